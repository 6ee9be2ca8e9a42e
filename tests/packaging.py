"""Wheels of this checkout, and environments that hold no more than some packages."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import sysconfig
import tomllib
import venv
from importlib.metadata import Distribution, distribution
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PACKAGES = ("lacmesh", "lacsolver", "verification")
PIP = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]


def build(folder):
    """The wheel and the source distribution, as `make wheel` builds them, in a folder."""
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    subprocess.run(command, check=True, capture_output=True)
    (wheel,), (source,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    return wheel, source


def bare(requirement):
    """The name of the package that is required: `numpy` of `numpy>=1.26; extra == 'x'`."""
    return re.match(r"[\w.-]+", requirement)[0]


def packages_of(requirements):
    """The distributions that requirements ask for, and those that these need, by name; what is optional is left out."""
    needed, waiting = {}, [bare(requirement) for requirement in requirements]
    while waiting:
        name = waiting.pop()
        if name not in needed:
            needed[name] = distribution(name)
            waiting += [bare(r) for r in needed[name].requires or () if "extra" not in r and not _foreign(r)]
    return needed


def _foreign(requirement):
    """True for a requirement of another Python or system: it is not installed here."""
    try:
        distribution(bare(requirement))
    except ModuleNotFoundError:
        return ";" in requirement
    return False


def linked_environment(folder, requirements):
    """The Python of a new environment that has the packages required, as links to those installed here, and no more."""
    venv.create(folder)
    inside = Path(sysconfig.get_path("purelib", "venv", {"base": str(folder), "platbase": str(folder)}))
    for package in packages_of(requirements).values():
        for name in _entries(package):
            if not (inside / name).exists():
                (inside / name).symlink_to(Path(package.locate_file(name)).resolve())
    return Path(folder, "bin", "python")


def _entries(package: Distribution):
    """The files and folders of a package in `site-packages`."""
    return {file.parts[0] for file in package.files or () if file.parts[0] not in ("..", "__pycache__")}


def install(python, wheel):
    """Install a wheel, without what it requires; what Python compiles of it comes as it is imported."""
    subprocess.run([*PIP, "--python", str(python), "install", "--no-deps", "--no-compile", str(wheel)], check=True)


def user_environment(folder):
    """The variables of a user's shell, with the programs of an environment first."""
    env = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "MYPY", "MAKE"))}
    return env | {"PATH": f"{folder / 'bin'}{os.pathsep}{env['PATH']}"}
