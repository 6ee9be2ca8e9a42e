"""Ties: blocks glued together carry any stress, turn as one even across a gap, and give back a body that was split."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh.cells import CELLS
from lacmesh.generate import box, rectangle
from lacmesh.generate import stack as stacked
from lacsolver.case import Displacement, Material, Pretension, Steps, Tie, Traction, Value
from lacsolver.output import create_output
from lacsolver.problem.problem import Problem
from lacsolver.results.state import CONTACT
from lacsolver.running import run
from lacsolver.saddle.contact_system import contact_system
from lacsolver.validation import validate
from tests.checks.blocks import SOLIDS, block, join, skin
from tests.lacsolver.contact_cases import YOUNG, by_node, load, only, stresses
from tests.lacsolver.patch_meshes import stack, ways
from tests.meshes import facets_of
from tests.problems import ELASTIC, case_of, fix, move
from tests.samples import samples
from verification.measures.balance import unbalanced
from verification.meshes.stacks import PLANE_KINDS, SOLID_KINDS

TIE = Tie(slave="slave", master="master")
GROUND = fix("bottom", "xyz")
#: a displacement with every strain and a rotation in it, and a rotation
GRADIENT = 1e-3 * np.array([[1.0, 2.0, -1.0], [0.5, -2.0, 1.5], [-0.5, 1.0, 3.0]])
TURN = 1e-3 * np.array([[0.0, -3.0, 2.0], [3.0, 0.0, -1.0], [-2.0, 1.0, 0.0]])
MODELS = {2: "plane_strain", 3: "3d"}
_PAIRS = [(kind, "TRIA6" if kind != "TRIA6" else "QUAD9", 2, "pyramid") for kind in PLANE_KINDS]
_PAIRS += [(kind, SOLID_KINDS[k - 4], 3, way) for k, kind in enumerate(SOLID_KINDS) for way in ways(kind)]


def linear(group, H):
    """The displacement H x of a group."""
    d = len(H)
    fields = (Value.of(lambda x, t, k=k: np.asarray(x)[:, :d] @ H[k]) for k in range(d))
    return Displacement(group=group, **dict(zip(("ux", "uy", "uz"), fields, strict=False)))


def outside(H):
    """The displacement H x of all sides of a stack."""
    sides = ("x0", "x1", "bottom", "top", "y0", "y1")[: 2 * len(H)]
    return [linear(side, H) for side in sides]


@pytest.mark.parametrize("slave, master, dim, way", _PAIRS)
def test_a_tie_carries_any_uniform_stress(slave, master, dim, way):
    """The patch test of ties: A x on the whole outside, the uniform stress of A inside, its traction on the slave."""
    A = np.zeros((3, 3))
    A[:dim, :dim] = GRADIENT[:dim, :dim]
    problem, state = only(stack(slave, master, dim), replace(TIE, hexa=way), *outside(A[:dim, :dim]), model=MODELS[dim])
    strain, (lame, shear) = (A + A.T) / 2, (YOUNG * 0.3 / (1.3 * 0.4), YOUNG / 2.6)
    sigma = lame * np.trace(strain) * np.eye(3) + 2 * shear * strain
    found, want = stresses(problem, state), sigma[[0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]
    np.testing.assert_allclose(found, np.tile(want[: found.shape[1]], (len(found), 1)), atol=1e-10 * np.abs(want).max())
    np.testing.assert_allclose(by_node(problem, state), problem.space.mesh.points @ A.T[:, :dim], atol=1e-13)
    (zone,) = state.zones
    traction = np.tile(sigma[:dim, dim - 1], (len(zone.area), 1))
    np.testing.assert_allclose(zone.traction, traction, atol=1e-9 * np.abs(sigma).max())
    np.testing.assert_allclose(zone.pressure, -sigma[dim - 1, dim - 1], rtol=1e-9)
    assert zone.tie and (zone.status == CONTACT).all()


GAPS = pytest.mark.parametrize("gap", [0.0, 0.07])


@GAPS
@pytest.mark.parametrize(
    "slave, master, dim", [("QUAD8", "TRIA3", 2), ("HEXA8", "TETRA10", 3), ("mixed 2", "HEXA8", 3)]
)
def test_a_body_that_only_a_tie_holds_turns_with_the_other(slave, master, dim, gap):
    """A rigid rotation costs nothing, also across a gap: the moment arm of the rotation is part of the jump."""
    A = TURN[:dim, :dim]
    problem, state = only(stack(slave, master, dim, gap=gap), TIE, linear("bottom", A), model=MODELS[dim])
    np.testing.assert_allclose(by_node(problem, state), problem.space.mesh.points[:, :dim] @ A.T, atol=1e-13)
    energy = problem.kinematics.energy(state.u, state.time)
    assert abs(energy) <= 1e-13 * YOUNG * np.abs(A).max() ** 2
    assert np.abs(state.zones[0].traction).max() <= 1e-11 * YOUNG * np.abs(A).max()


def test_what_a_tie_says_of_a_bent_joint_is_what_the_slave_gives():
    """Sum of traction x area on the slave, without a gap, against the load on the upper block."""
    _, state = only(stack("HEXA8", "HEXA20", 3, slave_below=False), TIE, GROUND, load("top", "1 + x"))
    (zone,) = state.zones
    np.testing.assert_allclose(zone.traction.T @ zone.area, [0, 0, 1.5], atol=1e-11)


@pytest.mark.parametrize(("gap", "warns"), [(0.0, False), (0.02, False), (0.2, True)])
def test_the_gap_that_a_tie_bridges_is_named(gap, warns, tmp_path):
    """Wider than a tenth of a macro-element, it is a warning, of `run` and of `validate`."""
    case = case_of(stack("HEXA8", "TETRA4", 3, gap=gap), ELASTIC, TIE, GROUND, load("top", "1"), model="3d")
    (zone,) = validate(case).zones
    assert zone.bridged == (pytest.approx(gap) if gap else 0)
    assert any("across a gap" in one for one in zone.told) == warns
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        results = run(case, create_output(tmp_path / "out"))
    assert any("across a gap of up to" in str(one.message) for one in told) == warns
    assert results.bridged == ({} if not gap else {"slave": pytest.approx(gap)})


# ---- finite kinematics


def turning(angle, kind, shear=0.0, gap=0.5, **traction):
    """The case of a block tied across a gap to one that is turned about z by an angle, then sheared, or loaded."""
    cell, shape = CELLS[kind].linear, {2: rectangle, 3: box}[CELLS[kind].dim]
    counts = [(2, 1), (3, 2)] if shape is rectangle else [(2, 1, 1), (3, 1, 2)]
    if shape is box:  # stacked along y: bottom and top are its front and back
        low, high = (box(n, (2, 1, 1), cell) for n in counts)
        names = {"front": "bottom", "back": "top", "bottom": "under", "top": "over"}
        low, high = (mesh.renamed(**names).renamed(body=name) for mesh, name in ((low, "lower"), (high, "upper")))
        mesh = lacmesh.join(
            low.renamed(top="master"), high.moved([0, 1 + gap, 0]).renamed(bottom="slave")
        )  # fmt: skip
    else:
        mesh = stacked(*(rectangle(n, (2, 1), cell) for n in counts), gap=gap)
    phi = f"({angle} * min(t, 1))"
    turned = {"ux": f"x * (cos{phi} - 1) - y * sin{phi}", "uy": f"x * sin{phi} + y * (cos{phi} - 1)"}
    turned |= {"uz": 0.0} if shape is box else {}
    along = [f"{shear} * max(t - 1, 0) * cos({angle})", f"{shear} * max(t - 1, 0) * sin({angle})"]
    pull = {"tx": along[0], "ty": along[1]} | traction
    records = TIE, move("lower", **turned), Traction(group="top", **pull), Steps(times=(0.25, 0.5, 0.75, 1.0, 2.0))
    law = Material(law="saint_venant_kirchhoff", young=1000.0, poisson=0.0 if traction else 0.3)
    mesh = mesh if kind == cell else lacmesh.raise_order(mesh)
    return case_of(mesh, law, *records, model=MODELS[mesh.space_dim], kinematics="finite")


@pytest.mark.parametrize("gap", [0.0, 0.5])
@pytest.mark.parametrize("kind", ["QUAD4", "HEXA8"])
def test_a_tie_turns_with_its_bodies(kind, gap):
    """A rigid turn of 90 degrees needs no force; a load that turns with it moves the bodies as the same load before."""
    straight, turned = (list(ls.march(turning(angle, kind, 5.0, gap))) for angle in (0.0, np.pi / 2))
    R = np.eye(straight[0].mesh.space_dim)
    R[:2, :2] = [[0, -1], [1, 0]]
    for one, other in zip(straight[3:], turned[3:], strict=True):
        x = one.mesh.points[:, : len(R)]
        np.testing.assert_allclose(x + other.u, (x + one.u) @ R.T, atol=1e-8)
    assert straight[4].iterations <= 5 and np.abs(straight[4].u).max() > 0.015
    assert np.abs(turned[3].contact["slave"].force).max() <= 1e-8
    one, other = straight[4].contact["slave"], turned[4].contact["slave"]
    u, forces = (np.pad(values, ((0, 0), (0, 3 - len(R)))) for values in (turned[4].u, other.force))
    assert max(unbalanced(turned[4].mesh.points + u, forces)) <= 1e-10 and max(turned[4].figures.balance) <= 1e-10
    assert one.pressure.max() > 10  # pressures are the same, and along normals that turn by R
    for name in ("pressure", "recovered", "pressure_recovered", "gap", "area"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), atol=1e-6, err_msg=name)
    for name in ("normal", "centre"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name) @ R.T, atol=1e-8, err_msg=name)
    moment, after = (state.figures.contact["slave"].moment for state in (straight[4], turned[4]))
    np.testing.assert_allclose(after, moment if len(R) == 2 else R @ moment, atol=1e-6)


@pytest.mark.parametrize("kind", ["QUAD4", "HEXA8"])
def test_the_pressure_of_a_tie_that_is_pulled_after_a_turn(kind):
    """Without lateral contraction it is the pull, per undeformed area, as the load is."""
    *_, state = ls.march(turning(np.pi / 2, kind, gap=0.0, tx="-50 * max(t - 1, 0)", ty=0.0))
    zone, d = state.contact["slave"], state.mesh.space_dim
    np.testing.assert_allclose(zone.pressure, -50.0, rtol=1e-8)
    np.testing.assert_allclose(zone.recovered, -50.0, rtol=1e-8)
    np.testing.assert_allclose(zone.normal, np.tile([1.0, 0.0, 0.0][:d], (len(zone.area), 1)), atol=1e-9)
    np.testing.assert_allclose(zone.centre[:, 0], -1.0, rtol=1e-9)


@pytest.mark.parametrize("kind", ["QUAD4", "TRIA6", "HEXA20"])
def test_the_rows_of_a_tie_across_a_gap_and_their_derivatives(kind):
    """B is the derivative of the jump at a large displacement, and the geometric stiffness that of B^T p."""
    problem = Problem.of(turning(0.0, kind))
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


# ---- a tie over the two sides of a split gives back the whole body, on all cells

KINDS = [name for name, cell in CELLS.items() if cell.dim > 1]


def divided(kind, seed, wide=2):
    """A unit block with the group `G` of facets between the cells below a random surface and those above it."""
    linear, order = SOLIDS[kind]
    d, rng = CELLS[linear].dim, np.random.default_rng(seed)
    points, cells = block((3, 3) if d == 2 else (wide, wide, 3), (0,) * d, (1,) * d, linear)
    solid = lacmesh.Mesh.create(points, cells.items(), space_dim=d)
    centres = np.concatenate([points[nodes].mean(axis=1) for nodes in cells.values()])
    below, found = centres[:, d - 1] + 0.35 * (rng.random(len(centres)) - 0.5) < 0.5, {}
    for owners in facets_of(solid).values():
        if len(owners) == 2 and below[owners[0][0]] != below[owners[1][0]]:
            found.setdefault(owners[0][2], []).append(owners[0][3])
    skins = {"G": {name: np.array(rows) for name, rows in found.items()}}
    for k, axis in enumerate("xyz"[:d]):
        for end in (0, 1):
            skins[f"{axis}{end}"] = skin(points, cells, lambda x, k=k, end=end: np.abs(x[..., k] - end) < 1e-9)
    mesh = join([(points, cells, skins)])
    return lacmesh.raise_order(mesh, order) if order else mesh


SOFT = Material(young=100.0, poisson=0.3)


@pytest.mark.filterwarnings("ignore:.*:lacmesh.errors.LacmeshWarning")
@pytest.mark.fuzz
@pytest.mark.parametrize("seed", samples((0,), range(4)))
@pytest.mark.parametrize("kind", KINDS)
def test_a_tie_is_the_whole_body_under_uniform_strain(kind, seed):
    mesh = divided(kind, seed)
    d = mesh.space_dim
    H = np.random.default_rng(seed).uniform(-1, 1, (d, d))
    sides = [linear(f"{axis}{end}", H) for axis in "xyz"[:d] for end in "01"]
    glue = Tie(slave="G_a", master="G_b")
    solution = ls.solve(case_of(lacmesh.split(mesh, "G"), SOFT, glue, *sides, model=MODELS[d]))
    used = np.unique(np.concatenate([b.nodes.ravel() for b in solution.mesh.blocks]))
    np.testing.assert_allclose(solution.u[used], solution.mesh.points[used, :d] @ H.T, rtol=0, atol=1e-10)


@pytest.mark.parametrize("kind", KINDS)
def test_a_section_without_a_shortening_is_the_whole_body_under_any_load(kind):
    mesh = divided(kind, 5, 3)
    d, up = mesh.space_dim, "xyz"[mesh.space_dim - 1]
    pull = {"tx": 0.3, "ty": 1.0} | ({"tz": -2.0} if d == 3 else {})
    records = SOFT, fix(f"{up}0", "xyz"[:d]), Traction(group=f"{up}1", **pull)
    section = Pretension(group="G", shortening=0.0)
    apart, whole = (ls.solve(case_of(mesh, *records, *more, model=MODELS[d])) for more in ((section,), ()))
    np.testing.assert_allclose(apart.u[: mesh.n_nodes], whole.u, rtol=0, atol=1e-12 * np.abs(whole.u).max() + 1e-13)
