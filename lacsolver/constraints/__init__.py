"""What holds and moves a body: u = T q + u0(t), with q the unknowns that are left.

conditions = direction . u = value, at nodes                         (conditions; normals, for `un`)
local bases = what the conditions of each node leave free of it      (local)
rigid bodies = nodes whose displacement is that of a few motions     (rigid)
constraints = all of them as T, u0(t), and the forces they carry     (constraints)
"""

from lacsolver.constraints.constraints import Constraints
from lacsolver.constraints.rigid import RigidBody

__all__ = ["Constraints", "RigidBody"]
