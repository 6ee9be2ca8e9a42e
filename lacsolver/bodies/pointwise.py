"""Laws that are evaluated at integration points: the general element loop, for any law with or without memory.

    f_as = int P_si L_ia dV,      K_ab,st = int A_sitj L_ia L_jb dV,      A = dP/dH

with the stress P and the tangent A that a law gives for the gradient of displacement H_si = du_s/dX_i, (3, 3) in every
model: H_22 is 0 in plane strain, u_x / r in axisymmetry, and in plane stress it is solved for from P_22 = 0. A law is a
frozen record with the members of `PointLaw`; `MATERIAL_LAWS` of `lacsolver.case.added` makes it known to case files by
a name. The laws that lacsolver comes with do without this loop: with one C for each law (small strains) or two
constants (finite strains) their kernels assemble K in a tenth of its time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.bodies.finite.equations import check_admissible
from lacsolver.bodies.material import PLACES, Materials
from lacsolver.bodies.small.fields import Field, checked, mapped, scatter
from lacsolver.bodies.small.gradients import Piece, nodal, table
from lacsolver.space.space import Space

#: histories of laws: an array (cells, points, n) for each block of the space, () if no law has one
LawHistory = tuple[NDArray[np.floating], ...]
#: Newton's method for H_22 of plane stress: relative tolerance of P_22, largest number of iterations
_CLOSE, _STEPS = 1e-12, 60


class PointResponse(NamedTuple):
    """Answer of a law at points (k,): `stress` P (k, 3, 3), `tangent` A (k, 3, 3, 3, 3), and `energy` (k,) per volume.

    P_si is force along s per undeformed area across i (first Piola; under small strains symmetric). A_sitj =
    dP_si/dH_tj has the symmetry A_sitj = A_tjsi. `history` (k, n_history): the new one, if the step ended here.
    """

    stress: Floats
    tangent: Floats
    energy: Floats
    history: Floats


class PointLaw(Protocol):
    """Interface of a law that is evaluated at points."""

    #: True for a law of finite strains
    finite: bool
    #: number of values that a point keeps from step to step; 0 at the start
    n_history: int

    @property
    def density(self) -> float:
        """Mass per volume."""

    @property
    def reference_temperature(self) -> float:
        """Temperature at which there is no thermal strain; a law at points has none at any temperature."""

    def respond(self, H: Floats, history: Floats) -> PointResponse:
        """Return the response to gradients of displacement H (k, 3, 3), after a history (k, n_history)."""


class _Points(NamedTuple):
    """Response at all points of the cells of one law in a piece: rows of the piece's cells, H and the law's answer."""

    rows: Ints
    H: NDArray[np.floating]
    answer: PointResponse


@dataclass(frozen=True, eq=False)
class PointwiseBodies:
    """The cells of a space whose laws are evaluated at points. `finite`: True to refuse inverted cells."""

    space: Space
    materials: Materials
    threads: int = 1
    finite: bool = False

    def internal_force(self, u: Floats, history: LawHistory = ()) -> NDArray[np.floating]:
        """Return f_int (n_dof,) of these cells at u (n_dof,). Raises InadmissibleError where u inverts a cell."""
        out = np.zeros((self.space.mesh.n_nodes, self.space.dim))
        for part, points in self._evaluated(u, history):
            P = points.answer.stress.reshape(*points.H.shape[:2], 9)[..., self._components] * self._exists
            f = np.einsum("cq,cqsi,cqia->cas", part.W[points.rows], P, part.L[points.rows], optimize=True)
            scatter(out, part.nodes[points.rows], np.ascontiguousarray(f))
        return out.ravel()

    def tangent(self, u: Floats, history: LawHistory = ()) -> csr_array:
        """Return K = df_int/du (n_dof, n_dof) of these cells at u (n_dof,)."""
        n, dim = self.space.n_dof, self.space.dim
        rows, columns, values = [np.empty(0, int)], [np.empty(0, int)], [np.empty(0)]
        for part, points in self._evaluated(u, history):
            A = points.answer.tangent.reshape(*points.H.shape[:2], 9, 9)
            A = A[:, :, self._components][..., self._components]
            A = A * self._exists[..., None, None] * self._exists
            L, W = part.L[points.rows], part.W[points.rows]
            K = np.einsum("cq,cqsitj,cqia,cqjb->casbt", W, A, L, L, optimize=True)
            dofs = self.space.dofs(part.nodes[points.rows].ravel()).reshape(len(L), -1, dim)
            rows.append(np.broadcast_to(dofs[:, :, :, None, None], K.shape).ravel())
            columns.append(np.broadcast_to(dofs[:, None, None], K.shape).ravel())
            values.append(K.ravel())
        made = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        return coo_array(made, shape=(n, n)).tocsr()

    def energy(self, u: Floats, history: LawHistory = ()) -> float:
        """Return the energy stored in these cells at u (n_dof,), of several processes in its own ones."""
        total = 0.0
        for part, points in self._evaluated(u, history):
            own = self.space.own_cells(self.space.blocks[part.block])[part.cells][points.rows]
            stored = part.W[points.rows] * points.answer.energy.reshape(points.H.shape[:2])
            total += float(stored[own].sum())
        return total

    def commit(self, u: Floats, history: LawHistory = ()) -> LawHistory:
        """Return the history at the end of a step that led to u (n_dof,)."""
        n, axisymmetric = self._n_history, self.space.model.axisymmetric
        if not n:
            return ()
        blocks = self.space.blocks
        out = tuple(np.zeros((len(b.nodes), len(table(b.type, axisymmetric).w), n)) for b in blocks)
        for part, (rows, H, answer) in self._evaluated(u, history):
            kept = answer.history.reshape(*H.shape[:2], -1)
            out[part.block][part.cells.start + rows, :, : kept.shape[2]] = kept
        return out

    def with_stress(self, field: Field, u: Floats, history: LawHistory = ()) -> Field:
        """Return a stress field (cells, points, 4 or 6) with the Cauchy stress of these cells at u (n_dof,)."""
        places = np.array(PLACES[: self.space.model.n_stress])
        out = tuple(values.copy() for values in field)
        for part, (rows, H, answer) in self._evaluated(u, history):
            sigma = answer.stress.reshape(H.shape)
            if self.finite:
                F = H + np.eye(3)
                sigma = sigma @ F.swapaxes(2, 3) / np.linalg.det(F)[..., None, None]
            out[part.block][part.cells.start + rows] = sigma[:, :, places[:, 0], places[:, 1]]
        return out

    @cached_property
    def _n_history(self) -> int:
        return max((law.n_history for _, law in self.materials.pointwise), default=0)

    @cached_property
    def _components(self) -> Ints:
        """Index (dim, rows) into the nine components of P that each entry L_i u_s works on: s i, and the hoop."""
        dim, rows = self.space.dim, self.space.model.rows
        out = 3 * np.arange(dim)[:, None] + np.arange(rows)
        if self.space.model.axisymmetric:
            out[0, 2] = 8
        return out

    @cached_property
    def _exists(self) -> NDArray[np.floating]:
        """Mask (dim, rows), 1 where an entry of `_components` exists: in axisymmetry there is no L_2 u_y."""
        out = np.ones(self._components.shape)
        if self.space.model.axisymmetric:
            out[1, 2] = 0.0
        return out

    def _evaluated(self, u: Floats, history: LawHistory) -> Iterator[tuple[Piece, _Points]]:
        """Yield the responses, law by law, of every piece of the space, in order."""
        u = checked(self.space, u)

        def answers(part: Piece) -> tuple[Piece, list[_Points]]:
            which = self.materials.law[part.block][part.cells]
            made = [(k, law, np.flatnonzero(which == k)) for k, law in self.materials.pointwise]
            return part, [self._answer(part, law, rows, u, history) for _, law, rows in made if len(rows)]

        inverted = [np.zeros(len(block.nodes), bool) for block in self.space.blocks]
        for part, made in mapped(self.space, None, answers, self.threads):
            for points in made:
                if self.finite:
                    J = np.linalg.det(points.H + np.eye(3))
                    inverted[part.block][part.cells.start + points.rows] = ~(J > 0).all(axis=1)
                yield part, points
        check_admissible(self.space, inverted)

    def _answer(self, part: Piece, law: PointLaw, rows: Ints, u: Floats, history: LawHistory) -> _Points:
        """Return the response at the points of some cells of a piece."""
        dim, model = self.space.dim, self.space.model
        H = np.zeros((len(rows), part.W.shape[1], 3, 3))
        L_u = np.einsum("cqia,cas->cqsi", part.L[rows], nodal(u, part, dim)[rows], optimize=True)
        H[..., :dim, :dim] = L_u[..., :dim]
        if model.axisymmetric:
            H[..., 2, 2] = L_u[..., 0, 2]
        memory = np.zeros((H.shape[0] * H.shape[1], law.n_history))
        if history:
            memory[:] = history[part.block][part.cells.start + rows, :, : law.n_history].reshape(memory.shape)
        flat = H.reshape(-1, 3, 3)
        answer = _plane_stress(law, flat, memory) if model.plane_stress else law.respond(flat, memory)
        return _Points(rows, H, answer)


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
