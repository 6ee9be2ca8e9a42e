"""Pictures for the docs: a real CAD part cut on its curved bore, the two blocks of the demo, what `lacmesh view` shows.

python docs/make_pictures.py        needs gmsh and pyvista; writes docs/figures/*.png
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

import gmsh

import lacmesh
from lacmesh.checks import check
from lacmesh.quality import measure_quality
from lacmesh.report import plot_quality
from lacmesh.view import cell_values, picture
from lacsolver.cli import main as lacsolver

FIGURES = Path(__file__).parent / "figures"
ROOT = Path(__file__).parents[1]


def mesh_nut(path: Path, size: float = 4.0) -> None:
    """Mesh the hexagonal nut that gmsh's wheel ships (component8.step) with TETRA10; its bore is the group 'bore'."""
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
        picture_of = FIGURES / f"press_fit_{surface}.png"
        pressed = ["run", str(case), "-o", str(folder / surface), "--quiet", "--force"]
        assert lacsolver([*pressed, "--plot", str(picture_of)]) == 0


def main() -> None:
    """Write the pictures."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "nut.msh"
        mesh_nut(path)
        nut = lacmesh.cut_skin(lacmesh.read(path), "bore").mesh
        title = f"A nut of TETRA10, cut on its bore: {lacmesh.Cut(nut).n_macros} macro-elements (half of it shown)"
        picture(nut, FIGURES / "nut.png", camera=(0.25, 0.75, 1.0), cutaway=(0, 0, 1), title=title)
        source = lacmesh.read(ROOT / "data" / "two_blocks.msh")
        blocks = lacmesh.cut_skin(source, "slave").mesh
        size = (1280, 800)
        values = cell_values(blocks)
        picture(
            blocks, FIGURES / "view_quality.png", master="master", values=values, size=size, title="two_blocks, cut"
        )
        plot_quality(measure_quality(blocks), FIGURES / "quality.png", title="Quality of two_blocks.lac.msh")
        found = check(source, "slave", "master")
        picture(source, FIGURES / "view_check.png", slave="slave", master="master", findings=found, size=size)
        pressed = ["run", str(ROOT / "data" / "two_blocks.toml"), "-o", f"{folder}/pressed", "--quiet", "--force"]
        assert lacsolver([*pressed, "--plot", str(FIGURES / "two_blocks_pressure.png")]) == 0
        draw_press_fit(Path(folder))


if __name__ == "__main__":
    main()
