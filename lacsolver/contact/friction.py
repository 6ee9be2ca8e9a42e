"""Friction of macro-elements: the bound of the traction, and the rules by which states change from solve to solve.

    |t| <= b(p) = min(friction p + cohesion, shear_limit) where p > 0, else 0
    s = 0 where |t| < b,    s = |s| t / |t| where |t| = b          s: mean slip, t: traction on the master

A macro-element is open, sticks (p and t follow from G = 0 and s = 0), or slides (t = b d along its direction d, and p
follows from G = 0). After each solve, with c_T the stiffness of the skin along its tangents, stress per length:

0. At the start it is closed without a traction, and presses without friction in the first solve (it sticks where
   friction alone holds the bodies). It slides along s if c_T |s| is more than the bound, and sticks otherwise.
1. It sticks, and |t| > b: it slides, d = t / |t|. A macro-element that sticks never opens; it slides first: a tension
   there comes mostly of too much that sticks. Only without a traction, or rough, it opens at once.
2. It slides, and p <= 0: it opens. It slides against d: it turns round, once a search, if |b d + c_T s| > b, and sticks
   otherwise. Else d is the direction of t + c_T s.
3. It is open and overlaps: it closes, and slides along s if c_T |s| is more than the bound at the pressure that the
   overlap asks for; otherwise it sticks.

A fourth rule, for states that come back, is that of all contact (`equilibrium.active_set.Pivots`). All is of plain
arrays, of m macro-elements with k tangents each, so that another solver can use it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats
from lacmesh.surface.normals import unit
from lacsolver.contact.laws import Bools


class Bounds(NamedTuple):
    """Friction of each macro-element, (m,) each: coefficient (inf where rough), cohesion, limit (inf for none)."""

    friction: Floats
    cohesion: Floats
    limit: Floats

    @property
    def rough(self) -> Bools:
        """True where a closed macro-element never slides."""
        return np.asarray(np.isinf(self.friction) & np.isinf(self.limit))

    @property
    def any(self) -> Bools:
        """True where there is friction at all."""
        return np.asarray((self.friction > 0) | (self.cohesion > 0))

    @property
    def unlimited(self) -> Bounds:
        """The bounds of macro-elements that never slide."""
        m = len(self.limit)
        return Bounds(np.full(m, np.inf), np.zeros(m), np.full(m, np.inf))

    def at(self, p: Floats) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return the bound b (m,) at pressures p (m,), and its slope b' (m,).

        The slope is that of closed macro-elements, also at p <= 0, where the bound is 0.

        >>> Bounds(np.array([0.5, 0.5]), np.array([1.0, 0.0]), np.array([np.inf, 3.0])).at(np.array([4.0, 8.0]))
        (array([3., 3.]), array([0.5, 0. ]))
        """
        pressed = p > 0
        asked = self.cohesion + np.multiply(self.friction, p, out=np.zeros(len(p)), where=pressed & (self.friction > 0))
        steep = (asked < self.limit) & np.isfinite(self.friction)
        return np.where(pressed, np.minimum(asked, self.limit), 0.0), np.where(steep, self.friction, 0.0)


class States(NamedTuple):
    """States of m macro-elements: `closed` (m,), `sticks` (m,), and `direction` (m, k) of those that slide, else 0.

    A closed one that neither sticks nor has a direction presses without friction, where it has none or in the first
    solve. `turned` (m,): True for those that have turned round in this search.
    """

    closed: Bools
    sticks: Bools
    direction: Floats
    turned: Bools

    @property
    def slides(self) -> Bools:
        """True for macro-elements that slide, (m,)."""
        return np.asarray(self.direction.any(axis=1))

    @classmethod
    def of(cls, closed: Bools, sticks: Bools, t: Floats, bounds: Bounds, held: bool = False) -> States:
        """Return the states to start from: those that are closed and do not stick slide along their tractions t (m, k).

        Those without a traction stick, or press without friction if the bodies are `held` without it.
        """
        slides = closed & ~sticks & bounds.any & ~bounds.rough & t.any(axis=1)
        sticks = closed & bounds.any & ~slides & (sticks | (not held))
        return cls(closed, sticks, np.where(slides[:, None], _directions(t), 0.0), np.zeros(len(closed), bool))


class Solved(NamedTuple):
    """Solution of the last system: pressures `p` (m,), tractions `t` (m, k), mean slips `s` (m, k), lengths.

    `pressing` (m,): pressures that would close the overlaps, 0 for open gaps. `presses` (m,): True where the law of
    the pressure asks for contact. `stiffness` (m,): c_T.
    """

    p: Floats
    t: Floats
    s: Floats
    pressing: Floats
    presses: Bools
    stiffness: Floats


def next_states(now: States, solved: Solved, bounds: Bounds) -> States:
    """Return the states for the next solve, by the rules."""
    kept = _sticking(now, solved, bounds)
    sliding = _sliding(now, solved, bounds)
    pressing = np.where(now.closed, solved.p, solved.pressing)
    closing = _closing(now, solved._replace(pressing=pressing), bounds)
    slides, stays = now.slides, now.closed & (now.sticks | ~bounds.any)
    return States(
        *(
            np.where(_column(slides, a), a, np.where(_column(stays, b), b, c))
            for a, b, c in zip(sliding, kept, closing, strict=True)
        )
    )


def _sticking(now: States, solved: Solved, bounds: Bounds) -> States:
    """Rule 1, for macro-elements that stick, or have no friction."""
    size = np.linalg.norm(solved.t, axis=1)
    opens = np.where(now.sticks & ~bounds.rough & (size > 0), False, ~solved.presses)
    slides = now.sticks & ~opens & ~bounds.rough & (size > bounds.at(solved.p)[0])
    direction = np.where(slides[:, None], _directions(solved.t), 0.0)
    return States(~opens, now.sticks & ~opens & ~slides, direction, now.turned)


def _sliding(now: States, solved: Solved, bounds: Bounds) -> States:
    """Rule 2, for macro-elements that slide."""
    b, pull = np.where(now.slides, bounds.at(solved.p)[0], 0.0), solved.stiffness[:, None] * solved.s
    trial = b[:, None] * now.direction + pull
    back = (solved.s * now.direction).sum(axis=1) < 0
    turns = back & (np.linalg.norm(trial, axis=1) > b) & ~now.turned
    sticks = solved.presses & back & ~turns
    goes_on = np.where(turns[:, None], trial, solved.t + pull)
    direction = np.where(np.any(goes_on, axis=1, keepdims=True), _directions(goes_on), now.direction)
    slides = solved.presses & ~sticks
    return States(solved.presses, sticks, np.where(slides[:, None], direction, 0.0), now.turned | (slides & turns))


def _closing(now: States, solved: Solved, bounds: Bounds) -> States:
    """Rules 0 and 3, for macro-elements that are open, or press without friction at the start."""
    asked = solved.stiffness * np.linalg.norm(solved.s, axis=1)
    slides = solved.presses & bounds.any & ~bounds.rough & (asked > bounds.at(solved.pressing)[0])
    direction = np.where(slides[:, None], _directions(solved.s), 0.0)
    return States(solved.presses, solved.presses & bounds.any & ~slides, direction, now.turned)


def _directions(v: Floats) -> NDArray[np.floating]:
    """Return the directions of vectors (m, k), 0 for those without one; in the plane they are 1 and -1 exactly."""
    return np.sign(v) if v.shape[1] == 1 else unit(v)


def _column(mask: Bools, like: NDArray) -> Bools:
    return mask.reshape(-1, *(1,) * (like.ndim - 1))


def defect(t: Floats, s: Floats, b: Floats, stiffness: Floats) -> NDArray[np.floating]:
    """Return how far tractions t (m, k) and slips s (m, k) are from the law at bounds b (m,), as lengths (m, k).

    It is (t - P(t + c s)) / c, with P the projection on the disc of radius b and c the `stiffness` (m,).

    >>> defect(np.array([[0.25]]), np.array([[0.0]]), np.array([0.5]), np.array([8.0])).tolist()  # sticks
    [[0.0]]
    >>> defect(np.array([[0.5]]), np.array([[5.0]]), np.array([0.5]), np.array([8.0])).tolist()  # slides
    [[0.0]]
    """
    c = stiffness[:, None]
    return np.asarray((t - within(t + c * s, b)) / c)


def within(t: Floats, b: Floats) -> NDArray[np.floating]:
    """Return tractions t (m, k), those that are larger than their bounds b (m,) shortened to them.

    >>> within(np.array([[3.0, 4.0], [0.3, 0.4]]), np.array([1.0, 1.0])).tolist()
    [[0.6000000000000001, 0.8], [0.3, 0.4]]
    """
    size = np.linalg.norm(t, axis=1)
    part = np.divide(b, size, out=np.ones(len(b)), where=size > b)
    return np.asarray(part[:, None] * t)


class Kept(NamedTuple):
    """History of the friction of m macro-elements with k tangents each.

    `anchor` (m, k): B_T u where the slip is counted from: that of the last state in which the macro-element slid or was
    open. `path` (m,): length of its slips so far; `dissipation` (m,): energy that they have taken.
    """

    anchor: Floats
    path: Floats
    dissipation: Floats

    @staticmethod
    def n_columns(k: int) -> int:
        """Return the number of columns with k tangents."""
        return k + 2

    @classmethod
    def of(cls, columns: Floats, k: int) -> Kept:
        """Return what is kept in `columns` (m, k + 2)."""
        return cls(columns[:, :k], columns[:, k], columns[:, k + 1])

    @property
    def columns(self) -> NDArray[np.floating]:
        """All of it as an array (m, k + 2)."""
        return np.column_stack([self.anchor, self.path, self.dissipation])


class Slid(NamedTuple):
    """Friction of a step: tractions `t` (m, k), slips (m, k), `energy` taken (m,), `slides` (m,).

    `bound` (m,): b at the end; `kept`: what the next step starts from.
    """

    t: Floats
    slip: Floats
    energy: Floats
    slides: Bools
    bound: Floats
    kept: Kept
