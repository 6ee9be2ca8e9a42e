"""Natural modes: exact frequencies and their rates, rigid-body modes, effective masses, contact held in a state."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.errors import DataError, RequestError
from lacsolver.bodies.mass import assemble_mass
from lacsolver.case import CaseError, Contact, Material, Pressure, Rigid, Solver, Spring, Tie, Traction
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.stepping import march
from lacsolver.linear import SingularError
from lacsolver.results.results import Restart
from lacsolver.vibration.linearised import LinearisedProblem
from lacsolver.vibration.natural_modes import natural_modes
from tests.lacsolver.bodies import PLANES, square
from tests.lacsolver.held import joined, with_sides
from tests.lacsolver.mode_cases import DENSITY, SOLID, YOUNG, block, modes_of, problem_of, strip, waves, with_groups
from tests.lacsolver.patch_meshes import stack
from tests.problems import fix

ROLLERS = fix("x0", "x"), fix("x1", "x"), fix("y0", "y"), fix("y1", "y")
BOXED = *ROLLERS, fix("z0", "z"), fix("z1", "z")
TIE, CONTACT = (kind(name="joint", slave="slave", master="master") for kind in (Tie, Contact))
FLAT = replace(SOLID, poisson=0.0)


# ---- exact frequencies


#: cells, number of cells along a side, dimension, mass, and the least rate
RATES = [
    *((name, 4, 2, "consistent", 1.9 if CELLS[name].order == 1 else 3.6) for name in PLANES),
    ("QUAD4", 4, 2, "lumped", 1.9),
    *((name, 3, 3, "consistent", 1.7) for name in ("TETRA4", "HEXA8")),
    ("PYRAM5", 2, 3, "consistent", 1.7),
    *((name, 2, 3, "consistent", 3.3) for name in ("TETRA10", "HEXA20")),
]


@pytest.mark.rows("QUAD8-4-2-consistent-3.6", "TETRA4-3-3-consistent-1.7")
@pytest.mark.parametrize(("name", "n", "dim", "mass", "rate"), RATES)
def test_frequencies_converge_at_rates_two_and_four(name, n, dim, mass, rate):
    """The first mode of a body on rollers: a standing transverse wave, curl of sin(pi x) sin(pi y).

    Frequencies come from above with a consistent mass, and from below with a lumped one of linear cells.
    """
    exact, model = waves()[1] * np.sqrt(2) / 2, "plane_strain" if dim == 2 else "3d"
    held = ROLLERS if dim == 2 else BOXED
    found = [modes_of(block(name, k, model), *held, count=1, model=model, mass=mass) for k in (n, 2 * n)]
    coarse, fine = ((modes.frequencies[0] / exact - 1) * (-1 if mass == "lumped" else 1) for modes in found)
    assert 0 < fine < coarse and np.log2(coarse / fine) > rate


def test_a_bar_with_one_end_held_has_its_frequencies_and_effective_masses():
    """Frequencies (2 k - 1) c / 4 L, masses 8 / ((2 k - 1) pi)^2 (Timoshenko, Vibration Problems, 1937)."""
    held, how = (fix("x0", "x"), *ROLLERS[2:]), {"model": "plane_stress", "law": FLAT, "count": 3}
    coarse, modes = (modes_of(strip("QUAD8", n, 1, 3.0, 0.2), *held, **how) for n in (12, 24))
    odd = np.array([1, 3, 5])
    before, after = (m.frequencies / (odd * np.sqrt(YOUNG / DENSITY) / 12) - 1 for m in (coarse, modes))
    assert (after < 1e-5).all() and (np.log2(before / after) > 3.9).all()
    assert modes.effective_masses[:, 0] / modes.mass == pytest.approx(8 / (odd * np.pi) ** 2, rel=1e-4)
    assert modes.mass == pytest.approx(DENSITY * 3.0 * 0.2, rel=1e-13) and modes.rigid == ()


# ---- rigid-body modes


@pytest.mark.parametrize(
    ("name", "model", "count"),
    [
        *(("HEXA8", "3d", 6), ("TETRA10", "3d", 6), ("QUAD4", "plane_strain", 3), ("TRIA6", "plane_stress", 3)),
        *(("QUAD8", "axisymmetric", 1), ("TRIA3", "axisymmetric", 1)),
    ],
)
def test_a_free_block_has_its_rigid_body_modes_and_their_masses(name, model, count):
    mesh = block(name, 2, model)
    modes, problem = modes_of(mesh, model=model, count=5), problem_of(mesh, model=model)
    assert len(modes.rigid) == count == len(modes.rigid_shapes) and len(modes.frequencies) == 5
    assert modes.rigid_masses == pytest.approx(modes.mass, rel=1e-12)
    assert np.abs(modes.effective_masses).max() < 1e-20 * modes.mass
    K = problem.kinematics.tangent(np.zeros(problem.space.n_dof), 0.0)
    flat = modes.rigid_shapes.reshape(count, -1)
    assert np.abs(K @ flat.T).max() < 1e-12 * abs(K).max()
    assert modes.frequencies[0] > 0.1  # the first that is not rigid: the size is 1, and waves travel at about 1


def test_no_mode_of_several_with_one_frequency_is_missed():
    """Six bodies alike have each frequency six times; the numbers asked for end within and between the groups."""
    one, six = block("QUAD4", 6), joined(*(block("QUAD4", 6, shift=3.0 * k) for k in range(6)))
    each = np.repeat(modes_of(one, count=3).frequencies, 6)
    for count in (4, 10, 12, 15):
        modes = modes_of(six, count=count)
        assert len(modes.rigid) == 18 and modes.frequencies == pytest.approx(each[:count], rel=1e-10)
    assert "'a' moves along x" in modes.rigid and "'b' moves along y" in modes.rigid


# ---- effective masses, and modes as such


def test_shapes_solve_the_equations_and_fulfil_the_tie():
    mesh, records = stack("HEXA8", "TETRA4", 3, counts=(3, 2)), (fix("bottom", "xyz"), TIE)
    modes, problem = modes_of(mesh, *records, count=5, model="3d"), problem_of(mesh, *records, model="3d")
    lin = LinearisedProblem.of(ReducedProblem(problem))
    M = assemble_mass(problem.space, problem.materials)
    u = modes.shapes.reshape(5, -1).T
    omega2 = (2 * np.pi * modes.frequencies) ** 2
    q = lin.T.T @ u
    assert np.abs(lin.T @ q - u).max() < 1e-14
    assert np.abs(lin.C @ q).max() < 1e-9 * abs(lin.C).max()
    left = lin.K @ q - (lin.T.T @ (M @ u)) * omega2  # carried by the tie
    pressures = np.linalg.lstsq(lin.C.T.toarray(), left, rcond=None)[0]
    assert np.abs(left - lin.C.T @ pressures).max() < 1e-8 * np.abs(lin.K @ q).max()
    gram = u.T @ (M @ u)
    assert np.diag(gram) == pytest.approx(modes.modal_masses, rel=1e-12)
    assert np.abs(gram - np.diag(np.diag(gram))).max() < 1e-9 * gram.max()
    assert np.linalg.norm(modes.shapes, axis=2).max(axis=1) == pytest.approx(1.0, rel=1e-14)


# ---- about a state


def last_state(problem):
    """The last state of a problem."""
    *_, state = march(problem)
    return Restart.of(state, 1.0, 1)


def test_rows_closed_in_a_state_are_held():
    """Pressed all over, contact holds what a bilateral contact holds; undeformed, it is open."""
    mesh = stack("QUAD4", "TRIA3", 2, counts=(4, 3))
    pressed = fix("bottom", "xy"), fix("x0", "x"), Pressure(group="top", value=0.01)
    problem = problem_of(mesh, *pressed, CONTACT)
    closed, open_ = natural_modes(problem, count=6, at=last_state(problem)), natural_modes(problem, count=6)
    both = modes_of(mesh, *pressed, replace(CONTACT, type="bilateral"), count=6)
    assert closed.frequencies == pytest.approx(both.frequencies, rel=1e-10)
    assert closed.held == both.held == {"joint": problem.joints[0].zone.n_macros} and closed.time == 1.0
    assert open_.held == {"joint": 0} and len(open_.rigid) == 1 and "'upper'" not in closed.rigid
    assert open_.frequencies[0] < closed.frequencies[1]


@pytest.mark.parametrize("given", [0.7, "0.7 * (1 + t)"])
def test_a_soft_contact_is_a_spring(given):
    """A bar on a soft foundation: omega L / c tan(omega L / c) = k L / E, with k the stiffness of contact per area.

    That of time 0, where the bodies are undeformed.
    """
    mesh, stiff = stack("QUAD8", "QUAD8", 2, counts=(3, 3), even=True), 0.7
    soft = fix("lower", "xy"), *ROLLERS[:2], replace(CONTACT, type="bilateral", stiffness=given)
    modes = modes_of(mesh, *soft, model="plane_stress", law=FLAT, count=1)
    z = brentq(lambda z: z * np.tan(z) - stiff / YOUNG, 1e-3, 1.5)
    assert modes.frequencies[0] == pytest.approx(z * np.sqrt(YOUNG / DENSITY) / (2 * np.pi), rel=1e-5)
    assert modes.rigid == ()


def test_the_tangent_of_a_state_is_the_symmetric_part_of_the_derivative_of_its_forces():
    """Finite strains, sliding contact, a follower, and a rigid body that turns freely: against central differences."""
    mesh = stack("QUAD4", "TRIA3", 2, counts=(3, 2))
    loads = Pressure(group="x1", value=0.05, follower=True), Rigid(group="top", fx=0.05, fy=-0.2, moment=0.01)
    records = fix("bottom", "xy"), CONTACT, Spring(group="upper", kx=0.02, ky=0.02), *loads
    problem = problem_of(mesh, *records, law=replace(SOLID, law="neo_hookean"), kinematics="finite")
    state = last_state(problem)
    lin = LinearisedProblem.of(ReducedProblem(problem), state)
    assert sum(lin.held.values()) > 0
    q0, p, _ = state.step.iterate
    c, K = problem.constraints, problem.kinematics

    def forces(q):
        u = c.displacement(q, 1.0)
        (face,) = (pair.integrate(problem.space, u, 1.0) for pair in problem.joints)
        out = K.internal_force(u, 1.0) - problem.load(1.0, u) + face.B.T @ p
        return c.tangent(q, 1.0).T @ out - c.force(1.0, q)

    h, some = 1e-6, np.random.default_rng(0).normal(size=(6, len(q0)))
    J = np.array([(forces(q0 + h * v) - forces(q0 - h * v)) / (2 * h) for v in some]) @ some.T
    assert np.abs(J - J.T).max() > 1e-5 * np.abs(J).max()  # the antisymmetric part is there, and left out
    assert np.abs(some @ (lin.K @ some.T) - (J + J.T) / 2).max() < 1e-7 * np.abs(J).max()
    modes = natural_modes(problem, count=3, at=state)
    assert modes.rigid == () and (modes.frequencies > 0).all()


def pulled(stress):
    """A slender beam under finite strains, hinged at the middle of its ends, with a stress along it."""
    L, H = 40.0, 1.0
    mesh = strip("QUAD8", 20, 2, L, H)
    ends = np.flatnonzero(np.abs(mesh.points[:, 1] - H / 2) < 1e-9)
    hinge = {f"hinge{k}": ends[np.abs(mesh.points[ends, 0] - at) < 1e-9] for k, at in enumerate((0.0, L))}
    sides = with_sides(replace(mesh, node_groups={}), node_groups=hinge)
    records = fix("hinge0", "xy"), fix("hinge1", "y"), Traction(group="x1", tx=stress)
    law = Material(law="saint_venant_kirchhoff", young=1.0, poisson=0.0, density=DENSITY)
    problem = problem_of(sides, *records, law=law, model="plane_stress", kinematics="finite")
    return problem, last_state(problem)


def test_a_stress_along_a_beam_changes_its_frequency():
    """f^2 = f0^2 (1 + P / P_E) with Euler's load P_E = pi^2 E I / L^2 (Timoshenko, Vibration Problems, 1937)."""
    euler = np.pi**2 / 12 / 40.0**2
    for share, within in ((0.5, 4e-3), (-0.9, 0.05)):
        problem, state = pulled(share * euler)
        f0, f = (natural_modes(problem, count=1, at=at).frequencies[0] for at in (None, state))
        assert (f / f0) ** 2 == pytest.approx(1 + share, rel=within)
    problem, state = pulled(-1.1 * euler)
    with pytest.raises(SingularError, match="not stable"):
        natural_modes(problem, count=1, at=state)


# ---- rigid bodies, and what is refused


def test_a_rigid_part_of_a_body_keeps_the_mass_of_its_cells():
    """A block, its side rigid and free: the same rigid-body modes and masses as without, and higher frequencies."""
    mesh, side = block("QUAD4", 3), Rigid(group="x0", fx=0.0, fy=0.0, moment=0.0)
    stiffer, free = modes_of(mesh, side, count=3), modes_of(mesh, count=3)
    assert len(stiffer.rigid) == 3 and stiffer.rigid_masses == pytest.approx(stiffer.mass, rel=1e-12)
    assert (stiffer.frequencies > free.frequencies).all()


def plate(*records, **keys):
    """Modes of a rigid plate beside a block, loaded along y."""
    mesh = joined(with_sides(square("QUAD4", 2)), Mesh.create([[0, 2], [3, 2]], [("SEG2", [[0, 1]])], space_dim=2))
    return modes_of(mesh, Rigid(group="b", ux=0.0, fy=-1.0, **keys), *records, count=2)


def test_a_rigid_surface_with_mass_on_a_spring_is_an_oscillator():
    """A plate on springs at its ends, 3 apart: f = sqrt(k / m) / 2 pi along y, sqrt(k_t / J) / 2 pi in rotation."""
    ends = [Spring(at=[x, 2.0], ky=1e-4) for x in (0.0, 3.0)]
    modes = plate(*ends, mass=2.0, inertia=5.0, moment=0.0)
    expected = np.sqrt(np.array([2e-4 / 2.0, 2 * 1e-4 * 1.5**2 / 5.0])) / (2 * np.pi)
    assert modes.frequencies == pytest.approx(np.sort(expected), rel=1e-10)
    assert modes.mass == pytest.approx(2.0 + DENSITY, rel=1e-12) and len(modes.rigid) == 3
    assert sorted(modes.effective_masses[:, 1]) == pytest.approx([0.0, 2.0], abs=1e-9)


def hinged():
    """Two squares that share a corner."""
    points = [[0, 0], [1, 0], [1, 1], [0, 1], [2, 1], [2, 2], [1, 2]]
    return with_groups(Mesh.create(points, [("QUAD4", [[0, 1, 2, 3], [2, 4, 5, 6]])], space_dim=2))


@pytest.mark.parametrize(
    ("ask", "error", "words"),
    [
        (lambda mesh: modes_of(mesh, law=replace(SOLID, density=0.0)), DataError, "have no density"),
        (lambda mesh: modes_of(mesh, *(fix(side, "xy") for side in ("x0", "x1"))), DataError, "nothing can vibrate"),
        (lambda mesh: modes_of(mesh, Solver(backend="multigrid")), RequestError, 'in place of "multigrid"'),
        (lambda mesh: modes_of(mesh, Solver(engine="petsc")), RequestError, "by one process"),
        (lambda mesh: natural_modes(problem_of(mesh), 5), RequestError, "count="),
        (lambda mesh: modes_of(hinged(), fix("x0", "xy"), count=1), SingularError, "without any force"),
        (lambda mesh: plate(), CaseError, "has no mass"),
        (lambda mesh: plate(mass=2.0, moment=0.0), CaseError, "has no inertia"),
    ],
)
def test_what_cannot_be_done_is_said(ask, error, words):
    with pytest.raises(error, match=words):
        ask(block("QUAD4", 1))
