"""A contact pair or tie of a problem: slave and master, the options of their pairing, and the law of their contact."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.checks.findings import named
from lacmesh.errors import LacmeshError, LacmeshWarning
from lacmesh.facts import Described
from lacmesh.mesh import Floats, Mesh
from lacmesh.reference.quadrature import rule
from lacmesh.smooth import DOUBTFUL, doubt_text, few_faces_text_of
from lacmesh.surface import Surface
from lacmesh.surface.normals import normals_of
from lacmesh.topology.skin import FACE_TYPES
from lacsolver.case import Contact, Cyclic, Tie
from lacsolver.case.value import Value
from lacsolver.constraints.cyclic import turn_of
from lacsolver.contact import Interface, Pairing, Zone, arm, integrate
from lacsolver.contact.faces import places, tangents
from lacsolver.contact.friction import Bounds
from lacsolver.contact.laws import ContactLaw
from lacsolver.problem.laws import contact_law_of
from lacsolver.space.places import wrong
from lacsolver.space.space import Space

#: polynomial degree to which friction that is a formula is integrated
_DEGREE = 4
#: round-off of a coverage
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class ContactPair(Described):
    """A contact pair or tie: its zone, the options of its pairing, and its contact law at the start.

    `record`: the case's contact or tie. The kind of law stays the same, and its stiffness may change: see `law_at`.
    `turns`: True for a tie under finite kinematics: its arm across a gap (`contact.arm`), and its normals in results,
    turn with the slave.
    """

    record: Contact | Tie
    zone: Zone
    pairing: Pairing
    law: ContactLaw
    turns: bool = False
    _kept: list[Interface] = field(default_factory=list, init=False, repr=False)

    @classmethod
    def of(cls, space: Space, record: Contact | Tie) -> ContactPair:
        """Return the pair of a contact or a tie. Raises CaseError, with its line, if the groups make no zone."""
        try:
            zone = zone_of(space.local, record)
        except LacmeshError as error:
            raise wrong(record, str(error)) from None
        pairing = Pairing()
        if isinstance(record, Cyclic):
            turned = turn_of(record, space.dim)
            pairing = Pairing(turn=turned._replace(centre=turned.centre - space.origin))
        if isinstance(record, Contact):
            _warn_of_skins(space, record, zone)
            value = record.clearance
            fixed = not (value.depends_on_place or value.depends_on_time)
            normals = "facet" if record.normals == "slave" else record.normals
            pairing = Pairing(
                normals, record.crease_angle, max_penetration=record.max_penetration, measure=record.measure,
                clearance=value.at(0.0) if fixed else _at_local_points(space, value), friction=record.has_friction,
            )  # fmt: skip
        try:
            pairing = pairing.within(space, zone, record.search_distance)
        except LacmeshError as error:
            raise wrong(record, str(error)) from None
        return cls(record, zone, pairing, contact_law_of(record, 0.0))

    @property
    def name(self) -> str:
        """Name of the pair in results."""
        return self.record.name

    def law_at(self, t: float, dt: float) -> ContactLaw:
        """Return the law at time t, in a step of size dt in motion; 0 at rest. Raises CaseError as the law does."""
        stiffness = self.record.stiffness if isinstance(self.record, Contact) else None
        changes = stiffness is not None and stiffness.depends_on_time
        law = contact_law_of(self.record, t) if changes else self.law
        return law.in_step(dt)

    def bounds(self, space: Space, t: float) -> Bounds | None:
        """Return the bounds of friction at time t, means over each macro-element; None without friction."""
        record = self.record
        if not (isinstance(record, Contact) and record.has_friction):
            return None
        limit = Value(np.inf) if record.shear_limit is None else record.shear_limit
        return Bounds(*(self._means(space, value, t) for value in (record.friction, record.cohesion, limit)))

    def _means(self, space: Space, value: Value, t: float) -> NDArray[np.floating]:
        """Return the means (n_macros,) of a value of friction over the undeformed macro-elements, by Gauss's rules."""
        zone = self.zone
        if not value.depends_on_place:
            at_all = np.inf if value.source == np.inf else value.at(t)
            return np.full(zone.n_macros, self._never_negative(at_all, value))
        total, size = np.zeros((2, zone.n_macros))
        for code in np.unique(zone.slave.faces.type):
            face, (xi, weights) = (
                np.flatnonzero(zone.slave.faces.type == code),
                rule(CELLS[FACE_TYPES[code]].family, _DEGREE),
            )
            for at, weight in zip(xi, weights, strict=True):
                place = np.broadcast_to(np.pad(at, (0, 2 - len(at))), (len(face), 2))
                area = weight * np.linalg.norm(normals_of(tangents(zone.slave, face, place)), axis=1)
                x = places(zone.slave, face, place)
                area = area * x[:, 0] if self.pairing.axisymmetric else area
                own = self._never_negative(_at_local_points(space, value)(x, t), value)
                total += np.bincount(zone.macro[face], area * own, zone.n_macros)
                size += np.bincount(zone.macro[face], area, zone.n_macros)
        return np.asarray(total / size)

    def _never_negative(self, values: Any, value: Value) -> Any:
        """Return values of friction. Raises CaseError for negative ones, which formulas may give."""
        if np.min(values) < 0:
            raise wrong(self.record, f"{value.name} is {np.min(values):g} at some place or time; it must be >= 0")
        return values

    @property
    def tie(self) -> bool:
        """True for a tie, which joins all components."""
        return self.law.all_components

    @property
    def one_sided(self) -> bool:
        """True for contact whose pressure is >= 0 and whose gap may open."""
        return self.law.compressive

    def n_rows(self, dim: int) -> int:
        """Return the number of contact rows in `dim` dimensions, those along tangents included."""
        return self.zone.n_macros * (dim if self.tie or self.pairing.friction else 1)

    @property
    def initial(self) -> str:
        """Rows that are closed at the start: `all`, `none`, or those without a gap (`gap`)."""
        return self.record.initial if isinstance(self.record, Contact) and self.law.compressive else "all"

    @property
    def timed(self) -> bool:
        """True if the clearance changes with time."""
        return isinstance(self.record, Contact) and self.record.clearance.depends_on_time

    @property
    def moving(self) -> bool:
        """True if the zone is paired again on the deformed skins."""
        return isinstance(self.record, Contact) and self.record.geometry == "current"

    def places(self, space: Space, u: Floats) -> NDArray[np.floating]:
        """Return the coordinates (n_nodes, 3) at which forces act on the skins under u (n_dof,).

        They are displaced if the zone is paired on the deformed skins, and of a tie under finite kinematics; else
        undeformed. They are relative to the space's origin.
        """
        return space.places(u) if self.moving or self.turns else space.local.points

    def integrate(self, space: Space, u: Floats, t: float, closed: NDArray[np.bool_] | None = None) -> Interface:
        """Return the interface of the pair under u (n_dof,) at time t, see `places`.

        `closed` (n_macros,): macro-elements that were in contact before, which keep to a plane master as they fold.
        """
        x, tie = self.places(space, u) if self.moving else None, self.law.all_components
        face = integrate(self.zone, space.dim, self.pairing, x=x, t=t, tie=tie, share=space.share, keeps=closed)
        return self.turned(face, space, u)

    def undeformed(self, space: Space, t: float) -> Interface:
        """Return the interface of the undeformed skins at time t; skins that are paired once are so here."""
        if self.moving or self.timed or not self._kept:
            face = self.integrate(space, np.zeros(space.n_dof), t)
            self._kept[:] = [] if self.moving or self.timed else [face]
            return face
        return self._kept[0]

    def turned(self, face: Interface, space: Space, u: Floats) -> Interface:
        """Return an undeformed interface under u (n_dof,), where the arm of a tie turns; others as they are."""
        return arm.turned(face, space.places(u), space.share) if self.has_turning_arm(face, space) else face

    def has_turning_arm(self, face: Interface, space: Space) -> bool:
        """True for a tie across a gap whose arm turns; that between the sides of a sector does not."""
        return self.turns and self.pairing.turn is None and arm.has_arm(face, space.share)

    def above_threshold(self, face: Interface) -> NDArray[np.bool_]:
        """Return a mask (n_macros,), True for macro-elements of an interface whose coverage reaches the threshold.

        Macro-elements without any coverage are never paired. The threshold is lowered by round-off, since a complete
        coverage may be slightly below 1.
        """
        coverage = face.coverage
        return np.asarray((coverage >= self.record.coverage_threshold - _ROUNDING) & (coverage > 0))


def zone_of(mesh: Mesh, record: Contact | Tie) -> Zone:
    """Return the zone of a contact or a tie. Raises as `Zone.of`."""
    return Zone.of(
        mesh, record.slave, record.master, record.name, surface=record.surface, crease_angle=record.crease_angle
    )


def _warn_of_skins(space: Space, record: Contact, zone: Zone) -> None:
    """Warn of skins of a contact that are taken as round over creases, and of those whose height is doubtful."""
    for side, group, skin in (("slave", record.slave, zone.slave), ("master", record.master, zone.master)):
        where = f"contact {record.name!r}: {side} {group!r}: "
        if message := few_faces_text_of(space.local, skin, record.crease_angle):
            message += "; give crease_angle = 40 if the edges are sharp, or finer faces if they are not"
            warnings.warn(LacmeshWarning(where + named(message, "few-faces")), stacklevel=4)
        if message := _doubtful(space, skin):
            warnings.warn(LacmeshWarning(where + named(message, "faceted")), stacklevel=4)


def _doubtful(space: Space, skin: Surface) -> str:
    """Say where the height of a curved skin may be off by much; "" if it is not."""
    doubt = None if skin.height is None else skin.height.doubt
    if doubt is None or not doubt.max(initial=0.0) > DOUBTFUL:
        return ""
    worst = int(doubt.argmax())
    middle = skin.x[skin.faces.nodes[worst, : skin.n_corners[worst]]].mean(axis=0)[: space.dim]
    place = ", ".join(space.told(middle + space.origin[: space.dim]))
    return (
        f"its {doubt_text(float(doubt[worst]))} near ({place}), which changes the pressure by as great a part of "
        "Young's modulus; refine it there, put nodes on the line where two shapes touch, or take quadratic cells"
    )


def _at_local_points(space: Space, value: Value) -> Callable[[Floats, float], Floats]:
    """Return a value of the case as a function of points (n, 3), relative to the space's origin, and time."""
    return lambda x, t: value((x + space.origin)[:, : space.dim], t)
