"""Patch test with friction: two blocks that do not match under pressure and shear, sticking or sliding, are exact."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

import lacsolver as ls
from lacsolver.case import Case, Contact, Displacement, Material, Solver, Traction
from tests.lacsolver.patch_meshes import stack
from tests.samples import each_option

YOUNG, POISSON, PRESSURE, MU = 1000.0, 0.3, 1.0, 0.3
#: (shear, slip): below the bound it sticks, at the bound it slides
WAYS = {"stick": (0.2, 0.0), "slide": (MU * PRESSURE, 0.05)}
KINDS = {
    2: [("TRIA3", "QUAD4"), ("QUAD4", "TRIA3"), ("QUAD8", "TRIA6"), ("TRIA6", "QUAD9"), ("QUAD9", "QUAD8")],
    3: [("TETRA4", "HEXA8"), ("HEXA8", "TETRA4"), ("TETRA10", "HEXA20"), ("HEXA20", "TETRA10")],
}
PAIRS = [(dim, *pair) for dim, pairs in KINDS.items() for pair in pairs]
CASES = each_option(itertools.product(PAIRS, WAYS, ("below", "above")))


def turned(dim):
    """Columns: tangents and normal of a tilted skin."""
    if dim == 2:
        c, s = np.cos(0.4), np.sin(0.4)
        return np.array([[c, -s], [s, c]])
    return np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]


def exact(dim, way):
    """The stress (d, d), and the displacement at points (n, d) of the lower and of the upper block."""
    shear, slip = WAYS[way]
    Q = turned(dim)
    along = np.array([1.0]) if dim == 2 else np.array([0.6, 0.8])
    stress = np.zeros((dim, dim))
    stress[-1, -1] = -PRESSURE
    stress[:-1, -1] = stress[-1, :-1] = shear * along
    lame = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    G = YOUNG / (2 * (1 + POISSON))
    trace = np.trace(stress) * (1 / (3 * lame + 2 * G) if dim == 3 else 1 / (2 * lame + 2 * G))
    strain = (stress - lame * trace * np.eye(dim)) / (2 * G)
    strain[:-1, -1] *= 2
    strain[-1, :-1] = 0.0  # a shear of planes over one another: the skins stay plane

    def displacement(x, upper):
        local = x @ Q
        u = local @ strain.T
        u[:, :-1] += slip * along * upper
        return u @ Q.T

    return Q @ stress @ Q.T, displacement


def press(dim, slave, master, way, below):
    """The case of the patch test, with its mesh."""
    mesh = stack(slave, master, dim, slave_below=below, counts=(3, 2), skew=0.15)
    Q = np.eye(3)
    Q[:dim, :dim] = turned(dim)
    mesh = replace(mesh, points=mesh.points @ Q.T)
    stress, displacement = exact(dim, way)
    held = []
    for group, upper in (("bottom", False), ("top", True)):
        functions = {f"u{a}": of_axis(displacement, k, upper) for k, a in enumerate("xyz"[:dim])}
        held.append(Displacement(group=group, **functions))
    sides = [f"{a}{e}" for a in "xyz"[: dim - 1] for e in "01"]

    def traction(k):
        return lambda x, n, t: n[:, :dim] @ stress[k]

    loads = [Traction(group=side, **{f"t{a}": traction(k) for k, a in enumerate("xyz"[:dim])}) for side in sides]
    return Case(
        model="3d" if dim == 3 else "plane_strain", mesh=mesh, material=[Material(young=YOUNG, poisson=POISSON)],
        contact=[Contact(name="joint", slave="slave", master="master", friction=MU)], displacement=held, traction=loads,
        solver=Solver(tolerance=1e-13),
    )  # fmt: skip


def of_axis(displacement, k, upper):
    return lambda x, t: displacement(x, upper)[:, k]


@pytest.mark.parametrize(("pair", "way", "place"), CASES, ids=str)
def test_patch(pair, way, place):
    dim = pair[0]
    case = press(*pair, way, place == "below")
    solution = ls.solve(case)
    zone = solution.contact["joint"]
    stress, displacement = exact(dim, way)
    mesh = solution.mesh
    x = mesh.points[:, :dim]
    upper = np.zeros((len(x), 1), bool)
    for _, _, nodes in mesh.select(mesh.cells_of("upper")):
        upper[nodes] = True
    np.testing.assert_allclose(solution.u, np.where(upper, displacement(x, True), displacement(x, False)), atol=1e-12)
    np.testing.assert_allclose(zone.pressure, PRESSURE, rtol=1e-10)
    np.testing.assert_allclose(np.linalg.norm(zone.shear, axis=1), WAYS[way][0], rtol=1e-10)
    np.testing.assert_allclose(np.linalg.norm(zone.slip_vector, axis=1), WAYS[way][1], atol=1e-12)
    assert (zone.status == (2 if way == "slide" else 1)).all() and zone.use.max() <= 1 + 1e-12
    on_master = zone.shear_vector + zone.pressure[:, None] * zone.normal
    np.testing.assert_allclose(on_master, -zone.normal @ stress, atol=1e-10)


@pytest.mark.parametrize("poisson", [0.0, 0.3])
@pytest.mark.parametrize(
    ("slave", "master", "d", "counts"),
    [("QUAD4", "QUAD4", 2, (1, 1)), ("HEXA8", "HEXA8", 3, (2, 1)), ("TRIA6", "QUAD8", 2, (4, 3))],
)
def test_a_body_that_friction_alone_holds_aside_is_pressed_straight_down(slave, master, d, counts, poisson):
    """Nothing pushes it aside: the forces that friction carries along that motion are round-off."""
    down = {2: "uy", 3: "uz"}[d]
    whole = dict.fromkeys(("ux", "uy", "uz")[:d], 0.0)
    case = Case(
        model={2: "plane_strain", 3: "3d"}[d],
        material=[Material(young=1e3, poisson=poisson)],
        contact=[Contact(slave="slave", master="master", friction=0.3)],
        displacement=[Displacement(group="bottom", **whole), Displacement(group="top", **{down: -0.01})],
    )
    pressure = ls.solve(case, stack(slave, master, d, counts=counts)).contact["slave"].pressure
    if poisson == 0:
        np.testing.assert_allclose(pressure, 5.0, rtol=1e-12)
    else:
        assert pressure.min() > 0 and abs(pressure.mean() - 5.4) < 0.4
