"""Friction on matrices and of single rows: rules of states, bounds, recovered tractions.

Then models whose sets of rows return under pivoting: seats, a lid on two blocks.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_array

import lacsolver as ls
from lacmesh.errors import RequestError
from lacsolver.case import BodyForce, Force, Material, Solver, Steps, Tie
from lacsolver.contact.friction import Bounds, Solved, States, defect, next_states
from lacsolver.contact.laws import CONTACT, SLIDES, Unilateral
from lacsolver.equilibrium.active_set import active_set_iterates
from lacsolver.equilibrium.search import search
from lacsolver.equilibrium.state import Iterate
from lacsolver.equilibrium.stepping import NotConvergedError
from lacsolver.matrices import read_matrices, write_matrices
from lacsolver.results.recovered_shear import recover_shear
from lacsolver.results.recovery import recover_pressure
from lacsolver.saddle.contact_system import ContactSystem, skin_stiffness
from lacsolver.saddle.row_group import RowGroup, Rows
from lacsolver.saddle.row_set import ShearRows
from lacsolver.saddle.stiffness import FactorCache
from lacsolver.saddle.tolerances import ConvergenceTolerance
from tests.lacsolver.contact_cases import total
from tests.lacsolver.test_friction import WAYS, joint, plane, rubbed, rubs
from tests.problems import case_of, fix
from tests.samples import each_option, samples
from verification.exact.coulomb import condensed, lemke
from verification.families import friction_bank

pytestmark = [
    pytest.mark.filterwarnings("ignore:steps are too long for the energy"),
    pytest.mark.filterwarnings("ignore:friction of .* depends on the load path"),
]

INF, POINTS = np.inf, 12
MESHES = Path(__file__).parent / "meshes"


def coulomb(mu, m):
    """Return the bounds of m macro-elements with a coefficient."""
    return Bounds(np.full(m, float(mu)), np.zeros(m), np.full(m, INF))


ROUGH = coulomb(INF, 1)

# ---- matrices of a random body: the loop against Lemke's algorithm in the plane, against the law itself in space


def random_problem(seed, tangents, m=POINTS):
    """K, B, f, gaps, slips at the start and a coefficient, at random: rows open, close, stick, slide.

    B (m (1 + k), n): points with a normal and k tangents each, coupled as on a body's skin, where farther points are
    coupled less; row m + k i + a is the tangent a of point i. K (n, n) is symmetric and definite.
    """
    rng = np.random.default_rng(seed)
    d = 1 + tangents
    place = rng.uniform(size=(m, tangents)) * m
    away = np.linalg.norm(place[:, None] - place[None], axis=2)
    blocks = rng.normal(size=(d, d))
    K = np.linalg.inv(np.kron(np.exp(-away / 2), np.eye(d) + 0.3 * (blocks + blocks.T) / 4) + 0.1 * np.eye(d * m))
    order = np.arange(d * m).reshape(m, d)
    B = np.eye(d * m)[np.concatenate([order[:, 0], order[:, 1:].ravel()])]
    rng = np.random.default_rng(seed)
    f = B.T @ np.concatenate([rng.normal(0.5, 1, m), rng.normal(size=tangents * m)])
    slip = 0.3 * rng.normal(size=tangents * m)
    return (K + K.T) / 2, B, f, rng.uniform(0, 0.5, m), slip, rng.choice([0.1, 0.3, 0.6, 1.0])


def solve(K, B, f, G, bounds, slip):
    """Return the outcome of the loop; `slip` (m k,): what slips are counted from."""
    m, tolerance = len(G), ConvergenceTolerance(1e-10, 60, 0.0)  # no rigid-body motion
    stiffness = FactorCache(np.zeros((len(f), 0)), "superlu").factorise(csr_array(K))
    rows, normal, every = Rows(csr_array(B), np.ones(len(B))), slice(0, m), np.ones(len(B), bool)
    group = RowGroup(Unilateral(), normal, np.empty((m, 0)), shear=ShearRows(normal, slice(m, len(B)), bounds))
    system = ContactSystem(rows, np.concatenate([G, slip]), (group,), every, every, skin_stiffness(stiffness, rows))
    start = Iterate(np.zeros(len(f)), np.zeros(len(B)), ~every)
    iterates = active_set_iterates(stiffness, f, lambda q: system.with_gaps(system.G - B @ q), start, tolerance)
    return search(iterates, tolerance)


@pytest.mark.rows("17", "18")
@pytest.mark.fuzz
@pytest.mark.parametrize("seed", range(samples(20, 200)))
def test_plane_is_as_lemke_finds_it(seed):
    K, B, f, G, slip, mu = random_problem(seed, 1)
    outcome = solve(K, B, f, G, coulomb(mu, POINTS), slip)
    p, t = lemke(condensed(K, f, (B[:POINTS], B[POINTS:]), G, mu, -slip[:, None]))
    assert outcome.converged and len(outcome.residuals) <= 12
    np.testing.assert_allclose(outcome.iterate.p, np.concatenate([p, t.ravel()]), atol=1e-10)


@pytest.mark.parametrize(
    ("seed", "tangents", "cohesion", "limit"),
    each_option(itertools.product(range(6), (1, 2), (0.0, 0.1), (INF, 0.2)), of=lambda row: [row[0], row[1:]]),
)
def test_the_law_is_fulfilled(seed, tangents, cohesion, limit):
    K, B, f, G, slip, mu = random_problem(100 + seed, tangents)
    bounds = Bounds(np.full(POINTS, mu), np.full(POINTS, cohesion), np.full(POINTS, limit))
    outcome = solve(K, B, f, G, bounds, slip)
    assert outcome.converged
    u, (p, t) = outcome.iterate.q, np.split(outcome.iterate.p, [POINTS])
    gap, S = G - (B @ u)[:POINTS], ((B @ u)[POINTS:] - slip).reshape(POINTS, -1)
    assert np.abs(np.minimum(p, gap)).max() <= 1e-9
    t = t.reshape(POINTS, -1)
    assert np.abs(defect(t, S, bounds.at(p)[0], np.ones(POINTS))).max() <= 1e-9
    assert (t * S).sum(axis=1).min() >= -1e-9


@pytest.mark.parametrize("model", ["plane_strain", "3d"])
def test_given_matrices_are_solved_as_a_case(tmp_path, model):
    """`contact_matrices` and `solve_contact` come to what a case does; files of matrices have the same rows."""
    case = rubbed(model, count=1)
    solution = ls.solve(case)
    zone, system = solution.contact["joint"], ls.assemble(case, t=1.0)
    pair = ls.contact_matrices(system.mesh, "slave", "master")
    given = ls.solve_contact(
        system.K, system.f, pair.B, pair.G, w=pair.w, fixed=system.fixed, u0=system.u0, B_T=pair.B_T, friction=0.4
    )
    np.testing.assert_allclose(given.pressure, zone.pressure, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(given.shear, zone.shear, rtol=1e-6, atol=1e-8)
    np.testing.assert_array_equal(given.status, zone.status)
    np.testing.assert_allclose(pair.tangents, zone.friction.tangents, atol=1e-12)
    write_matrices(tmp_path / "joint.npz", pair, friction=True)
    arrays = read_matrices(tmp_path / "joint.npz")[1]
    assert (arrays["B_T"] != pair.B_T).nnz == 0 and arrays["tangents"].shape == pair.tangents.shape


ONE_POINT = [[2.0, 0.0], [0.0, 2.0]], [6.0, 1.0], [[1.0, 0.0]], [1.0]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"B_T": [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]], "friction": 0.1}, "one or two tangents"),
        ({"B_T": [[0.0, 1.0]], "friction": -0.1}, "must be >= 0"),
    ],
)
def test_matrices_that_do_not_fit(given, words):
    with pytest.raises(RequestError, match=words):
        ls.solve_contact(*ONE_POINT, **given)


def test_one_point_sticks_or_slides():
    K, _, B, G = ONE_POINT
    for push, status, shear in ((1.0, 1, 1.0), (5.0, 2, 2.0)):
        found = ls.solve_contact(K, [6.0, push], B, G, B_T=[[0.0, 1.0]], friction=0.5)
        assert found.pressure == pytest.approx([4.0]) and found.status.tolist() == [status]
        assert found.shear[0] == pytest.approx([shear]) and found.slip[0] == pytest.approx([(push - shear) / 2])


# ---- rules of the states of macro-elements


def states(closed=True, sticks=False, direction=(0.0,), turned=False):
    return States(*(np.array([v]) for v in (closed, sticks, direction, turned)))


def after(now, p, t=(0.0,), s=(0.0,), *, presses=None, pressing=0.0, bounds=None):
    """(closed, sticks, direction, turned) after a solve with a pressure, a traction and a slip."""
    presses = p > 0 if presses is None else presses
    solved = Solved(*(np.array([v]) for v in (float(p), t, s, pressing, presses, 10.0)))
    then = next_states(now, solved, bounds or coulomb(0.5, 1))
    return bool(then.closed[0]), bool(then.sticks[0]), then.direction[0].round(12).tolist(), bool(then.turned[0])


BEGINS, STICKS, OPEN = states(), states(sticks=True), states(closed=False)
SLIDING, BACK, TURNED = states(direction=(1.0,)), states(direction=(-1.0,)), states(direction=(1.0,), turned=True)
CLOSES = {"presses": True, "pressing": 2.0}
IS_OPEN, IS_STUCK = (False, False, [0.0], False), (True, True, [0.0], False)
SLIDES_ON, SLIDES_BACK = (True, False, [1.0], False), (True, False, [-1.0], False)


@pytest.mark.parametrize(
    ("now", "solved", "options", "expected"),
    [
        (STICKS, (2.0, (0.9,)), {}, IS_STUCK),  # below the bound
        (STICKS, (2.0, (-1.1,)), {}, SLIDES_BACK),  # above it: slides along its traction
        (STICKS, (-2.0, (0.1,)), {}, SLIDES_ON),  # in tension it slides first
        (STICKS, (-2.0,), {}, IS_OPEN),  # without a traction it opens
        (SLIDING, (2.0, (1.0,), (0.3,)), {}, SLIDES_ON),
        (SLIDING, (-0.1, (-0.05,), (0.3,)), {}, IS_OPEN),
        (SLIDING, (2.0, (1.0,), (-0.1,)), {}, IS_STUCK),  # a little back: |1 - 1| <= 1
        (SLIDING, (2.0, (1.0,), (-0.3,)), {}, (True, False, [-1.0], True)),  # far back: |1 - 3| > 1, turns round
        (TURNED, (2.0, (1.0,), (-0.3,)), {}, (True, True, [0.0], True)),  # once only
        (BACK, (2.0, (-1.0,), (-0.3,)), {}, SLIDES_BACK),
        (OPEN, (0.0, (0.0,), (0.3,)), {"presses": False}, IS_OPEN),  # stays open
        (OPEN, (0.0, (0.0,), (0.01,)), CLOSES, IS_STUCK),  # 0.1 < 1
        (OPEN, (0.0, (0.0,), (-0.3,)), CLOSES, SLIDES_BACK),  # 3 > 1: slides along its slip
        (BEGINS, (2.0, (0.0,), (0.05,)), {}, IS_STUCK),  # pressed without friction in the first solve: 0.5 < 1
        (BEGINS, (2.0, (0.0,), (-0.3,)), {}, SLIDES_BACK),
        (BEGINS, (-2.0, (0.0,), (0.3,)), {}, IS_OPEN),
        # rough: it never slides, and opens at once
        (STICKS, (1.0, (1e9,)), {"bounds": ROUGH}, IS_STUCK),
        (STICKS, (-1.0, (1e9,)), {"bounds": ROUGH}, IS_OPEN),
        (OPEN, (0.0, (0.0,), (9.0,)), {"bounds": ROUGH, "presses": True, "pressing": 1.0}, IS_STUCK),
        # soft contact may press at a gap, where p is not yet above 0; an infinite bound has no size to slide at
        (STICKS, (-0.1, (0.5,)), {"bounds": ROUGH, "presses": True}, IS_STUCK),
        # without friction it only presses
        (OPEN, (0.0, (0.0,), (9.0,)), {"bounds": coulomb(0.0, 1), **CLOSES}, (True, False, [0.0], False)),
        (BEGINS, (1.0, (0.0,), (9.0,)), {"bounds": coulomb(0.0, 1)}, (True, False, [0.0], False)),
        (BEGINS, (-1.0, (0.0,), (9.0,)), {"bounds": coulomb(0.0, 1)}, IS_OPEN),
    ],
)
def test_the_next_state(now, solved, options, expected):
    assert after(now, *solved, **options) == expected


def test_directions_in_space():
    """It begins to slide along its traction, and goes on along traction and slip."""
    _, sticks, d, _ = after(states(sticks=True, direction=(0.0, 0.0)), 1.0, (3.0, 4.0), (0.0, 0.0))
    assert not sticks and d == pytest.approx([0.6, 0.8])
    _, _, d, _ = after(states(direction=(1.0, 0.0)), 2.0, (1.0, 0.5), (0.1, 0.2))
    assert d == pytest.approx(np.array([2.0, 2.5]) / np.hypot(2.0, 2.5))


def test_states_to_start_from():
    """Without a traction it sticks, or presses without friction if the bodies are held without; else it slides."""
    none, t, bounds = np.zeros((2, 1)), np.array([[0.0], [-2.0]]), coulomb(0.5, 2)
    closed, no = np.ones(2, bool), np.zeros(2, bool)
    assert States.of(closed, no, none, bounds).sticks.all()
    begins = States.of(closed, no, none, bounds, held=True)
    assert begins.closed.all() and not begins.sticks.any() and not begins.slides.any()
    assert States.of(closed, no, t, bounds, held=True).direction.ravel().tolist() == [0.0, -1.0]
    assert States.of(closed, closed, none, bounds, held=True).sticks.all()


def test_bounds():
    """Coulomb, with a cohesion, with a limit, Tresca, rough with a limit; nothing without pressure."""
    bounds = Bounds(np.array([0.5, 0.5, 0.5, 0.0, INF]), np.array([0, 1, 1, 2, 0.0]), np.array([INF, INF, 2, INF, 3.0]))
    b, slope = bounds.at(np.full(5, 4.0))
    assert b.tolist() == [2, 3, 2, 2, 3] and slope.tolist() == [0.5, 0.5, 0, 0, 0]
    assert not bounds.at(np.zeros(5))[0].any() and not bounds.at(np.full(5, -1.0))[0].any()
    assert bounds.rough.tolist() == [False] * 5 and bounds.any.all()


def test_a_defect_is_a_length():
    t, s, b = np.array([[3.0, 4.0], [0.0, 0.0]]), np.zeros((2, 2)), np.array([4.0, 1.0])
    assert defect(t, s, b, np.array([2.0, 2.0])) == pytest.approx(np.array([[0.3, 0.4], [0.0, 0.0]]))
    assert defect(t[1:], s[1:] + 0.01, b[1:], np.array([2.0])) == pytest.approx(np.full((1, 2), -0.01))


# ---- recovered friction: exact where it is even, and within its bound


@pytest.mark.parametrize(("model", "geometry"), each_option(WAYS))
def test_it_is_within_its_bound_where_the_pressure_is(model, geometry):
    zone = joint(model, geometry)
    t, on = np.linalg.norm(zone.shear_recovered, axis=1), np.isfinite(zone.pressure_recovered)
    assert np.isfinite(t[on]).all() and np.isnan(t[~on]).all()
    assert (t[on] <= 0.4 * zone.pressure_recovered[on] * (1 + 1e-12) + 1e-12).all() and t[on].max() > 0


@pytest.mark.parametrize("friction", [0.5, INF])
def test_what_is_even_is_exact(friction):
    """Uniform tractions, that stick below the bound, slide on it, or are rough, and a linear one that is rough."""
    zone = joint("3d")
    surface, macro, centre, n = zone.surface, zone.macro, zone.centre, len(zone.centre)
    bounds, p, way = coulomb(friction, n), np.full(n, 2.0), np.array([0.6, -0.8, 0.0])

    def recovered(t, status):
        nodal, _ = recover_pressure(surface, macro, p, np.full(n, status))
        return recover_shear(surface, macro, t, (p, nodal), np.full(n, status), bounds)[on]

    on = np.isfinite(recover_pressure(surface, macro, p, np.full(n, CONTACT))[0])
    for size, status in ((0.7, CONTACT), (1.0, SLIDES)):
        t = recovered(np.tile(size * way, (n, 1)), status)
        np.testing.assert_allclose(t, np.tile(size * way, (on.sum(), 1)), atol=1e-12)
    if np.isinf(friction):
        t = recovered(np.outer(centre[:, 0] - 0.4, way), CONTACT)  # through 0
        np.testing.assert_allclose(t, np.outer(surface.x[on, 0] - 0.4, way), atol=1e-10)


# ---- models whose sets of rows return under pivoting: seats, a lid on two blocks


def seat(model, friction, geometry="reference", slave="round", **steps):
    """A cylinder in a groove or a ball in a cone of 90 degrees, under a weight of 1 per volume: half of it."""
    held = fix("base", "xy"), fix("axis_seat", "x"), fix("axis_ball", "x"), BodyForce(groups=["ball"], fy=-1.0)
    master = {"round": "flank", "flank": "round"}[slave]
    joint = rubs(slave=slave, master=master, friction=friction, geometry=geometry)
    steel = Material(young=210e3, poisson=0.3)
    return case_of(MESHES / "seat.msh", steel, joint, *held, Steps(max_halvings=0, **steps), model=model)


@pytest.mark.rows("0.1-reference-round-plane_strain")
@pytest.mark.parametrize("model", ["plane_strain", "axisymmetric"])
@pytest.mark.parametrize(
    ("friction", "geometry", "slave"),
    [(0.1, "reference", "round"), (0.5, "reference", "flank"), (0.5, "current", "flank"), (0.3, "current", "flank")],
)
@pytest.mark.filterwarnings("ignore:master 'round' is in front of")
def test_a_body_in_a_seat(model, friction, geometry, slave):
    """It slides on the flank as it settles, so that forces along it are its bound, and both carry the weight."""
    zone = ls.solve(seat(model, friction, geometry, slave, count=4)).contact["joint"]
    pressed = zone.status == 2
    ratio = np.abs(zone.shear[pressed, 0]) / zone.pressure[pressed]
    assert ratio == pytest.approx(np.full(pressed.sum(), friction), rel=1e-8)
    assert pressed.any() and not (zone.status == 1).any()


def test_a_message_blames_no_friction_where_pressures_carry_the_load():
    with pytest.raises(NotConvergedError, match="forces are off by") as caught:
        ls.solve(replace(seat("plane_strain", 0.2, count=1), solver=Solver(max_iterations=1)))
    assert "raise friction" not in str(caught.value)


@pytest.mark.parametrize(
    ("friction", "normal", "shear"), [(0.2, 2.7830869501, 0.5231004109), (0.3, 2.7427535141, 0.5553778340)]
)
def test_a_lid_on_two_blocks(friction, normal, shear):
    """Tied to a column between them, pressed and pushed.

    Forces are those of projected Gauss-Seidel on the same matrices, whose largest violation is 4e-16.
    """
    joints = rubs(slave="pt", master="hb", friction=friction, geometry="reference"), Tie(slave="bt", master="hb")
    push = Force(group="ht", fx=1.0, fy=-4.0, total=True)
    held = fix("bolt0", "xy"), fix("p0", "xy"), push, Steps(count=1, max_halvings=0)
    zone = ls.solve(plane(MESHES / "lid.msh", *joints, *held)).contact["joint"]
    assert total(zone) == pytest.approx(normal, rel=1e-9)
    assert zone.shear[:, 0] @ zone.area == pytest.approx(shear, rel=1e-9)
    assert (zone.status > 0).sum() == 5 and (zone.status == 2).sum() == 4


def test_a_lid_whose_sets_return_with_finite_strains():
    """Each time they are a little better, until all iterations are spent: such a cycle is left to the splitting."""
    text = friction_bank.lid_text("finite", 0.3, -1.1812138464037285, 0.3)
    zone = ls.solve(ls.parse_case(text), friction_bank.lid(4, 10)).contact["joint"]
    slides = zone.status == 2
    assert np.abs(zone.shear[slides, 0]) == pytest.approx(0.3 * zone.pressure[slides], rel=1e-8)
    assert (zone.status == 1).any() and np.all(np.abs(zone.shear[:, 0]) <= 0.3 * zone.pressure * (1 + 1e-8))
