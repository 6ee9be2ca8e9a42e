"""Ties: blocks glued together carry any stress, and turn as one even across a gap."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh.cells import CELLS
from lacsolver.case import Case, Displacement, Material, Steps, Tie, Traction, parse_case
from lacsolver.output import create_output
from lacsolver.problem.problem import Problem
from lacsolver.results.state import CONTACT
from lacsolver.running import run
from lacsolver.saddle.contact_system import contact_system
from lacsolver.validation import validate
from tests.checks.blocks import block as grid
from tests.checks.blocks import join, skin
from tests.lacsolver.contact_cases import HEAD, JOINT, MATERIAL, YOUNG, by_node, held, nodes_of, only, pressed, stresses
from tests.lacsolver.patch_meshes import stack, three_blocks, ways
from verification.measures.balance import unbalanced
from verification.meshes.stacks import PLANE_KINDS, SOLID_KINDS

TIE = '[[tie]]\nslave = "slave"\nmaster = "master"\n'
#: a displacement with every strain and a rotation in it
GRADIENT = 1e-3 * np.array([[1.0, 2.0, -1.0], [0.5, -2.0, 1.5], [-0.5, 1.0, 3.0]])
TURN = 1e-3 * np.array([[0.0, -3.0, 2.0], [3.0, 0.0, -1.0], [-2.0, 1.0, 0.0]])
LAME = YOUNG * 0.3 / (1.3 * 0.4), YOUNG / 2.6
_PAIRS = [(kind, "TRIA6" if kind != "TRIA6" else "QUAD9", 2, "pyramid") for kind in PLANE_KINDS]
_PAIRS += [(kind, SOLID_KINDS[k - 4], 3, way) for k, kind in enumerate(SOLID_KINDS) for way in ways(kind)]


def linear(gradient, dim):
    """Components of the displacement A x, as formulas."""
    return {
        f"u{a}": " + ".join(f"{gradient[s, k]!r} * {b}" for k, b in enumerate("xyz"[:dim])).replace("np.float64", "")
        for s, a in enumerate("xyz"[:dim])
    }


@pytest.mark.parametrize("slave, master, dim, way", _PAIRS)
def test_a_tie_carries_any_uniform_stress(slave, master, dim, way):
    """The patch test of ties: A x on the whole outside, the uniform stress of A inside, its traction on the slave."""
    mesh = stack(slave, master, dim)
    A = GRADIENT.copy()
    if dim == 2:
        A[2], A[:, 2] = 0.0, 0.0
    sides = ("x0", "x1", "bottom", "top") + (("y0", "y1") if dim == 3 else ())
    fixed = "".join(held(side, **linear(A, dim)) for side in sides)
    model = "3d" if dim == 3 else "plane_strain"
    hexa = f'hexa = "{way}"\n' if way != "pyramid" else ""
    problem, state = only(mesh, TIE + hexa + fixed, model)
    strain = (A + A.T) / 2
    sigma = LAME[0] * np.trace(strain) * np.eye(3) + 2 * LAME[1] * strain
    want = sigma[[0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]
    found = stresses(problem, state)
    np.testing.assert_allclose(found, np.tile(want[: found.shape[1]], (len(found), 1)), atol=1e-10 * np.abs(want).max())
    np.testing.assert_allclose(by_node(problem, state), problem.space.mesh.points @ A.T[:, :dim], atol=1e-13)
    (zone,) = state.zones
    traction = np.tile(sigma[:dim, dim - 1], (len(zone.area), 1))
    np.testing.assert_allclose(zone.traction, traction, atol=1e-9 * np.abs(sigma).max())
    np.testing.assert_allclose(zone.pressure, -sigma[dim - 1, dim - 1], rtol=1e-9)
    assert zone.tie and (zone.status == CONTACT).all()


@pytest.mark.parametrize("gap", [0.0, 0.07])
@pytest.mark.parametrize(
    "slave, master, dim", [("QUAD8", "TRIA3", 2), ("HEXA8", "TETRA10", 3), ("mixed 2", "HEXA8", 3)]
)
def test_a_body_that_only_a_tie_holds_turns_with_the_other(slave, master, dim, gap):
    """A rigid rotation costs nothing, also across a gap: the moment arm of the rotation is part of the jump."""
    mesh = stack(slave, master, dim, gap=gap)
    A = TURN if dim == 3 else TURN * [[1, 1, 0], [1, 1, 0], [0, 0, 0]]
    fixed = held("bottom", **linear(A, dim))
    problem, state = only(mesh, TIE + fixed, "3d" if dim == 3 else "plane_strain")
    np.testing.assert_allclose(by_node(problem, state), problem.space.mesh.points @ A.T[:, :dim], atol=1e-13)
    energy = problem.kinematics.energy(state.u, state.time)
    assert abs(energy) <= 1e-13 * YOUNG * np.abs(A).max() ** 2
    assert np.abs(state.zones[0].traction).max() <= 1e-11 * YOUNG * np.abs(A).max()


@pytest.mark.parametrize("gap", [0.0, 0.07])
@pytest.mark.parametrize(
    "slave, master", [("HEXA8", "TETRA10"), ("TETRA4", "HEXA20"), ("PENTA15 quadrangle", "mixed 1")]
)
def test_forces_and_moments_of_a_tie_are_in_balance(slave, master, gap):
    """Loaded askew on the side; across a gap, too, and the foot bears all of it."""
    mesh = stack(slave, master, 3, gap=gap)
    load = '[[traction]]\ngroup = "x1"\ntx = "1 + y"\nty = 0.5\ntz = "z - x"\n' + pressed("top", "x")
    problem, state = only(mesh, TIE + held("bottom", ux=0.0, uy=0.0, uz=0.0) + load)
    (zone,) = state.zones
    force, moment = unbalanced(problem.space.mesh.points, zone.force)
    assert max(force, moment) <= 1e-12 and np.abs(zone.force).max() > 1e-3
    bottom = nodes_of(problem, "bottom")
    given = problem.load(1.0).reshape(-1, 3)
    x = problem.space.mesh.points
    reaction = state.reaction.reshape(-1, 3)
    np.testing.assert_allclose(reaction[bottom].sum(axis=0), -given.sum(axis=0), atol=1e-11)
    np.testing.assert_allclose(
        np.cross(x[bottom], reaction[bottom]).sum(axis=0), -np.cross(x, given).sum(axis=0), atol=1e-11
    )


def test_what_a_tie_says_of_a_bent_joint_is_what_the_slave_gives():
    """Sum of traction x area on the slave, without a gap, against the load on the upper block."""
    mesh = stack("HEXA8", "HEXA20", 3, slave_below=False)
    _, state = only(mesh, TIE + held("bottom", ux=0.0, uy=0.0, uz=0.0) + pressed("top", "1 + x"))
    (zone,) = state.zones
    np.testing.assert_allclose(zone.traction.T @ zone.area, [0, 0, 1.5], atol=1e-11)


@pytest.mark.parametrize(("gap", "warns"), [(0.0, False), (0.02, False), (0.2, True)])
def test_the_gap_that_a_tie_bridges_is_named(gap, warns, tmp_path):
    """Wider than a tenth of a macro-element, it is a warning, of `run` and of `validate`."""
    mesh = stack("HEXA8", "TETRA4", 3, gap=gap)
    text = MATERIAL + TIE + held("bottom", ux=0.0, uy=0.0, uz=0.0) + pressed("top", "1")
    case = parse_case(HEAD.format(model="3d") + text)
    found = validate(case, mesh)
    (zone,) = found.zones
    assert (zone.bridged > 0) == (gap > 0) and (gap == 0 or zone.bridged == pytest.approx(gap))
    assert any("joins slave 'slave' to master 'master' across a gap" in one for one in zone.told) == warns
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        results = run(case, create_output(tmp_path / "out"), mesh=mesh)
    assert any("across a gap of up to" in str(one.message) for one in told) == warns
    assert results.bridged == ({} if not gap else {"slave": pytest.approx(gap)})


def test_a_tie_beside_a_contact():
    """Three blocks: the lower two are glued, the third lies on them and is lifted off."""
    mesh = three_blocks()
    tie = '[[tie]]\nname = "glue"\nslave = "slave1"\nmaster = "master1"\n'
    joint = JOINT.replace('"slave"', '"slave2"').replace('"master"', '"master2"')
    sections = joint + tie + held("x0", ux=0.0) + held("y0", uy=0.0) + held("bottom", uz=0.0)
    problem, state = only(mesh, sections + pressed("top", 2.0), material=MATERIAL)
    contact, glue = state.zones
    assert [contact.name, glue.name] == ["slave2", "glue"]
    np.testing.assert_allclose(contact.pressure, 2.0, rtol=1e-10)
    np.testing.assert_allclose(glue.pressure, 2.0, rtol=1e-10)
    np.testing.assert_allclose(stresses(problem, state)[:, 2], -2.0, rtol=1e-10)
    _, state = only(mesh, sections + held("top", uz=0.1))
    contact, glue = state.zones
    np.testing.assert_allclose(contact.gap, 0.1, rtol=1e-11)
    assert np.abs(glue.traction).max() <= 1e-12 * YOUNG


def turning(angle, kind, load=0.0, gap=0.5):
    """(case, mesh): a block tied across a gap to one that is turned about z by an angle, then sheared."""
    d, kind, order = CELLS[kind].dim, CELLS[kind].linear, 1 + (CELLS[kind].linear != kind)
    low, high = (
        grid((2, 1, 1)[:d], (0, 0, 0)[:d], (2, 1, 1)[:d], kind),
        grid((3, 1, 2)[:d], (0, 1 + gap, 0)[:d], (2, 2 + gap, 1)[:d], kind),
    )
    skins = [
        skin(*cells, lambda x, y=y: np.isclose(x[..., 1], y))
        for cells, y in ((low, 1), (high, 1 + gap), (high, 2 + gap))
    ]
    of_low = {"m": skins[0], "low": skin(*low, lambda x: x[..., 0] > -1)}
    mesh = join([(*low, of_low), (*high, {"s": skins[1], "top": skins[2]})])
    phi = f"({angle} * min(t, 1))"
    turned = {"ux": f"x * (cos{phi} - 1) - y * sin{phi}", "uy": f"x * sin{phi} + y * (cos{phi} - 1)"}
    turned |= {"uz": 0.0} if d == 3 else {}
    along = [f"{load} * max(t - 1, 0) * cos({angle})", f"{load} * max(t - 1, 0) * sin({angle})"]
    case = Case(
        model="3d" if d == 3 else "plane_strain", kinematics="finite", tie=Tie(slave="s", master="m"),
        material=Material(law="saint_venant_kirchhoff", young=1000.0, poisson=0.3),
        displacement=Displacement(group="low", **turned), traction=Traction(group="top", tx=along[0], ty=along[1]),
        steps=Steps(times=(0.25, 0.5, 0.75, 1.0, 2.0)),
    )  # fmt: skip
    return case, mesh if order == 1 else lacmesh.raise_order(mesh)


@pytest.mark.parametrize("gap", [0.0, 0.5])
@pytest.mark.parametrize("kind", ["QUAD4", "HEXA8"])
def test_a_tie_turns_with_its_bodies(kind, gap):
    """A rigid turn of 90 degrees needs no force; a load that turns with it moves the bodies as the same load before."""
    straight, turned = (list(ls.march(*turning(angle, kind, 5.0, gap))) for angle in (0.0, np.pi / 2))
    R = np.eye(straight[0].mesh.space_dim)
    R[:2, :2] = [[0, -1], [1, 0]]
    for one, other in zip(straight[3:], turned[3:], strict=True):
        x = one.mesh.points[:, : len(R)]
        np.testing.assert_allclose(x + other.u, (x + one.u) @ R.T, atol=1e-8)
    assert straight[4].iterations <= 5 and np.abs(straight[4].u).max() > 0.015
    assert np.abs(turned[3].contact["s"].force).max() <= 1e-8
    u, forces = (np.pad(one, ((0, 0), (0, 3 - len(R)))) for one in (turned[4].u, turned[4].contact["s"].force))
    force, moment = unbalanced(turned[4].mesh.points + u, forces)
    assert max(force, moment) <= 1e-10 and max(turned[4].figures.balance) <= 1e-10
    has_turned_pressures(straight[4], turned[4], R)


def has_turned_pressures(straight, turned, R):
    """Check that pressures are the same, and along normals that turn by R."""
    one, other = straight.contact["s"], turned.contact["s"]
    assert one.pressure.max() > 10
    for name in ("pressure", "recovered", "pressure_recovered", "gap", "area"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), atol=1e-6, err_msg=name)
    for name in ("normal", "centre"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name) @ R.T, atol=1e-8, err_msg=name)
    moment, after = (state.figures.contact["s"].moment for state in (straight, turned))
    np.testing.assert_allclose(after, moment if len(R) == 2 else R @ moment, atol=1e-6)


@pytest.mark.parametrize("kind", ["QUAD4", "HEXA8"])
def test_the_pressure_of_a_tie_that_is_pulled_after_a_turn(kind):
    """Without lateral contraction it is the pull, per undeformed area, as the load is."""
    case, mesh = turning(np.pi / 2, kind, gap=0.0)
    bar = (Material(law="saint_venant_kirchhoff", young=1000.0, poisson=0.0),)
    case = replace(case, material=bar, traction=(Traction(group="top", tx="-50 * max(t - 1, 0)", ty=0.0),))
    *_, state = ls.march(case, mesh)
    zone, d = state.contact["s"], state.mesh.space_dim
    np.testing.assert_allclose(zone.pressure, -50.0, rtol=1e-8)
    np.testing.assert_allclose(zone.recovered, -50.0, rtol=1e-8)
    np.testing.assert_allclose(zone.normal, np.tile([1.0, 0.0, 0.0][:d], (len(zone.area), 1)), atol=1e-9)
    np.testing.assert_allclose(zone.centre[:, 0], -1.0, rtol=1e-9)


@pytest.mark.parametrize("kind", ["QUAD4", "TRIA6", "HEXA20"])
def test_the_rows_of_a_tie_across_a_gap_and_their_derivatives(kind):
    """B is the derivative of the jump at a large displacement, and the geometric stiffness that of B^T p."""
    problem = Problem.of(*turning(0.0, kind))
    rng, space = np.random.default_rng(1), problem.space
    (pair,), (u, v) = problem.joints, rng.uniform(-0.05, 0.05, (2, problem.space.n_dof))

    def rows(u):
        return contact_system(problem, [pair.integrate(space, u, 1.0)], u)

    h, now = 1e-5, rows(u)
    p = rng.uniform(-1, 1, len(now.G))
    ahead, back = rows(u + h * v), rows(u - h * v)
    np.testing.assert_allclose(now.rows.B @ v, (back.G - ahead.G) / (2 * h), atol=1e-9)
    change = (ahead.rows.B - back.rows.B).T @ p / (2 * h)
    np.testing.assert_allclose(now.geometric_stiffness(p) @ v, change, atol=1e-7 * np.abs(change).max())
