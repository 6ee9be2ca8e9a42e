"""Pictures of bodies in space, all from the same camera, rendered off-screen in a subprocess.

VTK ends the process if it finds no renderer, which is why it runs in a process of its own (as in `lacmesh.view`).
"""

from __future__ import annotations

import subprocess
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import WriteError
from lacmesh.formats.output import temporary_folder
from lacmesh.mesh import Floats, Ints
from lacmesh.origin import origin_of
from lacmesh.view.draw import LIGHTS
from lacmesh.view.png import ADVICE, draw_apart, windows

#: time limit for all pictures together, in seconds
_TIMEOUT = 1800.0
#: default direction from the bodies to the eye
CAMERA = (-0.55, -1.0, 0.6)


class Scene(NamedTuple):
    """Input of the renderer: `triangles` (t, 3) and `edges` (e, 2); `x` and colours `rgb` (k, p, 3) of k pictures."""

    triangles: Ints
    edges: Ints
    x: Floats
    rgb: NDArray[np.uint8]
    camera: Floats
    size: tuple[int, int]


def photographs(scene: Scene, place: Path) -> list[NDArray[np.uint8]]:
    """Return the scene's pictures, (height, width, 3) each. Raises WriteError, which names the output `place`."""
    image = import_module("matplotlib.image")
    said = ""
    with temporary_folder() as folder:
        np.savez(folder / "scene.npz", **scene._asdict())
        for window in windows():
            try:
                child = draw_apart("lacsolver.pictures.stage", folder, window, _TIMEOUT)
            except subprocess.TimeoutExpired as error:
                raise WriteError(place, f"was not drawn within {_TIMEOUT:g} s; fewer frames are quicker") from error
            made = [folder / f"{k}.png" for k in range(len(scene.x))]
            if child.returncode == 0 and all(path.exists() for path in made):
                return [(255 * image.imread(path)[..., :3]).round().astype(np.uint8) for path in made]
            last = (child.stderr.strip().splitlines() or [""])[-1]
            said = f" ({last})" if child.returncode == 1 and last else said
    raise WriteError(place, f"nothing can be drawn here{said}; {ADVICE.partition(',')[0]}")


def draw(folder: str) -> None:
    """Render the scene of a folder to the files 0.png, 1.png, ... in it."""
    pyvista: Any = import_module("pyvista")
    scene = dict(np.load(Path(folder) / "scene.npz"))
    scene["x"] = scene["x"] - origin_of(scene["x"].reshape(-1, 3))  # a graphics card counts with seven digits
    plotter = pyvista.Plotter(off_screen=True, window_size=scene["size"].tolist())
    plotter.set_background("white")
    plotter.remove_all_lights()
    for position, strength in LIGHTS:
        plotter.add_light(pyvista.Light(position=position, intensity=strength, light_type="camera light"))
    faces, lines = (np.insert(scene[name], 0, wide, axis=1) for name, wide in (("triangles", 3), ("edges", 2)))
    skin = pyvista.PolyData(scene["x"][0].copy(), faces=faces.ravel())
    net = pyvista.PolyData(scene["x"][0].copy(), lines=lines.ravel())
    skin["rgb"] = scene["rgb"][0]
    plotter.add_mesh(skin, scalars="rgb", rgb=True, ambient=0.65, diffuse=0.45, specular=0.0)
    actor = plotter.add_mesh(net, color="#1b1f24", line_width=1.0, lighting=False, opacity=0.35)
    actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
    actor.mapper.SetRelativeCoincidentTopologyLineOffsetParameters(-1, -4)
    _look(plotter, scene)
    for k, (x, rgb) in enumerate(zip(scene["x"], scene["rgb"], strict=True)):
        skin.points, net.points, skin["rgb"] = x, x, rgb
        plotter.reset_camera_clipping_range()
        plotter.render()
        plotter.screenshot(Path(folder) / f"{k}.png")


def _look(plotter: Any, scene: Any) -> None:
    """Set the camera so that the points of all pictures are in view."""
    to_eye = scene["camera"] / np.linalg.norm(scene["camera"])
    up = [0.0, 0.0, 1.0] if abs(to_eye[2]) < 0.99 else [0.0, 1.0, 0.0]
    right = np.cross(up, to_eye)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(to_eye, right), to_eye])
    seen = scene["x"].reshape(-1, 3) @ axes.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    middle, half = (low + high) / 2 @ axes, (high - low) / 2
    width, height = scene["size"].tolist()
    plotter.enable_parallel_projection()
    plotter.camera_position = [middle + to_eye * 10 * half.max(), middle, axes[1]]
    plotter.camera.parallel_scale = 1.03 * max(half[1], half[0] * height / width)
    plotter.enable_anti_aliasing("ssaa")
