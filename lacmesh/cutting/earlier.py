"""The cut that slave faces have already: by the records of their mesh, or recognised in the faces (`recognition`)."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from lacmesh.cutting.recognition import NOT_LAST, RecognisedCut, as_cut, find_macros
from lacmesh.cutting.records import Cut, is_cut
from lacmesh.cutting.select import SlaveSkin, slave_skin
from lacmesh.errors import CutError, LacmeshWarning, RequestError
from lacmesh.mesh import Ints, Mesh, MeshLike, as_mesh, spec_list
from lacmesh.topology.skin import Faces, find_repeats


def earlier_cut(mesh: Mesh, slave: SlaveSkin, recognise: bool | None) -> Cut | None:
    """Return the cut that some slave faces have already, or None if they are to be cut.

    `recognise`: as in `cut_skin`. Raises CutError if they are cut in part, or if no cut is there that must be.
    """
    recorded = is_cut(mesh)
    if recorded and recognise is False:
        message = f"the mesh is cut already: its records (zones {', '.join(mesh.zones)}) are replaced"
        warnings.warn(message, LacmeshWarning, stacklevel=3)
    if recorded and recognise is not False:
        return _recorded(mesh, slave)
    if recognise is False or not slave.names:
        return None
    recognised = find_macros(mesh, slave)
    return as_cut(mesh, recognised) if _is_taken(mesh, recognised, recognise) else None


def recognise(mesh: MeshLike, slave: str | int | Sequence[str | int], *, certain: bool = True) -> Cut | None:
    """Recognise the cut of the slave groups of a mesh; return it with its records, or None if they are not cut.

    Existing records are used as they are; without them the macro-elements are recognised from the faces and numbered
    zone by zone, in the order of their first faces. The cells that the children replaced are unknown: `lac_parent` is
    left out. `certain`: require all marks of a cut, half-widths of 1/3 and the new nodes last; otherwise the pattern of
    the faces is sufficient, for a cut with another `ring` or a mesh that was renumbered. A skin that is only partly cut
    gives None and a LacmeshWarning with the remaining faces. Raises GroupNotFoundError and RequestError.

    >>> from dataclasses import replace
    >>> from lacmesh import cut_skin, read
    >>> mesh = read("data/two_blocks.msh")
    >>> bare = replace(cut_skin(mesh, "slave").mesh, cell_data={}, node_data={})
    >>> recognise(bare, "slave").n_macros, recognise(mesh, "slave")
    (36, None)
    """
    mesh, specs = as_mesh(mesh), spec_list(slave)
    if is_cut(mesh):
        return Cut(mesh)
    if not specs:
        raise RequestError("no slave group was given")
    recognised = find_macros(mesh, slave_skin(mesh, specs))
    if certain and recognised.doubt:
        return None
    if recognised.n_macros and not len(recognised.left):
        return as_cut(mesh, recognised)
    if recognised.n_cut:
        left = mesh.cell_names(recognised.cells[recognised.left])
        message = f"the slave skin is cut in part: cells {left} belong to no macro-element of it"
        warnings.warn(message, LacmeshWarning, stacklevel=2)
    return None


def _recorded(mesh: Mesh, slave: SlaveSkin) -> Cut:
    """Return the cut that a mesh has records of. Raises CutError if a slave group has faces that are not cut."""
    cut = Cut(mesh)
    dim = int(mesh.cell_dim[cut.macro_of_face >= 0].max())
    for name in slave.names:
        faces = mesh.cells_of(name)
        faces = faces[mesh.cell_dim[faces] == dim]
        left = _uncovered(cut, faces)
        if len(left) or not len(faces):
            raise CutError(
                f"this mesh is cut already (zones {', '.join(mesh.zones)}), but not everywhere on {name!r} "
                f"(cells {mesh.cell_names(left)}); cut the mesh it came from, with every --slave at once",
                mesh.cell_number[left],
            )
    return cut


def _uncovered(cut: Cut, faces: Ints) -> Ints:
    """Return the faces that belong to no macro-element and are no duplicates of faces that do."""
    mesh, macro = cut.mesh, cut.macro_of_face
    left = faces[macro[faces] < 0]
    covered = Faces.join((kind, nodes) for kind, _, nodes in mesh.select(np.flatnonzero(macro >= 0)))
    repeats = find_repeats(covered, [(kind, nodes, cells) for kind, cells, nodes in mesh.select(left)], mesh.n_nodes)
    return np.setdiff1d(left, repeats.cell)


def _is_taken(mesh: Mesh, recognised: RecognisedCut, recognise: bool | None) -> bool:
    """True if recognised macro-elements are to be taken for an earlier cut; a warning where they only look like one.

    Raises CutError if they were asked for and are not complete.
    """
    names = ", ".join(recognised.names)
    if recognise and not recognised.complete:
        left = recognised.cells[recognised.left]
        message = f"no earlier cut is recognised on {names} (cells {mesh.cell_names(left)} are in none)"
        raise CutError(message, mesh.cell_number[left])
    if not recognise and recognised.mostly_cut and recognised.doubt in ("", NOT_LAST):
        n_faces, n_macros = len(recognised.cells), recognised.n_macros
        message = f"the {n_faces:,} face{'' if n_faces == 1 else 's'} of {names} look like {n_macros:,} macro-element"
        message += f"{'' if n_macros == 1 else 's'} of an earlier cut without records, and are cut as they are"
        advice = "--recognise (recognise=True) takes them for these"
        warnings.warn(f"{message}; {advice}", LacmeshWarning, stacklevel=4)
    return bool(recognise)
