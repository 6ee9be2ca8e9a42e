"""A page: polygons, lines, marks and labels in units of length; its figure in matplotlib, and a small SVG of that."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]

COLOURS = ("#9db8d2", "#e3bd93", "#aecba3", "#d8a9ab", "#bcb0d4", "#d3c795")
INK, FAINT, SLAVE, INSIDE = "#30343a", "#9aa0a8", "#b3262e", "#1f5f99"
GAP = 0.55  # between panels
_UNIT = 0.62  # inches on the page for one of length
MARKS = {"own": (INK, "o", 2.6), "face": (SLAVE, "o", 4.4), "inside": (INSIDE, "s", 4.0)}


@dataclass
class Page:
    """Drawing in units of length, turned into a figure at the end."""

    polygons: list[dict[str, Any]] = field(default_factory=list)
    texts: list[dict[str, Any]] = field(default_factory=list)
    low: Array = field(default_factory=lambda: np.array([np.inf, np.inf]))
    high: Array = field(default_factory=lambda: np.array([-np.inf, -np.inf]))

    def see(self, points: Array) -> None:
        """Make room for points."""
        points = np.atleast_2d(points)
        self.low = np.minimum(self.low, points.min(axis=0))
        self.high = np.maximum(self.high, points.max(axis=0))

    def polygon(self, points: Array, face: str, edge: str = INK, width: float = 0.9, alpha: float = 1.0) -> None:
        """A filled polygon."""
        self.see(points)
        self.polygons.append({"xy": points, "fill": face, "edge": edge, "width": width, "alpha": alpha, "style": "-"})

    def line(self, points: Array, colour: str = INK, width: float = 0.9, style: str = "-") -> None:
        """A line through points."""
        self.see(points)
        self.polygons.append({"xy": points, "fill": None, "edge": colour, "width": width, "alpha": 1.0, "style": style})

    def mark(self, point: Array, kind: str, scale: float = 1.0, ring: bool = False) -> None:
        """A node: the cell's own, on the face or inside; in a ring where it carries an internal dof."""
        self.see(point)
        colour, form, size = MARKS[kind]
        if ring:
            self.polygons.append({"at": point, "form": "o", "size": 9.0 * scale, "fill": "none", "edge": colour})
        self.polygons.append({"at": point, "form": form, "size": size * scale, "fill": colour, "edge": "white"})

    def text(self, point: Array, words: str, size: float = 8.5, colour: str = INK, **rest: Any) -> None:
        """A label, centred unless `rest` says otherwise; `offset` is in points."""
        self.see(point)
        self.texts.append({"at": point, "words": words, "size": size, "colour": colour, **rest})

    def beside(self, other: Page, gap: float = GAP) -> None:
        """Put another page to the right, centred on this one's height."""
        if not np.isfinite(other.low).all():
            return
        if not np.isfinite(self.low).all():
            shift = -other.low
        else:
            middle = (self.low + self.high) / 2
            shift = np.array([self.high[0] + gap - other.low[0], middle[1] - (other.low[1] + other.high[1]) / 2])
        self.place(other, shift)

    def place(self, other: Page, shift: Array) -> None:
        """Put another page on this one, moved by `shift`."""
        for item in other.polygons:
            key = "xy" if "xy" in item else "at"
            self.polygons.append({**item, key: item[key] + shift})
        self.texts += [{**item, "at": item["at"] + shift} for item in other.texts]
        self.see(np.stack([other.low + shift, other.high + shift]))


def roomiest(face: Array, covers: list[Array]) -> tuple[float, Array]:
    """The point of a face that is farthest from its edges and from what is painted over it, and how far."""
    grid = np.linspace(0.02, 0.98, 25)
    low, high = face.min(axis=0), face.max(axis=0)
    points = low + np.stack(np.meshgrid(grid, grid, indexing="ij"), axis=-1).reshape(-1, 2) * (high - low)
    room = np.where(_inside(points, face), _to_edges(points, face), -1.0)
    for cover in covers:
        room = np.minimum(room, np.where(_inside(points, cover), -1.0, _to_edges(points, cover)))
    best = int(np.round(room, 6).argmax())
    return float(room[best]), points[best]


def _inside(points: Array, polygon: Array) -> NDArray[np.bool_]:
    """True for points in a convex polygon."""
    side = [_cross(b - a, points - a) for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True)]
    return (np.array(side) >= 0).all(axis=0) | (np.array(side) <= 0).all(axis=0)


def _to_edges(points: Array, polygon: Array) -> Array:
    """Distance of points to the edges of a polygon."""
    far = np.full(len(points), np.inf)
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        t = np.clip((points - a) @ (b - a) / max((b - a) @ (b - a), 1e-12), 0, 1)
        far = np.minimum(far, np.linalg.norm(points - a - t[:, None] * (b - a), axis=1))
    return far


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def draw(page: Page) -> Any:
    """A page as a matplotlib figure."""
    from matplotlib.figure import Figure

    pad = np.array([0.35, 0.35])
    low, high = page.low - pad, page.high + pad
    made = Figure(figsize=tuple((high - low) * _UNIT), facecolor="white")
    axes = made.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    for z, item in enumerate(_together(page.polygons)):
        _add(axes, item, z)
    for item in page.texts:
        axes.annotate(
            item["words"], item["at"], xytext=tuple(item.get("offset", (0.0, 0.0))), textcoords="offset points",
            ha="left" if item.get("left") else "center", va="center", fontsize=item["size"], color=item["colour"],
            fontweight="bold" if item.get("bold") else "normal", zorder=len(page.polygons) + 1, annotation_clip=False,
        )  # fmt: skip
    return made


def _together(items: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Merge consecutive marks of one kind into one item, which halves the size of the file."""
    for alike, run in groupby(items, key=lambda item: item.get("form") and (item["form"], item["size"], item["fill"])):
        group = list(run)
        if alike:
            yield {**group[0], "at": np.array([item["at"] for item in group]).T}
        else:
            yield from group


def _add(axes: Any, item: dict[str, Any], z: int) -> None:
    if "at" in item:
        axes.plot(
            *item["at"], marker=item["form"], markersize=item["size"], zorder=z + 1, clip_on=False, ls="none",
            markerfacecolor=item["fill"], markeredgecolor=item["edge"],
            markeredgewidth=0.5 if item["edge"] == "white" else 0.9,
        )  # fmt: skip
    elif item["fill"] is None:
        axes.plot(
            *item["xy"].T, color=item["edge"], lw=item["width"], ls=item["style"], zorder=z + 1, clip_on=False,
            solid_capstyle="round", solid_joinstyle="round",
        )  # fmt: skip
    else:
        axes.fill(
            *item["xy"].T, facecolor=item["fill"], edgecolor=item["edge"], lw=item["width"], alpha=item["alpha"],
            zorder=z + 1, clip_on=False, joinstyle="round",
        )  # fmt: skip


def save(page: Page, path: Path, name: str, title: str, about: str) -> None:
    """Write a page to a file; one name gives the same file every time. A PNG if the suffix says so."""
    import matplotlib

    settings = {"svg.hashsalt": name, "svg.fonttype": "none", "font.family": "sans-serif"}
    with matplotlib.rc_context({**settings, "font.sans-serif": ["DejaVu Sans", "Verdana"]}):
        made = draw(page)
        if path.suffix == ".png":
            made.savefig(path, dpi=130)
            return
        text = io.StringIO()
        about = f"{about}, matplotlib {matplotlib.__version__}"
        made.savefig(text, format="svg", metadata={"Date": None, "Creator": None, "Title": title, "Description": about})
    path.write_text(_slim(text.getvalue()), encoding="utf-8")


def _slim(svg: str) -> str:
    """Shorten the text of a drawing: two decimals, a path on one line, no groups of one item."""
    svg = re.sub(r"-?\d+\.\d{3,}", lambda m: f"{float(m[0]):.2f}".rstrip("0").rstrip("."), svg)
    svg = re.sub(r' transform="rotate\(-0 [^"]*"', "", svg)
    svg = re.sub(r' id="(?:line2d|patch|text)_\d+"', "", svg)
    svg = re.sub(r" ?\n(?=[LCz]|\" style)", " ", svg)
    svg = re.sub(r"<g>\s*(<(?:path|use|text)[^>]*/>)\s*</g>", r"\1", svg)
    return re.sub(r"\n\s+", "\n", svg)
