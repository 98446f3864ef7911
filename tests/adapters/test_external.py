from __future__ import annotations

import os
import platform
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest

from bench.adapters.external import External
from bench.adapters.session import OutOfTime, Refused
from bench.errors import BadConfig, BadOutput, MethodFailed
from tests.adapters.outside import COPY, after_hello, by_hand, content_take, left_behind, rng, style_take, with_worker
from tests.waiting import started, wait_for

QUICK = """
[timeouts]
start_s = 20.0
task_s = 0.5
silence_s = 1.0
stop_s = 0.5
"""


@pytest.fixture(autouse=True)
def shared_memory(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Exchange folders lie where a test can see whether they are removed."""
    folder = tmp_path / "exchange"
    folder.mkdir()
    monkeypatch.setattr("bench.adapters.session.SHARED_MEMORY", folder)
    monkeypatch.setattr("bench.adapters.session.SHARED_MEMORY_MIN_BYTES", 0)
    return folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "program"
    path.mkdir()
    return path


def check_nothing_is_left(folder: Path, shared_memory: Path) -> None:
    assert left_behind(folder) == []
    assert list(shared_memory.iterdir()) == []


def fails(adapter: type[External], match: str, error: type[MethodFailed] = MethodFailed) -> External:
    """The first transfer fails for this reason, and takes no longer than its limits."""
    method = adapter()
    with pytest.raises(error, match=match):
        method.transfer(content_take(), style_take(), rng=rng())
    return method


def test_outside_program_answers_and_leaves(folder: Path, shared_memory: Path) -> None:
    method = with_worker(folder, COPY)()
    content = content_take()
    answer = method.transfer(content, style_take(), rng=rng())
    np.testing.assert_allclose(answer.rotations_wxyz, content.clip.rotations_wxyz, atol=1e-12)
    np.testing.assert_array_equal(answer.root_xyz_m, content.clip.root_xyz_m)
    assert answer.skeleton is content.clip.skeleton
    assert method.session().says == f"Python {platform.python_version()}, numpy {np.__version__}"
    assert left_behind(folder)
    method.close()
    check_nothing_is_left(folder, shared_memory)


def test_program_ends_with_its_adapter(folder: Path, shared_memory: Path) -> None:
    method = with_worker(folder, COPY)()
    method.transfer(content_take(), style_take(), rng=rng())
    del method
    check_nothing_is_left(folder, shared_memory)


def test_bvh_goes_both_ways(folder: Path) -> None:
    code = """
    def transfer(content, style):
        assert content.path.endswith(".bvh")
        assert content.positions_m().shape == (16, 21, 3)
        return content.path
    """
    content = content_take()
    answer = with_worker(folder, code, 'motions = "bvh"')().transfer(content, style_take(), rng=rng())
    np.testing.assert_allclose(np.abs((answer.rotations_wxyz * content.clip.rotations_wxyz).sum(-1)), 1.0, atol=1e-8)
    np.testing.assert_allclose(answer.root_xyz_m, content.clip.root_xyz_m, atol=1e-7)


def test_worker_reads_the_numbers_of_a_bvh(folder: Path) -> None:
    code = "def transfer(content, style):\n    return content\n"
    content = content_take()
    answer = with_worker(folder, code, 'motions = "bvh"')().transfer(content, style_take(), rng=rng())
    np.testing.assert_allclose(np.abs((answer.rotations_wxyz * content.clip.rotations_wxyz).sum(-1)), 1.0, atol=1e-8)


def test_labels_arrive_and_unknown_ones_are_none(folder: Path) -> None:
    code = """
    def transfer(content, style):
        assert (content.content, content.style, style.style) == (None, None, "old")
        return content
    """
    with_worker(folder, code)().transfer(content_take(), style_take(), rng=rng())


def test_prints_go_to_the_log_and_not_into_the_protocol(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    code = """
    import os, subprocess, sys
    print("at import")
    def transfer(content, style):
        print("from python")
        os.write(1, b"from below\\n")
        subprocess.run([sys.executable, "-c", "print('from a child')"], check=True)
        print("to stderr", file=sys.stderr)
        assert sys.stdin.read() == ""
        return content
    """
    method = with_worker(folder, code)()
    method.transfer(content_take(), style_take(), rng=rng())
    method.close()
    log = capfd.readouterr().err
    for line in ("at import", "from python", "from below", "from a child", "to stderr"):
        assert line in log


def test_forks_and_pools_do_not_answer_for_the_worker(folder: Path, shared_memory: Path) -> None:
    code = """
    import multiprocessing, os
    def transfer(content, style):
        with multiprocessing.Pool(2) as pool:
            assert pool.map(abs, [-1, -2]) == [1, 2]
        os.fork()
        print("twice")
        return content
    """
    method = with_worker(folder, code)()
    for seed in range(3):
        content = content_take(seed=seed)
        answer = method.transfer(content, style_take(), rng=rng())
        np.testing.assert_array_equal(answer.root_xyz_m, content.clip.root_xyz_m)
    method.close()
    check_nothing_is_left(folder, shared_memory)


def test_forks_in_answers_that_are_made_while_they_are_stored_write_nothing(folder: Path) -> None:
    code = """
    import os, time
    worker = os.getpid()
    class Late:
        def __init__(self, values):
            self.values = values
        def __array__(self, dtype=None, copy=None):
            os.fork()
            is_fork = os.getpid() != worker
            # Without a guard the fork's answer would replace the one that the worker has just written.
            time.sleep(0.3 if is_fork else 0.2)
            return self.values + 0.01 * is_fork
    def transfer_batch(pairs):
        return [(content.rotations_wxyz, Late(content.root_xyz_m)) for content, style in pairs]
    """
    method = with_worker(folder, code)()
    pairs = [(content_take(seed=seed), style_take()) for seed in range(3)]
    answers = method.transfer_batch(pairs, rngs=[rng()] * 3)
    for answer, (content, _) in zip(answers, pairs, strict=True):
        np.testing.assert_array_equal(answer.root_xyz_m, content.clip.root_xyz_m)
    method.close()


def test_answers_depend_on_the_seed_alone(folder: Path) -> None:
    code = """
    import random, numpy
    def transfer(content, style, seed):
        assert 0 <= seed < 2**32
        return content.rotations_wxyz, content.root_xyz_m + 0.01 * numpy.random.rand() + 0.01 * random.random()
    """
    method = with_worker(folder, code)()
    pairs = [(content_take(seed=k), style_take()) for k in range(3)]
    alone = [method.transfer(*pair, rng=rng(k)).root_xyz_m for k, pair in enumerate(pairs)]
    together = method.transfer_batch(pairs[::-1], rngs=[rng(k) for k in (2, 1, 0)])
    for one, other in zip(alone, reversed(together), strict=True):
        np.testing.assert_array_equal(one, other.root_xyz_m)
    assert not np.array_equal(alone[0], method.transfer(*pairs[0], rng=rng(9)).root_xyz_m)


def test_every_call_of_the_contract(folder: Path, tmp_path: Path) -> None:
    code = """
    import json, os
    state = {}
    def sample(content, style_label):
        assert style_label == "old"
        return content
    def interpolate(content, styles):
        assert [weight for _, weight in styles] == [0.25, 0.75]
        return content
    def interpolate_parts(content, part, styles):
        assert part == "arms" and len(styles) == 1
        return content
    def transfer_parts(content, styles):
        assert list(styles) == ["legs"] and styles["legs"].style == "old"
        return content
    def predict(past, style, trajectory_xz_m):
        assert trajectory_xz_m.shape == (30, 2)
        return past.rotations_wxyz[-1:], past.root_xyz_m[-1:]
    def open_stream(style, content_label=None):
        assert content_label == "walk"
        return lambda rotations, root: (rotations, root + 1.0)
    def describe():
        return {"parameters": 7, "bytes_per_style": 256}
    def fit(takes, seed, budget, progress):
        progress("epochs", 1, 2)
        state["n"] = len(takes)
    def save(folder):
        os.mkdir(os.path.join(folder, "deep"))
        with open(os.path.join(folder, "deep", "n.json"), "w") as file:
            json.dump(state, file)
    def load(folder):
        with open(os.path.join(folder, "deep", "n.json")) as file:
            state.update(json.load(file))
    """
    names = "samples", "interpolates", "interpolates parts", "transfers parts", "predicts", "streams", "describes"
    adapter = with_worker(folder, code, "fits = true", ", ".join(f'"{name}"' for name in names))
    method, content, style = adapter(), content_take(), style_take()
    heard: list[tuple[str, int, int]] = []
    method.fit([content, style], seed=0, budget="smoke", progress=lambda *event: heard.append(event))
    assert heard == [("epochs", 1, 2)]
    weights = tmp_path / "weights"
    weights.mkdir()
    method.save(weights)
    method.load(weights)
    assert (weights / "deep" / "n.json").read_text() == '{"n": 2}'
    for answer in (
        method.sample(content, "old", rng=rng()),
        method.interpolate(content, [(content, 0.25), (style, 0.75)], rng=rng()),
        method.interpolate_parts(content, "arms", [(style, 1.0)], rng=rng()),
        method.transfer_parts(content, {"legs": style}, rng=rng()),
    ):
        assert answer.n_frames == content.clip.n_frames
    assert method.predict(content.clip, style, np.zeros((30, 2))).n_frames == 1
    stream = method.open_stream(style, content_label="walk", rng=rng())
    turns, root = stream.step(content.clip.rotations_wxyz[0], content.clip.root_xyz_m[0])
    np.testing.assert_array_equal(turns, content.clip.rotations_wxyz[0])
    np.testing.assert_array_equal(root, content.clip.root_xyz_m[0] + 1.0)
    assert method.describe().parameters == 7
    with pytest.raises(BadConfig, match="does not declare that it transfers"):
        method.transfer(content, style, rng=rng())
    method.close()


def test_an_error_is_told_and_the_program_stays(folder: Path) -> None:
    code = """
    def transfer(content, style):
        if len(content.root_xyz_m) == 9:
            raise ValueError("nine\\nframes")
        return content
    """
    method = with_worker(folder, code)()
    with pytest.raises(Refused, match="transfer failed: ValueError: nine frames"):
        method.transfer(content_take(9), style_take(), rng=rng())
    running = method.session().pid
    method.transfer(content_take(8), style_take(), rng=rng())
    assert method.session().pid == running


def test_weights_are_loaded_again_after_a_crash(folder: Path, tmp_path: Path) -> None:
    code = """
    import os
    state = []
    def transfer(content, style):
        if len(content.root_xyz_m) == 9:
            os._exit(3)
        assert state == ["loaded"]
        return content
    def fit(takes): pass
    def save(folder): pass
    def load(folder): state.append("loaded")
    """
    weights = tmp_path / "weights"
    weights.mkdir()
    method = with_worker(folder, code, "fits = true")()
    method.load(weights)
    with pytest.raises(MethodFailed, match="ended with exit code 3 during 'transfer'"):
        method.transfer(content_take(9), style_take(), rng=rng())
    method.transfer(content_take(8), style_take(), rng=rng())


@pytest.mark.parametrize(
    ("answer", "match"),
    [
        ("content.rotations_wxyz[1:], content.root_xyz_m[1:]", "frames: expected 16 frames, got 15 frames"),
        ("content.rotations_wxyz[:, 1:], content.root_xyz_m", r"must have shape \[any, 21, 4\], got \[16, 20, 4\]"),
        ("content.rotations_wxyz * float('nan'), content.root_xyz_m", "must be finite"),
        ("content.rotations_wxyz, content.root_xyz_m * float('inf')", "must be finite"),
        ("content.rotations_wxyz * 2, content.root_xyz_m", "must be unit quaternions"),
        ("content.rotations_wxyz, content.root_xyz_m * 100", "likely cause: centimetres instead of metres"),
        ("content.rotations_wxyz, content.root_xyz_m + 9.0 * (numpy.arange(16) > 7)[:, None] * [1, 0, 0]", "root path"),
        ("dict(vars(content), offsets_m=content.offsets_m * 1.1)", "bone lengths: expected the content's bones"),
        ("numpy.zeros((40000, 21, 4)), numpy.zeros((40000, 3))", "can belong to what is expected here"),
    ],
)
def test_answers_that_cannot_be_scored_are_refused(folder: Path, answer: str, match: str) -> None:
    method = with_worker(folder, f"import numpy\ndef transfer(content, style):\n    return {answer}\n")()
    with pytest.raises(BadOutput, match=match):
        method.transfer(content_take(), style_take(), rng=rng())
    method.close()


def test_missing_functions_and_programs_are_named(folder: Path) -> None:
    fails(with_worker(folder, "x = 1"), "promises that it transfers, the program does not offer it", BadConfig)  # type: ignore[arg-type]
    adapter = with_worker(folder, COPY, python="no-such-python")
    fails(adapter, "no program 'no-such-python' that can be run", BadConfig)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("code", "match"),
    [
        ("raise RuntimeError('at import')", "ended with exit code 1 during 'hello'.*RuntimeError: at import"),
        ("import no_such_package", "No module named 'no_such_package'"),
        ("import sys; sys.exit(4)", "ended with exit code 4"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "was ended by signal 11"),
    ],
)
def test_programs_that_do_not_start(folder: Path, shared_memory: Path, code: str, match: str) -> None:
    method = fails(with_worker(folder, code), match)
    check_nothing_is_left(folder, shared_memory)
    del method


@pytest.mark.parametrize(
    ("code", "match"),
    [
        ("print('loss 0.1', flush=True); time.sleep(60)", "wrote what is no JSON: 'loss 0.1'.*prints to stdout"),
        ("say([1]); time.sleep(60)", "JSON that is no object"),
        ("say({'id': 'x', 'ok': True}); time.sleep(60)", "an answer without a number 'id'"),
        ("say({'event': 'party'}); time.sleep(60)", "unknown event"),
        ("say({'id': 99, 'ok': True}); time.sleep(60)", "answered request 99, but 1 was asked"),
        ("print('[' * 100000, flush=True); time.sleep(60)", "no JSON"),
        ("sys.stdout.write('x' * 3000000); sys.stdout.flush(); time.sleep(60)", "without an end of line"),
        ("sys.exit(5)", "ended with exit code 5 during 'transfer'"),
        ("sys.stdout.write('{\"id\": 1, '); sys.stdout.flush(); import os; os._exit(6)", "ended with exit code 6"),
        ("import os; os.close(1); time.sleep(60)", "closed its output during 'transfer'"),
        ("time.sleep(60)", "no answer to 'transfer' within 0.5 s, and it did not stop"),
        ("while True: sys.stdout.write('x' * 65536 + chr(10))", "no JSON"),
        ("while True: say({'event': 'heartbeat'})", "no answer to 'transfer' within 0.5 s"),
        ("while True: sys.stderr.write('x' * 65536)", "no answer to 'transfer' within 0.5 s"),
        ("say({'id': 1, 'ok': True}); time.sleep(60)", "expected 'files' with 1 names"),
        ("say({'id': 1, 'ok': True, 'files': ['../x.npz']}); time.sleep(60)", "expected the file answer-"),
        (
            "say({'id': 1, 'ok': True, 'files': [request['tasks'][0]['answer'] + '.npz']}); time.sleep(60)",
            "No such file",
        ),
    ],
)
def test_programs_that_break_the_protocol(folder: Path, shared_memory: Path, code: str, match: str) -> None:
    # Only programs that never answer are given little time: a busy machine is slow to answer wrongly.
    timeouts = QUICK if "no answer" in match else QUICK.replace("task_s = 0.5", "task_s = 30.0")
    method = by_hand(folder, code, timeouts)()
    with pytest.raises(Exception, match=match) as caught:
        method.transfer(content_take(), style_take(), rng=rng())
    assert isinstance(caught.value, MethodFailed | BadOutput)
    method.close()
    check_nothing_is_left(folder, shared_memory)


def test_banner_before_hello_is_passed_over(folder: Path) -> None:
    adapter = by_hand(folder, "say({'id': 1, 'ok': False, 'error': {'type': 'E', 'text': 'reached'}}); read()")
    program = folder / "program.py"
    program.write_text("print('activating the environment')\nprint()\n" + program.read_text())
    fails(adapter, "transfer failed: E: reached")


def test_program_of_another_protocol_is_refused(folder: Path, shared_memory: Path) -> None:
    adapter = by_hand(folder, "")
    program = folder / "program.py"
    program.write_text(program.read_text().replace('"protocol": 1', '"protocol": 2'))
    fails(adapter, "expected protocol 1, got '2'; remedy: copy the newer worker.py")
    check_nothing_is_left(folder, shared_memory)


def test_program_that_does_not_read_is_given_up(folder: Path, shared_memory: Path) -> None:
    method = after_hello(folder, "time.sleep(60)", QUICK)()
    pairs = [(content_take(1), style_take())] * 500
    with pytest.raises(MethodFailed, match="does not read its input"):
        method.transfer_batch(pairs, rngs=[rng()] * 500)
    method.close()
    check_nothing_is_left(folder, shared_memory)


STUBBORN = """
import os, signal, subprocess, sys, time
for number in (signal.SIGTERM, signal.SIGHUP):
    signal.signal(number, signal.SIG_IGN)
def child(**options):
    code = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); time.sleep(600)"
    subprocess.Popen([sys.executable, "-c", code, os.getcwd()], **options)
child()
child(start_new_session=True)
if os.fork() == 0:
    os.setsid()
    child(start_new_session=True)
    os._exit(0)
def transfer(content, style):
    while len(content.root_xyz_m) == 9:
        try:
            time.sleep(600)
        except BaseException:
            pass
    return content
"""


def test_stubborn_programs_and_their_children_are_ended(folder: Path, shared_memory: Path) -> None:
    # Calls that are answered have all the time that a busy machine needs.
    method = with_worker(folder, STUBBORN, "[timeouts]\nstop_s = 0.5")()
    method.transfer(content_take(8), style_take(), rng=rng())
    assert len(left_behind(folder)) >= 4
    with pytest.raises(OutOfTime, match="did not stop when it was told to"):
        method.transfer_batch([(content_take(9), style_take())], rngs=[rng()], timeout_s=3.0)
    check_nothing_is_left(folder, shared_memory)
    method.transfer(content_take(8), style_take(), rng=rng())
    method.close()
    check_nothing_is_left(folder, shared_memory)


def test_cancelled_program_stays_and_answers_on(folder: Path) -> None:
    code = """
    import time
    def transfer(content, style):
        try:
            time.sleep(60 if len(content.root_xyz_m) == 9 else 0)
        except Exception:
            raise SystemExit("cancelling is no Exception")
        return content
    """
    method = with_worker(folder, code, "[timeouts]\nstop_s = 60.0")()
    method.transfer(content_take(8), style_take(), rng=rng())
    running = method.session().pid
    with pytest.raises(OutOfTime, match=r"within 0\.5 s; it was cancelled"):
        method.transfer_batch([(content_take(9), style_take())], rngs=[rng()], timeout_s=0.5)
    method.transfer(content_take(8), style_take(), rng=rng())
    assert method.session().pid == running
    method.close()


@pytest.mark.slow
def test_heartbeats_tell_a_slow_program_from_a_hanging_one(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bench.adapters.external.HEARTBEAT_S", 0.2)
    code = """
    import os, signal, time
    def transfer(content, style):
        if len(content.root_xyz_m) == 9:
            os.kill(os.getpid(), signal.SIGSTOP)
        time.sleep(8.0)
        return content
    """
    method = with_worker(folder, code, "[timeouts]\nsilence_s = 5.0")()
    method.transfer(content_take(8), style_take(), rng=rng())
    with pytest.raises(MethodFailed, match="no sign of life for 5 s"):
        method.transfer(content_take(9), style_take(), rng=rng())
    assert left_behind(folder) == []


def test_removed_exchange_folder_is_a_failure_and_the_next_call_works(folder: Path) -> None:
    code = """
    import os, shutil
    def transfer(content, style):
        if len(content.root_xyz_m) == 9:
            shutil.rmtree(os.path.dirname(content.path))
        return content
    """
    method = with_worker(folder, code)()
    with pytest.raises(MethodFailed, match="transfer failed: FileNotFoundError"):
        method.transfer(content_take(9), style_take(), rng=rng())
    with pytest.raises(MethodFailed, match="exchange folder cannot be written"):
        method.transfer(content_take(8), style_take(), rng=rng())
    method.close()
    method.transfer(content_take(8), style_take(), rng=rng())


def test_links_and_devices_in_answers_are_not_followed(folder: Path) -> None:
    code = """
    import os
    say_file = request["tasks"][0]["answer"] + ".npz"
    path = os.path.join(hello["exchange"], say_file)
    os.symlink("/etc/hostname", path) if request["tasks"][0]["content"]["fps"] else os.mkfifo(path)
    say({"id": 1, "ok": True, "files": [say_file]})
    """
    with pytest.raises(Exception, match=r"cannot be read \(it is a link\)"):
        by_hand(folder, code)().transfer(content_take(), style_take(), rng=rng())
    with pytest.raises(Exception, match="is not a regular file"):
        by_hand(folder, code.replace('["fps"]', '["kept"]').replace("kept", "content"))().transfer(
            content_take(), style_take(), rng=rng()
        )


def test_a_flood_on_stderr_is_cut_off(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    code = """
    import sys
    def transfer(content, style):
        for _ in range(200):
            sys.stderr.write("x" * 65536)
        return content
    """
    method = with_worker(folder, code)()
    method.transfer(content_take(), style_take(), rng=rng())
    method.close()
    log = capfd.readouterr().err
    assert 4 << 20 <= len(log) < 5 << 20
    assert log.endswith("[the rest of the log is dropped]\n")


def test_killed_harness_leaves_nothing_behind(folder: Path, shared_memory: Path, tmp_path: Path) -> None:
    with_worker(folder, STUBBORN)
    script = tmp_path / "harness.py"
    script.write_text(
        textwrap.dedent(f"""
        import time
        from pathlib import Path
        from bench.adapters import session
        from bench.adapters.external import external_adapter
        from tests.adapters.outside import content_take, rng, style_take
        session.SHARED_MEMORY, session.SHARED_MEMORY_MIN_BYTES = Path({str(shared_memory)!r}), 0
        method = external_adapter(Path({str(folder / "adapter.toml")!r}))()
        method.transfer(content_take(8), style_take(), rng=rng())
        print("ready", flush=True)
        time.sleep(600)
        """)
    )
    root = Path(__file__).resolve().parents[2]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    with started([sys.executable, str(script)], stdout=subprocess.PIPE, env=environment) as harness:
        assert harness.stdout is not None
        assert harness.stdout.readline() == b"ready\n"
        assert left_behind(folder)
        harness.send_signal(signal.SIGKILL)
    wait_for(lambda: not left_behind(folder) and not any(shared_memory.iterdir()), "the end of the program", 20.0)
    check_nothing_is_left(folder, shared_memory)


def test_environment_of_the_harness_does_not_reach_the_program(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", "/nowhere")
    monkeypatch.setenv("VIRTUAL_ENV", "/nowhere")
    code = """
    import os
    def transfer(content, style):
        assert "PYTHONPATH" not in os.environ and "VIRTUAL_ENV" not in os.environ
        assert os.environ["MINE"] == "1"
        return content
    """
    with_worker(folder, code, '[environment]\nMINE = "1"')().transfer(content_take(), style_take(), rng=rng())


def test_digest_files_are_those_that_the_toml_lists(folder: Path) -> None:
    adapter = with_worker(folder, COPY)
    assert [path.name for path in adapter.digest_files()] == ["adapter.toml", "my_code.py", "worker.py"]
    (folder / "weights").mkdir()
    (folder / "weights" / "a.bin").write_bytes(b"1")
    adapter = with_worker(folder, COPY, 'files = ["my_code.py", "weights/*"]')
    assert [path.name for path in adapter.digest_files()] == ["adapter.toml", "my_code.py", "a.bin"]
    with pytest.raises(BadConfig, match=r"no file matches 'gone\.pt'"):
        with_worker(folder, COPY, 'files = ["gone.pt"]').digest_files()


def test_saved_weights_that_are_links_are_refused(folder: Path, tmp_path: Path) -> None:
    code = (
        COPY
        + """
import os
def fit(takes): pass
def save(folder): os.symlink("/etc/hostname", os.path.join(folder, "weights"))
def load(folder): pass
"""
    )
    method = with_worker(folder, code, "fits = true")()
    method.fit([], seed=0, budget="smoke", progress=lambda *_: None)
    with pytest.raises(BadOutput, match="neither a file nor a folder"):
        method.save(tmp_path)
    method.close()
