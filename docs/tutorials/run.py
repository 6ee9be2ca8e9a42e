"""Run the commands of the tutorials as their pages stand, and keep the pictures they make beside the pages.

python docs/tutorials/run.py        needs gmsh, pyvista and CalculiX; writes docs/tutorials/*.png
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
PAGES = (
    "bolt_script.md",
    "flange.md",
    "friction.md",
    "from_calculix.md",
    "gmsh_script.md",
    "impact.md",
    "own_mesh.md",
    "own_solver.md",
    "p0_mortar.md",
    "pin_in_lug.md",
    "step_to_med.md",
)


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
    """Run the commands of a page in a folder that has what of the checkout they name; each with what it printed.

    A block of TOML is there as well, in the file that its first line names.
    """
    of_pages = (
        "bolt_forces",
        "bolt_script",
        "stick_and_slip",
        "from_calculix",
        "gmsh_script",
        "own_mesh",
        "half_width",
        "own_solver",
        "p0_mortar",
    )
    scripts = [f"docs/tutorials/{name}.py" for name in of_pages]
    impacts = [f"data/impact/{name}.{end}" for name in ("bar_on_wall", "dropping_ball") for end in ("msh", "toml")]
    rubbed = [f"data/friction/{name}.{end}" for name in ("clamp", "cylinders") for end in ("msh", "toml")]
    rubbed += ["data/flange/flange.msh", "data/flange/flange.toml"]
    for name in ("data/disc_on_block.msh", "data/pin_in_lug.step", "data/punch.inp", *impacts, *rubbed, *scripts):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    for case in blocks(page, "toml"):
        (folder / case.split()[1]).write_text(case, encoding="utf-8")
    for command in commands(page):
        with contextlib.chdir(folder):
            yield command, run(command.words)


def run(words: list[str]) -> str:
    """Run `lacmesh`, `lacsolver`, `python` or `ccx`; what it printed. Raises SystemExit where it fails."""
    program, *rest = words
    if program in ("python", "ccx"):
        program = sys.executable if program == "python" else program
        return subprocess.run([program, *rest], stdout=subprocess.PIPE, text=True, check=True).stdout
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
            for picture in Path(folder).glob("*.png"):
                shutil.copy(picture, HERE)


if __name__ == "__main__":
    main()
