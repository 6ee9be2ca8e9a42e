"""Faces between two shapes that touch inside them: a plane that goes over into a fillet between two rows of nodes.

Such a face has nodes on both shapes, A and B, and lies on neither. Along an edge of length h from a node on A to one on
B, with curvatures kappa_A and kappa_B, the skin is A up to the point where the shapes touch, at 1 - t of the edge, and
B from there on. The distances of the ends from the other's shape are the deviations of two parabolas that touch there,

    |f_B(i)| = |kappa_B - kappa_A| ((1 - t) h)^2 / 2,  |f_A(j)| = |kappa_B - kappa_A| (t h)^2 / 2,

of opposite signs: t is that of their square roots, and whether the shapes touch at all follows from their sum, h
sqrt(|kappa_B - kappa_A| / 2). The mean height of the skin over the edge is that of a parabola with the height

    h^2 / 8 (kappa_A + (kappa_B - kappa_A) (3 t^2 - 2 t^3))

at the middle, which a fit that sees both curvatures in all of its neighbours has not. What is left within the face is
up to an eighth of |kappa_B - kappa_A| h^2 / 8, at t = 1 / 2, and has the mean 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints
from lacmesh.smooth.find import FoundShape, Sought
from lacmesh.smooth.patches import Bools
from lacmesh.smooth.shape import Shape

#: how far the sum of the roots may be from that of shapes that touch, against it
_TOUCHING = 0.15


class NodeShapes(NamedTuple):
    """The shapes of nodes: `first` and `second` (n,) of `found` that each lies on, or -1; nodes of more have two.

    `loose` (f,): faces of planes without a node of their own, as one row of quadrangles between a plane and a fillet
    is: the nodes do not tell that these are planes, and have only the shapes beside them.
    """

    found: tuple[FoundShape, ...]
    first: Ints
    second: Ints
    loose: Bools

    @classmethod
    def of(cls, sought: Sought) -> NodeShapes:
        """Return the shapes of the nodes of all patches, before shapes were grown inside them."""
        node, n = sought.whole.node, len(sought.whole.x)
        nodes = [np.unique(node[one.faces][node[one.faces] >= 0]) for one in sought.found]
        shared = np.zeros(n, np.int64)
        for mine in nodes:
            shared[mine] += 1
        first, second, loose = np.full(n, -1), np.full(n, -1), np.zeros(len(node), bool)
        for number, (one, mine) in enumerate(zip(sought.found, nodes, strict=True)):
            if one.shape.kind == "plane" and shared[mine].min() > 1:
                loose[one.faces] = True
                continue
            second[mine] = np.where(first[mine] >= 0, number, -1)
            first[mine] = np.where(first[mine] >= 0, first[mine], number)
        return cls(sought.found, first, second, loose)


def heights_between(
    sought: Sought, sides: NodeShapes, i: Ints, j: Ints, normal: Floats
) -> tuple[NDArray[np.floating], Bools, NDArray[np.floating]]:
    """(e,): heights over the middles of chords from nodes i to j (e,) along unit normals (e, 3); (e,): True if known.

    Known are those between two nodes of one shape, and of two shapes that touch in between. (e,): largest distance of
    the skin from the parabola of such a height.
    """
    out, known, left = np.zeros(len(i)), np.zeros(len(i), bool), np.zeros(len(i))
    a, b = sides.first[i], sides.first[j]
    for one, other in ((sides.second[i], b), (a, sides.second[j]), (sides.second[i], sides.second[j])):
        same = (one == other) & (one >= 0)  # a node on two shapes: that which it shares with the other end
        a, b = np.where(same, one, a), np.where(same, other, b)
    x = sought.whole.x
    both = np.flatnonzero((a >= 0) & (b >= 0))
    pair = a[both] * len(sides.found) + b[both]
    for code in np.unique(pair):
        e = both[pair == code]
        A, B = (sides.found[k].shape for k in divmod(int(code), len(sides.found)))
        at, to = x[i[e]], x[j[e]]
        bend_a, f_b = _bend(A, at, to - at, normal[e]), _signed(B, at, normal[e])
        bend_b, f_a = _bend(B, to, to - at, normal[e]), _signed(A, to, normal[e])
        if A is B:
            out[e], known[e] = bend_a / 8, True
            continue
        root_a, root_b = np.sqrt(np.abs(f_a)), np.sqrt(np.abs(f_b))
        whole = np.sqrt(np.abs(bend_b - bend_a) / 2)
        known[e] = (f_a * f_b < 0) & (np.abs(root_a + root_b - whole) <= _TOUCHING * whole)
        t = np.divide(root_a, root_a + root_b, out=np.zeros_like(root_a), where=root_a + root_b > 0)
        out[e] = (bend_a + (bend_b - bend_a) * t * t * (3 - 2 * t)) / 8
        left[e] = np.abs(bend_b - bend_a) * t * (1 - t) / 16
    return out, known, left


def _signed(shape: Shape, x: Floats, normal: Floats) -> NDArray[np.floating]:
    """(n,): signed distances of points x (n, 3) from a shape, outward along normals (n, 3) of the faces."""
    f, gradient = shape.distance(x)
    return f * np.copysign(1.0, (gradient * normal).sum(axis=1))


def _bend(shape: Shape, x: Floats, e: Floats, normal: Floats) -> NDArray[np.floating]:
    """(n,): curvature of a shape at points x (n, 3) along chords e (n, 3), convex > 0, times the chord squared."""
    ahead, here, behind = (_signed(shape, x + part * e, normal) for part in (0.5, 0.0, -0.5))
    return 4 * (ahead - 2 * here + behind)
