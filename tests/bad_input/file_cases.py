"""Files that hold no mesh, or only a part of one, whatever the format."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path

import h5py

from tests.bad_input.case import INFO, Case
from tests.bad_input.mesh_cases import WRITERS
from tests.bad_input.raw import two_hexahedra

_NEITHER = "is neither .* nor"


def png() -> bytes:
    """A picture of one white pixel."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">2I5B", 1, 1, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"\0\xff")) + chunk(b"IEND", b"")


def other_hdf5() -> bytes:
    """HDF5 that has nothing to do with MED."""
    image = BytesIO()
    with h5py.File(image, "w") as file:
        file["pressure"] = [1.0, 2.0]
    return image.getvalue()


def _folder(folder: Path) -> None:
    (folder / "bad.msh").mkdir()


def _no_file(folder: Path) -> None:
    (folder / "good.msh").write_bytes(b"")


def _link(folder: Path) -> None:
    (folder / "bad.msh").symlink_to("nowhere.msh")


def _circle(folder: Path) -> None:
    (folder / "bad.msh").symlink_to("bad.msh")


def _pipe(folder: Path) -> None:
    os.mkfifo(folder / "bad.msh")


def _secret(folder: Path) -> None:
    (folder / "bad.msh").write_bytes(WRITERS["msh 4.1 ASCII"](two_hexahedra()))
    (folder / "bad.msh").chmod(0)


NOT_A_MESH: list[tuple[str, bytes | Callable[[Path], object], str]] = [
    ("a picture (PNG)", png(), _NEITHER),
    ("text", b"Dear all,\nthe mesh is in the annex.\n", _NEITHER),
    ("a page (HTML)", b"<!DOCTYPE html>\n<html><body>404 not found</body></html>\n", _NEITHER),
    ("XML that is no mesh", b'<?xml version="1.0"?>\n<note>no mesh</note>\n', _NEITHER),
    ("numbers separated by blanks", b"0 0 0\n1 0 0\n" * 40, _NEITHER),
    ("zeros", b"\0" * 4096, _NEITHER),
    ("UTF-16", "$MeshFormat\n4.1 0 8\n".encode("utf-16"), _NEITHER),
    ("gzip", b"\x1f\x8b\x08\x00" + bytes(range(200)), "is a file packed by gzip"),
    ("CAD (STEP)", b"ISO-10303-21;\nHEADER;\nENDSEC;\n", "is a STEP file, which is geometry"),
    ("HDF5 without MED", other_hdf5(), "is an HDF5 file, but not MED"),
    ("empty", b"", "is empty"),
    ("blanks and line ends", b"  \n\r\n\t\n" * 10, "is empty"),
    ("a folder", _folder, "cannot be read .*directory"),
    ("missing", _no_file, "cannot be read .*No such file"),
    ("a link to nothing", _link, "cannot be read .*No such file"),
    ("a link to itself", _circle, "cannot be read .*symbolic links"),
    ("a pipe", _pipe, "no regular file"),
]

#: Where a file is cut short, as parts of its length.
PARTS = (0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98)


def cases() -> Iterator[Case]:
    """Files that are no meshes, then files that are cut short or begin otherwise, for each format."""
    for what, make, says in NOT_A_MESH:
        yield Case("not a mesh", "any", what, make, says)
    for suffix in (".med", ".mail", ".inp", ".vtu", ".xdmf"):
        for what, content in (("text", b"Dear all,\nthe mesh is in the annex.\n"), ("a picture (PNG)", png())):
            what, says = f"{what} in a file named {suffix}", _NAMED.get(suffix, _NEITHER)
            yield Case("not a mesh", "any", what, content, says, file=f"bad{suffix}")
    yield Case("permission", "any", "the input may not be read", _secret, "Permission denied", nobody=True)
    for name, writer in WRITERS.items():
        content = writer(two_hexahedra())
        for part in PARTS:
            whole = content[: int(part * len(content))]
            status, says = _IN_TWO.get((name, part), (3, _SHORT[name.split()[0]]))
            yield Case("cut short", name, f"after {part:.0%} of the file", whole, says, status)
        yield Case("cut short", name, "the last 4 bytes are missing", content[:-4], _SHORT[name.split()[0]])
    for name in WRITERS:
        content = WRITERS[name](two_hexahedra())
        begin = content.index(b"\n") + 1 if name.startswith("msh") else 8
        for what, spoilt in (
            ("zeros before the file", b"\0" * 16 + content),
            ("without its beginning", content[begin:]),
        ):
            status, says = _MAGIC.get(name, (3, _NEITHER))
            yield Case("magic", name, what, spoilt, says, status, INFO)


_SHORT = {
    "msh": "too early|has no|should (end|stand|say) here|should hold|should begin|byte order mark",
    "MED": r"it is cut short: \d+ of its \d+ bytes",
    "mail": "FINSF after it: the file may be cut off|without FIN: it may be cut off",
    "inp": "there is no .NODE|and should have",
    "vtu": "is no sound XML|is XML, but neither VTU",
    "xdmf": "is no sound XML",
}
#: .inp has no end: cut between two lines, it is a shorter file.
_IN_TWO = {
    **{("inp", part): (2, "no cell group named 'SLAVE'") for part in (0.1, 0.25, 0.5, 0.75)},
    ("inp", 0.9): (0, ""),
}
_MAGIC = {
    "mail": (3, "is no keyword of a .mail file"),
    "inp": (0, "the text before the first keyword line is no card"),
}
_NAMED = {".mail": "is no keyword of a .mail file", ".inp": "holds no keyword line"}
