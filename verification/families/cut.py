"""The cut of the slave skin: what must hold of the cut mesh, counted for every type, facet, turn and variant.

Every type of cell is cut by each of its facets, listed from each corner and both ways round, in each variant, and in
the full suite by every set of its facets; blocks of every kind are cut by two sides that meet and, in the full suite,
by faces between two cells. What must hold is counted from the meshes before and after: children fill their parent and
are positive, the mesh conforms, what was not cut is unchanged, the children of a slave face stand in order and face as
it did, every macro-element owns an internal dof, groups, numbers and data follow, and the order of cells and groups
does not matter (Abbas, Drouet, Hild, Comput. Methods Appl. Mech. Engrg. 339, 2018; code_aster R5.03.55, 3.1). The
verdict of `lacmesh.check` stands beside.

Totals of cells and nodes are compared with those of code_aster's own test.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

import lacmesh
from lacmesh import Cut, Mesh
from lacmesh.cells import CELLS
from lacmesh.generate import box, sphere
from lacmesh.generate.parts import SPLITS, assembled, divided
from verification.measures.cutting import PROPERTIES, facets, same_up_to_numbers, violations
from verification.meshes.blocks import joined
from verification.meshes.stacks import BEND, LAYERS, PLANE_KINDS, SOLID_KINDS, TWO_WAYS, block, moved
from verification.records import Case, Family, Rows, at_least, at_most, equal, informative, problem, row

Ints = NDArray[np.integer]

_SOURCE = "Abbas, Drouet, Hild, 2018; code_aster R5.03.55, 3.1"
#: what is counted beside `PROPERTIES`
_ADDED = "types with another number of new nodes and cells than the rule's"
_ORDER = "meshes that depend on the order of cells and groups"
_AGAIN = "cut meshes that a further cut changes"
_CHECKED = "findings of lacmesh check that are errors"
_COUNTED = (*PROPERTIES, _ADDED, _ORDER, _AGAIN, _CHECKED)

#: (cell, slave face, variant) -> nodes and net cells added by one slave face, skin and volume together
_RULE: dict[tuple[str, str, str], tuple[int, int]] = {
    ("TRIA3", "SEG2", ""): (1, 2), ("QUAD4", "SEG2", ""): (4, 5),
    ("TETRA4", "TRIA3", ""): (1, 4), ("TETRA10", "TRIA6", ""): (5, 4),
    ("HEXA8", "QUAD4", "hexa"): (8, 9), ("HEXA8", "QUAD4", "pyramid"): (1, 7),
    ("HEXA20", "QUAD8", "hexa"): (28, 9), ("HEXA20", "QUAD8", "pyramid"): (9, 7),
    ("PENTA6", "TRIA3", ""): (1, 5), ("PENTA6", "QUAD4", ""): (1, 6),
    ("PENTA15", "TRIA6", ""): (7, 5), ("PENTA15", "QUAD8", ""): (7, 6), ("PENTA18", "TRIA6", ""): (7, 5),
    ("PYRAM5", "QUAD4", ""): (1, 6), ("PYRAM5", "TRIA3", ""): (1, 5),
    ("PYRAM13", "QUAD8", ""): (6, 6), ("PYRAM13", "TRIA6", ""): (6, 5), ("PYRAM14", "TRIA6", ""): (6, 5),
}  # fmt: skip
_BEND = 0.3
#: faces that own an internal dof as they are, and are left whole
_WHOLE = ("SEG3", "QUAD9")


@dataclass(frozen=True)
class Counted:
    """One cell (or a cube of tetrahedra) with all its facets and edges, cut: how many cells and nodes it has then.

    `order`: that the mesh is raised to before; `slaves`: places of facets, a zone each; `name`: of code_aster's row.
    """

    name: str
    cell: str
    order: str
    slaves: tuple[int, ...]
    hexa: str
    n_cells: int
    n_nodes: int


@dataclass(frozen=True)
class Trial:
    """A mesh that is cut: `count` bodies in it. `added`: nodes and cells that come to it, None where not asked."""

    label: str
    mesh: Mesh
    slave: tuple[str, ...]
    hexa: str
    count: int = 1
    added: tuple[int, int] | None = None


@problem
def compare_counts(rows: tuple[Counted, ...]) -> Rows:
    """Count cells and nodes after the cut."""
    for one in rows:
        mesh = with_all(one.cell, one.order)
        cut = lacmesh.cut_skin(mesh, [f"facet{k}" for k in one.slaves], hexa=one.hexa or "pyramid").mesh
        source = f"code_aster, test zzzz383{one.name}, on a mesh of the same cells"
        for what, count, wanted in (("cells", cut.n_cells, one.n_cells), ("nodes", cut.n_nodes, one.n_nodes)):
            yield equal(f"{what} of {one.name}", count, wanted, 0, source=source, reason="a count")


@problem
def run(dim: int, cells: tuple[str, ...], blocks: tuple[str, ...], *, levels: int) -> Rows:
    """Cut single `cells` by every facet, turn and variant, and small `blocks` of a kind by several sides, and count;
    `dim` of all. A second level has every set of a cell's faces, and slave faces between two cells.
    """
    counters: dict[str, Counter[str]] = {name: Counter() for name in _COUNTED}
    count, worst = 0, np.inf
    for trial in trials(dim, cells, blocks, levels):
        count += trial.count
        cut = lacmesh.cut_skin(trial.mesh, trial.slave, hexa=trial.hexa)
        for name, wrong in broken(trial, cut).items():
            counters[name][trial.label] += wrong
        quality = lacmesh.measure_quality(cut.mesh, "body", "corner_jacobian")
        worst = min(worst, *(part.measures["corner_jacobian"].least for part in quality.types))
    for name, counter in counters.items():
        first = next((f"; first: {label}" for label, wrong in counter.items() if wrong), "")
        yield at_most(name, sum(counter.values()), 0, source=_SOURCE, reason=f"counted in {count} bodies{first}")
    reason = f"of {count} bodies, in cells that are sheared by up to a quarter: it depends on the cells that are cut"
    yield informative("worst corner Jacobian of a cell", worst, reason=reason)


def broken(trial: Trial, cut: Cut) -> dict[str, int]:
    """Count all that is wrong with one cut, by name."""
    counts = violations(trial.mesh, cut)
    added = (cut.mesh.n_nodes - trial.mesh.n_nodes, cut.mesh.n_cells - trial.mesh.n_cells)
    other = lacmesh.cut_skin(backwards(trial.mesh), trial.slave[::-1], hexa=trial.hexa)
    again = lacmesh.cut_skin(cut.mesh, trial.slave, hexa=trial.hexa).mesh
    return counts | {
        _ADDED: int(trial.added is not None and added != trial.added),
        _ORDER: int(not same_up_to_numbers(other.mesh, cut.mesh)),
        _AGAIN: int(again.n_cells != cut.mesh.n_cells or not same_up_to_numbers(again, cut.mesh)),
        _CHECKED: len(lacmesh.check(cut).errors),
    }


def single(name: str, slaves: Sequence[int], turn: int, inward: bool, seed: int = 0) -> Mesh:
    """One sheared cell, some of its facets as the group `slave`, listed from another corner or the other way round."""
    cell = CELLS[name]
    rng = np.random.default_rng(seed)
    shear = np.eye(cell.dim) + 0.25 * rng.uniform(-1, 1, (cell.dim, cell.dim))
    rows: dict[tuple[str, str], list[Ints]] = {(name, "body"): [np.arange(cell.n_nodes)]}
    for k in slaves:
        facet = cell.facets[k]
        rows.setdefault((facet.type, "slave"), []).append(listed(np.array(facet.nodes), facet.type, turn, inward))
    points = np.pad(np.array(cell.reference) @ shear.T, ((0, 0), (0, 3 - cell.dim)))
    return assembled(points, {key: np.array(nodes) for key, nodes in rows.items()}, cell.dim)


def sided(kind: str, dim: int, *, between: bool = False) -> Mesh:
    """A block of uneven, distorted cells; the groups `slave` (top, or facets between two cells) and `slave2` (a side).

    Slave faces are listed by turns from each corner and both ways round.
    """
    mesh = block(kind, (*(3,) * (dim - 1), LAYERS), bend=_BEND, skew=0.05)
    up = dim - 1
    rows = {(b.type, "body"): list(b.nodes) for b in mesh.blocks if CELLS[b.type].dim == dim}
    height = 0.5 + 0.25 * BEND[up] * _BEND if between else 1.0
    for k, (face, nodes) in enumerate(own[0] for own in facets(mesh).values()):
        x = mesh.points[nodes]
        group = "slave" if np.allclose(x[:, up], height) else "slave2" if np.allclose(x[:, 0], 1.0) else ""
        if group:
            rows.setdefault((face, group), []).append(listed(nodes, face, k % 4, k % 3 == 0))
    return _dressed(assembled(mesh.points, {key: np.array(nodes) for key, nodes in rows.items()}, dim))


def listed(nodes: Ints, kind: str, turn: int, inward: bool) -> Ints:
    """The nodes of a face from another of its corners on, or the other way round."""
    cell, n = CELLS[kind], CELLS[kind].n_corners
    if n == 2:
        return nodes[[1, 0, *range(2, len(nodes))]] if inward else nodes
    places = [(turn + (-k if inward else k)) % n for k in range(n)]
    order = list(places)
    if cell.order == 2:
        edges = {frozenset((k, (k + 1) % n)): n + k for k in range(n)}
        order += [edges[frozenset(pair)] for pair in zip(places, places[1:] + places[:1], strict=True)]
        order += range(2 * n, cell.n_nodes)
    return nodes[order]


def backwards(mesh: Mesh) -> Mesh:
    """Copy of a mesh with its types, cells and groups in the opposite order."""
    place = np.empty(mesh.n_cells, int)
    blocks, first = [], 0
    for k, b in reversed(list(enumerate(mesh.blocks))):
        place[mesh.offsets[k] : mesh.offsets[k + 1]] = first + np.arange(len(b.nodes))[::-1]
        blocks.append((b.type, b.nodes[::-1]))
        first += len(b.nodes)
    groups = {name: np.sort(place[mesh.cell_groups[name]]) for name in reversed(list(mesh.cell_groups))}
    return Mesh.create(mesh.points, blocks, space_dim=mesh.space_dim, cell_groups=groups)


def with_all(cell: str, order: str) -> Mesh:
    """A cell with its facets as groups `facet0`, ... and, in space, its edges; `cube`: twelve tetrahedra in a cube."""
    box = CELLS["HEXA8" if cell == "cube" else cell]
    points = np.pad(np.array(box.reference), ((0, 0), (0, 3 - box.dim)))
    rows: dict[tuple[str, str], Ints] = {(box.name, ""): np.arange(box.n_nodes)[None]}
    sides = [np.array([facet.nodes]) for facet in box.facets]
    if cell == "cube":
        halves = tuple(("TETRA4", (*corners, 8)) for _, (a, b, c, d, _) in SPLITS["PYRAM5"]
                       for corners in ((a, b, c), (a, c, d)))  # fmt: skip
        points, cells = divided(points, np.arange(8)[None], [halves], np.zeros(1, int))
        rows = {("TETRA4", ""): cells["TETRA4"]}
        sides = [np.concatenate([side[:, [0, 1, 3]], side[:, [1, 2, 3]]]) for side in sides]
    kinds = {2: "SEG2", 3: "TRIA3", 4: "QUAD4"}
    rows |= {(kinds[side.shape[1]], f"facet{k}"): side for k, side in enumerate(sides)}
    if box.dim == 3:
        rows["SEG2", ""] = np.array(box.edges)
    mesh = assembled(points, rows, box.dim)
    return mesh if order == "1" else lacmesh.raise_order(mesh, order)


def trials(dim: int, cells: tuple[str, ...], blocks: tuple[str, ...], levels: int) -> Iterator[Trial]:
    """The meshes that are cut."""
    for name in cells:
        for hexa in _ways(name):
            yield _singles(name, hexa)
            if levels > 1:
                yield _sets(name, hexa)
    for kind in blocks:
        for hexa in ("pyramid", "hexa") if kind in ("mixed 1", "mixed 2") and dim == 3 else _ways(kind):
            yield Trial(f"block of {kind}, {hexa}", sided(kind, dim), ("slave", "slave2"), hexa)
            if levels > 1:
                mesh = sided(kind, dim, between=True)
                yield Trial(f"block of {kind}, {hexa}, between cells", mesh, ("slave",), hexa)


def _singles(name: str, hexa: str) -> Trial:
    """A cell for each facet, corner that it is listed from, and way round."""
    meshes, added = [], np.zeros(2, int)
    for k, facet in enumerate(CELLS[name].facets):
        corners = CELLS[facet.type].n_corners
        one = (0, 0) if facet.type in _WHOLE else _RULE[name, facet.type, hexa if name in TWO_WAYS else ""]
        for turn in range(corners if corners > 2 else 1):
            meshes += [single(name, (k,), turn, inward, turn) for inward in (False, True)]
            added += 2 * np.array(one)
    return Trial(f"{name}, {hexa}", _apart(meshes), ("slave",), hexa, len(meshes), (int(added[0]), int(added[1])))


def _sets(name: str, hexa: str) -> Trial:
    """A cell for each set of two facets or more."""
    n = len(CELLS[name].facets)
    chosen = [facets for size in range(2, n + 1) for facets in combinations(range(n), size)]
    meshes = [single(name, facets, len(facets), bool(len(facets) % 2), k) for k, facets in enumerate(chosen)]
    return Trial(f"{name}, {hexa}, several facets", _apart(meshes), ("slave",), hexa, len(meshes))


def _apart(meshes: Sequence[Mesh]) -> Mesh:
    """Meshes in a row as one, their groups joined."""
    shifts = [np.array([5.0 * k, 0, 0]) for k in range(len(meshes))]
    names = {name: name for name in meshes[0].cell_groups}
    return _dressed(joined([(moved(mesh, shift=shift), names) for mesh, shift in zip(meshes, shifts, strict=True)]))


#: faces of a star on average, at most, from 500 faces on
_MEAN = {"TETRA4": 7.0, "HEXA8": 4.3, "TETRA10": 2.03}


@problem
def solve_stars(cell: str, *, levels: int) -> Rows:
    """Stars of whole faces on so many distorted boxes and octants of spheres of `cell`."""
    boxes = [(box((33, 31, 1), kind=cell, distortion=0.12, seed=seed), "top") for seed in range(levels)]
    balls = [(sphere(14, kind=cell, distortion=0.12, seed=seed), "outer") for seed in range(levels)]
    cuts = [(lacmesh.cut_skin(mesh, slave, macro="stars"), slave) for mesh, slave in (*boxes, *balls)]
    found = [lacmesh.check(cut.mesh, slave).summary for cut, slave in cuts]
    lost = sum(cut.n_macros - one["with_internal_dof"] for (cut, _), one in zip(cuts, found, strict=True))
    yield at_most("macro-elements without a dof of their own", lost, 0, source=_SOURCE)
    share, name = min(one["least_integral"] for one in found), "integral of a carrier's function"
    yield at_least(f"{name}, as a part of its macro-element", share, 0.1, source=_SOURCE)
    faces = [np.array([len(own) for own in cut.faces_of_macro]) for cut, _ in cuts]
    name, source = "faces of a macro-element", "the largest set of nodes, no two of which are on one face"
    yield at_most(f"{name}, mean", max(own.mean() for own in faces), _MEAN[cell], source=source)
    yield at_most(f"{name}, most", max(own.max() for own in faces), 12, source=source)


def _ways(name: str) -> tuple[str, ...]:
    return ("pyramid", "hexa") if name in TWO_WAYS else ("pyramid",)


def _dressed(mesh: Mesh) -> Mesh:
    """The mesh with numbers that are not indices, groups that overlap, and data."""
    cells, nodes = np.arange(mesh.n_cells), np.arange(mesh.n_nodes)
    return Mesh.create(
        mesh.points,
        mesh.blocks,
        space_dim=mesh.space_dim,
        cell_number=7 * cells[::-1] + 3,
        node_number=5 * nodes[::-1] + 2,
        cell_groups={**mesh.cell_groups, "all": cells, "even": cells[::2], "none": cells[:0]},
        node_groups={"every": nodes},
        cell_data={"colour": np.sin(cells)},
        node_data={"where": mesh.points.copy()},
    )


#: what code_aster's own test of the cut counts, DECOUPE_LAC (zzzz383a to d); edges and points of the file are kept
_ROWS = (
    Counted("a-1", "QUAD4", "1", (0, 3), "", 15, 12),
    Counted("a-2", "QUAD4", "2", (0,), "", 5, 8),
    Counted("b-1", "TRIA3", "1", (0,), "", 6, 4),
    Counted("b-2", "TRIA3", "2", (0,), "", 4, 6),
    Counted("c-1", "HEXA8", "1", (0,), "hexa", 28, 16),
    Counted("c-2", "HEXA8", "1", (0,), "pyramid", 26, 9),
    Counted("c-3", "HEXA8", "2", (0,), "hexa", 28, 48),
    Counted("c-4", "HEXA8", "2", (0,), "pyramid", 26, 29),
    Counted("c-5", "HEXA8", "2-full", (0,), "", 19, 27),
    Counted("d-1", "cube", "1", (0,), "", 44, 11),
    Counted("d-2", "cube", "2", (0,), "", 44, 45),
)


def _cases() -> Iterator[Case]:
    for family in ("TRIA", "QUAD", "TETRA", "HEXA", "PENTA", "PYRAM"):
        cells = tuple(name for name, cell in CELLS.items() if cell.family == family)
        blocks = tuple(kind for kind in (*PLANE_KINDS, *SOLID_KINDS) if kind.split()[0] in cells)
        words = f"{', '.join(cells)}: single cells by every facet, turn and variant, small blocks by several sides"
        yield row("cut", family, words, run, CELLS[cells[0]].dim, cells, blocks, quick=1, full=2, seconds=8.0)
    for dim, kinds in ((2, PLANE_KINDS), (3, SOLID_KINDS)):
        mixed, words = tuple(kind for kind in kinds if kind.startswith("mixed")), f"blocks of mixed cells in {dim}D"
        yield row("cut", f"mixed-{dim}d", words, run, dim, (), mixed, quick=1, full=2, seconds=3.0)
    for cell in _MEAN:
        words = f"stars of whole faces on skins of {cell}"
        yield row("cut", f"{cell}-stars", words, solve_stars, cell, quick=1, full=3, seconds=2.0)
    words = "cells and nodes as code_aster's test of its cut counts them"
    yield row("cut", "counts", words, compare_counts, _ROWS, quick=1, seconds=1.0)


FAMILY = Family("cut", "The cut", __doc__.partition("\n\n")[2], tuple(_cases()))
