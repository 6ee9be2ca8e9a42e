"""Shared parts of the commands: declaration of arguments, checks and writing of outputs."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

from lacmesh.errors import RequestError, listed

if TYPE_CHECKING:
    from lacmesh.mesh import Mesh

#: whom a mesh may be for: the keys of lacmesh.exchange.targets.TARGETS
PROGRAMS = ("gmsh", "aster", "calculix", "abaqus", "fenics", "lacsolver")

#: options of a command -> those of lacmesh.write that they become
_OPTIONS = {"msh": "msh", "ascii": "binary", "plane": "plane", "all_cells": "all_cells", "lenient": "lenient"}

EPILOG = """\
A group is named as in the file, or by its tag (5), or dimension and tag (2:5); an elementary entity is entity:2:17.
Exit status: 0 done, 1 the data are wrong, 2 the command is wrong, 3 a file cannot be read or written,
130 interrupted, 143 terminated."""


def add_command(
    commands: Any, name: str, run: Callable[..., None], text: str, verbose: str = ""
) -> argparse.ArgumentParser:
    """Declare a command with the options of all; `text` is its line in the help, `verbose` a further effect of -v."""
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=text,
        description=text[0].upper() + text[1:] + ".",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=run)
    parser.add_argument("-q", "--quiet", action="store_true", help="print nothing but warnings and errors")
    parser.add_argument(
        "-v", "--verbose", action="store_true", help=f"{verbose}show where an internal error comes from"
    )
    return parser


def add_output_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of every command that writes a mesh."""
    add_msh_options(parser, "the input's, or 4.1", "as the input, or binary")
    parser.add_argument(
        "--plane",
        choices=("CPS", "CPE", "CAX"),
        help="elements of a plane mesh in an .inp output: plane stress, plane strain, axisymmetric (default: those of "
        "an .inp input, or CPS)",
    )
    parser.add_argument(
        "--all-cells",
        action="store_true",
        help="write cells below the mesh's dimension as elements of an .inp output too, not as surfaces and sets alone",
    )
    parser.add_argument(
        "--lenient",
        action="store_true",
        help="from .inp to .inp: leave out, with a warning, a line that cannot be carried, instead of an error",
    )
    parser.add_argument(
        "--mesh-only",
        action="store_true",
        help="from .inp to .inp: write the mesh alone, without the other cards and their order",
    )
    parser.add_argument("--force", action="store_true", help="replace an existing output")
    add_mesh_option(parser)


def add_msh_options(parser: argparse.ArgumentParser, version: str, form: str) -> None:
    """Declare `--msh` and `--ascii`; `version` and `form` describe their defaults."""
    parser.add_argument("--msh", choices=("4.1", "2.2"), help=f"version of a .msh output (default: {version})")
    parser.add_argument("--ascii", action="store_true", help=f"write .msh, .vtu or .xdmf as text (default: {form})")


def add_program_option(parser: argparse.ArgumentParser, text: str) -> None:
    """Declare `--for`, stored as `args.program`."""
    parser.add_argument(
        "--for", dest="program", choices=PROGRAMS, help=f"{text}; also whose .inp to write (default: calculix)"
    )


def add_recognition_options(parser: argparse.ArgumentParser) -> None:
    """Declare `--recut` and `--recognise`: which slave faces are those of an earlier cut?"""
    either = parser.add_mutually_exclusive_group()
    either.add_argument(
        "--recut",
        dest="recognise",
        action="store_false",
        default=None,
        help="treat the slave faces as not cut yet, even where they have records of a cut",
    )
    either.add_argument(
        "--recognise",
        action="store_true",
        default=None,
        help="recognise an earlier cut without records by the pattern of its faces",
    )


def add_skin_options(parser: argparse.ArgumentParser, slave: str, master: str) -> None:
    """Declare `--slave`, `--master` and `--pair`; `slave`, `master` are their lines in the help."""
    parser.add_argument("--slave", action="append", metavar="GROUP", help=f"{slave}; may be repeated")
    parser.add_argument("--master", action="append", metavar="GROUP", help=f"{master}; may be repeated")
    parser.add_argument(
        "--pair",
        action="append",
        metavar="SLAVE:MASTER",
        help="in place of --slave and --master, for several contacts: each pair is examined by itself; may be repeated",
    )


def check_skins(args: argparse.Namespace, *, needed: bool = True) -> None:
    """Check the options of `add_skin_options` before a mesh is read; `needed`: there must be a slave.

    Raises RequestError.
    """
    if args.pair and (args.slave or args.master):
        raise RequestError("--pair names the slaves and masters; leave out --slave and --master")
    if needed and not (args.slave or args.pair):
        raise RequestError("no slave was named; give --slave GROUP, or --pair SLAVE:MASTER")


def skins(mesh: Mesh, args: argparse.Namespace, *, checked: bool = True) -> dict[str, Any]:
    """Return `slave`, `master` and `pairs` of the options of `add_skin_options`, for a mesh.

    `checked`: whether slaves and masters are compared, so that several of both are an error. Raises RequestError.
    """
    from lacmesh.checks.pairs import check_one_pair, split_pairs

    if args.pair:
        pairs = split_pairs(mesh, args.pair)
        slave, master = (list(dict.fromkeys(names)) for names in zip(*pairs, strict=True))
        return {"slave": slave, "master": master, "pairs": pairs}
    if checked:
        check_one_pair(args.slave or mesh.zones, args.master or (), f"lacmesh {args.command} {quote(args.input)}")
    return {"slave": args.slave, "master": args.master or [], "pairs": None}


def sides(options: dict[str, Any]) -> dict[str, Any]:
    """Return what `skins` returns as keyword arguments of `lacmesh.check`."""
    return {"pairs": options["pairs"]} if options["pairs"] else {"slave": options["slave"], "master": options["master"]}


def add_facing_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options that control how slave and master are compared."""
    parser.add_argument(
        "--dirichlet",
        action="append",
        default=[],
        metavar="GROUP",
        help="cells or nodes with prescribed displacement; may be repeated",
    )
    parser.add_argument(
        "--axisymmetric", action="store_true", help="a plane mesh, axisymmetric about y: areas include 2 pi x"
    )
    parser.add_argument(
        "--search-distance",
        type=_length,
        metavar="LENGTH",
        help="search distance from slave to master (default: a quarter of the smaller skin's diagonal, or twice its "
        "largest macro-element)",
    )
    parser.add_argument(
        "--max-penetration",
        type=_length,
        metavar="LENGTH",
        help="largest initial penetration searched (default: half the local element size)",
    )
    parser.add_argument(
        "--surface",
        choices=("smooth", "faces"),
        default="smooth",
        help="gaps of linear cells are measured between the curved surfaces on which their nodes lie, or between the "
        "faces (default: smooth)",
    )
    parser.add_argument(
        "--crease-angle",
        type=_angle,
        metavar="DEGREES",
        help="edges at which the normal turns by more are sharp (default: 40, but for five to eight faces to a turn "
        "whose nodes lie on one circle, cylinder, sphere or cone)",
    )


def facing_options(args: argparse.Namespace) -> dict[str, Any]:
    """Options of `add_facing_options`, as keyword arguments of `lacmesh.check`."""
    names = ("dirichlet", "axisymmetric", "search_distance", "max_penetration", "surface", "crease_angle")
    return {name: getattr(args, name) for name in names}


def _angle(text: str) -> float:
    value = float(text)
    if not 0 <= value <= 180:
        raise argparse.ArgumentTypeError(f"{text} is no angle from 0 to 180 degrees")
    return value


def _length(text: str) -> float:
    value = float(text)
    if not 0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is no length")
    return value


def add_mesh_option(parser: argparse.ArgumentParser) -> None:
    """Declare `--mesh`."""
    parser.add_argument("--mesh", metavar="NAME", help="which mesh, in a file that holds several")


def output_of(args: argparse.Namespace, ending: str) -> Path:
    """Return the path to write to: as `-o` says, or the input with an ending before the suffix of its format."""
    from lacmesh.formats import detect_format

    source = Path(args.input)
    suffix = source.suffix or f".{detect_format(source).format}"
    return Path(args.output) if args.output else source.with_name(f"{source.stem}.{ending}{suffix}")


def left_at(path: Path) -> Callable[[], str]:
    """Return a function for an interrupted command: a clause that says, by what is there, if its output was written."""
    before = _identity(path)
    return lambda: "nothing was written" if _identity(path) == before else f"{path} was written before that"


def pending_output(target: Path, *, force: bool) -> Callable[[], str]:
    """Check early that a file can be written; return `left_at` of it. Raises RequestError, WriteError."""
    from lacmesh.formats.output import check_place

    check_place(target, force=force)
    return left_at(target)


def pending_mesh(target: Path, args: argparse.Namespace) -> Callable[[], str]:
    """Check early that a mesh can be written with these options; return `left_at` of it.

    Raises RequestError, WriteError.
    """
    from lacmesh.formats.registry import format_of, takers

    taken = format_of(target).options
    for option, name in _OPTIONS.items():
        if getattr(args, option, None) and name not in taken:
            suffixes = listed([taker.suffixes[0] for taker in takers(name)], "or")
            article = "an" if suffixes.startswith(".i") else "a"
            raise RequestError(f"--{option.replace('_', '-')} is for {article} {suffixes} output, and {target} is none")
    return pending_output(target, force=args.force)


def _identity(path: Path) -> tuple[int, int] | None:
    """Inode and time of modification, which tell a file from one that took its place; None if there is no file."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns


def write_mesh(target: Path, mesh: Mesh, source: Path, args: argparse.Namespace) -> None:
    """Write a mesh as the options say; what they leave open is taken from the input."""
    from lacmesh.formats import detect_format, write
    from lacmesh.formats.registry import format_of

    if args.mesh_only:
        mesh = replace(mesh, deck=None)
    coding, program, taken = detect_format(source), getattr(args, "program", None), format_of(target).options
    write(
        target,
        mesh,
        msh=(args.msh or coding.version or None) if "msh" in taken else None,
        binary=(coding.binary and not args.ascii) if "binary" in taken else None,
        target=program if "target" in taken and program in ("calculix", "abaqus") else None,
        plane=args.plane,
        all_cells=args.all_cells,
        lenient=args.lenient,
        force=args.force,
    )
