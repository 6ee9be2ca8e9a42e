"""Formats that meshio reads and writes and lacmesh does not: the cells, and as much of the rest as meshio keeps.

meshio may raise any exception, exit, drop cells silently, or swap nodes in some formats. Its output is therefore read
back and compared: changed cells are an error, and other losses are named in one warning. Quadratic cells are written
only if their node order was checked against another program; mid-nodes that a reader puts far from their edges are an
error. Messages that meshio prints while reading, for example on cells that it drops, are passed on.
"""

from __future__ import annotations

import contextlib
import io
import re
import string
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import LacmeshError, LacmeshWarning, ReadError, WriteError
from lacmesh.formats import exodus
from lacmesh.formats.arrays import to_arrays
from lacmesh.formats.meshio_mesh import from_meshio, needed, to_meshio
from lacmesh.formats.round_trip import match, misplaced_mid_nodes, round_trip_losses
from lacmesh.formats.registry import GMSH_CAN
from lacmesh.formats.truncation import check_counts, check_whole, read_watched
from lacmesh.formats.vtu.types import NOT_READ
from lacmesh.mesh import Mesh

#: Formats of meshio that are not taken, and why.
NOT_TAKEN = {
    "ansys": "a .msh file is gmsh's",
    "tetgen": "a mesh is two files, and meshio's reader may never end",
    "ugrid": "meshio does not read what it writes",
    "cgns": "what meshio writes is no CGNS: gmsh does not open it, nor meshio what others write",
    "svg": "it is a picture",
    "wkt": "it has no mesh, only single triangles",
    "gmsh": "lacmesh reads and writes it",
    "abaqus": "lacmesh reads and writes it",
    "med": "lacmesh reads and writes it",
    "vtu": "lacmesh reads and writes it",
    "xdmf": "lacmesh reads and writes it",
}
#: types of cells that VTK has, whose order of nodes was not checked in meshio's files
_NOT_VTK = ("TRIA7", "PENTA15", "PYRAM13", "PYRAM14")
#: Formats that keep arrays on cells and nodes: groups, numbers and fields go there.
_WITH_ARRAYS = ("vtk", "hmf", "tecplot", "avsucd")
#: The characters that VTK's files have in names as they are; %XX is for the others.
_PLAIN = "".join(sorted({*string.punctuation} - {*'%"'}))
#: A message of meshio to the user, up to the next one.
_WORD = re.compile(r"^(Warning|Error|Info): (.*?)(?=^(?:Warning|Error|Info): |\Z)", re.MULTILINE | re.DOTALL)


def read(path: Path, name: str) -> Mesh:
    """Read a file of meshio's format `name`; a LacmeshWarning passes on the warnings of meshio.

    Raises ReadError, also if meshio warns and no cells are left; RequestError if meshio is missing.
    """
    meshio = needed()
    if not path.is_file():
        raise ReadError(path, "cannot be read (No such file or directory)")
    if name == "exodus":
        return exodus.read(path)
    check_whole(path, name)
    heard: list[str] = []
    way = f"; {GMSH_CAN}" if name == "nastran" else ""
    given = _guarded(lambda: read_watched(meshio.read, path, name), lambda why: ReadError(path, why + way), heard)
    if name == "vtk":
        heard = [*map(_of_vtk, heard), *_colours(path)]
    said = "; ".join(heard)
    if said and not any(len(block.data) for block in given.cells):
        hint = " (.vtu is read by lacmesh itself, with more types of cells)" if name == "vtk" else ""
        raise ReadError(path, f"has no cells as meshio reads it ({said}); use another format{hint}")
    check_counts(path, name, len(given.points), sum(len(block.data) for block in given.cells))
    _as_ours(given, name)
    try:
        mesh = from_meshio(given)
    except LacmeshError as error:
        raise ReadError(path, str(error)) from error
    odd = misplaced_mid_nodes(mesh)
    if odd:
        raise ReadError(path, f"has mid-nodes far from their edges as meshio reads {name} ({odd}); use another format")
    if said:
        warnings.warn(f"{path.name} as meshio reads it: {said}", LacmeshWarning, stacklevel=3)
    return mesh


def write(path: Path, mesh: Mesh, *, name: str) -> None:
    """Write a mesh in the format of the suffix, read it back, and warn of all losses.

    Raises WriteError where cells are not kept as they are, RequestError where meshio is missing.
    """
    meshio = needed()
    _check_types(path, mesh, name)
    # writers fail on blocks of no cells, which a cut leaves of a type that it replaced
    given = _given(replace(mesh, blocks=tuple(b for b in mesh.blocks if len(b.nodes))), name)
    _turn_wedges(given, name)
    with _told_by_the_disk(path):
        _guarded(lambda: meshio.write(path, given, file_format=name), lambda why: WriteError(path, why))
    back = _guarded(lambda: meshio.read(path, file_format=name), lambda why: WriteError(path, why))
    _as_ours(back, name)
    reread = _guarded(lambda: from_meshio(back), lambda why: WriteError(path, why))
    where = match(mesh, reread)
    if isinstance(where, str):
        message = f"meshio's format {name} does not keep the cells ({where} are left); write .vtu, .med or .msh"
        raise WriteError(path, message)
    lost = round_trip_losses(mesh, reread, where)
    if lost:
        warnings.warn(f"written by meshio as {name}, which loses " + "; ".join(lost), LacmeshWarning, stacklevel=3)


def _check_types(path: Path, mesh: Mesh, name: str) -> None:
    """Raise WriteError for quadratic cells whose order of nodes was not checked: VTK's reader takes those of VTK."""
    for cell_type, n in mesh.cells_by_type.items():
        if ALL_CELLS[cell_type].order > 1 and (name != "vtk" or cell_type in _NOT_VTK):
            message = f"cells of type {cell_type} (the mesh has {n}) are not written as {name}"
            raise WriteError(path, f"{message}; write .vtu, .med or .msh")


def _given(mesh: Mesh, name: str) -> Any:
    """Convert a mesh for meshio, with data and groups as arrays if the format keeps arrays, else without any data."""
    given = to_meshio(mesh)
    given.cell_sets, given.point_sets = {}, {}
    if name not in _WITH_ARRAYS:
        given.cell_data, given.point_data = {}, {}
        return given
    arrays = to_arrays(mesh, [], _encoded if name == "vtk" else lambda text: "_".join(text.split()))
    bounds = list(zip(mesh.offsets, mesh.offsets[1:], strict=False))
    given.cell_data = {key: [values[a:b] for a, b in bounds] for key, values in arrays.cell.items()}
    given.point_data = dict(arrays.node)
    if name == "vtk":
        given.cell_data = {key: [_wide(v) for v in values] for key, values in given.cell_data.items()}
        given.point_data = {key: _wide(values) for key, values in given.point_data.items()}
    if name in ("tecplot", "avsucd"):  # meshio's writers take numbers of one width
        given.cell_data = {key: [v.astype(float) for v in values] for key, values in given.cell_data.items()}
    return given


def _encoded(text: str) -> str:
    """Percent-encode a name, since VTK's files allow no blanks in names."""
    return quote(text, safe=_PLAIN)


def _wide(values: NDArray) -> NDArray:
    """Integers in 64 bits: VTK's reader does not know meshio's words for narrower ones, and then drops all arrays."""
    return values.astype(np.int64) if values.dtype.kind in "iu" and values.dtype != np.uint64 else values


def _as_ours(given: Any, name: str) -> None:
    """Convert, in place, what differs in a VTK file: the node order of wedges, encoded names, the pairs in `entity`."""
    if name != "vtk":
        return
    _turn_wedges(given, name)
    given.cell_data = {unquote(k): _pairs(v) if k == "entity" else v for k, v in given.cell_data.items()}
    given.point_data = {unquote(k): _pairs([v])[0] if k == "entity" else v for k, v in given.point_data.items()}


def _pairs(pieces: list[NDArray]) -> list[NDArray]:
    """Remove the third column, of zeros, that meshio adds to arrays of pairs."""
    added = all(v.ndim == 2 and v.shape[1] == 3 and not v[:, 2].any() for v in pieces)
    return [v[:, :2] for v in pieces] if added else pieces


def _of_vtk(word: str) -> str:
    """Add the names of cell types to a message of meshio on a VTK file, which gives only their numbers."""
    names = {**NOT_READ, 11: "voxels"}
    return re.sub(r"\(type (\d+)\)", lambda m: f"(type {m[1]}, {names.get(int(m[1]), 'unknown')})", word)


def _colours(path: Path) -> list[str]:
    """Messages on the COLOR_SCALARS that meshio skips silently; VTK saves an active array of bytes in that form."""
    colours = re.findall(rb"^COLOR_SCALARS (\S+) \d+\r?$", path.read_bytes(), re.MULTILINE)
    return [f"the colours {unquote(name.decode(errors='replace'))!r} are left out" for name in colours]


def _turn_wedges(given: Any, name: str) -> None:
    """Undo, in place, meshio's reordering of VTK's linear wedges, which gives them negative volumes in VTK."""
    for block in given.cells if name == "vtk" else ():
        if block.type == "wedge":
            block.data = block.data[:, [0, 2, 1, 3, 5, 4]]


@contextlib.contextmanager
def _told_by_the_disk(path: Path) -> Iterator[None]:
    """Report a failed write as an error of the disk, instead of meshio's message on it."""
    try:
        yield
    except WriteError as error:
        if not isinstance(error.__cause__, OSError):
            raise
        why = error.__cause__.strerror or "not all of it was taken; is the disk full?"
        raise WriteError(path, f"cannot be written ({why})") from error.__cause__


def _guarded(call: Callable[[], Any], failed: Callable[[str], LacmeshError], words: list[str] | None = None) -> Any:
    """Call meshio and return its result; keep its output off the terminal, and turn any exception into one error.

    Its warnings are added to `words`, each once. A writer's warnings are not collected, since its losses are measured.
    """
    heard = io.StringIO()
    try:
        with contextlib.redirect_stdout(heard), contextlib.redirect_stderr(heard), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = call()
    except LacmeshError as error:
        raise failed(f"what meshio made of it cannot be used ({error})") from error
    except (Exception, SystemExit) as error:
        said = " ".join(heard.getvalue().split())[:120]
        why = said or str(error).splitlines()[0][:120] if said or str(error) else type(error).__name__
        raise failed(f"meshio fails ({type(error).__name__}: {why})") from error
    if words is not None:
        words += dict.fromkeys(_warned(heard.getvalue()))
    return result


def _warned(printed: str) -> list[str]:
    """Warnings and errors in meshio's printed output, each on one line, without colour codes and final full stop."""
    plain = re.sub(r"\x1b\[[0-9;]*m", "", printed)
    return [" ".join(text.split()).rstrip(".") for kind, text in _WORD.findall(plain) if kind != "Info"]
