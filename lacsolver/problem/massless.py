"""Nodes without mass: which they are, and the velocity that each of them has instead.

Contact is well posed in motion if every contact row has an entry at a node without mass (docs/theory.md): the pressures
then follow from the displacements, without impulses. The velocity field is v = P v_y, with v_y at the nodes that keep
their mass, and the mass matrix is P^T M P: its total is that of M, and it is positive definite on v_y.

Several processes all have the skins with the cells that touch them. Each decides about its own nodes, as it has all
cells there; then all have the rows of P at massless nodes.

Rows of P at massless nodes have the weights 1 / distance², normalised, of the nearest nodes with mass. Pressures are
smooth only with such positive weights. For internal nodes alone the weights reproduce linear fields, so that centres
and inertia stay exact.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array, eye_array

from lacmesh.cutting.records import NODE_RECORD
from lacmesh.mesh import Ints, mask_of
from lacsolver.contact import Zone
from lacsolver.problem.rigid_modes import body_names
from lacsolver.space.cut_nodes import inside_children
from lacsolver.space.space import Space
from lacsolver.space.sparse import sparse

Bools = NDArray[np.bool_]
#: most steps from node to node, through cells, to the nodes that take the mass of another
_RINGS = 3


class Massless(NamedTuple):
    """Nodes without mass: `nodes` (n_nodes,) a mask, `P` (n_nodes, n_nodes) the velocities of all nodes by those of
    nodes with mass. `told`: one sentence for each body whose skins keep their mass, in part.
    """

    nodes: Bools
    P: csr_array
    told: tuple[str, ...]


def massless_nodes(space: Space, zones: Sequence[Zone], choice: str, rigid: Ints) -> Massless:
    """Return the massless nodes for a choice of [dynamics] massless; nodes of `rigid` bodies keep their mass.

    A body that would have no node with mass near some of its skin nodes keeps the mass of its master skins, or, if
    this does not suffice, that of all its nodes but the internal ones.
    """
    indptr, indices = space.pattern
    adjacent = csr_array((np.ones(len(indices)), indices, indptr), shape=(space.mesh.n_nodes,) * 2)
    rigid_node = mask_of(space.mesh.n_nodes, rigid)
    attached = space.agreed(space.attached)
    movable, levels = attached & ~space.agreed(rigid_node), _levels(space, zones)
    wanted, sentences, of_node = levels[choice] & movable, [], space.bodies
    for fallback, words in (("slave", "all but its master skins"), ("internal", "its internal nodes alone")):
        if choice in (fallback, "internal", "none"):
            continue
        stranded = wanted & ~_reached(space, adjacent, attached & ~wanted)
        short = np.unique(space.share.gather(np.unique(of_node[stranded])))
        if len(short):
            there = np.isin(of_node, short)
            wanted = np.where(there, levels[fallback] & movable, wanted)
            names = body_names(space, of_node)
            sentences += [
                f"{names[body]} is too thin for massless surfaces: {words} are massless, if any" for body in short
            ]
    wanted &= _reached(space, adjacent, attached & ~wanted)
    own = wanted if space.share.own is None else wanted & space.share.own
    around = space.share.add_matrices(csr_array(diags_array(own.astype(float)) @ adjacent), (True, True))
    return Massless(wanted, _velocities(space, around, wanted, linear=choice == "internal"), tuple(sentences))


def _levels(space: Space, zones: Sequence[Zone]) -> dict[str, Bools]:
    """Return the mask (n_nodes,) of the nodes that each choice makes massless."""
    n = space.mesh.n_nodes
    record = space.mesh.node_data.get(NODE_RECORD)
    internal = np.zeros(n, bool) if record is None else np.asarray(record) >= 0
    slave, master = np.zeros(n, bool), np.zeros(n, bool)
    for zone in zones:
        for mask, skin in ((slave, zone.slave), (master, zone.master)):
            mask[skin.faces.nodes[skin.faces.nodes >= 0]] = True
    born = internal | space.agreed(inside_children(space.mesh, space.dim))
    return {"skins": born | slave | master, "slave": born | slave, "internal": internal, "none": np.zeros(n, bool)}


def _reached(space: Space, adjacent: csr_array, nodes: Bools) -> Bools:
    """Return the mask of the nodes at most two cells away from some `nodes`."""
    once = space.agreed(adjacent @ nodes.astype(float) > 0)
    return space.agreed(adjacent @ once.astype(float) > 0)


def _velocities(space: Space, adjacent: csr_array, massless: Bools, linear: bool) -> csr_array:
    """Return P (n_nodes, n_nodes): the identity at nodes with mass, weights of nearby ones at massless nodes.

    `adjacent` (n_nodes, n_nodes): ones at the neighbours of massless nodes.
    """
    n = space.mesh.n_nodes
    P = diags_array((~massless).astype(float), format="csr")
    for rows, columns in _near(adjacent, massless):
        away = space.local.points[columns] - space.local.points[rows]
        weight = 1 / (away**2).sum(axis=1)
        if linear:
            weight = _reproducing(rows, away[:, : space.dim], weight, n)
        total = np.bincount(rows, weight, n)
        P = csr_array(P + sparse((n, n), (rows, columns, weight / total[rows])))
    return P


def _near(adjacent: csr_array, massless: Bools) -> Iterator[tuple[Ints, Ints]]:
    """Yield (massless nodes, nodes with mass next to them) as pairs, for the nearest ring of cells that has any."""
    left, ring = massless.copy(), csr_array(eye_array(adjacent.shape[0], format="csr"))
    for _ in range(_RINGS):
        ring = csr_array(diags_array(left.astype(float)) @ ring @ adjacent)
        ring.eliminate_zeros()
        pairs = ring.tocoo()
        there = ~massless[pairs.col]
        rows, columns = pairs.row[there].astype(np.int64), pairs.col[there].astype(np.int64)
        if len(rows):
            yield rows, columns
        left[rows] = False


def _reproducing(rows: Ints, away: NDArray[np.floating], weight: NDArray[np.floating], n: int) -> NDArray[np.floating]:
    """Return weights (k,) near the given ones that interpolate linear fields at the rows' nodes, by least squares.

    `away` (k, dim): from a row's node to the other one. Nodes whose neighbours do not span the space get what is best.
    """
    size = np.sqrt(np.bincount(rows, weight, n) / np.maximum(np.bincount(rows, minlength=n), 1))
    basis = np.column_stack([np.ones(len(rows)), away * size[rows, None]])  # lengths near 1
    used, place = np.unique(rows, return_inverse=True)
    gram = np.zeros((len(used), basis.shape[1], basis.shape[1]))
    np.add.at(gram, place, (weight / size[rows] ** 2)[:, None, None] * basis[:, :, None] * basis[:, None, :])
    first = np.linalg.pinv(gram, rcond=1e-10, hermitian=True)[:, 0]
    return np.asarray((basis * first[place]).sum(axis=1) * weight / size[rows] ** 2)
