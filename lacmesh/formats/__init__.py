"""File formats: a module for each, with `read(path) -> Mesh` and `write(path, mesh)`; here, the choice of the format.

The format is detected from the content when reading and given by the suffix when writing (`registry.py`); `output.py`
puts the written files in their places.
"""

from __future__ import annotations

import os
import warnings
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from lacmesh.errors import LacmeshWarning, ReadError, RequestError, WriteError, listed, reading, some
from lacmesh.formats.output import check_place, replacing
from lacmesh.formats.registry import HEAD, OF_NAME, SUFFIXES, DetectedFormat, format_of, sniff, takers
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

    `mesh`: name of the mesh to read from a file that holds several (MED, XDMF). Raises ReadError (RequestError for a
    wrong `mesh`, or if meshio is missing).

    >>> mesh = read("data/two_blocks.msh")
    >>> mesh.n_nodes, sorted(mesh.cell_groups)[:3]
    (476, ['bottom', 'lower', 'master'])
    """
    path = Path(path)
    form = OF_NAME[detect_format(path).format]
    if mesh is not None and not form.several:
        raise RequestError(f"{path} is a {form.title} file, which holds one mesh: leave out the name {mesh!r}")
    return form.read(path, mesh)


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
    options: dict[str, Any] = {"msh": msh, "binary": binary, "compress": compress or None, "target": target}
    options |= {"plane": plane, "all_cells": all_cells or None, "lenient": lenient or None}
    options = {name: value for name, value in options.items() if value is not None}
    for name in options:
        if name not in form.options:
            titles = listed([taker.title for taker in takers(name)], "and")
            raise RequestError(f"the option {name!r} is for {titles}, not for {form.title}")
    if form.meshio:
        import_module("lacmesh.formats.by_meshio").needed()
    if len(bad := mesh.node_number[~np.isfinite(mesh.points).all(axis=1)]):
        raise WriteError(path, f"the coordinates of nodes {some(bad)} are not finite numbers")
    places = [path, *([path.with_suffix(form.beside)] if form.beside and binary is not False else [])]
    for place in places:
        if place != path and place.is_file() and not import_module(form.module).is_ours(place):
            message = f"{place.name} is there and lacmesh did not write it; move it, or choose another name"
            raise WriteError(place, message)
        check_place(place, force=force)
    if mesh.deck is not None and form.name != "inp":
        if lost := import_module("lacmesh.formats.inp").losses(mesh.deck):
            warnings.warn(LacmeshWarning(f"{lost}; an .inp output keeps them"), stacklevel=2)
        cell_data = {name: values for name, values in mesh.cell_data.items() if name != "inp_card"}
        mesh = replace(mesh, deck=None, cell_data=cell_data)
    with replacing(*places) as files:
        if len(files) > 1:
            options["second"] = files[1], places[1].name
        form.write(files[0], mesh, **options)
