"""Files: a module for each format, with `read(path) -> Mesh` and `write(path, mesh)`; here, the choice between them.

The format is known by its content when reading (the first bytes), by its suffix when writing. A file is written beside
its place and renamed, so that nothing is ever half-written or lost.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lacmesh.errors import ReadError, RequestError, WriteError, did_you_mean, some
from lacmesh.mesh import Mesh


@dataclass(frozen=True)
class Kind:
    """How a file keeps a mesh: its format, and for msh the version (4.1 or 2.2) and whether it is binary."""

    format: str
    version: str = "4.1"
    binary: bool = True


#: suffix -> format
SUFFIXES = {".msh": "msh", ".med": "med", ".rmed": "med", ".mmed": "med"}

_HDF5 = b"\x89HDF\r\n\x1a\n"


def kind_of(path: str | os.PathLike[str]) -> Kind:
    """What an existing file is, by its content. Raises ReadError."""
    path = Path(path)
    try:
        with path.open("rb") as file:
            head = file.read(2048)
    except OSError as error:
        raise ReadError(path, f"cannot be read ({error.strerror or error})") from error
    if head.startswith(_HDF5):
        return Kind("med")
    if head.lstrip().startswith(b"$"):
        from lacmesh.formats.msh import header

        version, binary = header(path, head)
        return Kind("msh", version, binary)
    if not head.strip():
        raise ReadError(path, "is empty")
    raise ReadError(path, "is neither a gmsh msh file ($MeshFormat) nor a MED file (HDF5)")


def read(path: str | os.PathLike[str], *, mesh: str | None = None) -> Mesh:
    """The mesh in a file: msh 2.2 or 4.1 (ASCII or binary), MED 2.3 to 4.1.

    `mesh`: which one, by name, in a file that holds several. Raises ReadError (RequestError for a wrong `mesh`).
    """
    kind = kind_of(path)
    if kind.format == "med":
        from lacmesh.formats.med import read as read_med

        return read_med(Path(path), mesh)
    if mesh is not None:
        raise RequestError(f"{path} is a msh file, which holds one mesh: leave out the name {mesh!r}")
    from lacmesh.formats.msh import read as read_msh

    return read_msh(Path(path))


def write(
    path: str | os.PathLike[str], mesh: Mesh, *, msh: str = "4.1", binary: bool = True, force: bool = True
) -> None:
    """Write a mesh; the suffix says the format (.msh, .med). `msh`: the version, `binary`: or ASCII, for msh only.

    An existing file is replaced, at the end and whole, unless `force` is False. Raises WriteError, RequestError.
    """
    path = Path(os.path.realpath(path))  # a link stays one, what it points to is replaced
    writer = _writer(path, msh, binary)
    if not np.isfinite(mesh.points).all():
        nodes = some(mesh.node_number[~np.isfinite(mesh.points).all(axis=1)])
        raise WriteError(path, f"the coordinates of nodes {nodes} are not finite numbers")
    if not force and path.exists():
        raise RequestError(f"{path} exists already; --force replaces it, -o names another file")
    _write_beside(path, lambda beside: writer(beside, mesh))


def check_target(path: str | os.PathLike[str]) -> str:
    """The format that the suffix of `path` means. Raises RequestError."""
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise RequestError(f"{path}: no format has the suffix {suffix!r}{did_you_mean(suffix, SUFFIXES)}")
    return SUFFIXES[suffix]


def _writer(path: Path, version: str, binary: bool) -> Callable[[Path, Mesh], Any]:
    if check_target(path) == "med":
        from lacmesh.formats.med import write as write_med

        return write_med
    if version not in ("4.1", "2.2"):
        raise RequestError(f"msh version {version!r} is not written; choose 4.1 or 2.2")
    from lacmesh.formats.msh import write as write_msh

    return lambda beside, mesh: write_msh(beside, mesh, version, binary)


def _write_beside(path: Path, fill: Callable[[Path], Any]) -> None:
    """Let `fill` write a file next to `path`, force it to the disk, and rename it; leave nothing behind on failure."""
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    except OSError as error:
        raise WriteError(path, f"cannot be written ({error.strerror or error})") from error
    os.close(handle)
    beside = Path(name)
    try:
        fill(beside)
        _settle(beside, path)
    except WriteError as error:
        raise WriteError(path, str(error).removeprefix(f"{beside}: ")) from error
    except OSError as error:
        raise WriteError(path, f"cannot be written ({error.strerror or error})") from error
    finally:
        with suppress(FileNotFoundError):
            beside.unlink()


def _settle(beside: Path, path: Path) -> None:
    with beside.open("rb") as file:
        os.fsync(file.fileno())
    mode = path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~_umask()
    beside.chmod(mode)
    beside.replace(path)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
