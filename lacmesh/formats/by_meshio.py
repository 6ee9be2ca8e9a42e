"""Files that meshio reads and writes and lacmesh does not, whole ones alone, and what they do not give back.

meshio may raise any exception, exit, drop cells silently, or swap nodes in some formats. Groups and numbers are written
as arrays where a format keeps arrays. What was written is read back: changed cells are an error, all other losses are
named in one warning. Quadratic cells are written only where their node order was checked against another program.
Messages that meshio prints while reading, for example on cells that it drops, are passed on.

Some readers of meshio go on at the end of a file for ever; others take a truncated file for a whole one. A stream from
here stops the first, after a number of reads beyond the end: no clock is needed. For the second, a text is searched for
the words that end its format; if a format has none, its last line must be ended; and points and cells that a format
announces are counted. A file of a format that neither counts nor ends (`AT_RISK`) may still have lost whole lines.
"""

from __future__ import annotations

import contextlib
import io
import re
import string
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import LacmeshError, LacmeshWarning, ReadError, WriteError, some
from lacmesh.facts import listed
from lacmesh.formats import exodus
from lacmesh.formats.arrays import GROUP, NUMBER, mesh_of_meshio, needed, to_arrays, to_meshio
from lacmesh.formats.orders import VTK_CELLS, VTK_NOT_READ, file_order
from lacmesh.formats.registry import GMSH_CAN
from lacmesh.mesh import Floats, Ints, Mesh

#: formats that keep arrays on cells and nodes: groups, numbers and fields go there
_WITH_ARRAYS = ("vtk", "hmf", "tecplot", "avsucd")
#: types of cells that are written as vtk but for their nodes' order, which was not checked
_NOT_CHECKED = ("TRIA7", "PENTA15", "PYRAM13", "PYRAM14")
#: the characters that VTK's files have in names as they are; %XX is for the others
_PLAIN = "".join(sorted({*string.punctuation} - {*'%"'}))
#: a message of meshio to the user, up to the next one
_WORD = re.compile(r"^(Warning|Error|Info): (.*?)(?=^(?:Warning|Error|Info): |\Z)", re.MULTILINE | re.DOTALL)
#: formats whose text does not say where it ends: a file that lost its last lines reads as a smaller mesh
AT_RISK = ("flac3d", "mdpa", "obj")
#: meshio's formats whose reader takes a stream, of text or of bytes. The others open the file by its name: libraries
#: (HDF5, netCDF, XML) and readers that look at the suffix, or open it twice; they stop where the file does
_OF_TEXT = ("avsucd", "nastran", "netgen", "obj", "off", "permas", "su2", "tecplot")
_OF_BYTES = ("mdpa", "ply")
#: how often a reader may look beyond the end
_PATIENCE = 1000
#: what stands at the end of a text of a format
_END = {
    "mdpa": (rb"^\s*End [^\n]*\s*\Z", "End"),
    "medit": (rb"^\s*End\b", "End"),
    "netgen": (rb"^endmesh\b", "endmesh"),
    "permas": (rb"^\$FIN\b", "$FIN"),
    "stl": (rb"^\s*endsolid\b", "endsolid"),
}
#: what says in a file how many points, and how many cells, it has
_COUNTS = {
    "ply": (rb"^element vertex (\d+)", rb"^element face (\d+)"),
    "su2": (rb"^NPOIN\s*=\s*(\d+)", rb"^(?:NELEM|MARKER_ELEMS)\s*=\s*(\d+)"),
}
#: formats of text that end with a number
_LINES = ("avsucd", "flac3d", "obj", "off", "ply", "su2", "tecplot", "vtk")
#: binary medit's last word, before the place of the next
_GMF_END = 54


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
        mesh = mesh_of_meshio(_as_ours(foreign, name), path)
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
    reread = lambda: mesh_of_meshio(_as_ours(meshio.read(path, file_format=name), name), path)  # noqa: E731
    back = _guarded(reread, lambda why: WriteError(path, why))
    try:
        lost = list(losses(mesh, back))
    except ValueError as error:
        message = f"meshio's format {name} does not keep the cells ({error} are left); write .vtu, .med or .msh"
        raise WriteError(path, message) from None
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


# ---- whole files


class _Watched:
    """Mixin for streams that raises EOFError in a reader which goes on beyond the end."""

    _beyond = 0

    def readline(self, size: int | None = -1, /) -> Any:
        """Read a line as a stream does, and count the reads beyond the end."""
        return self._counted(super().readline(size))  # type: ignore[misc]

    def read(self, size: int | None = -1, /) -> Any:
        """Read as a stream does, and count the reads beyond the end."""
        return self._counted(super().read(size))  # type: ignore[misc]

    def _counted(self, content: Any) -> Any:
        self._beyond += not content
        if self._beyond > _PATIENCE:
            raise EOFError("the file ends before the mesh does")
        return content


class _Bytes(_Watched, io.BufferedReader): ...


class _Text(_Watched, io.TextIOWrapper): ...


def read_whole(read: Callable[..., Any], path: Path, name: str) -> Any:
    """Call `read` (meshio's) on a file of its format `name`.

    Raises ReadError where the file was cut short, as far as its format tells; EOFError if `read` goes on at its end.
    """
    packed = path.suffix == ".gz"  # a packed file that is cut short cannot be unpacked
    content = b"" if packed else path.read_bytes()
    if not packed:
        _check_end(path, name, content)
    if packed or name not in (*_OF_TEXT, *_OF_BYTES):
        mesh = read(path, file_format=name)
    else:
        with _Bytes(io.FileIO(path)) as file:
            mesh = read(_Text(file) if name in _OF_TEXT else file, file_format=name)
    counts = len(mesh.points), sum(len(block.data) for block in mesh.cells)
    for pattern, count, what in zip(_COUNTS.get(name, ()), counts, ("points", "cells"), strict=False):
        announced = sum(map(int, re.findall(pattern, content, re.MULTILINE)))
        if count < announced:
            raise ReadError(path, f"is cut short: it has {count} of the {announced} {what} that it announces")
    return mesh


def _check_end(path: Path, name: str, content: bytes) -> None:
    if b"\0" in content[:4096] or b"\0" in content[-4096:]:  # no text
        words = [int.from_bytes(content[at : at + 4], order) for at in (-8, -12) for order in ("little", "big")]
        if name == "medit" and _GMF_END not in words:
            raise ReadError(path, "is cut short: its end is missing (GmfEnd)")
    elif name == "dolfin-xml":
        for whole, part in ((b"vertices", b"vertex"), (b"cells", b"interval|triangle|tetrahedron")):
            announced = sum(map(int, re.findall(b"<%b\\s[^>]*?size=[\"'](\\d+)" % whole, content)))
            n = len(set(re.findall(b"<(?:%b)\\s[^>]*?index=[\"'](\\d+)" % part, content)))
            if n != announced:
                raise ReadError(path, f"has {n} of {announced} {whole.decode()}, or others than it should")
    elif name in _END:
        pattern, word = _END[name]
        if not re.search(pattern, content, re.MULTILINE):
            raise ReadError(path, f"is cut short: {word!r} is missing, which ends a file of {name}")
    elif name in _LINES and content[-1:] not in (b"\n", b"\r"):
        raise ReadError(path, "ends within a line, so it may be cut short; if it is whole, end its last line")


# ---- losses


def losses(before: Mesh, after: Mesh, tolerance: float = 1e-5) -> Iterator[str]:
    """Yield what `after` has lost of `before`. Raises ValueError where its cells, by type and in order, are others.

    `tolerance`: largest distance of a node from its place, over the mesh's size.
    """
    size = float(np.ptp(before.points, axis=0).max(initial=0)) if before.n_nodes else 0.0
    to = {"cell": np.full(before.n_cells, -1), "node": np.full(before.n_nodes, -1)}  # indices in `after`
    off, none = 0.0, np.empty((0, 1), np.int64)
    parts = [{kind: part for kind, *part in mesh.select(np.arange(mesh.n_cells))} for mesh in (before, after)]
    for kind in dict.fromkeys([*parts[0], *parts[1]]):
        (cells, ours), (others, theirs) = (part.get(kind, [none, none]) for part in parts)
        if len(ours) != len(theirs):
            raise ValueError(f"{len(theirs)} {kind} of {len(ours)}")
        away = _farthest(before.points[ours], after.points[theirs])
        if not away <= tolerance * size:
            raise ValueError(f"{kind} with other nodes")
        off = max(off, away)
        to["cell"][cells], to["node"][ours] = others, theirs
    alone = np.flatnonzero(to["node"] < 0)
    if after.n_nodes == before.n_nodes and _farthest(before.points[alone], after.points[alone]) <= tolerance * size:
        to["node"][alone] = alone
    if off > 1e-14 * size:
        yield f"digits of coordinates (moved by up to {off / size:.0e} of the mesh's size)"
    if n := int((to["node"] < 0).sum()):
        yield f"{n} nodes that no cell has"
    for on, indices in to.items():
        yield from _lost_on(on, before, after, indices)
    one, other = (np.repeat([b.type for b in m.blocks], np.diff(m.offsets))[file_order(m)] for m in (before, after))
    rest = {
        f"the names of the zones {listed(map(repr, before.zones))}": before.zones and before.zones != after.zones,
        f"the mesh's name {before.name!r}": before.name not in ("mesh", after.name),
        f"that the mesh has {before.space_dim} dimensions": before.space_dim != after.space_dim,
        "the times of steps": before.steps and before.steps != after.steps,
        "the tags of groups": before.group_tags and before.group_tags != after.group_tags,
        "periodic links": before.model and before.model.periodic and not (after.model and after.model.periodic),
        "the order of cells of different types": before.file_order is not None and not np.array_equal(one, other),
    }
    yield from (what for what, gone in rest.items() if gone)


def _farthest(a: Floats, b: Floats) -> float:
    return float(np.linalg.norm(a - b, axis=-1).max(initial=0.0))


def _lost_on(on: str, before: Mesh, after: Mesh, to: Ints) -> Iterator[str]:
    """Yield what is lost of the groups, numbers and data of nodes or cells, whose indices in `after` are `to`."""
    there, clauses = to >= 0, dict[str, list[str]]()
    ours, theirs = (getattr(to_arrays(mesh, []), on) for mesh in (before, after))
    for name, values in ours.items():
        other, what = theirs.get(name), f"the {on} data {{}}"
        padded = other is not None and (values.shape[1:], other.shape[1:]) == ((2,), (3,)) and not other[:, 2].any()
        other = other[:, :2] if padded else other
        if other is None or other.shape[1:] != values.shape[1:] or not _same(values[there], other[to[there]]):
            kind = f"the {on} groups {{}}" if name.startswith(GROUP) else what
            kind = f"the numbers of {on}s (they are 1, 2, ...)" if name == NUMBER[on] else kind
            clauses.setdefault(kind, []).append(name.removeprefix(GROUP))
        elif values.dtype.kind in "iu" and other.dtype.kind == "f":
            clauses.setdefault(f"that {what} are integers", []).append(name)
        elif padded:
            clauses.setdefault(f"that {what} have 2 components (a third, 0, is added)", []).append(name)
    yield from (clause.format(listed(map(repr, names))) for clause, names in clauses.items())


def _same(a: NDArray, b: NDArray) -> bool:
    scale = float(np.nanmax(np.abs(a), initial=0.0)) if a.dtype.kind == "f" else 0.0
    return bool(np.allclose(a.astype(float), b.astype(float), rtol=1e-6, atol=1e-9 * scale, equal_nan=True))


def misplaced_mid_nodes(mesh: Mesh) -> str:
    """Text that names cells with misplaced mid-nodes, the sign of a wrong node order; "" if there are none.

    A mid-node is misplaced if it is farther from the middle of its edge than half the edge's length.
    """
    wrong = []
    for block, first in zip(mesh.blocks, mesh.offsets, strict=False):
        cell = ALL_CELLS[block.type]
        if cell.order != 2 or not len(block.nodes) or cell.dim < 2:
            continue
        x = mesh.points[block.nodes]
        a, b = (x[:, [edge[k] for edge in cell.edges]] for k in (0, 1))
        middle = x[:, cell.n_corners : cell.n_corners + len(cell.edges)]
        far = np.linalg.norm(middle - (a + b) / 2, axis=2) > 0.5 * np.linalg.norm(b - a, axis=2)
        bad = np.flatnonzero(far.any(axis=1)) + first
        if len(bad):
            wrong.append(f"{block.type} {some(mesh.cell_number[bad], 3)}")
    return ", ".join(wrong)
