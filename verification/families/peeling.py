"""Thin plates that part: strips bent apart, a heavy strip lifted off a table, leaf springs, and a bank of plates."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lacmesh import Mesh
from lacsolver import NotConvergedError
from verification.meshes.plates import Floats, plates
from verification.records import Family, Result, at_most, equal, problem, row
from verification.solving import Solved, balanced, case_text, contact, entry, fixed, material, model_of, solve

_CONVEX = "small strains without friction: one equilibrium, of a convex problem"
_FEW = "a system is a solution with one active set; the edge of contact passes over many faces"
#: the heavy strip: Young's modulus, weight for each length, height that its end is lifted by, and its thickness 1
_YOUNG, _WEIGHT, _LIFT = 2e5, 0.01, 0.2


def _effort(solved: Solved, most: int, source: str = _CONVEX, one_step: str = _CONVEX) -> Iterator[Result]:
    """Linear systems and halved steps of a solution, and its balance."""
    yield at_most("systems", solved.iterations, most, source=source, reason=_FEW)
    yield at_most("halved steps", solved.halvings, 0, source=one_step)
    yield from balanced([solved])


@problem
def solve_strips(faces: int) -> Iterator[Result]:
    """Two strips, the lower one, of some slave faces, pushed up at its start: one of 30 faces stays closed."""
    lower, upper = ((0.0, 0.0), (75.0, 5.0)), ((0.0, 5.0), (150.0, 10.0))
    boxes = [(np.array(low), np.array(high)) for low, high in (lower, upper)]
    text = case_text(
        "plane_strain", material(210000.0, 0.3), contact("over1", "under2"), *(fixed(f"start{k}", "x") for k in (1, 2)),
        entry("displacement", at=[0.0, 0.0], uy=10.0), entry("displacement", at=[150.0, 5.0], uy=0.0),
    )  # fmt: skip
    solved = solve(text, plates(boxes, [(faces, 1), (2 * faces + 1, 1)], table=False))
    force, source = float(solved.zone.pressure @ solved.zone.area), "Murty's rule alone, on the same mesh"
    yield equal("force between the strips", force, 44.4763, 1e-4, source=source, reason="digits of the source")
    yield from _effort(solved, 25)


@problem
def solve_lifted(faces: int) -> Iterator[Result]:
    """A heavy strip of QUAD8 on a table, of some slave faces, lifted at its end.

    A beam without shear is lifted over l = (24 E I H / q)^(1/4), by a force q l / 2.
    """
    text = case_text(
        "plane_strain", material(_YOUNG, 0.0, groups=["plate1"]), contact("under1", "table"),
        entry("rigid", group="table"), entry("body_force", groups=["plate1"], fy=-_WEIGHT),
        entry("displacement", at=[120.0, 0.0], uy=_LIFT), entry("displacement", at=[0.0, 0.0], ux=0.0),
    )  # fmt: skip
    strip = (np.array([0.0, 0.0]), np.array([120.0, 1.0]))
    solved = solve(text, plates([strip], [(faces, 1)], table=True, kind="QUAD8"))
    length = (24 * _YOUNG / 12 * _LIFT / _WEIGHT) ** 0.25
    force = 120.0 * _WEIGHT - float(solved.zone.pressure @ solved.zone.area)
    yield equal("lifting force over that of a beam", force / (_WEIGHT * length / 2), 1.0, 1e-3,
                source="a beam without shear lifted off a table, in closed form",
                reason="shear, and the edge of contact within a face")  # fmt: skip
    yield from _effort(solved, 60)


@problem
def solve_leaves(count: int, finite: bool, most: int) -> Iterator[Result]:
    """Leaves clamped at their start on one another, of 85 faces each, the highest pressed down at its end."""
    boxes = [(np.array([0.0, 2.0 * k]), np.array([100.0, 2.0 * (k + 1)])) for k in range(count)]
    geometry = "current" if finite else "reference"
    text = case_text(
        "plane_strain", material(2e5, 0.3, law="neo_hookean" if finite else "elastic"),
        *(contact(f"over{k}", f"under{k + 1}", geometry=geometry) for k in range(1, count)),
        *(fixed(f"start{k}", "xy") for k in range(1, count + 1)),
        entry("displacement", at=[100.0, 2.0 * count], uy=-8.0), kinematics="finite" if finite else "small",
    )  # fmt: skip
    solved = solve(text, plates(boxes, [(85, 1)] * count, table=False))
    one_step = "one step serves where one equilibrium is sought"
    yield from _effort(solved, most, "" if finite else _CONVEX, one_step)


def random_plates(seed: int) -> tuple[str, Mesh]:
    """A case, as text, and its mesh: a random stack of one to four plates that has an equilibrium.

    Plates are clamped, guided at their start, or loose; each of the last two lies wholly over the one below.
    """
    draw = np.random.default_rng([43, seed])
    dim, count = (2 if draw.random() < 0.7 else 3), int(draw.integers(1, 5))
    table = count == 1 or draw.random() < 0.6
    axes, up, initial = "xyz"[:dim], "xyz"[dim - 1], str(draw.choice(["gap", "all", "none"], p=[0.5, 0.3, 0.2]))
    width, height, length, tables = draw.uniform(2, 5), 0.0, 14.0, list[str]()
    boxes, counts = list[tuple[Floats, Floats]](), list[tuple[int, ...]]()
    for k in range(1, count + 1):
        support = "clamped" if k == 1 and not table else str(draw.choice(["clamped", "guided", "loose"]))
        length = draw.uniform(6, 14) if support == "clamped" else length * draw.uniform(0.6, 0.99)
        thick, low = float(draw.choice([0.05, 0.1, 0.3, 0.8])), np.zeros(dim)
        low[0], low[-1] = 0.01 * k, height + (0.0 if draw.random() < 0.7 else draw.uniform(0, 0.3))
        high = low + np.array([length, *[width] * (dim - 2), thick])
        height = high[-1]
        ranges = ((15, 70), (1, 3)) if dim == 2 else ((8, 20), (2, 6), (1, 2))
        cells = tuple(int(draw.integers(*ends)) for ends in ranges)
        boxes, counts = [*boxes, (low, high)], [*counts, cells]
        young = float(1e5 * 10 ** draw.uniform(-1, 1))
        tables.append(material(young, float(draw.uniform(0, 0.35)), groups=[f"plate{k}"]))
        if support == "loose":
            tables.append(entry("displacement", at=low.tolist(), **dict.fromkeys((f"u{a}" for a in axes[:-1]), 0.0)))
        else:
            tables.append(fixed(f"start{k}", axes if support == "clamped" else axes[:1]))
        if dim == 3 and support != "clamped":
            tables.append(entry("displacement", at=[float(high[0]), *low[1:].tolist()], uy=0.0))
        weight = young * thick**3 / 12 * 8 / length**4 * 10 ** draw.uniform(-2, 1)  # it bends by 0.01 to 10 alone
        tables.append(entry("body_force", groups=[f"plate{k}"], **{f"f{up}": float(-weight / thick)}))
        for _ in range(int(draw.integers(0, 3)) if support != "loose" else 0):
            place = low + (high - low) * np.array([draw.integers(1, n + 1) / n for n in cells[:-1]] + [1.0])
            force = weight * length * (width if dim == 3 else 1.0) * draw.uniform(-1, 1 if support == "clamped" else 0)
            tables.append(entry("force", at=place.tolist(), **{f"f{up}": float(force)}))
        if draw.random() < 0.25:
            lift = draw.uniform(-0.05 if support == "clamped" and k > 1 else 0.0, 0.4)
            place = np.array([high[0], *low[1:-1], high[-1]])
            tables.append(entry("displacement", at=place.tolist(), **{f"u{up}": float(lift)}))
        if k > 1 or table:
            below = f"over{k - 1}" if k > 1 else "table"
            skins = (f"under{k}", below) if k == 1 or draw.random() < 0.5 else (below, f"under{k}")
            tables.append(contact(skins[0], skins[1], initial=initial))
    tables += [entry("rigid", group="table")] if table else []
    return case_text(model_of(dim), *tables), plates(boxes, counts, table=table)


@problem
def solve_bank(first: int = 0, *, levels: int) -> Iterator[Result]:
    """So many random stacks of plates: number `first`, `first` + 1, ..."""
    lost, halvings = 0, 0
    for number in range(first, first + levels):
        try:
            halvings += solve(*random_plates(number)).halvings
        except NotConvergedError:
            lost += 1
    yield at_most("runs that end without an equilibrium", lost, 0, source=_CONVEX)
    yield at_most("halved steps", halvings, 0, source=_CONVEX)


TEXT = """
Thin plates part from one another or from a table, so that the edge of contact passes over most of their faces. Bodies
are soft against bending and stiff in their skins, which is hard on the search for the closed faces: without help its
edge moves by about one face in each linear system. Strips, a strip lifted off a table, leaf springs, and 300 random
stacks of one to four plates, in the plane and in space, under weight and point forces, closed or apart at the start.
"""

_LEAVES = (
    ("leaves_2", 2, False, 40), ("leaves_3", 3, False, 80), ("leaves_2_finite", 2, True, 100),
    ("leaves_3_finite", 3, True, 160),
)  # fmt: skip
FAMILY = Family(
    "peeling",
    "Peeling",
    TEXT,
    (
        row("peeling", "strips", "two strips, 30 faces", solve_strips, 30, quick=1, seconds=1.0),
        row("peeling", "lifted", "a heavy strip, 240 faces", solve_lifted, 240, full=1, seconds=2.0),
        *(
            row(
                "peeling", name, f"{count} leaves, 85 faces each, {'finite' if finite else 'small'} kinematics",
                solve_leaves, count, finite, most, full=1, seconds=10.0,
            )
            for name, count, finite, most in _LEAVES
        ),
        *(
            row(
                "peeling", f"bank_{k + 1}", f"random stacks {100 * k} to {100 * k + 99}",
                solve_bank, 100 * k, full=100, seconds=60.0,
            )
            for k in range(3)
        ),
    ),
)  # fmt: skip
