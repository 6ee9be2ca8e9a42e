"""All contact pairs of a problem at one displacement: rows, gaps and their derivatives, on the unknowns of all nodes.

B v = int (v(x) - v(x_bar)).n, D = -dG/du; both are the same if an interface is paired only once, or if a symmetric
tangent is required.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from lacmesh.mesh import Floats
from lacsolver.contact import Interface
from lacsolver.contact.tangent import Motion, gap_derivative, motion_of, tangent
from lacsolver.problem.problem import ContactPair, Problem


@dataclass(frozen=True, eq=False)
class Meeting:
    """Interfaces of the contact pairs, and their rows one after the other (m,); a tie has d rows per macro-element.

    `B`, `D` (m, n_dof); `G` (m,): gap integrals; `w` (m,): measure that they are integrated over, 1 for uncovered rows;
    `covered` (m,): True if the coverage reaches the threshold; `held` (m,): True for equalities. `motions`: derivatives
    of the interfaces, None for those without.
    """

    interfaces: tuple[Interface, ...]
    motions: tuple[Motion | None, ...]
    B: csr_array
    D: csr_array
    G: NDArray[np.floating]
    w: NDArray[np.floating]
    covered: NDArray[np.bool_]
    held: NDArray[np.bool_]

    @property
    def turns(self) -> bool:
        """True if the direction or position of contact forces depends on the displacement."""
        return any(motion is not None for motion in self.motions)

    def turning(self, p: Floats) -> csr_array:
        """Return d(B^T p)/du (n_dof, n_dof) at pressures p (m,)."""
        n = self.B.shape[1]
        total, first = csr_array((n, n)), 0
        for face, motion in zip(self.interfaces, self.motions, strict=True):
            last = first + face.B.shape[0]
            if motion is not None:
                total = csr_array(total + tangent(face, motion, p[first:last]))
            first = last
        return total


def meeting(problem: Problem, interfaces: Sequence[Interface], u: Floats) -> Meeting:
    """Return contact rows, gaps and derivatives of all contact pairs at u (n_dof,).

    The gaps of pairs that are paired only once are linear in u.
    """
    d, n = problem.space.dim, problem.space.n_dof
    B: list[csr_array] = [csr_array((0, n))]
    D: list[csr_array] = [csr_array((0, n))]
    G: list[Floats] = [np.empty(0)]
    w: list[Floats] = [np.empty(0)]
    covered, held = [np.empty(0, bool)], [np.empty(0, bool)]
    motions = [_motion(problem, joint, face) for joint, face in zip(problem.joints, interfaces, strict=True)]
    for joint, face, motion in zip(problem.joints, interfaces, motions, strict=True):
        repeat = d if joint.tie else 1
        B.append(face.B)
        D.append(face.B if motion is None else gap_derivative(face, motion))
        G.append(face.G if joint.moving else face.G - face.B @ u)
        w.append(np.repeat(face.w, repeat))
        covered.append(np.repeat(joint.paired(face), repeat))
        held.append(np.full(len(w[-1]), not joint.one_sided))
    left, on = csr_array(vstack(B)), np.concatenate(covered)
    right = left if all(motion is None for motion in motions) else csr_array(vstack(D))
    return Meeting(
        tuple(interfaces), tuple(motions), left, right, np.concatenate(G), np.where(on, np.concatenate(w), 1.0), on,
        np.concatenate(held),
    )  # fmt: skip


def _motion(problem: Problem, joint: ContactPair, face: Interface) -> Motion | None:
    """Return the derivatives of a pair's interface; None if it is paired only once, or for a symmetric tangent."""
    if not joint.moving or problem.case.solver.tangent == "symmetric":
        return None
    return motion_of(face, face.slave, face.master, joint.pairing, problem.space.dim)
