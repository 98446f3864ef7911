"""The one exception family. Each error says what is wrong, where, the likely cause and the remedy, in one line."""

from __future__ import annotations


class BenchError(Exception):
    """Base of everything this package raises on purpose.

    Parameters
    ----------
    problem : what was expected and what came.
    where : ``file:line``, a sample id, an argument name; empty if the problem says it.
    cause : the likely cause, as far as it can be guessed.
    remedy : what the reader can do about it.
    """

    def __init__(self, problem: str, *, where: str = "", cause: str = "", remedy: str = "") -> None:
        self.problem = problem
        self.where = where
        self.cause = cause
        self.remedy = remedy
        parts = [f"{where}: {problem}" if where else problem]
        if cause:
            parts.append(f"likely cause: {cause}")
        if remedy:
            parts.append(f"remedy: {remedy}")
        super().__init__("; ".join(parts))


class BadInput(BenchError):
    """An argument of a function has the wrong shape, range or content."""


class BadMotion(BenchError):
    """A motion is not what it claims to be: wrong shape, NaN, non-unit rotations, another skeleton."""


class BadFile(BenchError):
    """A file or archive cannot be read as what it should be."""


class BadConfig(BenchError):
    """A name, option or configuration value does not exist or does not fit the rest."""


class BadData(BenchError):
    """A dataset is missing, incomplete or not labelled as needed."""


class BadOutput(BenchError):
    """A method returned something that cannot be scored."""


class MethodFailed(BenchError):
    """A method raised, hung, ran out of memory or died."""


class JudgeRefused(BenchError):
    """A judge is missing, has another digest than its card, or cannot tell real motions apart."""
