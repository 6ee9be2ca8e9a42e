"""**Published.** Problems on code_aster's own meshes: a plate pressed on a rigid plane and pushed from the side
(ssnv128), NAFEMS's roller (ssnp154a), punch with rounded edges (ssna122a) and loaded pin (ssnp156a), and ironing
(ssnp153a). They are left out where these meshes are not beside this tree; twins on meshes of our own always run.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from verification.meshes.blocks import joined, nodes_of
from verification.meshes.published import mesh_of, there
from verification.records import Case, Published, Result, at_most, equal, problem, row
from verification.solving import Solved, balanced, case_text, contact, entry, fixed, material, solve, times

Floats = NDArray[np.floating]
#: why figures differ on code_aster's mesh, and on a twin
_DIFFER = "two methods, one mesh", "two methods, meshes of like size"

#: ssnv128: place along the plane (mm), u_x there by code_aster's CONTINUE, and by GRECO
_PLATE = (
    (0.0, 2.84594e-5, 2.86e-5),
    (1.25, 2.70792e-5, 2.72e-5),
    (5.0, 2.27403e-5, 2.28e-5),
    (7.5, 1.97271e-5, 1.98e-5),
    (11.25, 1.53642e-5, 1.50e-5),
)


@problem
def solve_plate(twin: bool = False) -> Iterator[Result]:
    """ssnv128: displacement along the plane."""
    text = case_text(
        "plane_strain", material(1.3e11, 0.2), contact("LCONTA", "LBATI", friction=1.0), fixed("SBATI", "xy"),
        fixed("LBLOCX", "x"), entry("pressure", group="LPRESV", value=5e7),
        entry("pressure", group="LPRESH", value=15e7),
    )  # fmt: skip
    one = solve(text, mesh_of("ssnv128m", twin))
    nodes = nodes_of(one.mesh, "LCONTA")
    order = nodes[np.argsort(one.mesh.points[nodes, 0])]
    for x, right, mean in _PLATE:
        greco = Published("GRECO, mean of several codes", mean, "Feijoo, Barbosa, Zouain")
        u = float(np.interp(1e-3 * x, one.mesh.points[order, 0], one.u[order, 0]))
        yield equal(f"u_x at {x:g} mm", u, right, 0.005 * right, source="code_aster, ssnv128, CONTINUE",
                    reason=_DIFFER[twin], published=(greco,))  # fmt: skip
    yield at_most("iterations", one.iterations, 26, source="a prototype")
    yield from balanced([one])


@problem
def solve_roller(twin: bool = False) -> Iterator[Result]:
    """NAFEMS's roller, ssnp154a: u_y of the point B, with friction and without.

    Small strains in the deformed geometry.
    """
    solutions = []
    for friction, right, mean in ((0.1, -1.26898, -1.3026), (0.0, -1.27031, -1.3069)):
        text = case_text(
            "plane_strain", material(210e3, 0.3, groups=["Cylinder"]), material(70e3, 0.3, groups=["Block"]),
            contact("Bottom_C", "Top_B", friction=friction or None, geometry="current"), fixed("Encast", "xy"),
            fixed("Axe", "x"), entry("force", group="Force", fy=-17500.0), entry("steps", count=2),
        )  # fmt: skip
        one = solve(text, mesh_of("ssnp154a", twin))
        (b,) = one.mesh.node_groups["B"]
        solutions.append(one)
        yield equal(f"u_y of B, mu = {friction:g}", one.u[b, 1], right, 0.005 * abs(right),
                    source="code_aster, ssnp154a", reason=_DIFFER[twin],
                    published=(Published("Abaqus, Marc, quadratic", mean, "NAFEMS, FENET"),))  # fmt: skip
    yield from balanced(solutions)


@problem
def solve_rounded(twin: bool = False) -> Iterator[Result]:
    """NAFEMS's punch with rounded edges, ssna122a: u_y of M; its moduli are taken to be the roller's."""
    u, solutions, theirs = [], [], (-0.130734, -0.128580)  # code_aster's u_y of M without friction and with it
    for friction in (0.0, 0.1):
        text = case_text(
            "axisymmetric", material(210e3, 0.3, groups=["Poincon"], law="saint_venant_kirchhoff"),
            material(70e3, 0.3, groups=["Massif"], law="saint_venant_kirchhoff"),
            contact("P_cont", "M_cont", friction=friction or None), fixed("Encast", "xy"), fixed("Axe", "x"),
            entry("pressure", group="Force", value=100.0), entry("steps", count=4), kinematics="finite",
        )  # fmt: skip
        one = solve(text, mesh_of("ssna122a", twin))
        (m,) = one.mesh.node_groups["M"]
        solutions.append(one)
        u.append(float(one.u[m, 1]))
    part, right, reason = 1 - u[1] / u[0], 1 - theirs[1] / theirs[0], "1.61 % on a prototype"
    name = "part of u_y that friction takes off"
    yield equal(name, part, right, 0.001, source="code_aster, ssna122a", reason=reason)
    yield from balanced(solutions)


@problem
def solve_pin(twin: bool = False) -> Iterator[Result]:
    """NAFEMS's loaded pin, ssnp156a, without friction, and with friction in one step and in eight.

    Largest u_x of the pin's skin, and u_x and u_y of the hole's, without friction, by code_aster's Lagrangian contact
    (cont014a), and the values that it compares them with, to 2 and 3 %.
    """
    (_, free), one, many = (_pin(friction, steps, twin) for friction, steps in ((None, 1), (0.1, 1), (0.1, 8)))
    source, near = "code_aster, cont014a: ssnp156a without friction", 0.01 if twin else 0.002
    for name, own, theirs, other in (
        ("largest u_x of the pin", free[0], 0.779275, 0.762576),
        ("largest u_x of the hole", free[1], 0.754844, 0.740573),
        ("largest u_y of the hole", free[2], 0.0927840, 0.0918286),
    ):
        yield equal(f"{name}, mu = 0", own, theirs, near * theirs, source=source, reason=_DIFFER[twin],
                    published=(Published("code_aster, CONTINUE", other, "reference of cont014a"),))  # fmt: skip
    apart = float(np.abs(many[1] / one[1] - 1).max())
    yield at_most("largest difference between one step and eight", apart, 1e-6, source="loaded in proportion")
    yield from balanced([one[0], many[0]])


def _pin(friction: float | None, steps: int, twin: bool) -> tuple[Solved, Floats]:
    """Solution, and the largest displacements (3,): along the load of the pin's skin and of the hole's, and across."""
    text = case_text(
        "plane_strain", material(210e3, 0.3, groups=["Pin"]), material(70e3, 0.3, groups=["Sheet"]),
        contact("Slave", "Master", friction=friction, geometry="current"), fixed("Encast", "xy"), fixed("Axe", "y"),
        entry("force", group="F", fx=10e3), entry("steps", count=steps),
    )  # fmt: skip
    one = solve(text, mesh_of("ssnp156a", twin))
    skins = np.union1d(nodes_of(one.mesh, "Slave"), nodes_of(one.mesh, "Master"))
    pin, hole = (one.u[np.intersect1d(skins, nodes_of(one.mesh, body))] for body in ("Pin", "Sheet"))
    return one, np.array([pin[:, 0].max(), hole[:, 0].max(), hole[:, 1].max()])


@problem
def solve_ironing(
    slaves: tuple[str, ...], steps: int, iterations: int | None = None, twin: bool = False
) -> Iterator[Result]:
    """Shallow ironing, ssnp153a: a die goes down by 1 in 10 steps, then along by 10 in `steps`.

    `slaves`: groups that are the slave in turn, of the die or the slab. `iterations`: at most, of all steps.
    code_aster's law is not neo-Hookean, but has logarithmic strains, so that its forces are others.
    """
    every = []
    for slave in slaves:
        path = {"ux": [[0.0, 0.0], [1.0, 0.0], [2.0, 10.0]], "uy": [[0.0, 0.0], [1.0, -1.0], [2.0, -1.0]]}
        text = case_text(
            "plane_strain", material(6.896e8, 0.32, groups=["Soft"], law="neo_hookean"),
            material(68.96e8, 0.32, groups=["Hard"], law="neo_hookean"),
            contact(slave, {"Master": "Slave", "Slave": "Master"}[slave], friction=0.3), fixed("Bloq", "xy"),
            entry("displacement", group="Depl", **path), entry("steps", times=times(10, steps)), kinematics="finite",
        )  # fmt: skip
        every.append(solve(text, joined([(mesh_of("ssnp153a", twin), {})], keep=True)))
    halvings = sum(one.halvings for one in every)
    yield at_most("cutbacks", halvings, 0, source="a prototype had none in 110 steps")
    if iterations is not None:
        name, most = "iterations of all steps, of the role that takes more", max(one.iterations for one in every)
        yield at_most(name, most, iterations, source="a prototype: 528 and 656")
    if len(every) > 1:
        first, second = (
            np.abs(np.asarray(contact.resultant)) for one in every for contact in one.figures.contact.values()
        )
        apart = np.abs(first / second - 1).max()
        yield at_most("forces at the end, difference of the roles", apart, 0.01, source="either body a slave")
    yield from balanced(every)


def cases(family: str) -> Iterator[Case]:
    """Plate, roller, punch, pin, ironing; each with a twin."""
    dies, own = ("Master", "Slave"), "a mesh of our own of the same bodies"
    for name, mesh, what, solve_it, given, quick in (
        ("ssnv128", "ssnv128m", "a plate on a rigid plane", solve_plate, (), 1),
        ("ssnp154a", "ssnp154a", "NAFEMS's roller", solve_roller, (), 1),
        ("ssna122a", "ssna122a", "NAFEMS's punch with rounded edges", solve_rounded, (), 0),
        ("ssnp156a", "ssnp156a", "NAFEMS's loaded pin", solve_pin, (), 1),
        ("ironing-110", "ssnp153a", "ironing in 110 steps, both roles", solve_ironing, (dies, 100, 600), 0),
        ("ironing-60", "ssnp153a", "ironing in 60 steps, the die is the slave", solve_ironing, (dies[:1], 50), 0),
    ):
        long, short = {"ironing-110": (600.0, 60.0), "ironing-60": (200.0, 15.0)}.get(name, (5.0, 5.0))
        if there(mesh):
            words, full = f"{what}, code_aster's mesh", int(mesh != "ssnp153a")
            yield row(family, name, words, solve_it, *given, quick=quick, full=full, every=1, seconds=long)
        name, words = f"{name}-twin", f"{what}, {own}"
        yield row(family, name, words, solve_it, *given, twin=True, quick=quick, full=1, seconds=short)
