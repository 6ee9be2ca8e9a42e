"""Pictures of meshes and of their cuts by pyvista: a PNG file, a page that opens offline in a browser, a window."""

from __future__ import annotations

import base64
import io
import os
import re
import subprocess
import sys
from collections.abc import Iterable, Sequence
from contextlib import redirect_stderr
from dataclasses import dataclass
from functools import cache
from html import escape
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.drawing import OPACITY, RAMP, Drawing
from lacmesh.errors import LacmeshError, RequestError, WriteError, check_installed, did_you_mean
from lacmesh.formats.output import replace_file
from lacmesh.grids import Groups, Vector
from lacmesh.mesh import Floats, Mesh, MeshLike, as_mesh

PICTURES, PAGES = (".png",), (".html", ".htm")
#: the largest side of a picture in pixels, the widest gap in diagonals of the mesh, cells that a thumbnail may have
_LARGEST, _WIDEST, _SMALL = 16384, 100.0, 50_000
#: address from which the viewer of pyvista's pages takes an icon
_ICON = "https://kitware.github.io/vtk-js/icon/favicon-"


@dataclass(frozen=True)
class Values:
    """A value for each cell: `what` it is, `values` (n_cells,), NaN where there is none, and its bad and good ends.

    `invalid` (n_cells,): cells that no solver can use. `ramp`: colours from the bad end to the good one. `on_skin`:
    values are those of slave faces alone, such as a pressure, and not of the cells behind.
    """

    what: str
    values: Floats
    bad: float
    good: float
    invalid: NDArray[np.bool_]
    ramp: Sequence[str] = RAMP
    on_skin: bool = False


def cell_values(mesh: Mesh, measure: str = "corner_jacobian") -> Values:
    """Return a measure of quality (`lacmesh.quality`) of each cell of dimension 2 or 3 that has it.

    Raises RequestError where there is no such measure, or no cell that has it.
    """
    from lacmesh.quality import measure_cells, measures_of, validity_of
    from lacmesh.quality.measures import SCALES, chosen_measures

    chosen_measures(measure)
    values, invalid = np.full(mesh.n_cells, np.nan), np.zeros(mesh.n_cells, bool)
    for k, block in enumerate(mesh.blocks):
        if ALL_CELLS[block.type].dim > 1 and measure in measures_of(block.type):
            measured = measure_cells(block.type, mesh.points, block.nodes, [measure])[measure]
            values[mesh.offsets[k] : mesh.offsets[k + 1]] = measured
    known = values[np.isfinite(values)]
    if mesh.n_cells and np.isnan(values).all():
        names = set().union(*(measures_of(b.type) for b in mesh.blocks))
        raise RequestError(f"no cell of this mesh has the measure {measure!r}{did_you_mean(measure, names)}")
    solid = np.flatnonzero(mesh.cell_dim > 1)
    invalid[solid] = validity_of(mesh, solid) <= 0
    kind, better = SCALES[measure]
    low, high = (0.0, 1.0) if kind == "unit" or not len(known) else (float(known.min()), float(known.max()))
    if kind == "ratio":  # from 1 on; cells that are ten times worse than most share one colour
        low, high = 1.0, max(1.01, min(high, 10 * float(np.median(known))))
    high += 0.01 * max(abs(low), abs(high)) * (high - low < 0.01 * max(abs(low), abs(high)))
    return Values(measure.replace("_", " "), values, *((high, low) if better < 0 else (low, high)), invalid)


def check_request(
    path: Path | None = None,
    *,
    size: tuple[int, int] | None = None,
    camera: Sequence[float] | None = None,
    cutaway: Sequence[float] | None = None,
    explode: float | None = None,
    bodies: str | None = None,
) -> None:
    """Check early that a drawing can be made. `path`: None for a window. Raises RequestError."""
    suffix = path.suffix.lower() if path else ""
    if path and suffix not in (*PICTURES, *PAGES):
        raise RequestError(f"{path}: nothing is drawn as {suffix!r}{did_you_mean(suffix, (*PICTURES, *PAGES))}")
    if size and suffix in PAGES:
        raise RequestError(f"size is for a picture (.png), and {path} is a page, which fills its window")
    if size and not all(0 < side <= _LARGEST for side in size):
        raise RequestError(f"a picture of {size[0]} x {size[1]} pixels cannot be drawn; each side is 1 to {_LARGEST}")
    for name, direction in (("camera", camera), ("cutaway", cutaway)):
        if direction is not None and not (len(direction) == 3 and np.isfinite(direction).all() and any(direction)):
            words = " ".join(f"{v:g}" for v in direction)
            raise RequestError(f"{name} {words} is no direction; give three finite numbers, one of them not 0")
    if explode is not None and not 0 <= explode <= _WIDEST:
        raise RequestError(f"explode {explode:g} is no gap; give a number from 0 to {_WIDEST:g}, in sizes of the mesh")
    if bodies is not None and bodies not in OPACITY:
        raise RequestError(f"bodies are drawn {', '.join(OPACITY)}, not {bodies!r}{did_you_mean(bodies, OPACITY)}")
    for package in ("pyvista", "trame_pyvista")[: 1 + (suffix in PAGES)]:
        check_installed(package, "view", "a page" if suffix in PAGES else "a picture")


def plotter(
    mesh: Mesh,
    *,
    slave: Groups = None,
    master: Groups = None,
    findings: Iterable[Any] | None = None,
    values: Values | None = None,
    camera: Vector | None = None,
    explode: float | None = None,
    cutaway: Vector | None = None,
    bodies: str | None = None,
    title: str | None = None,
    size: tuple[int, int] = (1600, 1000),
    off_screen: bool = True,
) -> Any:
    """Return a plotter of pyvista: bodies in greys, macro-elements in colours, internal nodes as red dots.

    `slave`, `master`: groups whose faces are coloured (default: all slave faces of a cut, no master; each slave face
    has its own colour in a mesh that carries no cut). `findings`: those of `lacmesh check`; the cells that errors name
    are red, those of warnings orange, skins are paler. `values`: a value for each cell, on a ramp of colours. `camera`:
    the direction from the mesh to the eye. `explode`: the gap by which bodies with slave faces are moved off the
    others, in diagonals of the mesh; by default they stay, but in a plane with a master. `cutaway`: cells beyond the
    middle in this direction are left out. `bodies`: `solid`, `ghost` (see-through) or `hidden`; by default solid, or
    ghosts where others hide the slave skin, unless they have the colours of values. `title`: a line above. `size`:
    pixels.

    Raises RequestError where pyvista is missing, GroupNotFoundError, DataError for places too far away, WriteError
    where nothing can be drawn.
    """
    check_request(size=size, camera=camera, cutaway=cutaway, explode=explode, bodies=bodies)
    if off_screen:
        check_renderer()
    drawing = Drawing(mesh, slave, master, cutaway, size, off_screen)
    eye = drawing.eye(camera)
    moved = drawing.move_apart(explode)
    if bodies is None:
        see_through = drawing.hidden and drawing.whole and not drawing.plane and (values is None or values.on_skin)
        bodies = "ghost" if see_through else "solid"
    listed = None if findings is None else list(findings)
    drawing.add_bodies(OPACITY[bodies], values)
    drawing.add_skins(values, pale=any(finding.severity != "info" for finding in listed or ()))
    drawing.add_findings(listed)
    title = drawing.title if title is None else title
    drawing.add_words(f"{title} (opened)" if title and moved else title)
    drawing.set_camera(eye)
    return drawing.plot


def picture(mesh: MeshLike, path: str | os.PathLike[str], **options: Any) -> None:
    """Draw a mesh into a PNG file; `options`: those of `plotter`. Raises as it does, and WriteError."""
    path = Path(path)
    if path.suffix.lower() not in PICTURES:
        raise RequestError(f"{path}: a picture is written as .png")
    replace_file(path, image_of(plotter(as_mesh(mesh), **options)))


def page(mesh: MeshLike, path: str | os.PathLike[str], **options: Any) -> None:
    """Write a page that turns a mesh in a browser, without a network; `options`: those of `plotter`.

    Raises as it does, RequestError where trame-pyvista is missing, and WriteError.
    """
    path = Path(path)
    if path.suffix.lower() not in PAGES:
        raise RequestError(f"{path}: a page is written as .html")
    check_request(path)
    plot = plotter(as_mesh(mesh), **options)
    plot.disable_parallel_projection()
    plot.reset_camera()
    title = f"<title>{escape(options.get('title') or path.name)}</title>"
    text = re.sub("<title>.*?</title>", lambda _: title, page_of(plot), count=1)
    replace_file(path, text.encode("utf-8", "replace"))


def window(mesh: MeshLike, **options: Any) -> None:
    """Show a mesh in a window until it is closed; `options`: those of `plotter`.

    Raises as it does, and RequestError without a display.
    """
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise RequestError("there is no display for a window; -o FILE.png draws a picture without one")
    plotter(as_mesh(mesh), off_screen=False, **options).show()


def thumbnail(mesh: Mesh) -> str:
    """Return a small picture of a mesh as HTML, for notebooks; "" for a large mesh, or where nothing can be drawn."""
    if find_spec("pyvista") is None or not 0 < mesh.n_cells <= _SMALL:
        return ""
    try:
        image = image_of(plotter(mesh, size=(480, 320)))
    except LacmeshError:
        return ""
    return f'<img alt="the mesh" src="data:image/png;base64,{base64.b64encode(image).decode()}">'


def image_of(plot: Any) -> bytes:
    """Return what a plotter shows as a PNG image, and close it."""
    out = io.BytesIO()
    import_module("PIL.Image").fromarray(plot.screenshot(return_img=True)).save(out, "PNG")
    plot.close()
    return out.getvalue()


def page_of(plot: Any) -> str:
    """Return what a plotter shows as a page of HTML, by pyvista's export (trame-pyvista), and close it."""
    with redirect_stderr(io.StringIO()):  # trame looks for a newer viewer in the network, and prints that there is none
        text: str = plot.trame.export_html(None).getvalue()
    plot.close()
    return text.replace(_ICON, "data:,")  # the viewer would ask the network for the icon of its tab


@cache
def check_renderer() -> None:
    """Raise WriteError where VTK finds no renderer: it would end this process, so that a child tries first."""
    if sys.platform != "linux" or os.environ.get("DISPLAY"):
        return
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")  # VTK takes OSMesa where EGL is missing
    code = "import vtkmodules.vtkRenderingOpenGL2; from vtkmodules.vtkRenderingCore import vtkRenderWindow as Window; "
    code += "window = Window(); window.SetOffScreenRendering(1); window.Render()"
    if subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).returncode:
        advice = "apt-get install libegl1 (or libosmesa6) brings a renderer"
        raise WriteError("picture", f"nothing can be drawn here; {advice}")
