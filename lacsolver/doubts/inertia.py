"""A motion before it is computed: skins that keep their mass, a changed inertia, displacements that start by a jump."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lacsolver.case import Tie
from lacsolver.doubts.run import Doubt, Run
from lacsolver.problem.initial import jumps
from lacsolver.problem.problem import Problem


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
