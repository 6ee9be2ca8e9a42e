"""Contact of blocks whose answer is known in closed form: pressed, parted, overlapping, warm, heavy, unloaded again.

Then skins that nothing can move, warped ones, the direction of contact, and ties, also over the two sides of a split.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.generate import box, rectangle
from lacmesh.generate import stack as stacked
from lacsolver.case import CaseError, Displacement, Material, Pretension, Steps, Temperature, Tie, Traction, Value
from lacsolver.doubts.run import Run
from lacsolver.doubts.steps import dips
from lacsolver.equilibrium.state import CONTACT, OPEN, UNPAIRED
from lacsolver.output import create_output
from lacsolver.problem.problem import Problem
from lacsolver.running import run
from lacsolver.saddle.contact_system import contact_system
from lacsolver.validation import validate
from tests.checks.blocks import SOLIDS, block, join, skin
from tests.lacsolver.contact_cases import POISSON, SIDES, YOUNG, by_node, load, only, resultant, solve, stresses
from tests.lacsolver.patch_meshes import stack, ways
from tests.meshes import facets_of
from tests.problem_meshes import overhang
from tests.problems import ELASTIC, case_of, contact, fix, move
from tests.samples import each_option, samples
from verification.families.friction_moving import solve_on_table
from verification.measures.balance import unbalanced
from verification.meshes.sliding import in_groove
from verification.meshes.stacks import PLANE_KINDS, SOLID_KINDS

#: (slave, master, model): one of each model, and cells that differ
PAIRS = [
    ("HEXA8", "TETRA4", "3d"),
    ("TETRA10", "HEXA20", "3d"),
    ("TRIA3", "QUAD8", "plane_strain"),
    ("QUAD9", "TRIA6", "plane_stress"),
    ("QUAD8", "QUAD4", "axisymmetric"),
]
EACH_PAIR = pytest.mark.parametrize(("slave", "master", "model"), PAIRS)
FIXED = *SIDES, fix("bottom", "z")


def blocks(slave, master, model, **options):
    """A stack, the records that let it slide along its sides and hold its bottom, and the key of its height."""
    dim = 3 if model == "3d" else 2
    up = "xyz"[dim - 1]
    return stack(slave, master, dim, **options), (*SIDES[: dim - 1], fix("bottom", up)), f"u{up}"


def modulus(model):
    """Stress along the height for a unit strain along it, free sideways."""
    return YOUNG / (1 - POISSON**2) if model == "plane_strain" else YOUNG


def check_uniform(problem, state, p):
    """Every pressure is p, and so is the stress along the height; nothing else but what plane strain asks for."""
    for zone in state.zones:
        np.testing.assert_allclose(zone.pressure, p, rtol=1e-10)
    sigma = stresses(problem, state)
    want = np.zeros(sigma.shape[1])
    want[problem.space.dim - 1] = -p
    if problem.case.model == "plane_strain":
        want[2] = -POISSON * p
    np.testing.assert_allclose(sigma, np.tile(want, (len(sigma), 1)), atol=1e-10 * abs(p))


@pytest.mark.parametrize(
    "slave, master, model, initial", each_option((*pair, way) for pair in PAIRS for way in ("gap", "all", "none"))
)
def test_unilateral_contact_lets_go(slave, master, model, initial):
    """The upper block is lifted as it is, the lower one does not follow."""
    mesh, fixed, up = blocks(slave, master, model)
    _, state = only(mesh, contact(initial=initial), *fixed, move("top", **{up: 0.01}), model=model)
    (zone,) = state.zones
    assert (zone.pressure == 0).all() and (zone.status == OPEN).all() and (zone.force == 0).all()
    np.testing.assert_allclose(zone.gap, 0.01, rtol=1e-11)


@pytest.mark.parametrize(
    "slave, master, model, gap, clearance",
    each_option(
        (*pair, *opening) for pair in PAIRS for opening in ((0.1, -0.04), (0.0, 0.06), (0.06, 0.0), (0.0, -0.01))
    ),
)
def test_a_clearance_is_closed_before_anything_presses(slave, master, model, gap, clearance):
    """Real or by `clearance`, closed by 0.01 less and by 0.02 more than it is; an overlap presses by itself."""
    mesh, fixed, up = blocks(slave, master, model, gap=gap)
    for beyond in (-0.01, 0.02):
        end = move("top", **{up: -(gap + clearance + beyond)})
        problem, state = only(mesh, contact(clearance=clearance), *fixed, end, model=model)
        if beyond < 0:
            np.testing.assert_allclose(state.zones[0].gap, 0.01, rtol=1e-11)
        else:
            check_uniform(problem, state, modulus(model) * beyond / 2)


@pytest.mark.parametrize("clearance", ["-0.01 * t", [[0, 0], [1, -0.01]]])
def test_a_clearance_may_change_with_time(clearance):
    """Two blocks of height 1 between fixed ends overlap, so that both are strained by half of it."""
    mesh, fixed, _ = blocks("HEXA8", "TETRA4", "3d")
    problem, states = solve(mesh, contact(clearance=clearance), *fixed, fix("top", "z"), Steps(count=4))
    assert [state.time for state in states] == [0.25, 0.5, 0.75, 1.0]
    for state in states:
        check_uniform(problem, state, YOUNG * 0.01 * state.time / 2)


@pytest.mark.rows("warm0-1.0-QUAD8-QUAD4-axisymmetric", "warm1-0.5-QUAD9-TRIA6-plane_stress")
@EACH_PAIR
@pytest.mark.parametrize("warm, share", [({}, 1.0), ({"groups": ["upper"]}, 0.5)])
def test_thermal_strain_presses_blocks_together(slave, master, model, warm, share):
    """Between fixed ends, with a clearance of a quarter of what both would grow by."""
    mesh, fixed, up = blocks(slave, master, model)
    law = Material(young=YOUNG, poisson=POISSON, expansion=1e-4, reference_temperature=20.0)
    records = contact(clearance=0.005), *fixed, fix("top", up[1]), Temperature(value=120.0, **warm)
    problem, state = only(mesh, *records, model=model, material=law)
    # in plane strain expansion across the plane is held, too, and adds its part of Poisson's
    grown = 0.01 * (1 + POISSON if model == "plane_strain" else 1) * 2 * share
    p = modulus(model) * (grown - 0.005) / 2
    np.testing.assert_allclose(state.zones[0].pressure, p, rtol=1e-10)
    np.testing.assert_allclose(stresses(problem, state)[:, problem.space.dim - 1], -p, rtol=1e-9)


@pytest.mark.parametrize("threshold, count", [(0.45, 1), (0.55, 2)])
def test_the_coverage_threshold_unpairs_what_is_covered_less(threshold, count):
    """The upper block covers 5/8 of the lower, one of four macro-elements by half."""
    held = fix("bottom", "y"), fix("x0", "x"), load("top", 1.0)
    _, state = only(overhang(), contact(coverage_threshold=threshold), *held, model="plane_strain")
    (zone,) = state.zones
    on = zone.status != UNPAIRED
    assert (~on).sum() == count
    assert zone.pressure @ (zone.area * np.where(on, zone.coverage, 0.0)) == pytest.approx(0.625, rel=1e-11)


@EACH_PAIR
def test_a_coverage_of_all_that_rounding_leaves_is_all(slave, master, model):
    mesh, fixed, up = blocks(slave, master, model)
    _, state = only(mesh, contact(coverage_threshold=1.0), *fixed, move("top", **{up: -0.01}), model=model)
    assert (state.zones[0].status == CONTACT).all()


def test_what_is_beyond_the_search_distance_is_not_looked_at():
    mesh, fixed, _ = blocks("HEXA8", "TETRA4", "3d", gap=0.2)
    _, state = only(mesh, contact(search_distance=0.3), *fixed, fix("top", "z"))
    assert (state.zones[0].status == OPEN).all()
    with pytest.raises(CaseError, match="raise search_distance"):
        ls.solve(case_of(mesh, ELASTIC, contact(search_distance=0.1), *fixed, fix("top", "z"), model="3d"))


def test_unloading_goes_back_the_way_it_came():
    """Pressed, let go, lifted, pressed again, by a motion and by a load: contact has no memory."""
    mesh, fixed, _ = blocks("HEXA8", "TETRA4", "3d")
    table = [[0, 0], [1, -0.01], [2, 0.01], [3, -0.01], [4, 0]]
    _, states = solve(mesh, contact(), *fixed, move("top", uz=table), Steps(end=4.0, count=8))
    assert len(states) == 8
    for state in states:
        top, (zone,) = np.interp(state.time, *np.array(table).T), state.zones
        np.testing.assert_allclose(zone.pressure, YOUNG * max(-top, 0) / 2, atol=1e-11 * YOUNG)
        np.testing.assert_allclose(zone.gap, max(top, 0), atol=1e-13)
    for once, again in ((0, 6), (1, 5), (2, 4)):
        np.testing.assert_allclose(states[once].u, states[again].u, atol=1e-14)
    table = [[0, 0], [1, 3.0], [2, 0.5], [3, 2.0]]
    problem, states = solve(mesh, contact(), *fixed, load("top", table), Steps(end=3.0, count=6))
    for state in states:
        check_uniform(problem, state, np.interp(state.time, *np.array(table).T))


# ---- macro-elements that nothing can move: all nodes of both surfaces are prescribed

GLUE = Tie(slave="slave", master="master")
BILATERAL = contact(type="bilateral")


def stuck(joint, uz):
    return only(stack("HEXA8", "TETRA4", 3), joint, fix("lower", "xyz"), move("upper", ux=0.0, uy=0.0, uz=uz))[1]


@pytest.mark.parametrize("joint", [contact(), contact(geometry="current"), BILATERAL, GLUE])
def test_skins_that_fit_are_what_they_are(joint):
    (zone,) = stuck(joint, 0.0).zones
    assert (zone.status == (CONTACT if joint in (BILATERAL, GLUE) else OPEN)).all()
    assert (zone.pressure == 0).all() and np.abs(zone.gap).max() <= 1e-15
    if joint == contact():
        (zone,) = stuck(joint, 0.01).zones
        assert (zone.status == OPEN).all() and zone.gap == pytest.approx(0.01, rel=1e-12)


@pytest.mark.parametrize(
    "joint, uz, says",
    [
        (contact(), -0.01, "9 macro-elements overlap by up to 0.01 at time 1.*all nodes of both surfaces"),
        (BILATERAL, 0.02, "contact: 9 macro-elements are apart by up to 0.02"),
        (GLUE, 0.02, "tie: 9 macro-elements are apart by up to 0.02"),
        (contact(), [[0, 0], [0.5, 0.1], [1, -0.1]], "overlap by up to 0.1 at time 1"),
    ],
)
def test_what_cannot_be_is_refused(joint, uz, says):
    with pytest.raises(CaseError, match=says):
        stuck(joint, uz)


def test_a_tie_of_which_a_component_is_held_carries_the_others():
    """Nothing moves along y, on either side: what is left of the tie is in force, and says so."""
    fixed = fix("bottom", "xyz"), fix("lower", "y"), fix("upper", "y"), Traction(group="top", tx=0.5, tz=2.0)
    problem, state = only(stack("HEXA8", "TETRA4", 3), GLUE, *fixed)
    (zone,) = state.zones
    assert (zone.status == CONTACT).all() and zone.gap.max() <= 1e-14
    np.testing.assert_allclose(resultant(zone, problem)[[0, 2]], [0.5, 2.0], rtol=1e-10)
    assert (zone.traction[:, 1] == 0).all()


def test_some_that_are_stuck_among_others_that_are_not():
    """The slave's far end is clamped, and its master's: the others bear the load. One without a master stays so."""
    mesh = stack("QUAD4", "QUAD4", 2, counts=(4, 4), even=True)
    faces = [row for name in ("slave", "master") for row in mesh.select(mesh.cells_of(name))]
    end = np.concatenate([cells[(mesh.points[nodes, 0] > 0.7).all(axis=1)] for _, cells, nodes in faces])
    made = replace(mesh, cell_groups={**mesh.cell_groups, "end": np.sort(end)})
    held = fix("bottom", "xy"), fix("end", "xy"), load("top", 1.0)
    (zone,) = only(made, contact(), *held, model="plane_strain")[1].zones
    order = np.argsort(zone.centre[:, 0])
    status, gap, p = zone.status[order], zone.gap[order], zone.pressure[order]
    assert (status != UNPAIRED).all() and status[0] == CONTACT and status[3] == OPEN
    assert gap[3] == pytest.approx(0, abs=1e-15) and p[3] == 0 < p[0]
    (zone,) = only(overhang(), contact(), fix("lower", "xy"), fix("upper", "xy"), model="plane_strain")[1].zones
    assert sorted(zone.status) == [UNPAIRED, OPEN, OPEN, OPEN] and np.isnan(zone.gap).sum() == 1


# ---- faces that are warped

#: nodes of the cells of a mirrored mesh
REVERSED = {"HEXA8": [1, 0, 3, 2, 5, 4, 7, 6], "QUAD4": [1, 0, 3, 2]}


@pytest.mark.rows("facet")
@pytest.mark.parametrize("normals", ["facet", "smoothed"])
def test_warped_faces_converge_and_mirrored_ones_answer_mirrored(normals):
    """Fifteen slave faces, warped by 0.01 (z - 0.4)^2 at most, over six flat master faces."""
    mesh = lacmesh.read(Path(__file__).with_name("meshes") / "warped.msh")
    over = np.array([1.0, 1.0, -1.0])
    blocks = [(block.type, block.nodes[:, REVERSED[block.type]]) for block in mesh.blocks]
    mirrored = Mesh.create(mesh.points * over, blocks, cell_groups=mesh.cell_groups)
    records = contact(slave="up.y0", master="lo.y1", hexa="hexa", normals=normals), fix("lo.y0", "xyz")
    states = []
    for one, uz in ((mesh, 0.004), (mirrored, -0.004)):
        end = move("up.y1", ux=0.01, uy=-0.02, uz=uz)
        rubber = Material(young=2000.0, poisson=0.3, law="neo_hookean")
        states.append(only(one, *records, end, material=rubber, kinematics="finite")[1])
    assert states[0].iterations <= 6 and states[1].iterations == states[0].iterations
    zone, other = (state.zones[0] for state in states)
    order = [int(((other.centre * over - centre) ** 2).sum(axis=1).argmin()) for centre in zone.centre]
    assert sorted(order) == list(range(15))
    assert np.abs(other.pressure[order] - zone.pressure).max() < 1e-11 * zone.pressure.max()
    assert np.abs(other.gap[order] - zone.gap).max() < 1e-11


# ---- direction of contact: that of a plane master, where faces of the slave are at an angle to it


@pytest.mark.rows("0.9-6")
@pytest.mark.parametrize("friction, n", [(0.5, 8), (0.9, 6)])
def test_a_block_that_slides_on_a_table_is_held_back_by_mu(friction, n):
    """Coulomb: where all slides the quotient of the forces is the coefficient, though the last face tilts.

    With 0.9 that face turns by more than a right angle under its friction, and the block does not lose its table.
    """
    (ratio, *_) = solve_on_table(friction, n, levels=1).results
    assert ratio.value == pytest.approx(friction, rel=1e-6)


@pytest.mark.parametrize(
    ("slave", "stiffer", "joint", "normals"),
    [
        ("round", 1, {}, "master"),
        ("flank", 1, {}, "facet"),
        ("round", 1, {"geometry": "current", "friction": 0.1}, "master"),
        ("round", 2, {"geometry": "current"}, "master"),
        ("round", 2, {"friction": 0.1}, "master"),
        ("round", 2, {"geometry": "current", "friction": 0.1}, "facet"),  # it bends the plane
    ],
)
def test_the_plane_side_gives_the_direction(slave, stiffer, joint, normals):
    own = [Material(groups=[name], young=young, poisson=0.3) for name, young in (("ball", stiffer), ("seat", 1.0))]
    zone = contact(slave=slave, master="flank" if slave == "round" else "round", **joint)
    (pair,) = Problem.of(case_of(in_groove(4), *own, zone, model="plane_strain")).joints
    assert pair.pairing.normals == normals


def test_an_edge_that_dips_into_its_master_is_warned_of():
    """Half of the skin is above, half below the master: the mean gap is zero."""
    problem, state = only(stack("HEXA8", "TETRA4", 3), contact(), *FIXED, load("top", 1.0))
    (zone,) = state.zones
    dip = np.where(np.arange(len(zone.area)) == 1, 0.25, 0.05)
    run = Run(problem, problem.joints, last=replace(state, zones=(replace(zone, dip=dip),)))
    (doubt,) = dips(run)
    assert "is inside its master by" in doubt.text and "25 % of a macro-element" in doubt.text


# ---- ties: blocks glued together carry any stress, and turn as one even across a gap

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


@pytest.mark.rows("QUAD8-TRIA6-2-pyramid", "PENTA6 quadrangle-HEXA8-3-pyramid")
@pytest.mark.parametrize("slave, master, dim, way", _PAIRS)
def test_a_tie_carries_any_uniform_stress(slave, master, dim, way):
    """The patch test of ties: A x on the whole outside, the uniform stress of A inside, its traction on the slave."""
    A = np.zeros((3, 3))
    A[:dim, :dim] = GRADIENT[:dim, :dim]
    problem, state = only(
        stack(slave, master, dim), replace(GLUE, hexa=way), *outside(A[:dim, :dim]), model=MODELS[dim]
    )
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
    problem, state = only(stack(slave, master, dim, gap=gap), GLUE, linear("bottom", A), model=MODELS[dim])
    np.testing.assert_allclose(by_node(problem, state), problem.space.mesh.points[:, :dim] @ A.T, atol=1e-13)
    energy = problem.kinematics.energy(state.u, state.time)
    assert abs(energy) <= 1e-13 * YOUNG * np.abs(A).max() ** 2
    assert np.abs(state.zones[0].traction).max() <= 1e-11 * YOUNG * np.abs(A).max()


@pytest.mark.parametrize(("gap", "warns"), [(0.0, False), (0.02, False), (0.2, True)])
def test_the_gap_that_a_tie_bridges_is_named(gap, warns, tmp_path):
    """Wider than a tenth of a macro-element, it is a warning, of `run` and of `validate`."""
    case = case_of(
        stack("HEXA8", "TETRA4", 3, gap=gap), ELASTIC, GLUE, fix("bottom", "xyz"), load("top", "1"), model="3d"
    )
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
    records = GLUE, move("lower", **turned), Traction(group="top", **pull), Steps(times=(0.25, 0.5, 0.75, 1.0, 2.0))
    law = Material(law="saint_venant_kirchhoff", young=1000.0, poisson=0.0 if traction else 0.3)
    mesh = mesh if kind == cell else lacmesh.raise_order(mesh)
    return case_of(mesh, law, *records, model=MODELS[mesh.space_dim], kinematics="finite")


@pytest.mark.rows("QUAD4-0.0")
@pytest.mark.parametrize("gap", [0.0, 0.5])
@pytest.mark.parametrize("kind", ["QUAD4", "HEXA8"])
@pytest.mark.filterwarnings("ignore:tie 'slave' joins slave 'slave' to master 'master' across a gap")
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


@pytest.mark.rows("QUAD4")
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


@pytest.mark.rows("TRIA3-0", "QUAD4-0")
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


@pytest.mark.rows("QUAD4", "TETRA4")
@pytest.mark.parametrize("kind", KINDS)
def test_a_section_without_a_shortening_is_the_whole_body_under_any_load(kind):
    mesh = divided(kind, 5, 3)
    d, up = mesh.space_dim, "xyz"[mesh.space_dim - 1]
    pull = {"tx": 0.3, "ty": 1.0} | ({"tz": -2.0} if d == 3 else {})
    records = SOFT, fix(f"{up}0", "xyz"[:d]), Traction(group=f"{up}1", **pull)
    section = Pretension(group="G", shortening=0.0)
    apart, whole = (ls.solve(case_of(mesh, *records, *more, model=MODELS[d])) for more in ((section,), ()))
    np.testing.assert_allclose(apart.u[: mesh.n_nodes], whole.u, rtol=0, atol=1e-12 * np.abs(whole.u).max() + 1e-13)
