"""`lacmesh mesh`: list a CAD file, or mesh it with the groups that contact needs."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lacmesh.cli.options import add_command, add_msh_options, pending_mesh
from lacmesh.cli.terminal import Stages, as_json, console, table
from lacmesh.errors import RequestError

if TYPE_CHECKING:
    from lacmesh.gmsh import CadShape, EntitySelection

TEXT = """\
list the surfaces of a CAD file, or mesh it with groups

A group is made of surfaces by their tags, as --list shows them, or of those that lie in a box as a whole; of curves,
where the file is plane: no volumes, and all surfaces in one plane. After DIM: they are of that dimension: --group
body=3:1 names the volume 1. Repeat --group for further groups, and for more of the same group. Volumes in no group are
in the mesh all the same, and so are surfaces: entity:2:17 names them to other commands. Lengths of STEP and IGES come
out in millimetres."""


def add(commands: Any) -> None:
    """Declare the command."""
    first, _, rest = TEXT.partition("\n\n")
    parser = add_command(commands, "mesh", run, first)
    parser.description = f"{parser.description}\n\n{rest}"
    parser.add_argument(
        "cad", metavar="CAD", help="geometry: .geo, .geo_unrolled, .step, .stp, .iges, .igs, .brep, .stl"
    )
    parser.add_argument("--list", action="store_true", help="list bodies and surfaces: tag, type, area, normal, box")
    parser.add_argument("--json", action="store_true", help="with --list: one JSON object")
    parser.add_argument("-o", "--output", metavar="OUT", help="the mesh; the suffix says the format")
    parser.add_argument(
        "--group",
        action="append",
        default=[],
        metavar="NAME=TAG,TAG",
        help="or NAME=box:x0,y0,z0,x1,y1,z1; may be repeated",
    )
    parser.add_argument(
        "--size",
        type=float,
        metavar="H",
        help="length of edges (default: as a .geo says, else a twentieth of the diagonal, and 12 to a full turn)",
    )
    parser.add_argument("--order", type=int, choices=(1, 2), help="2: quadratic, on the curved geometry (default: 1)")
    parser.add_argument("--slave", action="append", default=[], metavar="GROUP", help="group that gets --slave-size")
    parser.add_argument("--slave-size", type=float, metavar="H", help="length of edges on the slave faces")
    parser.add_argument(
        "--dim", type=int, choices=(2, 3), help="2: mesh surfaces only (default: 3, if there are volumes)"
    )
    add_msh_options(parser, "4.1", "binary")
    parser.add_argument("--force", action="store_true", help="replace an existing output")


def run(args: argparse.Namespace) -> None:
    """List or mesh a file."""
    if args.list == bool(args.output):
        raise RequestError("say --list to see what is in the file, or -o OUT to mesh it")
    if args.list:
        _list(args)
    elif args.json:
        raise RequestError("--json goes with --list; lacmesh info --json tells of a mesh")
    else:
        _mesh(args)


def _list(args: argparse.Namespace) -> None:
    from dataclasses import asdict

    from lacmesh.gmsh import list_cad

    shapes = list_cad(args.cad, dim=args.dim)
    if args.json:
        print(as_json({"file": args.cad, "shapes": [asdict(s) for s in shapes]}))
        return
    dim = max(shape.dim for shape in shapes)
    bodies, skin = ([s for s in shapes if s.dim == d] for d in (dim, dim - 1))
    of_bodies = len(bodies) > 1 or not all(shape.bodies for shape in skin)
    out = console()
    print(f"{args.cad}: {_count(bodies, dim)}, {_count(skin, dim - 1)}")
    out.print(_table(bodies, dim, of_bodies))
    out.print(_table(skin, dim - 1, of_bodies))


def _count(shapes: Sequence[CadShape], dim: int) -> str:
    what = ("point", "curve", "surface", "volume")[dim]
    return f"{len(shapes)} {what}{'s' if len(shapes) != 1 else ''}"


def _table(shapes: Sequence[CadShape], dim: int, of_bodies: bool) -> Any:
    """Table of the shapes of one dimension; columns without content are left out."""
    columns = {
        ("", "curve", "surface", "volume")[dim]: [str(s.tag) for s in shapes],
        "name": [s.name for s in shapes],
        "type": [s.type for s in shapes],
        ("", "length", "area", "volume ")[dim]: [f"{s.measure:.5g}" for s in shapes],
        "centre": [_vector(s.centre, _largest(s.box)) for s in shapes],
        "normal, or radius": [_facing(s) for s in shapes],
        "box": [_box(*s.box) for s in shapes],
        "of body": [", ".join(map(str, s.bodies)) if of_bodies else "" for s in shapes],
        "group": [", ".join(s.groups) for s in shapes],
    }
    shown = {name: cells for name, cells in columns.items() if any(cells)}
    rows = table(*shown)
    for cells in zip(*shown.values(), strict=True):
        rows.add_row(*cells)
    return rows


def _facing(shape: CadShape) -> str:
    if shape.normal is not None:
        return _vector(shape.normal)
    if shape.radius is None:
        return ""
    return f"{'round' if shape.radius > 0 else 'hollow'}, r = {abs(shape.radius):.5g}"


def _box(low: Sequence[float], high: Sequence[float]) -> str:
    largest = _largest((low, high))
    return f"{_vector(low, largest)} .. {_vector(high, largest)}"


def _largest(box: Sequence[Sequence[float]]) -> float:
    return max(abs(v) for corner in box for v in corner)


def _vector(values: Sequence[float], largest: float = 1.0) -> str:
    """Numbers in brackets; those negligible beside `largest` are 0."""
    return f"({', '.join(f'{0.0 if abs(v) < 1e-7 * largest else v:.4g}' for v in values)})"


def _mesh(args: argparse.Namespace) -> None:
    from lacmesh.formats import write
    from lacmesh.gmsh import check_source, mesh_cad, parse_group

    groups: dict[str, list[EntitySelection]] = {}
    for text in args.group:
        name, part = parse_group(text)
        groups.setdefault(name, []).append(part)
    check_source(args.cad)
    target = Path(args.output)
    args.left = pending_mesh(target, args)
    stage = Stages(args, ("mesh", "write"))
    with stage("mesh"):
        mesh = mesh_cad(
            args.cad,
            groups=groups,
            size=args.size,
            order=args.order,
            slave=args.slave,
            slave_size=args.slave_size,
            dim=args.dim,
        )
    with stage("write"):
        write(target, mesh, msh=args.msh, binary=False if args.ascii else None, force=args.force)
    if not args.quiet:
        types = ", ".join(f"{n:,} {cell_type}" for cell_type, n in mesh.cells_by_type.items())
        print(f"{target}: {mesh.n_nodes:,} nodes, {mesh.n_cells:,} cells ({types})")
        for name, cells in mesh.cell_groups.items():
            print(f"  {name}: {len(cells):,} cells of dimension {mesh.group_dim(name)}")
