"""Conformance of an adapter: rows of a table that say what was expected, what came, the likely cause and the remedy.

:func:`check_adapter` runs in this process and yields rows as they come; ``check_run`` does the same in a process of
its own, so that an adapter that hangs or dies costs a row and nothing else.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from bench.adapters.answers import CheckRow, check_answer
from bench.adapters.base import CAPABILITIES, Adapter, Description, ProgressCallback
from bench.adapters.external import External
from bench.adapters.session import OutOfTime
from bench.arrays import FloatArray
from bench.datasets.take import Take
from bench.errors import BenchError
from bench.motion.clip import Clip
from bench.motion.edit import crop, window

WINDOW_FRAMES = 64
PAST_FRAMES = 30
SAMPLES = 4
SAME_TOLERANCE = 1e-5
"""Radians and metres within which two answers are the same."""
STREAM_TOLERANCE = 1e-3
GROWTH_CALLS, WARM_UP_CALLS, GROWTH_SECONDS = 200, 20, 120.0
GROWTH_MB_A_CALL = 0.1
SEED = 20250101
CANCELLED_PAIRS = 20
CANCELLED_AFTER_S = (0.0, 0.5)
"""Told to stop at once, mostly before it has begun, and in the middle of the work."""


@dataclass(frozen=True, eq=False)
class Example:
    """One task of the check: a source window, a style reference, the style's label.

    ``source_style_label`` is for the source where it is one of the styles of a mixture.
    """

    content: Take
    style: Take
    style_label: str
    content_label: str | None
    source_style_label: str | None
    seed: int

    @property
    def rng(self) -> np.random.Generator:
        return np.random.default_rng(self.seed)


Call = Callable[[Adapter, Example], Clip]

CLIP_CALLS: dict[str, Call] = {
    "transfers": lambda method, e: method.transfer(e.content, e.style, rng=e.rng),
    "samples": lambda method, e: method.sample(e.content, e.style_label, rng=e.rng),
    "interpolates": lambda method, e: method.interpolate(e.content, _half(e), rng=e.rng),
    "interpolates parts": lambda method, e: method.interpolate_parts(e.content, "arms", _half(e), rng=e.rng),
    "transfers parts": lambda method, e: method.transfer_parts(e.content, {"arms": e.style}, rng=e.rng),
}
"""Capability -> a call whose answer has the content's frames and bones."""


def check_adapter(
    adapter: type[Adapter], takes: Sequence[Take], *, progress: ProgressCallback | None = None
) -> Iterator[CheckRow]:
    """Every check that applies to an adapter, one after the other.

    Parameters
    ----------
    adapter : the class; it is instantiated several times.
    takes : labelled takes with at least two contents and styles, for example those of the procedural dataset.
    progress : told about training.
    """
    method = yield from _loaded(adapter)
    if method is None:
        return
    examples = make_examples(adapter, takes)
    if adapter.fits():
        restored = yield from _fitted(adapter, method, fit_takes(takes), examples[0], progress)
        if not restored:
            return
    answers = yield from _answered(method, examples)
    if not answers:
        return
    capability, clips = next(iter(answers.items()))
    call = CLIP_CALLS[capability]
    every_answer = [clip for group in answers.values() for clip in group]
    yield from _properties(every_answer, examples * len(answers))
    if not all(isinstance(answer, Clip) for answer in every_answer):
        return
    deterministic = _same_answer(
        "deterministic under seed",
        lambda: [call(method, examples[0])],
        clips[:1],
        "the same seed gives the same answer",
        "randomness that does not come from rng, or state kept between calls",
        "draw from rng only; outside programs: from generators seeded with seed",
    )
    yield deterministic
    if deterministic.ok:
        yield _same_answer(
            "independent of task order",
            lambda: [call(method, example) for example in reversed(examples)][::-1],
            clips,
            "answers do not depend on what was asked before",
            "state kept between calls: running statistics, caches, dropout left on",
            "call eval() on networks; keep nothing between calls",
        )
        yield _batch_row(method, examples, answers)
    yield _stream_row(method, examples[0], answers)
    yield _growth_row(method, call, examples[0])
    yield _cancel_row(method, examples[0])
    if isinstance(method, External):
        method.close()


def make_examples(adapter: type[Adapter], takes: Sequence[Take]) -> list[Example]:
    """A few tasks with the labels that the adapter declared to need, and no others."""
    traits = adapter.traits
    frames = traits.designed_input_frames if traits.only_designed_input else None
    long_enough = [take for take in takes if take.clip.n_frames >= WINDOW_FRAMES]
    order = np.random.default_rng(SEED).permutation(len(long_enough))
    chosen = [long_enough[i] for i in order]
    examples = []
    for number, content in enumerate(chosen[:SAMPLES]):
        style = next((take for take in chosen if take.style != content.style and take is not content), content)
        source = content.with_clip(window(content.clip, 0, frames or WINDOW_FRAMES))
        examples.append(
            Example(
                source.hidden(content=traits.needs_content_label, style=traits.needs_source_style_label),
                style.hidden(content=False, style=traits.needs_style_label),
                str(style.style),
                content.content if traits.needs_content_label else None,
                content.style if traits.needs_style_label else None,
                SEED + number,
            )
        )
    return examples


def fit_takes(takes: Sequence[Take]) -> list[Take]:
    """The first take of every content in every style, as ``fit`` gets them."""
    first: dict[tuple[str | None, str | None], Take] = {}
    for take in takes:
        first.setdefault((take.content, take.style), take.hidden(content=True, style=True))
    return list(first.values())


def _half(example: Example) -> list[tuple[Take, float]]:
    return [(Take(example.content.clip, style=example.source_style_label), 0.5), (example.style, 0.5)]


def _failed(name: str, expected: str, error: Exception, remedy: str = "") -> CheckRow:
    if isinstance(error, BenchError):
        where = f"{error.where}: " if error.where else ""
        return CheckRow(name, False, expected, f"{where}{error.problem}", error.cause, error.remedy or remedy)
    return CheckRow(name, False, expected, f"{type(error).__name__}: {error}", remedy=remedy)


def _loaded(adapter: type[Adapter]) -> Generator[CheckRow, None, Adapter | None]:
    expected = "a name, one capability, and a constructor without arguments"
    can = adapter.capabilities()
    if not adapter.name:
        remedy = 'write name = "mine" into the class'
        yield CheckRow("loads", False, expected, "no name", "the class attribute is missing", remedy)
        return None
    if not any(name in CLIP_CALLS or name in ("predicts", "streams") for name in can):
        remedy = "override transfer() or another call"
        yield CheckRow("loads", False, expected, f"capabilities: {', '.join(can) or 'none'}", "", remedy)
        return None
    try:
        method = adapter()
        if isinstance(method, External):
            method.session()
    except Exception as error:
        yield _failed("loads", expected, error, "the constructor must need no arguments")
        return None
    yield CheckRow("loads", True, expected, f"{adapter.name}: {', '.join(can)}")
    return method


def _fitted(
    adapter: type[Adapter],
    method: Adapter,
    takes: list[Take],
    example: Example,
    progress: ProgressCallback | None,
) -> Generator[CheckRow, None, bool]:
    """Rows of training and of the round trip through files; whether what follows makes sense."""
    expected = "fit, save into an empty folder, load in another instance"
    with tempfile.TemporaryDirectory(prefix="stylebench-check-") as name:
        try:
            method.fit(takes, seed=0, budget="smoke", progress=progress or (lambda what, done, total: None))
            method.save(Path(name))
            restored = adapter()
            restored.load(Path(name))
            if isinstance(restored, External):
                restored.session()
        except Exception as error:
            yield _failed("save and load", expected, error, "override save() and load() where fit() is overridden")
            return False
        call = next((CLIP_CALLS[c] for c in adapter.capabilities() if c in CLIP_CALLS), None)
        row = CheckRow("save and load", True, expected, "fitted, saved, loaded")
        if call is not None:
            try:
                before = call(method, example)
            except Exception as error:
                yield _failed("save and load", "an answer after fit()", error)
                return False
            row = _same_answer(
                "save and load",
                lambda: [call(restored, example)],
                [before],
                "the same answer before save() and after load()",
                "something that fit() learned is not stored",
                "store normalisation statistics and label lists beside the weights",
            )
        if isinstance(restored, External):
            restored.close()
        yield row
    return True


def _answered(method: Adapter, examples: Sequence[Example]) -> Generator[CheckRow, None, dict[str, list[Clip]]]:
    """One row for each declared capability; the answers that are clips of the content's length."""
    answers: dict[str, list[Clip]] = {}
    for capability in method.capabilities():
        name = f"answers {CAPABILITIES[capability]}()"
        try:
            if capability in CLIP_CALLS:
                answers[capability] = [CLIP_CALLS[capability](method, example) for example in examples]
            elif capability == "predicts":
                _predict(method, examples[0])
            elif capability == "streams":
                _stream(method, examples[0], 8)
            elif capability == "describes" and not isinstance(method.describe(), Description):
                raise TypeError("describe() must return a bench.adapters.base.Description")
        except Exception as error:
            answers.pop(capability, None)
            yield _failed(name, "an answer", error)
        else:
            yield CheckRow(name, True, "an answer", "answered")
    return answers


def _predict(method: Adapter, example: Example) -> None:
    clip = example.content.clip
    past, path = crop(clip, 0, PAST_FRAMES), clip.root_xyz_m[PAST_FRAMES : 2 * PAST_FRAMES, [0, 2]]
    frame = method.predict(past, example.style, path)
    for row in check_answer(frame, crop(clip, PAST_FRAMES, 1)):
        if row.ok is False and row.name != "bone lengths":
            raise BenchError(f"{row.name}: expected {row.expected}, got {row.got}", cause=row.cause, remedy=row.remedy)


def _stream(method: Adapter, example: Example, n_frames: int) -> tuple[FloatArray, FloatArray]:
    stream = method.open_stream(example.style, content_label=example.content_label, rng=example.rng)
    clip = example.content.clip
    frames = [stream.step(clip.rotations_wxyz[t], clip.root_xyz_m[t]) for t in range(n_frames)]
    answer = clip.with_motion(*(np.stack(arrays) for arrays in zip(*frames, strict=True)))
    return answer.rotations_wxyz, answer.root_xyz_m


def _properties(answers: Sequence[object], examples: Sequence[Example]) -> Iterator[CheckRow]:
    """The properties of all answers; of each the first that does not hold."""
    found: dict[str, CheckRow] = {}
    for answer, example in zip(answers, examples, strict=True):
        for row in check_answer(answer, example.content.clip):
            if row.name not in found or (found[row.name].ok and not row.ok):
                found[row.name] = row
    yield from found.values()
    if all(isinstance(answer, Clip) for answer in answers):
        # A Clip cannot hold anything else; what tried to is an error of the call above.
        yield CheckRow("finite", True, "no NaN, no Inf", "none")


def _same_answer(
    name: str, again: Callable[[], list[Clip]], first: Sequence[Clip], expected: str, cause: str, remedy: str
) -> CheckRow:
    try:
        second = again()
    except Exception as error:
        return _failed(name, expected, error)
    for one, other in zip(first, second, strict=True):
        if one.rotations_wxyz.shape != other.rotations_wxyz.shape:
            return CheckRow(name, False, expected, "another number of frames", cause, remedy)
    difference = max(_difference(one, other) for one, other in zip(first, second, strict=True))
    same = difference <= SAME_TOLERANCE
    return CheckRow(name, same, expected, "the same" if same else f"differs by {difference:.2g}", cause, remedy)


def _difference(one: Clip, other: Clip) -> float:
    """The larger of root distance (metres) and rotation difference; q and -q are the same rotation."""
    return _arrays_difference(one.rotations_wxyz, one.root_xyz_m, other.rotations_wxyz, other.root_xyz_m)


def _arrays_difference(turns: FloatArray, root: FloatArray, other_turns: FloatArray, other_root: FloatArray) -> float:
    signs = np.where((turns * other_turns).sum(axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
    return max(float(np.abs(turns - signs * other_turns).max()), float(np.abs(root - other_root).max()))


def _batch_row(method: Adapter, examples: list[Example], answers: dict[str, list[Clip]]) -> CheckRow:
    name, expected = "independent of batch", "answers do not depend on what is asked together"
    together = getattr(method, "transfer_batch", None)
    if together is None or "transfers" not in answers:
        return CheckRow(name, None, expected, "no transfer_batch()")
    pairs = [(example.content, example.style) for example in examples]
    return _same_answer(
        name,
        lambda: together(pairs, rngs=[example.rng for example in examples]),
        answers["transfers"],
        expected,
        "normalisation over the batch, padding to the longest, or one seed for all",
        "call eval() on networks and seed each task by itself",
    )


def _stream_row(method: Adapter, example: Example, answers: dict[str, list[Clip]]) -> CheckRow:
    name, expected = "streaming equals offline", "the same frames from step() and from transfer()"
    if "streams" not in method.capabilities() or method.traits.look_ahead_frames != 0 or "transfers" not in answers:
        return CheckRow(name, None, expected, "not promised: no stream, or look_ahead_frames is not 0")
    offline = answers["transfers"][0]
    try:
        turns, root = _stream(method, example, example.content.clip.n_frames)
    except Exception as error:
        return _failed(name, expected, error)
    difference = _arrays_difference(turns, root, offline.rotations_wxyz, offline.root_xyz_m)
    return CheckRow(
        name,
        difference <= STREAM_TOLERANCE,
        expected,
        f"differs by {difference:.2g}",
        "offline sees the future: normalisation over the clip, centred filters, bidirectional layers",
        "declare look_ahead_frames, or make transfer() causal",
    )


def _growth_row(method: Adapter, call: Call, example: Example) -> CheckRow:
    name = "memory growth"
    expected = f"less than {GROWTH_MB_A_CALL:g} MB a call over {GROWTH_CALLS} calls"
    deadline = time.monotonic() + GROWTH_SECONDS
    calls, before = 0, 0.0
    try:
        while calls < GROWTH_CALLS and time.monotonic() < deadline:
            call(method, example)
            calls += 1
            if calls == WARM_UP_CALLS:
                before = tree_rss_mb()
    except Exception as error:
        return _failed(name, expected, error)
    if calls <= 2 * WARM_UP_CALLS:
        return CheckRow(name, None, expected, f"only {calls} calls in {GROWTH_SECONDS:.0f} s, too few to tell")
    growth = (tree_rss_mb() - before) / (calls - WARM_UP_CALLS)
    return CheckRow(
        name,
        growth < GROWTH_MB_A_CALL,
        expected,
        f"{growth:.2f} MB a call over {calls} calls",
        "answers or graphs kept in a list, gradients on",
        "use torch.no_grad() and keep nothing between calls",
    )


def tree_rss_mb() -> float:
    """Resident memory of this process and all that descend from it, MB."""
    own = psutil.Process()
    total = 0.0
    for process in (own, *own.children(recursive=True)):
        try:
            total += process.memory_info().rss / 2**20
        except psutil.Error:
            continue
    return total


def _cancel_row(method: Adapter, example: Example) -> CheckRow:
    name, expected = "honours cancellation", "stops in time when told to, and answers on"
    if not isinstance(method, External) or "transfers" not in method.capabilities():
        return CheckRow(name, None, expected, "not an outside program")
    limit = method.program.timeouts.stop_s
    seconds = 0.0
    for timeout_s in CANCELLED_AFTER_S:
        started = time.monotonic()
        try:
            pairs = [(example.content, example.style)] * CANCELLED_PAIRS
            method.transfer_batch(pairs, rngs=[example.rng] * CANCELLED_PAIRS, timeout_s=timeout_s)
        except OutOfTime as error:
            if not method.is_running:
                return _failed(name, expected, error, "let KeyboardInterrupt and worker.Cancelled pass")
        except Exception as error:
            return _failed(name, expected, error)
        seconds = max(seconds, time.monotonic() - started - timeout_s)
    try:
        method.transfer(example.content, example.style, rng=example.rng)
    except Exception as error:
        return _failed(name, "answers on after a cancellation", error)
    return CheckRow(name, seconds <= limit + 1.0, expected, f"stopped after {seconds:.2f} s")
