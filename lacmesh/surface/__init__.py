"""The geometry of contact between two surfaces: pairing, mortar segments, contact points, gaps and coverage.

    faces = the skin under some cells, oriented outward                     (record)
    pairs = slave and master faces whose boxes intersect                    (patches)
    pieces = mortar segments: the common part of each pair, in the slave's plane (clip)
    points = quadrature points on the pieces, projected along the slave's normal (place, points)
    coverage = area, covered part and gap of each macro-element             (points)

Signs: n is the slave's outward unit normal, the gap (x_bar - x).n is > 0 where open and < 0 in penetration.
The checks of a mesh and a contact solver both read `ContactPoints`, and nothing else of this package.
"""

from lacmesh.surface.points import ContactPoints, Coverage, contact_points, coverage, default_distance
from lacmesh.surface.record import Surface

__all__ = ["ContactPoints", "Coverage", "Surface", "contact_points", "coverage", "default_distance"]
