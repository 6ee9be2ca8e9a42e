"""Roles of two surfaces: which of them is the slave where a case names them without saying so.

The rules, in their order, each for two surfaces that those before do not tell apart: macro-elements in the mesh; cells
behind the faces; internal dofs that are free; enough faces to keep a body from turning; faces that the other covers;
the softer body; the finer faces; the more convex surface; the name that comes first in the alphabet. All are of the
mesh before its cut, relative, and coarser than round-off: units, numbering and the order of the two names do not count.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.cutting.records import Cut, is_cut
from lacmesh.errors import LacmeshError
from lacmesh.mesh import Ints, Mesh, mask_of
from lacmesh.origin import from_origin, origin_of_mesh
from lacmesh.surface import Surface, contact_points, coverage
from lacmesh.surface.normals import CREASE_ANGLE, unit, weighted
from lacmesh.surface.points import face_measure
from lacmesh.surface.record import mean_normals
from lacmesh.topology.skin import cells_of_dim, find_owners
from lacsolver.case import Case, Contact, Displacement, Rigid, Tie
from lacsolver.constraints.coupling import rigid_records
from lacsolver.constraints.cyclic import with_sectors
from lacsolver.contact.zone import Zone
from lacsolver.problem.pair import ContactPair
from lacsolver.space.places import wrong

#: fewer faces of a slave than this, by dimension, may not keep a body from turning
FEW = {2: 2, 3: 3}
#: square of the sine of the least angle at which a free direction may stand to the normal's plane
_FREE = 0.01
#: parts of a surface that are taken for the same; ratios of moduli and of sizes; angles between faces, in radian
_PART, _RATIO, _ANGLE = 0.05, 1.1, 0.01
#: angle between the faces of a plane, in radian, which rounded coordinates make
_PLANE = 1e-4


def with_roles(case: Case, mesh: Mesh) -> Case:
    """Return the case with the roles of surfaces that it names without them, as the rules choose.

    `mesh`: before its cut, with all groups of the case. Raises CaseError, with the line, where neither surface can be
    the slave.
    """
    case = with_sectors(case, mesh)
    records: list[Contact | Tie] = [*case.contact, *case.tie]
    if not any(record.surfaces for record in records):
        return case
    taken = {record.slave for record in records if not record.surfaces}
    records_with_roles: list[Contact | Tie] = []
    for record in records:
        one = _chosen(case, mesh, record, taken) if record.surfaces else record
        taken.add(one.slave)
        records_with_roles.append(one)
    names = [record.name for record in records_with_roles]
    for record in records_with_roles:
        if record.why and names.count(record.name) > 1:
            raise wrong(
                record,
                f"its default name is that of its slave, {record.name!r}, which another section has; give it a name",
            )
    contacts = tuple(one for one in records_with_roles if isinstance(one, Contact))
    ties = tuple(one for one in records_with_roles if isinstance(one, Tie))
    return case.altered(contact=contacts, tie=ties)


def slaves_of(case: Case, mesh: Mesh) -> tuple[list[str], dict[str, Any]]:
    """Return the groups to be cut in a mesh, and the options of their cut. Raises as `with_roles`."""
    done = with_roles(case, mesh)
    return list(dict.fromkeys(record.slave for record in (*done.contact, *done.ties))), done.cut_options()


def directed(pair: ContactPair, case: Case, mesh: Mesh) -> ContactPair:
    """Return a pair as it moves in a case of `with_roles`: the direction of contact, a tie that turns."""
    record = pair.record
    if isinstance(record, Tie):
        return replace(pair, turns=case.kinematics == "finite")
    if not isinstance(record, Contact) or record.normals != "facet":
        return pair
    normals = "master" if _by_master(pair, case, mesh) else "facet"
    return pair if normals == pair.pairing.normals else replace(pair, pairing=replace(pair.pairing, normals=normals))


def _by_master(pair: ContactPair, case: Case, mesh: Mesh) -> bool:
    """True if the master's normals are the better known ones.

    It is plane and the slave is not; but with friction on skins that are paired as they move, a stiffer slave bends it.
    Or both are plane, and friction turns faces at the slave's edges as they deform: then the master is stiffer.
    """
    record, zone = pair.record, pair.zone
    assert isinstance(record, Contact)
    alone = only_master_is_plane(zone, record.crease_angle)
    if not (pair.moving and pair.pairing.friction and is_plane(zone.master, record.crease_angle)):
        return alone
    slave, master = (_Side(case, mesh, name, record).stiffness for name in (record.slave, record.master))
    return slave <= master * _RATIO if alone else master > slave * _RATIO


def only_master_is_plane(zone: Zone, crease_angle: float | None) -> bool:
    """Return True if the master is plane and the slave is not, so that the direction of contact is the master's."""
    return is_plane(zone.master, crease_angle) and not is_plane(zone.slave, crease_angle)


def is_plane(skin: Surface, crease_angle: float | None) -> bool:
    """True if a skin consists of planes that meet at creases."""
    n, _ = mean_normals(skin)
    for name, rows, nodes in skin.by_type():
        own = unit(weighted(name, skin.x[nodes], np.array(CELLS[name].reference, dtype=float)))
        if np.abs(own - n[rows, None]).max(initial=0.0) > _PLANE:
            return False
    face, k = np.nonzero(skin.neighbours >= 0)
    one, other = n[face], n[skin.neighbours[face, k]]
    crease = np.cos(np.radians(CREASE_ANGLE if crease_angle is None else crease_angle))
    meets = (one * other).sum(axis=1) >= crease
    return bool(np.abs(one - other)[meets].max(initial=0.0) <= _PLANE)


def _chosen(case: Case, mesh: Mesh, record: Contact | Tie, taken: set[str]) -> Contact | Tie:
    """Return a record with its roles, and why they were chosen."""
    assert record.surfaces is not None
    names = sorted(record.surfaces)
    try:
        sides = [_Side(case, mesh, name, record) for name in names]
    except LacmeshError as error:
        raise wrong(record, str(error)) from None
    free = [side for side in sides if side.name not in taken]
    if not free:
        message = f"{names[0]!r} and {names[1]!r} are slaves of other sections already"
        raise wrong(record, f"{message}, and a slave has one master; put the masters into one group")
    if len(free) == 1:
        other = next(side for side in sides if side is not free[0])
        slave, why = free[0], f"{other.name!r} is the slave of another"
    else:
        slave, why = _first_that_differs(*sides)
    if not slave.behind:
        message = f"{slave.name!r} has faces without one cell behind them, so that it cannot be cut"
        raise wrong(record, f"{message}, and neither can the other surface; name the surface of a body")
    master = next(side.name for side in sides if side is not slave)
    name = record.name or slave.name
    return record.altered(slave=slave.name, master=master, surfaces=None, why=why, name=name)


class _Side:
    """One of two surfaces before the cut: its faces, and what the rules ask of it."""

    def __init__(self, case: Case, mesh: Mesh, name: str, record: Contact | Tie) -> None:
        self.name, self._case, self._mesh, self._record = name, case, mesh, record
        self._cells = mesh.cells_of(name)
        self.skin = Surface.of(from_origin(mesh, origin_of_mesh(mesh)), self._cells)
        self.n_faces, self.dim = len(self.skin), self.skin.dim + 1
        self.cut = is_cut(mesh) and bool((Cut(mesh).macro_of_face[self._cells] >= 0).all())
        self.behind = not np.isnan(self.skin.depth).any()
        self._area = face_measure(self.skin)
        self._faces: float | None = None

    def faces(self, other: _Side) -> float:
        """The part of the area that faces the other surface."""
        if self._faces is None:
            met = contact_points(self.skin, other.skin, search_distance=self._record.search_distance)
            covered = coverage(met, self.skin)
            self._faces = float(covered.covered.sum() / covered.area.sum())
        return self._faces

    @property
    def size(self) -> float:
        """Mean size of a face, a length."""
        return float(np.median(self._area ** (1 / self.skin.dim)))

    @property
    def bend(self) -> float:
        """Mean angle between neighbouring faces, positive where the surface is convex."""
        n, centre = mean_normals(self.skin)
        face, k = np.nonzero(self.skin.neighbours >= 0)
        beyond = self.skin.neighbours[face, k]
        apart = centre[beyond] - centre[face]
        away = np.linalg.norm(apart, axis=1)
        turn = ((n[beyond] - n[face]) * apart).sum(axis=1)
        return float(np.mean(turn / np.where(away > 0, away, 1.0))) if len(face) else 0.0

    @property
    def young(self) -> float:
        """Mean modulus behind the faces; infinite where they are rigid, or where a law has none."""
        value = np.full(self._mesh.n_cells, np.inf)
        for material in self._case.material:
            modulus = np.inf if material.young is None else float(np.mean(material.young))
            for cells in _cells_of(self._mesh, material.groups):
                value[cells] = modulus
        young = value[self._parents]
        return float(np.average(young, weights=self._area)) if self._rigid() is None else np.inf

    @property
    def stiffness(self) -> float:
        """Mean modulus behind the faces; infinite where no body is, or a rigid one, or the normal is not free."""
        return self.young if self.behind and self.free > 0 else np.inf

    @property
    def free(self) -> float:
        """The part of the faces whose new nodes would be free: along the normal, for a tie in every direction."""
        fixed = np.zeros((self.n_faces, 3, 3))
        n, _ = mean_normals(self.skin)
        records: tuple[Displacement | Rigid, ...] = (*self._case.displacement, *rigid_records(self._case))
        for record in records:
            there = self._held_by(record)
            if isinstance(record, Rigid):
                fixed[there] = np.eye(3)
                continue
            for k, axis in enumerate("xyz"):
                if getattr(record, f"u{axis}") is not None:
                    fixed[there, k, k] = 1.0
            if record.un is not None:
                fixed[there] += np.einsum("fi,fj->fij", n[there], n[there])
        left = np.einsum("fi,fij,fj->f", n, np.eye(3) - fixed, n)
        if isinstance(self._record, Tie):
            left = np.where(fixed[:, range(self.dim), range(self.dim)].any(axis=1), 0.0, 1.0)
        return float(np.mean(left > _FREE))

    def _rigid(self) -> Rigid | None:
        """The rigid body that has all faces; None for another surface."""
        return next((one for one in rigid_records(self._case) if self._held_by(one).all()), None)

    def _held_by(self, record: Displacement | Rigid) -> NDArray[np.bool_]:
        """Return a mask (f,), True for faces that lie in a record's group, so that the nodes of their cut will."""
        mesh, nodes = self._mesh, self.skin.faces.nodes
        inside = np.zeros(mesh.n_nodes + 1, bool)
        inside[-1] = True  # faces of few nodes are padded with -1
        if record.group is None:
            return np.zeros(self.n_faces, bool)
        if record.kind == "node" or (record.kind is None and not _is_cells(mesh, record.group)):
            inside[mesh.node_groups[record.group]] = True
            return np.asarray(inside[nodes].all(axis=1))
        cells = mesh.cells_of(record.group)
        chosen = mask_of(mesh.n_cells, cells)
        return np.asarray(chosen[self.skin.cell] | chosen[self._parents] | self._same(cells))

    def _same(self, cells: Ints) -> NDArray[np.bool_]:
        """Return a mask (f,), True for faces that have the nodes of one of these cells."""
        skin = cells[self._mesh.cell_dim[cells] == self.skin.dim]
        wanted = {frozenset(row) for _, _, nodes in self._mesh.select(skin) for row in nodes.tolist()}
        return np.array([frozenset(k for k in row if k >= 0) in wanted for row in self.skin.faces.nodes.tolist()], bool)

    @cached_property
    def _parents(self) -> Ints:
        """The cell (f,) behind each face; the face itself where there is none."""
        out = np.array(self.skin.cell)
        owners = find_owners(self.skin.faces, cells_of_dim(self._mesh, self.dim), self._mesh.n_nodes)
        out[owners.face] = owners.cell
        return out


def _reason_of_facing(a: _Side, b: _Side) -> str:
    part, back = a.faces(b), b.faces(a)
    whole = "its whole area" if part > 1 - _PART else f"{100 * part:.0f} % of its area"
    return f"it faces {b.name!r} with {whole}, and {b.name!r} faces it with {100 * back:.0f} %"


#: the rules, in their order: True if side a is to be the slave and b is not, and the reason
_RULES: tuple[tuple[Callable[[_Side, _Side], bool], Callable[[_Side, _Side], str]], ...] = (
    (lambda a, b: a.cut and not b.cut, lambda a, b: "it has macro-elements in the mesh"),
    (lambda a, b: a.behind and not b.behind, lambda a, b: f"{b.name!r} has no cells behind it that could be cut"),
    (lambda a, b: a.free > b.free + _PART,
     lambda a, b: f"the displacement of {b.name!r} is prescribed, or that of a rigid body"),
    (lambda a, b: a.n_faces >= FEW[a.dim] > b.n_faces, lambda a, b: f"{b.name!r} has few faces, {b.n_faces}"),
    (lambda a, b: a.faces(b) > b.faces(a) + _PART, _reason_of_facing),
    (lambda a, b: a.young * _RATIO < b.young,
     lambda a, b: f"it is softer: Young's modulus {a.young:.4g} beside {b.young:.4g}"),
    (lambda a, b: a.size * _RATIO < b.size, lambda a, b: f"it is finer: faces of {a.size:.4g} beside {b.size:.4g}"),
    (lambda a, b: a.bend > b.bend + _ANGLE, lambda a, b: "it is more convex"),
)  # fmt: skip


def _first_that_differs(a: _Side, b: _Side) -> tuple[_Side, str]:
    """Return the slave of two sides by the first rule that distinguishes them, and the reason for it."""
    for chooses, reason in _RULES:
        for one, other in ((a, b), (b, a)):
            if chooses(one, other):
                return one, reason(one, other)
    return a, "the two are alike, and its name comes first"


def _cells_of(mesh: Mesh, groups: Iterable[str] | None) -> list[Ints]:
    return [np.flatnonzero(mesh.cell_dim >= 0)] if groups is None else [mesh.cells_of(name) for name in groups]


def _is_cells(mesh: Mesh, group: str) -> bool:
    try:
        return len(mesh.cells_of(group)) >= 0
    except LacmeshError:
        return False
