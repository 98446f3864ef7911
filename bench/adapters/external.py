"""An outside program as an adapter: ``adapter.toml`` says how to start it, ``session`` talks to it.

The program runs in its own interpreter, environment or container and is never imported. It starts with the first call
and stays for the following ones; after a violation of the protocol it is killed, and the next call starts it anew.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from bench.adapters.answers import checked_answer
from bench.adapters.base import CAPABILITIES, Adapter, Description, ProgressCallback, Stream
from bench.adapters.motion_files import npz_bytes, read_motion
from bench.adapters.program import Program, read_program
from bench.adapters.session import HEARTBEAT_S, PROTOCOLS, Session, one_line
from bench.arrays import FloatArray, finite_array
from bench.datasets.take import Take
from bench.errors import BadConfig, BadFile, BadInput, BadOutput, MethodFailed
from bench.motion.bvh import write_bvh
from bench.motion.clip import Clip
from bench.motion.skeleton import CANONICAL_NAMES, CANONICAL_PARENTS

KEPT_STYLES = 256


def external_adapter(toml_file: Path) -> type[External]:
    """The adapter class of an ``adapter.toml``.

    Raises
    ------
    BadConfig : the file is not readable or not right.
    """
    program = read_program(toml_file)
    facts = {
        "name": program.name,
        "title": program.title,
        "description": program.description,
        "traits": program.traits,
        "program": program,
        "__module__": __name__,
        "__doc__": f"The outside program of {toml_file}.",
    }
    return type("OutsideProgram", (External,), facts)


class External(Adapter):
    """Base of the classes made by :func:`external_adapter`."""

    program: ClassVar[Program]
    log_fd: int = 2
    """where the program's stderr goes"""

    def __init__(self) -> None:
        self._session: Session | None = None
        self._weights: Path | None = None
        self._fitted_here = False
        self._styles: dict[str, str] = {}
        self._count = 0

    @classmethod
    def capabilities(cls) -> tuple[str, ...]:
        """Those that ``adapter.toml`` names."""
        return tuple(name for name in CAPABILITIES if name in cls.program.capabilities)

    @classmethod
    def fits(cls) -> bool:
        return cls.program.fits

    @classmethod
    def digest_files(cls) -> tuple[Path, ...]:
        """The files that decide its answers: ``adapter.toml`` and those it lists."""
        return cls.program.digest_files()

    def session(self) -> Session:
        """The running program; started and asked for what it can where it does not run yet.

        Raises
        ------
        BadConfig : it cannot be started, or lacks a capability that ``adapter.toml`` names.
        MethodFailed : it does not answer as the protocol says.
        """
        if self._session is None or not self._session.is_open:
            if self._fitted_here:
                self._fitted_here = False
                problem = "the program ended after fit() and before save(); what it learned is lost"
                raise MethodFailed(problem, where=self.program.name)
            self._styles.clear()
            self._session = Session(self.program, log_fd=self.log_fd)
            try:
                self._greet(self._session)
                if self._weights is not None:
                    self._load(self._session, self._weights)
            except BaseException:
                self._session.close(kill=True)
                raise
        return self._session

    @property
    def is_running(self) -> bool:
        return self._session is not None and self._session.is_open

    def close(self) -> None:
        """Let the program leave; the next call starts it again."""
        if self._session is not None:
            self._session.close()

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return self.transfer_batch([(content, style)], rngs=[rng])[0]

    def transfer_batch(
        self,
        pairs: Sequence[tuple[Take, Take]],
        *,
        rngs: Sequence[np.random.Generator],
        timeout_s: float | None = None,
    ) -> list[Clip]:
        """Several transfers in one message; each has its own generator, so that answers do not depend on the batch.

        ``timeout_s`` replaces the time that ``adapter.toml`` gives them.
        """
        self._require("transfers")
        session = self.session()
        contents = [self._give(content) for content, _ in pairs]
        styles = [self._give_kept(style) for _, style in pairs]
        stems = [self._name() for _ in pairs]
        tasks = [
            {"content": content, "style": style, "answer": stem, "seed": seed(rng)}
            for content, style, stem, rng in zip(contents, styles, stems, rngs, strict=True)
        ]
        limit_s = self.program.timeouts.task_s * len(tasks) if timeout_s is None else timeout_s
        answer = session.request("transfer", {"tasks": tasks}, limit_s)
        clips = self._receive(answer, stems, [content.clip for content, _ in pairs])
        self._forget([entry["file"] for entry in contents])
        return clips

    def sample(self, content: Take, style_label: str, *, rng: np.random.Generator) -> Clip:
        return self._one("samples", content, {"style_label": style_label}, rng)

    def interpolate(self, content: Take, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator) -> Clip:
        self.session()
        mixed = [[self._give_kept(style), weight] for style, weight in styles]
        return self._one("interpolates", content, {"styles": mixed}, rng)

    def interpolate_parts(
        self, content: Take, part: str, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator
    ) -> Clip:
        self.session()
        mixed = [[self._give_kept(style), weight] for style, weight in styles]
        return self._one("interpolates parts", content, {"part": part, "styles": mixed}, rng)

    def transfer_parts(self, content: Take, styles: Mapping[str, Take], *, rng: np.random.Generator) -> Clip:
        self.session()
        by_part = {part: self._give_kept(style) for part, style in styles.items()}
        return self._one("transfers parts", content, {"styles": by_part}, rng)

    def predict(self, past: Clip, style: Take, trajectory_xz_m: FloatArray) -> Clip:
        self._require("predicts")
        session = self.session()
        fields: dict[str, Any] = {"past": self._give(Take(past)), "style": self._give_kept(style), "seed": 0}
        fields.update(trajectory_xz_m=np.asarray(trajectory_xz_m).tolist(), answer=self._name())
        answer = session.request("predict", fields, self.program.timeouts.task_s)
        [clip] = self._receive(answer, [fields["answer"]], [past], check=False)
        self._forget([fields["past"]["file"]])
        return clip

    def open_stream(self, style: Take, *, content_label: str | None, rng: np.random.Generator) -> Stream:
        self._require("streams")
        session = self.session()
        self._count += 1
        fields = {"style": self._give_kept(style), "content_label": content_label, "seed": seed(rng)}
        session.request("open_stream", {**fields, "stream": self._count}, self.program.timeouts.task_s)
        return OutsideStream(session, self._count)

    def describe(self) -> Description:
        self._require("describes")
        answer = self.session().request("describe", {}, self.program.timeouts.task_s)
        facts = answer.get("description")
        known = ("parameters", "bytes_per_style", "designed_input_frames", "look_ahead_frames")
        numbers = {key: facts.get(key) for key in known} if isinstance(facts, dict) else {}
        if any(value is not None and type(value) is not int for value in numbers.values()) or not (
            isinstance(numbers.get("parameters"), int) and isinstance(numbers.get("bytes_per_style"), int)
        ):
            raise BadOutput("describe must give whole numbers 'parameters' and 'bytes_per_style'", where=self.name)
        return Description(**numbers)  # type: ignore[arg-type]

    def fit(self, takes: Sequence[Take], *, seed: int, budget: str, progress: ProgressCallback) -> None:
        self._require_fit()
        session = self.session()
        entries = [self._give(take) for take in takes]
        fields = {"takes": entries, "seed": seed, "budget": budget}
        session.request("fit", fields, self.program.timeouts.fit_s, progress)
        self._forget([str(entry["file"]) for entry in entries])
        self._fitted_here = True

    def save(self, folder: Path) -> None:
        self._require_fit()
        session = self.session()
        inside = session.exchange / self._name("weights")
        inside.mkdir()
        session.request("save", {"folder": inside.name}, self.program.timeouts.fit_s)
        copy_regular_files(inside, folder)
        shutil.rmtree(inside, ignore_errors=True)
        self._weights, self._fitted_here = folder, False

    def load(self, folder: Path) -> None:
        self._require_fit()
        self._load(self.session(), folder)
        self._weights = folder

    def _load(self, session: Session, folder: Path) -> None:
        inside = session.exchange / self._name("weights")
        inside.mkdir()
        copy_regular_files(folder, inside)
        session.request("load", {"folder": inside.name}, self.program.timeouts.fit_s)
        shutil.rmtree(inside, ignore_errors=True)

    def _greet(self, session: Session) -> None:
        fields = {
            "protocols": PROTOCOLS,
            "exchange": str(session.program_exchange),
            "motions": self.program.motions,
            "names": CANONICAL_NAMES,
            "parents": CANONICAL_PARENTS,
            "heartbeat_s": HEARTBEAT_S,
        }
        answer = session.request("hello", fields, self.program.timeouts.start_s)
        if answer.get("protocol") not in PROTOCOLS:
            raise MethodFailed(
                f"expected protocol 1, got {one_line(str(answer.get('protocol')), 40)!r}",
                where=self.name,
                remedy="copy the newer worker.py",
            )
        has = answer.get("capabilities")
        lacks = [name for name in self.program.capabilities if not isinstance(has, list) or name not in has]
        if lacks or (self.program.fits and answer.get("fits") is not True):
            raise BadConfig(
                f"adapter.toml promises that it {lacks[0] if lacks else 'fits'}, the program does not offer it",
                where=str(self.program.toml_file),
                cause="the function is missing or called differently",
                remedy=f"define {CAPABILITIES[lacks[0]] if lacks else 'fit, save and load'}, or correct adapter.toml",
            )
        session.heartbeat = answer.get("heartbeat") is True
        session.says = one_line(str(answer.get("program", "")), 120)

    def _one(self, capability: str, content: Take, fields: dict[str, Any], rng: np.random.Generator) -> Clip:
        self._require(capability)
        session = self.session()
        entry, stem = self._give(content), self._name()
        call = CAPABILITIES[capability]
        request = {"content": entry, "answer": stem, "seed": seed(rng), **fields}
        answer = session.request(call, request, self.program.timeouts.task_s)
        [clip] = self._receive(answer, [stem], [content.clip])
        self._forget([str(entry["file"])])
        return clip

    def _receive(
        self, answer: dict[str, Any], stems: Sequence[str], sources: Sequence[Clip], *, check: bool = True
    ) -> list[Clip]:
        names = answer.get("files")
        if not isinstance(names, list) or len(names) != len(stems):
            raise BadOutput(f"expected 'files' with {len(stems)} names", where=self.name)
        clips = []
        for name, stem, source in zip(names, stems, sources, strict=True):
            if name not in (f"{stem}.npz", f"{stem}.bvh"):
                shown = one_line(str(name), 80)
                raise BadOutput(f"expected the file {stem}.npz or {stem}.bvh, got {shown!r}", where=self.name)
            try:
                clip = read_motion(self.session().exchange, name, source, max_frames=source.n_frames)
            except BadFile as error:
                # The protocol was kept; what was answered is not a motion.
                raise BadOutput(error.problem, where=name, cause=error.cause, remedy=error.remedy) from None
            clips.append(checked_answer(clip, source, name) if check else clip)
        self._forget(names)
        return clips

    def _give(self, take: Take, name: str = "") -> dict[str, Any]:
        """Write a motion into the exchange folder; how a message refers to it."""
        file = f"{name or self._name('motion')}.{self.program.motions}"
        try:
            path = self.session().exchange / file
            if self.program.motions == "bvh":
                write_bvh(path, take.clip)
            else:
                arrays = {"rotations_wxyz": take.clip.rotations_wxyz, "root_xyz_m": take.clip.root_xyz_m}
                path.write_bytes(npz_bytes({**arrays, "offsets_m": take.clip.skeleton.offsets_m}))
        except OSError as error:
            raise MethodFailed(
                f"the exchange folder cannot be written ({error.strerror})",
                where=self.name,
                cause="the program removed it, or the disk is full",
            ) from None
        return {"file": file, "fps": take.clip.fps, "content": take.content, "style": take.style}

    def _give_kept(self, take: Take) -> dict[str, Any]:
        """As :meth:`_give`; the file stays, since the same style serves many tasks."""
        arrays = (take.clip.rotations_wxyz, take.clip.root_xyz_m, take.clip.skeleton.offsets_m)
        hasher = hashlib.blake2b(digest_size=12)
        for array in arrays:
            hasher.update(np.ascontiguousarray(array).data)
        digest = hasher.hexdigest()
        if digest not in self._styles:
            if len(self._styles) >= KEPT_STYLES:
                self._forget(list(self._styles.values()))
                self._styles.clear()
            self._styles[digest] = str(self._give(take, f"style-{digest}")["file"])
        entry = {"file": self._styles[digest], "fps": take.clip.fps, "content": take.content, "style": take.style}
        return {**entry, "kept": True}

    def _name(self, kind: str = "answer") -> str:
        self._count += 1
        return f"{kind}-{self._count:06d}"

    def _forget(self, names: Sequence[str]) -> None:
        if self._session is not None and self.is_running:
            for name in names:
                (self._session.exchange / name).unlink(missing_ok=True)

    def _require(self, capability: str) -> None:
        if capability not in self.program.capabilities:
            raise self._cannot(capability)

    def _require_fit(self) -> None:
        if not self.program.fits:
            raise BadConfig(f"adapter {self.name!r} does not fit", remedy="set fits = true in adapter.toml")


class OutsideStream:
    """One open stream of an outside program."""

    def __init__(self, session: Session, number: int) -> None:
        self.session = session
        self.number = number

    def step(self, rotations_wxyz: FloatArray, root_xyz_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """One frame ``[J, 4]`` and ``[3]`` in, the same out.

        Raises
        ------
        BadOutput : another shape, or numbers that are not finite.
        """
        turns, root = np.asarray(rotations_wxyz), np.asarray(root_xyz_m)
        fields = {"stream": self.number, "rotations_wxyz": turns.tolist(), "root_xyz_m": root.tolist()}
        answer = self.session.request("step", fields, self.session.program.timeouts.task_s)
        try:
            return (
                finite_array(answer.get("rotations_wxyz", ()), "rotations_wxyz", turns.shape),
                finite_array(answer.get("root_xyz_m", ()), "root_xyz_m", root.shape),
            )
        except (BadInput, TypeError, ValueError) as error:
            raise BadOutput(one_line(str(error)), where="step") from None


def seed(rng: np.random.Generator) -> int:
    """The seed that an outside program gets for a task: 32 bits, so that every language and library takes it."""
    return int(rng.integers(2**32))


def copy_regular_files(source: Path, target: Path) -> None:
    """Copy a folder's files, folders included; links and devices are refused.

    Raises
    ------
    BadOutput : something in it is neither a file nor a folder.
    """
    for path in sorted(source.rglob("*")):
        place = target / path.relative_to(source)
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            raise BadOutput("is neither a file nor a folder", where=str(path.relative_to(source)))
        if path.is_dir():
            place.mkdir(parents=True, exist_ok=True)
        else:
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, place)
