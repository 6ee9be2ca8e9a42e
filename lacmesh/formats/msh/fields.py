"""Fields of a msh file: $NodeData and $ElementData, one section for each step, and the data of a mesh.

A header of text (name; time; step, components, rows, partition) is followed by rows: a number and its values, in binary
an int of 4 bytes and doubles. Nodes or cells without a row have no value: NaN, or -1 in integers.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import WriteError
from lacmesh.formats.builder import MeshBuilder
from lacmesh.formats.msh.streams import MshSource, quoted, safe_names
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


class Rows(NamedTuple):
    """A section as it stands in the file, in a binary one as views: `number` (m,), `values` (m, components)."""

    head: Head
    partition: int
    number: Ints
    values: Floats


def read_rows(source: MshSource, section: str) -> Rows:
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
    if not 1 <= width <= min(source.size, 2**27) or n < 0:  # numpy's types have 2 GB at most
        raise source.error(f"a ${section} cannot have {width} components and {n} rows", at)
    head = Head(SECTIONS[section], quoted(strings[0]), step, time)
    source.begin(section)
    rows = Rows(head, rest[0] if rest else 0, *source.numbered(n, width, head.on))
    source.end()
    return rows


def add_to(
    out: MeshBuilder, source: MshSource, sections: Sequence[Rows], notes: Sequence[Mapping[str, Any]]
) -> dict[str, Step]:
    """Add the arrays of all sections to a mesh; return the steps of those that are one of several. Raises ReadError.

    `notes`: what the headers cannot hold (`field_rows`).
    """
    noted = {(note["on"], note["field"], note["step"]): note for note in notes}
    arrays: dict[tuple[Head, int, int], list[Rows]] = {}  # one of several sections: of one step, on several partitions
    seen: dict[tuple[Head, int, int], int] = {}
    for rows in sections:
        one = (rows.head, rows.values.shape[1], rows.partition)
        seen[one] = seen.get(one, -1) + 1
        arrays.setdefault((*one[:2], seen[one]), []).append(rows)
    steps: dict[str, Step] = {}
    budget = 64 * source.size + 2**28
    for ((head, width, _), parts), (key, step) in zip(arrays.items(), keys([head for head, *_ in arrays]), strict=True):
        note = noted.get((head.on, head.name, head.step))
        budget -= 8 * out.size(head.on) * width
        if budget < 0:
            raise source.error(f"the field {head.name!r} would take far more memory than the file has values")
        if note is not None:
            key = note["key"] if note["key"] not in RESERVED else key
            step = Step(note["name"], note["number"], note["order"], head.time)
            step = None if step == Step(key, 0, -1, 0.0) else step
        for rows in parts:
            out.values(head.on, key, rows.number, _shaped(source, key, head, rows.values, note))
        if step is not None:
            steps[key] = step
    return steps


def _shaped(source: MshSource, key: str, head: Head, values: Floats, note: Mapping[str, Any] | None) -> NDArray:
    """Values in the shape and type of the mesh's array. Raises ReadError."""
    shape = () if values.shape[1] == 1 else (values.shape[1],)
    if note is not None and note["shape"] is not None:
        shape = tuple(note["shape"])
    width = int(np.prod(shape, dtype=object)) if all(n >= 0 for n in shape) else -1
    if not 0 <= width <= values.shape[1]:
        raise source.error(f"the field {head.name!r} has {values.shape[1]} components, and our notes say {shape}")
    values = values[:, :width].reshape(len(values), *shape)
    ours = key.startswith("lac_")
    if not ours and (note is None or not note["integer"]):
        return values
    whole = np.where(np.isnan(values), -1.0, values)
    limit = 2.0**31 if ours or key == "partition" else 2.0**63
    if not ((whole == np.rint(whole)) & (np.abs(whole) < limit)).all():
        raise source.error(f"the field {head.name!r} should have integers only")
    return whole.astype(np.int32 if limit < 2.0**32 else np.int64)


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
    used = {(on, key) for on in SECTIONS.values() for key in RESERVED}
    step_of: dict[str, Step | None] = {}
    result: list[tuple[str, Step | None]] = []
    for on, name, number, time in heads:
        many = len(place[name]) > 1
        step = Step(name, number, -1, time) if many or number or time else None
        key, k = (f"{name}@{place[name][number, time]}" if many else name), len(place[name])
        while (on, key) in used or step_of.setdefault(key, step) != step:
            key, k, step = f"{name}@{k}", k + 1, Step(name, number, -1, time)
        used.add((on, key))
        result.append((key, step))
    return result


def field_rows(
    path: Path, on: str, data: Mapping[str, NDArray], steps: Mapping[str, Step]
) -> Iterator[tuple[Head, Ints, Floats, dict[str, Any] | None]]:
    """Yield each array on nodes or cells as a section has it. Raises WriteError, for `path`.

    A header, the indices (m,) that have values, these values (m, components), and a note of what the header cannot
    hold, None where nothing is left.
    """
    step_of = {key: steps.get(key, Step(key, 0, -1, 0.0)) for key in data}
    heads = _heads(on, step_of)
    for (key, array), head, (default, step) in zip(data.items(), heads, keys(heads), strict=True):
        if array.dtype.kind not in "iufb":
            raise WriteError(path, f"the field {key!r} holds {array.dtype}, and msh holds numbers only")
        integer = array.dtype.kind in "iub"
        rows = array.reshape(len(array), int(np.prod(array.shape[1:])))
        filled = (rows != -1) if integer else ~np.isnan(rows)
        there = np.flatnonzero(filled.any(axis=1))
        values = rows[there].astype(np.float64)
        if integer and (np.abs(values) > 2.0**53).any():
            raise WriteError(path, f"the field {key!r} has integers above 2^53, which msh's numbers cannot hold")
        width = next((w for w in _WIDTHS if w >= values.shape[1]), values.shape[1])
        shape = None if array.shape[1:] == (() if width == 1 else (width,)) else list(array.shape[1:])
        truth, plain = step_of[key], step or Step(default, 0, -1, 0.0)
        usual = {"key": default, "name": plain.field, "number": plain.number, "order": -1, "shape": None}
        note = {"key": key, "name": truth.field, "number": int(truth.number), "order": int(truth.order), "shape": shape}
        note["integer"] = integer and not key.startswith("lac_")
        place = {"on": on, "field": head.name, "step": head.step}
        values = np.pad(values, ((0, 0), (0, width - values.shape[1])))
        yield head, there, values, None if note == usual | {"integer": False} else place | note


def _heads(on: str, step_of: Mapping[str, Step]) -> list[Head]:
    """Header of each array in the file; step numbers are kept small, as gmsh makes room for all up to the largest."""
    safe = safe_names(step.field for step in step_of.values())
    numbers: dict[str, list[int]] = {}
    for step in step_of.values():
        numbers.setdefault(step.field, []).append(step.number)
    heads, count = list[Head](), Counter[str]()
    for step in step_of.values():
        used = numbers[step.field]
        plain = len(set(used)) == len(used) and min(used) >= 0 and max(used) < _MANY_STEPS
        number, time = int(step.number) if plain else count[step.field], float(step.time)
        count[step.field] += 1
        heads.append(Head(on, safe[step.field], number, time if time == time else 0.0))
    return heads
