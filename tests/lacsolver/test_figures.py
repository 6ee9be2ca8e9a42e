from __future__ import annotations

import numpy as np
import pytest

from lacmesh import Mesh
from lacsolver.bodies.small import points
from lacsolver.case import parse_case
from lacsolver.problem.problem import Problem
from lacsolver.results.figures import balance, moment, probe, stress_ranges, with_invariants, zone_figures
from lacsolver.results.state import CONTACT, OPEN, UNPAIRED, ZoneState
from lacsolver.space.space import Space
from tests.lacsolver.bodies import cube, plane_mixture, square
from tests.lacsolver.held import TEXT, case, with_sides


def zone(force, status=(CONTACT, OPEN, UNPAIRED), **given):
    n, d = len(status), force.shape[1]
    made = {
        "pressure": np.array([4.0, 0, 0])[:n],
        "gap": np.array([1e-9, 0.5, np.nan])[:n],
        "coverage": np.array([0.5, 1.0, 0.0])[:n],
        "area": np.array([2.0, 3.0, 5.0])[:n],
    }
    rest = {"traction": np.zeros((n, d)), "centre": np.zeros((n, d)), "normal": np.zeros((n, d))}
    return ZoneState("joint", False, status=np.array(status), force=force, **(made | rest | given))


def space_of(model="3d"):
    return Space.of(cube("HEXA8", 1) if model == "3d" else square("QUAD4", 1), model)


def pushed(x, pairs):
    """Forces (n, d) of (node, force) pairs."""
    force = np.zeros(x.shape)
    for node, f in pairs:
        force[node] += f
    return force


X2 = np.array([[1.0, 0], [3.0, 0], [1.0, 1], [3.0, 1]])
X3 = np.array([[0.0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 1], [2, 0, 1], [0, 3, 1]])


# ---- zones


def test_zone_figures_in_the_plane():
    force = pushed(X2, [(0, [0, -4.0]), (1, [1, -2.0]), (2, [0, 4.0]), (3, [-1, 2.0])])
    told = zone_figures(zone(force), np.array([0, 1]), X2)
    assert (told.pressure_min, told.pressure_max) == (0, 4)
    assert (told.gap_min, told.gap_max) == (1e-9, 0.5)
    assert told.contact_area == 1.0
    assert told.resultant == pytest.approx([1, -6])
    assert told.moment.shape == ()
    assert told.moment == pytest.approx(1 * -4 + 3 * -2)
    assert (told.coverage_min, told.coverage_max) == (0, 1)
    assert (told.active, told.open, told.unpaired) == (1, 1, 1)


def test_moment_in_space_is_a_vector_about_the_origin():
    force = pushed(X3, [(0, [0, 0, -1.0]), (1, [0, 0, -2.0]), (2, [5.0, 0, -3.0])])
    told = zone_figures(zone(force), np.array([0, 1, 2]), X3)
    assert told.resultant == pytest.approx([5, 0, -6])
    assert told.moment == pytest.approx([-9, 4, -15])
    assert moment(force, X3 + np.array([0, 0, 2.0])) == pytest.approx([-9, 14, -15])


def test_a_zone_that_meets_nothing_has_no_least_pressure():
    told = zone_figures(zone(np.zeros((4, 2)), (UNPAIRED,) * 3), np.array([0, 1]), X2)
    assert np.isnan([told.pressure_min, told.pressure_max, told.gap_min, told.gap_max]).all()
    assert (told.contact_area, told.unpaired, told.coverage_max) == (0, 3, 1)


# ---- balance


def test_forces_in_balance_are_told_so():
    force = pushed(X3, [(0, [0, 0, -1.0]), (2, [0, 0, -3.0]), (3, [0, 0, 1.0]), (5, [0, 0, 3.0])])
    assert balance([(force, X3)]) == pytest.approx((0, 0), abs=1e-15)


def test_a_missing_force_and_a_couple_are_measured():
    missing = pushed(X2, [(0, [0, -4.0]), (2, [0, 3.0])])
    force, _ = balance([(missing, X2)])
    assert force == pytest.approx(1 / 3.5)
    couple = pushed(X2, [(0, [0, -4.0]), (3, [0, 4.0])])  # not on one line, two apart
    force, turn = balance([(couple, X2)])
    arm = np.hypot(1, 0.5)
    assert force == pytest.approx(0)
    assert turn == pytest.approx(2 * 4 / (4 * arm))
    assert balance([(missing, X2), (couple, X2)]) == pytest.approx((1 / 3.5, 2 / arm))


def test_balance_does_not_know_units_or_the_origin():
    rng = np.random.default_rng(0)
    force = rng.uniform(-1, 1, X3.shape)
    made = balance([(force, X3)])
    assert min(made) > 0.01
    assert balance([(1e6 * force, 1e-3 * X3)]) == pytest.approx(made)
    assert balance([(force, X3 + np.array([7, -2, 5.0]))]) == pytest.approx(made)


def test_nothing_that_acts_is_in_balance():
    assert balance([(np.zeros((6, 3)), X3)]) == (0, 0)
    assert balance([]) == (0, 0)


# ---- stress, energy, probes


def test_stress_ranges_of_every_group_and_of_the_whole():
    mesh = plane_mixture()
    kinds = [b.type for b in mesh.blocks]
    first = np.arange(len(mesh.blocks[0].nodes))
    groups = {"left": first[:2], "mixed": np.array([0, len(first)]), "empty": np.empty(0, int)}
    space = Space.of(Mesh.create(mesh.points, mesh.blocks, cell_groups=groups, space_dim=2), "plane_strain")
    assert len(kinds) == 2
    rng = np.random.default_rng(1)
    field = tuple(rng.uniform(-1, 1, (*at.shape[:2], 4)) for at in points(space))
    told = stress_ranges(space, field)
    assert set(told) == {"", "left", "mixed"}
    flat = np.concatenate([f.reshape(-1, 4) for f in field])
    assert [told[""][c] for c in ("xx", "yy", "zz", "xy")] == [
        pytest.approx((flat[:, k].min(), flat[:, k].max())) for k in range(4)
    ]
    assert told["left"]["yy"] == pytest.approx((field[0][:2, :, 1].min(), field[0][:2, :, 1].max()))
    mixed = np.concatenate([field[0][0, :, 3], field[1][0, :, 3]])
    assert told["mixed"]["xy"] == pytest.approx((mixed.min(), mixed.max()))


def test_ranges_of_von_mises_and_of_the_principal_stresses():
    """Against the eigenvalues of each tensor, in the plane and in space."""
    for mesh, model, n in ((square("QUAD4", 2), "plane_strain", 4), (cube("TETRA4", 1), "3d", 6)):
        space = Space.of(with_sides(mesh), model)
        rng = np.random.default_rng(n)
        field = tuple(rng.uniform(-1, 1, (*at.shape[:2], n)) for at in points(space))
        told = stress_ranges(space, field)[""]
        flat = np.concatenate([f.reshape(-1, n) for f in field])
        xx, yy, zz, xy, yz, xz = np.pad(flat, ((0, 0), (0, 6 - n))).T
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
        values = np.linalg.eigvalsh(tensor)
        for k, name in enumerate(("principal_3", "principal_2", "principal_1")):
            assert told[name] == pytest.approx((values[:, k].min(), values[:, k].max()), rel=1e-12)
        a, b, c = values.T
        mises = np.sqrt(((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2) / 2)
        assert told["von_mises"] == pytest.approx((mises.min(), mises.max()), rel=1e-12)


def test_skin_cells_of_a_group_say_nothing():
    space = Space.of(with_sides(square("QUAD4", 1)), "plane_strain")
    told = stress_ranges(space, (np.full((1, 4, 4), 7.0),))
    assert set(told) == {"", "body"}  # x0, x1, y0, y1 hold segments alone
    mesh = space.mesh
    both = Mesh.create(mesh.points, mesh.blocks, cell_groups={"both": np.arange(mesh.n_cells)}, space_dim=2)
    assert stress_ranges(Space.of(both, "plane_strain"), (np.full((1, 4, 4), 7.0),))["both"]["xy"] == (7, 7)


def energy(problem, u):
    return problem.kinematics.energy(u, 1.0)


def stretched(model, name, strain, sections=""):
    """The problem of a unit body, E = 1, nu = 0.3, and the displacement with a strain (d,) along each axis."""
    mesh = with_sides(cube(name, 2) if model == "3d" else square(name, 2))
    problem = Problem.of(case(sections, model), mesh)
    d = problem.space.dim
    return problem, (mesh.points[:, :d] * strain).ravel()


E, NU = 1.0, 0.3


@pytest.mark.parametrize("name", ["HEXA8", "TETRA10", "PYRAM13"])
def test_energy_of_a_pulled_bar(name):
    problem, u = stretched("3d", name, [0.01, -NU * 0.01, -NU * 0.01])
    assert energy(problem, u) == pytest.approx(0.5 * E * 0.01**2)


@pytest.mark.parametrize(
    ("model", "stiffness"),
    [("plane_stress", E / (1 - NU**2)), ("plane_strain", E * (1 - NU) / (1 + NU) / (1 - 2 * NU))],
)
def test_energy_of_a_strip_held_aside(model, stiffness):
    problem, u = stretched(model, "QUAD8", [0.01, 0.0])
    assert energy(problem, u) == pytest.approx(0.5 * stiffness * 0.01**2)


def test_energy_of_the_full_circle():
    problem, u = stretched("axisymmetric", "TRIA6", [0.01, 0.01])  # the same strain all ways: p = E eps / (1 - 2 nu)
    volume = np.pi * (2**2 - 1)
    assert energy(problem, u) == pytest.approx(1.5 * E / (1 - 2 * NU) * 0.01**2 * volume)


HEATED = "\n[[temperature]]\nvalue = 40.0\n"


@pytest.mark.parametrize(
    ("model", "strain", "expected"),
    [
        ("3d", [3e-3] * 3, 0.0),  # free
        ("3d", [0.0] * 3, 1.5 * E / (1 - 2 * NU) * 3e-3**2),  # held
        ("plane_strain", [0.0] * 2, 1.5 * E / (1 - 2 * NU) * 3e-3**2),
        ("plane_strain", [(1 + NU) * 3e-3] * 2, 0.5 * E * 3e-3**2),  # held along z alone
        ("plane_stress", [3e-3] * 2, 0.0),
        ("plane_stress", [0.0] * 2, E / (1 - NU) * 3e-3**2),
        ("axisymmetric", [0.0] * 2, 1.5 * E / (1 - 2 * NU) * 3e-3**2 * 3 * np.pi),
    ],
)
def test_energy_of_what_heat_does_not_stretch(model, strain, expected):
    text = TEXT.replace("poisson = 0.3", "poisson = 0.3\nexpansion = 1e-4\nreference_temperature = 10.0")
    name = "HEXA8" if model == "3d" else "QUAD4"
    mesh = with_sides(cube(name, 2) if model == "3d" else square(name, 2))
    problem = Problem.of(parse_case(text.format(model=model) + HEATED, "heated.toml"), mesh)
    u = (mesh.points[:, : problem.space.dim] * strain).ravel()
    assert energy(problem, u) == pytest.approx(expected, abs=1e-18)


def test_springs_hold_energy():
    problem, u = stretched("3d", "HEXA8", [0.01, 0.0, 0.0])
    held, _ = stretched("3d", "HEXA8", [0.0] * 3, '[[spring]]\ngroup = "x1"\nkx = 3.0\n')
    nodes = np.flatnonzero(held.space.mesh.points[:, 0] > 1 - 1e-9)  # one at each
    assert energy(held, u) - energy(problem, u) == pytest.approx(0.5 * 3.0 * 0.01**2 * len(nodes))


def test_a_probe_is_the_mean_over_its_nodes():
    space = space_of("plane_strain")
    assert probe(space, np.arange(8.0), np.array([0, 3])) == pytest.approx([3, 4])


def test_a_process_without_cells_of_a_type_has_no_invariants_of_them():
    assert with_invariants(np.empty((0, 4, 6))).shape == (0, 4, 10)
