"""File formats: a module for each, with `read(path) -> Mesh` and `write(path, mesh)`; here, the choice of the format.

The format is detected from the content when reading (`sniff.py`) and given by the suffix when writing (`table.py`);
`output.py` puts the written files in their places.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from lacmesh.errors import LacmeshError, LacmeshWarning, ReadError, RequestError, WriteError, listed, reading, some
from lacmesh.formats.output import check_place, replacing
from lacmesh.formats.sniff import HEAD, DetectedFormat, sniff
from lacmesh.formats.table import OF_NAME, SUFFIXES, Format, WriteOptions, format_of, takers
from lacmesh.mesh import Mesh

__all__ = ["SUFFIXES", "DetectedFormat", "detect_format", "read", "title_of", "write"]


def detect_format(path: str | os.PathLike[str]) -> DetectedFormat:
    """Detect the format of an existing file by its content, else by its suffix. Raises ReadError."""
    path = Path(path)
    with reading(path):
        if not path.is_dir() and path.exists() and not path.is_file():  # a pipe gives its content once, or waits
            raise ReadError(path, "is no regular file; save it as one first")
        with path.open("rb") as file:
            head = file.read(HEAD)
        detected = sniff(path, head)
    if detected.format == "msh":
        from lacmesh.formats.msh import header

        return DetectedFormat("msh", *header(path, head))
    return detected


def title_of(path: str | os.PathLike[str]) -> str:
    """Name of the format of an existing file, for people. Raises ReadError.

    For example "msh 4.1 binary", "MED", "VTU ASCII", "stl, by meshio".
    """
    detected = detect_format(path)
    title = OF_NAME[detected.format].title
    if detected.format == "msh":
        return f"{title} {detected.version} {'binary' if detected.binary else 'ASCII'}"
    return title if detected.binary else title + " ASCII"


def read(path: str | os.PathLike[str], *, mesh: str | None = None) -> Mesh:
    """Read the mesh in a file: msh 2.2 or 4.1, MED 2.3 to 4.2, .mail, .inp, VTU, XDMF, and the formats of meshio.

    `mesh`: name of the mesh to read from a file that holds several (MED, XDMF). Cut records that a format has no place
    for are read from the sidecar NAME.SUFFIX.lac.json; a LacmeshWarning is given if the sidecar does not belong to this
    file. Raises ReadError (RequestError for a wrong `mesh`, or if meshio is missing).

    >>> mesh = read("data/two_blocks.msh")
    >>> mesh.n_nodes, sorted(mesh.cell_groups)[:3]
    (476, ['bottom', 'lower', 'master'])
    """
    path = Path(path)
    form = OF_NAME[detect_format(path).format]
    if mesh is not None and not form.several:
        raise RequestError(f"{path} is a {form.title} file, which holds one mesh: leave out the name {mesh!r}")
    alone = form.read(path, mesh)
    if not form.sidecar:
        return alone
    from lacmesh.formats.sidecar import with_sidecar_records

    return with_sidecar_records(path, alone)


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
    lenient: bool = False,
    force: bool = True,
) -> None:
    """Write a mesh in the format given by the suffix of `path` (`lacmesh.formats.SUFFIXES`).

    `msh`: version of a msh file, 4.1 (default) or 2.2; `binary`: binary (default) or ASCII, for msh, VTU and XDMF;
    `compress`: for VTU and XDMF. XDMF has a second file beside it, .h5. For .inp: `target`, the program, calculix
    (default) or abaqus; `plane`, the elements of a plane mesh, CPS, CPE or CAX (default: `mesh.plane`, else CPS, with a
    warning); `all_cells`: write cells below the mesh's dimension as elements too, not only as surfaces and node sets.
    A mesh read from an .inp file is written to another with all its cards (`Mesh.deck`): `lenient` leaves out a line
    that cannot be carried, with a warning, instead of an error.
    If a format has no place for the records of a cut, they go to the sidecar NAME.SUFFIX.lac.json; writing a mesh
    without a cut removes such a file.
    An existing file is replaced at the end, as a whole, unless `force` is False. Raises WriteError, and RequestError,
    for example for an option that the format does not take.

    >>> from tempfile import TemporaryDirectory
    >>> triangle = Mesh.create([[0, 0], [1, 0], [0, 1]], [("TRIA3", [[0, 1, 2]])])
    >>> with TemporaryDirectory() as folder:
    ...     write(f"{folder}/triangle.med", triangle)
    ...     read(f"{folder}/triangle.med").n_cells
    1
    """
    path = Path(path)
    form = format_of(path)
    options = WriteOptions(msh, binary, compress, target, plane, all_cells, lenient)
    _check_options(form, options)
    if form.meshio:
        from lacmesh.formats.meshio_mesh import needed

        needed()
    _check_coordinates(path, mesh)
    places = [path, *_second(path, form, mesh, options)]
    for place in places:
        check_place(place, force=force)
    with replacing(*places) as files:
        if form.beside and len(files) > 1:
            options = replace(options, second=(files[1], places[1].name))
        form.write(files[0], mesh, options)
        if form.sidecar and len(files) > 1:
            back = _read_back(files[0], form, mesh)
            _write_sidecar(files[1], mesh, back)
    if mesh.deck is not None and form.name != "inp":
        from lacmesh.formats.inp import losses

        if lost := losses(mesh.deck):
            warnings.warn(LacmeshWarning(f"{lost}; an .inp output keeps them"), stacklevel=2)


def _check_options(form: Format, options: WriteOptions) -> None:
    """Raise RequestError for an option that is given and that the format does not take, and for a wrong version."""
    for option in fields(options):
        if getattr(options, option.name) != option.default and option.name not in form.options:
            titles = listed([taker.title for taker in takers(option.name)], "and")
            raise RequestError(f"the option {option.name!r} is for {titles}, not for {form.title}")
    versions = ("4.1", "2.2")
    if options.msh and options.msh not in versions:
        raise RequestError(f"msh version {options.msh!r} is not written; choose {' or '.join(versions)}")


def _check_coordinates(path: Path, mesh: Mesh) -> None:
    finite = np.isfinite(mesh.points)
    if not finite.all():
        nodes = some(mesh.node_number[~finite.all(axis=1)])
        raise WriteError(path, f"the coordinates of nodes {nodes} are not finite numbers")


def _second(path: Path, form: Format, mesh: Mesh, options: WriteOptions) -> list[Path]:
    """List with the path of the second file that has to be written or removed; empty if there is none.

    Raises WriteError if a file that lacmesh did not write stands there.
    """
    if form.beside and options.in_binary:
        from lacmesh.formats.xdmf import writer as xdmf_write

        second = path.with_suffix(form.beside)
        is_ours: Callable[[Path], bool] = xdmf_write.is_ours
    elif form.sidecar:
        from lacmesh.formats import sidecar

        second, is_ours = sidecar.place_of(path), sidecar.is_ours
        if sidecar.cut_of(mesh) is None and not is_ours(second):
            return []
    else:
        return []
    if second.is_file() and not is_ours(second):
        raise WriteError(
            second, f"{second.name} is there and lacmesh did not write it; move it, or choose another name"
        )
    return [second]


def _read_back(path: Path, form: Format, mesh: Mesh) -> Mesh | None:
    """The mesh file just written as it will be read; None, with a warning, if it cannot be, and for a mesh uncut.

    Its sidecar needs it: writers renumber, and faces of *SURFACEs get their numbers from the reader.
    """
    from lacmesh.formats.sidecar import cut_of

    if cut_of(mesh) is None:
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return form.read(path)
    except LacmeshError as error:
        _warn_of_lost_records(str(error).replace(str(path), "the file"))
        return None


def _write_sidecar(side: Path, mesh: Mesh, back: Mesh | None) -> None:
    """Write the cut records of `mesh` for its file, which reads as `back`; remove the sidecar if there is nothing."""
    from lacmesh.formats.sidecar import UnfitError, to_json

    text = None
    try:
        text = None if back is None else to_json(mesh, back)
    except UnfitError as error:
        _warn_of_lost_records(str(error))
    if text is None:
        side.unlink()
    else:
        side.write_text(text, encoding="ascii")


def _warn_of_lost_records(why: str) -> None:
    warnings.warn(LacmeshWarning(f"the records of the cut are left out: {why}"), stacklevel=4)
