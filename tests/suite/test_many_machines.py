"""A Dask scheduler and workers that see the store at a path of their own: the numbers are those of one machine."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from bench.errors import BadConfig
from bench.suite.machines import STORE_VARIABLE
from tests.suite.tiny import contents, tiny_run
from tests.waiting import PATIENCE_S, wait_for

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default::ResourceWarning")]

N_WORKERS = 3


@dataclass
class Cluster:
    """A scheduler and workers, each a process of its own."""

    folder: Path
    stack: ExitStack
    n_workers: int = 0

    def __post_init__(self) -> None:
        self.process = self.start("scheduler", "--host", "127.0.0.1", "--port", "0")
        wait_for(Path(self.scheduler).is_file, "the scheduler")

    @property
    def scheduler(self) -> str:
        return str(self.folder / "scheduler.json")

    def start(self, *arguments: str, **environment: str) -> subprocess.Popen[bytes]:
        """Start ``dask ARGUMENTS``; its output goes to a log."""
        log = self.stack.enter_context((self.folder / f"{arguments[0]}.log").open("ab"))
        command = [sys.executable, "-m", "dask", *arguments, "--scheduler-file", self.scheduler, "--no-dashboard"]
        process = subprocess.Popen(
            command, stdout=log, stderr=log, env={**os.environ, **environment, "OMP_NUM_THREADS": "1"}
        )
        self.stack.callback(process.wait)
        self.stack.callback(process.kill)
        return process

    def add_worker(self, store: Path, threads: int = 1) -> subprocess.Popen[bytes]:
        """Start a worker that sees the store at a path."""
        self.n_workers += 1
        options = {"--nthreads": str(threads), "--local-directory": str(self.folder / f"worker-{self.n_workers}")}
        words = [word for option in options.items() for word in option]
        return self.start("worker", "--no-nanny", *words, **{STORE_VARIABLE: str(store)})

    def ready(self) -> None:
        """Wait for all workers that were added."""
        with self.client() as client:
            client.wait_for_workers(self.n_workers, timeout=PATIENCE_S)

    @contextmanager
    def client(self) -> Iterator[Any]:
        import distributed

        connect: Any = distributed.Client
        with connect(scheduler_file=self.scheduler, set_as_default=False) as client:
            yield client


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    """A scheduler without workers."""
    with ExitStack() as stack:
        yield Cluster(tmp_path, stack)


@pytest.fixture
def store(undisturbed: Path, tmp_path: Path) -> Path:
    """A store with judges and reference, and no cell done."""
    for stage in ("takes", "tasks", "judges", "reference"):
        shutil.copytree(undisturbed / "store" / stage, tmp_path / "store" / stage)
    return tmp_path / "store"


def provenance_of(out: Path) -> list[dict[str, Any]]:
    return [json.loads(path.read_text())["provenance"] for path in sorted((out / "records").glob("*.json"))]


def begun(out: Path, store: Path, cluster: Cluster) -> tuple[subprocess.Popen[str], Path]:
    """A run on a cluster, in the middle of its first cell, and the file by which a worker claimed that."""
    command = [sys.executable, "-m", "tests.suite.tiny", str(out), str(store), cluster.scheduler]
    main = cluster.stack.enter_context(subprocess.Popen(command, stderr=subprocess.PIPE, text=True))
    cluster.stack.callback(main.kill)
    return main, wait_for(lambda: next((store / "tmp").glob("run-*/*.attempt-1"), None), "the first cell")


def test_one_of_three_workers_is_killed_and_nothing_shows(
    undisturbed: Path, cluster: Cluster, store: Path, tmp_path: Path
) -> None:
    (tmp_path / "mounted").symlink_to(store)
    workers = [cluster.add_worker(tmp_path / "mounted") for _ in range(N_WORKERS)]
    cluster.ready()
    out = tmp_path / "out"
    main, claim = begun(out, store, cluster)
    victim = int(wait_for(claim.read_text, "the name of its worker").rpartition(":")[2])
    assert victim in [worker.pid for worker in workers]
    os.kill(victim, signal.SIGKILL)
    assert main.wait(timeout=PATIENCE_S) == 0

    assert contents(out) == contents(undisturbed / "out")
    retried = [made["retried"] for made in provenance_of(out) if made["retried"]]
    assert len(retried) == 1
    assert f":{victim} was lost; done again by" in retried[0]
    assert list((store / "tmp").iterdir()) in ([], [*(store / "tmp").glob(f"*-{victim}@*")])


def test_a_run_that_loses_its_scheduler_says_so_and_goes_on_without(
    undisturbed: Path, cluster: Cluster, store: Path, tmp_path: Path
) -> None:
    cluster.add_worker(store)
    cluster.ready()
    main, _ = begun(tmp_path / "out", store, cluster)
    cluster.process.kill()
    _, said = main.communicate(timeout=PATIENCE_S)
    assert main.returncode != 0 and "the scheduler was lost; remedy: start it and its workers again" in said
    tiny_run(tmp_path / "out", store)
    assert contents(tmp_path / "out") == contents(undisturbed / "out")


def test_workers_that_cannot_take_part_are_named_before_anything_runs(
    cluster: Cluster, store: Path, tmp_path: Path
) -> None:
    cluster.add_worker(store)
    (tmp_path / "empty").mkdir()
    cluster.add_worker(tmp_path / "empty")
    cluster.add_worker(store, threads=2)
    cluster.ready()
    with pytest.raises(BadConfig, match="2 of 3 workers cannot take part") as refused:
        tiny_run(tmp_path / "out", store, scheduler=cluster.scheduler)
    assert f"has no dataset tiny@1 (takes/{next((store / 'takes').iterdir()).name})" in str(refused.value)
    assert "runs 2 cells beside each other: start it with --nthreads 1" in str(refused.value)
    assert not (store / "motions").exists()
    assert list((store / "tmp").iterdir()) == []
