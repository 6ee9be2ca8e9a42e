"""Damping of soft contact in motion: a pressure c do/dt beside that of the law, with the overlap o = max(0, r - g).

    p = max(0, p_law(g) + c do/dt) where o > 0, else 0          r: the gap from which on the law presses

It acts while the surfaces overlap, as they approach and as they part, and never pulls. As it goes with the rate of the
overlap and not with that of the gap, it is continuous at the first touch, and p falls with the gap g. It takes the
energy (p - p_law) do >= 0: where the damper is held back at p = 0, that of the law which is not given back.

The rate at the end of a step of size h is that of the parabola through the last three overlaps (BDF2), with d = (o' -
o) / h, and d- of the step of size h- before,

    do'/dt = (1 + s) d - s d-,    s = h / (h + h-);    s = 0 in the first step

It is of second order, as the time schemes are, and damps what the skins, which have no mass, could oscillate with: at
every frequency the work of the mean of both ends of a step is not negative. Where the parabola would leave o' = 0 with
a positive rate, the rate is a o' there, so that p is 0 at o' = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats
from lacsolver.contact.curves import Curved, Linear
from lacsolver.contact.laws import Bools, RowState


@dataclass(frozen=True)
class Damped(Curved):
    """A law `base` with `damping` c, stress per velocity, in a step of size `dt`; 0 at rest, where the law is alone.

    History (m, 5): 1 once the rest is known; overlap; its rate in the last step, and the size of that, 0 without one; p
    - p_law.

    >>> law = Damped(base=Linear(stiffness=10.0), damping=2.0, dt=0.1)
    >>> rows = RowState(np.array([-0.2]), np.zeros(1), np.zeros(1, bool), np.ones(1), np.array([[1.0, 0.1, 0, 0, 0]]))
    >>> law.total(rows).tolist(), law.in_step(0.0).total(rows).tolist()
    ([4.0], [2.0])
    """

    base: Curved = field(default_factory=Linear)
    damping: float = 0.0
    dt: float = 0.0

    n_history = 5

    def in_step(self, dt: float) -> Damped:
        """Return the law in a step of size dt."""
        return replace(self, dt=dt)

    @property
    def reach(self) -> float:
        """Gap from which on the law presses."""
        return self.base.reach

    def _overlap(self, gap: Floats) -> NDArray[np.floating]:
        return np.maximum(self.reach - gap, 0.0)

    def _rate(self, rows: RowState) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return (a, b), (m,) each: at the end of the step do/dt = a o - b."""
        known, overlap, rate, before, _ = rows.history.T
        if not self.dt:
            return np.zeros_like(known), np.zeros_like(known)
        s = np.where(before > 0, self.dt / (self.dt + before), 0.0)
        a = np.where(known > 0, (1 + s) / self.dt, 0.0)
        return a, np.maximum(np.where(known > 0, a * overlap + s * rate, 0.0), 0.0)

    def total(self, rows: RowState) -> NDArray[np.floating]:
        """Return the pressure (m,) at the gaps of some rows, at the end of the step."""
        (a, b), o = self._rate(rows), self._overlap(rows.gap)
        return np.where(o > 0, np.maximum(self.base.pressure(rows.gap) + self.damping * (a * o - b), 0.0), 0.0)

    def next_active(self, rows: RowState) -> Bools:
        """Return the rows that press at their gaps."""
        return self.total(rows) > 0

    def linearise(self, rows: RowState) -> tuple[Floats, Floats]:
        """Return the equation of the law with the rate of the damper, which is linear in the gap."""
        a, b = self._rate(rows)
        damper = self.damping * (a * self._overlap(rows.gap) - b)
        offset, compliance = self.base.linearise(rows._replace(pressure=rows.pressure - damper))
        slope = 1 / compliance + self.damping * a
        return (offset / compliance + self.damping * (a * self.reach - b)) / slope, 1 / slope

    def residual(self, rows: RowState) -> Floats:
        """Return the difference of pressures over the slopes of law, damper and skin."""
        slope = self.base.slope(rows.gap) + self.damping * self._rate(rows)[0]
        return (self.total(rows) - rows.pressure) / (slope + rows.skin_stiffness)

    def commit(self, rows: RowState) -> Floats:
        """Return the overlap, its rate, and the damper's pressure at the end of a step."""
        known, o = rows.history[:, 0] * bool(self.dt), self._overlap(rows.gap)
        rate = known * (o - rows.history[:, 1]) / (self.dt or 1.0)
        return np.column_stack([np.ones_like(o), o, rate, known * self.dt, known * self._damper(rows)])

    def stored(self, rows: RowState) -> Floats:
        """Return that of the law without the damper."""
        return self.base.stored(rows)

    def _damper(self, rows: RowState) -> NDArray[np.floating]:
        return np.asarray(rows.pressure - self.base.pressure(rows.gap))

    def taken(self, rows: RowState) -> NDArray[np.floating]:
        """Return the energy per area (m,) that the damper takes in a step, by its mean pressure."""
        known, overlap, _, _, before = rows.history.T
        change = self._overlap(rows.gap) - overlap
        return np.asarray(known * bool(self.dt) * 0.5 * (before + self._damper(rows)) * change)
