"""Recovery of a continuous contact pressure on the slave from the means p_m of macro-elements, after the solution.

The pressure p_m of a macro-element is a mean, so that as a function it is of first order whatever the cells. Away from
the boundary of the slave and from the edge of contact the means themselves are more accurate. Around each macro-element
a parabola (in space a quadric) is fitted to the means, or its root (`parabolas`), and the value at a node is the mean
of the fits of its macro-elements. A linear pressure is reproduced exactly on plane faces.

On the boundary of contact, which is that of the slave and of what the master covers, p_m has errors of order h times
the slope of p, which alternate and decrease to about a third from one macro-element to the next. The weights there are
those of least squares for such errors: a ninth of the area for the last macro-element but one, and a ninth of that for
the last.

At the edge of contact p behaves as a square root, and the last macro-element in contact shares its force wrongly with
its neighbours (10 % of the peak; the sum is right), where faces are linear also with open ones that the contact
reaches into. So for p >= 0, near an open macro-element, the last ones in contact and, of linear faces, the open ones
beside them are merged with their neighbours, and p is the root of a parabola that has the means p_m. The square of
Hertz's pressure is one. If fewer than 3 (9) remained, the open ones alone are merged, into the last ones in contact.

Finally, each connected part of the contact gets the force of its p_m: linear interpolation between nodes has less or
more force than the root, by what it makes of the tip. A constant is added to p squared at the last nodes in contact,
which moves the edge. The rest is added where the fit misses the means by more than they scatter and than p changes
within a macro-element: at sharp edges of a body, where the pressure has no bound. So it leaves the middle as it is.
What no macro-element lacks is scaled onto all.

The accuracy of this recovery, and errors that no recovery can correct, are described in docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import shape
from lacmesh.surface import Surface
from lacmesh.surface.normals import weighted
from lacsolver.equilibrium.state import CONTACT, OPEN, UNPAIRED
from lacsolver.results.boundary_layer import without_layer
from lacsolver.results.parabolas import Slave, between, dyads, fitted, nodal_means, summed
from lacsolver.results.patches import beside, nodes_of, ones, only, scaled
from lacsolver.space.sparse import joined_columns

Bools = NDArray[np.bool_]

#: degree of the rule on faces, by their order: N times the Jacobian, with r
_DEGREE = {1: 5, 2: 8}
#: weight of the macro-elements on the boundary, and of their neighbours, relative to their area
_RIM = (1 / 81, 1 / 9)
#: deviation from the mean, over its usual size: none of it is restored below the first value, all above the second
_POOR = (1.0, 2.0)
#: usual deviations from the mean, in scatters
_USUAL = 1.5
#: number of rings of macro-elements that are near the edge of contact
_NEAR = 9
#: largest factor by which the pressure at the last nodes in contact changes where the edge moves
_MOST = 2.0
#: part of a negative square that counts when the edge moves: linear interpolation across the last face has the force of
#: the root with the edge at 3/4 of the face, where the square beyond is a third of that before
_BEYOND = 1 / 3
#: of the interval of the constant that moves the edge, down to round-off
_HALVINGS = 50


def recover_pressure(
    surface: Surface,
    macro: Ints,
    pressure: Floats,
    status: Ints,
    *,
    axisymmetric: bool = False,
    unilateral: bool = True,
    coverage: Floats | None = None,
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return a continuous pressure of higher order at nodes (n_nodes,), and its mean over macro-elements (n_macros,).

    `surface`: the slave's faces; `macro` (faces,): macro-element of each face, negative for none; `pressure` p_m and
    `status` (n_macros,). `unilateral`: nodal values are not negative, and forces are those of p_m, on the `coverage`
    (n_macros,) of each macro-element; by default all that are paired are covered. Raises ValueError for shapes that do
    not agree.

    Between nodes the pressure is interpolated by the faces' shape functions. Nodes of no macro-element in contact have
    0, nodes off the slave's surface NaN; beyond the edge of contact the pressure falls to 0 in the next macro-element.
    The mean equals the value at the centroid up to terms of second order, and is more accurate than the value of the
    shape functions there.
    """
    macro, pressure, status = np.asarray(macro), np.asarray(pressure, dtype=float), np.asarray(status)
    if macro.shape != (len(surface),) or macro.max(initial=-1) >= len(pressure):
        raise ValueError(f"macro must be ({len(surface)},), and below {len(pressure)}")
    if pressure.ndim != 1 or status.shape != pressure.shape:
        raise ValueError(f"pressure and status must be (n_macros,), not {pressure.shape} and {status.shape}")
    ours = surface if (macro >= 0).all() else surface.take(np.flatnonzero(macro >= 0))
    slave = _slave(ours, macro[macro >= 0], status == UNPAIRED, axisymmetric)
    contact = (status >= CONTACT) & (slave.area > 0)
    means = np.where(contact, pressure, 0.0)
    touch = only(slave.touch, contact)
    weighted, corrected = without_layer(slave, touch, means, ours, macro[macro >= 0])
    values, scatter = fitted(weighted, touch, corrected)
    p = nodal_means(touch, values)
    if unilateral:
        opened = (status == OPEN) & (slave.area > 0)
        edge = beside(slave.touch, opened, 1) & contact
        near, last = (nodes_of(slave.touch, m) for m in (beside(slave.touch, edge, _NEAR) & contact, edge))
        p = np.maximum(p, 0.0)
        q = np.where(near, _squares(slave, means, contact, edge, opened), p**2) if edge.any() else p**2
        covered = slave.area * np.where(status == UNPAIRED, 0.0, 1.0 if coverage is None else coverage)
        p = _balanced(slave, q, means, contact, covered, scatter, last)
    nodal = np.full(len(surface.x), np.nan)
    nodal[slave.nodes] = p
    return nodal, slave.means @ p


def _slave(surface: Surface, macro: Ints, unpaired: Bools, axisymmetric: bool) -> Slave:
    """Compute the data of a surface for the fits. A macro-element without extent has an area of 0."""
    rows, columns, values, n = [], [], [], len(unpaired)
    area, first, second, linear = np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3, 3)), np.zeros(n, bool)
    for name, faces, nodes in surface.by_type():
        X, w = rule(CELLS[name].family, _DEGREE[CELLS[name].order])
        N, own = shape(name, X), macro[faces]
        at = np.einsum("qa,fas->fqs", N, surface.x[nodes])
        W = np.linalg.norm(weighted(name, surface.x[nodes], X), axis=2) * w
        W = W * (2 * np.pi * at[..., 0] if axisymmetric else 1.0)
        area += summed(own, W.sum(axis=1), n)
        first += summed(own, np.einsum("fq,fqs->fs", W, at), n)
        second += summed(own, np.einsum("fq,fqs,fqt->fst", W, at, at), n)
        linear[own] |= CELLS[name].order == 1
        rows.append(np.repeat(own, nodes.shape[1]))
        columns.append(nodes.ravel())
        values.append((W @ N).ravel())
    m, (nodes, k) = np.concatenate(rows), np.unique(np.concatenate(columns), return_inverse=True)
    size = np.where(area > 0, area, 1.0)
    means = coo_array((np.concatenate(values) / size[m], (m, k)), shape=(n, len(nodes))).tocsr()
    touch = ones(coo_array((np.ones(len(m)), (k, m)), shape=(len(nodes), n)))
    centroid = first / size[:, None]
    moment = second / size[:, None, None] - dyads(centroid)
    trust = _trust(touch, surface, macro, unpaired)
    return Slave(nodes, surface.x[nodes], area, centroid, moment, means, touch, trust, linear, surface.dim)


def _trust(touch: csr_array, surface: Surface, macro: Ints, unpaired: Bools) -> NDArray[np.floating]:
    """Return the factors (n,) `_RIM` for macro-elements on the boundary and their neighbours, and 1 for the others.

    Their boundary is that of the slave and that of the `unpaired` macro-elements.
    """
    rim = np.isin(np.arange(touch.shape[1]), macro[surface.boundary.any(axis=1)]) | beside(touch, unpaired, 1)
    steps = np.sum([~beside(touch, rim, k) for k in range(len(_RIM))], axis=0)
    return np.array([*_RIM, 1.0])[steps]


def _squares(slave: Slave, means: Floats, contact: Bools, edge: Bools, opened: Bools) -> NDArray[np.floating]:
    """Return nodal values (k,) of parabolas whose roots, 0 where these are negative, have means fitted to p_m.

    Those `opened` beside the `edge` of contact, in which it may end, are merged into the macro-elements at the edge,
    and these into their neighbours: where 2 along each axis are in contact, and where 3 remain.
    """
    beyond = beside(slave.touch, edge, 1) & opened & slave.ends & (np.count_nonzero(contact) >= 2**slave.dim)
    merged, W = _merged(slave, contact, edge, beyond, edge)
    if len(merged.area) < 3**slave.dim:
        merged, W = _merged(slave, contact, edge, beyond, edge & False)
    q, _ = fitted(merged, merged.touch, W @ means, root=True)
    return nodal_means(merged.touch, q)


def _merged(slave: Slave, contact: Bools, last: Bools, beyond: Bools, inner: Bools) -> tuple[Slave, csr_array]:
    """Merge macro-elements `beyond` the edge into the `last` ones in contact, and the `inner` ones into neighbours.

    Return the merged slave, whose nodes are those in contact, and W (merged, n), which takes means to merged ones.
    """
    near = ones(slave.touch.T @ slave.touch)
    inwards = _shared(scaled(near, contact & ~inner, inner))
    kept = contact & (~inner | (inwards.sum(axis=0) == 0))
    inwards = (inwards + diags_array(kept.astype(float))).tocsr()[np.flatnonzero(kept)]
    shares = (inwards + inwards @ _shared(scaled(near, last, beyond))).tocsr()
    area = shares @ slave.area
    W = scaled(shares, 1 / area, slave.area)
    centroid = W @ slave.centroid
    second = W @ (slave.moment + dyads(slave.centroid)).reshape(-1, 9)
    merged = slave._replace(
        area=area, centroid=centroid, moment=second.reshape(-1, 3, 3) - dyads(centroid), means=W @ slave.means,
        touch=ones(slave.touch @ inwards.T), trust=np.ones_like(area), ends=shares @ beyond.astype(float) > 0,
    )  # fmt: skip
    return merged, W


def _shared(shares: csr_array) -> csr_array:
    """Return shares (n, n) of columns among rows, the same for each row that a column has, with sums of 1 or 0."""
    count = shares.sum(axis=0)
    return scaled(shares, 1.0, np.divide(1.0, count, out=np.zeros_like(count), where=count > 0))


def _balanced(
    slave: Slave, q: Floats, means: Floats, contact: Bools, covered: Floats, scatter: Floats, last: Bools
) -> NDArray[np.floating]:
    """Return nodal values (k,) of the pressure, with which each connected part of the contact has the force of its p_m.

    `q` (k,): squares of the pressure, negative beyond the edge of contact. The force is that on the `covered` areas
    (n,). First the edge moves, by a constant that is added to q at the `last` nodes (k,); then nodes where the fit
    misses the means by more than their `scatter` (n,) are corrected; then all are scaled.
    """
    touch = only(slave.touch, contact)
    part = joined_columns(touch)
    held = np.flatnonzero(np.diff(touch.indptr))
    of_node = part[touch.indices[touch.indptr[held]]]
    integral = (slave.means.T @ covered)[held]
    wanted = np.bincount(part, covered * means)

    def lacking(p: Floats) -> NDArray[np.floating]:
        """Return the missing force (parts,) of nodal values p."""
        return np.asarray(wanted - np.bincount(of_node, integral * p, minlength=len(wanted)))

    def shares(p: Floats) -> NDArray[np.floating]:
        """Return the missing force (parts,) of the balanced values, relative to the force of p."""
        theirs = np.bincount(of_node, integral * p, minlength=len(wanted))
        return np.divide(lacking(out), theirs, out=np.zeros_like(wanted), where=theirs > 0)

    out = _moved(q[held], last[held], of_node, lacking)
    balanced = np.sqrt(np.maximum(q, 0.0))
    balanced[held] = out
    missed = _missed(slave, balanced, means, scatter)
    missed = np.where(missed * np.sign(lacking(out))[part] > 0, missed, 0.0)
    local = (touch @ (covered * missed))[held] / np.maximum((touch @ covered)[held], np.finfo(float).tiny)
    local = np.maximum(local, -out)
    out = out + np.minimum(np.abs(shares(np.abs(local))), 1.0)[of_node] * local
    balanced[held] = out * (1 + shares(out))[of_node]
    return balanced


def _moved(q: Floats, last: Bools, part: Ints, lacking: Callable[[Floats], Floats]) -> NDArray[np.floating]:
    """Return the roots (k,) of q, 0 where it is negative, when the edge of contact has moved so that forces agree.

    A constant for each `part` (k,) of the contact is added to q at the `last` nodes. It is bisected within bounds, at
    which the largest of these pressures changes by the factor `_MOST`. `lacking`: the missing force (parts,).
    """
    q = np.where(q < 0, _BEYOND * q, q)

    def root(c: Floats) -> NDArray[np.floating]:
        return np.sqrt(np.maximum(q + np.where(last, c[part], 0.0), 0.0))

    largest = np.zeros_like(lacking(q))
    np.maximum.at(largest, part[last], q[last])
    low, high = (1 / _MOST**2 - 1) * largest, (_MOST**2 - 1) * largest
    for _ in range(_HALVINGS):
        c = (low + high) / 2
        more = lacking(root(c)) > 0
        low, high = np.where(more, c, low), np.where(more, high, c)
    return root((low + high) / 2)


def _missed(slave: Slave, p: Floats, means: Floats, scatter: Floats) -> NDArray[np.floating]:
    """Return by how much (n,) the means of nodal values p miss `means`, 0 where that is usual.

    Usual are some times the `scatter` (n,), and the standard deviation of p at the nodes of the macro-element.
    """
    mean, count = slave.means @ p, np.maximum(slave.touch.sum(axis=0), 1)
    square = slave.touch.T @ p**2 - 2 * mean * (slave.touch.T @ p)
    usual = np.sqrt(np.maximum(square / count + mean**2, 0.0) + (_USUAL * scatter) ** 2)
    return np.asarray((means - mean) * between(np.abs(means - mean), usual, _POOR))
