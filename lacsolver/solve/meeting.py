"""All joints of a problem at one displacement: rows, gaps and their derivatives, on the unknowns of all nodes.

B v = int (v(x) - v(x_bar)).n, D = -dG/du; they are one where an interface stays where it was, or its tangent is asked
to be symmetric.
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
from lacsolver.problem.problem import Joint, Problem


@dataclass(frozen=True, eq=False)
class Meeting:
    """Interfaces of joints, and their rows one after the other (m,), a tie's d a macro-element.

    `B`, `D` (m, n_dof); `G` (m,) gap integrals; `w` (m,) what they are integrals over, 1 where nothing is; `covered`
    (m,): enough of the master is in front; `held` (m,): rows that are equalities. `motions`: how interfaces change,
    None for those that do not.
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
        """Whether contact forces change direction or place with the displacement."""
        return any(motion is not None for motion in self.motions)

    def turning(self, p: Floats) -> csr_array:
        """(n_dof, n_dof): d(B^T p)/du at pressures p (m,)."""
        n = self.B.shape[1]
        total, first = csr_array((n, n)), 0
        for face, motion in zip(self.interfaces, self.motions, strict=True):
            last = first + face.B.shape[0]
            if motion is not None:
                total = csr_array(total + tangent(face, motion, p[first:last]))
            first = last
        return total


def meeting(problem: Problem, interfaces: Sequence[Interface], u: Floats) -> Meeting:
    """What the joints' interfaces come to at u (n_dof,); gaps of those that stay where they were are linear in u."""
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


def _motion(problem: Problem, joint: Joint, face: Interface) -> Motion | None:
    """How a joint's interface moves; None where it does not, or where the tangent asked for leaves that out."""
    if not joint.moving or problem.case.solver.tangent == "symmetric":
        return None
    return motion_of(face, face.slave, face.master, joint.pairing, problem.space.dim)
