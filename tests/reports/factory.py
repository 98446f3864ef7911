"""Synthetic records and samples files of plausible methods, for tests of everything that reads records."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from reports.bootstrap import cluster_counts, interval, mean_replicates
from reports.records import (
    JudgeFacts,
    Measurement,
    MethodFacts,
    Provenance,
    Record,
    Status,
    digest_of,
    digest_of_arrays,
    samples_path,
    write_bytes_atomically,
    write_record,
)

SLICES = ("different_content", "same_content", "all")
N_JUDGES = 3
LEFT_OUT = "left out for fewer than 20 real windows: proud"


@dataclass(frozen=True)
class FakeMethod:
    """What a synthetic row should look like; shares are percent on different-content pairs."""

    name: str
    title: str
    kind: Literal["anchor", "method"] = "method"
    content_right: float = 60.0
    style_right: float = 60.0
    joint: float = 40.0
    conditional_kid: float = 0.4
    copied_share: float = 5.0
    jerk_ratio: float = 1.05
    description: str = ""
    draws_from: str = ""
    parameters: int | None = None
    needs_style_label: bool = False
    uses_judge: bool = False
    trained_on: str = ""
    status: Status = "ok"
    reason: str = ""


def _anchor(name: str, title: str, numbers: tuple[float, ...], description: str, draws_from: str = "") -> FakeMethod:
    content, style, joint, kid, copied, jerk = numbers
    return FakeMethod(
        name, title, "anchor", content, style, joint, kid, copied, jerk, description=description, draws_from=draws_from
    )


ANCHORS = (
    _anchor("real-test", "real test", (96.9, 99.1, 96.2, 0.012, 8.1, 1.0), "real takes under their own labels", "test"),
    _anchor(
        "real-disjoint", "real disjoint", (96.1, 98.7, 95.0, 0.010, 9.3, 1.01), "other real takes, own labels", "fit"
    ),
    _anchor(
        "label-oracle", "label oracle", (96.5, 98.9, 95.6, 0.011, 95.2, 1.0), "a real clip with both labels", "fit"
    ),
    _anchor("copy-content", "copy content", (97.1, 1.2, 0.9, 4.0, 99.0, 1.0), "returns the source", "test"),
    _anchor("copy-style", "copy style", (1.5, 99.2, 1.1, 2.9, 99.0, 1.0), "returns the style reference", "test"),
    _anchor("coin-flip", "coin flip", (49.6, 50.2, 1.0, 2.24, 99.0, 1.0), "one of the two, at random", "test"),
    _anchor("concatenated-halves", "concatenated halves", (51.3, 28.5, 10.5, 1.8, 60.1, 1.3), "half of each", "test"),
    _anchor("mean-pose", "mean pose", (7.9, 15.0, 1.0, 7.1, 0.0, 0.0), "the mean pose, held", "fit"),
    _anchor("frozen-frame", "frozen frame", (73.3, 2.0, 0.8, 5.5, 0.0, 0.0), "the first source frame, held", "test"),
    _anchor("noise-0.03", "noise 0.03 rad", (95.5, 1.0, 0.5, 4.1, 98.0, 34.0), "source with noise", "test"),
    _anchor("noise-0.1", "noise 0.1 rad", (58.9, 7.0, 0.6, 5.0, 80.0, 110.0), "source with noise", "test"),
    _anchor("noise-0.3", "noise 0.3 rad", (13.7, 13.0, 0.2, 9.0, 0.0, 330.0), "source with noise", "test"),
    _anchor("style-mean-shift", "style mean-shift", (69.1, 62.5, 42.3, 2.1, 12.0, 1.03), "mean pose offset", "fit"),
    _anchor("pose-adain", "pose AdaIN", (12.6, 91.8, 12.4, 3.0, 11.0, 1.06), "AdaIN on poses", "test"),
    _anchor(
        "nearest-fit", "nearest fit window", (55.6, 97.9, 54.7, 0.8, 97.0, 1.0), "retrieval by pose distance", "fit"
    ),
    _anchor("retrieve", "classify-and-retrieve", (93.0, 97.0, 90.8, 0.05, 97.0, 1.0), "retrieval by label", "fit"),
)

METHODS = (
    FakeMethod("park2021", "Park 2021", "method", 78.4, 80.3, 66.0, 0.52, 9.0, 1.10, parameters=4_300_000,
               needs_style_label=True, trained_on="fit part, budget small, seed 0"),
    FakeMethod("style_erd", "Style-ERD", "method", 81.0, 77.9, 65.2, 0.61, 7.0, 1.31, parameters=7_900_000,
               needs_style_label=True, uses_judge=True, trained_on="fit part, budget small, seed 0"),
    FakeMethod("motion_puzzle", "Motion Puzzle", "method", 70.2, 66.1, 49.5, 0.95, 6.0, 0.92, parameters=5_100_000,
               trained_on="fit part, budget small, seed 0"),
    FakeMethod("mason2022", "Mason 2022", "method", 61.9, 49.2, 33.3, 1.40, 4.0, 0.81, parameters=12_000_000,
               trained_on="fit part, budget small, seed 0"),
    FakeMethod("cheater", "Cheater", "method", 95.0, 96.0, 91.0, 0.06, 93.0, 1.0, trained_on="fit part"),
    FakeMethod("broken", "Broken | [net]_1", "method", status="timeout", reason="no answer within 60 s for task 17"),
)  # fmt: skip


@dataclass(frozen=True)
class FakeTasks:
    """The samples all methods of a synthetic protocol share."""

    n: int = 400
    n_clusters: int = 60
    n_replicates: int = 200
    seed: int = 7
    cluster: NDArray[np.str_] = field(init=False)
    different: NDArray[np.bool_] = field(init=False)
    counts: NDArray[np.int32] = field(init=False)

    def __post_init__(self) -> None:
        rng = np.random.default_rng(self.seed)
        index = rng.permutation(np.arange(self.n) % self.n_clusters)
        object.__setattr__(self, "cluster", np.array([f"take{number:04d}" for number in index]))
        object.__setattr__(self, "different", np.arange(self.n) % 10 < 8)
        object.__setattr__(self, "counts", cluster_counts(self.cluster, self.n_replicates, seed=self.seed))

    def inside(self, slice_name: str) -> NDArray[np.bool_]:
        """Mask of a slice."""
        masks = {"different_content": self.different, "same_content": ~self.different}
        return masks.get(slice_name, np.ones(self.n, dtype=np.bool_))


def clustered_hits(
    cluster: NDArray[Any],
    share: float,
    rng: np.random.Generator,
    *,
    spread: float = 0.8,
    difficulty: NDArray[np.float64] | None = None,
) -> NDArray[np.bool_]:
    """Hits ``[n]`` with the expected ``share`` (0..1), correlated within clusters by normal offsets of sd ``spread``.

    ``difficulty`` ``[number of clusters]`` (standard normal) shares the offsets between methods.
    """
    names, index = np.unique(cluster, return_inverse=True)
    offsets = rng.standard_normal(len(names)) if difficulty is None else difficulty
    # A probit of a normal threshold plus a normal offset keeps the mean at `share` exactly.
    threshold = norm.ppf(np.clip(share, 1e-6, 1 - 1e-6)) * np.sqrt(1.0 + spread**2)
    return np.asarray(rng.standard_normal(len(cluster)) < threshold + spread * offsets[index])


def joint_recognition_arrays(
    tasks: FakeTasks, share: float, rng: np.random.Generator, difficulty: NDArray[np.float64] | None = None
) -> dict[str, NDArray[Any]]:
    """The samples arrays of a row of which only joint recognition (percent expected: ``share``) matters."""
    per_judge = [clustered_hits(tasks.cluster, share / 100.0, rng, difficulty=difficulty)]
    # Judges agree on 97 % of the samples; where they do not, the others guess with the method's share.
    for _ in range(1, N_JUDGES):
        guess = rng.random(tasks.n) < share / 100.0
        per_judge.append(np.where(rng.random(tasks.n) < 0.97, per_judge[0], guess))
    arrays: dict[str, NDArray[Any]] = {
        "sample_id": np.arange(tasks.n, dtype=np.int32),
        "cluster": tasks.cluster,
        **{f"slice/{name}": tasks.inside(name) for name in SLICES},
        "per_sample/joint_recognition": (100.0 * np.mean(per_judge, axis=0)).astype(np.float32),
    }
    for number, hits in enumerate(per_judge):
        arrays[f"judge/stgcn-joint/{number}"] = hits.astype(np.int8)
    for name in SLICES:
        arrays[f"replicates/joint_recognition|{name}"] = sliced_replicates(
            arrays["per_sample/joint_recognition"], tasks, name
        )
    return arrays


def sliced_replicates(values: NDArray[Any], tasks: FakeTasks, slice_name: str) -> NDArray[np.float64]:
    """Replicates of the mean of ``values`` over a slice, in the unit of ``values``."""
    return mean_replicates(np.where(tasks.inside(slice_name), values, np.nan), tasks.counts)


def _joint_measurement(arrays: dict[str, NDArray[Any]], tasks: FakeTasks, slice_name: str) -> Measurement:
    inside = tasks.inside(slice_name)
    value = float(arrays["per_sample/joint_recognition"][inside].mean(dtype=np.float64))
    low, high = interval(value, arrays[f"replicates/joint_recognition|{slice_name}"])
    judges = tuple(float(100.0 * arrays[f"judge/stgcn-joint/{j}"][inside].mean()) for j in range(N_JUDGES))
    return Measurement(
        name="joint_recognition", version=1, slice=slice_name, value=value, unit="%", better="higher",
        n=int(inside.sum()), low=low, high=high, judge_values=judges, floor=None, details={"chance": 1.8},
    )  # fmt: skip


def _plain(
    name: str,
    value: float | None,
    unit: str,
    better: Literal["higher", "lower", "one", "none"],
    tasks: FakeTasks,
    *,
    slice_name: str = "different_content",
    floor: float | None = None,
    reason: str | None = None,
    details: dict[str, float] | None = None,
) -> Measurement:
    spread = 0.0 if value is None else 0.04 * abs(value) + 0.001
    return Measurement(
        name=name, version=1, slice=slice_name, value=value, unit=unit, better=better,
        n=int(tasks.inside(slice_name).sum()), low=None if value is None else value - spread,
        high=None if value is None else value + spread, floor=floor, reason=reason, details=details or {},
    )  # fmt: skip


def _further_measurements(fake: FakeMethod, joint: float, tasks: FakeTasks) -> tuple[Measurement, ...]:
    kid = fake.conditional_kid
    still = fake.jerk_ratio == 0.0
    own_labels = fake.name.startswith(("real-", "label-oracle"))
    residue = None if own_labels else 0.8 * (100.0 - fake.style_right)
    by_content = {"chance": 100.0 / 7.0, "majority_rate": 24.0}
    by_style = {"chance": 100.0 / 7.0, "majority_rate": 19.5}
    return (
        _plain("joint_recognition_ratio", joint / 95.0, "1", "higher", tasks, details={"real_disjoint_percent": 95.0}),
        _plain("conditional_kid", kid, "distance", "lower", tasks, floor=0.011, reason=LEFT_OUT),
        _plain("conditional_fmd", 12.0 * kid, "distance", "lower", tasks, floor=0.14),
        _plain("copied_share", fake.copied_share, "%", "lower", tasks, slice_name="all"),
        _plain("cra", fake.content_right, "%", "higher", tasks, details=by_content),
        _plain("cra_balanced", 0.97 * fake.content_right, "%", "higher", tasks),
        _plain("sra", fake.style_right, "%", "higher", tasks, details=by_style),
        _plain("sra_balanced", 0.98 * fake.style_right, "%", "higher", tasks),
        _plain("source_style_residue", residue, "%", "lower", tasks,
               reason="scored under its source's own style: nothing was to be removed" if own_labels else None),
        _plain("fmd[stgcn-content]", 1.0 + 3.0 * kid, "distance", "lower", tasks, slice_name="all", floor=0.11),
        _plain("fmd[stgcn-style]", 1.5 + 2.0 * kid, "distance", "lower", tasks, slice_name="all", floor=0.08),
        _plain("fmd[dae]", 0.002 + 0.01 * kid, "distance", "lower", tasks, slice_name="all", floor=0.0003),
        _plain("kid[stgcn-content]", 0.1 * kid, "distance", "lower", tasks, slice_name="all", floor=0.001),
        _plain("kid[stgcn-style]", 0.12 * kid, "distance", "lower", tasks, slice_name="all", floor=0.001),
        _plain("jerk_ratio", fake.jerk_ratio, "1", "one", tasks, slice_name="all"),
        _plain("jerk_ratio_worst_content", 1.2 * fake.jerk_ratio, "1", "one", tasks, slice_name="all"),
        _plain("time_correlation", None if still else 0.7, "1", "none", tasks, slice_name="all",
               reason="output does not move" if still else None),
        _plain("bone_drift", 0.0, "%", "lower", tasks, slice_name="all"),
    )  # fmt: skip


def _classifier(target: str, seed: int, majority_rate: float) -> JudgeFacts:
    return JudgeFacts(
        id=f"stgcn-{target}/{seed}",
        digest=digest_of(["judge", target, seed]),
        origin="canonical",
        real_accuracy=97.0 + 0.4 * seed,
        chance=100.0 / 7.0,
        majority_rate=majority_rate,
    )


JUDGES = (
    *(_classifier("content", seed, 24.0) for seed in range(N_JUDGES)),
    *(_classifier("style", seed, 19.5) for seed in range(N_JUDGES)),
    *(
        JudgeFacts(id=f"autoencoder/{seed}", digest=digest_of(["judge", "autoencoder", seed]), origin="canonical")
        for seed in range(N_JUDGES)
    ),
)

PROVENANCE = Provenance(
    commit="0123456789abcdef0123456789abcdef01234567", dirty=False, packages={"numpy": "2.4.0", "torch": "2.13.0"},
    python="3.11.9", cpu="Some CPU", gpu="", threads=1, time_utc="2026-01-02T03:04:05Z", wall_s=12.3,
    peak_rss_mb=640.0, command="stylebench run --data bandai-namco=PATH --profile standard",
)  # fmt: skip


def make_row(
    fake: FakeMethod,
    tasks: FakeTasks,
    *,
    seed: int = 0,
    trial: int = 0,
    dataset: str = "bandai-namco@1",
    profile: str = "standard",
) -> tuple[Record, dict[str, NDArray[Any]]]:
    """One record and its samples arrays (empty for a cell that did not finish)."""
    facts = MethodFacts(
        name=fake.name, title=fake.title, kind=fake.kind, description=fake.description, digest=digest_of(fake.name),
        parameters=fake.parameters, needs_style_label=fake.needs_style_label, uses_judge=fake.uses_judge,
        trained_on=fake.trained_on, draws_from=fake.draws_from,
    )  # fmt: skip
    arrays: dict[str, NDArray[Any]] = {}
    measurements: tuple[Measurement, ...] = ()
    if fake.status == "ok":
        words = int(digest_of([fake.name, seed, trial, dataset])[:8], 16)
        arrays = joint_recognition_arrays(tasks, fake.joint, np.random.default_rng(words))
        joint = [_joint_measurement(arrays, tasks, name) for name in SLICES]
        measurements = (*joint, *_further_measurements(fake, joint[0].value or 0.0, tasks))
    record = Record(
        key=digest_of(["key", facts.row_name, seed, trial, dataset, profile]), method=facts,
        protocol="stylebench-transfer", protocol_version=1, dataset=dataset, dataset_digest=digest_of(dataset),
        split="default", split_seed=0, track="transfer", profile=profile, seed=seed, trial=trial, status=fake.status,
        reason=fake.reason, log="" if fake.status == "ok" else f"logs/{fake.name}.log",
        copies=fake.status == "ok" and fake.copied_share > 50.0, measurements=measurements,
        judges=JUDGES if fake.status == "ok" else (),
        protocol_facts={"windows": "64 frames at 30 fps", "licence": "CC BY-NC 4.0", "citation": "Kobayashi 2023"},
        motions_digest=digest_of(["motions", fake.name]) if fake.status == "ok" else "",
        samples_digest=digest_of_arrays(arrays) if arrays else "", provenance=PROVENANCE,
    )  # fmt: skip
    return record, arrays


def write_row(folder: Path, record: Record, arrays: dict[str, NDArray[Any]]) -> Path:
    """Store a record and its samples file in ``folder``; returns the record's path."""
    path = folder / f"{record.method.name}-{record.seed}-{record.trial}-{record.key[:8]}.json"
    write_record(path, record)
    if arrays:
        buffer = io.BytesIO()
        np.savez_compressed(buffer, allow_pickle=False, **arrays)
        write_bytes_atomically(samples_path(path), buffer.getvalue())
    return path


def write_run(
    folder: Path,
    fakes: Sequence[FakeMethod] = (*ANCHORS, *METHODS),
    tasks: FakeTasks | None = None,
    *,
    seeds: Sequence[int] = (0,),
    dataset: str = "bandai-namco@1",
    profile: str = "standard",
) -> Path:
    """A folder of records and samples files of all ``fakes``; returns it."""
    shared = tasks or FakeTasks()
    for fake in fakes:
        for seed in seeds:
            write_row(folder, *make_row(fake, shared, seed=seed, dataset=dataset, profile=profile))
    return folder
