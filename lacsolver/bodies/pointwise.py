"""Bodies at a displacement: stress and tangent of their laws at integration points, and what is summed from them.

    f_as = int P_si L_ia dV,      K_ab,st = int A_sitj L_ia L_jb dV,      A = dP/dH

over the undeformed body (total Lagrangian). A law gives the stress P and the tangent A for the gradient of displacement
H_si = du_s/dX_i, (3, 3) in every model. One pass through the pieces of `points`, law by law, does in this order:

    H       0 at [2, 2] in plane strain, u_x / r there in axisymmetry
    warmth  H - (T - T0) alpha at small strains; F / theta in place of F at finite ones, L / theta and theta^3 W
    mean    the mean change of volume of a cell (`dilatation`), if the law has it and the cell takes it
    law     P, A, energy and history; in plane stress H_22 is solved for from P_22 = 0
    sums    forces and tangent (`assembly`), or fields of the points

A law is a frozen record with the members of `PointLaw`; `MATERIAL_LAWS` of `lacsolver.case.added` makes it known to
case files by a name. The stiffness of linear laws is constant, and `small` assembles it in a fraction of the time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array

from lacmesh.mesh import Floats
from lacsolver.bodies.assembly import NO_MEAN, OwnedRows, add_cells, assemble, block_values, matrix
from lacsolver.bodies.deformation import mark_inverted
from lacsolver.bodies.dilatation import add_mean_pressure, dilated
from lacsolver.bodies.errors import InadmissibleError
from lacsolver.bodies.hyperelastic import Hyperelastic
from lacsolver.bodies.locking import may_take_the_mean
from lacsolver.bodies.material import PLACES, LinearLaw, Materials, PointLaw, PointResponse
from lacsolver.bodies.plastic import LARGEST_FLOW, Plastic
from lacsolver.bodies.points import Field, Piece, Span, checked, fill_gradient, gathered, kind, piece
from lacsolver.bodies.temperature import stretches
from lacsolver.space.space import Space

__all__ = ["DisplacedBodies", "LawHistory", "PointLaw", "PointResponse"]

#: histories of laws: an array (cells, points, n) for each block of the space, () if no law has one
LawHistory = tuple[NDArray[np.floating], ...]
#: Newton's method for H_22 of plane stress: step after which it has converged, as its error is the square of the step,
#: and largest number of iterations
_CLOSE, _STEPS = 1e-9, 80


class _Points(NamedTuple):
    """Response at the points of a piece (c, q, ...): gradient `H` of F_e, stress, tangent or none, energy, history.

    Where the cells have the mean dilatation `stretch` (c, q) is that of `dilatation`, and the stress that of the law
    alone, to its own gradient; None elsewhere.
    """

    H: Floats
    stress: Floats
    tangent: Floats
    energy: Floats
    history: Floats
    stretch: Floats | None


@dataclass(frozen=True, eq=False)
class DisplacedBodies:
    """Bodies at a displacement u (n_dof,): their forces, tangent, energy and stress.

    `warmer`: T - T0 of `temperature.warming`. `history`: what the laws committed at the end of the last step. `finite`:
    False for small strains. Raises RequestError for a law of the other kind; the methods raise InadmissibleError where
    u inverts a cell at one of its integration points, or lets a metal flow too far in a step.

    >>> from lacmesh import Mesh
    >>> from lacsolver.bodies.hyperelastic import NeoHookean
    >>> bar = Mesh.create([[0, 0], [1, 0], [1, 1], [0, 1]], [("QUAD4", [[0, 1, 2, 3]])])
    >>> space = Space.of(bar, "plane_stress")
    >>> turned = np.array([0, 0, -1, 1, -2, 0, -1, -1.0])  # by 90 degrees
    >>> body = DisplacedBodies(space, Materials.of(space, NeoHookean(young=1.0, poisson=0.3)), turned)
    >>> float(abs(body.internal_force()).max()), body.tangent().shape
    (0.0, (8, 8))
    """

    space: Space
    materials: Materials
    u: Floats
    warmer: Sequence[Floats] | None = None
    history: LawHistory = ()
    threads: int = 1
    finite: bool = True

    def __post_init__(self) -> None:
        checked(self.space, self.u)
        if self.finite:
            self.materials.check_finite()
        else:
            self.materials.check_small()

    def internal_force(self, laws: Sequence[bool] | None = None) -> NDArray[np.floating]:
        """Return the internal forces f_int (n_dof,), the same to round-off for any number of threads.

        `laws`: those whose cells are summed, all if None.
        """
        return self._summed(np.empty((0, self.space.dim, self.space.dim)), laws)

    def tangent(self, out: NDArray[np.floating] | None = None, laws: Sequence[bool] | None = None) -> bsr_array:
        """Return the symmetric K = df_int/du (n_dof, n_dof) in dim x dim blocks; `laws` as in `internal_force`.

        `out` (n_blocks, dim, dim): array that the values of K are written to; None allocates a new one.
        """
        K = block_values(self.space, out)
        self._summed(K, laws)
        return matrix(self.space, K)

    def energy(self) -> float:
        """Return the energy stored, times thickness or around the circle; of several processes, in its own cells."""
        blocks, stored = self.space.blocks, self._gathered(lambda part, points: part.W * points.energy)
        return float(sum(part[self.space.own_cells(block)].sum() for part, block in zip(stored, blocks, strict=True)))

    def cauchy_stress(self) -> Field:
        """Return the Cauchy stress P F^T / J (cells, points, 4 or 6), in the components of `space.COMPONENTS`.

        At small strains it is that of the law, in cells with mean dilatation to the strain with the mean of its trace.
        """
        rows, columns = np.array(PLACES[: self.space.model.n_stress]).T

        def stress(part: Piece, points: _Points) -> NDArray[np.floating]:
            sigma = points.stress
            if self.finite:
                F = points.H + np.eye(3)
                sigma = self._of_cells(part, points) @ F.swapaxes(2, 3) / np.linalg.det(F)[..., None, None]
            return np.asarray(sigma[:, :, rows, columns])

        return self._gathered(stress)

    def commit(self) -> LawHistory:
        """Return the history of the laws at the end of a step that led to u; () if no law has one."""
        n = max(law.n_history for law in self.materials.at_points)
        if not n:
            return ()

        def padded(part: Piece, points: _Points) -> NDArray[np.floating]:
            out = np.zeros((*part.W.shape, n))
            out[..., : points.history.shape[2]] = points.history
            return out

        return self._gathered(padded)

    def evaluated(self, make: Callable[[Floats, Floats], Floats]) -> Field:
        """Return the results of `make` for P and F (c, q, 3, 3) at the points, with zz or the hoop at [2, 2].

        P_si is the first Piola stress, force along s per undeformed area across i.
        """

        def of_piece(part: Piece, points: _Points) -> NDArray[np.floating]:
            P, F = self._of_cells(part, points), points.H + np.eye(3)
            if self._stretches is not None:
                theta = self._stretches[part.block][part.cells, :, None, None]
                P, F = theta**2 * P, theta * F
            return np.asarray(make(P, F))

        return self._gathered(of_piece)

    @cached_property
    def _stretches(self) -> Field | None:
        """Thermal stretches (cells, points) of finite strains; None without temperature."""
        if self.warmer is None or not self.finite:
            return None
        return stretches(self.space, self.materials, tuple(self.warmer))

    @cached_property
    def _overstrained(self) -> tuple[NDArray[np.bool_], ...]:
        """Mask of the cells of each block that flow too far in one step, filled by `_respond`."""
        return tuple(np.zeros(len(block.nodes), bool) for block in self.space.blocks)

    @cached_property
    def _inverted(self) -> tuple[NDArray[np.bool_], ...]:
        """Mask of the inverted cells of each block, filled by `_respond`."""
        return tuple(np.zeros(len(block.nodes), bool) for block in self.space.blocks)

    def _summed(self, K: NDArray[np.floating], laws: Sequence[bool] | None) -> NDArray[np.floating]:
        """Return f_int, and add the values of K to `K` unless that array is empty."""
        space = self.space
        f = np.zeros((space.mesh.n_nodes, space.dim))

        def add(span: Span, rows: OwnedRows) -> None:
            if not len(span[2]) or not (laws is None or laws[span[1]]):
                return
            part, mean = piece(space, span), NO_MEAN
            points = self._respond(part, tangent=len(K) > 0)
            if points.stretch is not None:
                mean = add_mean_pressure(self.finite, points.H, part.W, points.stretch, points.stress, points.tangent)
            add_cells(part.nodes, part.L, part.W, points.stress, points.tangent, mean, kind(space), rows)

        assemble(space, self.materials.law, add, f, K, self.threads)
        self._check_admissible()
        return f.ravel()

    def _gathered(self, make: Callable[[Piece, _Points], NDArray[np.floating]]) -> Field:
        """Return the arrays that `make` gives for the pieces, put together block by block."""

        def of_piece(part: Piece) -> NDArray[np.floating]:
            points = self._respond(part) if len(part.cells) else _no_points(part)
            bad = self._inverted[part.block][part.cells]
            if bad.any():  # an error names them when all are known
                points.H[bad], points.stress[bad], points.energy[bad] = 0.0, 0.0, 0.0
            return make(part, points)

        values = gathered(self.space, of_piece, laws=self.materials.law, threads=self.threads)
        self._check_admissible()
        return values

    def _respond(self, part: Piece, tangent: bool = False) -> _Points:
        """Return the response in a piece, whose L and W become those of the warm, stress-free cells."""
        law: Any = self.materials.at_points[part.law]
        H, shape, stretch = self._gradient(part), part.W.shape, None
        memory = self._memory(law, part).reshape(part.W.size, law.n_history)
        own = H
        if getattr(law, "mean_dilatation", False) and may_take_the_mean(self.space, part.block):
            own, stretch = dilated(H, part.W, self.finite)
        solve = self.space.model.plane_stress and not isinstance(law, LinearLaw)
        answer = (respond_in_plane_stress if solve else _ask)(law, own.reshape(-1, 3, 3), memory, tangent)
        inverted = np.isnan(H[..., 2, 2]).any(axis=1)
        if self.finite:
            mark_inverted(H, inverted)
        self._inverted[part.block][part.cells] = inverted
        history = np.reshape(answer.history, (*shape, law.n_history))
        if isinstance(law, Plastic):
            flow = (history - memory.reshape(history.shape))[..., 0]
            self._overstrained[part.block][part.cells] = (flow > LARGEST_FLOW).any(axis=1)
        P, A = np.ascontiguousarray(answer.stress, float).reshape(H.shape), np.empty((0, 0, 3, 3, 3, 3))
        if tangent:
            A = np.ascontiguousarray(answer.tangent, float).reshape(*shape, 3, 3, 3, 3)
        return _Points(H, P, A, np.reshape(answer.energy, shape), history, stretch)

    def _of_cells(self, part: Piece, points: _Points) -> Floats:
        """Return the stress P (c, q, 3, 3) whose work is the forces', with the pressure of the cells."""
        if points.stretch is None:
            return points.stress
        P = points.stress.copy()
        add_mean_pressure(self.finite, points.H, part.W, points.stretch, P, points.tangent)
        return P

    def _memory(self, law: PointLaw, part: Piece) -> NDArray[np.floating]:
        """Return the history (c, q, n_history) of a piece, 0 at the start."""
        if not self.history:
            return np.zeros((*part.W.shape, law.n_history))
        return np.ascontiguousarray(self.history[part.block][part.cells, :, : law.n_history])

    def _gradient(self, part: Piece) -> NDArray[np.floating]:
        """Return H (c, q, 3, 3) of F_e = I + H, at small strains without the thermal strain."""
        theta = None
        if self._stretches is not None:
            theta = self._stretches[part.block][part.cells]
            part.L[:] /= theta[..., None, None]
            part.W[:] *= theta**3
        H = np.empty((*part.W.shape, 3, 3))
        fill_gradient(part.nodes, part.L, np.asarray(self.u, float).reshape(-1, self.space.dim), kind(self.space), H)
        if theta is not None:
            np.einsum("cqii->cqi", H)[:] += ((1.0 - theta) / theta)[..., None]
        elif self.warmer is not None:
            H -= self.warmer[part.block][part.cells][..., None, None] * self.materials.thermal_strain[part.law]
        return H

    def _check_admissible(self) -> None:
        blocks, mesh = self.space.blocks, self.space.mesh
        faults = "are inverted by this displacement", f"have plastic strains that grow by more than {LARGEST_FLOW:g}"
        for what, masks in zip(faults, (self._inverted, self._overstrained), strict=True):
            cells = np.concatenate([block.cell[bad] for block, bad in zip(blocks, masks, strict=True)])
            if len(cells):
                message = f"cells {mesh.cell_names(cells)} {what}; take smaller steps"
                raise InadmissibleError(message, mesh.cell_number[cells])


def _no_points(part: Piece) -> _Points:
    """Return the response of a piece without cells."""
    zero, none = np.zeros((*part.W.shape, 3, 3)), np.empty((*part.W.shape, 0))
    return _Points(zero, zero, np.empty((0, 0, 3, 3, 3, 3)), np.zeros(part.W.shape), none, None)


def _ask(law: Any, H: Floats, history: Floats, tangent: bool) -> PointResponse:
    """Return the response of a law to gradients H (k, 3, 3); those of this package form a tangent only if asked to."""
    own = isinstance(law, (Hyperelastic, Plastic, LinearLaw))
    answer: PointResponse = law.respond(H, history, tangent) if own else law.respond(H, history)
    return answer


def respond_in_plane_stress(law: Any, H: Floats, history: Floats, tangent: bool = True) -> PointResponse:
    """Fill in H_22 (k,) such that P_22 = 0, in place, and return the response without the direction 22.

    Newton's method for Kirchhoff's stress P_22 F_22 as a function of x = ln F_22, in which laws are least curved; at
    small strains for P_22 and x = H_22. The stress grows with x, so that the root stays between bounds. Where there is
    no root, H_22 becomes NaN.
    """
    H[:, 2, 2] = 0.0
    n, size = len(H), np.abs(H).reshape(-1, 9).max(axis=1)
    x, low, high, left, failed = np.zeros(n), np.full(n, -np.inf), np.full(n, np.inf), np.arange(n), np.zeros(n, bool)
    for _ in range(_STEPS):
        answer, at = _ask(law, H[left], history[left], True), x[left]
        across, stiff, F = answer.stress[:, 2, 2], answer.tangent[:, 2, 2, 2, 2], 1.0 + H[left, 2, 2]
        with np.errstate(all="ignore"):
            step = across / (stiff * F + across if law.finite else stiff)
        low[left], high[left] = np.where(across < 0, at, low[left]), np.where(across > 0, at, high[left])
        done, failed[left] = np.abs(step) <= _CLOSE * (np.abs(at) + size[left]), ~np.isfinite(step)
        x[left] = np.where(done, at - step, _bounded(at, step, low[left], high[left]))
        H[left, 2, 2] = np.expm1(x[left]) if law.finite else x[left]
        left = left[~done & ~failed[left]]
        if not len(left):
            break
    failed[left] = True
    H[failed, 2, 2] = 0.0
    answer = _ask(law, H, history, tangent)
    H[failed, 2, 2] = np.nan
    stress, A = np.array(answer.stress, float), answer.tangent
    stress[:, 2, 2] = 0.0
    if tangent:
        with np.errstate(all="ignore"):
            A = A - np.einsum("ksi,ktj,k->ksitj", A[:, :, :, 2, 2], A[:, 2, 2], 1 / A[:, 2, 2, 2, 2])
    return answer._replace(stress=stress, tangent=A)


def _bounded(x: Floats, step: Floats, low: Floats, high: Floats) -> Floats:
    """Return x - step (k,) between bounds; where it leaves them their middle, or x moved by 1/2 if one is infinite."""
    with np.errstate(invalid="ignore"):
        new, middle = x - step, 0.5 * (low + high)
    beyond = np.where(np.isfinite(low), x + 0.5, x - 0.5)
    return np.where((new > low) & (new < high), new, np.where(np.isfinite(middle), middle, beyond))
