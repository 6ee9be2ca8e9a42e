"""A good mesh and a command that cannot be carried out: wrong names, places that take no file, a disk that is full."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.bad_input import raw
from tests.bad_input.case import CUT, PRECIOUS, Case
from tests.bad_input.mesh_cases import WRITERS
from tests.bad_input.raw import Cell, two_hexahedra

GOOD = WRITERS["msh 4.1 binary"](two_hexahedra())
#: Suffix and options -> how the output is called in the page.
OUTPUTS = {
    "msh 2.2 ASCII": (".msh", "--msh", "2.2", "--ascii"),
    "msh 2.2 binary": (".msh", "--msh", "2.2"),
    "msh 4.1 ASCII": (".msh", "--ascii"),
    "msh 4.1 binary": (".msh",),
    "MED 4.1": (".med",),
    "mail": (".mail",),
    "inp": (".inp", "--hexa", "hexa"),
    "vtu": (".vtu",),
    "xdmf": (".xdmf",),
}


def _cut(group: str, *more: str) -> tuple[str, ...]:
    return ("cut", "{in}", "--slave", group, "-o", "{out}", "--force", *more)


def _points(folder: Path) -> None:
    mesh = two_hexahedra()
    mesh.cells = [Cell(101, "SEG2", [11, 12], "SLAVE")]
    (folder / "bad.msh").write_bytes(raw.msh41(mesh))


GROUPS: list[tuple[str, bytes | Callable[[Path], object], tuple[str, ...], int, str]] = [
    ("a tag that no group has", GOOD, _cut("77"), 2, "no cell group named '77'"),
    ("a dimension and tag that no group has", GOOD, _cut("1:2"), 2, "no cell group named '1:2'"),
    ("an entity that is not there", GOOD, _cut("entity:2:99"), 2, "no entity named 'entity:2:99'"),
    ("an entity without a tag", GOOD, _cut("entity:2"), 2, "'entity:2' is no entity; write entity:DIM:TAG"),
    ("an entity named by letters", GOOD, _cut("entity:two:x"), 2, "is no entity; write entity:DIM:TAG"),
    ("an empty name", GOOD, _cut(""), 2, "no cell group named ''"),
    ("a name in another case", GOOD, _cut("slave"), 2, "no cell group named 'slave'; did you mean SLAVE"),
    ("the same group twice", GOOD, _cut("SLAVE", "--slave", "SLAVE"), 2, "given twice"),
    ("a second group that is not there", GOOD, _cut("SLAVE", "--slave", "MASTR"), 2, "'MASTR'; did you mean MASTER"),
    ("a mesh of lines only", _points, _cut("SLAVE"), 1, "."),
    ("--mesh for a msh file", GOOD, _cut("SLAVE", "--mesh", "mesh"), 2, "holds one mesh"),
]
REQUESTS: list[tuple[str, tuple[str, ...], str]] = [
    ("no slave group", ("cut", "{in}", "-o", "{out}"), "give --slave GROUP, or --pair"),
    ("an option that nobody knows", (*CUT, "--quickly"), "unrecognized arguments: --quickly"),
    ("a variant that nobody knows", (*CUT, "--hexa", "tetra"), "--hexa: invalid choice: 'tetra'"),
    ("an order that nobody knows", ("convert", "{in}", "{out}", "--order", "7"), "--order: invalid choice: '7'"),
    ("a command that nobody knows", ("chop", "{in}"), "invalid choice: 'chop'"),
    ("the output exists", ("cut", "{in}", "--slave", "SLAVE", "-o", "{out}"), "out.msh exists already; --force"),
    ("the output is the input", ("cut", "{in}", "--slave", "SLAVE", "-o", "{in}"), "bad.msh exists already; --force"),
]


def _folder(folder: Path) -> None:
    (folder / "bad.msh").write_bytes(GOOD)
    (folder / "out.msh").mkdir()


def _device(folder: Path) -> None:
    (folder / "bad.msh").write_bytes(GOOD)
    os.mkfifo(folder / "out.msh")


def _to_device(folder: Path) -> None:
    (folder / "bad.msh").write_bytes(GOOD)
    os.mkfifo(folder / "device")
    (folder / "out.msh").symlink_to("device")


def _closed(folder: Path) -> None:
    """A folder in which nobody may write; where we own it, `nobody` does not."""
    (folder / "bad.msh").write_bytes(GOOD)
    (folder / "out.msh").write_bytes(PRECIOUS)
    folder.chmod(0o555)


def _replaced(folder: Path) -> None:
    assert (folder / "out.msh").read_bytes() != PRECIOUS


PLACES: list[tuple[str, bytes | Callable[[Path], object], str, int, str]] = [
    ("no format has the suffix", GOOD, "out.xyz", 2, "no format has the suffix '.xyz'"),
    ("there is no suffix", GOOD, "out", 2, "no format has the suffix ''"),
    ("the suffix is nearly one", GOOD, "out.mssh", 2, "no format has the suffix '.mssh'; did you mean .msh"),
    ("the folder is not there", GOOD, "no/folder/out.msh", 3, "the folder no/folder does not exist"),
    ("the folder is a file", GOOD, "bad.msh/out.msh", 3, "the folder bad.msh does not exist"),
    ("it is a folder", _folder, "out.msh", 3, "out.msh: is no file"),
    ("it is a pipe", _device, "out.msh", 3, "out.msh: is no file"),
    ("it is a link to a pipe", _to_device, "out.msh", 3, "out.msh: is no file"),
    ("the system takes no file there", GOOD, "/proc/out.msh", 3, "/proc/out.msh: cannot be written"),
    ("its name is too long", GOOD, "x" * 300 + ".msh", 3, "cannot be written .File name too long"),
]


def cases() -> Iterator[Case]:
    """Groups, requests, places, permissions, a full disk."""
    for what, make, command, status, says in GROUPS:
        yield Case("groups", "any", what, make, says, status, command)
    for what, command, says in REQUESTS:
        yield Case("request", "any", what, GOOD, says, 2, command)
    for what, make, out, status, says in PLACES:
        yield Case("output", "any", what, make, says, status, out=out)
    yield Case(
        "permission",
        "any",
        "the folder of the output takes no files",
        _closed,
        "no file may be made in the folder",
        nobody=True,
    )
    yield Case(
        "permission",
        "any",
        "the folder and the older output are another's, but open",
        GOOD,
        "",
        0,
        then=_replaced,
        nobody=True,
    )
    for name, (suffix, *options) in OUTPUTS.items():
        for size in (0, 700):
            what = f"no room at all for {name}" if not size else f"no room after {size} bytes of {name}"
            command = (*_cut("SLAVE"), *options)
            yield Case(
                "full disk", "any", what, GOOD, "cannot be written", 3, command, out="out" + suffix, file_size=size
            )
