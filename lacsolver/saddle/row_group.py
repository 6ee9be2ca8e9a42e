"""Rows of contact: their matrices, and the rows of one pair in one configuration, with the law that they obey.

The rows of a pair are followed by those along its tangents where it has friction; rows of equality have no pair.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from lacmesh.mesh import Floats, Ints
from lacsolver.constraints.equality_rows import EqualityRows
from lacsolver.contact import Interface, arm
from lacsolver.contact.anchors import Anchors, Slip, slip
from lacsolver.contact.friction import Kept
from lacsolver.contact.laws import ContactLaw
from lacsolver.contact.sliver import allowed_overlap
from lacsolver.distributed.share import ALONE, Share
from lacsolver.problem.pair import ContactPair
from lacsolver.saddle.row_set import ShearRows

if TYPE_CHECKING:
    from lacsolver.contact.tangent import Motion


@dataclass(frozen=True, eq=False)
class Rows:
    """Matrices of contact rows: B (m, n), and w (m,), the measure that G is integrated over.

    `derivative()`: returns D (m, n), -dG/dq, once it is needed; None if D is B. `typical` (m,): mean measure of the
    rows of the same pair, 1 for equalities.
    """

    B: csr_array
    w: NDArray[np.floating]
    derivative: Callable[[], csr_array] | None = None
    typical: Floats | float = 1.0

    @cached_property
    def D(self) -> csr_array:
        """The derivative -dG/dq (m, n)."""
        return self.B if self.derivative is None else self.derivative()

    @cached_property
    def B_T(self) -> csr_array:
        """The transpose of B, (n, m)."""
        return self.B.T.tocsr()

    @cached_property
    def touched(self) -> Ints:
        """Indices of the unknowns with an entry in B."""
        return np.unique(self.B.indices)

    def reduced(self, T: csr_array) -> Rows:
        """Return the rows on the unknowns q, with T = du/dq."""
        derivative = None if self.derivative is None else lambda: csr_array(self.D @ T)
        return Rows(csr_array(self.B @ T), self.w, derivative, self.typical)

    def combined(self, combine: csr_array, turn: csr_array) -> Rows:
        """Return the rows with C^T B and R D in the places of B and D, for C `combine` and R `turn`, (m, m)."""
        rows = Rows(csr_array(combine.T @ self.B), self.w, lambda: csr_array(turn @ self.D), self.typical)
        rows.__dict__["touched"] = self.touched
        return rows


@dataclass(frozen=True, eq=False)
class RowGroup:
    """Rows that one law is for: the `rows` that obey it, and their `history` (rows, n_history).

    `shear`: the rows along the tangents of a pair with friction, after `rows`. `symmetric`: True if D is B in the
    tangent: derivatives of the interface are left out.
    """

    law: ContactLaw
    rows: slice
    history: Floats = field(default_factory=lambda: np.empty((0, 0)))
    shear: ShearRows | None = None
    symmetric: bool = True

    @property
    def every(self) -> slice:
        """All rows of the group."""
        return self.rows if self.shear is None else slice(self.rows.start, self.shear.tangential.stop)

    def on_rows(self, values: NDArray) -> NDArray:
        """Return values (m,) of macro-elements on all rows."""
        if self.shear is None:
            return np.repeat(values, (self.rows.stop - self.rows.start) // max(len(values), 1))
        return np.concatenate([values, np.repeat(values, self.shear.n_tangents)])

    @property
    def kept(self) -> Kept:
        """History of friction at the end of the last step."""
        assert self.shear is not None
        return Kept.of(self.history[:, self.law.n_history :], self.shear.n_tangents)


@dataclass(frozen=True, eq=False, kw_only=True)
class EqualityGroup(RowGroup):
    """Rows of `equality`, at u and t of `here`."""

    equality: EqualityRows
    here: tuple[Floats, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class PairGroup(RowGroup):
    """Rows of a contact pair, with its interface in this configuration.

    `share`: what this process holds of the model. `since`: what the slip of friction is counted from where the pair
    moves, its anchors and coordinates (n_nodes, 3) in the last state. `x` (n_nodes, 3): those of a tie whose arm turns.
    """

    pair: ContactPair
    face: Interface
    share: Share = ALONE
    since: tuple[Anchors, Floats] | None = None
    x: Floats | None = None

    @cached_property
    def motion(self) -> Motion | None:
        """Derivatives of the interface; None if it is paired only once, or for a symmetric tangent."""
        if self.symmetric or self.x is not None:
            return None
        from lacsolver.contact.tangent import motion_of

        return motion_of(self.face, self.face.slave, self.face.master, self.pair.pairing, self.face.normal.shape[1])

    def geometric_stiffness(self, p: Floats) -> csr_array | None:
        """Return d(B^T p)/du (n_dof, n_dof) of own macro-elements at all pressures and tractions p; None for 0."""
        if self.x is not None and not self.symmetric:
            return arm.bent(self.face, self.x, p[self.rows])
        if self.motion is None:
            return None
        from lacsolver.contact.tangent import tangent

        return tangent(self.motion, p[self.rows], None if self.shear is None else self.shear.vectors(p))

    def gaps(self, u: Floats) -> NDArray[np.floating]:
        """Return the gap integrals at u (n_dof,), and in rows along tangents -S, the slip from `kept` on."""
        if self.shear is None:
            return self._gaps(u)
        assert self.face.B_T is not None
        slip = self.face.B_T @ u - self.kept.anchor.ravel() if self.slip is None else self.slip.S.ravel()
        return np.concatenate([self._gaps(u), -slip])

    @cached_property
    def slip(self) -> Slip | None:
        """Slip of a pair with friction that moves, None for others, where it is linear in u."""
        if self.since is None:
            return None
        anchors, before = self.since
        return slip(anchors, self.face, self.pair.pairing, before, self.share, lambda: self.motion)

    @property
    def measure(self) -> Floats:
        """Measure that each row is integrated over, 0 where nothing is covered."""
        w = self.on_rows(self.face.w)
        if self.slip is not None and self.shear is not None:
            w[self.shear.n_rows :] = np.repeat(self.slip.w, self.shear.n_tangents)
        return w

    def _gaps(self, u: Floats) -> NDArray[np.floating]:
        """Return the gap integrals (rows,) at u (n_dof,), with the overlap that slivers of one-sided contact may have.

        The gaps of pairs that are paired only once are linear in u.
        """
        if not self.pair.moving and self.x is None:
            return np.asarray(self.face.G - self.face.B @ u)
        if not self.pair.one_sided:
            return self.face.G
        return self.face.G + allowed_overlap(self.face, self.pair.pairing)[0]

    def derivative(self) -> csr_array:
        """Return -d`gaps`/du (rows, n_dof), summed over all processes."""
        if self.motion is None and self.slip is None:
            return self.face.all_rows
        if self.slip is not None:
            return csr_array(vstack([self._derivative(), self.slip.D_T]))
        return self._derivative()

    def _derivative(self) -> csr_array:
        """Return the derivative of rows along normals."""
        if self.motion is None:
            return self.face.B
        from lacsolver.contact.tangent import gap_derivative

        fading = allowed_overlap(self.face, self.pair.pairing)[1] if self.pair.one_sided else None
        return self.share.add_matrices(gap_derivative(self.motion, fading), (False, True))
