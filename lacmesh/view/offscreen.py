"""Rendering without a window, by VTK in a process of its own: VTK ends the process where it finds no renderer.

images = what a module's `draw` makes of a folder, in a subprocess         (`render`)
plotter = a white background, and lights that go with the camera           (`open_plotter`, called by `draw`)
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from lacmesh.errors import WriteError

#: what VTK can draw in without a screen (`libegl1`, `libosmesa6`), tried in this order
WINDOWS = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
#: advice where no renderer is found
ADVICE = "apt-get install libegl1 (or libosmesa6) brings a renderer"
#: lights that go with the camera: where they stand (right, up, towards the eye), how strong
LIGHTS = (((-0.5, 0.9, 1.0), 0.55), ((0.9, 0.0, 0.6), 0.22), ((0.0, -0.2, 1.0), 0.33))


def render(
    module: str, folder: Path, names: Sequence[str], *, output: Path, timeout: float, quicker: str, advice: str = ADVICE
) -> list[bytes]:
    """Images that a module's `draw(folder)` makes, in a subprocess with the first kind of window that works.

    `names`: of the files in the folder that it makes. `output`, `quicker` and `advice` are for messages: the file that
    the images are for, what takes less time than `timeout` seconds, what to do where there is no renderer. Raises
    WriteError.
    """
    files = [folder / name for name in names]
    last_words = ""
    for window in windows():
        try:
            process = draw_in_subprocess(module, folder, window, timeout)
        except subprocess.TimeoutExpired as error:
            raise WriteError(output, f"was not drawn within {timeout:g} s; {quicker} quicker") from error
        if process.returncode == 0 and all(file.exists() for file in files):
            return [file.read_bytes() for file in files]
        last = (process.stderr.strip().splitlines() or [""])[-1]
        last_words = f" ({last})" if process.returncode == 1 and last else last_words
    raise WriteError(output, f"nothing can be drawn here{last_words}; {advice}")


def windows() -> Iterator[str | None]:
    """Kinds of window for VTK to try: the user's choice or VTK's own where there is a screen, else those without."""
    if sys.platform != "linux" or os.environ.get("DISPLAY") or "VTK_DEFAULT_OPENGL_WINDOW" in os.environ:
        yield None
    if sys.platform == "linux":
        yield from WINDOWS


def draw_in_subprocess(
    module: str, folder: Path, window: str | None, timeout: float
) -> subprocess.CompletedProcess[str]:
    """Run a module's `draw` on a folder in a subprocess, which is ended on an interrupt or when time is out.

    Raises subprocess.TimeoutExpired after so many seconds.
    """
    env = dict(os.environ, PYTHONPATH=os.pathsep.join(p for p in sys.path if p))
    if window:
        env["VTK_DEFAULT_OPENGL_WINDOW"] = window
    code = f"import sys; from {module} import draw; draw(sys.argv[1])"
    return subprocess.run(
        [sys.executable, "-c", code, str(folder)],
        env=env,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
        timeout=timeout,
    )


def open_plotter(size: Sequence[int]) -> Any:
    """Plotter of pyvista without a window, of a size in pixels, with a white background and LIGHTS."""
    pyvista: Any = import_module("pyvista")
    plotter = pyvista.Plotter(off_screen=True, window_size=list(size))
    plotter.set_background("white")
    plotter.remove_all_lights()
    for place, strength in LIGHTS:
        plotter.add_light(pyvista.Light(position=place, intensity=strength, light_type="camera light"))
    return plotter


def set_camera(plotter: Any, camera: Mapping[str, Any]) -> None:
    """Set the camera that `scene.placing.fit_camera` found: parallel rays."""
    plotter.enable_parallel_projection()
    plotter.camera_position = [camera["position"], camera["focal"], camera["up"]]
    plotter.camera.parallel_scale = camera["scale"]


def add_lines(plotter: Any, lines: Any, pixels: float, **style: Any) -> None:
    """Add lines of a width in pixels, in front of the faces that they lie on."""
    actor = plotter.add_mesh(lines, line_width=pixels, lighting=False, **style)
    actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
    actor.mapper.SetRelativeCoincidentTopologyLineOffsetParameters(-1, -4 * pixels)
