"""The patch test's stacks, its exact solution, and that its errors would be seen."""

from __future__ import annotations

from collections import Counter
from itertools import product

import numpy as np
import pytest

from lacmesh.cells import CELLS
from lacmesh.reference.quadrature import measure
from tests.samples import each_option
from verification.families import patch
from verification.families.patch import FAMILY, Press, errors, exact_displacement, exact_stress
from verification.meshes.stacks import LAYERS, PLANE_KINDS, SOLID_KINDS, block, skin, stack, tilt, tower
from verification.solving import BALANCED

KINDS = [(2, kind) for kind in PLANE_KINDS] + [(3, kind) for kind in SOLID_KINDS]
CASES = {case.name: case for case in FAMILY.cases}
FRAMES = [*((model, False) for model in ("3d", "plane_strain", "plane_stress", "axisymmetric", "ring")),
          *((model, True) for model in ("3d", "plane_strain", "plane_stress"))]  # fmt: skip


def options_of(row):
    """Model, frame, contact and distortion of a case that `row` names."""
    given = CASES[row[0]].solve.args[0]
    return given.model, ("tilted", given.tilted), given.contact, ("skew", given.skew)


def solids(mesh):
    return mesh.select(np.flatnonzero(mesh.cell_dim == mesh.space_dim))


def inner(mesh, group):
    x = mesh.points[np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(mesh.cell_groups[group])]))]
    return x[((x[:, : mesh.space_dim - 1] > 1e-9) & (x[:, : mesh.space_dim - 1] < 1 - 1e-9)).all(axis=1)]


@pytest.mark.parametrize("dim, kind", KINDS)
def test_blocks_fill_their_place_conform_and_turn_the_faces_that_they_are_named_by(dim, kind):
    mesh = block(kind, (*(3,) * (dim - 1), LAYERS), bend=0.3, skew=0.1)
    sizes = np.concatenate([measure(name, mesh.points[nodes]) for name, _, nodes in solids(mesh)])
    assert sizes.sum() == pytest.approx(1, rel=1e-12) and sizes.min() > 0
    facets = [n[:, list(f.nodes)] for name, _, n in solids(mesh) for f in CELLS[name].facets]
    times = Counter(tuple(sorted(row)) for rows in facets for row in rows.tolist())
    skins = Counter(
        tuple(sorted(r)) for g in mesh.cell_groups.values() for _, _, n in mesh.select(g) for r in n.tolist()
    )
    assert set(times.values()) == {1, 2} and Counter(f for f, count in times.items() if count == 1) == skins
    for side in (f"{'xyz'[dim - 1]}{end}" for end in "01"):
        faces = {CELLS[name].linear for name, _, _ in mesh.select(mesh.cell_groups[side])}
        name, _, face = kind.partition(" ")
        shapes = {"triangle": {"TRIA3"}, "quadrangle": {"QUAD4"}}
        mixed = {"TRIA3", "QUAD4"} if dim == 3 else {"SEG2"}
        assert faces == (mixed if name == "mixed" else shapes.get(face, faces))
        assert len(faces) == (2 if name == "mixed" and dim == 3 else 1)


def test_every_type_is_the_slave_and_the_master_of_every_other():
    for dim, kinds in ((2, PLANE_KINDS), (3, SOLID_KINDS)):
        assert {kind.split()[0] for kind in kinds} - {"mixed"} == {n for n, cell in CELLS.items() if cell.dim == dim}
        for tilted in (False, True):
            frame = [
                c.solve.args[0]
                for c in CASES.values()
                if c.name.startswith(f"{dim}d") and c.parameters["tilted"] == tilted
            ]
            assert {pair for given in frame for pair in given.pairs} == set(product(kinds, kinds))
            ways = {given.contact for given in frame if ("HEXA8", "HEXA8") in given.pairs}
            assert len(ways) == (2 if dim == 3 else 0)


def test_blocks_do_not_match():
    for how in ({}, {"skew": 0.2, "counts": (5, 4)}, {"bend": 0.3}):
        mesh = stack("HEXA8", "HEXA8", 3, **how)
        apart = np.linalg.norm(inner(mesh, "slave")[:, None] - inner(mesh, "master"), axis=2)
        assert apart.size and apart.min() > 1e-3


@pytest.mark.parametrize("skew", [0.05, 0.2])
def test_distorted_stacks_are_the_peers(skew):
    """x and y of columns of nodes move by skew and -0.7 skew times 16 x (1 - x) y (1 - y), the upper the other way."""
    mesh = stack("HEXA8", "HEXA8", 3, counts=(5, 4), skew=skew)
    for group, n, way in (("slave", 5, 1), ("master", 4, -1)):
        line = np.linspace(0, 1, n + 1)[1:-1]
        x, y = (v.ravel() for v in np.meshgrid(line, line, indexing="ij"))
        bubble = way * skew * 16 * x * (1 - x) * y * (1 - y)
        wanted = np.stack([x + bubble, y - 0.7 * bubble, np.ones(len(x))], axis=1)
        np.testing.assert_allclose(*(sorted(v.round(12).tolist()) for v in (inner(mesh, group), wanted)), atol=2e-12)


@pytest.mark.parametrize("model, tilted", FRAMES)
def test_the_exact_solution_obeys_hooke_and_bears_the_pressure(model, tilted):
    given = Press((), model, tilted)
    dim = given.dim
    places = np.eye(3)[:dim]
    strain = np.zeros((3, 3))
    strain[:dim, :dim] = exact_displacement(given, places).T
    np.testing.assert_allclose(strain, strain.T, atol=1e-18)
    stress = np.zeros((3, 3))
    for value, (a, b) in zip(exact_stress(given), patch._AXES, strict=True):
        stress[a, b] = stress[b, a] = value
    if model in ("axisymmetric", "ring"):
        strain[2, 2] = strain[0, 0]
    if model == "plane_stress":
        strain[2, 2] = -patch.POISSON / (1 - patch.POISSON) * (strain[0, 0] + strain[1, 1])
    mu = patch.YOUNG / 2 / (1 + patch.POISSON)
    lame = 2 * mu * patch.POISSON / (1 - 2 * patch.POISSON)
    np.testing.assert_allclose(lame * np.trace(strain) * np.eye(3) + 2 * mu * strain, stress, atol=1e-14)
    normal = given.turn[:, dim - 1]
    np.testing.assert_allclose(stress @ normal, -patch.PRESSURE * normal, atol=1e-15)


@pytest.mark.parametrize("given", [
    Press((("QUAD4", "TRIA6"),), "plane_strain", True),
    Press((("HEXA8", "HEXA8"),), "3d", contact=(("hexa", "hexa"),), bend=0.0),
])  # fmt: skip
def test_a_press_meets_its_figures(given):
    outcome = patch.run(given, levels=1)
    assert all(result.passed for result in outcome.results) and len(outcome.results) == 5
    assert [len(line.x) for line in outcome.plots[0].lines] == [2] * 3


@pytest.mark.parametrize("name", each_option([(name,) for name in CASES], of=options_of))
def test_a_stack_of_each_case_is_exact(name):
    given = CASES[name].solve.args[0]
    check(errors(given, *given.pairs[len(name) % len(given.pairs)], len(name) % 2 == 0))


@pytest.mark.parametrize("way", ["pyramid", "hexa"])
@pytest.mark.parametrize("geometry", ["reference", "current"])
def test_smoothed_normals_of_distorted_quadrangles_are_integrated_as_exactly(way, geometry):
    contact = (("hexa", way), ("geometry", geometry), ("normals", "smoothed"))
    check(errors(Press((), contact=contact, skew=0.2), "HEXA8", "HEXA8", True))


def check(one):
    assert max(one.errors.values()) <= patch.EXACT, one
    assert max(one.solved.balance) <= BALANCED, one.solved.balance


def test_errors_are_seen_and_the_worst_stack_is_named(monkeypatch):
    given = Press((("QUAD4", "TRIA3"),), "plane_strain")
    made = errors(given, "QUAD4", "TRIA3", True)
    monkeypatch.setattr(patch, "POISSON", 0.31)
    (zone,) = made.solved.state.zones
    zone.pressure[0] *= 1 + 1e-6
    monkeypatch.setattr(patch, "solve", lambda *_: made.solved)
    wrong = errors(given, "QUAD4", "TRIA3", True)
    assert min(wrong.errors[patch.STRESS], wrong.errors[patch.DISPLACEMENT]) > 1e-3
    assert wrong.errors[patch.PRESSURES] == pytest.approx(1e-6, rel=1e-6)
    for quantity in made.errors:
        lost = made._replace(label="lost", errors={**made.errors, quantity: np.nan})
        result = patch.worst(quantity, [wrong, lost, made])
        assert not result.passed and result.reason.endswith("lost")


def test_peers_are_told_where_they_ran_the_same_problem():
    told = {name: patch._published(case.solve.args[0]) for name, case in CASES.items()}
    assert {name for name, published in told.items() if published.get(patch.PRESSURES)} == {
        f"peers-{way}-skew-{skew}" for way in ("pyramid", "hexa") for skew in (0.0, 0.05, 0.2)
    }
    distorted = told["peers-hexa-skew-0.2"]
    assert distorted[patch.PRESSURES][0].value == 5.5e-3 and not distorted[patch.STRESS]
    assert len(told["peers-pyramid-skew-0.05"][patch.STRESS]) == 8


def test_towers_skins_and_rotations():
    mesh = tower(("HEXA8", "TETRA4", "PENTA6 quadrangle"), (2, 3, 2))
    assert {"slave1", "master1", "slave2", "master2", "bottom", "top", "body0", "body2"} <= set(mesh.cell_groups)
    assert set(mesh.points[np.unique(mesh.block("TETRA4"))][:, 2]) == {1, 1.5, 2}
    bare = skin(mesh, "master1")
    assert bare.cells_by_type == {"QUAD4": 4} and bare.n_nodes == 9
    for dim in (2, 3):
        np.testing.assert_allclose(tilt(dim) @ tilt(dim).T, np.eye(3), atol=1e-15)
        assert np.linalg.det(tilt(dim)) == pytest.approx(1) and tilt(dim)[1, 0] != pytest.approx(0)
