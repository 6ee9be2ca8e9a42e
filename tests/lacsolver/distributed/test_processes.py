"""Several processes find what one finds, of every problem of the corpus and of `cases`; and what their shares tell."""

import json
import math
import time
from dataclasses import MISSING

import numpy as np
import pytest
from scipy.sparse import csr_array

from lacsolver.case import Solver, read_case
from lacsolver.distributed.launch import import_petsc
from lacsolver.distributed.processes import Processes
from lacsolver.doubts.motion import inertia
from lacsolver.doubts.run import Run
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.stepping import march
from lacsolver.linear.petsc import petsc_matrix, set_up
from lacsolver.output.tables import history_row
from lacsolver.problem.problem import Problem
from lacsolver.problem.skin import prepared
from lacsolver.results.figures import step_figures
from lacsolver.saddle.shared_stiffness import SharedFactors
from tests.lacsolver.distributed.cases import CASES, JOINED
from tests.lacsolver.distributed.mpi import ROOT, printed
from tests.problems import PROBLEMS
from tests.samples import each_option
from verification.families.distributed import FAMILY, problems
from verification.families.distributed import run as run_family

pytestmark = pytest.mark.petsc
#: but one that finds no equilibrium, and those whose springs between nodes, or whole rings, are of one process only
CORPUS = [name for name in PROBLEMS if not name.startswith(("given up", "linked", "sector"))]
OWN = [*CASES]


def options_of(row):
    """The records of a problem, and its keys that are no default, with their words."""
    problem = PROBLEMS[row[0]]
    for record in problem.records:
        yield record.SECTION.name
        for key, default in record.DEFAULTS.items():
            value = getattr(record, key)
            if default is not MISSING and value != default:
                yield record.SECTION.name, key, value if isinstance(value, str) else ""
    yield from problem.keys.items()


#: problems of the corpus that together have every record and option, and the others
SOME = [row.values[0] for row in each_option([(name,) for name in CORPUS], options_of) if not row.marks]
OTHERS = [name for name in CORPUS if name not in SOME]
#: the ranks, of four processes that are started once, the backend, and the cases; rows that share no rank are solved
#: side by side
QUICK = [
    ([0, 1], "mumps", SOME[::2]),
    ([2, 3], "mumps", SOME[1::2]),
    ([0, 1], "mumps", OWN[::4]),
    ([2, 3], "mumps", OWN[2::4]),
    ([0, 1, 2], "multigrid", OWN[:2] + [*JOINED][:2]),
    ([3], "multigrid", OWN[:1]),
    ([0, 1], "gamg", OWN[:1]),
    ([0, 1, 2, 3], "hypre", OWN[:1]),
]
SLOW = [
    ([0, 1], "mumps", OTHERS[::2]),
    ([2, 3], "mumps", OTHERS[1::2]),
    ([0, 1], "multigrid", CORPUS[::2] + OWN[1::4]),
    ([2, 3], "multigrid", CORPUS[1::2] + OWN[3::4]),
    ([0, 1, 2], "multigrid", OWN[2:]),
    ([0, 1, 2, 3], "mumps", OWN),
]
ROWS = [pytest.param(False, *row, id=f"{row[1]}-{len(row[0])}") for row in QUICK]
ROWS += [pytest.param(True, *row, id=f"{row[1]}-{len(row[0])}-slow", marks=pytest.mark.slow) for row in SLOW]
#: bounds of relative differences from one process: the tolerance is of displacements, beside which slips are small
BOUND = 1e-9
BOUNDS = {"p": 5e-9} | dict.fromkeys(("shear", "slip", "path", "dissipation", "resultant", "work"), 2e-7)
CLOSED, SLIDES = 1, 2


def lines_of(slow):
    """What the program tells of each row, and of shares, by their keys."""
    return {tuple(key): line for key, line in printed(4, "test_processes", json.dumps(slow), timeout=900)}


@pytest.fixture(scope="module")
def told():
    """The lines of quick rows."""
    return lines_of(False)


@pytest.fixture(scope="module")
def told_of_slow():
    """The lines of slow rows."""
    return lines_of(True)


@pytest.mark.parametrize(("slow", "ranks", "backend", "names"), ROWS)
def test_several_processes_find_what_one_finds(request, slow, ranks, backend, names):
    """Sets of contact, displacements, pressures, motions, friction, flow, and all that the history has."""
    lines = request.getfixturevalue("told_of_slow" if slow else "told")
    for name in names:
        one = lines[len(ranks), backend, name]
        assert one["sets"] and one["doubts"], name
        far = {key: value for key, value in one["far"].items() if value > BOUNDS.get(key, BOUND)}
        assert not far and {"u", "strain"} <= set(one["far"]), (name, far)
        if name.startswith(("rubbed in", "held by")):
            assert {CLOSED, SLIDES} <= set(one["seen"])
        elif name in CASES and name != "thrown away from a bar at rest":
            assert {CLOSED, SLIDES} & set(one["seen"]), name
        if name in JOINED:
            assert {"pretension", "coupling", "equation"} & set(one["far"])


def test_the_largest_value_of_all_processes_keeps_nan(told):
    for one in told["shares",]:
        assert one["largest"] == 1.0 and one["least"] == -1.0
        assert one["nan"] and one["infinite"]


def test_the_cycle_with_rows_of_contact_reduces_errors_as_that_without(told):
    one, other = told["shares",]
    assert one["cycles"] == other["cycles"]
    for left, unsymmetric in one["cycles"]:
        assert left < 0.2 and unsymmetric < 1e-5


def test_a_backend_is_taken_after_another_in_the_same_process(told):
    assert [one["kinds"] for one in told["shares",]] == [["gamg", "hypre", "lu", "gamg"]] * 2


@pytest.mark.slow
def test_a_process_may_have_no_cell():
    """The last process has nodes of the rigid plate alone, which is longer than the block over it."""
    (case,) = (case for case in FAMILY.cases if case.name == "block_QUAD4_facet")
    problem, title, _ = case.solve.args
    assert len(list(problems(problem))) == 1
    outcome = run_family(problem, title, ((4, ("mumps",)),), levels=1)
    assert all(result.passed for result in outcome.results), outcome.results


# ---- the program


def main(world, slow):
    """Solve each case in one process, the cases shared out; then compare what is found by the ranks of each row."""
    import_petsc()
    slow = json.loads(slow)
    rows = SLOW if slow else QUICK
    every = list(dict.fromkeys(name for _, _, names in rows for name in names))
    own = {name: solved(name) for name in every[world.rank :: world.size]}
    wait(world)
    alone = {name: states for part in world.allgather(own) for name, states in part.items()}
    groups = {tuple(ranks): None for ranks, _, _ in rows if world.rank in ranks}
    groups = {ranks: world.Create_group(world.group.Incl(ranks)) for ranks in groups}
    for ranks, backend, names in rows:
        comm = groups.get(tuple(ranks))
        if comm is not None:
            wait(comm)
            for name in names:
                tell(comm, (comm.size, backend, name), compared(name, backend, comm, alone[name]))
    wait(world)
    if not slow:
        pair = world.Split(world.rank // 2)
        if world.rank < 2:
            tell(pair, ("shares",), pair.gather(shares(pair)))


def tell(comm, key, line):
    """Print a line with its key."""
    if comm.rank == 0:
        print(json.dumps([key, line]), flush=True)


def wait(comm):
    """Wait for the other processes, and leave the processor to them."""
    request = comm.Ibarrier()
    while not request.Test():
        time.sleep(0.02)


def problem_of(name, backend=None, comm=None):
    """The problem of a case, alone or shared by processes."""
    source = (CASES | PROBLEMS)[name]
    solver = next((one for one in source.records if isinstance(one, Solver)), Solver())
    keys = {key: getattr(solver, key) for key in ("tangent", "max_iterations")}  # the tolerance is always small
    rest = [one for one in source.records if one is not solver]
    case = source.case([*rest, Solver(threads=1, **keys, **({"backend": backend} if backend else {}))])
    return Problem.of(case, case.mesh) if comm is None else Problem.of(case, case.mesh, Processes(comm))


def row_of(problem, state):
    """The row of a state in the history, and its strain energy."""
    figures = step_figures(problem, state)
    return history_row(figures) | {"strain": figures.energy}


def solved(name):
    """The states of a case in one process, their rows in the history, the stiffness, and the doubts about a motion."""
    problem = problem_of(name)
    states = list(march(problem))
    rows = [row_of(problem, state) for state in states]
    stiffness = abs(problem.kinematics.tangent(states[0].u, states[0].time)).max()
    return states, rows, stiffness, [*inertia(Run(problem, problem.joints))]


def compared(name, backend, comm, alone):
    """Worst relative differences from one process; those of u and p are relative to their step, others to all steps."""
    problem, far, sizes, sets, seen = problem_of(name, backend, comm), {}, {}, True, set()
    n, space = problem.space.n_dof, problem.space

    def add(key, value, expected, least=0.0):
        far[key] = max(far.get(key, 0.0), float(np.abs(np.subtract(value, expected)).max(initial=0.0)))
        sizes[key] = max(sizes.get(key, 0.0), float(np.abs(expected).max(initial=0.0)), least)

    for k, (one, other, expected) in enumerate(zip(march(problem), *alone[:2], strict=True)):
        force = alone[2] * np.abs(other.u).max()  # beside which reactions are noise where nothing pushes
        sizes_of = {"reaction": force, "contact": force, "strain": force * np.abs(other.u).max()}
        add(f"u at {k}", whole(space, one.u), other.u)
        add("reactions", whole(space, one.reaction), other.reaction, force)
        for zone, alike in zip(one.zones, other.zones, strict=True):
            sets &= bool((zone.status == alike.status).all())
            seen |= set(zone.status.tolist())
            add(f"p at {k}", zone.pressure, alike.pressure)
            for key in ("shear", "slip", "path", "dissipation", "resultant") if alike.friction is not None else ():
                add(key, getattr(zone.friction, key), getattr(alike.friction, key))
        row = row_of(problem, one)
        assert list(row) == list(expected)
        for key in set(row) - {"iterations"}:
            kind = key.split(".")[0]
            add(kind, *np.nan_to_num([row[key], expected[key]]), sizes_of.get(kind, 0.0))
        if other.step.motion is not None:
            speed = np.abs(other.step.motion.velocity).max()
            for key, least in (("velocity", 0.0), ("acceleration", speed / other.time)):
                mine, theirs = (getattr(state.step.motion, key) for state in (one, other))
                add(key, whole(space, mine[:n]), theirs[: len(theirs) - len(mine) + n], least)
            for key in ("energies", "impulse", "linear", "angular"):
                add(key, getattr(one.step.motion, key), getattr(other.step.motion, key))
    parts = {key: value / sizes[key] if value else 0.0 for key, value in far.items()}
    worst = {}
    for key, value in parts.items():
        worst[key.split(" at ")[0]] = max(worst.get(key.split(" at ")[0], 0.0), value)
    told = [*inertia(Run(problem, problem.joints))] == alone[3]
    return {"far": worst, "sets": sets, "doubts": told, "seen": sorted(seen)}


def whole(space, values):
    """Values (n_dof,) at all nodes of the model, from those that each process owns."""
    order = np.argsort(space.share.gather(space.share.node[space.share.own]))
    return space.share.gather(space.own(values))[order].ravel()


# ---- shares


def shares(comm):
    """Largest values of all processes, the quality of cycles, the name of each preconditioner, one after another."""
    case = read_case(ROOT / "data" / "two_blocks.toml")
    problem = Problem.of(case, prepared(case), Processes(comm))
    space, share, petsc = problem.space, problem.space.share, import_petsc()
    own = space.dofs(np.flatnonzero(share.own)).ravel()
    one = csr_array((np.ones(len(own)), (np.arange(len(own)), own)), shape=(len(own), space.n_dof))
    A = petsc_matrix(petsc, share.mpi, one, space.dofs(share.number).ravel(), space.dim)
    modes = np.tile(np.eye(space.dim), (len(own) // space.dim, 1))
    return {
        "largest": share.largest(float(share.rank)),
        "least": share.largest(-1.0 - share.rank),
        "nan": math.isnan(share.largest(math.nan if share.rank else 1.0)),
        "infinite": share.largest(math.inf if share.rank else 1.0) == math.inf,
        "cycles": cycles(problem),
        "kinds": [set_up(petsc, A, modes, kind).getType() for kind in ("gamg", "hypre", "mumps", "gamg")],
    }


def cycles(problem):
    """The energy of an error after a V-cycle, without and with rows of contact, and how far from symmetry each is."""
    model, constraints = ReducedProblem(problem), problem.constraints
    K = SharedFactors(np.zeros((constraints.n_q, 0)), "multigrid", constraints, model.vectors).factorise(model.K_q)
    B = LoadStep(model, 1.0).contact(np.zeros(constraints.n_q)).rows.B
    weights = np.full(B.shape[0], float(K.scaling.max()) / float(abs(B).max()) ** 2)
    unknown = problem.space.dofs(problem.space.share.node).ravel()  # of the whole model
    x, y = (constraints.T.T @ np.sin(rate * unknown) for rate in (1.0, 2.0))

    def quality(A, cycle):
        def dot(a, b):
            return K.vectors.dots(a[None], b)[0]

        left = x - cycle(A(x))
        one, other = dot(y, cycle(x)), dot(x, cycle(y))
        return float(dot(left, A(left)) / dot(x, A(x))), float(abs(one - other) / abs(one))

    with_rows = K.cycle_with_rows(B, weights)
    return quality(K.apply, K.cycle), quality(lambda q: K.apply(q) + B.T @ (weights * (B @ q)), with_rows)
