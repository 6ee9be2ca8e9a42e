"""**Lids.** A lid, tied to a column, is pressed and pushed on two blocks: rows of the two zones depend on each other
through the column, and sets of rows return under pivoting in several of a hundred such lids. All random lids must be
solved at once, without a cutback, with small strains on either geometry and with finite ones; two known ones with the
forces of projected Gauss-Seidel on the same matrices.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

import lacsolver
from lacmesh import Mesh
from lacsolver import NotConvergedError
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from verification.meshes.blocks import joined
from verification.meshes.half_spaces import piece
from verification.records import Case, Outcome, at_most, equal
from verification.solving import case_text, entry, solve

#: kinematics and geometry of contact
KINDS = {"reference": ("small", "reference"), "current": ("small", "current"), "finite": ("finite", "current")}
#: friction, and the forces along y and x of the blocks on the lid; violations of the conditions are below 4e-16
_KNOWN = ((0.2, 2.7830869501, 0.5231004109), (0.3, 2.7427535141, 0.5553778340))
_SOURCE = "projected Gauss-Seidel on the same matrices"


def lid(n_block: int, n_lid: int) -> Mesh:
    """Two blocks of n_block cells across beside a column, and a lid of n_lid on all three."""
    x, up, lid_y = np.linspace, np.linspace(0, 4, 5), np.linspace(4, 5, 3)
    parts = [
        (piece("QUAD4", [x(-0.5, 0.5, 3), up]), {"": "column", "y0": "foot", "y1": "head"}),
        (piece("QUAD4", [x(-2, 2, n_lid + 1), lid_y]), {"": "lid", "y0": "under", "y1": "top"}),
    ]
    for low in (-2.0, 1.0):
        block = piece("QUAD4", [x(low, low + 1, n_block + 1), up])
        parts.append((block, {"": "blocks", "y0": "base", "y1": "skin"}))
    return joined(parts)


def text_of(kind: str, friction: float, push: float, poisson: float) -> str:
    """The case of a lid pressed with 4."""
    kinematics, geometry = KINDS[kind]
    law = {"law": "neo_hookean"} if kinematics == "finite" else {}
    return case_text(
        "plane_strain",
        entry("material", young=1000.0, poisson=poisson, **law),
        entry("contact", name="joint", slave="skin", master="under", friction=friction, geometry=geometry),
        entry("tie", name="tie", slave="head", master="under"),
        entry("displacement", group="foot", ux=0.0, uy=0.0),
        entry("displacement", group="base", ux=0.0, uy=0.0),
        entry("force", group="top", fx=push, fy=-4.0, total=True),
        entry("steps", count=2, max_halvings=0),
        kinematics=kinematics,
    )


def solve_bank(kind: str, *, levels: int) -> Outcome:
    """So many random lids: cells, friction, push and Poisson's ratio."""
    random, lost = np.random.default_rng(5), 0
    for _ in range(levels):
        mesh = lid(int(random.integers(2, 7)), int(random.integers(5, 17)))
        friction, push = float(random.choice([0.1, 0.2, 0.3, 0.4])), float(random.uniform(-1.5, 1.5))
        text = text_of(kind, friction, push, float(random.choice([0.0, 0.3])))
        try:
            for _ in march(Problem.of(lacsolver.parse_case(text), mesh)):
                pass
        except NotConvergedError:
            lost += 1
    return Outcome((at_most(f"lids that are not solved at once, of {levels}", lost, 0, source="a solution exists"),))


def solve_known(*, levels: int) -> Outcome:
    """Two lids whose sets return."""
    del levels
    results = []
    for friction, normal, shear in _KNOWN:
        zone = solve(text_of("reference", friction, 1.0, 0.3), lid(3, 8)).state.zones[0]
        assert zone.friction is not None
        for name, value, right in (
            ("pressure", zone.pressure @ zone.area, normal), ("friction", zone.friction.shear[:, 0] @ zone.area, shear)
        ):  # fmt: skip
            results.append(
                equal(f"force of {name}, coefficient {friction}", float(value), right, 1e-8 * right, source=_SOURCE,
                      reason="digits of the reference")
            )  # fmt: skip
    return Outcome(tuple(results))


def cases(family: str) -> Iterator[Case]:
    """300 lids in all, and the known ones."""
    yield Case(family, "lids-known", "forces of two lids", partial(solve_known), {"quick": 1, "full": 1}, 2.0)
    for kind in KINDS:
        sizes = {"quick": 4, "full": 100}
        yield Case(family, f"lids-{kind}", f"random lids, {kind}", partial(solve_bank, kind), sizes, 150.0)
