"""Table of formats: the name, the suffixes and the writer's options of each.

`lacmesh/formats/NAME.py` reads and writes a format; formats that meshio reads and writes share one module.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from lacmesh.errors import RequestError, did_you_mean

#: suffix -> meshio's name of the format: all that meshio knows, but for our own, for by_meshio.NOT_TAKEN, and for
#: permas's .post.gz and .dato.gz, which meshio neither packs nor unpacks
OF_MESHIO = {
    ".f3grid": "flac3d",
    ".mdpa": "mdpa",
    ".ply": "ply",
    ".stl": "stl",
    ".vtk": "vtk",
    ".h5m": "h5m",
    ".avs": "avsucd",
    ".xml": "dolfin-xml",
    ".e": "exodus",
    ".exo": "exodus",
    ".ex2": "exodus",
    ".hmf": "hmf",
    ".mesh": "medit",
    ".meshb": "medit",
    ".bdf": "nastran",
    ".fem": "nastran",
    ".nas": "nastran",
    ".vol": "netgen",
    ".vol.gz": "netgen",
    ".obj": "obj",
    ".off": "off",
    ".post": "permas",
    ".dato": "permas",
    ".su2": "su2",
    ".dat": "tecplot",
    ".tec": "tecplot",
}


class Format(NamedTuple):
    """A format: its `name`, its `title` for people, its suffixes (the first is the usual one).

    `options`: what `lacmesh.formats.write` takes for it. `beside`: the suffix of a second file beside the first.
    `sidecar`: the records of a cut go to a file beside it (`sidecar.py`) where it does not keep them itself.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]
    options: tuple[str, ...] = ()
    beside: str = ""
    meshio: bool = False
    sidecar: bool = False


OWN = (
    Format("msh", "msh", (".msh",), ("msh", "binary")),
    Format("med", "MED", (".med", ".rmed", ".mmed")),
    Format("mail", "code_aster .mail", (".mail",), sidecar=True),
    Format("inp", ".inp of CalculiX and Abaqus", (".inp",), ("target", "plane", "all_cells", "lenient"), sidecar=True),
    Format("vtu", "VTU", (".vtu",), ("binary", "compress")),
    Format("xdmf", "XDMF", (".xdmf", ".xmf"), ("binary", "compress"), beside=".h5"),
)


def _of_meshio() -> tuple[Format, ...]:
    suffixes: dict[str, list[str]] = {}
    for suffix, name in OF_MESHIO.items():
        suffixes.setdefault(name, []).append(suffix)
    return tuple(
        Format(name, f"{name}, by meshio", tuple(found), meshio=True, sidecar=True) for name, found in suffixes.items()
    )


def takers(option: str) -> list[Format]:
    """The formats that take an option.

    >>> [form.title for form in takers("compress")]
    ['VTU', 'XDMF']
    """
    return [form for form in OWN if option in form.options]


FORMATS = (*OWN, *_of_meshio())
OF_NAME = {found.name: found for found in FORMATS}
#: suffix -> name of the format
SUFFIXES = {suffix: found.name for found in FORMATS for suffix in found.suffixes}


def suffix_of(path: Path) -> str:
    """Suffix of a path that selects a format, double ones such as `.vol.gz` included; else its last."""
    double = "".join(path.suffixes[-2:]).lower()
    return double if double in OF_MESHIO else path.suffix.lower()


def format_of(path: Path) -> Format:
    """Format that the suffix of `path` selects. Raises RequestError."""
    suffix = suffix_of(path)
    if suffix not in SUFFIXES:
        raise RequestError(f"{path}: no format has the suffix {suffix!r}{did_you_mean(suffix, SUFFIXES)}")
    return OF_NAME[SUFFIXES[suffix]]
