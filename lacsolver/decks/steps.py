"""Steps: how time runs, amplitudes, inertia; the [steps] and [dynamics] records, and the velocities of [[initial]]."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil
from typing import Any

import numpy as np

from lacmesh.deck import key_of
from lacmesh.errors import some
from lacmesh.mesh import Floats, Ints
from lacmesh.topology.bodies import body_names, label_bodies
from lacsolver.decks.cards import Card, Lacking, Refused, look_up
from lacsolver.decks.histories import Amplitude, Assigned, DeckStep
from lacsolver.decks.import_ import AXES, Import

#: most increments of a step that become steps of a case; a step that does not converge is halved all the same
MOST_INCREMENTS = 10
#: short increments, relative to the others, that follow on a static step: the motion begins in equilibrium, and after a
#: jump of loads the scheme of Hilber, Hughes and Taylor has the new forces at both ends of the second one
_SUDDEN = (1e-3, 2e-3)
#: most increments of a step that a case lists
MOST_STEPS = 100_000
#: largest numerical damping of the method of Hilber, Hughes and Taylor
_MOST_DAMPING = 1 / 3
#: largest difference of the velocities of a body from linear ones, relative to the largest of them
_LINEAR = 1e-6


# ---- cards


def amplitude(import_: Import, card: Card) -> None:
    """Take a table of times and factors."""
    if card.word("DEFINITION", "TABULAR") != "TABULAR":
        raise Refused("only tables of times and factors are taken (DEFINITION=TABULAR); write one")
    if card.word("VALUE", "RELATIVE") != "RELATIVE":
        raise Refused("only factors are taken (VALUE=RELATIVE); divide the table by the load's size")
    later, more = (card.number(name, 0.0) for name in ("SHIFTX", "SHIFTY"))
    rows: list[tuple[float, float]] = []
    for row in card.rows:
        for k in range(0, len(row.fields) - 1, 2):
            t, factor = row.number(k, "a time"), row.number(k + 1, "a factor")
            if rows and t + later <= rows[-1][0]:
                raise Refused(f"its times should increase, and {t:g} follows {rows[-1][0]:g}", row)
            rows.append((t + later, factor + more))
    if not rows:
        raise Refused("it should list times and factors")
    import_.amplitudes[key_of(card.needed("NAME"))] = Amplitude(tuple(rows), card.word("TIME") == "TOTALTIME")


def step(import_: Import, card: Card) -> None:
    """Begin a step."""
    begin = import_.steps[-1].end if import_.steps else 0.0
    before = bool(import_.steps) and import_.steps[-1].large  # which stays, unless a step says NO
    large = card.word("NLGEOM") != "NO" if "NLGEOM" in card.options else before
    if import_.steps and large != import_.steps[0].large:
        raise Refused(
            "lacsolver has small or finite displacements for all steps; give NLGEOM in all of them or in none"
        )
    if (grown := card.word("AMPLITUDE", "RAMP")) not in ("RAMP", "STEP"):
        raise Refused(f"the amplitude of a step is RAMP or STEP, and not {grown}")
    import_.steps.append(DeckStep(card, begin, large=large, sudden=grown == "STEP"))
    import_.in_step = True


def _procedure(import_: Import, card: Card) -> DeckStep:
    """Return the step that is open, which has this procedure. Raises Refused if it has another."""
    which = import_.step
    if which.procedure is not None:
        before = which.procedure.of
        raise Refused(f"this step is *{before.name} already (line {before.line}); keep one of them")
    which.procedure = card
    return which


def static(import_: Import, card: Card) -> None:
    """Take the first increment and the length of a step."""
    _take_times(_procedure(import_, card), card)


def _take_times(which: DeckStep, card: Card) -> None:
    """Take the increments and the length of a step from its procedure. Raises Refused."""
    if card.rows:
        row = card.rows[0]
        which.increment, which.period = row.number(0, "the first increment", 1.0), row.number(1, "the period", 1.0)
        which.largest = row.number(3, "the largest increment", 0.0)
        if not (which.period > 0 and which.increment > 0 and which.largest >= 0):
            raise Refused("the increments and the period of a step should be positive", row)
    which.direct = "DIRECT" in card.options


def dynamic(import_: Import, card: Card) -> None:
    """Take an implicit step with inertia: its increments, and the numerical damping; loads act in full at once."""
    which = _procedure(import_, card)
    if "EXPLICIT" in card.options:
        message = "lacsolver's time scheme is implicit, and this step is EXPLICIT; leave the option out, and give"
        message += " increments in which a wave crosses a half to a whole element"
        if not (import_.lenient or import_.partial):
            raise Refused(message)
        import_.warn(card, f"left out: {message}; the step is implicit")
    alpha = -card.number("ALPHA", -0.05)
    if not 0 <= alpha <= _MOST_DAMPING:
        raise Refused(f"ALPHA should be from -1/3 to 0, not {-alpha:g}")
    _take_times(which, card)
    which.alpha = alpha
    which.sudden = which.card.word("AMPLITUDE") != "RAMP"


def frequency(import_: Import, card: Card) -> None:
    """Take how many natural modes are asked for: `lacsolver modes` finds them."""
    which = _procedure(import_, card)
    which.modes = card.first("the number of modes").whole(0, "the number of modes")
    if which.modes < 1:
        raise Refused("the number of modes should be positive", card.rows[0])
    state = ", with --state DIR for those about the state of a run" if len(import_.steps) > 1 else ""
    import_.note(card, f"natural modes are found by lacsolver modes CASE.toml -k {which.modes}{state}")


def end_step(import_: Import, card: Card) -> None:
    """End a step, if one is open; one that asks for modes takes no time, and may not load anything."""
    del card
    if not import_.in_step:
        return
    import_.in_step = False
    which, now = import_.steps[-1], len(import_.steps) - 1
    if which.left_out:
        import_.steps.pop()
        import_.assigned = [line for line in import_.assigned if line.step < now]
        for steps in import_.removed.values():
            steps.pop(now, None)
    elif which.modes:
        import_.modal = import_.steps.pop()
        if any(line.step == now for line in import_.assigned):
            raise Refused("supports and loads of a *FREQUENCY step are not supported; give supports in the model")
    elif "PERTURBATION" in which.card.options:
        raise Refused("a step of small PERTURBATION is taken with *FREQUENCY alone; leave the option out")


def cyclic_modes(import_: Import, card: Card) -> None:
    """Warn that a step of *FREQUENCY asks for modes with nodal diameters. Raises Lacking elsewhere."""
    message = "modes with nodal diameters are not supported; static sectors are"
    if not (import_.in_step and import_.step.modes):
        raise Lacking(message)
    import_.warn(card, f"{message}: lacsolver modes finds those that are alike in all sectors")


# ---- records


def steps(import_: Import) -> None:
    """Add [steps]: the increments of the deck's steps, of a static one MOST_INCREMENTS at most. Raises Refused."""
    times: list[float] = []
    for one in import_.steps:
        count = _increments(import_, one)
        if one.begin and one.begin == import_.ramped and one.sudden:  # loads jump where the motion begins
            times += [one.begin + part * one.period / count for part in _SUDDEN]
        times += [one.begin + one.period * k / count for k in range(1, count + 1)]
    end = import_.steps[-1].end
    even = [end * k / len(times) for k in range(1, len(times) + 1)]
    if np.allclose(times, even, rtol=1e-12, atol=0):
        import_.add("steps", {"end": end, "count": len(times)})
    else:
        import_.add("steps", {"times": times})


def _increments(import_: Import, one: DeckStep) -> int:
    """Return how many increments a step is computed in. Raises Refused for more than MOST_STEPS."""
    is_static = one.alpha is None
    count = one.period / (one.increment if is_static or one.direct else max(one.increment, one.largest))
    if is_static and not one.direct:
        count = min(count, MOST_INCREMENTS)
    if not count <= MOST_STEPS:
        message = f"a step of {count:.0f} increments is too long for the case; give fewer in the line of the procedure"
        raise Refused(message, None, one.origin)
    count = max(1, ceil(count - 1e-9))
    if not is_static and not one.direct:
        message = f"it is computed in {count} equal increments; lacsolver validate tells if they are short enough"
        import_.note(one.origin, message)
    return count


def dynamics(import_: Import) -> None:
    """Add [dynamics] and [[initial]] if there is a *DYNAMIC step. Raises Refused."""
    moving = [one for one in import_.steps if one.alpha is not None]
    given = import_.lines("velocity")
    if not moving:
        cards = [line.card for line in given[:1]] + [m.card for m in import_.materials.values() if any(m.damping)]
        for card in cards:
            import_.note(card, "without a step of *DYNAMIC velocities and damping have no effect")
        return
    first = import_.steps.index(moving[0])
    if late := next((one for one in import_.steps[first:] if one.alpha is None), None):
        import_.error(
            late.origin, "a static step after a dynamic one is not supported; compute it in a deck of its own"
        )
    if other := next((one for one in moving if one.alpha != moving[0].alpha), None):
        import_.error(other.origin, "lacsolver has one ALPHA for all steps; give the steps of *DYNAMIC the same")
    if first and given:
        message = "CalculiX sets these velocities to 0 in the static step before the motion"
        raise Refused(f"{message}; remove them, or add [[initial]] to the case", given[0].row, given[0].card)
    keys: dict[str, Any] = {"alpha": moving[0].alpha} | ({"start": moving[0].begin} if first else {})
    if any(damping := _damping(import_)):
        keys["rayleigh"] = list(damping)
    import_.add("dynamics", keys, moving[0].origin)
    if given:
        _add_initial(import_, given)


def _damping(import_: Import) -> tuple[float, float]:
    """Return the Rayleigh damping of the materials, which all must share, and have a density. Raises Refused."""
    keys = {look_up(import_.materials, one.material, "*MATERIAL") for one in import_.sections}
    materials = [import_.materials[key] for key in sorted(keys)]
    for material in materials:
        if not material.keys.get("density"):
            message = f"material {material.name} has no *DENSITY, and motion needs a mass; give it one"
            import_.error(material.card, message)
    if len({material.damping for material in materials}) > 1:
        names = ", ".join(material.name for material in materials)
        raise Refused(f"materials {names} have several dampings, and lacsolver has one for all; give them the same")
    return materials[0].damping if materials else (0.0, 0.0)


def _add_initial(import_: Import, lines: list[Assigned]) -> None:
    """Add an [[initial]] for each body with velocities, which must be linear in its coordinates. Raises Refused."""
    mesh = import_.names.mesh
    v = np.zeros((mesh.n_nodes, 3))
    for line in lines:
        v[line.items, line.components[0]] = line.value
    _move_rigid(import_, v, lines)
    _check_velocities(import_, v, lines)
    solid = np.flatnonzero(mesh.cell_dim == mesh.dim)
    body_of = label_bodies((nodes for _, _, nodes in mesh.select(solid)), mesh.n_nodes)
    cell_body = np.full(mesh.n_cells, -1)
    for _, cells, nodes in mesh.select(solid):
        cell_body[cells] = body_of[nodes[:, 0]]
    names = body_names(mesh, body_of, int(body_of.max(initial=-1)) + 1)
    for body in np.unique(body_of[(v != 0).any(axis=1) & (body_of >= 0)]).tolist():
        nodes, cells = np.flatnonzero(body_of == body), np.flatnonzero(cell_body == body)
        line = next((one for one in lines if np.isin(one.items, nodes).any()), lines[0])
        keys: dict[str, Any] = dict(_linear(import_, names[body], nodes, v[nodes], line))
        if len(cells) < len(solid):
            same = (name for name, own in import_.groups.cells.items() if np.array_equal(np.sort(own), cells))
            keys = {"groups": [next(same, "") or import_.groups.add("cells", "moving", cells)]} | keys
        import_.add("initial", keys, line.card)


def _move_rigid(import_: Import, v: Floats, lines: list[Assigned]) -> None:
    """Give the nodes of rigid bodies the velocity (n_nodes, 3) of their reference nodes, in place. Raises Refused."""
    for body in import_.bodies:
        own, reference = v[body.nodes], v[body.reference].copy()
        if own.any() and (own != reference).any():
            number = import_.names.mesh.node_number[body.reference]
            line = next(one for one in lines if np.isin(one.items, body.nodes).any())
            message = f"a rigid body moves with its reference node, {number}, in CalculiX and Abaqus"
            raise Refused(f"{message}; give the velocity to that node", line.row, line.card)
        v[body.reference] = 0.0
        v[body.nodes] = reference


def _check_velocities(import_: Import, v: Floats, lines: list[Assigned]) -> None:
    """Raise Refused for velocities of nodes of no solid element, or along directions in which nodes are held."""
    number = import_.names.mesh.node_number
    loose = np.flatnonzero((v != 0).any(axis=1) & ~import_.names.in_cells)
    if len(loose):
        message = f"nodes {some(number[loose])} belong to no solid element"
        raise Refused(f"{message}; give the velocity to the nodes of elements", lines[0].row, lines[0].card)
    for line in import_.lines("displacement"):
        for c in line.components:
            if (fixed := line.items[v[line.items, c] != 0]).size:
                message = f"nodes {some(number[fixed])} have a velocity along {AXES[c]}, in which they are constrained"
                raise Refused(f"{message}; constrain the nodes or move them, not both", line.row, line.card)


def _linear(import_: Import, name: str, nodes: Ints, v: Floats, line: Assigned) -> Iterator[tuple[str, float | str]]:
    """Yield the keys of the velocities (k, 3) of the nodes of a body, its name in a sentence: numbers, or formulas.

    Raises Refused.
    """
    points = import_.names.mesh.points[nodes]
    centre = points.mean(axis=0)
    basis = np.column_stack([np.ones(len(nodes)), points - centre])[:, : 1 + import_.dim]
    for c in range(import_.dim):
        size = np.abs(v[:, c]).max()
        if not size:
            continue
        if (v[:, c] == v[0, c]).all():
            yield f"v{AXES[c]}", float(v[0, c])
            continue
        parts = np.linalg.lstsq(basis, v[:, c], rcond=None)[0]
        off = np.abs(basis @ parts - v[:, c])
        if off.max() > _LINEAR * size:
            number = import_.names.mesh.node_number[nodes[off.argmax()]]
            raise Refused(
                f"the velocities along {AXES[c]} of {name} are not linear in its coordinates, most of all at node "
                f"{number}, as those of a translation, a rotation or a stretch are; give all nodes of the body such "
                "velocities",
                line.row,
                line.card,
            )
        terms = [f"{a!r} * ({AXES[k]} - {centre[k].item()!r})" for k, a in enumerate(parts[1:].tolist())]
        yield f"v{AXES[c]}", " + ".join([repr(float(parts[0])), *terms])
