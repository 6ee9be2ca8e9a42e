"""**Patch tests.** Two blocks on one another whose faces do not match, pressed by 1 and sheared: below mu p they stick,
and at mu p the upper one is moved aside by a slip more. Stress, displacement, p and t are uniform or linear, and known
to the last digit, whatever the cells; along the axes, in a tilted frame, and on distorted quadrangles.

**Balance.** The blocks of the family `balance` with friction: on curved, warped, overhanging and turning skins, across
gaps, forces and moments of slave and master balance to rounding, as the rows of t have the moment arm of the gap.

**Inf-sup.** The constant of (p, t) and of t alone beside that of p, on the blocks of the family `inf-sup`: the cut
that is stable for pressures is stable for tractions with as many components as the space has, since normal and tangents
are at right angles; on plane skins, and on curved ones of both bodies, whose faces do not match.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack
from scipy.sparse.linalg import splu

import lacmesh
from lacsolver.contact import Pairing, Zone, integrate
from lacsolver.results.fields import point_stress
from verification.families import balance
from verification.families.inf_sup import SIDES, STAYS, Skin, block_of
from verification.families.patch import DISPLACEMENT, PRESSURES, STRESS, StackErrors, worst
from verification.measures.inf_sup import in_body, norm
from verification.measures.rates import fitted
from verification.meshes.blocks import bent, nodes_of
from verification.meshes.stacks import PLANE_KINDS, SOLID_KINDS, moved, stack, tilt
from verification.records import Case, Result, at_most, levels_of, problem, row
from verification.solving import balanced, case_text, contact, entry, material, model_of, solve

Floats = NDArray[np.floating]
Keys = tuple[tuple[str, Any], ...]

YOUNG, POISSON, PRESSURE, FRICTION = 1e3, 0.3, 1.0, 0.3
#: shear stress of the blocks that stick; slip of those that slide
STICKS, SLIP = 0.2, 0.05
#: of the solver where the blocks slide: it is relative to the largest displacement, the slip, which is 50 times that
#: under the pressure
SLIDING_TOLERANCE = 1e-12
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
    keys: Keys = (("friction", FRICTION),)

    @property
    def turn(self) -> Floats:
        """Rotation (3, 3) of the frame."""
        return tilt(self.dim) if self.tilted else np.eye(3)

    @property
    def along(self) -> Floats:
        """(3,): direction in which the upper block is sheared, or slides, in the frame of the mesh."""
        return self.turn @ {2: (1.0, 0.0, 0.0), 3: (0.8, 0.6, 0.0)}[self.dim]

    @property
    def shear(self) -> float:
        """Shear stress."""
        return FRICTION * PRESSURE if self.slides else STICKS

    @property
    def stress(self) -> Floats:
        """(3, 3) in the frame of the mesh."""
        up, along = self.turn[:, self.dim - 1], self.along
        sigma = self.shear * (np.outer(up, along) + np.outer(along, up)) - PRESSURE * np.outer(up, up)
        if self.dim == 2:
            sigma[2, 2] = -POISSON * PRESSURE
        return np.asarray(sigma)

    @property
    def gradient(self) -> Floats:
        """(dim, 3): of the displacement of both blocks, without rotation."""
        sigma = self.stress
        strain = ((1 + POISSON) * sigma - POISSON * np.trace(sigma) * np.eye(3)) / YOUNG
        return np.asarray(strain[: self.dim])

    @property
    def text(self) -> str:
        """The case, as TOML: the displacement of top and bottom, the tractions of the sides."""
        d, axes = self.dim, "xyz"[: self.dim]

        def ends(group: str, shift: Floats) -> str:
            formulas = {}
            for k, a in enumerate(axes):
                terms = [f"({float(g)!r}) * {b}" for g, b in zip(self.gradient[k], "xyz", strict=True) if g]
                formulas[f"u{a}"] = " + ".join([*terms, f"({float(shift[k])!r})"])
            return entry("displacement", group=group, **formulas)

        def side(k: int, end: str) -> str:
            pull = (1 if end == "1" else -1) * self.stress[:d, :d] @ self.turn[:d, k]
            return entry("traction", group=f"{axes[k]}{end}", **{f"t{a}": float(pull[n]) for n, a in enumerate(axes)})

        return case_text(
            model_of(d), entry("solver", threads=1, tolerance=SLIDING_TOLERANCE if self.slides else None),
            material(YOUNG, POISSON), contact(**dict(self.keys)), ends("bottom", np.zeros(3)),
            ends("top", SLIP * self.along if self.slides else np.zeros(3)),
            *(side(k, end) for k in range(d - 1) for end in "01"),
        )  # fmt: skip


@problem
def solve_sheared(given: Sheared) -> Iterator[Result]:
    """Solve every pair, with the slave below and above."""
    stacks = [errors(given, *pair, below) for pair in given.pairs for below in (True, False)]
    yield from (worst(quantity, stacks) for quantity in stacks[0].errors)
    other = sum(int((one.solved.zone.status != (2 if given.slides else 1)).sum()) for one in stacks)
    name = f"macro-elements that do not {'slide' if given.slides else 'stick'}"
    yield at_most(name, other, 0, source="the load, over mu p")
    yield from balanced([one.solved for one in stacks])


def errors(given: Sheared, slave: str, master: str, slave_below: bool) -> StackErrors:
    """Solve one stack: largest errors, relative to the pressure, the displacement and the slip."""
    d = given.dim
    mesh = stack(slave, master, d, slave_below=slave_below, counts=(3, 2), bend=0.3, skew=given.skew)
    solved = solve(given.text, moved(mesh, given.turn))
    sigma = np.concatenate([s.reshape(-1, s.shape[-1]) for s in point_stress(solved.problem, solved.state)])
    exact = np.array([given.stress[a, b] for a, b in _AXES])[: sigma.shape[1]]
    right, slip = solved.mesh.points @ given.gradient.T, SLIP if given.slides else 0.0
    right[nodes_of(solved.mesh, "upper")] += slip * given.along[:d]
    along = (-1.0 if slave_below else 1.0) * given.along[:d]  # t is on the master, along the slave's slip
    each = {
        STRESS: float(np.abs(sigma - exact).max() / PRESSURE),
        PRESSURES: float(np.abs(solved.zone.pressure / PRESSURE - 1).max()),
        "contact shear t_m": float(np.abs(solved.shear - given.shear * along).max() / PRESSURE),
        "slip": float(np.abs(solved.slip - slip * along).max() / (slip or PRESSURE / YOUNG)),
        DISPLACEMENT: float(np.abs(solved.u - right).max() / np.abs(right).max()),
    }
    return StackErrors(f"{slave} {'under' if slave_below else 'on'} {master}", each, solved)


# ---- inf-sup

#: of the constant of t and of (p, t), the difference from that of p, of it
SAME = 0.02
#: rise of curved skins, whose sides are 1 long
CURVED = 0.15
_THEORY = "v = sum of h psi_m (p_m n + t_m e): normal and tangents are at right angles"


def constants(skin: Skin, rise: float, n: int) -> tuple[dict[str, float], int]:
    """beta of p, t and both, the slave's rim fixed; number of free unknowns."""
    dim = skin.dim
    slave = f"{'xyz'[dim - 1]}0"
    mesh = lacmesh.cut_skin(bent(block_of(skin, n), lambda x: _risen(x, rise, dim)), slave, hexa=skin.hexa).mesh
    face = integrate(Zone.of(mesh, slave, "master"), dim, Pairing(friction=True))
    x = mesh.points[:, :dim]
    sides = ((x[:, :-1] < 1e-9) | (x[:, :-1] > 1 - 1e-9)).any(axis=1)
    moving = np.flatnonzero(~sides & (np.abs(x[:, -1]) < 1 - 1e-9) & in_body(mesh))
    inverse = splu(norm(mesh)[moving][:, moving], permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve
    weight = face.area ** (-0.5 * dim / (dim - 1))
    weight_t = np.repeat(weight, dim - 1)
    least = partial(_least, moving=moving, dim=dim, inverse=inverse)
    both = least(csr_array(vstack([face.B, face.B_T])), np.concatenate([weight, weight_t]))
    return {"p": least(face.B, weight), "t": least(face.B_T, weight_t), "both": both}, dim * len(moving)


def _risen(x: Floats, rise: float, dim: int) -> Floats:
    """Points (n, 3) of blocks at heights from -1 to 1, with a curved skin at height 0; their other sides stay flat."""
    plane, height = x[:, : dim - 1], x[:, dim - 1]
    bubble = np.prod(4 * plane * (1 - plane), axis=1) * (1 - np.abs(height))
    return np.asarray(x + rise * bubble[:, None] * np.eye(3)[dim - 1])


def _least(
    B: csr_array, weight: Floats, moving: NDArray[np.integer], dim: int, inverse: Callable[[Floats], Floats]
) -> float:
    S = np.zeros((B.shape[0],) * 2)
    for axis in range(dim):
        own = B[:, dim * moving + axis]
        S += own @ inverse(own.toarray().T)
    return float(np.sqrt(max(np.linalg.eigvalsh(weight[:, None] * S * weight)[0], 0.0)))


@problem
def solve_constants(skin: Skin, rise: float = 0.0, *, levels: int) -> Iterator[Result]:
    """The constants of a block on a fixed plane or another block, as `inf_sup.Skin`, on so many meshes.

    `rise`: of the skins' middle over their rim; their faces meet at angles, which fall.
    """
    sides = SIDES[skin.dim][:levels]
    every, unknowns = zip(*(constants(skin, rise, n) for n in sides), strict=True)
    h = [1 / n for n in sides]
    for name, of in (("p", "p"), ("t", "t"), ("both", "(p, t)")) if levels > 2 else ():
        beta = [own[name] for own in every]
        table = levels_of(h, unknowns, beta)
        yield at_most(f"beta of {of}, exponent of h", fitted(h, beta, 3), STAYS, source=_THEORY, levels=table)
    if not rise:
        apart = max(abs(own[name] / own["p"] - 1) for own in every for name in ("t", "both"))
        yield at_most("largest difference of the constants, of that of p", apart, SAME, source=_THEORY)


# ---- the tables

_FEW = {
    2: (("TRIA3", "QUAD8"), ("QUAD4", "TRIA7"), ("QUAD9", "mixed 1"), ("TRIA6", "TRIA3")),
    3: (("HEXA8", "TETRA4"), ("TETRA10", "HEXA20"), ("PENTA15 quadrangle", "HEXA27"), ("mixed 2", "mixed 1")),
}
#: other laws with the same bound, on blocks paired once (in the deformed geometry one would slide off the other's edge)
_LAWS: dict[str, Keys] = {
    "tresca": (("cohesion", FRICTION),),
    "limited": (("friction", 1.0), ("shear_limit", FRICTION)),
    "both": (("friction", 0.2), ("cohesion", 0.1)),
    "smoothed": (("friction", FRICTION), ("normals", "smoothed")),
}
_QUICK_BALANCE = ("waves-facet-2d", "waves-smoothed-2d", "overhang-3d", "waves-facet-finite-2d")


def _patches() -> Iterator[tuple[str, Sheared, float, bool]]:
    """Name, blocks, seconds, and whether the quick suite has them."""
    skewed = tuple(product(("HEXA8", "HEXA20", "HEXA27"), ("HEXA8", "HEXA20")))
    for dim, kinds in ((2, PLANE_KINDS), (3, SOLID_KINDS)):
        solid, few = dim == 3, _FEW[dim]
        for slides, word in ((False, "sticks"), (True, "slides")):
            for tilted in () if solid else (False, True):
                name = f"patch-2d-{word}{'-tilted' if tilted else ''}"
                yield name, Sheared(tuple(product(kinds, kinds)), 2, slides, tilted), 20.0, False
            for slave in kinds if solid else ():
                own = tuple((slave, master) for master in kinds)
                yield f"patch-3d-{word}-{slave.replace(' ', '-')}", Sheared(own, 3, slides, True), 15.0, False
            yield f"patch-few-{dim}d-{word}", Sheared(few, dim, slides, solid), 4.0, True
            for skew in (0.05, 0.2) if solid else ():
                yield f"patch-3d-{word}-skew-{skew}", Sheared(skewed, 3, slides, True, skew), 8.0, skew == 0.2
        for name, keys in _LAWS.items():
            yield f"patch-{dim}d-{name}", Sheared(few, dim, True, solid, keys=keys), 4.0, False


def _skins() -> Iterator[tuple[str, str, Skin, float, bool]]:
    """Name, description, skin, rise, and whether the quick suite has it."""
    for dim, kinds in ((2, PLANE_KINDS), (3, SOLID_KINDS)):
        for kind in kinds:
            name, what = kind.replace("mixed", f"mixed {dim}D").replace(" ", "-"), f"{kind}: beta of p, t and both"
            yield name, what, Skin(kind, dim), 0.0, kind in ("TRIA3", "TETRA4")
    for slave, master, dim in (("TRIA3", "QUAD4", 2), ("HEXA8", "TETRA4", 3)):
        yield f"{slave}-on-{master}", f"{slave} on a block of {master}", Skin(slave, dim, master=master), 0.0, False
    for kind in ("TRIA3", "QUAD4", "TRIA6", "QUAD8", "TETRA4", "HEXA8", "HEXA20"):
        skin = Skin(kind, 2 if kind in PLANE_KINDS else 3, master=kind)
        yield f"curved-{kind}", f"{kind}: both skins are curved, and do not match", skin, CURVED, kind == "QUAD4"


def cases(family: str) -> Iterator[Case]:
    """Patch tests, balance, inf-sup constants: every kind of cell, and a few on another block, on curved skins too."""
    for name, given, seconds, quick in _patches():
        what = f"blocks that {'slide' if given.slides else 'stick'}, "
        what += ", ".join(f"{key}: {value}" for key, value in given.keys)
        yield row(family, name, what, solve_sheared, given, quick=int(quick), full=1, seconds=seconds)
    for case in balance.FAMILY.cases:
        (touch,) = case.solve.args
        if touch.joint == "contact" and dict(touch.keys).get("type") != "bilateral":
            rubbed = replace(touch, keys=(*touch.keys, ("friction", FRICTION)))
            name, what = f"balance-{case.name}", f"{case.description}, with friction"
            quick = case.name in _QUICK_BALANCE
            yield row(family, name, what, balance.run, rubbed, quick=int(quick), full=1, seconds=case.seconds)
    for name, what, skin, rise, quick in _skins():
        few, full = 3 * int(quick), 4 if skin.dim == 2 and "-on-" not in name else 3
        yield row(family, f"inf-sup-{name}", what, solve_constants, skin, rise, quick=few, full=full, seconds=4.0)
