"""File formats: a module for each, with `read(path) -> Mesh` and `write(path, mesh)`; here, the choice of the format.

The format is detected from the content when reading (`sniff.py`) and given by the suffix when writing (`table.py`);
`output.py` puts the written files in their places.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lacmesh.errors import LacmeshError, LacmeshWarning, ReadError, RequestError, WriteError, listed, some
from lacmesh.formats.output import check_place, replacing
from lacmesh.formats.sniff import HEAD, sniff
from lacmesh.formats.table import OF_NAME, SUFFIXES, Format, format_of, takers
from lacmesh.mesh import Mesh

__all__ = ["SUFFIXES", "Kind", "check_target", "kind_of", "read", "title_of", "write"]


@dataclass(frozen=True)
class Kind:
    """Coding of a mesh file: its format, for msh the version (4.1 or 2.2), and whether it is binary.

    `binary` is False only for the text form of a format that has a binary form too: msh, VTU and XDMF.
    """

    format: str
    version: str = "4.1"
    binary: bool = True


def kind_of(path: str | os.PathLike[str]) -> Kind:
    """Detect the format of an existing file by its content, else by its suffix. Raises ReadError."""
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
    """Name of the format of an existing file, for people. Raises ReadError.

    For example "msh 4.1 binary", "MED", "VTU ASCII", "stl, by meshio".
    """
    kind = kind_of(path)
    title = OF_NAME[kind.format].title + (f" {kind.version}" if kind.format == "msh" else "")
    if kind.format == "msh" and kind.binary:
        return title + " binary"
    return title if kind.binary else title + " ASCII"


def read(path: str | os.PathLike[str], *, mesh: str | None = None) -> Mesh:
    """Read the mesh in a file: msh 2.2 or 4.1, MED 2.3 to 4.2, .mail, .inp, VTU, XDMF, and the formats of meshio.

    `mesh`: name of the mesh to read from a file that holds several (MED, XDMF). Cut records that a format has no place
    for are read from the sidecar NAME.SUFFIX.lac.json; a LacmeshWarning is given if the sidecar does not belong to this
    file. Raises ReadError (RequestError for a wrong `mesh`, or if meshio is missing).
    """
    path = Path(path)
    name = kind_of(path).format
    found = OF_NAME[name]
    if name in ("med", "xdmf"):
        return _reader(name)(path, mesh)
    if mesh is not None:
        raise RequestError(f"{path} is a {found.title} file, which holds one mesh: leave out the name {mesh!r}")
    made = _read_alone(path, found)
    if not found.sidecar:
        return made
    from lacmesh.formats.sidecar import with_sidecar_records

    return with_sidecar_records(path, made)


def _read_alone(path: Path, form: Format) -> Mesh:
    """Read the mesh in one file, without its sidecar."""
    if form.meshio:
        from lacmesh.formats.by_meshio import read as read_by_meshio

        return read_by_meshio(path, form.name)
    return _reader(form.name)(path)


def _reader(name: str) -> Callable[..., Mesh]:
    from importlib import import_module

    return import_module(f"lacmesh.formats.{name}").read


def write(
    path: str | os.PathLike[str],
    mesh: Mesh,
    *,
    msh: str | None = None,
    binary: bool | None = None,
    compress: bool = False,
    target: str | None = None,
    plane: str | None = None,
    all_cells: bool = False,
    force: bool = True,
) -> None:
    """Write a mesh in the format given by the suffix of `path` (`lacmesh.formats.SUFFIXES`).

    `msh`: version of a msh file, 4.1 (default) or 2.2; `binary`: binary (default) or ASCII, for msh, VTU and XDMF;
    `compress`: for VTU and XDMF. XDMF has a second file beside it, .h5. For .inp: `target`, the program, calculix
    (default) or abaqus; `plane`, the elements of a plane mesh, CPS, CPE or CAX (default: `mesh.plane`, else CPS, with a
    warning); `all_cells`: write cells below the mesh's dimension as elements too, not only as surfaces and node sets.
    If a format has no place for the records of a cut, they go to the sidecar NAME.SUFFIX.lac.json; writing a mesh
    without a cut removes such a file.
    An existing file is replaced at the end, as a whole, unless `force` is False. Raises WriteError, and RequestError,
    for example for an option that the format does not take.
    """
    path = Path(path)
    form = format_of(path)
    options = {"compress": compress or None, "target": target, "plane": plane, "all_cells": all_cells or None}
    _check_options(form, {"msh": msh, "binary": binary, **options})
    binary = binary is None or binary
    fill = _writer(form, msh or "4.1", binary, {name: value for name, value in options.items() if value})
    if not np.isfinite(mesh.points).all():
        nodes = some(mesh.node_number[~np.isfinite(mesh.points).all(axis=1)])
        raise WriteError(path, f"the coordinates of nodes {nodes} are not finite numbers")
    places = [path, *_second(path, form, mesh, binary)]
    for place in places:
        check_place(place, force=force)
    with replacing(*places) as made:
        if form.sidecar:
            fill(mesh, made[0])
            for side in made[1:]:
                _write_records(side, mesh, made[0], form)
        else:
            fill(mesh, *made, *(place.name for place in places[1:]))


def check_target(path: str | os.PathLike[str]) -> Format:
    """The format that the suffix of `path` means. Raises RequestError."""
    return format_of(Path(path))


def _check_options(form: Format, options: dict[str, Any]) -> None:
    """Raise RequestError for an option that is given (not None) and that the format does not take."""
    for name, value in options.items():
        if value is not None and name not in form.options:
            titles = listed([taker.title for taker in takers(name)], "and")
            raise RequestError(f"the option {name!r} is for {titles}, not for {form.title}")


def _writer(form: Format, version: str, binary: bool, options: dict[str, Any]) -> Callable[..., Any]:
    """Return the function that writes a mesh; it takes the mesh and a path, for binary XDMF also the .h5 file's."""
    from importlib import import_module

    if form.meshio:
        from lacmesh.formats.by_meshio import write as write_by_meshio
        from lacmesh.formats.meshio_mesh import needed

        needed()
        return lambda mesh, path: write_by_meshio(path, mesh, form.name)
    module = import_module(f"lacmesh.formats.{form.name}")
    if form.name == "msh":
        if version not in ("4.1", "2.2"):
            raise RequestError(f"msh version {version!r} is not written; choose 4.1 or 2.2")
        options |= {"version": version}
    if form.name in ("msh", "vtu"):
        options |= {"binary": binary}
    if form.name != "xdmf" or not binary:
        return lambda mesh, path: module.write(path, mesh, **options)
    return lambda mesh, path, heavy, link: module.write(path, mesh, heavy=heavy, link=link, **options)


def _second(path: Path, form: Format, mesh: Mesh, binary: bool) -> list[Path]:
    """List with the path of the second file that has to be written or removed; empty if there is none.

    Raises WriteError if a file that lacmesh did not write stands there.
    """
    if form.beside and binary:
        from lacmesh.formats.xdmf import writer as xdmf_write

        second = path.with_suffix(form.beside)
        is_ours: Callable[[Path], bool] = xdmf_write.is_ours
    elif form.sidecar:
        from lacmesh.formats import sidecar

        second, is_ours = sidecar.place_of(path), sidecar.is_ours
        if sidecar.records_of(mesh) is None and not is_ours(second):
            return []
    else:
        return []
    if second.is_file() and not is_ours(second):
        raise WriteError(
            second, f"{second.name} is there and lacmesh did not write it; move it, or choose another name"
        )
    return [second]


def _write_records(side: Path, mesh: Mesh, written: Path, form: Format) -> None:
    """Write the sidecar with the cut records for a file that was just written; without records, remove the sidecar."""
    from lacmesh.formats.sidecar import UnfitError, records_of, to_json

    text = None
    if records_of(mesh) is not None:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                back = _read_alone(written, form)
            text = to_json(mesh, back)
        except (UnfitError, LacmeshError) as error:
            why = str(error).replace(str(written), "the file")
            warnings.warn(LacmeshWarning(f"the records of the cut are left out: {why}"), stacklevel=3)
    if text is None:
        side.unlink()
    else:
        side.write_text(text, encoding="ascii")
