"""Bodies that hardly change their volume, in cells that lock.

What locks was measured on rings and spheres under pressure ("Nearly incompressible bodies" of the theory page).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lacmesh.cells import CELLS
from lacsolver.bodies.locking import LOCKING, ROUNDING, nearly_incompressible, poisson_of
from lacsolver.bodies.material import Law, Materials, Orthotropic
from lacsolver.bodies.plastic import Plastic
from lacsolver.doubts.run import Doubt, Run
from lacsolver.space.space import Space

#: by dimension: Poisson's ratio above which quadratic cells are too stiff to be trusted
QUADRATIC = {2: 0.4999, 3: 0.499}
#: linear cells that do not lock with mean dilatation, by dimension from 2
_DO_NOT_LOCK = ("QUAD4", "HEXA8")


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
