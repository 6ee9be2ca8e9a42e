"""Make figures, pictures, films and the site of the pages: `python docs/make.py [--check] [PART ...]`.

    figures      docs/figures/*.svg, every pattern of the cut, and the short tables that stand in pages
    pictures     docs/figures/*.png; needs gmsh and pyvista
    films        docs/sliding/*.png and build/films/*.gif, of the cases of data/sliding; some minutes
    tutorials    docs/tutorials/*.png: runs the commands of the tutorials as their pages stand
    site         build/site, with Sphinx; a link that leads nowhere is an error

`--check` writes nothing, and fails where a figure or a table is out of date. Pictures are kept small: at most 1,000
pixels wide, with a palette.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import figures as drawn
from tables import TABLES, with_tables

import lacmesh
from lacmesh.cli import main as lacmesh_main
from lacsolver.cli import main as lacsolver_main

DOCS = Path(__file__).resolve().parent
ROOT, FIGURES, TUTORIALS = DOCS.parent, DOCS / "figures", DOCS / "tutorials"
PROGRAMS = {"lacmesh": lacmesh_main, "lacsolver": lacsolver_main}
#: how each case is shown: its title, and options of `lacsolver.film`
SHOWN = {
    "ring": {
        "title": "A ring on a block",
        "curves": ["-probe.ends.uy:-reaction.ends.y"],
        "log": True,
        "scale": (1.0, 20000.0),
    },
    "ironing_2d": {
        "title": "Ironing, in the plane",
        "curves": ["probe.top.ux:-reaction.top.y", "probe.top.ux:reaction.top.x"],
    },
    "ironing_3d": {
        "title": "Ironing, in space",
        "curves": ["probe.top.ux:-reaction.top.z", "probe.top.ux:reaction.top.x"],
    },
    "ball": {
        "title": "A rubber ball, flattened to 60 % of its height",
        "curves": ["-probe.top_plate.uy:-reaction.top_plate.y"],
    },
    "snap_fit": {"title": "A snap-fit", "curves": ["probe.base.ux:reaction.base.x"]},
}


def keep(source: Path, target: Path, width: int = 1000) -> None:
    """Keep a picture as a small file: at most so wide, with a palette of 128 colours."""
    from PIL import Image

    with Image.open(source) as image:
        picture = image.convert("RGB")
    if picture.width > width:
        size = width, round(width * picture.height / picture.width)
        picture = picture.resize(size, Image.Resampling.LANCZOS)
    palette = picture.quantize(128, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    palette.save(target, optimize=True)


# ---- figures and tables


def stale() -> list[str]:
    """Figures that are out of date, and pages with a short table that is not what the code says."""
    texts = {page: (DOCS / page).read_text(encoding="utf-8") for page in TABLES}
    return drawn.stale() + [page for page, text in texts.items() if with_tables(page, text) != text]


def make_figures() -> None:
    """Draw every figure, and write the short tables."""
    for name in drawn.figures():
        drawn.write_figure(name, FIGURES / name)
    for page in TABLES:
        path = DOCS / page
        path.write_text(with_tables(page, path.read_text(encoding="utf-8")), encoding="utf-8")


# ---- pictures and films


def mesh_nut(path: Path, size: float = 4.0) -> None:
    """Mesh the hexagonal nut that gmsh's wheel ships (component8.step) with TETRA10; its bore is the group 'bore'."""
    import gmsh

    step = next((Path(sys.prefix) / "share" / "doc" / "gmsh").rglob("component8.step"))
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(step))
        gmsh.model.addPhysicalGroup(2, [17, 18], name="bore")
        gmsh.model.addPhysicalGroup(3, [1], name="nut")
        for name, value in (("MeshSizeMax", size), ("ElementOrder", 2), ("HighOrderOptimize", 2), ("Binary", 1)):
            gmsh.option.setNumber(f"Mesh.{name}", value)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def draw_press_fit(folder: Path) -> None:
    """The pressure of data/press_fit.toml, and what it is between the flat faces."""
    data, text = ROOT / "data", (ROOT / "data" / "press_fit.toml").read_text(encoding="utf-8")
    shutil.copy(data / "press_fit.msh", folder)
    for surface in ("smooth", "faces"):
        case = folder / f"{surface}.toml"
        case.write_text(text.replace('name = "fit"', f'name = "fit"\nsurface = "{surface}"'), encoding="utf-8")
        pressed = ["run", str(case), "-o", str(folder / surface), "--quiet", "--force"]
        assert lacsolver_main([*pressed, "--plot", str(folder / f"press_fit_{surface}.png")]) == 0


def make_pictures() -> None:
    """A real CAD part cut on its curved bore, the two blocks of the demo, what `lacmesh view` shows."""
    from lacmesh.checks import check
    from lacmesh.quality import measure_quality
    from lacmesh.report import plot_quality
    from lacmesh.view import cell_values, picture

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        mesh_nut(folder / "nut.msh")
        nut = lacmesh.cut_skin(lacmesh.read(folder / "nut.msh"), "bore").mesh
        title = f"A nut of TETRA10, cut on its bore: {lacmesh.Cut(nut).n_macros} macro-elements (half of it shown)"
        picture(nut, folder / "nut.png", camera=(0.25, 0.75, 1.0), cutaway=(0, 0, 1), title=title)
        source = lacmesh.read(ROOT / "data" / "two_blocks.msh")
        blocks, size = lacmesh.cut_skin(source, "slave").mesh, (1280, 800)
        values = {"values": cell_values(blocks), "title": "two_blocks, cut"}
        picture(blocks, folder / "view_quality.png", master="master", size=size, **values)
        plot_quality(measure_quality(blocks), folder / "quality.png", title="Quality of two_blocks.lac.msh")
        found = check(source, "slave", "master")
        picture(source, folder / "view_check.png", slave="slave", master="master", findings=found, size=size)
        pressed = ["run", str(ROOT / "data" / "two_blocks.toml"), "-o", str(folder / "pressed"), "--quiet", "--force"]
        assert lacsolver_main([*pressed, "--plot", str(folder / "two_blocks_pressure.png")]) == 0
        draw_press_fit(folder)
        for path in folder.glob("*.png"):
            keep(path, FIGURES / path.name)


def make_films(folder: Path = ROOT / "build" / "films") -> None:
    """Run the cases of data/sliding that are not done yet, and draw all."""
    from lacsolver.pictures.filming import film

    folder.mkdir(parents=True, exist_ok=True)
    for name, look in SHOWN.items():
        results = folder / name / "results.json"
        if not results.exists() or json.loads(results.read_text())["status"] != "done":
            words = ["run", str(ROOT / "data" / "sliding" / f"{name}.toml"), "-o", str(folder / name), "--force"]
            assert lacsolver_main(words) == 0, name
        film(folder / name, folder / f"{name}.gif", frames=30, rate=10.0, **look)
        film(folder / name, folder / f"{name}.png", frames=6, rate=10.0, **look)
        keep(folder / f"{name}.png", DOCS / "sliding" / f"{name}.png")


# ---- tutorials


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
    shutil.copytree(
        TUTORIALS, folder / "docs" / "tutorials", dirs_exist_ok=True, ignore=shutil.ignore_patterns("*.png")
    )
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


def make_tutorials() -> None:
    """Run all tutorials, and keep their pictures."""
    for page in sorted(TUTORIALS.glob("*.md")):
        with tempfile.TemporaryDirectory() as folder:
            for command, printed in run_page(page, Path(folder)):
                print(f"$ {shlex.join(command.words)}\n{printed}")
            for picture in pictures(page):
                keep(Path(folder, picture), TUTORIALS / picture)


def build_site() -> None:
    """Make the site; exit with 1 where Sphinx warns of anything."""
    from site_pages import make_site

    target = ROOT / "build" / "site"
    if warnings := make_site(target):
        sys.exit("\n".join(warnings))
    print(f"{target / 'index.html'}: open it in a browser")


PARTS = {"figures": make_figures, "pictures": make_pictures, "films": make_films, "tutorials": make_tutorials}
PARTS |= {"site": build_site}

if __name__ == "__main__":
    if "--check" in sys.argv:
        sys.exit("\n".join(f"out of date: {name}" for name in stale()) or 0)
    for part in sys.argv[1:] or PARTS:
        PARTS[part]()
