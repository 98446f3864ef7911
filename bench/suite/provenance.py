"""Where and with what a number was made."""

from __future__ import annotations

import platform
import subprocess
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from reports.records import Provenance

PACKAGES = ("stylebench", "numpy", "scipy", "numba", "torch", "scikit-learn", "pandas")
ROOT = Path(__file__).resolve().parents[2]


def provenance(command: str, *, threads: int, wall_s: float, peak_rss_mb: float, gpu: str = "") -> Provenance:
    """The provenance of a record made now, on this machine, with this checkout."""
    commit, dirty = checkout()
    return Provenance(
        commit=commit,
        dirty=dirty,
        packages=package_versions(),
        python=platform.python_version(),
        cpu=cpu_model(),
        gpu=gpu,
        threads=threads,
        time_utc=datetime.now(UTC).isoformat(timespec="seconds"),
        wall_s=round(wall_s, 3),
        peak_rss_mb=round(peak_rss_mb, 1),
        command=command,
    )


@cache
def checkout() -> tuple[str, bool]:
    """Commit of this checkout and whether code differs from it; empty where it is no checkout."""
    try:
        commit = _git("rev-parse", "HEAD")
        changed = _git("status", "--porcelain", "--", "bench", "classifiers", "reports", "pyproject.toml")
    except (OSError, subprocess.CalledProcessError):
        return "", False
    return commit, bool(changed)


def _git(*arguments: str) -> str:
    found = subprocess.run(["git", "-C", str(ROOT), *arguments], check=True, capture_output=True, text=True)
    return found.stdout.strip()


@cache
def package_versions() -> dict[str, str]:
    """Installed versions of the packages that numbers depend on."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


@cache
def cpu_model() -> str:
    """Model name of the processor, as the system gives it."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
