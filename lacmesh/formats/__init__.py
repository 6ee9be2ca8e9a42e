"""Files: a module for each format, with `read(path) -> Mesh` and `write(path, mesh)`; here, the choice between them.

The format is known by its content when reading (`sniff.py`), by its suffix when writing (`table.py`). A file is written
beside its place and renamed, so that nothing is ever half-written or lost.
"""

from __future__ import annotations

import os
import secrets
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lacmesh.errors import ReadError, RequestError, WriteError, some
from lacmesh.formats.sniff import HEAD, sniff
from lacmesh.formats.table import OF_NAME, SUFFIXES, Format, format_of
from lacmesh.mesh import Mesh

__all__ = ["SUFFIXES", "Kind", "check_target", "kind_of", "read", "title_of", "write"]

#: Programs that an .inp file is written for.
_INP_TARGETS = ("calculix", "abaqus")


@dataclass(frozen=True)
class Kind:
    """How a file keeps a mesh: its format, for msh the version (4.1 or 2.2), and whether it is binary.

    `binary` is False only where the same format could be: msh, VTU or XDMF in text.
    """

    format: str
    version: str = "4.1"
    binary: bool = True


def kind_of(path: str | os.PathLike[str]) -> Kind:
    """What an existing file is, by its content; by its suffix where that says nothing. Raises ReadError."""
    path = Path(path)
    try:
        if not path.is_dir() and path.exists() and not path.is_file():  # a pipe gives its content once, or waits
            raise ReadError(path, "is no regular file; save it as one first")
        with path.open("rb") as file:
            head = file.read(HEAD)
        found = sniff(path, head)
    except OSError as error:
        raise ReadError(path, f"cannot be read ({error.strerror or error})") from error
    if found.format == "msh":
        from lacmesh.formats.msh import header

        return Kind("msh", *header(path, head))
    return Kind(found.format, binary=found.binary or found.format not in ("vtu", "xdmf"))


def title_of(path: str | os.PathLike[str]) -> str:
    """What an existing file is, for people. Raises ReadError.

    For example "msh 4.1 binary", "MED", "VTU ASCII", "stl, by meshio".
    """
    kind = kind_of(path)
    title = OF_NAME[kind.format].title + (f" {kind.version}" if kind.format == "msh" else "")
    if kind.format == "msh" and kind.binary:
        return title + " binary"
    return title if kind.binary else title + " ASCII"


def read(path: str | os.PathLike[str], *, mesh: str | None = None) -> Mesh:
    """The mesh in a file: msh 2.2 or 4.1, MED 2.3 to 4.2, .mail, .inp, VTU, XDMF, and what meshio reads.

    `mesh`: which one, by name, in a file that holds several (MED, XDMF). Raises ReadError (RequestError for a wrong
    `mesh`, or where meshio is missing).
    """
    path = Path(path)
    name = kind_of(path).format
    found = OF_NAME[name]
    if name in ("med", "xdmf"):
        return _reader(name)(path, mesh)
    if mesh is not None:
        raise RequestError(f"{path} is a {found.title} file, which holds one mesh: leave out the name {mesh!r}")
    if found.meshio:
        from lacmesh.formats.by_meshio import read as read_by_meshio

        return read_by_meshio(path, name)
    return _reader(name)(path)


def _reader(name: str) -> Callable[..., Mesh]:
    from importlib import import_module

    return import_module(f"lacmesh.formats.{name}").read


def write(
    path: str | os.PathLike[str],
    mesh: Mesh,
    *,
    msh: str = "4.1",
    binary: bool = True,
    compress: bool = False,
    target: str | None = None,
    force: bool = True,
) -> None:
    """Write a mesh; the suffix says the format (`lacmesh.formats.SUFFIXES`).

    `msh`: the version of a msh file; `binary`: or ASCII, for msh, VTU and XDMF; `compress`: for VTU and XDMF; `target`:
    the program that an .inp file is for, calculix (as by default) or abaqus. XDMF has a second file beside it, .h5.
    An existing file is replaced, at the end and whole, unless `force` is False. Raises WriteError, RequestError.
    """
    path = Path(path)
    form = format_of(path)
    fill = _writer(form, msh, binary, compress, target)
    if not np.isfinite(mesh.points).all():
        nodes = some(mesh.node_number[~np.isfinite(mesh.points).all(axis=1)])
        raise WriteError(path, f"the coordinates of nodes {nodes} are not finite numbers")
    heavy = form.beside if binary else ""
    try:
        for there in (path, path.with_suffix(heavy)) if heavy else (path,):
            if there.exists() and not there.is_file():  # renaming would put a file in place of a device
                raise WriteError(there, "is no file; write to another one")
            if not force and there.exists():
                raise RequestError(f"{there} exists already; --force replaces it, -o names another file")
    except OSError as error:
        raise WriteError(path, f"cannot be written ({error.strerror or error})") from error
    _write_beside(path, lambda *beside: fill(mesh, *beside), heavy)


def check_target(path: str | os.PathLike[str]) -> str:
    """The format that the suffix of `path` means. Raises RequestError."""
    return format_of(Path(path)).name


def _writer(form: Format, version: str, binary: bool, compress: bool, target: str | None) -> Callable[..., Any]:
    """What writes a mesh of that format: called with the mesh, the file, and the second file where there is one."""
    from importlib import import_module

    if compress and "compress" not in form.options:
        raise RequestError(f"compress is for VTU and XDMF, {form.title} has no such choice")
    if target is not None and "target" not in form.options:
        raise RequestError(f"a target ({target}) is for .inp files, {form.title} has no such choice")
    if target not in (None, *_INP_TARGETS):
        raise RequestError(f"an .inp file is for {' or '.join(_INP_TARGETS)}, not {target!r}")
    if form.name == "msh" and version not in ("4.1", "2.2"):
        raise RequestError(f"msh version {version!r} is not written; choose 4.1 or 2.2")
    if form.meshio:
        from lacmesh.formats.by_meshio import write as write_by_meshio
        from lacmesh.formats.meshio_mesh import needed

        needed()
        return lambda mesh, path: write_by_meshio(path, mesh, form.name)
    module = import_module(f"lacmesh.formats.{form.name}")
    options: dict[str, Any] = {}
    if form.name in ("msh", "vtu"):
        options["binary"] = binary
    if form.name == "msh":
        options["version"] = version
    if compress:
        options["compress"] = True
    if target is not None:
        options["target"] = target
    if form.name != "xdmf" or not binary:
        return lambda mesh, path: module.write(path, mesh, **options)

    def with_heavy(mesh: Mesh, path: Path, heavy: Path, link: str) -> None:
        module.write(path, mesh, heavy=heavy, link=link, **options)

    return with_heavy


def _write_beside(path: Path, fill: Callable[..., Any], heavy: str = "") -> None:
    """Let `fill` write a file next to `path`, force it to the disk, and rename it; leave nothing behind on failure.

    `heavy`: the suffix of a second file, which goes with the first; `fill` is then given it too, and its later name.
    """
    real = Path(os.path.realpath(path))  # a link stays one, what it points to is replaced
    places = [real, *([path.with_name(path.stem + heavy)] if heavy else [])]
    # the names are known before the files are there: whenever a signal arrives, what is there can be removed
    token = secrets.token_hex(8)
    beside = [place.with_name(f".{place.stem[:40]}-{token}{place.suffix}") for place in places]
    try:
        for name in beside:
            os.close(os.open(name, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600))
        fill(*beside, *(place.name for place in places[1:]))
        if heavy:
            _check_ours(places[1])
        for name, place in zip(beside[::-1], places[::-1], strict=True):
            _settle(name, place)
    except WriteError as error:
        raise WriteError(path, error.what) from error
    except OSError as error:
        raise WriteError(path, f"cannot be written ({error.strerror or error})") from error
    finally:
        for name in beside:
            with suppress(OSError):
                name.unlink()


def _check_ours(heavy: Path) -> None:
    """Raise WriteError where a file that lacmesh did not write stands where the second file goes."""
    from lacmesh.formats.xdmf_write import is_ours

    if heavy.exists() and not is_ours(heavy):
        raise WriteError(heavy, f"{heavy.name} is there and lacmesh did not write it; move it, or choose another name")


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
