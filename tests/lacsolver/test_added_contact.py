"""A contact law that the packages do not have, added from outside: a bond that breaks at a tension, for good."""

from dataclasses import dataclass

import numpy as np
import pytest

from lacsolver.case import parse_case
from lacsolver.case.added import CONTACT_LAWS
from lacsolver.contact.laws import CONTACT, Bilateral, Unilateral
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from tests.lacsolver.patch_meshes import stack

YOUNG = 1000.0


@dataclass(frozen=True)
class Bond(Bilateral):
    """No gap while the pressure is at least -strength; broken, pressure or gap. History: 1 where it is broken."""

    strength: float = 0.0

    n_history, exact = 1, True

    def next_active(self, rows):
        holds = rows.active & (rows.history[:, 0] == 0) & (rows.pressure >= -self.strength)
        return holds | Unilateral().next_active(rows)

    def residual(self, rows):
        beyond = np.minimum(rows.pressure + self.strength, 0.0) / rows.skin_stiffness
        bonded = rows.active & (rows.history[:, 0] == 0)
        return np.where(bonded, rows.gap + beyond, Unilateral().residual(rows))

    def status(self, rows):
        return np.where(rows.active, CONTACT, 0).astype(np.int8)

    def commit(self, rows):
        return np.maximum(rows.history, ~rows.active[:, None])


def test_a_bond_between_two_columns(monkeypatch):
    """The exact solution: tension E u / 2 up to the strength, then a gap, and only pressure ever after."""
    monkeypatch.setitem(CONTACT_LAWS, "bond", Bond)
    text = (
        f'mesh = "two.msh"\nmodel = "3d"\n[steps]\ncount = 5\nend = 5.0\n[[material]]\nyoung = {YOUNG}\npoisson = 0.0\n'
    )
    text += '[[contact]]\nslave = "slave"\nmaster = "master"\ntype = "bond"\nconstants = { strength = 2.5 }\n'
    text += "".join(
        f'[[displacement]]\ngroup = "{g}"\nu{a} = 0.0\n' for g, a in (("x0", "x"), ("y0", "y"), ("bottom", "z"))
    )
    text += (
        '[[displacement]]\ngroup = "top"\nuz = [[0, 0], [1, 0.002], [2, 0.004], [3, 0.006], [4, -0.001], [5, 0.001]]\n'
    )
    states = list(march(Problem.of(parse_case(text), stack("HEXA8", "TETRA4", 3))))
    for state, pressure, gap in zip(states, (-1.0, -2.0, 0.0, 0.5, 0.0), (0.0, 0.0, 0.006, 0.0, 0.001), strict=True):
        (zone,) = state.zones
        assert zone.pressure == pytest.approx(np.full(len(zone.pressure), pressure), abs=1e-9)
        assert zone.gap == pytest.approx(np.full(len(zone.gap), gap), abs=1e-12)
