"""Macro-elements that alternate in the last iterations of a search that failed, and what to try for them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats
from lacsolver.equilibrium.search import Outcome
from lacsolver.saddle.row_group import PairGroup
from lacsolver.space.space import Space

#: changes of a status that alternates, at least, and the least change of a coverage that counts
_CHANGES, _SWING = 2, 1e-3


def alternating(outcome: Outcome, space: Space) -> tuple[str, str]:
    """Return a clause about what alternates most in the last iterations, and what to try for it; '' and '' for none.

    A coverage that alternates comes before states that do, which follow from it.
    """
    if len(outcome.recent) <= _CHANGES:
        return "", ""
    covered, active = (np.array(own) for own in zip(*outcome.recent, strict=True))
    pairs = outcome.contact.pairs
    clauses = [_of_coverage(group, covered[:, group.rows], space) for group in pairs if group.pair.moving]
    if not any(count for count, *_ in clauses):
        clauses = [_of_states(group, active, space) for group in pairs]
    _, what, advice = max(clauses, key=lambda clause: clause[0], default=(0, "", ""))
    return what, advice


def _of_states(group: PairGroup, active: NDArray[np.bool_], space: Space) -> tuple[int, str, str]:
    """Return how many macro-elements of a pair close and open, or stick and slide, and a clause about them.

    `active` (iterations, rows): the active set, of all rows.
    """
    closed = active[:, group.rows]
    changes = {"close and open in turn": _changes(closed)}
    if group.shear is not None:
        sticks = np.array([group.shear.sticks(own) for own in active])
        changes["stick and slide in turn"] = np.where(closed.all(axis=0), _changes(sticks), 0)
    what, times = max(changes.items(), key=lambda own: int((own[1] >= _CHANGES).sum()))
    rows = np.flatnonzero(times >= _CHANGES)
    if not len(rows):
        return 0, "", ""
    return len(rows), _clause(group, len(rows), what, int(rows[times[rows].argmax()]), space), ""


def _changes(states: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return how many times each of some states (iterations, n) has changed, (n,)."""
    return np.asarray((states[1:] != states[:-1]).sum(axis=0))


def _clause(group: PairGroup, count: int, what: str, row: int, space: Space) -> str:
    """Return a clause about what some macro-elements of a pair do, with the place of that of one row."""
    pair, face = group.pair, group.face
    centre = face.centre[row * len(face.centre) // (group.rows.stop - group.rows.start)]
    place = ", ".join(space.told(centre + space.origin[: space.dim]))
    return f"{count} of the macro-elements of contact {pair.name!r} {what}, as the one at ({place})"


def _of_coverage(group: PairGroup, covered: Floats, space: Space) -> tuple[int, str, str]:
    """Return how many macro-elements of a pair have a coverage that alternates, a clause about them, and advice.

    `covered` (iterations, rows): measure that is covered.
    """
    pair, face = group.pair, group.face
    area = np.where(face.area > 0, face.area, 1.0)
    coverage = covered / area
    swing = np.ptp(coverage, axis=0)
    moves = np.where(np.abs(change := np.diff(coverage, axis=0)) > _SWING, np.sign(change), 0)
    edge = _turns(moves) & (coverage.min(axis=0) < 1 - _SWING)
    pairing = _changes(covered > 0) >= _CHANGES
    if not (pairing.any() or edge.any()):
        return 0, "", ""
    rows, what = (pairing, "pair and unpair in turn") if pairing.any() else (edge, "are covered now more, now less")
    first = int(np.flatnonzero(rows)[swing[rows].argmax()])
    clause = _clause(group, int(rows.sum()), what, first, space)
    clause += f", whose coverage goes between {coverage[:, first].min():.3g} and {coverage[:, first].max():.3g}"
    advice = ["exchange slave and master"]
    advice += ['ask for normals = "smoothed"'] if pair.pairing.normals == "facet" else []
    advice += ['ask for geometry = "reference"', "take another coverage_threshold"]
    return int(rows.sum()), clause, ", ".join(advice[:-1]) + " or " + advice[-1]


def _turns(moves: Floats) -> NDArray[np.bool_]:
    """Return a mask (rows,): True where the signs of changes (iterations, rows) are not all the same.

    >>> _turns(np.array([[1, 1], [-1, 1], [1, 0], [-1, 1]])).tolist()
    [True, False]
    """
    return np.asarray((moves > 0).any(axis=0) & (moves < 0).any(axis=0))
