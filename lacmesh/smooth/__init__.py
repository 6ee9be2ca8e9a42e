"""The smooth surface that the nodes of flat faces lie on: its shapes, and its height over the faces.

    parents = the faces as the user meshed them                                  (parents)
    patches = faces joined without a crease                                      (patches)
    shapes = planes, cylinders, spheres, cones, tori that all nodes lie on       (shape, find)
    fits = elsewhere, quadratics through the nodes of two rings                  (quadratic)
    heights                                                                      (heights)
    what the skin of a group is, for people                                      (fitted)

Nothing here depends on units, on where the model lies, on how it is turned or numbered.
"""

from lacmesh.smooth.coarse import unresolved
from lacmesh.smooth.fitted import FittedShape, fit_surface
from lacmesh.smooth.heights import height_of
from lacmesh.smooth.surfaces import surface_of

__all__ = ["FittedShape", "fit_surface", "height_of", "surface_of", "unresolved"]
