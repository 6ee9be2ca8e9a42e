"""Several processes find what one finds: closed sets, displacements, pressures and reactions of cases of every kind."""

from __future__ import annotations

import json
from functools import cache

import pytest

from tests.lacsolver.distributed import friction_cases, joined_cases, moving_cases, plastic_cases, soft_cases
from tests.lacsolver.distributed.mpi import printed
from tests.lacsolver.invariant_cases import CASES

pytestmark = pytest.mark.petsc
#: bounds of relative differences from one process
BOUNDS = {"u": 1e-9, "p": 5e-9, "reaction": 1e-9, "energy": 1e-9}
#: and of those of a motion
MOVING = ("velocity", "acceleration", "energies", "impulse", "linear", "angular", "probes")
PLANE = [name for name, case in CASES.items() if case.dim == 2]
SOLID = [name for name, case in CASES.items() if case.dim == 3]
RIGID = [*moving_cases.RIGID]
MOVED = [*moving_cases.CASES]
RUBBED = [*friction_cases.CASES]
YIELDED = [*plastic_cases.CASES]
SOFT = [*soft_cases.CASES]
JOINED = [*joined_cases.CASES]
#: and of those of friction, with their bound: the tolerance is of displacements, beside which slips are small
RUBBING, OF_SLIPS = ("shear", "slip", "path", "dissipation", "resultant", "work"), 2e-7
#: the ranks, of four processes that are started once, the backend, and the cases of each kind; rows that share no rank
#: are solved side by side
QUICK = {
    "any": [
        ([0, 1, 2, 3], "hypre", SOLID[:1]),
        ([0, 1, 2], "multigrid", SOLID + RIGID),
        ([3], "multigrid", SOLID[:1]),
        ([0, 1], "mumps", PLANE),
        ([2, 3], "gamg", SOLID[:1]),
    ],
    "motion": [([2, 3], "multigrid", MOVED[3:])],
    "friction": [([0, 1], "mumps", RUBBED[:2]), ([2, 3], "multigrid", RUBBED[2:])],
    "flow": [([0, 1], "mumps", YIELDED[:1]), ([2, 3], "multigrid", YIELDED[1:])],
    "soft": [([0, 1], "mumps", SOFT[::2]), ([1, 2, 3], "multigrid", SOFT[1:])],
    "joined": [([0, 1], "mumps", JOINED[::2]), ([1, 2, 3], "multigrid", JOINED[3:5])],
}
SLOW = {
    "motion": [([0, 1, 2, 3], "mumps", MOVED[:3])],
    "friction": [([0, 1, 2], "mumps", RUBBED), ([0, 1, 2, 3], "mumps", RUBBED)],
    "flow": [([0, 1], "mumps", YIELDED[1:]), ([2, 3], "multigrid", YIELDED[:1]), ([0, 1, 2], "multigrid", YIELDED)],
    "soft": [([0, 1], "mumps", SOFT[1::2]), ([1, 2, 3], "multigrid", SOFT[:1])],
    "joined": [([0, 1], "mumps", JOINED[1::2]), ([1, 2, 3], "multigrid", JOINED[5:])],
}


@cache
def solved(slow):
    """The differences of all rows, by number of processes, backend and case."""
    rows = [row for kind in (SLOW if slow else QUICK).values() for row in kind]
    lines = printed(4, "compare", json.dumps(rows), timeout=600)
    return {(line["n"], line["backend"], line["name"]): line for line in lines}


def rows_of(kind):
    """Mark a test to try each row of a kind: what it is given are the differences of the cases."""
    rows = [
        pytest.param(slow, *row, marks=[pytest.mark.slow] * slow, id=f"{len(row[0])}-{row[1]}")
        for slow, table in ((False, QUICK), (True, SLOW))
        for row in table.get(kind, ())
    ]
    return pytest.mark.parametrize(("slow", "ranks", "backend", "names"), rows)


def differences(slow, ranks, backend, names):
    """The differences of some processes from one, of each case."""
    return [solved(slow)[len(ranks), backend, name] for name in names]


@rows_of("any")
def test_several_processes_find_what_one_finds(slow, ranks, backend, names):
    for one in differences(slow, ranks, backend, names):
        assert one["sets"], one
        assert all(one[key] <= bound for key, bound in BOUNDS.items()), one


@rows_of("motion")
def test_several_processes_find_the_motion_that_one_finds(slow, ranks, backend, names):
    for one in differences(slow, ranks, backend, names):
        assert one["sets"] and one["told"] and (one["closed"] or one["name"] == moving_cases.APART), one
        assert all(one[key] <= bound for key, bound in BOUNDS.items()), one
        assert all(one[key] <= BOUNDS["u"] for key in MOVING), one


@rows_of("friction")
def test_several_processes_find_the_friction_that_one_finds(slow, ranks, backend, names):
    """Sets that stick and that slide, of which there are both, are the same, and so are tractions, slips and work."""
    for one in differences(slow, ranks, backend, names):
        assert one["sets"] and one["closed"] and one["sliding"], one
        assert all(one[key] <= bound for key, bound in BOUNDS.items()), one
        assert all(one[key] <= OF_SLIPS for key in RUBBING), one


@rows_of("flow")
def test_several_processes_find_the_flow_that_one_finds(slow, ranks, backend, names):
    """Each process keeps the flow of its own cells; strains, stresses and dissipation are those of one process."""
    for one in differences(slow, ranks, backend, names):
        assert one["sets"] and one["closed"], one
        assert all(one[key] <= bound for key, bound in BOUNDS.items()), one
        assert one["flow"] <= BOUNDS["u"], one


@rows_of("soft")
def test_several_processes_find_the_contact_that_one_finds(slow, ranks, backend, names):
    """Slave nodes are moved alike by all processes."""
    for one in differences(slow, ranks, backend, names):
        assert one["sets"] and one["closed"], one
        assert all(one[key] <= bound for key, bound in BOUNDS.items()), one


@rows_of("joined")
def test_several_processes_join_nodes_as_one_does(slow, ranks, backend, names):
    """Equations, couplings, sections of bolts and sides of sectors have nodes of several processes before they move."""
    for one in differences(slow, ranks, backend, names):
        assert one["sets"] and one["closed"] + one["sliding"], one
        assert all(one[key] <= bound for key, bound in BOUNDS.items()), one
        joints = [one[key] for key in ("pretension", "couplings", "equations") if key in one]
        assert joints and max(joints) <= BOUNDS["u"], one
