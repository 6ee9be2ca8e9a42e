"""Listing and meshing of CAD files by gmsh in a child process, which may be stopped or crash without harm.

request = what is wanted, as JSON                       (`list_cad`, `mesh_cad`)
child = the file opened, listed or meshed, by gmsh      (`child.main`)
answer = rows or a mesh, warnings, or the one error     (`_ask`)
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lacmesh.errors import (
    DataError,
    LacmeshError,
    LacmeshWarning,
    ReadError,
    RequestError,
    WriteError,
    did_you_mean,
    reading,
)
from lacmesh.formats import read
from lacmesh.formats.output import temporary_folder
from lacmesh.gmsh import session
from lacmesh.mesh import Mesh

#: suffix -> what the file is
SUFFIXES = {
    ".geo": "a gmsh script",
    ".geo_unrolled": "a gmsh script",
    ".step": "STEP",
    ".stp": "STEP",
    ".iges": "IGES",
    ".igs": "IGES",
    ".brep": "BREP",
    ".stl": "STL",
}
_ERRORS: Mapping[str, type[LacmeshError]] = {
    "DataError": DataError,
    "RequestError": RequestError,
    "GroupNotFoundError": RequestError,
}


@dataclass(frozen=True)
class CadShape:
    """An entity of a geometry. `measure`: length, area or volume; `centre` of it; `box`: least and greatest corner.

    `normal`: out of the first body, where it is the same all over. `radius`: of circles, cylinders, spheres; negative
    where the body is outside (a bore). `bodies`: tags of the bodies that it bounds. `groups`: names of its groups.
    `name`: that of the part in a STEP file, "" without one.
    """

    dim: int
    tag: int
    type: str
    measure: float
    centre: tuple[float, float, float]
    box: tuple[tuple[float, float, float], tuple[float, float, float]]
    normal: tuple[float, float, float] | None = None
    radius: float | None = None
    bodies: tuple[int, ...] = ()
    groups: tuple[str, ...] = ()
    name: str = ""


@dataclass(frozen=True)
class EntitySelection:
    """Part of a group: entities given by tag, or those of dimension `dim` in a box (least and greatest corner).

    A dimension of None means 2, and 1 if the geometry is plane: no volumes, and all surfaces in one plane.
    """

    dim: int | None
    tags: tuple[int, ...] = ()
    box: tuple[float, ...] = ()


def list_cad(path: str | os.PathLike[str], *, dim: int | None = None) -> list[CadShape]:
    """List the bodies of a CAD file (volumes; surfaces if there are none, or if `dim` is 2), then their boundaries.

    Exact for STEP, IGES and BREP; from a fine mesh of the surfaces for .geo and STL. Raises ReadError, DataError, and
    RequestError where gmsh is missing.
    """
    path = check_source(path)
    answer, _ = _ask({"do": "list", "dim": dim}, path, want_mesh=False)
    return [_shape(row) for row in answer["shapes"]]


def mesh_cad(
    path: str | os.PathLike[str],
    *,
    groups: Mapping[str, Sequence[EntitySelection]] | None = None,
    size: float | None = None,
    order: int | None = None,
    slave: Sequence[str] = (),
    slave_size: float | None = None,
    dim: int | None = None,
) -> Mesh:
    """Mesh a CAD file: its bodies, all that bounds them, and lower entities that are in a group.

    `groups`: name -> what it is made of (`parse_group`), besides those of a .geo. `size`: length of edges (default: as
    the .geo says; for other files a twentieth of the diagonal, and 12 edges to a full turn). `order`: 1 or 2 (default:
    as the .geo says, or 1); nodes of order 2 stand on the geometry. `slave`, `slave_size`: groups of the skin whose
    faces get edges of that length, and cells that grow away from them. `dim`: 2 or 3 (default: 3 where there are
    volumes). Cells of the skin are oriented outward.

    Raises ReadError for the file, RequestError for groups or tags that it lacks (and where gmsh is missing), DataError
    where gmsh cannot mesh it. Warns of cells that are inverted or degenerate.
    """
    path = check_source(path)
    for what, value in (("size", size), ("slave_size", slave_size)):
        if value is not None and not 0 < value < float("inf"):
            raise RequestError(f"{what} must be a positive length, not {value}")
    if order not in (None, 1, 2) or dim not in (None, 2, 3):
        raise RequestError(
            f"order is 1 or 2, not {order}" if order not in (None, 1, 2) else f"dim is 2 or 3, not {dim}"
        )
    if bool(slave) != (slave_size is not None):
        raise RequestError("a slave group and its size go together: say both, or neither")
    parts = {name: [vars(part) for part in entities] for name, entities in (groups or {}).items()}
    request = {"do": "mesh", "dim": dim, "groups": parts, "size": size, "order": order}
    _, mesh = _ask({**request, "slave": list(slave), "slave_size": slave_size}, path, want_mesh=True)
    assert mesh is not None
    return mesh


def parse_group(text: str) -> tuple[str, EntitySelection]:
    """Parse `NAME=TAG,TAG` or `NAME=box:x0,y0,z0,x1,y1,z1`; `DIM:` after the = sets the dimension. Raises RequestError.

    >>> parse_group("bore=17,18")
    ('bore', EntitySelection(dim=None, tags=(17, 18), box=()))
    >>> parse_group("body=3:1")[1], parse_group("top=box:0,0,1,2,2,1")[1].box
    (EntitySelection(dim=3, tags=(1,), box=()), (0.0, 0.0, 1.0, 2.0, 2.0, 1.0))
    """
    name, equals, said = text.rpartition("=")
    head, colon, rest = said.partition(":")
    dim = int(head) if colon and head in ("0", "1", "2", "3") else None
    what = said if dim is None else rest
    try:
        if not name or not equals:
            raise ValueError
        if what.startswith("box:"):
            box = tuple(float(x) for x in what[4:].split(","))
            if len(box) != 6 or any(a > b for a, b in zip(box[:3], box[3:], strict=True)):
                raise ValueError
            return name, EntitySelection(dim, box=box)
        tags = tuple(int(t) for t in what.split(","))
        if min(tags) < 1:
            raise ValueError
    except ValueError:
        form = "NAME=TAG,TAG or NAME=box:x0,y0,z0,x1,y1,z1 (least, then greatest corner; DIM: before either)"
        raise RequestError(f"{text!r} says no group; write {form}") from None
    return name, EntitySelection(dim, tags)


def check_source(path: str | os.PathLike[str]) -> Path:
    """Check that a CAD file can be read, and return its path. Raises RequestError for an unknown suffix, ReadError."""
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        if suffix in (".msh", ".med"):
            raise RequestError(f"{path} is a mesh already; lacmesh cut cuts it, lacmesh convert writes it otherwise")
        raise RequestError(f"{path}: no CAD file has the suffix {suffix!r}{did_you_mean(suffix, SUFFIXES)}")
    with reading(path), path.open("rb") as file:
        if not file.read(1):
            raise ReadError(path, "is empty")
    return path


def _ask(request: dict[str, Any], path: Path, want_mesh: bool) -> tuple[dict[str, Any], Mesh | None]:
    """Let a child process answer a request; repeat its warnings, and raise its error."""
    session.find()
    with temporary_folder() as folder:
        request = {**request, "path": str(path.absolute())}
        (folder / "request.json").write_text(json.dumps(request), encoding="utf-8")
        status, printed = _run_child(folder)
        answer = _answer(folder, path, status, printed)
        lost = [f"its reader says {said}; shapes may be missing" for said in _complaints(printed)]
        for message in (*lost, *answer["warnings"]):
            warnings.warn(LacmeshWarning(f"{path}: {message}"), stacklevel=3)
        return answer, read(folder / "mesh.msh") if want_mesh else None


def _run_child(folder: Path) -> tuple[int, str]:
    """The exit status of the child that answers the request in a folder, and what it printed."""
    env = dict(os.environ, PYTHONPATH=os.pathsep.join(p for p in sys.path if p))
    code = "import sys; from lacmesh.gmsh.child import main; main(sys.argv[1])"
    with (folder / "printed").open("w+b") as printed:
        child = subprocess.Popen(
            [sys.executable, "-c", code, str(folder)], env=env, stdin=subprocess.DEVNULL, stdout=printed, stderr=printed
        )
        try:
            status = child.wait()
        except BaseException:  # an interrupt, say
            child.kill()
            child.wait()
            raise
        printed.seek(0)
        return status, re.sub(r"\x1b\[[0-9;]*m", "", printed.read().decode(errors="replace"))  # colours taken off


def _answer(folder: Path, path: Path, status: int, printed: str) -> dict[str, Any]:
    """The child's answer; its error is raised, with what it printed where that explains it."""
    explained = _complaints(printed)
    try:
        answer: dict[str, Any] = json.loads((folder / "answer.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        last = (explained or printed.strip().splitlines() or ["without a word"])[-1]
        message = f"gmsh died on it (status {status}: {last}); repair the geometry, or save it in another format"
        raise ReadError(path, message) from None
    error = answer.get("error")
    if error is None:
        return answer
    message = "; ".join([error["message"], *explained[:1]])
    if error["kind"] == "ReadError":
        raise ReadError(path, message)
    if error["kind"] == "WriteError":  # of the mesh in the folder
        raise WriteError(folder.parent, error["message"].rpartition(": ")[2])
    raise _ERRORS[error["kind"]](f"{path}: {message}")


def _complaints(printed: str) -> list[str]:
    """Errors that gmsh's reader of STEP and IGES prints itself, bypassing gmsh's log.

    >>> _complaints("**** ERR StepFile : Undefined Parsing: Line 7: unexpected end    ****")
    ['Undefined Parsing: Line 7: unexpected end']
    """
    return list(dict.fromkeys(re.findall(r"\*\* ERR \w+ : (.*?)\s*\*\*", printed)))


def _shape(row: dict[str, Any]) -> CadShape:
    pairs = {key: tuple(value) for key, value in row.items() if isinstance(value, list) and key != "box"}
    return CadShape(**{**row, **pairs, "box": tuple(map(tuple, row["box"]))})
