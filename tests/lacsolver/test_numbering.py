"""Contact matrices on the unknowns of other programs: the same gaps, the same solution, and clear refusals."""

from __future__ import annotations

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh.errors import RequestError

CASE = "data/two_blocks.toml"


@pytest.fixture(scope="module")
def given():
    """(system, pair, solution) of the two blocks."""
    system = ls.assemble(CASE)
    pair = ls.contact_matrices(system.mesh, "slave", "master")
    return system, pair, solved(system, pair)


def solved(system, pair):
    return ls.solve_contact(system.K, system.f, pair.B, pair.G, fixed=system.fixed, u0=system.u0)


@pytest.fixture(scope="module")
def u(given):
    return np.random.default_rng(1).uniform(size=(given[0].mesh.n_nodes, 3))


def test_every_layout_gives_the_same_gaps_and_slips(given, u):
    """Node-major, component-major, permuted nodes, and an unknown of its own for each displacement."""
    _, pair, _ = given
    n = u.size
    rng = np.random.default_rng(2)
    order, each = rng.permutation(len(u)), rng.permutation(2 * n)[:n]
    of_order = np.empty_like(u)
    of_order[order] = u
    of_each = np.full(2 * n, np.nan)
    of_each[each] = u.ravel()
    for theirs, v in (
        (pair.renumber(), u.ravel()),
        (pair.renumber("components"), u.T.ravel()),
        (pair.renumber(nodes=order), of_order.ravel()),
        (pair.renumber("components", nodes=order), of_order.T.ravel()),
        (pair.renumber(each.reshape(u.shape), n=2 * n), np.nan_to_num(of_each)),
    ):
        np.testing.assert_allclose(theirs.B @ v, pair.B @ u.ravel(), atol=1e-12)
        np.testing.assert_allclose(theirs.B_T @ v, pair.B_T @ u.ravel(), atol=1e-12)


def test_eliminated_unknowns_move_the_gaps(given):
    """Supports that are gone, one of them moved: the solution is that with all unknowns."""
    system, pair, _ = given
    u0 = system.u0.copy()
    u0[system.fixed[system.fixed % 3 == 2]] = 0.01  # the bottom is lifted
    whole = ls.solve_contact(system.K, system.f, pair.B, pair.G, fixed=system.fixed, u0=u0)
    free = np.setdiff1d(np.arange(len(u0)), system.fixed)
    numbers = np.full(len(u0), -1)
    numbers[free] = np.arange(len(free))
    theirs = pair.renumber(numbers.reshape(-1, 3), u0=u0.reshape(-1, 3))
    part = ls.solve_contact(system.K[free][:, free], (system.f - system.K @ u0)[free], theirs.B, theirs.G)
    np.testing.assert_allclose(part.u, whole.u[free], atol=1e-9 * abs(whole.u).max())
    np.testing.assert_allclose(part.pressure, whole.pressure, atol=1e-9 * whole.pressure.max())


@pytest.mark.parametrize("order", [1, 2])
def test_cells_with_nodes_in_another_order_are_found(order):
    """Two blocks whose skins have nodes at the same places, numbered at random, the nodes of each cell shuffled."""
    mesh = lacmesh.read("data/two_blocks.msh")
    mesh = lacmesh.raise_order(mesh) if order == 2 else mesh
    pair = ls.contact_matrices(mesh, "slave", "master", hexa="hexa")
    rng = np.random.default_rng(3)
    number = rng.permutation(pair.mesh.n_nodes)
    points = np.empty_like(pair.mesh.points)
    points[number] = pair.mesh.points
    solids = [name for name in ("TETRA4", "HEXA8", "TETRA10", "HEXA20", "HEXA27") if len(pair.mesh.block(name))]
    cells = {name: rng.permuted(number[pair.mesh.block(name)], axis=1) for name in solids}
    theirs, ours = pair.renumber(nodes=cells, points=points), pair.renumber(nodes=number)
    assert len(solids) == 2 and abs(theirs.B - ours.B).max() == 0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"unknowns": "rows"}, "nodes, components"),
        ({"unknowns": np.zeros((512, 3), int)}, "is that of 1536 displacements"),
        ({"unknowns": np.arange(1536).reshape(512, 3), "n": 1000}, "there are 1000 unknowns, and 1535"),
        ({"unknowns": np.arange(1024).reshape(512, 2)}, "(512, 3) is needed"),
        ({"nodes": np.arange(5)}, "the cut mesh has 512 nodes"),
        ({"nodes": {"HEXA8": np.zeros((3, 8), int)}, "points": np.zeros((512, 3))}, "the cut mesh has"),
        ({"nodes": {"TETRA4": 0}}, "give points="),
        ({"nodes": np.full(512, -1)}, "nodes in contact"),
    ],
)
def test_what_does_not_fit_is_refused(given, options, words):
    with pytest.raises(RequestError, match=words.replace("(", r"\(").replace(")", r"\)")):
        given[1].renumber(**options)


def test_cells_in_another_order_are_refused(given):
    mesh = given[1].mesh
    cells = {"TETRA4": mesh.block("TETRA4")[::-1]}
    with pytest.raises(RequestError, match="cell 0 of the other program lies elsewhere"):
        given[1].renumber(nodes=cells, points=mesh.points)


def test_friction_with_moved_eliminated_unknowns_is_refused(given):
    numbers = np.arange(1536).reshape(512, 3)
    numbers[np.unique(given[1].B_T.indices // 3)[0]] = -1
    with pytest.raises(RequestError, match="friction counts slips from 0"):
        given[1].renumber(numbers, u0=np.ones((512, 3)))
