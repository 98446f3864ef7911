"""What travels to another machine, and what that machine must have."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from pathlib import Path

import pytest

from bench.adapters.loading import AdapterSource, find_adapter, source_from_option
from bench.suite.calls import MOST_ATTEMPTS, Attempt, CellCall, worker_name
from bench.suite.failures import Failures
from bench.suite.keys import adapter_digest
from bench.suite.machines import STORE_VARIABLE, Home, Wanted, code_digest, problem_here, problems_here
from bench.suite.store import Store
from bench.suite.workers import Limits, Outcome
from tests.suite.test_workers import make_job


def wanted(root: Path) -> Wanted:
    """What a run asks that has one dataset in the store and two adapters."""
    store = Store(root / "store")
    store.put("takes", "abc", lambda folder: {"n": 0})
    file = root / "mine.py"
    file.write_text(
        "from bench.adapters.base import Adapter\n\nclass Mine(Adapter):\n"
        "    def transfer(self, content, style, *, rng):\n        return content.clip\n"
    )
    sources = (AdapterSource("copy-content"), source_from_option(str(file)))
    adapters = tuple((source, adapter_digest(find_adapter(source))) for source in sources)
    home = Home(str(store.root), str(store.draft("run")))
    return Wanted(home, code_digest(), (("toy@1", "abc"),), adapters)


def test_a_machine_that_has_all_is_fit(tmp_path: Path) -> None:
    assert problems_here(wanted(tmp_path)) == ""


def test_a_machine_with_the_store_elsewhere_is_fit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = wanted(tmp_path)
    (tmp_path / "mounted").symlink_to(tmp_path / "store")
    monkeypatch.setenv(STORE_VARIABLE, str(tmp_path / "mounted"))
    elsewhere = replace(
        asked.home, store="/home/me/runs/store", run=f"/home/me/runs/store/tmp/{Path(asked.home.run).name}"
    )
    assert problems_here(replace(asked, home=elsewhere)) == ""


def test_what_a_machine_lacks_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = wanted(tmp_path)
    assert "another version of this project" in problems_here(replace(asked, code="other"))
    assert "has no dataset other@1 (takes/def)" in _quickly(replace(asked, datasets=(("other@1", "def"),)), monkeypatch)
    source, _ = asked.adapters[1]
    assert "another version of adapter mine" in problems_here(replace(asked, adapters=((source, "other"),)))
    gone = replace(source, file=str(tmp_path / "gone.py"))
    assert "adapters must lie in a folder that all machines see" in problems_here(
        replace(asked, adapters=((gone, ""),))
    )
    monkeypatch.setenv(STORE_VARIABLE, str(tmp_path / "nowhere"))
    assert "has no store at" in problems_here(asked)
    assert not (tmp_path / "nowhere").exists()


def test_a_copy_of_the_store_is_not_the_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = wanted(tmp_path)
    Store(tmp_path / "copy").put("takes", "abc", lambda folder: {"n": 0})
    monkeypatch.setenv(STORE_VARIABLE, str(tmp_path / "copy"))
    assert "that is not the store of this run" in problems_here(asked)


def _quickly(asked: Wanted, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr("bench.suite.machines.SEEN_WITHIN_S", 0.0)
    return problems_here(asked)


def cell_call(folder: Path) -> CellCall:
    """A cell of six tasks that is only generated."""
    store = Store(folder / "store")
    home = Home(str(store.root), str(store.draft("run")))
    wanted = Wanted(home, code_digest(), (), ())
    job, limits = make_job(folder, "return clip"), Limits(wall_s=60)
    return CellCall("cell", home.run, wanted, (), job, None, True, limits, str(folder / "logs"), "")


def test_a_call_is_plain_data_and_does_its_work_once(tmp_path: Path) -> None:
    call = pickle.loads(pickle.dumps(cell_call(tmp_path)))
    answer = call.run()
    assert (answer.outcome, answer.generated, answer.made.retried) == (Outcome("ok"), True, "")
    second = call.run()
    assert (second.outcome, second.generated) == (Outcome("ok"), False)
    assert second.made.retried == f"the worker {worker_name()} was lost; done again by {worker_name()}"
    third = call.run()
    assert third.outcome == Outcome("failed", f"its workers were lost: {worker_name()}, {worker_name()}")


def test_a_call_whose_store_lacks_something_fails_with_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bench.suite.calls.VISIBLE_WITHIN_S", 0.0)
    answer = replace(cell_call(tmp_path), needs=(("reference", "abc"),)).run()
    assert answer.outcome.status == "failed" and "lacks reference/abc" in answer.outcome.reason


def test_a_machine_that_joins_late_and_is_unfit_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    call = cell_call(tmp_path)
    assert call.wanted is not None
    answer = replace(call, wanted=replace(call.wanted, code="other")).run()
    assert answer.outcome.status == "failed" and "another version of this project" in answer.outcome.reason
    assert problem_here(call.wanted) == problem_here(None) == ""
    late = replace(call, wanted=replace(call.wanted, datasets=(("other@1", "abc"),)))
    monkeypatch.setenv(STORE_VARIABLE, str(tmp_path / "nowhere"))
    assert "has no store at" in late.run().outcome.reason


def test_paths_move_with_the_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    call = cell_call(tmp_path)
    monkeypatch.setenv(STORE_VARIABLE, "/mnt/store")
    assert call.wanted is not None
    moved = call.wanted.home.here(call)
    assert moved.job.store == "/mnt/store" and moved.folder.startswith("/mnt/store/tmp/run-")
    assert moved.logs == call.logs and moved.job.source == call.job.source
    assert moved.job.cells == call.job.cells


def test_attempts_count_and_tell_how_far_they_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bench.suite.calls.REPORT_EVERY_S", 60.0)
    attempts = [Attempt(tmp_path, "cell") for _ in range(MOST_ATTEMPTS + 1)]
    assert [attempt.too_many for attempt in attempts] == [False, False, True]
    assert attempts[0].retried == "" and "was lost" in attempts[1].retried
    attempts[0].report("fit", 1, 10)
    attempts[0].report("fit", 2, 10)
    assert json.loads((tmp_path / "cell.progress").read_text()) == ["fit", 1, 10]


def test_failures_are_remembered_until_a_success(tmp_path: Path) -> None:
    failures = Failures(Store(tmp_path / "store"), tmp_path / "out")
    assert failures.recall("key") is None
    failures.note("key", Outcome("timeout", "no answer", "logs/a.log"))
    assert failures.recall("key") == Outcome("timeout", "no answer")
    (tmp_path / "out" / "logs").mkdir(parents=True)
    (tmp_path / "out" / "logs" / "a.log").touch()
    assert failures.recall("key") == Outcome("timeout", "no answer", "logs/a.log")
    failures.note("key", Outcome("ok"))
    assert failures.recall("key") is None
