"""Conversion between the arrays of a mesh and $NodeData, $ElementData: fields, one section for each step.

A header of text (name; time; step, components, rows, partition) is followed by rows: a number and its values, in binary
an int of 4 bytes and doubles. Nodes or cells without a row have no value: NaN, or -1 in integers.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import WriteError
from lacmesh.formats.ids import CHUNK, Index
from lacmesh.formats.msh.names import quoted, safe_names
from lacmesh.formats.msh.output import Output
from lacmesh.formats.msh.scan import MshBytes
from lacmesh.formats.notes import FieldNote
from lacmesh.mesh import Floats, Ints, Step

#: section -> what its rows are on
SECTIONS = {"NodeData": "node", "ElementData": "cell"}
#: Keys of a mesh's data that are no fields.
RESERVED = ("entity",)
#: Components that gmsh knows.
_WIDTHS = (1, 3, 9)
#: Numbers of steps up to here are written as they are.
_MANY_STEPS = 10_000


class Head(NamedTuple):
    """One array of values in a file: on "node" or "cell", the field's name, step and time there."""

    on: str
    name: str
    step: int
    time: float


@dataclass(frozen=True)
class Rows:
    """A section as it stands in the file, in a binary one as views: `number` (m,), `values` (m, components)."""

    head: Head
    partition: int
    number: Ints
    values: Floats


def read_rows(source: MshBytes, section: str) -> Rows:
    """Read the section that starts here. Raises ReadError."""
    strings = [source.line() for _ in range(source.count(section))]
    reals = [source.line() for _ in range(source.count(section))]
    at = source.position
    integers = [source.line().strip() for _ in range(source.count(section))]
    if not strings or len(integers) < 3 or not all(re.fullmatch(rb"-?\d{1,18}", i) for i in integers):
        raise source.error(f"a ${section} needs a name and the integers step, components, rows", at)
    step, width, n, *rest = (int(i) for i in integers)
    try:
        time = float(reals[0]) if reals else 0.0
        if time != time:
            raise ValueError("not a number")
    except ValueError:
        raise source.error(f"{quoted(reals[0][:40])!r} should be a time", at) from None
    if not 1 <= width <= source.size or n < 0:
        raise source.error(f"a ${section} cannot have {width} components and {n} rows", at)
    head = Head(SECTIONS[section], quoted(strings[0]), step, time)
    numbers = source.numbers(section, True)
    rows = Rows(head, rest[0] if rest else 0, *numbers.numbered(n, width, head.on))
    numbers.done()
    return rows


def keys(heads: Sequence[Head]) -> list[tuple[str, Step | None]]:
    """The key of each array in a mesh, and its entry in `Mesh.steps` where it needs one.

    The key of a field with one step is its name; with several steps, `name@0`, `name@1` ... by step and time.

    >>> keys([Head("node", "U", 0, 0.0), Head("node", "T", 0, 0.0), Head("node", "T", 1, 0.5)])[:2]
    [('U', None), ('T@0', Step(field='T', number=0, order=-1, time=0.0))]
    """
    times: dict[str, set[tuple[int, float]]] = {}
    for head in heads:
        times.setdefault(head.name, set()).add((head.step, head.time))
    place = {name: {when: k for k, when in enumerate(sorted(steps))} for name, steps in times.items()}
    used: dict[tuple[str, str], None] = {(on, key): None for on in SECTIONS.values() for key in RESERVED}
    said: dict[str, Step | None] = {}
    result: list[tuple[str, Step | None]] = []
    for on, name, number, time in heads:
        many = len(place[name]) > 1
        step = Step(name, number, -1, time) if many or number or time else None
        key, k = (f"{name}@{place[name][number, time]}" if many else name), len(place[name])
        while (on, key) in used or said.setdefault(key, step) != step:
            key, k, step = f"{name}@{k}", k + 1, Step(name, number, -1, time)
        used[on, key] = None
        result.append((key, step))
    return result


def to_mesh(
    source: MshBytes,
    rows: Sequence[Rows],
    index: Mapping[str, Index],
    sizes: Mapping[str, int],
    notes: Mapping[tuple[str, str, int], FieldNote],
) -> tuple[dict[str, NDArray], dict[str, NDArray], dict[str, Step], int]:
    """The arrays on cells and on nodes, their steps, and how many rows of the sections have a place.

    `index`: from numbers of nodes ("node") and cells ("cell") to their indices; `sizes`: how many of them the
    whole mesh has. Raises ReadError.
    """
    cell_data: dict[str, NDArray] = {}
    node_data: dict[str, NDArray] = {}
    steps: dict[str, Step] = {}
    arrays = _joined(rows)
    budget = 64 * source.size + 2**28
    known = 0
    for (head, parts), (key, step) in zip(arrays, keys([head for head, _ in arrays]), strict=True):
        note = notes.get((head.on, head.name, head.step))
        width = parts[0].values.shape[1]
        budget -= 8 * sizes[head.on] * width
        if budget < 0:
            raise source.error(f"the field {head.name!r} would take far more memory than the file has values")
        values = np.full((index[head.on].n, width), np.nan)
        known += sum(_fill(values, part, index[head.on]) for part in parts)
        if note is not None:
            key = note.key if note.key not in RESERVED else key
            step = Step(note.name, note.number, note.order, head.time)
            step = None if step == Step(key, 0, -1, 0.0) else step
        data = node_data if head.on == "node" else cell_data
        data[key] = _shaped(source, key, head, values, note)
        if step is not None:
            steps[key] = step
    return cell_data, node_data, steps, known


def _fill(values: Floats, rows: Rows, index: Index) -> int:
    """Write the rows of a section to the places of their numbers, piece by piece; return how many have a place."""
    known = 0
    for a in range(0, len(rows.number), CHUNK):
        place = index.places(rows.number[a : a + CHUNK])
        here = place >= 0
        values[place[here]] = rows.values[a : a + CHUNK][here]
        known += int(here.sum())
    return known


def _joined(rows: Sequence[Rows]) -> list[tuple[Head, list[Rows]]]:
    """Group the sections that make one array together: the same step, on different partitions."""
    joined: dict[tuple[Head, int, int], list[Rows]] = {}
    seen: dict[tuple[Head, int, int], int] = {}
    for r in rows:
        width = r.values.shape[1]
        again = seen.get((r.head, width, r.partition), 0)
        seen[r.head, width, r.partition] = again + 1
        joined.setdefault((r.head, width, again), []).append(r)
    return [(head, parts) for (head, _, _), parts in joined.items()]


def _shaped(source: MshBytes, key: str, head: Head, values: Floats, note: FieldNote | None) -> NDArray:
    """Values in the shape and type of the mesh's array."""
    shape = (1,) if note is None or note.shape is None else note.shape
    if note is None or note.shape is None:
        shape = () if values.shape[1] == 1 else (values.shape[1],)
    width = int(np.prod(shape, dtype=object)) if all(n >= 0 for n in shape) else -1
    if not 0 <= width <= values.shape[1]:
        raise source.error(f"the field {head.name!r} has {values.shape[1]} components, and our notes say {shape}")
    values = values[:, :width].reshape(len(values), *shape)
    ours = key.startswith("lac_")
    if not ours and (note is None or not note.integer):
        return values
    whole = np.where(np.isnan(values), -1.0, values)
    limit = 2.0**31 if ours or key == "partition" else 2.0**63
    if not ((whole == np.rint(whole)) & (np.abs(whole) < limit)).all():
        raise source.error(f"the field {head.name!r} should have integers only")
    return whole.astype(np.int32 if limit < 2.0**32 else np.int64)


def to_file(
    out: Output,
    path: Path,
    on: str,
    number: Ints,
    data: Mapping[str, NDArray],
    steps: Mapping[str, Step],
    notes: dict[tuple[str, str, int], FieldNote],
) -> None:
    """Write all arrays on nodes or cells; what the sections cannot hold is added to `notes`. Raises WriteError."""
    section = next(s for s, what in SECTIONS.items() if what == on)
    for _, head, there, values in to_rows(path, on, data, steps, notes):
        width = values.shape[1]
        out.text(f'${section}\n1\n"{head.name}"\n1\n{head.time!r}\n3\n{head.step}\n{width}\n{len(there)}\n')
        out.numbered_rows(number[there], values)
        out.end(section)


def to_rows(
    path: Path,
    on: str,
    data: Mapping[str, NDArray],
    steps: Mapping[str, Step],
    notes: dict[tuple[str, str, int], FieldNote],
) -> Iterator[tuple[str, Head, Ints, Floats]]:
    """Yield each array on nodes or cells: its key, its header, the indices (m,) with values, these values (m, width).

    What headers cannot hold is added to `notes`. Raises WriteError, for `path`.
    """
    meant = {key: steps.get(key, Step(key, 0, -1, 0.0)) for key in data}
    heads = _heads(on, meant)
    for (key, array), head, (default, step) in zip(data.items(), heads, keys(heads), strict=True):
        there, values, integer = _as_reals(path, key, np.asarray(array))
        width = next((w for w in _WIDTHS if w >= values.shape[1]), values.shape[1])
        trailing = () if width == 1 else (width,)
        truth = meant[key]
        note = FieldNote(
            key,
            truth.field,
            truth.number,
            truth.order,
            None if array.shape[1:] == trailing else array.shape[1:],
            integer and not key.startswith("lac_"),
        )
        plain = step or Step(default, 0, -1, 0.0)
        if note != FieldNote(default, plain.field, plain.number, -1, None, False):
            notes[on, head.name, head.step] = note
        yield key, head, there, np.pad(values, ((0, 0), (0, width - values.shape[1])))


def _heads(on: str, meant: Mapping[str, Step]) -> list[Head]:
    """Header of each array in the file; step numbers are kept small, as gmsh makes room for all up to the largest."""
    safe = safe_names(step.field for step in meant.values())
    numbers: dict[str, list[int]] = {}
    for step in meant.values():
        numbers.setdefault(step.field, []).append(step.number)
    heads = []
    count: dict[str, int] = {}
    for step in meant.values():
        used = numbers[step.field]
        plain = len(set(used)) == len(used) and min(used) >= 0 and max(used) < _MANY_STEPS
        k = count[step.field] = count.get(step.field, -1) + 1
        time = float(step.time)
        heads.append(Head(on, safe[step.field], int(step.number) if plain else k, time if time == time else 0.0))
    return heads


def _as_reals(path: Path, key: str, array: NDArray) -> tuple[Ints, Floats, bool]:
    """Rows that have values, these values as doubles, and whether the array holds integers. Raises WriteError."""
    if array.dtype.kind not in "iufb":
        raise WriteError(path, f"the field {key!r} holds {array.dtype}, and msh holds numbers only")
    integer = array.dtype.kind in "iub"
    rows = array.reshape(len(array), -1) if array.size else np.empty((len(array), int(np.prod(array.shape[1:]))))
    given = (rows != -1) if integer else ~np.isnan(rows)
    there = np.flatnonzero(given[:, 0] if given.shape[1] == 1 else given.any(axis=1))
    values = rows[there].astype(np.float64)
    if integer and (np.abs(values) > 2.0**53).any():
        raise WriteError(path, f"the field {key!r} has integers above 2^53, which msh's numbers cannot hold")
    return there, values, integer
