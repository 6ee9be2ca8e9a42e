"""Environment of a run: software versions, the machine, the state of the sources."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import lacmesh

#: packages whose versions may matter
_PACKAGES = ("numpy", "scipy", "numba", "rslab", "pyamg", "sympy", "gmsh", "pyvista", "matplotlib")


def environment() -> dict[str, str]:
    """Names and values, in the order of the report."""
    versions = {
        "lacmesh": lacmesh.__version__,
        "commit": _commit(),
        "Python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "cores": str(cores()),
        "memory": _memory(),
    }
    return {**versions, **{name: _version(name) for name in _PACKAGES}}


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "absent"


def _commit() -> str:
    """The commit of the sources, and whether they differ from it."""
    root = Path(__file__).resolve().parents[2]
    git = shutil.which("git")
    if git is None or not (root / ".git").exists():
        return "unknown"

    def said(*words: str) -> str:
        child = subprocess.run([str(git), *words], cwd=root, capture_output=True, text=True, check=False)
        return child.stdout.strip()

    changed = said("status", "--porcelain", "--", "lacmesh", "lacsolver", "verification")
    return (said("rev-parse", "--short=12", "HEAD") or "unknown") + (", with changes" if changed else "")


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    names = [line for line in info.read_text().splitlines() if line.startswith("model name")] if info.exists() else []
    return names[0].partition(":")[2].strip() if names else platform.processor() or "unknown"


def _memory() -> str:
    try:
        return f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 2**30:.0f} GiB"
    except (ValueError, OSError, AttributeError):
        return "unknown"
