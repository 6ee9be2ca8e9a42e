"""Recovered pressure: from exact means, at edges of contact and of bodies, and from means that scatter."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import csr_array

import lacsolver
from lacmesh import Mesh, Surface, cut_skin
from lacmesh.cells import CELLS
from lacmesh.generate import rectangle
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import jacobian, shape
from lacsolver.equilibrium.state import CONTACT, OPEN, UNPAIRED
from lacsolver.results.recovery import _missed, recover_pressure
from tests.lacsolver.bodies import body
from tests.lacsolver.held import with_sides

#: cells behind the slave, and the cut of hexahedra
SLAVES = [(name, "pyramid") for name in ("TRIA3", "QUAD4", "TRIA6", "TRIA7", "QUAD8", "QUAD9")]
SLAVES += [(name, "pyramid") for name in ("TETRA4", "TETRA10", "PENTA6", "PENTA15", "HEXA8", "HEXA20", "HEXA27")]
SLAVES += [("HEXA8", "hexa"), ("HEXA20", "hexa")]


def slave_of(name, n, hexa="pyramid", shift=0.0):
    """The body and its cut top: mesh, surface, macro-element of each face, number of macro-elements."""
    cut = cut_skin(
        with_sides(body(name, n).moved((shift, 0, 0)[: CELLS[name].dim])),
        "y1" if CELLS[name].dim == 2 else "z1",
        hexa=hexa,
    )
    cells = np.flatnonzero(cut.macro_of_face >= 0)
    surface = Surface.of(cut.mesh, cells)
    return cut.mesh, surface, cut.macro_of_face[surface.cell], cut.n_macros


def on_surface(surface):
    return np.unique(surface.faces.nodes[surface.faces.nodes >= 0])


# ---- from exact means


def on_faces(surface, degree, axisymmetric=False):
    """For each type of face: rows, nodes, N (q, n), points (f, q, 3), weights (f, q)."""
    for name, rows, nodes in surface.by_type():
        X, w = rule(CELLS[name].family, degree)
        N, x, J = shape(name, X), surface.x[nodes], jacobian(name, surface.x[nodes], X)
        size = np.linalg.norm(J[..., 0], axis=-1) if J.shape[-1] == 1 else None
        W = w * (np.linalg.norm(np.cross(J[..., 0], J[..., 1]), axis=-1) if size is None else size)
        at = np.einsum("qa,fas->fqs", N, x)
        yield rows, nodes, N, at, W * (2 * np.pi * at[..., 0] if axisymmetric else 1.0)


def means_of(surface, macro, n, f, degree=12, axisymmetric=False):
    """Means of f(x) over the macro-elements, and these's areas."""
    area, total = np.zeros(n), np.zeros(n)
    for rows, _, _, at, W in on_faces(surface, degree, axisymmetric):
        np.add.at(area, macro[rows], W.sum(axis=1))
        np.add.at(total, macro[rows], (W * f(at)).sum(axis=1))
    return total / area, area


def errors(surface, macro, f, p, nodal, degree=12):
    """L2 errors over the surface of p_m and of the recovered pressure."""
    of_means = of_nodal = 0.0
    for rows, nodes, N, at, W in on_faces(surface, degree):
        of_means += (W * (p[macro[rows]][:, None] - f(at)) ** 2).sum()
        of_nodal += (W * (nodal[nodes] @ N.T - f(at)) ** 2).sum()
    return np.sqrt([of_means, of_nodal])


def fitted_rate(h, error):
    return np.polyfit(np.log(h), np.log(error), 1)[0]


@pytest.mark.rows("QUAD4-pyramid", "HEXA8-hexa")
@pytest.mark.parametrize(("name", "hexa"), SLAVES)
def test_linear_pressure_is_met_and_a_smooth_one_is_of_second_order(name, hexa):
    """From exact means; and at nodes of the slave alone."""
    mesh, surface, macro, n = slave_of(name, 3, hexa)
    p, _ = means_of(surface, macro, n, plane)
    nodal, mean = recover_pressure(surface, macro, p, np.full(n, CONTACT))
    nodes = on_surface(surface)
    assert nodal[nodes] == pytest.approx(plane(mesh.points[nodes]), rel=1e-12)
    assert mean == pytest.approx(p, rel=1e-12)
    assert np.isnan(np.delete(nodal, nodes)).all()
    found, levels = [], (16, 32, 64) if CELLS[name].dim == 2 else (6, 9, 12)
    for k in levels:
        _, surface, macro, n = slave_of(name, k, hexa)
        p, _ = means_of(surface, macro, n, smooth)
        nodal, _ = recover_pressure(surface, macro, p, np.full(n, CONTACT))
        found.append(errors(surface, macro, smooth, p, nodal))
    of_means, of_nodal = np.array(found).T
    assert fitted_rate(1 / np.array(levels), of_means) == pytest.approx(1.0, abs=0.05)
    assert fitted_rate(1 / np.array(levels), of_nodal) > 1.9
    assert of_nodal[-1] < 0.4 * of_means[-1]


def plane(x):
    return 5 + 2 * x[..., 0] - x[..., 1] + 0.5 * x[..., 2]


def smooth(x):
    return 3 + np.sin(2 * x[..., 0] + 0.5) * np.cos(x[..., 1])


@pytest.mark.parametrize("name", ["TRIA3", "QUAD8"])
def test_linear_pressure_is_met_in_axisymmetry_from_the_axis_on(name):
    mesh, surface, macro, n = slave_of(name, 4, shift=-1.0)
    assert mesh.points[:, 0].min() == 0
    p, _ = means_of(surface, macro, n, lambda x: 3 - x[..., 0], axisymmetric=True)
    nodal, mean = recover_pressure(surface, macro, p, np.full(n, CONTACT), axisymmetric=True)
    nodes = on_surface(surface)
    assert nodal[nodes] == pytest.approx(3 - mesh.points[nodes, 0], rel=1e-12)
    assert mean == pytest.approx(p, rel=1e-12)
    plane, _ = recover_pressure(surface, macro, p, np.full(n, CONTACT))
    assert np.abs(plane[nodes] - nodal[nodes]).max() > 1e-3  # the weights matter


# ---- edges


def row_of(n):
    """n segments along x, each a macro-element of its own, faces up."""
    x = np.stack([np.arange(n + 1.0), np.zeros(n + 1)], axis=1)
    return Surface.of(Mesh.create(x, [("SEG2", np.stack([np.arange(n) + 1, np.arange(n)], axis=1))]), np.arange(n))


def recovered(p, status=None, **rest):
    """(nodal, mean) of pressures on as many segments of length 1 along x, each a macro-element of its own, faces up."""
    n = len(p)
    status = np.full(n, CONTACT) if status is None else np.array(status)
    return recover_pressure(row_of(n), np.arange(n), np.array(p, float), status, **rest)


def test_open_and_unpaired_macro_elements_have_none_and_parts_keep_their_own_force():
    nodal, mean = recovered([2.0, 1.0, 0, 0, 0], [CONTACT, CONTACT, OPEN, OPEN, UNPAIRED])
    assert (nodal[3:] == 0).all() and (mean[3:] == 0).all() and (np.diff(nodal[:4]) < 0).all()
    assert mean.sum() == pytest.approx(3)
    _, mean = recovered([5.0, 1, 0, 0, 7], [CONTACT, CONTACT, OPEN, OPEN, CONTACT])
    assert mean[:3].sum() == pytest.approx(6) and mean[3:].sum() == pytest.approx(7)
    nodal, mean = recovered([0, 4, 0], [OPEN, CONTACT, OPEN])  # one alone
    assert nodal == pytest.approx([0, 2, 2, 0]) and mean == pytest.approx([1, 2, 1])
    nodal, _ = recovered([0, 4, 4, 0], [UNPAIRED, CONTACT, CONTACT, UNPAIRED])
    assert nodal == pytest.approx([0, 4, 4, 4, 0])


def test_nothing_is_pulled_unless_it_may_be():
    p = np.array([9.0, 7, 5, 4, 3, 2, 0.5, 0])
    (nodal, mean), (both, _) = recovered(p), recovered(p, unilateral=False)
    assert both.min() < -0.1 and nodal.min() == 0
    assert mean.sum() == pytest.approx(p.sum())


def test_few_macro_elements_have_planes_and_a_row_of_them_a_slope_along_it():
    """Squares in space in a row along x; and faces of no macro-element are left out."""
    row = rectangle((6, 1), (6, 1))
    surface = Surface.of(Mesh.create(row.points, [("QUAD4", row.block("QUAD4"))], space_dim=3), np.arange(6))
    nodal, _ = recover_pressure(surface, np.arange(6), np.arange(6) + 0.5, np.full(6, CONTACT), unilateral=False)
    assert nodal == pytest.approx(surface.x[:, 0], rel=1e-12)
    nodal, mean = recover_pressure(row_of(4), np.array([0, 1, -1, -1]), np.array([2.0, 4.0]), np.full(2, CONTACT))
    assert nodal == pytest.approx([1, 3, 5, np.nan, np.nan], nan_ok=True) and mean == pytest.approx([2, 4])


def hertz_means(edge, n):
    """Means of sqrt(1 - (x / edge)^2) over n segments of length 1 from x = 0."""
    x = np.minimum(np.arange(n + 1) / edge, 1)
    return np.diff(edge * (x * np.sqrt(1 - x**2) + np.arcsin(x)) / 2)


@pytest.mark.parametrize("edge", [8.2, 8.3, 8.4, 8.6])
def test_contact_that_reaches_into_an_open_macro_element(edge):
    """The last one in contact has the force of the open one beside it, as where they are wide."""
    p = hertz_means(edge, 12)
    p[7:9] = p[7:9].sum(), 0.0
    status = np.where(p > 0, CONTACT, OPEN)
    nodal, mean = recovered(p, status)
    assert recovered(1e6 * p, status)[0] == pytest.approx(1e6 * nodal, rel=1e-9)  # in any unit
    exact = np.sqrt(1 - (np.arange(8.0) / edge) ** 2)
    assert nodal[:7] == pytest.approx(exact[:7], abs=2e-3) and nodal[7] == pytest.approx(exact[7], abs=0.045)
    assert mean.sum() == pytest.approx(p.sum())


@pytest.mark.parametrize("edge", [17.1, 17.3, 17.5, 17.7])
def test_force_of_interpolation_beyond_the_edge_is_taken_from_the_edge_alone(edge):
    """Stars of two segments; the last one lacks force that its neighbour has, as in contact of linear faces."""
    p, exact = hertz_means(edge, 24).reshape(12, 2).mean(axis=1), np.sqrt(1 - (np.arange(18.0) / edge) ** 2)
    p[7:9] += 0.06, -0.06
    nodal, mean = recover_pressure(row_of(24), np.arange(24) // 2, p, np.where(p > 0, CONTACT, OPEN))
    assert nodal[:17] == pytest.approx(exact[:17], abs=0.016) and nodal[17] == pytest.approx(exact[17], abs=0.03)
    assert mean.sum() == pytest.approx(p.sum())


@pytest.mark.parametrize(("macros", "corner", "off"), [(8, 0.0, 0.08), (5, 1.3, 0.12)])
def test_few_macro_elements_in_space_have_round_roots(macros, corner, off):
    """Hertz's pressure on stars of four faces: a quarter of the contact, and all of it; open ones give their share."""
    block = rectangle((2 * macros, 2 * macros), (2.6, 2.6))
    points, nodes = block.points - corner, block.block("QUAD4")
    surface = Surface.of(Mesh.create(points, [("QUAD4", nodes)], space_dim=3), np.arange(len(nodes)))
    i, j = np.floor((points[nodes].mean(axis=1)[:, :2] + corner) * macros / 2.6).astype(int).T

    def hertz(x):
        return np.sqrt(np.maximum(1 - (x[..., :2] ** 2).sum(axis=-1), 0))

    p, area = means_of(surface, i * macros + j, macros**2, hertz, degree=40)
    status = np.where(p > 0.05, CONTACT, OPEN)
    place = np.stack(np.divmod(np.arange(macros**2), macros), axis=1)
    for reached in np.flatnonzero((status == OPEN) & (p > 0)):
        steps = np.where(status == CONTACT, np.abs(place - place[reached]).sum(axis=1), macros)
        near = steps == steps.min()
        p[near] += p[reached] / near.sum()
    p[status == OPEN] = 0
    nodal, mean = recover_pressure(surface, i * macros + j, p, status)
    whole = np.sqrt(np.pi / 2 / (4 if corner == 0 else 1))
    assert errors(surface, i * macros + j, hertz, p, nodal)[1] < off * whole
    assert mean @ area == pytest.approx(p @ area)


def test_what_the_rim_lacks_stays_at_the_rim():
    """Even in the middle, with a peak at both ends that no parabola follows, as under the edges of a stiff hub."""
    p = np.full(16, 50.0)
    p[[0, 1, 2, -3, -2, -1]] = 160, 45, 60, 60, 45, 160
    made, mean = recovered(p)
    assert mean.sum() == pytest.approx(p.sum(), rel=1e-12)
    assert made[6:11] == pytest.approx(50, rel=0.02)
    assert made[[0, -1]].min() > 100


@pytest.mark.parametrize(("c", "part"), [((0.12, -0.04, 0.0), 0.1), ((0.1, -0.09, 0.03), 0.1), ((0.0, 0.0, 0.0), 0.0)])
def test_differences_at_the_boundary_in_proportion_to_the_slope_are_removed(c, part):
    """Rings of means differ from those of a parabola by c_k h (slope of p), as on QUAD9 and on the cut QUAD8."""
    n = 10
    _, surface, macro, count = slave_of("HEXA27", n)
    p, area = means_of(surface, macro, count, parabola)
    centre, on = np.zeros((count, 3)), surface.x[on_surface(surface)]
    centre[macro] = next(surface.x[nodes].mean(axis=1) for _, _, nodes in surface.by_type())
    low, high, off = on.min(axis=0), on.max(axis=0), np.zeros(count)
    for axis in (0, 1):
        h = (high - low)[axis] / n
        for outward, depth in ((-h, centre - low), (h, high - centre)):
            ring = np.minimum(depth[:, axis] // h, len(c)).astype(int)
            off += np.append(c, 0.0)[ring] * outward * slope_of_parabola(centre)[:, axis]
    off -= (area @ off) / area.sum()  # the force is exact
    nodal, _ = recover_pressure(surface, macro, p + off, np.full(count, CONTACT))
    _, of_nodal = errors(surface, macro, parabola, p + off, nodal)
    assert of_nodal <= part * np.sqrt(area @ off**2) + 1e-12 * np.sqrt(area @ p**2)


def parabola(x):
    return 3 + x[..., 0] + 0.5 * x[..., 1] + x[..., 0] ** 2 - 0.4 * x[..., 0] * x[..., 1]


def slope_of_parabola(x):
    return np.stack([1 + 2 * x[..., 0] - 0.4 * x[..., 1], 0.5 - 0.4 * x[..., 0]], axis=-1)


def test_the_rim_is_also_where_the_master_ends():
    """Faces beyond the master do not let the last ones that it covers, half, count as much as the others."""
    p, status, coverage = np.zeros(16), np.full(16, CONTACT), np.ones(16)
    p[:13] = 50.0
    p[10:13] = 60, 45, 200
    status[13:], coverage[12], coverage[13:] = UNPAIRED, 0.5, 0.0
    made, mean = recovered(p, status, coverage=coverage)
    assert mean @ coverage == pytest.approx(p @ coverage, rel=1e-12)
    assert made[2:10] == pytest.approx(50, rel=0.03)


# ---- means that scatter


@pytest.mark.rows("0.0-0.0-0.4")
@pytest.mark.parametrize(("slope", "hill", "off"), [(0.0, 0.0, 0.4), (0.5, 0.0, 0.4), (0.0, 2.0, 0.52)])
def test_means_that_scatter_have_no_parabola_of_their_own(slope, hill, off):
    """Even, linear or curved means that scatter: error at the nodes, also those of the rim, over the scatter."""
    _, surface, macro, n = slave_of("TETRA4", 6)
    nodes, random, wrong = on_surface(surface), np.random.default_rng(1), []

    def p(x):
        x, y = x[..., 0] - 0.5, x[..., 1] - 0.5
        return 1 + slope * x - hill * (x**2 + y**2)

    means, area = means_of(surface, macro, n, p)
    for _ in range(6):
        scatter = 0.2 * random.uniform(-1, 1, n)
        nodal, _ = recover_pressure(surface, macro, means + scatter - np.average(scatter, weights=area), np.full(n, 1))
        wrong.append(nodal[nodes] - p(surface.x[nodes]))
    assert np.sqrt(np.mean(np.square(wrong))) < off * 0.2 / np.sqrt(3)


def test_a_mean_is_missed_where_it_is_farther_off_than_the_pressures_at_the_nodes():
    """Pressures 2 and 4 have the mean 3 and the standard deviation 1; a mean twice as far off is missed in full."""
    segment = SimpleNamespace(means=csr_array([[0.5, 0.5]]), touch=csr_array([[1.0], [1.0]]))
    for mean, missed in ((3.9, 0.0), (5.1, 2.1)):
        assert _missed(segment, np.array([2.0, 4.0]), np.array([mean]), np.zeros(1)) == pytest.approx([missed])


def test_the_last_bits_of_means_do_not_matter():
    _, surface, macro, n = slave_of("TETRA4", 5)
    random = np.random.default_rng(2)
    for p in (np.ones(n), 1 + 0.3 * random.uniform(-1, 1, n), 1 + np.arange(n) / n):
        one, other = (recover_pressure(surface, macro, q, np.full(n, CONTACT))[0]
                      for q in (p, p * (1 + 1e-14 * random.uniform(-1, 1, n))))  # fmt: skip
        np.testing.assert_allclose(one, other, rtol=1e-11)
        scaled, _ = recover_pressure(surface, macro, 1e9 * p, np.full(n, CONTACT))
        np.testing.assert_allclose(scaled, 1e9 * one, rtol=1e-11)


@pytest.mark.filterwarnings("ignore:pressures of contact .fit. alternate")
def test_the_press_fit_of_data_is_even():
    """Its p_m alternate from 17 to 111, where Lame's pressure is 63.46 everywhere."""
    fields = lacsolver.solve(Path(__file__).parents[2] / "data" / "press_fit.toml").contact["fit"]
    wrong = np.sqrt(np.average((fields.recovered / 63.46 - 1) ** 2, weights=fields.area))
    assert wrong < 0.02
    z = np.abs(fields.centre[:, 2] - 5.0)
    middle = np.average(fields.recovered, weights=fields.area * (z < 2.5))
    assert middle == pytest.approx(np.average(fields.pressure, weights=fields.area * (z < 2.5)), rel=0.005)
    assert middle == pytest.approx(np.average(fields.pressure, weights=fields.area), rel=0.005)
    assert fields.recovered @ fields.area == pytest.approx(fields.pressure @ fields.area, rel=1e-6)  # flat faces


@pytest.mark.parametrize(("macro", "n", "status"), [(4, 3, 3), (3, 2, 2), (3, 3, 2)])
def test_wrong_shapes_are_refused(macro, n, status):
    with pytest.raises(ValueError, match=r"must be|below 2"):
        recover_pressure(row_of(3), np.arange(macro), np.ones(n), np.ones(status))
