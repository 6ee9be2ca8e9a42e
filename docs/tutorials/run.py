"""Run the tutorials as their pages stand, and keep the pictures they make beside the pages.

python docs/tutorials/run.py        needs gmsh and pyvista; writes docs/tutorials/*.png
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from lacmesh.cli import main as lacmesh

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]


class Command(NamedTuple):
    """A line that begins with `$` on a page, as words, and the lines that the page shows of what it prints."""

    words: list[str]
    shown: list[str]


def blocks(page: Path, language: str) -> list[str]:
    """The blocks of code of a page that are in a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def commands(page: Path) -> list[Command]:
    """The commands of a page, in their order."""
    found: list[Command] = []
    for line in "".join(blocks(page, "console")).splitlines():
        if line.startswith("$ "):
            found.append(Command(shlex.split(line[2:]), []))
        elif line.strip():
            found[-1].shown.append(line)
    return found


def run_page(page: Path, folder: Path) -> list[tuple[Command, str]]:
    """Run the commands of a page in a folder that has the checkout's `data/`; each with what it printed."""
    shutil.copytree(ROOT / "data", folder / "data", dirs_exist_ok=True)
    done = []
    with contextlib.chdir(folder):
        for command in commands(page):
            name, *rest = command.words
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed):
                status = lacmesh(rest)
            if name != "lacmesh" or status:
                raise SystemExit(f"{page.name}: {shlex.join(command.words)} ended with status {status}")
            done.append((command, printed.getvalue()))
    return done


def run_script(folder: Path) -> str:
    """Run gmsh_script.py in a folder; what it printed."""
    done = subprocess.run(
        [sys.executable, str(HERE / "gmsh_script.py"), str(folder)], capture_output=True, text=True, check=True
    )
    return done.stdout


def draw_script(folder: Path) -> None:
    """The picture of what gmsh_script.py left in a folder."""
    import lacmesh
    from lacmesh.view import picture

    mesh = lacmesh.read(folder / "roller.med")
    title = f"{lacmesh.Cut(mesh).n_macros} slave faces of HEXA8, cut into hexahedra"
    picture(mesh, folder / "roller.png", master="roller_face", camera=(1.0, -1.2, 1.2), explode=0.25, title=title)


def main() -> None:
    """Run both, and keep their pictures."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(os.path.realpath(name))
        run_script(folder)
        draw_script(folder)
        for _, printed in run_page(HERE / "step_to_med.md", folder):
            print(printed)
        for picture in folder.glob("*.png"):
            shutil.copy(picture, HERE)


if __name__ == "__main__":
    main()
