"""Materials: bodies that hardly change their volume, in cells that lock, and bodies that are crushed.

What locks was measured on rings and spheres under pressure ("Nearly incompressible bodies" of the theory page).

A body of the law of Saint Venant-Kirchhoff may be compressed beyond what the law is meant for. In uniaxial strain its
force is (lambda + 2 mu) (x^3 - x) / 2 at the stretch x: it is largest in compression at x = 1 / sqrt 3 = 0.577, falls
when the body is crushed further, and is 0 at x = 0. Nothing in a solution shows it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats
from lacsolver.bodies.hyperelastic import SaintVenantKirchhoff
from lacsolver.bodies.locking import LOCKING, ROUNDING, nearly_incompressible, poisson_of
from lacsolver.bodies.material import Law, Materials, Orthotropic
from lacsolver.bodies.plastic import Plastic
from lacsolver.bodies.points import table
from lacsolver.doubts.run import Doubt, Run, Watching
from lacsolver.equilibrium.state import State
from lacsolver.problem.problem import Problem
from lacsolver.space.space import Space

#: by dimension: Poisson's ratio above which quadratic cells are too stiff to be trusted
QUADRATIC = {2: 0.4999, 3: 0.499}
#: linear cells that do not lock with mean dilatation, by dimension from 2
_DO_NOT_LOCK = ("QUAD4", "HEXA8")
#: principal stretches at which the warning begins, and at which the force is largest
WARNED, LARGEST = 0.7, 3**-0.5


def locking(run: Run) -> Iterator[Doubt]:
    """Doubt laws whose cells, of all processes, are too stiff to be trusted."""
    if run.parts.materials is not None:
        yield from map(Doubt, too_stiff(run.space, run.parts.materials))


def too_stiff(space: Space, materials: Materials) -> Iterator[str]:
    """Yield a sentence about each law whose cells, of all processes, are too stiff to be trusted."""
    for k, law in enumerate(materials.laws):
        poisson = poisson_of(law)
        if poisson is None or space.model.plane_stress or not nearly_incompressible(law):
            continue
        linear, quadratic = _stiff(space, poisson, _types(space, materials, k), materials.mean[k])
        for names, advice in ((linear, _instead(space, law, materials.mean[k], linear)), (quadratic, _below(space))):
            if names:
                yield f"{_named(law, materials, k)} makes {', '.join(names)} far too stiff: they lock; {advice}"


def _types(space: Space, materials: Materials, k: int) -> list[str]:
    """Return the types of the cells of law k, of all processes, in the order of `CELLS`."""
    here = [b.type for b, which in zip(space.blocks, materials.law, strict=True) if (which == k).any()]
    there = space.share.texts(here)
    return [name for name in CELLS if name in there]


def _stiff(space: Space, poisson: float, names: Sequence[str], mean: bool) -> tuple[list[str], list[str]]:
    """Return the linear and the quadratic cells that lock, of some types and a law above `LOCKING`."""
    spared = ("TRIA6",) if space.model.name == "plane_strain" else ()
    linear = [name for name in names if CELLS[name].order == 1 and not (mean and name in _DO_NOT_LOCK)]
    quadratic = [name for name in names if CELLS[name].order == 2 and name not in spared]
    return linear, quadratic if poisson > QUADRATIC[space.dim] + ROUNDING else []


def _named(law: Law, materials: Materials, k: int) -> str:
    """Return words for law k: its Poisson's ratio and its cell groups."""
    groups = materials.groups[k] if materials.groups else None
    where = f" of material {', '.join(map(repr, groups))}" if groups else ""
    if isinstance(law, Plastic):
        return f'law = "plastic"{where}'
    what = "the mean poisson" if isinstance(law, Orthotropic) else "poisson"
    return f"{what} = {poisson_of(law):.6g}{where}"


def _instead(space: Space, law: Law, mean: bool, names: Sequence[str]) -> str:
    """Return what to take in place of linear cells that lock."""
    good = _DO_NOT_LOCK[space.dim - 2]
    advice = f"mesh that body with {good} or quadratic cells"
    if not mean:
        taken = "mean_dilatation" if getattr(law, "takes_mean", False) else 'law = "neo_hookean"'
        advice = f"take {taken} for {good} cells, or mesh that body with quadratic cells"
    elif "PYRAM5" in names and "lac_parent" in space.mesh.cell_data:
        advice = f'where a cut made them of HEXA8 take hexa = "hexa", else {advice}'
    return advice if isinstance(law, Plastic) else f"{advice}, or take poisson = {LOCKING} or less"


def _below(space: Space) -> str:
    """Return what to take in place of quadratic cells that lock."""
    return f"take poisson = {QUADRATIC[space.dim]} or less, or mesh that body with {_DO_NOT_LOCK[space.dim - 2]} cells"


def most_compressed(problem: Problem, state: State) -> NDArray[np.floating]:
    """Return the least principal stretch of each law of Saint Venant-Kirchhoff, its time and point, (laws, 2 + dim).

    The stretch is that without thermal expansion, the point an undeformed integration point of this process's own
    cells. Stretches above `WARNED`, and those of other laws, are inf.
    """
    space, body, materials = problem.space, problem.kinematics, problem.materials
    out = np.full((len(materials.laws), 2 + space.dim), np.inf)
    softens = np.array([isinstance(law, SaintVenantKirchhoff) for law in materials.laws])
    if not (softens.any() and body.finite):
        return out
    theta = body.stretches(state.time)
    most = WARNED * max([1.0, *(part.max(initial=0.0) for part in theta or ())])
    stretches = body.at(state.u, state.time, state.history).evaluated(lambda P, F: _least(F, most))
    for number, (block, stretch) in enumerate(zip(space.blocks, stretches, strict=True)):
        elastic = stretch if theta is None else stretch / theta[number]
        for k in np.flatnonzero(softens):
            cells = np.flatnonzero((materials.law[number] == k) & space.own_cells(block))
            least = elastic[cells].min(initial=np.inf)
            if least <= WARNED and least < out[k, 0]:
                cell, q = np.unravel_index(elastic[cells].argmin(), elastic[cells].shape)
                N = table(block.type, space.model.axisymmetric).N[q]
                point = N @ space.mesh.points[block.nodes[cells[cell]]]
                out[k] = least, state.time, *point[: space.dim]
    return out


class Crushed(Watching):
    """Doubts laws of Saint Venant-Kirchhoff that a step has compressed too far."""

    def __init__(self, run: Run) -> None:
        self._least = np.full((len(run.problem.materials.laws), 2 + run.space.dim), np.inf)

    def look(self, run: Run) -> None:
        """Keep the least stretches (laws, 2 + dim) of this process's cells, the first ones of those that are equal."""
        self._least = worse(self._least, most_compressed(run.problem, run.state))

    def __call__(self, run: Run) -> Iterator[Doubt]:
        """Yield a doubt about each law."""
        yield from (Doubt(text) for text in softened(run.problem, self._least))


def worse(one: Floats, other: Floats) -> NDArray[np.floating]:
    """Return the rows of two results of `most_compressed` with the lesser stretch, the first one's if they are equal.

    >>> worse(np.array([[0.6, 1.0, 0.0]]), np.array([[0.5, 2.0, 3.0]]))
    array([[0.5, 2. , 3. ]])
    """
    return np.where((np.asarray(other)[:, 0] < np.asarray(one)[:, 0])[:, None], other, one)


def softened(problem: Problem, rows: Floats) -> Iterator[str]:
    """Yield a warning for each law, from the least stretches (laws, 2 + dim) of this process's cells over all steps."""
    every = problem.space.share.gather(rows[None])
    for k, groups in enumerate(problem.materials.groups):
        stretch, time, *point = every[every[:, k, 0].argmin(), k].tolist()
        if stretch <= WARNED:
            who = f"material {', '.join(map(repr, groups))}" if groups else "the material"
            place = ", ".join(problem.space.told(np.array(point)))
            message = f"{who} of law saint_venant_kirchhoff is compressed to a principal stretch of {stretch:.3g}"
            message += f", most near ({place}) at time {time:.6g}; this law is meant for small strains, and below "
            yield f'{message}{LARGEST:.3f} its force falls while the body is crushed: take law = "neo_hookean"'


def _least(F: Floats, most: float) -> NDArray[np.floating]:
    """Return the least singular values of F (c, q, 3, 3) where they may be below `most`, and inf elsewhere."""
    C = np.swapaxes(F, 2, 3) @ F
    straight = np.einsum("cqii->cqi", C)
    circles = straight - (np.abs(C).sum(axis=3) - straight)  # Gershgorin's lower bounds of the eigenvalues
    there = circles.min(axis=2) <= most**2
    out = np.full(F.shape[:2], np.inf)
    out[there] = np.sqrt(np.linalg.eigvalsh(C[there])[:, 0])
    return out
