"""Plain twin of the compiled test for faces that cross: every piece of one face with every piece of the other."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from lacmesh.checks.crossing import EPSILON, INSIDE, pieces_of


def crossing(points, faces):
    """(k, 2): pairs of faces i < j that cross or overlap, as `lacmesh.checks.crossing.crossing` finds them."""
    nodes, face = pieces_of(faces)
    x = points[nodes]
    own = [np.flatnonzero(face == k) for k in range(len(faces))]
    pairs = [(i, j) for i, j in combinations(range(len(faces)), 2) if cross(x, own[i], own[j])]
    return np.array(pairs, int).reshape(-1, 2)


def cross(x, mine, other):
    """True if a piece of one face and a piece of another cross; `mine`, `other`: their rows of x (p, m, 3)."""
    a, b = np.repeat(mine, len(other)), np.tile(other, len(mine))
    near = ((x[a].min(axis=1) <= x[b].max(axis=1)) & (x[b].min(axis=1) <= x[a].max(axis=1))).all(axis=1)
    a, b = a[near], b[near]
    return bool((_reach(x[a], x[b]) | _reach(x[b], x[a])).any())


def _planes(x):
    """First corner, rows (k, c, 3) and size of pieces (k, m, 3).

    The rows times a position relative to the first corner give the signed distance and the barycentric coordinates.
    """
    side = x[:, 1] - x[:, 0]
    if x.shape[1] == 2:
        square = (side * side).sum(axis=1)
        normal = np.stack([side[:, 1], -side[:, 0], 0 * side[:, 0]], axis=1)
        size = np.sqrt(square)
        with np.errstate(all="ignore"):
            return x[:, 0], np.stack([normal / size[:, None], side / square[:, None]], axis=1), size
    other = x[:, 2] - x[:, 0]
    normal = np.cross(side, other)
    square = (normal * normal).sum(axis=1)[:, None]
    size = np.sqrt(np.maximum((side * side).sum(axis=1), (other * other).sum(axis=1)))
    with np.errstate(all="ignore"):
        rows = normal / np.sqrt(square), np.cross(other, normal) / square, np.cross(normal, side) / square
    return x[:, 0], np.stack(rows, axis=1), size


def _reach(x, other):
    """True for pieces x (k, m, 3) of which an edge, or the centre, enters the interior of the other piece."""
    origin, rows, size = _planes(other)
    m = x.shape[1]
    centre = x.mean(axis=1)
    lines = [(x[:, a], x[:, (a + 1) % m]) for a in range(m if m == 3 else 1)] + [(centre, centre)]
    out = np.zeros(len(x), bool)
    for start, stop in lines:
        low, high = np.zeros(len(x)), np.ones(len(x))
        at = [np.einsum("kcs,ks->kc", rows, end - origin) for end in (start, stop)]
        first, last = ([(EPSILON * size) - v[:, 0], (EPSILON * size) + v[:, 0], *_coordinates(v)] for v in at)
        for f, g in zip(first, last, strict=True):
            high = np.where((f < 0) & (g < 0) | np.isnan(f) | np.isnan(g), -1.0, high)
            with np.errstate(all="ignore"):
                turn = f / (f - g)
            low = np.where((f < 0) & (g >= 0), np.maximum(low, turn), low)
            high = np.where((f >= 0) & (g < 0), np.minimum(high, turn), high)
        out |= low <= high
    return out


def _coordinates(v):
    """Quantities that are positive inside a piece: the barycentric coordinates, from v = (distance, ...) (k, c)."""
    rest = 1 - v[:, 1:].sum(axis=1)
    return [*(v[:, k] - INSIDE for k in range(1, v.shape[1])), rest - INSIDE]
