"""Bodies whose laws are evaluated at integration points: all of finite strains, and laws of small strains with no C.

    f_as = int P_si L_ia dV,      K_ab,st = int A_sitj L_ia L_jb dV,      A = dP/dH

over the undeformed body (total Lagrangian), with the stress P and the tangent A that a law gives for the gradient of
displacement H_si = du_s/dX_i, (3, 3) in every model: H_22 is 0 in plane strain, u_x / r in axisymmetry, and in plane
stress it is solved for from P_22 = 0. A law is a frozen record with the members of `PointLaw`; `MATERIAL_LAWS` of
`lacsolver.case.added` makes it known to case files by a name.

Everything goes through the pieces of `points`, law by law: the law is asked for its response at all points of a piece,
and what comes of it is summed (`assembly`) or put together. Under thermal expansion L and W are taken on the warm,
stress-free cell: L / theta and theta^3 W, with F_e = F / theta in place of F.

Linear laws do without all this: with one C for each law `small` assembles K in a fraction of the time. Where
`finite` is False their cells are left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats
from lacsolver.bodies.assembly import NO_MEAN, MeanTerms, OwnedRows, add_cells, assemble, block_values, matrix
from lacsolver.bodies.dilatation import mean_response, with_mean_pressure
from lacsolver.bodies.errors import InadmissibleError
from lacsolver.bodies.hyperelastic import Hyperelastic, NeoHookean
from lacsolver.bodies.locking import may_take_the_mean
from lacsolver.bodies.material import PLACES, Materials, PointLaw, PointResponse
from lacsolver.bodies.plastic import LARGEST_FLOW, Plastic
from lacsolver.bodies.points import Field, Piece, Span, checked, gathered, kind, piece
from lacsolver.space.space import Space

__all__ = ["DisplacedBodies", "LawHistory", "PointLaw", "PointResponse"]

#: histories of laws: an array (cells, points, n) for each block of the space, () if no law has one
LawHistory = tuple[NDArray[np.floating], ...]
#: thermal stretches, (cells, points) for each block; None for 1 everywhere
Stretches = Sequence[Floats] | None
#: Newton's method for H_22 of plane stress: relative tolerance of P_22, largest number of iterations
_CLOSE, _STEPS = 1e-12, 60


class _Response(NamedTuple):
    """Response at the points of a piece: gradient `H` of F_e, P and energy per volume, A unless empty, history.

    `mean`: terms of its cells with mean dilatation.
    """

    H: Floats
    stress: Floats
    tangent: Floats
    energy: Floats
    history: Floats
    mean: MeanTerms


@dataclass(frozen=True, eq=False)
class DisplacedBodies:
    """Bodies at a displacement u (n_dof,): their forces, tangent, energy and stress.

    `stretches`: those of `finite.thermal_stretches`. `history`: what the laws committed at the end of the last step.
    `finite`: False for small strains, of which only cells of laws that are evaluated at points are taken. Raises
    RequestError for a law of small strains if `finite`; the methods raise InadmissibleError where u inverts a cell at
    one of its integration points, or lets a metal flow too far in a step.

    >>> from lacmesh import Mesh
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
    stretches: Stretches = None
    history: LawHistory = ()
    threads: int = 1
    finite: bool = True

    def __post_init__(self) -> None:
        checked(self.space, self.u)
        if self.finite:
            self.materials.check_finite()

    def internal_force(self) -> NDArray[np.floating]:
        """Return the internal forces f_int (n_dof,), the same to round-off for any number of threads."""
        return self._summed(np.empty((0, self.space.dim, self.space.dim)))

    def tangent(self, out: NDArray[np.floating] | None = None) -> bsr_array:
        """Return the symmetric K = df_int/du (n_dof, n_dof) in dim x dim blocks.

        `out` (n_blocks, dim, dim): array that the values of K are written to; None allocates a new one.
        """
        K = block_values(self.space, out)
        self._summed(K)
        return matrix(self.space, K)

    def energy(self) -> float:
        """Return the energy stored, times thickness or around the circle; of several processes, in its own cells."""
        blocks, stored = self.space.blocks, self._gathered(lambda part, response: part.W * response.energy)
        return float(sum(part[self.space.own_cells(block)].sum() for part, block in zip(stored, blocks, strict=True)))

    def cauchy_stress(self, degree: int | None = None) -> Field:
        """Return the Cauchy stress P F^T / J (cells, points, 4 or 6), in the components of `space.COMPONENTS`.

        At small strains it is the stress P, and 0 in cells of linear laws. `degree`: that of the stretches.
        """
        rows, columns = np.array(PLACES[: self.space.model.n_stress]).T

        def stress(part: Piece, response: _Response) -> NDArray[np.floating]:
            sigma = response.stress
            if self.finite:
                F = response.H + np.eye(3)
                sigma = sigma @ F.swapaxes(2, 3) / np.linalg.det(F)[..., None, None]
            return np.asarray(sigma[:, :, rows, columns])

        return self._gathered(stress, degree)

    def commit(self) -> LawHistory:
        """Return the history of the laws at the end of a step that led to u; () if no law has one."""
        n = max(getattr(law, "n_history", 0) for law in self.materials.laws)
        if not n:
            return ()

        def padded(part: Piece, response: _Response) -> NDArray[np.floating]:
            out = np.zeros((*part.W.shape, n))
            out[..., : response.history.shape[2]] = response.history
            return out

        return self._gathered(padded)

    def evaluated(self, make: Callable[[Floats, Floats], Floats]) -> Field:
        """Return the results of `make` for P and F (c, q, 3, 3) at the points, with zz or the hoop at [2, 2].

        P_si is the first Piola stress, force along s per undeformed area across i.
        """

        def of_piece(part: Piece, response: _Response) -> NDArray[np.floating]:
            P, F = response.stress, response.H + np.eye(3)
            if self.stretches is not None:
                stretch = np.asarray(self.stretches[part.block])[part.cells, :, None, None]
                P, F = stretch**2 * P, stretch * F
            return np.asarray(make(P, F))

        return self._gathered(of_piece)

    @cached_property
    def _overstrained(self) -> tuple[NDArray[np.bool_], ...]:
        """Mask of the cells of each block that flow too far in one step, filled by `_respond`."""
        return tuple(np.zeros(len(block.nodes), bool) for block in self.space.blocks)

    @cached_property
    def _inverted(self) -> tuple[NDArray[np.bool_], ...]:
        """Mask of the inverted cells of each block, filled by `_respond`."""
        return tuple(np.zeros(len(block.nodes), bool) for block in self.space.blocks)

    def _summed(self, K: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return f_int, and add the values of K to `K` unless that array is empty."""
        space = self.space
        f = np.zeros((space.mesh.n_nodes, space.dim))

        def add(span: Span, rows: OwnedRows) -> None:
            part = piece(space, span)
            if self._is_by_points(part):
                response = self._respond(part, tangent=len(K) > 0)
                P, A, mean = response.stress, response.tangent, response.mean
                add_cells(part.nodes, part.L, part.W, P, A, mean, kind(space), rows)

        assemble(space, self.materials.law, add, f, K, self.threads)
        self._check_admissible()
        return f.ravel()

    def _gathered(self, make: Callable[[Piece, _Response], NDArray[np.floating]], degree: int | None = None) -> Field:
        """Return the arrays that `make` gives for the pieces, put together block by block."""

        def of_piece(part: Piece) -> NDArray[np.floating]:
            response = self._respond(part) if self._is_by_points(part) else _no_response(part)
            bad = self._inverted[part.block][part.cells]
            if bad.any():  # an error names them when all are known
                response.H[bad], response.stress[bad], response.energy[bad] = 0.0, 0.0, 0.0
            return make(part, response)

        values = gathered(self.space, of_piece, laws=self.materials.law, degree=degree, threads=self.threads)
        self._check_admissible()
        return values

    def _is_by_points(self, part: Piece) -> bool:
        """True for a piece of cells whose law is evaluated at points."""
        return len(part.cells) > 0 and self.materials.pointwise[part.law]

    def _respond(self, part: Piece, tangent: bool = False) -> _Response:
        """Return the response in a piece, whose L and W become those of the warm, stress-free cells."""
        law: Any = self.materials.laws[part.law]
        H, shape = self._gradient(part), part.W.shape
        answer, mean = self._ask(law, part, H, tangent)
        if law.finite:
            inverted = np.zeros(len(H), bool)
            mark_inverted(H, inverted)
            self._inverted[part.block][part.cells] = inverted
        P, A = np.ascontiguousarray(answer.stress, float), np.empty((0, 0, 3, 3, 3, 3))
        if tangent:
            A = np.ascontiguousarray(answer.tangent, float).reshape(*shape, 3, 3, 3, 3)
        history = np.reshape(answer.history, (*shape, law.n_history))
        if isinstance(law, Plastic):
            grown = history[..., 0] - self._memory(law, part)[..., 0]
            self._overstrained[part.block][part.cells] = (grown > LARGEST_FLOW).any(axis=1)
        return _Response(H, P.reshape(H.shape), A, np.reshape(answer.energy, shape), history, mean)

    def _ask(self, law: Any, part: Piece, H: Floats, tangent: bool) -> tuple[PointResponse, MeanTerms]:
        """Return the answer (c q) of a law to gradients H (c, q, 3, 3), whose H_22 is filled in for plane stress."""
        flat, plane_stress = H.reshape(-1, 3, 3), self.space.model.plane_stress
        mean = getattr(law, "mean_dilatation", False) and may_take_the_mean(self.space, part.block)
        if isinstance(law, NeoHookean) and mean:
            return mean_response(law, H, part.W, tangent)
        memory = self._memory(law, part).reshape(len(flat), law.n_history)
        if isinstance(law, Plastic) and mean:
            return with_mean_pressure(law, H, part.W, law.respond(flat, memory, tangent=tangent, mean=True), tangent)
        if isinstance(law, (Hyperelastic, Plastic)):
            return law.respond(flat, memory, plane_stress=plane_stress, tangent=tangent), NO_MEAN
        return _plane_stress(law, flat, memory) if plane_stress else law.respond(flat, memory), NO_MEAN

    def _memory(self, law: Any, part: Piece) -> NDArray[np.floating]:
        """Return the history (c, q, n_history) of a piece, 0 at the start."""
        if not self.history:
            return np.zeros((*part.W.shape, law.n_history))
        return np.ascontiguousarray(self.history[part.block][part.cells, :, : law.n_history])

    def _gradient(self, part: Piece) -> NDArray[np.floating]:
        """Return H (c, q, 3, 3) of F_e = I + H, at small strains without the thermal strain."""
        theta = None
        if self.stretches is not None:
            theta = np.asarray(self.stretches[part.block])[part.cells]
            if self.finite:
                part.L[:] /= theta[..., None, None]
                part.W[:] *= theta**3
        H = np.empty((*part.W.shape, 3, 3))
        fill_gradient(part.nodes, part.L, np.asarray(self.u, float).reshape(-1, self.space.dim), kind(self.space), H)
        if theta is not None:
            np.einsum("cqii->cqi", H)[:] += ((1.0 - theta) / (theta if self.finite else 1.0))[..., None]
        return H

    def _check_admissible(self) -> None:
        blocks, mesh = self.space.blocks, self.space.mesh
        faults = "are inverted by this displacement", f"have plastic strains that grow by more than {LARGEST_FLOW:g}"
        for what, masks in zip(faults, (self._inverted, self._overstrained), strict=True):
            cells = np.concatenate([block.cell[bad] for block, bad in zip(blocks, masks, strict=True)])
            if len(cells):
                message = f"cells {mesh.cell_names(cells)} {what}; take smaller steps"
                raise InadmissibleError(message, mesh.cell_number[cells])


def _no_response(part: Piece) -> _Response:
    """Return zeros."""
    zero, none = np.zeros((*part.W.shape, 3, 3)), np.empty((*part.W.shape, 0))
    return _Response(zero, zero, np.empty((0, 0, 3, 3, 3, 3)), np.zeros(part.W.shape), none, NO_MEAN)


def _plane_stress(law: PointLaw, H: Floats, history: Floats) -> PointResponse:
    """Fill in H_22 (k,) such that P_22 = 0, in place, and return the response without the direction 22."""
    respond: Callable[[Floats, Floats], PointResponse] = law.respond
    answer = respond(H, history)
    for _ in range(_STEPS):
        across, stiff = answer.stress[:, 2, 2], answer.tangent[:, 2, 2, 2, 2]
        step = across / stiff
        if np.abs(step).max(initial=0.0) <= _CLOSE * (1.0 + np.abs(H[:, 2, 2]).max(initial=0.0)):
            break
        H[:, 2, 2] -= step
        answer = respond(H, history)
    row, column = answer.tangent[:, 2, 2], answer.tangent[:, :, :, 2, 2]
    condensed = np.einsum("ksi,ktj,k->ksitj", column, row, 1 / answer.tangent[:, 2, 2, 2, 2])
    return answer._replace(tangent=answer.tangent - condensed)


@kernel
def fill_gradient(nodes: Any, L: Any, u: Any, kind: Any, H: Any) -> None:
    """Fill H (c, q, 3, 3) with du_s/dX_i of cells of nodes (c, n) at u (n_nodes, dim); L (c, q, rows, n)."""
    for e in range(len(nodes)):
        for q in range(L.shape[1]):
            h00 = h01 = h02 = h10 = h11 = h12 = h20 = h21 = h22 = 0.0
            for a in range(nodes.shape[1]):
                p = nodes[e, a]
                u0, u1, g0, g1 = u[p, 0], u[p, 1], L[e, q, 0, a], L[e, q, 1, a]
                h00 += u0 * g0
                h01 += u0 * g1
                h10 += u1 * g0
                h11 += u1 * g1
                if kind.dim == 3:
                    u2, g2 = u[p, 2], L[e, q, 2, a]
                    h02 += u0 * g2
                    h12 += u1 * g2
                    h20 += u2 * g0
                    h21 += u2 * g1
                    h22 += u2 * g2
                elif kind.axisymmetric:
                    h22 += u0 * L[e, q, 2, a]
            H[e, q, 0, 0], H[e, q, 0, 1], H[e, q, 0, 2] = h00, h01, h02
            H[e, q, 1, 0], H[e, q, 1, 1], H[e, q, 1, 2] = h10, h11, h12
            H[e, q, 2, 0], H[e, q, 2, 1], H[e, q, 2, 2] = h20, h21, h22


@kernel
def mark_inverted(H: Any, inverted: Any) -> None:
    """Set `inverted` (c,) for cells where det(I + H), H (c, q, 3, 3), is not above 0 at every point."""
    for e in range(len(H)):
        for q in range(H.shape[1]):
            h = H[e, q]
            a, b, c = 1.0 + h[0, 0], 1.0 + h[1, 1], 1.0 + h[2, 2]
            J = a * (b * c - h[1, 2] * h[2, 1]) - h[0, 1] * (h[1, 0] * c - h[1, 2] * h[2, 0])
            J += h[0, 2] * (h[1, 0] * h[2, 1] - b * h[2, 0])
            if not J > 0.0:
                inverted[e] = True
