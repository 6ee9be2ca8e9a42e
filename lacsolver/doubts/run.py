"""A run as rules see it, and the doubts that they yield."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats
from lacsolver.case.entry import Entry
from lacsolver.contact import Interface
from lacsolver.equilibrium.state import State, ZoneState
from lacsolver.problem.pair import ContactPair
from lacsolver.problem.problem import Problem, ProblemParts
from lacsolver.space.space import Space


class Doubt(NamedTuple):
    """A sentence about what may be wrong; `record`: what it is about, None for the whole case.

    `fatal`: the case is refused.
    """

    text: str
    record: Entry | None = None
    fatal: bool = False


@dataclass
class Run:
    """A run between two steps.

    `parts`: its problem; of a validation, the parts that could be built. `pairs`: those that rules look at. `faces`:
    their interfaces in the undeformed configuration, by name, as far as a rule has asked. `last`: the last converged
    state. Of the one before it, `touched`: macro-elements (n,) in contact, by zone; `rigid`: motion of each rigid body,
    none before the first step.
    """

    parts: Problem | ProblemParts
    pairs: Sequence[ContactPair]
    faces: dict[str, Interface] = field(default_factory=dict)
    last: State | None = None
    touched: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)
    rigid: Mapping[str, Floats] = field(default_factory=dict)

    @property
    def problem(self) -> Problem:
        """The whole problem."""
        assert isinstance(self.parts, Problem)
        return self.parts

    @property
    def state(self) -> State:
        """The last converged state."""
        assert self.last is not None
        return self.last

    @property
    def start(self) -> float:
        """Time at which pairs are looked at undeformed: the end of the first step."""
        return self.parts.case.steps.planned[0]

    @property
    def space(self) -> Space:
        """Displacement space of the bodies."""
        assert self.parts.space is not None
        return self.parts.space

    def face(self, pair: ContactPair) -> Interface:
        """Return the interface of a pair in the undeformed configuration."""
        if pair.name not in self.faces:
            self.faces[pair.name] = pair.undeformed(self.space, self.start)
        return self.faces[pair.name]

    @property
    def zones(self) -> Iterator[tuple[ContactPair, ZoneState]]:
        """Pairs with their zones in the last state; none before the first step."""
        return zip(self.pairs, self.last.zones, strict=True) if self.last else iter(())


#: yields the doubts about a run
Rule = Callable[[Run], Iterator[Doubt]]


class Watching:
    """A rule that looks at every step, and is asked at the end."""

    def __init__(self, run: Run) -> None:
        """Look at the undeformed pairs of a run."""

    def look(self, run: Run) -> None:
        """Look at the step that led to the last state of a run."""

    def __call__(self, run: Run) -> Iterator[Doubt]:
        """Yield the doubts about a run."""
        yield from ()
