"""Show the results beside this file in ParaView: the deformed bodies, and the contact pressure on the slave skins.

Open it with *File > Load State*, or draw a picture without a window: `pvbatch paraview_state.py picture.png`. On the
left are the bodies, in the colours of von Mises' stress; on the right the slave skin of each contact and tie, in the
colours of its pressure, with the edges of the bodies. Both views turn together. Displacements are drawn as they are, at
the last time that was written, whose largest values end the scales.

`lacsolver run` copies this file into its folder; it needs nothing but ParaView (5.10 or later) and its Python.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

#: colours of a value, from its low end to its high one, in hexadecimal (those of lacmesh.scene.colours.RESULT)
COLOURS = ("f4f3d0", "a9d9b2", "56b4b8", "2f7fb5", "34489b", "231a4c")
#: field -> what it is called beside its colours
TITLES = {"von_mises": "von Mises stress", "pressure": "contact pressure"}
#: colours of what has no value, and of edges
GREY, INK = (0.85, 0.85, 0.85), (0.36, 0.39, 0.42)


def main() -> None:
    """Show the results in the folder of this file; draw them into the file that is named, if one is."""
    from paraview import simple

    simple._DisableFirstRenderCameraReset()
    folder = Path(__file__).resolve().parent
    ring = folder / "ring.pvd"
    bodies = deformed(simple, ring if ring.exists() else folder / "solid.pvd")
    skins = [deformed(simple, path) for path in sorted(folder.glob("contact_*.pvd"))]
    time = last_time(bodies)
    for source in (bodies, *skins):
        source.UpdatePipeline(time)
    flat = is_flat(bodies)
    views = new_views(simple, folder.name, 2 if skins else 1)
    simple.GetAnimationScene().UpdateAnimationUsingDataTimeSteps()
    simple.GetAnimationScene().AnimationTime = time
    for view in views:
        look(view, flat)
    show(simple, views[0], [bodies], ("POINTS", "von_mises"))
    scale(simple, views[0], [bodies.PointData], "von_mises", folder)
    if skins:
        draw_edges(simple, views[1], bodies)
        for shown in show(simple, views[1], skins, ("CELLS", "pressure")):
            shown.LineWidth = 5.0 if flat else 1.0
        scale(simple, views[1], [skin.CellData for skin in skins], "pressure", folder)
        simple.AddCameraLink(*views, "lacsolver")
    views[0].ResetCamera(False)
    simple.RenderAllViews()
    if len(sys.argv) > 1:
        simple.SaveScreenshot(sys.argv[1], simple.GetLayout(views[0]), ImageResolution=(800 * len(views), 700))


def deformed(simple: Any, path: Path) -> Any:
    """Return the results that a PVD file names, their points moved by the displacement."""
    source = simple.PVDReader(registrationName=path.name, FileName=str(path))
    moved = simple.WarpByVector(registrationName=f"{path.stem}, deformed", Input=source)
    moved.Vectors, moved.ScaleFactor = ["POINTS", "displacement"], 1.0
    return moved


def last_time(source: Any) -> float:
    """Return the last time of results."""
    source.UpdatePipelineInformation()
    times = source.Input.TimestepValues  # a number if there is one only
    return float(times if isinstance(times, float) else max(times, default=0.0))


def is_flat(source: Any) -> bool:
    """Return True if results lie in a plane z = const."""
    bounds = source.GetDataInformation().GetBounds()
    return bool(bounds[5] - bounds[4] <= 1e-9 * max(bounds[1] - bounds[0], bounds[3] - bounds[2]))


def new_views(simple: Any, name: str, count: int) -> list[Any]:
    """Return one view, or two side by side, in a layout of their own."""
    layout = simple.CreateLayout(f"lacsolver: {name}")
    views = [simple.CreateView("RenderView") for _ in range(count)]
    simple.AssignViewToLayout(view=views[0], layout=layout, hint=0)
    if count > 1:
        simple.AssignViewToLayout(view=views[1], layout=layout, hint=layout.SplitHorizontal(0, 0.5) + 1)
    layout.SetSize(800 * count, 700)
    for view in views:
        view.UseColorPaletteForBackground, view.Background = 0, (1.0, 1.0, 1.0)
        view.OrientationAxesLabelColor = (0.0, 0.0, 0.0)
    return views


def show(simple: Any, view: Any, sources: list[Any], field: tuple[str, str]) -> list[Any]:
    """Show sources in the colours of a field, which is on POINTS or CELLS; return what shows them."""
    shown = [simple.Show(source, view) for source in sources]
    for one in shown:
        one.Representation = "Surface"
        simple.ColorBy(one, field)
    return shown


def scale(simple: Any, view: Any, data: list[Any], field: str, folder: Path) -> None:
    """Show the scale of a field, from 0 to the largest value in the data of sources at their time."""
    arrays = [one.GetArray(field) for one in data]
    largest = max((array.GetRange()[1] for array in arrays if array is not None), default=0.0)
    top = largest if 0 < largest < float("inf") else 1.0
    table = simple.GetColorTransferFunction(field)
    ends = [(k / (len(COLOURS) - 1) * top, *channels(hexed)) for k, hexed in enumerate(COLOURS)]
    table.RGBPoints = [value for end in ends for value in end]
    table.ColorSpace, table.NanColor = "RGB", GREY
    bar = simple.GetScalarBar(table, view)
    bar.Title, bar.ComponentTitle = f"{TITLES[field]}{units(folder)}", ""
    bar.TitleColor = bar.LabelColor = (0.0, 0.0, 0.0)
    if bar.RangeLabelFormat.startswith("%"):  # of printf; releases after 5.13 may have another language
        bar.RangeLabelFormat = "%.3g"
    bar.Visibility = 1


def draw_edges(simple: Any, view: Any, source: Any) -> None:
    """Show the sharp edges and the boundary of a source as lines."""
    surface = simple.ExtractSurface(registrationName="surfaces of bodies", Input=source)
    edges = simple.Show(simple.FeatureEdges(registrationName="edges of bodies", Input=surface), view)
    edges.Representation, edges.ColorArrayName = "Surface", ("POINTS", "")
    edges.AmbientColor = edges.DiffuseColor = INK


def channels(hexed: str) -> tuple[float, ...]:
    """Return red, green and blue of a colour, from 0 to 1.

    >>> channels("ff0033")
    (1.0, 0.0, 0.2)
    """
    return tuple(int(hexed[k : k + 2], 16) / 255 for k in (0, 2, 4))


def units(folder: Path) -> str:
    """Return the units that the case names, as words to be added; none where it names none."""
    try:
        named = json.loads((folder / "results.json").read_text(encoding="utf-8")).get("units")
    except (OSError, ValueError):
        return ""
    return f" ({named})" if named else ""


def look(view: Any, flat: bool) -> None:
    """Point the camera at the model: at right angles to a plane, along a diagonal in space."""
    view.CameraFocalPoint = (0.0, 0.0, 0.0)
    view.CameraPosition, view.CameraViewUp = (
        ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)) if flat else ((1.0, -1.6, 0.8), (0.0, 0.0, 1.0))
    )
    view.InteractionMode = "2D" if flat else "3D"


if not __name__.startswith("lacsolver."):  # ParaView calls the module `__vtkconsole__`, and pvbatch `__main__`
    main()
