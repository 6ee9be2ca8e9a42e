"""**Units.** *units*: blocks that ties or contact and a coupling hold, in other units of length and of force: the same
iterations and the same solution. *two sizes*: two such contacts in one model, one smaller, against models of each.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lacmesh import Mesh
from verification.meshes.blocks import joined
from verification.meshes.stacks import moved, stack
from verification.records import Case, Rows, at_most, equal, problem, row
from verification.solving import Solved, case_text, entry, model_of, solve

#: name of a change of units -> factors of lengths and of stresses
_UNITS = {
    "lengths x 1e-3": (1e-3, 1.0),
    "lengths x 1e3": (1e3, 1.0),
    "lengths x 1e-6": (1e-6, 1.0),
    "forces x 1e9": (1.0, 1e9),
}
#: round-off of solutions, and of the coordinates of a contact that is 1e-5 as large as the model
_SOLVED, _SMALL = 1e-10, 1e-8
_RATIOS = (1e3, 1e4, 1e5)
_NAMES = ("bottom", "slave", "master", "top")


@problem
def solve_units(joint: str, dim: int) -> Rows:
    """A block on another one, joined by a `joint`, whose top is pressed and does not turn, in all units."""
    base, source = _pressed(joint, dim), "similarity"
    for name, (length, stress) in _UNITS.items():
        other = _pressed(joint, dim, length, stress)
        iterations, reason = (other.state.iterations, base.state.iterations), "those of the model as it stands"
        yield equal(f"iterations, {name}", *iterations, 0.0, source=source, reason=reason)
        off = np.abs(other.state.u / length - base.state.u).max() / np.abs(base.state.u).max()
        yield at_most(f"difference of displacements, {name}", off, _SOLVED, source=source)


@problem
def solve_two_sizes(kinematics: str, dim: int) -> Rows:
    """Two contacts in one model, of which the second is smaller by a factor."""
    pressures = _pressed("contact", dim, kinematics=kinematics).zone.pressure
    for ratio in _RATIOS:
        both = _pressed("contact", dim, kinematics=kinematics, sizes=(1.0, 1 / ratio))
        off = max(np.abs(zone.pressure - pressures).max() / pressures.max() for zone in both.state.zones)
        yield at_most(f"difference of pressures, 1 : {ratio:g}", off, _SMALL, source="similarity")


def _pressed(
    joint: str, dim: int, length: float = 1.0, stress: float = 1.0, kinematics: str = "small",
    sizes: tuple[float, ...] = (1.0,),
) -> Solved:  # fmt: skip
    """Solve stacks of two blocks side by side, of these sizes, in units in which lengths and stresses are so large."""
    up, parts, tables = "xyz"[dim - 1], list[tuple[Mesh, dict[str, str]]](), list[str]()
    for k, size in enumerate(sizes):
        mesh = stack(*(("QUAD4", "TRIA3") if dim == 2 else ("HEXA8", "HEXA8")), dim, counts=(3, 2))
        mesh = replace(mesh, points=mesh.points * size * length)
        parts.append((moved(mesh, shift=np.array([3.0 * k * length, 0, 0])), {name: f"{name}{k}" for name in _NAMES}))
        fixed = {f"u{axis}": 0.0 for axis in "xyz"[:dim]}
        force = -20.0 * stress * (size * length) ** (dim - 1)
        aside = {name: 0.0 for name in fixed if name != f"u{up}"}
        turned = 0.0 if dim == 2 else [0.0, 0.0, 0.0]
        tables += [
            entry(joint, name=f"joint{k}", slave=f"slave{k}", master=f"master{k}"),
            entry("displacement", group=f"bottom{k}", **fixed),
            entry("coupling", group=f"top{k}", rotation=turned, **aside, **{f"f{up}": force}),
        ]
    law = "neo_hookean" if kinematics == "finite" else "elastic"
    material = entry("material", law=law, young=1000.0 * stress, poisson=0.3)
    return solve(case_text(model_of(dim), material, *tables, kinematics=kinematics), joined(parts))


def cases(family: str) -> Iterator[Case]:
    """Cases of this module."""
    for dim in (2, 3):
        for joint in ("tie", "contact"):
            words = f"a {joint} and a coupling in other units, {dim}D"
            yield row(family, f"units-{joint}-{dim}d", words, solve_units, joint, dim, quick=1, seconds=2.0)
        for kinematics in ("small", "finite"):
            words = f"two contacts of different sizes, {kinematics} displacements, {dim}D"
            name = f"two-sizes-{kinematics}-{dim}d"
            yield row(family, name, words, solve_two_sizes, kinematics, dim, quick=1, seconds=4.0)
