"""The cut: from a mesh and its slave skin to a mesh whose slave faces are macro-elements with an internal dof.

    slave = the slave faces of some groups                                              (select)
    earlier = the cut that they have already, by its records or, on request, recognised (recognition)
    selection = the slave faces, the cells on them and behind them                      (select)
    subdivision = the pattern of each face, new nodes, and the cells that replace others (subdivide)
    new, origin = the mesh with the children, and what each cell comes from             (assemble)
    cut = the same with the records of its macro-elements                               (records)

Method: Abbas, Drouet, Hild, Comput. Methods Appl. Mech. Engrg. 339, 2018, 488-513; code_aster R5.03.55, 3.1.
`docs/cut.md` has the theory.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from lacmesh.cutting.assemble import assemble
from lacmesh.cutting.patterns import WHOLE_FACES, internal_points
from lacmesh.cutting.recognition import earlier_cut
from lacmesh.cutting.records import CELL_RECORDS, NODE_RECORD, Cut, Origin, is_cut, with_records, without_records
from lacmesh.cutting.select import Selection, select, slave_skin
from lacmesh.cutting.subdivide import HEXA, WHOLE_CODE, CutFaces, subdivide
from lacmesh.errors import LacmeshWarning, RequestError
from lacmesh.mesh import Ints, Mesh, MeshLike, as_mesh, places_of, spec_list

__all__ = ["CELL_RECORDS", "NODE_RECORD", "Cut", "cut_skin", "is_cut"]


def cut_skin(
    mesh: MeshLike,
    slave: str | int | Sequence[str | int],
    *,
    hexa: str = "pyramid",
    interface: str = "both",
    orient: str = "keep",
    skin_only: bool = False,
    node_groups: str = "extend",
    ring: float = 1 / 3,
    depth: float = 1 / 2,
    recognise: bool | None = None,
) -> Cut:
    """Cut the skin faces of the slave groups, and the cells behind them, into macro-elements.

    `mesh`: a mesh, or the path of its file. `slave`: one group or several (a zone each), named as `Mesh.group` takes
    them; an integer is a tag. `hexa`: HEXA8 and HEXA20 become pyramids (`pyramid`), hexahedra (`hexa`), or the one with
    the higher minimum Jacobian (`auto`).
    `interface`: a face between two cells has both cut (`both`) or is an error (`refuse`). `orient`: slave faces are
    left as they are (`keep`) or turned `outward`. `skin_only`: cut a skin that has no cells behind it. `node_groups`: a
    new node enters a node group that holds every corner of the face or cell it lies on (`extend`), or none (`keep`).
    `ring`: half-width of the inner polygon of ring patterns, `depth`: how deep it goes, both as parts of the parent,
    in (0, 1).

    Faces that own an internal dof already (SEG3, QUAD9, TRIA7) become macro-elements as they are. A mesh whose slave
    faces all have the records of a cut is returned unchanged. `recognise`: None: faces without records are cut. True:
    they are a cut whose records are restored, if they have its pattern; CutError if not. False: all faces are cut, and
    existing records are replaced.
    Raises CutError, GroupNotFoundError, RequestError.

    >>> cells = [("TRIA3", [[0, 2, 1]]), ("TETRA4", [[0, 1, 2, 3]])]
    >>> corner = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> cut = cut_skin(Mesh.create(corner, cells, cell_groups={"slave": [0]}), "slave")
    >>> cut.n_macros, cut.mesh.n_nodes, [(block.type, len(block.nodes)) for block in cut.mesh.blocks]
    (1, 5, [('TRIA3', 3), ('TETRA4', 3)])
    """
    for name, value, allowed in (
        ("hexa", hexa, HEXA),
        ("interface", interface, ("both", "refuse")),
        ("orient", orient, ("keep", "outward")),
        ("node_groups", node_groups, ("extend", "keep")),
    ):
        if value not in allowed:
            raise RequestError(f"{name} is one of {', '.join(allowed)}, not {value!r}")
    if not (0 < ring < 1 and 0 < depth < 1):
        raise RequestError(f"ring ({ring}) and depth ({depth}) must lie between 0 and 1")
    mesh = as_mesh(mesh)
    slave_faces = slave_skin(mesh, spec_list(slave), skin_only=skin_only)
    earlier = earlier_cut(mesh, slave_faces, recognise)
    if earlier is not None:
        return earlier
    mesh, selection = select(
        without_records(mesh), slave_faces, interface=interface, orient=orient, skin_only=skin_only
    )
    subdivision = subdivide(mesh, selection, hexa, skin_only, ring, depth)
    _warn_of_periodic(mesh, selection, subdivision.cut.patterns)
    new, origin = assemble(mesh, subdivision.new_nodes.parts, subdivision.children, extend=node_groups == "extend")
    internal = _internal_nodes(subdivision.cut, new.n_nodes)
    del subdivision  # a large mesh's records are about to need the room
    return _with_macros(mesh, new, origin, selection, internal)


def _warn_of_periodic(mesh: Mesh, selection: Selection, patterns: Ints) -> None:
    if mesh.model is None or "entity" not in mesh.cell_data or not mesh.model.periodic:
        return
    linked = {tag for link in mesh.model.periodic for tag in (link.slave, link.master)}
    cut = selection.skin.cell[patterns[selection.skin.face] != WHOLE_CODE]
    here = {tuple(int(t) for t in e) for e in np.unique(mesh.cell_data["entity"][cut], axis=0)} & linked
    if here:
        names = ", ".join(f"{dim}:{tag}" for dim, tag in sorted(here))
        message = f"slave faces lie on periodic entities ({names}): their new nodes have no periodic partner"
        warnings.warn(message, LacmeshWarning, stacklevel=3)


def _with_macros(mesh: Mesh, new: Mesh, origin: Origin, selection: Selection, internal: Ints) -> Cut:
    """Return the cut: the new mesh of `origin` in the old one, with its records; `internal`: `_internal_nodes`."""
    macro = places_of(selection.slave, mesh.n_cells, np.int32)[origin.cell]
    faces = np.flatnonzero(macro >= 0)
    zone, child = (np.full(new.n_cells, -1, np.int32) for _ in range(2))
    zone[faces] = selection.zone[macro[faces]]
    order = faces[np.argsort(macro[faces], kind="stable")]  # E1, E2, ... of each, as the children of a face follow
    first = np.flatnonzero(np.diff(macro[order], prepend=-1))
    child[order] = 1 + np.arange(len(order)) - np.repeat(first, np.diff(first, append=len(order)))
    wide = int(mesh.cell_number.max(initial=0)) > np.iinfo(np.int32).max
    parent: Ints = np.full(new.n_cells, -1, np.int64 if wide else np.int32)
    parent[origin.children] = mesh.cell_number[origin.cell[origin.children]]
    records = dict(zip(CELL_RECORDS, (macro, zone, child, parent), strict=True))
    return Cut(with_records(new, records, internal, selection.zones), origin)


def _internal_nodes(cut: CutFaces, n_nodes: int) -> Ints:
    """(n_nodes,): the macro-element whose internal dof each node carries, or -1."""
    owner = np.full(n_nodes, -1, np.int32)
    for face, pattern, rows in cut.by_pattern():
        if face in WHOLE_FACES:
            owner[cut.faces.nodes[rows, WHOLE_FACES[face]]] = rows
        else:
            owner[cut.points[rows][:, internal_points(face, pattern, cut.ring)]] = rows[:, None]
    return owner
