"""Hard problems in other units, turned, mirrored, far away; contacts of two sizes; motions that change nothing."""

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import lacmesh
from lacmesh import cut_skin, raise_order
from lacmesh.errors import LacmeshWarning
from lacsolver.case import CaseError, Coupling, Displacement, Output, Probe, Solver
from lacsolver.contact import integrate
from lacsolver.equilibrium.attempt import _initial
from lacsolver.equilibrium.stepping import march
from lacsolver.matrices import contact_matrices
from lacsolver.output.folder import create_output
from lacsolver.problem.problem import Problem
from lacsolver.problem.skin import prepared
from lacsolver.running import run
from lacsolver.validation import validate
from tests.lacsolver.patch_meshes import joined, stack
from tests.lacsolver.tables import table
from tests.problem_meshes import two_stacks, waved, waving
from tests.problems import FINITE, HARD, PROBLEMS, contact, fix, hard, move
from tests.samples import each_option
from tests.worlds import World, assert_same, case_in, permuted, turned_world
from verification.families.curved import PLANE
from verification.families.moved_fits import MovedFit, solve_case
from verification.families.press_fit import case_of as press_fit
from verification.families.press_fit import mesh_of
from verification.solving import solve

#: of figures, relative; of coordinates that are rounded, against the shift over the size of a cell
EXACT, ROUNDING = 1e-9, 1e-15
#: cells are at least so large, and models so large
CELL, SIZE = 0.2, 2.0
UNITS = {
    "small": World(1e-6, 1e-12), "large": World(1e6, 1e12), "mm in m": World(1e-3), "m in mm": World(1e3),
    "μm in m": World(1e-6), "forces": World(stress=1e9),
}  # fmt: skip
#: problems whose place matters; the clearance of the last is a formula of it
PLACED = HARD | {"searched": PROBLEMS["searched"]}
#: coordinates as on a map, in a plane z = 7
MAP = World(shift=np.array([5e5, 5e6, 7.0]))


def states_at(problem, world, mesh=None, **keys):
    case = case_in(problem, world, mesh, **keys)
    return tuple(march(Problem.of(case, case.mesh)))


@cache
def states_of(name):
    return states_at(HARD[name], World())


def check(name, others, world, *place, ones=None, allowed=EXACT, **keys):
    """Assert that states are those of a problem in a world."""
    ones = states_of(name) if ones is None else ones
    assert_same(ones, others, world, PLACED[name].mesh(), *place, allowed=allowed, **keys)


@pytest.mark.rows("plane stress, smoothed, bodied, sprung-large")
@pytest.mark.parametrize(("name", "units"), each_option(itertools.product(HARD, UNITS)))
def test_in_other_units(name, units):
    check(name, states_at(HARD[name], UNITS[units]), UNITS[units])


def mirrored(problem):
    """A world that is mirrored in x; about an axis along it."""
    signs = [1.0, -1.0, 1.0] if problem.keys["model"] == "axisymmetric" else [-1.0, 1.0, 1.0]
    return World(turn=np.diag(signs))


#: tangents of friction in space depend on the axes of the mesh, by which faces of a macro-element bend; a reflection
#: turns the faces of a section over, and so its sides
APART = {("rubbing in space", "turned"), ("rubbing in space", "mirrored"), ("bolted", "mirrored")}
WAYS = [row for row in itertools.product(HARD, ("turned", "mirrored")) if row not in APART]


@pytest.mark.rows("bilateral-turned", "held by contact and a coupling, finite-mirrored")
@pytest.mark.parametrize(("name", "way"), each_option(WAYS))
def test_turned_and_mirrored_and_in_another_order(name, way):
    problem = HARD[name]
    world = turned_world(problem) if way == "turned" else mirrored(problem)
    mesh, place = permuted(problem.mesh(), seed=1)
    moved = replace(mesh, points=world.places(mesh.points))
    check(name, states_at(problem, world, moved, reverse=True), world, place, iterations=False)


def brought_back(problem, world):
    """A problem's mesh cut in a world that is elsewhere, and brought back: its coordinates are rounded as they are."""
    case = case_in(problem, world)
    there = prepared(case, case.mesh)
    return replace(there, points=there.points - world.shift)


def options_of(row):
    """Model, kinematics and normals of a problem, and whether formulas of the place are in it."""
    problem = PLACED[row[0]]
    text = repr(problem.records)
    return problem.keys["model"], "kinematics" in problem.keys, "smoothed" in text, "x" in text, row[1]


ALONG = {"axisymmetric": [0.0, 1.0, 0.0], "3d": [1.0, -0.7, 0.4]}


@pytest.mark.rows("plane strain-10000000.0", "searched-1000.0")
@pytest.mark.parametrize(("name", "far"), each_option(itertools.product(PLACED, (1e7, 1e3)), of=options_of))
def test_somewhere_else(name, far):
    """Compared with the model whose coordinates are rounded as they are there, where it stands."""
    problem = PLACED[name]
    world = World(shift=far * SIZE * np.array(ALONG.get(problem.keys["model"], [1.0, -0.7, 0.0])))
    mesh = brought_back(problem, world)
    there = states_at(problem, world, replace(mesh, points=mesh.points + world.shift))
    one = states_at(problem, World(), mesh)
    check(name, there, world, ones=one, allowed=np.abs(world.shift).max() * ROUNDING / CELL)


# ---- files of a model that is far away


@pytest.mark.rows("vtu")
@pytest.mark.parametrize("kind", ["vtu", "med"])
def test_files_are_in_the_coordinates_of_the_mesh(tmp_path, kind):
    """The moment of contact forces is about the origin of the file, whose arms are long."""
    close = 1e-11
    mesh = brought_back(HARD["plane strain"], MAP)
    records = (*HARD["plane strain"].records, Output(format=kind), Probe(name="corner", at=mesh.points[3, :2].tolist()))
    problem, results, folders = replace(HARD["plane strain"], records=records), [], [tmp_path / "a", tmp_path / "b"]
    for world, folder in zip((World(), MAP), folders, strict=True):
        case = case_in(problem, world, replace(mesh, points=mesh.points + world.shift))
        assert not validate(case, case.mesh).problems
        results.append(run(case, create_output(folder), mesh=case.mesh))
    one, other = (result.steps[-1] for result in results)
    zone, far, (x, y, _) = one.contact["slave"], other.contact["slave"], MAP.shift
    np.testing.assert_allclose(other.probes["corner"], one.probes["corner"], rtol=close)
    force = zone.resultant
    np.testing.assert_allclose(far.resultant, force, rtol=close, atol=close * np.abs(force).max())
    np.testing.assert_allclose(far.moment, zone.moment + x * force[1] - y * force[0], rtol=close)
    assert max(other.balance) < 1e-14
    here, there = (table(folder / "contact_slave.csv") for folder in folders)
    for axis, shift in zip("xyz", MAP.shift, strict=True):
        np.testing.assert_allclose(there[axis], here[axis] + shift, rtol=1e-15)
    for name in ("pressure", "gap", "coverage", "nx", "ny"):
        np.testing.assert_allclose(there[name], here[name], atol=close * np.abs(here[name]).max())
    files = sorted(folders[0].rglob(f"*.{kind}"))
    assert files
    for path in files:
        near, away = (lacmesh.read(p) for p in (path, folders[1] / path.relative_to(folders[0])))
        np.testing.assert_allclose(away.points, near.points + MAP.shift, rtol=1e-15)


def between(mesh, *records, world=MAP, **keys):
    """The equations of two blocks of QUAD4 in a world."""
    problem = hard(lambda: mesh, contact(), *records, **keys)
    return Problem.of(case_in(problem, world))


def test_places_are_told_with_the_digits_that_tell_them_apart():
    mesh = stack("QUAD4", "QUAD4", 2)
    with pytest.raises(CaseError, match=r"near \(500000\.\d+, 5000001\)"):
        list(march(between(mesh, fix("lower", "xy"), move("upper", ux=0.0, uy=-0.01))))
    ends = [Displacement(at=[x, 2.0], uy=-0.01) for x in (0.0, 1.0)]
    names = list(between(mesh, *ends).constraints.names)
    assert names == ["bottom", "at [500000, 5000002]", "at [500001, 5000002]"]
    with pytest.raises(CaseError, match=r"no node at \[500000\.4, 5000002\]"):
        between(mesh, replace(ends[0], at=[0.4, 2.0]))


def test_parts_of_a_model_that_lie_far_from_each_other():
    """Each zone is measured from a point of its own."""
    far = np.array([1e6, -7e5, 0.0])
    apart = two_stacks(apart=tuple(far))
    second = apart.points[:, 0] > far[0] / 2
    near = replace(apart, points=np.where(second[:, None], apart.points - far + [3.0, 0.0, 0.0], apart.points))
    (one,), (other,) = (states_at(HARD["two zones"], World(), mesh) for mesh in (near, apart))
    assert one.iterations == other.iterations
    for here, there in zip(one.zones, other.zones, strict=True):
        np.testing.assert_allclose(there.pressure, here.pressure, atol=5e-9 * here.pressure.max())


@pytest.mark.parametrize("radius", [1e3, 1e5, 1e7])
def test_a_wide_ring_is_in_plane_strain(radius):
    """About an axis so far away, forces a length are those of plane strain, but for the part that the model is wide."""
    mesh = waving("QUAD8", "TRIA3", shift=(radius, 0, 0))()
    flat = replace(mesh, points=mesh.points - np.array([radius, 0.0, 0.0]))
    records = contact(), move("top", ux=0.004, uy=-0.03)
    (ring,), (plane,) = (
        march(Problem.of(hard(lambda made=made: made, *records, model=model).case()))
        for made, model in ((mesh, "axisymmetric"), (flat, "plane_strain"))
    )
    one, other = ring.zones[0], plane.zones[0]
    assert ring.iterations == plane.iterations
    np.testing.assert_array_equal(one.status, other.status)
    assert np.abs(one.pressure - other.pressure).max() <= (0.2 / radius + 1e-14 * radius) * other.pressure.max()


@pytest.mark.parametrize("dim", [2, 3])
def test_contact_matrices_far_away(dim):
    mesh = stack(*{2: ("QUAD8", "TRIA3"), 3: ("HEXA8", "TETRA4")}[dim], dim, skew=0.1, gap=0.01)
    shift = np.array([5e5, 5e6, 0.0])
    there = cut_skin(replace(mesh, points=mesh.points + shift), "slave").mesh
    one, other = (contact_matrices(m, "slave", "master") for m in (replace(there, points=there.points - shift), there))
    for name in ("G", "w", "area", "coverage", "normal"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=0, atol=1e-9)
    np.testing.assert_allclose(other.centre, one.centre + shift[:dim], rtol=1e-15)
    assert np.abs((other.B - one.B).data).max(initial=0.0) < 1e-9


# ---- lengths of macro-elements are true ones


@pytest.mark.parametrize("world", [World(1e-3), World(), World(1e3)], ids=["km", "m", "mm"])
@pytest.mark.parametrize("model, keys", [("plane_stress", {"thickness": 100.0}), ("axisymmetric", {}), ("3d", {})])
def test_an_overlap_that_is_prescribed_is_refused_in_every_unit(model, keys, world):
    """The area of a macro-element holds the thickness, or 2 pi r; its length does not."""
    mesh = stack("HEXA8", "HEXA8", 3) if model == "3d" else stack("QUAD4", "QUAD4", 2, shift=(50, 0, 0))
    up = {"ux": 0.0, "uy": 0.0, "uz": -1e-5} if model == "3d" else {"ux": 0.0, "uy": -1e-5}
    still = fix("lower", "xyz" if model == "3d" else "xy")
    with pytest.raises(CaseError, match="overlap by up to"):
        list(march(between(mesh, still, move("upper", **up), world=world, model=model, **keys)))


def test_a_gap_that_is_not_closed_in_millimetres():
    """`initial = "gap"` asks whether a macro-element touches; one that is thick touches no sooner."""
    mesh = stack("QUAD4", "QUAD4", 2, gap=1e-4)
    made = between(mesh, fix("top", "xy"), world=World(1e3), model="plane_stress", thickness=1e3)
    (joint,) = made.joints
    assert not _initial(joint, integrate(joint.zone, 2, joint.pairing)).any()


# ---- two contacts in one model, one much smaller than the other

#: cells of slave and master, finite kinematics, and whether the upper block is pushed or hung on a coupling
OF_TWO_SIZES = {
    "pushed": ("QUAD4", "TRIA3", False, True),
    "pushed, finite": ("QUAD4", "TRIA3", True, True),
    "pushed in space": ("HEXA8", "HEXA8", False, True),
    "hung": ("QUAD4", "TRIA3", False, False),
    "hung in space": ("HEXA8", "HEXA8", False, False),
    "hung, finite": ("QUAD4", "TRIA3", True, False),
    "hung in space, finite": ("HEXA8", "HEXA8", True, False),
}


def of_sizes(name, sizes, stacks, *records):
    """The zones of a model of some stacks of these sizes."""
    low, high, finite, pushed = OF_TWO_SIZES[name]
    parts, space = [], low == "HEXA8"
    for k in stacks:
        mesh = waved(stack(low, high, 3 if space else 2, number=str(k), counts=(2, 2) if space else (4, 3), skew=0.1))
        names = {
            group: group if group in ("bottom", f"slave{k}", f"master{k}") else f"{group}{k}"
            for group in mesh.cell_groups
        }
        parts.append((replace(mesh, points=mesh.points * sizes[k]), np.array([3.0 * k, 0, 0]), names))
        down = np.array([0.004, 0.002, -0.03] if space else [0.004, -0.03]) * sizes[k]
        if pushed:
            records += (move(f"top{k}", **dict(zip(("ux", "uy", "uz"), down.tolist(), strict=False))),)
        elif space:
            force = -20.0 * sizes[k] ** 2
            records += (Coupling(name=f"pin{k}", group=f"top{k}", ux=0.0, uy=0.0, rotation=[0.0] * 3, fz=force),)
        else:
            records += (Coupling(name=f"pin{k}", group=f"top{k}", ux=0.0, fy=-20.0 * sizes[k]),)
        records += (contact(slave=f"slave{k}", master=f"master{k}"),)
    model, keys = "3d" if space else "plane_strain", FINITE if finite else {}
    *_, state = march(Problem.of(hard(lambda: joined(parts), *records, model=model, **keys).case()))
    return state.zones


alone = cache(of_sizes)
#: the round-off of its coordinates limits the small one of some
RATIOS = [
    (name, ratio)
    for ratio in (1e4, 1e5, 1e6)
    for name in OF_TWO_SIZES
    if (name, ratio) != ("hung in space, finite", 1e6)
]


@pytest.mark.rows("hung-10000.0")
@pytest.mark.parametrize(("name", "ratio"), each_option(RATIOS))
def test_contacts_of_two_sizes_in_one_model(name, ratio):
    """Each is as in a model of its own, to the round-off of the coordinates of the small one."""
    for k, zone in enumerate(of_sizes(name, (1.0, 1 / ratio), (0, 1))):
        (own,) = alone(name, (1.0, 1.0), (k,))
        assert (zone.status == own.status).all()
        assert np.abs(zone.pressure - own.pressure).max() <= max(1e-8, 3e-14 * ratio) * own.pressure.max()


def test_multigrid_warns_of_bodies_that_are_much_smaller_than_others():
    with pytest.warns(LacmeshWarning, match="of the largest one"):
        of_sizes("pushed", (1.0, 1e-4), (0, 1), Solver(backend="multigrid"))


# ---- motions that change nothing, and straight quadratic cells

COARSE = {"counts": ((2, 5, 2), (2, 4, 2))}
FITS = [
    MovedFit("TRIA3"),
    MovedFit("TETRA4", **COARSE),
    MovedFit("TETRA4", **COARSE, normals="smoothed"),
    MovedFit("TETRA4", **COARSE, slave="around"),
    MovedFit("HEXA8", **COARSE, slope=0.3),
    MovedFit("TETRA4", counts=((2, 9, 3), (2, 8, 2)), oval=0.7),
]


@pytest.mark.parametrize("given", FITS, ids=str)
def test_a_motion_that_changes_nothing_changes_no_pressure(given):
    """A cylinder slides on itself; a cone that is pressed by s has the pressures of an interference s sin(a)."""
    results = solve_case(given, levels=1).results
    assert len(results) > 3
    for result in results:
        assert result.passed, (result.quantity, result.value)


@pytest.mark.parametrize("cell", ["TRIA3", "QUAD4"])
@pytest.mark.parametrize("slave", ["within", "around"])
def test_quadratic_cells_whose_mid_nodes_are_on_chords(cell, slave):
    """Their faces are flat, and the gap is that between the circles that their corners lie on."""
    given = replace(PLANE, cell=cell, slave=slave)
    pressure = solve(press_fit(given), raise_order(mesh_of(given, 1))).zone.pressure
    np.testing.assert_allclose(pressure, given.exact.between, rtol=0.03)
