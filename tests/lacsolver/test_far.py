"""Models far from the origin: input and output of a run are in the coordinates of its file."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
from lacmesh import cut_skin
from lacsolver.case import CaseError, parse_case, read_case
from lacsolver.contact import integrate
from lacsolver.equilibrium.attempt import _initial
from lacsolver.equilibrium.stepping import march
from lacsolver.matrices import contact_matrices
from lacsolver.output.folder import create_output
from lacsolver.problem.problem import Problem
from lacsolver.running import run
from lacsolver.validation import validate
from tests.lacsolver.invariant_cases import (
    CASES,
    Case,
    World,
    blocks,
    brought_back,
    contact,
    figures,
    held,
    material,
    text_of,
    two_stacks,
)
from tests.lacsolver.patch_meshes import stack

#: coordinates as on a map, in a plane z = 7; what differs there from where the model stands, relative
MAP = np.array([5e5, 5e6, 7.0])
CLOSE = 1e-11


def ran(folder, w, mesh, more):
    """The results of the plane case in a world, and its folder; `more`: sections at its end."""
    folder.mkdir()
    lacmesh.write(folder / "none.msh", mesh)
    (folder / "case.toml").write_text(text_of(CASES["plane strain"], w) + more)
    return run(read_case(folder / "case.toml"), create_output(folder / "out")), folder / "out"


@pytest.fixture(scope="module", params=["vtu", "med"])
def both(request, tmp_path_factory):
    """(results, folder) where the model stands, and on the map."""
    base = tmp_path_factory.mktemp("far")
    here = CASES["plane strain"].world
    there = replace(here, shift=MAP)
    mesh = brought_back(CASES["plane strain"], there)
    found = []
    for name, w in (("here", here), ("there", there)):
        moved = replace(mesh, points=mesh.points + w.shift)
        at = [float(x) for x in moved.points[3, :2]]
        more = f'[[probe]]\nname = "corner"\nat = {at}\n[output]\nformat = "{request.param}"\n'
        found.append(ran(base / name, w, moved, more))
    return request.param, found


def test_figures(both):
    """The moment of contact forces is about the origin of the file, whose arms are long."""
    _, ((here, _), (there, _)) = both
    one, other = here.steps[-1], there.steps[-1]
    zone, far = one.contact["slave"], other.contact["slave"]
    np.testing.assert_allclose(other.probes["corner"], one.probes["corner"], rtol=CLOSE)
    np.testing.assert_allclose(far.resultant, zone.resultant, rtol=CLOSE, atol=CLOSE * np.abs(zone.resultant).max())
    force = zone.resultant
    np.testing.assert_allclose(far.moment, zone.moment + MAP[0] * force[1] - MAP[1] * force[0], rtol=CLOSE)
    assert max(other.balance) < 1e-14


def test_tables(both):
    _, ((_, here), (_, there)) = both
    rows = [list(csv.DictReader((folder / "contact_slave.csv").read_text().splitlines())) for folder in (here, there)]
    one, other = ({name: np.array([float(r[name]) for r in part]) for name in rows[0][0]} for part in rows)
    for k, axis in enumerate("xyz"):
        np.testing.assert_allclose(other[axis], one[axis] + MAP[k], rtol=1e-15)
    for name in ("pressure", "gap", "coverage", "nx", "ny"):
        np.testing.assert_allclose(other[name], one[name], atol=CLOSE * np.abs(one[name]).max())


def test_fields(both):
    kind, ((_, here), (_, there)) = both
    files = sorted(here.rglob(f"*.{kind}"))
    assert files
    for path in files:
        one, other = (lacmesh.read(p) for p in (path, there / path.relative_to(here)))
        np.testing.assert_array_equal(other.points, one.points + MAP)


def test_clearance_is_a_formula_of_the_files_coordinates():
    case = CASES["plane strain"]
    there = replace(case.world, shift=MAP)
    mesh = brought_back(case, there)
    gaps = []
    for w in (case.world, there):
        text = text_of(case, w).replace(
            'master = "master"\n', f'master = "master"\nclearance = "{w.formula("0.01 * x + 0.02 * y")}"\n'
        )
        problem = Problem.of(parse_case(text), replace(mesh, points=mesh.points + w.shift))
        (joint,) = problem.joints
        gaps.append(integrate(joint.zone, 2, joint.pairing).gap)
    np.testing.assert_allclose(gaps[1], gaps[0], atol=1e-14)


# ---- lengths of macro-elements are true ones


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3], ids=["km", "m", "mm"])
@pytest.mark.parametrize("model, head", [("plane_stress", "thickness = {}\n"), ("axisymmetric", ""), ("3d", "")])
def test_an_overlap_that_is_prescribed_is_refused_in_every_unit(model, head, unit):
    """The area of a macro-element holds the thickness, or 2 pi r; its length does not."""
    dim = 3 if model == "3d" else 2
    w = World(dim, length=unit)
    mesh = stack("QUAD4", "QUAD4", 2, shift=(50, 0, 0)) if dim == 2 else stack("HEXA8", "HEXA8", 3)
    text = f'mesh = "none.msh"\nmodel = "{model}"\n{head.format(100.0 * unit)}' + material(w)
    text += contact(w) + held(w, "lower") + held(w, "upper", np.eye(3)[dim - 1] * -1e-5)
    with pytest.raises(CaseError, match="macro-elements overlap by up to"):
        list(march(Problem.of(parse_case(text), replace(mesh, points=unit * mesh.points))))


def test_a_gap_that_is_not_closed_in_millimetres():
    """`initial = "gap"` asks whether a macro-element touches; one that is thick touches no sooner."""
    w = World(2, length=1e3)
    mesh = stack("QUAD4", "QUAD4", 2, gap=1e-4)
    text = 'mesh = "none.msh"\nmodel = "plane_stress"\nthickness = 1e6\n' + material(w)
    text += contact(w) + held(w, "bottom") + held(w, "top")
    problem = Problem.of(parse_case(text), replace(mesh, points=1e3 * mesh.points))
    (joint,) = problem.joints
    assert not _initial(joint, integrate(joint.zone, 2, joint.pairing)).any()


# ---- what is said


def test_places_are_told_with_the_digits_that_tell_them_apart():
    w = World(2, shift=MAP)
    mesh = stack("QUAD4", "QUAD4", 2)
    text = 'mesh = "none.msh"\nmodel = "plane_strain"\n' + material(w) + contact(w)
    text += held(w, "lower") + held(w, "upper", (0.0, -0.01, 0.0))
    with pytest.raises(CaseError, match=r"most near \(500000\.\d+, 5000001\)"):
        list(march(Problem.of(parse_case(text), replace(mesh, points=mesh.points + MAP))))


def test_a_place_without_a_node_and_a_name_that_is_one_of_two():
    w = World(2, shift=MAP)
    mesh = replace(stack("QUAD4", "QUAD4", 2), node_groups={})
    there = replace(mesh, points=mesh.points + MAP)
    text = 'mesh = "none.msh"\nmodel = "plane_strain"\n' + material(w) + contact(w) + held(w, "bottom")
    places = [[5e5, 5000002.0], [500001.0, 5000002.0]]
    ends = "".join(f"[[displacement]]\nat = {at}\nuy = -0.01\n" for at in places)
    problem = Problem.of(parse_case(text + ends), there)
    assert list(problem.constraints.names) == ["bottom", *(f"at [{x:.0f}, {y:.0f}]" for x, y in places)]
    with pytest.raises(CaseError, match=r"no node at \[500000\.4, 5000002\]; the nearest is node \d+ at \[5000"):
        Problem.of(parse_case(text + "[[displacement]]\nat = [500000.4, 5000002.0]\nuy = 0\n"), there)


# ---- elsewhere in the solver


def pressed(w):
    """Blocks pressed from above, all of whose nodes at the ends are held."""
    return material(w) + contact(w) + held(w, "bottom") + held(w, "top", (0.004, -0.03, 0.0))


@pytest.mark.parametrize("radius", [1e3, 1e5, 1e7])
def test_a_wide_ring_is_in_plane_strain(radius):
    """About an axis so far away, forces a length are those of plane strain, but for the part that the model is wide."""
    make = blocks("QUAD8", "TRIA3", 2, shift=(radius, 0, 0))
    flat = replace(make(), points=make().points - np.array([radius, 0.0, 0.0]))
    ring, plane = (
        figures(Case(mesh, model, pressed), World(2, model == "axisymmetric"))
        for mesh, model in ((make, "axisymmetric"), (lambda: flat, "plane_strain"))
    )
    one, other = (f.values[0, "slave", "pressure"] for f in (ring, plane))
    assert ring.iterations == plane.iterations
    np.testing.assert_array_equal(ring.values[0, "slave", "status"], plane.values[0, "slave", "status"])
    assert np.abs(one - other).max() <= (0.2 / radius + 1e-14 * radius) * other.max()


@pytest.mark.parametrize("dim", [2, 3])
def test_contact_matrices(dim):
    mesh = stack(*{2: ("QUAD8", "TRIA3"), 3: ("HEXA8", "TETRA4")}[dim], dim, skew=0.1, gap=0.01)
    shift = np.array([5e5, 5e6, 0.0])
    there = cut_skin(replace(mesh, points=mesh.points + shift), "slave").mesh
    here = replace(there, points=there.points - shift)
    one, other = (contact_matrices(m, "slave", "master") for m in (here, there))
    for name in ("G", "w", "area", "coverage", "normal"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=0, atol=1e-9)
    np.testing.assert_allclose(other.centre, one.centre + shift[:dim], rtol=1e-15)
    assert np.abs((other.B - one.B).data).max(initial=0.0) < 1e-9


def test_parts_of_a_model_that_lie_far_from_each_other():
    """Each zone is measured from a point of its own."""
    kinds, far = (("QUAD4", "TRIA3"), ("TRIA6", "QUAD4")), np.array([1e6, -7e5, 0.0])
    apart = two_stacks(kinds, far)()
    second = apart.points[:, 0] > far[0] / 2
    near = replace(apart, points=np.where(second[:, None], apart.points - far + [3.0, 0.0, 0.0], apart.points))
    one, other = (figures(CASES["two zones"]._replace(mesh=lambda m=m: m), World(2)) for m in (near, apart))
    assert one.iterations == other.iterations
    for name in ("slave0", "slave1"):
        p, q = (f.values[0, name, "pressure"] for f in (one, other))
        np.testing.assert_allclose(q, p, atol=5e-9 * p.max())


def test_validation():
    found = []
    for w in (World(2), World(2, shift=MAP)):
        mesh = brought_back(CASES["plane strain"], World(2, shift=MAP))
        made = validate(parse_case(text_of(CASES["plane strain"], w)), replace(mesh, points=mesh.points + w.shift))
        assert not made.problems
        found.append(made.zones[0])
    one, other = found
    assert (other.macros, other.unpaired) == (one.macros, one.unpaired)
    np.testing.assert_allclose([other.covered, *other.gap], [one.covered, *one.gap], atol=1e-14)
