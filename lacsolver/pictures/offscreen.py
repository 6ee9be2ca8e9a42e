"""Frames of bodies in space, all from the same camera, rendered by `lacmesh.view.offscreen`."""

from __future__ import annotations

import io
import json
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.formats.output import temporary_folder
from lacmesh.mesh import Floats, Ints
from lacmesh.origin import origin_of
from lacmesh.scene.colours import INK
from lacmesh.scene.placing import fit_camera
from lacmesh.scene.visible import unit
from lacmesh.view.offscreen import add_lines, open_plotter, render, set_camera

#: time limit for all frames together, in seconds
_TIMEOUT = 1800.0
#: default direction from the bodies to the eye
CAMERA = (-0.55, -1.0, 0.6)
#: heights between which the bodies are, as parts of that of the picture
_LOW, _HIGH = 0.015, 0.985


class Scene(NamedTuple):
    """Input of the renderer: `triangles` (t, 3) and `edges` (e, 2); `x` and colours `rgb` (k, p, 3) of k frames.

    `eye`: direction from the bodies to the eye; `size`: pixels.
    """

    triangles: Ints
    edges: Ints
    x: Floats
    rgb: NDArray[np.uint8]
    eye: tuple[float, float, float]
    size: tuple[int, int]


def render_frames(scene: Scene, output: Path) -> list[NDArray[np.uint8]]:
    """Return the frames of a scene, (height, width, 3) each. Raises WriteError, which names the file `output`."""
    image = import_module("matplotlib.image")
    x = scene.x - origin_of(scene.x.reshape(-1, 3))  # a graphics card counts with seven digits
    camera = fit_camera(x.reshape(-1, 3), unit(scene.eye), scene.size, _LOW, _HIGH)
    names = [f"{k}.png" for k in range(len(x))]
    with temporary_folder() as folder:
        np.savez(folder / "scene.npz", x=x, rgb=scene.rgb, triangles=scene.triangles, edges=scene.edges)
        (folder / "scene.json").write_text(json.dumps({"camera": camera, "size": scene.size}), encoding="utf-8")
        pngs = render(__name__, folder, names, output=output, timeout=_TIMEOUT, quicker="fewer frames are")
    return [(255 * image.imread(io.BytesIO(png))[..., :3]).round().astype(np.uint8) for png in pngs]


def draw(folder: str) -> None:
    """Render the scene of a folder to the files 0.png, 1.png, ... in it."""
    pyvista: Any = import_module("pyvista")
    arrays = np.load(Path(folder) / "scene.npz")
    view = json.loads((Path(folder) / "scene.json").read_text(encoding="utf-8"))
    plotter = open_plotter(view["size"])
    faces, lines = (np.insert(arrays[name], 0, n, axis=1).ravel() for name, n in (("triangles", 3), ("edges", 2)))
    frames = list(zip(arrays["x"], arrays["rgb"], strict=True))
    skin, net = pyvista.PolyData(frames[0][0].copy(), faces=faces), pyvista.PolyData(frames[0][0].copy(), lines=lines)
    skin["rgb"] = frames[0][1]
    plotter.add_mesh(skin, scalars="rgb", rgb=True, ambient=0.65, diffuse=0.45, specular=0.0)
    add_lines(plotter, net, 1.0, color=f"#{INK}", opacity=0.35)
    set_camera(plotter, view["camera"])
    plotter.enable_anti_aliasing("ssaa")
    for k, (x, rgb) in enumerate(frames):
        skin.points, net.points, skin["rgb"] = x, x, rgb
        plotter.reset_camera_clipping_range()
        plotter.render()
        plotter.screenshot(Path(folder) / f"{k}.png")
