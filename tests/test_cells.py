"""The table of cells, its shape functions and quadrature: each row proved by an identity, none left out."""

from itertools import product
from math import factorial

import numpy as np
import pytest

from lacmesh.cells import ALL_CELLS, CARRIED, CELLS
from lacmesh.reference.quadrature import measure, rule
from lacmesh.reference.shapes import gradient, jacobian, shape
from lacmesh.topology.orientation import REVERSED
from lacmesh.topology.skin import FACE_TYPES
from tests.meshes import pad

NAMES = list(CELLS)
SOLID = [n for n, c in CELLS.items() if c.dim == 3]
MEASURED = [n for n in NAMES if CELLS[n].dim > 1]


def inner_points(name, n=5):
    X, _ = rule(CELLS[name].family, 2 * n - 1)
    return X


def test_names_and_numbers_of_all_types():
    """A name is the family and the number of nodes; cells that are carried have no table."""
    families = {"SEG": "2 3", "TRIA": "3 6 7", "QUAD": "4 8 9", "TETRA": "4 10", "HEXA": "8 20 27", "PENTA": "6 15 18"}
    families |= {"PYRAM": "5 13 14", "POI": "1"}
    assert set(NAMES) == {family + n for family, numbers in families.items() for n in numbers.split()}
    assert all(name == f"{cell.family}{cell.n_nodes}" for name, cell in ALL_CELLS.items())
    assert not any(cell.facets or cell.reference for cell in CARRIED.values())
    numbers = [c.msh for c in ALL_CELLS.values() if c.msh is not None]
    assert len(set(numbers)) == len(numbers)
    assert [n for n, c in ALL_CELLS.items() if c.msh is None] == ["TRIA7"]


@pytest.mark.gmsh
def test_reference_nodes_and_msh_numbers_are_gmshs(gmsh):
    for name, cell in ALL_CELLS.items():
        if cell.msh is None or cell.dim == 0:
            continue
        if name in ("PENTA40", "PENTA75"):  # gmsh has no properties of these, only their number
            assert gmsh.model.mesh.getElementType("Prism", 3 if name == "PENTA40" else 4) == cell.msh
            continue
        _, dim, _, n_nodes, local, n_corners = gmsh.model.mesh.getElementProperties(cell.msh)
        assert (dim, n_nodes, n_corners) == (cell.dim, cell.n_nodes, cell.n_corners), name
        if name in CELLS:
            np.testing.assert_allclose(np.reshape(local, (n_nodes, dim)), cell.reference, atol=1e-12)


@pytest.mark.parametrize("name", [n for n in NAMES if CELLS[n].dim])
def test_shape_functions(name):
    cell = CELLS[name]
    X = inner_points(name)
    N, dN = shape(name, X), gradient(name, X)
    np.testing.assert_allclose(shape(name, cell.reference), np.eye(cell.n_nodes), atol=1e-14)
    np.testing.assert_allclose(N.sum(axis=1), 1, atol=1e-14)
    np.testing.assert_allclose(dN.sum(axis=1), 0, atol=1e-13)
    np.testing.assert_allclose(N @ np.array(cell.reference), X, atol=1e-14)  # isoparametric
    h = 1e-6
    for axis in range(cell.dim):
        step = h * np.eye(cell.dim)[axis]
        slope = (shape(name, X + step) - shape(name, X - step)) / (2 * h)
        np.testing.assert_allclose(dN[:, :, axis], slope, atol=1e-8)


@pytest.mark.parametrize("name", [n for n in NAMES if CELLS[n].order == 2])
def test_quadratic_cells_contain_p2(name):
    cell = CELLS[name]
    X, nodes = inner_points(name), np.array(cell.reference)
    for e in product(range(3), repeat=cell.dim):
        if sum(e) <= 2:
            np.testing.assert_allclose(shape(name, X) @ np.prod(nodes**e, axis=1), np.prod(X**e, axis=1), atol=1e-13)


@pytest.mark.parametrize("name", MEASURED)
def test_trace_on_a_facet_is_the_facets_own(name):
    """Mixed meshes are conforming: on each facet only its nodes have nonzero functions, those of the facet type."""
    cell = CELLS[name]
    for facet in cell.facets:
        flat = CELLS[CELLS[facet.type].linear]
        X = rule(flat.family, 5)[0]
        corners = np.array([cell.reference[c] for c in facet.nodes[: flat.n_corners]])
        N = shape(name, shape(flat.name, X) @ corners)
        own = shape(facet.type, X)
        np.testing.assert_allclose(N[:, list(facet.nodes)], own, atol=1e-13)
        others = np.setdiff1d(np.arange(cell.n_nodes), facet.nodes)
        np.testing.assert_allclose(N[:, others], 0, atol=1e-13)


@pytest.mark.parametrize("name", SOLID)
def test_facets_close_the_cell_and_point_outward(name):
    """Divergence theorem: the flux of x through the facets is three times the volume."""
    cell = CELLS[name]
    x = pad(cell.reference)
    flux = 0.0
    for facet in cell.facets:
        X, w = rule(CELLS[facet.type].family, 6)
        J = jacobian(facet.type, x[list(facet.nodes)][None], X)[0]
        normal = np.cross(J[..., 0], J[..., 1])
        flux += (w * np.einsum("ps,ps->p", shape(facet.type, X) @ x[list(facet.nodes)], normal)).sum()
    np.testing.assert_allclose(flux, 3 * monomial(cell.family, (0, 0, 0)), rtol=1e-13)
    np.testing.assert_allclose(measure(name, x[None]), flux / 3, rtol=1e-13)


@pytest.mark.parametrize("family", ["SEG", "TRIA", "QUAD", "TETRA", "HEXA", "PENTA", "PYRAM"])
def test_rules_integrate_every_monomial_of_their_degree(family):
    dim = next(c.dim for c in CELLS.values() if c.family == family)
    for degree in (0, 1, 2, 3, 4, 5, 6, 7, 8, 11):
        X, w = rule(family, degree)
        for e in product(range(degree + 1), repeat=dim):
            if sum(e) <= degree:
                exact = monomial(family, (*e, 0, 0)[:3])
                np.testing.assert_allclose((w * np.prod(X**e, axis=1)).sum(), exact, rtol=1e-12, atol=1e-14)
    with pytest.raises(ValueError, match="no rule"):
        rule("OCTA", 1)


@pytest.mark.parametrize(
    ("family", "points"), [("TRIA", [1, 1, 3, 6, 6, 7, 12, 16, 16]), ("TETRA", [1, 1, 4, 14, 14, 14, 24])]
)
def test_symmetric_rules_are_small_positive_and_inside(family, points):
    for degree, count in enumerate(points):
        X, w = rule(family, degree)
        assert len(w) == count and (w > 0).all() and (X > 0).all() and (X.sum(axis=1) < 1).all()


def monomial(family, e):
    """Exact integral of x^i y^j z^k over a reference element."""
    i, j, k = e
    line = lambda n: 2 / (n + 1) if n % 2 == 0 else 0.0  # noqa: E731
    if family in ("SEG", "QUAD", "HEXA"):
        return line(i) * (line(j) if family != "SEG" else 1) * (line(k) if family == "HEXA" else 1)
    triangle = factorial(i) * factorial(j) / factorial(i + j + 2)
    if family == "TRIA":
        return triangle
    if family == "PENTA":
        return triangle * line(k)
    if family == "TETRA":
        return factorial(i) * factorial(j) * factorial(k) / factorial(i + j + k + 3)
    # pyramid: x = u (1 - z), y = v (1 - z)
    power = i + j + 2
    return line(i) * line(j) * factorial(power) * factorial(k) / factorial(power + k + 1)


@pytest.mark.parametrize("name", FACE_TYPES[1:])
def test_a_reversed_face_is_the_same_face_turned_over(name):
    order = list(REVERSED[name])
    x = np.array(CELLS[name].reference)
    X = rule(CELLS[name].family, 3)[0]
    there = shape(name, X) @ x[order]
    J = jacobian(name, pad(x[order])[None], X)[0]
    sign = J[:, 0, 0] if CELLS[name].dim == 1 else np.cross(J[..., 0], J[..., 1])[:, 2]
    assert (sign < 0).all()
    assert order[0] == 0 or CELLS[name].dim == 1
    np.testing.assert_allclose(shape(name, there).sum(axis=1), 1)
