"""Bodies that the solver is tested on: boxes of every cell type, mixtures, one distorted cell; their forces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse.linalg import spsolve

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.generate.parts import box_of
from lacsolver.bodies.material import Materials
from lacsolver.bodies.points import fill_gradient, gathered, kind
from lacsolver.bodies.pointwise import DisplacedBodies
from lacsolver.space.space import Space
from tests.lacsolver import plain
from tests.meshes import pad

#: every cell that carries displacements
SOLIDS = [name for name, cell in CELLS.items() if cell.dim == 3]
PLANES = [name for name, cell in CELLS.items() if cell.dim == 2]
PLANE_MODELS = ("plane_strain", "plane_stress", "axisymmetric")
MIXTURES = [(order, model) for order in ("1", "2", "2-full") for model in ("3d", *PLANE_MODELS)]
#: (cell, model): every pair there is
PAIRS = [(name, "3d") for name in SOLIDS] + [(name, model) for name in PLANES for model in PLANE_MODELS]


def one_cell(name, distortion=0.0, seed=0, shift=3.0):
    """A mesh of one cell, its nodes moved at random, at x > 0."""
    cell = CELLS[name]
    rng = np.random.default_rng(seed)
    points = pad(cell.reference)
    points = points + rng.uniform(-distortion, distortion, points.shape) * [1, 1, cell.dim == 3]
    points[:, 0] += shift
    return Mesh.create(points, [(name, [np.arange(cell.n_nodes)])])


def with_skin(mesh):
    """Copy of a mesh of one cell with every facet as a skin cell, in the group 'skin'."""
    (block,) = mesh.blocks
    blocks = {block.type: block.nodes}
    for facet in CELLS[block.type].facets:
        row = block.nodes[0][list(facet.nodes)]
        blocks[facet.type] = np.vstack([*([blocks[facet.type]] if facet.type in blocks else []), row[None]])
    n = sum(len(rows) for rows in blocks.values())
    return Mesh.create(mesh.points, blocks.items(), cell_groups={"skin": np.arange(1, n), "body": [0]})


def body(name, n, low=None, high=None, counts=None):
    """A box of one type of cell, n a side or `counts`; by default a cube, or a square at x in [1, 2]."""
    dim = CELLS[name].dim
    low = ((1.0, 0.0) if dim == 2 else (0.0,) * dim) if low is None else low
    high = [x + 1 for x in low] if high is None else high
    return box_of(name, dim, counts or n, np.subtract(high, low), low, 0.0, 0, ()).renamed(body="")


square = cube = body


def mixture(order="1"):
    """Hexahedra, prisms, tetrahedra and the pyramids between them, conforming, in [0, 3] x [0, 2] x [0, 2]."""
    return box_of(f"mixed {order}", 3, (3, 2, 2), (3, 2, 2), (0, 0, 0), 0.0, 0, ()).renamed(body="")


def plane_mixture(order="1"):
    """Quadrangles and triangles at x in [1, 4]."""
    return box_of(f"mixed {order}", 2, 3, 3, (1, 0), 0.0, 0, ()).renamed(body="")


def rim(mesh):
    """(n_nodes,): whether a node lies on the box around the mesh."""
    x = mesh.points
    dims = range(2 if mesh.space_dim == 2 else 3)
    return np.any([(np.abs(x[:, s] - side(x[:, s])) < 1e-9) for s in dims for side in (np.min, np.max)], axis=0)


def distorted(mesh, size, seed=0):
    """The mesh with every node moved at random by up to `size` each way; curved where it is quadratic."""
    rng = np.random.default_rng(seed)
    move = rng.uniform(-size, size, mesh.points.shape) * [1, 1, mesh.space_dim == 3]
    return Mesh.create(mesh.points + move, [(b.type, b.nodes) for b in mesh.blocks], space_dim=mesh.space_dim)


def made(mesh, model, law):
    """The space and the materials of a mesh; plane stress with a thickness."""
    space = Space.of(mesh, model, thickness=0.4 if model == "plane_stress" else None)
    return space, Materials.of(space, law)


def unturned(order, model):
    """A mixture of cells in space or in a plane."""
    return mixture(order) if model == "3d" else plane_mixture(order)


def mixed(order, model, size=0.06):
    """A distorted mixture."""
    return distorted(unturned(order, model), size * (0.5 if order != "1" else 1.0), seed=4)


def in_two(mesh):
    """The mesh with its cells in the groups `a` and `b` in turn."""
    return replace(mesh, cell_groups={"a": np.arange(0, mesh.n_cells, 2), "b": np.arange(1, mesh.n_cells, 2)})


def rigid(space):
    """(n_dof, modes): the rigid motions that a model has."""
    x = space.mesh.points
    if space.model.axisymmetric:
        return np.tile([[0.0], [1.0]], (len(x), 1))
    zero, one = np.zeros(len(x)), np.ones(len(x))
    if space.dim == 2:
        modes = [[one, zero], [zero, one], [-x[:, 1], x[:, 0]]]
    else:
        shifts = [[one if s == k else zero for s in range(3)] for k in range(3)]
        turns = [np.cross(np.eye(3)[k], x).T for k in range(3)]
        modes = [*shifts, *turns]
    return np.stack([np.stack(m, axis=1).ravel() for m in modes], axis=1)


def uniform(space, seed=0):
    """A displacement of uniform strain (n_dof,), and the strain."""
    rng = np.random.default_rng(seed)
    x = space.mesh.points[:, : space.dim]
    A = rng.uniform(-1, 1, (space.dim, space.dim)) * 1e-3
    shift = rng.uniform(-1, 1, space.dim) * 1e-3
    if space.model.axisymmetric:
        A[0, 1] = A[1, 0] = shift[0] = 0.0
    strain = [A[0, 0], A[1, 1], 0.0, A[0, 1] + A[1, 0]]
    if space.model.axisymmetric:
        strain[2] = A[0, 0]
    if space.dim == 3:
        strain = [*strain[:2], A[2, 2], strain[3], A[1, 2] + A[2, 1], A[0, 2] + A[2, 0]]
    return (x @ A.T + shift).ravel(), np.array(strain)


def solved(K, u, free, f=None):
    """u where it is given (not free), and the rest in equilibrium with forces f."""
    f = np.zeros(len(u)) if f is None else f
    out = u.copy()
    out[free] = spsolve(K[free][:, free], (f - K[:, ~free] @ u[~free])[free])
    return out


def displacement(space, u, degree=None):
    """Return the displacement (cells, points, dim) of u (n_dof,) at the points of a rule, block by block."""
    return gathered(space, lambda part: part.N @ u.reshape(-1, space.dim)[part.nodes], degree=degree)


def strain(space, u, degree=None):
    """Return the strain (cells, points, 4 or 6) of u (n_dof,) at the points of a rule, block by block."""
    rows, columns = np.array(plain.PAIRS[: space.model.n_stress]).T

    def of(part):
        H = np.empty((*part.W.shape, 3, 3))
        fill_gradient(part.nodes, part.L, u.reshape(-1, space.dim), kind(space), H)
        return (H + H.swapaxes(2, 3))[..., rows, columns] * np.where(rows == columns, 0.5, 1.0)

    return gathered(space, of, degree=degree)


# ---- at finite strains, each by one call


def internal_force(space, materials, u, **options):
    """Return f_int (n_dof,)."""
    return DisplacedBodies(space, materials, u, **options).internal_force()


def tangent(space, materials, u, *, out=None, **options):
    """Return K (n_dof, n_dof)."""
    return DisplacedBodies(space, materials, u, **options).tangent(out)


def force_and_tangent(space, materials, u, *, out=None, **options):
    """Return f_int (n_dof,) and K (n_dof, n_dof)."""
    body = DisplacedBodies(space, materials, u, **options)
    return body.internal_force(), body.tangent(out)


def stored_energy(space, materials, u, **options):
    """Return the stored energy."""
    return DisplacedBodies(space, materials, u, **options).energy()


def cauchy_stress(space, materials, u, **options):
    """Return the Cauchy stress (cells, points, 4 or 6) of each block."""
    return DisplacedBodies(space, materials, u, **options).cauchy_stress()


def first_piola(space, materials, u, **options):
    """Return the first Piola stress P_si (cells, points, 3, 3) of each block."""
    return DisplacedBodies(space, materials, u, **options).evaluated(lambda P, F: P)


def agree(one, other):
    """True if two arrays or sparse matrices agree to round-off, relative to the largest entry.

    Their last bits may depend on the number of threads: numpy has other loops for other layouts of an array.
    """
    return bool(abs(one - other).max() <= 1e-14 * abs(other).max())
