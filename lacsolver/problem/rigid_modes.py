"""Connected bodies, their rigid-body modes, and the rigid-body motions that constraints, springs or contact leave free.

Motions are small, u = t + theta x (X - c). Those that constraints u = T q and springs leave free are the null space of
one matrix on the amplitudes of the bodies' unit motions Phi. Its rows are what T does not let through, Phi - T q(Phi)
with the nearest q, the equations, and the springs' forces. Rigid groups need no amplitudes, as T has their motions, but
for the nodes of such a group that no cell has: they are a body of their own. The matrix splits into systems of bodies
that are joined, mostly of one body. `still_free` finds those of the free motions that no row of B constrains either.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import orth
from scipy.sparse import csr_array, diags_array, vstack

from lacmesh.mesh import Floats, Ints
from lacmesh.topology.bodies import body_names as names_of
from lacmesh.topology.bodies import label_components
from lacsolver.constraints import Constraints
from lacsolver.constraints.equations import Equations
from lacsolver.constraints.rigid import moments
from lacsolver.problem.motions import Body, FreeMotion, describe, plain_motions, unheld
from lacsolver.space.space import Space
from lacsolver.space.sparse import joined_columns, sparse

__all__ = ["Body", "FreeMotion", "body_names", "describe", "free_motions", "rigid_modes", "still_free", "unheld"]

#: root mean square of a unit motion on the rows of its system, below which the motion is free
_STOPPED = 1e-9
#: the same threshold for contact, whose directions are integrated
STOPPED_BY_CONTACT = 1e-8
#: displacement under a unit motion that is round-off
_ROUNDING = 1e-12


def rigid_modes(space: Space, of_node: Ints) -> NDArray[np.floating]:
    """Return the rigid-body modes (n_dof, r) of all bodies: 6 in 3D, 3 in a plane, the one along y in axisymmetry.

    `of_node` (n_nodes,): `Space.bodies`. The modes of each body are orthonormal, and all bodies share the same
    columns, so that memory does not grow with the number of bodies; nodes of no body have 0. Translations come first,
    then rotations about the principal axes through the mean of a body's nodes. A rotation that moves none of the nodes,
    about a line on which all of them lie, is left out.
    """
    nodes, start = _body_by_body(of_node)
    blocks = [_rigid_block(space, own) for own in np.split(nodes, start[1:])]
    out = np.zeros((space.mesh.n_nodes, space.dim, max(block.shape[2] for block in blocks)))
    for own, block in zip(np.split(nodes, start[1:]), blocks, strict=True):
        out[own, :, : block.shape[2]] = block
    return out.reshape(space.n_dof, -1)


def _rigid_block(space: Space, nodes: Ints) -> NDArray[np.floating]:
    """Return orthonormal rigid-body modes (k, dim, r) of some nodes."""
    x = space.local.points[nodes] - space.local.points[nodes].mean(axis=0)
    turns = moments(space.dim, x)
    gram = np.einsum("ksa,ksb->ab", turns, turns)
    size, axes = np.linalg.eigh(gram)
    fine = size > 1e-18 * max(size.max(), np.abs(x).max() ** 2)
    turns = turns @ (axes[:, fine] / np.sqrt(size[fine]))
    straight = np.tile(np.eye(space.dim), (len(nodes), 1, 1)) / np.sqrt(len(nodes))
    return straight[:, :, 1:] if space.model.axisymmetric else np.concatenate([straight, turns], axis=2)


def _body_by_body(of_node: Ints) -> tuple[Ints, Ints]:
    """Return the nodes of bodies, one body after the other, and the start of each body in them."""
    nodes = np.flatnonzero(of_node >= 0)
    nodes = nodes[np.argsort(of_node[nodes], kind="stable")]
    count = np.bincount(of_node[nodes])
    return nodes, np.cumsum(count) - count


def free_motions(space: Space, constraints: Constraints, springs: csr_array | None = None) -> tuple[FreeMotion, ...]:
    """Return the rigid-body motions that constraints and springs (n_dof, n_dof) leave free, easy to `describe`.

    Bodies that share a rigid group are treated together, and its nodes without cells are a body of their own. A body is
    named after its groups (`body_names`).
    """
    supports, units = constraints.supports, _UnitMotions.of(space, constraints)
    acting = [supports.constrained, *(one.C.indices for one in constraints.equations)]
    acting += [] if springs is None else [np.flatnonzero(np.diff(springs.indptr))]
    Phi = units.at(np.unique(np.concatenate(acting) // space.dim))
    own = diags_array(space.of_own(np.ones(space.n_dof)))
    rows = [own @ (Phi - supports.T @ supports.unknowns(Phi))]
    rows += [_equation_rows(space, one, csr_array(own @ Phi)) for one in constraints.equations]
    if springs is not None:
        stiffness = abs(springs).max(axis=1).toarray().ravel()
        rows.append(diags_array(_inverse(stiffness)) @ springs @ Phi)
    every = space.share.gather_rows(_without_round_off(csr_array(vstack(rows))))
    motions: list[FreeMotion] = []
    for blocks, columns, basis in _null_spaces(every, units.block, _STOPPED):
        of_block = units.block[columns][None] == blocks[:, None]
        twists = np.einsum("zk,bk,ki->zbi", basis, of_block, units.twists[columns])
        motions += plain_motions(space, [units.bodies[b] for b in blocks], twists)
    return tuple(motions)


def still_free(
    B: csr_array, motions: Sequence[FreeMotion], *, least: float = STOPPED_BY_CONTACT, x: Floats | None = None
) -> tuple[FreeMotion, ...]:
    """Return the motions in the span of those given that no row of B (m, n_dof) constrains, easy to `describe`.

    The rows of B are contacts and ties. A row is taken to constrain a motion in both directions; a motion is free if
    its root mean square over the rows of its bodies is less than `least` (`felt`). `x` (n_nodes, 3): coordinates of the
    nodes, those of the mesh if None.
    """
    if not motions:
        return ()
    rows, seen = _rates(B, motions, x)
    free: list[FreeMotion] = []
    weight = 1 / np.sqrt(np.maximum(seen, 1))
    for _, columns, basis in _null_spaces(
        csr_array(rows @ diags_array(weight)), _by_bodies(motions), least, total=True
    ):
        moved, twists = _together([motions[k] for k in columns])
        free += plain_motions(motions[0].space, moved, np.einsum("zk,kbs->zbs", basis * weight[columns], twists))
    return tuple(free)


def felt(B: csr_array, motions: Sequence[FreeMotion], x: Floats | None = None) -> NDArray[np.floating]:
    """Return the root mean square (k,) of each motion, of size 1, over the rows of B (m, n_dof) on its bodies.

    Rows are normalised to size 1, whatever area they integrate over. 0 for bodies without any row.
    """
    rows, seen = _rates(B, motions, x)
    return np.sqrt(np.asarray(rows.power(2).sum(axis=0)).ravel() / np.maximum(seen, 1))


def displaced_by(motions: Sequence[FreeMotion], u: Floats, x: Floats | None = None) -> NDArray[np.floating]:
    """Return the largest nodal displacement (k,) of each motion's part in u (n_dof,), found by least squares."""
    if not motions:
        return np.empty(0)
    F, space = _fields(motions, x), motions[0].space
    here = np.repeat(
        np.ones(space.mesh.n_nodes) if space.share.own is None else space.share.own.astype(float), space.dim
    )
    own = diags_array(here) @ F
    part = np.linalg.solve(space.share.total((own.T @ F).toarray()), space.share.total(own.T @ u))
    moved = (m.at_nodes if x is None else m.at(x) for m in motions)
    farthest = [space.share.largest(float(np.linalg.norm(at, axis=1).max(initial=0.0))) for at in moved]
    return np.abs(part) * farthest


def _rates(B: csr_array, motions: Sequence[FreeMotion], x: Floats | None) -> tuple[csr_array, Ints]:
    """Return the products (m, k) of normalised rows with unit motions, and the number of rows (k,) on their bodies."""
    B = csr_array(B)
    size = np.sqrt(B.power(2).sum(axis=1))
    unit = diags_array(_inverse(size)) @ B
    fields = _fields(motions, x)
    dim, there = motions[0].space.dim, np.concatenate([motion.nodes for motion in motions])
    own = np.repeat(np.arange(len(motions)), [len(motion.nodes) for motion in motions])
    of = sparse((B.shape[1] // dim, len(motions)), (there, own, 1.0))
    nodes = csr_array((np.ones(B.nnz), B.indices // dim, B.indptr), shape=(B.shape[0], B.shape[1] // dim))
    return csr_array(unit @ fields), np.diff((nodes @ of).tocsc().indptr)


class _UnitMotions(NamedTuple):
    """Unit motions of bodies, connected ones and then the nodes of rigid groups that no cell has.

    `of_node` (n_nodes,): body of each node, -1 for none. `block` (a,): body of each motion; `twists` (a, 6): t and
    theta, scaled so that a rotation displaces nodes by about 1.
    """

    space: Space
    bodies: tuple[Body, ...]
    of_node: Ints
    block: Ints
    twists: Floats

    @classmethod
    def of(cls, space: Space, constraints: Constraints) -> _UnitMotions:
        """Return those of a model; of nodes without cells those that are free in their rigid group."""
        of_node, unit = space.bodies.copy(), _unit_twists(space)
        own = unit[1:] if space.model.axisymmetric else unit
        bodies = _connected(space, of_node)
        twists = [own / _lengths(body) for body in bodies]
        attached = space.agreed(space.attached)
        for rigid in constraints.rigid:
            bare, arm = rigid.nodes[~attached[rigid.nodes]], rigid.arm[space.mask_own(rigid.nodes)]
            square, n_arms, n_bare = space.share.total(np.array([np.square(arm).sum(), len(arm), len(bare)]))
            if n_bare:
                of_node[bare], radius = len(bodies), _radius(square / n_arms)
                bodies.append(Body(f"rigid {rigid.name!r}", bare, rigid.centre - space.origin, radius))
                twists.append(unit[: len(rigid.free)][rigid.free] / _lengths(bodies[-1]))
        block = np.repeat(np.arange(len(bodies)), [len(own) for own in twists])
        return cls(space, tuple(bodies), of_node, block, np.concatenate(twists))

    def at(self, nodes: Ints) -> csr_array:
        """Return the displacements Phi (n_dof, a) of some nodes."""
        nodes = nodes[self.of_node[nodes] >= 0]
        body, space = self.of_node[nodes], self.space
        first, stop = (np.searchsorted(self.block, body, side) for side in ("left", "right"))
        node = np.repeat(np.arange(len(nodes)), stop - first)
        motion = np.arange(len(node)) + (first - np.cumsum(stop - first) + stop - first)[node]
        centre = np.array([b.centre for b in self.bodies]).reshape(-1, 3)
        unit = self.twists[motion]
        u = unit[:, :3] + np.cross(unit[:, 3:], space.local.points[nodes[node]] - centre[body[node]])
        return sparse((space.n_dof, len(self.block)), (space.dofs(nodes[node]), motion[:, None], u[:, : space.dim]))


def _connected(space: Space, of_node: Ints) -> list[Body]:
    """Return the connected bodies of the model, in the order of their numbers, each with its nodes of this process."""
    centre, square = centres(space, of_node)
    n = len(centre)
    nodes = np.argsort(of_node, kind="stable")[np.count_nonzero(of_node < 0) :]
    parts = np.split(nodes, np.cumsum(np.bincount(of_node[nodes], minlength=n))[:-1])
    named = zip(body_names(space, of_node), parts, centre, square, strict=True)
    return [Body(name, there, c, _radius(s)) for name, there, c, s in named]


def centres(space: Space, of_node: Ints) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return the mean (n, 3) of the nodes of each connected body, and the mean square (n,) of their distances from it.

    `of_node` (n_nodes,): `Space.bodies`. The nodes are those of all processes.
    """
    n, share = int(space.share.largest(float(of_node.max(initial=-1)))) + 1, space.share
    own, x = space.own(of_node).ravel(), space.own(space.local.points.ravel())
    own, x = own[own >= 0], x[own >= 0]

    def sums(values: Floats | None = None) -> NDArray[np.floating]:
        return share.total(np.bincount(own, values, minlength=n).astype(float))

    count = np.maximum(sums(), 1)
    centre = np.stack([sums(x[:, k]) for k in range(3)], axis=1) / count[:, None]
    return centre, sums(np.square(x - centre[own]).sum(axis=1)) / count


def body_names(space: Space, of_node: Ints) -> list[str]:
    """Return the name of each body, by its groups or its place: `lacmesh.topology.bodies`.

    `of_node` (n_nodes,): `Space.bodies`. All processes call it at the same time.
    """
    share = space.share
    n = int(share.largest(float(of_node.max(initial=-1)))) + 1

    def largest(x: Floats) -> NDArray[np.floating]:
        return share.gather(np.asarray(x)[None]).max(axis=0)

    return names_of(space.mesh, of_node, n, own=share.own, total=share.total, largest=largest)


def _radius(square: float) -> float:
    return float(np.sqrt(square)) or 1.0


def _lengths(body: Body) -> Floats:
    return np.array([1.0, 1.0, 1.0, *(3 * [body.radius])])


def _unit_twists(space: Space) -> Floats:
    """Return the unit motions (m, 6) of a rigid body in the order of `RigidBody`: displacements, rotations."""
    chosen = {True: [0, 1], False: [0, 1, 5] if space.dim == 2 else list(range(6))}[space.model.axisymmetric]
    return np.eye(6)[chosen]


def _equation_rows(space: Space, one: Equations, Phi: csr_array) -> csr_array:
    """Return equations C u + E s on unit motions (n_dof, a) at own nodes, each of size 1, for the nearest s.

    All processes have all of the equations, and the first one returns them.
    """
    E = csr_array((one.C.shape[0], 0)) if one.E is None else one.E
    size = np.sqrt(np.asarray(one.C.power(2).sum(axis=1) + E.power(2).sum(axis=1)).ravel())
    unit = diags_array(_inverse(size))
    rows = csr_array(unit @ space.share.total_matrix(csr_array(one.C @ Phi)))
    if one.E is not None:
        Q = orth((unit @ E).toarray())
        rows = csr_array(rows - csr_array(Q @ (Q.T @ rows)))
    return rows if space.share.rank == 0 else rows[:0]


def _inverse(size: Floats) -> NDArray[np.floating]:
    """Return 1 / size, 0 where it is 0."""
    return np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)


def _without_round_off(rows: csr_array) -> csr_array:
    """Return rows on unit motions without entries that are round-off, which would join systems."""
    rows.data[np.abs(rows.data) < _ROUNDING] = 0.0
    rows.eliminate_zeros()
    return rows


def _null_spaces(
    rows: csr_array, block: Ints, least: float, *, total: bool = False
) -> Iterator[tuple[Ints, Ints, Floats]]:
    """Yield the null space of rows (m, a) by systems: (blocks, columns (c,), orthonormal basis (k, c)), if k > 0.

    `block` (a,): columns of one block belong to the same system, and so do blocks that a row couples. `least`:
    threshold of the root mean square over a system's rows, or of the root of their sum of squares if `total`.
    """
    n = int(block.max(initial=-1)) + 1
    column = sparse((len(block), n), (np.arange(len(block)), block, 1.0))
    touched = abs(rows) @ column
    system = joined_columns(touched)
    filled = np.flatnonzero(np.diff(touched.indptr))
    of_row = system[touched.indices[touched.indptr[filled]]]
    order = np.argsort(of_row, kind="stable")
    edges = np.searchsorted(of_row[order], np.arange(system.max(initial=-1) + 2))
    for k in range(len(edges) - 1):
        columns = np.flatnonzero(system[block] == k)
        mine = rows[filled[order[edges[k] : edges[k + 1]]]][:, columns].toarray()
        basis = _null(mine, least if total else least * np.sqrt(len(mine)))
        if len(basis):
            yield np.flatnonzero(system == k), columns, basis


def _null(rows: Floats, least: float) -> NDArray[np.floating]:
    """Return an orthonormal basis (k, c) of the right singular vectors of rows (m, c) up to the value `least`."""
    if not len(rows):
        return np.eye(rows.shape[1])
    R = np.linalg.qr(rows, mode="r")
    _, s, Vt = np.linalg.svd(R)
    return Vt[int((s > least).sum()) :]


def _by_bodies(motions: Sequence[FreeMotion]) -> Ints:
    """Return a number (k,) for each motion, the same for motions with a common body, directly or through others."""
    place: dict[Body, int] = {}
    pairs = [(k, place.setdefault(body, len(place))) for k, motion in enumerate(motions) for body in motion.bodies]
    motion, body = np.array(pairs).T
    n = len(motions)
    return label_components(motion, n + body, n + len(place))[:n]


def _fields(motions: Sequence[FreeMotion], x: Floats | None = None) -> csr_array:
    """Return the displacements (n_dof, k) of motions, with nodes at x (n_nodes, 3) or undeformed if None."""
    space = motions[0].space
    moved = ((motion.nodes, motion.at_nodes if x is None else motion.at(x)) for motion in motions)
    entries = [(space.dofs(nodes), k, u) for k, (nodes, u) in enumerate(moved)]
    return sparse((space.n_dof, len(motions)), *entries)


def _together(motions: Sequence[FreeMotion]) -> tuple[list[Body], Floats]:
    """Return the bodies that some motions move, each once, and the motions' twists (k, b, 6)."""
    place: dict[Body, int] = {}
    for motion in motions:
        for body in motion.bodies:
            place.setdefault(body, len(place))
    twists = np.zeros((len(motions), len(place), 6))
    for k, motion in enumerate(motions):
        twists[k, [place[body] for body in motion.bodies]] = motion.twists
    return list(place), twists
