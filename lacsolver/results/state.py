"""What is known at a time: the displacement, what every zone says of its macro-elements, and how it was reached."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints

#: status of a macro-element
UNPAIRED, OPEN, CONTACT = -1, 0, 1


class Iterate(NamedTuple):
    """Unknowns q (n,), pressures p (m,), the set of the last solve (m,)."""

    q: NDArray[np.floating]
    p: NDArray[np.floating]
    active: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ZoneState:
    """A contact zone or a tie, a row each macro-element (n,); vectors have the space's dimension d.

    `pressure`: p_m >= 0 in compression, 0 where open (a tie's: the pull of the slave on the master along -normal).
    `traction` (n, d): force per area on the slave, -p n for a contact. `gap`: mean gap G / w, NaN where unpaired;
    for a tie the size of the mean jump. `status`: CONTACT, OPEN, UNPAIRED. `coverage` w / A, `area` A (of the measure
    that pressures refer to; thickness or 2 pi r in it), `centre` and `normal` (n, d) of the macro-element.
    `force` (n_nodes, d): contact force on every node, slave's and master's.
    """

    name: str
    tie: bool
    pressure: Floats
    traction: Floats
    gap: Floats
    status: Ints
    coverage: Floats
    area: Floats
    centre: Floats
    normal: Floats
    force: Floats


class Held(NamedTuple):
    """A motion of bodies that nothing but contact stops, in `words`; `part`: what of contact's stiffness resists it.

    `moved`: how far it displaced a node of its bodies at most; `size`: the least extent of one of them. `part` is NaN
    where it was not asked for, because it is enough.
    """

    words: str
    moved: float
    size: float
    part: float = float("nan")


@dataclass(frozen=True, eq=False)
class State:
    """A converged state (or the last one tried). `u` (n_dof,): displacement; `zones`: in the case's order, ties last.

    `reaction` (n_dof,): force that what holds the body gives it. `rigid` (name -> dofs): the motion of rigid bodies,
    displacement of the centre then rotation. `iterations`, `halvings` of the step that led here, `residuals` of its
    iterations, the last `settled` of which solved with one set of closed rows; `next_step`: the size of step that would
    come next. `iterate`, `earlier`: unknowns, pressures and set here and, with its time, a step before: what to go on
    from. Of the last time of a case, `held`: what came of motions that nothing but contact stops, and `prescribed`: how
    far what is prescribed moves, at most.
    """

    time: float
    u: NDArray[np.floating]
    reaction: NDArray[np.floating]
    zones: tuple[ZoneState, ...]
    rigid: dict[str, NDArray[np.floating]]
    iterations: int = 0
    halvings: int = 0
    residuals: tuple[float, ...] = ()
    next_step: float = np.inf
    iterate: Iterate | None = None
    earlier: tuple[float, Iterate] | None = None
    settled: int = 0
    held: tuple[Held, ...] = ()
    prescribed: float = 0.0
