"""What is scored in each track: the tasks themselves, or what the track makes of them."""

from __future__ import annotations

from collections.abc import Sequence

from bench.datasets.pack import Pack
from bench.datasets.take import Take
from bench.motion.edit import crop
from bench.protocols.base import Protocol, Task
from bench.suite.motions import Motions
from bench.suite.scores.conditions import segments_of
from bench.suite.scores.interpolation import groups_of


def samples_of(protocol: Protocol, tasks: Sequence[Task], pack: Pack) -> tuple[Task, ...]:
    """One task a sample: a group of the interpolation track, a segment of a long sequence, else the task."""
    if protocol.track == "interpolation":
        return tuple(groups_of(tasks))
    if are_cut(tasks):
        lengths = [pack.rows[task.content_take_id]["n_frames"] for task in tasks]
        return tuple(s for task, n in zip(tasks, lengths, strict=True) for s in segments_of(task, n))
    return tuple(tasks)


def are_cut(tasks: Sequence[Task]) -> bool:
    """Whether answers are long sequences, of which segments are judged."""
    return any(task.segments for task in tasks)


def cut_motions(motions: Motions, tasks: Sequence[Task], samples: Sequence[Task]) -> Motions:
    """The windows that are judged; long sequences are cut into their segments, everything else stays as it is.

    A segment has its piece's content; its style is the sequence's.
    """
    if not are_cut(tasks):
        return motions
    place = {task.content_take_id: index for index, task in enumerate(tasks)}
    return Motions.of(
        [
            Take(
                crop(motions.clip(index), sample.start_frame, sample.n_frames),
                content=sample.content,
                style=str(motions.styles[index]),
            )
            for sample, index in ((sample, place[sample.content_take_id]) for sample in samples)
        ]
    )
