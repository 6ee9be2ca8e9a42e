"""Nodes without mass: which they are, where their mass goes, and what bodies that are too thin keep."""

import numpy as np
import pytest

from lacsolver.case import parse_case
from lacsolver.problem.inertia import LARGE
from lacsolver.problem.problem import Problem
from lacsolver.space.cut_nodes import inside_children
from tests.lacsolver.moving import PLANE, SMALL, SPACE, WALL
from verification.meshes.bars import bar, bar_on_wall
from verification.meshes.blocks import BLOCK_TYPES, joined

PLANE_TYPES = [kind for kind in BLOCK_TYPES if kind.startswith(("TRIA", "QUAD"))]


def inertia(kind, massless, n=4, how=""):
    dim = 2 if kind in PLANE_TYPES else 3
    text = (PLANE if dim == 2 else SPACE) + SMALL + WALL.replace("[[rigid]]", how + "[[rigid]]")
    return Problem.of(parse_case(text + f'[dynamics]\nmassless = "{massless}"\n'), bar_on_wall(kind, n, 0.01)).inertia


def rows(kind):
    """Options of the cut of a type of cell."""
    return ['hexa = "pyramid"\n', 'hexa = "hexa"\n'] if kind in ("HEXA8", "HEXA20") else [""]


CUTS = [(kind, how) for kind in BLOCK_TYPES for how in rows(kind)]


@pytest.mark.parametrize(("kind", "how"), CUTS, ids=lambda v: v.strip().replace('"', ""))
def test_mass_moves_and_stays_as_much(kind, how):
    """Total mass to round-off, no mass at massless nodes, positive definite at the others, symmetric."""
    made = inertia(kind, "skins", how=how)
    dim, nodes, attached = made.space.dim, made.massless.nodes, made.space.attached
    for s in range(dim):
        one = np.tile(np.eye(dim)[s], made.space.mesh.n_nodes)
        assert one @ made.M @ one == pytest.approx(one @ made.plain @ one, rel=1e-13)
    slave = made.space.mesh.points[:, dim - 1] < 0.01 + 1e-9
    assert nodes[slave & attached].all()
    M = made.M.toarray()
    assert not M[made.massless_dofs].any() and abs(M - M.T).max() <= 1e-15 * M.max()
    kept = made.space.dofs(np.flatnonzero(attached & ~nodes)).ravel()
    assert np.linalg.eigvalsh(M[np.ix_(kept, kept)])[0] > 1e-3 * np.diag(M)[kept].min()


@pytest.mark.parametrize(("kind", "how"), CUTS, ids=lambda v: v.strip().replace('"', ""))
def test_nodes_that_the_cut_made_are_found(kind, how):
    """New nodes that are not on the slave skin are those inside the children of one parent."""
    made = inertia(kind, "none", how=how)
    mesh, dim = made.space.mesh, made.space.dim
    before = bar_on_wall(kind, 4, 0.01).points
    new = np.array([np.linalg.norm(before - x, axis=1).min() > 1e-9 for x in mesh.points])
    on_skin = mesh.points[:, dim - 1] < 0.01 + 1e-9
    np.testing.assert_array_equal(inside_children(made.space.mesh, dim), new & ~on_skin)


@pytest.mark.parametrize("kind", ["QUAD4", "TRIA6", "TETRA4"])
def test_internal_nodes_alone_leave_the_inertia(kind):
    """Linear fields keep their kinetic energy: centre and tensor of inertia are exact."""
    made, field = inertia(kind, "internal"), np.random.default_rng(0)
    dim = made.space.dim
    x = np.column_stack([made.space.local.points[:, :dim], np.ones(made.space.mesh.n_nodes)])
    for _ in range(3):
        v = (x @ field.normal(size=(dim + 1, dim))).ravel()
        assert v @ made.M @ v == pytest.approx(v @ made.plain @ v, rel=1e-12)
    assert made.told() == []


def test_a_large_change_of_inertia_is_told():
    made = inertia("QUAD4", "skins", n=4)
    (moved,) = made.moved().values()
    assert abs(moved) > LARGE
    assert made.told() == [
        f"massless nodes change the inertia of 'bar' by {moved:+.2%}; refine the cells at the contact, or take "
        'massless = "internal"'
    ]


def test_a_body_too_thin_keeps_the_mass_of_its_skins():
    """A plate one cell thick between two others, slave above and master below; then slave on both sides."""
    parts = [(bar("QUAD4", 4, 0.0, 4), {"y0": "low", "y1": "master", "": "foot", "x0": "x0"})]
    low = bar("QUAD4", 1, 1.01, 4)
    parts.append((low, {"y0": "slave", "y1": "above", "": "plate"}))
    parts.append((bar("QUAD4", 4, 2.02, 4), {"y0": "top_slave", "": "lid"}))
    text = PLANE + SMALL + '[[contact]]\nslave = "slave"\nmaster = "master"\n'
    text += '[[contact]]\nslave = "top_slave"\nmaster = "above"\n[dynamics]\n'
    made = Problem.of(parse_case(text), joined(parts)).inertia
    (said,) = made.massless.told
    assert said == "'plate' is too thin for massless skins: all but its master skins are massless, if any"
    y = made.space.mesh.points[:, 1]
    assert made.massless.nodes[np.abs(y - 1.01) < 1e-9].all()
    assert not made.massless.nodes[np.abs(y - 2.01) < 1e-9].any()
