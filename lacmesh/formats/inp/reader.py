"""Reading .inp: scopes of numbers and names become a mesh."""

from __future__ import annotations

import warnings
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from lacmesh.errors import LacmeshWarning, ReadError, some
from lacmesh.formats.ids import Index, repeated
from lacmesh.formats.inp.deck import read_model
from lacmesh.formats.inp.plain import plane_of
from lacmesh.formats.inp.record import deck_of
from lacmesh.formats.inp.scope import ElementCard, NodesOf, Resolver, Scope, SurfaceCard
from lacmesh.formats.inp.skin import CellBlock, Skin
from lacmesh.mesh import Floats, Ints, Mesh, concatenated

_NONE = np.empty(0, np.int64)


def read(path: Path) -> Mesh:
    """Read the mesh in an .inp file of Abaqus or CalculiX. Raises ReadError, with the file and the line.

    All cards are in `Mesh.deck`. One LacmeshWarning names what is read otherwise than it stands.
    """
    model = read_model(path)
    said = model.said
    if not model.scope.nodes:
        raise ReadError(path, "has no nodes: there is no *NODE")
    number, points = _nodes(model.scope)
    listed, place, cell_number = _elements(model.scope, Index(number), said)
    skin = Skin(listed, len(number))
    node_groups, cell_groups, surfaces = _groups(model.scope, number, cell_number, skin, said)
    new, members = skin.finish([cell_groups.get(name, _NONE) for name in surfaces])
    if skin.unknown:
        said.append(f"surfaces name sides that are no faces, left out: {', '.join(skin.unknown)}")
    if said:
        warnings.warn(LacmeshWarning(f"{path}: {'; '.join(said)}"), stacklevel=2)
    for name, which in zip(surfaces, members, strict=True):
        cell_groups[name] = np.append(cell_groups.get(name, _NONE), which)
    blocks, before = _with_skin(listed, new)
    n_new = len(before) - len(place)
    largest = max(model.largest, int(cell_number.max(initial=0)))
    cell_number = np.append(cell_number, largest + 1 + np.arange(n_new))[before]
    place = np.append(place, len(place) + np.arange(n_new))[before]
    index = np.argsort(before)
    mesh = Mesh.create(
        points,
        blocks,
        space_dim=_space_dim(model.scope, points),
        node_number=number,
        cell_number=cell_number,
        file_order=None if (np.diff(place) > 0).all() else np.argsort(place),
        cell_groups={name: index[which] for name, which in cell_groups.items()},
        node_groups=node_groups,
        name=model.heading[0] if len(model.heading) == 1 else "mesh",
        plane=plane_of(model.scope.elements),
    )
    return replace(mesh, deck=deck_of(path, model, mesh))


def _nodes(scope: Scope) -> tuple[Ints, Floats]:
    number = np.concatenate([n.number for n in scope.nodes])
    twice = repeated(number) if len(number) else None
    if twice is not None:
        owner = [n.card for n in scope.nodes if (n.number == twice).any()][-1]
        raise owner.error(f"two nodes have the number {twice}")
    return number, np.concatenate([n.points for n in scope.nodes])


def _elements(scope: Scope, nodes: Index, said: list[str]) -> tuple[list[CellBlock], Ints, Ints]:
    """Elements that are cells, a block a type in order of first appearance; their positions in the file and numbers.

    Raises ReadError.
    """
    used = [e for e in scope.elements if e.element is not None and len(e.number)]
    number = concatenated(e.number for e in used)
    twice = repeated(number) if len(number) else None
    if twice is not None:
        owner = [e.card for e in used if (e.number == twice).any()][-1]
        raise owner.error(f"two elements have the number {twice}")
    first = np.cumsum([0, *(len(e.number) for e in used)])
    blocks, order = [], []
    types = [e.element.type for e in used if e.element is not None]
    for cell_type in dict.fromkeys(types):
        mine = [k for k, name in enumerate(types) if name == cell_type]
        rows = [_placed(used[k], nodes) for k in mine]
        what = [np.full(len(used[k].number), _what(used[k]), np.int8) for k in mine]
        blocks.append(CellBlock(cell_type, np.concatenate(rows), np.concatenate(what)))
        order += [np.arange(first[k], first[k + 1]) for k in mine]
    if "SEG3" in types:
        blocks = [_lines(b, nodes, scope, said) if b.type == "SEG3" else b for b in blocks]
    place = concatenated(order)
    _say_repeats(blocks, number[place], said)
    return blocks, place, number[place]


def _what(e: ElementCard) -> int:
    assert e.element is not None
    return e.element.kind


def _placed(e: ElementCard, nodes: Index) -> Ints:
    """Node indices of a card's elements, in lacmesh's node order. Raises ReadError for an unknown node."""
    assert e.element is not None
    places = np.empty(e.nodes.shape, np.int32)
    bad = nodes.convert(e.nodes, places)
    if bad is not None:
        wrong = e.nodes[bad][nodes.places(e.nodes[bad]) < 0][0]
        raise e.card.error(f"element {e.number[bad]} has the node {wrong}, which is not among the nodes")
    rows = np.empty_like(places)
    rows[:, list(e.element.nodes)] = places
    return rows


def _lines(block: CellBlock, nodes: Index, scope: Scope, said: list[str]) -> CellBlock:
    """Reorder lines of three nodes whose mid-node is listed last, as gmsh writes them, with a message in `said`."""
    points = np.concatenate([n.points for n in scope.nodes])
    a, b, middle = (points[block.nodes[:, k]] for k in range(3))
    as_listed = np.linalg.norm(middle - (a + b) / 2, axis=1)
    last = np.linalg.norm(b - (a + middle) / 2, axis=1)  # were the third node listed the middle
    turned = last < 0.5 * as_listed
    if turned.any():
        said.append(f"{int(turned.sum())} lines have their middle node last, not between their ends: read so")
        block.nodes[turned] = block.nodes[turned][:, [0, 2, 1]]
    return block


def _say_repeats(blocks: list[CellBlock], number: Ints, said: list[str]) -> None:
    """Report elements that list a node twice, which is legal (a collapsed brick is a wedge): they are kept."""
    start = 0
    for block in blocks:
        ordered = np.sort(block.nodes, axis=1)
        bad = np.flatnonzero((ordered[:, 1:] == ordered[:, :-1]).any(axis=1))
        if len(bad):
            said.append(f"{len(bad)} elements {block.type} have a node twice, kept so: {some(number[start + bad], 5)}")
        start += len(block.nodes)


def _groups(
    scope: Scope, node: Ints, cell: Ints, skin: Skin, said: list[str]
) -> tuple[dict[str, Ints], dict[str, Ints], list[str]]:
    """Indices of nodes and of cells by group; surfaces of faces are added to the skin, in the order of the names last.

    Raises ReadError.
    """
    resolver = Resolver(scope, {"node": np.sort(node), "element": np.sort(cell)}, NodesOf(scope.elements))
    nodes, elements = Index(node), Index(cell)
    of_nodes = {s.shown: nodes.places(resolver.numbers("node", k, s.card)) for k, s in scope.node_sets.items()}
    of_cells = {s.shown: elements.places(resolver.numbers("element", k, s.card)) for k, s in scope.element_sets.items()}
    surfaces = []
    for surface in scope.surfaces.values():
        entries = [_entry(resolver, surface, which) for _, which in surface.entries]
        if surface.of_nodes:
            more = concatenated(nodes.places(e) for e in entries)
            of_nodes[surface.shown] = np.append(of_nodes.get(surface.shown, _NONE), more)
            continue
        skin.begin()
        surfaces.append(surface.shown)
        for (face, _), which in zip(surface.entries, entries, strict=True):
            skin.add(surface.card, face, np.sort(elements.places(which)))
    if resolver.strays:
        said.append(f"{resolver.strays} members of sets and surfaces are no nodes or cells of the mesh, and left out")
    return of_nodes, of_cells, surfaces


def _entry(resolver: Resolver, surface: SurfaceCard, which: Ints | str) -> Ints:
    of = "node" if surface.of_nodes else "element"
    if isinstance(which, str):
        return resolver.numbers(of, which, surface.card)
    return resolver.existing(of, which)


def _with_skin(listed: list[CellBlock], new: list[tuple[str, Ints]]) -> tuple[list[tuple[str, Ints]], Ints]:
    """Blocks of the file's cells and of the new ones on surfaces, and the index that each cell had before.

    The new ones had the indices that follow those of the file.
    """
    offsets = np.cumsum([0, *(len(b.nodes) for b in listed)])
    blocks = {b.type: b.nodes for b in listed}
    index = {b.type: np.arange(lo, hi) for b, (lo, hi) in zip(listed, pairwise(offsets), strict=True)}
    n = int(offsets[-1])
    for cell_type, rows in new:
        index[cell_type] = np.append(index.get(cell_type, _NONE), n + np.arange(len(rows)))
        blocks[cell_type] = np.concatenate([blocks[cell_type], rows]) if cell_type in blocks else rows
        n += len(rows)
    return list(blocks.items()), concatenated(index.values())


def _space_dim(scope: Scope, points: Floats) -> int:
    """Return 2 if all nodes have z = 0 and there are plane elements, or none that need three dimensions; else 3."""
    spaces = {e.element.space for e in scope.elements if e.element is not None}
    return 3 if np.any(points[:, 2]) or (3 in spaces and 2 not in spaces) else 2
