"""Springs of a case: from nodes to the ground, and between two nodes, as a matrix or as lines that turn."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from lacmesh.errors import DataError
from lacmesh.mesh import Floats, Ints, concatenated
from lacsolver.bodies.line_springs import LineSprings, between_nodes
from lacsolver.case import Case, Spring
from lacsolver.constraints.coupling import rigid_records
from lacsolver.space.axes import directions
from lacsolver.space.places import nodes_before_cut, nodes_of, on_bodies, wrong
from lacsolver.space.space import Space
from lacsolver.space.sparse import sparse_blocks

_AXES = "xyz"
#: distance, relative to the bodies' extent, up to which two nodes are at one place
_APART = 1e-9


def springs_of(space: Space, case: Case, *, along_lines: bool = True) -> csr_array | None:
    """Return the stiffness (n_dof, n_dof) of springs; None if there are none.

    `along_lines`: with those along the undeformed line between two nodes. Raises CaseError for ends that are not one
    node each, or are at one place, and DataError for nodes without a cell.
    """
    moved = _on_rigid_bodies(space, case)
    parts = [_matrix(space, spring, moved) for spring in case.spring if along_lines or spring.k is None]
    return csr_array(sum(parts[1:], parts[0])) if parts else None


def line_springs(space: Space, case: Case) -> LineSprings | None:
    """Return the springs along the line between two nodes, which turns with them; None if there are none."""
    records = [spring for spring in case.spring if spring.k is not None]
    if not records:
        return None
    moved = _on_rigid_bodies(space, case)
    ends = np.array([_ends(space, spring, moved) for spring in records])
    return LineSprings(space, ends, np.array([spring.k for spring in records], float))


def to_ground(space: Space, nodes: Ints, k: Floats, along: Floats) -> csr_array:
    """Return the stiffness (n_dof, n_dof) of springs from nodes (n,) to the ground.

    `k` (dim,): stiffness along the directions `along` (n, dim, dim), one a row.
    """
    matrix = sparse_blocks(space.n_dof, [(space.dofs(nodes), np.einsum("k,nki,nkj->nij", k, along, along))])
    matrix.eliminate_zeros()
    return matrix


def _matrix(space: Space, spring: Spring, moved: Ints) -> csr_array:
    """Return the stiffness (n_dof, n_dof) of a spring; one between two nodes along its undeformed line or its axes."""
    k = np.array([getattr(spring, f"k{a}") or 0.0 for a in _AXES[: space.dim]])
    if spring.to is None:
        nodes = on_bodies(space, nodes_before_cut(space, spring), "spring", moved)
        return to_ground(space, nodes, k, directions(space, spring, nodes))
    ends = _ends(space, spring, moved)
    along = directions(space, spring, ends[:1])[0]
    if spring.k is not None:
        line = np.subtract(*space.local.points[ends[::-1], : space.dim])
        k, along = np.array([spring.k]), line[None] / np.linalg.norm(line)
    return between_nodes(space, ends[None], np.einsum("k,ks,kt->st", k, along, along)[None])


def _on_rigid_bodies(space: Space, case: Case) -> Ints:
    """Return the nodes (k,) of rigid bodies, on which springs act without a cell."""
    return concatenated(nodes_of(space, body) for body in rigid_records(case))


def _ends(space: Space, spring: Spring, moved: Ints) -> Ints:
    """Return the two nodes (2,) of a spring. Raises CaseError unless they are two, at two places for one on a line."""
    records = spring, spring.altered(group=spring.to, at=None)
    nodes = [np.unique(nodes_before_cut(space, record)) for record in records]
    for record, own in zip(records, nodes, strict=True):
        if len(own) > 1:
            message = f"the group {record.group!r} has {len(own)} nodes, and a spring between two nodes has one at"
            raise wrong(spring, f"{message} each end; name a group of one node")
    ends = np.concatenate(nodes)
    if ends[0] == ends[1]:
        raise wrong(spring, f"both its ends are node {space.mesh.node_number[ends[0]]}; name another one by to")
    if spring.k is not None and np.ptp(space.local.points[ends], axis=0).max() <= _APART * space.extent:
        numbers = " and ".join(str(number) for number in space.mesh.node_number[ends])
        raise wrong(spring, f"nodes {numbers} are at one place, with no line between them; give kx, ky, kz and no k")
    try:
        on_bodies(space, ends, "spring", moved)
    except DataError as error:
        raise wrong(spring, str(error)) from None
    return ends
