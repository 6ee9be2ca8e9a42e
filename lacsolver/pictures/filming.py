"""A run as a film, or as a sheet of pictures: the deforming bodies to scale, and growing curves beside them.

shots = fields of the run's folder, time by time           (shots)
look = one scale of colours for all times
pictures = drawn by matplotlib in a plane, off-screen by pyvista in space       (stage)
curves = columns of history.csv, one against the other
film = an animated GIF of one colour table; or a sheet, PNG
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import ReadError, RequestError, did_you_mean
from lacmesh.formats.output import readable, replace_file
from lacmesh.mesh import Floats
from lacmesh.scene.colours import RAMP
from lacsolver.output.names import HISTORY
from lacsolver.pictures.shots import COLOURS, Shot, Shots, Sight, read_shots
from lacsolver.pictures.stage import CAMERA, Scene, photographs

#: default number of pictures of a sheet and of a film
SHEET, FILM = 6, 60
#: default range of a logarithmic scale
DECADES = 3.0
#: dots per inch of a film and of a sheet; in inches, widths of a film's bodies and curves, their height, and the width
#: of a picture of a sheet
_DPI, _DPI_SHEET, _WIDE, _HIGH, _TILE = 80, 100, (6.2, 3.8), 4.6, 3.7
#: colours of a film
_COLOURS = 128
#: duration of the last picture of a film, in seconds
_STAYS = 1.5
#: colours of faces without a value, of surfaces without parent cells, of lines
_PLAIN, _BARE, _INK = "#dfe3e6", "#44546a", "#1b1f24"


class Curve(NamedTuple):
    """Two columns of a history, `x` and `y` (steps,) at `time` (steps,), and their labels `across` and `up`."""

    time: Floats
    x: Floats
    y: Floats
    across: str
    up: str


@dataclass(frozen=True)
class Look:
    """Scale of colours. `colour`: one of COLOURS; `low`, `high`: ends of the scale; `log`: True if logarithmic."""

    colour: str
    low: float
    high: float
    log: bool

    @property
    def scale(self) -> Any:
        """Scale of matplotlib from values to 0 ... 1."""
        colours = import_module("matplotlib.colors")
        return (colours.LogNorm if self.log else colours.Normalize)(self.low, self.high, clip=True)

    @property
    def bar(self) -> Any:
        """Mappable of matplotlib for a bar of colours, whose low values are light."""
        colours = import_module("matplotlib.colors")
        table = colours.LinearSegmentedColormap.from_list("ramp", [f"#{colour}" for colour in reversed(RAMP)])
        return import_module("matplotlib.cm").ScalarMappable(self.scale, table)


def check_film(path: Path, folder: Path) -> None:
    """Raise RequestError if no film can be made: another suffix, no folder, a package that is missing."""
    if path.suffix.lower() not in (".gif", ".png"):
        raise RequestError(f"{path}: a film is written as .gif, a sheet of its pictures as .png")
    if not folder.is_dir():
        raise RequestError(f"{folder} is no folder; name the one that lacsolver run wrote")
    if find_spec("matplotlib") is None:
        raise RequestError("a film needs matplotlib; pip install 'lacmesh[view]' brings it")


def film(
    folder: str | Path,
    path: str | Path,
    *,
    colour: str = "stress",
    curves: Sequence[str] = (),
    frames: int | None = None,
    scale: tuple[float, float] | None = None,
    log: bool = False,
    camera: tuple[float, float, float] = CAMERA,
    rate: float = 12.0,
    title: str | None = None,
) -> None:
    """Make a film (.gif) or a sheet of pictures (.png) from the VTU files that `lacsolver.run` wrote into a folder.

    `colour`: the bodies' von Mises `stress`, or the recovered contact `pressure` on slave skins. `curves`: "x:y",
    columns of history.csv, each with a minus in front to change its sign; by default `default_curve`. `frames`: largest
    number of times shown, evenly spaced (default: 60 for a film, 6 for a sheet). `scale`: least and largest value of
    the colours, by default those of all times; `log`: a logarithmic scale, by default of three decades. `camera`: in
    space, the direction from the bodies to the eye. `rate`: pictures per second.

    Raises RequestError for an invalid request, ReadError, DataError for files that cannot be read, WriteError if
    nothing can be drawn or written.

    >>> from tempfile import TemporaryDirectory
    >>> from lacsolver import create, read_case, run
    >>> with TemporaryDirectory() as folder:
    ...     done = run(read_case("data/two_blocks.toml"), create(folder))
    ...     film(folder, f"{folder}/press.png", colour="pressure", frames=2)
    """
    folder, path = Path(folder), Path(path)
    check_film(path, folder)
    if frames is not None and frames < 1:
        raise RequestError(f"a film has at least one frame, not {frames}")
    if not (np.isfinite(rate) and 0 < rate <= 100):
        raise RequestError(f"a film shows more than 0 and at most 100 pictures a second, not {rate:g}")
    drawn = _curves(folder, curves)
    moving = path.suffix.lower() == ".gif"
    shots = read_shots(folder, colour, frames or (FILM if moving else SHEET))
    if shots.sight.dim == 3 and find_spec("pyvista") is None:
        raise RequestError("a film in space needs pyvista; pip install 'lacmesh[view]' brings it")
    sheet = _Sheet(shots, _look(shots, colour, scale, log), drawn, readable(title or folder.name), camera, path)
    replace_file(path, _moving(sheet, rate) if moving else _still(sheet))


def _look(shots: Shots, colour: str, scale: tuple[float, float] | None, log: bool) -> Look:
    low, high = scale or shots.span
    if scale is None:
        high = high if high > 0 else 1.0
        low = high / 10**DECADES if log else min(low, 0.0)
    if not low < high or (log and low <= 0):
        what = "0 < low < high" if log else "low < high"
        raise RequestError(f"a scale of colours from {low:g} to {high:g} is none; it needs {what}")
    return Look(colour, float(low), float(high), log)


# ---- curves


def _curves(folder: Path, named: Sequence[str]) -> list[Curve]:
    table = read_history(folder / HISTORY)
    named = named or [default_curve(table)]
    return [_curve(name, table) for name in named if name]


def read_history(path: Path) -> dict[str, NDArray[np.floating]]:
    """Return the columns of history.csv, NaN for empty fields. Raises ReadError."""
    try:
        with path.open(encoding="utf-8", errors="surrogateescape", newline="") as file:
            heads, *rows = list(csv.reader(file))
        values = [[float(cell) if cell else np.nan for cell in row] for row in rows]
        return dict(zip(heads, np.array(values, float).reshape(-1, len(heads)).T, strict=True))
    except OSError as error:
        raise ReadError(path, f"cannot be read ({error.strerror or error})") from error
    except ValueError as error:
        raise ReadError(path, f"is damaged ({error}); run the case again") from error


def default_curve(table: dict[str, NDArray[np.floating]]) -> str:
    """Return the default curve: the most varying reaction over the displacement of the probe of the same name.

    A reaction without such a probe is drawn over time, if no other has one; an empty string if there is no reaction.

    >>> default_curve({"time": np.r_[0, 1], "reaction.top.y": np.r_[0, -5], "probe.top.uy": np.r_[0, -1]})
    'probe.top.uy:reaction.top.y'
    """
    span = {name: np.ptp(v[np.isfinite(v)]) for name, v in table.items() if np.isfinite(v).any()}
    told = [name for name in table if name.startswith("reaction.") and name in span]
    for name in sorted(told, key=lambda name: -span[name]):
        _, _, rest = name.partition(".")
        group, _, axis = rest.rpartition(".")
        if span.get(f"probe.{group}.u{axis}", 0.0) > 0:
            return f"probe.{group}.u{axis}:{name}"
    return f"time:{max(told, key=lambda name: span[name])}" if told else ""


def _curve(text: str, table: dict[str, NDArray[np.floating]]) -> Curve:
    names = text.split(":")
    if len(names) != 2:
        raise RequestError(f"{text!r} is no curve; write two columns of {HISTORY} as time:reaction.GROUP.y")
    values = []
    for name in names:
        sign, column = (-1.0, name[1:]) if name.startswith("-") else (1.0, name)
        if column not in table:
            raise RequestError(f"{HISTORY} has no column {column!r}{did_you_mean(column, table)}")
        values.append(sign * table[column] + 0.0)
    return Curve(table["time"], values[0], values[1], *(name.replace("-", "\N{MINUS SIGN}", 1) for name in names))


# ---- pictures


@dataclass(frozen=True, eq=False)
class _Sheet:
    """Everything to be drawn."""

    shots: Shots
    look: Look
    curves: list[Curve]
    title: str
    camera: tuple[float, float, float]
    path: Path

    @property
    def height(self) -> float:
        """Height of the picture of a time, relative to its width."""
        if self.shots.sight.dim == 3:
            return 0.75
        wide, high, _ = np.diff(self.shots.box, axis=0)[0]
        return float(np.clip(high / wide, 0.25, 1.4))

    def photographs(self, inches: tuple[float, float]) -> list[Any]:
        """Return the rendered picture of each time in space; None for each in a plane."""
        shots, sight = self.shots.shots, self.shots.sight
        if sight.dim == 2:
            return [None] * len(shots)
        x, rgb = np.stack([shot.x for shot in shots]), np.stack([self._rgb(shot) for shot in shots])
        size = (round(inches[0] * 2 * _DPI), round(inches[1] * 2 * _DPI))
        scene = Scene(sight.triangles, sight.edges, x, rgb, np.asarray(self.camera, float), size)
        return list(photographs(scene, self.path))

    def _rgb(self, shot: Shot) -> NDArray[np.uint8]:
        """Return the colour of each point, (p, 3)."""
        rgb = self.look.bar.to_rgba(np.nan_to_num(shot.value, nan=self.look.low), bytes=True)[:, :3].copy()
        rgb[np.isnan(shot.value)] = [int(_PLAIN[k : k + 2], 16) for k in (1, 3, 5)]
        return np.asarray(rgb, np.uint8)

    def draw(self, axes: Any, shot: Shot, photograph: Any) -> None:
        """Draw the bodies at one time."""
        _bare(axes)
        if photograph is not None:
            axes.imshow(photograph)
            return
        _draw_plane(axes, self.shots.sight, shot, self.look)
        low, high = self.shots.box[:, :2]
        room = 0.02 * max(high - low)
        axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room), aspect="equal")

    def plot(self, axes: Any, marked: Sequence[float]) -> None:
        """Draw the curves: pale as a whole, strong up to the last of the times `marked`, which have dots."""
        for k, (time, x, y, _, up) in enumerate(self.curves):
            on = time <= marked[-1] * (1 + 1e-12)
            axes.plot(x, y, color=f"C{k}", linewidth=0.8, alpha=0.3)
            axes.plot(x[on], y[on], color=f"C{k}", linewidth=1.6, label=up)
            axes.plot(np.interp(marked, time, x), np.interp(marked, time, y), "o", color=f"C{k}", markersize=4)
        axes.grid(color="#e2e5e8", linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
        axes.set(xlabel=self.curves[0].across, ylabel=self.curves[0].up if len(self.curves) == 1 else "")
        if len(self.curves) > 1:
            axes.legend(frameon=False, fontsize=8)

    def add_bar(self, figure: Any, axes: Any, **place: Any) -> None:
        """Add the bar of colours with its label."""
        figure.colorbar(self.look.bar, ax=axes, label=COLOURS[self.look.colour], **place)


def _draw_plane(axes: Any, sight: Sight, shot: Shot, look: Look) -> None:
    """Draw faces coloured by values, edges, outlines, surfaces without parent cells, and pressures on slave skins."""
    x, valued = shot.x[:, :2], np.isfinite(shot.value)
    whole = valued[sight.triangles].all(axis=1)
    lines = import_module("matplotlib.collections").LineCollection
    if not whole.all():
        plain = x[sight.triangles[~whole]]
        axes.add_collection(import_module("matplotlib.collections").PolyCollection(plain, color=_PLAIN, linewidth=0.3))
    if whole.any():
        triangles = import_module("matplotlib.tri").Triangulation(*x.T, sight.triangles[whole])
        value = np.nan_to_num(shot.value, nan=look.low)
        axes.tripcolor(triangles, value, shading="gouraud", norm=look.scale, cmap=look.bar.cmap, rasterized=True)
    axes.add_collection(lines(x[sight.edges], color=_INK, linewidth=0.25, alpha=0.35))
    axes.add_collection(lines(x[sight.rims], color=_INK, linewidth=0.8))
    axes.add_collection(lines(x[sight.bare], color=_BARE, linewidth=2.5, capstyle="round"))
    on = valued[sight.rims].all(axis=1)
    if look.colour == "pressure" and on.any():
        value = shot.value[sight.rims[on]].mean(axis=1)
        colours = look.bar.to_rgba(value)
        axes.add_collection(lines(x[sight.rims[on]], colors=colours, linewidth=4, capstyle="round", zorder=3))


def _bare(axes: Any) -> None:
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def _figure(wide: float, high: float, dpi: int = _DPI) -> Any:
    return import_module("matplotlib.figure").Figure(figsize=(wide, high), dpi=dpi, layout="constrained")


def _image(figure: Any) -> Any:
    """Return a figure as an image of Pillow."""
    out = io.BytesIO()
    figure.savefig(out, format="png")
    return import_module("PIL.Image").open(out).convert("RGB")


def _moving(sheet: _Sheet, rate: float) -> bytes:
    """Return the film: the bodies at each time, and the curves up to that time beside them."""
    images, n = [], 1 + bool(sheet.curves)
    for shot, photograph in zip(sheet.shots.shots, sheet.photographs((_WIDE[0], _HIGH)), strict=True):
        figure = _figure(sum(_WIDE[:n]), _HIGH)
        bodies, *rest = figure.subplots(1, n, width_ratios=_WIDE[:n], squeeze=False)[0]
        sheet.draw(bodies, shot, photograph)
        sheet.add_bar(figure, bodies, location="bottom", shrink=0.7, pad=0.02, aspect=40)
        for axes in rest:
            sheet.plot(axes, [shot.time])
        figure.suptitle(f"{sheet.title}, t = {shot.time:.4g}", fontsize=11)
        images.append(_image(figure))
    return _gif(images, rate)


def _gif(images: list[Any], rate: float) -> bytes:
    """Return an animated GIF; all images share one table of colours, so that nothing flickers."""
    pil = import_module("PIL.Image")
    few = [images[k] for k in np.unique(np.linspace(0, len(images) - 1, 5).round().astype(int))]
    strip = pil.new("RGB", (few[0].width, few[0].height * len(few)))
    for k, image in enumerate(few):
        strip.paste(image, (0, k * image.height))
    table = strip.quantize(_COLOURS, method=pil.Quantize.MEDIANCUT)
    flat = [image.quantize(palette=table, dither=pil.Dither.NONE) for image in images]
    lasts = [round(1000 / rate)] * (len(flat) - 1) + [round(1000 * _STAYS)]
    out = io.BytesIO()
    flat[0].save(out, "GIF", save_all=True, append_images=flat[1:], duration=lasts, loop=0, optimize=False, disposal=1)
    return out.getvalue()


def _still(sheet: _Sheet) -> bytes:
    """Return the sheet: rows of pictures titled by their times, and below them the curves with dots at these times."""
    shots, n = sheet.shots.shots, 1 + bool(sheet.curves)
    across = min(3, len(shots))
    down = -(-len(shots) // across)
    tall = _TILE * sheet.height
    high = [down * (tall + 0.25) + 0.8, _TILE * 0.7][:n]
    figure = _figure(_TILE * across, sum(high), _DPI_SHEET)
    upper, *lower = figure.subfigures(n, 1, height_ratios=high, squeeze=False)[:, 0]
    tiles = upper.subplots(down, across, squeeze=False)
    for axes in tiles.flat:
        _bare(axes)
    for axes, shot, photograph in zip(tiles.flat, shots, sheet.photographs((_TILE, tall)), strict=False):
        sheet.draw(axes, shot, photograph)
        axes.set_title(f"t = {shot.time:.4g}", fontsize=9)
    sheet.add_bar(upper, tiles, location="bottom", shrink=0.5, pad=0.02, aspect=40)
    for part in lower:
        sheet.plot(part.subplots(), [shot.time for shot in shots])
    upper.suptitle(sheet.title, fontsize=11)
    return _png(_image(figure))


def _png(image: Any) -> bytes:
    """Return an image as a PNG file with a table of colours, which takes a third of the size of one without."""
    out, pil = io.BytesIO(), import_module("PIL.Image")
    image.quantize(2 * _COLOURS, method=pil.Quantize.MEDIANCUT, dither=pil.Dither.NONE).save(out, "PNG", optimize=True)
    return out.getvalue()
