"""What meshio does not notice: files that end too early, and what a file that it wrote does not give back.

Some readers of meshio go on reading at the end of a file for ever; others take a truncated file for a whole one. A
stream from here stops the first, after a number of reads beyond the end: no clock is needed. For the second, a text is
searched for the words that end its format; if a format has none, its last line must be ended; and points and cells that
a format announces are counted. A file of a format that neither counts nor ends (`AT_RISK`) may still have lost whole
lines, which cannot be noticed. Losses are measured: the mesh that was written is compared with the one read back.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import ReadError, some
from lacmesh.facts import listed
from lacmesh.formats.orders import file_order
from lacmesh.mesh import Floats, Ints, Mesh

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


class MeshMap(NamedTuple):
    """Index of each cell and node in the mesh read back, -1 if lost; `off`: largest node shift over the mesh's size."""

    cell: Ints
    node: Ints
    off: float


def match(before: Mesh, after: Mesh, tolerance: float = 1e-5) -> MeshMap | str:
    """Match two meshes whose cells are the same, type by type and in order; else a text that says what differs."""
    size = float(np.ptp(before.points, axis=0).max(initial=0)) if before.n_nodes else 0.0
    cell, node = np.full(before.n_cells, -1), np.full(before.n_nodes, -1)
    off, none = 0.0, np.empty((0, 1), np.int64)
    parts = [{kind: part for kind, *part in mesh.select(np.arange(mesh.n_cells))} for mesh in (before, after)]
    for kind in dict.fromkeys([*parts[0], *parts[1]]):
        (cells, ours), (others, theirs) = (part.get(kind, [none, none]) for part in parts)
        if len(ours) != len(theirs):
            return f"{len(theirs)} {kind} of {len(ours)}"
        away = _farthest(before.points[ours], after.points[theirs])
        if not away <= tolerance * size:
            return f"{kind} with other nodes"
        off = max(off, away)
        cell[cells], node[ours] = others, theirs
    alone = np.flatnonzero(node < 0)
    if after.n_nodes == before.n_nodes and _farthest(before.points[alone], after.points[alone]) <= tolerance * size:
        node[alone] = alone
    return MeshMap(cell, node, off / size if size else 0.0)


def _farthest(a: Floats, b: Floats) -> float:
    return float(np.linalg.norm(a - b, axis=-1).max(initial=0.0))


def round_trip_losses(before: Mesh, after: Mesh, indices: MeshMap) -> list[str]:
    """Clauses that name what `after` has lost of `before`."""
    lost = []
    if indices.off > 1e-14:
        lost.append(f"digits of coordinates (moved by up to {indices.off:.0e} of the mesh's size)")
    if (indices.node < 0).any():
        lost.append(f"{int((indices.node < 0).sum())} nodes that no cell has")
    for on, to in (("cell", indices.cell), ("node", indices.node)):
        lost += _lost_on(on, before, after, to)
    types = [np.repeat([b.type for b in m.blocks], np.diff(m.offsets))[file_order(m)] for m in (before, after)]
    same_order = np.array_equal(types[0], types[1])
    periodic = [mesh.model is not None and bool(mesh.model.periodic) for mesh in (before, after)]
    rest = {
        f"the names of the zones {listed(map(repr, before.zones))}": before.zones and before.zones != after.zones,
        f"the mesh's name {before.name!r}": before.name not in ("mesh", after.name),
        f"that the mesh has {before.space_dim} dimensions": before.space_dim != after.space_dim,
        "the times of steps": before.steps and before.steps != after.steps,
        "the tags of groups": before.group_tags and before.group_tags != after.group_tags,
        "periodic links": periodic == [True, False],
        "the order of cells of different types": before.file_order is not None and not same_order,
    }
    return lost + [what for what, gone in rest.items() if gone]


def _lost_on(on: str, before: Mesh, after: Mesh, to: Ints) -> Iterator[str]:
    """Yield what is lost of the groups, numbers and data of nodes or cells, whose indices in `after` are `to`."""
    (groups, data, number), (others, values_of, theirs) = (
        (getattr(mesh, f"{on}_groups"), getattr(mesh, f"{on}_data"), getattr(mesh, f"{on}_number"))
        for mesh in (before, after)
    )
    there, clauses = to >= 0, dict[str, list[str]]()
    for name, members in groups.items():
        if name not in others or not np.array_equal(np.sort(to[members]), np.sort(others[name])):
            clauses.setdefault(f"the {on} groups {{}}", []).append(name)
    for name, values in data.items():
        other, what = values_of.get(name), f"the {on} data {{}}"
        padded = other is not None and (values.shape[1:], other.shape[1:]) == ((2,), (3,)) and not other[:, 2].any()
        other = other[:, :2] if padded else other
        if other is None or other.shape[1:] != values.shape[1:] or not _same(values[there], other[to[there]]):
            clauses.setdefault(what, []).append(name)
        elif values.dtype.kind in "iu" and other.dtype.kind == "f":
            clauses.setdefault(f"that {what} are integers", []).append(name)
        elif padded:
            clauses.setdefault(f"that {what} have 2 components (a third, 0, is added)", []).append(name)
    if not np.array_equal(number[there], theirs[to[there]]):
        yield f"the numbers of {on}s (they are 1, 2, ...)"
    yield from (clause.format(listed(map(repr, names))) for clause, names in clauses.items())


def _same(a: NDArray, b: NDArray) -> bool:
    if a.dtype.kind not in "iufb" or b.dtype.kind not in "iufb":
        return False
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
