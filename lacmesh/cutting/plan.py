"""Plan of a cut: the slave faces, the cells on them, their parents, and the pattern by which each is cut."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from lacmesh.cells import CARRIED, CELLS
from lacmesh.cutting.patterns import RING_PARENTS, WHOLE_FACES
from lacmesh.cutting.subdivide import CONE_CODE, RING_CODE, WHOLE_CODE, subdivide
from lacmesh.errors import CutError, LacmeshWarning, RequestError
from lacmesh.mesh import Ints, Mesh, codes, distinct
from lacmesh.quality import corner_jacobian
from lacmesh.topology.components import label_components
from lacmesh.topology.faces import cells_of_dim, distinct_faces
from lacmesh.topology.orientation import turn_outward
from lacmesh.topology.skin import FACE_TYPES, FaceIncidence, Faces, find_owners, find_repeats

HEXA = ("pyramid", "hexa", "auto")
_WHOLE_TYPES = np.array([name in WHOLE_FACES for name in FACE_TYPES])
_RING_TYPES = np.array([name in ("SEG2", "QUAD4", "QUAD8") for name in FACE_TYPES])


@dataclass(frozen=True)
class Plan:
    """Plan of a cut: `faces`, one per macro-element, with `kinds` (f,), codes of `subdivide.KINDS`, and `zone` (f,).

    `slave` (f,): the cell of the mesh that gave each face its node order. `skin`: every cell on a face, the slave cells
    and their duplicates; sorted by cell. `parents`: the parent cells.
    """

    faces: Faces
    kinds: Ints
    zones: tuple[str, ...]
    zone: Ints
    slave: Ints
    skin: FaceIncidence
    parents: FaceIncidence


def make_plan(
    mesh: Mesh,
    specs: list[str],
    hexa: str,
    interface: str,
    orient: str,
    skin_only: bool,
    shape: tuple[float, float],
) -> tuple[Mesh, Plan]:
    """Make the plan of a cut; return it with the mesh, whose slave faces are oriented outward if requested."""
    _check_numbers(mesh)
    zones, cells, zone = _slave_cells(mesh, specs, skin_only)
    faces, first = distinct_faces(mesh, cells)
    dim = int(mesh.cell_dim[cells[0]])
    _refuse_higher_order(mesh, faces, dim)
    parents = find_owners(faces, cells_of_dim(mesh, dim + 1), mesh.n_nodes)
    _check_parents(mesh, faces, cells[first], parents, interface, skin_only)
    if orient == "outward":
        mesh, faces = turn_outward(mesh, cells, faces, first, parents)
    skin = _by_cell(find_repeats(faces, cells_of_dim(mesh, dim), mesh.n_nodes))
    if not skin.same.all():
        odd = skin.cell[~skin.same]
        raise CutError(
            f"cells {mesh.cell_names(odd)} lie on slave faces with other nodes (linear on quadratic?); remove them",
            mesh.cell_number[odd],
        )
    _warn_of_twins(mesh, cells, first)
    kinds = _choose(mesh, faces, skin, parents, hexa, skin_only, shape)
    return mesh, Plan(faces, kinds, zones, zone[first], cells[first], skin, parents)


def _check_numbers(mesh: Mesh) -> None:
    """Check that the numbers of cells and of nodes are unique, because the records of a cut refer to them."""
    for what, numbers in (("cells", mesh.cell_number), ("nodes", mesh.node_number)):
        if len(numbers) and (numbers.min() < 0 or not distinct(numbers)):
            raise CutError(f"the numbers of {what} are not distinct, or some are negative: number them again")


def _slave_cells(mesh: Mesh, specs: list[str], skin_only: bool) -> tuple[tuple[str, ...], Ints, Ints]:
    """Return zone names, the slave faces (each cell once, in its first zone), and the zone of each face."""
    if not specs:
        raise RequestError("no slave group was given")
    names = [_name(mesh, spec) for spec in specs]
    if len(set(names)) < len(names):
        raise RequestError(f"a slave group is given twice: {', '.join(names)}")
    parts = [_skin_faces(mesh, name, skin_only) for name in names]
    cells = np.concatenate(parts)
    zone = np.repeat(np.arange(len(parts)), [len(p) for p in parts])
    first = np.arange(len(cells)) if len(parts) == 1 else np.sort(np.unique(cells, return_index=True)[1])
    dims = codes(mesh.cell_dim[cells])
    if mesh.dim < 2:
        raise CutError("this mesh has lines and points only: there is no skin to cut")
    empty = [name for k, name in enumerate(names) if not (zone[first] == k).any()]
    if empty:
        message = f"every face of {', '.join(empty)} is in an earlier slave group: no macro-element is of that zone"
        warnings.warn(message, LacmeshWarning, stacklevel=4)
    if len(dims) > 1:
        raise CutError(f"the slave groups {', '.join(names)} have faces of dimensions {dims.tolist()}; cut them apart")
    return tuple(names), cells[first], zone[first]


def _name(mesh: Mesh, spec: str) -> str:
    if not spec.startswith("entity:") or spec in mesh.cell_groups:
        return mesh.group(spec)
    mesh.cells_of(spec)
    return ":".join(["entity", *(str(int(part)) for part in spec.split(":")[1:])])


def _skin_faces(mesh: Mesh, name: str, skin_only: bool) -> Ints:
    cells = mesh.cells_of(name)
    if not len(cells):
        raise CutError(f"the slave group {name!r} is empty")
    dims = mesh.cell_dim[cells]
    want = int(dims.max()) if skin_only else mesh.dim - 1
    wrong = cells[dims > want] if not skin_only else cells[(dims < 1) | (dims > 2)]
    if len(wrong) or not (dims == want).any():
        odd = wrong if len(wrong) else cells
        raise CutError(
            f"the slave group {name!r} holds cells of dimension {int(mesh.cell_dim[odd].max())} "
            f"({mesh.cell_names(odd)}); a slave skin is made of faces of dimension "
            + ("1 or 2" if skin_only else f"{max(want, 1)}, one less than the cells behind it"),
            mesh.cell_number[odd],
        )
    if (dims < want).any():
        message = f"the slave group {name!r} also holds cells of lower dimension: they are left as they are"
        warnings.warn(message, LacmeshWarning, stacklevel=5)
    faces = cells[dims == want]
    for kind, which, _ in mesh.select(faces):
        if kind not in CELLS:
            message = f"slave faces of type {kind} ({mesh.cell_names(which)}) cannot be cut"
            raise CutError(message, mesh.cell_number[which])
    return faces


def _by_cell(match: FaceIncidence) -> FaceIncidence:
    order = np.argsort(match.cell, kind="stable")
    return FaceIncidence(match.face[order], match.cell[order], match.facet[order], match.same[order])


def _check_parents(
    mesh: Mesh, faces: Faces, slave: Ints, parents: FaceIncidence, interface: str, skin_only: bool
) -> None:
    def fail(which: Ints, message: str) -> None:
        names = mesh.cell_names(slave[which])
        raise CutError(f"slave faces {names} {message}", mesh.cell_number[slave[which]])

    count = np.bincount(parents.face, minlength=len(faces))
    if skin_only:
        if (count > 0).any():
            fail(np.flatnonzero(count), "have cells behind them, which a cut of the skin only would tear apart")
        return
    if (count == 0).any():
        fail(
            np.flatnonzero(count == 0), "have no parent cell; --skin-only cuts a surface without parent cells (a shell)"
        )
    if (count > 2).any():
        fail(np.flatnonzero(count > 2), "have more than two cells behind them: the mesh is not a manifold there")
    if not parents.same.all():
        odd = np.unique(parents.face[~parents.same])
        behind = mesh.cell_names(parents.cell[~parents.same])
        fail(
            odd, f"and the cells behind them ({behind}) do not have the same mid-nodes: elevate the order of both alike"
        )
    if interface == "refuse" and (count == 2).any():
        fail(np.flatnonzero(count == 2), "lie between two cells; --interface both cuts both sides")


def _refuse_higher_order(mesh: Mesh, faces: Faces, dim: int) -> None:
    """Raise an error if a cell of order 3 or higher has a slave face or lies on one: such cells are never cut."""
    corners = None
    for kind, nodes, cells in (
        b for d in (dim, dim + 1) for b in cells_of_dim(mesh, d) if b[0] in CARRIED and len(b[1])
    ):
        if corners is None:
            corners = {tuple(sorted(c for c in row if c >= 0)) for row in faces.corners.tolist()}
        own = nodes[:, : CARRIED[kind].n_corners]
        for row in np.flatnonzero(np.count_nonzero(np.isin(own, faces.corners), axis=1) > dim):
            sets = (s for n in {len(c) for c in corners} for s in combinations(sorted(own[row].tolist()), n))
            if not corners.isdisjoint(sets):
                message = (
                    f"the {kind} {mesh.cell_number[cells[row]]} has a slave face, and cells of its order are not cut"
                )
                raise CutError(message, [mesh.cell_number[cells[row]]])


def _warn_of_twins(mesh: Mesh, cells: Ints, first: Ints) -> None:
    if len(first) < len(cells):
        twins = np.setdiff1d(cells, cells[first])
        message = f"slave faces stand twice in the slave groups (cells {mesh.cell_names(twins)} repeat others): "
        warnings.warn(message + "one macro-element each, both copies cut", LacmeshWarning, stacklevel=4)


def _choose(
    mesh: Mesh,
    faces: Faces,
    skin: FaceIncidence,
    parents: FaceIncidence,
    hexa: str,
    skin_only: bool,
    shape: tuple[float, float],
) -> Ints:
    """Choose the pattern of every face before anything is cut: a parent uses one variant for all its slave faces."""
    if skin_only:
        ring = _RING_TYPES[faces.type] & (faces.type != FACE_TYPES.index("SEG2"))
        alone = FaceIncidence(*(np.empty(0, np.int64),) * 3, np.empty(0, bool))
        if hexa == "auto":
            return _better(mesh, faces, skin, alone, ring, np.arange(len(faces)), shape)
        return _kinds(faces, ring & (hexa == "hexa"))
    able = _ring_able(mesh, parents.cell, hexa)
    ring = _RING_TYPES[faces.type].copy()
    ring[parents.face[~able]] = False
    component: Ints = np.arange(len(faces))
    if hexa == "auto" or (able & ~ring[parents.face]).any():
        component = _components(len(faces), parents, able)
        spoilt = np.zeros(len(faces), bool)
        spoilt[component[~ring & ~_WHOLE_TYPES[faces.type]]] = True
        ring &= ~spoilt[component]
    if hexa == "auto" and mesh.dim == 3:
        return _better(mesh, faces, skin, parents, ring, component, shape)
    return _kinds(faces, ring)


def _kinds(faces: Faces, ring: Ints) -> Ints:
    return np.where(_WHOLE_TYPES[faces.type], WHOLE_CODE, np.where(ring, RING_CODE, CONE_CODE))


def _ring_able(mesh: Mesh, cells: Ints, hexa: str) -> Ints:
    types = [b.type in RING_PARENTS and (hexa != "pyramid" or b.type == "QUAD4") for b in mesh.blocks]
    return np.array(types, bool)[np.searchsorted(mesh.offsets, cells, side="right") - 1]


def _components(n_faces: int, parents: FaceIncidence, able: Ints) -> Ints:
    """(n_faces,): labels of faces that must be cut alike because parents that allow the ring connect them."""
    _, cell = np.unique(parents.cell[able], return_inverse=True)
    face = parents.face[able]
    size = n_faces + (int(cell.max()) + 1 if len(cell) else 0)
    labels = label_components(face, n_faces + cell, size)[:n_faces]
    return np.unique(labels, return_inverse=True)[1]


def _better(
    mesh: Mesh,
    faces: Faces,
    skin: FaceIncidence,
    parents: FaceIncidence,
    ring: Ints,
    component: Ints,
    shape: tuple[float, float],
) -> Ints:
    """Choose the variant with the higher minimum Jacobian, for each set of faces to be cut alike; ring on a tie."""
    worst = []
    for kinds in (_kinds(faces, np.zeros_like(ring)), _kinds(faces, ring)):
        made = subdivide(mesh, faces, kinds, skin, parents, *shape)
        points = np.vstack([mesh.points, np.zeros((made.n_nodes - mesh.n_nodes, 3))])
        for birth in made.births:
            points[birth.ids] = birth.values(points)
        face_of_root = np.full(mesh.n_cells, -1)
        face_of_root[parents.cell] = parents.face
        face_of_root[skin.cell] = skin.face
        least = np.full(len(faces), np.inf)
        for block in made.leaves:
            quality = corner_jacobian(block.type, points[block.nodes], mesh.space_dim == 2)
            np.minimum.at(least, component[face_of_root[block.root]], quality)
        worst.append(least)
    return _kinds(faces, ring & (worst[1] >= worst[0])[component])
