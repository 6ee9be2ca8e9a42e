"""Several processes find what one finds: closed sets, displacements, pressures and reactions of cases of every kind."""

from __future__ import annotations

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
JOINED = [*joined_cases.CASES]
#: and of those of friction, with their bound: the tolerance is of displacements, beside which slips are small
RUBBING, OF_SLIPS = ("shear", "slip", "path", "dissipation", "resultant", "work"), 2e-7


@pytest.mark.parametrize(
    ("n", "backend", "names"),
    [
        (1, "multigrid", SOLID[:1]),
        (2, "mumps", PLANE),
        (2, "gamg", SOLID[:1]),
        (3, "multigrid", SOLID + RIGID),
        (4, "hypre", SOLID[:1]),
    ],
)
def test_several_processes_find_what_one_finds(n, backend, names):
    for one in compared(n, backend, names):
        assert one["sets"], one
        assert all(one[key] <= bound for key, bound in BOUNDS.items()), one


@pytest.mark.parametrize(
    ("n", "backend", "names"),
    [(2, "multigrid", MOVED[3:]), pytest.param(4, "mumps", MOVED[:3], marks=pytest.mark.slow)],
)
def test_several_processes_find_the_motion_that_one_finds(n, backend, names):
    for one in compared(n, backend, names):
        assert one["sets"] and one["closed"] and one["told"], one
        assert all(one[key] <= bound for key, bound in BOUNDS.items()), one
        assert all(one[key] <= BOUNDS["u"] for key in MOVING), one


@pytest.mark.parametrize(
    ("n", "backend", "names"),
    [
        (2, "mumps", RUBBED[:2]),
        (2, "multigrid", RUBBED[2:]),
        *(pytest.param(n, "mumps", RUBBED, marks=pytest.mark.slow) for n in (3, 4)),
    ],
)
def test_several_processes_find_the_friction_that_one_finds(n, backend, names):
    """Sets that stick and that slide, of which there are both, are the same, and so are tractions, slips and work."""
    for one in compared(n, backend, names):
        assert one["sets"] and one["closed"] and one["sliding"], one
        assert all(one[key] <= bound for key, bound in BOUNDS.items()), one
        assert all(one[key] <= OF_SLIPS for key in RUBBING), one


@pytest.mark.parametrize(
    ("n", "backend"), [(2, "mumps"), (2, "multigrid"), pytest.param(3, "multigrid", marks=pytest.mark.slow)]
)
def test_several_processes_find_the_flow_that_one_finds(n, backend):
    """Each process keeps the flow of its own cells; strains, stresses and dissipation are those of one process."""
    for one in compared(n, backend, [*plastic_cases.CASES]):
        assert one["sets"] and one["closed"], one
        assert all(one[key] <= bound for key, bound in BOUNDS.items()), one
        assert one["flow"] <= BOUNDS["u"], one


@pytest.mark.parametrize(("n", "backend"), [(2, "mumps"), (3, "multigrid")])
def test_several_processes_find_the_contact_that_one_finds(n, backend):
    """Slave nodes are moved alike by all processes."""
    for one in compared(n, backend, [*soft_cases.CASES]):
        assert one["sets"] and one["closed"], one
        assert all(one[key] <= bound for key, bound in BOUNDS.items()), one


@pytest.mark.parametrize(
    ("n", "backend", "names"),
    [
        (2, "mumps", JOINED[::2]),
        (3, "multigrid", JOINED[3:5]),
        pytest.param(2, "mumps", JOINED[1::2], marks=pytest.mark.slow),
        pytest.param(3, "multigrid", JOINED[5:], marks=pytest.mark.slow),
    ],
)
def test_several_processes_join_nodes_as_one_does(n, backend, names):
    """Equations, couplings, sections of bolts and sides of sectors have nodes of several processes before they move."""
    for one in compared(n, backend, names):
        assert one["sets"] and one["closed"] + one["sliding"], one
        assert all(one[key] <= bound for key, bound in BOUNDS.items()), one
        joints = [one[key] for key in ("pretension", "couplings", "equations") if key in one]
        assert joints and max(joints) <= BOUNDS["u"], one


def compared(n, backend, names):
    """The differences of n processes from one, of each case."""
    told = printed(n, "compare", backend, *names)
    assert [one["name"] for one in told] == names
    return told
