"""Rings of few faces: thick polygons whose nodes lie on circles, in the plane and along z, of every linear cell."""

import numpy as np

from lacmesh import generate, join
from lacmesh.cells import CELLS


def rings(*given, dim):
    """A mesh of several rings, each a dict of arguments of `ring`."""
    mesh = join(*(ring(**one) for one in given))
    assert mesh.space_dim == dim
    return mesh


def ring(kind, n, radii, heights=(0.0,), turn=0.0, twist=0.0, names=("body", "inner", "outer")):
    """A ring of n cells around of a linear type, its body and its two skins in groups of these names.

    Nodes are at `radii`, and in space at `heights`. `turn`: angle of the first node; `twist`: how far each layer of
    nodes is turned further.
    """
    lines = (radii, n, heights)[: CELLS[kind].dim]

    def turned(x):
        angle = turn + twist * np.interp(x[2], heights, np.arange(len(heights)))
        return [x[0] * np.cos(angle) - x[1] * np.sin(angle), x[0] * np.sin(angle) + x[1] * np.cos(angle), x[2]]

    mesh = generate.ring(lines, (radii[0], radii[-1]), kind).only("body", "inner", "outer").moved(turned)
    return mesh.renamed(**dict(zip(("body", "inner", "outer"), names, strict=True)))
