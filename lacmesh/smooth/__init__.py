"""The smooth surface through the nodes of flat faces: its shapes, and its height over the faces.

    parents = the faces before the cut                                           (parents)
    patches = faces joined without a crease                                      (parents)
    shapes = planes, cylinders, spheres, cones, tori through all nodes           (shape, find)
    shapes of few faces, which turn by more than the crease angle                (find)
    fits = elsewhere, polynomials fitted to the nodes of two rings, or three     (local)
    heights = distances of the smooth surface from the faces                     (heights)
    description of the skin of a group, for users                                (fitted)

Nothing here depends on units, or on the position, orientation or numbering of the model.
"""

from lacmesh.smooth.fitted import DOUBTFUL, FittedShape, doubt_text, few_faces_text_of, fit_surface, unresolved
from lacmesh.smooth.heights import height_of, surface_of

__all__ = [
    "DOUBTFUL",
    "FittedShape",
    "doubt_text",
    "few_faces_text_of",
    "fit_surface",
    "height_of",
    "surface_of",
    "unresolved",
]
