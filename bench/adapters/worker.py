"""Answer a benchmark's questions with your own code. One file: Python 3.7 or newer, numpy, nothing else.

Copy this file next to your code, write a module with one function::

    # my_code.py
    def transfer(content, style):
        rotations, root = my_network(content.rotations_wxyz, content.root_xyz_m, style.rotations_wxyz)
        return rotations, root

and let ``adapter.toml`` start ``python worker.py my_code.py``. What your code prints goes to the log.

Your functions get motions (class ``Motion`` below) and answer with the pair ``(rotations_wxyz, root_xyz_m)``, a
``Motion``, a dictionary with these keys, or the path of a .bvh file on the same joints in centimetres; as many
frames as the content motion has.

Functions that your module may have; only those that adapter.toml names are called. ``seed``, ``budget``,
``progress(what, done, total)`` and ``content_label`` are passed by name to functions that have such an argument::

    transfer(content, style)              transfer_batch(pairs)  -> list, where many at once are faster
    sample(content, style_label)          interpolate(content, styles)      styles: list of (motion, weight)
    interpolate_parts(content, part, styles)    the same for one body part; the rest stays the content's
    transfer_parts(content, styles)       styles: dictionary body part -> motion
    open_stream(style)                    -> function (rotations_wxyz, root_xyz_m) of one frame -> the same two
    predict(past, style, trajectory_xz_m) -> the frames that follow
    describe()                            -> {"parameters": ..., "bytes_per_style": ...}
    fit(takes)    save(folder)    load(folder)
"""

from __future__ import annotations

import importlib.util
import inspect
import json
import os
import platform
import queue
import random as python_random
import shutil
import signal
import sys
import threading
import time
import traceback
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any

PROTOCOL = 1
CALLS = {
    "transfers": ("transfer", "transfer_batch"),
    "samples": ("sample",),
    "interpolates": ("interpolate",),
    "interpolates parts": ("interpolate_parts",),
    "transfers parts": ("transfer_parts",),
    "streams": ("open_stream",),
    "predicts": ("predict",),
    "describes": ("describe",),
}
ARRAYS = ("rotations_wxyz", "root_xyz_m", "offsets_m")
KEPT_MOTIONS, OPEN_STREAMS = 256, 16
CENTIMETRE_M = 0.01


class Cancelled(BaseException):
    """The benchmark no longer waits for the answer. Not an Exception, so that ``except Exception`` lets it pass."""


class Motion:
    """One motion on the benchmark's 21 joints.

    Attributes
    ----------
    rotations_wxyz : [T, 21, 4] local unit quaternions, w first. root_xyz_m : [T, 3] metres, Y up.
    offsets_m : [21, 3] each joint's place in its parent's frame; with all rotations identity: a T-pose facing +Z.
    names, parents : of the joints, -1 for the root. fps : frames per second.
    content, style : labels, None unless adapter.toml declares the need. path : the file it was read from.
    """

    def __init__(
        self,
        rotations_wxyz: Any,
        root_xyz_m: Any,
        offsets_m: Any,
        names: Sequence[str],
        parents: Sequence[int],
        fps: float,
        content: str | None = None,
        style: str | None = None,
        path: str = "",
    ) -> None:
        self.rotations_wxyz = rotations_wxyz
        self.root_xyz_m = root_xyz_m
        self.offsets_m = offsets_m
        self.names = list(names)
        self.parents = list(parents)
        self.fps = fps
        self.content = content
        self.style = style
        self.path = path

    def with_motion(self, rotations_wxyz: Any, root_xyz_m: Any) -> Motion:
        """Another motion of the same skeleton."""
        return Motion(rotations_wxyz, root_xyz_m, self.offsets_m, self.names, self.parents, self.fps)

    def positions_m(self) -> Any:
        """World positions [T, 21, 3] of the joints, metres."""
        turns = numpy.array(self.rotations_wxyz, dtype=numpy.float64)
        places = numpy.empty((*turns.shape[:2], 3))
        places[:, 0] = self.root_xyz_m
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                places[:, joint] = places[:, parent] + _rotate(turns[:, parent], self.offsets_m[joint])
                turns[:, joint] = _multiply(turns[:, parent], turns[:, joint])
        return places


def read_bvh(path: str) -> Motion:
    """A .bvh file whose root alone has positions, centimetres, rotation channels in any order."""
    head, _, tail = Path(path).read_text(encoding="utf-8").partition("MOTION")
    names, parents, offsets, channels = [], [], [], []
    open_joints: list[int] = []
    words = head.split()
    for place, word in enumerate(words):
        if word in ("ROOT", "JOINT"):
            parents.append(open_joints[-1] if open_joints else -1)
            names.append(words[place + 1])
        elif word == "{":
            open_joints.append(-2 if words[place - 1] == "Site" else len(names) - 1)
        elif word == "}":
            open_joints.pop()
        elif word == "OFFSET" and open_joints[-1] != -2:
            offsets.append([float(value) for value in words[place + 1 : place + 4]])
        elif word == "CHANNELS":
            channels.append(words[place + 2 : place + 2 + int(words[place + 1])])
    lines = [line for line in tail.splitlines() if line.strip()]
    values = numpy.array([line.split() for line in lines[2:]], dtype=numpy.float64)
    turns = numpy.zeros((len(values), len(names), 4))
    turns[..., 0] = 1.0
    root = numpy.zeros((len(values), 3))
    column = 0
    for joint, joint_channels in enumerate(channels):
        for channel in joint_channels:
            axis = "XYZ".index(channel[0])
            if channel.endswith("rotation"):
                turns[:, joint] = _multiply(turns[:, joint], _about_axis(axis, numpy.radians(values[:, column])))
            else:
                root[:, axis] = values[:, column] * CENTIMETRE_M
            column += 1
    fps = 1.0 / float(lines[1].split(":")[1])
    fps = round(fps) if abs(fps - round(fps)) < 0.01 else fps
    return Motion(turns, root, numpy.array(offsets) * CENTIMETRE_M, names, parents, fps, path=path)


def _multiply(a: Any, b: Any) -> Any:
    aw, ax, ay, az = numpy.moveaxis(a, -1, 0)
    bw, bx, by, bz = numpy.moveaxis(b, -1, 0)
    return numpy.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def _rotate(turn: Any, vector: Any) -> Any:
    twice = 2.0 * numpy.cross(turn[..., 1:], vector)
    return vector + turn[..., :1] * twice + numpy.cross(turn[..., 1:], twice)


def _about_axis(axis: int, angle: Any) -> Any:
    turn = numpy.zeros((*angle.shape, 4))
    turn[..., 0] = numpy.cos(angle / 2.0)
    turn[..., 1 + axis] = numpy.sin(angle / 2.0)
    return turn


class Channel:
    """The protocol's two pipes: one JSON object a line. Nobody else may write to them."""

    def __init__(self) -> None:
        self.lines = os.fdopen(os.dup(0), "rb")
        self.out = os.dup(1)
        # Whatever the user's code and its libraries read or print must not touch the protocol.
        empty = os.open(os.devnull, os.O_RDONLY)
        os.dup2(empty, 0)
        os.close(empty)
        os.dup2(2, 1)
        self.lock = threading.Lock()
        self.owner = os.getpid()

    def leave_if_forked(self) -> None:
        """End a fork of the user's code that came back as if it were the worker: it must not answer, nor write."""
        if os.getpid() != self.owner:
            os._exit(1)

    def send(self, message: dict[str, Any]) -> None:
        self.leave_if_forked()
        data = (json.dumps(message, allow_nan=False) + "\n").encode("utf-8")
        with self.lock:
            while data:
                data = data[os.write(self.out, data) :]


class Worker:
    """Answers requests one after the other; two threads beside it listen and give signs of life."""

    def __init__(self, module: Any, channel: Channel) -> None:
        self.module = module
        self.channel = channel
        self.requests: queue.Queue[dict[str, Any] | None] = queue.Queue()
        self.cancelled: set[int] = set()
        self.running: int | None = None
        self.exchange = Path()
        self.names: list[str] = []
        self.parents: list[int] = []
        self.kept: dict[str, Motion] = {}
        self.streams: dict[int, Any] = {}
        self.known: dict[str, list[str]] = {}

    def run(self) -> None:
        """Answer until the benchmark says stop or goes away."""
        signal.signal(signal.SIGINT, self._interrupted)
        threading.Thread(target=self._listen, daemon=True).start()
        while True:
            request = self.requests.get()
            if request is None or request["call"] == "stop":
                return
            self.channel.send(self._answer(request))

    def _listen(self) -> None:
        for line in self.channel.lines:
            message = json.loads(line.decode("utf-8"))
            if message["call"] == "cancel":
                self.cancelled.add(message["id"])
                if self.running == message["id"]:
                    signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
            else:
                self.requests.put(message)
        # The benchmark is gone: a call that still runs would answer nobody.
        self.requests.put(None)
        time.sleep(1.0)
        os._exit(1)

    def _interrupted(self, signum: int, frame: Any) -> None:
        if self.running in self.cancelled:
            raise Cancelled()

    def _heartbeats(self, seconds: float) -> None:
        while True:
            time.sleep(seconds)
            try:
                self.channel.send({"event": "heartbeat"})
            except OSError:
                os._exit(1)

    def _answer(self, request: dict[str, Any]) -> dict[str, Any]:
        answer = {"id": request["id"], "ok": False}
        try:
            self.running = request["id"]
            if self.running in self.cancelled:
                raise Cancelled()
            answer.update(getattr(self, "_on_" + request["call"])(request), ok=True)
            self.running = None
        except Cancelled:
            answer.update(ok=False, error={"type": "Cancelled", "text": "stopped on request"})
        except (Exception, SystemExit) as error:
            self.running = None
            traceback.print_exc()
            answer.update(ok=False, error={"type": type(error).__name__, "text": str(error)[:2000]})
        self.running = None
        return answer

    def _on_hello(self, request: dict[str, Any]) -> dict[str, Any]:
        if PROTOCOL not in request["protocols"]:
            raise ValueError(f"this worker.py speaks protocol {PROTOCOL}; copy the newer file")
        self.exchange = Path(request["exchange"])
        self.names, self.parents = request["names"], request["parents"]
        threading.Thread(target=self._heartbeats, args=(request["heartbeat_s"],), daemon=True).start()
        return {
            "protocol": PROTOCOL,
            "capabilities": [name for name, calls in CALLS.items() if any(map(self._has, calls))],
            "fits": self._has("fit"),
            "heartbeat": True,
            "program": f"Python {platform.python_version()}, numpy {numpy.__version__}",
        }

    def _on_transfer(self, request: dict[str, Any]) -> dict[str, Any]:
        tasks = request["tasks"]
        if self._has("transfer_batch") and (len(tasks) > 1 or not self._has("transfer")):
            pairs = [(self._motion(task["content"]), self._motion(task["style"])) for task in tasks]
            answers = list(self._call("transfer_batch", pairs, seed=tasks[0]["seed"]))
            if len(answers) != len(tasks):
                raise ValueError(f"transfer_batch got {len(tasks)} pairs and gave {len(answers)} answers")
            return {"files": [self._keep(answers[n], task["answer"]) for n, task in enumerate(tasks)]}
        files = []
        for task in tasks:
            answer = self._call(
                "transfer", self._motion(task["content"]), self._motion(task["style"]), seed=task["seed"]
            )
            files.append(self._keep(answer, task["answer"]))
        return {"files": files}

    def _on_sample(self, request: dict[str, Any]) -> dict[str, Any]:
        return self._one(request, "sample", self._motion(request["content"]), request["style_label"])

    def _on_interpolate(self, request: dict[str, Any]) -> dict[str, Any]:
        styles = [(self._motion(style), weight) for style, weight in request["styles"]]
        return self._one(request, "interpolate", self._motion(request["content"]), styles)

    def _on_interpolate_parts(self, request: dict[str, Any]) -> dict[str, Any]:
        styles = [(self._motion(style), weight) for style, weight in request["styles"]]
        return self._one(request, "interpolate_parts", self._motion(request["content"]), request["part"], styles)

    def _on_transfer_parts(self, request: dict[str, Any]) -> dict[str, Any]:
        styles = {part: self._motion(style) for part, style in request["styles"].items()}
        return self._one(request, "transfer_parts", self._motion(request["content"]), styles)

    def _on_predict(self, request: dict[str, Any]) -> dict[str, Any]:
        trajectory = numpy.array(request["trajectory_xz_m"], dtype=numpy.float64)
        return self._one(request, "predict", self._motion(request["past"]), self._motion(request["style"]), trajectory)

    def _on_open_stream(self, request: dict[str, Any]) -> dict[str, Any]:
        style = self._motion(request["style"])
        stream = self._call("open_stream", style, seed=request["seed"], content_label=request["content_label"])
        while len(self.streams) >= OPEN_STREAMS:
            del self.streams[min(self.streams)]
        self.streams[request["stream"]] = getattr(stream, "step", stream)
        return {}

    def _on_step(self, request: dict[str, Any]) -> dict[str, Any]:
        turns, root = (numpy.array(request[name]) for name in ("rotations_wxyz", "root_xyz_m"))
        turns, root = self.streams[request["stream"]](turns, root)
        return {"rotations_wxyz": _as_array(turns).tolist(), "root_xyz_m": _as_array(root).tolist()}

    def _on_describe(self, request: dict[str, Any]) -> dict[str, Any]:
        return {"description": self.module.describe()}

    def _on_fit(self, request: dict[str, Any]) -> dict[str, Any]:
        def progress(what: str, done: int, total: int) -> None:
            event = {"event": "progress", "id": request["id"], "what": str(what), "done": int(done)}
            # No cancelling in the middle of a line.
            running, self.running = self.running, None
            self.channel.send(dict(event, total=int(total)))
            self.running = running
            if running in self.cancelled:
                raise Cancelled()

        takes = [self._motion(take) for take in request["takes"]]
        self._call("fit", takes, seed=request["seed"], budget=request["budget"], progress=progress)
        return {}

    def _on_save(self, request: dict[str, Any]) -> dict[str, Any]:
        self.module.save(str(self.exchange / request["folder"]))
        return {}

    def _on_load(self, request: dict[str, Any]) -> dict[str, Any]:
        self.module.load(str(self.exchange / request["folder"]))
        return {}

    def _has(self, name: str) -> bool:
        return callable(getattr(self.module, name, None))

    def _one(self, request: dict[str, Any], name: str, *arguments: Any) -> dict[str, Any]:
        return {"files": [self._keep(self._call(name, *arguments, seed=request["seed"]), request["answer"])]}

    def _call(self, name: str, *arguments: Any, **optional: Any) -> Any:
        """Call the user's function with the optional arguments it has, all usual generators seeded."""
        function = getattr(self.module, name)
        _seed_generators(optional["seed"])
        if name not in self.known:
            self.known[name] = list(inspect.signature(function).parameters)
        answer = function(*arguments, **{key: value for key, value in optional.items() if key in self.known[name]})
        self.channel.leave_if_forked()
        return answer

    def _motion(self, entry: dict[str, Any]) -> Motion:
        path = str(self.exchange / entry["file"])
        motion = self.kept.get(path) or self._read(path, entry["fps"])
        if entry.get("kept") and path not in self.kept:
            if len(self.kept) >= KEPT_MOTIONS:
                self.kept.clear()
            self.kept[path] = motion
        fresh = motion.with_motion(motion.rotations_wxyz.copy(), motion.root_xyz_m.copy())
        fresh.content, fresh.style, fresh.path = entry["content"], entry["style"], path
        return fresh

    def _read(self, path: str, fps: float) -> Motion:
        if path.endswith(".bvh"):
            return read_bvh(path)
        arrays = _read_npz(path)
        turns, root, offsets = (arrays[name] for name in ARRAYS)
        return Motion(turns, root, offsets, self.names, self.parents, fps, path=path)

    def _keep(self, answer: Any, name: str) -> str:
        """Store an answer in the exchange folder; its file name there."""
        if isinstance(answer, (str, os.PathLike)):
            return self._put(name + ".bvh", lambda path: shutil.copyfile(os.fspath(answer), path))
        if isinstance(answer, (tuple, list)) and len(answer) == 2:
            answer = {"rotations_wxyz": answer[0], "root_xyz_m": answer[1]}
        elif isinstance(answer, Motion):
            answer = vars(answer)
        if not isinstance(answer, dict):
            raise TypeError(f"answer with (rotations_wxyz, root_xyz_m), got {type(answer).__name__}")
        wanted = ARRAYS if "offsets_m" in answer else ARRAYS[:2]
        arrays = {key: _as_array(answer[key]) for key in wanted}
        return self._put(name + ".npz", lambda path: numpy.savez(path, **arrays))

    def _put(self, name: str, write: Callable[[str], Any]) -> str:
        """Write a file that appears whole or not at all, and only from the worker: a fork of it has another part."""
        part = self.exchange / f"part-{os.getpid()}-{name}"
        write(str(part))
        self.channel.leave_if_forked()
        part.replace(self.exchange / name)
        return name


def _read_npz(path: str) -> dict[str, Any]:
    """The arrays of a motion: three times as fast as numpy.load, since the benchmark writes plain float64 only."""
    arrays = {}
    with zipfile.ZipFile(path) as archive:
        for member in archive.namelist():
            data = archive.read(member)
            start = data.index(b"\n") + 1
            shape = data[:start].split(b"(")[1].split(b")")[0].split(b",")
            lengths = [int(length) for length in shape if length.strip()]
            arrays[member[: -len(".npy")]] = numpy.frombuffer(data, "<f8", offset=start).reshape(lengths)
    return arrays


def _as_array(values: Any) -> Any:
    if hasattr(values, "detach"):
        values = values.detach().cpu().numpy()
    return numpy.asarray(values, dtype=numpy.float64)


def _seed_generators(seed: int) -> None:
    # Research code draws from the global generators; the same task must give the same answer in any order.
    python_random.seed(seed)
    numpy.random.seed(seed % 2**32)  # noqa: NPY002
    seed_torch = getattr(sys.modules.get("torch"), "manual_seed", None)
    if seed_torch is not None:
        seed_torch(seed)


def load_module(path: str) -> Any:
    """The user's file as a module; files beside it can be imported from it."""
    file = Path(path).resolve()
    sys.path.insert(0, str(file.parent))
    name = file.stem
    spec = importlib.util.spec_from_file_location(name, str(file))
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def serve(module: Any) -> None:
    """Answer with the functions of a module or object; returns when the benchmark is done."""
    Worker(module, Channel()).run()


def main() -> None:
    """``python worker.py my_code.py``."""
    if len(sys.argv) != 2:
        sys.exit("usage: python worker.py my_code.py")
    channel = Channel()
    Worker(load_module(sys.argv[1]), channel).run()


if __name__ == "__main__":
    main()
