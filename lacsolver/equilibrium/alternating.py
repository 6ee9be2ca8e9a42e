"""Macro-elements that alternate in the last iterations of a search that failed, and what to try for them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats
from lacsolver.equilibrium.search import Outcome
from lacsolver.saddle.contact_system import ContactSystem, RowGroup
from lacsolver.space.space import Space

#: changes of a status that alternates, at least, and the least change of a coverage that counts
_CHANGES, _SWING = 2, 1e-3


def alternating(outcome: Outcome, space: Space) -> tuple[str, str]:
    """Return a clause about what alternates most in the last iterations, and what to try for it; '' and '' for none."""
    if len(outcome.recent) <= _CHANGES:
        return "", ""
    covered, active = (np.array(own) for own in zip(*outcome.recent, strict=True))
    clauses = [_of(group, covered[:, group.rows], active[:, group.rows], space) for group in _paired(outcome.contact)]
    _, what, advice = max(clauses, key=lambda clause: clause[0], default=(0, "", ""))
    return what, advice


def _paired(contact: ContactSystem) -> list[RowGroup]:
    """Return the groups of rows that are paired again in each iteration."""
    return [group for group in contact.groups if group.pair is not None and group.pair.moving]


def _of(group: RowGroup, covered: Floats, active: NDArray[np.bool_], space: Space) -> tuple[int, str, str]:
    """Return how many rows of a pair alternate, a clause about them, and advice.

    `covered`, `active` (iterations, rows): measure that is covered, and the active set.
    """
    pair, face = group.pair, group.face
    assert pair is not None and face is not None
    area = np.where(face.area > 0, face.area, 1.0)
    coverage = covered / area
    swing = np.ptp(coverage, axis=0)
    moves = np.where(np.abs(change := np.diff(coverage, axis=0)) > _SWING, np.sign(change), 0)
    edge = _turns(moves) & (coverage.min(axis=0) < 1 - _SWING)
    pairing = np.abs(np.diff((covered > 0).astype(int), axis=0)).sum(axis=0) >= _CHANGES
    closing = np.abs(np.diff(active.astype(int), axis=0)).sum(axis=0) >= _CHANGES

    def clause(rows: NDArray[np.bool_], what: str) -> str:
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
        return int(rows.sum()), clause(rows, what), ", ".join(advice[:-1]) + " or " + advice[-1]
    if closing.any():
        return int(closing.sum()), clause(closing, "close and open in turn"), ""
    return 0, "", ""


def _turns(moves: Floats) -> NDArray[np.bool_]:
    """Return a mask (rows,): True where the signs of changes (iterations, rows) are not all the same.

    >>> _turns(np.array([[1, 1], [-1, 1], [1, 0], [-1, 1]])).tolist()
    [True, False]
    """
    return np.asarray((moves > 0).any(axis=0) & (moves < 0).any(axis=0))
