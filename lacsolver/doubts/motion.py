"""Motions: inertia and start before they are computed, energy that steps make or lose; and the work of static steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from lacmesh.mesh import Floats
from lacsolver.case import Tie
from lacsolver.doubts.run import Doubt, Run, Watching
from lacsolver.equilibrium.motion import CONTACT, ENERGIES, NUMERICAL, STORED
from lacsolver.problem.initial import jumps
from lacsolver.problem.problem import Problem
from lacsolver.results.yielding import dissipated

#: parts of the largest energy above which a motion is doubted: what the steps have made, and what contact has taken
_MADE, _TAKEN = 0.01, 0.05
#: part of the dissipation that the balance of work may leave over; part of the work below which it is not looked at
_LEFT, _FELT = 0.05, 1e-4


def inertia(run: Run) -> Iterator[Doubt]:
    """Doubt the inertia and the start of a case with [dynamics]."""
    if isinstance(run.parts, Problem) and run.parts.inertia is not None:
        problem, record = run.parts, run.parts.case.dynamics
        texts = [*run.parts.inertia.told(), *_heavy_skins(problem), *jumps(problem)]
        yield from (Doubt(text, record) for text in texts)


def _heavy_skins(problem: Problem) -> Iterator[str]:
    """Yield a sentence about each rigid contact that moves and has no node without mass, as between rigid bodies."""
    space, inertia, how = problem.space, problem.inertia, problem.case.dynamics
    assert inertia is not None and how is not None
    moves = np.diff(problem.constraints.T.indptr).reshape(-1, space.dim).any(axis=1)
    for pair in problem.joints if how.massless != "none" else ():
        faces = np.concatenate([skin.faces.nodes.ravel() for skin in (pair.zone.slave, pair.zone.master)])
        nodes = faces[faces >= 0]
        soft = isinstance(pair.record, Tie) or pair.record.is_soft
        if soft or inertia.massless.nodes[nodes].any():
            continue
        if moves[nodes].any():
            advice = "let one body deform, or give the contact a stiffness"
            advice += "" if how.massless == "skins" else ', or take massless = "skins"'
            yield (
                f"the surfaces of contact {pair.name!r} have no nodes without mass, as rigid bodies keep their mass: "
                f"pressures alternate, and an impact creates energy; {advice}"
            )


class Energies(Watching):
    """Doubts steps in motion that have made energy, or have lost too much of it in contact."""

    def __init__(self, run: Run) -> None:
        self._times: list[float] = []
        self._energies: list[Floats] = []

    def look(self, run: Run) -> None:
        """Keep the energies of a step in motion; static steps before have none."""
        motion = run.state.step.motion
        if motion is not None and np.isfinite(motion.energies).all():
            self._times.append(run.state.time)
            self._energies.append(motion.energies)

    def __call__(self, run: Run) -> Iterator[Doubt]:
        """Yield a doubt about the steps so far."""
        case = run.problem.case
        conservative = all(pair.type in ("unilateral", "bilateral") for pair in case.contact)
        table = np.array(self._energies).reshape(-1, len(ENERGIES))
        message = doubtful_energy(self._times, table, conservative)
        if message is not None and case.dynamics is not None:
            skins = case.dynamics.massless == "skins"
            advice = "take smaller steps" if skins else 'take massless = "skins", or smaller steps'
            yield Doubt(f"{message}; {advice}", case.dynamics)


def doubtful_energy(times: Sequence[float], energies: Floats, conservative: bool) -> str | None:
    """Return a sentence if the steps have made over 1 % of the largest energy, or contact has taken over 5 % of it.

    `times` (n,) and `energies` (n, 8), in the order of ENERGIES, are those of the steps in motion. Contact may take
    energy if its laws are not `conservative`.

    >>> import numpy as np
    >>> doubtful_energy([0.5, 1.0], np.array([[1.0, 0, 1, 0, 0, 0, 0, 0], [1.5, 0, 1, 0, 0.1, 0, -0.6, 0]]), True)
    'contact and the time scheme have made 33% of the largest energy out of nothing by time 1'
    >>> doubtful_energy([0.5, 1.0], np.array([[1.0, 0, 1, 0, 0, 0, 0, 0], [0.9, 0, 1, 0, 0.1, 0, 0, 0]]), True)
    'contact has taken 10% of the largest energy by time 1, as steps do not resolve the impact'
    """
    if not len(times):
        return None
    largest = max(energies[:, STORED].sum(axis=1).max(), energies[:, 2].max())  # external has that at the start
    gained, taken = -energies[:, [CONTACT, NUMERICAL]].sum(axis=1), energies[:, CONTACT]
    last, most = int(gained.argmax()), int(taken.argmax())
    if gained[last] > _MADE * largest:
        share = f"{gained[last] / largest:.0%} of the largest energy out of nothing by time {times[last]:.6g}"
        return f"contact and the time scheme have made {share}"
    if conservative and taken[most] > _TAKEN * largest:
        share = f"{taken[most] / largest:.0%} of the largest energy by time {times[most]:.6g}"
        return f"contact has taken {share}, as steps do not resolve the impact"
    return None


def dissipation(run: Run) -> Iterator[Doubt]:
    """Doubt static steps that are too long for the energy that friction takes, as the ledger of work shows.

    What the plastic flow has taken is no error. Friction that takes little of the work is not looked at.
    """
    work = run.last.step.work if run.last else None
    if work is None or not work.dissipation > _FELT * max(abs(work.external), work.strain):
        return
    flow = dissipated(run.problem, run.state.step.histories.materials, run.state.time)
    taken, left = work.dissipation + flow, work.left - flow
    if abs(left) > _LEFT * taken:
        by = "friction and plastic flow" if flow else "friction"
        message = f"steps are too long for the energy that {by} takes: it is {taken:.4g} at time {run.state.time:.6g}, "
        message += f"and the work balance is off by {left:.4g} ({abs(left) / taken:.0%})"
        yield Doubt(f"{message}; use more steps")
