"""Writers of all formats under one signature: the new files, the mesh, the options of `lacmesh.formats.write`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import NamedTuple, Protocol

from lacmesh.errors import RequestError, listed
from lacmesh.formats.table import Format, takers
from lacmesh.mesh import Mesh

_MSH_VERSIONS = ("4.1", "2.2")


class NewFile(NamedTuple):
    """A file to be filled at `path`, which will take its `place` when all files are complete."""

    path: Path
    place: Path


@dataclass(frozen=True)
class WriteOptions:
    """Options of `lacmesh.formats.write`, as given there; each is for some formats only (`Format.options`)."""

    msh: str | None = None
    binary: bool | None = None
    compress: bool = False
    target: str | None = None
    plane: str | None = None
    all_cells: bool = False
    lenient: bool = False

    @property
    def in_binary(self) -> bool:
        """True if a format that has both forms is written as binary, which is the default."""
        return self.binary is None or self.binary


class FormatWriter(Protocol):
    """Writes a mesh to new files; the first is the mesh file, a second one holds its arrays (XDMF)."""

    def __call__(self, files: Sequence[NewFile], mesh: Mesh, options: WriteOptions) -> None:
        """Fill the files. Raises WriteError, RequestError."""


def check_options(form: Format, options: WriteOptions) -> None:
    """Raise RequestError for an option that is given and that the format does not take, and for a wrong version."""
    for option in fields(options):
        if getattr(options, option.name) != option.default and option.name not in form.options:
            titles = listed([taker.title for taker in takers(option.name)], "and")
            raise RequestError(f"the option {option.name!r} is for {titles}, not for {form.title}")
    if options.msh and options.msh not in _MSH_VERSIONS:
        raise RequestError(f"msh version {options.msh!r} is not written; choose {' or '.join(_MSH_VERSIONS)}")


def writer_of(form: Format) -> FormatWriter:
    """Return the writer of a format. Raises RequestError if it is one of meshio's and meshio is missing."""
    return _meshio_writer(form.name) if form.meshio else _WRITERS[form.name]


def _write_msh(files: Sequence[NewFile], mesh: Mesh, options: WriteOptions) -> None:
    from lacmesh.formats import msh

    msh.write(files[0].path, mesh, version=options.msh or _MSH_VERSIONS[0], binary=options.in_binary)


def _write_med(files: Sequence[NewFile], mesh: Mesh, options: WriteOptions) -> None:
    from lacmesh.formats import med

    med.write(files[0].path, mesh)


def _write_mail(files: Sequence[NewFile], mesh: Mesh, options: WriteOptions) -> None:
    from lacmesh.formats import mail

    mail.write(files[0].path, mesh)


def _write_inp(files: Sequence[NewFile], mesh: Mesh, options: WriteOptions) -> None:
    from lacmesh.formats import inp

    target, plane, all_cells, lenient = options.target, options.plane, options.all_cells, options.lenient
    inp.write(files[0].path, mesh, target=target, plane=plane, all_cells=all_cells, lenient=lenient)


def _write_vtu(files: Sequence[NewFile], mesh: Mesh, options: WriteOptions) -> None:
    from lacmesh.formats import vtu

    vtu.write(files[0].path, mesh, binary=options.in_binary, compress=options.compress)


def _write_xdmf(files: Sequence[NewFile], mesh: Mesh, options: WriteOptions) -> None:
    from lacmesh.formats import xdmf

    heavy, link = (files[1].path, files[1].place.name) if options.in_binary else (None, "")
    xdmf.write(files[0].path, mesh, heavy=heavy, link=link, compress=options.compress)


_WRITERS: dict[str, FormatWriter] = {
    "msh": _write_msh,
    "med": _write_med,
    "mail": _write_mail,
    "inp": _write_inp,
    "vtu": _write_vtu,
    "xdmf": _write_xdmf,
}


def _meshio_writer(name: str) -> FormatWriter:
    from lacmesh.formats import by_meshio
    from lacmesh.formats.meshio_mesh import needed

    needed()

    def write_by_meshio(files: Sequence[NewFile], mesh: Mesh, options: WriteOptions) -> None:
        by_meshio.write(files[0].path, mesh, name)

    return write_by_meshio
