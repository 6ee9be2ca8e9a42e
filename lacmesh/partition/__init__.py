"""Parts of a mesh for several processes (`parts`), and a folder from which each process reads its own (`store`)."""

from __future__ import annotations

from lacmesh.partition.parts import Part, cut_part, distribute_nodes, part_of
from lacmesh.partition.store import describe_parts, read_part, write_parts

__all__ = ["Part", "cut_part", "describe_parts", "distribute_nodes", "part_of", "read_part", "write_parts"]
