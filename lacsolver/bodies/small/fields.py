"""Displacement, strain and stress at integration points, and nodal forces of a stress there.

A field is a tuple with one array (cells, points, ...) for each block of the space. `degree` chooses a rule of
`lacmesh.reference.quadrature` instead of the points of the stiffness, for norms and output. Components are those of
`space.COMPONENTS`.

    f_int(u) = int B^T stress(u) dV, the first term of (35)

In cells with mean dilatation (`bodies.locking`) stress is that of the elastic strain whose trace is its mean over the
cell, and forces are those of the stress whose trace is its mean: int B^T P C P (B u - thermal strain) dV, with P the
projection that takes this mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints, mask_of
from lacsolver.bodies.locking import may_take_the_mean
from lacsolver.bodies.material import Materials
from lacsolver.bodies.points import Field, Piece, checked, coordinates, gathered, mapped, nodal
from lacsolver.space.space import Space
from lacsolver.space.values import ScalarField, evaluate

#: a temperature of the whole body, or (temperature, cells) pairs, where None means all cells and later pairs override
#: earlier ones
TemperatureField = ScalarField | Sequence[tuple[ScalarField, Ints | None]]


def points(space: Space, degree: int | None = None) -> Field:
    """Return the coordinates of the integration points, (cells, points, 3)."""
    return gathered(space, lambda part: coordinates(space, part), degree=degree)


def weights(space: Space, degree: int | None = None) -> Field:
    """Return the weights of the integration points, thickness or 2 pi r included, (cells, points)."""
    return gathered(space, lambda part: part.W, degree=degree)


def displacement(space: Space, u: Floats, degree: int | None = None) -> Field:
    """Return the displacement u (n_dof,) at the integration points, (cells, points, dim)."""
    u = checked(space, u)
    return gathered(space, lambda part: part.N @ nodal(u, part, space.dim), degree=degree)


def strain(space: Space, u: Floats, degree: int | None = None) -> Field:
    """Return the total strain of u (n_dof,), thermal strain included, (cells, points, 4 or 6).

    In plane stress zz is not known and is set to 0.
    """
    u = checked(space, u)
    return gathered(space, lambda part: _strain(space, part, u), degree=degree)


def stress(
    space: Space,
    materials: Materials,
    u: Floats,
    *,
    temperature: TemperatureField | None = None,
    t: float = 1.0,
    degree: int | None = None,
    threads: int = 1,
) -> Field:
    """Return the stress C (strain(u) - (T - T0) alpha) of u (n_dof,) at time t, (cells, points, 4 or 6).

    `temperature`: a number or f(points, t), or (value, cells) pairs. There is no thermal strain for None and in cells
    of no pair.
    Raises RequestError for a law of finite strains.
    """
    materials.check_small()
    u = checked(space, u)
    given = temperatures(space, temperature)
    return gathered(
        space,
        lambda part: _stress(space, materials, part, u, given, t),
        laws=materials.law,
        degree=degree,
        threads=threads,
    )


def internal_force(
    space: Space,
    materials: Materials,
    u: Floats,
    *,
    temperature: TemperatureField | None = None,
    t: float = 1.0,
    threads: int = 1,
) -> NDArray[np.floating]:
    """Return f_int (n_dof,), the nodal forces of the stress of u (n_dof,).

    The result is the same to round-off for any number of threads.

    Raises RequestError for a law of finite strains.
    """
    materials.check_small()
    u = checked(space, u)
    given, slots = temperatures(space, temperature), np.array(space.model.slots)

    def cell_forces(part: Piece) -> tuple[Ints, NDArray[np.floating]]:
        stress = _dilated(space, materials, part, _stress(space, materials, part, u, given, t))
        f = np.zeros((*part.nodes.shape, space.dim))
        add_nodal_forces(part.L, part.W, stress, slots, f)
        return part.nodes, f

    out = np.zeros((space.mesh.n_nodes, space.dim))
    for nodes, f in mapped(space, cell_forces, laws=materials.law, threads=threads):
        scatter(out, nodes, f)
    return out.ravel()


@kernel
def scatter(out: Any, nodes: Any, f: Any) -> None:
    """Add nodal forces f (c, n, dim) of cells to out (n_nodes, dim), in their order."""
    for e in range(nodes.shape[0]):
        for a in range(nodes.shape[1]):
            for s in range(f.shape[2]):
                out[nodes[e, a], s] += f[e, a, s]


def temperatures(space: Space, given: TemperatureField | None) -> list[tuple[ScalarField, NDArray[np.bool_] | None]]:
    """Return (value, mask) pairs; the mask tells for each cell of the mesh if it has the value, None for all cells."""
    if given is None:
        return []
    if not isinstance(given, Sequence):
        return [(given, None)]
    pairs: list[tuple[ScalarField, NDArray[np.bool_] | None]] = []
    for value, cells in given:
        mask = None
        if cells is not None:
            mask = mask_of(space.mesh.n_cells, cells)
        pairs.append((value, mask))
    return pairs


def temperature_at(
    space: Space, part: Piece, given: list[tuple[ScalarField, NDArray[np.bool_] | None]], t: float
) -> NDArray[np.floating] | None:
    """Return the temperature (c, q) at a piece's points, NaN in cells without one; None if nothing is given."""
    if not given:
        return None
    x = coordinates(space, part)
    out = np.full(x.shape[:2], np.nan)
    index = space.blocks[part.block].cell[part.cells]
    for value, mask in given:
        rows = slice(None) if mask is None else np.flatnonzero(mask[index])
        out[rows] = evaluate(value, x[rows], t, "temperature")
    return out


def _strain(space: Space, part: Piece, u: Floats) -> NDArray[np.floating]:
    e = np.zeros((*part.W.shape, space.model.n_stress))
    add_strain(part.nodes, part.L, u.reshape(-1, space.dim), np.array(space.model.slots), e)
    return e


@kernel
def add_strain(nodes: Any, L: Any, u: Any, slots: Any, e: Any) -> None:
    """Add the strain of u (n_nodes, dim) to e (c, q, n_stress); L (c, q, rows, n)."""
    for c in range(nodes.shape[0]):
        for q in range(L.shape[1]):
            for k, i, s in slots:
                v = 0.0
                for a in range(nodes.shape[1]):
                    v += L[c, q, i, a] * u[nodes[c, a], s]
                e[c, q, k] += v


@kernel
def add_nodal_forces(L: Any, W: Any, stress: Any, slots: Any, f: Any) -> None:
    """Add the nodal forces of a stress (c, q, n_stress) to f (c, n, dim)."""
    for c in range(L.shape[0]):
        for q in range(L.shape[1]):
            for k, i, s in slots:
                v = W[c, q] * stress[c, q, k]
                for a in range(L.shape[3]):
                    f[c, a, s] += L[c, q, i, a] * v


def _stress(
    space: Space,
    materials: Materials,
    part: Piece,
    u: Floats,
    given: list[tuple[ScalarField, NDArray[np.bool_] | None]],
    t: float,
) -> NDArray[np.floating]:
    temperature = temperature_at(space, part, given, t)
    elastic = materials.elastic_strain(part.law, _strain(space, part, u), temperature)
    elastic = _dilated(space, materials, part, elastic)
    return np.asarray((elastic.reshape(-1, elastic.shape[2]) @ materials.tables[0][part.law]).reshape(elastic.shape))


def _dilated(space: Space, materials: Materials, part: Piece, values: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return strains or stresses (c, q, n); in cells with mean dilatation their trace is its mean over the cell."""
    if not (materials.mean[part.law] and may_take_the_mean(space, part.block)):
        return values
    trace, W = values[..., :3].sum(axis=2), part.W
    change = ((W * trace).sum(axis=1) / W.sum(axis=1))[:, None] - trace
    out = values.copy()
    out[..., :3] += change[..., None] / 3
    return out
