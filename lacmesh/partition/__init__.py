"""Parts of a mesh for several processes: the owner of each node, and the cells that each process needs.

owner = the process that owns each node      (`bisection`)
part = the cells around the nodes of one     (`parts`)
"""

from __future__ import annotations

from lacmesh.partition.bisection import distribute_nodes
from lacmesh.partition.parts import Part, part_of

__all__ = ["Part", "distribute_nodes", "part_of"]
