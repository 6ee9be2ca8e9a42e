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
from dataclasses import replace

import numpy as np

from lacmesh.cutting.patterns import WHOLE_FACES, internal_points
from lacmesh.cutting.plan import HEXA, Plan, make_plan
from lacmesh.cutting.rebuild import Origin, rebuild
from lacmesh.cutting.recognition import NOT_LAST, RecognisedCut, find_macros, with_records
from lacmesh.cutting.records import CELL_RECORDS, NODE_RECORD, Cut, is_cut
from lacmesh.cutting.subdivide import KINDS, WHOLE_CODE, subdivide
from lacmesh.errors import CutError, LacmeshWarning, RequestError
from lacmesh.mesh import Ints, Mesh, codes, spec_list
from lacmesh.topology.skin import FACE_TYPES, Faces, find_repeats

__all__ = ["CELL_RECORDS", "NODE_RECORD", "Cut", "cut_skin", "is_cut"]


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
    recognise: bool | None = None,
) -> Cut:
    """Cut the skin faces of the slave groups, and the cells behind them, into macro-elements.

    `slave`: one group or several (a zone each), named as `Mesh.group` takes them; an integer is a tag. `hexa`: HEXA8
    and HEXA20 become pyramids (`pyramid`), hexahedra (`hexa`), or the one with the higher minimum Jacobian (`auto`).
    `interface`: a face between two cells has both cut (`both`) or is an error (`refuse`). `orient`: slave faces are
    left as they are (`keep`) or turned `outward`. `skin_only`: cut a skin that has no cells behind it. `node_groups`: a
    new node enters a node group that holds every corner of the face or cell it lies on (`extend`), or none (`keep`).
    `ring`: half-width of the inner polygon of ring patterns, `depth`: how deep it goes, both as parts of the parent,
    in (0, 1).

    Faces that own an internal dof already (SEG3, QUAD9, TRIA7) become macro-elements as they are. A mesh whose slave
    faces all belong to a cut is returned unchanged; if its records are missing they are restored, and a LacmeshWarning
    says which faces were recognised. `recognise` overrides this. None: faces with all the marks of a cut are recognised
    (`lacmesh.recognise`). True: the pattern of the faces is sufficient; CutError if it is absent. False: all faces are
    cut, whatever they look like, and existing records are replaced.
    Raises CutError, GroupNotFoundError, RequestError.

    >>> cells = [("TRIA3", [[0, 2, 1]]), ("TETRA4", [[0, 1, 2, 3]])]
    >>> corner = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> cut = cut_skin(Mesh.create(corner, cells, cell_groups={"slave": [0]}), "slave")
    >>> cut.n_macros, cut.mesh.n_nodes, [(block.type, len(block.nodes)) for block in cut.mesh.blocks]
    (1, 5, [('TRIA3', 3), ('TETRA4', 3)])
    """
    _check_options(hexa=(hexa, HEXA), interface=(interface, ("both", "refuse")))
    _check_options(orient=(orient, ("keep", "outward")), node_groups=(node_groups, ("extend", "keep")))
    if not (0 < ring < 1 and 0 < depth < 1):
        raise RequestError(f"ring ({ring}) and depth ({depth}) must lie between 0 and 1")
    specs = spec_list(slave)
    if is_cut(mesh) and recognise is not False:
        return _already_cut(mesh, specs)
    found = _taken_for_cut(mesh, specs, recognise)
    if found is not None:
        return Cut(with_records(mesh, found))
    mesh = _without_records(mesh)
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


def _taken_for_cut(mesh: Mesh, specs: list[str], recognise: bool | None) -> RecognisedCut | None:
    """Macro-elements recognised in slave faces without records; None if the faces are to be cut."""
    if not specs or recognise is False:
        return None
    found = find_macros(mesh, specs)
    if recognise and not found.complete:
        left = found.cells[found.left]
        message = f"no earlier cut is recognised on {', '.join(specs)} (cells {mesh.cell_names(left)} are in none)"
        raise CutError(message, mesh.cell_number[left])
    if recognise:
        return found
    if found.mostly_cut and found.doubt == NOT_LAST:
        _say(found, f"look like {_macros(found)} of an earlier cut, but {NOT_LAST}: they are cut; --recognise "
             "(recognise=True) takes them for these")  # fmt: skip
    if not found.n_cut or found.doubt:
        return None
    if not found.complete:
        _refuse_half_cut(mesh, found)
        return None
    _say(found, f"are taken for {_macros(found)} of an earlier cut, whose records are gone, and left as they are; "
         "--recut (recognise=False) cuts them")  # fmt: skip
    return found


def _say(found: RecognisedCut, what: str) -> None:
    faces = f"the {len(found.cells):,} face{'' if len(found.cells) == 1 else 's'} of {', '.join(found.names)}"
    warnings.warn(f"{faces} {what}", LacmeshWarning, stacklevel=4)


def _macros(found: RecognisedCut) -> str:
    return f"{found.n_macros:,} macro-element{'' if found.n_macros == 1 else 's'}"


def _refuse_half_cut(mesh: Mesh, found: RecognisedCut) -> None:
    """Raise CutError if half of the slave faces or more look like an earlier cut; fewer may do so by chance."""
    if not found.mostly_cut:
        return
    left = found.cells[found.left]
    raise CutError(
        f"this mesh was cut before (its records are gone), but not everywhere on {', '.join(found.names)} "
        f"(cells {mesh.cell_names(left)}); cut the mesh it came from, with every --slave at once, or --recut "
        "(recognise=False) cuts this one",
        mesh.cell_number[left],
    )


def _without_records(mesh: Mesh) -> Mesh:
    """Return the mesh without the records of an earlier cut; warn if there were any."""
    if not is_cut(mesh):
        return mesh
    message = f"the mesh is cut already: its records (zones {', '.join(mesh.zones)}) are replaced"
    warnings.warn(message, LacmeshWarning, stacklevel=3)
    cells = {name: values for name, values in mesh.cell_data.items() if name not in CELL_RECORDS}
    nodes = {name: values for name, values in mesh.node_data.items() if name != NODE_RECORD}
    return replace(mesh, cell_data=cells, node_data=nodes, zones=())


def _uncovered(mesh: Mesh, faces: Ints) -> Ints:
    """Return the faces that belong to no macro-element and are no duplicates of faces that do."""
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
    """(n_nodes,): the macro-element whose internal dof each node carries, or -1."""
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
