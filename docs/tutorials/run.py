"""Run the commands of the tutorials as their pages stand, and keep the pictures they make beside the pages.

python docs/tutorials/run.py        needs gmsh, pyvista and scikit-fem; writes docs/tutorials/*.png
"""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from lacmesh.cli import main as lacmesh
from lacsolver.cli import main as lacsolver

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PROGRAMS = {"lacmesh": lacmesh, "lacsolver": lacsolver}
PAGES = ("first_run.md", "flange.md", "friction.md", "own_mesh.md", "pin_in_lug.md", "step_to_med.md")


class Command(NamedTuple):
    """A line that begins with `$` on a page, as words, and the lines that the page shows of what it prints."""

    words: list[str]
    shown: list[str]


def blocks(page: Path, language: str) -> list[str]:
    """The blocks of code of a page that are in a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def commands(page: Path) -> list[Command]:
    """The commands of a page, in their order; a line that ends with a backslash goes on in the next."""
    found: list[Command] = []
    for line in "".join(blocks(page, "console")).replace("\\\n", "").splitlines():
        if line.startswith("$ "):
            found.append(Command(shlex.split(line[2:]), []))
        elif line.strip():
            found[-1].shown.append(line)
    return found


def run_page(page: Path, folder: Path) -> Iterator[tuple[Command, str]]:
    """Run the commands of a page in a folder that has the data and the scripts; each with what it printed.

    A block of TOML is there as well, in the file that its first line names.
    """
    shutil.copytree(ROOT / "data", folder / "data", dirs_exist_ok=True)
    shutil.copytree(HERE, folder / "docs" / "tutorials", dirs_exist_ok=True, ignore=shutil.ignore_patterns("*.png"))
    for case in blocks(page, "toml"):
        (folder / case.split()[1]).write_text(case, encoding="utf-8")
    for command in commands(page):
        with contextlib.chdir(folder):
            yield command, run(command.words)


def pictures(page: Path) -> list[str]:
    """The pictures that a page shows and that its commands make: those beside it."""
    return re.findall(r"!\[[^\]]+\]\(([^)\s/]+\.png)\)", page.read_text(encoding="utf-8"))


def run(words: list[str]) -> str:
    """Run `lacmesh`, `lacsolver` or `python`; what it printed. Raises SystemExit where it fails."""
    program, *rest = words
    if program == "python":
        return subprocess.run([sys.executable, *rest], stdout=subprocess.PIPE, text=True, check=True).stdout
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        status = PROGRAMS[program](rest)
    if status:
        raise SystemExit(f"{shlex.join(words)} ended with status {status}")
    return printed.getvalue()


def main() -> None:
    """Run all pages, and keep their pictures."""
    for page in PAGES:
        with tempfile.TemporaryDirectory() as folder:
            for command, printed in run_page(HERE / page, Path(folder)):
                print(f"$ {shlex.join(command.words)}\n{printed}")
            for picture in pictures(HERE / page):
                shutil.copy(Path(folder, picture), HERE)


if __name__ == "__main__":
    main()
