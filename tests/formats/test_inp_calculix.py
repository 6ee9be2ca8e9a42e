"""CalculiX runs what we write: contact takes our surfaces, and a pressure on a surface of ours pushes its facet."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest

from lacmesh import cut_skin
from lacmesh.cells import CELLS
from lacmesh.formats import inp
from lacmesh.formats.inp.writer_types import card
from lacmesh.formats.table import WriteOptions
from tests.formats.inp_blocks import PRESSED, E, K, P, on_springs, run, two_blocks
from tests.meshes import cell_with_faces

PROGRAM = shutil.which("ccx")
pytestmark = [
    pytest.mark.calculix,
    pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning"),
]
VOLUMES = [kind for kind, cell in CELLS.items() if cell.dim == 3 and card(kind, "calculix", None, False)]


@pytest.mark.parametrize("kind", ["HEXA8", "HEXA20", "TETRA10"])
def test_pressed_blocks_balance(tmp_path, kind):
    """A cut slave under a master that does not match it: the load passes, and both blocks are in uniform stress."""
    mesh = two_blocks(kind)
    cut = cut_skin(mesh, "slave", hexa="hexa").mesh
    assert len(cut.cell_groups["slave"]) > len(mesh.cell_groups["slave"])
    inp.write(tmp_path / "mesh.inp", cut)
    words, found = run(tmp_path, PROGRAM, PRESSED)
    assert "Job finished" in words, words[-2000:]
    assert np.allclose(found["total force"][-1], [[0, 0, P]], atol=1e-6)
    assert np.allclose(found["displacements"][-1][:, 3], -P * (2 / E + 1 / K), rtol=1e-5)
    assert len(found["stresses"]) == 2
    for stress in found["stresses"]:
        assert np.allclose(stress[:, 4], -P, rtol=1e-3)


@pytest.mark.parametrize("kind", VOLUMES)
def test_pressure_pushes_the_facet(tmp_path, kind):
    """Under a pressure on one facet, a cell on springs is held by a force of the facet's area, inward."""
    cell = CELLS[kind]
    for j, facet in enumerate(cell.facets):
        mesh = cell_with_faces(kind, facets=[j], inward=True)
        corners = mesh.points[list(facet.nodes[: CELLS[facet.type].n_corners])]  # plane: the cell is an affine image
        area = np.cross(corners[1:-1] - corners[0], corners[2:] - corners[0]).sum(axis=0) / 2
        inp.write(tmp_path / "mesh.inp", mesh)
        words, found = run(tmp_path, PROGRAM, on_springs(cell.n_nodes))
        assert "Job finished" in words, words[-2000:]
        u = found["displacements"][-1][:, 1:]
        assert np.allclose(E * u.sum(axis=0), -P * area, atol=1e-5 * np.linalg.norm(P * area))


@pytest.mark.parametrize("kind", ["TRIA3", "QUAD4", "TRIA6", "QUAD8"])
def test_pressure_pushes_the_edge(tmp_path, kind):
    """A pressure on an edge gives the right force in plane strain and on linear shells, both one unit thick."""
    cell = CELLS[kind]
    for j, facet in enumerate(cell.facets):
        plane = cell_with_faces(kind, facets=[j], inward=True)
        a, b = plane.points[list(facet.nodes[:2])]
        normal = np.array([(b - a)[1], -(b - a)[0], 0])
        solid = "*SOLID SECTION, ELSET=body, MATERIAL=M\n1."
        jobs = [(plane, on_springs(cell.n_nodes, solid, axes=(1, 2)))]
        if cell.order == 1:
            raised = replace(plane, points=plane.points + np.array([0, 0, 1]), space_dim=3)
            jobs.append((raised, on_springs(cell.n_nodes, solid.replace("SOLID", "SHELL"))))
        for mesh, job in jobs:
            inp.write(tmp_path / "mesh.inp", mesh, WriteOptions(plane="CPE"))
            words, found = run(tmp_path, PROGRAM, job)
            assert "Job finished" in words, words[-2000:]
            u = found["displacements"][-1][:, 1:]
            assert np.allclose(E * u.sum(axis=0), -P * normal, atol=1e-5 * np.linalg.norm(P * normal))
