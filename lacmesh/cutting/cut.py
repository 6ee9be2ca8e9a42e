"""The cut: from a mesh and its slave skin to a mesh whose slave faces are macro-elements with an internal dof.

    slave, selection = the slave faces, the cells on them and behind them (select)
    recognised = macro-elements of an earlier cut without records         (recognition)
    patterns = how each face is cut: whole, cone or ring                  (variants)
    subdivision = new nodes, and the cells that replace others            (subdivide)
    new = the mesh with the children, their numbers, groups and data      (assemble)
    cut = the same with the records of its macro-elements                 (macros)

Method: Abbas, Drouet, Hild, Comput. Methods Appl. Mech. Engrg. 339, 2018, 488-513; code_aster R5.03.55, 3.1.
`docs/cut.md` has the theory.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lacmesh.cutting.assemble import assemble
from lacmesh.cutting.macros import internal_nodes, with_macros
from lacmesh.cutting.recognition import NOT_LAST, RecognisedCut, find_macros, with_records
from lacmesh.cutting.records import CELL_RECORDS, NODE_RECORD, Cut, is_cut
from lacmesh.cutting.select import Selection, SlaveSkin, select, slave_skin
from lacmesh.cutting.subdivide import WHOLE_CODE, Subdivision, subdivide
from lacmesh.cutting.variants import HEXA, allowed_variants, compare_variants, with_ring
from lacmesh.errors import CutError, LacmeshWarning, RequestError
from lacmesh.mesh import Ints, Mesh, MeshLike, as_mesh, spec_list
from lacmesh.topology.skin import Faces, find_repeats

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
    specs, mesh = spec_list(slave), as_mesh(mesh)
    if is_cut(mesh) and recognise is not False:
        return _already_cut(mesh, specs)
    slave_faces = slave_skin(mesh, specs, skin_only=skin_only)
    recognised = _taken_for_cut(mesh, specs, slave_faces, recognise)
    if recognised is not None:
        return Cut(with_records(mesh, recognised))
    mesh, selection = select(
        _without_records(mesh), specs, slave_faces, interface=interface, orient=orient, skin_only=skin_only
    )
    patterns, subdivision = _subdivide(mesh, selection, hexa, skin_only, (ring, depth))
    _warn_of_periodic(mesh, selection, patterns)
    internal = internal_nodes(subdivision.n_nodes, selection, patterns, subdivision.face_points, ring)
    new, origin = assemble(mesh, subdivision, selection.slave, extend=node_groups == "extend")
    del subdivision  # a large mesh's records are about to need the room
    return Cut(with_macros(mesh, new, selection, origin, internal))


def _subdivide(
    mesh: Mesh, selection: Selection, hexa: str, skin_only: bool, shape: tuple[float, float]
) -> tuple[Ints, Subdivision]:
    """Choose the pattern of every face, and cut; `auto` cuts both ways and keeps the better."""
    variants = allowed_variants(mesh, selection, hexa, skin_only)
    if hexa == "auto" and (skin_only or mesh.dim == 3):
        return compare_variants(mesh, selection, variants, shape)
    patterns = with_ring(selection.faces, variants.ring)
    return patterns, subdivide(mesh, selection.faces, patterns, selection.skin, selection.parents, *shape)


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


def _taken_for_cut(mesh: Mesh, specs: list[str], slave: SlaveSkin, recognise: bool | None) -> RecognisedCut | None:
    """Macro-elements recognised in slave faces without records; None if the faces are to be cut."""
    if not specs or recognise is False:
        return None
    recognised = find_macros(mesh, specs, slave)
    if recognise and not recognised.complete:
        left = recognised.cells[recognised.left]
        message = f"no earlier cut is recognised on {', '.join(specs)} (cells {mesh.cell_names(left)} are in none)"
        raise CutError(message, mesh.cell_number[left])
    if recognise:
        return recognised
    if not recognised.n_cut:
        return None
    macros = _macros(recognised)
    if recognised.mostly_cut and recognised.doubt == NOT_LAST:
        _say(recognised, f"look like {macros} of an earlier cut, but {NOT_LAST}: they are cut; --recognise "
             "(recognise=True) takes them for these")  # fmt: skip
    if recognised.doubt:
        return None
    if not recognised.complete:
        _refuse_half_cut(mesh, recognised)
        return None
    _say(recognised, f"are taken for {macros} of an earlier cut, whose records are gone, and left as they are; "
         "--recut (recognise=False) cuts them")  # fmt: skip
    return recognised


def _say(recognised: RecognisedCut, what: str) -> None:
    count = len(recognised.cells)
    faces = f"the {count:,} face{'' if count == 1 else 's'} of {', '.join(recognised.names)}"
    warnings.warn(f"{faces} {what}", LacmeshWarning, stacklevel=4)


def _macros(recognised: RecognisedCut) -> str:
    return f"{recognised.n_macros:,} macro-element{'' if recognised.n_macros == 1 else 's'}"


def _refuse_half_cut(mesh: Mesh, recognised: RecognisedCut) -> None:
    """Raise CutError if half of the slave faces or more look like an earlier cut; fewer may do so by chance."""
    if not recognised.mostly_cut:
        return
    left = recognised.cells[recognised.left]
    raise CutError(
        f"this mesh was cut before (its records are gone), but not everywhere on {', '.join(recognised.names)} "
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
