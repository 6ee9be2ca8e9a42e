"""Prescribed displacements and rigid bodies as linear constraints u = T q + u0(t), with q the remaining unknowns.

conditions = direction . u = value, at nodes                         (conditions; normals, for `un`)
local bases = directions in which each node remains free             (local)
rigid bodies = nodes that move with a few rigid-body motions         (rigid)
constraints = all of them as T, u0(t), and their reactions           (constraints)
"""

from lacsolver.constraints.constraints import Constraints
from lacsolver.constraints.rigid import RigidBody

__all__ = ["Constraints", "RigidBody"]
