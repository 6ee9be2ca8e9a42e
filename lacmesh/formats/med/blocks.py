"""Points and cells of a MED file, or of a slice of it: some rows of each of its arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lacmesh.errors import ReadError, some
from lacmesh.formats.med.hdf5 import Branch, Name, text
from lacmesh.formats.med.types import MED_TYPES, NOT_READ, MedType
from lacmesh.formats.slices import RowRange, Slice
from lacmesh.mesh import Floats, Ints

_OF_NAME = {kind.name: kind for kind in MED_TYPES}
#: Where a file may keep cells: as cells, or in old files as faces and edges (the first that has a type counts).
ENTITIES = ("MAI", "FAC", "ARE")


class Cells(NamedTuple):
    """Cells of one type, those in `rows` of all in the file: nodes (k, n) from 0, and families (k,).

    `number` (k,): those in the file, None if it has none.
    """

    kind: MedType
    support: str
    rows: RowRange
    nodes: Ints
    number: Ints | None
    family: Ints


def read_points(home: Branch, step: Branch, piece: Slice) -> tuple[Floats, int, RowRange]:
    """Points (k, 3), the number of coordinates in the file (2 if it has one), and the rows that these points are."""
    nodes = step.branch("NOE")
    size = nodes.count("COO", "f")
    counted = nodes.has_attribute("NBR", of="COO")
    n = nodes.integer("NBR", of="COO") if counted else -1
    dim = home.integer("ESP", size // n if n > 0 else home.integer("DIM"))
    if not counted and 1 <= dim <= 3:
        n = size // dim
    if not 1 <= dim <= 3 or size != n * dim:
        raise nodes.error(f"holds {size} values for {n} nodes in {dim} dimensions", "COO")
    if home.integer("REP", nodes.integer("REP", 0, of="COO")) != 0:
        raise nodes.error("is cylindrical or spherical; only Cartesian coordinates are read", "COO")
    rows = piece.rows(n)
    points = np.zeros((rows.n, 3))
    points[:, :dim] = nodes.reals("COO", size, rows).reshape(dim, -1).T
    finite = np.isfinite(points)
    if not finite.all():
        bad = np.flatnonzero(~finite.all(axis=1))
        number = number_in(nodes, rows)
        names = some(rows.start + bad + 1 if number is None else number[bad])
        raise nodes.error(f"the coordinates of nodes {names} are not finite numbers", "COO")
    return points, max(dim, 2), rows


def read_cells(step: Branch, n_nodes: int, piece: Slice, said: list[str]) -> list[Cells]:
    """The cells of each type that a slice has, in the order of the file where it has one, else in libmed's."""
    cells_of: dict[str, Cells] = {}
    named = step.branch("NOE").has("NOM")
    for entity in ENTITIES:
        for link in _in_order(step.branch(entity)) if step.has(entity) else ():
            name = text(link)
            part = step.branch(entity).branch(link)
            named = named or part.has("NOM")
            if name in cells_of:
                said.append(f"{entity}/{name} is left out, {cells_of[name].support} has such cells too")
            elif (cells := _read_type(part, entity, name, n_nodes, piece)) is not None:
                cells_of[name] = cells
    if named:
        said.append("names of single nodes and cells are left out")
    return list(cells_of.values())


def _in_order(inside: Branch) -> list[Name]:
    order = {kind.name: k for k, kind in enumerate(MED_TYPES)}
    names = inside.names()
    return names if inside.ordered else sorted(names, key=lambda n: order.get(text(n), len(order)))


def _read_type(part: Branch, entity: str, name: str, n_nodes: int, piece: Slice) -> Cells | None:
    """The cells of one type; None where there are none."""
    if name not in _OF_NAME:
        raise part.error(f"{NOT_READ.get(name, f'cells of type {name}')} are not read")
    kind = _OF_NAME[name]
    width = len(kind.nodes)
    if not part.has("NOD"):
        if part.has("DES"):
            raise part.error("gives cells by their faces (descending connectivity), which is not read")
        return None
    size = part.count("NOD", "iu")
    n = part.integer("NBR", size // width, of="NOD")
    if n < 0 or size != n * width:
        raise part.error(f"holds {size} values for {n} cells of {width} nodes", "NOD")
    if n == 0:
        return None
    rows = piece.rows(n)
    values = part.integers("NOD", size, rows)
    if values.min(initial=1) < 1 or values.max(initial=1) > n_nodes:
        raise _stray_node(part, kind, values, n_nodes, rows)
    nodes = np.empty((rows.n, width), np.int64)
    nodes[:, kind.nodes] = values.reshape(width, -1).T
    nodes -= 1
    return Cells(kind, f"{entity}.{name}", rows, nodes, number_in(part, rows), family_in(part, rows))


def _stray_node(part: Branch, kind: MedType, values: Ints, n_nodes: int, rows: RowRange) -> ReadError:
    """The error for a cell one of whose nodes, counted from 1, is not there."""
    place = int(((values < 1) | (values > n_nodes)).argmax())
    number = number_in(part, rows)
    cell = rows.start + place % rows.n + 1 if number is None else number[place % rows.n]
    return part.error(f"the {kind.type} {cell} has node {values[place]}, and there are {n_nodes} nodes", "NOD")


def number_in(part: Branch, rows: RowRange) -> Ints | None:
    """Numbers of some nodes, or cells of a type; None if the file has none."""
    return part.integers("NUM", rows.size, rows).astype(np.int64) if part.has("NUM") else None


def family_in(part: Branch, rows: RowRange) -> Ints:
    """Families of some nodes, or cells of a type; 0 if the file has none."""
    return part.integers("FAM", rows.size, rows).astype(np.int64) if part.has("FAM") else np.zeros(rows.n, np.int64)
