"""Macro-elements that alternate in the last iterations of a search that failed, and what to try for them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats
from lacsolver.equilibrium.search import Outcome
from lacsolver.saddle.contact_system import ContactSystem, RowGroup
from lacsolver.space.space import Space

#: changes of a status that alternates, at least, and the least change of a coverage that counts
_CHANGES, _SWING = 2, 1e-3


class Alternating(NamedTuple):
    """A clause about macro-elements that alternate, and what to try for them; '' and '' if none do."""

    what: str = ""
    advice: str = ""


def alternating(outcome: Outcome, space: Space) -> Alternating:
    """Return what alternates most in the last iterations of an outcome."""
    if len(outcome.recent) <= _CHANGES:
        return Alternating()
    covered, active = (np.array(own) for own in zip(*outcome.recent, strict=True))
    found = [_of(group, covered[:, group.rows], active[:, group.rows], space) for group in _paired(outcome.contact)]
    return max(found, key=lambda each: each[0], default=(0, Alternating()))[1]


def _paired(contact: ContactSystem) -> list[RowGroup]:
    """Return the groups of rows that are paired again in each iteration."""
    return [group for group in contact.groups if group.pair is not None and group.pair.moving]


def _of(group: RowGroup, covered: Floats, active: NDArray[np.bool_], space: Space) -> tuple[int, Alternating]:
    """Return how many rows of a pair alternate, and what is said of them; `covered`, `active` (iterations, rows)."""
    pair, face = group.pair, group.face
    assert pair is not None and face is not None
    area = np.where(face.area > 0, face.area, 1.0)
    coverage = covered / area
    swing = np.ptp(coverage, axis=0)
    moves = np.where(np.abs(change := np.diff(coverage, axis=0)) > _SWING, np.sign(change), 0)
    edge = _turns(moves) & (coverage.min(axis=0) < 1 - _SWING)
    pairing = np.abs(np.diff((covered > 0).astype(int), axis=0)).sum(axis=0) >= _CHANGES
    closing = np.abs(np.diff(active.astype(int), axis=0)).sum(axis=0) >= _CHANGES

    def told(rows: NDArray[np.bool_], what: str) -> str:
        first = np.flatnonzero(rows)[swing[rows].argmax()]
        place = ", ".join(space.told(face.centre[first] + space.origin[: space.dim]))
        low, high = coverage[:, first].min(), coverage[:, first].max()
        who = f"{rows.sum()} of the macro-elements of contact {pair.name!r} {what}"
        return f"{who}, as the one at ({place}), whose coverage goes between {low:.3g} and {high:.3g}"

    if pairing.any() or edge.any():
        rows, what = (pairing, "pair and unpair in turn") if pairing.any() else (edge, "are covered now more, now less")
        advice = ["exchange slave and master"]
        advice += ['ask for normals = "smoothed"'] if pair.pairing.normals == "facet" else []
        advice += ['ask for geometry = "reference"', "take another coverage_threshold"]
        return int(rows.sum()), Alternating(told(rows, what), ", ".join(advice[:-1]) + " or " + advice[-1])
    if closing.any():
        return int(closing.sum()), Alternating(told(closing, "close and open in turn"), "")
    return 0, Alternating()


def _turns(moves: Floats) -> NDArray[np.bool_]:
    """Return a mask (rows,): True where the signs of changes (iterations, rows) are not all the same.

    >>> _turns(np.array([[1, 1], [-1, 1], [1, 0], [-1, 1]])).tolist()
    [True, False]
    """
    return np.asarray((moves > 0).any(axis=0) & (moves < 0).any(axis=0))
