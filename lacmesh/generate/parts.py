"""Parts of which shapes are made: grids of boxes, divided into cells of a kind, with their sides as groups."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lacmesh.cells import CELLS
from lacmesh.cutting.order import raise_order
from lacmesh.errors import RequestError
from lacmesh.mesh import Block, Floats, Ints, Mesh
from lacmesh.topology.skin import label_rows

#: how a box of the grid is divided: cells by their type and its corners, of which 8 is its centre
Pattern = tuple[tuple[str, tuple[int, ...]], ...]
#: a number of cells for all axes, or for each axis a number of cells or the coordinates of the grid's lines
Counts = int | Sequence[int | ArrayLike]

_FACETS = tuple(facet.nodes for facet in CELLS["HEXA8"].facets)
_KUHN = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))  # Kuhn, 1960
_AROUND: Pattern = tuple(("PYRAM5", (*facet[::-1], 8)) for facet in _FACETS)
#: linear cells, and what prisms turn up, -> the pattern of such cells alone
SPLITS: dict[str, Pattern] = {
    "SEG2": (("SEG2", (0, 1)),),
    "TRIA3": (("TRIA3", (0, 1, 2)), ("TRIA3", (0, 2, 3))),
    "QUAD4": (("QUAD4", (0, 1, 2, 3)),),
    "TETRA4": tuple(("TETRA4", corners) for corners in _KUHN),
    "HEXA8": (("HEXA8", tuple(range(8))),),
    "PENTA6": (("PENTA6", (0, 1, 2, 4, 5, 6)), ("PENTA6", (0, 2, 3, 4, 6, 7))),
    "PYRAM5": _AROUND,
    "PENTA6 quadrangle": (("PENTA6", (0, 3, 7, 1, 2, 6)), ("PENTA6", (0, 7, 4, 1, 6, 5))),
}
#: three pyramids with their apex in a corner of the box: triangles on the facets that have that corner
_CORNERED: tuple[Pattern, ...] = tuple(
    tuple(("PYRAM5", (*facet[::-1], corner)) for facet in _FACETS if corner not in facet) for corner in range(8)
)
_MIXED = {"mixed": "1", "mixed 1": "1", "mixed 2": "2", "mixed 2-full": "2-full"}
_FULL = ("QUAD9", "HEXA27", "PENTA18", "PYRAM14")
#: sides of a part that meet other parts
SEAM = "seam"
#: distance of nodes that are one, over the size of the mesh; the largest distortion: at 1/7 pyramids become flat
_NEAR, _MOST = 1e-9, 0.125


def kinds(dim: int) -> tuple[str, ...]:
    """Return the kinds of cells of dimension 1, 2 or 3 that a mesh can be made of.

    >>> kinds(2)
    ('TRIA3', 'TRIA6', 'TRIA7', 'QUAD4', 'QUAD8', 'QUAD9', 'mixed', 'mixed 2', 'mixed 2-full')
    """
    types = [name for name, cell in CELLS.items() if cell.dim == dim]
    both = [f"{name} {face}" for name in types for face in ("triangle", "quadrangle") if name[:5] in ("PENTA", "PYRAM")]
    return (*types, *both, *(("mixed", "mixed 2", "mixed 2-full") if dim > 1 else ()))


def dim_of(kind: str, dims: Sequence[int]) -> int:
    """The dimension of a kind of cells, one of `dims`; the first of these for mixtures. Raises RequestError."""
    known = [dim for dim in dims if kind in kinds(dim) or (dim > 1 and kind in _MIXED)]
    if not known:
        names = [name for dim in dims for name in kinds(dim)]
        raise RequestError(f"kind is one of {', '.join(names)}, not {kind!r}")
    return known[0]


def box_of(
    kind: str, dim: int, n: Counts, size: ArrayLike, corner: ArrayLike, distortion: float,
    seed: int | np.random.Generator, sides: Sequence[tuple[str, str]],
) -> Mesh:  # fmt: skip
    """A box of a kind of cells, with its sides in groups of the names `sides`: (least, greatest) of each axis."""
    dim_of(kind, (dim,))
    if not 0 <= distortion <= _MOST:
        raise RequestError(f"distortion is a share of a cell from 0 to {_MOST}, not {distortion}")
    try:
        sizes, corners = (np.broadcast_to(np.asarray(x, float), dim) for x in (size, corner))
    except ValueError:
        raise RequestError(f"a size and a corner are a number or {dim} numbers") from None
    axes: list[Any] = [n] * dim if np.isscalar(n) else list(n)  # type: ignore[arg-type]
    if len(axes) != dim:
        raise RequestError(f"n is a number of cells, or {dim} of them, one along each axis, not {n}")
    lines = [_lines(own, *ends) for own, *ends in zip(axes, sizes, corners, strict=True)]
    points = _tensor(lines)
    if distortion:
        random = seed if isinstance(seed, np.random.Generator) else np.random.Generator(np.random.PCG64(seed))
        steps = [np.minimum(np.diff(x, append=np.inf), np.diff(x, prepend=-np.inf)) for x in lines]
        points += distortion * _moves(points, sides, random) * _tensor(steps)
    return raised(linear(points, kind, sides), kind)


def _lines(n: Any, size: float, corner: float) -> Floats:
    """Coordinates of the grid's lines along an axis, ascending. Raises RequestError."""
    if np.ndim(n) == 1:
        lines = np.asarray(n, float)
        if len(lines) < 2 or not (np.diff(lines) > 0).all():
            raise RequestError("lines of a grid are two or more ascending coordinates")
        return lines
    if not isinstance(n, (int, np.integer)) or n < 1:
        raise RequestError(f"the number of cells along an axis is a whole number from 1, not {n}")
    if not (size > 0 and np.isfinite([size, corner]).all()):
        raise RequestError(f"a size is above 0, not {size}")
    return np.asarray(corner + size * (np.arange(n + 1) / n))


def _tensor(lines: Sequence[Floats]) -> Floats:
    """Points (a, .., d) of a grid of lines."""
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)


def _moves(points: Floats, sides: Sequence[tuple[str, str]], random: np.random.Generator) -> Floats:
    """Random moves of the corners of a grid, in steps, from -1 to 1; not across sides, and not at all on seams."""
    moves = random.uniform(-1, 1, points.shape)
    for axis, names in enumerate(sides):
        for end, name in zip((0, -1), names, strict=True):
            on = np.moveaxis(moves, axis, 0)[end]
            on[..., slice(None) if name == SEAM else axis] = 0.0
    return moves


def linear(
    points: Floats, kind: str, sides: Sequence[tuple[str, str]], division: tuple[Sequence[Pattern], Ints] | None = None
) -> Mesh:
    """Linear cells of a kind between corner points (a, .., d), and their faces on the sides.

    `division`: patterns, and the index of each box's pattern (k,), where they are not those of the kind.
    """
    shape, dim = points.shape[:-1], points.shape[-1]
    number = np.arange(np.prod(shape)).reshape(shape)
    corners = (np.array(CELLS[("SEG2", "QUAD4", "HEXA8")[dim - 1]].reference) > 0).astype(int)
    boxes = np.stack(
        [number[tuple(slice(c, c + n - 1) for c, n in zip(own, shape, strict=True))].ravel() for own in corners], axis=1
    )
    place = np.stack(np.unravel_index(np.arange(len(boxes)), [n - 1 for n in shape]), axis=1)
    x, rows = divided(points.reshape(-1, dim), boxes, *(division or _patterns(kind, [n - 1 for n in shape], place)))
    groups = {(name, "body"): nodes for name, nodes in rows.items()}
    for axis, names in enumerate(sides[:dim]):
        for end, side in zip((0, -1), names, strict=True):
            on = np.zeros(len(x), bool)
            on[np.moveaxis(number, axis, 0)[end]] = True
            for key, faces in _facets_on(rows, on, dim):
                groups[key, side] = np.concatenate([groups[key, side], faces]) if (key, side) in groups else faces
    return assembled(x, groups, dim)


def _facets_on(rows: Mapping[str, Ints], on: NDArray[np.bool_], dim: int) -> list[tuple[str, Ints]]:
    """Facets (type, nodes) of cells all of whose nodes are `on` a side."""
    out = []
    for kind, nodes in rows.items():
        close = nodes[on[nodes].sum(axis=1) >= dim]
        for facet in CELLS[kind].facets:
            own = close[:, facet.nodes]
            out.append((facet.type, own[on[own].all(axis=1)]))
    return [(name, own) for name, own in out if len(own)]


def _patterns(kind: str, counts: Sequence[int], place: Ints) -> tuple[Sequence[Pattern], Ints]:
    """Patterns that divide the boxes of a grid at places (k, dim), and the index of each box's pattern (k,)."""
    none = np.zeros(len(place), int)
    if kind in _MIXED and len(counts) == 2:
        return [SPLITS["QUAD4"], SPLITS["TRIA3"]], place[:, 0] % 2
    if kind in _MIXED:
        column = (place[:, 0] + place[:, 1]) % 3
        lowest, highest = place[:, 2] == 0, place[:, 2] == counts[2] - 1
        outer = [(column == 2) & lowest & highest, (column == 2) & lowest, (column == 2) & highest]
        which = np.select(outer, [4, 2, 3], column == 1)
        opened = (_opened(facets) for facets in ((0,), (5,), (0, 5)))
        return [SPLITS["HEXA8"], SPLITS["PENTA6"], *opened], which
    name, _, face = kind.partition(" ")
    linear = CELLS[name].linear
    if (linear, face) == ("PYRAM5", "triangle"):
        corners = (np.array(CELLS["HEXA8"].reference) > 0).astype(int)
        return _CORNERED, (place[:, None] % 2 == corners).all(axis=2).argmax(axis=1)
    return [SPLITS.get(f"{linear} {face}", SPLITS[linear])], none


def _opened(facets: Sequence[int]) -> Pattern:
    """Six pyramids around the centre of a hexahedron, of which those on some facets are two tetrahedra each."""
    cells = list(_AROUND[k] for k in range(6) if k not in facets)
    for a, b, c, d in (_FACETS[k][::-1] for k in facets):
        cells += [("TETRA4", (a, b, c, 8)), ("TETRA4", (a, c, d, 8))]
    return tuple(cells)


def divided(points: Floats, boxes: Ints, patterns: Sequence[Pattern], which: Ints) -> tuple[Floats, dict[str, Ints]]:
    """Boxes (k, corners) divided into cells: points, with the centres of boxes that need them, and type -> nodes."""
    centred = np.array([any(8 in corners for _, corners in pattern) for pattern in patterns])[which]
    if centred.any():
        centre = np.zeros((len(boxes), 1), boxes.dtype)
        centre[centred, 0] = len(points) + np.arange(centred.sum())
        points = np.concatenate([points, points[boxes[centred]].mean(axis=1)])
        boxes = np.concatenate([boxes, centre], axis=1)
    rows: dict[str, list[Ints]] = defaultdict(list)
    for k, pattern in enumerate(patterns):
        own = boxes if len(patterns) == 1 else boxes[which == k]
        for kind, corners in pattern if len(own) else ():
            rows[kind].append(own[:, corners])
    cells = {kind: np.concatenate(parts) for kind, parts in rows.items()}
    return points, {kind: nodes for kind, nodes in cells.items() if len(nodes)}


def assembled(points: Floats, rows: Mapping[tuple[str, str], Ints], dim: int) -> Mesh:
    """A mesh of the cells (k, n) of each type and group; those of the group "" are in none."""
    blocks: dict[str, list[Ints]] = defaultdict(list)
    for (kind, _), nodes in rows.items():
        blocks[kind].append(nodes)
    sizes = {kind: sum(map(len, parts)) for kind, parts in blocks.items()}
    first = dict(zip(sizes, np.cumsum([0, *sizes.values()])[:-1].tolist(), strict=True))
    groups: dict[str, list[Ints]] = defaultdict(list)
    for (kind, name), nodes in rows.items():
        groups[name].append(first[kind] + np.arange(len(nodes)))
        first[kind] += len(nodes)
    cells = [(kind, np.concatenate(parts)) for kind, parts in blocks.items()]
    named = {name: np.concatenate(own) for name, own in groups.items() if name}
    return Mesh.create(points, cells, space_dim=max(dim, 2), cell_groups=named)


def raised(mesh: Mesh, kind: str) -> Mesh:
    """The mesh with cells of the order of a kind, whose new nodes lie in the middle of edges, faces and cells."""
    name = kind.partition(" ")[0]
    order = _MIXED.get(kind) or ("2-full" if name in _FULL else str(CELLS[name].order))
    if order == "1":
        return mesh
    mesh = raise_order(mesh, order, surface="faces")
    if name != "TRIA7":
        return mesh
    six = mesh.block("TRIA6")
    seven = np.column_stack([six, mesh.n_nodes + np.arange(len(six))])
    blocks = [Block("TRIA7", seven) if block.type == "TRIA6" else block for block in mesh.blocks]
    points = np.concatenate([mesh.points, mesh.points[six[:, :3]].mean(axis=1)])
    return Mesh.create(points, blocks, space_dim=mesh.space_dim, cell_groups=mesh.cell_groups)


def sew(mesh: Mesh, group: str) -> Mesh:
    """The mesh with nodes of a group of faces at one place made one; faces that come twice are no cells any more."""
    if group not in mesh.cell_groups:
        return mesh
    from scipy.spatial import cKDTree

    cells = mesh.cell_groups[group]
    on = mesh.nodes_on(cells)
    near = _NEAR * np.ptp(mesh.points, axis=0).max()
    a, b = on[cKDTree(mesh.points[on]).query_pairs(near, output_type="ndarray")].T
    new = np.arange(mesh.n_nodes)
    np.minimum.at(new, np.maximum(a, b), np.minimum(a, b))
    mesh = replace(mesh, blocks=tuple(Block(kind, new[nodes]) for kind, nodes in mesh.blocks))
    twice = np.zeros(mesh.n_cells, bool)
    for _, own, nodes in mesh.select(cells):
        labels, count = label_rows(np.sort(nodes, axis=1))
        twice[own] = np.bincount(labels, minlength=count)[labels] == 2
    groups = {name: own[~twice[own]] for name, own in mesh.cell_groups.items()}
    groups = {name: own for name, own in groups.items() if len(own)}
    sewn = replace(mesh, cell_groups=groups).only(*groups)
    return replace(sewn, node_number=np.arange(sewn.n_nodes) + 1, cell_number=np.arange(sewn.n_cells) + 1)


def check_seams(mesh: Mesh, kind: str, shape: str) -> Mesh:
    """The mesh of parts that were sewn together. Raises RequestError if faces of two parts do not match."""
    if SEAM in mesh.cell_groups:
        raise RequestError(f"cells of kind {kind!r} do not match where parts of this {shape} meet; take another kind, "
                           "or even numbers of cells")  # fmt: skip
    return mesh
