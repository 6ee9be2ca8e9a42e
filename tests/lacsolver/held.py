"""Meshes with a group for each side, and cases that hold them."""

from __future__ import annotations

import numpy as np

from lacmesh import Mesh, generate
from lacmesh.cells import CELLS
from lacsolver.case import Case, Material, parse_case
from lacsolver.constraints import Constraints
from lacsolver.space.space import Space
from tests.lacsolver.bodies import cube, square
from tests.meshes import facets_of

TEXT = """mesh = "a.msh"
model = "{model}"
[[material]]
young = 1.0
poisson = 0.3
"""


def with_sides(solid, sides=None, node_groups=None):
    """The mesh with its skin as cells. `sides`: name -> f(centres of faces (k, 3)); else the box's x0, x1, y0 ..."""
    skin = [rows[0] for rows in facets_of(solid).values() if len(rows) == 1]
    centre = np.array([solid.points[nodes[: CELLS[kind].n_corners]].mean(axis=0) for _, _, kind, nodes in skin])
    blocks = {b.type: list(b.nodes) for b in solid.blocks}
    kinds = [kind for _, _, kind, _ in skin]
    order = []
    for kind in dict.fromkeys(kinds):
        chosen = [k for k, other in enumerate(kinds) if other == kind]
        blocks[kind] = [skin[k][3] for k in chosen]
        order += chosen
    low, high = solid.points.min(axis=0), solid.points.max(axis=0)
    box = {
        f"{axis}{end}": lambda x, s=s, at=at: np.abs(x[:, s] - at[s]) < 1e-9
        for s, axis in enumerate("xyz"[: solid.space_dim])
        for end, at in enumerate((low, high))
    }
    groups = {name: solid.n_cells + np.flatnonzero(side(centre[order])) for name, side in (sides or box).items()}
    bodies = {name: cells for name, cells in solid.cell_groups.items()}
    return Mesh.create(
        solid.points,
        [(kind, np.array(rows)) for kind, rows in blocks.items()],
        cell_groups={**bodies, "body": np.arange(solid.n_cells), **groups},
        node_groups={**solid.node_groups, **(node_groups or {})},
        space_dim=solid.space_dim,
        node_number=solid.node_number,
    )


def joined(*meshes):
    """Join meshes, each a body in the group `a`, `b`, ... or, beyond six, in no group."""
    kinds = dict.fromkeys(b.type for m in meshes for b in m.blocks)
    start = np.cumsum([0, *(m.n_nodes for m in meshes)])
    blocks = {t: np.concatenate([m.block(t) + s for m, s in zip(meshes, start, strict=False)]) for t in kinds}
    owner = np.concatenate([np.repeat(k, len(m.block(t))) for t in kinds for k, m in enumerate(meshes)])
    groups = {name: np.flatnonzero(owner == k) for k, name in enumerate("abcdef"[: len(meshes)])}
    return Mesh.create(
        np.concatenate([m.points for m in meshes]), blocks.items(), cell_groups=groups, space_dim=meshes[0].space_dim
    )


def moved(mesh, matrix=None, shift=(0, 0, 0)):
    """The mesh turned, sheared or shifted."""
    points = mesh.points if matrix is None else mesh.points @ np.asarray(matrix, float).T
    return Mesh.create(points + shift, mesh.blocks, cell_groups=mesh.cell_groups, space_dim=mesh.space_dim)


def two(model="3d", gap=0.5):
    """Two boxes, one above the other: groups a and b, sides of the whole, `low` and `high` faces between them."""
    one = cube("HEXA8", 2) if model == "3d" else square("QUAD4", 2)
    up = [0, 0, 1 + gap] if model == "3d" else [0, 1 + gap, 0]
    s = 2 if model == "3d" else 1
    mesh = with_sides(joined(one, moved(one, shift=up)))
    x = mesh.points
    first = np.arange(mesh.n_nodes) < one.n_nodes
    groups = {"low": first & (np.abs(x[:, s] - 1) < 1e-9), "high": ~first & (np.abs(x[:, s] - 1 - gap) < 1e-9)}
    groups = {name: np.flatnonzero(found) for name, found in groups.items()}
    return Mesh.create(x, mesh.blocks, cell_groups=mesh.cell_groups, node_groups=groups, space_dim=mesh.space_dim)


def held(mesh, model="3d", **sections):
    """The space of a mesh, and the constraints of a case's sections."""
    space = Space.of(mesh, model)
    case = Case(mesh="a.msh", model=model, material=(Material(young=1.0, poisson=0.3),), **sections)
    return space, Constraints.of(space, case)


def case(sections, model="3d"):
    return parse_case(TEXT.format(model=model) + sections, "press.toml")


def box(name, model):
    return with_sides(cube(name, 2) if model == "3d" else square(name, 2))


def turn(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def ring(name="HEXA8", n=12):
    """A ring of radii 1 and 2, height 1, about the z axis, uniform; `outer`, `inner`, `ends`."""
    mesh = generate.ring((1, n, 1), kind=name)

    def half(side):
        return lambda x: np.isclose(np.hypot(x[0], x[1]), 2) & (side * x[0] > -1e-9)

    return mesh.with_groups(east=half(1), west=half(-1)).renamed(bottom="ends", top="ends")


def nodes_in(mesh, group):
    return np.unique(np.concatenate([nodes.ravel() for _, _, nodes in mesh.select(mesh.cell_groups[group])]))


def conditions_at(constraints, node):
    """The directions and the values at t = 1 of the conditions at a node."""
    here = constraints.local.node == node
    return constraints.local.direction[here], constraints.local.values(1.0)[here]


def check_map(space, constraints, t=1.0):
    """T's columns at free nodes are orthonormal, meet D u = 0, leave nothing out; u0 is the shortest there is."""
    T, local = constraints.T.toarray(), constraints.local
    rigid = np.concatenate([np.empty(0, int), *(b.nodes for b in constraints.rigid)])
    own = np.ones(len(T), bool)
    own[space.dofs(rigid).ravel()] = False
    N = T[own][:, np.abs(T[own]).max(axis=0, initial=0) > 0]
    np.testing.assert_allclose(N.T @ N, np.eye(N.shape[1]), atol=1e-14)
    np.testing.assert_allclose(local.D @ T, 0, atol=1e-14)
    for node in np.unique(local.node):
        D, c = conditions_at(constraints, node)
        at = space.dofs(np.array([node])).ravel()
        rank = np.linalg.matrix_rank(D, tol=1e-6)
        left = space.dim - rank if space.attached[node] else 0
        assert (np.abs(T[at]).max(axis=0) > 0).sum() == left
        np.testing.assert_allclose(constraints.u0(t)[at], np.linalg.pinv(D, rcond=1e-6) @ c, atol=1e-13)
