"""Prescribed displacements, rigid bodies and equations as constraints u = T q + u0(t), with q the remaining unknowns.

conditions = direction . u = value, at nodes                         (conditions; normals, for `un`)
local bases = directions in which each node remains free             (local)
rigid bodies = nodes that move with a few rigid-body motions         (rigid)
supports = all of these as u = T x + u0(t)                           (supports)
equations = sums of displacements, of which unknowns are eliminated  (equations)
constraints = supports and equations in a chain, and their reactions (constraints)
of the case: their terms, shared displacements                     (terms)
rows of equality = sums that are kept, with multipliers              (equality_rows)
"""

from lacsolver.constraints.constraints import Constraints
from lacsolver.constraints.of_case import constraints_of, equalities_of
from lacsolver.constraints.rigid import RigidBody

__all__ = ["Constraints", "RigidBody", "constraints_of", "equalities_of"]
