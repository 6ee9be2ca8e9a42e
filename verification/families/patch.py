"""The patch test of contact: a uniform pressure goes through an interface whose faces do not match.

Two unit blocks on one another under a uniform pressure: the stress is uniform, uniaxial (in plane strain with the
stress that holds the plane), the displacement linear by Hooke's law, every p_m the pressure. A method passes only if it
integrates the contact terms over the true intersections of the two skins (Taylor, Papadopoulos, On a patch test for
contact problems in two dimensions, in: Wriggers, Wagner (eds.), Nonlinear Computational Mechanics, Springer, 1991).

Every type of cell is the slave and the master of every other, below and above, along the axes and in a tilted frame;
the grids are uneven, and in some cases the faces are distorted quadrangles. Errors are the largest anywhere: of the
stress at integration points, of the pressure of each macro-element, of the displacement of each node, relative to the
largest value of each. What others obtained stands beside where they ran the same problem.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from lacsolver.results.fields import point_stress
from verification.meshes.stacks import PLANE_KINDS, SOLID_KINDS, TWO_WAYS, moved, stack, tilt
from verification.records import Case, Family, Published, Result, Rows, at_most, problem, row
from verification.solving import Solved, balanced, case_text, entry, material, solve

Floats = NDArray[np.floating]
Pairs = tuple[tuple[str, str], ...]

#: of every error, relative
EXACT = 1e-10
YOUNG, POISSON, PRESSURE = 1e3, 0.3, 1.0
#: measured quantities, whose errors are relative
STRESS, PRESSURES, DISPLACEMENT = "stress at integration points", "contact pressure p_m", "displacement"

_SOURCE = "uniform stress, linear displacement; Taylor, Papadopoulos, 1991"
#: components of a stress, as pairs of axes
_AXES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
#: sides that slide, by model: symmetry planes, or the axis; a ring has none
_SLIDING = {"3d": ("x0", "y0"), "ring": ()}


@dataclass(frozen=True)
class Press:
    """Stacks of two blocks, the slave below and above, each under a pressure on its top.

    `pairs`: kinds of slave and master; `model`: a model of a case, or `ring`, axisymmetric without its axis;
    `contact`: keys of [[contact]], or of `joint`; `tilted`: in a frame that is turned; others: as `stack` takes them.
    """

    pairs: Pairs
    model: str = "3d"
    tilted: bool = False
    contact: Pairs = ()
    counts: tuple[int, int] = (3, 2)
    bend: float = 0.3
    skew: float = 0.0
    joint: str = "contact"

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return 3 if self.model == "3d" else 2

    @property
    def turn(self) -> Floats:
        """Rotation (3, 3) of the frame."""
        return tilt(self.dim) if self.tilted else np.eye(3)


class StackErrors(NamedTuple):
    """Largest relative errors of one stack, by quantity: stress, p_m, displacement at nodes."""

    label: str
    errors: dict[str, float]
    solved: Solved


def errors(given: Press, slave: str, master: str, slave_below: bool) -> StackErrors:
    """Solve one stack. Raises what `verification.solving.solve` raises."""
    solved = solve(text(given), mesh_of(given, slave, master, slave_below))
    sigma = np.concatenate([s.reshape(-1, s.shape[-1]) for s in point_stress(solved.problem, solved.state)])
    exact = exact_displacement(given, solved.mesh.points)
    largest = {
        STRESS: float(np.abs(sigma - exact_stress(given)[: sigma.shape[1]]).max() / PRESSURE),
        PRESSURES: float(np.abs(solved.zone.pressure / PRESSURE - 1).max()),
        DISPLACEMENT: float(np.abs(solved.u - exact).max() / np.abs(exact).max()),
    }
    return StackErrors(f"{slave} {'under' if slave_below else 'on'} {master}", largest, solved)


def mesh_of(given: Press, slave: str, master: str, slave_below: bool = True) -> Mesh:
    """A stack of blocks, not cut."""
    mesh = stack(
        slave, master, given.dim, slave_below=slave_below, counts=given.counts, bend=given.bend, skew=given.skew
    )
    return moved(mesh, given.turn, np.array([1.0, 0, 0]) if given.model == "ring" else None)


def text(given: Press) -> str:
    """The case of every stack, as TOML. In a tilted frame symmetry planes hold the normal displacement."""
    up = "xyz"[given.dim - 1]
    supports = [(side, side[0]) for side in _SLIDING.get(given.model, ("x0",))] + [("bottom", up)]
    return case_text(
        "axisymmetric" if given.model == "ring" else given.model,
        entry("solver", threads=1),
        material(YOUNG, POISSON),
        entry(given.joint, slave="slave", master="master", **dict(given.contact)),
        *(entry("displacement", group=name, **{"un" if given.tilted else f"u{a}": 0.0}) for name, a in supports),
        entry("pressure", group="top", value=PRESSURE),
    )


def exact_displacement(given: Press, points: Floats) -> Floats:
    """Exact displacement (n, dim) at points (n, 3): linear from the corner, or axis, that does not move."""
    e = PRESSURE / YOUNG
    across, down = POISSON * e, -e
    if given.model == "plane_strain":
        across, down = POISSON * (1 + POISSON) * e, -(1 - POISSON**2) * e
    strains = np.array([across, across, down] if given.dim == 3 else [across, down, 0.0])
    return np.asarray((points @ given.turn * strains) @ given.turn.T[:, : given.dim])


def exact_stress(given: Press) -> Floats:
    """Exact stress (6,): xx, yy, zz, xy, yz, xz."""
    sigma = np.zeros((3, 3))
    sigma[given.dim - 1, given.dim - 1] = -PRESSURE
    if given.model == "plane_strain":
        sigma[2, 2] = -POISSON * PRESSURE
    sigma = given.turn @ sigma @ given.turn.T
    return np.array([sigma[a, b] for a, b in _AXES])


@problem
def run(given: Press) -> Rows:
    """Solve every pair, with the slave below and above."""
    stacks = [errors(given, *pair, below) for pair in given.pairs for below in (True, False)]
    published = _published(given)
    yield from (worst(quantity, stacks, published.get(quantity, ())) for quantity in stacks[0].errors)
    yield from balanced([one.solved for one in stacks])


def worst(quantity: str, stacks: Sequence[StackErrors], published: tuple[Published, ...] = ()) -> Result:
    """The largest error of all stacks; NaN above all."""
    errors = np.array([one.errors[quantity] for one in stacks])
    k = int(np.where(np.isnan(errors), np.inf, errors).argmax())
    reason = f"rounding, times the condition of the stiffness; worst of {len(stacks)}: {stacks[k].label}"
    return at_most(quantity, errors[k], EXACT, source=_SOURCE, reason=reason, published=published)


def _published(given: Press) -> dict[str, tuple[Published, ...]]:
    """Errors of other codes on hexahedra, by quantity; they used the same meshes, without a bend."""
    if given.bend or given.model != "3d" or given.pairs[0] != ("HEXA8", "HEXA8"):
        return {}
    hexa, peers = dict(given.contact)["hexa"], "measured on the same meshes, frictionless, small strain"
    aster = _ASTER[hexa, given.skew]
    return {
        STRESS: tuple(Published(who, both[given.skew], peers) for who, both in _STRESS.items() if given.skew in both),
        PRESSURES: (Published(f"code_aster LAC, {hexa}", aster, "code_aster 2020, measured on the same meshes"),),
    }


#: code -> skew -> largest error of the axial stress at integration points; 3x3x2 under 2x2x2, and 5x5x2 under 4x4x2
_STRESS: dict[str, dict[float, float]] = {
    "Kratos 10.4, dual mortar": {0.0: 2.4e-13, 0.05: 3.8e-5},
    "CalculiX 2.20, surface to surface": {0.0: 1.5e-10, 0.05: 3.4e-6},
    "CalculiX 2.20, mortar (printed digits)": {0.0: 1e-7},
    "CalculiX 2.20, mortar": {0.05: 3.4e-6},
    "NGSolve, contact energy": {0.0: 1.5e-4, 0.05: 6.8e-5},
    "GetFEM 5.4, integral": {0.0: 2.7e-2, 0.05: 2.7e-2},
    "Kratos 10.4, penalty mortar": {0.0: 8.1e-3, 0.05: 2.1e-2},
    "CalculiX 2.20, node to surface": {0.0: 0.41, 0.05: 0.17},
    "GetFEM 5.4, node to surface": {0.0: 0.57, 0.05: 0.20},
}
#: (cut, skew) -> largest error of the contact pressure
_ASTER = {
    ("hexa", 0.0): 1.2e-13, ("pyramid", 0.0): 3.5e-13, ("hexa", 0.05): 1.2e-9, ("pyramid", 0.05): 2.2e-9,
    ("hexa", 0.2): 5.5e-3, ("pyramid", 0.2): 1.1e-8,
}  # fmt: skip

#: pairs that stand for all, where something else than the cells varies
_FEW: dict[int, Pairs] = {
    2: (("TRIA3", "QUAD8"), ("QUAD4", "TRIA7"), ("QUAD9", "mixed 1"), ("TRIA6", "TRIA3"), ("mixed 2", "QUAD9")),
    3: (("HEXA8", "TETRA4"), ("TETRA10", "HEXA20"), ("PENTA15 quadrangle", "HEXA27"), ("mixed 2", "mixed 1")),
}
#: keys of [[contact]] that must not change anything between plane faces
_KEYS: dict[str, Pairs] = {
    "smoothed": (("normals", "smoothed"),),
    "bilateral": (("type", "bilateral"),),
    "open-at-first": (("initial", "none"),),
    "current": (("geometry", "current"),),
    "current-smoothed": (("geometry", "current"), ("normals", "smoothed")),
}
#: slaves in the quick suite, in 3D, along the axes and tilted
_QUICK = {("TETRA10", "", False), ("HEXA8", "hexa", False), ("mixed 2", "", True)}
#: slaves whose faces are quadrangles: words of the case's name, kinds, keys of [[contact]]
_QUADRANGLES: tuple[tuple[str, tuple[str, ...], Pairs], ...] = (
    ("HEXA20-pyramid", ("HEXA20",), (("hexa", "pyramid"),)),
    ("HEXA20-hexa", ("HEXA20",), (("hexa", "hexa"),)),
    ("others", ("HEXA27", *(f"{name} quadrangle" for name in ("PENTA6", "PENTA15", "PYRAM5", "PYRAM14"))), ()),
)


def _every(slaves: Iterable[str], masters: Iterable[str]) -> Pairs:
    return tuple((slave, master) for slave in slaves for master in masters)


def _cases() -> Iterator[Case]:
    def case(name: str, description: str, given: Press, seconds: float, quick: bool = False) -> Case:
        name = name.replace(" ", "-")
        return row("patch", name, description, run, given, quick=int(quick), full=1, seconds=seconds)

    plane = partial(Press, model="plane_strain")
    for slave in PLANE_KINDS:
        given = plane(_every([slave], PLANE_KINDS))
        yield case(f"2d-{slave}", f"plane strain, slave {slave} against every kind", given, 3.0, True)
    given = plane(_every(PLANE_KINDS, PLANE_KINDS), tilted=True)
    yield case("2d-tilted", "plane strain, every kind against every kind, tilted", given, 10.0)
    for tilted, slave in product((False, True), SOLID_KINDS):
        for way in ("pyramid", "hexa") if slave in TWO_WAYS else ("",):
            given = Press(_every([slave], SOLID_KINDS), tilted=tilted, contact=(("hexa", way),) if way else ())
            name = "-".join(["3d", *["tilted"] * tilted, slave, *[way] * bool(way)])
            yield case(name, f"slave {slave} against every kind", given, 7.0, (slave, way, tilted) in _QUICK)
    for skew, counts in ((0.0, (3, 2)), (0.05, (5, 4)), (0.2, (5, 4))):
        for way in ("pyramid", "hexa"):
            given = Press((("HEXA8", "HEXA8"),), contact=(("hexa", way),), counts=counts, bend=0.0, skew=skew)
            description = f"hexahedra on hexahedra, cut {way}, skew {skew}: the peers' problem"
            yield case(f"peers-{way}-skew-{skew}", description, given, 4.0, skew == 0.2)
        for words, slaves, keys in _QUADRANGLES if skew else ():
            given = Press(_every(slaves, ("HEXA8", "HEXA20")), "3d", True, keys, counts, skew=skew)
            description = f"distorted quadrangles, slaves {', '.join(slaves)}, skew {skew}"
            yield case(f"distorted-{words}-skew-{skew}", description, given, 5.0)
    for model in ("plane_stress", "axisymmetric", "ring"):
        description = f"a few pairs, {model.replace('_', ' ')}"
        yield case(model, description, Press(_FEW[2], model), 3.0, model != "ring")
    for (name, keys), (dim, model) in product(_KEYS.items(), ((2, "plane_strain"), (3, "3d"))):
        description = f"a few pairs in {dim}D, {', '.join(f'{key} = {value}' for key, value in keys)}"
        yield case(f"{name}-{dim}d", description, Press(_FEW[dim], model, dim == 3, keys), 4.0)
    # macro-elements of whole faces; faces of QUAD8, and those that no star reaches, are cut
    for (model, kinds), joint in product((("plane_strain", PLANE_KINDS), ("3d", SOLID_KINDS)), ("contact", "tie")):
        given = Press(_every(kinds, kinds), model, contact=(("macro", "stars"),), joint=joint)
        yield case(f"stars-{joint}-{given.dim}d", f"stars, {joint}: every pair of kinds", given, 120.0)


FAMILY = Family("patch", "Patch test", __doc__.partition("\n\n")[2], tuple(_cases()))
