"""A picture as a PNG file, rendered off-screen."""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import LacmeshError, RequestError
from lacmesh.formats.output import replace_file, temporary_folder
from lacmesh.mesh import Floats, Mesh, MeshLike, as_mesh
from lacmesh.origin import origin_of
from lacmesh.scene import Scene, camera_of, laid_out, make_scene
from lacmesh.scene.layers import Layer
from lacmesh.scene.marks import MarkedFinding, Values
from lacmesh.scene.placing import fit_camera
from lacmesh.scene.visible import Groups, Vector, unit
from lacmesh.view.draw import ARRAYS, PICTURE
from lacmesh.view.offscreen import ADVICE, render

#: the largest side of a picture, in pixels: what renderers allow
LARGEST = 16384
#: largest number of cells of a thumbnail, which is drawn without being asked for
_SMALL = 50_000
#: heights between which the bodies of frames are, as parts of that of the picture; seconds for all frames together
_FRAMED, _FILM_TIMEOUT = (0.015, 0.985), 1800.0
#: what is quicker than a drawing that takes too long, and what to do where nothing can be drawn
_QUICKER, _ADVICE = "a smaller size, near or a page (.html) is", f"{ADVICE}, and a page (.html) needs none"


def picture(
    mesh: MeshLike,
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
    bodies: str | None = None,
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
    slave face. `cutaway`: cells beyond the middle in this direction are left out. `bodies`: `solid`,
    `ghost` (see-through) or `hidden`; by default solid, or ghosts where nothing can be moved to show the slave skin.
    `title`: a line above; what was moved stands behind it.
    `explode` and `near` are parts of the mesh's diagonal. `timeout`: seconds that the drawing may take.

    Raises RequestError where pyvista is missing, GroupNotFoundError, DataError for places too far away, WriteError
    where nothing can be drawn or written.
    """
    mesh = as_mesh(mesh)
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise RequestError(f"{path}: a picture is written as .png")
    if not all(0 < side <= LARGEST for side in size):
        raise RequestError(f"a picture of {size[0]} x {size[1]} pixels cannot be drawn; each side is 1 to {LARGEST}")
    if find_spec("pyvista") is None:
        raise RequestError("a picture needs pyvista; pip install 'lacmesh[view]' brings it, and a page needs nothing")
    scene = make_scene(
        mesh, slave, master, findings=findings, values=values,
        camera=camera, explode=explode, tilt=tilt, near=near, cutaway=cutaway, bodies=bodies,
    )  # fmt: skip
    replace_file(path, image_of(scene if title is None else replace(scene, title=title), size, path, timeout))


def image_of(scene: Scene, size: tuple[int, int], path: Path, timeout: float = 600.0) -> bytes:
    """Draw a scene as a PNG image of a size in pixels, for the file `path`, in `timeout` seconds. Raises WriteError."""
    with temporary_folder() as folder:
        scene = laid_out(scene, size)
        _save(folder, scene, size, camera_of(scene, size))
        (image,) = render(
            "lacmesh.view.draw", folder, [PICTURE], output=path, timeout=timeout, quicker=_QUICKER, advice=_ADVICE
        )
    return image


def thumbnail(mesh: Mesh) -> str:
    """Return a small picture of a mesh as HTML, for notebooks; "" for a large mesh, or where nothing can be drawn."""
    if find_spec("pyvista") is None or not 0 < mesh.n_cells <= _SMALL:
        return ""
    with TemporaryDirectory() as folder:
        path = Path(folder, "mesh.png")
        try:
            picture(mesh, path, size=(480, 320), timeout=20.0)
        except LacmeshError:
            return ""
        return f'<img alt="the mesh" src="data:image/png;base64,{base64.b64encode(path.read_bytes()).decode()}">'


def frames(
    layers: Sequence[Layer], x: Floats, rgb: NDArray[np.uint8], eye: Vector, size: tuple[int, int], path: Path
) -> list[bytes]:
    """Draw bodies at several times, all from the same camera, as PNG images for the file `path`.

    `layers`: the faces, then lines, all of the same points; `x` (k, p, 3): the points at each time, and `rgb` (k, p, 3)
    the colours of the faces there. `eye`: direction from the bodies to the eye. Raises WriteError.
    """
    x = x - origin_of(x.reshape(-1, 3))  # a graphics card counts with seven digits
    camera = fit_camera(x.reshape(-1, 3), unit(eye), size, *_FRAMED)
    layers = [replace(layer, points=x[0]) for layer in layers]
    scene = Scene(tuple(layers), unit(eye), "", ())
    names = [f"{k}.png" for k in range(len(x))]
    with temporary_folder() as folder:
        _save(folder, scene, size, camera, x=x, rgb=rgb)
        return render(
            "lacmesh.view.draw", folder, names, output=path, timeout=_FILM_TIMEOUT, quicker="fewer frames are"
        )


def _save(folder: Path, scene: Scene, size: tuple[int, int], camera: Mapping[str, Any], **moving: NDArray) -> None:
    """Write a scene for `draw`: `scene.npz` has the arrays, `scene.json` the rest; `moving`: `x`, `rgb` of frames."""
    arrays = {f"{name}{k}": getattr(layer, name) for k, layer in enumerate(scene.layers) for name in ARRAYS}
    np.savez(folder / "scene.npz", **arrays, **moving)  # type: ignore[arg-type]
    rest: dict[str, Any] = {
        "layers": [(layer.kind, layer.width, layer.opacity) for layer in scene.layers],
        "size": size,
        "title": scene.heading,
        "legend": scene.legend,
        "labels": scene.labels,
        "camera": camera,
        "frames": len(moving["x"]) if moving else 0,
    }
    if scene.values is not None:
        rest["ramp"] = (scene.values.what, scene.values.bad, scene.values.good, scene.values.ramp)
    (folder / "scene.json").write_text(json.dumps(rest), encoding="utf-8")
