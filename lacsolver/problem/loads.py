"""Loads as nodal forces (n_dof,) at a time t, and springs as matrices.

Forces are those of the whole thickness or circle: the weight of a point includes thickness or 2 pi r, here and in
`bodies.points`. Every value is a number or f(points (n, 3), t) -> (n,) (`lacsolver.space.values`). The rules
integrate a constant exactly on any cell or face, including curved ones, if the integrand is a polynomial: that of a
pressure is (the normal is not normalised), that of a traction on a curved face is not, and converges with its degree.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.cells import CELLS
from lacmesh.errors import DataError
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import gradient, jacobian, shape
from lacmesh.surface import Surface
from lacmesh.surface.normals import normals_of
from lacsolver.bodies.material import Materials
from lacsolver.bodies.small import internal_force
from lacsolver.bodies.small.fields import TemperatureField, scatter
from lacsolver.space.determinant import determinant
from lacsolver.space.space import Space
from lacsolver.space.sparse import sparse, sparse_blocks
from lacsolver.space.values import ScalarField, evaluate, evaluate_vector

#: components of a vector; of a traction also f(points (n, 3), unit outward normals (n, 3), t) -> (n, dim)
Vector = Sequence[ScalarField]
TractionField = Vector | Callable[[Floats, Floats, float], Floats]

#: by order of the face: degree of N times the normal, with r, for a constant (TRIA7: total degree, the others: degree
#: in each coordinate)
_FACE_DEGREE = {0: 1, 1: 5, 2: 10}
#: by dimension and order of the cell: degree of N times det J, with r
_CELL_DEGREE = {(2, 1): 5, (2, 2): 10, (3, 1): 5, (3, 2): 7}
_PIECE = 1 << 18


def pressure(
    space: Space, faces: Ints, value: ScalarField, t: float = 1.0, *, x: Floats | None = None
) -> NDArray[np.floating]:
    """Return the nodal forces (n_dof,) of a pressure on skin cells `faces` (indices), > 0 into the body.

    `x` (n_nodes, 3): deformed coordinates of the nodes, for a follower load. The value is evaluated at undeformed
    points. Raises DataError for cells that are no faces of the body, or that do not have exactly one cell behind them,
    so that the side of the pressure would be unknown.
    """

    def force(at: Floats, normal: Floats) -> NDArray[np.floating]:
        return -evaluate(value, at, t, "pressure")[..., None] * normal[..., : space.dim]

    return _on_faces(space, _pressed(space, faces), force, x)


def pressure_tangent(
    space: Space, faces: Ints, value: ScalarField, t: float = 1.0, *, x: Floats | None = None
) -> csr_array:
    """Return df/du (n_dof, n_dof) of `pressure` as a follower load, with normals and radii at x (n_nodes, 3).

    With the tangents a_k of the face, n = a_1 x a_2 and f_as = -int p N_a n_s; n changes with the tangents,

        df_as/du_bt = -int p N_a (N_b,1 e_t x a_2 - N_b,2 e_t x a_1)_s,

    in 2D n = (a_y, -a_x); in axisymmetry the radius in 2 pi r grows by N_b with u_bx. The matrix is symmetric if the
    pressure is uniform and the surface is closed or its boundary is fixed; in general it is not.
    """
    surface = _pressed(space, faces)
    parts = []
    for part in _face_points(space, surface, x):
        p = -evaluate(value, part.at, t, "pressure") * part.w
        K = np.einsum("fq,qa,fqbst->fasbt", p, part.N, _turning(space, part), optimize=True)
        dofs = space.dofs(part.nodes.ravel()).reshape(len(part.nodes), -1)
        parts.append((dofs, K.reshape(*dofs.shape, -1)))
    return sparse_blocks(space.n_dof, parts)


def _turning(space: Space, part: _FacePoints) -> NDArray[np.floating]:
    """Return the derivative (f, q, n, s, t) of the normals, times Jacobian, by the nodes' displacements.

    In axisymmetry it includes the derivative of the radius, relative to the radius.
    """
    J, dN = part.J, part.gradient
    if space.dim == 3:
        cross = np.cross(np.eye(3)[:, None], J.swapaxes(2, 3)[:, :, None])  # (f, q, t, k, s): e_t x a_k
        by_first = np.einsum("qb,fqts->fqbst", dN[..., 0], cross[..., 1, :])
        return by_first - np.einsum("qb,fqts->fqbst", dN[..., 1], cross[..., 0, :])
    quarter = np.array([[0.0, 1.0], [-1.0, 0.0]])
    turned = np.broadcast_to(np.einsum("qb,st->qbst", dN[..., 0], quarter), (*part.w.shape, *dN.shape[1:2], 2, 2))
    if not space.model.axisymmetric:
        return turned
    off_axis = part.radius > 0
    inverse = np.divide(1.0, part.radius, out=np.zeros_like(part.radius), where=off_axis)
    grown = np.einsum("fqs,qb,fq->fqbs", part.normal[..., :2], part.N, inverse)
    return turned + grown[..., None] * np.eye(2)[0]


def traction(space: Space, faces: Ints, value: TractionField, t: float = 1.0) -> NDArray[np.floating]:
    """Return the nodal forces (n_dof,) of a force per area on skin cells `faces` (indices).

    `value`: one value per component, or f(points, normals, t). Normals are those of `lacmesh.Surface`: unit and
    outward, or those of the mesh on a face between two cells.
    """

    def force(at: Floats, normal: Floats) -> NDArray[np.floating]:
        size = np.linalg.norm(normal, axis=-1, keepdims=True)
        if not callable(value):
            return evaluate_vector(value, at, t, space.dim, "traction") * size
        unit = np.divide(normal, size, out=np.zeros_like(normal), where=size > 0)
        got = np.asarray(value(at.reshape(-1, 3), unit.reshape(-1, 3), t), dtype=float)
        wanted = (at.size // 3, space.dim)
        if got.shape != wanted or not np.isfinite(got).all():
            what = got.shape if got.shape != wanted else "a value that is not finite"
            raise DataError(f"traction: the function returned {what}; return finite numbers {wanted}")
        return got.reshape(*at.shape[:-1], space.dim) * size

    return _on_faces(space, _skin(space, faces), force, None)


def body_force(space: Space, value: Vector, t: float = 1.0, *, cells: Ints | None = None) -> NDArray[np.floating]:
    """Return the nodal forces (n_dof,) of a force per volume on some cells of the space (indices; all if None).

    `value`: one value per component.
    """

    def force(at: Floats, _block: int, _rows: Ints) -> NDArray[np.floating]:
        return evaluate_vector(value, at, t, space.dim, "body force")

    return _on_cells(space, cells, force)


def gravity(space: Space, materials: Materials, acceleration: Vector, t: float = 1.0) -> NDArray[np.floating]:
    """Return the nodal forces (n_dof,) of weight: each cell's density times an acceleration, one value per component.

    Raises DataError if no law has a density.
    """
    if not any(law.density for law in materials.laws):
        raise DataError("gravity needs a density, and every material has 0; give at least one its density")

    def force(at: Floats, block: int, rows: Ints) -> NDArray[np.floating]:
        density = materials.densities(block)[rows]
        return density[:, None, None] * evaluate_vector(acceleration, at, t, space.dim, "gravity")

    return _on_cells(space, None, force)


def nodal_force(space: Space, nodes: Ints, value: Vector, t: float = 1.0) -> NDArray[np.floating]:
    """Return the vector (n_dof,) of forces on nodes, one value per component; in axisymmetry of the full circle."""
    nodes = check_on_bodies(space, nodes, "force")
    out = np.zeros((space.mesh.n_nodes, space.dim))
    out[nodes] = evaluate_vector(value, space.mesh.points[nodes], t, space.dim, "force")
    return out.ravel()


def spread_force(
    space: Space, value: Vector, t: float = 1.0, *, cells: Ints | None = None, nodes: Ints | None = None
) -> NDArray[np.floating]:
    """Return the nodal forces (n_dof,) whose sum is a given force, one value per component: it is spread evenly.

    Over `cells` (indices), those of the highest dimension among them: faces by area, edges by length, cells of the
    body by volume, with thickness or 2 pi r; without `cells`, and for points, over nodes in equal parts. Raises
    DataError where nothing has an area, and for what is not on the body.
    """
    w = _nodal_parts(space, cells, nodes)
    whole = float(space.share.total(space.own(w).sum()))
    if not whole > 0:
        raise DataError("a total force is spread by area, and the group has none; name a group of faces, or of nodes")
    return (evaluate_vector(value, space.mesh.points, t, space.dim, "force") * (w / whole)[:, None]).ravel()


def _nodal_parts(space: Space, cells: Ints | None, nodes: Ints | None) -> NDArray[np.floating]:
    """Return int N_a (n_nodes,) over cells, those of the highest dimension among them; over nodes, 1 at each."""
    own = space.mesh.cell_dim[np.empty(0, np.int64) if cells is None else cells]
    dim = int(space.share.largest(float(own.max(initial=0))))
    if cells is not None and dim:
        cells = cells[own == dim]
        if dim == space.dim - 1:
            parts = _on_faces(space, _skin(space, cells), _unit_on_faces(space.dim), None)
        elif dim == space.dim:
            parts = _on_cells(space, cells, lambda at, _block, _rows: np.ones((*at.shape[:-1], space.dim)))
        else:
            parts = _on_edges(space, cells)
        return parts.reshape(-1, space.dim)[:, 0]
    w = np.zeros(space.mesh.n_nodes)
    w[check_on_bodies(space, np.empty(0, np.int64) if nodes is None else nodes, "force")] = 1.0
    return w


def _unit_on_faces(dim: int) -> Callable[[Floats, Floats], NDArray[np.floating]]:
    return lambda _at, normal: np.repeat(np.linalg.norm(normal, axis=-1, keepdims=True), dim, axis=-1)


def _on_edges(space: Space, cells: Ints) -> NDArray[np.floating]:
    """Return int N_a ds over edges in space, the same for each component (n_dof,)."""
    out = np.zeros((space.mesh.n_nodes, space.dim))
    for name, _, nodes in space.mesh.select(space.near(cells)):
        check_on_bodies(space, nodes, "force")
        X, w = rule("SEG", _FACE_DEGREE[CELLS[name].order])
        J = jacobian(name, space.local.points[nodes], X[:, :1])
        f = np.einsum("qn,fq->fn", shape(name, X), np.linalg.norm(J[..., 0], axis=-1) * w)
        scatter(out, nodes, np.ascontiguousarray(np.repeat(f[..., None], space.dim, axis=-1)))
    return out.ravel()


def thermal_force(
    space: Space, materials: Materials, temperature: TemperatureField, t: float = 1.0, *, threads: int = 1
) -> NDArray[np.floating]:
    """Return the thermal load int B^T C (T - T0) alpha dV (n_dof,): K u equals it if nothing else acts."""
    still = np.zeros(space.n_dof)
    return -internal_force(space, materials, still, temperature=temperature, t=t, threads=threads)


def springs(
    space: Space, nodes: Ints, stiffness: Vector, t: float = 1.0, *, moved: Ints | None = None,
    along: Floats | None = None,
) -> csr_array:  # fmt: skip
    """Return the stiffness (n_dof, n_dof) of springs from some nodes, sorted and distinct, to the ground.

    `stiffness`: force per length along each axis, or along the directions `along` (k, dim, dim), a row each. `moved`:
    nodes of rigid bodies, which need no cell. Raises DataError for a negative stiffness, and for other nodes without a
    cell.
    """
    nodes = check_on_bodies(space, nodes, "spring", moved)
    k = evaluate_vector(stiffness, space.mesh.points[nodes], t, space.dim, "spring")
    if (k < 0).any():
        raise DataError(f"a spring's stiffness is 0 or more, and is {k.min():.6g} somewhere")
    dofs = space.dofs(nodes)
    if along is None:
        matrix = sparse((space.n_dof, space.n_dof), (dofs, dofs, k))
    else:
        matrix = sparse_blocks(space.n_dof, [(dofs, np.einsum("nk,nki,nkj->nij", k, along, along))])
    matrix.eliminate_zeros()
    return matrix


def _pressed(space: Space, faces: Ints) -> Surface | None:
    """Return the surface of skin cells for a pressure. Raises DataError unless each has one cell behind it."""
    surface = _skin(space, faces)
    if surface is None:
        return None
    unknown = surface.cell[np.isnan(surface.depth)]
    if len(unknown):
        message = f"cells {space.mesh.cell_names(unknown)} do not have exactly one cell of a body behind them"
        raise DataError(f"{message}; a pressure needs outer faces of a body", space.mesh.cell_number[unknown])
    return surface


def check_on_bodies(space: Space, nodes: Ints, what: str, moved: Ints | None = None) -> Ints:
    """Return distinct nodes. Raises DataError for nodes that are neither on cells of the space nor in `moved`."""
    nodes = np.unique(np.asarray(nodes, dtype=np.int64))
    loose = nodes[~space.attached[nodes]]
    loose = loose if moved is None else np.setdiff1d(loose, moved)
    if len(loose):
        numbers = ", ".join(str(n) for n in space.mesh.node_number[loose[:10]])
        raise DataError(f"{what} at nodes {numbers}, which belong to no cell of a body; name nodes of a body")
    return nodes


def _skin(space: Space, faces: Ints) -> Surface | None:
    """Return the surface of skin cells, each face once, outward; of several processes, at its own nodes, None if none.

    Raises DataError for cells that are no skin.
    """
    faces = np.asarray(faces, dtype=np.int64)
    wrong = faces[space.mesh.cell_dim[faces] != space.dim - 1]
    if len(wrong) or not space.share.total(np.array(len(faces))):
        named = f"cells {space.mesh.cell_names(wrong)} have another" if len(wrong) else "the group is empty"
        message = f"a load on a surface needs cells of dimension {space.dim - 1}, and {named}"
        raise DataError(f"{message}; name a group of faces", space.mesh.cell_number[wrong])
    faces = space.near(faces)
    if not len(faces):
        return None
    surface = Surface.of(space.mesh, faces)
    nodes = surface.faces.nodes
    loose = surface.cell[((nodes >= 0) & ~space.attached[nodes]).any(axis=1)]
    if len(loose):
        message = f"cells {space.mesh.cell_names(loose)} have nodes that belong to no cell of a body"
        raise DataError(f"{message}; a load acts on the surface of a body", space.mesh.cell_number[loose])
    return surface


class _FacePoints(NamedTuple):
    """Faces of one type: nodes (f, n), N (q, n) and its gradient (q, n, k), points (f, q, 3).

    `normal` (f, q, 3): normals times the Jacobian; `J` (f, q, 3, k): the k tangents; `radius` (f, q): x of the points;
    `w` (f, q): weights with thickness or 2 pi r.
    """

    nodes: Ints
    N: NDArray[np.floating]
    gradient: NDArray[np.floating]
    at: NDArray[np.floating]
    normal: NDArray[np.floating]
    J: NDArray[np.floating]
    radius: NDArray[np.floating]
    w: NDArray[np.floating]


def _face_points(space: Space, surface: Surface | None, x: Floats | None) -> Iterator[_FacePoints]:
    """Yield the faces of a surface, type by type, with normals and radii at `x`, and undeformed points."""
    if surface is None:
        return
    where = space.local.points if x is None else np.asarray(x, dtype=float)
    for name, rows, nodes in surface.by_type():
        cell = CELLS[name]
        X, w = rule(cell.family, _FACE_DEGREE[cell.order])
        N = shape(name, X)
        J = jacobian(name, where[nodes], X[:, : cell.dim])
        normal = normals_of(J)
        at = np.einsum("qn,fns->fqs", N, space.mesh.points[nodes], optimize=True)
        now = np.einsum("qn,fns->fqs", N, where[nodes], optimize=True)
        w = w * space.depth(now, surface.cell[rows])
        yield _FacePoints(nodes, N, gradient(name, X), at, normal, J, now[..., 0], w)


def _on_faces(
    space: Space,
    surface: Surface | None,
    force: Callable[[Floats, Floats], NDArray[np.floating]],
    x: Floats | None,
) -> NDArray[np.floating]:
    """Return the nodal forces of force(points, normals times Jacobian), which is per reference area, (f, q, dim)."""
    out = np.zeros((space.mesh.n_nodes, space.dim))
    for part in _face_points(space, surface, x):
        f = np.einsum("qn,fq,fqs->fns", part.N, part.w, force(part.at, part.normal), optimize=True)
        scatter(out, part.nodes, np.ascontiguousarray(f))
    return out.ravel()


def _on_cells(
    space: Space,
    cells: Ints | None,
    force: Callable[[Floats, int, Ints], NDArray[np.floating]],
) -> NDArray[np.floating]:
    """Return the nodal forces of force(points, block, rows of it), per volume, (c, q, dim), on some cells."""
    out = np.zeros((space.mesh.n_nodes, space.dim))
    for number, (name, nodes, cell_of) in enumerate(space.blocks):
        cell = CELLS[name]
        X, w = rule(cell.family, _CELL_DEGREE[space.dim, cell.order])
        N, dN = shape(name, X), gradient(name, X)
        chosen = np.arange(len(cell_of)) if cells is None else np.flatnonzero(np.isin(cell_of, cells))
        size = max(1, _PIECE // N.size)
        for rows in (chosen[k : k + size] for k in range(0, len(chosen), size)):
            at = np.einsum("qn,cns->cqs", N, space.mesh.points[nodes[rows]], optimize=True)
            W = np.abs(determinant(nodes[rows], space.local.points, dN)) * w * space.depth(at, cell_of[rows])
            f = np.einsum("qn,cq,cqs->cns", N, W, force(at, number, rows), optimize=True)
            scatter(out, nodes[rows], np.ascontiguousarray(f))
    return out.ravel()
