"""The cut: from a mesh and its slave skin to a mesh whose slave faces are in macro-elements with an internal dof.

    slave = the slave faces of some groups                                              (select)
    earlier = the cut that they have already, by its records or, on request, recognised (recognition)
    selection = the slave faces, the cells on them and behind them                      (select)
    stars = with macro = "stars" the macro-elements of whole faces, which are not cut   (stars)
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
from lacmesh.cutting.patterns import internal_points
from lacmesh.cutting.recognition import earlier_cut
from lacmesh.cutting.records import CELL_RECORDS, NODE_RECORD, Cut, Origin, is_cut, with_records, without_records
from lacmesh.cutting.select import Selection, nodes_of_group, select, slave_skin
from lacmesh.cutting.stars import Stars, find_stars, whole_faces
from lacmesh.cutting.subdivide import HEXA, WHOLE_CODE, CutFaces, subdivide
from lacmesh.errors import CutError, LacmeshWarning, RequestError
from lacmesh.mesh import Ints, Mesh, MeshLike, as_mesh, concatenated, places_of, spec_list
from lacmesh.topology.skin import TYPE_CODE

__all__ = ["CELL_RECORDS", "NODE_RECORD", "Cut", "cut_skin", "is_cut"]


#: options of `cut_skin` that are words, and what each may be
_WORDS = {"hexa": HEXA, "interface": ("both", "refuse"), "orient": ("keep", "outward"),
          "node_groups": ("extend", "keep"), "macro": ("cut", "stars"), "rest": ("cut", "join")}  # fmt: skip


def cut_skin(
    mesh: MeshLike, slave: str | int | Sequence[str | int], *, hexa: str = "pyramid", interface: str = "both",
    orient: str = "keep", skin_only: bool = False, node_groups: str = "extend", ring: float = 1 / 3,
    depth: float = 1 / 2, recognise: bool | None = None, macro: str = "cut", rest: str = "cut", pairs: bool = False,
    crease_angle: float | None = None, dirichlet: Sequence[str | int] = (),
) -> Cut:  # fmt: skip
    """Cut the skin faces of the slave groups, and the cells behind them, into macro-elements, or join them into some.

    `mesh`: a mesh, or the path of its file. `slave`: one group or several (a zone each), named as `Mesh.group` takes
    them; an integer is a tag. `hexa`: HEXA8 and HEXA20 become pyramids (`pyramid`), hexahedra (`hexa`), or the one with
    the higher minimum Jacobian (`auto`).
    `interface`: a face between two cells has both cut (`both`) or is an error (`refuse`). `orient`: slave faces are
    left as they are (`keep`) or turned `outward`. `skin_only`: cut a skin that has no cells behind it. `node_groups`: a
    new node enters a node group that holds every corner of the face or cell it lies on (`extend`), or none (`keep`).
    `ring`: half-width of the inner polygon of ring patterns, `depth`: how deep it goes, both as parts of the parent,
    in (0, 1).

    `macro`: each face is divided into a macro-element (`cut`), or faces around a node are one as they are (`stars`), so
    that the mesh is not changed. Of stars alone: faces that no star reaches are cut, with a warning, or join others
    across creases (`rest` = `join`); QUAD8 are cut, or joined in `pairs`; no star bends around an edge by more than
    `crease_angle` (40 degrees), or has its dof at a node of the groups `dirichlet`, whose displacement is given.

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
    for name, value in zip(_WORDS, (hexa, interface, orient, node_groups, macro, rest), strict=True):
        if value not in _WORDS[name]:
            raise RequestError(f"{name} is one of {', '.join(_WORDS[name])}, not {value!r}")
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
    stars = whole_faces(selection.faces)
    if macro == "stars":
        fixed = concatenated(nodes_of_group(mesh, group) for group in spec_list(dirichlet))
        angle = 40.0 if crease_angle is None else crease_angle
        stars = find_stars(mesh, selection.faces, selection.zone, angle, fixed, pairs=pairs, join=rest == "join")
        _warn_of_rest(mesh, selection, stars, rest)
    subdivision = subdivide(mesh, selection, stars.macro >= 0, hexa, skin_only, ring, depth)
    _warn_of_periodic(mesh, selection, subdivision.cut.patterns)
    new, origin = assemble(mesh, subdivision.new_nodes.parts, subdivision.children, extend=node_groups == "extend")
    of_face, owner = _macros(subdivision.cut, stars, new.n_nodes)
    del subdivision  # a large mesh's records are about to need the room
    return _with_macros(mesh, new, origin, selection, of_face, owner, macro == "cut" or len(origin.children) > 0)


def _macros(cut: CutFaces, stars: Stars, n_nodes: int) -> tuple[Ints, Ints]:
    """(f,): the macro-element of each face, numbered by first faces; (n_nodes,): that with its dof at a node, or -1."""
    alone = stars.macro < 0
    label = np.where(alone, len(stars.carrier) + np.arange(len(alone)), stars.macro)
    values, first = np.unique(label, return_index=True)
    order = np.argsort(first)
    number = places_of(values[order], len(stars.carrier) + len(alone), np.int32)
    owner = np.full(n_nodes, -1, np.int32)
    owner[stars.carrier] = number[: len(stars.carrier)]
    for face, pattern, rows in cut.by_pattern(np.flatnonzero(alone)):
        rows = np.flatnonzero(alone)[rows]
        owner[cut.points[rows][:, internal_points(face, pattern, cut.ring)]] = number[label[rows], None]
    return number[label], owner


def _warn_of_rest(mesh: Mesh, selection: Selection, stars: Stars, rest: str) -> None:
    """Warn of faces that are in no star. Raises CutError if they were to be joined."""
    cells = selection.slave[stars.macro < 0]
    if not len(cells):
        return
    quad8 = selection.faces.type[stars.macro < 0] == TYPE_CODE["QUAD8"]
    if rest == "join" and not quad8.all():
        names = mesh.cell_names(cells[~quad8])
        raise CutError(
            f"slave faces {names} have no star beside them to join; rest = 'cut' cuts them", mesh.cell_number[cells]
        )
    no_star = "no star reaches them: their nodes are on a boundary or edge, or fixed"
    for some, why in ((cells[quad8], "they are QUAD8, which pairs = True joins in pairs"), (cells[~quad8], no_star)):
        if len(some):
            warnings.warn(f"slave faces {mesh.cell_names(some)} are cut: {why}", LacmeshWarning, stacklevel=3)


def _warn_of_periodic(mesh: Mesh, selection: Selection, patterns: Ints) -> None:
    periodic = mesh.model.periodic if mesh.model is not None and len(mesh.entity_of_cell) else ()
    linked = {tag for link in periodic for tag in (link.slave, link.master)}
    cut = selection.skin.cell[patterns[selection.skin.face] != WHOLE_CODE] if linked else []
    here = linked & {(dim, tag) for dim, tag in mesh.entity_of_cell[cut].tolist()} if linked else ()
    if here:
        names = ", ".join(f"{dim}:{tag}" for dim, tag in sorted(here))
        message = f"slave faces lie on periodic entities ({names}): their new nodes have no periodic partner"
        warnings.warn(message, LacmeshWarning, stacklevel=3)


def _with_macros(
    mesh: Mesh, new: Mesh, origin: Origin, selection: Selection, of_face: Ints, owner: Ints, parents: bool
) -> Cut:
    """Return the cut: the new mesh of `origin` in the old one, with its records, among them `parents` of the cells.

    `of_face`, `owner`: of `_macros`.
    """
    face = places_of(selection.slave, mesh.n_cells, np.int32)[origin.cell]
    faces = np.flatnonzero(face >= 0)
    macro, zone, child = (np.full(new.n_cells, -1, np.int32) for _ in range(3))
    macro[faces] = of_face[face[faces]]
    zone[faces] = selection.zone[face[faces]]
    order = faces[np.argsort(macro[faces], kind="stable")]  # E1, E2, ... of each, as the children of a face follow
    first = np.flatnonzero(np.diff(macro[order], prepend=-1))
    child[order] = 1 + np.arange(len(order)) - np.repeat(first, np.diff(first, append=len(order)))
    records: dict[str, Ints] = dict(zip(CELL_RECORDS, (macro, zone, child), strict=False))
    if parents:
        wide = int(mesh.cell_number.max(initial=0)) > np.iinfo(np.int32).max
        parent: Ints = np.full(new.n_cells, -1, np.int64 if wide else np.int32)
        parent[origin.children] = mesh.cell_number[origin.cell[origin.children]]
        records[CELL_RECORDS[3]] = parent
    return Cut(with_records(new, records, owner, selection.zones), origin)
