"""*PRE-TENSION SECTION of decks: forces, shortenings, locks, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from lacsolver.case import CaseError
from lacsolver.results.figures import step_figures
from tests.lacsolver.deck_texts import Block, imported, section, solved, step

#: a column of four elements, 4 high, held at its foot and its head
COLUMN = Block(high=(1, 1, 4), cells=(1, 1, 4))
SURFACE = "*SURFACE, NAME=MIDDLE\n2, S2\n"
BOLT = SURFACE + "*NODE\n9999, 5., 5., 5.\n"
HELD = "*BOUNDARY\nB_Z0, 1, 3\nB_Z1, 1, 3\n"


def deck(card, *steps):
    return COLUMN.text() + section(nu=0.0) + BOLT + HELD + card + "".join(steps)


def bolts(solution):
    return [step_figures(solution.problem, state).pretension["MIDDLE"] for state in solution.states]


@pytest.mark.parametrize("normal", ["", "0., 0., 2.\n"])
def test_a_force_that_is_locked(tmp_path, normal):
    """The force 10, then the shortening stays whatever the force becomes; 10 = E A s / 4."""
    card = f"*PRE-TENSION SECTION, SURFACE=MIDDLE, NODE=9999\n{normal}"
    first, second = step("*CLOAD\n9999, 1, 10.\n"), step("*BOUNDARY, FIXED\n9999, 1\n*CLOAD\n9999, 1, 30.\n")
    solution = solved(tmp_path, deck(card, first, second))
    (record,) = solution.made.case.pretension
    assert record.lock == 1.0 and (record.normal is None) == (not normal)
    np.testing.assert_allclose([bolt.force for bolt in bolts(solution)], 10.0, rtol=1e-10)
    np.testing.assert_allclose([bolt.shortening for bolt in bolts(solution)], 10 * 4 / 1000, rtol=1e-10)


def test_a_shortening(tmp_path):
    card = "*PRE-TENSION SECTION, SURFACE=MIDDLE, NODE=9999\n"
    solution = solved(tmp_path, deck(card, step("*BOUNDARY\n9999, 1, 1, 0.02\n")))
    assert bolts(solution)[-1].force == pytest.approx(1000 * 0.02 / 4, rel=1e-10)


@pytest.mark.parametrize(
    ("card", "loads", "says"),
    [
        ("*PRE-TENSION SECTION, ELEMENT=2, NODE=9999\n", "*CLOAD\n9999, 1, 1.\n", "a bolt that is a beam"),
        ("*PRE-TENSION SECTION, SURFACE=MIDDLE, NODE=1\n", "*CLOAD\n1, 1, 1.\n", "a node of its own"),
        ("*PRE-TENSION SECTION, SURFACE=MIDDLE, NODE=9999\n", "*CLOAD\nB_Z1, 3, 1.\n", "node 9999 has no"),
        (
            "*PRE-TENSION SECTION, SURFACE=MIDDLE, NODE=9999\n",
            "*BOUNDARY, FIXED\nB_Z1, 3\n",
            "FIXED is taken from the second step on",
        ),
    ],
)
def test_what_is_refused(tmp_path, card, loads, says):
    with pytest.raises(CaseError, match=says):
        imported(tmp_path, deck(card, step(loads)))
