"""For maintainers: train canonical judges and store them in this package.

``python -m bench.suite.make_judges NAME [--data PATH]`` replaces the dataset's folder under ``classifiers/pretrained``;
``--again CONDITION`` trains one judge once more, for example on another processor, and notes on the card by how much
the result differs; ``--second`` trains the second family alone.
"""

from __future__ import annotations

import argparse
import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from bench.datasets import procedural
from bench.datasets.base import Dataset, ProgressCallback
from bench.datasets.split import deal
from bench.datasets.table import load_dataset
from bench.datasets.take import Take
from bench.errors import JudgeRefused
from bench.suite.judge_card import to_markdown
from bench.suite.judge_training import measure_split, train_again
from bench.suite.judges import (
    CANONICAL_RECIPE,
    PRETRAINED,
    SEEDS,
    JudgeSet,
    load_canonical,
    read_card,
    save_judges,
    train_judges,
)
from bench.suite.second_judges import SecondJudges, save_second_judges, train_second_judges

_log = logging.getLogger(__name__)


def make_canonical(dataset: Dataset, unseen: Sequence[Take] = (), progress: ProgressCallback | None = None) -> JudgeSet:
    """Train a dataset's canonical judges, with everything its card wants to know, and store them in this package.

    Raises
    ------
    JudgeRefused : a judge is below its gate; nothing is stored.
    """
    split = deal(dataset.takes)
    judges = train_judges(dataset, split, unseen=unseen, progress=progress)
    others = tuple(
        row
        for kind in ("contiguous", "interleaved")
        for row in measure_split(dataset, deal(dataset.takes, kind=kind), SEEDS[:1], CANONICAL_RECIPE)
    )
    judges = replace(judges, card=judges.card.model_copy(update={"other_splits": others}))
    save_judges(PRETRAINED / dataset.dataset_id, judges)
    add_second(dataset, unseen, progress)
    return judges


def add_second(dataset: Dataset, unseen: Sequence[Take] = (), progress: ProgressCallback | None = None) -> SecondJudges:
    """Train the second family beside a dataset's canonical judges and store it with them.

    Raises
    ------
    JudgeRefused : one is below its gate, or there are no canonical judges; nothing is stored.
    """
    second = train_second_judges(dataset, deal(dataset.takes), unseen=unseen, progress=progress)
    save_second_judges(PRETRAINED / dataset.dataset_id, second)
    return second


def repeat_canonical(dataset: Dataset, condition: str) -> JudgeSet:
    """Train the first canonical content judge once more and add the difference to the card.

    Parameters
    ----------
    dataset : the one with canonical judges.
    condition : what is different this time, for example another processor; a row of that name is replaced.

    Raises
    ------
    JudgeRefused : there are no canonical judges for this data.
    """
    split = deal(dataset.takes)
    judges = load_canonical(dataset.dataset_id, dataset.digest, split.digest)
    if judges is None:
        raise JudgeRefused(f"no canonical judges for {dataset.dataset_id} with digest {dataset.digest}")
    known = judges.card.of("content")[0]
    again = train_again(dataset, split, known, judges.content[0], CANONICAL_RECIPE, condition)
    kept = tuple(row for row in judges.card.repeats if row.condition != condition)
    judges = replace(judges, card=judges.card.model_copy(update={"repeats": (*kept, again)}))
    save_judges(PRETRAINED / dataset.dataset_id, judges)
    return judges


def main() -> None:
    """Make canonical judges; see the module's text."""
    parser = argparse.ArgumentParser(prog="python -m bench.suite.make_judges", description=main.__doc__)
    parser.add_argument("name", help="dataset, as in `stylebench list datasets`")
    parser.add_argument("--again", metavar="CONDITION", help="only train one judge again and note the difference")
    parser.add_argument("--second", action="store_true", help="only train the second family")
    parser.add_argument("--data", type=Path, help="where the dataset lies; generated data needs none")
    arguments = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")
    dataset = load_dataset(arguments.name, arguments.data)
    unseen = procedural.unseen_takes() if dataset.name == "procedural" else ()
    if arguments.again:
        repeat_canonical(dataset, arguments.again)
    elif arguments.second:
        add_second(dataset, unseen, progress=_log_fifths)
    else:
        make_canonical(dataset, unseen, progress=_log_fifths)
    folder = PRETRAINED / dataset.dataset_id
    _log.info("stored in %s\n%s", folder, to_markdown(read_card(folder)))


def _log_fifths(what: str, done: int, total: int) -> None:
    if done % max(total // 5, 1) == 0:
        _log.info("%s: %d of %d steps", what, done, total)


if __name__ == "__main__":
    main()
