"""Drawing of the scene that `png` left in a folder; `offscreen` runs it in a process of its own."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.scene import INDENT, LETTER, unit_of
from lacmesh.scene.colours import INK, on_ramp
from lacmesh.view.offscreen import add_lines, open_plotter, set_camera

#: name of the file that is drawn
PICTURE = "picture.png"
#: arrays of a layer
ARRAYS = ("points", "cells", "rgb", "normals")
#: triangles that all balls together may have; where that is too few for balls, dots are flat
BALLS = 2_000_000


class Sheet(NamedTuple):
    """Drawing sheet: pyvista's plotter, the module pyvista, pixels per unit of length (`unit_of`), the scene."""

    plotter: Any
    pyvista: Any
    unit: float
    scene: Mapping[str, Any]


def draw(folder: str) -> None:
    """Draw the scene in a folder into its file PICTURE, or each of its frames into 0.png, 1.png, ..."""
    pyvista: Any = import_module("pyvista")
    scene = json.loads((Path(folder) / "scene.json").read_text(encoding="utf-8"))
    arrays = np.load(Path(folder) / "scene.npz")
    width, height = scene["size"]
    plotter = open_plotter(scene["size"])
    sheet = Sheet(plotter, pyvista, unit_of((width, height)), scene)
    layers = [_add_layer(sheet, layer, [arrays[f"{a}{k}"] for a in ARRAYS]) for k, layer in enumerate(scene["layers"])]
    set_camera(plotter, scene["camera"])
    plotter.reset_camera_clipping_range()
    if width * height <= 4_000_000:  # this costs four times the memory of the picture
        plotter.enable_anti_aliasing("ssaa")
    _add_words(sheet)
    _add_labels(sheet)
    if not scene["frames"]:
        plotter.screenshot(Path(folder) / PICTURE)
    for k in range(scene["frames"]):
        for layer in layers:
            layer.points = arrays["x"][k]
        layers[0]["rgb"] = arrays["rgb"][k]
        plotter.reset_camera_clipping_range()
        plotter.render()
        plotter.screenshot(Path(folder) / f"{k}.png")


def _add_layer(sheet: Sheet, layer: tuple[str, float, float], arrays: list[NDArray]) -> Any:
    """Add a layer: its kind, width and opacity; the arrays of ARRAYS. Return its points and cells in pyvista."""
    (kind, width, opacity), (points, cells, rgb, normals) = layer, arrays
    plotter, pyvista = sheet.plotter, sheet.pyvista
    rows = np.hstack([np.full((len(cells), 1), cells.shape[1]), cells]).ravel()
    if kind == "dots":
        return _add_dots(sheet, points, rgb[0].tolist(), width)
    data = pyvista.PolyData(points, **{kind: rows})
    data["rgb"] = rgb
    if kind == "lines":
        add_lines(plotter, data, width * sheet.unit, scalars="rgb", rgb=True, opacity=opacity)
    else:
        if len(normals):
            data.point_data.active_normals = normals
        style = {"ambient": 0.65, "diffuse": 0.45, "specular": 0.0}
        actor = plotter.add_mesh(data, scalars="rgb", rgb=True, opacity=opacity, **style)
        if opacity < 1:  # behind the opaque faces that it lies on
            actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
            actor.mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(2, 2)
    return data


def _add_dots(sheet: Sheet, points: NDArray, colour: list[int], radius: float) -> Any:
    plotter, pyvista = sheet.plotter, sheet.pyvista
    data = pyvista.PolyData(points)
    around = min(24, int(np.sqrt(BALLS / len(points) / 2)))
    if around >= 6:
        ball = pyvista.Sphere(radius=radius, theta_resolution=around, phi_resolution=around)
        dots = data.glyph(geom=ball, scale=False, orient=False)
        plotter.add_mesh(dots, color=colour, smooth_shading=True)
    else:
        pixels = radius / sheet.scene["camera"]["scale"] * sheet.scene["size"][1]
        plotter.add_mesh(data, color=colour, style="points", point_size=max(pixels, 1.5), lighting=False)
    return data


def _add_words(sheet: Sheet) -> None:
    """Add the title above, the legend below, each of its lines beside its mark, and the ramp at the right."""
    plotter, _, unit, scene = sheet
    width, height = scene["size"]
    style = {"viewport": True, "color": f"#{INK}"}
    if scene["title"]:
        title = _fitted(scene["title"], 0.96 * width, 13 / 11 * LETTER * unit)
        plotter.add_text(title, position=(0.02, 0.945), font_size=round(13 * unit), **style)
    if "ramp" in scene:
        _add_ramp(sheet)
    for row, (kind, words, colours) in enumerate(reversed(scene["legend"])):
        y = (26 + 40 * row) * unit
        _add_mark(sheet, kind, colours, 0.02 * width, y)
        left = 0.0 if kind == "none" else INDENT * unit
        plotter.add_text(words, position=(0.02 + left / width, y / height), font_size=round(11 * unit), **style)


def _add_mark(sheet: Sheet, kind: str, colours: list[str], x: float, y: float) -> None:
    """Add the mark of a legend line (area, outline or dot) in a box of 66 by 24 units."""
    pyvista, unit = sheet.pyvista, sheet.unit
    wide, high = 66 * unit / max(1, len(colours)), 24 * unit
    for k, colour in enumerate(colours):
        left, shade = x + wide * k, [int(colour[i : i + 2], 16) for i in (0, 2, 4)]
        if kind == "dot":
            ball = pyvista.Disc(center=(x + 33 * unit, y + 12 * unit, 0), inner=0, outer=9 * unit, c_res=40)
            sheet.plotter.add_actor(_flat(ball, shade))
            continue
        for inset, tone in ((0, shade), (4 * unit, [255, 255, 255])) if kind == "outline" else ((0, shade),):
            a, b, c, d = left + inset, left + wide - inset, y + inset, y + high - inset
            sheet.plotter.add_actor(_flat(pyvista.Rectangle([(a, c, 0), (b, c, 0), (b, d, 0)]), tone))


def _add_ramp(sheet: Sheet) -> None:
    """Add the ramp that explains the colours of values: a bar from the bad end to the good one, its name above."""
    plotter, pyvista, unit, scene = sheet
    width, height = scene["size"]
    what, bad, good, ramp = scene["ramp"]
    left, y, wide, parts = width - 440 * unit, 26 * unit, 400 * unit, 5 * (len(ramp) - 1) * 4
    for k, colour in enumerate(on_ramp((np.arange(parts) + 0.5) / parts, 0.0, 1.0, ramp).tolist()):
        a, b = left + wide * k / parts, left + wide * (k + 1) / parts
        plotter.add_actor(_flat(pyvista.Rectangle([(a, y, 0), (b, y, 0), (b, y + 24 * unit, 0)]), colour))
    style = {"viewport": True, "color": f"#{INK}", "font_size": round(11 * unit)}
    top = (y + 32 * unit) / height
    plotter.add_text(f"{bad:.3g}", position=(left / width, top), **style)
    plotter.add_text(what, position=(left / width, top + 36 * unit / height), **style)
    end = f"{good:.3g}"
    plotter.add_text(end, position=((left + wide - 11 * len(end) * unit) / width, top), **style)


def _add_labels(sheet: Sheet) -> None:
    """Add the numbers of cells in front of everything; one that would cover another is left out."""
    scene, taken = sheet.scene, np.empty((0, 2))
    camera, height = scene["camera"], scene["size"][1]
    back = np.subtract(camera["position"], camera["focal"])
    right = np.cross(camera["up"], back / np.linalg.norm(back))
    for point, words, colour in scene["labels"]:
        at = np.array([np.dot(point, right), np.dot(point, camera["up"])]) / camera["scale"] * height / 2
        if (np.abs(taken - at) < [110 * sheet.unit, 36 * sheet.unit]).all(axis=1).any():
            continue
        taken = np.vstack([taken, at])
        sheet.plotter.add_point_labels(
            [point],
            [words],
            always_visible=True,
            show_points=False,
            font_size=round(22 * sheet.unit),
            text_color="white",
            shape="rounded_rect",
            shape_color=f"#{colour}",
            shape_opacity=1.0,
            margin=4,
        )


def _fitted(words: str, room: float, letter: float) -> str:
    """Words that fit into some pixels, given the width of a letter; an ellipsis for what does not."""
    return textwrap.shorten(words, max(8, int(room / letter)), placeholder=" ...")


def _flat(shape: Any, colour: list[int]) -> Any:
    """Actor for a flat figure in the plane of the picture; its coordinates are pixels."""
    core: Any = import_module("vtkmodules.vtkRenderingCore")
    mapper, actor = core.vtkPolyDataMapper2D(), core.vtkActor2D()
    mapper.SetInputData(shape)
    actor.SetMapper(mapper)
    actor.GetProperty().SetColor(*(c / 255 for c in colour))
    return actor
