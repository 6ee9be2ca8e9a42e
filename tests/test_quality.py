"""Quality by what it must be: ideal cells, motions that change nothing, cells spoilt in known ways, statistics.

Verdict's measures are those that pyvista computes, whatever the size of a cell.
"""

import json
import subprocess
import sys
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from lacmesh import Mesh, generate
from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.errors import GroupNotFoundError, RequestError
from lacmesh.quality import (
    corner_jacobian,
    measure_cells,
    measure_quality,
    measures_of,
    validity,
    validity_at,
    validity_of,
)
from lacmesh.quality.geometry import OWN
from lacmesh.quality.measures import ACCEPTED, SCALES, TYPES, default_measures, primary_metric
from lacmesh.quality.summary import PLACES, histogram, statistics
from lacmesh.reference import quadrature
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import gradient, jacobian
from tests.meshes import box, pad
from tests.quality_cells import IDEAL, LINEAR, MEASURED, degenerate, distorted, ideal, reference, rotation

CURVED = [n for n in MEASURED if CELLS[n].order == 2]
LINES_TOO = [n for n in CELLS if CELLS[n].dim]


def measured(name, x, measures=None, **more):
    x = np.asarray(x, float).reshape(-1, *np.shape(x)[-2:])
    k, n = x.shape[:2]
    wanted = measures_of(name) if measures is None else measures
    return measure_cells(name, x.reshape(-1, 3), np.arange(k * n).reshape(k, n), wanted, **more)


def at_corners(name, x):
    """Corner Jacobian, edge ratio, least and largest angle of cells x (k, n, 3)."""
    return list(measured(name, x, measures_of(name)[1:5]).values())


# ---- the tables


def test_every_type_has_its_measures():
    for name, cell in ALL_CELLS.items():
        measures = measures_of(name)
        assert len(set(measures)) == len(measures) and set(measures) <= set(SCALES)
        assert set(default_measures(name)) <= set(measures) & {"validity", *OWN}
        assert (primary_metric(name) is None) == (not measures)
        assert bool(measures) == (name in CELLS and cell.dim > 0)
    assert set(ACCEPTED) == set(LINEAR)
    assert not any(set(measures_of(n)) & {"scaled_jacobian", "condition", "shape"} for n in CURVED)


def test_a_measure_that_is_not_defined_is_refused():
    with pytest.raises(RequestError, match=r"'skew' is not defined on TETRA4"):
        measured("TETRA4", ideal("TETRA4"), ["skew"])
    with pytest.raises(RequestError, match=r"no measure named 'skw'; did you mean skew"):
        measure_quality(Mesh.create([[0, 0], [1, 0], [0, 1]], [("TRIA3", [[0, 1, 2]])]), measures=["skw"])


# ---- ideal cells


#: sizes and angles by hand: area or volume, least angle, largest angle (dihedral of solids)
BY_HAND = {
    "TRIA3": (np.sqrt(3) / 4, 60, 60),
    "QUAD4": (1, 90, 90),
    "TETRA4": (np.sqrt(2) / 12, np.degrees(np.arccos(1 / 3)), np.degrees(np.arccos(1 / 3))),
    "HEXA8": (1, 90, 90),
    "PENTA6": (np.sqrt(3) / 4, 60, 90),
    "PYRAM5": (np.sqrt(2) / 6, np.degrees(np.arccos(1 / np.sqrt(3))), np.degrees(np.arccos(-1 / 3))),
}


@pytest.mark.parametrize("name", MEASURED)
def test_sizes_and_angles_of_ideal_cells(name):
    size, low, high = BY_HAND[CELLS[name].linear]
    x = ideal(name)[None]
    jacobian_at_corners, ratio, least, largest = at_corners(name, 7.5 * x + 3)
    assert jacobian_at_corners[0] == corner_jacobian(name, 7.5 * x + 3)[0] == pytest.approx(1, abs=1e-13)
    assert least[0] == pytest.approx(low, abs=1e-9) and largest[0] == pytest.approx(high, abs=1e-9)
    assert ratio[0] == pytest.approx(1, abs=1e-12)
    assert quadrature.measure(name, x)[0] == pytest.approx(size, abs=1e-14)


# ---- what changes nothing, what mirrors


@pytest.mark.rows(
    "TRIA3-1000000.0; TRIA6-0.001; TRIA7-1; QUAD4-0.001; QUAD8-1e-09; QUAD9-1; TETRA4-0.001; TETRA10-1; HEXA8-1e-09; "
    "HEXA20-0.001; HEXA27-1; PENTA6-1e-09; PENTA15-0.001; PENTA18-0.001; PYRAM5-1; PYRAM13-1; PYRAM14-0.001"
)
@pytest.mark.vtk
@pytest.mark.parametrize("scale", [1, 1e-9, 1e-3, 1e6])
@pytest.mark.parametrize("name", MEASURED)
def test_motions_change_nothing_and_units_only_sizes(name, scale):
    """A mesh of cells of a nanometre, in metres, is as good as it is in nanometres."""
    rng = np.random.default_rng(2)
    x = reference(name) + 0.08 * rng.normal(size=(40, *reference(name).shape))
    before, after = measured(name, x), measured(name, scale * (x @ rotation(rng).T + rng.normal(size=3)))
    powers = {"area": 2, "volume": 3, "dimension": 1, "jacobian": CELLS[name].dim}
    for measure, values in before.items():
        own_unit = after[measure] / scale ** powers.get(measure, 0)
        np.testing.assert_allclose(own_unit, values, rtol=1e-9, atol=1e-9, err_msg=measure)
    if name in LINEAR:
        lengths = np.linalg.norm(np.diff(x[:, CELLS[name].edges], axis=2)[:, :, 0], axis=2)
        np.testing.assert_allclose(before["edge_ratio"], lengths.max(axis=1) / lengths.min(axis=1), rtol=1e-12)


@pytest.mark.vtk
@pytest.mark.parametrize("name", MEASURED)
def test_inverted_cells_are_invalid(name):
    """Cells of a surface are inverted in a plane mesh only."""
    x, plane = ideal(name)[None], CELLS[name].dim == 2
    mirrored = x * ([1, -1, 1] if plane else [1, 1, -1])
    assert validity(name, x, plane=plane)[0] == pytest.approx(1)
    assert validity(name, mirrored, plane=plane)[0] == pytest.approx(-1)
    assert corner_jacobian(name, mirrored, plane=plane)[0] == pytest.approx(-1)
    if plane:
        assert validity(name, mirrored)[0] == pytest.approx(1) == corner_jacobian(name, mirrored)[0]
        return
    found = measured(name, mirrored)
    if name in LINEAR:
        assert found["volume"][0] < 0 and found["shape"][0] == 0 and found["scaled_jacobian"][0] <= 0
    assert validity_at(name, mirrored).point[0] < 0


@pytest.mark.vtk
@pytest.mark.parametrize("name", MEASURED)
@pytest.mark.parametrize("cells", [distorted, degenerate])
def test_measures_stay_in_their_ranges(name, cells):
    """Whatever the cell: nothing but numbers, and units between -1 and 1 where they are bounded."""
    found = measured(name, cells(name, k=100))
    for measure, values in found.items():
        undefined = ("dimension", "distortion", "min_dihedral", "max_dihedral", "min_corner_angle", "max_corner_angle")
        assert measure in undefined or not np.isnan(values).any(), measure
        some = values[np.isfinite(values) & (np.abs(values) < 1e30)]
        kind, better = SCALES[measure]
        if kind == "angle":
            assert (some >= 0).all() and (some <= 360).all(), measure
        elif kind == "ratio" and measure != "condition":
            low = 1 - 1e-9 if measure != "radius_ratio" else 0.9
            assert (some >= low).all(), measure
        elif kind == "unit" and better > 0 and measure not in ("distortion", "collapse_ratio", "stretch"):
            best = np.sqrt(2) if measure == "corner_jacobian" and name in CURVED else 1  # edges that bend at corners
            assert (some <= best + 1e-9).all(), measure
            assert (some >= -np.sqrt(2) - 1e-9).all() or measure == "validity", measure


# ---- validity


@pytest.mark.parametrize("name", LINES_TOO)
def test_validity_is_the_least_determinant(name):
    """Against the determinants of the map at fine points: never above them where it samples, and of their size."""
    rng = np.random.default_rng(4)
    ref = pad(np.array(CELLS[name].reference).reshape(CELLS[name].n_nodes, -1))
    x = ref + 0.025 * rng.normal(size=(30, *ref.shape)) * (np.arange(3) < CELLS[name].dim)
    parts = validity_at(name, x)
    nodes = np.array(CELLS[name].reference)
    if CELLS[name].family == "PYRAM":
        nodes = np.delete(nodes, 4, axis=0)
    J = jacobian(name, x, nodes)[..., : CELLS[name].dim, :]
    det = np.linalg.det(J)
    at_nodes = np.minimum(parts.corner, parts.node)
    scale = det.min(axis=1) / at_nodes  # the mean determinant, where only nodes count
    if CELLS[name].family != "PYRAM":
        assert (scale > 0).all()
        np.testing.assert_allclose(np.sign(at_nodes), np.sign(det.min(axis=1)))
        fine = jacobian(name, x, rule(CELLS[name].family, 7)[0])[..., : CELLS[name].dim, :]
        np.testing.assert_allclose(scale, np.abs(np.linalg.det(fine)).mean(axis=1), rtol=0.25)
    np.testing.assert_array_equal(validity(name, x), np.minimum(at_nodes, parts.point))


def test_a_corner_folded_over_with_good_integration_points():
    """A HEXA8 that a solver would take, and is yet invalid at a corner."""
    x = ideal("HEXA8")[None].copy()
    x[0, 6] = [0.6, 0.6, 0.6]  # below the plane of its neighbours, at 2 / 3
    parts = validity_at("HEXA8", x)
    assert parts.corner[0] < 0 < parts.point[0]
    mesh = Mesh.create(x[0], [("HEXA8", [np.arange(8)])])
    (found,) = measure_quality(mesh).types
    assert found.invalid == 1 and found.invalid_at == {"corner": 1, "integration point": 0}
    assert found.worst[0].invalid_at == ("corner",) and found.poor == 0


@pytest.mark.parametrize("name", LINES_TOO)
def test_cells_without_extent_are_not_valid(name):
    point = np.ones((1, CELLS[name].n_nodes, 3))
    assert validity(name, point)[0] == 0
    if CELLS[name].dim == 3:
        flat = reference(name)[None] * [1, 1, 0] @ rotation(np.random.default_rng(5)).T + 7
        assert validity(name, flat)[0] == 0
    assert np.isnan(validity(name, np.full((1, CELLS[name].n_nodes, 3), np.nan)))[0]
    thin = reference(name)[None] * [1, 1, 1e-6]
    assert validity(name, thin)[0] == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("name", ["TRIA6", "QUAD9", "TETRA10", "HEXA20", "PENTA15", "PYRAM13"])
def test_the_order_of_the_nodes_does_not_matter(name):
    """Every way to list a cell's corners that keeps its sense gives the same validity, angles and corner Jacobian."""
    rng = np.random.default_rng(6)
    cell = CELLS[name]
    x = reference(name) + 0.12 * rng.normal(size=(10, *reference(name).shape)) * [1, 1, cell.dim == 3]
    expected = [validity(name, x), *at_corners(name, x), corner_jacobian(name, x)]
    count = 0
    for order in _symmetries(cell):
        count += 1
        other = x[:, order]
        measures = [validity(name, other), *at_corners(name, other), corner_jacobian(name, other)]
        for mine, before in zip(measures, expected, strict=True):
            np.testing.assert_allclose(mine, before, rtol=1e-9)
    assert count == {"TRIA": 3, "QUAD": 4, "TETRA": 12, "HEXA": 24, "PENTA": 6, "PYRAM": 4}[cell.family]


def _symmetries(cell):
    """Orders of a cell's nodes that list the same cell in the same sense, found by trying."""
    where = {frozenset(on): k for k, on in enumerate(cell.corners_of_node)}
    edges = {frozenset(e) for e in cell.edges}
    ref = np.array(cell.reference)[: cell.n_corners]
    turned = gradient(cell.linear, np.mean(ref, axis=0))[0]
    for corners in permutations(range(cell.n_corners)):
        if {frozenset((corners[a], corners[b])) for a, b in cell.edges} != edges:
            continue
        if np.linalg.det(ref[list(corners)].T @ turned) > 0:
            yield [where[frozenset(corners[c] for c in on)] for on in cell.corners_of_node]


# ---- VTK's measures


def test_without_pyvista_the_measures_of_vtk_are_refused_by_name(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)
    x = ideal("HEXA8")
    assert measured("HEXA8", x, default_measures("HEXA8"))["corner_jacobian"] == pytest.approx(1)
    for names, words in ((["oddy"], r"'oddy' needs .*lacmesh\[view\]"), (None, "condition, diagonal,")):
        with pytest.raises(RequestError, match=words):
            measured("HEXA8", x, names)
    code = "import sys, lacmesh; lacmesh.measure_quality('data/two_blocks.msh'); print('pyvista' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "False\n"


def verdict(name, x, measures):
    """{measure: (k,)} of cells x (k, n, 3), as pyvista has them."""
    import pyvista

    cells = {pyvista.CellType[TYPES[name]]: np.arange(x.shape[0] * x.shape[1]).reshape(x.shape[:2])}
    found = pyvista.UnstructuredGrid(cells, x.reshape(-1, 3)).cell_quality(list(measures)).cell_data
    return {m: np.array(found[m]) for m in measures}


@pytest.mark.vtk
@pytest.mark.parametrize("name", LINEAR)
def test_measures_of_cells_of_any_size_are_verdicts(name):
    x = distorted(name)
    mine, theirs = measured(name, x, ACCEPTED[name]), verdict(name, x, ACCEPTED[name])
    for measure, values in mine.items():
        np.testing.assert_allclose(values, theirs[measure], rtol=1e-9, atol=1e-12, err_msg=measure)


@pytest.mark.vtk
@pytest.mark.parametrize("name", ["TRIA3", "TETRA4", "PENTA6"])
def test_the_scaled_jacobian_of_valid_simplices_and_prisms_is_the_corner_jacobian(name):
    x = distorted(name)
    verdicts, corner = (np.maximum(v, 0) for v in measured(name, x, ["scaled_jacobian", "corner_jacobian"]).values())
    np.testing.assert_allclose(verdicts, corner, atol=1e-12)


@pytest.mark.vtk
@pytest.mark.parametrize("name", LINEAR)
def test_ideal_cells_have_the_values_that_pyvista_gives(name):
    import pyvista

    x = np.array([IDEAL[name]])
    mine = measured(name, x, ACCEPTED[name])
    for measure, limits in ACCEPTED[name].items():
        try:
            info = pyvista.cell_quality_info(pyvista.CellType[TYPES[name]], measure)
        except ValueError:
            assert limits is None or measure in ("relative_size_squared",)
            continue
        assert mine[measure][0] == pytest.approx(info.unit_cell_value, abs=1e-12), measure
        assert limits == pytest.approx(info.acceptable_range), measure


@pytest.mark.vtk
def test_min_dihedral_is_the_angle_that_verdict_means():
    """Verdict's least angle of a tetrahedron depends on how its nodes are listed, by its own error; ours does not.

    Over the ways to list them that keep the orientation, ours is the least that Verdict finds.
    """
    x = distorted("TETRA4", k=50)[:100]
    turned = [[0, 1, 2, 3], [1, 2, 0, 3], [2, 0, 1, 3], [1, 0, 3, 2], [3, 1, 0, 2], [0, 2, 3, 1]]
    theirs = np.array([verdict("TETRA4", x[:, order], ["min_angle"])["min_angle"] for order in turned])
    mine = [measured("TETRA4", x[:, order], ["min_dihedral"])["min_dihedral"] for order in turned]
    np.testing.assert_allclose(mine, [mine[0]] * len(turned), rtol=1e-9)
    assert np.ptp(theirs, axis=0).max() > 1
    assert (theirs.min(axis=0) <= mine[0] + 1e-6).all()


# ---- statistics


def test_the_statistics_are_numpys():
    rng = np.random.default_rng(8)
    values = rng.uniform(-0.2, 1, 1001)
    s = statistics("corner_jacobian", values, (0.5, 1))
    np.testing.assert_allclose(s.percentiles, np.percentile(values, (1, 5, 50, 95, 99)))
    assert (s.least, s.largest) == (values.min(), values.max()) and s.mean == pytest.approx(values.mean())
    assert s.outside == (values < 0.5).sum() and s.median == np.median(values)
    h = s.histogram
    assert sum(h.counts) + h.below + h.above == 1001 and h.below == (values < 0).sum()
    assert list(h.counts) == np.histogram(values, h.edges)[0].tolist()


def test_infinite_and_missing_values_are_told_apart():
    s = statistics("condition", np.array([1.0, 2.0, 1e30, np.nan, np.inf]), (1, 3))
    assert (s.count, s.undefined, s.outside, s.largest) == (2, 3, 3, 2.0)
    none = statistics("condition", np.array([1e30]))
    assert none.count == 0 and np.isnan(none.mean) and none.as_json()["min"] is None
    assert histogram("volume", np.array([2.0, 2.0])).counts[0] == 2
    assert sum(histogram("corner_jacobian", np.array([1 + 1e-15, -1e-18])).counts) == 2


# ---- a mesh


@pytest.fixture
def mixed():
    """Eight hexahedra of a box, one of them spoilt, a tetrahedron beside, a skin face, a line, a point, a TRIA10."""
    points, cells = box(2)
    points = np.vstack([points, [[5, 0, 0], [6, 0, 0], [5, 1, 0], [5, 0, 1]]])
    points[cells[3, 6]] = [0.2, 0.2, 0.2]  # turns several cells over
    far = np.arange(4) + len(points) - 4
    blocks = [("HEXA8", cells), ("TETRA4", [far]), ("QUAD4", cells[:1, :4])]
    blocks += [("SEG2", [[0, 1]]), ("POI1", [[0]]), ("TRIA10", [np.arange(10)])]
    groups = {"body": np.arange(8), "some": [0, 8], "skin": [9], "nothing": [], "odd": [12]}
    return Mesh.create(points, blocks, cell_groups=groups, cell_number=np.arange(13) + 100)


def test_a_mesh_by_type_and_by_group(mixed):
    q = measure_quality(mixed)
    by_type = {t.type: t for t in q.types}
    assert list(by_type) == ["HEXA8", "TETRA4", "QUAD4", "SEG2"] and q.not_measured == {"POI1": 1, "TRIA10": 1}
    assert q.count == 11 and q.invalid == by_type["HEXA8"].invalid > 0
    of_group = {g: [t.type for t in types] for g, types in q.groups.items()}
    assert of_group == {"body": ["HEXA8"], "some": ["HEXA8", "TETRA4"], "skin": ["QUAD4"]}
    hexa = by_type["HEXA8"]
    value = measure_cells("HEXA8", mixed.points, mixed.block("HEXA8"), ["corner_jacobian"])["corner_jacobian"]
    valid = validity_of(mixed)
    assert hexa.invalid == (valid[:8] <= 0).sum()
    assert hexa.poor == ((valid[:8] > 0) & (value < 0.1)).sum()
    assert hexa.measures["corner_jacobian"].least == value.min()
    worst = hexa.worst[0]
    assert worst.number == 100 + valid[:8].argmin() and "body" in worst.groups and set(worst.invalid_at) <= set(PLACES)
    assert worst.centroid == pytest.approx(mixed.points[mixed.block("HEXA8")[valid[:8].argmin()]].mean(axis=0))


@pytest.mark.vtk
def test_one_group(mixed):
    """Sizes refer to the whole mesh even if one group is measured, as in ParaView."""
    q = measure_quality(mixed, "some")
    assert [(t.type, t.count) for t in q.types] == [("HEXA8", 1), ("TETRA4", 1)] and not q.groups
    assert measure_quality(mixed, "nothing").count == 0
    assert measure_quality(mixed, "odd").not_measured == {"TRIA10": 1}
    with pytest.raises(GroupNotFoundError, match="did you mean body"):
        measure_quality(mixed, "bdy")
    size = "relative_size_squared"
    whole, one = (measure_quality(mixed, of, measures=[size]).types[0].measures[size] for of in (None, "some"))
    values = measure_cells("HEXA8", mixed.points, mixed.block("HEXA8"), [size])[size]
    assert one.least == pytest.approx(values[0]) and whole.least == pytest.approx(values.min())


def test_the_worst_are_the_worst():
    """Invalid cells by validity, then the others by what ranks them; the same by a full sort."""
    mesh = generate.box(6).only("body").moved(lambda x: x + 0.03 * np.random.default_rng(9).normal(size=x.T.shape).T)
    (t,) = measure_quality(mesh).types
    found = measure_cells("HEXA8", mesh.points, mesh.block("HEXA8"), ["validity", "corner_jacobian"])
    invalid = found["validity"] <= 0
    key = np.where(invalid, found["validity"], np.inf)
    order = np.lexsort((found["corner_jacobian"], key))[:10] + 1
    assert [w.number for w in t.worst] == order.tolist()
    assert 0 < invalid.sum() < 10  # both kinds are among them


def test_nodes_without_a_place(mixed):
    points = mixed.points.copy()
    points[mixed.block("HEXA8")[0, 0]] = np.nan
    q = measure_quality(replace(mixed, points=points))
    hexa = q.types[0]
    assert hexa.measures["corner_jacobian"].undefined == 1 and np.isnan(hexa.worst[0].validity)
    assert json.dumps(q.as_json(), allow_nan=False)


@pytest.mark.vtk
def test_json_has_its_schema(mixed):
    q = measure_quality(mixed, measures="all").as_json()
    assert q["schema"] == "lacmesh.quality/2"
    of_mesh = "schema group cells invalid types groups not_measured"
    assert {*q} == {*of_mesh.split()}
    of_type = "type cells invalid invalid_at poor ranked_by accepted_ranges measures worst"
    of_measure = "count undefined outside_range min p1 p5 p50 p95 p99 mean max histogram"
    for t in [*q["types"], *(t for types in q["groups"].values() for t in types)]:
        assert {*t} == {*of_type.split()}
        assert set(t["measures"]) == set(measures_of(t["type"])) and len(t["worst"]) == min(10, t["cells"])
        for s in t["measures"].values():
            assert list(s) == of_measure.split()
            assert sum(s["histogram"]["counts"]) + s["histogram"]["below"] + s["histogram"]["above"] == s["count"]
        for w in t["worst"]:
            assert set(w) == {"cell", "groups", "centroid", "measure", "value", "validity", "invalid_at"}
    assert json.loads(json.dumps(q, allow_nan=False)) == json.loads(json.dumps(q))
