"""Quantities of contact that pictures show: what each is, its values on a zone, its colours and its unit.

QUANTITIES has a row for each. A quantity has one palette in every picture, film and page: light where it is low, dark
where it is high; what a macro-element does (`status`) has a colour for each state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.drawing import RAMP
from lacmesh.errors import RequestError, did_you_mean
from lacmesh.mesh import Floats
from lacsolver.equilibrium.state import CONTACT, OPEN, SLIDES, UNPAIRED
from lacsolver.results.results import ZoneFields
from lacsolver.results.units import Units

#: a result from its low end to its high one: light to dark, so that what is large stands out on light bodies
RESULT = RAMP[::-1]
#: states of a macro-element: unpaired, open, closed (or sticking), sliding
STATES = ("#ffffff", "#c9d1da", "#2b6cb0", "#e8701a")


class Quantity(NamedTuple):
    """A quantity: its `label`, its `unit` (a name in Units, "" without one), and its values (n,) on a zone's rows.

    `friction`: only contacts with friction have it. `nodal`: its values are at nodes, interpolated over the faces.
    """

    label: str
    unit: str
    values: Callable[[ZoneFields], Floats]
    friction: bool = False
    nodal: bool = False

    def of(self, zone: ZoneFields) -> NDArray[np.floating]:
        """Return the values on the macro-elements of a zone (n,), NaN if the zone has none."""
        if self.friction and zone.friction is None:
            return np.full(len(zone.status), np.nan)
        values = np.array(self.values(zone), float)
        values[np.abs(values) <= _ROUND_OFF * _size(zone, self.unit)] = 0.0
        return values

    def range_of(self, zones: Iterable[ZoneFields]) -> tuple[float, float]:
        """Return the ends of a scale of colours for some zones; 0 is part of it."""
        if self is QUANTITIES["status"]:
            return float(UNPAIRED), float(SLIDES)
        parts = [zone.pressure_recovered if self.nodal else self.of(zone) for zone in zones]
        return ends_of(np.concatenate([np.zeros(0), *parts]), zero=True)


def _size(zone: ZoneFields, unit: str) -> float:
    """Return the size that round-off of values in a unit is relative to: of coordinates, or of pressures."""
    sizes = {"length": zone.surface.x, "stress": zone.pressure}
    return float(np.abs(sizes[unit]).max(initial=0.0)) if unit in sizes else 0.0


def _length(vectors: Floats | None) -> Floats:
    return np.linalg.norm(np.asarray(vectors), axis=1)


def _of_friction(name: str) -> Callable[[ZoneFields], Floats]:
    return lambda zone: getattr(zone.friction, name)


#: values of this size, relative to coordinates or to pressures, are 0: a picture would show round-off as differences
_ROUND_OFF = 1e-12
#: what `lacsolver plot --field` may name
QUANTITIES: Mapping[str, Quantity] = {
    "pressure": Quantity("contact pressure", "stress", lambda zone: zone.pressure),
    "recovered": Quantity("recovered contact pressure", "stress", lambda zone: zone.recovered, nodal=True),
    "gap": Quantity("gap", "length", lambda zone: zone.gap),
    "status": Quantity("contact status", "", lambda zone: zone.status.astype(float)),
    "slip": Quantity("slip of the step", "length", lambda zone: _length(zone.slip), friction=True),
    "shear": Quantity("shear traction of friction", "stress", lambda zone: _length(zone.shear), friction=True),
    "path": Quantity("length slipped so far", "length", _of_friction("path"), friction=True),
    "use": Quantity("shear traction relative to its bound", "", _of_friction("use"), friction=True),
}
#: the states of macro-elements, as STATES has their colours; those with friction stick where others are closed
STATUS_WORDS = {UNPAIRED: "no master opposite", OPEN: "open", CONTACT: "closed", SLIDES: "slides"}


def ends_of(values: Floats, *, zero: bool = False, least: float = 0.01) -> tuple[float, float]:
    """Low and high end of a scale for values, NaN left out; (0, 1) where all are 0 or there is none.

    `zero`: 0 is part of the scale. The span is at least `least` of the larger end, so that round-off is not shown as a
    difference: uniform values lie in its middle, or with `zero` at one end.

    >>> ends_of(np.array([5 - 1e-15, 5, np.nan]), zero=True), ends_of(np.array([5.0, 5.0]), least=0.2)
    ((0.0, 5.0), (4.5, 5.5))
    """
    known = np.append(values[np.isfinite(values)], [0.0] * zero)
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    size = max(abs(low), abs(high))
    if size < 1e-200:
        return 0.0, 1.0
    lacking = least * size - (high / 2 - low / 2) * 2
    return (low - lacking / 2, high + lacking / 2) if lacking > 0 else (low, high)


def quantity_of(name: str, zones: Mapping[str, ZoneFields]) -> Quantity:
    """Return the quantity of a name. Raises RequestError if it is unknown, or none of the zones has it."""
    if name not in QUANTITIES:
        raise RequestError(f"no field {name!r}{did_you_mean(name, QUANTITIES)}")
    quantity = QUANTITIES[name]
    if quantity.friction and all(zone.friction is None for zone in zones.values()):
        raise RequestError(f"{name} is a field of contacts with friction, and no contact here has friction")
    return quantity


def zones_of(zones: Mapping[str, ZoneFields], wanted: Iterable[str]) -> dict[str, ZoneFields]:
    """Return the zones of some names, all if there are none. Raises RequestError for an unknown one, or no zone."""
    if not zones:
        raise RequestError("a plot shows contacts and ties, and there are none")
    for name in wanted:
        if name not in zones:
            raise RequestError(f"no contact {name!r}{did_you_mean(name, zones)}")
    return {name: zones[name] for name in wanted or zones}


@dataclass(frozen=True)
class ColourScale:
    """Scale of colours. `label`: its words beside the scale; `low`, `high`: its ends; `log`: True if logarithmic.

    `states`: colours of the states of macro-elements, in place of a scale.
    """

    label: str
    low: float
    high: float
    log: bool = False
    states: bool = False

    @classmethod
    def of(cls, quantity: Quantity, zones: Iterable[ZoneFields], units: Units) -> ColourScale:
        """Return the scale of a quantity on some zones."""
        label = units.label(quantity.label, quantity.unit)
        return cls(label, *quantity.range_of(zones), states=quantity is QUANTITIES["status"])

    @property
    def ramp(self) -> tuple[str, ...]:
        """Colours from the low end to the high one, evenly apart."""
        return STATES if self.states else RESULT

    @property
    def norm(self) -> Any:
        """Norm of matplotlib from values to 0 ... 1."""
        colours = import_module("matplotlib.colors")
        return (colours.LogNorm if self.log else colours.Normalize)(self.low, self.high, clip=True)

    @property
    def bar(self) -> Any:
        """Mappable of matplotlib from values to colours, for a bar of them; grey hatching is for what has no value."""
        colours = import_module("matplotlib.colors")
        table = colours.LinearSegmentedColormap.from_list("result", list(self.ramp))
        return import_module("matplotlib.cm").ScalarMappable(self.norm, table)

    def rgba(self, values: Floats) -> NDArray[np.floating]:
        """Return the colour (n, 4) of each value (n,), transparent where there is none."""
        out = np.array(self.bar.to_rgba(np.nan_to_num(values, nan=self.low)), float)
        out[np.isnan(values)] = 0.0
        return out
