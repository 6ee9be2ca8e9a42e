"""`lacmesh info`, `convert`, `partition`, `example`, `docs` and `compile`: files, examples, pages, compiled kernels."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from statistics import mean
from typing import Annotated, Any, Literal

from typer import Argument, Option

import lacmesh
from lacmesh.cli.options import AsJson, Force, ForProgram, MeshFile, MeshName, MeshOutput
from lacmesh.cli.program import Run
from lacmesh.cli.terminal import Stages, print_json, print_table
from lacmesh.errors import counted

#: entities that the table lists at most
_LISTED = 60


def info(source: MeshFile, *, json: AsJson = False, mesh_name: MeshName = None, run: Run) -> None:
    """List the content of a file, or of a folder of parts.

    With --verbose also the shapes of curved surfaces of linear cells.

    $ lacmesh info part.med
    $ lacmesh info part.msh --json
    """
    if Path(source).is_dir():
        _print_parts(source, json)
        return
    mesh = lacmesh.read(source, mesh=mesh_name)
    described = lacmesh.report.describe(mesh)
    if run.verbose:
        from lacmesh.smooth.fitted import shapes_of_groups

        shapes = shapes_of_groups(mesh)
        described["shapes"] = {name: [one.as_dict() for one in fitted] for name, fitted in shapes.items()}
    if json:
        print_json(described)
        return
    _print_content(f"{source}: {lacmesh.formats.title_of(source)}", described, mesh.group_tags)
    if mesh.dim < min(mesh.space_dim, 3) or mesh.dim < 2:
        from lacmesh.topology.skin import lacking

        print(lacking(mesh, max(mesh.dim, 1) + 1))


def _print_content(title: str, described: dict[str, Any], tags: Mapping[str, tuple[tuple[int, int], ...]]) -> None:
    """Print the content of a file; entities can be named where there are no groups."""
    from lacmesh.smooth.fitted import shapes_text

    print(f"{title}, {described['nodes']:,} nodes, {described['cells']:,} cells")
    if described["bounding_box"]:
        low, high = described["bounding_box"]
        size = max(b - a for a, b in zip(low, high, strict=True))
        ends = (lacmesh.origin.format_coordinates(corner, size, 6) for corner in (low, high))
        print("box: " + ", ".join(f"{a} in [{lo}, {hi}]" for a, lo, hi in zip("xyz", *ends, strict=True)))
    print_table(("type", "+cells"), [(name, f"{count:,}") for name, count in described["cells_by_type"].items()])
    groups = []
    for name, group in described["groups"].items():
        dim = str(group["dim"]) if group["dim"] >= 0 else ""
        size = "" if group["size"] is None else f"{group['size']:.6g}"
        groups.append((name, dim, f"{group['cells']:,}", size, ", ".join(f"{d}:{t}" for d, t in tags.get(name, ()))))
    entities = [] if groups else described["entities"]
    if groups:
        print_table(("group", "dimension", "+cells", "length, area or volume", "tag"), groups)
    rows = []
    for entity in entities[:_LISTED]:
        low, high = ("(" + ", ".join(f"{v:.4g}" for v in corner) + ")" for corner in entity["box"])
        rows.append((f"entity:{entity['dim']}:{entity['tag']}", f"{entity['cells']:,}", f"{low} .. {high}"))
    if rows:
        print_table(("entity", "+cells", "box"), rows)
    if len(entities) > _LISTED:
        print(f"and {len(entities) - _LISTED} entities more, which --json lists")
    if node_groups := [(name, f"{count:,}") for name, count in described["node_groups"].items()]:
        print_table(("node group", "+nodes"), node_groups)
    for name, shapes in described.get("shapes", {}).items():
        print(f"{name}: {shapes_text(shapes)}")
    if described["lac"]:
        print(f"cut: {described['lac']['macro_elements']:,} macro-elements in {', '.join(described['lac']['zones'])}")


def _print_parts(folder: str, json: bool) -> None:
    """Print the content of a folder of parts."""
    described = lacmesh.partition.describe_parts(folder)
    if json:
        print_json(described)
        return
    parts = described["parts"]
    size = f"{described['nodes']:,} nodes, {described['cells']:,} cells; {described['copies']:.2f} copies of a node"
    print(f"{folder}: {len(parts['nodes']):,} parts of a mesh of {size}")
    columns = [("+" if name in ("nodes", "cells", "own_nodes") else "") + name.replace("_", " ") for name in parts]
    which: dict[str, Callable[..., float]] = {"smallest": min, "mean": mean, "largest": max}
    rows = [(name, *(f"{round(pick(counts)):,}" for counts in parts.values())) for name, pick in which.items()]
    print_table(("part", *columns), rows)


def summary(mesh: lacmesh.Mesh) -> str:
    """Return the counts of nodes and cells of a mesh."""
    types = ", ".join(f"{n:,} {cell_type}" for cell_type, n in mesh.cells_by_type.items())
    return f"{mesh.n_nodes:,} nodes, {mesh.n_cells:,} cells ({types})"


def convert(
    source: MeshFile,
    target: Annotated[str, Argument(metavar="OUT", help="the suffix says the format (lacmesh docs formats)")],
    *,
    order: Annotated[
        Literal["2", "2-full"] | None, Option(help="raise linear cells to serendipity (2), or full quadratic (2-full)")
    ] = None,
    mesh_name: MeshName = None,
    program: ForProgram = None,
    out: MeshOutput,
    run: Run,
) -> None:
    """Write a mesh in another format, or with elevated order; groups are kept.

    $ lacmesh convert part.inp part.med
    $ lacmesh convert part.msh quadratic.med --order 2
    """
    out.check(run, Path(target))
    mesh = lacmesh.read(source, mesh=mesh_name)
    if order:
        mesh = lacmesh.raise_order(mesh, order)
    if program:
        from lacmesh.exchange.targets import check_cells

        check_cells(mesh, program)
    out.write(Path(target), mesh, source, program)
    groups = counted(len(mesh.cell_groups) + len(mesh.node_groups), "group")
    print(f"{source}: {summary(mesh)}, {groups}; written to {target}")


def partition(
    source: MeshFile,
    *,
    parts: Annotated[int, Option("--parts", "-n", metavar="N", help="number of parts")],
    target: Annotated[
        str | None, Option("--output", "-o", metavar="DIR", help="folder (default: IN with suffix .parts)")
    ] = None,
    method: Annotated[
        Literal["bisection", "metis"], Option(help="of the coordinates, or of the graph of nodes (needs pymetis)")
    ] = "bisection",
    mesh_name: MeshName = None,
    force: Force = False,
    run: Run,
) -> None:
    """Divide a mesh into parts, of which each process of a parallel run reads its own.

    $ lacmesh partition part.msh -n 4
    $ lacmesh partition part.med -n 64 --method metis -o parts
    """
    from lacmesh.partition import describe_parts, distribute_nodes
    from lacmesh.partition.parts import distribute_by_metis
    from lacmesh.partition.store import FILE, check_folder, write_parts

    if not target:
        lacmesh.formats.detect_format(source)
    folder = Path(target) if target else Path(source).with_suffix(".parts")
    stage = Stages(run)
    run.leaves(folder / FILE)
    check_folder(folder, force=force)
    with stage("read"):
        mesh = lacmesh.read(source, mesh=mesh_name)
    with stage("divide"):
        owner = (distribute_by_metis if method == "metis" else distribute_nodes)(mesh, parts)
    with stage("write"):
        write_parts(folder, mesh, owner, force=force)
    described = describe_parts(folder)
    nodes = described["parts"]["nodes"]
    print(f"{source}: {parts:,} parts of {min(nodes):,} to {max(nodes):,} nodes, ", end="")
    print(f"{described['copies']:.2f} copies of a node; written to {folder}")
    print(stage.spent())


Name = Annotated[str | None, Argument(metavar="NAME", help="the example (default: list all)")]
Folder = Annotated[str, Option("--output", "-o", metavar="DIR", help="folder for its files")]


def example(name: Name = None, *, folder: Folder = ".", force: Force = False, run: Run) -> None:
    """List the meshes that come with lacmesh, or copy one here.

    $ lacmesh example
    $ lacmesh example two_blocks
    """
    offer(lacmesh.examples.MESHES, name, folder, force=force)


def offer(examples: Mapping[str, Any], name: str | None, folder: str, *, force: bool) -> None:
    """List examples, or copy the one that is named, and print the command to try."""
    if name is None:
        wide = max(map(len, examples))
        print("\n".join(f"{name:{wide}}  {one.words}" for name, one in examples.items()))
        return
    chosen = lacmesh.examples.example_of(name, examples)
    copied = lacmesh.examples.copy_example(chosen, Path(folder), force=force)
    command = chosen.command.replace(f" {copied[0].name}", f" {copied[0]}", 1)
    print(f"{', '.join(map(str, copied))}; next: {command}")


Page = Annotated[str, Argument(metavar="PAGE", help="the page, such as cut or solver (default: the overview of all)")]
PathOnly = Annotated[bool, Option("--path", help="print the path of its Markdown text in place of opening it")]


def docs(page: Page = "README", *, path: PathOnly = False, run: Run) -> None:
    """Open a page of the documentation in the browser.

    $ lacmesh docs cut
    $ lacmesh docs conventions --path
    """
    open_page(page, path_only=path)


def open_page(name: str, *, path_only: bool) -> None:
    """Open a page of the documentation, or print where it is where there is no browser."""
    from tempfile import mkdtemp

    from lacmesh.pages import page, pages_folder, show, write_pages

    source = page(name)
    if path_only:
        print(source)
        return
    folder = Path(mkdtemp(prefix="lacmesh-docs-"))
    write_pages(folder)
    target = folder / source.relative_to(pages_folder()).with_suffix(".html")
    print(target if show(target) else f"{target}; there is no browser here: the same as text is {source}")


def compile_(*, run: Run) -> None:
    """Compile all kernels once, for all later commands of lacmesh and lacsolver.

    Nothing has to be compiled: small work runs without, and larger work compiles what it needs, once. Where it is
    kept: beside the package, or where that cannot be written, in the user's cache folder.

    $ lacmesh compile
    $ NUMBA_CACHE_DIR=/var/cache/lacmesh lacmesh compile
    """
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from multiprocessing import get_context

    from lacmesh.errors import WriteError
    from lacmesh.kernels import cache_folder, compile_listed, listed, writable
    from lacmesh.threads import available_cores

    start, names, folder = time.perf_counter(), list(listed()), cache_folder()
    if not writable(folder):
        raise WriteError(folder, "cannot be written; name another folder by NUMBA_CACHE_DIR")
    # the terminal sends an interrupt to all processes: workers leave it to this one, which ends them
    ignore = (signal.SIGINT, signal.SIG_IGN)
    with ProcessPoolExecutor(min(available_cores(), 4), get_context("spawn"), signal.signal, ignore) as pool:
        try:
            for count, done in enumerate(as_completed([pool.submit(compile_listed, name) for name in names]), 1):
                done.result()
                if count * 10 // len(names) > (count - 1) * 10 // len(names):
                    print(f"compiling: {count} of {len(names)}", flush=True)
        except BaseException:  # interrupted: what is compiled is kept
            pool.shutdown(cancel_futures=True)
            raise
    print(f"compiled {len(names)} kernels in {time.perf_counter() - start:.0f} s; kept in {folder}")
