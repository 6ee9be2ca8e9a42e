"""Columns of the Schur complement that are kept over the steps: applications of K^-1 counted, results unchanged."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pytest

import lacsolver.equilibrium.reduced
from lacsolver.case import parse_case
from lacsolver.equilibrium import kept_columns
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.results.results import Restart
from lacsolver.results.state import CONTACT
from lacsolver.saddle.stiffness import Stiffness
from tests.lacsolver.contact_cases import HEAD, JOINT, MATERIAL, at, held, pressed
from tests.lacsolver.moving import PLANE, SMALL, SPACE, SPEED, WALL, moved, steps, thrown
from tests.lacsolver.patch_meshes import stack
from verification.meshes.bars import bar_on_wall
from verification.meshes.thrown import disc, on_wall

#: two blocks whose contact spreads from the middle while the upper one is pressed down, and shrinks again
ROUND = JOINT + 'clearance = "0.02 * ((x - 0.5)**2 + (y - 0.5)**2)"\n'
FIXED = held("bottom", ux=0.0, uy=0.0, uz=0.0)
UPRIGHT = at([0.0, 0.0, 2.0], ux=0.0, uy=0.0) + at([1.0, 0.0, 2.0], uy=0.0)
PRESSED = ROUND + FIXED + held("top", ux=0.0, uy=0.0, uz="-0.02 * sin(3 * t)")


def counted(problem, start=None):
    """(states, applications of K^-1 in each step, rows in contact at its end, rows closed so far)."""
    made, states, table, ever = [0], [], [], np.zeros(0, bool)
    solve = Stiffness.solve

    def counting(self, f):
        made[0] += 1
        return solve(self, f)

    with patch.object(Stiffness, "solve", counting):
        for state in march(problem, start=start):
            closed = np.concatenate([zone.status == CONTACT for zone in state.zones])
            ever = closed | (ever if len(ever) else closed)
            states.append(state)
            table.append((made[0], int(closed.sum()), int(ever.sum())))
            made[0] = 0
    return states, np.array(table)


def without(problem):
    """Return what `counted` does, without columns."""
    with patch.object(lacsolver.equilibrium.reduced, "SAVED", 0):
        return counted(problem)


def per_step(table):
    """Applications in a step in contact, on average, of steps that close no row for the first time."""
    again = np.diff(table[:, 2], prepend=0) == 0
    return table[(table[:, 1] > 0) & again, 0].mean()


def static(count, sections=PRESSED, counts=(7, 6)):
    text = HEAD.format(model="3d") + MATERIAL + sections + f"[steps]\ncount = {count}\n"
    return Problem.of(parse_case(text), stack("HEXA8", "HEXA8", 3, counts=counts, even=True))


def impact():
    """A disc on a wall, small kinematics: rows close and open one after the other."""
    text = PLANE + SMALL + WALL + "[dynamics]\n" + thrown("body", vy=-0.1) + steps(4.0, 50)
    return Problem.of(parse_case(text), on_wall(disc(8, (0.0, 1.01), "slave")))


@pytest.mark.parametrize("made", [impact, lambda: static(50)], ids=["dynamics", "statics"])
def test_a_step_in_contact_takes_at_most_three_applications(made):
    """One more for each row that closes for the first time; without columns it takes several times as many."""
    states, table = counted(made())
    plain, before = without(made())
    on = table[:, 1] > 0
    assert on.sum() > 30 and table[:, 1].max() >= 8
    assert per_step(table) <= 3 < 2 * per_step(table) < per_step(before)
    assert table[on, 0].sum() <= 3 * on.sum() + table[-1, 2] * 1.5
    assert table[:, 0].sum() < 0.6 * before[:, 0].sum()
    np.testing.assert_array_equal(table[:, 1:], before[:, 1:])
    for one, other in zip(states, plain, strict=True):
        assert np.abs(one.u - other.u).max() <= 1e-10 * np.abs(other.u).max()
        p, q = one.zones[0].pressure, other.zones[0].pressure
        assert np.abs(p - q).max() <= 1e-9 * max(np.abs(q).max(), 1e-300)


LAWS = {
    "soft": JOINT + "stiffness = 200.0\n" + 'clearance = "0.01 * x"\n' + PRESSED.removeprefix(ROUND),
    "tie": PRESSED.replace("[[contact]]", "[[tie]]").replace(ROUND.splitlines()[-1], ""),
    "held by contact alone": ROUND + FIXED + UPRIGHT + pressed("top", "1 + x + 0.8 * cos(5 * t)"),
    "pulled off": JOINT + 'initial = "all"\n' + FIXED + held("top", ux=0.0, uy=0.0, uz="0.01 * (t - 0.45)"),
}  # fmt: skip


@pytest.mark.parametrize("name", LAWS)
def test_results_are_those_without_columns(name):
    states, table = counted(static(6, LAWS[name], counts=(4, 3)))
    plain, _ = without(static(6, LAWS[name], counts=(4, 3)))
    rows = table[-1, 2] * (3 if name == "tie" else 1)
    assert table[1:, 0].sum() - rows <= 3 * (len(table) - 1)  # the first step has no columns yet
    for one, other in zip(states, plain, strict=True):
        assert np.abs(one.u - other.u).max() <= 1e-9 * np.abs(other.u).max()
        np.testing.assert_array_equal(one.zones[0].status, other.zones[0].status)


def test_columns_are_dropped_with_their_factor_and_with_their_rows():
    """Halving dt makes another factor: its columns are found anew; the memory of columns is bounded."""
    text = PLANE + SMALL + WALL + "[dynamics]\n" + thrown("bar", vy=-0.1)
    text += f"[steps]\ntimes = {[float(0.1 * k / SPEED) for k in (1, 2, 3, 3.5, 4)]}\n"
    kept = []
    start = kept_columns.start_from_columns

    def watched(columns, *arguments):
        kept.append(columns)
        return start(columns, *arguments)

    with patch("lacsolver.equilibrium.attempt.start_from_columns", watched):
        list(march(Problem.of(parse_case(text), bar_on_wall("QUAD4", 8, 0.0))))
    assert kept[0] is kept[2] is not kept[3] is kept[4]
    K, rows = kept[4].K, kept[4].rows
    assert kept[4].serve(K, rows) and not kept[4].serve(kept[0].K, rows)
    with patch.object(kept_columns, "_MEMORY", 8 * len(rows.w)):
        small = kept_columns.KeptColumns(K, rows, 9)
    assert small.most == 1
    one, other = small.columns(np.array([0])), small.columns(np.array([1]))
    np.testing.assert_array_equal(one, kept_columns.KeptColumns(K, rows, 9).columns(np.array([1, 0]))[:, 1:])
    assert len(small._values) == 1 and other.shape == one.shape
    B, C = rows.B.toarray(), kept_columns.KeptColumns(K, rows, 9).columns(np.arange(2))
    np.testing.assert_allclose(C, B @ np.linalg.solve(K.K.toarray(), B[:2].T), rtol=1e-9, atol=1e-12 * C.max())


def test_a_run_goes_on_to_the_last_bit_with_columns():
    """A restart has no columns yet, and finds the same."""
    text = SPACE + SMALL + WALL + "[dynamics]\n" + thrown("bar", vz=-0.5) + steps(0.9, 12)
    mesh = bar_on_wall("HEXA8", 4, 0.02)
    _, states, _ = moved(text, mesh)
    restart = Restart.of(states[7], states[7].step.step_size, 8)
    _, again, _ = moved(text, mesh, start=restart)
    np.testing.assert_array_equal(again[-1].u, states[-1].u)
    np.testing.assert_array_equal(again[-1].zones[0].pressure, states[-1].zones[0].pressure)
