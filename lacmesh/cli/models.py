"""`lacmesh view` and `mesh`: a mesh as a picture, a geometry as a mesh."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast

from typer import Argument, BadParameter, Option

import lacmesh
from lacmesh.cli.files import summary
from lacmesh.cli.options import AsJson, Direction, Force, MeshFile, MeshName, MshOutput, Names, Skins
from lacmesh.cli.program import Run
from lacmesh.cli.terminal import Stages, print_json, print_table
from lacmesh.errors import RequestError, counted

if TYPE_CHECKING:
    from lacmesh.gmsh import CadShape


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit() and int(width) and int(height)):
        raise BadParameter(f"invalid size {text!r}; expected WIDTHxHEIGHT, e.g. 1600x1000")
    return int(width), int(height)


def view(
    source: MeshFile,
    *,
    target: Annotated[
        str | None, Option("--output", "-o", metavar="FILE", help=".png, .html; default: a window")
    ] = None,
    skins: Skins,
    check: Annotated[bool, Option("--check", help="mark the cells with errors and warnings of lacmesh check")] = False,
    quality: Annotated[str | None, Option(metavar="[MEASURE]", help="as colours (default: corner_jacobian)")] = None,
    camera: Annotated[Direction, Option(metavar="X Y Z", help="direction from the mesh to the eye")] = None,
    cutaway: Annotated[Direction, Option(metavar="X Y Z", help="leave out cells beyond the middle, this way")] = None,
    explode: Annotated[float | None, Option(metavar="GAP", help="gap between bodies, in sizes of the mesh")] = None,
    bodies: Annotated[
        Literal["solid", "ghost", "hidden"] | None,
        Option(help="ghost: see-through; hidden: the surfaces alone (default: what shows the slave surface)"),
    ] = None,
    size: Annotated[str | None, Option(metavar="WxH", parser=_size, help="pixels (default: 1600x1000)")] = None,
    title: Annotated[str | None, Option(metavar="TITLE", help="a line above (default: the file's name)")] = None,
    mesh_name: MeshName = None,
    force: Force = False,
    run: Run,
) -> None:
    """Draw a mesh, cut or not: a picture, a page that opens offline in a browser, or a window.

    $ lacmesh view part.lac.msh -o part.png
    $ lacmesh view part.msh --slave slave --master master --check -o part.html
    """
    from lacmesh import view as drawing
    from lacmesh.formats.output import readable

    skins.check(needed=False)
    name = readable(title or Path(source).name)
    path, pixels = Path(target) if target else None, cast("tuple[int, int] | None", size)
    drawing.check_request(path, size=pixels, camera=camera, cutaway=cutaway, explode=explode)
    if path:
        run.will_write(path, force=force)
    stage = Stages(run)
    with stage("read"):
        mesh = lacmesh.read(source, mesh=mesh_name)
    with stage("look"):
        sides = skins.sides(mesh, "view", source, compared=check)
        options: dict[str, Any] = {"slave": skins.slave, "master": skins.master or None}
        if check:
            slave = {} if skins.pair else {"slave": skins.slave or mesh.zones}
            options["findings"] = lacmesh.check(mesh, **sides | slave)
        if quality is not None:
            options["values"] = drawing.cell_values(mesh, quality or "corner_jacobian")
    options |= {"camera": camera, "cutaway": cutaway, "explode": explode, "bodies": bodies}
    if path is None:
        drawing.window(mesh, title=name, **options)
        return
    with stage("draw"):
        if path.suffix.lower() == ".png":
            drawing.picture(mesh, path, size=pixels or (1600, 1000), title=title and name, **options)
        else:
            drawing.page(mesh, path, title=name, **options)
    print(f"{path}: {path.stat().st_size / 1e6:.1f} MB; {stage.spent()}")


def mesh_command(
    cad: Annotated[str, Argument(metavar="CAD", help="geometry: .geo, .geo_unrolled, .step, .iges, .brep, .stl")],
    *,
    list_: Annotated[bool, Option("--list", help="list bodies and surfaces: tag, type, area, normal, box")] = False,
    json: AsJson = False,
    target: Annotated[str | None, Option("--output", "-o", metavar="OUT", help="the mesh")] = None,
    group: Annotated[Names, Option(metavar="NAME=TAG,TAG", help="or NAME=box:x0,y0,z0,x1,y1,z1; repeatable")] = None,
    size: Annotated[
        float | None,
        Option(metavar="H", help="length of edges (default: as a .geo says, else a twentieth of the diagonal)"),
    ] = None,
    order: Annotated[Literal["1", "2"] | None, Option(help="2: quadratic, on the curved geometry (default: 1)")] = None,
    slave: Annotated[Names, Option(metavar="GROUP", help="group that gets --slave-size; may be repeated")] = None,
    slave_size: Annotated[float | None, Option(metavar="H", help="length of edges on the slave faces")] = None,
    dim: Annotated[Literal["2", "3"] | None, Option(help="2: surfaces only (default: 3, if there are volumes)")] = None,
    out: MshOutput,
    run: Run,
) -> None:
    """List the surfaces of a CAD file, or mesh it with groups.

    A group consists of surfaces by their tags, as --list shows them, or of those that lie in a box as a whole; of
    curves, where the file is plane: no volumes, and all surfaces in one plane. --group body=3:1 names the volume 1.
    Repeat --group for further groups, and for more of the same group. Volumes and surfaces in no group are in the mesh
    all the same: entity:2:17 names them to other commands. Lengths of STEP and IGES come out in millimetres.

    $ lacmesh mesh pin_in_lug.step --list
    $ lacmesh mesh pin_in_lug.step --group pin=15 --size 2 -o lug.msh
    """
    from lacmesh.gmsh import check_source, list_cad, mesh_cad, parse_group

    dimension = None if dim is None else int(dim)
    if list_ == bool(target):
        raise RequestError("say --list to see what is in the file, or -o OUT to mesh it")
    if target is None:
        _print_shapes(cad, list_cad(cad, dim=dimension), json)
        return
    if json:
        raise RequestError("--json goes with --list; lacmesh info --json tells of a mesh")
    groups: dict[str, list[Any]] = {}
    for name, part in map(parse_group, group or ()):
        groups.setdefault(name, []).append(part)
    check_source(cad)
    out.check(run, Path(target))
    stage = Stages(run)
    with stage("mesh"):
        raised = None if order is None else int(order)
        mesh = mesh_cad(
            cad, groups=groups, dim=dimension, size=size, order=raised, slave=slave or [], slave_size=slave_size
        )
    with stage("write"):
        lacmesh.write(target, mesh, msh=out.msh, binary=False if out.ascii else None, force=out.force)
    print(f"{target}: {summary(mesh)}")
    for name, cells in mesh.cell_groups.items():
        print(f"  {name}: {len(cells):,} cells of dimension {mesh.group_dim(name)}")


def _print_shapes(cad: str, shapes: Sequence[CadShape], json: bool) -> None:
    """Print the bodies of a geometry and their boundaries; columns without content are left out."""
    if json:
        print_json({"file": cad, "shapes": [asdict(shape) for shape in shapes]})
        return
    names, measures = ("point", "curve", "surface", "volume"), ("", "length", "area", "volume ")
    top = max(shape.dim for shape in shapes)
    parts = {dim: [shape for shape in shapes if shape.dim == dim] for dim in (top, top - 1)}
    several = len(parts[top]) > 1 or not all(shape.bodies for shape in parts[top - 1])
    print(f"{cad}: {', '.join(counted(len(part), names[dim]) for dim, part in parts.items())}")
    for dim, part in parts.items():
        columns = {
            names[dim]: [str(s.tag) for s in part],
            "name": [s.name for s in part],
            "type": [s.type for s in part],
            measures[dim]: [f"{s.measure:.5g}" for s in part],
            "centre": [_vector(s.centre, s.box) for s in part],
            "normal, or radius": [_vector(s.normal) if s.normal else _radius(s.radius) for s in part],
            "box": [" .. ".join(_vector(corner, s.box) for corner in s.box) for s in part],
            "of body": [", ".join(map(str, s.bodies)) if several else "" for s in part],
            "group": [", ".join(s.groups) for s in part],
        }
        columns = {name: cells for name, cells in columns.items() if any(cells)}
        print_table(tuple(columns), zip(*columns.values(), strict=True))


def _radius(radius: float | None) -> str:
    return "" if radius is None else f"{'round' if radius > 0 else 'hollow'}, r = {abs(radius):.5g}"


def _vector(values: Sequence[float], box: Iterable[Sequence[float]] = ((1.0,),)) -> str:
    """Numbers in brackets; those negligible beside the coordinates of a box are 0."""
    least = 1e-7 * max(abs(value) for corner in box for value in corner)
    return f"({', '.join(f'{0.0 if abs(value) < least else value:.4g}' for value in values)})"
