"""A run as a film, or as a sheet of pictures: the deforming bodies to scale, and growing curves beside them.

frames = fields of the run's folder, time by time          (frames)
scale = one scale of colours for all times
picture of a time = bodies by matplotlib in a plane, off-screen by pyvista in space, and curves of history.csv beside
film = an animated GIF of these, of one colour table; or a sheet of them, PNG

A natural mode is filmed in the same way, over one period of its vibration, without curves.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib import import_module
from itertools import repeat
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.drawing import BODIES, INK, fit_camera, rgb
from lacmesh.errors import RequestError, check_installed, did_you_mean
from lacmesh.formats.output import readable, replace_file
from lacmesh.mesh import Floats
from lacmesh.origin import origin_of
from lacmesh.view import check_renderer
from lacsolver.output.finished import FinishedRun
from lacsolver.output.modes import read_modes
from lacsolver.output.names import HISTORY, MODES_PVD
from lacsolver.output.tables import read_table
from lacsolver.pictures.drawing import pictures_of
from lacsolver.pictures.frames import COLOURS, SHAPE, Frame, Frames, even_times, read_frames, read_mode
from lacsolver.pictures.plane import draw_bodies, draw_faces, level_out, png_of, without_frame
from lacsolver.pictures.quantities import QUANTITIES, ColourScale, quantity_of

#: default direction from bodies in space to the eye
CAMERA = (-0.55, -1.0, 0.6)
#: default number of pictures of a sheet and of a film
SHEET, FILM = 6, 60
#: number of pictures of a natural mode's period
_PERIOD = 24
#: default range of a logarithmic scale
DECADES = 3.0
#: dots per inch; in inches, widths of bodies and curves, and their height
_DPI, _WIDE, _HIGH = 80, (6.2, 3.8), 4.6
#: colours of a film
_COLOURS = 128
#: width of a sheet in pixels, and at least that of a picture
_SHEET_WIDE = 2000
#: duration of the last picture of a film, in seconds
_STAYS = 1.5


class Curve(NamedTuple):
    """Two columns of a history, `x` and `y` (steps,) at `time` (steps,), and their labels `across` and `up`."""

    time: Floats
    x: Floats
    y: Floats
    across: str
    up: str


def check_film(path: Path, folder: Path) -> None:
    """Raise RequestError if no film can be made: another suffix, no folder, a package that is missing."""
    if path.suffix.lower() not in (".gif", ".png"):
        raise RequestError(f"{path}: a film is written as .gif, a sheet of its pictures as .png")
    if not folder.is_dir():
        raise RequestError(f"{folder} is no folder; name the one that lacsolver run wrote")
    check_installed("matplotlib", "view", "a film")


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
    mode: int | None = None,
) -> None:
    """Make a film (.gif) or a sheet of pictures (.png) from the fields that `lacsolver.run` wrote into a folder.

    `mode`: number of a natural mode, from 1, in a folder of `lacsolver modes`, to be filmed over one period; it has no
    curves, and is coloured by its displacement.

    `colour`: the bodies' von Mises `stress`, or the recovered contact `pressure` on slave skins; or another field of
    `lacsolver.plot`, such as `status` or `gap`, which shows each zone by itself, and no curves. `curves`: "x:y",
    columns of history.csv, each with a minus in front to change its sign; by default `default_curve`. `frames`: largest
    number of times shown, evenly spaced (default: 60 for a film, 6 for a sheet). `scale`: least and largest value of
    the colours, by default those of all times; `log`: a logarithmic scale, by default of three decades. `camera`: in
    space, the direction from the bodies to the eye. `rate`: pictures per second.

    Raises RequestError for an invalid request, ReadError, DataError for files that cannot be read, WriteError if
    nothing can be drawn or written.

    >>> from tempfile import TemporaryDirectory
    >>> from lacsolver import read_case, run
    >>> from lacsolver.output import create_output
    >>> with TemporaryDirectory() as folder:
    ...     done = run(read_case("data/two_blocks.toml"), create_output(folder))
    ...     film(folder, f"{folder}/press.png", colour="pressure", frames=2)
    """
    folder, path = Path(folder), Path(path)
    check_film(path, folder)
    if frames is not None and frames < 1:
        raise RequestError(f"a film has at least one frame, not {frames}")
    if not (np.isfinite(rate) and 0 < rate <= 100):
        raise RequestError(f"a film shows more than 0 and at most 100 pictures a second, not {rate:g}")
    moving = path.suffix.lower() == ".gif"
    count = frames or ((FILM if mode is None else _PERIOD) if moving else SHEET)
    if mode is not None or colour not in QUANTITIES or colour in COLOURS:
        shown, drawn, colour = _frames(folder, colour, mode, curves, count)
        if shown.surface.dim == 3:
            check_installed("pyvista", "view", "a film in space")
        title = title or (folder.name if mode is None else _mode_title(folder, mode))
        bar = ColourScale(COLOURS.get(colour, SHAPE), **_ends(scale, log, shown.span))
        images = list(_images(shown, bar, drawn, readable(title), camera))
    elif curves:
        raise RequestError(f"a film of {colour} shows the contacts, and has no curves; leave --curve out")
    else:
        images = _contact_images(folder, colour, count, scale, log, camera, title or folder.name)
    replace_file(path, _gif(images, rate, _STAYS if mode is None else 0.0) if moving else _png(_tiled(images)))


def _frames(
    folder: Path, colour: str, mode: int | None, curves: Sequence[str], count: int
) -> tuple[Frames, list[Curve], str]:
    """Return the frames of a run or of a natural mode, the curves beside them, and what the bodies are coloured by."""
    if mode is None:
        if (folder / MODES_PVD).exists() and not (folder / HISTORY).exists():
            raise RequestError(f"{folder} holds natural modes, and not a run; name one of them by --mode")
        drawn = _curves(folder, curves)
        return read_frames(folder, colour, count), drawn, colour
    if curves:
        raise RequestError("a natural mode has no history to draw curves of; leave --curve out")
    return read_mode(folder, mode, count), [], "shape"


def _mode_title(folder: Path, number: int) -> str:
    """Return the title of a natural mode: its number and frequency, or its motion as a rigid body."""
    modes = read_modes(folder)
    vibrating = number - modes["rigid"]
    said = f"f = {modes['frequencies'][vibrating - 1]:.6g}" if vibrating > 0 else modes["rigid_motions"][number - 1]
    return f"mode {number}, {said}"


def _contact_images(
    folder: Path, field: str, count: int, ends: tuple[float, float] | None, log: bool,
    camera: tuple[float, float, float], title: str,
) -> list[Any]:  # fmt: skip
    """Return the pictures of a field on the zones of contact at several times, to one scale, with one magnification."""
    run = FinishedRun(folder)
    units, stored = run.units, run.stored
    states = [(stored.mesh, stored.read(k)) for k in even_times(stored.times, count)]
    zones = [zone for _, fields in states for zone in fields.zones.values()]
    quantity = quantity_of(field, states[-1][1].zones)
    scale = ColourScale.of(quantity, zones, units)
    if not scale.states:
        scale = replace(scale, **_ends(ends, log, (scale.low, scale.high)))
    pictures = pictures_of(states, field, scale, units, title)
    return [_image(replace(picture, camera=camera).figure()) for picture in pictures]


def _tiled(images: list[Any]) -> Any:
    """Return pictures of one size as a sheet, as many side by side as its width takes."""
    wide, high = images[0].size
    across = min(max(1, _SHEET_WIDE // wide), len(images))
    sheet = import_module("PIL.Image").new("RGB", (across * wide, -(-len(images) // across) * high), "white")
    for k, image in enumerate(images):
        sheet.paste(image, (k % across * wide, k // across * high))
    return sheet


def _ends(scale: tuple[float, float] | None, log: bool, span: tuple[float, float]) -> dict[str, Any]:
    """Return the ends of a scale, those that are wanted or those of the values. Raises RequestError."""
    low, high = scale or span
    if scale is None and log:
        high = high if high > 0 else 1.0
        low = high / 10**DECADES
    if not low < high or (log and low <= 0):
        what = "0 < low < high" if log else "low < high"
        raise RequestError(f"a scale of colours from {low:g} to {high:g} is none; it needs {what}")
    return {"low": float(low), "high": float(high), "log": log}


# ---- curves


def _curves(folder: Path, named: Sequence[str]) -> list[Curve]:
    table = read_table(folder / HISTORY)
    named = named or [default_curve(table)]
    return [_curve(name, table) for name in named if name]


def default_curve(table: dict[str, NDArray[np.floating]]) -> str:
    """Return the default curve: the most varying reaction over the displacement of the probe of the same name.

    A reaction without such a probe is drawn over time, if no other has one; an empty string if there is no reaction.

    >>> default_curve({"time": np.r_[0, 1], "reaction.top.y": np.r_[0, -5], "probe.top.uy": np.r_[0, -1]})
    'probe.top.uy:reaction.top.y'
    """
    span = {name: np.ptp(v[np.isfinite(v)]) for name, v in table.items() if np.isfinite(v).any()}
    reactions = [name for name in table if name.startswith("reaction.") and name in span]
    for name in sorted(reactions, key=lambda name: -span[name]):
        _, _, rest = name.partition(".")
        group, _, axis = rest.rpartition(".")
        if span.get(f"probe.{group}.u{axis}", 0.0) > 0:
            return f"probe.{group}.u{axis}:{name}"
    return f"time:{max(reactions, key=lambda name: span[name])}" if reactions else ""


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


def _images(
    frames: Frames, scale: ColourScale, curves: Sequence[Curve], title: str, camera: tuple[float, float, float]
) -> Iterator[Any]:
    """Yield a picture of each time: the bodies, and beside them the curves up to that time."""
    n = 1 + bool(curves)
    rendered = _rendered(frames, scale, camera) if frames.surface.dim == 3 else repeat(None)
    for frame, image in zip(frames.frames, rendered, strict=False):
        size = sum(_WIDE[:n]), _HIGH
        figure = import_module("matplotlib.figure").Figure(figsize=size, dpi=_DPI, layout="constrained")
        bodies, *rest = figure.subplots(1, n, width_ratios=_WIDE[:n], squeeze=False)[0]
        without_frame(bodies)
        if image is None:
            _draw_plane(bodies, frames, frame, scale)
        else:
            bodies.imshow(image)
        figure.colorbar(scale.bar, ax=bodies, label=scale.label, location="bottom", shrink=0.7, pad=0.02, aspect=40)
        for axes in rest:
            _draw_curves(axes, curves, frame.time)
        figure.suptitle(f"{title}, {frame.words}", fontsize=11)
        yield _image(figure)


def _rendered(frames: Frames, scale: ColourScale, camera: tuple[float, float, float]) -> Iterator[NDArray[np.uint8]]:
    """Yield the rendered picture of each time in space."""
    check_renderer()
    surface, size = frames.surface, (round(_WIDE[0] * 2 * _DPI), round(_HIGH * 2 * _DPI))
    x = np.stack([frame.x for frame in frames.frames])
    x = x - origin_of(x[:, surface.drawn].reshape(-1, 3))  # a graphics card counts with seven digits
    pyvista = import_module("pyvista")
    plot = pyvista.Plotter(off_screen=True, window_size=list(size))
    plot.set_background("white")
    faces = pyvista.PolyData.from_regular_faces(x[0], surface.triangles)
    faces["colour"] = _rgb(frames.frames[0], scale)
    edges = pyvista.PolyData(x[0], lines=np.insert(surface.edges, 0, 2, axis=1))
    plot.add_mesh(faces, scalars="colour", rgb=True, smooth_shading=False, ambient=0.65, diffuse=0.45)
    plot.add_mesh(edges, color=INK, opacity=0.35, line_width=1, lighting=False)
    eye = np.asarray(camera) / np.linalg.norm(camera)
    fit_camera(plot, x[:, surface.drawn].reshape(-1, 3), eye, size, 0.015, 0.985)
    for k, frame in enumerate(frames.frames):
        faces.points = edges.points = x[k]
        faces["colour"] = _rgb(frame, scale)
        plot.render()
        yield np.array(plot.screenshot(return_img=True))
    plot.close()


def _rgb(frame: Frame, scale: ColourScale) -> NDArray[np.uint8]:
    """Return the colour of each point, (p, 3)."""
    colours = scale.bar.to_rgba(np.nan_to_num(frame.value, nan=scale.low), bytes=True)[:, :3].copy()
    colours[np.isnan(frame.value)] = rgb(BODIES[:1])
    return np.asarray(colours, np.uint8)


def _draw_plane(axes: Any, frames: Frames, frame: Frame, scale: ColourScale) -> None:
    """Draw the bodies of a plane at one time, and the slave skins where their nodes alone have values."""
    surface = frames.surface
    draw_bodies(axes, surface, frame.x, frame.value, scale)
    inside = np.isfinite(frame.value)[surface.triangles].all(axis=1)
    if not inside.any():
        ends = frame.value[surface.outline]
        draw_faces(axes, frame.x[surface.outline][..., :2], ends.mean(axis=1), scale)
    low, high = frames.box[:, :2]
    room = 0.02 * max(high - low)
    axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room), aspect="equal")


def _draw_curves(axes: Any, curves: Sequence[Curve], now: float) -> None:
    """Draw curves: pale as a whole, strong up to a time, which has a dot."""
    for k, (time, x, y, _, up) in enumerate(curves):
        on = time <= now * (1 + 1e-12)
        axes.plot(x, y, color=f"C{k}", linewidth=0.8, alpha=0.3)
        axes.plot(x[on], y[on], color=f"C{k}", linewidth=1.6, label=up)
        axes.plot(np.interp(now, time, x), np.interp(now, time, y), "o", color=f"C{k}", markersize=4)
    level_out(axes, np.concatenate([curve.y for curve in curves]))
    axes.grid(color="#e2e5e8", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set(xlabel=curves[0].across, ylabel=curves[0].up if len(curves) == 1 else "")
    if len(curves) > 1:
        axes.legend(frameon=False, fontsize=8)


def _image(figure: Any) -> Any:
    """Return a figure as an image of Pillow."""
    return import_module("PIL.Image").open(io.BytesIO(png_of(figure))).convert("RGB")


def _gif(images: list[Any], rate: float, stays: float) -> bytes:
    """Return an animated GIF; all images share one table of colours, so that nothing flickers."""
    pil = import_module("PIL.Image")
    few = [images[k] for k in np.unique(np.linspace(0, len(images) - 1, 5).round().astype(int))]
    strip = pil.new("RGB", (few[0].width, few[0].height * len(few)))
    for k, image in enumerate(few):
        strip.paste(image, (0, k * image.height))
    table = strip.quantize(_COLOURS, method=pil.Quantize.MEDIANCUT)
    flat = [image.quantize(palette=table, dither=pil.Dither.NONE) for image in images]
    lasts = [round(1000 / rate)] * (len(flat) - 1) + [round(1000 * (stays or 1 / rate))]
    out = io.BytesIO()
    flat[0].save(out, "GIF", save_all=True, append_images=flat[1:], duration=lasts, loop=0, optimize=False, disposal=1)
    return out.getvalue()


def _png(image: Any) -> bytes:
    """Return an image as a PNG file with a table of colours, which takes a third of the size of one without."""
    out, pil = io.BytesIO(), import_module("PIL.Image")
    image.quantize(2 * _COLOURS, method=pil.Quantize.MEDIANCUT, dither=pil.Dither.NONE).save(out, "PNG", optimize=True)
    return out.getvalue()
