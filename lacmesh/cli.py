"""The command `lacmesh`: arguments, terminal, exit status. Everything else is imported when a command needs it."""

from __future__ import annotations

import argparse
import gc
import json
import os
import signal
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TextIO

from lacmesh import __version__
from lacmesh.errors import LacmeshError, LacmeshWarning, RequestError

if TYPE_CHECKING:
    from lacmesh.cut import Cut
    from lacmesh.mesh import Mesh
    from lacmesh.report import CutSummary

EPILOG = """\
A group is named as in the file, or by its tag (5), or dimension and tag (2:5); an elementary entity is entity:2:17.
Exit status: 0 done, 1 the data are wrong, 2 the command is wrong, 3 a file cannot be read or written,
130 interrupted, 143 terminated."""


class Terminated(BaseException):
    """SIGTERM arrived: unwind, so that nothing half-written stays."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; the exit status."""
    gc.disable()  # a short life of large arrays and no cycles: collecting would only cost time
    if sys.stdout is None:  # closed by who called us
        sys.stdout = Path(os.devnull).open("w")  # noqa: SIM115
    args = _parser().parse_args(argv)
    signal.signal(signal.SIGTERM, _terminate)
    _keep_memory()
    with warnings.catch_warnings():
        warnings.simplefilter("always", LacmeshWarning)
        warnings.showwarning = _show_warning
        try:
            args.run(args)
            sys.stdout.flush()
        except LacmeshError as error:
            return _fail(str(error), error.status)
        except BrokenPipeError:  # the reader of our output went away, as `head` does
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        except OSError as error:  # files of ours say so themselves: this is what we print to
            return _fail(f"the terminal or file that is printed to fails ({error.strerror or error})", 3)
        except KeyboardInterrupt:
            return _fail("interrupted; nothing was written", 130)
        except Terminated:
            return _fail("terminated; nothing was written", 143)
        except MemoryError:
            return _fail("there is not enough memory for this mesh", 1)
        except Exception as error:  # a fault of ours: one line, and the traceback on request
            if args.verbose:
                raise
            message = f"internal error ({type(error).__name__}: {error}); --verbose shows where; please report it"
            return _fail(message, 1)
    return 0


def _keep_memory() -> None:
    """Let glibc keep what is freed for the next array: new pages cost a tenth of the time on a mesh of 1e6 cells."""
    if sys.platform == "linux":
        import ctypes

        mallopt = getattr(ctypes.CDLL(None), "mallopt", None)  # musl has none
        if mallopt is not None:
            mallopt(-3, 1 << 30)  # M_MMAP_THRESHOLD
            mallopt(-1, (1 << 31) - 1)  # M_TRIM_THRESHOLD
            mallopt(-2, 1 << 26)  # M_TOP_PAD


def _terminate(signum: int, frame: object) -> NoReturn:
    raise Terminated


def _fail(message: str, status: int) -> int:
    print(f"lacmesh: error: {message}", file=sys.stderr)
    return status


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    if issubclass(category, LacmeshWarning):
        print(f"lacmesh: warning: {message}", file=sys.stderr)


# ---- arguments


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lacmesh",
        description="Cut meshes for Local Average Contact: each face of the slave skin becomes a macro-element that "
        "owns a displacement degree of freedom.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"lacmesh {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    _add_cut(commands)
    _add_info(commands)
    _add_convert(commands)
    types = _command(commands, "types", _types, "list the supported cells, the patterns and what each costs")
    types.epilog = "Nodes and cells are those added for one slave face, skin and volume together."
    return parser


def _command(commands: Any, name: str, run: Callable[..., None], text: str) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=text,
        description=text[0].upper() + text[1:] + ".",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=run)
    parser.add_argument("-q", "--quiet", action="store_true", help="print nothing but warnings and errors")
    parser.add_argument("-v", "--verbose", action="store_true", help="show where an internal error comes from")
    return parser


def _add_cut(commands: Any) -> None:
    parser = _command(commands, "cut", _cut, "cut the slave skin, and the cells behind it, into macro-elements")
    parser.add_argument("input", metavar="IN", help="mesh: .msh (2.2, 4.1), .med")
    parser.add_argument("--slave", action="append", required=True, metavar="GROUP", help="slave skin; may be repeated")
    parser.add_argument("-o", "--output", metavar="OUT", help="default: beside the input, with .lac before its suffix")
    parser.add_argument(
        "--hexa",
        choices=("pyramid", "hexa", "auto"),
        default="pyramid",
        help="children of hexahedra; auto: those whose worst is better (default: pyramid)",
    )
    parser.add_argument(
        "--interface",
        choices=("both", "refuse"),
        default="both",
        help="a slave face between two cells: cut both, or refuse (default: both)",
    )
    parser.add_argument(
        "--orient",
        choices=("keep", "outward"),
        default="keep",
        help="leave slave faces as they turn, or turn them outward (default: keep)",
    )
    parser.add_argument("--skin-only", action="store_true", help="cut a skin that has no cells behind it (a shell)")
    parser.add_argument(
        "--node-groups",
        choices=("extend", "keep"),
        default="extend",
        help="new nodes enter node groups that hold all corners around them (default: extend)",
    )
    _add_output_options(parser)


def _add_info(commands: Any) -> None:
    parser = _command(commands, "info", _info, "say what is in a file")
    parser.add_argument("input", metavar="IN")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    _add_mesh_option(parser)


def _add_convert(commands: Any) -> None:
    parser = _command(commands, "convert", _convert, "write a mesh in another format, or of another order, groups kept")
    parser.add_argument("input", metavar="IN")
    parser.add_argument("output", metavar="OUT", help="the suffix says the format: .msh, .med")
    parser.add_argument(
        "--order",
        choices=("2", "2-full"),
        help="raise linear cells to serendipity (2) or full quadratic (2-full: HEXA27 ...)",
    )
    _add_output_options(parser)


def _add_output_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--msh", choices=("4.1", "2.2"), help="version of a .msh output (default: the input's, or 4.1)")
    parser.add_argument("--ascii", action="store_true", help="write .msh as text (default: as the input, or binary)")
    parser.add_argument("--force", action="store_true", help="replace an existing output")
    _add_mesh_option(parser)


def _add_mesh_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--mesh", metavar="NAME", help="which mesh, in a file that holds several")


# ---- commands


def _cut(args: argparse.Namespace) -> None:
    from concurrent.futures import ThreadPoolExecutor

    from lacmesh.cut import cut_skin, is_cut
    from lacmesh.formats import read

    source = Path(args.input)
    target = Path(args.output) if args.output else _beside(source)
    stage = _Stages(args, ("read", "cut", "write"))
    _check_output(target, args)
    with stage("read"):
        mesh = read(source, mesh=args.mesh)
    done = is_cut(mesh)
    with stage("cut"):
        cut = cut_skin(
            mesh,
            args.slave,
            hexa=args.hexa,
            interface=args.interface,
            orient=args.orient,
            skin_only=args.skin_only,
            node_groups=args.node_groups,
        )
    with ThreadPoolExecutor(1) as beside:
        # beside the writing, which waits for the disk
        summary = None if args.quiet or done else beside.submit(_summarise, mesh, cut)
        with stage("write"):
            _write(target, cut.mesh, source, args)
    if summary is not None:
        _print_summary(summary.result(), source, target, stage)
    elif done and not args.quiet:
        print(f"{source} is cut already everywhere on {', '.join(args.slave)}: written as it was to {target}")


def _beside(source: Path) -> Path:
    """Where a cut goes when nothing is said: `.lac` before the suffix (the format's own where there is none)."""
    from lacmesh.formats import kind_of

    kind = kind_of(source)
    return source.with_name(f"{source.stem}.lac{source.suffix or f'.{kind.format}'}")


def _summarise(mesh: Mesh, cut: Cut) -> CutSummary:
    import rich.console
    import rich.table  # noqa: F401  (what the printing will need)

    from lacmesh.report import summarise

    return summarise(mesh, cut)


def _info(args: argparse.Namespace) -> None:
    from lacmesh.formats import kind_of, read
    from lacmesh.report import describe

    mesh = read(args.input, mesh=args.mesh)
    found = describe(mesh)
    if args.json:
        print(json.dumps(found, ensure_ascii=False, indent=2))
        return
    kind = kind_of(args.input)
    name = f"msh {kind.version} {'binary' if kind.binary else 'ASCII'}" if kind.format == "msh" else "MED"
    if not args.quiet:
        _print_info(args.input, name, found, mesh.group_tags)


def _convert(args: argparse.Namespace) -> None:
    from lacmesh.formats import read

    source, target = Path(args.input), Path(args.output)
    _check_output(target, args)
    mesh = read(source, mesh=args.mesh)
    if args.order:
        from lacmesh.order import raise_order

        mesh = raise_order(mesh, args.order)
    _write(target, mesh, source, args)
    if not args.quiet:
        types = ", ".join(f"{n} {kind}" for kind, n in mesh.cells_by_type.items())
        print(f"{target}: {mesh.n_nodes} nodes, {mesh.n_cells} cells ({types}), {len(mesh.cell_groups)} groups")


def _types(args: argparse.Namespace) -> None:
    from lacmesh.cells import CELLS
    from lacmesh.report import pattern_table

    table = _table("cell", "slave face", "variant", "faces", "children", "+nodes", "+cells")
    previous = None
    for row in pattern_table():
        name = "" if row.cell == previous else row.cell
        previous = row.cell
        table.add_row(name, row.face, row.variant, row.faces, row.children, str(row.added_nodes), str(row.added_cells))
    _console().print(table)
    skin = ", ".join(c.name for c in CELLS.values() if c.dim < 2)
    print(f"Also read and written: {skin}, and cells of higher order, which are left whole.")
    print("A skin without cells behind it (--skin-only) is cut as its faces are here; QUAD4 and QUAD8 follow --hexa.")


# ---- files


def _check_output(target: Path, args: argparse.Namespace) -> None:
    """Say at once what would stop the writing at the end."""
    from lacmesh.errors import WriteError
    from lacmesh.formats import check_target

    check_target(target)
    if target.exists() and not args.force:
        raise RequestError(f"{target} exists already; --force replaces it, -o names another file")
    if not target.parent.is_dir():
        raise WriteError(target, f"the folder {target.parent} does not exist")


def _write(target: Path, mesh: Mesh, source: Path, args: argparse.Namespace) -> None:
    """Write as the options say; what they leave open is as in the input."""
    from lacmesh.formats import kind_of, write

    kind = kind_of(source)
    write(target, mesh, msh=args.msh or kind.version, binary=kind.binary and not args.ascii, force=args.force)


# ---- terminal


class _Stages:
    """Times the stages of a command, and shows a progress bar where a person watches."""

    def __init__(self, args: argparse.Namespace, names: Iterable[str]) -> None:
        self.names = tuple(names)
        self.seconds: dict[str, float] = {}
        self.bar: Any = None
        if sys.stderr.isatty() and not args.quiet:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

            self.bar = Progress(
                TextColumn("{task.description:6}"),
                BarColumn(),
                TimeElapsedColumn(),
                console=Console(stderr=True),
                transient=True,
            )
            self.task = self.bar.add_task("", total=len(self.names))

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        if self.bar:
            self.bar.start()
            self.bar.update(self.task, description=name, refresh=True)
        try:
            yield
            self.seconds[name] = time.perf_counter() - start
            if self.bar:
                self.bar.advance(self.task)
        finally:
            if self.bar and (name not in self.seconds or name == self.names[-1]):
                self.bar.stop()


def _console() -> Any:
    from rich.console import Console

    return Console(width=None if sys.stdout.isatty() else 160, highlight=False, markup=False, emoji=False)


def _table(*columns: str) -> Any:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in columns:
        number = name.startswith("+") or name in ("before", "after", "added", "cells", "number", "nodes")
        table.add_column(name, justify="right" if number else "left", no_wrap=number)
    return table


def _print_summary(summary: CutSummary, source: Path, target: Path, stage: _Stages) -> None:
    console = _console()
    table = _table(f"{source.name} -> {target.name}", "before", "after", "added")
    for name, (before, after) in (("nodes", summary.nodes), ("cells", summary.cells)):
        table.add_row(name, f"{before:,}", f"{after:,}", f"+{after - before:,}")
    for zone, macros in summary.zones.items():
        table.add_row(f"macro-elements of {zone}", "", f"{macros:,}", "")
    table.add_section()
    for kind in dict.fromkeys([*summary.replaced, *summary.children]):
        old, new = summary.replaced.get(kind, 0), summary.children.get(kind, 0)
        table.add_row(f"{kind} touched", f"{old:,}", f"{new:,}", f"{new - old:+,}")
    if summary.replaced:
        table.add_row("worst quality of the touched cells", *(f"{q:.3f}" for q in summary.worst), "")
    else:
        table.add_row("every slave face owns an internal dof already: no cell is cut", "", "", "")
    console.print(table)
    if summary.worst[0] <= 0:
        message = "cells behind the slave faces were inverted or degenerate before the cut: their children are too"
        warnings.warn(message, LacmeshWarning, stacklevel=1)
    times = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in stage.seconds.items())
    print(f"{target}: {times}{_memory()}")


def _memory() -> str:
    try:
        import resource
    except ImportError:  # not on Windows
        return ""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    return f"; peak memory {peak / 1e6:.0f} MB"


def _print_info(path: str, kind: str, found: dict[str, Any], tags: Mapping[str, tuple[tuple[int, int], ...]]) -> None:
    console = _console()
    print(f"{path}: {kind}, {found['nodes']:,} nodes, {found['cells']:,} cells")
    if found["bounding_box"]:
        low, high = found["bounding_box"]
        print("box: " + ", ".join(f"{a} in [{lo:.6g}, {hi:.6g}]" for a, lo, hi in zip("xyz", low, high, strict=True)))
    table = _table("type", "cells")
    for name, count in found["cells_by_type"].items():
        table.add_row(name, f"{count:,}")
    console.print(table)
    if found["groups"]:
        table = _table("group", "dimension", "cells", "tag")
        for name, group in found["groups"].items():
            dim = str(group["dim"]) if group["dim"] >= 0 else ""
            table.add_row(name, dim, f"{group['cells']:,}", ", ".join(f"{d}:{t}" for d, t in tags.get(name, ())))
        console.print(table)
    if found["node_groups"]:
        table = _table("node group", "nodes")
        for name, count in found["node_groups"].items():
            table.add_row(name, f"{count:,}")
        console.print(table)
    if found["lac"]:
        print(f"cut: {found['lac']['macro_elements']:,} macro-elements in {', '.join(found['lac']['zones'])}")


if __name__ == "__main__":
    sys.exit(main())
