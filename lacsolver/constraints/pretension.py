"""Sections of bolts: two sides that move together but for a shortening s along the normal n, which points from a to b.

    u_a - u_b = s n     at each pair of nodes, or in the mean over each macro-element of side a

The force F that pulls the sides together does the work F s, so it is the bolt's tension: F = n . f, with f the
resultant of what the equations exert on side a. Where the nodes of the sides coincide, each pair has an equation;
elsewhere side a is cut as a slave is, and the equations are those of a tie (`contact.interface`), divided by the
covered area. In finite kinematics n keeps its direction in space.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array, kron

from lacmesh.checks.bodies import same_place
from lacmesh.cutting.records import Cut, is_cut
from lacmesh.errors import LacmeshError, some
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.topology.orientation import face_normals
from lacmesh.topology.skin import Faces, cells_of_dim, distinct_faces, find_owners, label_rows
from lacsolver.case import Case, Pretension
from lacsolver.constraints.equality_rows import EqualityAt, EqualityRows, Locked, Unlocked, until
from lacsolver.constraints.equations import Equations
from lacsolver.contact.interface import Pairing, integrate
from lacsolver.contact.laws import ContactLaw
from lacsolver.contact.zone import Zone
from lacsolver.space.places import in_words, wrong
from lacsolver.space.space import Space
from lacsolver.space.sparse import sparse

#: distance of two nodes at one place, relative to the section's extent
_PLACE = 1e-8
#: least cosine of the angle between a given normal and the mean normal of the faces
_ALONG = 0.1
#: part of a normal across the axis that is round-off
_SAME = 1e-9
#: macro-elements that are covered less are not held
_COVERED = 1e-6


@dataclass(frozen=True, eq=False)
class BoltSection:
    """A section of a bolt: the equations C u = s n between its sides, `dim` rows each; built by `section_of`.

    `C` (k dim, n_dof); `weight` (k,): part of each equation in the mean over the section; `normal` (dim,), from side a
    to side b; `nodes`: those of side a; `centre` (dim,): centre of its faces' area.
    """

    record: Pretension
    C: csr_array
    weight: Floats
    normal: Floats
    nodes: Ints
    centre: Floats

    @property
    def name(self) -> str:
        """Name of the equations' forces in a state."""
        return f"pretension {self.record.name}"

    @property
    def lock_name(self) -> str:
        """Name of the force of the lock in a state."""
        return f"lock of {self.name}"

    @property
    def mean(self) -> csr_array:
        """Row (1, n_dof) whose product with u is the shortening: the mean of n . (u_a - u_b)."""
        return csr_array(np.kron(self.weight, self.normal)[None] @ self.C)

    def held_until(self, t: float) -> float:
        """Return the time at which the shortening or the force is taken: t, or that of the lock if it is before."""
        return t if self.record.lock is None else min(t, self.record.lock)

    def equations(self) -> Equations:
        """Return the equations of the section, with the shortening as a further unknown where the force is given."""
        record, n, words = self.record, np.tile(self.normal, len(self.weight)), partial(in_words, self.record)
        if record.force is None:
            return Equations(self.name, self.C, partial(self._prescribed, n), words, may_follow=True)
        E, loads = csr_array(-n[:, None]), self._load
        zeros = np.zeros(len(n))
        return Equations(self.name, self.C, lambda t: zeros, words, E=E, loads=loads, may_follow=True)

    def _prescribed(self, n: Floats, t: float) -> NDArray[np.floating]:
        assert self.record.shortening is not None
        return n * self.record.shortening.at(self.held_until(t))

    def _load(self, t: float) -> NDArray[np.floating]:
        assert self.record.force is not None
        return np.array([self.record.force.at(self.held_until(t))])


class SectionForces(NamedTuple):
    """Forces and moment that a section of a bolt carries, and its shortening.

    `force`: along the normal, positive where it pulls the sides together; `shortening`: positive where these would
    overlap; `moment` about the centre of the section, which side b exerts on side a: (3,), one number () in a plane,
    None where axisymmetric; `resultant` (dim,): the whole force on side a, with what is across the bolt.
    """

    force: float
    shortening: float
    moment: Floats | None
    resultant: Floats


def carried_by(
    section: BoltSection, space: Space, u: Floats, forces: Mapping[str, Floats], *, displaced: bool
) -> SectionForces:
    """Return what a section carries at u (n_dof,), with the `forces` of all equations by name.

    `displaced`: moments are about the displaced centre, of forces at displaced nodes.
    """
    f = section.C.T @ forces[section.name]
    if section.lock_name in forces:
        f = f + section.mean.T @ forces[section.lock_name]
    f = f.reshape(-1, space.dim)[section.nodes]
    x = space.mesh.points[section.nodes, : space.dim] - section.centre
    if displaced:
        own = u.reshape(-1, space.dim)[section.nodes]
        x = x + own - own.mean(axis=0)
    resultant = f.sum(axis=0)
    moment = None if space.model.axisymmetric else _moment(x, f)
    return SectionForces(float(section.normal @ resultant), float((section.mean @ u)[0]), moment, resultant)


def _moment(x: Floats, f: Floats) -> NDArray[np.floating]:
    if x.shape[1] == 2:
        return np.asarray((x[:, 0] * f[:, 1] - x[:, 1] * f[:, 0]).sum())
    return np.asarray(np.cross(x, f).sum(axis=0))


# ---- for the constraints of a case


def equations_of(space: Space, case: Case) -> Iterator[Equations]:
    """Yield the equations of each section of a case. Raises CaseError for sides that are no section."""
    for record in case.pretension:
        yield section_of(space, record).equations()


def locks_of(space: Space, case: Case) -> Iterator[EqualityRows]:
    """Yield a row of equality for each section that is tightened by a force and locked."""
    for record in case.pretension:
        if record.lock is not None and record.force is not None:
            yield Lock(section_of(space, record))


@dataclass(frozen=True, eq=False)
class Lock:
    """The shortening of a section, which keeps its value from the time of the lock on."""

    section: BoltSection
    linear = True

    @property
    def name(self) -> str:
        """Name in the results."""
        return self.section.lock_name

    @property
    def record(self) -> Pretension:
        """The record of the case."""
        return self.section.record

    def at(self, u: Floats, t: float) -> EqualityAt:
        """Return minus the shortening, and the row of its derivative."""
        return EqualityAt(-(self.section.mean @ u), self.section.mean)

    def curvature(self, u: Floats, t: float, p: Floats) -> csr_array | None:
        """Return None: the row is constant."""
        return None

    def law(self, t: float) -> ContactLaw:
        """Return what lets the shortening go and remembers it until the lock, and what keeps it after that."""
        assert self.record.lock is not None
        return Unlocked() if until(t, self.record.lock) else Locked()


# ---- the sides of a section


def sides_of(mesh: Mesh, record: Pretension) -> tuple[str, str]:
    """Return the names of the two skins of a section, whose group may be named by a tag."""
    name = record.group
    if f"{name}_a" not in mesh.cell_groups and not name.startswith("entity:"):
        with suppress(LacmeshError):
            name = mesh.group(name)
    return f"{name}_a", f"{name}_b"


def coincide(mesh: Mesh, record: Pretension) -> bool:
    """True if each node of side a has one of side b at its place, and no side is cut."""
    a, b = (_faces(mesh, record, name) for name in sides_of(mesh, record))
    return not _is_cut(mesh, record) and _partners(mesh, a, b) is not None


def section_of(space: Space, record: Pretension) -> BoltSection:
    """Return the section of a record. Raises CaseError for sides that are no skins, that meet, or are not covered."""
    mesh = space.local
    faces = _faces(mesh, record, sides_of(mesh, record)[0]), _faces(mesh, record, sides_of(mesh, record)[1])
    a, b = (side.distinct_nodes for side in faces)
    shared = np.intersect1d(a, b)
    if len(shared):
        message = (
            f"its sides share nodes {some(mesh.node_number[shared], limit=8)}, where the faces end inside the body"
        )
        advice = "the faces must divide the bolt completely; add the missing ones"
        raise wrong(record, f"{message}: {advice}")
    n, centre = _normal(space, record, faces[0]), _centre(mesh, faces[0])
    pairs = None if _is_cut(mesh, record) else _partners(mesh, *faces)
    if pairs is None:
        C, weight = _tied(space, record)
    else:
        C, weight = _paired(space, *pairs.T), np.full(len(pairs), 1 / len(pairs))
    return BoltSection(record, C, weight, n, a, (centre + space.origin)[: space.dim])


def _faces(mesh: Mesh, record: Pretension, name: str) -> Faces:
    """Return the faces of a side, each once. Raises CaseError for what is no skin of a body."""
    try:
        cells = mesh.cells_of(name)
    except LacmeshError as error:
        raise wrong(record, str(error)) from None
    cells = cells[mesh.cell_dim[cells] == mesh.dim - 1]
    if not len(cells):
        raise wrong(record, f"the surface {name!r} has no faces")
    faces, first = distinct_faces(mesh, cells)
    owners = find_owners(faces, cells_of_dim(mesh, mesh.dim), mesh.n_nodes)
    count = np.bincount(owners.face, minlength=len(faces))
    if (count != 1).any():
        names = mesh.cell_names(cells[first[count != 1]])
        raise wrong(record, f"faces {names} of {name!r} do not lie on the surface of a body, each on one cell")
    return faces


def _is_cut(mesh: Mesh, record: Pretension) -> bool:
    """True if side a has been cut into macro-elements."""
    return is_cut(mesh) and bool((Cut(mesh).macro_of_face[mesh.cells_of(sides_of(mesh, record)[0])] >= 0).any())


def _partners(mesh: Mesh, one: Faces, other: Faces) -> Ints | None:
    """Return pairs (n, 2) of a node of side a and the one of side b at its place, None if the faces do not coincide.

    A node is in several pairs where a side meets itself.
    """
    if len(one) != len(other):
        return None
    nodes = Faces.stack([one, other]).distinct_nodes
    x = mesh.points[nodes]
    place = np.full(mesh.n_nodes + 1, -1)  # one more, for the padding's -1
    place[nodes] = same_place(x, _PLACE * float(np.ptp(x, axis=0).max()))
    ordered = [np.take_along_axis(f.nodes, np.argsort(place[f.nodes], axis=1), axis=1) for f in (one, other)]
    labels, _ = label_rows(place[np.vstack(ordered)] + 1)
    of_one, of_other = labels[: len(one)], labels[len(one) :]
    rows = np.argsort(of_one), np.argsort(of_other)
    if not np.array_equal(of_one[rows[0]], of_other[rows[1]]):
        return None
    pairs = np.stack([ordered[k][rows[k]].ravel() for k in range(2)], axis=1)
    return np.unique(pairs[pairs[:, 0] >= 0], axis=0)


def _normal(space: Space, record: Pretension, faces: Faces) -> NDArray[np.floating]:
    """Return the unit normal (dim,) from side a to side b. Raises CaseError for one that lies in the section."""
    mesh, d = space.local, space.dim
    normals = face_normals(mesh, faces)
    owners = find_owners(faces, cells_of_dim(mesh, mesh.dim), mesh.n_nodes)
    inside = np.empty((mesh.n_cells, 3))
    for _, cells, nodes in mesh.select(np.sort(owners.cell)):
        inside[cells] = mesh.points[nodes].mean(axis=1)
    there = mesh.points[faces.corners[:, :2]].mean(axis=1)
    outward = ((there - inside[owners.cell]) * normals).sum(axis=1) >= 0
    mean = (normals * np.where(outward, 1.0, -1.0)[:, None]).sum(axis=0)[:d]
    size, area = np.linalg.norm(mean), np.linalg.norm(normals, axis=1).sum()
    if size <= _ALONG * area:
        raise wrong(record, "its faces have no mean normal, as those of a closed surface; name those of one section")
    mean /= size
    if record.normal is None:
        n = mean
    else:
        n = np.array(record.normal) / np.linalg.norm(record.normal)
        n = -n if n @ mean < 0 else n
        if n @ mean < _ALONG:
            raise wrong(record, f"normal lies in the section, whose own is [{', '.join(f'{c:.4g}' for c in mean)}]")
    if space.model.axisymmetric and abs(n[0]) > _SAME:
        raise wrong(record, "normal is not along the axis y, as that of an axisymmetric bolt is; give normal = [0, 1]")
    return n


def _centre(mesh: Mesh, faces: Faces) -> NDArray[np.floating]:
    """Return the centre (3,) of the area of plane faces."""
    x, there = mesh.points[faces.corners], faces.corners >= 0
    if there.sum(axis=1).max() == 2:
        return np.average(x[:, :2].mean(axis=1), axis=0, weights=np.linalg.norm(x[:, 1] - x[:, 0], axis=1))
    last = np.where(there[:, 3:4], x[:, 3], x[:, 2])
    parts = [np.stack([x[:, 0], x[:, 1], x[:, 2]], axis=1), np.stack([x[:, 0], x[:, 2], last], axis=1)]
    area = np.concatenate([np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1) for p in parts])
    return np.average(np.concatenate([p.mean(axis=1) for p in parts]), axis=0, weights=area)


def _paired(space: Space, a: Ints, b: Ints) -> csr_array:
    """Return the rows (dim n, n_dof) of u_a - u_b."""
    rows = np.arange(space.dim * len(a)).reshape(len(a), -1)
    return sparse((rows.size, space.n_dof), (rows, space.dofs(a), 1.0), (rows, space.dofs(b), -1.0))


def _tied(space: Space, record: Pretension) -> tuple[csr_array, NDArray[np.floating]]:
    """Return the rows of the mean of u_a - u_b over each macro-element of side a, and the weights of these."""
    a, b = sides_of(space.mesh, record)
    try:
        zone = Zone.of(space.local, a, b, surface="faces")
        face = integrate(zone, space.dim, Pairing().within(space, zone, None), tie=True)
    except LacmeshError as error:
        raise wrong(record, str(error)) from None
    covered = np.flatnonzero(face.coverage > _COVERED)
    if not len(covered):
        raise wrong(record, f"side {b!r} lies nowhere in front of side {a!r}")
    rows = (space.dim * covered[:, None] + np.arange(space.dim)).ravel()
    scale = kron(diags_array(1 / face.w[covered]), diags_array(np.ones(space.dim)))
    return csr_array(scale @ face.B[rows]), face.w[covered] / face.w[covered].sum()
