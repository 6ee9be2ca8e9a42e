"""The cut of a mesh by several processes: each cuts its own part, and the parts together are those of the whole cut.

A cut changes the slave faces, the cells on them and the cells behind them, and nothing else. Where the slave groups are
in every part (`Part.everywhere`), as the pairing of slave and master needs it anyway, each process cuts all of them: it
knows every new node and every child in the order of the whole cut, and computes their indices and numbers without
communication. What the variant of a hexahedron depends on, which spreads from face to face, is known to it too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lacmesh.cutting.cut import cut_skin
from lacmesh.errors import RequestError
from lacmesh.joining import restrict
from lacmesh.mesh import Ints, Mesh, concatenated, mask_of, spec_list
from lacmesh.origin import bounds_of
from lacmesh.partition.parts import Bools, Part, needed, skin_name


def cut_part(part: Part, slave: str | Sequence[str], **options: Any) -> Part:
    """Cut the slave groups in a part of a mesh; return the part of the mesh that `cut_skin` makes of the whole mesh.

    `slave` and the options `hexa`, `macro`, `crease_angle` and `dirichlet` are as for `cut_skin`. A new node
    belongs to the owner of the first node of the face or cell that it was put into (`Origin`). A part of a cut mesh
    is returned unchanged; an earlier cut without records is not recognised. Raises RequestError for a slave group
    that is not in every part, and what `cut_skin` raises, on every process alike.
    """
    specs = spec_list(slave)
    missing = [spec for spec in specs if skin_name(part.mesh, spec) not in part.everywhere]
    if missing:
        raise RequestError(f"slave {missing[0]!r} is not in every part; read the parts with everywhere={specs}")
    if part.mesh.zones:
        cut_skin(part.mesh, specs)
        return part
    cut = cut_skin(part.mesh, specs, recognise=False, **options)
    old, origin = part.mesh, cut.origin
    assert origin is not None
    more = cut.mesh.points[old.n_nodes :]
    nodes = np.concatenate([part.node, part.n_nodes + np.arange(len(more))])
    cells, types = _cells_of_whole(part, cut.mesh, mask_of(old.n_cells, origin.cell[origin.children]))
    owner, body = part.owner[origin.node], part.body[origin.node]
    new = _numbered(part, cut.mesh)
    node, cell = needed(new, owner == part.rank, part.everywhere)
    return replace(
        part,
        mesh=restrict(new, node, cell),
        node=nodes[node],
        owner=owner[node],
        cell=cells[cell],
        body=body[node],
        n_nodes=part.n_nodes + len(more),
        types=types,
        largest_node=max(part.largest_node, int(new.node_number.max(initial=0))),
        largest_cell=max(part.largest_cell, int(new.cell_number.max(initial=0))),
        used=bounds_of(np.vstack([part.used, more])),
        box=bounds_of(np.vstack([part.box, more])),
    )


def _cells_of_whole(part: Part, new: Mesh, removed: Bools) -> tuple[Ints, tuple[tuple[str, int], ...]]:
    """Return the index of each cell of `new` in the whole cut mesh, and the types of that with their numbers of cells.

    A block has the cells that stay, in their old order, and then the children, all of which are in the part.
    `removed` (c,): cells of the part that children replace.
    """
    old, indices, types, start, before = part.mesh, [], [], 0, 0
    for k, block in enumerate(new.blocks):
        rows, count = (slice(*old.offsets[k : k + 2]), part.types[k][1]) if k < len(old.blocks) else (slice(0), 0)
        cells, out = part.cell[rows], removed[rows]
        stay = cells[~out] - before - np.searchsorted(cells[out], cells[~out])
        n_stay, n_children = count - int(out.sum()), len(block.nodes) - len(stay)
        indices += [start + stay, start + n_stay + np.arange(n_children)]
        types.append((block.type, n_stay + n_children))
        start, before = start + n_stay + n_children, before + count
    return concatenated(indices), tuple(types)


def _numbered(part: Part, new: Mesh) -> Mesh:
    """Return the cut mesh with the numbers of the whole cut: those of new nodes and cells follow its largest ones."""
    added = new.n_nodes - part.mesh.n_nodes
    nodes = part.largest_node + 1 + np.arange(added)
    largest = int(part.mesh.cell_number.max(initial=0))
    cells = new.cell_number.astype(np.int64)
    cells[cells > largest] += part.largest_cell - largest
    return replace(new, node_number=np.concatenate([part.mesh.node_number, nodes]), cell_number=cells)
