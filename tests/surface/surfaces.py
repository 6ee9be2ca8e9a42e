"""Surfaces that the tests of contact geometry face with one another, and integrals over them done the plain way."""

from __future__ import annotations

import numpy as np

from lacmesh import Mesh, raise_order
from lacmesh.cells import CELLS
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import jacobian, shape
from lacmesh.surface import Surface
from lacmesh.topology.skin import FACE_TYPES

TYPES = {"TRIA3": ("TRIA3", "1"), "TRIA6": ("TRIA3", "2"), "TRIA7": ("TRIA3", "2-full")}
TYPES |= {"QUAD4": ("QUAD4", "1"), "QUAD8": ("QUAD4", "2"), "QUAD9": ("QUAD4", "2-full"), "mixed": ("mixed", "1")}
TYPES |= {"mixed2": ("mixed", "2")}


def whole(mesh):
    """The surface of all cells of a mesh of faces."""
    return Surface.of(mesh, np.arange(mesh.n_cells))


def sheet(n, z=0.0, *, kind="QUAD4", skew=0.0, seed=0, down=False, size=1.0, ny=None, keep=None):
    """A rectangle of n x ny faces at height z, its inner nodes moved by up to skew of a face in the plane."""
    rng = np.random.default_rng(seed)
    ny = n if ny is None else ny
    i, j = np.meshgrid(np.arange(n + 1), np.arange(ny + 1), indexing="ij")
    inner = (i % n != 0) & (j % ny != 0)
    points = np.stack([i / n, j / ny, np.zeros(i.shape)], axis=-1)
    points[inner, :2] += skew * rng.uniform(-1, 1, (inner.sum(), 2)) / [n, ny]
    points = points.reshape(-1, 3) * [size, size, 0] + [0, 0, z]
    g = np.arange((n + 1) * (ny + 1)).reshape(n + 1, ny + 1)
    quads = np.stack([g[:-1, :-1], g[1:, :-1], g[1:, 1:], g[:-1, 1:]], axis=-1).reshape(-1, 4)
    if keep is not None:
        quads = quads[keep(points[quads].mean(axis=1))]
    if down:
        quads = quads[:, ::-1]
    base, order = TYPES[kind]
    some = rng.random(len(quads)) < {"QUAD4": 2.0, "TRIA3": -1.0, "mixed": 0.5}[base]
    rest = quads[~some]
    cells = {"QUAD4": quads[some], "TRIA3": np.concatenate([rest[:, [0, 1, 2]], rest[:, [0, 2, 3]]])}
    mesh = Mesh.create(points, [(t, c) for t, c in cells.items() if len(c)], space_dim=3)
    mesh = mesh if order == "1" else raise_order(mesh, order)
    return with_centres(mesh) if kind == "TRIA7" else mesh


def with_centres(mesh):
    """TRIA6 made TRIA7."""
    nodes = mesh.block("TRIA6")
    middle = shape("TRIA6", [[1 / 3, 1 / 3]])[0] @ mesh.points[nodes].reshape(len(nodes), 6, 3)
    nodes = np.column_stack([nodes, mesh.n_nodes + np.arange(len(nodes))])
    return Mesh.create(np.concatenate([mesh.points, middle]), [("TRIA7", nodes)], space_dim=3)


def mapped(mesh, f):
    """A mesh whose points are moved by f (n, 3) -> (n, 3)."""
    return Mesh.create(f(mesh.points), [(b.type, b.nodes) for b in mesh.blocks], space_dim=mesh.space_dim)


def line(n, y=0.0, *, kind="SEG2", down=False, a=0.0, b=1.0, skew=0.0, seed=0):
    """A line of n segments from (a, y) to (b, y) whose normal points up, or down; `skew` also moves middle nodes."""
    rng = np.random.default_rng(seed)
    parts = n * (2 if kind == "SEG3" else 1)
    t = np.linspace(a, b, parts + 1)
    t[1:-1] += skew * (b - a) / parts * rng.uniform(-1, 1, parts - 1)
    i = np.arange(n)
    nodes = np.stack([i, i + 1], axis=1) if kind == "SEG2" else np.stack([2 * i, 2 * i + 2, 2 * i + 1], axis=1)
    if not down:
        nodes[:, [0, 1]] = nodes[:, [1, 0]]
    return Mesh.create(np.stack([t, np.full(len(t), float(y))], axis=1), [(kind, nodes)], space_dim=2)


def blocks(n, low, high, *, order="1", skew=0.0, seed=0):
    """n x n x 1 hexahedra over the unit square, group `skin`: their lower side (low = 0) or upper one (high = 0)."""
    rng = np.random.default_rng(seed)
    flat = sheet(n, skew=skew, seed=int(rng.integers(1 << 30)))
    points = np.concatenate([flat.points + np.array([0, 0, low]), flat.points + np.array([0, 0, high])])
    quads = flat.block("QUAD4")
    cells = np.concatenate([quads, quads + flat.n_nodes], axis=1)
    skin = cells[:, 4:] if high == 0 else cells[:, [0, 3, 2, 1]]
    mesh = Mesh.create(
        points, [("HEXA8", cells), ("QUAD4", skin)], cell_groups={"skin": len(cells) + np.arange(len(skin))}
    )
    return mesh if order == "1" else raise_order(mesh, order)


def shape_integrals(surface):
    """(n_nodes,): integral of every node's shape function over a surface, by its own faces."""
    out = np.zeros(len(surface.x))
    for name, _, nodes in surface.by_type():
        X, w = rule(CELLS[name].family, 12)
        J = jacobian(name, surface.x[nodes], X)
        size = np.linalg.norm(J[..., 0] if surface.dim == 1 else np.cross(J[..., 0], J[..., 1]), axis=-1)
        np.add.at(out, nodes, (size * w) @ shape(name, X))
    return out


def integrated(points, surface, faces, xi):
    """(n_nodes,): the same from contact points on some faces at xi."""
    out = np.zeros(len(surface.x))
    for code in np.unique(surface.faces.type[faces]):
        at = surface.faces.type[faces] == code
        cell = CELLS[FACE_TYPES[code]]
        N = shape(cell.name, xi[at][:, : cell.dim])
        np.add.at(out, surface.faces.nodes[faces[at], : cell.n_nodes], N * points.weight[at, None])
    return out


def positions(points, surface, faces, xi):
    """(n, 3): where points on some faces at xi are."""
    out = np.zeros((len(points), 3))
    for code in np.unique(surface.faces.type[faces]):
        at = surface.faces.type[faces] == code
        cell = CELLS[FACE_TYPES[code]]
        x = surface.x[surface.faces.nodes[faces[at], : cell.n_nodes]]
        out[at] = np.einsum("pn,pns->ps", shape(cell.name, xi[at][:, : cell.dim]), x)
    return out


def errors(points, slave, master):
    """Relative errors of the integrals of the shape functions of either side."""
    out = []
    for surface, faces, xi in ((slave, points.slave, points.xi_slave), (master, points.master, points.xi_master)):
        exact = shape_integrals(surface)
        out.append(np.abs(integrated(points, surface, faces, xi) - exact).max() / np.abs(exact).max())
    return tuple(out)
