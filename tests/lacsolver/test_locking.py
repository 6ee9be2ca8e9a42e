"""Nearly incompressible bodies under small strains: mean dilatation of the linear laws, and what is warned of."""

from __future__ import annotations

import itertools
import warnings

import numpy as np
import pytest

from lacmesh import Mesh, cut_skin
from lacmesh.errors import DataError, LacmeshWarning
from lacsolver.bodies import small as assemble
from lacsolver.bodies.finite import NeoHookean, SaintVenantKirchhoff
from lacsolver.bodies.kinematics import kinematics_of
from lacsolver.bodies.locking import locking, nearly_incompressible, poisson_of
from lacsolver.bodies.material import Elastic, Materials, Orthotropic
from lacsolver.bodies.small import assemble_stiffness, internal_force
from lacsolver.case import parse_case
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.loads import thermal_force
from lacsolver.problem.problem import Problem
from lacsolver.results.fields import point_stress
from lacsolver.results.figures import step_figures
from lacsolver.space.space import Space
from lacsolver.validation import validate
from tests.lacsolver import plain
from tests.lacsolver.bodies import agree, tangent
from tests.lacsolver.bodies import body, distorted, mixture, one_cell, plane_mixture, rim
from tests.lacsolver.mode_cases import block, hold, modes_of, text, waves
from tests.lacsolver.rings import case_text, exact, ring
from tests.lacsolver.test_assemble import rigid, solved, uniform
from tests.samples import each_option

RUBBER = Elastic(3.0, 0.4999, expansion=2e-3, reference_temperature=20.0, mean_dilatation=True)
#: nearly incompressible: the columns of its compliance sum up to almost 0
FIBRES = dict(young=(3.0, 2.5, 2.0), poisson=(0.3499, 0.6498, 0.7081), shear=(0.9, 0.7, 0.6))
CORDS = Orthotropic(**FIBRES, axes=((2.0, 1.0), (0.0, 1.0)), expansion=(2e-3, 1e-3, 5e-4), mean_dilatation=True)
TAKES_IT = [(name, "3d") for name in ("HEXA8", "PENTA6", "PYRAM5")]
TAKES_IT += [("QUAD4", "plane_strain"), ("QUAD4", "axisymmetric")]
MODELS = ("3d", "plane_strain", "axisymmetric")
LAWS = pytest.mark.parametrize("law", [RUBBER, CORDS], ids=["elastic", "orthotropic"])
ROLLERS = hold(x0="ux", x1="ux", y0="uy", y1="uy")


def told_of(mesh, case):
    """The warnings of validation, and of the problem of a run, which are the same."""
    told = []
    for read in (lambda: validate(parse_case(case), mesh), lambda: Problem.of(parse_case(case), mesh)):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            read()
        told.append([str(w.message) for w in caught if issubclass(w.category, LacmeshWarning)])
    assert told[0] == told[1]
    return told[0]


def solution(mesh, case):
    """The radial displacements of the nodes of the inner skin."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LacmeshWarning)
        *_, state = march(Problem.of(parse_case(case), mesh))
    inner = np.unique(mesh.blocks[-1].nodes)
    return np.linalg.norm(state.u.reshape(mesh.n_nodes, -1)[inner], axis=1)


# ---- the answer


#: name, model, cells, radial cells, and the relative error that is allowed
RINGS = [
    ("QUAD4", "plane_strain", 8, 0, 0.01),
    ("QUAD4", "axisymmetric", 8, 0, 0.03),
    ("HEXA8", "3d", 6, 0, 0.01),
    ("PENTA6", "3d", 6, 2, 0.01),
]


@pytest.mark.parametrize("case, poisson", each_option(itertools.product(RINGS, (0.499, 0.4999))))
def test_a_ring_and_a_sphere_under_pressure(case, poisson):
    """Without mean dilatation QUAD4 gives 0.71 and 0.20 of the ring's displacement, and HEXA8 0.39 and 0.06."""
    name, model, n, radial, within = case
    found = solution(ring(name, n, radial), case_text(model, poisson))
    assert np.abs(found / exact(poisson, model == "axisymmetric") - 1).max() < within


@pytest.mark.parametrize("model", ["plane_strain", "3d"])
def test_an_orthotropic_ring_of_isotropic_constants_is_the_isotropic_one(model):
    poisson = 0.4999
    same = f"young = [1.0, 1.0, 1.0]\npoisson = [{poisson}, {poisson}, {poisson}]\n"
    same += f"shear = [{', '.join([repr(0.5 / (1 + poisson))] * 3)}]\n"
    mesh = ring("QUAD4", 4) if model == "plane_strain" else ring("HEXA8", 3)
    found = solution(mesh, case_text(model, poisson, same, "orthotropic"))
    np.testing.assert_allclose(found, solution(mesh, case_text(model, poisson)), rtol=1e-9)


def test_frequencies_of_a_nearly_incompressible_body():
    """The first mode of a square on rollers keeps the volume: its frequency is that of transverse waves."""
    case = text(sections=ROLLERS, poisson=0.4999)
    exact = waves(poisson=0.4999)[1] * np.sqrt(2) / 2
    coarse, fine = (modes_of(block("QUAD4", n), case, 1).frequencies[0] / exact - 1 for n in (4, 8))
    assert 0 < fine < 0.02 and np.log2(coarse / fine) > 1.9
    assert modes_of(block("HEXA8", 4, "3d"), text("3d", hold(x0="ux", x1="ux", y0="uy", y1="uy", z0="uz", z1="uz"),
                    poisson=0.4999), 1).frequencies[0] == pytest.approx(exact, rel=0.06)  # fmt: skip


# ---- stiffness, forces, stress and energy agree


@pytest.mark.parametrize(("name", "model"), TAKES_IT)
@LAWS
def test_stiffness_equals_its_textbook_twin(name, model, law):
    space = Space.of(distorted(body(name, 2), 0.04), model)
    materials = Materials.of(space, law)
    K, twin = assemble_stiffness(space, materials), plain.stiffness(space, materials, mean=True)
    assert abs(K - twin).max() < 2e-14 * abs(twin).max()
    assert agree(K, K.T)
    assert abs(K - plain.stiffness(space, materials)).max() > 0.02 * abs(twin).max()


@pytest.mark.parametrize(("name", "model"), TAKES_IT)
def test_stiffness_is_the_tangent_of_the_neo_hookean_law_at_rest(name, model):
    space = Space.of(distorted(body(name, 2), 0.04), model)
    K = assemble_stiffness(space, Materials.of(space, Elastic(3.0, 0.49, mean_dilatation=True)))
    rubber = Materials.of(space, NeoHookean(3.0, 0.49, mean_dilatation=True))
    assert abs(K - tangent(space, rubber, np.zeros(space.n_dof))).max() < 1e-14 * abs(K).max()


@pytest.mark.parametrize(("name", "model"), TAKES_IT)
@pytest.mark.parametrize("distortion", [0.0, 0.12])
@LAWS
def test_one_cell_has_no_mode_without_energy_but_the_rigid_ones(name, model, distortion, law):
    space = Space.of(one_cell(name, distortion), model)
    K = assemble_stiffness(space, Materials.of(space, law)).toarray()
    values = np.linalg.eigvalsh(K)
    assert (values < 1e-10 * values[-1]).sum() == rigid(space).shape[1]
    assert np.abs(K @ rigid(space)).max() < 1e-12 * np.abs(K).max()


@pytest.mark.parametrize("model", MODELS)
@LAWS
@pytest.mark.usefixtures("every_thread")
def test_forces_stress_and_energy_belong_to_the_stiffness(model, law):
    """Thermal forces too, of a temperature that varies within a cell: the energy's derivative is K u - f."""
    space = Space.of(distorted(mixture("1") if model == "3d" else plane_mixture("1"), 0.05), model)
    materials = Materials.of(space, law)

    def warm(points, t):
        return 30.0 + 10.0 * points[:, 0] ** 2

    K, f = assemble_stiffness(space, materials), thermal_force(space, materials, warm)
    body = kinematics_of("small", space, materials, temperature=warm)
    rng = np.random.default_rng(0)
    u, v = 1e-2 * rng.normal(size=(2, space.n_dof))
    at_u = internal_force(space, materials, u, temperature=warm)
    np.testing.assert_allclose(at_u, K @ u - f, rtol=0, atol=1e-12 * np.abs(K @ u).max())
    work = v @ (K @ u - f) + 0.5 * v @ (K @ v)
    assert body.energy(u + v, 1.0) - body.energy(u, 1.0) == pytest.approx(work, rel=1e-9)
    assert agree(internal_force(space, materials, u, temperature=warm, threads=3), at_u)
    for threads in (2, 5):
        assert agree(assemble_stiffness(space, materials, threads=threads), K)


@pytest.mark.parametrize(
    ("model", "law"), [*((model, RUBBER) for model in MODELS), ("3d", CORDS), ("plane_strain", CORDS)]
)
def test_patch_test_of_distorted_cells(model, law):
    """A uniform strain in a mixture of cells: the solution and its stress are exact."""
    mesh = mixture("1") if model == "3d" else plane_mixture("1")
    free = ~np.repeat(rim(mesh), 3 if model == "3d" else 2)
    space = Space.of(distorted(mesh, 0.05), model)
    materials = Materials.of(space, law)
    u, strain = uniform(space)
    found = solved(assemble_stiffness(space, materials).tocsc(), u, free, np.zeros_like(u))
    assert np.abs(found - u).max() < 1e-10 * np.abs(u).max()
    wanted = materials.tables[0][0] @ strain
    for stress in assemble.stress(space, materials, found):
        np.testing.assert_allclose(stress, np.broadcast_to(wanted, stress.shape), atol=1e-9 * np.abs(wanted).max())


@pytest.mark.parametrize("model", ["3d", "axisymmetric"])
def test_free_thermal_expansion_is_free_of_stress(model):
    space = Space.of(distorted(mixture("1") if model == "3d" else plane_mixture("1"), 0.05), model)
    materials = Materials.of(space, RUBBER)
    u = (RUBBER.expansion * 100.0 * space.mesh.points[:, : space.dim]).ravel()
    K = assemble_stiffness(space, materials)
    assert np.abs(K @ u - thermal_force(space, materials, 120.0)).max() < 1e-12 * np.abs(K @ u).max()
    for stress in assemble.stress(space, materials, u, temperature=120.0):
        assert np.abs(stress).max() < 1e-8 * RUBBER.young


def test_what_varies_in_a_cell_gives_no_pressure_that_does():
    """A temperature that varies along a free bar of rubber strains it, without a pressure in every cell."""
    mesh = Mesh.create(body("HEXA8", 4).points * [8, 1, 1], body("HEXA8", 4).blocks)
    space = Space.of(mesh, "3d")
    materials = Materials.of(space, RUBBER)

    def warm(points, t):
        return 20.0 + points[:, 0]

    pressure = [
        s[..., :3].mean(axis=2) for s in assemble.stress(space, materials, np.zeros(space.n_dof), temperature=warm)
    ]
    assert np.ptp(pressure[0], axis=1).max() < 1e-12 * np.abs(pressure[0]).max()


def test_cells_that_do_not_take_it_are_as_they_are():
    plane = ("TRIA3", "plane_strain"), ("QUAD8", "axisymmetric"), ("QUAD4", "plane_stress")
    for name, model in (("TETRA4", "3d"), *plane):
        space = Space.of(one_cell(name, 0.05), model)
        pair = [assemble_stiffness(space, Materials.of(space, Elastic(3.0, 0.49, mean_dilatation=m))) for m in (1, 0)]
        assert agree(*pair)


# ---- who takes it


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


def test_the_law_of_saint_venant_kirchhoff_has_none():
    with pytest.raises(DataError, match="SaintVenantKirchhoff has no mean dilatation; take NeoHookean"):
        SaintVenantKirchhoff(1.0, 0.49, mean_dilatation=True)


# ---- warnings


@pytest.mark.parametrize(
    ("name", "model", "poisson", "says"),
    [
        ("TRIA3", "plane_strain", 0.46, "mesh that body with QUAD4 or quadratic cells, or take poisson = 0.45 or less"),
        ("TETRA4", "3d", 0.46, "mesh that body with HEXA8 or quadratic cells, or take poisson = 0.45 or less"),
        ("PENTA6", "3d", 0.46, "mesh that body with HEXA8 or quadratic cells"),
        ("PYRAM5", "3d", 0.46, "mesh that body with HEXA8 or quadratic cells"),
        ("QUAD8", "plane_strain", 0.49991, "take poisson = 0.4999 or less, or mesh that body with QUAD4 cells"),
        ("TRIA6", "axisymmetric", 0.49991, "take poisson = 0.4999 or less"),
        ("HEXA20", "3d", 0.4991, "take poisson = 0.499 or less, or mesh that body with HEXA8 cells"),
    ],
)
def test_cells_that_lock_are_named(name, model, poisson, says):
    mesh = ring(name, 2)
    (told,) = told_of(mesh, case_text(model, poisson))
    assert told.startswith(f"poisson = {poisson} of material 'rubber' makes {name} far too stiff: they lock; {says}")


@pytest.mark.parametrize(
    ("name", "model", "poisson"),
    [
        ("QUAD4", "plane_strain", 0.4999),
        ("HEXA8", "3d", 0.4999),
        ("TRIA3", "plane_strain", 0.45),
        ("TRIA3", "plane_stress", 0.4999),
        ("QUAD8", "plane_strain", 0.4999),
        ("TRIA6", "plane_strain", 0.49999),
        ("HEXA20", "3d", 0.499),
    ],
)
def test_cells_that_do_not_lock_are_not_warned_of(name, model, poisson):
    assert told_of(ring(name, 2), case_text(model, poisson)) == []


def test_the_advice_is_one_that_the_law_can_take():
    mesh = ring("QUAD4", 2)
    big = case_text("plane_strain", 0.46, law="saint_venant_kirchhoff", more='kinematics = "finite"\n')
    (told,) = told_of(mesh, big)
    assert 'QUAD4 far too stiff: they lock; take law = "neo_hookean" for QUAD4 cells, or mesh' in told
    assert told_of(mesh, big.replace("saint_venant_kirchhoff", "neo_hookean")) == []
    cut = cut_skin(ring("HEXA8", 2), "inner").mesh
    (told,) = told_of(cut, case_text("3d", 0.49))
    assert 'makes PYRAM5 far too stiff: they lock; where a cut made them of HEXA8 take hexa = "hexa", else mesh' in told
    assert told_of(cut_skin(ring("HEXA8", 2), "inner", hexa="hexa").mesh, case_text("3d", 0.49)) == []
    space = Space.of(mesh, "plane_strain")
    (told,) = locking(space, Materials.of(space, Elastic(1.0, 0.49)))
    assert "take mean_dilatation for QUAD4 cells" in told
    space = Space.of(body("TETRA4", 1), "3d")
    (told,) = locking(space, Materials.of(space, CORDS))
    assert told.startswith(f"the mean poisson = {poisson_of(CORDS):.6g} makes TETRA4 far too stiff")


def test_prisms_and_pyramids_lock_although_they_take_it():
    """A prism in plane strain across its axis is a TRIA3; six pyramids fill a cube."""
    for name, bound in (("PENTA6", 0.7), ("PYRAM5", 0.7)):
        assert (solution(ring(name, 4), case_text("3d", 0.4999)) / exact(0.4999)).min() < bound


def test_natural_modes_warn():
    with pytest.warns(LacmeshWarning, match="poisson = 0.49 makes TRIA3 far too stiff"):
        modes_of(block("TRIA3", 2), text(sections=ROLLERS, poisson=0.49), 1)


def test_results_take_the_stress_of_the_mean():
    """The stress of an answer is the one whose work is its energy; its trace is uniform in a cell."""
    problem = Problem.of(parse_case(case_text("plane_strain", 0.4999)), ring("QUAD4", 3))
    *_, state = march(problem)
    (stress,) = point_stress(problem, state)
    trace = stress[..., :3].sum(axis=2)
    assert np.ptp(trace, axis=1).max() < 1e-9 * np.abs(trace).max()
    f = problem.load(1.0)
    assert step_figures(problem, state).energy == pytest.approx(0.5 * f @ state.u, rel=1e-9)
