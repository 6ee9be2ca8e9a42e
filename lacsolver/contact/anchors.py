"""Anchors: pairs of points of slave and master that were in front of each other when their macro-element last slid.

The slip of a macro-element is measured between them, along the tangents of the slave as they are now (`shear`):

    S_alpha = sum w e_alpha(u).(x(u) - x_bar(u))
    D_T v = dS = sum w [ e_alpha.(v - v_bar) + de_alpha(v).(x - x_bar) ]

Rotations of both skins change no S. A macro-element that sticks keeps its anchors, so that no drift adds up, however
many steps it sticks for. Where it slides or is open they are renewed at the end of each step (`renewed`), and S is 0 at
that time: x_bar - x is along n.

A macro-element that covers ten times as much as its anchors do, or has none, was just entered by the master. Its slip
is that of the points that are in front of each other now, since the last state u_0,

    S_alpha = -sum w e_alpha(u_0).(x(u_0) - x_bar(u_0))
    D_T v = sum w [ e_alpha.dx_bar/dxi^b - de_alpha/dxi_bar^b.(x - x_bar) ](u_0) dxi_bar^b + dw s_alpha

as xi_bar moves (`tangent`), and with it the master's normal that e_alpha is normal to. With the tangents' change

    de_1 = -n (e_1.dn) + e_2 spin,   de_2 = -n (e_2.dn) - e_1 spin,
    spin = e_2.(c^a dv/dxi^a - (n.a_1) dn) / |a_1 - n n.a_1|

D_T is a sum of products with v - v_bar, with dv/dxi^a, and with dn (`shear`, `chain`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from lacmesh.mesh import Floats, Ints
from lacmesh.surface import ContactPoints, Surface
from lacmesh.surface.maps import interpolated, slopes, values
from lacmesh.surface.normals import dual_vectors, normals_of, smooth_normals, unit
from lacsolver.contact.faces import places, tangents
from lacsolver.contact.interface import Interface, Pairing, own_macros
from lacsolver.contact.normals import OtherNormals, other_normals
from lacsolver.contact.rows import macro_rows, normal_rows, skins_of
from lacsolver.contact.shear import frames, integrals
from lacsolver.contact.zone import Zone
from lacsolver.distributed.share import ALONE, Share

if TYPE_CHECKING:
    from lacsolver.contact.tangent import Motion

#: part of what a macro-element covers that its anchors must have covered
_LEAST = 0.1


class Anchors(NamedTuple):
    """Anchored pairs of points (n,), by macro-element: reference points of the slave's faces and of the master's.

    `macro`: ascending; `slave`, `master`: faces; `xi_slave`, `xi_master` (n, 2); `weight`: what each stands for.
    """

    macro: Ints
    slave: Ints
    master: Ints
    xi_slave: Floats
    xi_master: Floats
    weight: Floats

    @staticmethod
    def none() -> Anchors:
        """Return those of skins that have not met."""
        no, none, points = np.empty(0, np.int64), np.empty(0), np.empty((0, 2))
        return Anchors(no, no, no, points, points, none)


@dataclass(frozen=True, eq=False)
class Slip:
    """Slip of each macro-element: its integral `S` (m, d - 1), over the measure `w` (m,); S / w is the mean slip.

    `entered` (m,): True for macro-elements that the master has just entered, whose anchors do not count.
    `derivative()` returns D_T, once it is needed.
    """

    S: Floats
    w: Floats
    entered: NDArray[np.bool_]
    derivative: Callable[[], csr_array]

    @cached_property
    def D_T(self) -> csr_array:
        """The derivative dS/du (m (d - 1), n_dof)."""
        return self.derivative()


class _Directions(NamedTuple):
    """Normals n (points, 3) and tangents at points of a slave, e and c of `shear.Tangents`.

    J (points, 3, dim of the skins): tangents of the faces along their coordinates.

    With other normals than those of the slave's faces `others`, and `size` (points,), that of their interpolation; else
    None and 1. `along` (points, 3, dim of the skins): derivative of n by the coordinates in the master's face, zeros
    where n is of the slave.
    """

    n: Floats
    e: Floats
    c: Floats
    J: Floats
    others: OtherNormals | None
    size: Floats
    along: Floats


def own_anchors(anchors: Anchors, zone: Zone, share: Share) -> Anchors:
    """Return those of the macro-elements that this process pairs, of the anchors of all of them."""
    if share.own is None:
        return anchors
    own = np.zeros(zone.n_macros, bool)
    macro = own_macros(zone, share)
    own[macro[macro >= 0]] = True
    return Anchors._make(values[own[anchors.macro]] for values in anchors)


def all_anchors(anchors: Anchors, share: Share) -> Anchors:
    """Return the anchors of all processes, by macro-element, of those of this one."""
    if share.own is None:
        return anchors
    joined = [share.gather(values) for values in anchors]
    order = np.argsort(joined[0], kind="stable")
    return Anchors._make(values[order] for values in joined)


def renewed(anchors: Anchors, face: Interface, which: NDArray[np.bool_]) -> Anchors:
    """Return anchors with those of some macro-elements, a mask (m,), replaced by the pairs of an interface."""
    points, kept, new = face.points, ~which[anchors.macro], which[face.points.macro]
    of_face = points.macro, points.slave, points.master, points.xi_slave, points.xi_master, face.weight
    joined = [np.concatenate([a[kept], b[new]]) for a, b in zip(anchors, of_face, strict=True)]
    order = np.argsort(joined[0], kind="stable")
    return Anchors._make(values[order] for values in joined)


def slip(
    anchors: Anchors, face: Interface, pairing: Pairing, before: Floats, share: Share = ALONE,
    motion: Callable[[], Motion | None] = lambda: None,
) -> Slip:  # fmt: skip
    """Return the slip of a zone in the configuration of an interface.

    `before` (n_nodes, 3): coordinates in the last state, where the anchors were renewed. `motion()`: the derivatives of
    the interface, None if they are left out; then D_T is B_T where the master has entered.
    """
    m, d = len(face.w), face.normal.shape[1]
    at = _directions(face.zone, face.slave, face.master, anchors, pairing, d)
    y = _apart(face.slave, face.master, anchors)
    S = share.total(integrals(np.einsum("pas,ps->pa", at.e, y[:, :d]), anchors.macro, anchors.weight, m))
    w = share.total(np.bincount(anchors.macro, anchors.weight, m).astype(float))
    entered = w < _LEAST * face.w
    if entered.any():
        since = _since(face, pairing, before, face.points)[0]
        total = share.total(integrals(since, face.points.macro, face.weight, m))
        S, w = np.where(entered[:, None], total, S), np.where(entered, face.w, w)

    def derivative() -> csr_array:
        D_T = _derivative(anchors, face, at, y)
        if not entered.any():
            return share.add_matrices(D_T, (False, True))
        assert face.B_T is not None
        keep, take = (diags_array(np.repeat(rows, d - 1).astype(float)) for rows in (~entered, entered))
        moved = motion()
        if moved is None:
            return csr_array(share.add_matrices(csr_array(keep @ D_T), (False, True)) + take @ face.B_T)
        D_T = csr_array(keep @ D_T + _derivative_since(face, pairing, before, entered, moved))
        return share.add_matrices(D_T, (False, True))

    return Slip(S, w, entered, derivative)


def _apart(slave: Surface, master: Surface, points: ContactPoints | Anchors) -> NDArray[np.floating]:
    """Return x - x_bar (points, 3) of pairs of points."""
    x = places(slave, points.slave, points.xi_slave)
    return np.asarray(x - places(master, points.master, points.xi_master))


def _since(
    face: Interface, pairing: Pairing, before: Floats, points: ContactPoints | Anchors
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return the slip (points, d - 1) of pairs of points since the last state, and its derivative by xi_bar.

    The derivative is (points, d - 1, d - 1).
    """
    d = face.normal.shape[1]
    slave, master = face.zone.slave.at(before), face.zone.master.at(before)
    at, y = _directions(face.zone, slave, master, points, pairing, d), _apart(slave, master, points)
    J = tangents(master, points.master, points.xi_master)
    of_dn, _ = _turned(at, y)
    return -np.einsum("pas,ps->pa", at.e, y[:, :d]), at.e @ J[:, :d] - of_dn @ at.along[:, :d]


def _derivative_since(
    face: Interface, pairing: Pairing, before: Floats, entered: NDArray[np.bool_], motion: Motion
) -> csr_array:
    """Return D_T (m (d - 1), n_dof) of the macro-elements that the master has entered, zeros elsewhere."""
    assert motion.along is not None
    slips = []
    for loop, along in zip(motion.loops, motion.along, strict=True):
        at, macro = loop.points, face.zone.macro[along.slave]
        pairs = Anchors(macro, along.slave, along.master, at.xi_s, at.xi_m, loop.weight)
        slips.append(_since(face, pairing, before, pairs))
    return motion.slips(entered, slips)


def _derivative(anchors: Anchors, face: Interface, at: _Directions, y: Floats) -> csr_array:
    """Return D_T (m (d - 1), n_dof) of anchors, with x - x_bar of their points in y (points, 3)."""
    slave, master, d, m = face.slave, face.master, face.normal.shape[1], len(face.w)
    of_dn, arms = _turned(at, y)
    if at.others is None:
        dual, N = dual_vectors(at.J), unit(normals_of(at.J))
        along, out = of_dn @ dual[:, :d], np.einsum("psa,ps->pa", dual, at.n)
        leans = out[:, :, None] * (of_dn @ N[:, :d, None]).transpose(0, 2, 1)
        arms += leans[..., None] * N[:, None, None, :d] - along.transpose(0, 2, 1)[..., None] * at.n[:, None, None, :d]
    weight = anchors.weight[:, None, None]
    D_T = macro_rows(anchors, slave, master, weight * at.e, m, weight[..., None] * arms)
    if at.others is not None:
        across = of_dn - np.einsum("pks,ps->pk", of_dn, at.n[:, :d])[..., None] * at.n[:, None, :d]
        q = weight * across / at.size[:, None, None]
        D_T = csr_array(D_T + normal_rows(anchors, slave, master, at.others, q, m))
    return D_T


def _turned(at: _Directions, y: Floats) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return the factors of dn (points, d - 1, d) and of dv/dxi^a (points, d - 1, d - 1, d) in de_alpha.y."""
    d = at.e.shape[2]
    of_dn, arms = -(at.n * y).sum(axis=1)[:, None, None] * at.e, np.zeros((len(y), d - 1, d - 1, d))
    if d == 3:
        _add_spin(at, y, of_dn, arms)
    return of_dn, arms


def _add_spin(at: _Directions, y: Floats, of_dn: Floats, arms: Floats) -> None:
    """Add the terms of the tangents' spin about n to the vectors that dn and dv/dxi^a are multiplied by."""
    a_1 = np.einsum("psa,pa->ps", at.J, at.c)
    out = (a_1 * at.n).sum(axis=1)
    size = (a_1 * at.e[:, 0]).sum(axis=1)  # of the part of a_1 that is normal to n
    turned = np.stack([(at.e[:, 1] * y).sum(axis=1), -(at.e[:, 0] * y).sum(axis=1)], axis=1)
    turned = np.divide(turned, size[:, None], out=np.zeros_like(turned), where=size[:, None] > 0)
    spin = turned[:, :, None] * at.e[:, None, 1]
    of_dn -= out[:, None, None] * spin
    arms += at.c[:, :, None, None] * spin[:, None]


def _directions(
    zone: Zone, slave: Surface, master: Surface, points: ContactPoints | Anchors, pairing: Pairing, d: int
) -> _Directions:
    """Return the normals of a pairing, and the tangents, at points of a slave as the skins are deformed."""
    face, xi = points.slave, points.xi_slave
    J = tangents(slave, face, xi)
    others = other_normals(slave, master, pairing.normals, pairing.crease_angle, d, skins_of(slave, master)[1])
    along = np.zeros_like(J)
    if others is None:
        H = smooth_normals(J, slave.leans(face, xi))
    elif others.of_master:
        G = interpolated(master.faces.type, others.n[others.of_faces])
        H, along = values(G, points.master, points.xi_master), slopes(G, points.master, points.xi_master, slave.dim)
    else:
        H = values(interpolated(slave.faces.type, others.n[others.of_faces]), face, xi)
    n, size = unit(H), np.linalg.norm(H, axis=1)
    along = (along - n[:, :, None] * (n[:, None] @ along)) / size[:, None, None]
    return _Directions(n, *frames(zone, face, xi, n, J), J, others, size, along)
