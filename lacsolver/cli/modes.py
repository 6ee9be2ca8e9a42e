"""`lacsolver modes`: natural frequencies and shapes of a case, of its undeformed bodies or about a state of a run."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lacmesh.cli.terminal import Stages, console, table
from lacmesh.errors import RequestError
from lacsolver.cli.options import add_case, add_command, beside
from lacsolver.cli.ranks import check_alone

if TYPE_CHECKING:
    from lacsolver.problem.problem import Problem
    from lacsolver.results.modes import NaturalModes
    from lacsolver.results.results import Restart


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands, "modes", run, "find natural frequencies and mode shapes of a case, with its contacts open or closed"
    )
    add_case(parser)
    parser.add_argument(
        "-k",
        "--count",
        type=int,
        default=10,
        metavar="N",
        help="how many modes to find, the lowest ones, beside rigid-body modes (default: 10)",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="DIR",
        help="folder of the modes (default: next to the case, press_modes for press.toml)",
    )
    parser.add_argument(
        "--state",
        metavar="DIR",
        help="vibrate about the last state of a run in DIR: its closed macro-elements stay closed (default: the "
        "undeformed bodies, contacts open)",
    )
    parser.add_argument(
        "--from", dest="from_time", type=float, metavar="TIME", help="with --state: about the state at this time"
    )
    parser.add_argument(
        "--mass",
        choices=("consistent", "lumped"),
        default="consistent",
        help="mass matrix: consistent (default), or lumped on its diagonal",
    )
    parser.add_argument("--force", action="store_true", help="replace the modes in the folder")


def run(args: argparse.Namespace) -> None:
    """Find the natural modes of a case, write and print them."""
    from lacsolver.case import read_case
    from lacsolver.output import read_state
    from lacsolver.output.modes import check_modes_folder, write_modes
    from lacsolver.problem.problem import Problem, read_mesh
    from lacsolver.vibration.natural_modes import natural_modes

    check_alone()
    if args.from_time is not None and args.state is None:
        raise RequestError("--from says which state in the folder of --state to take; give both")
    if args.count < 1:
        raise RequestError(f"-k is the number of modes to find, 1 or more, not {args.count}")
    folder = check_modes_folder(args.output or beside(Path(args.case), "modes", "_modes"), force=args.force)
    case = read_case(args.case)
    stage = Stages(args, ("mesh", "modes", "write"))
    with stage("mesh"):
        mesh = read_mesh(case)
        state = None if args.state is None else read_state(args.state, case, args.from_time, mesh=mesh)
        problem = Problem.of(case, mesh)
    with stage("modes"):
        modes = natural_modes(problem, count=args.count, at=state, mass=args.mass)
    with stage("write"):
        write_modes(folder, modes, problem.space)
    if not args.quiet:
        _print(modes, problem, state)
        print(f"results: {folder} (modes.json, modes.pvd for ParaView)")
        print(f"{args.case}: {stage.spent()}")


def _print(modes: NaturalModes, problem: Problem, state: Restart | None) -> None:
    """Print a table of the modes, with effective masses as parts of the whole mass, and what else was found."""
    rows = table()
    for name in ("mode", "frequency", "period", *(f"mass {axis}" for axis in modes.axes)):
        rows.add_column(name, justify="right")
    for number in range(1, len(modes.rigid) + 1):
        rows.add_row(str(number), "0", "", *("" for _ in modes.axes), end_section=number == len(modes.rigid))
    for k, frequency in enumerate(modes.frequencies):
        parts = (f"{part:.2%}" for part in modes.effective_masses[k] / modes.mass)
        rows.add_row(str(len(modes.rigid) + k + 1), f"{frequency:.6g}", f"{1 / frequency:.4g}", *parts)
    console().print(rows)
    for name, value in _figures(modes, problem, state):
        print(f"{name}: {value}")


def _figures(modes: NaturalModes, problem: Problem, state: Restart | None) -> Iterator[tuple[str, str]]:
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
