"""Pictures of whole parts for the docs: a real CAD part cut on its curved bore, and the two blocks of the demo.

python docs/make_pictures.py        needs gmsh and pyvista; writes docs/figures/*.png
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import gmsh

import lacmesh
from lacmesh.view import picture

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


def main() -> None:
    """Write the pictures."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "nut.msh"
        mesh_nut(path)
        nut = lacmesh.cut_skin(lacmesh.read(path), "bore").mesh
    title = f"A nut of TETRA10, cut on its bore: {lacmesh.Cut(nut).n_macros} macro-elements (half of it shown)"
    picture(nut, FIGURES / "nut.png", camera=(0.25, 0.75, 1.0), cutaway=(0, 0, 1), title=title)
    blocks = lacmesh.cut_skin(lacmesh.read(ROOT / "data" / "two_blocks.msh"), "slave").mesh
    picture(blocks, FIGURES / "two_blocks.png")


if __name__ == "__main__":
    main()
