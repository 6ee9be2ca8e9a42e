"""Records of what acts in the steps: supports, rigid bodies, loads, temperatures; and the times of the steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import ceil
from typing import Any

import numpy as np

from lacmesh.errors import some
from lacmesh.mesh import Ints
from lacsolver.decks.cards import Refused
from lacsolver.decks.content import COMPONENTS, Assigned, DeckStep
from lacsolver.decks.draft import AXES, CaseDraft
from lacsolver.decks.histories import JUMP, Orders, Points, history_of, orders_of, parts_of, written
from lacsolver.decks.local_axes import by_axes
from lacsolver.decks.model_records import expanding, initial_temperatures
from lacsolver.decks.names import SIDES

#: most increments of a step that become steps of a case; a step that does not converge is halved all the same
MOST_INCREMENTS = 10
#: short increments, relative to the others, that follow on a static step: the motion begins in equilibrium, and after a
#: jump of loads the scheme of Hilber, Hughes and Taylor has the new forces at both ends of the second one
_SUDDEN = (1e-3, 2e-3)
#: most increments of a step that a case lists
MOST_STEPS = 100_000


def orders(draft: CaseDraft, kind: str) -> Orders:
    """Return the orders of one kind on nodes, facets or cells that are no nodes of rigid bodies. Raises Refused."""
    deck = draft.deck
    beside = deck.beside_bodies
    if kind == "displacement":
        beside += [n for one in deck.equations for n, *_ in one.terms if not deck.names.in_cells[n]]
    lines = [line for line in deck.assigned if line.kind == kind]
    if kind in ("displacement", "force"):
        lines = [replace(line, items=np.setdiff1d(line.items, np.array(beside, np.int64))) for line in lines]
        lines = [line for line in lines if len(line.items)]
    return orders_by_step(draft, kind, lines)


def orders_by_step(draft: CaseDraft, kind: str, lines: Sequence[Assigned]) -> Orders:
    """Return the orders of some lines. Raises Refused where a step removes some of earlier steps (OP=NEW)."""
    deck = draft.deck
    adds = kind not in ("displacement", "spin", "temperature")
    whole = orders_of(lines, len(deck.steps), COMPONENTS[kind], adds)
    for now, card in deck.removed.get(kind, {}).items():
        before = orders_of([one for one in lines if one.step < now], len(deck.steps), COMPONENTS[kind], adds)
        after = orders_of([one for one in lines if one.step == now], len(deck.steps), COMPONENTS[kind], adds)
        kept = np.zeros((COMPONENTS[kind], len(whole.items)), bool)
        lost = kept.copy()
        lost[:, np.searchsorted(whole.items, before.items)] = ~np.isnan(before.value).all(axis=0)
        kept[:, np.searchsorted(whole.items, after.items)] = ~np.isnan(after.value).all(axis=0)
        if (lost & ~kept).any():
            message = "what OP=NEW removes stays in lacsolver; repeat it in this step, a load with the value 0"
            raise Refused(message, card.rows[0] if card.rows else None)
    return whole


def check_begun(prescribed: Orders) -> None:
    """Raise Refused for a prescribed motion that begins after the first step: that of a body's own nodes may."""
    late = np.isnan(prescribed.value[0]) & ~np.isnan(prescribed.value).all(axis=0)
    if late.any():
        component, at = np.argwhere(late)[0].tolist()
        message = "this motion of a reference node begins after the first step, and lacsolver's from the beginning"
        line = prescribed.line_of(at, component)
        raise Refused(f"{message}; prescribe it in the first step too, or compute the steps apart", line.row, line.card)


def supports(draft: CaseDraft) -> None:
    """Add a [[displacement]] for each set of nodes. Raises Refused."""
    prescribed = orders(draft, "displacement")
    names = draft.deck.names
    for part, histories in parts_of(draft.deck, prescribed, once=False):
        there = part.items[names.in_cells[part.items]]
        if not len(there):
            draft.deck.note(part.card, "these nodes belong to no solid element: the support is left out", part.row)
            continue
        for line, when, own in _by_begin(draft, prescribed, part, histories):
            keys = {f"u{AXES[c]}": written(points, draft.ramped) for c, points in own.items()} | when
            for axes, some_nodes in by_axes(draft, there):
                name = part.name if len(some_nodes) == len(part.items) else ""
                group = draft.node_group(name, some_nodes, "held")
                draft.add("displacement", {"group": group} | keys | axes, line.card)


def _by_begin(
    draft: CaseDraft, prescribed: Orders, part: Assigned, histories: dict[int, Points]
) -> Iterator[tuple[Assigned, dict[str, float], dict[int, Points]]]:
    """Yield the line, the times and the histories of components of a support that begin together, the earliest first.

    The times are {} from the start on, else the keys `begin` and `reached`: nodes go from where they are to the value.
    Raises Refused for a support that begins as bodies move.
    """
    at = int(np.searchsorted(prescribed.items, part.items[0]))
    first = {c: int(np.argmin(np.isnan(prescribed.value[:, c, at]))) for c in histories if c < draft.dim}
    for k in sorted(set(first.values())):
        own = {c: points for c, points in histories.items() if first.get(c) == k}
        if k == 0:
            yield part, {}, own
            continue
        step, line = draft.deck.steps[k], prescribed.line_of(at, min(own))
        if step.begin >= draft.ramped and step.alpha is not None:
            message = "this support begins in a step of *DYNAMIC, and what moves would stop at once"
            raise Refused(f"{message}; hold it from the start, or in a static step before", line.row, line.card)
        jumps = step.sudden or (prescribed.amplitude[k, list(own), at] >= 0).any()
        reached = step.begin + JUMP * step.period if jumps else step.end
        yield line, {"begin": step.begin, "reached": reached}, own


def kept(draft: CaseDraft) -> None:
    """Add a [[displacement]] that begins late for nodes that stay where a step finds them (FIXED). Raises Refused.

    A displacement that a step before prescribes without an amplitude stays anyway.
    """
    prescribed, stay = orders(draft, "displacement"), [np.empty(0, np.int64)] * draft.dim
    for line in (one for one in draft.deck.assigned if one.kind == "held" and len(one.items)):
        step, known = draft.deck.steps[line.step], np.isin(prescribed.items, line.items)
        there, value = prescribed.items[known], prescribed.value[:, :, known]
        moved = ~np.isnan(value[line.step :]).all(axis=0)
        changed = np.asarray(moved | (prescribed.amplitude[:, :, known] >= 0).any(axis=0))
        if changed[list(line.components)].any() or step.alpha is not None:
            message = "FIXED holds nodes that this step or a later one moves, or that an amplitude or a motion does"
            raise Refused(f"{message}; write their displacement", line.row, line.card)
        for c in (c for c in line.components if c < draft.dim):
            free = np.setdiff1d(line.items, np.append(there[~np.isnan(value[:, c]).all(axis=0)], stay[c]))
            stay[c] = np.union1d(stay[c], free)
            for axes, nodes in by_axes(draft, free):
                group = draft.node_group(line.name if len(nodes) == len(line.items) else "", nodes, "held")
                draft.add("displacement", {"group": group, f"u{AXES[c]}": 0.0, "begin": step.begin} | axes, line.card)


def forces(draft: CaseDraft) -> None:
    """Add a [[force]] for each set of nodes. Raises Refused."""
    for part, histories in parts_of(draft.deck, orders(draft, "force"), once=True):
        if max(histories) >= draft.dim:
            raise Refused("a force has the directions 1 and 2 in a plane model", part.row)
        loose = part.items[~draft.deck.names.in_cells[part.items]]
        numbers = draft.groups.mesh.node_number
        if len(loose):
            raise Refused(f"nodes {some(numbers[loose])} belong to no solid element, and carry no force", part.row)
        keys = {f"f{AXES[c]}": written(points, draft.ramped) for c, points in histories.items()}
        for axes, some_nodes in by_axes(draft, part.items):
            name = part.name if len(some_nodes) == len(part.items) else ""
            group = draft.node_group(name, some_nodes, "loaded")
            draft.add("force", {"group": group} | keys | axes, part.card)
    if moments := [one for one in draft.deck.assigned if one.kind in ("moment", "spin")]:
        _check_rotations(draft, moments)


def _check_rotations(draft: CaseDraft, lines: list[Assigned]) -> None:
    """Raise Refused for moments at nodes of no rigid body; a rotation of 0 has no meaning there, and is left out."""
    for line in lines:
        if line.value and not np.isin(line.items, draft.deck.references).all():
            raise Refused(
                "only the reference node of a *RIGID BODY or a *COUPLING turns; nodes of solid elements do not",
                line.row,
            )


def scaled(value: Any, factor: float) -> Any:
    """Return a value of a case, a number or a table of times, times a factor."""
    return [[t, v * factor] for t, v in value] if isinstance(value, list) else value * factor


def pressures(draft: CaseDraft) -> None:
    """Add a [[pressure]] for each set of faces; with NLGEOM it follows them. Raises Refused."""
    for part, histories in parts_of(draft.deck, orders(draft, "pressure"), once=True):
        if len(inner := draft.deck.names.inner(part.items)):
            numbers = some(draft.groups.mesh.cell_number[inner // SIDES])
            raise Refused(f"these faces of elements {numbers} lie between two elements; press outer faces", part.row)
        group = draft.groups.add_skin(part.name or "pressed", part.items)
        keys = {"group": group, "value": written(histories[0], draft.ramped)}
        draft.add("pressure", keys | ({"follower": True} if draft.large else {}), part.card)


def temperatures(draft: CaseDraft) -> None:
    """Add a [[temperature]] for each group of cells that expand, and have one history. Raises Refused."""
    deck, mesh = draft.deck, draft.groups.mesh
    lines = [one for one in deck.assigned if one.kind == "temperature" and one.step >= 0]
    cells = expanding(draft)
    if not lines:
        return
    if not len(cells):
        draft.deck.note(lines[0].card, "no material has an *EXPANSION, so that temperatures have no effect")
        return
    prescribed = orders_by_step(draft, "temperature", lines)
    row_of, start = _rows_of_nodes(prescribed, mesh.n_nodes), initial_temperatures(draft)
    code = np.full(mesh.n_cells, -1)
    for _, own, nodes in mesh.select(cells):
        rows = row_of[nodes]
        uneven = (rows != rows[:, :1]).any(axis=1)
        if uneven.any():
            message = f"the nodes of elements {some(mesh.cell_number[own[uneven]])} have several temperatures"
            raise Refused(f"{message}, and an element has one in lacsolver; give its nodes one", lines[-1].row)
        code[own] = rows[:, 0]
    warm = cells[code[cells] >= 0]
    kinds, which = np.unique(np.stack([code[warm], start[warm]], axis=1), axis=0, return_inverse=True)
    for k, (row, T) in enumerate(kinds.tolist()):
        own = warm[which.ravel() == k]
        at = int(np.flatnonzero(row_of[prescribed.items] == row)[0])
        points = history_of(deck, prescribed, int(prescribed.items[at]), 0, T)
        value = written(points or [(0.0, T)], draft.ramped, T)
        if value == T:
            continue
        line = prescribed.line_of(at)
        whole = len(own) == np.count_nonzero(mesh.cell_dim == mesh.dim)
        groups = {} if whole else {"groups": [draft.groups.add_cells(line.name or "warm", own)]}
        draft.add("temperature", groups | {"value": value}, line.card)


def _rows_of_nodes(prescribed: Orders, n_nodes: int) -> Ints:
    """Return a number (n_nodes,) for each node, the same for nodes of the same orders; -1 for nodes without."""
    value, amplitude = prescribed.value[:, 0], prescribed.amplitude[:, 0]
    table = np.concatenate([np.nan_to_num(value, nan=np.inf), amplitude.astype(float)])
    out = np.full(n_nodes, -1)
    out[prescribed.items] = np.unique(table.T, axis=0, return_inverse=True)[1].ravel()
    return out


def probes(draft: CaseDraft) -> None:
    """Add a [[probe]] for each node whose displacements the deck prints."""
    for node in draft.deck.watched:
        number = draft.groups.mesh.node_number[node]
        group = draft.node_group("", np.array([node]))
        draft.add("probe", {"group": group, "name": f"node {number}"})


def steps(draft: CaseDraft) -> None:
    """Add [steps]: the increments of the deck's steps, of a static one MOST_INCREMENTS at most. Raises Refused."""
    times: list[float] = []
    for step in draft.deck.steps:
        count = _increments(draft, step)
        if step.begin and step.begin == draft.ramped and step.sudden:  # loads jump where the motion begins
            times += [step.begin + part * step.period / count for part in _SUDDEN]
        times += [step.begin + step.period * k / count for k in range(1, count + 1)]
    even = [draft.end * k / len(times) for k in range(1, len(times) + 1)]
    if np.allclose(times, even, rtol=1e-12, atol=0):
        draft.add("steps", {"end": draft.end, "count": len(times)})
    else:
        draft.add("steps", {"times": times})


def _increments(draft: CaseDraft, step: DeckStep) -> int:
    """Return how many increments a step is computed in. Raises Refused for more than MOST_STEPS."""
    static = step.alpha is None
    count = step.period / (step.increment if static or step.direct else max(step.increment, step.largest))
    if static and not step.direct:
        count = min(count, MOST_INCREMENTS)
    if not count <= MOST_STEPS:
        message = f"a step of {count:.0f} increments is too long for the case; give fewer in the line of the procedure"
        raise Refused(message, None, step.origin)
    count = max(1, ceil(count - 1e-9))
    if not static and not step.direct:
        message = f"it is computed in {count} equal increments; lacsolver validate tells if they are short enough"
        draft.deck.note(step.origin, message)
    return count
