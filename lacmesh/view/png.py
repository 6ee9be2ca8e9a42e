"""A picture as a PNG file, drawn off the screen in a child process."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from lacmesh.errors import RequestError, WriteError
from lacmesh.formats.output import replace_file, temporary_folder
from lacmesh.mesh import Mesh
from lacmesh.scene import Scene, camera_of, laid_out, make_scene
from lacmesh.scene.marks import MarkedFinding, Values
from lacmesh.scene.seen import Groups, Vector
from lacmesh.view.draw import ARRAYS

#: what VTK can draw in without a screen (`libegl1`, `libosmesa6`), tried in this order
WINDOWS = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
#: the largest side of a picture, in pixels: what renderers allow
LARGEST = 16384
ADVICE = "apt-get install libegl1 (or libosmesa6) brings a renderer, and a page (.html) needs none"


def picture(
    mesh: Mesh,
    path: str | os.PathLike[str],
    *,
    slave: Groups = None,
    master: Groups = None,
    findings: Iterable[MarkedFinding] | None = None,
    values: Values | None = None,
    size: tuple[int, int] = (1600, 1000),
    camera: Vector | None = None,
    explode: float | None = None,
    tilt: float | None = None,
    near: float | None = None,
    cutaway: Vector | None = None,
    title: str | None = None,
    timeout: float = 600.0,
) -> None:
    """Draw a mesh into a PNG file: bodies in greys, macro-elements in colours, internal nodes as red dots.

    `slave`, `master`: groups whose faces are coloured (default: all slave faces of a cut, no master; each slave face
    has its own colour in a mesh that carries no cut). `findings`: those of `lacmesh check`; the cells that errors name
    are red, those of warnings orange, all else is paler. `values`: a value for each cell, on a ramp of colours.
    `size`: pixels. `camera`: the direction from the mesh to the eye. `tilt`: degrees by which the bodies that carry
    slave faces are turned to show them, `explode`: the gap then left between these bodies and the others. By default
    both are what shows the skin, and 0 where no other body hides it. `near`: only cells no farther than this from a
    slave face. `cutaway`: cells beyond the middle in this direction are left out. `title`: a line above.
    `explode` and `near` are parts of the mesh's diagonal. `timeout`: seconds that the drawing may take.

    Raises RequestError where pyvista is missing, GroupNotFoundError, DataError for places too far away, WriteError
    where nothing can be drawn or written.
    """
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise RequestError(f"{path}: a picture is written as .png")
    if not all(0 < side <= LARGEST for side in size):
        raise RequestError(f"a picture of {size[0]} x {size[1]} pixels cannot be drawn; each side is 1 to {LARGEST}")
    if find_spec("pyvista") is None:
        raise RequestError("a picture needs pyvista; pip install 'lacmesh[view]' brings it, and a page needs nothing")
    scene = make_scene(
        mesh, slave, master, findings=findings, values=values,
        camera=camera, explode=explode, tilt=tilt, near=near, cutaway=cutaway,
    )  # fmt: skip
    with temporary_folder() as folder:
        _save(folder, laid_out(scene if title is None else replace(scene, title=title), size), size)
        image = _drawn(path, folder, timeout)
    replace_file(path, image)


def _drawn(path: Path, folder: Path, timeout: float) -> bytes:
    """The picture of the scene saved in a folder, from a child process with the first kind of window that works."""
    said = ""
    for window in windows():
        try:
            child = draw_apart("lacmesh.view.draw", folder, window, timeout)
        except subprocess.TimeoutExpired as error:
            message = f"was not drawn within {timeout:g} s; a smaller size, near or a page (.html) is quicker"
            raise WriteError(path, message) from error
        image = folder / "picture.png"
        if child.returncode == 0 and image.exists():
            return image.read_bytes()
        last = (child.stderr.strip().splitlines() or [""])[-1]
        said = f" ({last})" if child.returncode == 1 and last else said
    raise WriteError(path, f"nothing can be drawn here{said}; {ADVICE}")


def windows() -> Iterator[str | None]:
    """Kinds of window for VTK to try: the user's choice or VTK's own where there is a screen, else those without."""
    if sys.platform != "linux" or os.environ.get("DISPLAY") or "VTK_DEFAULT_OPENGL_WINDOW" in os.environ:
        yield None
    if sys.platform == "linux":
        yield from WINDOWS


def draw_apart(module: str, folder: Path, window: str | None, timeout: float) -> subprocess.CompletedProcess[str]:
    """Run a module's `draw` on a folder in a child process, which is ended on an interrupt or when time is out.

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


def _save(folder: Path, scene: Scene, size: tuple[int, int]) -> None:
    """Write a scene for `draw`: `scene.npz` holds the arrays, `scene.json` the rest."""
    arrays = {f"{name}{k}": getattr(layer, name) for k, layer in enumerate(scene.layers) for name in ARRAYS}
    np.savez(folder / "scene.npz", **arrays)
    rest: dict[str, Any] = {
        "layers": [(layer.kind, layer.width, layer.opacity) for layer in scene.layers],
        "size": size,
        "title": scene.title,
        "legend": scene.legend,
        "labels": scene.labels,
        "camera": camera_of(scene, size),
    }
    if scene.values is not None:
        rest["ramp"] = (scene.values.what, scene.values.bad, scene.values.good)
    (folder / "scene.json").write_text(json.dumps(rest), encoding="utf-8")
