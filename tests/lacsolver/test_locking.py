"""Laws near the ends of their range: mean dilatation of nearly incompressible bodies, and bodies that are crushed.

Mean dilatation of linear and finite laws: twins, differences, no locking, who takes it; cells that lock are warned of.
Bodies of the law of Saint Venant-Kirchhoff that are crushed are warned of, with stretch, place and time."""

import itertools
import warnings
from dataclasses import replace

import numpy as np
import pytest

from lacmesh import cut_skin
from lacmesh.cells import CELLS
from lacmesh.errors import DataError, LacmeshWarning
from lacmesh.generate import ring
from lacsolver.bodies import small as assemble
from lacsolver.bodies.hyperelastic import NeoHookean, SaintVenantKirchhoff
from lacsolver.bodies.kinematics import kinematics_of
from lacsolver.bodies.locking import nearly_incompressible, poisson_of
from lacsolver.bodies.material import Elastic, Materials, Orthotropic
from lacsolver.bodies.plastic import Plastic
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.bodies.temperature import warming
from lacsolver.case import Material, Pressure, Solver, Steps, Temperature
from lacsolver.doubts.materials import LARGEST, most_compressed, softened, too_stiff, worse
from lacsolver.doubts.rules import Doubts
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.output import create_output
from lacsolver.problem.laws import law_of
from lacsolver.problem.loads import thermal_force
from lacsolver.problem.problem import Problem
from lacsolver.results.fields import point_stress
from lacsolver.results.figures import step_figures
from lacsolver.running import run
from lacsolver.space.space import Space
from lacsolver.validation import validate
from tests.lacsolver import plain
from tests.lacsolver.bodies import (
    agree,
    body,
    cauchy_stress,
    distorted,
    first_piola,
    force_and_tangent,
    internal_force,
    made,
    mixed,
    mixture,
    one_cell,
    stored_energy,
    tangent,
)
from tests.lacsolver.held import with_sides
from tests.lacsolver.mode_cases import block, modes_of
from tests.lacsolver.test_finite import by_differences, shaken
from tests.problems import case_of, fix, move
from tests.samples import each_option

SOFT = Elastic(3.0, 0.4999, expansion=2e-3, reference_temperature=20.0, mean_dilatation=True)
#: nearly incompressible: the columns of its compliance sum up to almost 0
FIBRES = dict(young=(3.0, 2.5, 2.0), poisson=(0.3499, 0.6498, 0.7081), shear=(0.9, 0.7, 0.6))
CORDS = Orthotropic(**FIBRES, axes=((2.0, 1.0), (0.0, 1.0)), expansion=(2e-3, 1e-3, 5e-4), mean_dilatation=True)
RUBBER = NeoHookean(3.0, 0.49, mean_dilatation=True)
METAL = Plastic(1000.0, 0.3, hardening=((2.0, 0.0),), kinematic=50.0)
WARM = NeoHookean(3.0, 0.2, expansion=2e-3, reference_temperature=20.0, mean_dilatation=True)
TAKES_IT = [(name, "3d") for name in ("HEXA8", "PENTA6", "PYRAM5")]
TAKES_IT += [("QUAD4", "plane_strain"), ("QUAD4", "axisymmetric")]
TAKES_IT = pytest.mark.parametrize(("name", "model"), TAKES_IT)
LAWS = pytest.mark.parametrize("law", [SOFT, CORDS], ids=["elastic", "orthotropic"])
MODELS = ("3d", "plane_strain", "axisymmetric")


def tube(name, n=2):
    """A quarter of a ring or tube of rubber, 1 <= r <= 2."""
    mesh = ring(n, kind=name, angle=90).renamed(body="rubber", start="y0", end="x0")
    return mesh.renamed(bottom="z0", top="z1") if CELLS[name].dim == 3 else mesh


def case_on(mesh, model, poisson, law="elastic", **keys):
    """The case of a tube with young = 1 under an inner pressure of 1, by symmetry; `keys`: at the top of a case."""
    rubber = Material(law=law, groups=["rubber"], young=1.0, poisson=poisson)
    held = fix("y0", "y"), fix("x0", "x"), *([fix("z0", "z"), fix("z1", "z")] if model == "3d" else [])
    return case_of(mesh, rubber, *held, Pressure(group="inner", value=1.0), model=model, **keys)


def told_of(mesh, *given, **keys):
    """The warnings of validation, and of the problem of a run, which are the same."""
    case, told = case_on(mesh, *given, **keys), []
    for read in (lambda: validate(case), lambda: Doubts(Problem.of(case)).ask("undeformed")):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            read()
        told.append([str(w.message) for w in caught if issubclass(w.category, LacmeshWarning)])
    assert told[0] == told[1]
    return told[0]


@TAKES_IT
@LAWS
def test_stiffness_equals_its_textbook_twin(name, model, law):
    space = Space.of(distorted(body(name, 2), 0.04), model)
    materials = Materials.of(space, law)
    K, twin = assemble_stiffness(space, materials), plain.stiffness(space, materials, mean=True)
    assert abs(K - twin).max() < 2e-14 * abs(twin).max()
    assert agree(K, K.T)
    assert abs(K - plain.stiffness(space, materials)).max() > 0.02 * abs(twin).max()
    K = assemble_stiffness(space, Materials.of(space, Elastic(3.0, 0.49, mean_dilatation=True)))
    rest = tangent(space, Materials.of(space, RUBBER), np.zeros(space.n_dof))
    assert abs(K - rest).max() < 1e-14 * abs(K).max(), "the law of finite strains at rest"


@pytest.mark.parametrize("model", MODELS)
@LAWS
@pytest.mark.usefixtures("every_thread")
def test_forces_stress_and_energy_belong_to_the_stiffness(model, law):
    """Thermal forces too, of a temperature that varies within a cell: the energy's derivative is K u - f."""
    space, materials = made(mixed("1", model), model, law)

    def warm(points, t):
        return 30.0 + 10.0 * points[:, 0] ** 2

    K, f = assemble_stiffness(space, materials), thermal_force(space, materials, warm)
    body = kinematics_of("small", space, materials, temperature=warm)
    rng = np.random.default_rng(0)
    u, v = 1e-2 * rng.normal(size=(2, space.n_dof))
    at_u = assemble.internal_force(space, materials, u, temperature=warm)
    np.testing.assert_allclose(at_u, K @ u - f, rtol=0, atol=1e-12 * np.abs(K @ u).max())
    work = v @ (K @ u - f) + 0.5 * v @ (K @ v)
    assert body.energy(u + v, 1.0) - body.energy(u, 1.0) == pytest.approx(work, rel=1e-9)
    assert agree(assemble.internal_force(space, materials, u, temperature=warm, threads=3), at_u)
    for threads in (2, 5):
        assert agree(assemble_stiffness(space, materials, threads=threads), K)


def test_what_varies_in_a_cell_gives_no_pressure_that_does():
    """A temperature that varies along a free bar of rubber strains it, without a pressure in every cell."""
    space, materials = made(body("HEXA8", 4, (0, 0, 0), (8, 1, 1)), "3d", SOFT)
    varied = lambda points, t: 20.0 + points[:, 0]  # noqa: E731
    (stress,) = assemble.stress(space, materials, np.zeros(space.n_dof), temperature=varied)
    pressure = stress[..., :3].mean(axis=2)
    assert np.ptp(pressure, axis=1).max() < 1e-12 * np.abs(pressure).max()


def test_results_take_the_stress_of_the_mean():
    """The stress of an answer is the one whose work is its energy; its trace is uniform in a cell."""
    problem = Problem.of(case_on(tube("QUAD4", 3), "plane_strain", 0.4999))
    *_, state = march(problem)
    (stress,) = point_stress(problem, state)
    trace = stress[..., :3].sum(axis=2)
    assert np.ptp(trace, axis=1).max() < 1e-9 * np.abs(trace).max()
    f = problem.load(1.0)
    assert step_figures(problem, state).energy == pytest.approx(0.5 * f @ state.u, rel=1e-9)


# ---- finite strains


def without(space, law):
    """The law without mean dilatation."""
    return Materials.of(space, NeoHookean(law.young, law.poisson))


@pytest.mark.rows("rubber-QUAD4-axisymmetric", "soft-PYRAM5-3d")
@TAKES_IT
@pytest.mark.parametrize(("law", "theta"), [(RUBBER, 1.0), (WARM, 1.0), (WARM, 1.2)], ids=["rubber", "soft", "warm"])
def test_forces_equal_their_twin_and_the_tangent_is_their_derivative(name, model, law, theta):
    space, materials = made(one_cell(name, 0.1), model, law)
    how = {} if theta == 1 else {"warmer": warming(space, materials, 120.0)}
    u = shaken(space, 0.05)
    f, K = force_and_tangent(space, materials, u, **how)
    twin, energy = plain.mean_force(space, materials, u, theta)
    np.testing.assert_allclose(f, twin, rtol=0, atol=1e-12 * np.abs(twin).max())
    assert stored_energy(space, materials, u, **how) == pytest.approx(energy, rel=1e-12)
    expected = by_differences(lambda v: internal_force(space, materials, v, **how), u, 1e-4)
    np.testing.assert_allclose(K.toarray(), expected, rtol=0, atol=1e-9 * abs(K).max())
    assert agree(K, K.T)
    if theta > 1 and model != "plane_strain":
        free = (0.2 * space.mesh.points[:, : space.dim]).ravel()
        assert np.abs(internal_force(space, materials, free, **how)).max() < 1e-13
        assert max(np.abs(sigma).max() for sigma in cauchy_stress(space, materials, free, **how)) < 1e-13
    if theta > 1:
        return
    assert np.abs(f - internal_force(space, without(space, law), u)).max() > 1e-3 * np.abs(f).max()
    by_stress = np.zeros_like(f)
    for P, (name, nodes, _) in zip(first_piola(space, materials, u), space.blocks, strict=True):
        D, W = plain.variations(space, name, nodes)
        np.add.at(by_stress.reshape(-1, space.dim), nodes, np.einsum("cqsi,cqsiat,cq->cat", P, D, W))
    np.testing.assert_allclose(by_stress, f, rtol=0, atol=1e-12 * np.abs(f).max())


# ---- who takes it


def test_cells_that_do_not_take_it_are_as_they_are():
    plane = ("TRIA3", "plane_strain"), ("QUAD8", "axisymmetric"), ("QUAD4", "plane_stress")
    for name, model in (("TETRA4", "3d"), *plane):
        space = Space.of(one_cell(name, 0.05), model)
        pair = [assemble_stiffness(space, Materials.of(space, Elastic(3.0, 0.49, mean_dilatation=m))) for m in (1, 0)]
        assert agree(*pair)
        u = shaken(space, 0.05)
        f = internal_force(space, Materials.of(space, RUBBER), u)
        assert agree(f, internal_force(space, without(space, RUBBER), u))


def test_a_case_takes_it_where_the_law_is_nearly_incompressible():
    assert law_of(Material(law="neo_hookean", young=1.0, poisson=0.49)).mean_dilatation
    assert not law_of(Material(law="neo_hookean", young=1.0, poisson=0.4)).mean_dilatation
    with pytest.raises(DataError, match="no mean dilatation"):
        SaintVenantKirchhoff(1.0, 0.49, mean_dilatation=True)


def test_a_law_of_isotropic_constants_has_their_poisson():
    for poisson in (-0.3, 0.0, 0.3, 0.45, 0.4999):
        E, G = 7.0, 3.5 / (1 + poisson)
        law = Orthotropic((E,) * 3, (poisson,) * 3, (G,) * 3, axes=((1.0, 2.0, 0.3), (0.0, 1.0, 1.0)))
        assert poisson_of(law) == pytest.approx(poisson, abs=1e-12)
        assert nearly_incompressible(law) == (poisson > 0.45)
    stiff = {name: tuple(1.1e7 * v for v in FIBRES[name]) for name in ("young", "shear")}
    assert poisson_of(Orthotropic(**(FIBRES | stiff))) == pytest.approx(poisson_of(CORDS), abs=1e-12)
    assert nearly_incompressible(CORDS)
    assert not nearly_incompressible(Orthotropic((140.0, 10.0, 10.0), (0.3, 0.3, 0.5), (5.0, 5.0, 3.4)))


# ---- warnings


#: cells, model, Poisson's ratio, and the advice, if they lock; SVK: the law of Saint Venant-Kirchhoff
ADVICE = [
    ("TRIA3", "plane_strain", 0.46, "with QUAD4 or quadratic cells, or take poisson = 0.45"),
    ("TETRA4", "3d", 0.46, "with HEXA8 or quadratic cells, or take poisson = 0.45"),
    ("PENTA6", "3d", 0.46, "with HEXA8 or quadratic cells"),
    ("PYRAM5", "3d", 0.46, "with HEXA8 or quadratic cells"),
    ("QUAD8", "plane_strain", 0.49991, "poisson = 0.4999 or less, or mesh that body with QUAD4"),
    ("TRIA6", "axisymmetric", 0.49991, "poisson = 0.4999 or less"),
    ("HEXA20", "3d", 0.4991, "poisson = 0.499 or less, or mesh that body with HEXA8"),
    ("QUAD4", "plane_strain", 0.4999, ""),
    ("HEXA8", "3d", 0.4999, ""),
    ("TRIA3", "plane_strain", 0.45, ""),
    ("TRIA3", "plane_stress", 0.4999, ""),
    ("QUAD8", "plane_strain", 0.4999, ""),
    ("TRIA6", "plane_strain", 0.49999, ""),
    ("HEXA20", "3d", 0.499, ""),
]


@pytest.mark.parametrize(("name", "model", "poisson", "advice"), ADVICE)
def test_cells_that_lock_are_named(name, model, poisson, advice):
    told = told_of(tube(name), model, poisson)
    assert len(told) == bool(advice)
    assert all(f"of material 'rubber' makes {name}" in one and advice in one for one in told)


def test_the_advice_is_one_that_the_law_can_take():
    mesh = tube("QUAD4")
    (told,) = told_of(mesh, "plane_strain", 0.46, "saint_venant_kirchhoff", kinematics="finite")
    assert 'law = "neo_hookean" for QUAD4' in told
    assert told_of(mesh, "plane_strain", 0.46, "neo_hookean", kinematics="finite") == []
    cut = cut_skin(tube("HEXA8"), "inner").mesh
    (told,) = told_of(cut, "3d", 0.49)
    assert "makes PYRAM5" in told and 'hexa = "hexa"' in told
    assert told_of(cut_skin(tube("HEXA8"), "inner", hexa="hexa").mesh, "3d", 0.49) == []
    for solid, law, words in (
        (mesh, Elastic(1.0, 0.49), "take mean_dilatation for QUAD4"),
        (body("TETRA4", 1), CORDS, f"mean poisson = {poisson_of(CORDS):.6g} makes TETRA4"),
        (mixture(), NeoHookean(1.0, 0.49), " makes TETRA4, HEXA8, PENTA6, PYRAM5 far"),
        (mixture(), RUBBER, " makes TETRA4, PENTA6, PYRAM5 far"),
        (mixture(), NeoHookean(1.0, 0.45), ""),
        (mixture("2"), RUBBER, ""),
        (body("TRIA3", 2), METAL, 'law = "plastic" makes TRIA3'),
        (body("QUAD4", 2), METAL, ""),
        (body("QUAD8", 2), METAL, ""),
    ):
        space = Space.of(solid, "3d" if solid.space_dim == 3 else "plane_strain")
        told = list(too_stiff(space, Materials.of(space, law)))
        assert len(told) == bool(words) and all(words in one for one in told)
        assert law is not METAL or all("poisson" not in one for one in told)
    with pytest.warns(LacmeshWarning, match="makes TRIA3"):
        modes_of(block("TRIA3", 2), fix("x0", "xy"), count=1, law=Material(young=1.0, poisson=0.49, density=1.0))


# ---- bodies that are crushed

SIDES = {"3d": "xyz", "plane_strain": "xy", "plane_stress": "xy", "axisymmetric": "y"}
CRUSHED = Material(law="saint_venant_kirchhoff", young=100.0, poisson=0.3)
SLOWLY = Steps(count=4)


def body_of(model, n=2):
    """A block or ring of height 1."""
    shift = 1.0 if model == "axisymmetric" else 0.0
    return block("HEXA8", n, "3d") if model == "3d" else block("QUAD4", n, shift=shift)


def crushed(model, down, *records, mesh=None, law=CRUSHED):
    """It stands on rollers, its top moves by `down` along its last axis, its sides are free; None: no top."""
    up = "z" if model == "3d" else "y"
    held = [fix(f"{a}0", a) for a in SIDES[model]]
    top = [] if down is None else [move(f"{up}1", **{f"u{up}": down})]
    mesh = body_of(model) if mesh is None else mesh
    return case_of(mesh, law, *held, *top, *records, model=model, kinematics="finite")


def warned(folder, case):
    """The warnings of a run, which its results have too."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        done = run(case, create_output(folder / "out", force=True))
    said = [str(w.message) for w in caught if issubclass(w.category, LacmeshWarning)]
    assert done.message == "\n".join(said)
    return said


@pytest.mark.rows("plane_strain-0.69", "axisymmetric-0.75")
@pytest.mark.parametrize(("model", "stretch"), each_option(itertools.product(SIDES, (0.75, 0.69, 0.5))))
def test_a_body_that_is_pressed(model, stretch, tmp_path):
    rubber = replace(CRUSHED, law="neo_hookean")
    assert warned(tmp_path, crushed(model, f"{stretch - 1} * t", SLOWLY, law=rubber)) == []
    said = warned(tmp_path, crushed(model, f"{stretch - 1} * t", SLOWLY))
    assert len(said) == (stretch < 0.7)
    for line in said:
        assert f"to a principal stretch of {stretch:g}, most near (" in line
        assert "at time 1; this law is meant for small strains, and below 0.577 its force falls" in line
        assert 'law = "neo_hookean"' in line


def test_the_force_is_largest_where_the_warning_says():
    """Uniaxial strain: dP/dx = 0, from the reactions of two states on either side."""
    mesh = body_of("plane_strain", 1)
    case = crushed("plane_strain", "-0.02 * t", fix("x1", "x"), Steps(count=25, end=25.0), mesh=mesh)
    problem = Problem.of(case, mesh)
    top = problem.space.mesh.points[:, 1] == 1
    forces = [-state.reaction.reshape(-1, 2)[top, 1].sum() for state in march(problem)]
    assert 1 - 0.02 * (1 + int(np.argmax(forces))) == pytest.approx(LARGEST, abs=0.01)


def test_the_worst_step_counts_and_the_material_is_named(tmp_path):
    """Pressed, and let go again; one of two materials is the softer one."""
    mesh = body_of("plane_strain", 2)
    upper = np.flatnonzero(mesh.points[mesh.blocks[0].nodes][..., 1].mean(axis=1) > 0.5)
    mesh = replace(mesh, cell_groups={"upper": upper, "lower": np.setdiff1d(np.arange(mesh.n_cells), upper)})
    stiff = replace(CRUSHED, groups=["lower"], young=1e6)
    there = "-0.25 * (1 - abs(t - 1))"
    case = crushed(
        "plane_strain", there, stiff, Steps(count=8, end=2.0), mesh=mesh, law=replace(CRUSHED, groups=["upper"])
    )
    (line,) = warned(tmp_path, case)
    assert line.startswith("material 'upper'") and " at time 1; " in line


def test_a_turned_body_is_not_compressed():
    turn = np.array([[0.0, -1], [1, 0]])
    case = crushed("plane_strain", 0.0)
    problem = Problem.of(case, case.mesh)
    (state,) = march(problem)
    x = problem.space.mesh.points[:, :2]
    for stretch in (1.0, 0.6):
        object.__setattr__(state, "u", (x @ (turn * [1.0, stretch]).T - x).ravel())
        found = most_compressed(problem, state)
        assert found[0, 0] == (pytest.approx(stretch) if stretch < 0.7 else np.inf)
    one, other = np.array([[0.6, 1.0], [np.inf, np.inf]]), np.array([[0.65, 2.0], [0.5, 2.0]])
    assert worse(one, other).tolist() == worse(other, one).tolist() == [[0.6, 1.0], [0.5, 2.0]]
    assert list(softened(problem, one[1:])) == []


def test_what_heat_alone_would_stretch_is_compressed(tmp_path):
    """A body that is held and warm: its elastic stretch is 1 / 1.6 = 0.625."""
    hot = replace(CRUSHED, expansion=6e-3)
    held = fix("x1", "x"), fix("y1", "y"), Temperature(value="100 * t"), SLOWLY
    (line,) = warned(tmp_path, crushed("plane_strain", None, *held, law=hot))
    assert "a principal stretch of 0.625, " in line


def test_a_run_that_does_not_converge_tells_what_was_crushed(tmp_path):
    """A pressure that grows to more than the largest that the law can bear, 25.9."""
    mesh = with_sides(body("QUAD4", 1, (0, 0)))
    how = (
        fix("x1", "x"),
        Pressure(group="y1", value="30 * t"),
        Steps(count=6, max_halvings=0),
        Solver(max_iterations=15),
    )
    case = crushed("plane_strain", None, *how, mesh=mesh)
    with pytest.warns(LacmeshWarning, match=r"principal stretch of 0\.66"), pytest.raises(NotConvergedError):
        run(case, create_output(tmp_path / "out"))
