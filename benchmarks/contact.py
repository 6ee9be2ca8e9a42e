"""Measure contact solves against elastic solves of the same mesh with the same backend, and against CalculiX.

    python -m benchmarks.contact [--quick] [-o TABLE.md]

Two blocks, non-matching, pressed together with a clearance of r^2 / 2R, `geometry = "reference"`. An elastic solve is
one analysis, one factorisation and one solution of K; a contact solve is everything from K to the pressures: pairing,
integration, factorisation, and all steps of the active set. Both are timed in turn, medians of three. Then the contact
matrices alone (search, intersection, B) of 1e5 against 1e5 faces, and how they grow. Last a deck like CalculiX's test
`contact2` (a die pressed into a block and slid over it), by `lacsolver run` and by ccx, start-up included.
"""

from __future__ import annotations

import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

import numpy as np

from benchmarks.common import HEADS, Clock, blocks, exponent, main, seconds
from lacmesh import Surface
from lacsolver.case import Case, Contact, Displacement, Material, Solver
from lacsolver.contact import Zone, integrate
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem


def pressed(mesh, backend: str, ratio: float = 1.0) -> Problem:
    """The problem of `pressed_case` on a mesh of two blocks."""
    return Problem.of(pressed_case(backend, ratio), mesh)


def pressed_case(backend: str, ratio: float = 1.0, path: Path = Path("blocks.msh"), threads: int = 0) -> Case:
    """The upper block pushed into the lower one by a hundredth of its height.

    `ratio`: stiffness of the upper block, which has the master, relative to that of the lower one; `path`: the mesh.
    """
    bodies = {"lower": 1000.0, "upper": 1000.0 * ratio}
    return Case(
        mesh=path,
        model="3d",
        material=tuple(Material(groups=(name,), young=young, poisson=0.3) for name, young in bodies.items()),
        contact=(Contact(slave="slave", master="master", clearance="0.03*((x-0.5)**2+(y-0.5)**2)"),),
        displacement=(
            Displacement(group="bottom", ux=0.0, uy=0.0, uz=0.0),
            Displacement(group="top", ux=0.0, uy=0.0, uz=-0.01),
        ),
        solver=Solver(backend=backend, **({"threads": threads} if threads else {})),
    )


def solved(problem: Problem):
    """The clock of an elastic solve and of a contact solve, and the last state.

    The elastic solve is one factorisation and solution of K, by the backend of the contact solve (with multigrid: the
    set-up of a hierarchy).
    """
    clock, model = Clock(), ReducedProblem(problem)
    b = np.random.default_rng(0).normal(size=problem.constraints.n_q)
    _ = model.K  # is assembled
    with clock("elastic"):
        model.reference().solve(b)
    with clock("contact"):
        *_, state = march(problem)
    return clock, state


def compared(name: str, mesh):
    problem = pressed(mesh, "auto")
    _ = ReducedProblem(problem).K  # kernels are compiled
    runs = [solved(problem) for _ in range(3)]
    e, c = (median(clock.wall[phase] for clock, _ in runs) for phase in ("elastic", "contact"))
    own = median(clock.cpu["contact"] / clock.cpu["elastic"] for clock, _ in runs)
    state = runs[0][1]
    what = f"{name}, {problem.constraints.n_q:,} unknowns, {problem.joints[0].zone.n_macros:,} macro-elements"
    found = f"{c:.1f} s, {state.iterations} iterations, {int((state.zones[0].status == 1).sum())} in contact"
    return what, found, f"{c / e:.2f} elastic solves of {e:.1f} s ({own:.2f} by processor time)"


def cut(mesh) -> Zone:
    """The contact of a mesh that is cut."""
    return Zone.of(mesh, "slave", "master")


def whole(mesh) -> Zone:
    """The contact of a mesh that is not cut, each slave face a macro-element."""
    slave, master = (Surface.of(mesh, mesh.cell_groups[name]) for name in ("slave", "master"))
    faces = np.arange(len(slave))
    return Zone("slave", slave, master, faces, faces)


SIDES = {
    "triangles (HEXA8 cut pyramid against TETRA4)": lambda k: cut(blocks(k, round(1.4 * k), 1, "HEXA8", "TETRA4")),
    "parallelograms (QUAD4)": lambda k: whole(blocks(2 * k, 2 * k + 3, 1, hexa=None)),
    "biquadratic parallelograms (HEXA27)": lambda k: cut(blocks(2 * k, 2 * k + 3, 1, "HEXA27")),
    "trapezoids (HEXA8 cut hexa against QUAD4)": lambda k: cut(blocks(round(0.9 * k), 2 * k, 1, hexa="hexa")),
}


def matrices(name: str, faces: int):
    """The row of the contact matrices on skins of a kind."""
    sizes, taken = [], []
    for k in (faces // 4, faces // 2, faces):
        zone, made = SIDES[name](k), []
        sizes.append(len(zone.slave))
        work = lambda z=zone, m=made: m.append(integrate(z, 3))  # noqa: E731
        taken.append(median(seconds(work) for _ in "123"))
    what = f"contact matrices, {len(zone.slave):,} against {len(zone.master):,} {name}"
    grown = f"exponent {exponent(sizes[1:], taken[1:]):.2f}"
    return what, f"{taken[-1]:.2f} s", f"{len(made[-1].points):,} points, {made[-1].B.nnz:,} entries, {grown}"


def die():
    """The row of the deck like `contact2`: processor seconds of both programs, medians of three runs in turn."""
    name = "a deck like CalculiX's contact2, 1,572 unknowns, eight steps"
    if shutil.which("ccx") is None:
        return name, "", "absent: ccx is not installed (Debian: calculix-ccx)"
    from tests.lacsolver.deck_texts import die_on_block

    def spent(words, folder):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(words, cwd=folder, check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    lacsolver = [sys.executable, "-m", "lacsolver"]
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "die.inp").write_text(die_on_block())
        subprocess.run([*lacsolver, "import", "die.inp"], cwd=folder, check=True, capture_output=True)
        run = [*lacsolver, "run", "die.toml", "-o", "out", "--force", "--quiet"]
        spent(run, folder)
        both = [(spent(run, folder), spent(["ccx", "-i", "die"], folder)) for _ in range(3)]
    ours, theirs = np.median(both, axis=0)
    return name, f"{ours:.2f} s", f"ccx {theirs:.2f} s: ratio {median(a / b for a, b in both):.2f}"


def rows(quick):
    n, n10, faces = (10, 6, 20) if quick else (30, 15, 160)
    solved(pressed(blocks(4, 3, 2), "auto"))  # kernels are compiled, or loaded
    yield compared("HEXA8", blocks(n, n - 3, n // 2))
    yield compared("HEXA8 cut hexa", blocks(n, n - 3, n // 2, hexa="hexa"))
    yield compared("TETRA10", blocks(n10, n10 - 3, n10 // 2, "TETRA10"))
    for name in SIDES:
        yield matrices(name, faces)
    yield die()


if __name__ == "__main__":
    main(__doc__, lambda asked: [(HEADS, rows(asked.quick))])
