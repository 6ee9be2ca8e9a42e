"""Surfaces that the tests of contact geometry face with one another, and integrals over them done the plain way."""

from dataclasses import replace

import numpy as np

from lacmesh import Mesh, generate
from lacmesh.cells import CELLS
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import jacobian, shape
from lacmesh.surface import Surface
from lacmesh.topology.orientation import REVERSED
from lacmesh.topology.skin import FACE_TYPES

TYPES = ("TRIA3", "TRIA6", "TRIA7", "QUAD4", "QUAD8", "QUAD9", "mixed", "mixed 2")


def whole(mesh):
    """The surface of all cells of a mesh of faces."""
    return Surface.of(mesh, np.arange(mesh.n_cells))


def skewed(n, ny, skew, seed):
    """Corners (n + 1, ny + 1, 2) of a grid over the unit square, the inner ones moved by up to skew of a face."""
    x = np.stack(np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, ny + 1), indexing="ij"), axis=-1)
    x[1:-1, 1:-1] += skew * np.random.default_rng(seed).uniform(-1, 1, (n - 1, ny - 1, 2)) / [n, ny]
    return x


def sheet(n, z=0.0, *, kind="QUAD4", skew=0.0, seed=0, down=False, size=1.0, ny=None):
    """A rectangle of n x ny faces at height z, its inner nodes moved by up to skew of a face in the plane."""
    mesh = generate.grid(size * skewed(n, ny or n, skew, seed), kind=kind).only("body")
    faces = [(b.type, b.nodes[:, np.array(REVERSED[b.type])] if down else b.nodes) for b in mesh.blocks]
    return Mesh.create(mesh.points + np.array([0, 0, z]), faces, space_dim=3)


def mapped(mesh, f):
    """A mesh whose points are moved by f (n, 3) -> (n, 3)."""
    return replace(mesh, points=f(mesh.points))


def line(n, y=0.0, *, kind="SEG2", down=False, a=0.0, b=1.0, skew=0.0, seed=0):
    """A line of n segments from (a, y) to (b, y) whose normal points up, or down; `skew` also moves middle nodes."""
    mesh = generate.line(n, (0, y), (1, y), kind)
    x = mesh.points.copy()
    order = np.argsort(x[:, 0])[1:-1]
    x[order, 0] += skew / (len(x) - 1) * np.random.default_rng(seed).uniform(-1, 1, len(order))
    nodes = mesh.block(kind)
    return Mesh.create(
        x * [b - a, 1, 0] + [a, 0, 0], [(kind, nodes if down else nodes[:, [1, 0, 2][: nodes.shape[1]]])]
    )


def blocks(n, low, high, *, kind="HEXA8", skew=0.0, seed=0):
    """n x n x 1 hexahedra over the unit square; group `skin`: their upper side if it is at 0, else the lower one."""
    flat, at = skewed(n, n, skew, seed), 0 if high == 0 else low
    points = np.stack([np.dstack([flat, np.full(flat.shape[:2], z)]) for z in (low, high)], axis=2)
    return generate.grid(points, kind=kind).only("body").with_groups(skin=lambda x: x[2] == at)


def of_types(surface, faces, xi):
    """For each type of face among points on some faces at xi: (rows, nodes, shape functions there)."""
    for code in np.unique(surface.faces.type[faces]):
        at = surface.faces.type[faces] == code
        cell = CELLS[FACE_TYPES[code]]
        yield at, surface.faces.nodes[faces[at], : cell.n_nodes], shape(cell.name, xi[at][:, : cell.dim])


def shape_integrals(surface):
    """(n_nodes,): integral of every node's shape function over a surface, by its own faces."""
    out = np.zeros(len(surface.x))
    for name, _, nodes in surface.by_type():
        X, w = rule(CELLS[name].family, 12)
        J = jacobian(name, surface.x[nodes], X)
        size = np.linalg.norm(J[..., 0] if surface.dim == 1 else np.cross(J[..., 0], J[..., 1]), axis=-1)
        np.add.at(out, nodes, (size * w) @ shape(name, X))
    return out


def positions(points, surface, faces, xi):
    """(n, 3): where points on some faces at xi are."""
    out = np.zeros((len(points), 3))
    for at, nodes, N in of_types(surface, faces, xi):
        out[at] = np.einsum("pn,pns->ps", N, surface.x[nodes])
    return out


def errors(points, slave, master):
    """Relative errors of the integrals of the shape functions of either side."""
    out = []
    for surface, faces, xi in ((slave, points.slave, points.xi_slave), (master, points.master, points.xi_master)):
        exact, found = shape_integrals(surface), np.zeros(len(surface.x))
        for at, nodes, N in of_types(surface, faces, xi):
            np.add.at(found, nodes, N * points.weight[at, None])
        out.append(np.abs(found - exact).max() / np.abs(exact).max())
    return tuple(out)
