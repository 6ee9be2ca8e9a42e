"""A tie over the two sides of a split gives back the whole body: patch tests over random sections, on all cells."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh.cells import CELLS
from lacsolver.case import Case, Displacement, Material, Pretension, Tie, Traction, Value
from tests.checks.blocks import SOLIDS, block, join, skin
from tests.meshes import facets_of
from tests.samples import samples

KINDS = [name for name, cell in CELLS.items() if cell.dim > 1]


def divided(kind, seed, wide=2):
    """A unit block with the group `G` of facets between the cells below a random surface and those above it."""
    linear, order = SOLIDS[kind]
    d = CELLS[linear].dim
    rng = np.random.default_rng(seed)
    points, cells = block((3, 3) if d == 2 else (wide, wide, 3), (0,) * d, (1,) * d, linear)
    solid = lacmesh.Mesh.create(points, cells.items(), space_dim=d)
    centres = np.concatenate([points[nodes].mean(axis=1) for nodes in cells.values()])
    below = centres[:, d - 1] + 0.35 * (rng.random(len(centres)) - 0.5) < 0.5
    found = {}
    for owners in facets_of(solid).values():
        if len(owners) == 2 and below[owners[0][0]] != below[owners[1][0]]:
            found.setdefault(owners[0][2], []).append(owners[0][3])
    skins = {"G": {name: np.array(rows) for name, rows in found.items()}}
    for axis in range(d):
        for end, value in (("0", 0.0), ("1", 1.0)):
            skins["xyz"[axis] + end] = skin(points, cells, lambda x, a=axis, v=value: np.abs(x[..., a] - v) < 1e-9)
    mesh = join([(points, cells, skins)])
    return lacmesh.raise_order(mesh, order) if order else mesh


@pytest.mark.filterwarnings("ignore:.*:lacmesh.errors.LacmeshWarning")
@pytest.mark.fuzz
@pytest.mark.parametrize("seed", samples((0,), range(4)))
@pytest.mark.parametrize("kind", KINDS)
def test_a_tie_is_the_whole_body_under_uniform_strain(kind, seed):
    mesh = divided(kind, seed)
    d = mesh.space_dim
    H = np.random.default_rng(seed).uniform(-1, 1, (d, d))
    names = ("ux", "uy", "uz")[:d]
    sides = [f"{axis}{end}" for axis in "xyz"[:d] for end in "01"]
    fields = {name: Value.of(lambda x, t, k=k: np.asarray(x)[:, :d] @ H[k]) for k, name in enumerate(names)}
    case = Case(
        model="3d" if d == 3 else "plane_strain", material=Material(young=100.0, poisson=0.3),
        displacement=[Displacement(group=side, **fields) for side in sides], tie=Tie(slave="G_a", master="G_b"),
    )  # fmt: skip
    parts = lacmesh.split(mesh, "G")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        solution = ls.solve(case, parts)
    u = solution.mesh.points[:, :d] @ H.T
    used = np.unique(np.concatenate([b.nodes.ravel() for b in solution.mesh.blocks]))
    np.testing.assert_allclose(solution.u[used], u[used], rtol=0, atol=1e-10)


@pytest.mark.parametrize("kind", KINDS)
def test_a_section_without_a_shortening_is_the_whole_body_under_any_load(kind):
    mesh = divided(kind, 5, 3)
    d = mesh.space_dim
    pull = dict(zip(("tx", "ty", "tz"), (0.3, 1.0, -2.0), strict=False) if d == 3 else (("tx", 0.3), ("ty", 1.0)))
    up = "xyz"[d - 1]
    case = Case(
        model="3d" if d == 3 else "plane_strain", material=Material(young=100.0, poisson=0.3),
        displacement=Displacement(group=f"{up}0", **dict.fromkeys(("ux", "uy", "uz")[:d], 0.0)),
        traction=Traction(group=f"{up}1", **pull), pretension=Pretension(group="G", shortening=0.0),
    )  # fmt: skip
    apart, whole = ls.solve(case, mesh), ls.solve(replace(case, pretension=()), mesh)
    np.testing.assert_allclose(apart.u[: mesh.n_nodes], whole.u, rtol=0, atol=1e-12 * np.abs(whole.u).max() + 1e-13)
