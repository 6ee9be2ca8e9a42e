"""State at one time: displacement, reactions, contact state of every zone, and data of the solution and its restart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints

#: status of a macro-element
UNPAIRED, OPEN, CONTACT = -1, 0, 1


class Iterate(NamedTuple):
    """Unknowns q (n,), pressures p (m,), and the active set (m,) of the last solve."""

    q: NDArray[np.floating]
    p: NDArray[np.floating]
    active: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ZoneState:
    """State of a contact zone or a tie, one row per macro-element (n,); vectors have the space's dimension d.

    `pressure`: p_m >= 0 in compression, 0 where open; for a tie -traction . normal. `traction` (n, d): force per area
    on the slave, -p n for a contact. `gap`: mean gap G / w, NaN where unpaired; for a tie the magnitude of the mean
    jump. `status`: CONTACT, OPEN, UNPAIRED. `coverage`: w / A; `area`: A, in the measure that pressures refer to, with
    thickness or 2 pi r; `centre` and `normal` (n, d) of the macro-element. `force` (n_nodes, d): contact force on every
    node of slave and master.

    >>> from lacsolver import Problem, march, read_case
    >>> *_, state = march(Problem.of(read_case("data/two_blocks.toml")))
    >>> zone = state.zones[0]
    >>> zone.name, float((zone.pressure * zone.area).sum().round(6))
    ('joint', 10.435185)
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
    """A rigid-body motion that only contact constrains, in `words`.

    `moved`: largest nodal displacement by it; `size`: least extent of its bodies; `part`: fraction of the contact
    stiffness that resists it, NaN if that was not computed because it is sufficient.
    """

    words: str
    moved: float
    size: float
    part: float = float("nan")


@dataclass(frozen=True, eq=False)
class State:
    """A converged state (or the last one tried). `u` (n_dof,): displacement; `zones`: in the case's order, ties last.

    `reaction` (n_dof,): forces of the supports on the bodies. `rigid` (name -> dofs): motion of rigid bodies,
    displacement of the centre, then rotation. `iterations`, `halvings`: numbers of the step that led here; `residuals`:
    those of its iterations, the last `settled` of which had the same active set; `next_step`: size of the next step.
    `iterate`, `earlier`: unknowns, pressures and active set of this state and, with its time, of the one before, for
    extrapolation and restart. At the last time of a case, `held`: rigid-body motions that only contact constrains, and
    `prescribed`: largest prescribed displacement.

    >>> from lacsolver import Problem, march, read_case
    >>> *_, state = march(Problem.of(read_case("data/two_blocks.toml")))
    >>> state.time, state.u.shape, [zone.name for zone in state.zones]
    (1.0, (1536,), ['joint'])
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
