"""Inf-sup stability: the constant against h, and the contact pressures on meshes that lack it.

Pressures that are constant on macro-elements and displacements go together if the inf-sup constant beta of the two
stays above zero as h falls: then p_m converges and cannot oscillate. The hypothesis of the internal dof is enough for
it (Abbas, Drouet, Hild, CMAME 339, 2018), and `lacmesh cut` is there to make it true. Each problem is a block whose
slave side is cut, and the same block with each slave face a macro-element as it is.

**Constants.** Blocks of every type, their slave's rim fixed, which leaves displacements the least room. On the cut skin
beta stays, above what the internal dofs alone give, which is the same for all h. Where each face is a macro-element as
it is, beta is zero: on segments and triangles of linear cells since faces are as many as the nodes that move, or more;
on quadrangles, QUAD4 and QUAD8, since all nodes average a checkerboard to zero. With the rim free, beta falls with h.
Elsewhere it is reported: the hypothesis is sufficient, not necessary.

**Pressures.** Blocks under a smooth load, nodes moved at random. The exact pressure is that of a band pressed on both
sides by 1 + q cos kx (Timoshenko and Goodier, Theory of Elasticity, art. 24). On the cut skin p_m is about as good as
the best constants are; on the uncut skin it oscillates from face to face.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import lacmesh
import lacsolver
from lacmesh import Mesh
from lacmesh.cells import CELLS
from verification.measures.inf_sup import constant, in_body
from verification.measures.norms import pressure_errors
from verification.measures.rates import fitted
from verification.meshes import blocks, stacks
from verification.records import Case, Family, Level, Rows, at_least, at_most, informative, levels_of, problem, row
from verification.solving import Solved, balanced, case_text, entry, fixed, material, model_of
from verification.solving import solve as solved

Floats = NDArray[np.floating]

#: kinds (of `stacks`) whose faces are left whole by the cut: SEG3 and QUAD9 own an internal dof
WHOLE = ("TRIA6", "TRIA7", "QUAD8", "QUAD9", "HEXA27", "PENTA18 quadrangle", "PYRAM14 quadrangle")
#: kinds whose faces, left uncut, make the constant zero: SEG2, TRIA3, QUAD4 and QUAD8 faces
ZERO = (
    *("TRIA3", "QUAD4", "TETRA4", "HEXA8", "HEXA20", "PENTA6 triangle", "PENTA6 quadrangle", "PENTA15 quadrangle"),
    *("PYRAM5 triangle", "PYRAM5 quadrangle", "PYRAM13 quadrangle"),
)
#: cells a side, level by level: even, for pyramids with their apex in a corner
SIDES = {2: (4, 8, 16, 32, 64), 3: (2, 4, 6, 8, 12)}
#: in a pressed block
PRESSED = {2: (8, 16, 32), 3: (4, 8, 12)}
#: a constant below this is zero: beta^2 is an eigenvalue beside others of size 1, known to rounding
NOTHING = 1e-6
#: exponents of h: of a constant that stays, of one that falls
STAYS, FALLS = 0.1, 0.5
#: error of p_m over that of the best constants, and how much larger it is on the uncut skin
QUASI_OPTIMAL, OSCILLATES = 2.0, 4.0
LOAD, YOUNG, POISSON = 0.5, 100.0, 0.3
_THEORY = "Abbas, Drouet, Hild, CMAME 339, 2018, 488-513: hypothesis of the internal dof"


@dataclass(frozen=True)
class Skin:
    """A block [0, 1]^dim of `kind` (of `stacks`), its slave at height 0, on a fixed plane or on a block of `master`.

    All sides but the slave are fixed, its rim with them. `master_ratio`: its cells a side, over the slave's.
    """

    kind: str
    dim: int
    hexa: str = "pyramid"
    master: str = ""
    master_ratio: float = 1.5


@dataclass(frozen=True)
class Pressed:
    """A block [0, 1]^dim on a rigid plane, pressed on top by 1 + LOAD cos(pi x), its sides fixed along their normal.

    Nodes are moved at random, but stay in the sides that they are in, by up to `jitter` of a cell; the slave's rim is
    fixed.
    """

    kind: str
    dim: int
    hexa: str = "pyramid"
    jitter: float = 0.2
    seed: int = 1


class Constants(NamedTuple):
    """beta of one mesh: cut with its rim fixed and free, of its internal dofs alone; the same of the uncut skin."""

    cut: float
    cut_free: float
    internal: float
    uncut: float
    uncut_free: float
    unknowns: int


def _slave(dim: int) -> str:
    return f"{'xyz'[dim - 1]}0"


def block_of(given: Skin | Pressed, n: int) -> Mesh:
    """The block, n cells a side, not cut, and what it stands on: the groups `y0` or `z0`, and `master`."""
    dim = given.dim
    mesh = stacks.block(given.kind, (n,) * dim)
    if isinstance(given, Pressed):
        rng, x = np.random.default_rng(given.seed), mesh.points.copy()
        for axis in range(dim):
            inner = np.abs(x[:, axis] - 0.5) < 0.5 - 1e-9
            x[inner, axis] += rng.uniform(-given.jitter, given.jitter, int(inner.sum())) / n
        mesh = replace(mesh, points=x)
    elif given.master:
        lower = stacks.block(given.master, (round(given.master_ratio * n),) * dim)
        down = stacks.moved(lower, shift=-np.eye(3)[dim - 1])
        return blocks.joined([(mesh, {_slave(dim): _slave(dim)}), (down, {f"{'xyz'[dim - 1]}1": "master"})])
    plane = "SEG2" if dim == 2 else "QUAD4"
    turn = -1 if dim == 2 else 1  # the skin's normal, (t_y, -t_x) of a segment along t, faces the block
    points = 0.5 + 0.6 * turn * np.array(CELLS[plane].reference, dtype=float)
    return blocks.with_master(mesh, plane, np.column_stack([points, np.zeros(len(points))]))


def uncut(mesh: Mesh, slave: str) -> Mesh:
    """The mesh with the records of a cut (`docs/conventions.md`) that makes each slave face a macro-element."""
    faces = mesh.cells_of(slave)
    macro, first, zone = (np.full(mesh.n_cells, -1, np.int32) for _ in range(3))
    macro[faces], first[faces], zone[faces] = np.arange(len(faces)), 1, 0
    return replace(mesh, cell_data={"lac_macro": macro, "lac_child": first, "lac_zone": zone}, zones=(slave,))


def _moving(mesh: Mesh) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Masks (n_nodes,) of movable nodes: with all sides but the slave fixed, and with only the far side fixed."""
    x, d = mesh.points, mesh.space_dim
    far = np.abs(x[:, d - 1]) > 1 - 1e-9
    sides = (np.abs(x[:, : d - 1] - 0.5) > 0.5 - 1e-9).any(axis=1)
    return ~(far | sides), ~far


# ---- constants


def constants(given: Skin, n: int) -> Constants:
    """Inf-sup constants of the block with n cells per side."""
    mesh, slave = block_of(given, n), _slave(given.dim)
    matrices = lacsolver.contact_matrices(mesh, slave, "master", hexa=given.hexa)
    rim, free = _moving(matrices.mesh)
    internal = lacmesh.Cut(matrices.mesh).macro_of_node >= 0
    cut = constant(matrices, rim), constant(matrices, free)
    without = cut
    inner, unknowns = constant(matrices, internal & rim), given.dim * int((rim & in_body(matrices.mesh)).sum())
    if given.kind not in WHOLE:
        matrices = lacsolver.contact_matrices(uncut(mesh, slave), slave, "master")
        rim, free = _moving(matrices.mesh)
        without = constant(matrices, rim), constant(matrices, free)
    return Constants(*cut, inner, *without, unknowns)


@problem
def solve_constants(given: Skin, *, levels: int) -> Rows:
    """The constants on so many meshes: that of the cut skin stays above that of its internal dofs alone."""
    sides = SIDES[given.dim][:levels]
    found, h = [constants(given, n) for n in sides], [1 / n for n in sides]
    beta = [one.cut for one in found]
    floor = max(found[0].internal * (1 - NOTHING), NOTHING)
    reason = "what internal dofs alone give on the coarsest mesh, on finer ones they give more; less rounding"
    yield at_least("least beta, cut, rim fixed", min(beta), floor, source=_THEORY, reason=reason)
    if levels > 2:
        exponent = fitted(h, beta) if min(beta) > NOTHING else math.nan
        yield at_most(
            "beta, cut, rim fixed: exponent of h", exponent, STAYS, source=_THEORY, levels=_levels(h, found, beta),
            reason="0 is the theory's; a skin that is not stable loses an order of h or more",
        )  # fmt: skip
    if given.kind not in WHOLE:
        yield from _uncut(given, h, found)


def _uncut(given: Skin, h: Sequence[float], found: Sequence[Constants]) -> Rows:
    """The constant of the uncut skin is zero with a fixed rim; with a free one it is zero, or falls with h."""
    fixed, free = [one.uncut for one in found], [one.uncut_free for one in found]
    if given.kind not in ZERO or given.master:
        reason = "the hypothesis is sufficient, not necessary: it fails here, and this is what becomes of the constant"
        for rim, beta in (("fixed", fixed), ("free", free)):
            yield informative(f"beta, uncut, rim {rim}, finest", beta[-1], reason=reason)
        return
    source = "more faces than nodes that move, or a checkerboard that every node averages to zero"
    for rim, beta in (("fixed", fixed), ("free", free)):
        if rim == "fixed" or max(free) < NOTHING:
            name = f"beta, uncut, rim {rim}: largest"
            yield at_most(name, max(beta), NOTHING, source=source, reason="the root of rounding")
    if max(free) >= NOTHING and len(h) > 2:
        reason = "only the rim tells a checkerboard from zero: the constant falls by an order of h or more"
        name, levels = "beta, uncut, rim free: exponent of h", _levels(h, found, free)
        yield at_least(name, fitted(h, free), FALLS, source=source, reason=reason, levels=levels)


def _levels(h: Sequence[float], found: Sequence[Constants], beta: Sequence[float]) -> tuple[Level, ...]:
    """Convergence table of the constants; zeros, which have no rate, appear as the least number."""
    return levels_of(h, [one.unknowns for one in found], np.maximum(beta, np.finfo(float).tiny).tolist())


@problem
def solve_stars(given: Skin, *, levels: int) -> Rows:
    """The constant with macro = "stars", rim fixed, and over that of the cut, on so many meshes."""
    sides, slave = SIDES[given.dim][:levels], _slave(given.dim)
    beta: dict[str, list[float]] = {"stars": [], "cut": []}
    for mesh in (block_of(given, n) for n in sides):
        for macro, values in beta.items():
            matrices = lacsolver.contact_matrices(lacmesh.cut_skin(mesh, slave, macro=macro).mesh, slave, "master")
            values.append(constant(matrices, _moving(matrices.mesh)[0]))
    exponent, over = fitted([1 / n for n in sides], beta["stars"]), np.divide(beta["stars"], beta["cut"]).min()
    yield at_most("beta of stars, rim fixed: exponent of h", exponent, STAYS, source=_THEORY)
    yield at_least("beta of stars over that of the cut, least", over, 0.9, source="the same mesh, cut")


# ---- pressures


def exact_pressure(x: Floats) -> Floats:
    """Exact pressure (n, 1) at points (n, dim) in the middle of a band of half-height 1 under 1 + LOAD cos(pi x)."""
    a = np.pi
    amplitude = LOAD * (np.sinh(a) + a * np.cosh(a)) / (a + np.sinh(a) * np.cosh(a))
    return np.asarray(1 + amplitude * np.cos(np.pi * x[:, :1]))


def pressed(given: Pressed, n: int, *, cut: bool = True) -> Solved:
    """The block solved, n cells a side, its slave cut or each face a macro-element."""
    mesh, slave = block_of(given, n), _slave(given.dim)
    mesh = lacmesh.cut_skin(mesh, slave, hexa=given.hexa).mesh if cut else uncut(mesh, slave)
    down = np.abs(mesh.points[:, given.dim - 1]) < 1e-9
    rim = np.flatnonzero(~_moving(mesh)[0] & down & in_body(mesh))
    return solved(case_of(given), replace(mesh, node_groups={"rim": rim}))


def case_of(given: Pressed) -> str:
    """The pressed block's case."""
    axes = "xyz"[: given.dim]
    up = axes[-1]
    return case_text(
        model_of(given.dim),
        material(YOUNG, POISSON),
        entry("contact", name="foot", slave=f"{up}0", master="master"),
        entry("rigid", group="master"),
        *(fixed(f"{a}{end}", a) for a in axes[:-1] for end in "01"),
        fixed("rim", up),
        entry("pressure", group=f"{up}1", value=f"1 + {LOAD} * cos(pi * x)"),
        entry("solver", threads=1),
    )


def over_best(got: Solved) -> float:
    """The error of p_m in L2, over that of the best constants: the means of the exact pressure."""
    errors = pressure_errors(got.mesh, got.zone.pressure, exact_pressure)
    return errors.exact / errors.best


@problem
def solve_pressed(given: Pressed, *, levels: int) -> Rows:
    """The pressed block on so many meshes."""
    both = [(pressed(given, n), pressed(given, n, cut=False)) for n in PRESSED[given.dim][:levels]]
    with_, without = ([over_best(pair[k]) for pair in both] for k in (0, 1))
    worst = int(np.argmax(without))
    yield at_most(
        "error of p_m over that of the best, cut", max(with_), QUASI_OPTIMAL, source=_THEORY,
        reason="a stable pair is quasi-optimal (Cea's lemma); the constant is taken as 2",
    )  # fmt: skip
    yield at_least(
        "error of p_m over that of the best, uncut over cut", without[worst] / with_[worst], OSCILLATES,
        source=_THEORY, reason="the worst of the meshes: how much there is to oscillate is chance on each of them",
    )  # fmt: skip
    yield informative("error of p_m over that of the best, uncut", without[worst], reason="how far p_m oscillates")
    yield from balanced([got for pair in both for got in pair])
    if given.dim == 3:
        for got, name in zip(both[worst], ("cut", "uncut"), strict=True):
            yield got.picture(f"{given.kind}, {name}")


# ---- cases

#: those that `quick` has too
_QUICK = ("TRIA3", "QUAD4", "TETRA4", "HEXA8", "HEXA8-hexa", "HEXA20")


def _cases() -> Iterator[Case]:
    def skin(name: str, given: Skin) -> Case:
        cut = f", cut {given.hexa}" if given.kind in stacks.TWO_WAYS else ""
        on = f" on a block of {given.master}" if given.master else ""
        words = f"{given.kind}{cut}{on}: beta against h, cut and uncut"
        suites = {"full": 5, "seconds": 3.0} if given.dim == 2 else {"full": 4, "every": 5}
        return row("inf-sup", name, words, solve_constants, given, quick=3 * (name in _QUICK), **suites)

    for dim, kinds in ((2, stacks.PLANE_KINDS), (3, stacks.SOLID_KINDS)):
        for kind in kinds:
            name = kind.replace("mixed", f"mixed {dim}D").replace(" ", "-")
            yield skin(name, Skin(kind, dim))
            if kind in stacks.TWO_WAYS:
                yield skin(f"{name}-hexa", Skin(kind, dim, "hexa"))
    for kind, dim in (("TRIA3", 2), ("QUAD4", 2), *((kind, 3) for kind in ("TETRA4", "HEXA8", "TETRA10", "mixed 1"))):
        name, words = f"{kind.replace(' ', '-')}-stars", f"stars of {kind}: beta against h"
        yield row("inf-sup", name, words, solve_stars, Skin(kind, dim), quick=3, full=4, seconds=2.0)
    yield skin("TRIA3-on-QUAD4", Skin("TRIA3", 2, master="QUAD4"))
    yield skin("HEXA8-on-TETRA4", Skin("HEXA8", 3, master="TETRA4"))
    for kind, dim in (("TRIA3", 2), ("QUAD4", 2), ("TETRA4", 3), ("HEXA8", 3)):
        yield row(
            "inf-sup", f"pressed-{kind}", f"{kind} pressed on a rigid plane, nodes moved at random: p_m, cut and uncut",
            solve_pressed, Pressed(kind, dim), quick=2 * (kind == "TRIA3"), full=3, seconds=3.0 if dim == 2 else 8.0,
        )  # fmt: skip


FAMILY = Family("inf-sup", "Inf-sup condition", __doc__.partition("\n\n")[2], tuple(_cases()))
