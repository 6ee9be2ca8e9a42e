"""Parts of a mesh for several processes: the owner of each node, and the cells that each process needs.

owner = the process that owns each node                          (`owners`)
part = the cells around the nodes of one process                 (`parts`)
a folder with all parts, from which each process reads its own   (`store`)
cut = the part of the cut mesh                                   (`cutting`)
"""

from __future__ import annotations

from lacmesh.partition.cutting import cut_part
from lacmesh.partition.owners import distribute_nodes
from lacmesh.partition.parts import Part, part_of
from lacmesh.partition.store import describe_parts, read_part, write_parts

__all__ = ["Part", "cut_part", "describe_parts", "distribute_nodes", "part_of", "read_part", "write_parts"]
