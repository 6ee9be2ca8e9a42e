"""Balance of the contact forces on slave and master, in problems that are hard on it.

What the slave gets the master gives. The forces of both sides come from one rule, at the same points and along the same
normal, so their resultant vanishes to rounding, however curved, warped or partly covered the skins are; so does their
moment, since a slave point and its image on the master lie on the normal that the pressure acts along. (The jump of a
tie has the moment arm of the gap in it.)

Here skins are curved, warped, overhanging or rigid, non-matching and distorted, with facet and smoothed normals, on the
undeformed and on the deformed bodies, under small and finite kinematics, with unilateral and bilateral contact, ties
and several zones. Every other case with contact of this report has the same two results. They are relative to the sum
of the sizes of the forces, and of the forces times their arms; in axisymmetry radial forces and moments balance all
round, and the axial resultant alone is given.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from verification.meshes.blocks import bent, joined, nodes_of
from verification.meshes.stacks import LAYERS, block, moved, stack, tower
from verification.records import Case, Family, Rows, at_least, problem, row
from verification.solving import balanced, case_text, entry, fixed, solve

Floats = NDArray[np.floating]
CellPairs = tuple[tuple[str, str], ...]
Keys = tuple[tuple[str, object], ...]

YOUNG, POISSON = 1e3, 0.3
#: how far the top comes down, and goes aside
_DOWN, _ASIDE = -0.1, 0.04
#: how far the rigid master turns, in radians: in a plane, in space
_TURN = {2: 0.1, 3: (0.06, 0.1, 0.2)}
#: of what bends the blocks: waves across, or a saddle
_WAVE, _SADDLE = 0.1, 0.6
#: shape -> widths of the lower and of the upper block
_WIDTHS = {"waves": (1.0, 1.0), "saddle": (0.8, 1.0), "overhang": (1.0, 0.62), "tucked": (0.7, 1.0)}


@dataclass(frozen=True)
class Touch:
    """Two bodies pressed on one another, and sheared, by a displacement of the top.

    `pairs`: kinds of slave and master, a problem each. `shape`: `waves`; `saddle`: warped quadrangles; `overhang`: the
    slave is wider than its master, `tucked`: narrower; `tower`: three blocks, two zones; `rigid`: the master is a bare
    skin that moves and turns. `joint`: `contact` or `tie`, with its keys; `gap`: between the undeformed bodies.
    """

    pairs: CellPairs
    model: str
    shape: str
    keys: Keys = ()
    kinematics: str = "small"
    joint: str = "contact"
    gap: float = 0.0
    steps: int = 1

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return 3 if self.model == "3d" else 2


def mesh_of(given: Touch, slave: str, master: str) -> Mesh:
    """The blocks, not cut; they are at x >= 1 where that is the radius."""
    mesh = _placed(given, slave, master)
    up = given.dim - 1

    def where(x: Floats) -> Floats:
        height = _WAVE * np.sin(2.1 * x[:, :up].sum(axis=1))
        if given.shape == "saddle":
            height = _SADDLE * (x[:, 0] - 0.5) * (x[:, 1] - 0.5)
        return np.asarray(x + height[:, None] * np.eye(3)[up] + [float(given.model == "axisymmetric"), 0, 0])

    return bent(mesh, where)


def text(given: Touch) -> str:
    """The case of every pair, as TOML."""
    axes = "xyz"[: given.dim]
    law = "elastic" if given.kinematics == "small" else "neo_hookean"
    zones = ("1", "2") if given.shape == "tower" else ("",)
    down = {"ux": _ASIDE, f"u{axes[-1]}": _DOWN - given.gap}
    top = {f"u{a}": down.get(f"u{a}", 0.0) for a in axes}
    if given.model == "axisymmetric":
        top.pop("ux")
    if given.shape == "tower":  # nothing but contact holds the middle block otherwise, and it would slip out
        top["ux"] = 0.0
    return case_text(
        given.model,
        entry("solver", threads=1),
        entry("material", law=law, young=YOUNG, poisson=POISSON),
        *(fixed(f"{a}0", a) for a in "xy" if given.shape == "tower"),
        *(entry(given.joint, slave=f"slave{k}", master=f"master{k}", **dict(given.keys)) for k in zones),
        fixed("bottom", axes),
        entry("rigid", group="master", **down, rotation=_TURN[given.dim])
        if given.shape == "rigid"
        else entry("displacement", group="top", **top),
        entry("steps", count=given.steps),
        kinematics=given.kinematics,
    )


@problem
def run(given: Touch) -> Rows:
    """Solve every pair."""
    solutions = [solve(text(given), mesh_of(given, *pair)) for pair in given.pairs]
    yield from balanced(solutions)
    closed = min(int((np.abs(zone.pressure) > 0).sum()) for solved in solutions for zone in solved.state.zones)
    reason = "balance means something only where forces are"
    yield at_least("macro-elements in contact, the least of all pairs", closed, 1, source="the load", reason=reason)


def _placed(given: Touch, slave: str, master: str) -> Mesh:
    """Mesh of the blocks before they are bent."""
    if given.shape == "tower":
        return tower((slave, master, slave), (2, 3, 2))
    up = given.dim - 1
    if given.shape == "rigid":
        axis = "xyz"[up]
        lower, upper = (block(kind, (*(n,) * up, LAYERS), skew=0.05) for kind, n in ((slave, 3), (master, 2)))
        face = moved(upper, shift=np.eye(3)[up]).only(f"{axis}0")
        return joined([(lower, {f"{axis}0": "bottom", f"{axis}1": "slave"}), (face, {f"{axis}0": "master"})])
    mesh = stack(slave, master, given.dim, counts=(3, 2), gap=given.gap, bend=0.2, skew=0.05)
    x = mesh.points.copy()
    for name, width in zip(("lower", "upper"), _WIDTHS[given.shape], strict=True):
        own = nodes_of(mesh, name)
        x[own, :up] = 0.5 + width * (x[own, :up] - 0.5)
    return bent(mesh, lambda _: x)


_PLANE: CellPairs = (
    ("TRIA3", "QUAD8"), ("QUAD4", "TRIA6"), ("TRIA6", "QUAD4"), ("QUAD9", "QUAD8"), ("mixed 1", "mixed 2"),
)  # fmt: skip
_SOLID: CellPairs = (
    ("TETRA4", "HEXA8"), ("HEXA8", "TETRA10"), ("TETRA10", "HEXA20"), ("HEXA20", "PENTA6 triangle"),
    ("HEXA27", "PYRAM5 quadrangle"), ("PENTA15 quadrangle", "HEXA27"), ("PYRAM13 triangle", "TETRA4"),
    ("PENTA18 triangle", "HEXA8"), ("mixed 2", "mixed 1"),
)  # fmt: skip
_FEW: CellPairs = (("HEXA8", "TETRA4"), ("TETRA4", "HEXA20"), ("PENTA15 quadrangle", "HEXA8"))
#: name -> keys of the contact
_NORMALS: dict[str, Keys] = {"facet": (("normals", "facet"),), "smoothed": (("normals", "smoothed"),)}
_CURRENT: Keys = (("geometry", "current"),)


def _case(name: str, description: str, given: Touch, seconds: float = 4.0, quick: bool = False) -> Case:
    dim = "axisymmetric" if given.model == "axisymmetric" else f"{given.dim}d"
    words = f"{description}, {dim}"
    return row("balance", f"{name}-{dim}", words, run, given, quick=int(quick), full=1, seconds=seconds)


def _of_model(model: str, pairs: CellPairs) -> Iterator[Case]:
    """Cases that are the same in the plane, about an axis and in space."""
    few, solid = pairs[:3] if model != "3d" else _FEW, model == "3d"
    for name, keys in _NORMALS.items():
        words, waves = f"interface in waves, {name} normals", f"waves-{name}"
        yield _case(waves, words, Touch(pairs, model, "waves", keys), 6.0, model == "plane_strain")
        now = Touch(few, model, "waves", keys + _CURRENT)
        yield _case(f"{waves}-current", f"{words}, geometry current", now, 4.0, solid)
        finite = Touch(few, model, "waves", keys, "finite", steps=2)
        yield _case(f"{waves}-finite", f"{words}, finite kinematics", finite, 12.0)
    for shape, words in (("overhang", "the slave reaches over the master's rim"), ("tucked", "a wider master")):
        yield _case(shape, words, Touch(few, model, shape), 2.0, solid and shape == "overhang")
        yield _case(f"{shape}-finite", f"{words}, finite", Touch(few, model, shape, (), "finite", steps=2), 8.0)
    both = Touch(few, model, "waves", (("type", "bilateral"),))
    yield _case("bilateral", "pressure of either sign", both, 2.0)
    for name, words, gap in (("tie", "a tie", 0.0), ("tie-gap", "a tie across a gap", 0.07)):
        yield _case(name, words, Touch(few, model, "waves", joint="tie", gap=gap), 2.0, solid and gap > 0)


def _cases() -> Iterator[Case]:
    for model, pairs in (("plane_strain", _PLANE), ("axisymmetric", _PLANE), ("3d", _SOLID)):
        yield from _of_model(model, pairs)
    for name, keys in _NORMALS.items():
        curved = Touch((("TETRA10", "HEXA20"),), "3d", "waves", keys + _CURRENT)
        words = f"curved faces on curved faces, {name} normals, geometry current"
        yield _case(f"curved-{name}-current", words, curved, 15.0)
    for model, on in (("plane_strain", _PLANE[:2]), ("3d", _FEW)):
        for kinematics, steps in (("small", 1), ("finite", 2)):
            words = f"a rigid skin that comes down and turns, {kinematics} kinematics"
            given = Touch(on, model, "rigid", (), kinematics, steps=steps)
            yield _case(f"rigid-{kinematics}", words, given, 4.0, kinematics == "small" and model == "3d")
    for name, hexa in (("pyramid", ()), ("hexa", (("hexa", "hexa"),))):
        warped = Touch((("HEXA8", "HEXA8"), ("HEXA20", "HEXA8"), ("HEXA8", "HEXA27")), "3d", "saddle", hexa)
        yield _case(f"warped-{name}", f"quadrangles that are not plane, cut {name}", warped, 3.0, name == "hexa")
    for kinematics in ("small", "finite"):
        three = Touch((("HEXA8", "TETRA4"), ("PENTA6 quadrangle", "HEXA20")), "3d", "tower", (), kinematics)
        yield _case(f"tower-{kinematics}", f"three blocks, two zones, {kinematics} kinematics", three, 5.0)


FAMILY = Family("balance", "Balance of forces", __doc__.partition("\n\n")[2], tuple(_cases()))
