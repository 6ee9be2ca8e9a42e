"""The patch test: contact passes a uniform pressure on exactly, whatever the cells on either side.

Every pair of kinds, along the axes and tilted, is in the verification's family `patch`; every kind is a slave and a
master in `test_patch_finite`.
"""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh.cells import CELLS
from lacmesh.reference.quadrature import measure
from tests.lacsolver.patch_cases import cases, figures, measured, pair, sized, solved, unbalanced
from tests.lacsolver.patch_meshes import side_by_side, stack
from tests.samples import one_in
from verification.meshes.stacks import PLANE_KINDS, SOLID_KINDS, tilt

#: of the stress, of every p_m, of the displacement, of the gap against the macro-element's size, of the coverage
EXACT = 1e-10
BALANCED = 1e-12


def check(found):
    assert max(found[:5]) <= EXACT, found
    assert max(found.force, found.moment) <= BALANCED, found


@pytest.mark.fuzz
@pytest.mark.parametrize("make", [pytest.param(c.make, id=f"{c.family}: {c.label}") for c in one_in(3, cases())])
def test_uniform_pressure_goes_through(make):
    check(figures(make()))


@pytest.mark.parametrize("size, young, pressure", [(1e-3, 2.1e11, 1e8), (1e4, 2.1e5, 25.0), (1.0, 1.0, 1e-6)])
def test_units_do_not_matter(size, young, pressure):
    """Metres and pascals, micrometres and megapascals, and loads that strain by a millionth."""
    check(figures(sized(pair("PENTA6 triangle", "HEXA20"), size, young, pressure)))


@pytest.mark.parametrize("dim, kinds", [(2, PLANE_KINDS), (3, SOLID_KINDS)])
def test_every_type_of_cell_is_among_the_kinds(dim, kinds):
    assert {kind.split()[0] for kind in kinds} - {"mixed"} == {n for n, cell in CELLS.items() if cell.dim == dim}


@pytest.mark.parametrize("dim, kinds", [(2, PLANE_KINDS), (3, SOLID_KINDS)])
def test_blocks_fill_their_place_and_meet_in_the_faces_that_they_are_named_by(dim, kinds):
    for kind in kinds:
        mesh = stack(kind, kinds[0], dim)
        assert volume(mesh) == pytest.approx(2)
        faces = {CELLS[name].linear for name, _, _ in mesh.select(mesh.cell_groups["slave"])}
        name, _, face = kind.partition(" ")
        if name == "mixed":
            families = {CELLS[b.type].family for b in mesh.blocks if CELLS[b.type].dim == dim}
            assert len(families) == (2 if dim == 2 else 4)
            assert faces == ({"SEG2"} if dim == 2 else {"TRIA3", "QUAD4"})
        elif face in ("triangle", "quadrangle"):
            assert faces == {"TRIA3" if face == "triangle" else "QUAD4"}


def test_blocks_do_not_match():
    """No node inside the interface of one block is where the other has one, and every inner node is moved."""
    for how in ({}, {"skew": 0.2, "counts": (5, 4)}, {"bulge": 0.2, "counts": (5, 4)}):
        mesh = stack("HEXA8", "HEXA8", 3, **how)
        slave, master = (inner_nodes(mesh, group) for group in ("slave", "master"))
        apart = np.linalg.norm(mesh.points[slave][:, None] - mesh.points[master], axis=2)
        assert len(slave) and len(master) and apart.min() > 1e-3
    even = stack("HEXA8", "HEXA8", 3, counts=(5, 4), even=True)
    skew = stack("HEXA8", "HEXA8", 3, counts=(5, 4), even=True, skew=0.2)
    moved = np.flatnonzero(np.abs(even.points - skew.points).max(axis=1) > 0)
    assert set(moved) == {*inner_nodes(even, "slave"), *inner_nodes(even, "master")}
    assert 0.02 < np.abs(even.points - skew.points).max() <= 0.2 / 4


def test_the_measure_of_errors_sees_errors():
    """A displacement, a pressure and a force that are wrong by a millionth show as that."""
    press = pair("HEXA8", "TETRA4", tilted=True)
    problem, state = solved(press)
    node = problem.space.dofs(np.array([0]))[0]
    wrong = state.u.copy()
    wrong[node] += 1e-6 * np.abs(state.u).max()
    object.__setattr__(state, "u", wrong)
    zone = state.zones[0]
    zone.pressure[0] *= 1 + 1e-6
    at = np.abs(zone.force).max(axis=1).argmax()
    zone.force[at] *= 1 + 1e-6
    found = measured(press, problem, state)
    assert found.displacement > 1e-7 and found.stress > 1e-7 and found.pressure > 9e-7
    assert found.force > 1e-9 and found.moment > 1e-9


def test_unbalanced_forces_and_moments():
    x = np.array([[0.0, 0, 0], [1, 0, 0]])
    assert unbalanced(x, np.array([[0.0, 1], [0, -1]])) == (0.0, 1.0)
    assert unbalanced(x, np.array([[1.0, 0], [-1, 0]])) == (0.0, 0.0)
    assert unbalanced(x, np.array([[0.0, 1], [0, 1]])) == (1.0, 0.0)


def test_stacks_are_apart_and_keep_their_roles():
    mesh = side_by_side("HEXA8", SOLID_KINDS, 3)
    assert volume(mesh) == pytest.approx(2 * len(SOLID_KINDS))
    for k in range(len(SOLID_KINDS)):
        slave, master = (np.unique(nodes_of(mesh, f"{role}{k}")) for role in ("slave", "master"))
        lower = set(nodes_of(mesh, "lower"))
        assert set(slave) <= lower if k % 2 == 0 else set(master) <= lower
        assert np.ptp(mesh.points[[*slave, *master]], axis=0) == pytest.approx([1, 1, 0])


def test_a_rotation_is_one():
    for dim in (2, 3):
        turn = tilt(dim)
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-15)
        assert np.linalg.det(turn) == pytest.approx(1)
        assert (np.abs(turn - np.round(turn)) > 0.02).sum() == (4 if dim == 2 else 9)


def volume(mesh):
    return sum(measure(b.type, mesh.points[b.nodes]).sum() for b in mesh.blocks if CELLS[b.type].dim == mesh.space_dim)


def nodes_of(mesh, group):
    return np.concatenate([nodes.ravel() for _, _, nodes in mesh.select(mesh.cell_groups[group])])


def inner_nodes(mesh, group):
    nodes = np.unique(nodes_of(mesh, group))
    x = mesh.points[nodes][:, : mesh.space_dim - 1]
    return nodes[((x > 1e-9) & (x < 1 - 1e-9)).all(axis=1)]


@pytest.mark.parametrize("way", ["pyramid", "hexa"])
@pytest.mark.parametrize("geometry", ["reference", "current"])
def test_smoothed_normals_of_a_plane_skin_are_its_own(way, geometry):
    """On distorted quadrangles too: what is smoothed is not integrated less exactly."""
    options = f'geometry = "{geometry}"\nnormals = "smoothed"'
    check(figures(pair("HEXA8", "HEXA8", way=way, options=options, skew=0.2)))
