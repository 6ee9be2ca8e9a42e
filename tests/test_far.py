"""Messages on a mesh depend neither on where it lies nor on its unit of length."""

from dataclasses import replace

import numpy as np
import pytest

from lacmesh import Mesh, check, cut_skin, measure_quality
from lacmesh.drawing import Drawing
from lacmesh.origin import format_coordinates, from_origin, origin_of, origin_of_mesh, size_of
from tests.lacsolver.patch_meshes import stack
from verification.meshes.stacks import tilt

FAR = (1e3, 1e7)
KINDS = {2: ("QUAD8", "TRIA3"), 3: ("HEXA8", "TETRA4")}


def moved(dim, far):
    """A turned stack (mesh) that lies far off, the same brought back, and the shift; both are rounded alike."""
    mesh = stack(*KINDS[dim], dim, skew=0.1, gap=0.01)
    mesh = replace(mesh, points=mesh.points @ tilt(dim, 0.3).T)
    shift = 2 * far * np.array([1.0, -0.7, 0.4 if dim == 3 else 0.0])
    there = replace(mesh, points=mesh.points + shift)
    return there, replace(there, points=there.points - shift), shift


def findings(mesh):
    return [(f.rule, f.severity, f.cells, f.nodes) for f in check(mesh, "slave", "master", ["bottom"]).findings]


def measures(mesh):
    """{(type, measure): its spread}, and the invalid and poor of each type."""
    types = measure_quality(mesh, measures="all").types
    values = {(t.type, name): [s.least, s.mean, s.largest] for t in types for name, s in t.measures.items()}
    return values, [(t.type, t.count, t.invalid, t.poor) for t in types]


EVERY = pytest.mark.parametrize(("dim", "far"), [(dim, far) for dim in (2, 3) for far in FAR])


@pytest.mark.rows("2-10000000.0", "3-1000.0")
@EVERY
def test_check(dim, far):
    there, here, shift = moved(dim, far)
    one, other = (check(mesh, "slave", "master") for mesh in (here, there))
    assert findings(there) == findings(here)
    for name in ("min", "mean", "max"):
        assert other.summary["gap"][name] == pytest.approx(one.summary["gap"][name], rel=1e-12)
    assert other.summary["covered"] == pytest.approx(one.summary["covered"], rel=1e-12)
    for f, g in zip(one.findings, other.findings, strict=True):
        if f.where.box:
            np.testing.assert_allclose(g.where.box, np.array(f.where.box) + shift, rtol=1e-15)


@pytest.mark.rows("2-1000.0")
@pytest.mark.vtk
@EVERY
def test_quality(dim, far):
    there, here, shift = moved(dim, far)
    (one, counts), (other, same) = measures(here), measures(there)
    assert same == counts
    for key, values in one.items():
        np.testing.assert_allclose(other[key], values, rtol=1e-11, atol=1e-14, err_msg=str(key))
    worst = [{bad.number: bad.centroid for t in measure_quality(m).types for bad in t.worst} for m in (here, there)]
    assert set(worst[0]) & set(worst[1])  # all of those that are alike have the same right to be named
    for number in set(worst[0]) & set(worst[1]):
        np.testing.assert_allclose(worst[1][number], np.array(worst[0][number]) + shift, rtol=1e-14)


@pytest.mark.vtk
@pytest.mark.parametrize("dim", [2, 3])
def test_a_picture_is_drawn_near_0(dim):
    there, here, _ = moved(dim, 1e7)
    a, b = (Drawing(mesh, "slave", None, None, (60, 40), True).grid.points for mesh in (here, there))
    assert np.abs(b).max() < 10
    np.testing.assert_allclose(np.ptp(b, axis=0), np.ptp(a, axis=0), atol=1e-12)


@pytest.mark.rows("2-1e-06")
@pytest.mark.parametrize("length", [1e-6, 1e3])
@pytest.mark.parametrize("dim", [2, 3])
def test_units_of_length(dim, length):
    _, mesh, _ = moved(dim, 0.0)
    other = replace(mesh, points=length * mesh.points)
    assert findings(other) == findings(mesh)
    assert measures(other)[1] == measures(mesh)[1]
    np.testing.assert_allclose(cut_skin(other, "slave").mesh.points / length, cut_skin(mesh, "slave").mesh.points)


@pytest.mark.parametrize("radius", [0.1, 1e3])
def test_an_axisymmetric_overlap_is_deep_or_not_whatever_the_radius(radius):
    """An overlap as deep as macro-elements are large is told, also where 2 pi r makes their areas large."""
    mesh = cut_skin(stack("QUAD4", "QUAD4", 2, gap=-0.6), "slave").mesh.moved((radius, 0))
    found = check(mesh, "slave", "master", axisymmetric=True, max_penetration=0.9, search_distance=0.9)
    assert "wrong-side" in found.rules


def test_the_origin_costs_no_digit_and_is_not_moved_by_nodes_of_no_cell_and_wild_ones():
    x = np.random.default_rng(0).uniform(1.0, 3.0, (1000, 3)) + np.array([5e5, -5e6, 0.3])
    origin = origin_of(x)
    assert origin[2] == 0 and (origin[:2] != 0).all()
    np.testing.assert_array_equal((x - origin) + origin, x)
    assert np.abs((x - origin)[:, :2]).max() < 2
    points = [[5e5, 0, 0], [5e5 + 1, 0, 0], [5e5, 1, 0], [0, 0, 0], [np.nan, 0, 0]]
    mesh = Mesh.create(points, [("TRIA3", [[0, 1, 2]])])
    assert origin_of_mesh(mesh).tolist() == [5e5, 0, 0]
    assert origin_of(np.full((2, 3), np.inf)).tolist() == [0, 0, 0]
    assert from_origin(mesh, np.zeros(3)) is mesh and size_of(Mesh.create([[np.inf, 0]], [])) == 0
    assert format_coordinates([0.123456789, -7.0, 1e-12], 1.0) == ["0.12346", "-7", "0"]
    assert format_coordinates([5000001.25], 2.0) == ["5000001.25"] and format_coordinates([1.0], 0.0) == ["1"]
