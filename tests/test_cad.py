"""A real CAD part: gmsh's nut, meshed with TETRA10, cut on its curved bore."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh.cells import CELLS
from lacmesh.reference.quadrature import measure, rule
from lacmesh.reference.shapes import gradient, jacobian, shape
from tests import properties

pytestmark = pytest.mark.gmsh
#: curved surfaces of each part, by tag: the two halves of the bore
BORE = {"component8.step": (17, 18), "t20_data.step": (17, 18)}


def step_file(name):
    found = sorted((Path(sys.prefix) / "share" / "doc" / "gmsh").rglob(name))
    assert found, f"gmsh's wheel no longer ships {name}"
    return found[0]


def mesh_part(name, path):
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(step_file(name)))
        gmsh.model.addPhysicalGroup(2, BORE[name], name="bore")
        gmsh.model.addPhysicalGroup(3, [1], name="nut")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 5)
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.option.setNumber("Mesh.HighOrderOptimize", 2)
        gmsh.model.mesh.generate(3)
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return lacmesh.read(path)


@pytest.mark.parametrize("name", list(BORE))
def test_cut_on_a_curved_face(name, tmp_path):
    mesh = mesh_part(name, tmp_path / "nut.msh")
    cut = lacmesh.cut_skin(mesh, "bore")
    after = cut.mesh
    faces = len(mesh.cell_groups["bore"])
    assert cut.n_macros == faces > 100
    assert (after.n_nodes - mesh.n_nodes, after.n_cells - mesh.n_cells) == (5 * faces, 4 * faces)
    assert smallest_jacobian(after.points[after.block("TETRA10")]) > 0
    before_volume, after_volume = (measure("TETRA10", m.points[m.block("TETRA10")]).sum() for m in (mesh, after))
    assert abs(after_volume / before_volume - 1) < 1e-12
    properties.owns_internal_dofs(mesh, cut)
    curved_children_fill_their_parents(mesh, cut)
    assert distance_to_parents(mesh, cut) < 1e-12 * np.ptp(mesh.points, axis=0).max()
    for group in ("bore", "nut"):
        assert group in after.cell_groups


def smallest_jacobian(x):
    """Least determinant over the nodes and many points inside, relative to the cell's mean."""
    X = np.vstack([np.array(CELLS["TETRA10"].reference), rule("TETRA", 8)[0]])
    det = np.linalg.det(jacobian("TETRA10", x, X))
    return (det.min(axis=1) / measure("TETRA10", x)).min()


def curved_children_fill_their_parents(mesh, cut):
    """TETRA10 children restrict their parent's own map: volumes add up to round-off though faces are curved."""
    size = {int(n): v for n, v in zip(mesh.cell_number, properties.volumes(mesh), strict=True)}
    children = np.flatnonzero((cut.parent_of_cell >= 0) & (cut.mesh.cell_dim == 3))
    total = {}
    for cell, volume in zip(children, properties.volumes(cut.mesh)[children], strict=True):
        number = int(cut.parent_of_cell[cell])
        total[number] = total.get(number, 0.0) + volume
    for number, volume in total.items():
        assert volume == pytest.approx(size[number], rel=1e-12)


def distance_to_parents(mesh, cut):
    """Largest distance of a slave child's node from its parent face's own surface (Newton on the face's map)."""
    row = {int(n): k for k, n in enumerate(mesh.cell_number)}
    faces = np.flatnonzero(cut.macro_of_face >= 0)
    ((_, cells, nodes),) = cut.mesh.select(faces)
    parents = np.array([row[int(n)] for n in cut.parent_of_cell[cells]])
    ((_, order, parent_nodes),) = mesh.select(np.sort(parents))
    x = mesh.points[parent_nodes[np.searchsorted(order, parents)]]
    worst = 0.0
    for k in range(6):
        y = cut.mesh.points[nodes[:, k]]
        X = np.full((len(y), 2), 1 / 3)
        for _ in range(25):
            J = np.einsum("kns,knd->ksd", x, gradient("TRIA6", X))
            r = y - np.einsum("kns,kn->ks", x, shape("TRIA6", X))
            X = X + np.linalg.solve(np.einsum("ksd,kse->kde", J, J), np.einsum("ksd,ks->kd", J, r)[..., None])[..., 0]
        worst = max(worst, np.linalg.norm(y - np.einsum("kns,kn->ks", x, shape("TRIA6", X)), axis=1).max())
    return worst
