"""A running outside program: one JSON object a line on its stdin and stdout, deadlines on everything.

A request ``{"id": 7, "call": "transfer", ...}`` is answered by ``{"id": 7, "ok": true, ...}`` or by ``{"id": 7,
"ok": false, "error": {"type": ..., "text": ...}}``; before it may come ``{"event": "heartbeat"}`` and ``{"event":
"progress", "id": 7, "what": ..., "done": 1, "total": 9}``. ``{"id": 7, "call": "cancel"}`` and ``{"call": "stop"}``
have no answer of their own. What the program writes to stderr is its log.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bench.adapters.base import ProgressCallback
from bench.adapters.guarded import Guarded
from bench.adapters.program import Program
from bench.errors import BenchError, MethodFailed

PROTOCOLS = [1]
HEARTBEAT_S = 2.0
MAX_LINE_BYTES = 1 << 20
SHARED_MEMORY = Path("/dev/shm")
SHARED_MEMORY_MIN_BYTES = 2 << 30


class Refused(MethodFailed):
    """The program answered a request with an error; it still runs."""


class OutOfTime(MethodFailed):
    """The program did not answer in time."""


class Session:
    """A started program. Ends with :meth:`close`, with this object, or with this process, however that ends.

    Attributes
    ----------
    exchange : the folder through which motions travel.
    heartbeat : whether the program promised signs of life.
    says : what it told of itself: versions of its interpreter and libraries.
    """

    def __init__(self, program: Program, *, log_fd: int = 2) -> None:
        self.program = program
        self.exchange = Path(tempfile.mkdtemp(prefix="stylebench-", dir=_exchange_parent()))
        self.program_exchange = Path(program.exchange_inside or self.exchange)
        self.heartbeat = False
        self.says = ""
        self._last_id = -1
        self._abandoned: set[int] = set()
        self._buffer = b""
        try:
            command = program.command_line(self.exchange)
        except BaseException:
            shutil.rmtree(self.exchange, ignore_errors=True)
            raise
        self._guarded = Guarded(
            command,
            self.exchange,
            working_folder=program.working_folder,
            environment=_environment(program),
            log_fd=log_fd,
        )
        os.set_blocking(self._guarded.requests, False)

    @property
    def is_open(self) -> bool:
        return self._guarded.is_open

    @property
    def pid(self) -> int:
        """Process id of the guard; the program and its children descend from it."""
        return self._guarded.process.pid

    def request(
        self, call: str, fields: dict[str, Any], timeout_s: float, progress: ProgressCallback | None = None
    ) -> dict[str, Any]:
        """Ask and wait for the answer.

        Raises
        ------
        Refused : the program answered with an error.
        OutOfTime : time was up; the program was told to stop that request, or killed where it did not listen.
        MethodFailed : anything else than an answer; the program is killed.
        """
        if not self.is_open:
            raise MethodFailed("the program has been stopped", where=self.program.name)
        self._last_id += 1
        number = self._last_id
        try:
            deadline = time.monotonic() + timeout_s
            self._send({"id": number, "call": call, **fields}, call)
            answer = self._answer(number, call, deadline, progress)
            if answer is None:
                self._cancel(number, call, timeout_s)
        except BaseException:
            # Whoever broke the protocol, or was interrupted in it, cannot be asked again.
            self.close(kill=True)
            raise
        if answer is None:
            raise OutOfTime(f"no answer to {call!r} within {timeout_s:g} s; it was cancelled", where=self.program.name)
        if not answer["ok"]:
            error = answer.get("error")
            shown = f"{error.get('type')}: {error.get('text')}" if isinstance(error, dict) else "it does not say why"
            raise Refused(f"{call} failed: {one_line(shown)}", where=self.program.name)
        return answer

    def close(self, *, kill: bool = False) -> None:
        """Ask the program to leave, then make it."""
        if not self.is_open:
            return
        if not kill:
            with contextlib.suppress(BenchError, subprocess.TimeoutExpired):
                self._send({"call": "stop"}, "stop")
                self._guarded.process.wait(self.program.timeouts.stop_s)
        self._guarded.end()

    def _send(self, message: dict[str, Any], call: str) -> None:
        data = memoryview((json.dumps(message, allow_nan=False) + "\n").encode())
        deadline = time.monotonic() + self.program.timeouts.silence_s
        while data:
            try:
                data = data[os.write(self._guarded.requests, data) :]
            except BlockingIOError:
                left = deadline - time.monotonic()
                if left <= 0.0:
                    problem = f"does not read its input: {call!r} could not be sent"
                    raise self._violation(problem, "it does not read lines from stdin") from None
                select.select([], [self._guarded.requests], [], left)
            except OSError:
                raise self._death(call) from None

    def _answer(
        self, number: int, call: str, deadline: float, progress: ProgressCallback | None
    ) -> dict[str, Any] | None:
        """The answer, or None where the deadline passes."""
        while True:
            line = self._line(call, deadline)
            if line is None:
                return None
            if call == "hello" and not line.lstrip().startswith(b"{"):
                # What activates an environment may print a banner before the program itself starts.
                self._guarded.printed += line[:1000] + b"\n"
                continue
            message = self._message(line, call)
            event = message.get("event")
            if event == "progress" and progress is not None and message["id"] == number:
                progress(message["what"], message["done"], message["total"])
            elif event is None and message["id"] in self._abandoned:
                self._abandoned.discard(message["id"])
            elif event is None and message["id"] != number:
                raise self._violation(f"answered request {message['id']}, but {number} was asked")
            elif event is None:
                return message

    def _cancel(self, number: int, call: str, timeout_s: float) -> None:
        """Tell the program that nobody waits any longer, and see whether it stops."""
        self._abandoned.add(number)
        self._send({"id": number, "call": "cancel"}, "cancel")
        deadline = time.monotonic() + self.program.timeouts.stop_s
        while number in self._abandoned:
            line = self._line(call, deadline)
            if line is None:
                problem = f"no answer to {call!r} within {timeout_s:g} s, and it did not stop when it was told to"
                raise OutOfTime(problem, where=self.program.name, remedy="raise [timeouts] in adapter.toml")
            self._abandoned.discard(self._message(line, call).get("id", -1))

    def _line(self, call: str, deadline: float) -> bytes | None:
        """The next line without its end, or None at the deadline."""
        last_sign = time.monotonic()
        # The deadline comes first: a flood of lines must not outrun it.
        while (now := time.monotonic()) < deadline and b"\n" not in self._buffer:
            silence = last_sign + self.program.timeouts.silence_s if self.heartbeat else deadline
            if now >= silence:
                problem = f"no sign of life for {self.program.timeouts.silence_s:g} s during {call!r}"
                raise self._violation(problem, "it hangs in one long call that lets no other thread run")
            if not select.select([self._guarded.answers], [], [], min(deadline, silence) - now)[0]:
                continue
            data = os.read(self._guarded.answers, 65536)
            if not data:
                raise self._death(call)
            last_sign = time.monotonic()
            self._buffer += data
            if len(self._buffer) > MAX_LINE_BYTES and b"\n" not in self._buffer[:MAX_LINE_BYTES]:
                raise self._violation(f"wrote more than {MAX_LINE_BYTES} bytes without an end of line")
        if now >= deadline:
            return None
        line, self._buffer = self._buffer.split(b"\n", 1)
        return line

    def _message(self, line: bytes, call: str) -> dict[str, Any]:
        try:
            return parse_message(line)
        except MethodFailed as error:
            cause = "it prints to stdout, which belongs to the protocol"
            remedy = "send what is printed to stderr; worker.py does that by itself"
            raise self._violation(f"{error.problem} (during {call!r})", cause, remedy) from None

    def _violation(self, problem: str, cause: str = "", remedy: str = "see its log") -> MethodFailed:
        return MethodFailed(problem, where=self.program.name, cause=cause or self._last_words(), remedy=remedy)

    def _death(self, call: str) -> MethodFailed:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._guarded.process.wait(6.0)
        code = self._guarded.process.returncode
        if code is None:
            return self._violation(f"closed its output during {call!r}", "it closed stdout, which it must keep open")
        how = f"was ended by signal {code - 128}" if code > 128 else f"ended with exit code {code}"
        cause = self._last_words() or ("out of memory" if code == 128 + 9 else "")
        return MethodFailed(f"the program {how} during {call!r}", where=self.program.name, cause=cause)

    def _last_words(self) -> str:
        return one_line(self._guarded.last_words())


def parse_message(line: bytes) -> dict[str, Any]:
    """One line of a program as an answer or an event.

    Raises
    ------
    MethodFailed : neither.
    """
    shown = one_line(line[:80].decode("utf-8", "replace"))
    try:
        message = json.loads(line, parse_constant=_no_constant)
    except (ValueError, RecursionError):
        raise MethodFailed(f"wrote what is no JSON: {shown!r}") from None
    if not isinstance(message, dict):
        raise MethodFailed(f"wrote JSON that is no object: {shown!r}")
    match message.get("event"):
        case "heartbeat":
            return message
        case "progress":
            numbers = [message.get(key) for key in ("id", "done", "total")]
            if not isinstance(message.get("what"), str) or not all(type(number) is int for number in numbers):
                raise MethodFailed(f"wrote progress without id, what, done and total: {shown!r}")
            return {**message, "what": one_line(message["what"])}
        case None:
            if type(message.get("id")) is not int or type(message.get("ok")) is not bool:
                raise MethodFailed(f"wrote an answer without a number 'id' and a true or false 'ok': {shown!r}")
            return message
    raise MethodFailed(f"wrote an unknown event: {shown!r}")


def one_line(text: str, length: int = 300) -> str:
    """Foreign text fit for a message: printable, one line, not too long."""
    words = "".join(character if character.isprintable() else " " for character in text[: 4 * length]).split()
    shown = " ".join(words)
    return shown if len(shown) <= length else shown[: length - 3] + "..."


def _no_constant(name: str) -> Callable[[], None]:
    raise ValueError(f"{name} is not JSON")


def _exchange_parent() -> Path | None:
    """Memory rather than disk where there is enough of it; None is the usual place for temporary files."""
    with contextlib.suppress(OSError):
        if os.access(SHARED_MEMORY, os.W_OK) and shutil.disk_usage(SHARED_MEMORY).free > SHARED_MEMORY_MIN_BYTES:
            return SHARED_MEMORY
    return None


def _environment(program: Program) -> dict[str, str]:
    """This process's environment without what would lead another interpreter back into this one."""
    own = ("VIRTUAL_ENV", "__PYVENV_LAUNCHER__")
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON") and name not in own}
    return {**kept, "PYTHONUNBUFFERED": "1", **program.environment}
