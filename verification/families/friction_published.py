"""**Published.** Problems on code_aster's own meshes: a plate pressed on a rigid plane and pushed from the side
(ssnv128), NAFEMS's roller (ssnp154a), punch with rounded edges (ssna122a) and loaded pin (ssnp156a), and ironing
(ssnp153a). They are left out where these meshes are not beside this tree; twins on meshes of our own always run.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from lacsolver.results.figures import step_figures
from verification.meshes.blocks import joined, nodes_of
from verification.meshes.published import mesh_of, there
from verification.records import Case, Outcome, Published, at_most, equal, informative
from verification.solving import Solved, balanced, case_text, entry, solve

Floats = NDArray[np.floating]
#: why figures differ on code_aster's mesh, and on a twin
_DIFFER = "two methods, one mesh", "two methods, meshes of like size"


def solve_plate(
    place: tuple[float, ...] = (0.0, 1.25e-3, 5e-3, 7.5e-3, 11.25e-3),
    aster: tuple[float, ...] = (2.84594e-5, 2.70792e-5, 2.27403e-5, 1.97271e-5, 1.53642e-5),
    greco: tuple[float, ...] = (2.86e-5, 2.72e-5, 2.28e-5, 1.98e-5, 1.50e-5),
    twin: bool = False,
    *,
    levels: int,
) -> Outcome:
    """ssnv128: places along the plane, and what code_aster has there with CONTINUE (m)."""
    text = case_text(
        "plane_strain",
        entry("material", young=1.3e11, poisson=0.2),
        entry("contact", slave="LCONTA", master="LBATI", friction=1.0),
        entry("displacement", group="SBATI", ux=0.0, uy=0.0),
        entry("displacement", group="LBLOCX", ux=0.0),
        entry("pressure", group="LPRESV", value=5e7),
        entry("pressure", group="LPRESH", value=15e7),
    )
    one = solve(text, mesh_of("ssnv128m", twin))
    mesh = one.mesh
    nodes = nodes_of(mesh, "LCONTA")
    order = nodes[np.argsort(mesh.points[nodes, 0])]
    along = np.interp(place, mesh.points[order, 0], one.u[order, 0])
    source = "code_aster, ssnv128, CONTINUE"
    return Outcome(
        (
            *(
                equal(f"u_x at {1e3 * x:g} mm", u, right, 0.005 * right, source=source, reason=_DIFFER[twin],
                      published=(Published("GRECO, mean of several codes", mean, "Feijoo, Barbosa, Zouain"),))
                for x, u, right, mean in zip(place, along, aster, greco, strict=True)
            ),
            at_most("iterations", one.iterations, 26, source="a prototype"),
            *balanced([one]),
        )
    )  # fmt: skip


def solve_roller(expected: tuple[float, float] = (-1.26898, -1.27031), twin: bool = False, *, levels: int) -> Outcome:
    """NAFEMS's roller, ssnp154a. `expected`: u_y of the point B, with and without friction: code_aster's. With friction
    and without, small strains in the deformed geometry.
    """
    results, solutions = [], []
    for friction, right in zip((0.1, 0.0), expected, strict=True):
        text = case_text(
            "plane_strain",
            entry("material", groups=["Cylinder"], young=210e3, poisson=0.3),
            entry("material", groups=["Block"], young=70e3, poisson=0.3),
            entry("contact", slave="Bottom_C", master="Top_B", friction=friction or None, geometry="current"),
            entry("displacement", group="Encast", ux=0.0, uy=0.0),
            entry("displacement", group="Axe", ux=0.0),
            entry("force", group="Force", fy=-17500.0),
            entry("steps", count=2),
        )
        one = solve(text, mesh_of("ssnp154a", twin))
        (b,) = one.mesh.node_groups["B"]
        solutions.append(one)
        published = Published("Abaqus, Marc, quadratic", -1.3026 if friction else -1.3069, "NAFEMS, FENET")
        results.append(equal(
            f"u_y of B, mu = {friction:g}", float(one.u[b, 1]), right, 0.005 * abs(right),
            source="code_aster, ssnp154a", reason=_DIFFER[twin], published=(published,),
        ))  # fmt: skip
    return Outcome((*results, *balanced(solutions)))


def solve_rounded(
    expected: tuple[float, float] = (-0.130734, -0.128580), twin: bool = False, *, levels: int
) -> Outcome:
    """NAFEMS's punch with rounded edges, ssna122a. `expected`: u_y of M with mu = 0 and 0.1: code_aster's. With
    friction and without; what friction takes off.
    """
    u, solutions = [], []
    for friction in (0.0, 0.1):
        text = case_text(
            "axisymmetric",
            entry("material", groups=["Poincon"], law="saint_venant_kirchhoff", young=210e3, poisson=0.3),
            entry("material", groups=["Massif"], law="saint_venant_kirchhoff", young=70e3, poisson=0.3),
            entry("contact", slave="P_cont", master="M_cont", friction=friction or None),
            entry("displacement", group="Encast", ux=0.0, uy=0.0),
            entry("displacement", group="Axe", ux=0.0),
            entry("pressure", group="Force", value=100.0),
            entry("steps", count=4),
            kinematics="finite",
        )
        one = solve(text, mesh_of("ssna122a", twin))
        (m,) = one.mesh.node_groups["M"]
        solutions.append(one)
        u.append(float(one.u[m, 1]))
    part, right = 1 - u[1] / u[0], 1 - expected[1] / expected[0]
    source = "code_aster, ssna122a"
    return Outcome(
        (
            equal("part of u_y that friction takes off", part, right, 0.001, source=source,
                  reason="1.61 % on a prototype"),
            *(
                informative(f"u_y of M, mu = {mu:g}", own, reason="its moduli are taken to be the roller's",
                            published=(Published("code_aster", theirs, source),))
                for mu, own, theirs in zip((0.0, 0.1), u, expected, strict=True)
            ),
            *balanced(solutions),
        )
    )  # fmt: skip


def solve_pin(
    computed: tuple[float, float, float] = (0.779275, 0.754844, 0.0927840),
    published: tuple[float, float, float] = (0.762576, 0.740573, 0.0918286),
    twin: bool = False,
    *,
    levels: int,
) -> Outcome:
    """NAFEMS's loaded pin, ssnp156a. `computed`: largest u_x of the pin's skin, and u_x and u_y of the hole's, without
    friction, by code_aster's Lagrangian contact (cont014a); `published`: what it compares them with, to 2 and 3 %.
    Without friction, and with friction in one step and in eight.
    """
    (_, free), one, many = (_pin(friction, steps, twin) for friction, steps in ((None, 1), (0.1, 1), (0.1, 8)))
    names = "largest u_x of the pin", "largest u_x of the hole", "largest u_y of the hole"
    rows = list(zip(names, free, computed, published, one[1], strict=True))
    apart = float(np.abs(many[1] / one[1] - 1).max())
    source, near = "code_aster, cont014a: ssnp156a without friction", 0.01 if twin else 0.002
    return Outcome(
        (
            *(
                equal(f"{name}, mu = 0", own, theirs, near * theirs, source=source, reason=_DIFFER[twin],
                      published=(Published("code_aster, CONTINUE", refe, "reference of cont014a"),))
                for name, own, theirs, refe, _ in rows
            ),
            *(informative(f"{name}, mu = 0.1", rubbed, reason="no figure is published") for name, *_, rubbed in rows),
            at_most("largest difference between one step and eight", apart, 1e-6, source="loaded in proportion"),
            *balanced([one[0], many[0]]),
        )
    )  # fmt: skip


def _pin(friction: float | None, steps: int, twin: bool) -> tuple[Solved, Floats]:
    """Solution, and the largest displacements (3,): along the load of the pin's skin and of the hole's, and across."""
    text = case_text(
        "plane_strain",
        entry("material", groups=["Pin"], young=210e3, poisson=0.3),
        entry("material", groups=["Sheet"], young=70e3, poisson=0.3),
        entry("contact", slave="Slave", master="Master", friction=friction, geometry="current"),
        entry("displacement", group="Encast", ux=0.0, uy=0.0),
        entry("displacement", group="Axe", uy=0.0),
        entry("force", group="F", fx=10e3),
        entry("steps", count=steps),
    )
    one = solve(text, mesh_of("ssnp156a", twin))
    skins = np.union1d(nodes_of(one.mesh, "Slave"), nodes_of(one.mesh, "Master"))
    pin, hole = (one.u[np.intersect1d(skins, nodes_of(one.mesh, body))] for body in ("Pin", "Sheet"))
    return one, np.array([pin[:, 0].max(), hole[:, 0].max(), hole[:, 1].max()])


#: code_aster's forces (F_x, F_y) on the die at two times; its law is not neo-Hookean, but has logarithmic strains
_IRONED = {0.5: (1.8359e7, 9.4539e7), 1.0: (6.9020e7, 3.2990e8)}


def solve_ironing(
    slaves: tuple[str, ...], steps: int, iterations: int | None = None, twin: bool = False, *, levels: int
) -> Outcome:
    """Shallow ironing, ssnp153a: a die goes down by 1 in 10 steps, then along by 10 in `steps`. Iron, with the die or
    the slab as the slave.

    `slaves`: groups that are the slave in turn. `iterations`: at most, of all steps.
    """
    every = [_ironed(slave, steps, twin) for slave in slaves]
    forces = np.array([[_force(one, time) for time in (*_IRONED, 2.0)] for one in every])
    most = max(one.iterations for one in every)
    count = "iterations of all steps, of the role that takes more"
    results = [
        at_most("cutbacks", sum(one.halvings for one in every), 0, source="a prototype had none in 110 steps"),
        informative(count, most, reason="no bound")
        if iterations is None
        else at_most(count, most, iterations, source="a prototype: 528 and 656"),
    ]
    if len(every) > 1:
        apart = np.abs(forces[0, -1] / forces[1, -1] - 1).max()
        results.append(at_most("forces at the end, difference of the roles", apart, 0.01, source="either body a slave"))
    for k, (time, right) in enumerate(_IRONED.items()):
        results += [
            informative(f"|F_{axis}| at the time {time}", forces[0, k, a], reason="its law is another",
                        published=(Published("code_aster", right[a], "ssnp153a"),))
            for a, axis in enumerate("xy")
        ]  # fmt: skip
    return Outcome((*results, *balanced(every)))


def _ironed(slave: str, steps: int, twin: bool) -> Solved:
    down_and_along = {"ux": [[0.0, 0.0], [1.0, 0.0], [2.0, 10.0]], "uy": [[0.0, 0.0], [1.0, -1.0], [2.0, -1.0]]}
    text = case_text(
        "plane_strain",
        entry("material", groups=["Soft"], law="neo_hookean", young=6.896e8, poisson=0.32),
        entry("material", groups=["Hard"], law="neo_hookean", young=68.96e8, poisson=0.32),
        entry("contact", slave=slave, master={"Master": "Slave", "Slave": "Master"}[slave], friction=0.3),
        entry("displacement", group="Bloq", ux=0.0, uy=0.0),
        entry("displacement", group="Depl", **down_and_along),
        entry("steps", times=[*(0.1 * (k + 1) for k in range(10)), *(1 + (k + 1) / steps for k in range(steps))]),
        kinematics="finite",
    )
    return solve(text, joined([(mesh_of("ssnp153a", twin), {})], keep=True))


def _force(one: Solved, time: float) -> Floats:
    """Size of the components of the force between die and slab (2,) at the end of the step at a time."""
    state = min(one.states, key=lambda state: abs(state.time - time))
    (zone,) = step_figures(one.problem, state).contact.values()
    return np.abs(np.asarray(zone.resultant))


def cases(family: str) -> Iterator[Case]:
    """Plate, roller, punch, pin, ironing; each with a twin."""
    both = ("Master", "Slave")
    known = (
        ("ssnv128", "ssnv128m", "a plate on a rigid plane", partial(solve_plate), "quick", 3.0),
        ("ssnp154a", "ssnp154a", "NAFEMS's roller", partial(solve_roller), "quick", 5.0),
        ("ssna122a", "ssna122a", "NAFEMS's punch with rounded edges", partial(solve_rounded), "full", 5.0),
        ("ssnp156a", "ssnp156a", "NAFEMS's loaded pin", partial(solve_pin), "quick", 5.0),
    )
    ironing = (
        ("ironing-110", "ironing in 110 steps, both roles", partial(solve_ironing, both, 100, 600), 600.0, 60.0),
        ("ironing-60", "ironing in 60 steps, the die is the slave", partial(solve_ironing, both[:1], 50), 200.0, 15.0),
    )
    own = "a mesh of our own of the same bodies"
    for name, mesh, description, solved, suite, seconds in known:
        if there(mesh):
            yield Case(family, name, f"{description}, code_aster's mesh", solved, {suite: 1}, seconds)
        yield Case(family, f"{name}-twin", f"{description}, {own}", partial(solved, twin=True), {suite: 1}, seconds)
    for name, description, solved, seconds, of_twin in ironing:
        if there("ssnp153a"):
            yield Case(family, name, f"{description}, code_aster's mesh", solved, {"all": 1}, seconds)
        yield Case(family, f"{name}-twin", f"{description}, {own}", partial(solved, twin=True), {"full": 1}, of_twin)
