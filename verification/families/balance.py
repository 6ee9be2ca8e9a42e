"""Balance of the contact forces on slave and master, in problems that are hard on it.

Exact: action and reaction. The forces of both sides come from one rule, at the same points and along the same normal,
so their resultant vanishes to rounding, however curved, warped or partly covered the skins are; so does their moment,
since a slave point and its image on the master lie on the normal that the pressure acts along. (The jump of a tie has
the moment_arm of the gap in it.)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from verification.meshes.blocks import bent, joined, nodes_of
from verification.meshes.stacks import LAYERS, block, moved, skin, stack, tower
from verification.records import Case, Family, Outcome, at_least
from verification.solving import Solved, balanced, case_text, entry, solve

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

    pairs: tuple[tuple[str, str], ...]
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
        *(entry("displacement", group=f"{a}0", **{f"u{a}": 0.0}) for a in "xy" if given.shape == "tower"),
        *(entry(given.joint, slave=f"slave{k}", master=f"master{k}", **dict(given.keys)) for k in zones),
        entry("displacement", group="bottom", **{f"u{a}": 0.0 for a in axes}),
        entry("rigid", group="master", **down, rotation=_TURN[given.dim])
        if given.shape == "rigid"
        else entry("displacement", group="top", **top),
        entry("steps", count=given.steps),
        kinematics=given.kinematics,
    )


def run(given: Touch, *, levels: int) -> Outcome:
    """Solve every pair."""
    solutions = [solve(text(given), mesh_of(given, *pair)) for pair in given.pairs]
    closed = min(_closed(solved) for solved in solutions)
    reason = "balance means something only where forces are"
    pressed = at_least("macro-elements in contact, the least of all pairs", closed, 1, source="the load", reason=reason)
    return Outcome((*balanced(solutions), pressed))


def _placed(given: Touch, slave: str, master: str) -> Mesh:
    """Mesh of the blocks before they are bent."""
    if given.shape == "tower":
        return tower((slave, master, slave), (2, 3, 2))
    up = given.dim - 1
    if given.shape == "rigid":
        axis = "xyz"[up]
        lower, upper = (block(kind, (*(n,) * up, LAYERS), skew=0.05) for kind, n in ((slave, 3), (master, 2)))
        face = skin(moved(upper, shift=np.eye(3)[up]), f"{axis}0")
        return joined([(lower, {f"{axis}0": "bottom", f"{axis}1": "slave"}), (face, {f"{axis}0": "master"})])
    mesh = stack(slave, master, given.dim, counts=(3, 2), gap=given.gap, bend=0.2, skew=0.05)
    x = mesh.points.copy()
    for name, width in zip(("lower", "upper"), _WIDTHS[given.shape], strict=True):
        own = nodes_of(mesh, name)
        x[own, :up] = 0.5 + width * (x[own, :up] - 0.5)
    return bent(mesh, lambda _: x)


def _closed(solved: Solved) -> int:
    """Number of macro-elements with a pressure, in the zone that has the fewest."""
    return min(int((np.abs(zone.pressure) > 0).sum()) for zone in solved.state.zones)


_PLANE: CellPairs = (
    ("TRIA3", "QUAD8"),
    ("QUAD4", "TRIA6"),
    ("TRIA6", "QUAD4"),
    ("QUAD9", "QUAD8"),
    ("mixed 1", "mixed 2"),
)
_SOLID: CellPairs = (
    *(("TETRA4", "HEXA8"), ("HEXA8", "TETRA10"), ("TETRA10", "HEXA20"), ("HEXA20", "PENTA6 triangle")),
    *(("HEXA27", "PYRAM5 quadrangle"), ("PENTA15 quadrangle", "HEXA27"), ("PYRAM13 triangle", "TETRA4")),
    *(("PENTA18 triangle", "HEXA8"), ("mixed 2", "mixed 1")),
)
_FEW: CellPairs = (("HEXA8", "TETRA4"), ("TETRA4", "HEXA20"), ("PENTA15 quadrangle", "HEXA8"))
_FACET: Keys = (("normals", "facet"),)
_SMOOTHED: Keys = (("normals", "smoothed"),)
_CURRENT: Keys = (("geometry", "current"),)
_HEXA: Keys = (("hexa", "hexa"),)
_BOTH: Keys = (("type", "bilateral"),)


def _case(name: str, description: str, given: Touch, seconds: float = 4.0, quick: bool = False) -> Case:
    dim = "axisymmetric" if given.model == "axisymmetric" else f"{given.dim}d"
    levels = {"quick" if quick else "full": 1}
    return Case("balance", f"{name}-{dim}", f"{description}, {dim}", partial(run, given), levels, seconds)


def _cases() -> Iterator[Case]:
    for model, pairs in (("plane_strain", _PLANE), ("axisymmetric", _PLANE), ("3d", _SOLID)):
        few, solid = pairs[:3] if model != "3d" else _FEW, model == "3d"
        for name, keys in (("facet", _FACET), ("smoothed", _SMOOTHED)):
            description = f"interface in waves, {name} normals"
            quick = model != "axisymmetric"
            yield _case(f"waves-{name}", description, Touch(pairs, model, "waves", keys), 6.0, quick and not solid)
            now = Touch(few, model, "waves", keys + _CURRENT)
            yield _case(f"waves-{name}-current", f"{description}, geometry current", now, 4.0, solid)
            finite = Touch(few, model, "waves", keys, "finite", steps=2)
            yield _case(f"waves-{name}-finite", f"{description}, finite kinematics", finite, 12.0)
        for shape, description in (
            ("overhang", "the slave reaches over the master's rim"),
            ("tucked", "a wider master"),
        ):
            yield _case(shape, description, Touch(few, model, shape), 2.0, solid and shape == "overhang")
            yield _case(
                f"{shape}-finite", f"{description}, finite", Touch(few, model, shape, (), "finite", steps=2), 8.0
            )
        yield _case("bilateral", "pressure of either sign", Touch(few, model, "waves", _BOTH), 2.0)
        for gap in (0.0, 0.07):
            words, description = ("tie-gap", "a tie across a gap") if gap else ("tie", "a tie")
            yield _case(
                words, description, Touch(few, model, "waves", (), joint="tie", gap=gap), 2.0, solid and gap > 0
            )
    for name, keys in (("facet", _FACET), ("smoothed", _SMOOTHED)):
        curved = Touch((("TETRA10", "HEXA20"),), "3d", "waves", keys + _CURRENT)
        yield _case(
            f"curved-{name}-current", f"curved faces on curved faces, {name} normals, geometry current", curved, 15.0
        )
    for model, on in (("plane_strain", _PLANE[:2]), ("3d", _FEW)):
        for kinematics in ("small", "finite"):
            description = f"a rigid skin that comes down and turns, {kinematics} kinematics"
            given = Touch(on, model, "rigid", (), kinematics, steps=2 if kinematics == "finite" else 1)
            yield _case(f"rigid-{kinematics}", description, given, 4.0, kinematics == "small" and model == "3d")
    for keys, name in (((), "pyramid"), (_HEXA, "hexa")):
        warped = Touch((("HEXA8", "HEXA8"), ("HEXA20", "HEXA8"), ("HEXA8", "HEXA27")), "3d", "saddle", keys)
        yield _case(f"warped-{name}", f"quadrangles that are not plane, cut {name}", warped, 3.0, name == "hexa")
    for kinematics in ("small", "finite"):
        three = Touch((("HEXA8", "TETRA4"), ("PENTA6 quadrangle", "HEXA20")), "3d", "tower", (), kinematics)
        yield _case(f"tower-{kinematics}", f"three blocks, two zones, {kinematics} kinematics", three, 5.0)


FAMILY = Family(
    "balance",
    "Balance of forces",
    "What the slave gets the master gives: the resultant of the contact forces on both, and their moment, must vanish "
    "to rounding on any skins. Here they are curved, warped, overhanging or rigid, non-matching and distorted, with "
    "facet and smoothed normals, on the undeformed and on the deformed bodies, under small and finite kinematics, with "
    "unilateral and bilateral contact, ties and several zones. Every other case with contact of this report has the "
    "same two results.\n\n"
    "What is left is relative to the sum of the sizes of the forces, and of the forces times their arms; in "
    "axisymmetry radial forces and moments balance all round, and the axial resultant alone is given.",
    tuple(_cases()),
)
