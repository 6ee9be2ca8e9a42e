"""`lacsolver run`, `modes` and `matrices`: what is computed from a case."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from typer import Option

from lacmesh.cli.options import Force
from lacmesh.cli.program import Run
from lacmesh.cli.terminal import Stages, print_table, show_log
from lacmesh.errors import RequestError, did_you_mean
from lacsolver.cli.options import CaseFile, FromTime, beside
from lacsolver.cli.ranks import all_ranks, check_alone

if TYPE_CHECKING:
    from lacsolver.case import Case
    from lacsolver.distributed.share import Distribution
    from lacsolver.output import OutputFolder
    from lacsolver.problem.problem import Problem
    from lacsolver.results.modes import NaturalModes
    from lacsolver.results.results import Restart
    from lacsolver.watch import Watch


def run_command(
    case: CaseFile,
    *,
    target: Annotated[
        str | None, Option("--output", "-o", metavar="DIR", help="default: beside the case, named like it")
    ] = None,
    restart: Annotated[str | None, Option(metavar="DIR", help="continue from the last state of a run in DIR")] = None,
    from_time: FromTime = None,
    plot: Annotated[
        str | None, Option(metavar="FILE.png", help="draw the contact pressure on the deformed bodies")
    ] = None,
    zoom: Annotated[bool, Option(help="with --plot: show only the surroundings of the contact")] = False,
    report: Annotated[
        str | None, Option(metavar="FILE.html", help="write a report: pictures, curves, tables, the case")
    ] = None,
    force: Force = False,
    run: Run,
) -> None:
    """Solve a case, and write fields, tables and summary values into a folder.

    $ lacsolver run press_fit.toml --plot pressure.png
    $ lacsolver run press_fit.toml --restart press_fit -o longer
    """
    with all_ranks(run) as ranks:  # before numpy is loaded
        from lacsolver.output import create_output, read_state
        from lacsolver.problem.problem import read_mesh
        from lacsolver.running import run as solve

        if from_time is not None and restart is None:
            raise RequestError("--from chooses a state in the folder of --restart; give both")
        if zoom and plot is None:
            raise RequestError("--zoom is an option of the picture of --plot; give both")
        record, distribution = _case(case, ranks.n)
        mesh = start = None
        if restart is not None:
            mesh = read_mesh(record, distribution)
            start = ranks.on_first(lambda: read_state(restart, record, from_time, mesh=mesh, large=ranks.n == 1))
        place = target or beside(case, "results")
        folder = ranks.on_first(lambda: create_output(place, force=force, restart=start))
        ranks.on_first(lambda: _check_pages(record, plot, report, force=force))
        with _watched(record, folder, start, run) as watch:
            options: dict[str, Any] = {"progress": watch.iterated, "stepped": watch.stepped}
            results = solve(record, folder, mesh=mesh, start=start, distribution=distribution, **options)
        if not run.quiet:
            from lacsolver.cli.summary import print_summary

            print_summary(results, folder.path, record.output.format, axisymmetric=record.model == "axisymmetric")
        if ranks.rank == 0:
            _write_pages(case, folder.path, plot, report, zoom=zoom)


def _case(path: str, n_ranks: int) -> tuple[Case, Distribution]:
    """Read a case; return it with the processes that share the model: those of MPI, or this one alone."""
    from lacsolver.case import read_case
    from lacsolver.distributed.share import UNDIVIDED

    case = read_case(path)
    if case.solver.engine_for(n_ranks) == "serial":
        check_alone()
        return case, UNDIVIDED
    if n_ranks > 1 and case.solver.threads is None:
        case = replace(case, solver=replace(case.solver, threads=1))
    from lacsolver.distributed.launch import import_mpi, import_petsc
    from lacsolver.distributed.processes import Processes

    import_petsc()
    return case, Processes(import_mpi().COMM_WORLD)


@contextmanager
def _watched(case: Case, folder: OutputFolder, start: Restart | None, run: Run) -> Iterator[Watch]:
    """Show a run while it is solved; if it stops, say what it leaves behind and how to continue it."""
    from lacsolver.equilibrium.stepping import NotConvergedError
    from lacsolver.watch import Watch

    watch = Watch(case, "stdout", quiet=run.quiet)
    if not run.quiet:
        show_log(watch.log)

    def left() -> str:
        if watch.time is None:
            again = f"; --restart {start.folder} goes on from t = {start.time:.9g} again" if start else ""
            return f"no step has converged{again}"
        done = f"what converged up to t = {watch.time:.9g} is in {folder.path}"
        return f"{done}; --restart {folder.path} goes on from there"

    run.left = left
    try:
        with watch:
            yield watch
    except NotConvergedError as error:
        tried = f"the last state tried is in {folder.path / 'unconverged'}"
        raise NotConvergedError(f"{error} ({left()}; {tried})", error.state) from None


def _check_pages(case: Case, plot: str | None, report: str | None, *, force: bool) -> None:
    """Raise an error before the run for anything that would stop a picture or a page at its end."""
    from lacmesh.formats.output import check_place

    if plot is not None:
        from lacsolver.pictures.drawing import check_plot_of

        check_plot_of(case, Path(plot))
        check_place(Path(plot), force=force)
    if report is not None:
        from lacsolver.reporting import check_report

        check_report(Path(report))
        check_place(Path(report), force=force)


def _write_pages(case: str, folder: Path, plot: str | None, report: str | None, *, zoom: bool) -> None:
    """Draw the picture of a finished run, and write its page."""
    if plot is not None:
        from lacsolver.pictures.drawing import plot as draw

        time = draw(folder, plot, zoom=zoom, title=folder.resolve().name)
        print(f"the pressure at t = {time:.9g}: {plot}")
    if report is not None:
        from lacsolver.reporting import write_run_report

        write_run_report(folder, report, case=case)
        print(f"the report: {report}")


def modes(
    case: CaseFile,
    *,
    count: Annotated[
        int, Option("--count", "-k", metavar="N", help="how many modes, the lowest ones, beside rigid-body modes")
    ] = 10,
    target: Annotated[
        str | None, Option("--output", "-o", metavar="DIR", help="default: press_modes beside press.toml")
    ] = None,
    state: Annotated[
        str | None,
        Option(metavar="DIR", help="vibrate about the last state of a run in DIR: its closed macro-elements stay "
               "closed (default: the undeformed bodies, contacts open)"),
    ] = None,
    from_time: FromTime = None,
    mass: Annotated[Literal["consistent", "lumped"], Option(help="mass matrix, or lumped on its diagonal")] = (
        "consistent"
    ),
    force: Force = False,
    run: Run,
) -> None:  # fmt: skip
    """Find natural frequencies and mode shapes of a case, with its contacts open or closed.

    $ lacsolver modes press_fit.toml -k 6
    $ lacsolver modes press_fit.toml --state press_fit --from 0.5
    """
    from lacsolver.case import read_case
    from lacsolver.output import read_state
    from lacsolver.output.modes import check_modes_folder, write_modes
    from lacsolver.problem.problem import Problem, read_mesh
    from lacsolver.vibration.natural_modes import natural_modes

    check_alone()
    if from_time is not None and state is None:
        raise RequestError("--from chooses a state in the folder of --state; give both")
    if count < 1:
        raise RequestError(f"-k is the number of modes to find, 1 or more, not {count}")
    folder = check_modes_folder(target or beside(case, "modes", "_modes"), force=force)
    record = read_case(case)
    stage = Stages(run)
    with stage("mesh"):
        mesh = read_mesh(record)
        at = None if state is None else read_state(state, record, from_time, mesh=mesh)
        problem = Problem.of(record, mesh)
    with stage("modes"):
        natural = natural_modes(problem, count=count, at=at, mass=mass)
    with stage("write"):
        write_modes(folder, natural, problem.space)
    names = ("mode", "frequency", "period", *(f"mass {axis}" for axis in natural.axes))
    print_table([f"+{name}" for name in names], _mode_rows(natural))
    for name, value in _mode_figures(natural, problem, at):
        print(f"{name}: {value}")
    print(f"results: {folder} (modes.json, modes.pvd for ParaView)")
    print(f"{case}: {stage.spent()}")


def _mode_rows(modes: NaturalModes) -> Iterator[tuple[str, ...]]:
    """Yield rows of the modes: rigid ones, then the others with effective masses as parts of the whole mass."""
    rigid = len(modes.rigid)
    yield from ((str(number), "0", "", *("" for _ in modes.axes)) for number in range(1, rigid + 1))
    if rigid:
        yield ()
    for k, frequency in enumerate(modes.frequencies):
        parts = (f"{part:.2%}" for part in modes.effective_masses[k] / modes.mass)
        yield str(rigid + k + 1), f"{frequency:.6g}", f"{1 / frequency:.4g}", *parts


def _mode_figures(modes: NaturalModes, problem: Problem, state: Restart | None) -> Iterator[tuple[str, str]]:
    for number, words in enumerate(modes.rigid, 1):
        yield f"mode {number}, rigid", words
    fractions = (modes.effective_masses.sum(axis=0) + modes.rigid_masses) / modes.mass
    parts = ", ".join(f"{part:.2%} along {axis}" for axis, part in zip(modes.axes, fractions, strict=True))
    yield "mass", f"{modes.mass:.6g}; effective in all of these modes: {parts}"
    if modes.sectors:
        yield "nodal diameters", f"0: all {modes.sectors} sectors of the ring move alike in these modes"
    if problem.joints:
        about = "of the undeformed bodies" if state is None else f"at t = {state.time:.9g}"
        closed = ", ".join(f"{name} {count:,}" for name, count in modes.held.items())
        yield "closed rows", f"{closed} ({about})"


def matrices(
    case: CaseFile,
    *,
    target: Annotated[
        str, Option("--output", "-o", metavar="FILE.npz", help="with several contacts one FILE-NAME.npz for each")
    ],
    mtx: Annotated[bool, Option(help="also write B in Matrix Market format")] = False,
    force: Force = False,
    run: Run,
) -> None:
    """Write the contact matrices of a case, for another solver; no material or load is needed.

    $ lacsolver matrices press_fit.toml -o contact.npz
    $ lacsolver matrices press_fit.toml -o contact.npz --mtx
    """
    from lacmesh.cutting.records import is_cut
    from lacsolver.case import check_groups, read_case
    from lacsolver.matrices import contact_matrices, write_matrices
    from lacsolver.problem.roles import with_roles
    from lacsolver.problem.skin import mesh_of

    check_alone()
    output = Path(target)
    if output.suffix.lower() != ".npz":
        raise RequestError(f"{output}: matrices are written as .npz{did_you_mean(output.suffix, ['.npz'])}")
    record = read_case(case, matrices=True)
    stage = Stages(run)
    with stage("pair"):
        mesh = mesh_of(record)
        if any(zone.surfaces for zone in (*record.contact, *record.ties)):
            check_groups(record, mesh)
            record = with_roles(record, mesh)
        targets = _places([zone.name for zone in (*record.contact, *record.ties)], output)
        for path in targets.values():
            for place in (path, path.with_suffix(".mtx"))[: 1 + mtx]:
                run.will_write(place, force=force)
        matrices_of = contact_matrices(record, mesh)
    with stage("write"):
        for name, written in matrices_of.items():
            rubs = any(one.name == name and one.has_friction for one in record.contact)
            write_matrices(targets[name], written, mtx=mtx, friction=rubs)
    for name, written in matrices_of.items():
        rows, columns = written.B.shape
        also = f" and {targets[name].with_suffix('.mtx').name}" if mtx else ""
        print(f"{name}: B {rows:,} x {columns:,}, {written.B.nnz:,} entries: {targets[name]}{also}")
    if not is_cut(mesh):
        print("the columns follow the nodes of the cut mesh; lacmesh cut writes that mesh")
    print(f"{case}: {stage.spent()}")


def _places(zones: list[str], output: Path) -> dict[str, Path]:
    """Return the file of each zone: `output`, or FILE-ZONE.npz if there are several."""
    from lacsolver.output.names import CONTACT, contact_stems

    stems = contact_stems(zones)
    if len(stems) == 1:
        return dict.fromkeys(stems, output)
    return {zone: output.with_stem(f"{output.stem}-{stem.removeprefix(CONTACT)}") for zone, stem in stems.items()}
