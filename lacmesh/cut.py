"""The cut: from a mesh and its slave skin to a mesh whose slave faces are macro-elements with an internal dof.

    faces = which faces are slave, the cells on them and behind them     (plan)
    kinds = how each is cut: whole, cone or ring, fixed before any is cut (plan)
    children = new nodes, and the cells that replace others               (subdivide)
    mesh = the same mesh with its children, numbers, groups and data      (rebuild)

Method: Abbas, Drouet, Hild, Comput. Methods Appl. Mech. Engrg. 339, 2018, 488-513; code_aster R5.03.55, 3.1.
`docs/cut.md` has the theory.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lacmesh.errors import CutError, LacmeshWarning, RequestError
from lacmesh.mesh import Ints, Mesh, codes
from lacmesh.patterns import WHOLE_FACES, internal_points
from lacmesh.plan import HEXA, Plan, make_plan
from lacmesh.rebuild import Origin, rebuild
from lacmesh.skin import FACE_TYPES, Faces, find_repeats
from lacmesh.subdivide import KINDS, WHOLE_CODE, subdivide

#: integer data that a cut is kept in, -1 where they say nothing (`docs/conventions.md`)
CELL_RECORDS = ("lac_macro", "lac_zone", "lac_child", "lac_parent")
NODE_RECORD = "lac_internal"


@dataclass(frozen=True)
class Cut:
    """A view on the records that a cut leaves in its mesh (they are data like any other: formats keep them).

    Raises CutError where the mesh carries no cut.
    """

    mesh: Mesh

    def __post_init__(self) -> None:
        if not is_cut(self.mesh):
            raise CutError("this mesh carries no cut; lacmesh.cut_skin makes one")
        faces = np.flatnonzero(self.macro_of_face >= 0)
        kinds = {kind for kind, _, _ in self.mesh.select(faces)}
        zones = self.zone_of_face[faces]
        if not kinds <= set(FACE_TYPES[1:]) or zones.min() < 0 or zones.max() >= len(self.zones):
            raise CutError("the data lac_macro and lac_zone of this mesh are not those of a cut; take them out")

    @property
    def zones(self) -> tuple[str, ...]:
        """Names of the zones: one for each slave group."""
        return self.mesh.zones

    @cached_property
    def n_macros(self) -> int:
        """Number of macro-elements."""
        return int(self.macro_of_face.max(initial=-1)) + 1

    @property
    def macro_of_face(self) -> Ints:
        """(n_cells,): the macro-element that a slave face is part of, -1 for every other cell."""
        return self.mesh.cell_data["lac_macro"]

    @property
    def zone_of_face(self) -> Ints:
        """(n_cells,): the place in `zones` of a slave face's zone, -1 for every other cell."""
        return self._cell_record("lac_zone")

    @property
    def child_kind(self) -> Ints:
        """(n_cells,): 1 to 5 for the slave faces E1 to E5 of a macro-element, -1 for every other cell."""
        return self._cell_record("lac_child")

    @property
    def parent_of_cell(self) -> Ints:
        """(n_cells,): the file's number of the cell that a child replaces, -1 for a cell that the cut left alone."""
        return self._cell_record("lac_parent")

    @property
    def macro_of_node(self) -> Ints:
        """(n_nodes,): the macro-element whose internal dof a node carries, -1 for every other node."""
        internal = self.mesh.node_data.get(NODE_RECORD)
        return np.full(self.mesh.n_nodes, -1, np.int32) if internal is None else internal

    def _cell_record(self, name: str) -> Ints:
        """A record; a file keeps none that says nothing (`lac_parent` where every face was left whole)."""
        values = self.mesh.cell_data.get(name)
        return np.full(self.mesh.n_cells, -1, np.int32) if values is None else values

    @cached_property
    def internal_nodes(self) -> tuple[Ints, ...]:
        """For each macro-element, the nodes that carry an internal dof of it."""
        nodes = np.flatnonzero(self.macro_of_node >= 0)
        return split(nodes, self.macro_of_node[nodes], self.n_macros)

    @cached_property
    def faces_of_macro(self) -> tuple[Ints, ...]:
        """For each macro-element, its slave faces, E1 first."""
        faces = np.flatnonzero(self.macro_of_face >= 0)
        faces = faces[np.argsort(self.child_kind[faces], kind="stable")]
        return split(faces, self.macro_of_face[faces], self.n_macros)


def split(members: Ints, owner: Ints, count: int) -> tuple[Ints, ...]:
    """The members of each of `count` owners, in their order."""
    order = np.argsort(owner, kind="stable")
    return tuple(np.split(members[order], np.cumsum(np.bincount(owner, minlength=count))[:-1]))


def is_cut(mesh: Mesh) -> bool:
    """Whether a mesh carries the records of a cut."""
    macro = mesh.cell_data.get("lac_macro")
    return macro is not None and bool((macro >= 0).any())


def cut_skin(
    mesh: Mesh,
    slave: str | int | Sequence[str | int],
    *,
    hexa: str = "pyramid",
    interface: str = "both",
    orient: str = "keep",
    skin_only: bool = False,
    node_groups: str = "extend",
    ring: float = 1 / 3,
    depth: float = 1 / 2,
) -> Cut:
    """Cut the skin faces of the slave groups, and the cells behind them, into macro-elements.

    `slave`: one group or several (a zone each), named as `Mesh.group` takes them; an integer is a tag. `hexa`: HEXA8
    and HEXA20 become pyramids (`pyramid`), hexahedra (`hexa`), or whichever has the better worst child (`auto`).
    `interface`: a face between two cells has both cut (`both`) or is an error (`refuse`). `orient`: slave faces are
    left as they are (`keep`) or turned outward. `skin_only`: cut a skin that has no cells behind it. `node_groups`: a
    new node enters a node group that holds every corner of the face or cell it lies on (`extend`), or none (`keep`).
    `ring`: half-width of the inner polygon of ring patterns, `depth`: how deep it goes, both as parts of the parent,
    in (0, 1).

    Faces that own an internal dof already (SEG3, QUAD9, TRIA7) become macro-elements as they are. A mesh whose slave
    faces are all covered by a cut is returned unchanged. Raises CutError, GroupNotFoundError, RequestError.
    """
    _check_options(hexa=(hexa, HEXA), interface=(interface, ("both", "refuse")))
    _check_options(orient=(orient, ("keep", "outward")), node_groups=(node_groups, ("extend", "keep")))
    if not (0 < ring < 1 and 0 < depth < 1):
        raise RequestError(f"ring ({ring}) and depth ({depth}) must lie between 0 and 1")
    specs = [str(s) for s in ([slave] if isinstance(slave, (str, int)) else slave)]
    if is_cut(mesh):
        return _already_cut(mesh, specs)
    mesh, plan = make_plan(mesh, specs, hexa, interface, orient, skin_only, (ring, depth))
    made = subdivide(mesh, plan.faces, plan.kinds, plan.skin, plan.parents, ring, depth)
    _warn_of_periodic(mesh, plan)
    face_points = made.face_points
    new, origin = rebuild(mesh, made, plan.slave, extend=node_groups == "extend")
    del made  # a large mesh's records are about to need the room
    internal = _internal(new.n_nodes, plan, face_points, ring)
    return Cut(_record(mesh, new, plan, origin, internal))


def _check_options(**options: tuple[str, tuple[str, ...]]) -> None:
    for name, (value, allowed) in options.items():
        if value not in allowed:
            raise RequestError(f"{name} is one of {', '.join(allowed)}, not {value!r}")


def _already_cut(mesh: Mesh, specs: list[str]) -> Cut:
    cut = Cut(mesh)
    dim = int(mesh.cell_dim[mesh.cell_data["lac_macro"] >= 0].max())
    for spec in specs:
        faces = mesh.cells_of(spec)
        faces = faces[mesh.cell_dim[faces] == dim]
        left = _uncovered(mesh, faces)
        if len(left) or not len(faces):
            raise CutError(
                f"this mesh is cut already (zones {', '.join(mesh.zones)}), but not everywhere on {spec!r} "
                f"(cells {mesh.cell_names(left)}); cut the mesh it came from, with every --slave at once",
                mesh.cell_number[left],
            )
    return cut


def _uncovered(mesh: Mesh, faces: Ints) -> Ints:
    """Those of some faces that are no part of a macro-element, nor repeat a face that is."""
    macro = mesh.cell_data["lac_macro"]
    left = faces[macro[faces] < 0]
    covered = Faces.join((kind, nodes) for kind, _, nodes in mesh.select(np.flatnonzero(macro >= 0)))
    repeats = find_repeats(covered, [(kind, nodes, cells) for kind, cells, nodes in mesh.select(left)], mesh.n_nodes)
    return np.setdiff1d(left, repeats.cell)


def _warn_of_periodic(mesh: Mesh, plan: Plan) -> None:
    if mesh.model is None or "entity" not in mesh.cell_data or not mesh.model.periodic:
        return
    linked = {tag for link in mesh.model.periodic for tag in (link.slave, link.master)}
    cut = plan.skin.cell[plan.kinds[plan.skin.face] != WHOLE_CODE]
    here = {tuple(int(t) for t in e) for e in np.unique(mesh.cell_data["entity"][cut], axis=0)} & linked
    if here:
        names = ", ".join(f"{dim}:{tag}" for dim, tag in sorted(here))
        message = f"slave faces lie on periodic entities ({names}): their new nodes have no periodic partner"
        warnings.warn(message, LacmeshWarning, stacklevel=3)


def _record(mesh: Mesh, new: Mesh, plan: Plan, origin: Origin, internal: Ints) -> Mesh:
    """Write the cut's records into the data of the new mesh."""
    wide = int(mesh.cell_number.max(initial=0)) > np.iinfo(np.int32).max
    macro, zone, child = (np.full(new.n_cells, -1, np.int32) for _ in range(3))
    parent = np.full(new.n_cells, -1, np.int64 if wide else np.int32)
    parent[origin.child] = mesh.cell_number[origin.root]
    order = np.argsort(plan.slave)
    at = np.minimum(np.searchsorted(plan.slave, origin.root, sorter=order), len(order) - 1)
    ours = plan.slave[order[at]] == origin.root
    whole = np.flatnonzero(origin.followed >= 0)
    faces = np.concatenate([origin.child[ours], origin.followed[whole]])
    macro[faces] = np.concatenate([order[at[ours]], whole])
    zone[faces] = plan.zone[macro[faces]]
    child[faces] = np.concatenate([origin.rank[ours], np.zeros(len(whole), int)]) + 1
    records = dict(zip(CELL_RECORDS, (macro, zone, child, parent), strict=True))
    cell_data = {**new.cell_data, **records}
    node_data = {**new.node_data, NODE_RECORD: internal}
    return replace(new, cell_data=cell_data, node_data=node_data, zones=plan.zones)


def _internal(n_nodes: int, plan: Plan, face_points: Ints, ring: float) -> Ints:
    """(n_nodes,): the macro-element whose internal dof each node carries."""
    owner = np.full(n_nodes, -1, np.int32)
    code = plan.faces.type * len(KINDS) + plan.kinds
    for value in codes(code):
        face, kind = FACE_TYPES[value // len(KINDS)], KINDS[value % len(KINDS)]
        rows = np.flatnonzero(code == value)
        if face in WHOLE_FACES:
            owner[plan.faces.nodes[rows, WHOLE_FACES[face]]] = rows
        else:
            owner[face_points[rows][:, internal_points(face, kind, ring)]] = rows[:, None]
    return owner
