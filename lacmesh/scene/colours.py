"""Colours: of bodies, slave, master, macro-elements, findings, and of a value on a ramp.

Chosen so that people who see red and green alike can tell them apart: macro-elements differ in lightness as well as in
hue, the ramp darkens steadily, and what is wrong is drawn in the two strongest colours of all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints

#: colours of macro-elements: close to Paul Tol's light scheme, made for areas side by side
PALETTE = ("77aadd", "ee8866", "eedd88", "ffaabb", "99ddff", "44bb99", "bbcc33", "c3a5d9")
#: colours of bodies, and of what a cutaway lays bare
BODIES, INSIDE = ("eceae4", "dbe1e6", "e6e0ec", "dfe8dc"), "c3c9cf"
MASTER = "8093b0"
INK, CREASE, EDGE, CHILD_EDGE, DOT = "1b1f24", "5c646c", "8a929a", "4a525a", "b3122f"
#: what is wrong, by its severity; a value beyond what is valid
SEVERITIES = {"error": "cc1f1a", "warning": "e87500", "info": "5b6b7d", "worst": "8f2f74"}
INVALID = "cc1f1a"
#: a value from its bad end to its good one: dark to light
RAMP = ("231a4c", "34489b", "2f7fb5", "56b4b8", "a9d9b2", "f4f3d0")
#: a result from its low end to its high one: light to dark, so that what is large stands out on light bodies
RESULT = RAMP[::-1]
#: states of a macro-element: unpaired, open, closed (or sticking), sliding
STATES = ("ffffff", "c9d1da", "2b6cb0", "e8701a")
#: by how much macro-elements pale where findings are to stand out
PALER = 0.55
#: least span of a scale of colours, relative to its largest end: values that differ by less have the same three digits
SPAN = 0.01
#: what is nearer to 0 is 0 in a scale
NOTHING = 1e-200


def rgb(colours: Sequence[str]) -> NDArray[np.uint8]:
    """Colours in hexadecimal as numbers from 0 to 255, (n, 3).

    >>> rgb(["77aadd"])
    array([[119, 170, 221]], dtype=uint8)
    """
    return np.array([[int(c[k : k + 2], 16) for k in (0, 2, 4)] for c in colours], np.uint8).reshape(-1, 3)


def pale(colours: NDArray[np.uint8], by: float = PALER) -> NDArray[np.uint8]:
    """Colours (n, 3) mixed with white."""
    return np.round(colours + by * (255.0 - colours)).astype(np.uint8)


def ends_of(values: Floats, *, zero: bool = False, least: float = SPAN) -> tuple[float, float]:
    """Low and high end of a scale for values, NaN left out; (0, 1) where all are 0 or there is none.

    `zero`: 0 is part of the scale. The span is at least `least` of the larger end, so that round-off is not shown as a
    difference: uniform values lie in its middle, or with `zero` at one end.

    >>> ends_of(np.array([5 - 1e-15, 5, np.nan]), zero=True), ends_of(np.array([5.0, 5.0]), least=0.2)
    ((0.0, 5.0), (4.5, 5.5))
    """
    known = np.append(values[np.isfinite(values)], [0.0] * zero)
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    size = max(abs(low), abs(high))
    if size < NOTHING:
        return 0.0, 1.0
    lacking = least * size - (high / 2 - low / 2) * 2
    return (low - lacking / 2, high + lacking / 2) if lacking > 0 else (low, high)


def on_ramp(values: Floats, bad: float, good: float, ramp: Sequence[str] = RAMP) -> NDArray[np.uint8]:
    """Colour (n, 3) of each value between its bad and its good end (good where both are one); grey where it is NaN.

    `ramp`: colours from the bad end to the good one, evenly apart.
    """
    stops = rgb(ramp).astype(float)
    span = good - bad
    place = np.clip((values - bad) / span if span else np.where(np.isnan(values), np.nan, 1.0), 0, 1) * (len(stops) - 1)
    known = np.isfinite(place)
    at = np.linspace(0, len(stops) - 1, len(stops))
    mixed = np.stack([np.interp(np.where(known, place, 0), at, stop) for stop in stops.T], axis=-1)
    mixed[~known] = rgb(BODIES[:1])
    return np.round(mixed).astype(np.uint8)


def paint(macro: Ints, corners: Ints) -> Ints:
    """Index in PALETTE of each slave face, (s,): one colour per macro-element, neighbours as different as possible.

    `macro` (s,) the macro-element of each face, `corners` (s, 4) its nodes, padded with -1.
    """
    from scipy.sparse import coo_matrix

    if not len(macro):
        return np.empty(0, np.int64)
    names, member = np.unique(macro, return_inverse=True)
    face, place = np.nonzero(corners >= 0)
    touch = coo_matrix((np.ones(len(face)), (member[face], corners[face, place]))).tocsr()
    touch.data[:] = 1
    shared = (touch @ touch.T).tocsr()  # nodes that two macro-elements share
    return _greedy(shared.indptr, shared.indices, shared.data, len(names))[member]


def _greedy(indptr: Ints, indices: Ints, shared: Floats, count: int) -> Ints:
    """Greedy colouring of a graph of `count` nodes: the colour least shared with neighbours, then the least used."""
    starts, near, weight = indptr.tolist(), indices.tolist(), shared.tolist()
    colour, used = [-1] * count, [0] * len(PALETTE)
    for k in range(count):
        clash = [0.0] * len(PALETTE)
        for j in range(starts[k], starts[k + 1]):
            if colour[near[j]] >= 0:
                clash[colour[near[j]]] += weight[j]
        best = min(range(len(PALETTE)), key=lambda c: (clash[c], used[c]))
        colour[k] = best
        used[best] += 1
    return np.array(colour)
