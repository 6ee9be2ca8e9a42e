"""`lacsolver run`: solve a case and write its results."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lacmesh.errors import RequestError
from lacsolver.cli.options import add_case, add_command, beside
from lacsolver.cli.ranks import Ranks, all_ranks, check_alone

if TYPE_CHECKING:
    from lacmesh.mesh import Mesh
    from lacsolver.case import Case
    from lacsolver.cli.watch import Watch
    from lacsolver.distributed.share import Distribution
    from lacsolver.output import OutputFolder
    from lacsolver.results.results import Restart, Results


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands, "run", run, "solve a case, and write fields, tables and summary values into a folder"
    )
    add_case(parser)
    parser.add_argument(
        "-o",
        "--output",
        metavar="DIR",
        help="folder of the results (default: next to the case, named like it without suffix)",
    )
    parser.add_argument("--force", action="store_true", help="replace the results in the folder")
    parser.add_argument("--restart", metavar="DIR", help="continue from the last state of an earlier run in DIR")
    parser.add_argument(
        "--from",
        dest="from_time",
        type=float,
        metavar="TIME",
        help="with --restart: continue from the state at this time",
    )
    parser.add_argument("--plot", metavar="FILE.png", help="draw the contact pressure on the deformed bodies")
    parser.add_argument(
        "--report",
        metavar="FILE.html",
        help="write a page on the run: its model, which turns, pictures, curves, the case",
    )
    parser.add_argument("--zoom", action="store_true", help="with --plot: show only the surroundings of the contact")


def run(args: argparse.Namespace) -> None:
    """Solve a case. Raises NotConvergedError after the results so far have been written."""
    with all_ranks(args) as ranks:
        _run(args, ranks)


def _run(args: argparse.Namespace, ranks: Ranks) -> None:
    from lacsolver.case import read_case
    from lacsolver.output import create_output, read_state
    from lacsolver.problem.problem import read_mesh

    if args.from_time is not None and args.restart is None:
        raise RequestError("--from says where in the folder of --restart to begin; give both")
    if args.zoom and args.plot is None:
        raise RequestError("--zoom says what the picture of --plot shows; give both")
    case = read_case(args.case)
    if case.solver.engine_for(ranks.n) == "serial":
        check_alone()
    if ranks.n > 1 and case.solver.threads is None:
        case = replace(case, solver=replace(case.solver, threads=1))
    distribution, mesh, start = _distribution(case, ranks.n), None, None
    if args.restart is not None:
        mesh = read_mesh(case, distribution)
        start = ranks.on_first(lambda: read_state(args.restart, case, args.from_time, mesh=mesh, large=ranks.n == 1))
    output = args.output or beside(Path(args.case), "results")
    folder = ranks.on_first(lambda: create_output(output, force=args.force, restart=start))
    if args.plot is not None:
        ranks.on_first(lambda: _check_plot(case, args))
    if args.report is not None:
        ranks.on_first(lambda: _check_report(args))
    results = _solve(case, mesh, folder, start, args, distribution)
    if not args.quiet:
        from lacsolver.cli.summary import print_summary

        print_summary(results, folder.path, case.output.format, axisymmetric=case.model == "axisymmetric")
    if args.plot is not None and ranks.rank == 0:
        _plot(folder, args)
    if args.report is not None and ranks.rank == 0:
        _report(folder, args)


def _solve(
    case: Case, mesh: Mesh | None, folder: OutputFolder, start: Restart | None, args: argparse.Namespace,
    distribution: Distribution,
) -> Results:  # fmt: skip
    from lacsolver.cli.watch import Watch
    from lacsolver.equilibrium.stepping import NotConvergedError
    from lacsolver.running import run as solve

    watch = Watch(case, quiet=args.quiet)
    args.left = lambda: left(watch, folder, start)
    try:
        with watch:
            return solve(
                case,
                folder,
                mesh=mesh,
                start=start,
                progress=watch.iterated,
                stepped=watch.stepped,
                distribution=distribution,
            )
    except NotConvergedError as error:
        tried = f"the last state tried is in {folder.path / 'unconverged'}"
        raise NotConvergedError(f"{error} ({left(watch, folder, start)}; {tried})", error.state) from None


def _distribution(case: Case, n_ranks: int) -> Distribution:
    """Return the processes that share the model: those of MPI for the engine petsc, else this one alone."""
    from lacsolver.distributed.share import UNDIVIDED

    if case.solver.engine_for(n_ranks) == "serial":
        return UNDIVIDED
    from lacsolver.distributed.launch import import_mpi, import_petsc
    from lacsolver.distributed.processes import Processes

    import_petsc()
    return Processes(import_mpi().COMM_WORLD)


def left(watch: Watch, folder: OutputFolder, start: Restart | None) -> str:
    """Describe the results that a stopped run leaves behind, and the option to continue it."""
    if watch.time is None:
        again = f"; --restart {start.folder} goes on from t = {start.time:.9g} again" if start else ""
        return f"no step has converged{again}"
    return f"what converged up to t = {watch.time:.9g} is in {folder.path}; --restart {folder.path} goes on from there"


def _check_plot(case: Case, args: argparse.Namespace) -> None:
    """Raise an error before the run for anything that would stop the drawing at its end."""
    from lacmesh.formats.output import check_place
    from lacsolver.pictures.drawing import check_plot_of

    target = Path(args.plot)
    check_plot_of(case, target)
    check_place(target, force=args.force)


def _check_report(args: argparse.Namespace) -> None:
    from lacmesh.formats.output import check_place
    from lacsolver.reporting.outline import check_report

    check_report(Path(args.report))
    check_place(Path(args.report), force=args.force)


def _report(folder: OutputFolder, args: argparse.Namespace) -> None:
    from lacsolver.reporting.outline import write_run_report

    write_run_report(folder.path, args.report, case=args.case)
    if not args.quiet:
        print(f"the report: {args.report}")


def _plot(folder: OutputFolder, args: argparse.Namespace) -> None:
    from lacsolver.pictures.drawing import plot

    time = plot(folder.path, args.plot, zoom=args.zoom, title=folder.path.resolve().name)
    if not args.quiet:
        print(f"the pressure at t = {time:.9g}: {args.plot}")
