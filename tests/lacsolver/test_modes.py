"""Natural modes: exact frequencies and their rates, rigid-body modes, effective masses, contact held in a state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import j0, j1

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.errors import DataError, RequestError
from lacsolver.bodies.mass import assemble_mass
from lacsolver.case import CaseError, parse_case
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.stepping import march
from lacsolver.linear import SingularError
from lacsolver.problem.problem import Problem
from lacsolver.results.results import Restart
from lacsolver.vibration import eigenmodes
from lacsolver.vibration.linearised import LinearisedProblem
from lacsolver.vibration.natural_modes import natural_modes
from tests.lacsolver.bodies import PLANES, square
from tests.lacsolver.held import joined, moved, with_sides
from tests.lacsolver.mode_cases import DENSITY, YOUNG, block, hold, modes_of, strip, text, waves, with_groups
from tests.lacsolver.patch_meshes import stack

ROLLERS = hold(x0="ux", x1="ux", y0="uy", y1="uy")
TIE = '[[tie]]\nname = "joint"\nslave = "slave"\nmaster = "master"\n'
CONTACT = TIE.replace("tie", "contact")


def nearest(frequencies, exact):
    """The relative error of the frequency nearest to an exact one."""
    return np.abs(frequencies / exact - 1).min()


# ---- exact frequencies


def error_of_a_square(name, n, **options):
    """Error of the first mode of a square on rollers: a standing transverse wave, curl of sin(pi x) sin(pi y)."""
    exact = waves()[1] * np.sqrt(2) / 2
    return modes_of(block(name, n), text(sections=ROLLERS), 1, **options).frequencies[0] / exact - 1


@pytest.mark.parametrize("name", PLANES)
def test_frequencies_converge_at_rates_two_and_four(name):
    coarse, fine = (error_of_a_square(name, n) for n in (4, 8))
    assert 0 < fine < coarse, "frequencies of a consistent mass come from above"
    assert np.log2(coarse / fine) > (1.9 if CELLS[name].order == 1 else 3.6)


def test_frequencies_of_a_lumped_mass_of_linear_cells_come_from_below():
    coarse, fine = (error_of_a_square("QUAD4", n, mass="lumped") for n in (4, 8))
    assert coarse < fine < 0 and np.log2(coarse / fine) > 1.9


@pytest.mark.parametrize(("name", "n"), [("TETRA4", 3), ("HEXA8", 3), ("PYRAM5", 2), ("TETRA10", 2), ("HEXA20", 2)])
def test_frequencies_of_solids_converge(name, n):
    case = text("3d", ROLLERS + hold(z0="uz", z1="uz"))
    exact = waves()[1] * np.sqrt(2) / 2
    coarse, fine = (modes_of(block(name, k, "3d"), case, 1).frequencies[0] / exact - 1 for k in (n, 2 * n))
    assert 0 < fine < coarse
    assert np.log2(coarse / fine) > (1.7 if CELLS[name].order == 1 else 3.3)


def test_a_bar_with_one_end_held_has_its_frequencies_and_effective_masses():
    """Frequencies (2 k - 1) c / 4 L, masses 8 / ((2 k - 1) pi)^2 (Timoshenko, Vibration Problems, 1937)."""
    case = text("plane_stress", hold(x0="ux", y0="uy", y1="uy"), poisson=0.0)
    coarse, modes = (modes_of(strip("QUAD8", n, 1, 3.0, 0.2), case, 3) for n in (12, 24))
    odd = np.array([1, 3, 5])
    before, after = (m.frequencies / (odd * np.sqrt(YOUNG / DENSITY) / 12) - 1 for m in (coarse, modes))
    assert (after < 1e-5).all() and (np.log2(before / after) > 3.9).all()
    assert modes.effective_masses[:, 0] / modes.mass == pytest.approx(8 / (odd * np.pi) ** 2, rel=1e-4)
    assert modes.mass == pytest.approx(DENSITY * 3.0 * 0.2, rel=1e-13) and modes.rigid == ()


def test_a_beam_on_rollers_bends_as_rayleigh_and_lamb_say():
    """A strip with uy = 0 at its ends bends in modes sin(k pi x / L): the antisymmetric waves of an infinite plate."""
    h, L = 0.1, 2.0
    cl, ct = waves()

    def residual(omega, k):
        p, q = np.sqrt(k**2 - (omega / cl) ** 2), np.sqrt(k**2 - (omega / ct) ** 2)
        return np.tanh(q * h) * 4 * k**2 * p * q - np.tanh(p * h) * (k**2 + q**2) ** 2

    case = text(sections=hold(x0="uy", x1="uy"))
    coarse, fine = (modes_of(strip("QUAD8", n, n // 8, L, 2 * h), case, 4) for n in (16, 32))
    for number in (1, 2):
        k = number * np.pi / L
        thin = np.sqrt(YOUNG / (1 - 0.25**2) / DENSITY / 3) * h * k**2  # Kirchhoff's plate
        exact = brentq(residual, 0.5 * thin, 1.01 * thin, args=(k,), xtol=1e-14) / (2 * np.pi)
        errors = [nearest(modes.frequencies, exact) for modes in (coarse, fine)]
        assert errors[1] < 4e-5 and np.log2(errors[0] / errors[1]) > 3.5
    assert len(fine.rigid) == 1 and "moves along x" in fine.rigid[0]


def test_a_long_cylinder_breathes_radially():
    """Axisymmetric, ends on rollers: omega = k c with k R J0(k R) = (1 - 2 nu) / (1 - nu) J1(k R)."""
    factor = (1 - 2 * 0.25) / (1 - 0.25)
    exact = brentq(lambda z: z * j0(z) - factor * j1(z), 0.5, 3.0) * waves()[0] / (2 * np.pi)
    errors = []
    for n in (3, 6):
        cylinder = block("QUAD8", n, size=(1.0, 0.1, 1.0))
        errors.append(nearest(modes_of(cylinder, text("axisymmetric", hold(y0="uy", y1="uy")), 1).frequencies, exact))
    assert errors[1] < 1e-5 and np.log2(errors[0] / errors[1]) > 3.7


def test_a_stiff_body_on_springs_has_the_frequency_of_a_mass():
    body = block("QUAD4", 1)
    spring = "".join(f"[[spring]]\nat = [{x}, {y}]\nkx = 0.5\nky = 2.0\n" for x in (0, 1) for y in (0, 1))
    modes = modes_of(body, text("plane_stress", spring, young=1e9, density=3.0), 2)
    assert modes.frequencies == pytest.approx(np.sqrt(np.array([2.0, 8.0]) / 3) / (2 * np.pi), rel=1e-7)
    assert modes.modal_masses == pytest.approx(3.0, rel=1e-6) and modes.rigid == ()


def test_units_change_no_frequency():
    """Steel in metres, kilograms and seconds, and in millimetres, tonnes and seconds."""
    sections = hold(x0="ux uy uz")
    si = modes_of(block("HEXA8", 3, "3d", (0.3, 0.1, 0.1)), text("3d", sections, young=2.1e11, density=7850.0), 4)
    mm = modes_of(block("HEXA8", 3, "3d", (300.0, 100.0, 100.0)), text("3d", sections, young=2.1e5, density=7.85e-9), 4)
    assert mm.frequencies == pytest.approx(si.frequencies, rel=1e-10)
    assert mm.mass == pytest.approx(si.mass * 1e-3, rel=1e-12) and si.mass == pytest.approx(7850 * 3e-3, rel=1e-12)


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
    modes = modes_of(mesh, text(model), 5)
    assert len(modes.rigid) == count == len(modes.rigid_shapes) and len(modes.frequencies) == 5
    assert modes.rigid_masses == pytest.approx(modes.mass, rel=1e-12)
    assert np.abs(modes.effective_masses).max() < 1e-20 * modes.mass
    problem = Problem.of(parse_case(text(model)), mesh)
    K = problem.kinematics.tangent(np.zeros(problem.space.n_dof), 0.0)
    flat = modes.rigid_shapes.reshape(count, -1)
    assert np.abs(K @ flat.T).max() < 1e-12 * abs(K).max()
    assert modes.frequencies[0] > 0.1  # the first that is not rigid: the size is 1, and waves travel at about 1


def test_frequencies_of_a_free_bar():
    """Waves along a free bar have k c / 2 L, with Poisson's ratio 0."""
    coarse, fine = (modes_of(strip("QUAD8", n, 1, 3.0, 1.0), text("plane_stress", poisson=0.0), 8) for n in (6, 12))
    assert len(fine.rigid) == 3
    for k in (1, 2):
        errors = [nearest(modes.frequencies, k * np.sqrt(YOUNG / DENSITY) / 6) for modes in (coarse, fine)]
        assert errors[1] < 6e-5 and np.log2(errors[0] / errors[1]) > 3.7


def test_modes_of_two_bodies_are_those_of_each():
    one, other = block("QUAD4", 3), block("QUAD4", 3, shift=5.0)
    both = modes_of(joined(one, other), text(), 6)
    alone = modes_of(one, text(), 3)
    assert len(both.rigid) == 6 and "'a' moves along x" in both.rigid and "'b' moves along y" in both.rigid
    assert both.frequencies == pytest.approx(np.repeat(alone.frequencies, 2), rel=1e-9)


def test_a_body_that_slides_or_turns_has_the_modes_that_are_left():
    mesh = block("QUAD8", 3)
    assert [len(modes_of(mesh, text(sections=s), 2).rigid) for s in (hold(y0="uy"), hold(y0="uy", x0="ux"))] == [1, 0]
    pin = "[[displacement]]\nat = [0.0, 0.0]\nux = 0.0\nuy = 0.0\n"
    assert modes_of(mesh, text(sections=pin), 2).rigid == ("the body turns about the point (0, 0)",)


# ---- effective masses, and modes as such


def test_effective_masses_of_all_modes_are_the_mass_that_is_free():
    """Over all modes they add up to r.M T (T.M T)^-1 T.M r: the whole mass, but for what hangs on held nodes."""
    found = []
    for n in (2, 4):
        mesh, case = block("QUAD8", n), text(sections=hold(x0="ux uy"))
        modes = modes_of(mesh, case, 10**6)
        problem = Problem.of(parse_case(case), mesh)
        M, T = assemble_mass(problem.space, problem.materials), problem.constraints.T
        assert len(modes.frequencies) == modes.unknowns == T.shape[1]
        r = np.tile(np.eye(2), (mesh.n_nodes, 1))
        b = T.T @ (M @ r)
        free = np.diag(b.T @ np.linalg.solve((T.T @ M @ T).toarray(), b))
        assert modes.effective_masses.sum(axis=0) == pytest.approx(free, rel=1e-10)
        assert (np.diff(modes.effective_masses.cumsum(axis=0), axis=0) >= 0).all()
        found.append(1 - free.max() / modes.mass)
    assert 0 < found[1] < 0.55 * found[0] < 0.1


def both_ways(monkeypatch, mesh, case, count=6, **options):
    """Frequencies by dense matrices and by Lanczos' iteration."""
    made = []
    for limit in (0, 10**6):
        monkeypatch.setattr(eigenmodes, "_DENSE", limit)
        made.append(modes_of(mesh, case, count, **options))
    return made


def test_no_mode_of_several_with_one_frequency_is_missed():
    """Six bodies alike have each frequency six times; the numbers asked for end within and between the groups."""
    one = block("QUAD4", 6)
    six = joined(*(block("QUAD4", 6, shift=3.0 * k) for k in range(6)))
    each = np.repeat(modes_of(one, text(), 3).frequencies, 6)
    for count in (4, 10, 12, 15):
        modes = modes_of(six, text(), count)
        assert len(modes.rigid) == 18 and modes.frequencies == pytest.approx(each[:count], rel=1e-10)


@pytest.mark.parametrize("sections", [hold(bottom="ux uy") + TIE, TIE, hold(bottom="ux uy") + CONTACT])
def test_sparse_and_dense_matrices_give_the_same(monkeypatch, sections):
    """Blocks that do not match: tied and held, tied and free (three rigid-body modes), and with an open contact."""
    sparse, dense = both_ways(monkeypatch, stack("QUAD4", "TRIA3", 2, counts=(4, 3)), text(sections=sections))
    assert sparse.frequencies == pytest.approx(dense.frequencies, rel=1e-9)
    assert sparse.effective_masses == pytest.approx(dense.effective_masses, abs=1e-9 * dense.mass)
    expected = {hold(bottom="ux uy") + TIE: 0}.get(sections, 3)
    assert len(sparse.rigid) == len(dense.rigid) == expected
    assert sparse.held == {"joint": 0 if "contact" in sections else 2 * 4}  # two components for each slave face


def test_shapes_solve_the_equations_and_fulfil_the_tie():
    mesh, case = stack("HEXA8", "TETRA4", 3, counts=(3, 2)), text("3d", hold(bottom="ux uy uz") + TIE)
    modes = modes_of(mesh, case, 5)
    problem = Problem.of(parse_case(case), mesh)
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


def test_a_tie_of_blocks_that_match_is_one_body():
    """Blocks with the same cells at their interface, tied, on rollers: the modes of one block of twice the height."""
    two = modes_of(
        stack("QUAD8", "QUAD8", 2, counts=(5, 5)), text(sections=hold(x0="ux", x1="ux", bottom="uy") + TIE), 2
    )
    high = strip("QUAD8", 6, 12, 1.0, 2.0)
    one = modes_of(high, text(sections=hold(x0="ux", x1="ux", y0="uy")), 2)
    assert two.frequencies == pytest.approx(one.frequencies, rel=2e-3)


# ---- about a state


def last_state(mesh, case):
    """The problem of a case, and its last state."""
    problem = Problem.of(parse_case(case), mesh)
    *_, state = march(problem)
    return problem, Restart.of(state, 1.0, 1)


PRESSED = hold(bottom="ux uy", x0="ux") + '[[pressure]]\ngroup = "top"\nvalue = 0.01\n'


def test_rows_closed_in_a_state_are_held():
    """Pressed all over, contact holds what a bilateral contact holds; undeformed, it is open."""
    mesh = stack("QUAD4", "TRIA3", 2, counts=(4, 3))
    problem, state = last_state(mesh, text(sections=PRESSED + CONTACT))
    closed = natural_modes(problem, count=6, at=state)
    both = modes_of(mesh, text(sections=PRESSED + CONTACT + 'type = "bilateral"\n'), 6)
    assert closed.frequencies == pytest.approx(both.frequencies, rel=1e-10)
    assert closed.held == both.held == {"joint": problem.joints[0].zone.n_macros} and closed.time == 1.0
    open_ = natural_modes(problem, count=6)
    assert open_.held == {"joint": 0} and len(open_.rigid) == 1 and "'upper'" not in closed.rigid
    assert open_.frequencies[0] < closed.frequencies[1]


def test_a_soft_contact_is_a_spring():
    """A bar on a soft foundation: omega L / c tan(omega L / c) = k L / E, with k the stiffness of contact per area."""
    mesh = stack("QUAD8", "QUAD8", 2, counts=(3, 3), even=True)
    stiff = 0.7
    sections = hold(lower="ux uy", x0="ux", x1="ux") + CONTACT + f'type = "bilateral"\nstiffness = {stiff}\n'
    modes = modes_of(mesh, text("plane_stress", sections, poisson=0.0), 1)
    z = brentq(lambda z: z * np.tan(z) - stiff / YOUNG, 1e-3, 1.5)
    assert modes.frequencies[0] == pytest.approx(z * np.sqrt(YOUNG / DENSITY) / (2 * np.pi), rel=1e-5)
    assert modes.rigid == ()


def test_the_tangent_of_a_state_is_the_symmetric_part_of_the_derivative_of_its_forces():
    """Finite strains, sliding contact, a follower, and a rigid body that turns freely: against central differences."""
    mesh = stack("QUAD4", "TRIA3", 2, counts=(3, 2))
    sections = hold(bottom="ux uy") + CONTACT + '[[spring]]\ngroup = "upper"\nkx = 0.02\nky = 0.02\n'
    sections += '[[pressure]]\ngroup = "x1"\nvalue = 0.05\nfollower = true\n'
    sections += '[[rigid]]\ngroup = "top"\nfx = 0.05\nfy = -0.2\nmoment = 0.01\n'
    case = text(sections=sections, more='kinematics = "finite"\n')
    case = case.replace("[[material]]\n", '[[material]]\nlaw = "neo_hookean"\n', 1)
    problem, state = last_state(mesh, case)
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
    sides = with_sides(Mesh.create(mesh.points, mesh.blocks, space_dim=2), node_groups=hinge)
    section = hold(hinge0="ux uy", hinge1="uy") + f'[[traction]]\ngroup = "x1"\ntx = {stress}\n'
    case = text("plane_stress", section, young=1.0, poisson=0.0, more='kinematics = "finite"\n')
    return last_state(sides, case.replace("[[material]]\n", '[[material]]\nlaw = "saint_venant_kirchhoff"\n', 1))


def test_a_stress_along_a_beam_changes_its_frequency():
    """f^2 = f0^2 (1 + P / P_E) with Euler's load P_E = pi^2 E I / L^2 (Timoshenko, Vibration Problems, 1937)."""
    euler = np.pi**2 / 12 / 40.0**2
    problem, state = pulled(0.5 * euler)
    f0 = natural_modes(problem, count=1).frequencies[0]
    f = natural_modes(problem, count=1, at=state).frequencies[0]
    assert (f / f0) ** 2 == pytest.approx(1.5, rel=4e-3)
    problem, state = pulled(-0.9 * euler)
    f = natural_modes(problem, count=1, at=state).frequencies[0]
    assert (f / f0) ** 2 == pytest.approx(0.1, rel=0.05)


def test_a_state_that_is_not_stable_is_refused():
    problem, state = pulled(-1.1 * np.pi**2 / 12 / 40.0**2)
    with pytest.raises(SingularError, match="the state is not stable"):
        natural_modes(problem, count=1, at=state)


# ---- rigid bodies, and what is refused


def test_a_rigid_part_of_a_body_keeps_the_mass_of_its_cells():
    """A block, its side rigid and free: the same rigid-body modes and masses as without, and higher frequencies."""
    mesh = block("QUAD4", 3)
    rigid = '[[rigid]]\ngroup = "x0"\nfx = 0.0\nfy = 0.0\nmoment = 0.0\n'
    stiffer, free = modes_of(mesh, text(sections=rigid), 3), modes_of(mesh, text(), 3)
    assert len(stiffer.rigid) == 3 and stiffer.rigid_masses == pytest.approx(stiffer.mass, rel=1e-12)
    assert (stiffer.frequencies > free.frequencies).all()


def plate(more):
    """A rigid plate beside a block, loaded along y, with more keys."""
    mesh = joined(with_sides(square("QUAD4", 2)), Mesh.create([[0, 2], [3, 2]], [("SEG2", [[0, 1]])], space_dim=2))
    return mesh, '[[rigid]]\ngroup = "b"\nux = 0.0\nfy = -1.0\n' + more


def test_a_rigid_surface_without_mass_is_refused():
    mesh, sections = plate("")
    with pytest.raises(CaseError, match=r"'b' moves freely under its loads and has no mass; give its mass, or hold it"):
        modes_of(mesh, text(sections=sections), 2)
    mesh, sections = plate("mass = 2.0\nmoment = 0.0\n")
    with pytest.raises(CaseError, match=r"'b' moves freely under its loads and has no inertia; give its inertia"):
        modes_of(mesh, text(sections=sections), 2)


def test_a_rigid_surface_with_mass_on_a_spring_is_an_oscillator():
    """A plate on springs at its ends, 3 apart: f = sqrt(k / m) / 2 pi along y, sqrt(k_t / J) / 2 pi in rotation."""
    mesh, sections = plate("mass = 2.0\ninertia = 5.0\nmoment = 0.0\n")
    ends = "".join(f"[[spring]]\nat = [{x}, 2.0]\nky = 1e-4\n" for x in (0.0, 3.0))
    modes = modes_of(mesh, text(sections=sections + ends), 2)
    expected = np.sqrt(np.array([2e-4 / 2.0, 2 * 1e-4 * 1.5**2 / 5.0])) / (2 * np.pi)
    assert modes.frequencies == pytest.approx(np.sort(expected), rel=1e-10)
    assert modes.mass == pytest.approx(2.0 + DENSITY, rel=1e-12) and len(modes.rigid) == 3
    assert sorted(modes.effective_masses[:, 1]) == pytest.approx([0.0, 2.0], abs=1e-9)


@pytest.mark.parametrize(
    ("case", "error", "says"),
    [
        (
            text(density=0.0),
            DataError,
            r"9 cells have no density: .*; a mass needs the density of their \[\[material\]\]",
        ),
        (text(sections=hold(all="ux uy")), DataError, "nothing can vibrate: all displacements are prescribed"),
        (text(sections='[solver]\nbackend = "multigrid"\n'), RequestError, 'take .* "auto" in place of "multigrid"'),
        (text(sections='[solver]\nengine = "petsc"\n'), RequestError, "by one process, not with PETSc"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_sentence(case, error, says):
    mesh = block("QUAD4", 3)
    mesh = replace(mesh, node_groups={**mesh.node_groups, "all": np.arange(mesh.n_nodes)})
    with pytest.raises(error, match=says):
        modes_of(mesh, case, 2)


def test_a_mechanism_is_refused_with_its_place():
    points = [[0, 0], [1, 0], [1, 1], [0, 1], [2, 1], [2, 2], [1, 2]]
    hinge = with_groups(Mesh.create(points, [("QUAD4", [[0, 1, 2, 3], [2, 4, 5, 6]])], space_dim=2))
    with pytest.raises(SingularError, match="a part of the body can move without any force, most of all node"):
        modes_of(hinge, text(sections=hold(x0="ux uy")), 1)
    assert moved(hinge) is not hinge


def test_a_number_of_modes_without_its_name_is_no_mesh_beside_a_problem():
    problem = Problem.of(
        parse_case('mesh = "m"\nmodel = "plane_stress"\n[[material]]\nyoung = 4.0\npoisson = 0.0\ndensity = 1.0\n'),
        Mesh.create([[0, 0], [1, 0], [1, 1], [0, 1]], [("QUAD4", [[0, 1, 2, 3]])]),
    )
    with pytest.raises(RequestError, match="count="):
        natural_modes(problem, 5)
