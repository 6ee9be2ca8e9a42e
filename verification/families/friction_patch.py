"""**Patch tests.** Two blocks on one another whose faces do not match, pressed by 1 and sheared: below mu p they stick,
and at mu p the upper one is moved aside by a slip more. Stress, displacement, p and t are uniform or linear, and known
to the last digit, whatever the cells; along the axes, in a tilted frame, and on distorted quadrangles.

**Balance.** The blocks of the family `balance` with friction: on curved, warped, overhanging and turning skins, across
gaps, forces and moments of slave and master balance to rounding, as the rows of t have the moment arm of the gap.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from lacsolver.results.fields import point_stress
from verification.families import balance
from verification.families.patch import DISPLACEMENT, PRESSURES, STRESS, worst
from verification.families.patch import StackErrors as Errors
from verification.meshes.blocks import nodes_of
from verification.meshes.stacks import PLANE_KINDS, SOLID_KINDS, moved, stack, tilt
from verification.records import Case, Outcome, at_most
from verification.solving import balanced, case_text, entry, model_of, solve

Floats = NDArray[np.floating]

YOUNG, POISSON, PRESSURE, FRICTION = 1e3, 0.3, 1.0, 0.3
#: shear stress of the blocks that stick; slip of those that slide
STICKS, SLIP = 0.2, 0.05
#: of the solver where the blocks slide: it is relative to the largest displacement, the slip, which is 50 times that
#: under the pressure
SLIDING_TOLERANCE = 1e-12
SHEAR, SLIPS = "contact shear t_m", "slip"
#: direction of the shear
_ALONG = {2: (1.0, 0.0), 3: (0.8, 0.6, 0.0)}
_SOURCE = "uniform stress, linear displacement"
#: components of a stress, as pairs of axes
_AXES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))


@dataclass(frozen=True)
class Sheared:
    """Stacks of two blocks that stick or slide. `pairs`: kinds of slave and master; `keys`: others of [[contact]]."""

    pairs: tuple[tuple[str, str], ...]
    dim: int
    slides: bool
    tilted: bool = False
    skew: float = 0.0
    keys: tuple[tuple[str, object], ...] = (("friction", FRICTION),)

    @property
    def turn(self) -> Floats:
        """Rotation (3, 3) of the frame."""
        return tilt(self.dim) if self.tilted else np.eye(3)

    @property
    def along(self) -> Floats:
        """(3,): direction in which the upper block is sheared, or slides, in the frame of the mesh."""
        return self.turn @ np.pad(_ALONG[self.dim], (0, 3 - self.dim))

    @property
    def stress(self) -> Floats:
        """(3, 3) in the frame of the mesh."""
        up, along = self.turn[:, self.dim - 1], self.along
        shear = FRICTION * PRESSURE if self.slides else STICKS
        sigma = shear * (np.outer(up, along) + np.outer(along, up)) - PRESSURE * np.outer(up, up)
        if self.dim == 2:
            sigma[2, 2] = -POISSON * PRESSURE
        return np.asarray(sigma)

    @property
    def gradient(self) -> Floats:
        """(dim, 3): of the displacement of both blocks, without rotation."""
        sigma = self.stress
        strain = ((1 + POISSON) * sigma - POISSON * np.trace(sigma) * np.eye(3)) / YOUNG
        return np.asarray(strain[: self.dim])


def solve_case(given: Sheared, *, levels: int) -> Outcome:
    """Solve every pair, with the slave below and above."""
    stacks = [errors(given, *pair, below) for pair in given.pairs for below in (True, False)]
    results = [worst(quantity, stacks) for quantity in stacks[0].errors]
    wrong = sum(_wrong(given, one) for one in stacks)
    state = at_most(
        f"macro-elements that do not {'slide' if given.slides else 'stick'}", wrong, 0, source="the load, over mu p"
    )
    return Outcome((*results, state, *balanced([one.solved for one in stacks])))


def errors(given: Sheared, slave: str, master: str, slave_below: bool) -> Errors:
    """Solve one stack: largest errors, relative to the pressure, the displacement and the slip."""
    d = given.dim
    mesh = stack(slave, master, d, slave_below=slave_below, counts=(3, 2), bend=0.3, skew=given.skew)
    solved = solve(text(given), moved(mesh, given.turn))
    sigma = np.concatenate([s.reshape(-1, s.shape[-1]) for s in point_stress(solved.problem, solved.state)])
    exact = np.array([given.stress[a, b] for a, b in _AXES])[: sigma.shape[1]]
    right = solved.mesh.points @ given.gradient.T
    if given.slides:
        right[nodes_of(solved.mesh, "upper")] += SLIP * given.along[:d]
    zone, side = solved.zone, -1.0 if slave_below else 1.0  # t is on the master, along the slave's slip
    shear = side * given.along[:d] * (FRICTION * PRESSURE if given.slides else STICKS)
    slip = side * given.along[:d] * (SLIP if given.slides else 0.0)
    moved_by = SLIP if given.slides else PRESSURE / YOUNG
    errors = {
        STRESS: float(np.abs(sigma - exact).max() / PRESSURE),
        PRESSURES: float(np.abs(zone.pressure / PRESSURE - 1).max()),
        SHEAR: float(np.abs(solved.shear - shear).max() / PRESSURE),
        SLIPS: float(np.abs(solved.slip - slip).max() / moved_by),
        DISPLACEMENT: float(np.abs(solved.u - right).max() / np.abs(right).max()),
    }
    return Errors(f"{slave} {'under' if slave_below else 'on'} {master}", errors, solved)


def text(given: Sheared) -> str:
    """The case of a stack, as TOML: the displacement of top and bottom, the tractions of the sides."""
    d, axes = given.dim, "xyz"[: given.dim]
    shift = SLIP * given.along if given.slides else np.zeros(3)

    def formula(k: int, constant: float) -> str:
        terms = [f"({float(g)!r}) * {a}" for g, a in zip(given.gradient[k], "xyz", strict=True) if g]
        return " + ".join([*terms, f"({constant!r})"])

    ends = [
        entry("displacement", group=name, **{f"u{a}": formula(k, float(v[k])) for k, a in enumerate(axes)})
        for name, v in (("bottom", np.zeros(3)), ("top", shift))
    ]
    sides = []
    for k, a in enumerate(axes[:-1]):
        for end, sign in (("0", -1.0), ("1", 1.0)):
            pull = sign * given.stress[:d, :d] @ given.turn[:d, k]
            sides.append(
                entry("traction", group=f"{a}{end}", **{f"t{b}": float(v) for b, v in zip(axes, pull, strict=True)})
            )
    return case_text(
        model_of(d),
        entry("solver", threads=1, tolerance=SLIDING_TOLERANCE if given.slides else None),
        entry("material", young=YOUNG, poisson=POISSON),
        entry("contact", slave="slave", master="master", **dict(given.keys)),
        *ends,
        *sides,
    )


def _wrong(given: Sheared, one: Errors) -> int:
    """Number of macro-elements whose state is not the one that is sought: 1 sticks, 2 slides."""
    return int((one.solved.zone.status != (2 if given.slides else 1)).sum())


_FEW_PLANE = (("TRIA3", "QUAD8"), ("QUAD4", "TRIA7"), ("QUAD9", "mixed 1"), ("TRIA6", "TRIA3"))
_FEW = (("HEXA8", "TETRA4"), ("TETRA10", "HEXA20"), ("PENTA15 quadrangle", "HEXA27"), ("mixed 2", "mixed 1"))
#: other laws with the same bound, on blocks paired once (in the deformed geometry one would slide off the other's edge)
_LAWS: tuple[tuple[str, tuple[tuple[str, object], ...]], ...] = (
    ("tresca", (("cohesion", FRICTION),)),
    ("limited", (("friction", 1.0), ("shear_limit", FRICTION))),
    ("both", (("friction", 0.2), ("cohesion", 0.1))),
    ("smoothed", (("friction", FRICTION), ("normals", "smoothed"))),
)


def cases(family: str) -> Iterator[Case]:
    """Patch tests and balance."""
    for dim, kinds, few in ((2, PLANE_KINDS, _FEW_PLANE), (3, SOLID_KINDS, _FEW)):
        for slides in (False, True):
            word = "slides" if slides else "sticks"
            every = tuple((slave, master) for slave in kinds for master in kinds)
            if dim == 2:
                for tilted in (False, True):
                    name = f"patch-2d-{word}{'-tilted' if tilted else ''}"
                    yield _case(family, name, Sheared(every, 2, slides, tilted), 20.0, quick=False)
            else:
                for slave in kinds:
                    own = tuple((slave, master) for master in kinds)
                    name = f"patch-3d-{word}-{slave.replace(' ', '-')}"
                    yield _case(family, name, Sheared(own, 3, slides, True), 15.0, quick=False)
            yield _case(family, f"patch-few-{dim}d-{word}", Sheared(few, dim, slides, dim == 3), 4.0, quick=True)
            for skew in (0.05, 0.2) if dim == 3 else ():
                pairs = tuple((s, m) for s in ("HEXA8", "HEXA20", "HEXA27") for m in ("HEXA8", "HEXA20"))
                yield _case(
                    family,
                    f"patch-3d-{word}-skew-{skew}",
                    Sheared(pairs, 3, slides, True, skew),
                    8.0,
                    quick=skew == 0.2,
                )
        for name, keys in _LAWS:
            yield _case(family, f"patch-{dim}d-{name}", Sheared(few, dim, True, dim == 3, keys=keys), 4.0, quick=False)
    for case in balance.FAMILY.cases:
        (touch,) = case.solve.args
        if touch.joint == "contact" and dict(touch.keys).get("type") != "bilateral":
            rubbed = {**dict(touch.keys), "friction": FRICTION}
            yield replace(
                case,
                family=family,
                name=f"balance-{case.name}",
                description=f"{case.description}, with friction",
                solve=partial(balance.run, replace(touch, keys=tuple(rubbed.items()))),
                levels={"full": 1} | ({"quick": 1} if case.name in _QUICK_BALANCE else {}),
            )


_QUICK_BALANCE = ("waves-facet-2d", "waves-smoothed-2d", "overhang-3d", "waves-facet-finite-2d")


def _case(family: str, name: str, given: Sheared, seconds: float, *, quick: bool) -> Case:
    description = f"blocks that {'slide' if given.slides else 'stick'}, {dict(given.keys)}"
    return Case(family, name, description.replace("{", "").replace("}", "").replace("'", ""),
                partial(solve_case, given), {"quick" if quick else "full": 1}, seconds)  # fmt: skip
