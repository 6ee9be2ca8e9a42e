"""Picture of the contact pressure of a state, on the deformed bodies, and for plane models along the contact too.

skins = the slaves' faces with their pressures, and the visible faces around them  (scene.visible)
shown = these faces, displaced by the magnified displacement
picture = rendered off-screen by lacmesh.view; in a plane by matplotlib            (view, figure of the plane)
"""

from __future__ import annotations

import io
import math
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.errors import RequestError
from lacmesh.formats.output import replace_file
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.reference.shapes import shape
from lacmesh.scene.colours import ends_of
from lacmesh.scene.marks import Values
from lacmesh.scene.visible import MASTER, SLAVE, find_visible
from lacmesh.topology.components import label_components
from lacmesh.topology.faces import cells_of_dim
from lacmesh.topology.skin import FACE_TYPES, N_NODES
from lacmesh.view import picture
from lacsolver.case import Case
from lacsolver.contact import Pairing, Zone, integrate
from lacsolver.problem.pair import zone_of
from lacsolver.problem.roles import with_roles
from lacsolver.problem.skin import mesh_of, prepared
from lacsolver.results.results import Restart

#: largest length of a magnified displacement, relative to the extent of the mesh
_MOVED = 0.04
#: largest overlap of magnified bodies, relative to the extent of the mesh
_OVERLAP = 0.004
#: number of segments that an edge of a cell is drawn with
_PARTS = 6
#: margin of a zoomed picture on each side of the faces under pressure, relative to their extent
_MARGIN = 0.5
#: room above and below a curve of pressure, relative to the span of its scale
_ROOM = 0.05


class Skin(NamedTuple):
    """A contact zone to draw, with the `pressure` (faces,) on each of its slave faces."""

    zone: Zone
    pressure: Floats


class Pressures(Values):
    """Pressures of cells, without a list of worst cells."""

    def worst(self, count: int) -> Ints:
        """Return no cells."""
        return np.empty(0, np.int64)


def check_plot(case: Case, path: Path) -> None:
    """Raise RequestError if nothing can be drawn: no contact in the case, no .png, a package that is missing."""
    if path.suffix.lower() != ".png":
        raise RequestError(f"{path}: a picture is written as .png")
    if not case.contact:
        raise RequestError("a plot shows the pressure of contacts, and the case has no [[contact]]")
    needed = "pyvista" if case.model == "3d" else "matplotlib"
    if find_spec(needed) is None:
        raise RequestError(f"a plot needs {needed}; pip install 'lacmesh[view]' brings it")


def plot(case: Case, state: Restart, path: Path, mesh: Mesh | None = None, *, zoom: bool = False) -> None:
    """Draw the pressure of a state's contacts into a PNG file; `mesh` as for `Problem.of`.

    Displacements are magnified so that they can be seen; the title gives the factor. `zoom`: show only the surroundings
    of the faces under pressure, to scale. Raises RequestError as `check_plot`, WriteError if nothing can be drawn (as
    `lacmesh.view.picture`) or written.

    >>> from tempfile import TemporaryDirectory
    >>> from lacsolver import read_case, run
    >>> from lacsolver.output import create_output, read_state
    >>> case = read_case("data/two_blocks.toml")
    >>> with TemporaryDirectory() as folder:
    ...     done = run(case, create_output(folder))
    ...     plot(case, read_state(folder, case), Path(folder, "pressure.png"))
    """
    check_plot(case, path)
    mesh = mesh_of(case, mesh)
    case = with_roles(case, mesh)
    mesh = prepared(case, mesh)
    dim = 3 if case.model == "3d" else 2
    u = np.zeros((mesh.n_nodes, 3))
    u[:, :dim] = state.u.reshape(-1, dim)
    zones = [zone_of(mesh, record) for record in case.contact]
    skins = [Skin(zone, np.asarray(state.multipliers[zone.name])[zone.macro]) for zone in zones]
    # seen from near by, bodies in contact would overlap if their displacements were magnified
    times = 1.0 if zoom else magnification(mesh, u, _gap_closed(skins, case, dim))
    scale = f"displacement x {times:g}" if times > 1 else "displacement to scale"
    title = f"pressure at t = {state.time:.6g}, {scale}"
    x = mesh.points + times * u
    window = pressed_window(skins, x) if zoom else None
    if dim == 3:
        _draw_space(mesh, x, skins, case, path, title, window)
    else:
        replace_file(path, _plane_figure(mesh, x, skins, title, window))


def pressed_window(skins: list[Skin], x: Floats) -> NDArray[np.floating] | None:
    """Return the corners (2, 3) of a box around the faces under pressure, with a margin; None if there are none."""
    pressed = np.concatenate([skin.zone.slave.faces.nodes[skin.pressure != 0] for skin in skins])
    points = x[pressed[pressed >= 0]]
    if not len(points):
        return None
    low, high = points.min(axis=0), points.max(axis=0)
    margin = _MARGIN * (high - low).max()
    return np.stack([low - margin, high + margin])


def _gap_closed(skins: list[Skin], case: Case, dim: int) -> float:
    """Return the largest initial gap of the macro-elements that are under pressure."""
    closed = [0.0]
    for (zone, pressure), record in zip(skins, case.contact, strict=True):
        face = integrate(zone, dim, Pairing(search_distance=record.search_distance))
        pressed = np.bincount(zone.macro, np.abs(pressure)) > 0
        closed.append(float(np.nanmax(np.append(np.abs(face.gap[pressed]), 0.0))))
    return max(closed)


def magnification(mesh: Mesh, u: Floats, closed: float = 0.0) -> float:
    """Return the factor by which displacements (n_nodes, 3) are magnified: 1, 2 or 5 times a power of ten, at least 1.

    `closed`: largest initial gap that has closed; magnified bodies overlap by about the factor times this gap, which is
    limited so that it cannot be visible.

    >>> bar = Mesh.create([[0, 0], [2, 0]], [("SEG2", [[0, 1]])])
    >>> magnification(bar, np.array([[0, 0, 0], [0.003, 0, 0]])), magnification(bar, np.ones((2, 3)))
    (20.0, 1.0)
    """
    largest, extent = float(np.abs(u).max(initial=0.0)), float(np.ptp(mesh.points, axis=0).max())
    ratio = min(_MOVED * extent / max(largest, 1e-300), 1 + _OVERLAP * extent / max(closed, 1e-300))
    if largest <= 0 or ratio < 1:
        return 1.0
    power = 10.0 ** math.floor(math.log10(ratio))
    return float(power * max(n for n in (1, 2, 5) if n * power <= ratio * (1 + 1e-9)))


def _draw_space(
    mesh: Mesh,
    x: Floats,
    skins: list[Skin],
    case: Case,
    path: Path,
    title: str,
    window: NDArray[np.floating] | None = None,
) -> None:
    """Draw the visible faces in space, as a mesh of their own, so that values of slave faces do not show on parents.

    With a `window`: only the faces that have a corner in it.
    """
    slaves, masters = ([getattr(record, role) for record in case.contact] for role in ("slave", "master"))
    visible = find_visible(mesh, slaves, masters)
    pressure = np.full(mesh.n_cells, np.nan)
    for zone, own in skins:
        pressure[zone.slave.cell] = own
    order = np.argsort(visible.faces.type, kind="stable")
    if window is not None:
        corners = visible.faces.corners[order]
        inside = ((x[corners] >= window[0]) & (x[corners] <= window[1])).all(axis=2) & (corners >= 0)
        order = order[inside.any(axis=1)]
    drawn = visible.faces.take(order)
    blocks = [(FACE_TYPES[code], drawn.nodes[drawn.type == code, : N_NODES[code]]) for code in np.unique(drawn.type)]
    role, skin = visible.role[order], visible.skin[order]
    faces = Mesh.create(
        x,
        blocks,
        space_dim=3,
        cell_groups={"slave": np.flatnonzero(role == SLAVE), "master": np.flatnonzero(role == MASTER)},
        cell_data={"lac_macro": np.where(role == SLAVE, visible.macro[order], -1)},
    )
    values = np.where(role == SLAVE, pressure[skin], np.nan)
    shown = Pressures("pressure", values, *ends_of(pressure, zero=True), np.zeros(len(values), bool))
    picture(faces, path, slave="slave", master="master", values=shown, title=title)


def _plane_figure(
    mesh: Mesh, x: Floats, skins: list[Skin], title: str, window: NDArray[np.floating] | None = None
) -> bytes:
    """Return a PNG with the deformed mesh and its slave skins above, and the pressure along each skin below."""
    figure = import_module("matplotlib.figure").Figure(figsize=(10, 10), dpi=130, layout="tight")
    colours = import_module("matplotlib.colors")
    body, profile = figure.subplots(2, 1, height_ratios=(3, 2))
    low, high = ends_of(np.concatenate([skin.pressure for skin in skins]), zero=True)
    scale = colours.Normalize(low, high)
    body.add_collection(_lines(_edges(mesh, x), color="#9aa2aa", linewidth=0.5))
    for skin in skins:
        drawn = _lines(_skin_lines(skin, x), cmap="viridis", norm=scale, linewidth=4, zorder=3)
        drawn.set_array(skin.pressure)
        body.add_collection(drawn)
        s, p = along(skin, mesh.points)
        profile.plot(s, p, linewidth=1.4, label=skin.zone.name)
    figure.colorbar(drawn, ax=body, label="pressure", fraction=0.05)
    body.set_aspect("equal", anchor="C")
    body.autoscale()
    if window is not None:
        body.set(xlim=window[:, 0], ylim=window[:, 1])
        profile.set_xlim(pressed_span(skins, mesh.points))
    body.set(title=title, xlabel="x", ylabel="y")
    profile.set(xlabel="length along the slave skin, undeformed", ylabel="pressure of the macro-elements")
    profile.set_ylim(low - _ROOM * (high - low), high + _ROOM * (high - low))
    profile.grid(color="#e2e5e8", linewidth=0.6)
    profile.legend(frameon=False)
    out = io.BytesIO()
    figure.savefig(out, format="png")
    return out.getvalue()


def _lines(pieces: Any, **style: Any) -> Any:
    return import_module("matplotlib.collections").LineCollection(pieces, **style)


def _edges(mesh: Mesh, x: Floats) -> NDArray[np.floating]:
    """Return the edges of all plane cells, once for each cell, as polylines (e, points, 2)."""
    facets = [(f.type, nodes[:, f.nodes]) for kind, nodes, _ in cells_of_dim(mesh, 2) for f in CELLS[kind].facets]
    return np.concatenate([_curves(kind, nodes, x) for kind, nodes in facets])


def _curves(kind: str, nodes: Ints, x: Floats) -> NDArray[np.floating]:
    """Return segments of one type as polylines (k, points, 2), with the same number of points for all types."""
    N = shape(kind, np.linspace(-1, 1, _PARTS + 1)[:, None])
    return np.asarray(np.einsum("pn,kns->kps", N, x[nodes, :2]))


def _skin_lines(skin: Skin, x: Floats) -> NDArray[np.floating]:
    """Return the slave faces, in the order of their surface, as polylines (f, points, 2)."""
    out = np.empty((len(skin.pressure), _PARTS + 1, 2))
    for kind, rows, nodes in skin.zone.slave.by_type():
        out[rows] = _curves(kind, nodes, x)
    return out


def along(skin: Skin, x: Floats) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return (s, pressure) of the slave faces along the skin, as steps, with NaN between chains that are not joined.

    An open chain starts at its end, a closed one at its first face; s continues from one chain to the next.
    """
    ends = skin.zone.slave.faces.nodes[:, :2]
    order, first = chains(ends)
    length = np.linalg.norm(x[ends[order, 1]] - x[ends[order, 0]], axis=1)
    stop = np.cumsum(length)
    s = np.stack([np.append(0.0, stop[:-1]), stop], axis=1)
    p = np.repeat(skin.pressure[order], 2).reshape(-1, 2)
    gaps = 2 * first[1:]
    return np.insert(s.ravel(), gaps, np.nan), np.insert(p.ravel(), gaps, np.nan)


def pressed_span(skins: list[Skin], x: Floats) -> tuple[float, float]:
    """Return the interval of length along the skins that is under pressure, with a margin."""
    lines = [along(skin, x) for skin in skins]
    pressed = np.concatenate([s[np.isfinite(p) & (p != 0)] for s, p in lines])
    low, high = float(pressed.min()), float(pressed.max())
    margin = _MARGIN * (high - low)
    return max(low - margin, 0.0), high + margin


def chains(ends: Ints) -> tuple[Ints, Ints]:
    """Return the order of segments (f, 2), which all run one way, along chains, and the start of each chain in it.

    >>> order, first = chains(np.array([[2, 3], [7, 8], [1, 2], [3, 4]]))
    >>> order.tolist(), first.tolist()
    ([2, 0, 3, 1], [0, 3])
    """
    n = len(ends)
    by_start = np.argsort(ends[:, 0], kind="stable")
    at = np.minimum(np.searchsorted(ends[by_start, 0], ends[:, 1]), n - 1)
    after = np.where(ends[by_start[at], 0] == ends[:, 1], by_start[at], -1)
    joined = np.flatnonzero(after >= 0)
    chain = label_components(joined, after[joined], n)
    lowest = np.unique(chain, return_index=True)[1]
    begun = np.isin(chain[lowest], chain[np.setdiff1d(np.arange(n), after)])
    after[np.isin(after, lowest[~begun])] = -1  # a closed chain begins at its first face
    left = (after >= 0).astype(np.int64)  # number of segments that follow: up to a jump, which doubles each time
    for _ in range(n.bit_length()):
        on = after >= 0
        left[on] += left[after[on]]
        after[on] = after[after[on]]
    order = np.lexsort((-left, chain))
    return order, np.searchsorted(chain[order], np.arange(len(lowest)))
