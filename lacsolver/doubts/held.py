"""Bodies that hardly anything holds: motions that contact alone resists, displacements beyond the size of a cell."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lacsolver.doubts.run import Doubt, Run
from lacsolver.equilibrium.holding import HARDLY
from lacsolver.problem.rigid_modes import STOPPED_BY_CONTACT


def hardly_held(run: Run) -> Iterator[Doubt]:
    """Doubt motions at the end that contact hardly resists, or that displaced a body by more than its size.

    A body may move in addition by the largest prescribed displacement.
    """
    described: set[str] = set()
    for one in run.last.held if run.last else ():
        far = one.moved > one.size + run.state.prescribed
        if one.words not in described and (far or one.part < HARDLY):
            described.add(one.words)
            went = f"{one.words} by {one.moved:.4g}"
            went += f", farther than it is long ({one.size:.4g})" if far else ""
            advice = "support it by a displacement or a spring, or check where its load moves it"
            yield Doubt(f"{went}: {_resisted(one.part)}; {advice}")


def _resisted(part: float) -> str:
    if np.isnan(part):
        return "contact alone resists that"
    if part < STOPPED_BY_CONTACT**2:
        return "contact alone could stop that, and no closed macro-element does"
    return f"contact alone resists that, with {part:.1e} of its stiffness, as little as the roughness of a mesh gives"


def beyond_a_cell(run: Run) -> Iterator[Doubt]:
    """Doubt small kinematics where the largest nodal displacement exceeds the size of the node's largest cell.

    Of several processes the one that has the node yields. Bodies and contact are evaluated undeformed there.
    """
    if run.last is None or run.problem.kinematics.finite:
        return
    space = run.space
    far = np.linalg.norm(run.last.u.reshape(-1, space.dim), axis=1)
    if space.share.own is not None:
        far[~space.share.own] = 0.0
    node = int(far.argmax())
    if far[node] < space.share.largest(float(far[node])):
        return
    size = 0.0
    for block in space.blocks:
        x = space.local.points[block.nodes[(block.nodes == node).any(axis=1)]]
        size = max(size, float(np.ptp(x, axis=1).max(initial=0.0)))
    if far[node] > size > 0:
        place = ", ".join(space.told(space.mesh.points[node]))
        message = f"node {space.mesh.node_number[node]} ({place}) moves by {far[node]:.4g} and its cells are {size:.4g}"
        message += " long: small kinematics assumes small displacements"
        yield Doubt(f'{message}; check what moves, or set kinematics = "finite"')
