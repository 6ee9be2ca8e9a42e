"""PVD files: collections that name a VTU file for each time, for ParaView."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

from lacmesh.errors import ReadError
from lacmesh.formats.output import replace_file
from lacmesh.formats.vtu.writer import quoted


def read_pvd(path: Path) -> dict[float, str]:
    """Return the files of a PVD that exist, by their times; none if there is no PVD. Raises ReadError."""
    if not path.exists():
        return {}
    try:
        sets = ElementTree.parse(path).getroot().iter("DataSet")
        files = {float(s.attrib["timestep"]): s.attrib["file"] for s in sets}
    except (OSError, ValueError, KeyError, ElementTree.ParseError) as error:
        raise ReadError(path, f"cannot be gone on with ({error}); write into another folder") from error
    return {time: file for time, file in files.items() if (path.parent / file).is_file()}


def write_pvd(path: Path, files: Mapping[float, str]) -> None:
    """Write a PVD that names the file of each time. Raises WriteError."""
    sets = [f'<DataSet timestep="{t!r}" group="" part="0" file={quoted(file)}/>\n' for t, file in files.items()]
    head = '<?xml version="1.0" encoding="utf-8"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
    replace_file(path, (head + "".join(sets) + "</Collection>\n</VTKFile>\n").encode())
