"""Locking of bodies that hardly change their volume: cells with mean dilatation, and a warning for those that lock.

A linear cell has a constraint of volume at each of its integration points, and too few degrees of freedom for that.
With mean dilatation a linear cell of several points (QUAD4, HEXA8, PENTA6, PYRAM5) has one, on the mean of the change
of volume over the cell: `bodies.small` for the linear laws, `bodies.dilatation` for the neo-Hookean law and for metals
that yield, which keep their volume as they flow, whatever their Poisson's ratio. TRIA3 and TETRA4 have one point, so
that nothing is gained; PENTA6 and PYRAM5 gain, but there may still be too many of them for their nodes: a prism in
plane strain across its axis is a TRIA3.
"""

from __future__ import annotations

from collections.abc import Sequence

from lacmesh.cells import CELLS
from lacsolver.bodies.material import Elastic, Law, Materials, Orthotropic
from lacsolver.bodies.plastic import Plastic
from lacsolver.space.space import Space

#: Poisson's ratio above which linear cells are too stiff to be trusted
LOCKING = 0.45
#: by dimension: the same of quadratic cells
QUADRATIC = {2: 0.4999, 3: 0.499}
#: linear cells that do not lock with mean dilatation, by dimension from 2
_DO_NOT_LOCK = ("QUAD4", "HEXA8")
#: tolerance of a Poisson's ratio that is computed from other constants
_ROUNDING = 1e-9


def poisson_of(law: Law) -> float | None:
    """Return the Poisson's ratio by which a law is judged, that of its averages if it is orthotropic; None if unknown.

    >>> wood = Orthotropic((11.0, 0.9, 0.5), (0.4, 0.35, 0.3), (0.8, 0.7, 0.06))
    >>> poisson_of(Elastic(1.0, 0.49)), round(poisson_of(wood), 3)
    (0.49, 0.287)
    """
    if isinstance(law, Orthotropic):
        return law.equivalent_poisson
    return law.poisson if isinstance(law, Elastic) else None


def nearly_incompressible(law: Law) -> bool:
    """True for a law by which linear cells lock: Poisson's ratio above `LOCKING`, or flow that keeps the volume."""
    if isinstance(law, Plastic):
        return True
    poisson = poisson_of(law)
    return poisson is not None and poisson > LOCKING + _ROUNDING * isinstance(law, Orthotropic)


def may_take_the_mean(space: Space, block: int) -> bool:
    """True if mean dilatation applies to a block: linear cells of several points, and not plane stress.

    Plane stress does not lock, since the strain across the plane is free.
    """
    cell = CELLS[space.blocks[block].type]
    return cell.order == 1 and cell.family not in ("TRIA", "TETRA") and not space.model.plane_stress


def locking(space: Space, materials: Materials) -> tuple[str, ...]:
    """Return warnings of all processes for each law whose cells are too stiff to be trusted.

    What locks was measured on rings and spheres under pressure ("Nearly incompressible bodies" of the theory page).
    """
    told = []
    for k, law in enumerate(materials.laws):
        poisson = poisson_of(law)
        if poisson is None or space.model.plane_stress or not nearly_incompressible(law):
            continue
        linear, quadratic = _stiff(space, poisson, _types(space, materials, k), materials.mean[k])
        for names, advice in ((linear, _instead(space, law, materials.mean[k], linear)), (quadratic, _below(space))):
            if names:
                told.append(f"{_named(law, materials, k)} makes {', '.join(names)} far too stiff: they lock; {advice}")
    return tuple(told)


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
    return linear, quadratic if poisson > QUADRATIC[space.dim] + _ROUNDING else []


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
