"""Mortar matrices D and M, averaged over macro-elements, that a solver builds from contact points of cut skins."""

import numpy as np
import pytest

from lacmesh import Mesh, cut_skin, raise_order
from lacmesh.cells import CELLS
from lacmesh.reference.shapes import shape
from lacmesh.surface import Surface, contact_points, coverage
from lacmesh.topology.skin import FACE_TYPES
from tests.surface.surfaces import blocks, mapped


def strip(n, low, high):
    """n x 1 quadrangles over x in [0, 1], group `skin`: their upper side (high = 0) or their lower one."""
    x = np.linspace(0, 1, n + 1)
    x[1:-1] += 0.2 / n * np.random.default_rng(n).uniform(-1, 1, n - 1)
    points = np.concatenate([np.stack([x, np.full(n + 1, y)], axis=1) for y in (low, high)])
    k = np.arange(n)
    quads = np.stack([k, k + 1, k + n + 2, k + n + 1], axis=1)
    skin = quads[:, [2, 3]] if high == 0 else quads[:, [0, 1]]
    return Mesh.create(points, [("QUAD4", quads), ("SEG2", skin)], cell_groups={"skin": n + k}, space_dim=2)


def average(points, surface, side, n_macros):
    """(n_macros, n_nodes): integrals of the shape functions of a side (0 slave, 1 master) over macro-elements."""
    out = np.zeros((n_macros, len(surface.x)))
    own, xi = ((points.slave, points.xi_slave), (points.master, points.xi_master))[side]
    for *types, _, a, b in points.groups:
        cell = CELLS[FACE_TYPES[types[side]]]
        N = shape(cell.name, xi[a:b, : cell.dim]) * points.weight[a:b, None]
        nodes = surface.faces.nodes[own[a:b], : cell.n_nodes]
        np.add.at(out, (points.macro[a:b, None], nodes), N)
    return out


@pytest.mark.parametrize("space", ["plane", "axisymmetric", "pyramid", "hexa"])
@pytest.mark.parametrize("order", ["1", "2"])
def test_both_sides_of_every_macro_element_sum_to_its_area(space, order):
    flat = space in ("plane", "axisymmetric")
    lower, upper = (strip(5, -0.3, 0.0), strip(7, 0.02, 0.4)) if flat else (blocks(4, -0.4, 0), blocks(5, 0.02, 0.4))
    if order == "2":
        lower, upper = raise_order(lower, "2"), raise_order(upper, "2")
    # the mesh that is cut is the upper one: its skin is the slave
    cut = cut_skin(upper, "skin", **({} if flat else {"hexa": space}))
    slave = Surface.of(cut.mesh, cut.mesh.cell_groups["skin"])
    master = Surface.of(lower, lower.cell_groups["skin"])
    macro = cut.macro_of_face[slave.cell]
    points = contact_points(slave, master, macro=macro, axisymmetric=space == "axisymmetric")
    found = coverage(points, slave, macro)
    D = average(points, slave, 0, len(found.area))
    M = average(points, master, 1, len(found.area))
    assert np.allclose(found.ratio, 1, rtol=1e-12, atol=0)
    for side in (D, M):
        assert np.allclose(side.sum(axis=1), found.area, rtol=1e-12, atol=0)
    whole = np.pi if space == "axisymmetric" else 1.0
    assert np.isclose(found.area.sum(), whole, rtol=1e-12, atol=0)
    # a linear displacement has the same average on either side: what a patch test asks
    for axis in range(2):
        if axis == 1 and flat:
            continue
        assert np.allclose(D @ slave.x[:, axis], M @ master.x[:, axis], rtol=1e-11, atol=0)
    # the node inside each macro-element has a column that no other macro-element shares: the cut's own freedom
    own = (np.abs(D) > 1e-14).sum(axis=0) == 1
    assert ((np.abs(D) > 1e-14) & own).any(axis=1).all()


def test_a_solver_moves_the_surfaces_and_takes_points_again():
    lower, upper = blocks(4, -0.4, 0.0), blocks(5, 0.0, 0.4)
    slave, master = (Surface.of(m, m.cell_groups["skin"]) for m in (upper, lower))
    for gap in (0.05, -0.03):
        points = contact_points(slave.at(slave.x + np.array([0, 0, gap])), master)
        assert np.allclose(points.gap, gap, atol=1e-14)


def test_renumbering_nodes_and_faces_changes_nothing():
    lower, upper = blocks(3, -0.4, 0.0, skew=0.2), blocks(4, 0.02, 0.4, skew=0.2, seed=1)
    bend = lambda x: x + np.outer(0.05 * np.sin(2 * x[:, 0]), [0, 0, 1])  # noqa: E731
    lower, upper = mapped_groups(lower, bend), mapped_groups(upper, bend)
    here = [Surface.of(m, m.cell_groups["skin"]) for m in (upper, lower)]
    rng = np.random.default_rng(0)
    there = []
    for mesh in (upper, lower):
        node, skin = rng.permutation(mesh.n_nodes), rng.permutation(mesh.cell_groups["skin"])
        points = np.empty_like(mesh.points)
        points[node] = mesh.points
        blocks_ = [(b.type, node[b.nodes]) for b in mesh.blocks]
        there.append(Surface.of(Mesh.create(points, blocks_, space_dim=3), skin))
    a, b = (coverage(contact_points(*pair), pair[0]) for pair in (here, there))
    place = np.argsort(there[0].cell)
    assert np.allclose(a.ratio, b.ratio[place], rtol=1e-12, atol=0)
    assert np.allclose(a.gap_integral, b.gap_integral[place], rtol=1e-9, atol=0)


def mapped_groups(mesh, f):
    moved = mapped(mesh, f)
    return Mesh.create(
        moved.points, [(b.type, b.nodes) for b in mesh.blocks], cell_groups=mesh.cell_groups, space_dim=3
    )
