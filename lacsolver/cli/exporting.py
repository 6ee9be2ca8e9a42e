"""`lacsolver export`: a case as a deck of CalculiX, or the fields of a run as MED."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from typer import Argument, Option

from lacmesh.cli.options import Force
from lacmesh.cli.program import Run
from lacmesh.errors import RequestError
from lacsolver.cli.options import folder_of, print_size
from lacsolver.cli.ranks import check_alone


def export(
    case: Annotated[str, Argument(metavar="CASE.toml|DIR", help="a case file, or the folder of a run")],
    *,
    to: Annotated[
        Literal["inp", "med"] | None,
        Option(
            "--to",
            help="inp: a case with its mesh, for CalculiX; med: mesh and fields of a run at all times, for "
            "Salome (default: inp of a case, med of a folder)",
        ),
    ] = None,
    target: Annotated[
        str | None,
        Option("--output", "-o", metavar="FILE", help="default: the case's name with .inp, or results.med in DIR"),
    ] = None,
    partial: Annotated[bool, Option(help="leave out what CalculiX has not, with a warning for each")] = False,
    force: Force = False,
    run: Run,
) -> None:
    """Write a case, or the fields of a run, for another program.

    $ lacsolver export press.toml -o job.inp
    $ lacsolver export press_fit --to med
    """
    check_alone()
    folder = Path(case).is_dir()
    if (to or ("med" if folder else "inp")) == "med":
        if partial:
            raise RequestError("--partial is for decks of CalculiX; leave it out")
        _write_fields(case, target, force=force, run=run)
    elif folder:
        raise RequestError(f"{case} is a folder; a deck is written of a case: name its CASE.toml")
    else:
        _write_deck(case, target, partial=partial, force=force, run=run)


def _write_deck(case: str, target: str | None, *, partial: bool, force: bool, run: Run) -> None:
    """Write a case as a deck, and print what CalculiX computes in another way. Raises RequestError for the name."""
    from lacsolver.case import read_case
    from lacsolver.decks import export_deck

    path = Path(target) if target else Path(case).with_suffix(".inp")
    if path.suffix.lower() != ".inp":
        raise RequestError(f"{path}: a deck is called .inp; name it so")
    run.will_write(path, force=force)
    for sentence in export_deck(read_case(case), path, partial=partial):
        level = "warning" if sentence.startswith("left out: ") else "note"
        print(f"lacsolver: {level}: {sentence}", file=sys.stderr)
    print(f"{path}: run it with ccx {path.with_suffix('')}")


def _write_fields(folder: str, target: str | None, *, force: bool, run: Run) -> None:
    """Write mesh and fields of a run's folder as MED. Raises RequestError for the name, ReadError, WriteError."""
    from lacsolver.output.med import write_med
    from lacsolver.output.names import MED
    from lacsolver.output.summary import read_summary

    of_run = folder_of(folder)
    path = Path(target) if target else of_run / MED
    if path.suffix.lower() != ".med":
        raise RequestError(f"{path}: fields are exported as .med")
    run.will_write(path, force=force)
    read_summary(of_run)
    write_med(of_run, path)
    print_size(path)
