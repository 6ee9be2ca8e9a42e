"""Arguments that commands of lacsolver share, and places of what they write."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from lacmesh.errors import ReadError, RequestError, did_you_mean

EPILOG = """\
Exit status: 0 done, 1 the data are wrong, 2 the command is wrong,
3 a file cannot be read or written, 4 did not converge, 130 interrupted,
143 terminated."""

CaseFile = Annotated[str, Argument(metavar="CASE.toml", help="the case file (lacsolver schema lists its keys)")]
NewCase = Annotated[
    str | None, Option("--output", "-o", metavar="CASE.toml", help="default: beside the input, with the suffix .toml")
]
RunFolder = Annotated[str, Argument(metavar="DIR", help="folder of a run, or its CASE.toml")]
FromTime = Annotated[float | None, Option("--from", metavar="TIME", help="take the state at this time, not the last")]
Title = Annotated[str | None, Option(metavar="TITLE", help="a line above (default: the folder's name)")]


def folder_of(name: str) -> Path:
    """Return the folder of a run that was named, itself or by its case. Raises ReadError where there is none."""
    folder = Path(name)
    folder = folder.with_suffix("") if folder.suffix == ".toml" else folder
    if not folder.exists():
        runs = [results.parent.name for results in folder.parent.glob("*/results.json")]
        raise ReadError(folder, f"a run with this folder does not exist{did_you_mean(folder.name, runs)}")
    return folder


def beside(case: str, what: str, ending: str = "") -> Path:
    """Return the default folder of what a command writes: the case's name without its suffix, and an ending."""
    path = Path(case)
    if not path.suffix:
        raise RequestError(f"{path} has no suffix to leave out for the folder of the {what}; name one with -o")
    return path.with_name(f"{path.stem}{ending}")


def case_beside(source: str, name: str | None) -> Path:
    """Return the path of a new case file: the name, or that of the input with another suffix. Raises RequestError."""
    target = Path(name) if name else Path(source).with_suffix(".toml")
    if target.suffix != ".toml":
        raise RequestError(f"{target}: a case file is called .toml; name it so")
    return target


def print_size(target: Path) -> None:
    """Print the size of a picture, film or page."""
    print(f"{target}: {target.stat().st_size / 1e6:.2f} MB")
