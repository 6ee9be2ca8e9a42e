"""Contact laws whose pressure is a curve p(g) of the gap: an exponential, and a table.

Both press from a gap `reach` on, and the more, the smaller the gap; what they store is the area under the curve. The
equation of a row is the curve's tangent where the curve meets the line through the gap and the pressure of the last
solve whose slope is the stiffness k of the macro-element's own skin, p(g) - k g = p' - k g': a semismooth Newton method
on the curve's resolvent, as the active set p' - k g' > 0 is on that of unilateral contact. It takes few iterations,
however stiff or soft the curve is: a small error of a gap is a large one of the pressure, or the other way round.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats
from lacsolver.contact.laws import Bools, RowState, Unilateral

#: least slope of a tangent, as a fraction of the stiffness of the skin: a curve may begin without a slope
_LEAST = 1e-6
#: slope below which, before anything presses, a row is as stiff as the skin: a body on such a slope would go far beyond
#: the overlap under its load
_LEAST_AT_FIRST = 1e-2
#: times that a pressure is farther along the tangent than on the curve, from which on the tangent is much too soft
_FARTHER = 100.0
#: iterations for a point of the exponential; each at least squares the error
_STEPS = 60


class Curved(Unilateral):
    """A law p(g): `pressure`, `slope` (-dp/dg), `energy`, and where a line meets the curve, `meeting`."""

    @property
    def yields(self) -> bool:
        """True: surfaces overlap under pressure."""
        return True

    @property
    def reach(self) -> float:
        """Gap from which on there is a pressure."""
        raise NotImplementedError

    def pressure(self, gap: Floats) -> NDArray[np.floating]:
        """Return p (m,) at gaps (m,), 0 beyond the reach."""
        raise NotImplementedError

    def slope(self, gap: Floats) -> NDArray[np.floating]:
        """Return -dp/dg (m,) at gaps (m,)."""
        raise NotImplementedError

    def energy(self, gap: Floats) -> NDArray[np.floating]:
        """Return the energy per area (m,) stored at gaps (m,): the integral of p from there to the reach."""
        raise NotImplementedError

    def meeting(self, z: Floats, stiffness: Floats) -> NDArray[np.floating]:
        """Return the gaps (m,) at which p(g) = z + stiffness * g; the reach or more where z is too low."""
        raise NotImplementedError

    def gap_of(self, pressure: Floats) -> NDArray[np.floating]:
        """Return the gaps (m,) of pressures (m,) above 0."""
        return self.meeting(pressure, np.zeros(len(pressure)))

    def next_active(self, rows: RowState) -> Bools:
        """Return the rows whose line, through gap and pressure, meets the curve within its reach."""
        return np.asarray(rows.pressure > rows.skin_stiffness * (rows.gap - self.reach))

    def linearise(self, rows: RowState) -> tuple[Floats, Floats]:
        """Return the tangent where the line through gap and pressure, as stiff as the skin, meets the curve.

        Where it does not, or at first the curve has hardly a slope there, a row that is to hold a body is as stiff as
        the skin: the beginning of a curve says little about the overlap under a load. With a pressure, and where that
        is much farther along the tangent than on the curve, it takes the chord to the point with that pressure.
        """
        k, pressure = rows.skin_stiffness, rows.pressure
        gap = np.minimum(self.meeting(pressure - k * rows.gap, k), self.reach)
        p, slope = self.pressure(gap), self.slope(gap)
        flat = gap == self.reach if pressure.any() else slope < _LEAST_AT_FIRST * k
        slope = np.where(flat, k, np.maximum(slope, _LEAST * k))
        more = np.flatnonzero((pressure > p) & (flat | (slope < k)))
        deeper, rise = gap[more] - self.gap_of(pressure[more]), pressure[more] - p[more]
        farther = flat[more] | (rise > _FARTHER * slope[more] * np.maximum(deeper, _LEAST * (self.reach - gap[more])))
        farther &= deeper > 0
        slope[more[farther]] = rise[farther] / deeper[farther]
        return gap + p / slope, 1 / slope

    def stored(self, rows: RowState) -> Floats:
        """Return the energy of the curve at the gap."""
        return self.energy(rows.gap)

    def residual(self, rows: RowState) -> Floats:
        """Return the difference of pressures over the slopes of curve and skin."""
        return (self.pressure(rows.gap) - rows.pressure) / (self.slope(rows.gap) + rows.skin_stiffness)


@dataclass(frozen=True)
class Linear(Curved):
    """p = stiffness times the overlap."""

    stiffness: float = 1.0

    @property
    def reach(self) -> float:
        """No gap: it presses where surfaces overlap."""
        return 0.0

    def pressure(self, gap: Floats) -> NDArray[np.floating]:
        """Return p (m,)."""
        return np.asarray(self.stiffness * np.maximum(-np.asarray(gap), 0.0))

    def slope(self, gap: Floats) -> NDArray[np.floating]:
        """Return the stiffness for every gap."""
        return np.full(np.shape(gap), self.stiffness)

    def energy(self, gap: Floats) -> NDArray[np.floating]:
        """Return that of the springs (m,)."""
        return np.asarray(0.5 * self.stiffness * np.square(np.minimum(gap, 0.0)))

    def linearise(self, rows: RowState) -> tuple[Floats, Floats]:
        """Return offsets of 0, and one over the stiffness: it is linear."""
        return np.zeros(len(rows.gap)), np.full(len(rows.gap), 1 / self.stiffness)


@dataclass(frozen=True)
class Exponential(Curved):
    """p = p0 s (e^s - 1) / (e - 1), s = 1 - g / c: 0 from a gap c on, p0 where the surfaces meet.

    `at_contact`: p0; `clearance`: c.

    >>> law = Exponential(at_contact=2.0, clearance=0.1)
    >>> law.pressure(np.array([0.2, 0.1, 0.0])).round(12).tolist(), law.gap_of(np.array([2.0])).round(15).tolist()
    ([0.0, 0.0, 2.0], [0.0])
    """

    at_contact: float = 1.0
    clearance: float = 1.0

    @property
    def reach(self) -> float:
        """The clearance at which there is no pressure."""
        return self.clearance

    @property
    def _scale(self) -> float:
        return float(self.at_contact / np.expm1(1.0))

    def _s(self, gap: Floats) -> NDArray[np.floating]:
        return np.clip(1 - gap / self.clearance, 0.0, 600.0)

    def pressure(self, gap: Floats) -> NDArray[np.floating]:
        """Return p (m,)."""
        s = self._s(gap)
        return np.asarray(self._scale * s * np.expm1(s))

    def slope(self, gap: Floats) -> NDArray[np.floating]:
        """Return -dp/dg (m,)."""
        s = self._s(gap)
        return np.asarray(self._scale / self.clearance * (np.expm1(s) + s * np.exp(s)))

    def energy(self, gap: Floats) -> NDArray[np.floating]:
        """Return c times the integral of p over s."""
        s = self._s(gap)
        return np.asarray(self._scale * self.clearance * ((s - 1) * np.expm1(s) + s - 0.5 * s**2))

    def meeting(self, z: Floats, stiffness: Floats) -> NDArray[np.floating]:
        """Return the gaps (m,), by Newton's method from above on a convex function of s."""
        k = stiffness * self.clearance / self._scale
        wanted = np.maximum(np.asarray(z) / self._scale + k, 0.0)
        s = np.minimum(np.sqrt(wanted), np.maximum(1.0, np.log1p(wanted)))
        for _ in range(_STEPS):
            s = s - (s * np.expm1(s) + k * s - wanted) / np.maximum(np.expm1(s) + s * np.exp(s) + k, 1e-300)
        return np.asarray(self.clearance * (1 - s))


@dataclass(frozen=True)
class Table(Curved):
    """Linear between `rows` (pressure, overlap) that both grow from a pressure of 0; the last slope goes on.

    >>> law = Table(rows=((0.0, 0.0), (1.0, 0.1), (5.0, 0.2)))
    >>> law.pressure(np.array([0.1, -0.05, -0.2, -0.3])).round(12).tolist()
    [0.0, 0.5, 5.0, 9.0]
    """

    rows: Sequence[tuple[float, float]] = ()

    @cached_property
    def _columns(self) -> tuple[Floats, Floats, Floats]:
        """Pressures (k,), gaps (k,) and slopes (k - 1,) of the table."""
        pressure, overlap = np.array(self.rows, float).T
        return pressure, -overlap, np.diff(pressure) / np.diff(overlap)

    @property
    def reach(self) -> float:
        """The gap of the first row."""
        return float(self._columns[1][0])

    def _row(self, gap: Floats) -> NDArray[np.integer]:
        """Return the segment (m,) of each gap."""
        gaps = self._columns[1]
        return np.clip(np.searchsorted(-gaps, -np.asarray(gap), side="left") - 1, 0, len(gaps) - 2)

    def pressure(self, gap: Floats) -> NDArray[np.floating]:
        """Return p (m,)."""
        pressures, gaps, slopes = self._columns
        k = self._row(gap)
        return np.maximum(pressures[k] + slopes[k] * (gaps[k] - gap), 0.0)

    def slope(self, gap: Floats) -> NDArray[np.floating]:
        """Return -dp/dg (m,); beyond the reach that of the first rows."""
        return self._columns[2][self._row(gap)]

    def energy(self, gap: Floats) -> NDArray[np.floating]:
        """Return the area under the table: that of whole segments, and of a part of one."""
        pressures, gaps, _ = self._columns
        whole = np.append(0.0, np.cumsum(0.5 * (pressures[1:] + pressures[:-1]) * -np.diff(gaps)))
        k = self._row(gap)
        part = np.maximum(gaps[k] - gap, 0.0)
        return np.asarray(whole[k] + 0.5 * (pressures[k] + self.pressure(gap)) * part)

    def meeting(self, z: Floats, stiffness: Floats) -> NDArray[np.floating]:
        """Return the gaps (m,)."""
        pressures, gaps, slopes = self._columns
        begins = pressures[1:-1] - np.multiply.outer(stiffness, gaps[1:-1])
        k = (begins < np.asarray(z)[:, None]).sum(axis=1)
        return np.asarray((pressures[k] + slopes[k] * gaps[k] - z) / (slopes[k] + stiffness))
