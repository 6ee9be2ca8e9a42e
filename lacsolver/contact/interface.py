"""Pairing and integration of two skins in a given configuration: contact matrices and integrals of the gap.

B v = int_{T_m} (v(x) - v(x_bar)).n dGamma, the virtual work of a unit pressure on macro-element m   (26), (35)
G   = int_{T_m} g dGamma, g = (x_bar - x).n - b_s - b_m + clearance                                  (27)

b_s, b_m are the heights of the smooth surfaces above the faces, 0 where the faces are the surfaces themselves.
A tie has d rows for each macro-element, for the jump int_{T_m} (v(x) + r dn(v) - v(x_bar)) e_k dGamma, where dn is the
change of the slave's normal under v: this corrects for the moment arm r = (x_bar - x).n, so that the jump of a rigid
rotation is zero. Friction adds d - 1 rows to the normal one, for the jump along tangents of the slave (`shear`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array, kron, vstack

from lacmesh.mesh import Floats, Ints
from lacmesh.surface import ContactPoints, Surface, contact_points, default_distance
from lacmesh.surface.maps import coefficients
from lacmesh.surface.normals import measures, unit
from lacmesh.surface.points import face_measure
from lacmesh.surface.record import mean_normals
from lacsolver.contact.faces import places, tangents
from lacsolver.contact.rows import macro_rows
from lacsolver.contact.shear import Tangents, frames, integrals, jump_rows
from lacsolver.contact.zone import Zone
from lacsolver.distributed.share import ALONE, Share
from lacsolver.space.space import Space
from lacsolver.space.values import ScalarField, evaluate

#: gap, relative to the macro-element's size, below which bodies touch: a mesh has such gaps by round-off
TOUCHING = 1e-6
#: polynomial degree to which a clearance that is a formula is integrated, in addition to the shape functions
_CLEARANCE = 4
#: a gap across a tie below this, relative to the size of the faces, is round-off
_ROUNDING = 1e-13


class Turn(NamedTuple):
    """Rotation R (3, 3) about a centre (3,), which takes a master to where it faces its slave."""

    R: Floats
    centre: Floats

    def places(self, x: Floats) -> NDArray[np.floating]:
        """Return places x (n, 3), turned."""
        return np.asarray((x - self.centre) @ np.transpose(self.R) + self.centre)

    def apart(self, slave: Surface, master: Surface) -> tuple[Surface, Surface]:
        """Return both skins with the master turned, on nodes of its own: those of the mesh, turned, after these."""
        x, n = np.concatenate([slave.x, self.places(master.x)]), len(slave.x)
        nodes = np.where(master.faces.nodes >= 0, master.faces.nodes + n, -1)
        return replace(slave, x=x), replace(master, x=x, faces=replace(master.faces, nodes=nodes))

    def together(self, B: csr_array, dim: int) -> csr_array:
        """Return rows B (m, 2 n dim) of both skins on the nodes of the mesh, where the master moves by R u."""
        n = B.shape[1] // 2
        turned = kron(eye_array(n // dim), self.R[:dim, :dim], format="csr")
        return csr_array(B[:, :n] + B[:, n:] @ turned)


@dataclass(frozen=True)
class Pairing:
    """Options of the pairing of a zone: those of `lacmesh.contact_points`, the measure, thickness and clearance.

    `measure`: area that pressures refer to, `reference` or `current`; `thickness` of a plane model's slave, one or that
    of each macro-element; `clearance`: added to the gap, a value at points of the undeformed slave; `friction`: True
    for tangential rows beside the normal ones; `turn`: rotation of the master of a tie to where it faces the slave,
    None without one.
    """

    normals: str = "facet"
    crease_angle: float | None = None
    search_distance: float | None = None
    max_penetration: float | None = None
    axisymmetric: bool = False
    thickness: float | NDArray[np.floating] = 1.0
    measure: str = "reference"
    clearance: ScalarField = 0.0
    friction: bool = False
    turn: Turn | None = None

    def within(self, space: Space, zone: Zone, search_distance: float | None) -> Pairing:
        """Return the pairing of a zone with the axisymmetry and thickness of a space, and with a search distance.

        Raises DataError for a slave of unknown thickness.
        """
        thickness = space.thick(zone.slave.cell)
        if not isinstance(thickness, float):
            thickness = thickness[np.unique(zone.macro, return_index=True)[1]]  # a macro-element is on one cell
        return replace(
            self, search_distance=search_distance, axisymmetric=space.model.axisymmetric, thickness=thickness
        )

    def depth(self, macro: Ints) -> float | NDArray[np.floating]:
        """Return the thickness of all macro-elements, or that (k,) of some."""
        return self.thickness if isinstance(self.thickness, float) else self.thickness[macro]


@dataclass(frozen=True, eq=False)
class Interface:
    """Pairing and contact integrals of a zone in one configuration, one row per macro-element (m,).

    `B` (m, n_dof), or (d m, n_dof) for a tie, whose row d m + k is the jump along axis k; `G` (m,): integral of the
    gap, clearance included ((d m,) zeros for a tie); `w`: covered measure; `area`; `gap`: mean gap, integral of the gap
    over w, NaN where nothing is covered; `centre`, `normal` (m, d): of the slave's faces, or the mean of the master's
    where these are the direction of contact; `length` (m,): size of each macro-element.
    `points`: integration points, with their `weight` (points,) and `distance` (points,), the gap with the clearance.
    `slave`, `master`: the skins in this configuration, at time `t`. With friction, else None: `B_T` (m (d - 1), n_dof),
    the slip along the tangents of the slave, row m (d - 1) + alpha (`shear`); `frame` (m, d - 1, d): the means of the
    `tangents` at the points. `leans`: False for directions that depend on other faces too, smoothed or the master's.
    """

    zone: Zone
    slave: Surface
    master: Surface
    points: ContactPoints
    weight: Floats
    distance: Floats
    B: csr_array
    G: Floats
    w: Floats
    area: Floats
    gap: Floats
    centre: Floats
    normal: Floats
    length: Floats
    t: float = 1.0
    B_T: csr_array | None = None
    frame: Floats | None = None
    tangents: Tangents | None = None
    leans: bool = True

    @cached_property
    def all_rows(self) -> csr_array:
        """B, and below it B_T with friction."""
        return self.B if self.B_T is None else csr_array(vstack([self.B, self.B_T]))

    @property
    def touching(self) -> NDArray[np.bool_]:
        """True for macro-elements (m,) without a gap, up to round-off."""
        return np.asarray(self.gap <= TOUCHING * self.length)

    @property
    def coverage(self) -> NDArray[np.floating]:
        """Covered fraction w / A of each macro-element, in [0, 1], (m,)."""
        return np.clip(np.divide(self.w, self.area, out=np.zeros_like(self.w), where=self.area > 0), 0.0, 1.0)


def integrate(
    zone: Zone, dim: int, pairing: Pairing = Pairing(), *, x: Floats | None = None, t: float = 1.0, tie: bool = False,
    share: Share = ALONE, keeps: NDArray[np.bool_] | None = None,
) -> Interface:  # fmt: skip
    """Return the interface of a zone with its nodes at x (n_nodes, 3), or undeformed if x is None, at time t.

    `keeps` (m,): macro-elements that were in contact before, and keep to a plane master that they turn away from.

    Each of several processes pairs and integrates its own macro-elements, and all have the sums; `points`, with their
    weights and distances, remain those of its own.
    """
    slave, master = (zone.slave, zone.master) if x is None else (zone.slave.at(x), zone.master.at(x))
    if pairing.turn is not None:
        slave, master = pairing.turn.apart(slave, master)
    points = _points(zone, slave, master, pairing, x is not None, share, keeps)
    weight = points.weight * pairing.depth(points.macro)
    if x is not None and pairing.measure == "reference":
        weight = weight * stretch(zone, slave, points.slave, points.xi_slave, pairing.axisymmetric)
    n = np.ascontiguousarray(points.normal[:, :dim])
    m = zone.n_macros
    gap = points.gap + clearance(zone, points.slave, points.xi_slave, pairing, t)
    integral = share.total(np.bincount(points.macro, weight * gap, m).astype(float))
    w = share.total(np.bincount(points.macro, weight, m).astype(float))
    if tie:
        B = _jump(slave, master, points, weight, dim, m)
    else:
        B = macro_rows(points, slave, master, weight[:, None] * n, m)
    if pairing.turn is not None:
        B = pairing.turn.together(B, dim)
    B = share.add_matrices(B, (False, True))
    if pairing.measure == "reference":
        total = (zone.area_of_revolution if pairing.axisymmetric else zone.area) * pairing.thickness
    else:
        total = zone.sums(face_measure(slave, pairing.axisymmetric)) * pairing.thickness
    with np.errstate(invalid="ignore", divide="ignore"):
        average = np.where(w > 0, integral / w, np.nan)
    G = np.zeros(dim * m) if tie else integral
    centre, normal, length = mean_planes(zone, slave, dim)
    if pairing.normals == "master":
        along = share.total(integrals(n, points.macro, weight, m))
        normal = np.where(w[:, None] > 0, unit(along), normal)
    face = Interface(
        zone, slave, master, points, weight, gap, B, G, w, total, average, centre, normal, length, t,
        leans=pairing.normals == "facet",
    )  # fmt: skip
    return with_shear(face, share) if pairing.friction else face


def _points(
    zone: Zone, slave: Surface, master: Surface, pairing: Pairing, moved: bool, share: Share,
    keeps: NDArray[np.bool_] | None,
) -> ContactPoints:  # fmt: skip
    distance = pairing.search_distance
    if distance is None:  # that of the undeformed skins, which is constant
        turned = pairing.turn is not None
        distance = default_distance(zone.slave, master, zone.macro) if turned else zone.search_distance
    deepest = pairing.max_penetration
    if deepest is None and moved:  # during the iterations skins overlap by more than cells are deep
        deepest = distance
    return contact_points(
        slave, master, macro=own_macros(zone, share), normals=pairing.normals, crease_angle=pairing.crease_angle,
        search_distance=distance, max_penetration=deepest,
        axisymmetric=pairing.axisymmetric, degree=_CLEARANCE if callable(pairing.clearance) else 0,
        keeps=None if keeps is None else keeps[zone.macro],
    )  # fmt: skip


def own_macros(zone: Zone, share: Share) -> Ints:
    """Return the macro-element (faces,) of each face, -1 for those of other processes.

    A macro-element is of the process that has the first node of its first face.
    """
    if share.own is None:
        return zone.macro
    first = np.unique(zone.macro, return_index=True)[1]
    return np.where(share.own[zone.slave.faces.nodes[first, 0]][zone.macro], zone.macro, -1)


def clearance(zone: Zone, face: Ints, xi: Floats, pairing: Pairing, t: float) -> Any:
    """Return the clearance at time t, which is added to the gap, at points xi (n, 2) of slave faces."""
    if not callable(pairing.clearance):
        return pairing.clearance
    return evaluate(pairing.clearance, places(zone.slave, face, xi), t, "clearance")


def positions(slave: Surface, points: ContactPoints) -> NDArray[np.floating]:
    """Return the coordinates of the contact points on the slave, (points, 3)."""
    return places(slave, points.slave, points.xi_slave)


def stretch(zone: Zone, slave: Surface, face: Ints, xi: Floats, axisymmetric: bool) -> NDArray[np.floating]:
    """Return the ratio of undeformed to deformed area (length in a plane) of the slave at points xi (n, 2) of faces."""
    before, after = (measures(coefficients(s), face, xi, s.dim, axisymmetric) for s in (zone.slave, slave))
    return np.asarray(np.divide(before, after, out=np.ones_like(after), where=after > 0))


def dips(face: Interface, share: Share) -> NDArray[np.floating]:
    """Return how far points of the slave are inside the master beyond the mean gap, over each macro-element's size."""
    macro, out = face.points.macro, np.zeros(len(face.w))
    np.maximum.at(out, macro, np.minimum(face.gap, 0.0)[macro] - face.distance)
    return np.divide(share.total(out), face.length, out=np.zeros_like(out), where=face.length > 0)


def _jump(slave: Surface, master: Surface, points: ContactPoints, weight: Floats, dim: int, m: int) -> csr_array:
    """Return the rows d m + k of the jump along each axis k, (d m, n_dof)."""
    if np.abs(points.ray).max(initial=0.0) > _ROUNDING * slave.size.max():
        axes = np.broadcast_to(np.eye(dim), (len(points), dim, dim))
        J = tangents(slave, points.slave, points.xi_slave)
        rows = jump_rows(slave, master, points, weight, axes, m, J)
        rows.eliminate_zeros()
        return rows
    scalar = macro_rows(points, slave, master, np.ascontiguousarray(weight[:, None]), m)
    return csr_array(kron(scalar, np.eye(dim), format="csr"))


def with_shear(face: Interface, share: Share = ALONE) -> Interface:
    """Return an interface with its tangential rows, and the means of its tangents."""
    points, m = face.points, len(face.w)
    J = tangents(face.slave, points.slave, points.xi_slave)
    directions = frames(face.zone, points.slave, points.xi_slave, points.normal, J)
    e = directions.e
    rows = jump_rows(face.slave, face.master, points, face.weight, e, m, J, leans=face.leans)
    B_T = share.add_matrices(rows, (False, True))
    sums, w = share.total(integrals(e, points.macro, face.weight, m)), face.w[:, None, None]
    return replace(face, B_T=B_T, tangents=directions, frame=np.divide(sums, w, out=np.zeros_like(sums), where=w > 0))


def mean_planes(zone: Zone, slave: Surface, dim: int) -> tuple[Floats, Floats, Floats]:
    """Return centre and unit normal (m, d) of each macro-element, area-weighted means over its faces, and size (m,)."""
    normal, centre = mean_normals(slave)
    size = face_measure(slave)
    whole = zone.sums(size)
    total = whole[:, None]
    out = zone.sums(normal * size[:, None])
    length = np.linalg.norm(out, axis=1, keepdims=True)
    middle = zone.sums(centre * size[:, None]) / np.where(total > 0, total, 1.0)
    unit = np.divide(out, length, out=np.zeros_like(out), where=length > 0)
    return middle[:, :dim], unit[:, :dim], whole ** (1 / slave.dim)
