"""Builder of a mesh from what a file lists: nodes and cells in runs, groups and values by number.

Every reader fills one. Numbers are sorted, checked and made indices here and nowhere else. An error names the place
that the reader gives with the run: a line, an element of XML, a path in HDF5.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.cutting.records import is_cut
from lacmesh.errors import LacmeshWarning, ReadError, some
from lacmesh.formats import notes
from lacmesh.indices import Index, repeated
from lacmesh.mesh import Floats, Ints, Mesh, concatenated, mask_of

#: makes the error of a message about a run
ErrorAt = Callable[[str], ReadError]


@dataclass
class _Run:
    """Nodes or cells that follow each other in a file: `rows` are points, or nodes of cells.

    `at`: their positions in the file; `first`: the index of the first in the mesh.
    """

    type: str
    number: Ints | None
    rows: Any
    error: ErrorAt
    groups: tuple[str, ...]
    data: dict[str, Any]
    at: Ints | None = None
    first: int = 0

    @property
    def span(self) -> slice:
        return slice(self.first, self.first + len(self.rows))


@dataclass
class _Listed:
    """Nodes or cells of a file in runs; groups and data by number: members (k,), pairs of numbers and values.

    Once all are there: `place` (n,), positions in the file, `number` (n,), and `index`, from a number or a row.
    """

    word: str
    runs: list[_Run] = field(default_factory=list)
    groups: dict[str, list[Ints]] = field(default_factory=dict)
    data: dict[str, list[tuple[Ints | None, Any]]] = field(default_factory=dict)
    place: Ints = field(init=False)
    number: Ints = field(init=False)
    index: Index = field(init=False)

    @property
    def size(self) -> int:
        return sum(len(run.rows) for run in self.runs)

    def order(self) -> None:
        """Sort the runs by type, in the order of the types' first rows in the file, and find all places."""
        n, first = self.size, dict[str, int]()
        rest = np.flatnonzero(~mask_of(n, *(run.at for run in self.runs if run.at is not None)))
        for run in self.runs:
            if run.at is None:
                run.at, rest = rest[: len(run.rows)], rest[len(run.rows) :]
            first[run.type] = min(first.get(run.type, n), int(run.at.min(initial=n)))
        self.runs.sort(key=lambda run: first[run.type])
        following = 0
        for run in self.runs:
            run.first, following = following, following + len(run.rows)
        self.place = concatenated(run.at for run in self.runs if run.at is not None)

    def error(self, index: int, message: str) -> ReadError:
        """Return the error about the node or cell of an index."""
        return next(run for run in self.runs if run.first <= index < run.span.stop).error(message)


class MeshBuilder:
    """Nodes, cells, groups and values of a file, which `mesh` makes a mesh.

    `rows_from`: None in a format where nodes of cells, members and values are given by number; 0 or 1 where they are
    given by row, counted from there, in the order of adding. `cell`: the format's word for a cell. `warnings`: clauses
    of one warning. `note`: what the format has no place for (`notes.parse`), applied by `mesh`.
    """

    def __init__(self, path: Path, *, rows_from: int | None = None, cell: str = "cell") -> None:
        self.path, self.warnings, self.note = path, list[str](), dict[str, Any]()
        self._rows_from, self._lost = rows_from, 0
        self._listed = {"node": _Listed("node"), "cell": _Listed(cell)}

    def nodes(self, number: Ints | None, points: Floats, *, error: ErrorAt | None = None, **data: Any) -> None:
        """Add nodes: numbers (k,) or None, points (k, 1 to 3), and data of each, (k, ...).

        `error` makes the error of a message about these; by default it names the file alone.
        """
        self._add("node", _Run("", number, points, error or self._error, (), data))

    def cells(
        self,
        kind: str,
        number: Ints | None,
        nodes: Ints,
        *,
        groups: Iterable[str] = (),
        at: Ints | None = None,
        error: ErrorAt | None = None,
        **data: Any,
    ) -> None:
        """Add cells of one type: numbers (k,) or None, nodes (k, n) in lacmesh's order, data as in `nodes`.

        `groups`: those that all of them are in. `at` (k,): their positions among all cells of the file; cells without
        positions take the free ones, in the order of adding.
        """
        if len(nodes):
            self._add("cell", _Run(kind, number, nodes, error or self._error, tuple(groups), data, at))

    def group(self, on: str, name: str, members: Ints | None = None) -> None:
        """Add members (k,) to a group of "node"s or "cell"s; a group without members is there, and empty.

        A member that the file does not have is left out with a warning.
        """
        parts = self._listed[on].groups.setdefault(name, [])
        if members is not None:
            parts.append(np.asarray(members))

    def values(self, on: str, name: str, number: Ints | None, values: NDArray) -> None:
        """Add values (k, ...) of "node"s or "cell"s, by number (k,), or, with None, of all in the order of adding.

        Those without a value get NaN, or -1 of integers.
        """
        self._listed[on].data.setdefault(name, []).append((number, values))

    def read_note(self, text: str | bytes) -> None:
        """Take the note of a file from its text; one that is damaged is left out, with a warning."""
        try:
            self.note = notes.parse(text)
            if not self.note:
                self.warnings.append("the note of a newer lacmesh is left out")
        except ValueError:
            self.warnings.append("lacmesh's own note is damaged and left out")

    def size(self, on: str) -> int:
        """Return how many nodes or cells have been added."""
        return self._listed[on].size

    def mesh(self, then: Callable[[Mesh], Mesh] | None = None, **rest: Any) -> Mesh:
        """Return the mesh, with `rest` as other fields of it; warn of what `warnings` lists.

        `then`: what a format adds to the mesh, before its note is applied.
        Raises ReadError for a number that is there twice, a node that is not, and coordinates that are not finite.
        """
        nodes, cells = self._listed.values()
        for part in (nodes, cells):
            part.order()
            self._number(part)
        points, blocks = self._points(nodes), list(self._blocks(nodes.index, cells))
        for on, part in self._listed.items():
            rest |= {f"{on}_groups": self._groups(part), f"{on}_data": self._data(on, part)}
        if self._lost:
            text = "values or members belong to nodes or cells that the file does not hold: left out"
            self.warnings.append(f"{self._lost} {text}")
        for key, known in (("group_tags", rest["cell_groups"]), ("steps", rest["cell_data"] | rest["node_data"])):
            rest[key] = {name: value for name, value in rest.get(key, {}).items() if name in known}
        order = None if (cells.place[1:] > cells.place[:-1]).all() else np.argsort(cells.place)
        mesh = Mesh.create(points, blocks, node_number=nodes.number, cell_number=cells.number, file_order=order, **rest)
        mesh = notes.load(then(mesh) if then else mesh, self.note, self.warnings)
        if is_cut(mesh) and not mesh.zones:
            mesh = replace(mesh, zones=notes.zone_names(mesh.cell_data, mesh.cell_groups))
        if self.warnings:
            text = "; ".join(dict.fromkeys(self.warnings))
            warnings.warn(LacmeshWarning(f"{self.path}: {text}"), stacklevel=4)
        return mesh

    def _add(self, on: str, run: _Run) -> None:
        self._listed[on].runs.append(run)
        for name in run.groups:
            self.group(on, name)
        for name in run.data:
            self._listed[on].data.setdefault(name, [])

    def _error(self, message: str) -> ReadError:
        return ReadError(self.path, message)

    def _number(self, listed: _Listed) -> None:
        """Choose the numbers, and the index of a number (or a row). Raises ReadError for one twice, or below 1."""
        by_run = [run.number for run in listed.runs if run.number is not None]
        counted = len(by_run) < len(listed.runs)
        listed.number = listed.place + 1 if counted else concatenated(by_run)
        twice = None if counted else repeated(listed.number)
        if self._rows_from is not None:
            listed.index = Index(listed.place + 1)
            if twice is not None:
                self.warnings.append(f"{listed.word}s are numbered from 1, the file gives several the number {twice}")
                listed.number = listed.place + 1
            return
        least = int(listed.number.min(initial=1))
        if least < 1:
            message = f"a {listed.word} has the number {least}; numbers start at 1"
            raise listed.error(int(listed.number.argmin()), message)
        if twice is not None:
            last = int(np.flatnonzero(listed.number == twice)[-1])
            raise listed.error(last, f"two {listed.word}s have the number {twice}")
        listed.index = Index(listed.number)

    def _points(self, nodes: _Listed) -> Floats:
        points = np.zeros((nodes.size, 3))
        for run in nodes.runs:
            points[run.span, : run.rows.shape[1]] = run.rows
        bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
        if len(bad):
            message = f"the coordinates of nodes {some(nodes.number[bad])} are not finite numbers"
            raise nodes.error(int(bad[0]), message)
        return points

    def _blocks(self, nodes: Index, cells: _Listed) -> Iterator[tuple[str, Ints]]:
        """Yield each type and the nodes of its cells, by index. Raises ReadError for a node that is not there."""
        dtype = np.int32 if nodes.n < 2**31 else np.int64
        for kind, group in groupby(cells.runs, key=lambda run: run.type):
            runs = list(group)
            block = np.empty((runs[-1].span.stop - runs[0].first, ALL_CELLS[kind].n_nodes), dtype)
            for run in runs:
                start = run.first - runs[0].first
                bad = nodes.convert(self._by_number(run.rows), block[start : start + len(run.rows)])
                if bad is not None:
                    row = run.rows[bad]
                    lost = some(row[nodes.places(self._by_number(row)) < 0])
                    cell = some(cells.number[run.first + bad : run.first + bad + 1])
                    raise run.error(f"the {kind} {cell} has node {lost}, which is not among the nodes")
            yield kind, block

    def _by_number(self, members: Ints) -> Ints:
        """Return numbers, or rows as numbers that count from 1."""
        return members + 1 if self._rows_from == 0 else members

    def _groups(self, listed: _Listed) -> dict[str, Ints]:
        """Return the members of each group, and count those that are left out."""
        groups = dict[str, list[Ints]]()
        for name, parts in listed.groups.items():
            places = [listed.index.places(self._by_number(members)) for members in parts]
            groups[name] = [found[found >= 0] for found in places]
            self._lost += sum(map(len, places)) - sum(map(len, groups[name]))
        for run in listed.runs:
            for name in run.groups:
                groups[name].append(np.arange(run.span.start, run.span.stop))
        return {name: concatenated(parts) for name, parts in groups.items()}

    def _data(self, on: str, listed: _Listed) -> dict[str, NDArray]:
        """Return the arrays on nodes or cells, and count the values that are left out."""
        data = dict[str, NDArray]()
        for name, by_number in listed.data.items():
            parts: list[tuple[Any, NDArray]] = [(run.span, run.data[name]) for run in listed.runs if name in run.data]
            for number, values in by_number:
                at = np.argsort(listed.place) if number is None else listed.index.places(self._by_number(number))
                here = at >= 0
                self._lost += int((~here).sum())
                parts.append((at[here], values[here]) if not here.all() else (at, values))
            shapes = {values.shape[1:] for _, values in parts}
            if len(shapes) > 1:
                self.warnings.append(f"{on} data {name!r} have several widths: they are left out")
                continue
            dtype = np.result_type(*(values for _, values in parts))
            if dtype.kind == "u" and sum(len(values) for _, values in parts) < listed.size:  # it has no -1
                dtype = np.result_type(dtype, np.int8) if dtype.itemsize < 8 else np.dtype(np.int64)
            blank = np.nan if dtype.kind == "f" else 0 if dtype.kind == "u" else -1  # unsigned ones have all values
            rows = np.full((listed.size, *shapes.pop()), blank, dtype)
            for where, values in parts:
                rows[where] = values
            data[name] = rows
        return data
