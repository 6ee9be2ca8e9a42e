"""**Inf-sup.** The constant of (p, t) and of t alone beside that of p, on the blocks of the family `inf-sup`: the cut
that is stable for pressures is stable for tractions with as many components as the space has, since normal and tangents
are at right angles; on plane skins, and on curved ones of both bodies, whose faces do not match.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack
from scipy.sparse.linalg import splu

import lacmesh
from lacsolver.contact import Pairing, Zone, integrate
from verification.families.inf_sup import SIDES, STAYS, Skin, block_of
from verification.measures.inf_sup import held, norm
from verification.measures.rates import fitted
from verification.meshes import stacks
from verification.meshes.blocks import bent
from verification.records import Case, Level, Outcome, Result, at_most, informative, levels_of

Floats = NDArray[np.floating]

#: of the constant of t and of (p, t), the difference from that of p, of it
SAME = 0.02
#: rise of curved skins, whose sides are 1 long
CURVED = 0.15
_THEORY = "v = sum of h psi_m (p_m n + t_m e): normal and tangents are at right angles"
_NAMES = ("p", "t", "both")


def constants(skin: Skin, rise: float, n: int) -> tuple[dict[str, float], int]:
    """beta of p, t and both, the slave's rim fixed; number of free unknowns."""
    dim = skin.dim
    slave = f"{'xyz'[dim - 1]}0"
    mesh = lacmesh.cut_skin(bent(block_of(skin, n), lambda x: _risen(x, rise, dim)), slave, hexa=skin.hexa).mesh
    face = integrate(Zone.of(mesh, slave, "master"), dim, Pairing(friction=True))
    x = mesh.points[:, :dim]
    sides = ((x[:, :-1] < 1e-9) | (x[:, :-1] > 1 - 1e-9)).any(axis=1)
    ends = (x[:, -1] > 1 - 1e-9) | (x[:, -1] < -1 + 1e-9)
    moving = np.flatnonzero(~sides & ~ends & held(mesh))
    solve = splu(norm(mesh)[moving][:, moving], permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve
    weight = face.area ** (-0.5 * dim / (dim - 1))
    rows = {"p": face.B, "t": face.B_T, "both": vstack([face.B, face.B_T])}
    weights = {
        "p": weight,
        "t": np.repeat(weight, dim - 1),
        "both": np.concatenate([weight, np.repeat(weight, dim - 1)]),
    }
    constants_of = {name: _least(csr_array(B), moving, dim, solve, weights[name]) for name, B in rows.items()}
    return constants_of, dim * len(moving)


def _risen(x: Floats, rise: float, dim: int) -> Floats:
    """Points (n, 3) of blocks at heights from -1 to 1, with a curved skin at height 0; their other sides stay flat."""
    plane, height = x[:, : dim - 1], x[:, dim - 1]
    bubble = np.prod(4 * plane * (1 - plane), axis=1) * (1 - np.abs(height))
    return np.asarray(x + rise * bubble[:, None] * np.eye(3)[dim - 1])


def _least(B: csr_array, moving: NDArray[np.integer], dim: int, solve: object, weight: Floats) -> float:
    S = np.zeros((B.shape[0],) * 2)
    for axis in range(dim):
        own = B[:, dim * moving + axis]
        S += own @ solve(own.toarray().T)  # type: ignore[operator]
    return float(np.sqrt(max(np.linalg.eigvalsh(weight[:, None] * S * weight)[0], 0.0)))


def solve_case(skin: Skin, rise: float = 0.0, *, levels: int) -> Outcome:
    """A block on a fixed plane or another block, as `inf_sup.Skin`. `rise`: of the skins' middle over their rim. The
    constants on so many meshes.
    """
    sides = SIDES[skin.dim][:levels]
    constants_of = [constants(skin, rise, n) for n in sides]
    h, unknowns = [1 / n for n in sides], [count for _, count in constants_of]
    table = {name: levels_of(h, unknowns, [own[name] for own, _ in constants_of]) for name in _NAMES}
    apart = [max(abs(own[name] / own["p"] - 1) for name in ("t", "both")) for own, _ in constants_of]
    name, on = "largest difference of the constants, of that of p", levels_of(h, unknowns, apart)
    if rise:
        same = informative(f"{name}, finest mesh", apart[-1], reason="faces meet at angles, which fall", levels=on)
    else:
        same = at_most(name, max(apart), SAME, source=_THEORY)
    return Outcome((*(_stays(name, table[name]) for name in _NAMES), same))


def _stays(name: str, table: tuple[Level, ...]) -> Result:
    """The exponent of h of a constant: 0."""
    quantity = {"p": "beta of p", "t": "beta of t", "both": "beta of (p, t)"}[name]
    if len(table) < 3:
        return informative(quantity, table[-1].error, reason="an exponent takes three levels", levels=table)
    exponent = fitted([level.h for level in table], [level.error for level in table], 3)
    return at_most(f"{quantity}, exponent of h", exponent, STAYS, source=_THEORY, levels=table)


def cases(family: str) -> Iterator[Case]:
    """Every kind of cell, and a few on another block, also with curved skins."""
    for dim, kinds in ((2, stacks.PLANE_KINDS), (3, stacks.SOLID_KINDS)):
        for kind in kinds:
            name = kind.replace("mixed", f"mixed {dim}D").replace(" ", "-")
            levels = {"full": 4 if dim == 2 else 3} | ({"quick": 3} if kind in ("TRIA3", "TETRA4") else {})
            solve = partial(solve_case, Skin(kind, dim))
            yield Case(family, f"inf-sup-{name}", f"{kind}: beta of p, t and both", solve, levels, 4.0)
    for slave, master, dim in (("TRIA3", "QUAD4", 2), ("HEXA8", "TETRA4", 3)):
        given = partial(solve_case, Skin(slave, dim, master=master))
        yield Case(family, f"inf-sup-{slave}-on-{master}", f"{slave} on a block of {master}", given, {"full": 3}, 4.0)
    for kind, dim in (
        ("TRIA3", 2),
        ("QUAD4", 2),
        ("TRIA6", 2),
        ("QUAD8", 2),
        ("TETRA4", 3),
        ("HEXA8", 3),
        ("HEXA20", 3),
    ):
        given = partial(solve_case, Skin(kind, dim, master=kind), CURVED)
        description = f"{kind}: both skins are curved, and do not match"
        levels = {"full": 4 if dim == 2 else 3} | ({"quick": 3} if kind == "QUAD4" else {})
        yield Case(family, f"inf-sup-curved-{kind}", description, given, levels, 5.0)
