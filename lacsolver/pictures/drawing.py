"""Picture of contact: the deformed model, small, and beside it each zone by itself, where nothing hides it.

zones = fields of contacts and ties at a time                 (a solution, or the folder of a run)
model = see-through bodies around the slave skins             (lacmesh.drawing; matplotlib in a plane)
panels = in space each skin laid flat; in a plane the values over the length along it     (skins, profiles)
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.drawing import INK, OPACITY, Drawing
from lacmesh.errors import RequestError
from lacmesh.formats.output import readable, replace_file
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.view import Values, check_renderer, image_of
from lacsolver.case import Case
from lacsolver.equilibrium.state import CONTACT, SLIDES
from lacsolver.output.finished import FinishedRun
from lacsolver.output.ring import fields_of_ring, sector_of
from lacsolver.output.tables import same_time
from lacsolver.pictures.frames import DrawnSurface
from lacsolver.pictures.framing import (
    largest_closed,
    magnification,
    pressed_span,
    pressed_window,
    values_on_faces,
    window_of,
    with_skins,
)
from lacsolver.pictures.plane import along, draw_bodies, draw_faces, faces_as_lines, lines, png_of, shade, without_frame
from lacsolver.pictures.quantities import QUANTITIES, STATUS_WORDS, ColourScale, Quantity, quantity_of, zones_of
from lacsolver.pictures.skins import SkinView, macro_places, outlines, rings_of, views_of
from lacsolver.results.results import Fields, ZoneFields
from lacsolver.results.units import Units

#: room above and below a curve, relative to the span of its scale
_ROOM = 0.05
#: dots per inch; in inches the width of the model, of a panel in space and in a plane, and their heights
_DPI, _MODEL, _SPACE, _PLANE, _HIGH, _LOW = 130, 5.0, 4.2, 6.4, 3.7, 2.9
#: arrows of shear in a panel at most; length of the longest, relative to the distance of macro-elements
_ARROWS, _LONGEST = 400, 1.3
#: panels in a picture at most
_PANELS = 12


def check_plot(path: Path, dim: int) -> None:
    """Raise RequestError if no picture can be drawn: another file than .png, a package that is missing."""
    if path.suffix.lower() != ".png":
        raise RequestError(f"{path}: a picture is written as .png")
    missing = missing_packages(dim)
    if missing:
        raise RequestError(f"a plot needs {missing[0]}; pip install 'lacmesh[view]' brings it")


def missing_packages(dim: int) -> list[str]:
    """Return the packages that pictures of a model of a dimension need, and that are not installed."""
    return [package for package in ("matplotlib", "pyvista")[: dim - 1] if find_spec(package) is None]


def check_plot_of(case: Case, path: Path) -> None:
    """Raise RequestError if nothing of a case can be drawn: no contact and no tie, or as `check_plot`."""
    if not (case.contact or case.ties):
        raise RequestError("a plot shows contacts and ties, and the case has no [[contact]] and no [[tie]]")
    check_plot(path, 3 if case.model == "3d" else 2)


def plot(
    folder: str | Path,
    path: str | Path,
    *,
    field: str = "pressure",
    zone: Sequence[str] = (),
    time: float | None = None,
    zoom: bool = False,
    ring: bool = False,
    title: str | None = None,
) -> float:
    """Draw the contact of a finished run from its folder into a PNG file; return the time that is shown.

    `field`: one of `lacsolver.pictures.quantities.QUANTITIES`. `zone`: names of zones, all by default. `time`: one at
    which fields were written, the last by default. `zoom`: show only the surroundings of what is under pressure, to
    scale. `ring`: draw the whole ring of a sector. `title`: a line above. Raises RequestError for what is not there or
    cannot be drawn, ReadError, WriteError.

    >>> from tempfile import TemporaryDirectory
    >>> import lacsolver as ls
    >>> from lacmesh import example
    >>> with TemporaryDirectory() as folder:
    ...     done = ls.run(example("two_blocks.toml"), f"{folder}/results")
    ...     ls.plot(f"{folder}/results", f"{folder}/gap.png", field="gap", time=0.5)
    0.5
    """
    run, path = FinishedRun(Path(folder)), Path(path)
    mesh, fields = run.stored.mesh, run.stored.read(stored_at(run.stored.times, time))
    if ring:
        mesh, fields = fields_of_ring(mesh, fields, sector_of(run.summary))
    picture = ContactPicture.of(mesh, fields, field, zone, run.units, zoom=zoom, title=title)
    check_plot(path, mesh.dim)
    replace_file(path, picture.png())
    return float(fields.time)


def stored_at(times: Sequence[float], time: float | None) -> int:
    """Return the index of a time among those written, the last for None. Raises RequestError."""
    if not times:
        raise RequestError("the folder holds no fields to draw; run the case again")
    if time is None:
        return len(times) - 1
    near = [k for k, t in enumerate(times) if same_time(t, time)]
    if not near:
        some = ", ".join(f"{t:g}" for t in times[:8]) + (f", ... {times[-1]:g}" if len(times) > 8 else "")
        raise RequestError(f"no fields were written at t = {time:g}; there are {some}")
    return near[0]


def pictures_of(
    states: Iterable[tuple[Mesh, Fields]], field: str, scale: ColourScale, units: Units, title: str | None = None
) -> list[ContactPicture]:
    """Return pictures of a field at several times, to one scale of colours and with one magnification."""
    drawn = [ContactPicture.of(mesh, fields, field, (), units, title=title, scale=scale) for mesh, fields in states]
    times = min(picture.times for picture in drawn)
    return [replace(picture, magnified=times) for picture in drawn]


@dataclass(frozen=True, eq=False)
class ContactPicture:
    """The contact of a state, to be drawn: its mesh and `fields`, the zones that are shown, and in what colours.

    `camera`: in space, the direction from the bodies to the eye; `magnified`: factor of the displacement. None leaves
    the choice to the picture.
    """

    mesh: Mesh
    fields: Fields
    zones: Mapping[str, ZoneFields]
    quantity: Quantity
    scale: ColourScale
    units: Units
    zoom: bool = False
    title: str | None = None
    camera: tuple[float, float, float] | None = None
    magnified: float | None = None

    @classmethod
    def of(
        cls, mesh: Mesh, fields: Fields, field: str, zone: Sequence[str] = (), units: Units | None = None, *,
        zoom: bool = False, title: str | None = None, scale: ColourScale | None = None,
    ) -> ContactPicture:  # fmt: skip
        """Return the picture of a field on some zones. Raises RequestError for what is not there."""
        zones, units = zones_of(fields.zones, zone), units or Units()
        quantity = quantity_of(field, zones)
        scale = scale or ColourScale.of(quantity, zones.values(), units)
        return cls(mesh, fields, zones, quantity, scale, units, zoom, title)

    def png(self) -> bytes:
        """Return the picture as PNG. Raises WriteError if nothing can be drawn."""
        return png_of(self.figure())

    def figure(self) -> Any:
        """Return the picture as a figure of matplotlib."""
        panels = self._all_panels[:_PANELS]
        across = 1 if self.mesh.dim == 2 and len(panels) < 4 else math.ceil(math.sqrt(len(panels)))
        down = math.ceil(len(panels) / across)
        wide, high = (_PLANE, _LOW) if self.mesh.dim == 2 else (_SPACE, _HIGH)
        size = _MODEL + wide * across, max(4.6, high * down + 0.9)
        figure = import_module("matplotlib.figure").Figure(size, dpi=_DPI, layout="constrained")
        figure.suptitle(_plain(self.heading), fontsize=12)
        left, right = figure.subfigures(1, 2, width_ratios=(_MODEL, wide * across))
        self._draw_model(left, (_MODEL, size[1] - 0.6))
        axes = right.subplots(down, across, squeeze=False)
        for ax, (name, zone, view) in zip(axes.flat, panels, strict=False):
            if view is None:
                self._draw_profile(ax, name, zone)
            else:
                self._draw_skin(ax, name, zone, view)
        for ax in axes.flat[len(panels) :]:
            ax.set_axis_off()
        self._add_scale(right, axes)
        return figure

    @property
    def heading(self) -> str:
        """The line above: the quantity, the time, and what was moved."""
        time = f"t = {self.fields.time:.6g}" + (f" {self.units.time}" if self.units.time else "")
        moved = f"displacement of the model x {self.times:g}" if self.times > 1 else "displacement to scale"
        start = f"{self.title}: " if self.title else ""
        more = "" if len(self._all_panels) <= _PANELS else f", {_PANELS} of {len(self._all_panels)} panels"
        return f"{start}{self.quantity.label} at {time}; {moved}{more}"

    @cached_property
    def times(self) -> float:
        """Factor of the displacement: from near by, magnified bodies in contact would overlap."""
        if self.magnified is not None:
            return self.magnified
        if self.zoom:
            return 1.0
        return magnification(self.mesh, self.u, largest_closed(self.mesh, self.u, self.zones.values()))

    @cached_property
    def u(self) -> NDArray[np.floating]:
        """Displacement (n_nodes, 3)."""
        given = np.nan_to_num(np.asarray(self.fields.displacement, float))
        return np.pad(given, ((0, 0), (0, 3 - given.shape[1])))

    @cached_property
    def _all_panels(self) -> list[tuple[str, ZoneFields, SkinView | None]]:
        """A panel for each zone: in space a view of its skin, or two."""
        if self.mesh.dim == 2:
            return [(name, zone, None) for name, zone in self.zones.items()]
        x = self.mesh.points + self.u
        return [
            (name, zone, view) for name, zone in self.zones.items() for view in views_of(zone.surface, x, zone.macro)
        ]

    def _add_scale(self, figure: Any, axes: Any) -> None:
        """Add the scale of colours: a bar, or a line for each state that occurs."""
        if not self.scale.states:
            if self.mesh.dim == 3:
                figure.colorbar(self.scale.bar, ax=axes, label=self.scale.label, fraction=0.04, pad=0.02)
            return
        occurring = sorted({int(s) for zone in self.zones.values() for s in np.unique(zone.status)})
        patch = import_module("matplotlib.patches").Patch
        friction = any(zone.friction is not None for zone in self.zones.values())
        colours = self.scale.rgba(np.array(occurring, float))
        words = ["sticks" if friction and s == CONTACT else STATUS_WORDS.get(s, str(s)) for s in occurring]
        handles = [patch(facecolor=c, edgecolor=INK, label=w) for c, w in zip(colours, words, strict=True)]
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False, fontsize=9)

    # ---- the model

    def _draw_model(self, figure: Any, inches: tuple[float, float]) -> None:
        """Draw the model; a zoomed one in a plane once for each zone under pressure, since zones may be far apart."""
        x = self.mesh.points + self.times * self.u
        if self.mesh.dim == 2:
            near = [pressed_window([zone], x) for zone in self.zones.values()] if self.zoom else []
            windows = [window for window in near if window is not None] or near[:1] or [None]
            for axes, window in zip(figure.subplots(len(windows), squeeze=False).flat, windows, strict=True):
                self._draw_plane(axes, x, window, colours=window is windows[-1])
            return
        axes = figure.subplots()
        without_frame(axes)
        size = (round(2 * _DPI * inches[0]), round(2 * _DPI * inches[1]))
        image = import_module("matplotlib.image").imread(io.BytesIO(self._rendered(x, size)))
        axes.imshow(image)

    def _rendered(self, x: Floats, size: tuple[int, int]) -> bytes:
        """Return the model in space: see-through bodies, and the slave skins in their colours."""
        check_renderer()
        drawing = self.drawing(x, size)
        for name, zone in self.zones.items() if len(self.zones) > 1 else ():
            drawing.add_label(
                x[zone.surface.faces.distinct_nodes].mean(axis=0) - drawing.origin, readable(name), "#44546a"
            )
        return image_of(drawing.plot)

    def drawing(self, x: Floats, size: tuple[int, int]) -> Drawing:
        """Return the bodies as ghosts at points x (n_nodes, 3), around the slave skins in their colours, in pyvista."""
        mesh, value, skins = with_skins(self.mesh, x, self.zones, self.on_faces)
        none = np.zeros(mesh.n_cells, bool)
        shown = Values(self.scale.label, value, self.scale.low, self.scale.high, none, self.scale.ramp, on_skin=True)
        drawing = Drawing(mesh, skins, None, None, size, off_screen=True)
        drawing.add_bodies(OPACITY["ghost"], shown)
        drawing.add_skins(shown)
        drawing.set_camera(drawing.eye(self.camera))
        return drawing

    def _draw_plane(self, axes: Any, x: Floats, window: Floats | None, *, colours: bool) -> None:
        """Draw the model in a plane: bodies, slave skins in their colours, arrows of shear.

        `window` (2, 3): corners of what is shown, None for all; `colours`: add the scale of colours.
        """
        surface = DrawnSurface.of(self.mesh)
        points = surface.points(x)
        draw_bodies(axes, surface, points, np.full(len(points), np.nan), self.scale)
        for name, zone in self.zones.items():
            drawn = faces_as_lines(zone.surface, x)
            draw_faces(axes, drawn, self.on_faces(zone), self.scale)
            if len(self.zones) > 1:
                middle = drawn[len(drawn) // 2, 0]
                axes.annotate(_plain(name), middle, xytext=(6, 6), textcoords="offset points", fontsize=8, zorder=6)
            self._add_plane_arrows(axes, zone, x)
        axes.set_aspect("equal", anchor="C")
        axes.autoscale()
        if window is not None:
            axes.set(xlim=window[:, 0], ylim=window[:, 1])
        axes.set(xlabel=self.units.label("x", "length"), ylabel=self.units.label("y", "length"))
        if colours and not self.scale.states:
            axes.figure.colorbar(
                self.scale.bar, ax=axes, label=self.scale.label, location="bottom", fraction=0.05, aspect=40
            )

    def _add_plane_arrows(self, axes: Any, zone: ZoneFields, x: Floats) -> None:
        """Add arrows of the shear on the master, at the faces of the deformed skin."""
        if zone.friction is None or not np.any(zone.shear):
            return
        faces = zone.surface.faces.nodes[:, :2]
        _, first = np.unique(zone.macro, return_index=True)
        first = first[zone.macro[first] >= 0]
        rows = zone.macro[first]
        length = np.linalg.norm(np.ptp(x[faces], axis=1)[:, :2], axis=1)
        spacing = 2.5 * float(np.median(length))
        vectors = np.asarray(zone.shear_vector)[rows]
        place = x[faces[first]].mean(axis=1)[:, :2] + 0.35 * spacing * zone.normal[rows]
        self._arrows(axes, place, vectors, spacing)

    def _arrows(self, axes: Any, place: Floats, vectors: Floats, spacing: float) -> float:
        """Draw arrows (n, 2) at some places; return what the longest is of, in units of shear."""
        size = np.linalg.norm(vectors, axis=1)
        shears = [np.abs(np.asarray(zone.shear)) for zone in self.zones.values() if zone.friction]
        largest = max((float(shear.max(initial=0.0)) for shear in shears), default=0.0)
        on = np.flatnonzero(size > 1e-9 * largest)
        on = on[:: max(1, len(on) // _ARROWS)]
        if len(on):
            scaled = vectors[on] * (_LONGEST * spacing / largest)
            axes.quiver(
                *place[on].T, *scaled.T, angles="xy", scale_units="xy", scale=1.0, color=INK,
                edgecolor="white", linewidth=0.4, width=0.004, pivot="mid", zorder=7,
            )  # fmt: skip
        return largest

    # ---- the panels

    def on_faces(self, zone: ZoneFields) -> NDArray[np.floating]:
        """Return the value of each face of a zone (f,), NaN where there is none."""
        return values_on_faces(zone, self.quantity.of(zone))

    def _draw_skin(self, axes: Any, name: str, zone: ZoneFields, view: SkinView) -> None:
        """Draw a skin laid flat, in colours, with the outlines of macro-elements and arrows of shear."""
        ring, values = rings_of(zone.surface), self.on_faces(zone)[view.rows]
        collections = import_module("matplotlib.collections")
        if self.quantity.nodal:
            self._add_nodal(axes, view, zone.pressure_recovered[ring[view.rows]])
        else:
            colours = self.scale.rgba(values)
            drawn = collections.PolyCollection(view.paper, facecolors=colours, edgecolors=colours, linewidths=0.3)
            axes.add_collection(drawn)
        macros, ends = outlines(view, ring, zone.macro)
        thin = min(0.5, 40.0 / max(1.0, math.sqrt(len(view.rows))) / 10)
        axes.add_collection(lines(macros, color=INK, linewidth=thin))
        axes.add_collection(lines(ends, color=INK, linewidth=1.0))
        axes.set_aspect("equal")
        axes.autoscale()
        self._zoom_skin(axes, view, zone)
        for set_limits, limits, falls in zip((axes.set_xlim, axes.set_ylim), (axes.get_xlim(), axes.get_ylim()),
                                             view.flipped, strict=True):  # fmt: skip
            set_limits(sorted(limits, reverse=falls))
        axes.set(xlabel=self.units.label(view.axes[0], "length"), ylabel=self.units.label(view.axes[1], "length"))
        arrows = self._add_skin_arrows(axes, zone, view) if zone.friction is not None else ""
        axes.set_title(_plain(f"{name}, {view.words}\n{self._facts(zone)}{arrows}"), fontsize=9)

    def _add_nodal(self, axes: Any, view: SkinView, values: Floats) -> None:
        """Add values at the nodes around each face (k, 8), interpolated between them and their mean."""
        k = view.paper.shape[1]
        points = np.concatenate([view.paper, view.paper.mean(axis=1, keepdims=True)], axis=1).reshape(-1, 2)
        value = np.concatenate([values, values.mean(axis=1, keepdims=True)], axis=1).ravel()
        start = (k + 1) * np.arange(len(view.rows))[:, None]
        around = np.arange(k)
        fan = np.stack(np.broadcast_arrays(start + around, start + (around + 1) % k, start + k), axis=-1).reshape(-1, 3)
        real = (points[fan[:, 0]] != points[fan[:, 1]]).any(axis=1) & np.isfinite(value[fan]).all(axis=1)
        shade(axes, points, fan[real], value, self.scale)

    def _zoom_skin(self, axes: Any, view: SkinView, zone: ZoneFields) -> None:
        pressed = np.nan_to_num(values_on_faces(zone, zone.pressure))[view.rows] != 0
        if self.zoom and pressed.any():
            window = window_of(view.paper[pressed].reshape(-1, 2))
            axes.set(xlim=np.clip(window[:, 0], *axes.get_xlim()), ylim=np.clip(window[:, 1], *axes.get_ylim()))

    def _add_skin_arrows(self, axes: Any, zone: ZoneFields, view: SkinView) -> str:
        """Add arrows of the shear on the master; return a line that explains them, "" if there are none."""
        places = list(macro_places(view, zone.macro))
        if not places:
            return ""
        rows = np.array([row for row, _, _ in places])
        vectors = np.einsum(
            "nid,nd->ni", np.stack([basis for _, _, basis in places]), np.asarray(zone.shear_vector)[rows]
        )
        size = np.ptp(view.paper.reshape(-1, 2), axis=0)
        spacing = float(np.sqrt(max(size.prod(), (0.1 * size.max()) ** 2) / len(places)))
        largest = self._arrows(axes, np.stack([place for _, place, _ in places]), vectors, spacing)
        unit = f" {self.units.stress}" if self.units.stress else ""
        return f"\narrows: shear on the master, {largest:.4g}{unit} at most" if largest > 0 else ""

    def _facts(self, zone: ZoneFields) -> str:
        """Return what is on a zone, in a line: its extremes, and how many macro-elements are closed."""
        values = zone.pressure_recovered if self.quantity.nodal else self.quantity.of(zone)
        closed = f"{int((zone.status >= CONTACT).sum()):,} of {len(zone.status):,} closed"
        if zone.friction is not None:
            closed += f", {int((zone.status == SLIDES).sum()):,} slide"
        known = values[np.isfinite(values)]
        if self.scale.states or not len(known):
            return closed
        return f"{known.min():.4g} to {known.max():.4g}; {closed}"

    def _draw_profile(self, axes: Any, name: str, zone: ZoneFields) -> None:
        """Draw values over the length along a skin in a plane: steps of macro-elements, and what belongs to them."""
        ends, X = zone.surface.faces.nodes[:, :2], zone.surface.x
        status = self.scale.states
        quantity = QUANTITIES["pressure"] if status else self.quantity
        s, values = along(ends, values_on_faces(zone, quantity.of(zone)), X)
        axes.plot(s, values, color=INK, linewidth=1.4, label="macro-elements", zorder=4)
        if quantity.unit == "stress" and not quantity.friction:
            self._add_curves(axes, zone, ends, X)
        low, high = quantity.range_of(self.zones.values()) if status else (self.scale.low, self.scale.high)
        if zone.friction is not None and quantity.unit == "stress":
            shear = np.asarray(zone.shear)
            low, high = min(low, float(shear.min(initial=0.0))), max(high, float(shear.max(initial=0.0)))
        axes.set_ylim(low - _ROOM * (high - low), high + _ROOM * (high - low))
        if zone.friction is not None or status:
            self._add_states(axes, zone, ends, X)
        span = pressed_span(zone) if self.zoom else None
        axes.set_xlim(*(span or (0.0, float(np.nanmax(s, initial=0.0)) or 1.0)))
        axes.set_title(_plain(f"{name}: {self._facts(zone)}"), fontsize=9)
        axes.set(xlabel=self.units.label("length along the slave surface, undeformed", "length"))
        axes.set_ylabel(self.units.label(quantity.label, quantity.unit))
        axes.grid(color="#e2e5e8", linewidth=0.6)
        if len(axes.get_legend_handles_labels()[0]) > 1:
            axes.legend(frameon=False, fontsize=8, loc="best")

    def _add_curves(self, axes: Any, zone: ZoneFields, ends: Ints, X: Floats) -> None:
        """Add the recovered pressure at the nodes, and the shear of friction."""
        s, _ = along(ends, np.zeros(len(ends)), X)
        _, first = along(ends, zone.pressure_recovered[ends[:, 0]], X)
        _, last = along(ends, zone.pressure_recovered[ends[:, 1]], X)
        new = np.isfinite(s) & (np.cumsum(np.isfinite(s)) % 2 == 1)
        axes.plot(s, np.where(new, first, last), color="#2f7fb5", linewidth=1.1, label="recovered", zorder=3)
        if zone.friction is not None:
            _, shear = along(ends, values_on_faces(zone, np.asarray(zone.shear)[:, 0]), X)
            axes.plot(s, shear, color="#c2410c", linewidth=1.2, linestyle="--", label="shear", zorder=4)

    def _add_states(self, axes: Any, zone: ZoneFields, ends: Ints, X: Floats) -> None:
        """Add a band below the curves, in the colours of the states of macro-elements."""
        s, status = along(ends, values_on_faces(zone, zone.status.astype(float)), X)
        pairs = np.flatnonzero(np.isfinite(s[:-1]) & np.isfinite(s[1:]) & np.isfinite(status[:-1]))
        pairs = pairs[s[pairs + 1] > s[pairs]]
        states = ColourScale("", *QUANTITIES["status"].range_of(()), states=True)
        band = np.stack([np.stack([s[pairs], s[pairs + 1]], axis=1), np.full((len(pairs), 2), 0.03)], axis=2)
        drawn = lines(band, colors=states.rgba(status[pairs]), linewidth=7, transform=axes.get_xaxis_transform())
        axes.add_collection(drawn, autolim=False)
        if not self.scale.states:
            axes.annotate("blue sticks, orange slides", (0.01, 0.07), xycoords="axes fraction", fontsize=7)


def _plain(text: str) -> str:
    """Return text in which a dollar is only a dollar for matplotlib."""
    return readable(text).replace("$", r"\$")
