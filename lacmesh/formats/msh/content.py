"""Content of a msh file, independent of its version: readers fill it, and `assembly` makes the mesh."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lacmesh.formats.msh import fields as msh_fields
from lacmesh.formats.msh.notes import Notes
from lacmesh.formats.msh.scan import MshBytes
from lacmesh.formats.slices import RowRange
from lacmesh.mesh import Floats, Ints, Tag


@dataclass
class Piece:
    """Cells of one type: `number` (m,), `nodes` (m, n of the type) by number.

    `at`: the position of the first in the file, or of each; `entity` (2,) or (m, 2), (-1, -1) where it is unknown;
    `partition`: one, or one for each, -1 for none; `groups`: physical groups that all of them are in;
    `physical` (m,): tags of physical groups of the cells' dimension, 0 for none.
    """

    type: str
    number: Ints
    nodes: Ints
    at: int | Ints
    entity: Any = (-1, -1)
    partition: int | Ints = -1
    groups: tuple[Tag, ...] = ()
    physical: Ints | None = None


@dataclass
class Content:
    """A file's content. `names`: (dimension or None, tag, name); `repeats` (4, m): elements that repeated a cell for a
    further physical group: number, the cell's number, dimension and tag of the group.

    `node_rows`: the nodes that are read, None for all. `links`: slave, master, affine map, node numbers (m, 2).
    `elements_at`: where the elements begin. `n_partitions`: parts of the whole mesh, 0 where the file has no number.
    """

    source: MshBytes
    names: list[tuple[int | None, int, str]] = field(default_factory=list)
    node_number: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    points: Floats = field(default_factory=lambda: np.empty((0, 3)))
    node_entity: Ints | None = None
    node_rows: RowRange | None = None
    pieces: list[Piece] = field(default_factory=list)
    repeats: Ints = field(default_factory=lambda: np.empty((4, 0), np.int64))
    boundary: dict[Tag, tuple[int, ...]] = field(default_factory=dict)
    links: list[tuple[Tag, Tag, tuple[float, ...], Ints]] = field(default_factory=list)
    rows: list[msh_fields.Rows] = field(default_factory=list)
    notes: Notes = field(default_factory=Notes)
    nodes_at: int = 0
    elements_at: int = 0
    n_partitions: int = 0
