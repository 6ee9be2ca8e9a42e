"""Formats that meshio reads and writes and lacmesh does not, and meshio's own objects.

meshio may raise any exception, exit, drop cells silently, read on beyond the end of a file for ever, or swap nodes in
some formats. So a file must be whole as far as its format tells (`meshio_checks.py`), and what was written is read
back: changed cells are an error. Groups and numbers are written as arrays where a format keeps arrays; all that a file
does not give back is named in one warning. Quadratic cells are written only where their node order was checked against
another program. Messages that meshio prints while reading, for example on cells that it drops, are passed on.
"""

from __future__ import annotations

import contextlib
import io
import re
import string
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import DataError, LacmeshError, LacmeshWarning, ReadError, WriteError, check_installed
from lacmesh.formats import exodus
from lacmesh.formats.arrays import GROUP, add_arrays, numbers_in, to_arrays, with_tag_groups
from lacmesh.formats.builder import MeshBuilder
from lacmesh.formats.meshio_checks import match, misplaced_mid_nodes, read_whole, round_trip_losses
from lacmesh.formats.orders import MESHIO_NAMES, VTK_CELLS, VTK_NOT_READ, meshio_nodes
from lacmesh.formats.registry import GMSH_CAN
from lacmesh.mesh import Ints, Mesh, Tag, concatenated

_OF_NAME = {theirs: ours for ours, theirs in MESHIO_NAMES.items()}
#: the note in meshio's `info`; gmsh's physical groups in its cell data
_INFO, _PHYSICAL = "lacmesh", "gmsh:physical"
#: formats that keep arrays on cells and nodes: groups, numbers and fields go there
_WITH_ARRAYS = ("vtk", "hmf", "tecplot", "avsucd")
#: types of cells that are written as vtk but for their nodes' order, which was not checked
_NOT_CHECKED = ("TRIA7", "PENTA15", "PYRAM13", "PYRAM14")
#: the characters that VTK's files have in names as they are; %XX is for the others
_PLAIN = "".join(sorted({*string.punctuation} - {*'%"'}))
#: a message of meshio to the user, up to the next one
_WORD = re.compile(r"^(Warning|Error|Info): (.*?)(?=^(?:Warning|Error|Info): |\Z)", re.MULTILINE | re.DOTALL)


def needed() -> Any:
    """Import the package meshio. Raises RequestError if it is missing."""
    check_installed("meshio", "io")
    import meshio

    return meshio


# ---- meshio's objects


def to_meshio(mesh: Mesh) -> Any:
    """The mesh as a `meshio.Mesh`: groups are `cell_sets` and `point_sets`, numbers and data are arrays.

    `cell_data["cell_number"]`, `point_data["node_number"]` are the file's numbers. Raises RequestError where meshio is
    missing. Data that are no numbers are left out.
    """
    meshio, arrays = needed(), to_arrays(mesh, [])
    bounds = list(pairwise(mesh.offsets))
    foreign = meshio.Mesh(
        mesh.points.copy(),
        [_block(meshio, b.type, b.nodes[:, meshio_nodes(b.type)]) for b in mesh.blocks],
        point_data={name: v for name, v in arrays.node.items() if not name.startswith(GROUP)},
        cell_data={n: [v[a:b] for a, b in bounds] for n, v in arrays.cell.items() if not n.startswith(GROUP)},
        point_sets={name: nodes.copy() for name, nodes in mesh.node_groups.items()},
        cell_sets={n: [c[(c >= a) & (c < b)] - a for a, b in bounds] for n, c in mesh.cell_groups.items()},
    )
    order = None if mesh.file_order is None else mesh.file_order.tolist()
    foreign.info = {_INFO: arrays.note(mesh, file_order=order)}
    return foreign


def _block(meshio: Any, kind: str, nodes: Ints) -> Any:
    """A block of cells; meshio's own constructor does not know the dimension of wedge15, pyramid13 and others."""
    try:
        return meshio.CellBlock(MESHIO_NAMES[kind], nodes)
    except KeyError:
        block = meshio.CellBlock.__new__(meshio.CellBlock)
        block.type, block.data, block.tags, block.dim = MESHIO_NAMES[kind], nodes, [], ALL_CELLS[kind].dim
        return block


def from_meshio(foreign: Any) -> Mesh:
    """The mesh of a `meshio.Mesh`; sets are groups, and so are gmsh's physical groups where there are no sets.

    Raises DataError for cells that lacmesh lacks (polygons, polyhedra) and for arrays that do not fit.

    >>> from lacmesh import Mesh
    >>> square = Mesh.create([[0, 0], [1, 0], [1, 1], [0, 1]], [("QUAD4", [[0, 1, 2, 3]])])
    >>> from_meshio(square.to_meshio()).cells_by_type
    {'QUAD4': 1}
    """
    try:
        return _mesh(foreign, Path("meshio"))
    except ReadError as error:
        raise DataError(f"this meshio mesh cannot be used: {error.reason}") from error
    except (ValueError, KeyError, IndexError, TypeError, AttributeError) as error:
        raise DataError(f"this meshio mesh cannot be used: {error}") from error


def _mesh(foreign: Any, path: Path) -> Mesh:
    """The mesh of a `meshio.Mesh`. Raises ReadError, DataError, and what numpy raises on arrays that do not fit."""
    out = MeshBuilder(path, rows_from=0)
    for block in foreign.cells:
        if block.type not in _OF_NAME:
            raise DataError(f"cells of meshio's type {block.type!r} are not read")
    starts = np.cumsum([0, *(len(block.data) for block in foreign.cells)]).tolist()
    # the note is in the info or, of a VTU file, in the field data
    n, in_file = len(foreign.points), np.asarray(foreign.field_data.get(_INFO, ()))
    info = foreign.info.get(_INFO) if isinstance(foreign.info, dict) else None
    if text := in_file.tobytes() if info is None and in_file.dtype == np.uint8 else str(info or ""):
        out.read_note(text)
    order, rows = np.asarray(out.note.get("file_order", ())), np.arange(starts[-1])
    rows = np.argsort(order) if np.array_equal(np.sort(order), rows) else rows  # places of the cells in the file
    on_cells = _native(
        {name: np.concatenate([np.asarray(v) for v in parts]) for name, parts in foreign.cell_data.items()}
    )
    on_nodes = _native({name: np.asarray(values) for name, values in foreign.point_data.items()})
    out.nodes(numbers_in(on_nodes, "node", n, out), np.asarray(foreign.points, float))
    number = numbers_in(on_cells, "cell", starts[-1], out)
    for block, (first, last) in zip(foreign.cells, pairwise(starts), strict=True):
        kind, listed = _OF_NAME[block.type], np.asarray(block.data)
        nodes = np.empty(listed.shape, np.int64)
        nodes[:, meshio_nodes(kind)] = listed
        out.cells(kind, None if number is None else number[first:last], nodes, at=rows[first:last])
    for name, parts in foreign.cell_sets.items():
        if not name.startswith("gmsh:"):
            out.group("cell", name, rows[concatenated(_members(m) + a for m, a in zip(parts, starts, strict=False))])
    for name, nodes in foreign.point_sets.items():
        out.group("node", name, _members(nodes))
    tags: dict[str, tuple[Tag, ...]] = {}
    if _PHYSICAL in on_cells and all(name.startswith("gmsh:") for name in foreign.cell_sets):
        tags = _physical_groups(foreign, on_cells.pop(_PHYSICAL), rows, out)
    add_arrays(out, "cell", on_cells, rows)
    add_arrays(out, "node", on_nodes)
    return with_tag_groups(out.mesh(group_tags=tags), out, on_cells)


def _native(arrays: Mapping[str, NDArray]) -> dict[str, NDArray]:
    """Arrays in native byte order, those of width 1 made flat."""
    flat = {n: v[:, 0] if v.ndim == 2 and v.shape[1] == 1 else v for n, v in arrays.items()}
    return {n: v.astype(v.dtype.newbyteorder("="), copy=False) if v.dtype.kind in "iuf" else v for n, v in flat.items()}


def _physical_groups(foreign: Any, physical: NDArray, rows: Ints, out: MeshBuilder) -> dict[str, tuple[Tag, ...]]:
    """Add gmsh's physical groups, a tag for each cell; return the tags of each group."""
    sizes = [len(block.data) for block in foreign.cells]
    dims = np.repeat([ALL_CELLS[_OF_NAME[block.type]].dim for block in foreign.cells], sizes)
    names = {(int(dim), int(tag)): name for name, (tag, dim) in foreign.field_data.items()}
    tags: dict[str, tuple[Tag, ...]] = {}
    for dim, tag in np.unique(np.stack([dims, physical.astype(np.int64)], axis=1), axis=0).tolist():
        if tag > 0:
            name = names.get((dim, tag), f"{dim}:{tag}")
            out.group("cell", name, rows[(dims == dim) & (physical == tag)])
            tags[name] = (*tags.get(name, ()), (dim, tag))
    return tags


def _members(members: Any) -> Ints:
    return np.asarray([] if members is None else members, np.int64)


# ---- files


def read(path: Path, name: str) -> Mesh:
    """Read a file of meshio's format `name`; a LacmeshWarning passes on the warnings of meshio.

    Raises ReadError, also if meshio warns and no cells are left; RequestError if meshio is missing.
    """
    meshio = needed()
    if not path.is_file():
        raise ReadError(path, "cannot be read (No such file or directory)")
    if name == "exodus":
        return exodus.read(path)
    printed: list[str] = []
    way = f"; {GMSH_CAN}" if name == "nastran" else ""
    foreign = _guarded(lambda: read_whole(meshio.read, path, name), lambda why: ReadError(path, why + way), printed)
    if name == "vtk":
        # meshio names types of cells by number alone, and skips COLOR_SCALARS silently, VTK's form of an array of bytes
        names = {str(n): name for n, name in {**VTK_NOT_READ, 11: "voxels"}.items()}
        with_name = lambda m: f"(type {m[1]}, {names.get(m[1], 'unknown')})"  # noqa: E731
        printed = [re.sub(r"\(type (\d+)\)", with_name, word) for word in printed]
        colours = re.findall(rb"^COLOR_SCALARS (\S+) \d+\r?$", path.read_bytes(), re.MULTILINE)
        printed += [f"the colours {unquote(name.decode(errors='replace'))!r} are left out" for name in colours]
    messages = "; ".join(printed)
    if messages and not any(len(block.data) for block in foreign.cells):
        hint = " (.vtu is read by lacmesh itself, with more types of cells)" if name == "vtk" else ""
        raise ReadError(path, f"has no cells as meshio reads it ({messages}); use another format{hint}")
    try:
        mesh = _mesh(_as_ours(foreign, name), path)
    except ReadError:
        raise
    except (LacmeshError, ValueError, KeyError, IndexError, TypeError, AttributeError) as error:
        raise ReadError(path, f"what meshio made of it cannot be used ({error})") from error
    odd = misplaced_mid_nodes(mesh)
    if odd:
        raise ReadError(path, f"has mid-nodes far from their edges as meshio reads {name} ({odd}); use another format")
    if messages:
        warnings.warn(f"{path.name} as meshio reads it: {messages}", LacmeshWarning, stacklevel=3)
    return mesh


def write(path: Path, mesh: Mesh, *, name: str) -> None:
    """Write a mesh in meshio's format `name`, read it back, and warn of all losses.

    Raises WriteError where cells are not kept as they are, RequestError where meshio is missing.
    """
    meshio = needed()
    for kind, n in mesh.cells_by_type.items():
        if ALL_CELLS[kind].order > 1 and (name != "vtk" or kind not in VTK_CELLS or kind in _NOT_CHECKED):
            message = f"cells of type {kind} (the mesh has {n}) are not written as {name}"
            raise WriteError(path, f"{message}; write .vtu, .med or .msh")
    # writers fail on blocks of no cells, which a cut leaves of a type that it replaced
    foreign = _with_arrays(replace(mesh, blocks=tuple(b for b in mesh.blocks if len(b.nodes))), name)
    _guarded(lambda: meshio.write(path, foreign, file_format=name), lambda why: WriteError(path, why), disk=path)
    reread = lambda: _mesh(_as_ours(meshio.read(path, file_format=name), name), path)  # noqa: E731
    back = _guarded(reread, lambda why: WriteError(path, why))
    where = match(mesh, back)
    if isinstance(where, str):
        message = f"meshio's format {name} does not keep the cells ({where} are left); write .vtu, .med or .msh"
        raise WriteError(path, message)
    lost = round_trip_losses(mesh, back, where)
    if lost:
        warnings.warn(f"written by meshio as {name}, which loses " + "; ".join(lost), LacmeshWarning, stacklevel=3)


def _with_arrays(mesh: Mesh, name: str) -> Any:
    """Return a mesh for meshio, with data and groups as arrays if the format keeps arrays, or else the cells alone."""
    foreign = to_meshio(mesh)
    foreign.cell_sets, foreign.point_sets, foreign.cell_data, foreign.point_data = {}, {}, {}, {}
    if name in _WITH_ARRAYS:
        quoted = lambda text: quote(text, safe=_PLAIN)  # noqa: E731, VTK's files allow no blanks in names
        arrays = to_arrays(mesh, [], quoted if name == "vtk" else lambda text: "_".join(text.split()))
        for key, values in arrays.cell.items():
            foreign.cell_data[key] = [_number_type(values[a:b], name) for a, b in pairwise(mesh.offsets)]
        foreign.point_data = {key: _number_type(values, name) for key, values in arrays.node.items()}
    if name == "vtk":
        _turn_wedges(foreign)
    return foreign


def _number_type(values: NDArray, name: str) -> NDArray:
    """Values as a format takes them: VTK's reader knows integers of 64 bits alone, two writers numbers of one width."""
    if name in ("tecplot", "avsucd"):
        return values.astype(float)
    wide = name == "vtk" and values.dtype.kind in "iu" and values.dtype != np.uint64
    return values.astype(np.int64) if wide else values


def _as_ours(foreign: Any, name: str) -> Any:
    """Convert, in place, what differs in a VTK file: the node order of wedges, encoded names, the pairs in `entity`."""
    if name == "vtk":
        _turn_wedges(foreign)
        foreign.cell_data = {unquote(k): _pairs(v) if k == "entity" else v for k, v in foreign.cell_data.items()}
        foreign.point_data = {unquote(k): _pairs([v])[0] if k == "entity" else v for k, v in foreign.point_data.items()}
    return foreign


def _pairs(parts: list[NDArray]) -> list[NDArray]:
    """Remove the third column, of zeros, that meshio adds to arrays of pairs."""
    added = all(v.ndim == 2 and v.shape[1] == 3 and not v[:, 2].any() for v in parts)
    return [v[:, :2] for v in parts] if added else parts


def _turn_wedges(foreign: Any) -> None:
    """Undo, in place, meshio's reordering of VTK's linear wedges, which gives them negative volumes in VTK."""
    for block in foreign.cells:
        if block.type == "wedge":
            block.data = block.data[:, [0, 2, 1, 3, 5, 4]]


def _guarded(
    call: Callable[[], Any],
    failed: Callable[[str], LacmeshError],
    words: list[str] | None = None,
    disk: Path | None = None,
) -> Any:
    """Call meshio and return its result; keep its output off the terminal, and turn any exception into one error.

    Its warnings are added to `words`, each once. A writer's warnings are not collected, since its losses are measured.
    `disk`: a path that is written, of which an error of the system is reported as such.
    """
    output = io.StringIO()
    try:
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = call()
    except LacmeshError as error:
        raise failed(getattr(error, "reason", str(error))) from error
    except (Exception, SystemExit) as error:
        if disk is not None and isinstance(error, OSError):
            why = error.strerror or "not all of it was taken; is the disk full?"
            raise WriteError(disk, f"cannot be written ({why})") from error
        printed = " ".join(output.getvalue().split())[:120]
        why = printed or (str(error).splitlines() or [type(error).__name__])[0][:120]
        raise failed(f"meshio fails ({type(error).__name__}: {why})") from error
    if words is not None:  # each on one line, without colour codes and final full stop
        plain = re.sub(r"\x1b\[[0-9;]*m", "", output.getvalue())
        texts = [" ".join(text.split()).rstrip(".") for kind, text in _WORD.findall(plain) if kind != "Info"]
        words += dict.fromkeys(texts)
    return result
