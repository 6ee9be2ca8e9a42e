"""`lacmesh info`: print the content of a mesh file."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lacmesh.cli.options import add_command, add_mesh_option
from lacmesh.cli.terminal import as_json, console, table

#: entities that the table lists at most
LISTED = 60


def add(commands: Any) -> None:
    """Declare the command."""
    shapes = "also say what shapes curved skins of linear faces have; "
    parser = add_command(commands, "info", run, "list the content of a file, or of a folder of parts", verbose=shapes)
    parser.add_argument("input", metavar="IN")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    add_mesh_option(parser)


def run(args: argparse.Namespace) -> None:
    """Print the content of a file, or of a folder of parts."""
    if Path(args.input).is_dir():
        _describe_parts(args)
        return
    from lacmesh.formats import read, title_of
    from lacmesh.report import describe

    mesh = read(args.input, mesh=args.mesh)
    described = describe(mesh)
    if args.verbose:
        from lacmesh.smooth.fitted import shapes_of_groups

        described["shapes"] = {
            name: [one.as_dict() for one in shapes] for name, shapes in shapes_of_groups(mesh).items()
        }
    if args.json:
        print(as_json(described))
        return
    if not args.quiet:
        _print_info(args.input, title_of(args.input), described, mesh.group_tags)
        if mesh.dim < min(mesh.space_dim, 3) or mesh.dim < 2:
            from lacmesh.topology.skin import lacking

            print(lacking(mesh, max(mesh.dim, 1) + 1))


def _print_info(
    path: str, title: str, described: dict[str, Any], tags: Mapping[str, tuple[tuple[int, int], ...]]
) -> None:
    from lacmesh.origin import told

    out = console()
    print(f"{path}: {title}, {described['nodes']:,} nodes, {described['cells']:,} cells")
    if described["bounding_box"]:
        low, high = described["bounding_box"]
        size = max(b - a for a, b in zip(low, high, strict=True))
        ends = (told(corner, size, 6) for corner in (low, high))
        print("box: " + ", ".join(f"{a} in [{lo}, {hi}]" for a, lo, hi in zip("xyz", *ends, strict=True)))
    rows = table("type", "cells")
    for name, count in described["cells_by_type"].items():
        rows.add_row(name, f"{count:,}")
    out.print(rows)
    if described["groups"]:
        rows = table("group", "dimension", "cells", "length, area or volume", "tag")
        for name, group in described["groups"].items():
            dim = str(group["dim"]) if group["dim"] >= 0 else ""
            size = "" if group["size"] is None else f"{group['size']:.6g}"
            rows.add_row(name, dim, f"{group['cells']:,}", size, ", ".join(f"{d}:{t}" for d, t in tags.get(name, ())))
        out.print(rows)
    else:
        _print_entities(out, described["entities"])
    if described["node_groups"]:
        rows = table("node group", "nodes")
        for name, count in described["node_groups"].items():
            rows.add_row(name, f"{count:,}")
        out.print(rows)
    if described.get("shapes"):
        from lacmesh.smooth.fitted import in_words

        for name, shapes in described["shapes"].items():
            print(f"{name}: {in_words(shapes)}")
    if described["lac"]:
        print(f"cut: {described['lac']['macro_elements']:,} macro-elements in {', '.join(described['lac']['zones'])}")


def _describe_parts(args: argparse.Namespace) -> None:
    """Print the content of a folder of parts."""
    from statistics import mean

    from lacmesh.partition import describe_parts

    described = describe_parts(args.input)
    if args.json:
        print(as_json(described))
    elif not args.quiet:
        parts = described["parts"]
        sizes = (
            f"{described['nodes']:,} nodes, {described['cells']:,} cells; {described['copies']:.2f} copies of a node"
        )
        print(f"{args.input}: {len(parts['nodes']):,} parts of a mesh of {sizes}")
        rows = table("part", *(name.replace("_", " ") for name in parts))
        for name, pick in (("smallest", min), ("mean", mean), ("largest", max)):
            rows.add_row(name, *(f"{round(pick(counts)):,}" for counts in parts.values()))
        console().print(rows)


def _print_entities(out: Any, entities: list[dict[str, Any]]) -> None:
    """Print the elementary entities, which can be named if the file has no groups."""
    if not entities:
        return
    rows = table("entity", "cells", "box")
    for entity in entities[:LISTED]:
        low, high = ("(" + ", ".join(f"{v:.4g}" for v in corner) + ")" for corner in entity["box"])
        rows.add_row(f"entity:{entity['dim']}:{entity['tag']}", f"{entity['cells']:,}", f"{low} .. {high}")
    out.print(rows)
    if len(entities) > LISTED:
        print(f"and {len(entities) - LISTED} entities more, which --json lists")
