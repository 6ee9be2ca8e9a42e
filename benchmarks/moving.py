"""Measure contact that is paired again in every iteration beside contact that is paired once, in one run.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.moving [--quick] [-o TABLE.md]

Two blocks of HEXA8, cut, with a clearance of 0.1 r^2, the upper one lowered by a twentieth: `geometry = "reference"`
and `"current"` with small strains, and finite strains (neo-Hookean), with facet and with smoothed normals. One thread;
seconds of the processor. The derivative of contact is measured against pairing and integration of the same points.
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from statistics import median
from unittest.mock import patch

import numpy as np

import lacsolver.contact.tangent as contact_tangent
from benchmarks.common import HEADS, Clock, blocks, growth, main, peak
from lacsolver.case import Case, Contact, Displacement, Material, Solver
from lacsolver.contact.tangent import gap_derivative, motion_of, tangent
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.pair import ContactPair
from lacsolver.problem.problem import Problem
from lacsolver.saddle.stiffness import Stiffness

_ROUND = "0.1*((x-0.5)**2+(y-0.5)**2)"
KINDS = {"reference": ("small", "reference"), "current": ("small", "current"), "finite": ("finite", "current")}
#: functions of `contact_tangent` that compute the derivative of contact
DERIVATIVES = ("motion_of", "tangent", "gap_derivative")


def case_of(kind: str, normals: str = "facet", backend: str = "auto", path: Path = Path("blocks.msh")) -> Case:
    """The case of the blocks, on one thread; `path`: the mesh."""
    kinematics, geometry = KINDS[kind]
    small = kinematics == "small"
    contact = {"slave": "slave", "master": "master", "clearance": _ROUND, "normals": normals}
    return Case(
        mesh=path,
        model="3d",
        kinematics=kinematics,
        material=(Material(law="elastic" if small else "neo_hookean", young=1000.0, poisson=0.3),),
        contact=(Contact(**contact, **({"geometry": geometry} if small else {})),),
        displacement=(
            Displacement(group="bottom", ux=0.0, uy=0.0, uz=0.0),
            Displacement(group="top", ux=0.0, uy=0.0, uz=-0.05),
        ),
        solver=Solver(backend=backend, threads=1),
    )


def solved(problem: Problem) -> tuple[float, int, Clock]:
    """The seconds of a solve, its iterations, and the clock of its stages."""
    clock = Clock()
    places = [(contact_tangent, name, "derivative") for name in DERIVATIVES]
    places += [(ContactPair, "integrate", "pairing"), (Stiffness, "solve", "solutions")]
    with ExitStack() as stack:
        for module, name, phase in places:
            stack.enter_context(patch.object(module, name, clock.around(phase, getattr(module, name))))
        with clock("all"):
            *_, state = march(problem)
    return clock.cpu["all"], state.iterations, clock


def derived(problem: Problem, face):
    """The derivatives of forces and gaps, the forces first, as in an iteration."""
    motion = motion_of(face, face.slave, face.master, problem.joints[0].pairing, problem.space.dim)
    return tangent(motion, np.ones(len(face.w))), gap_derivative(motion)


def stages(problem: Problem, repeats: int) -> tuple[float, float, int]:
    """The seconds of pairing and integration, of their derivative, and the number of points."""
    u, faces = 1e-3 * np.random.default_rng(0).normal(size=problem.space.n_dof), []
    taken = []
    for _ in range(repeats + 1):
        clock = Clock()
        with clock("pairing"):
            faces.append(problem.joints[0].integrate(problem.space, u, 1.0))
        with clock("derivative"):
            derived(problem, faces[-1])
        taken.append(list(clock.cpu.values()))
    first, second = np.median(taken[1:], axis=0)
    return first, second, len(faces[0].points)


def growing(sizes: list[int], normals: str):
    """A row: seconds of the derivative, and its memory over that of the points, as they grow in number."""
    counts, taken = [], []
    for n in sizes:
        problem = Problem.of(case_of("current", normals), blocks(n, n + 1, 1))
        face = problem.joints[0].integrate(problem.space, np.zeros(problem.space.n_dof), 1.0)
        points = sum(a.nbytes for a in vars(face.points).values() if isinstance(a, np.ndarray))
        counts.append(len(face.points))
        taken.append(stages(problem, 1)[1])
        most, made = peak(lambda p=problem, f=face: derived(p, f))
    values = sum(A.data.nbytes + A.indices.nbytes for A in made)
    what, listed, slope = growth(f"derivative with the points, {normals}", counts, taken)
    return what, listed, f"{slope}; peak memory {most / points:.1f} of the points', the result {values / points:.1f}"


def rows(quick):
    small, large = ((6, 5, 4), (10, 9, 8)) if quick else ((12, 11, 12), (25, 24, 16))
    mesh, both = blocks(*small), ("facet", "smoothed")
    for normals in both:
        pairing, derivative, count = stages(Problem.of(case_of("current", normals), mesh), 5)
        against = f"pairing and integration {pairing:.3f} s: ratio {derivative / pairing:.2f}"
        yield f"derivative of contact, {normals}, {count:,} points", f"{derivative:.3f} s", against
    for kind in ("current", "finite"):
        problems, took = {normals: Problem.of(case_of(kind, normals), mesh) for normals in both}, {n: [] for n in both}
        for k in range(4):  # in turn; kernels are loaded in the first
            for normals, problem in problems.items():
                took[normals].append(solved(problem)) if k else solved(problem)
        for normals, runs in took.items():
            seconds, iterations, clock = runs[0]
            share, solutions = clock.cpu["derivative"] / seconds, clock.calls["solutions"] / iterations
            against = f"derivative {100 * share:.0f} %; {solutions:.1f} solutions with K an iteration"
            what = f"{kind}, {normals}, {problems[normals].constraints.n_q:,} unknowns"
            yield what, f"{median(run[0] for run in runs):.2f} s, {iterations} iterations", against
        whole = median(b[0] / a[0] for a, b in zip(*took.values(), strict=True))
        yield f"{kind}, smoothed over facet, whole solve", f"{whole:.2f}", ""
    mesh, each = blocks(*large), {}
    for kind in KINDS:
        problem = Problem.of(case_of(kind), mesh)
        seconds, iterations, _ = solved(problem)
        each[kind] = seconds / iterations
        n = f"{problem.constraints.n_q:,} unknowns, {problem.joints[0].zone.n_macros} macro-elements"
        against = f"{each[kind] / each['reference']:.2f} of reference for each iteration"
        yield f"{kind}, facet, {n}", f"{seconds:.1f} s, {iterations} iterations", against
    yield growing([4, 12, 38] if quick else [4, 12, 38, 98], "facet")
    yield growing([4, 12, 20] if quick else [4, 12, 45], "smoothed")


if __name__ == "__main__":
    main(__doc__, lambda asked: [(HEADS, rows(asked.quick))])
