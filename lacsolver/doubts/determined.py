"""The hypothesis of the method in a case: every macro-element has an internal dof of its own that is free.

A pressure is determined by the displacements that it does work on: by the internal dof of its macro-element, unless
this is prescribed or moved by a rigid body; then by the master's nodes alone. More macro-elements without a free
internal dof than free nodes in front of them have pressures that nothing determines, whatever their size: such a case
is refused. A slave that is stiffer and finer than its master comes near to that (docs/theory.md, 'Slave and master').
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.cells import CELLS
from lacmesh.checks.findings import named
from lacmesh.mesh import Floats, Ints
from lacmesh.surface import Surface
from lacmesh.surface.normals import unit
from lacmesh.surface.points import face_measure
from lacmesh.surface.record import mean_normals
from lacmesh.topology.skin import FACE_TYPES
from lacsolver.bodies.material import Materials
from lacsolver.case import Contact
from lacsolver.constraints import Constraints
from lacsolver.contact import Interface, Zone, integrate
from lacsolver.doubts.run import Doubt, Run
from lacsolver.problem.pair import ContactPair
from lacsolver.space.space import Space

#: slaves this much stiffer than their master, in modulus over size, are named as the cause of alternating pressures
STIFFER = 2.0
#: square of the sine of the least angle at which a free direction may stand to the normal's plane
_FREE = 0.01
#: entries of a contact row below this part of its largest are round-off
_ROUNDING = 1e-9

Bools = NDArray[np.bool_]


def undetermined(run: Run) -> Iterator[Doubt]:
    """Refuse pairs with pressures that nothing determines.

    Rigid bodies on rigid bodies are not judged: whether anything holds them is checked elsewhere.
    """
    constraints = run.parts.constraints
    for pair in run.pairs:
        if constraints is None or own_free(pair, run.space, constraints).all():
            continue
        lacking, nodes = lacking_dofs(pair, _facing(run, pair), run.space, constraints)
        if lacking.sum() > nodes:
            yield Doubt(_refusal(pair, lacking, nodes, run.space, constraints), pair.record, fatal=True)


def lacking_dofs(pair: ContactPair, face: Interface, space: Space, constraints: Constraints) -> tuple[Bools, int]:
    """Return a mask (m,) of macro-elements with a master in front of them, and without a free internal dof.

    And the number of free nodes and motions that determine their pressures.
    """
    lacking = (face.w > 0) & ~own_free(pair, space, constraints) & (not pair.law.yields)
    nodes, motions = _columns(face, lacking, constraints)
    if not len(nodes):  # rigid on rigid
        lacking[:] = False
    return lacking, len(nodes) + len(motions)


def stiffer_and_finer(run: Run, pair: ContactPair) -> bool:
    """True if a stiffer slave has more macro-elements than the master has free nodes in front of them, at the end."""
    problem, constraints, space = run.problem, run.problem.constraints, run.space
    face = pair.integrate(space, run.state.u, run.state.time)
    lacking, _ = lacking_dofs(pair, face, space, constraints)
    stiffness, give = _own_stiffness(pair, own_free(pair, space, constraints), space, constraints, problem.materials)
    counts = np.bincount(face.points.macro, face.weight * give[face.points.master], len(face.w)).astype(float)
    mean = np.divide(space.share.total(counts), face.w, out=np.zeros_like(face.w), where=face.w > 0)
    chosen = lacking | (np.nan_to_num(stiffness * mean, posinf=0.0) >= STIFFER)
    nodes, _ = _columns(face, chosen, constraints) if chosen.any() else (np.empty(0, np.int64), None)
    return bool(chosen.sum() > len(np.setdiff1d(nodes, pair.zone.slave.faces.nodes)))


def own_free(pair: ContactPair, space: Space, constraints: Constraints) -> Bools:
    """Return a mask (m,), True for macro-elements with an internal dof that is free along what the law acts on.

    It is the normal of a contact; all directions of a tie. Macro-elements without internal nodes, which no cut makes
    (`lacmesh check` finds them in others' records), count as free.
    """
    zone, dim = pair.zone, space.dim
    owner = internal_nodes(zone, space.mesh.n_nodes)
    nodes = np.flatnonzero(owner >= 0)
    T = csr_array(constraints.nodal_T)
    free = np.stack([_products(T, dim * nodes + i, dim * nodes + j) for i in range(dim) for j in range(dim)], axis=-1)
    free = free.reshape(-1, dim, dim)  # projectors on the free directions
    if pair.law.all_components:
        part = np.einsum("nkk->nk", free).min(axis=1)
    else:
        n, _ = mean_normals(zone.slave)
        mean = unit(zone.sums(n * face_measure(zone.slave)[:, None])[:, :dim])[owner[nodes]]
        part = np.einsum("ni,nij,nj->n", mean, free, mean)
    all_, free_ = (np.bincount(owner[some], minlength=zone.n_macros) for some in (nodes, nodes[part > _FREE]))
    return (free_ > 0) | (all_ == 0)


def internal_nodes(zone: Zone, n_nodes: int) -> Ints:
    """Return the macro-element (n_nodes,) that alone has each node of the slave; -1 for others."""
    faces = zone.slave.faces.nodes
    low, high = np.full(n_nodes, zone.n_macros), np.full(n_nodes, -1)
    row, column = np.nonzero(faces >= 0)
    np.minimum.at(low, faces[row, column], zone.macro[row])
    np.maximum.at(high, faces[row, column], zone.macro[row])
    return np.where(low == high, low, -1)


def _products(T: csr_array, a: Ints, b: Ints) -> NDArray[np.floating]:
    """Return the products (k,) of rows a (k,) with rows b (k,)."""
    return np.asarray(T[a].multiply(T[b]).sum(axis=1)).ravel()


def _columns(face: Interface, chosen: Bools, constraints: Constraints) -> tuple[Ints, Ints]:
    """Return the free nodes, and the free motions of rigid bodies, that pressures on macro-elements (m,) do work on."""
    per = face.B.shape[0] // len(chosen)
    B = csr_array(face.B[np.flatnonzero(np.repeat(chosen, per))])
    work = csr_array(B @ constraints.T)
    work.data[np.abs(work.data) <= _ROUNDING * np.abs(B.data).max(initial=0.0)] = 0.0
    work.eliminate_zeros()
    used, n = np.unique(work.indices), constraints.n_nodal
    return np.unique(constraints.node_of_unknown[used[used < n]]), used[used >= n]


def _own_stiffness(
    pair: ContactPair, free: Bools, space: Space, constraints: Constraints, materials: Materials
) -> tuple[Floats, Floats]:
    """Return the stiffness (m,) of the slave, modulus over size, with a soft contact's; the give (f,) of the master.

    The give is size over modulus, with the distance of nodes as the size: 0 where the master has no free node, or a
    law without a modulus.
    """
    zone, dim = pair.zone, space.dim - 1
    young = _young(space, materials, constraints)
    E_s, E_m = (_of_faces(skin, young) for skin in (zone.slave, zone.master))
    area = zone.sums(face_measure(zone.slave))
    modulus = np.divide(zone.sums(E_s * face_measure(zone.slave)), area, out=np.zeros_like(area), where=area > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        give = np.where(free, area ** (1 / dim) / modulus, 0.0)
        if isinstance(pair.record, Contact) and pair.record.stiffness is not None:
            give = give + 1 / pair.record.stiffness.at(0.0)
        elif pair.law.yields:
            give = give + np.inf
        order = np.array([CELLS[name].order for name in FACE_TYPES])[zone.master.faces.type]
        theirs = face_measure(zone.master) ** (1 / dim) / order / E_m
    return np.divide(1.0, give, out=np.zeros_like(give), where=give > 0), np.nan_to_num(theirs, posinf=0.0)


def _young(space: Space, materials: Materials, constraints: Constraints) -> NDArray[np.floating]:
    """Return the mean modulus (n_nodes,) of the cells at each node; infinite at nodes that are not free."""
    moduli = np.array([float(np.mean(getattr(law, "young", np.nan))) for law in materials.laws])
    total, count = np.zeros(space.mesh.n_nodes), np.zeros(space.mesh.n_nodes)
    for block, law in zip(space.blocks, materials.law, strict=True):
        nodes = block.nodes.ravel()
        total += np.bincount(nodes, np.repeat(moduli[law], block.nodes.shape[1]), len(total))
        count += np.bincount(nodes, minlength=len(total))
    free = (np.diff(constraints.nodal_T.indptr).reshape(-1, space.dim) > 0).any(axis=1)
    return np.where(free, np.divide(total, count, out=np.full_like(total, np.inf), where=count > 0), np.inf)


def _of_faces(skin: Surface, values: Floats) -> NDArray[np.floating]:
    """Return the mean (f,) of values (n_nodes,) at the nodes of each face; infinite values count only where all are."""
    nodes = skin.faces.nodes
    there = np.where(nodes >= 0, values[nodes], np.inf)
    fine = ~np.isinf(there)
    n = fine.sum(axis=1)
    return np.divide(np.where(fine, there, 0.0).sum(axis=1), n, out=np.full(len(n), np.inf), where=n > 0)


def _facing(run: Run, pair: ContactPair) -> Interface:
    """Return the interface of a pair at the start; skins that are to meet later are paired at any distance."""
    face, space = run.face(pair), run.space
    if not pair.moving or (face.w > 0).any():
        return face
    skins = np.concatenate([pair.zone.slave.faces.nodes.ravel(), pair.zone.master.faces.nodes.ravel()])
    far = replace(pair.pairing, search_distance=float(np.ptp(space.local.points[skins[skins >= 0]], axis=0).sum()))
    return integrate(pair.zone, space.dim, far, t=run.start, tie=pair.law.all_components, share=space.share)


def _refusal(pair: ContactPair, lacking: Bools, nodes: int, space: Space, constraints: Constraints) -> str:
    """Return the message for a pair with pressures that nothing determines."""
    zone, record = pair.zone, pair.record
    owner = internal_nodes(zone, space.mesh.n_nodes)
    without = np.flatnonzero(np.isin(owner, np.flatnonzero(lacking)))
    moved = [body.name for body in constraints.rigid if np.isin(without, body.nodes).any()]
    why = f"rigid body {moved[0]!r} moves them" if moved else "their displacement is prescribed"
    message = f"{int(lacking.sum()):,} of {zone.n_macros:,} macro-elements of slave {record.slave!r} have no "
    message += f"internal dof that is free, for {why}, and master {record.master!r} has only {nodes:,} free "
    message += "nodes in front of them, which do not determine as many pressures"
    return named(f"{message}; exchange slave and master, or refine the master", "fixed-internal-dof")
