"""Pictures of meshes and of their cuts, as PNG files, without a window.

scene = what is drawn, and from where      (`scene.py`)
image = the scene drawn by pyvista         (`draw`, in a child process: VTK dies where no renderer works)
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import RequestError, WriteError
from lacmesh.mesh import Mesh
from lacmesh.scene import DOT, INK, PALETTE, Scene, Vector, camera_of, make_scene

#: what VTK can draw in without a screen (`libegl1`, `libosmesa6`), tried in this order
WINDOWS = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
#: arrays of a layer
ARRAYS = ("points", "cells", "rgb", "normals")
#: lights that go with the camera: where they stand (right, up, towards the eye), how strong
LIGHTS = (((-0.5, 0.9, 1.0), 0.55), ((0.9, 0.0, 0.6), 0.22), ((0.0, -0.2, 1.0), 0.33))


def picture(
    mesh: Mesh,
    path: str | os.PathLike[str],
    *,
    slave: str | Sequence[str] | None = None,
    size: tuple[int, int] = (1600, 1000),
    camera: Vector | None = None,
    explode: float | None = None,
    tilt: float | None = None,
    near: float | None = None,
    cutaway: Vector | None = None,
    title: str | None = None,
) -> None:
    """Draw a mesh into a PNG file: bodies in greys, macro-elements in colours, internal nodes as red dots.

    `slave`: groups whose faces are coloured (default: all of a cut; cell by cell in a mesh that carries none).
    `size`: pixels. `camera`: the direction from the mesh to the eye. `tilt`: degrees by which the bodies that carry
    slave faces are turned to show them, `explode`: the gap then left between these bodies and the others. By default
    both are what shows the skin, and 0 where no other body hides it. `near`: only cells no farther than this from a
    slave face. `cutaway`: cells beyond the middle in this direction are left out. `title`: a line above.
    `explode` and `near` are parts of the mesh's diagonal.

    Raises RequestError where pyvista or a renderer is missing, GroupNotFoundError, WriteError.
    """
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise RequestError(f"{path}: a picture is written as .png")
    if find_spec("pyvista") is None:
        raise RequestError("a picture needs pyvista; pip install 'lacmesh[view]' brings it")
    scene = make_scene(mesh, slave, camera=camera, explode=explode, tilt=tilt, near=near, cutaway=cutaway)
    with tempfile.TemporaryDirectory(prefix="lacmesh-") as name:
        _save(Path(name), scene if title is None else replace(scene, title=title), size)
        image = _drawn(Path(name))
    try:
        path.write_bytes(image)
    except OSError as error:
        raise WriteError(path, f"cannot be written ({error.strerror or error})") from error


def _drawn(folder: Path) -> bytes:
    """The picture of the scene saved in a folder, from a child process with the first kind of window that works."""
    said = ""
    for window in _windows():
        child = _draw_apart(folder, window)
        if child.returncode == 0:
            return (folder / "picture.png").read_bytes()
        last = (child.stderr.strip().splitlines() or [""])[-1]
        said = f" ({last})" if child.returncode == 1 and last else said
    raise RequestError(f"nothing can be drawn here{said}; apt-get install libegl1 (or libosmesa6) brings a renderer")


def _windows() -> Iterator[str | None]:
    """Kinds of window for VTK to try: the user's choice or VTK's own where there is a screen, else those without."""
    if sys.platform != "linux" or os.environ.get("DISPLAY") or "VTK_DEFAULT_OPENGL_WINDOW" in os.environ:
        yield None
    if sys.platform == "linux":
        yield from WINDOWS


def _draw_apart(folder: Path, window: str | None) -> subprocess.CompletedProcess[str]:
    env = dict(os.environ, PYTHONPATH=os.pathsep.join(p for p in sys.path if p))
    if window:
        env["VTK_DEFAULT_OPENGL_WINDOW"] = window
    code = "import sys; from lacmesh.view import draw; draw(sys.argv[1])"
    return subprocess.run(
        [sys.executable, "-c", code, str(folder)],
        env=env,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )


def _save(folder: Path, scene: Scene, size: tuple[int, int]) -> None:
    """Write a scene for `draw`: `scene.npz` holds the arrays, `scene.json` the rest."""
    arrays = {f"{name}{k}": getattr(layer, name) for k, layer in enumerate(scene.layers) for name in ARRAYS}
    np.savez(folder / "scene.npz", **arrays)
    rest: dict[str, Any] = {
        "layers": [(layer.kind, layer.width) for layer in scene.layers],
        "size": size,
        "title": scene.title,
    }
    rest |= {"legend": scene.legend, "camera": camera_of(scene, size)}
    (folder / "scene.json").write_text(json.dumps(rest), encoding="utf-8")


def draw(folder: str) -> None:
    """Draw the scene that `picture` left in a folder, into its `picture.png`. Run in a process of its own."""
    pyvista: Any = import_module("pyvista")
    scene = json.loads((Path(folder) / "scene.json").read_text(encoding="utf-8"))
    arrays = np.load(Path(folder) / "scene.npz")
    plotter = pyvista.Plotter(off_screen=True, window_size=scene["size"])
    plotter.set_background("white")
    plotter.remove_all_lights()
    for place, strength in LIGHTS:
        plotter.add_light(pyvista.Light(position=place, intensity=strength, light_type="camera light"))
    for k, (kind, width) in enumerate(scene["layers"]):
        _add_layer(plotter, pyvista, (kind, width, scene["size"][1] / 1000), [arrays[f"{a}{k}"] for a in ARRAYS])
    camera = scene["camera"]
    plotter.enable_parallel_projection()
    plotter.camera_position = [camera["position"], camera["focal"], camera["up"]]
    plotter.camera.parallel_scale = camera["scale"]
    plotter.reset_camera_clipping_range()
    plotter.enable_anti_aliasing("ssaa")
    _add_words(plotter, pyvista, scene)
    plotter.screenshot(Path(folder) / "picture.png")


def _add_layer(plotter: Any, pyvista: Any, what: tuple[str, float, float], arrays: list[NDArray]) -> None:
    """Add a layer: its kind, its width, the pixels of a unit of width; the arrays of ARRAYS."""
    (kind, width, unit), (points, cells, rgb, normals) = what, arrays
    rows = np.hstack([np.full((len(cells), 1), cells.shape[1]), cells]).ravel()
    if kind == "dots":
        ball = pyvista.Sphere(radius=width, theta_resolution=24, phi_resolution=24)
        dots = pyvista.PolyData(points).glyph(geom=ball, scale=False, orient=False)
        plotter.add_mesh(dots, color=rgb[0].tolist(), smooth_shading=True)
    elif kind == "lines":
        lines = pyvista.PolyData(points, lines=rows)
        actor = plotter.add_mesh(lines, scalars=rgb, rgb=True, line_width=width * unit, lighting=False)
        actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
        actor.mapper.SetRelativeCoincidentTopologyLineOffsetParameters(-1, -4 * width * unit)
    else:
        faces = pyvista.PolyData(points, faces=rows)
        faces.point_data.active_normals = normals
        plotter.add_mesh(faces, scalars=rgb, rgb=True, ambient=0.65, diffuse=0.45, specular=0.0)


def _add_words(plotter: Any, pyvista: Any, scene: Mapping[str, Any]) -> None:
    """The title above, the legend below, each of its lines beside what it explains."""
    width, height = scene["size"]
    unit = height / 1000
    ink = f"#{INK}"
    style = {"viewport": True, "color": ink}
    plotter.add_text(scene["title"], position=(0.02, 0.945), font_size=round(13 * unit), **style)
    for row, (kind, words) in enumerate(reversed(scene["legend"])):
        x, y = 0.02 * width, (30 + 42 * row) * unit
        for k, colour in enumerate((DOT,) if kind == "dot" else PALETTE[:3]):
            if kind == "dot":
                mark = pyvista.Disc(center=(x + 33 * unit, y + 12 * unit, 0), inner=0, outer=9 * unit, c_res=40)
            else:
                left = x + 22 * k * unit
                mark = pyvista.Rectangle([(left, y, 0), (left + 22 * unit, y, 0), (left + 22 * unit, y + 24 * unit, 0)])
            plotter.add_actor(_flat(mark, colour))
        plotter.add_text(words, position=(0.02 + 82 * unit / width, y / height), font_size=round(11 * unit), **style)


def _flat(shape: Any, colour: str) -> Any:
    """A figure in the plane of the picture; its coordinates are pixels."""
    from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D

    mapper, actor = vtkPolyDataMapper2D(), vtkActor2D()
    mapper.SetInputData(shape)
    actor.SetMapper(mapper)
    actor.GetProperty().SetColor(*(int(colour[k : k + 2], 16) / 255 for k in (0, 2, 4)))
    return actor
