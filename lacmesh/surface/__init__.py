"""The geometry of contact between two surfaces: who faces whom, where, how far, and what part of a face is covered.

    faces = the skin under some cells, turned outward                       (record)
    pairs = slave and master faces whose boxes meet; two ways, one answer   (search, front)
    pieces = the part of each pair that both share, in the slave's plane    (clip)
    points = quadrature points on the pieces, and where each meets the master along its normal (rules, project, points)
    coverage = what the points say of each macro-element                    (coverage)

Signs: n is the slave's outward unit normal, the gap (x_bar - x).n is > 0 where open and < 0 in penetration.
The checks of a mesh and a contact solver both read `ContactPoints`, and nothing else of this folder.
"""

from lacmesh.surface.coverage import Coverage, coverage
from lacmesh.surface.points import ContactPoints, contact_points, default_distance
from lacmesh.surface.record import Surface

__all__ = ["ContactPoints", "Coverage", "Surface", "contact_points", "coverage", "default_distance"]
