"""Impacts and free rigid bodies on few cells, for the family `distributed`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from lacmesh import Mesh
from verification.meshes.bars import bar_on_wall, bars
from verification.solving import case_text, entry

_SIDES = [(axis, f"{axis}{end}") for axis in "xy" for end in "01"]


@dataclass(frozen=True)
class Free:
    """A problem of this module, by its name."""

    name: str

    @property
    def text(self) -> str:
        """The case, as TOML."""
        return _PROBLEMS[self.name][0]

    @property
    def mesh(self) -> Mesh:
        """The mesh, not cut."""
        return _PROBLEMS[self.name][1]()


def _text(model: str, *tables: str, finite: bool = False, end: float = 1.0, count: int = 2) -> str:
    """A case of bodies of density 1 with these tables; `end`, `count`: of its steps."""
    law = {"law": "neo_hookean"} if finite else {}
    body = entry("material", **law, young=1.0, poisson=0.3, density=1.0)
    kinematics = "finite" if finite else "small"
    return case_text(model, body, *tables, entry("steps", end=end, count=count), kinematics=kinematics)


def _held(dim: int) -> list[str]:
    """Conditions by which waves are those of one dimension."""
    return [entry("displacement", group=side, **{f"u{axis}": 0.0}) for axis, side in _SIDES[: 2 * (dim - 1)]]


_CONTACT = entry("contact", slave="slave", master="master")
_BOTTOM = entry("displacement", group="bottom", ux=0.0, uy=0.0, uz=0.0)
_NO_LOAD = {"fx": 0.0, "fy": 0.0, "fz": 0.0, "moment": [0.0, 0.0, 0.0]}
#: name -> the text of the case, and what makes the mesh
_PROBLEMS: dict[str, tuple[str, Callable[[], Mesh]]] = {
    "bars": (
        _text(
            "plane_strain", _CONTACT, *_held(2), entry("initial", groups=["upper"], vy=-0.05), "[dynamics]",
            end=1.2, count=15,
        ),
        lambda: bars(("QUAD8", "TRIA3"), (8, 7), (2, 1), 0.01),
    ),
    "spin": (
        _text(
            "3d", _CONTACT, entry("initial", groups=["upper"], vz=-0.15, rotation=[0.0, 0.1, 0.05]),
            '[dynamics]\nscheme = "newmark"\nrayleigh = [0.02, 0.01]', finite=True, end=1.2, count=8,
        ),
        lambda: bars(("HEXA8", "TETRA4"), (4, 3), (2, 1), 0.02),
    ),
    "top": (
        _text(
            "3d", _CONTACT, _BOTTOM, entry("spring", group="top", kx=1e-3, ky=1e-3),
            entry("rigid", group="top", fz="-1e-4 * t", moment=[0.0, "1e-6 * t", 0.0]),
        ),
        lambda: bars(("HEXA8", "TETRA4"), (4, 3), (2, 1)),
    ),
    "plate": (
        _text(
            "plane_strain", entry("contact", slave="slave", master="wall"),
            entry("displacement", group="top", ux=0.0, uy=0.0),
            entry("rigid", group="wall", fy="0.01 * t", moment=0.0), finite=True,
        ),
        lambda: bar_on_wall("QUAD8", 8),
    ),
    "wall": (
        _text(
            "plane_strain", entry("contact", slave="slave", master="wall"),
            entry("rigid", group="wall", fx=0.0, fy=0.0, moment=0.0, mass=0.5, inertia=0.01), "[gravity]\ngx = 0.1",
            "[dynamics]", entry("initial", groups=["wall"], rotation=2.0), entry("initial", groups=["bar"], vy=-0.53),
            finite=True, end=0.4, count=8,
        ),
        lambda: bar_on_wall("QUAD4", 6, 0.05),
    ),
    "thrown": (
        _text(
            "3d", _CONTACT, _BOTTOM, entry("rigid", group="top", **_NO_LOAD, mass=0.01, inertia=[1e-4, 1e-4, 2e-4]),
            "[dynamics]", entry("initial", groups=["upper"], vz=-0.1), count=6,
        ),
        lambda: bars(("HEXA8", "TETRA4"), (4, 3), (2, 1), 0.01),
    ),
}  # fmt: skip
