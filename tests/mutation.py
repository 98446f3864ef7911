"""Are the metrics under test? ``python -m tests.mutation [NAME ...] [--verbose] [--page docs/metrics/mutation.md]``

Walks METRICS. Of every metric two results are changed in turn: what its pure functions return and what the record of a
row says. Each is doubled, negated and made one larger (booleans: all true, all opposite, one place further), and the
tests of its module run until one turns red. A change that no test sees is printed as SURVIVED; the exit code is then 1.
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
import functools
import importlib
import inspect
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from _pytest.runner import runtestprotocol

from bench.metrics import METRICS

ROOT = Path(__file__).resolve().parents[1]
RECORD_TESTS = (
    "tests/suite/test_recorded_values.py",
    "tests/suite/test_scores.py",
    "tests/suite/test_track_scores.py",
    "tests/suite/test_gesture_scores.py",
    "tests/suite/test_runtime_scores.py",
)
RECORD = "bench.suite.scores.base:measure"

_FRECHET = ("frechet:frechet_distance.value",)
_KERNEL = ("kernel:kernel_distance",)
_CONTENT, _STYLE = "gesture:content_error_components", "gesture:style_error_components"
_RIGHT = ("recognition:correct", "recognition:percent.percent", "recognition:share_of_judges")
_DISPLACEMENT = "locality:joint_displacement"

FUNCTIONS: dict[str, tuple[str, ...]] = {
    "joint_recognition": ("recognition:joint_correct",),
    "joint_recognition_ratio": ("recognition:joint_correct",),
    "conditional_kid": ("kernel:conditional_kernel.value",),
    "conditional_fmd": ("frechet:conditional_frechet.value",),
    "copied_share": ("memorisation:copied", "memorisation:nearest_distance", "memorisation:copy_threshold"),
    "cra": _RIGHT,
    "cra_balanced": ("recognition:balanced_accuracy_percent",),
    "cra_top3": ("recognition:top_k_correct",),
    "sra": _RIGHT,
    "sra_balanced": ("recognition:balanced_accuracy_percent",),
    "sra_top3": ("recognition:top_k_correct",),
    "source_style_residue": ("recognition:kept_source_style",),
    "fmd[stgcn-content]": _FRECHET,
    "fmd[stgcn-style]": _FRECHET,
    "fmd[dae]": _FRECHET,
    "kid[stgcn-content]": _KERNEL,
    "kid[stgcn-style]": _KERNEL,
    "jerk_ratio": ("physics:jerk_per_sample", "physics:ratio_to_reference"),
    "jerk_ratio_worst_content": ("physics:ratio_per_content",),
    "time_correlation": ("physics:time_correlation",),
    "bone_drift": ("physics:bone_drift",),
    "foot_skate": ("contacts:foot_skate",),
    "skate[gmd]": ("contacts:skate_gmd",),
    "penetration": ("contacts:penetration",),
    "float_height": ("contacts:float_height",),
    "speed_ratio": ("physics:speed_per_sample", "physics:ratio_to_reference"),
    "joint_range": ("joint_range:JointRange.outside",),
    "contact_precision": ("contacts:contact_timing.precision",),
    "contact_recall": ("contacts:contact_timing.recall",),
    "root_path_error": ("physics:root_path_error",),
    "density[stgcn-content]": ("diversity:density",),
    "density[stgcn-style]": ("diversity:density",),
    "coverage[stgcn-content]": ("diversity:coverage",),
    "coverage[stgcn-style]": ("diversity:coverage",),
    "diversity": ("diversity:diversity",),
    "multimodality": ("diversity:multimodality",),
    "neighbour_ratio": ("memorisation:neighbour_ratio",),
    "fmd[stgcn]": _FRECHET,
    "fmd[dae-512]": _FRECHET,
    "fmd[dae-512-first]": _FRECHET,
    "fmd[dae-512-every]": _FRECHET,
    "reconstruction_position": ("paired:position_errors_cm",),
    "reconstruction_rotation": ("paired:rotation_errors_deg",),
    "join_jerk_ratio": ("physics:jerk_per_sample",),
    "path_drift": ("physics:path_drift",),
    "prefix_error": ("paired:position_errors_cm",),
    "paired_position": ("paired:paired_errors.position_cm",),
    "paired_rotation": ("paired:paired_errors.rotation_deg",),
    "paired_position_aligned": ("paired:paired_errors.aligned_position_cm",),
    "paired_rotation_aligned": ("paired:paired_errors.aligned_rotation_deg",),
    "locality_msd": (_DISPLACEMENT,),
    "locality_distance": (_DISPLACEMENT,),
    "joints_above_0.1": ("locality:joints_above",),
    "joints_above_0.05": ("locality:joints_above",),
    "leak_ratio": ("locality:leak_ratio", "paired:rotation_errors_deg"),
    "leak_ratio[position]": ("locality:leak_ratio", _DISPLACEMENT),
    "gesture_error": (_CONTENT, _STYLE),
    "gesture_error[truth]": (_CONTENT, _STYLE),
    "content_error": (_CONTENT, "gesture:summarise.mean"),
    "content_error_worst": (_CONTENT, "gesture:summarise.worst"),
    "content_error_worst_quarter": (_CONTENT, "gesture:summarise.worst_quarter"),
    "content_error[world]": (_CONTENT, "gesture:hand_trajectories"),
    "content_error[fastdtw]": (_CONTENT,),
    "style_error": (_STYLE, "gesture:summarise.mean"),
    "style_error_worst": (_STYLE, "gesture:summarise.worst"),
    "style_error_worst_quarter": (_STYLE, "gesture:summarise.worst_quarter"),
    "style_error[1.07s]": (_STYLE, "gesture:segment_frames"),
    "style_error[4.27s]": (_STYLE, "gesture:segment_frames"),
    "style_error[world]": (_STYLE, "gesture:hand_trajectories"),
    "monotonicity": ("interpolation:monotonicity", "interpolation:target_log_odds"),
    "evenness": ("interpolation:evenness",),
    "end_recognition": ("interpolation:ends_right", "interpolation:end_recognition_percent"),
    "middle_content": ("interpolation:middle_right", "interpolation:middle_content_percent"),
    "next_frame_error": ("prediction:next_frame_error",),
    "bone_length_loss": ("prediction:bone_length_loss_m",),
    "latency_p50": ("runtime:duration_statistics.p50_s",),
    "latency_p90": ("runtime:duration_statistics.p90_s",),
    "latency_p99": ("runtime:duration_statistics.p99_s",),
    "latency_max": ("runtime:duration_statistics.max_s",),
    "frames_per_second": ("runtime:frames_per_second",),
    "real_time_factor": ("runtime:real_time_factor",),
    "deadline_miss": ("runtime:deadline_miss_percent",),
    "startup_designed": ("runtime:startup_latency.designed_s",),
    "startup_measured": ("runtime:startup_latency.measured_s",),
    "load_time": (),
    "first_call": (),
    "parameters": (),
    "bytes_per_style": (),
    "peak_memory": (),
}
"""Metric -> the functions of bench.metrics that it is made of, ``module:function`` with the field of the result where
it has several. Metrics without any are measured or declared by the method: of them the record alone is changed."""

CHANGES: dict[str, Callable[[Any], Any]] = {
    "doubled": lambda value: 2 * value,
    "negated": lambda value: -value,
    "one more": lambda value: value + 1,
}
BOOLEAN_CHANGES: dict[str, Callable[[Any], Any]] = {
    "doubled": np.ones_like,
    "negated": np.logical_not,
    "one more": lambda value: np.roll(value, 1, axis=-1),
}


@dataclass(frozen=True)
class Mutant:
    """One change of one result. ``metric`` is empty for a function, which many metrics may share."""

    target: str
    change: str
    metric: str = ""

    @property
    def parts(self) -> tuple[str, list[str], str]:
        """Module, path of the function in it, field of its result or nothing."""
        module, _, names = self.target.partition(":")
        path = names.split(".")
        field = path.pop() if len(path) > 1 and not path[0][0].isupper() else ""
        return (module if "." in module else f"bench.metrics.{module}"), path, field

    @property
    def names(self) -> tuple[str, ...]:
        """What tests that see it are likely to mention."""
        return (self.metric,) if self.metric else (self.parts[1][-1],)

    @property
    def test_files(self) -> tuple[str, ...]:
        return RECORD_TESTS if self.metric else (f"tests/metrics/test_{self.parts[0].rpartition('.')[2]}.py",)


def mutants_of(metric: str) -> list[Mutant]:
    """All changes of a metric's functions and of its record."""
    functions = [Mutant(target, change) for target in FUNCTIONS[metric] for change in CHANGES]
    return [*functions, *(Mutant(RECORD, change, metric) for change in CHANGES)]


def changed(value: Any, change: str, field: str = "") -> Any:
    """A result, changed: a number, an array, a tuple of joints, a dict of numbers, or a field of a dataclass."""
    if field:
        return replace(value, **{field: changed(getattr(value, field), change)})
    if isinstance(value, dict):
        return {key: changed(item, change) for key, item in value.items()}
    if isinstance(value, tuple):
        return {"doubled": (*value, *value), "negated": (), "one more": tuple(item + 1 for item in value)}[change]
    if isinstance(value, np.ndarray) and value.dtype == np.bool_:
        return BOOLEAN_CHANGES[change](value)
    return CHANGES[change](value)


@contextmanager
def applied(mutant: Mutant) -> Iterator[None]:
    """Replace the function everywhere it was imported to, for a while."""
    module, path, field = mutant.parts
    owner = functools.reduce(getattr, path[:-1], importlib.import_module(module))
    original = getattr(owner, path[-1])

    @functools.wraps(original)
    def function(*args: Any, **named: Any) -> Any:
        return changed(original(*args, **named), mutant.change, field)

    @functools.wraps(original)
    def measure(name: str, slice_name: str, value: float, *args: Any, **named: Any) -> Any:
        return original(
            name, slice_name, changed(value, mutant.change) if name == mutant.metric else value, *args, **named
        )

    wrapped = measure if mutant.metric else function
    places = [owner, *(m for m in list(sys.modules.values()) if m is not owner and _has(m, path[-1], original))]
    for place in places:
        setattr(place, path[-1], wrapped)
    try:
        yield
    finally:
        for place in places:
            setattr(place, path[-1], original)


def _has(module: Any, name: str, function: Any) -> bool:
    return getattr(module, "__dict__", {}).get(name) is function


class Hunt:
    """A pytest plugin that runs the tests of each mutant until one is red, instead of all tests once."""

    def __init__(self, mutants: Sequence[Mutant]) -> None:
        self.mutants = list(dict.fromkeys(mutants))
        self.killers: dict[Mutant, str] = {}
        self.red_anyway: list[str] = []

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection(self) -> None:
        # Imported before pytest starts, its plugin could not be rewritten, which is a warning and so an error.
        from hypothesis import Phase, settings

        settings.register_profile(
            "mutation", settings.get_profile("stylebench"), phases=[Phase.explicit, Phase.generate], max_examples=10
        )
        settings.load_profile("mutation")

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        items = {item.nodeid: item for item in session.items}
        for mutant in self.mutants:
            with applied(mutant):
                self.killers[mutant] = next((i.nodeid for i in _likely_first(mutant, session.items) if _red(i)), "")
        self.red_anyway = [name for name in sorted(set(self.killers.values()) - {""}) if _red(items[name])]
        return True

    def pytest_report_teststatus(self) -> tuple[str, str, str]:
        return "", "", ""


def _likely_first(mutant: Mutant, items: Sequence[pytest.Item]) -> list[pytest.Item]:
    own = [item for item in items if item.nodeid.split("::")[0] in mutant.test_files]

    def unlikely(item: pytest.Item) -> tuple[bool, bool]:
        source = _source(getattr(item, "function", None))
        return (
            not any(name in item.name for name in mutant.names),
            not any(name in source for name in mutant.names),
        )

    return sorted(own, key=unlikely)


@functools.cache
def _source(function: Any) -> str:
    return inspect.getsource(inspect.unwrap(function)) if function else ""


def _red(item: pytest.Item) -> bool:
    return any(report.failed for report in runtestprotocol(item, log=False, nextitem=None))


def hunt(metrics: Sequence[str]) -> Hunt:
    """Try every mutant of some metrics.

    Raises
    ------
    RuntimeError : a test that should have seen a mutant is red without it, or tests could not be collected.
    """
    found = Hunt([mutant for metric in metrics for mutant in mutants_of(metric)])
    files = sorted({str(ROOT / file) for mutant in found.mutants for file in mutant.test_files})
    code = pytest.main(
        ["-q", "--no-header", "--no-summary", "-p", "no:cacheprovider", "-m", "not slow", *files], plugins=[found]
    )
    if found.red_anyway or set(found.killers) != set(found.mutants):
        raise RuntimeError(f"no clean run (exit code {code}): red without any change: {found.red_anyway}")
    return found


def page(names: Sequence[str], found: Hunt) -> str:
    """The result as Markdown."""
    survived = sum(not killer for killer in found.killers.values())
    lines = [
        "# Metrics under test: the mutation check",
        "",
        "Written by `python -m tests.mutation --page docs/metrics/mutation.md`; do not edit.",
        "",
        "Of every metric the results of its functions and the number in a row's record are changed in turn: doubled,",
        "negated, made one larger (booleans: all true, all opposite, one place further). Each change must turn a test",
        "red. The changes of what a method declares or a clock measures are those of the record alone.",
        "",
        f"{len(found.mutants)} changes of {len(names)} metrics, **{survived} that no test sees**. Functions shared by",
        "several metrics are counted with each.",
        "",
        "| metric | changes | seen | functions |",
        "|---|---|---|---|",
    ]
    for name in names:
        mutants = mutants_of(name)
        seen = sum(bool(found.killers[mutant]) for mutant in mutants)
        functions = ", ".join(f"`{target.replace(':', '.')}`" for target in FUNCTIONS[name])
        lines.append(f"| `{name}` | {len(mutants)} | {seen} | {functions} |")
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("metrics", nargs="*", metavar="NAME", help="rows of METRICS; default: all")
    parser.add_argument("--verbose", action="store_true", help="print the test that sees each change")
    parser.add_argument("--page", type=Path, help="also write the result as a page")
    arguments = parser.parse_args()
    names = arguments.metrics or list(METRICS)
    unknown = sorted(set(names) - set(METRICS))
    if unknown:
        parser.error(f"no such metric: {', '.join(unknown)}")
    found = hunt(names)
    for name in names:
        mutants = mutants_of(name)
        survivors = [mutant for mutant in mutants if not found.killers[mutant]]
        print(f"{name:32s} {len(mutants) - len(survivors):2d} of {len(mutants):2d} changes turn a test red")
        for mutant in mutants if arguments.verbose else survivors:
            print(f"    {mutant.target} {mutant.change}: {found.killers[mutant] or 'SURVIVED'}")
    if arguments.page:
        arguments.page.write_text(page(names, found), encoding="utf-8")
    survived = sum(not killer for killer in found.killers.values())
    print(f"{len(found.mutants)} changes of {len(names)} metrics, {survived} survived")
    return int(survived > 0)


if __name__ == "__main__":
    sys.exit(main())
