"""Rules of the states of macro-elements with friction, one test a rule, and bounds and defects."""

from __future__ import annotations

import numpy as np
import pytest

from lacsolver.contact.friction import Bounds, Solved, States, defect, next_states
from tests.lacsolver.friction.small import coulomb

INF = np.inf


def states(closed=True, sticks=False, direction=(0.0,), turned=False):
    return States(*(np.array([v]) for v in (closed, sticks, direction, turned)))


def solved(p, t, s=(0.0,), presses=None, pressing=0.0):
    presses = p > 0 if presses is None else presses
    return Solved(*(np.array([v]) for v in (float(p), t, s, pressing, presses, 10.0)))


def after(now, what, bounds=None):
    then = next_states(now, what, bounds or coulomb(0.5, 1))
    return bool(then.closed[0]), bool(then.sticks[0]), then.direction[0].round(12).tolist(), bool(then.turned[0])


STICKS, OPEN = states(sticks=True), states(closed=False)
SLIDES, BACK = states(direction=(1.0,)), states(direction=(-1.0,))


@pytest.mark.parametrize(
    ("p", "t", "expected"),
    [
        (2.0, (0.9,), (True, True, [0.0], False)),  # below the bound
        (2.0, (-1.1,), (True, False, [-1.0], False)),  # above it: slides along its traction
        (-2.0, (0.1,), (True, False, [1.0], False)),  # in tension it slides first
        (-2.0, (0.0,), (False, False, [0.0], False)),  # without a traction it opens
    ],
)
def test_what_sticks(p, t, expected):
    assert after(STICKS, solved(p, t)) == expected


def test_in_space_it_slides_along_its_traction():
    _, sticks, d, _ = after(states(sticks=True, direction=(0.0, 0.0)), solved(1.0, (3.0, 4.0), (0.0, 0.0)))
    assert not sticks and d == pytest.approx([0.6, 0.8])


@pytest.mark.parametrize(
    ("now", "p", "t", "s", "expected"),
    [
        (SLIDES, 2.0, 1.0, 0.3, (True, False, [1.0], False)),  # goes on
        (SLIDES, -0.1, -0.05, 0.3, (False, False, [0.0], False)),  # opens
        (SLIDES, 2.0, 1.0, -0.1, (True, True, [0.0], False)),  # a little back: |1 - 1| <= 1, sticks
        (SLIDES, 2.0, 1.0, -0.3, (True, False, [-1.0], True)),  # far back: |1 - 3| > 1, turns round
        (states(direction=(1.0,), turned=True), 2.0, 1.0, -0.3, (True, True, [0.0], True)),  # once only
        (BACK, 2.0, -1.0, -0.3, (True, False, [-1.0], False)),
    ],
)
def test_what_slides(now, p, t, s, expected):
    assert after(now, solved(p, (t,), (s,))) == expected


def test_in_space_the_direction_is_that_of_traction_and_slip():
    now = states(direction=(1.0, 0.0))
    _, _, d, _ = after(now, solved(2.0, (1.0, 0.5), (0.1, 0.2)))
    assert d == pytest.approx(np.array([2.0, 2.5]) / np.hypot(2.0, 2.5))


@pytest.mark.parametrize(
    ("s", "pressing", "presses", "expected"),
    [
        (0.3, 0.0, False, (False, False, [0.0], False)),  # stays open
        (0.01, 2.0, True, (True, True, [0.0], False)),  # 0.1 < 1: sticks
        (-0.3, 2.0, True, (True, False, [-1.0], False)),  # 3 > 1: slides along its slip
    ],
)
def test_what_closes(s, pressing, presses, expected):
    assert after(OPEN, solved(0.0, (0.0,), (s,), presses, pressing)) == expected


def test_rough_never_slides_and_opens_at_once():
    rough = Bounds(np.array([INF]), np.zeros(1), np.array([INF]))
    assert after(STICKS, solved(1.0, (1e9,)), rough)[:2] == (True, True)
    assert after(STICKS, solved(-1.0, (1e9,)), rough)[0] is False
    assert after(OPEN, solved(0.0, (0.0,), (9.0,), True, 1.0), rough)[:2] == (True, True)


@pytest.mark.parametrize(
    ("s", "p", "expected"),
    [
        (0.05, 2.0, (True, True, [0.0], False)),  # 0.5 < 1: sticks
        (-0.3, 2.0, (True, False, [-1.0], False)),  # 3 > 1: slides along its slip
        (0.3, -2.0, (False, False, [0.0], False)),  # in tension it opens
    ],
)
def test_what_pressed_without_friction_in_the_first_solve(s, p, expected):
    assert after(states(), solved(p, (0.0,), (s,))) == expected


def test_states_to_start_from():
    """Without a traction it sticks, or presses without friction if the bodies are held without; else it slides."""
    none, t, bounds = np.zeros((2, 1)), np.array([[0.0], [-2.0]]), coulomb(0.5, 2)
    closed, no = np.ones(2, bool), np.zeros(2, bool)
    assert States.of(closed, no, none, bounds).sticks.all()
    begins = States.of(closed, no, none, bounds, held=True)
    assert begins.closed.all() and not begins.sticks.any() and not begins.slides.any()
    assert States.of(closed, no, t, bounds, held=True).direction.ravel().tolist() == [0.0, -1.0]
    assert States.of(closed, closed, none, bounds, held=True).sticks.all()


def test_without_friction_it_only_presses():
    none = coulomb(0.0, 1)
    assert after(OPEN, solved(0.0, (0.0,), (9.0,), True, 1.0), none) == (True, False, [0.0], False)
    assert after(states(), solved(1.0, (0.0,), (9.0,)), none) == (True, False, [0.0], False)
    assert after(states(), solved(-1.0, (0.0,), (9.0,)), none)[0] is False


def test_bounds():
    """Coulomb, with a cohesion, with a limit, Tresca, rough with a limit; nothing without pressure."""
    bounds = Bounds(np.array([0.5, 0.5, 0.5, 0.0, INF]), np.array([0, 1, 1, 2, 0.0]), np.array([INF, INF, 2, INF, 3.0]))
    b, slope = bounds.at(np.full(5, 4.0))
    assert b.tolist() == [2, 3, 2, 2, 3] and slope.tolist() == [0.5, 0.5, 0, 0, 0]
    assert not bounds.at(np.zeros(5))[0].any() and not bounds.at(np.full(5, -1.0))[0].any()
    assert bounds.rough.tolist() == [False] * 5 and bounds.any.all()


def test_a_defect_is_a_length():
    t, s, b = np.array([[3.0, 4.0], [0.0, 0.0]]), np.zeros((2, 2)), np.array([4.0, 1.0])
    assert defect(t, s, b, np.array([2.0, 2.0])) == pytest.approx(np.array([[0.3, 0.4], [0.0, 0.0]]))
    assert defect(t[1:], s[1:] + 0.01, b[1:], np.array([2.0])) == pytest.approx(np.full((1, 2), -0.01))
