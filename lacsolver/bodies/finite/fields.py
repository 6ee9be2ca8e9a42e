"""Stress, energy and thermal stretch at integration points, one array for each block, as in `bodies.small.fields`.

First Piola stress P_si is force along s per area of the undeformed body across i; Cauchy stress P F^T / J acts on the
deformed body and is the stress that is written to results.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import DataError
from lacmesh.kernels import kernel
from lacmesh.mesh import Floats
from lacsolver.bodies.finite.dilatation import dilate, mean_of, stress_and_tangent_mean
from lacsolver.bodies.finite.equations import Stretches, check_admissible
from lacsolver.bodies.finite.laws import POINTWISE, constants
from lacsolver.bodies.finite.point import apply_thermal_stretch, gradient, stress_and_tangent, work
from lacsolver.bodies.locking import may_take_the_mean
from lacsolver.bodies.material import PLACES, Elastic, Materials
from lacsolver.bodies.small.fields import Field, TemperatureField, checked, gathered, temperature_at, temperatures
from lacsolver.bodies.small.gradients import Piece, kind
from lacsolver.space.space import Space


def thermal_stretches(
    space: Space, materials: Materials, temperature: TemperatureField | None, t: float = 1.0, degree: int | None = None
) -> Field | None:
    """Return the thermal stretches (cells, points) at time t: 1 + expansion (T - T0), and 1 where no T is given.

    None if no temperature is given at all. `temperature` as in `bodies.small.stress`. Raises DataError for a
    temperature that shrinks a cell to nothing.
    """
    given = temperatures(space, temperature)
    if not given:
        return None
    expansion = np.array([law.expansion if isinstance(law, Elastic) else 0.0 for law in materials.laws])
    start = np.array([law.reference_temperature for law in materials.laws])

    def stretch(part: Piece) -> NDArray[np.floating]:
        T = temperature_at(space, part, given, t)
        which = materials.law[part.block][part.cells]
        assert T is not None
        return 1.0 + expansion[which, None] * np.nan_to_num(T - start[which, None], nan=0.0)

    made = gathered(space, degree, stretch)
    for block, theta in zip(space.blocks, made, strict=True):
        gone = block.cell[theta.min(axis=1) <= 0]
        if len(gone):
            message = f"at time {t:.6g} the temperature shrinks cells {space.mesh.cell_names(gone)} to nothing"
            raise DataError(f"{message}; check expansion, and that temperatures are given in its unit")
    return made


def cauchy_stress(
    space: Space,
    materials: Materials,
    u: Floats,
    *,
    stretches: Stretches = None,
    degree: int | None = None,
    threads: int = 1,
) -> Field:
    """Return the Cauchy stress (cells, points, 4 or 6) at u (n_dof,), in the components of `space.COMPONENTS`.

    `stretches`: those of `thermal_stretches` for the same `degree`. Raises InadmissibleError.
    """
    places = np.array(PLACES[: space.model.n_stress])

    def make(P: Floats, F: Floats) -> NDArray[np.floating]:
        sigma = P @ F.swapaxes(2, 3) / np.linalg.det(F)[..., None, None]
        return sigma[:, :, places[:, 0], places[:, 1]]

    return evaluated(
        space, materials, u, lambda P, F, _: make(P, F), stretches=stretches, degree=degree, threads=threads
    )


def energy(space: Space, materials: Materials, u: Floats, *, stretches: Stretches = None, threads: int = 1) -> float:
    """Return the energy stored in the bodies at u (n_dof,), times thickness or around the circle.

    Of several processes each has that of its own cells. Raises InadmissibleError.
    """
    made = evaluated(space, materials, u, lambda P, F, w: w, stretches=stretches, threads=threads)
    return float(sum(part[space.own_cells(block)].sum() for part, block in zip(made, space.blocks, strict=True)))


def evaluated(
    space: Space,
    materials: Materials,
    u: Floats,
    make: Callable[[Floats, Floats, Floats], Floats],
    *,
    stretches: Stretches = None,
    degree: int | None = None,
    threads: int = 1,
) -> Field:
    """Return the results of `make` for P, F (c, q, 3, 3) and the energies (c, q) of points, weights included.

    P_si is the first Piola stress, with zz or the hoop at [2, 2].
    """
    laws, moved = constants(materials), checked(space, u).reshape(-1, space.dim)
    folded = [np.zeros(len(block.nodes), bool) for block in space.blocks]

    def of_piece(part: Piece) -> NDArray[np.floating]:
        P, F = np.zeros((2, *part.W.shape, 3, 3))
        w = np.zeros(part.W.shape)
        theta = np.empty((0, 0)) if stretches is None else stretches[part.block][part.cells]
        which, bad = materials.law[part.block][part.cells], folded[part.block][part.cells]
        may = may_take_the_mean(space, part.block)
        _fill(
            part.nodes, part.L, part.W, moved, kind(space), space.model.plane_stress, which, laws, may, theta, P, F, w,
            bad,
        )  # fmt: skip
        return np.asarray(make(P, F, w))

    made = gathered(space, degree, of_piece, threads)
    check_admissible(space, folded)
    return made


@kernel
def _fill(
    nodes: Any, L: Any, W: Any, u: Any, kind: Any, plane_stress: bool, law: Any, laws: Any, may: bool, theta: Any,
    P: Any, F: Any, w: Any, folded: Any,
) -> None:  # fmt: skip
    """Fill P and F (c, q, 3, 3) and energies w (c, q) of cells of nodes (c, n).

    Overwrites L (c, q, rows, n) and W (c, q), and sets `folded` (c,) for inverted cells, whose F is set to I.
    """
    place, mean, hot = work(), mean_of(L.shape[1]), np.empty(0)
    for e in range(len(nodes)):
        k = law[e]
        if laws.kind[k] == POINTWISE:
            for q in range(L.shape[1]):
                for s in range(3):
                    F[e, q, s, s] = 1.0
            continue
        lam, mu, p = laws.lame[k, 0], laws.lame[k, 1], 0.0
        if len(theta):
            hot = theta[e]
            apply_thermal_stretch(hot, L[e], W[e])
        whole = may and laws.mean[k]
        if whole:
            p, _, w[e, 0], _, good = dilate(nodes, e, u, L[e], W[e], hot, kind, lam, mu, mean)
            folded[e] = not good
        for q in range(L.shape[1]):
            stretch = hot[q] if len(theta) else 1.0
            if whole:
                stress_and_tangent_mean(q, p, mu, mean, place)
            else:
                gradient(nodes, e, u, L[e, q], kind.dim, kind.axisymmetric, stretch, place.F)
                _, _, energy, good = stress_and_tangent(laws.kind[k], lam, mu, plane_stress, place)
                w[e, q] = W[e, q] * energy
                folded[e] |= not good
            for s in range(3):  # one by one: quicker to compile
                for i in range(3):
                    P[e, q, s, i] = stretch**2 * place.P[s, i]
                    F[e, q, s, i] = stretch * place.F[s, i]
            if plane_stress:
                P[e, q, 2, 2] = 0.0
        if folded[e]:
            for q in range(L.shape[1]):
                for s in range(3):
                    for i in range(3):
                        F[e, q, s, i] = 1.0 if s == i else 0.0
