"""What acts: cards of supports, loads and temperatures, and their records; probes of what is printed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from lacmesh.errors import on_page, some
from lacmesh.mesh import Floats, Ints
from lacsolver.decks.cards import Card, DeckLine, Refused
from lacsolver.decks.histories import JUMP, Assigned, Orders, Points, scaled, written
from lacsolver.decks.import_ import AXES, Import
from lacsolver.decks.materials import expanding, initial_temperatures
from lacsolver.decks.names import SIDES

#: supports of Abaqus that have a name, and the displacements that they hold; rotations have no meaning in a solid
_NAMED_SUPPORTS = {"ENCASTRE": (0, 1, 2), "PINNED": (0, 1, 2), "XSYMM": (0,), "YSYMM": (1,), "ZSYMM": (2,)}
#: most nodes of one *NODE PRINT that become probes
MOST_PROBES = 20


# ---- cards


def _now(import_: Import, card: Card, *kinds: str) -> int:
    """Return the number of the step, -1 before the first; OP=NEW removes what earlier steps say of some kinds."""
    if import_.steps and not import_.in_step:
        raise Refused("it is between two steps; move it into a step, between *STEP and *END STEP")
    now = len(import_.steps) - 1 if import_.in_step else -1
    if card.word("OP") == "NEW":
        for kind in kinds:
            import_.removed[kind][now] = card
    elif card.word("OP") not in ("", "MOD"):
        raise Refused(f"OP is MOD or NEW, and not {card.word('OP')}")
    return now


def _in_step(import_: Import, card: Card, *kinds: str) -> int:
    """Return the number of the step that is open, as `_now`. Raises Refused outside a step."""
    import_.step  # noqa: B018 (raises outside a step)
    return _now(import_, card, *kinds)


def boundary(import_: Import, card: Card) -> None:
    """Take prescribed displacements; those of the model are supports, and what is not 0 begins in the first step."""
    if (kind := card.word("TYPE", "DISPLACEMENT")) != "DISPLACEMENT":
        raise Refused(f"supports prescribe displacements, and not TYPE={kind}; give the displacement as an *AMPLITUDE")
    now = _now(import_, card, "displacement", "spin")
    for row in card.rows:
        named = import_.names.nodes(row.text(0), row)
        if "FIXED" in card.options:
            _fix(import_, card, row, now, named)
            continue
        directions = _NAMED_SUPPORTS.get(row.text(1).upper())
        value = 0.0
        if directions is None:
            first = row.whole(1, "the first direction")
            last = row.whole(2, "the last direction", first)
            if not 1 <= first <= last <= 6:
                raise Refused("the directions should be 1 to 3, or 4 to 6 for rotations of a rigid body", row)
            directions, value = tuple(range(first - 1, last)), row.number(3, "the displacement", 0.0)
        if value and now < 0:
            message = "a displacement among the model's data that is not 0 is taken as one of the first step"
            import_.note(card, message, row)
        begin = 0 if value and now < 0 else now
        shifts, turns = [a for a in directions if a < 3], [a - 3 for a in directions if a >= 3]
        for kind, axes in (("displacement", shifts), ("spin", turns)):
            if axes:
                import_.assign(card, row, kind, begin, named, axes, value)


def _fix(import_: Import, card: Card, row: DeckLine, now: int, named: tuple[str, Ints]) -> None:
    """Take that sections of bolts, and nodes of bodies, stay as they are from a step on. Raises Refused for others."""
    first = row.whole(1, "the first direction")
    last = row.whole(2, "the last direction", first)
    bolts = [node for node in named[1].tolist() if node in import_.locks]
    solid = bool(import_.names.in_cells[named[1]].all())
    if now < 1 or not 1 <= first <= last <= (3 if solid else 1) or not (solid or len(bolts) == len(named[1])):
        message = "FIXED is taken from the second step on, for nodes of solid elements in directions 1 to 3, and for"
        raise Refused(f"{message} nodes of *PRE-TENSION SECTION in direction 1; write other displacements", row)
    if solid:
        import_.assign(card, row, "held", now, named, range(first - 1, last), 0.0)
    for node in bolts:
        import_.locks[node] = now if import_.locks[node] is None else import_.locks[node]


def cload(import_: Import, card: Card) -> None:
    """Take forces on nodes, and moments on the node of a rigid body."""
    now = _in_step(import_, card, "force", "moment")
    for row in card.rows:
        nodes = import_.names.nodes(row.text(0), row)
        axis = row.whole(1, "the direction")
        if not 1 <= axis <= 6:
            raise Refused("the direction of a force should be 1 to 3, or 4 to 6 for a moment on a rigid body", row)
        kind, component = ("force", axis - 1) if axis < 4 else ("moment", axis - 4)
        import_.assign(card, row, kind, now, nodes, (component,), row.number(2, "the force"))


def dload(import_: Import, card: Card) -> None:
    """Take pressures on faces of elements, gravity, and centrifugal loads."""
    now = _in_step(import_, card, "pressure", "gravity", "centrifugal")
    for row in card.rows:
        named = name, cells = import_.names.cells(row.text(0), row)
        label = row.text(1).upper()
        if label == "GRAV":
            size = row.number(2, "the acceleration")
            way = np.array(row.numbers(3, 3, "a direction", 0.0))
            if not np.linalg.norm(way) > 0:
                raise Refused("the direction of gravity should not be 0", row)
            way = way / np.linalg.norm(way)
            along = (way.round(9) + 0.0).tolist()
            for axis, part in enumerate(size * way):
                import_.assign(card, row, "gravity", now, named, (axis,), float(part), along)
        elif label == "CENTRIF":
            axis_data = row.numbers(3, 6, "a point or a direction of the axis", 0.0)
            if not np.linalg.norm(axis_data[3:]) > 0:
                raise Refused("the direction of the axis should not be 0", row)
            value = row.number(2, "the square of the angular velocity")
            import_.assign(card, row, "centrifugal", now, named, (0,), value, axis_data)
        elif label[:1] == "P" and label[1:].isdigit():
            facets = f"{name}_{label}" if name else "", import_.names.facets(cells, label[1:], row)
            import_.assign(card, row, "pressure", now, facets, (0,), row.number(2, "the pressure"))
        else:
            raise Refused(f"lacsolver has the loads P1 to P6, GRAV and CENTRIF, and not {label or '(none)'}", row)


def dsload(import_: Import, card: Card) -> None:
    """Take pressures on surfaces."""
    now = _in_step(import_, card, "pressure")
    for row in card.rows:
        if row.text(1).upper() != "P":
            raise Refused(f"lacsolver has the load P on a surface, and not {row.text(1) or '(none)'}", row)
        facets = import_.names.skin(row.text(0), row)
        import_.assign(card, row, "pressure", now, facets, (0,), row.number(2, "the pressure"))


def temperature(import_: Import, card: Card) -> None:
    """Take temperatures of nodes."""
    now = _in_step(import_, card, "temperature")
    for row in card.rows:
        nodes = import_.names.nodes(row.text(0), row)
        import_.assign(card, row, "temperature", now, nodes, (0,), row.number(1, "the temperature"))


def initial_conditions(import_: Import, card: Card) -> None:
    """Take temperatures without strain, and the velocities with which nodes begin to move."""
    kind = card.word("TYPE")
    if kind not in ("TEMPERATURE", "VELOCITY"):
        raise Refused(f"initial conditions of type {kind or '(none)'} are not supported; TEMPERATURE and VELOCITY are")
    for row in card.rows:
        nodes = import_.names.nodes(row.text(0), row)
        if kind == "TEMPERATURE":
            import_.assign(card, row, "temperature", -1, nodes, (0,), row.number(1, "the temperature"))
            continue
        axis = row.whole(1, "the direction")
        if axis not in (1, 2, 3):
            raise Refused("the direction of an initial velocity should be 1 to 3", row)
        import_.assign(card, row, "velocity", -1, nodes, (axis - 1,), row.number(2, "the velocity"))


def node_print(import_: Import, card: Card) -> None:
    """Make probes of the nodes whose displacements are asked for; fields and tables have the rest."""
    wanted = {text.upper() for row in card.rows for text in row.fields if text}
    parts = []
    if "U" in wanted:
        name, nodes = import_.names.nodes(card.needed("NSET"), None)
        nodes = nodes[import_.names.in_cells[nodes]]
        few = len(nodes) <= MOST_PROBES
        what = "probes" if few else "nodes are too many for probes; the fields have them"
        parts.append(f"U of {name}: {len(nodes)} {what}")
        for node in nodes.tolist() if few else ():
            if node not in import_.watched:
                import_.watched[node] = None
                group = import_.node_group("", np.array([node]))
                import_.add("probe", {"group": group, "name": f"node {import_.names.mesh.node_number[node]}"})
    if "RF" in wanted:
        parts.append("RF: results.json has the reactions of each support")
    if others := sorted(wanted - {"U", "RF"}):
        parts.append(f"{', '.join(others)}: see {on_page('output')} for what a run writes")
    import_.note(card, "; ".join(parts) or "it requests nothing")


# ---- records of supports and forces


def _orders(import_: Import, kind: str) -> Orders:
    """Return the orders of one kind on nodes, facets or cells that are no nodes of rigid bodies. Raises Refused."""
    lines = import_.lines(kind)
    if kind in ("displacement", "force"):
        beside = list(import_.beside_bodies)
        if kind == "displacement":
            beside += [node for node in import_.equated if not import_.names.in_cells[node]]
        lines = [replace(line, items=np.setdiff1d(line.items, np.array(beside, np.int64))) for line in lines]
    return import_.orders(kind, [line for line in lines if len(line.items)])


def supports(import_: Import) -> None:
    """Add a [[displacement]] for each set of nodes. Raises Refused."""
    prescribed = _orders(import_, "displacement")
    for part, histories in prescribed.parts(once=False):
        with import_.taking(part.card):
            there = part.items[import_.names.in_cells[part.items]]
            if not len(there):
                import_.note(part.card, "these nodes belong to no solid element: the support is left out", part.row)
                continue
            for line, when, own in _by_begin(import_, prescribed, part, histories):
                keys = {f"u{AXES[c]}": written(points, import_.ramped) for c, points in own.items()} | when
                for axes, nodes in import_.by_axes(there):
                    group = import_.node_group(part.name if len(nodes) == len(part.items) else "", nodes, "held")
                    import_.add("displacement", {"group": group} | keys | axes, line.card)
    _add_held(import_, prescribed)


def _by_begin(
    import_: Import, prescribed: Orders, part: Assigned, histories: dict[int, Points]
) -> Iterator[tuple[Assigned, dict[str, float], dict[int, Points]]]:
    """Yield the line, the times and the histories of components of a support that begin together, the earliest first.

    The times are {} from the start on, else the keys `begin` and `reached`: nodes go from where they are to the value.
    Raises Refused for a support that begins as bodies move.
    """
    at = int(np.searchsorted(prescribed.items, part.items[0]))
    orders = {c: prescribed.order_of(c, at) for c in histories if c < import_.dim}
    first = {c: next(k for k, given in enumerate(order) if given) for c, order in orders.items()}
    for k in sorted(set(first.values())):
        own = {c: points for c, points in histories.items() if first.get(c) == k}
        if k == 0:
            yield part, {}, own
            continue
        step, line = import_.steps[k], prescribed.line_of(at, min(own))
        if step.begin >= import_.ramped and step.alpha is not None:
            message = "this support begins in a step of *DYNAMIC, and moving nodes would stop abruptly"
            raise Refused(f"{message}; apply it from the start, or in a static step before", line.row, line.card)
        jumps = step.sudden or any(given and given[1] for given in (orders[c][k] for c in own))
        reached = step.begin + JUMP * step.period if jumps else step.end
        yield line, {"begin": step.begin, "reached": reached}, own


def _add_held(import_: Import, prescribed: Orders) -> None:
    """Add a [[displacement]] that begins late for nodes that stay where a step finds them (FIXED). Raises Refused.

    A displacement that a step before prescribes without an amplitude stays anyway.
    """
    stay = [np.empty(0, np.int64)] * import_.dim
    for line in import_.lines("held"):
        with import_.taking(line.card):
            step, known = import_.steps[line.step], np.isin(prescribed.items, line.items)
            there, label = prescribed.items[known], prescribed.label[:, known]
            orders = [prescribed.orders[k] for k in np.unique(label[list(line.components)]).tolist() if k >= 0]
            moved = any(any(order[line.step :]) or any(one and one[1] for one in order) for order in orders)
            if moved or step.alpha is not None:
                message = "FIXED constrains nodes that this or a later step, an amplitude or a motion moves"
                raise Refused(f"{message}; write their displacement", line.row, line.card)
            for c in (c for c in line.components if c < import_.dim):
                free = np.setdiff1d(line.items, np.append(there[label[c] >= 0], stay[c]))
                stay[c] = np.union1d(stay[c], free)
                for axes, nodes in import_.by_axes(free):
                    group = import_.node_group(line.name if len(nodes) == len(line.items) else "", nodes, "held")
                    keys = {"group": group, f"u{AXES[c]}": 0.0, "begin": step.begin}
                    import_.add("displacement", keys | axes, line.card)


def forces(import_: Import) -> None:
    """Add a [[force]] for each set of nodes. Raises Refused."""
    numbers = import_.names.mesh.node_number
    for part, histories in _orders(import_, "force").parts(once=True):
        with import_.taking(part.card):
            if max(histories) >= import_.dim:
                raise Refused("a force has the directions 1 and 2 in a plane model", part.row)
            loose = part.items[~import_.names.in_cells[part.items]]
            if len(loose):
                raise Refused(f"nodes {some(numbers[loose])} belong to no solid element, and carry no force", part.row)
            keys = {f"f{AXES[c]}": written(points, import_.ramped) for c, points in histories.items()}
            for axes, nodes in import_.by_axes(part.items):
                group = import_.node_group(part.name if len(nodes) == len(part.items) else "", nodes, "loaded")
                import_.add("force", {"group": group} | keys | axes, part.card)
    for line in (*import_.lines("moment"), *import_.lines("spin")):
        with import_.taking(line.card):
            if line.value and not np.isin(line.items, import_.references).all():  # a rotation of 0 has no meaning there
                message = "only the reference node of a *RIGID BODY or a *COUPLING has rotations"
                raise Refused(f"{message}; nodes of solid elements do not", line.row)


# ---- records of loads on faces and cells


def pressures(import_: Import) -> None:
    """Add a [[pressure]] for each set of faces; with NLGEOM it follows them. Raises Refused."""
    for part, histories in _orders(import_, "pressure").parts(once=True):
        with import_.taking(part.card):
            if len(inner := import_.names.inner(part.items)):
                numbers = some(import_.names.mesh.cell_number[inner // SIDES])
                message = f"these faces of elements {numbers} lie between two elements; press outer faces"
                raise Refused(message, part.row)
            group = import_.groups.add("skins", part.name or "pressed", part.items)
            keys = {"group": group, "value": written(histories[0], import_.ramped)}
            import_.add("pressure", keys | ({"follower": True} if import_.large else {}), part.card)


def gravity(import_: Import) -> None:
    """Add [gravity] if it acts on all that has a density, else a [[body_force]] for each density. Raises Refused.

    Gravity along another direction is another load, which adds to that of earlier steps, as in CalculiX.
    """
    density, lines = import_.of_cells("density"), import_.lines("gravity")
    alike = [[line for line in lines if line.data == way] for way in dict.fromkeys(line.data for line in lines)]
    parts = [part for same in alike for part in import_.orders("gravity", same).parts(once=True)]
    heavy = np.flatnonzero(density)
    for part, histories in parts:
        with import_.taking(part.card):
            keys = {f"{AXES[c]}": written(points, import_.ramped) for c, points in histories.items() if c < import_.dim}
            if not np.isin(part.items, heavy).any():
                raise Refused("gravity acts on elements without a density; give their material a *DENSITY", part.row)
            if len(parts) == 1 and np.isin(heavy, part.items).all():
                if import_.model == "axisymmetric" and keys.pop("x", 0.0):
                    raise Refused("gravity along the radius has no meaning in a full circle; give it along y", part.row)
                import_.add("gravity", {f"g{axis}": value for axis, value in keys.items()}, part.card)
                continue
            for rho, cells in _by_density(density, part.items):
                group = import_.groups.add("cells", part.name or "heavy", cells)
                loads = {f"f{axis}": scaled(value, rho) for axis, value in keys.items()}
                import_.add("body_force", {"groups": [group]} | loads, part.card)


def _by_density(density: Floats, cells: Ints) -> list[tuple[float, Ints]]:
    """Return the densities of some cells, and the cells of each."""
    parts = [(float(rho), cells[density[cells] == rho]) for rho in np.unique(density[cells])]
    return [(rho, own) for rho, own in parts if rho]


def centrifugal(import_: Import) -> None:
    """Add a [[body_force]] for each centrifugal load. Raises Refused."""
    for line in import_.lines("centrifugal"):
        with import_.taking(line.card):
            if import_.large or line.amplitude or len(import_.steps) > 1:
                message = "a centrifugal load is taken in one step, without NLGEOM and without amplitude"
                raise Refused(f"{message}; write a [[body_force]]", line.row, line.card)
            time = "" if import_.steps[0].sudden else f" * t / {import_.steps[-1].end!r}"
            outward = _outward(np.array(line.data[:3]), np.array(line.data[3:]))
            for rho, cells in _by_density(import_.of_cells("density"), line.items):
                group = import_.groups.add("cells", line.name or "turning", cells)
                factor = rho * line.value
                loads = {f"f{AXES[c]}": f"{factor!r} * ({outward[c]}){time}" for c in range(import_.dim) if outward[c]}
                import_.add("body_force", {"groups": [group]} | loads, line.card)


def _outward(origin: Floats, way: Floats) -> list[str]:
    """Return the vector from an axis to a place, as formulas of x, y, z; "" for a component that is 0.

    >>> _outward(np.zeros(3), np.array([0.0, 2.0, 0.0]))
    ['1.0 * x', '', '1.0 * z']
    """
    rows = []
    for row in np.eye(3) - np.outer(way, way) / (way @ way):
        terms = [(float(a), AXES[k], float(origin[k])) for k, a in enumerate(row) if abs(a) > 1e-15]
        rows.append(" + ".join(f"{a!r} * ({axis} - {o!r})" if o else f"{a!r} * {axis}" for a, axis, o in terms))
    return rows


# ---- records of temperatures


def temperatures(import_: Import) -> None:
    """Add a [[temperature]] for each group of cells that expand, and have one history. Raises Refused."""
    cells = expanding(import_)
    lines = [one for one in import_.lines("temperature") if one.step >= 0]
    if not lines:
        return
    if not len(cells):
        import_.note(lines[0].card, "no material has an *EXPANSION, so that temperatures have no effect")
        return
    with import_.taking(lines[0].card):
        _add_temperatures(import_, lines, cells)


def _add_temperatures(import_: Import, lines: list[Assigned], cells: Ints) -> None:
    """Add the records of temperatures on cells. Raises Refused for an element of several temperatures."""
    mesh = import_.names.mesh
    prescribed = import_.orders("temperature", lines)
    row_of, start = np.full(mesh.n_nodes, -1), initial_temperatures(import_)
    row_of[prescribed.items] = prescribed.label[0]
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
    values = [[np.inf if one is None else one[0] for one in order] for order in prescribed.orders]
    for k, (row, T) in sorted(enumerate(kinds.tolist()), key=lambda one: values[int(one[1][0])]):
        own, at = warm[which.ravel() == k], int(np.flatnonzero(prescribed.label[0] == row)[0])
        points = prescribed.history(int(prescribed.items[at]), 0, T)
        value = written(points or [(0.0, T)], import_.ramped, T)
        if value == T:
            continue
        line = prescribed.line_of(at)
        keys: dict[str, Any] = {"value": value}
        if len(own) < np.count_nonzero(mesh.cell_dim == mesh.dim):
            keys = {"groups": [import_.groups.add("cells", line.name or "warm", own)]} | keys
        import_.add("temperature", keys, line.card)
