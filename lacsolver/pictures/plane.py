"""Bodies and skins of plane models, drawn by matplotlib, and values over the length along a skin."""

from __future__ import annotations

import io
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.drawing import INK
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.shapes import shape
from lacmesh.surface import Surface
from lacsolver.pictures.frames import DrawnSurface
from lacsolver.pictures.quantities import ColourScale, ends_of

#: number of segments that a face of a skin is drawn with
_PARTS = 6
#: span of values that are one, relative to the largest of them
_LEVEL = 1e-6
#: colours of faces without a value, of surfaces without parent cells, of lines
_PLAIN, _SEGMENTS = "#eceae4", "#44546a"


def png_of(figure: Any) -> bytes:
    """Return a figure of matplotlib as PNG."""
    out = io.BytesIO()
    figure.savefig(out, format="png", metadata={"Software": None})
    return out.getvalue()


def lines(pieces: Any, **style: Any) -> Any:
    """Return a collection of lines (k, points, 2) of matplotlib."""
    return import_module("matplotlib.collections").LineCollection(pieces, **style)


def draw_bodies(axes: Any, surface: DrawnSurface, x: Floats, value: Floats, scale: ColourScale) -> None:
    """Draw bodies at points x (p, 3): faces coloured by values (p,), edges, outlines, surfaces without parent cells."""
    x, whole = x[:, :2], np.isfinite(value)[surface.triangles].all(axis=1)
    if not whole.all():
        plain = x[surface.triangles[~whole]]
        axes.add_collection(import_module("matplotlib.collections").PolyCollection(plain, color=_PLAIN, linewidth=0.3))
    shade(axes, x, surface.triangles[whole], value, scale)
    axes.add_collection(lines(x[surface.edges], color=INK, linewidth=0.25, alpha=0.35))
    axes.add_collection(lines(x[surface.outline], color=INK, linewidth=0.8))
    axes.add_collection(lines(x[surface.segments], color=_SEGMENTS, linewidth=2.5, capstyle="round"))


def shade(axes: Any, x: Floats, triangles: Ints, value: Floats, scale: ColourScale) -> None:
    """Draw triangles (t, 3) of points x (p, 2) in the colours of values (p,), which are interpolated between them."""
    if len(triangles):
        drawn = import_module("matplotlib.tri").Triangulation(*x.T, triangles)
        known = np.nan_to_num(value, nan=scale.low)
        axes.tripcolor(drawn, known, shading="gouraud", norm=scale.norm, cmap=scale.bar.cmap, rasterized=True)


def draw_faces(axes: Any, pieces: NDArray, values: Floats, scale: ColourScale) -> None:
    """Draw lines (k, points, 2) of skins in the colours of values (k,), dark below, so that light ones are seen."""
    on = np.isfinite(values)
    axes.add_collection(lines(pieces[on], color=INK, linewidth=3.6, capstyle="round", zorder=3))
    axes.add_collection(lines(pieces[on], colors=scale.rgba(values[on]), linewidth=2.6, capstyle="round", zorder=4))


def faces_as_lines(surface: Surface, x: Floats) -> NDArray[np.floating]:
    """Return the faces of a skin, in their order, as polylines (f, points, 2) at x (n_nodes, 3)."""
    out = np.empty((len(surface), _PARTS + 1, 2))
    for kind, rows, nodes in surface.by_type():
        out[rows] = _curves(kind, nodes, x)
    return out


def _curves(kind: str, nodes: Ints, x: Floats) -> NDArray[np.floating]:
    """Return segments of one type as polylines (k, points, 2), with the same number of points for all types."""
    N = shape(kind, np.linspace(-1, 1, _PARTS + 1)[:, None])
    return np.asarray(np.einsum("pn,kns->kps", N, x[nodes, :2]))


def without_frame(axes: Any) -> None:
    """Leave out ticks and the frame of axes."""
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def level_out(axes: Any, values: Floats) -> None:
    """Make the range of an axis wider if its values (n,) differ by round-off only, which would be drawn as large."""
    known = values[np.isfinite(values)]
    low, high = ends_of(known, least=_LEVEL)
    if len(known) and low < known.min():
        axes.set_ylim(low, high)


def along(ends: Ints, values: Floats, x: Floats) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return (s, values) of faces along a skin, as steps, with NaN between chains that are not joined.

    `ends` (f, 2): end nodes of the faces, at x (n_nodes, 3); `values` (f,). An open chain starts at its end, a closed
    one at its first face; s continues from one chain to the next.
    """
    order, first = chains(ends)
    length = np.linalg.norm(x[ends[order, 1]] - x[ends[order, 0]], axis=1)
    stop = np.cumsum(length)
    s = np.stack([np.append(0.0, stop[:-1]), stop], axis=1)
    p = np.repeat(values[order], 2).reshape(-1, 2)
    gaps = 2 * first[1:]
    return np.insert(s.ravel(), gaps, np.nan), np.insert(p.ravel(), gaps, np.nan)


def chains(ends: Ints) -> tuple[Ints, Ints]:
    """Return the order of segments (f, 2), which all run one way, along chains, and the start of each chain in it.

    >>> order, first = chains(np.array([[2, 3], [7, 8], [1, 2], [3, 4]]))
    >>> order.tolist(), first.tolist()
    ([2, 0, 3, 1], [0, 3])
    """
    starting: dict[int, int] = {}
    for k, node in enumerate(ends[:, 0].tolist()):
        starting.setdefault(node, k)
    after = {k: starting[node] for k, node in enumerate(ends[:, 1].tolist()) if node in starting}
    before = {follower: k for k, follower in after.items()}
    order: dict[int, None] = {}
    first = []
    for k in range(len(ends)):
        if k in order:
            continue
        start: int | None = k
        while start in before and (start := before[start]) != k:  # back to the end; a closed chain begins at k
            pass
        first.append(len(order))
        while start is not None and start not in order:
            order[start] = None
            start = after.get(start)
    return np.array([*order], np.int64), np.array(first, np.int64)
