"""`lacsolver plot`, `film` and `report`: what is made of a finished run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from typer import Option

from lacmesh.cli.options import Direction, Force
from lacmesh.cli.program import Run
from lacmesh.errors import RequestError
from lacsolver.cli.options import RunFolder, Title, folder_of, print_size
from lacsolver.cli.ranks import check_alone


def plot(
    folder: RunFolder,
    *,
    field: Annotated[
        str | None,
        Option(
            metavar="FIELD",
            help="pressure (default), recovered, gap, status; with friction also slip, shear, path, use",
        ),
    ] = None,
    zone: Annotated[
        list[str] | None, Option(metavar="NAME", help="only this contact or tie; may be repeated")
    ] = None,
    time: Annotated[
        float | None, Option(metavar="T", help="a time of which fields were written (default: the last)")
    ] = None,
    zoom: Annotated[bool, Option(help="show only the surroundings of what is under pressure")] = False,
    ring: Annotated[bool, Option(help="draw the whole ring of a sector ([[cyclic]])")] = False,
    history: Annotated[
        list[str] | None,
        Option(metavar="[COLUMN ...]", help="in place of the contact: columns of history.csv over time, or patterns "
               "such as 'energy.*' (default: all energies, or all reactions)"),
    ] = None,
    target: Annotated[
        str | None, Option("--output", "-o", metavar="FILE.png", help="default: in DIR, named like the field")
    ] = None,
    title: Title = None,
    force: Force = False,
    run: Run,
) -> None:  # fmt: skip
    """Draw the contact of a run, or columns of its history.csv over time.

    $ lacsolver plot press_fit --field gap --zoom
    $ lacsolver plot press_fit --history 'energy.*' -o energies.png
    """
    check_alone()
    of_run = folder_of(folder)
    of_contact = {"field": field, "zone": zone, "time": time is not None, "zoom": zoom, "ring": ring}
    if history is not None and any(of_contact.values()):
        option = next(name for name, value in of_contact.items() if value)
        raise RequestError(f"--{option} is for a picture of the contact, and --history draws columns over time")
    name = "history" if history is not None else field or "pressure"
    path = Path(target) if target else of_run / f"{name}.png"
    run.will_write(path, force=force)
    if history is not None:
        from lacsolver.pictures.history import plot_history

        plot_history(of_run, path, [column for column in history if column], title=title)
    else:
        from lacsolver.pictures.drawing import plot as plot_contact

        title = title or of_run.resolve().name
        plot_contact(of_run, path, field=name, zone=zone or [], time=time, zoom=zoom, ring=ring, title=title)
    print_size(path)


def film(
    folder: RunFolder,
    *,
    target: Annotated[str, Option("--output", "-o", metavar="FILE", help="film (.gif) or sheet of pictures (.png)")],
    colour: Annotated[
        Literal["stress", "pressure", "recovered", "gap", "status", "slip", "shear", "path", "use"],
        Option("--colour", "--field", help="stress (von Mises) of bodies, pressure of slaves, or a field of contacts"),
    ] = "stress",
    mode: Annotated[
        int | None, Option(metavar="N", help="film the natural mode N of a folder that lacsolver modes wrote")
    ] = None,
    curve: Annotated[
        list[str] | None,
        Option(metavar="X:Y", help="two columns of history.csv; - before a column changes its sign; may be repeated "
               "(default: the reaction that varies most, against the displacement of its probe, or time)"),
    ] = None,
    frames: Annotated[
        int | None, Option(metavar="N", help="most times shown (default: 60 in a film, 24 of a mode, 6 on a sheet)")
    ] = None,
    scale: Annotated[
        tuple[float, float] | None, Option(metavar="LOW HIGH", help="ends of the colour scale")
    ] = None,
    log: Annotated[bool, Option(help="a logarithmic colour scale")] = False,
    camera: Annotated[Direction, Option(metavar="X Y Z", help="in 3D: direction to the eye")] = None,
    rate: Annotated[float, Option(metavar="N", help="frames per second")] = 12.0,
    title: Title = None,
    force: Force = False,
    run: Run,
) -> None:  # fmt: skip
    """Make a film of a run or a natural mode, or a sheet of pictures, with curves of a run's history.

    $ lacsolver film snap_fit -o snap_fit.gif
    $ lacsolver film press_modes --mode 7 -o mode.png
    """
    from lacsolver.pictures.filming import CAMERA, check_film
    from lacsolver.pictures.filming import film as make_film

    check_alone()
    of_run, path = folder_of(folder), Path(target)
    check_film(path, of_run)
    run.will_write(path, force=force)
    options: dict[str, Any] = {"scale": scale, "log": log, "rate": rate, "title": title, "mode": mode}
    make_film(of_run, path, colour=colour, curves=curve or [], frames=frames, camera=camera or CAMERA, **options)
    print_size(path)


def report(
    folder: RunFolder,
    *,
    target: Annotated[
        str | None, Option("--output", "-o", metavar="FILE", help=".html or .md (default: report.html in the folder)")
    ] = None,
    case: Annotated[
        str | None, Option(metavar="CASE.toml", help="the case to show (default: the one beside the folder)")
    ] = None,
    force: Force = False,
    run: Run,
) -> None:
    """Write a report on a run: pictures, curves, tables, the case; and beside it a page with the turning model.

    $ lacsolver report press_fit
    $ lacsolver report press_fit --case press_fit.toml -o press_fit.html
    """
    from lacsolver.reporting import check_report, model_page, write_run_report

    check_alone()
    of_run = folder_of(folder)
    path = Path(target) if target else of_run / "report.html"
    check_report(path)
    for place in (path, model_page(path)):
        run.will_write(place, force=force)
    write_run_report(of_run, path, case=case)
    print_size(path)
