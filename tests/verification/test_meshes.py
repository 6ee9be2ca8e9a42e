"""The harness's own meshes: whole, conforming, with faces where they should be, cut without complaint."""

from __future__ import annotations

from collections import Counter
from functools import partial

import numpy as np
import pytest

import lacmesh
from lacmesh.cells import CELLS
from lacmesh.reference.quadrature import measure
from lacmesh.reference.shapes import shape
from verification.exact.finite_bodies import FORCE, RADIUS, Hertz
from verification.families.manufactured import ROWS, cells_a_side, mesh_of
from verification.families.sliding import MESHES
from verification.meshes import stacks
from verification.meshes.blocks import BLOCK_TYPES, block
from verification.meshes.cylinder import cylinder_on_block
from verification.meshes.half_spaces import REACH, half_spaces
from verification.meshes.rings import octant, pair, ring
from verification.meshes.sliding import IRONED
from verification.meshes.spheres import spheres

LOW, HIGH = (-0.5, 1.0, 0.0), (0.5, 3.0, 3.0)
KINDS = [(2, kind) for kind in stacks.PLANE_KINDS] + [(3, kind) for kind in stacks.SOLID_KINDS]


def plain(kind):
    dim = CELLS[kind].dim
    return block(kind, 3, LOW[:dim], HIGH[:dim])


def bent(dim, kind):
    return stacks.block(kind, (*(3,) * (dim - 1), stacks.LAYERS), bend=0.3, skew=0.1)


def rings(kind, jitter):
    return pair(ring(kind, (2, 8), (20, 30), jitter=jitter), ring(kind, (2, 9), (30, 40), jitter=jitter, seed=1))


def octants(kind):
    return pair(octant(kind, (1, 2), (20, 30)), octant(kind, (1, 3), (30, 40)), slave="around")


#: what makes a mesh whose groups are all of its sides, its size, and to what part
CONFORMING = {
    **{f"block {kind}": (partial(plain, kind), 2 if CELLS[kind].dim == 2 else 6, 1e-13) for kind in BLOCK_TYPES},
    **{f"bent {dim} {kind}": (partial(bent, dim, kind), 1, 1e-12) for dim, kind in KINDS},
    **{
        f"rings {kind} {jitter}": (partial(rings, kind, jitter), np.pi * 300, 1e-5 if CELLS[kind].order == 2 else 1e-2)
        for kind in ("TRIA3", "TRIA6", "QUAD4", "QUAD8", "QUAD9")
        for jitter in (0.0, 0.2)
    },
    **{
        f"octants {kind}": (partial(octants, kind), np.pi / 6 * (40**3 - 20**3), rel)
        for kind, rel in {"TETRA4": 0.05, "TETRA10": 1e-3, "HEXA20": 2e-3, "HEXA27": 2e-4}.items()
    },
}
#: others
BODIES = {
    "ring": (lambda: MESHES["ring"](30), 250 * 50 + np.pi * (100**2 - 90**2) / 2, 0.01),
    "ironing_2d": (lambda: MESHES["ironing_2d"](32), IRONED[0] * IRONED[1] + np.pi * 1.5**2 / 2, 0.01),
    "ironing_3d": (lambda: MESHES["ironing_3d"](24), 13.5 + np.pi * 0.9 / 2 * (1 - 2 * 0.06 / 3 + 0.06**2 / 5), 0.02),
    **{f"spheres {kind}": (partial(spheres, kind, 6), np.pi * 50**2 / 2, 2e-3)
       for kind in ("TRIA3", "TRIA6", "QUAD4", "QUAD8")},
}  # fmt: skip


def solids(mesh):
    return mesh.select(np.flatnonzero(mesh.cell_dim == mesh.space_dim))


def assert_size(mesh, size, rel):
    sizes = np.concatenate([measure(kind, mesh.points[nodes]).ravel() for kind, _, nodes in solids(mesh)])
    assert (sizes > 0).all() and sizes.sum() == pytest.approx(size, rel=rel)


def skin(mesh, name):
    """Places of all nodes of the faces of a group (n, 3)."""
    return np.concatenate([mesh.points[nodes].reshape(-1, 3) for _, _, nodes in mesh.select(mesh.cell_groups[name])])


@pytest.mark.rows("bent 2 QUAD4", "octants HEXA27")
@pytest.mark.parametrize("name", CONFORMING)
def test_a_mesh_fills_its_place_and_its_cells_share_their_facets_or_have_them_in_a_side(name):
    make, *size = CONFORMING[name]
    mesh = make()
    assert_size(mesh, *size)
    facets = [nodes[:, list(f.nodes)] for kind, _, nodes in solids(mesh) for f in CELLS[kind].facets]
    times = Counter(tuple(sorted(row)) for rows in facets for row in rows.tolist())
    faces = mesh.select(np.flatnonzero(mesh.cell_dim == mesh.space_dim - 1))
    sides = Counter(tuple(sorted(row)) for *_, nodes in faces for row in nodes.tolist())
    assert set(times.values()) == {1, 2} and sides == {facet: 1 for facet, count in times.items() if count == 1}
    radii = {"inner": 20, "slave": 30, "master": 30, "outer": 40}
    for group, radius in radii.items() if "inner" in mesh.cell_groups else ():
        np.testing.assert_allclose(np.linalg.norm(skin(mesh, group), axis=1), radius, rtol=1e-14)
    if "inner" in mesh.cell_groups:
        assert not any(skin(mesh, f"{axis}0")[:, k].any() for k, axis in enumerate("xyz"[: mesh.space_dim]))
        assert not lacmesh.check(lacmesh.cut_skin(mesh, ["slave"])).errors


@pytest.mark.parametrize("name", BODIES)
def test_bodies_are_whole_and_do_not_match(name):
    make, *size = BODIES[name]
    mesh = make()
    assert_size(mesh, *size)
    up = mesh.space_dim - 1
    (low, below), (high, above) = sorted((skin(mesh, n)[:, up].mean(), n) for n in ("slave", "master"))
    assert low < high
    if name.startswith("spheres"):
        for group, centre in (("slave", 50.0), ("master", -50.0)):
            np.testing.assert_allclose(np.hypot(*(skin(mesh, group)[:, :2] - [0, centre]).T), 50.0, rtol=1e-9)
        assert mesh.points[:, 0].min() > -1e-9
    else:  # below its die, the block's nodes are not where the die's are
        one, other = (set(skin(mesh, n)[:, 0].round(6)) for n in (above, below))
        assert not one <= other and not other <= one


@pytest.mark.parametrize(("dim", "kind"), KINDS)
def test_a_stacks_block_turns_the_faces_that_it_is_named_by(dim, kind):
    mesh, (name, _, face) = bent(dim, kind), kind.partition(" ")
    mixed = {2: {"SEG2"}, 3: {"TRIA3", "QUAD4"}}[dim]
    for side in (f"{'xyz'[dim - 1]}{end}" for end in "01"):
        faces = {CELLS[kind].linear for kind, _, _ in mesh.select(mesh.cell_groups[side])}
        wanted = mixed if name == "mixed" else {"triangle": {"TRIA3"}, "quadrangle": {"QUAD4"}}.get(face, faces)
        assert faces == wanted and len(faces) == len(mixed) ** (name == "mixed")


@pytest.mark.rows("TRIA3", "TRIA7")
@pytest.mark.parametrize("row", ROWS.values(), ids=ROWS)
def test_a_manufactured_row_can_be_cut_and_has_a_master_that_is_exact(row):
    given, mesh = row.solution, mesh_of(row, 0)
    cut = lacmesh.cut_skin(mesh, [given.slave], **({"hexa": row.hexa} if row.hexa else {}))
    assert not lacmesh.check(cut).errors
    (cell,) = mesh.select(mesh.cell_groups["master"])
    X = np.random.default_rng(2).uniform(-1, 1, (30, given.dim - 1))
    x = shape(cell[0], X) @ mesh.points[cell[2][0]]
    height = eval(given.master_height, {}, dict(zip("xyz", x.T, strict=False)))
    np.testing.assert_allclose(x[:, given.dim - 1], height, atol=1e-14)
    assert cells_a_side(row, 3) == 8 * cells_a_side(row, 0)


def inner(mesh, group):
    """Nodes of a skin of a stack that are not on its rim."""
    x, up = np.unique(skin(mesh, group), axis=0), mesh.space_dim - 1
    return x[((x[:, :up] > 1e-9) & (x[:, :up] < 1 - 1e-9)).all(axis=1)]


@pytest.mark.parametrize("skew", [0.0, 0.05, 0.2])
def test_stacks_do_not_match_and_are_distorted_as_the_peers(skew):
    """x and y of columns of nodes move by skew and -0.7 skew times 16 x (1 - x) y (1 - y), the upper the other way."""
    mesh = stacks.stack("HEXA8", "HEXA8", 3, counts=(5, 4), skew=skew)
    for group, n, way in (("slave", 5, 1), ("master", 4, -1)) if skew else ():
        line = np.linspace(0, 1, n + 1)[1:-1]
        x, y = (v.ravel() for v in np.meshgrid(line, line, indexing="ij"))
        bubble = way * skew * 16 * x * (1 - x) * y * (1 - y)
        wanted = np.stack([x + bubble, y - 0.7 * bubble, np.ones(len(x))], axis=1)
        apart = np.linalg.norm(inner(mesh, group)[:, None] - wanted, axis=2)
        assert apart.shape == (len(x),) * 2 and apart.min(axis=0).max() < 2e-12
    apart = np.linalg.norm(inner(mesh, "slave")[:, None] - inner(mesh, "master"), axis=2)
    assert apart.size and apart.min() > 1e-3


def test_the_cylinders_mesh_is_the_peers():
    """Counts of the mesh that others ran: 4 faces to the half-width; a coarser slave than master."""
    mesh = cylinder_on_block(4)
    assert mesh.cells_by_type == {"QUAD4": 1126, "SEG2": 140}
    counts = {name: len(cells) for name, cells in mesh.cell_groups.items()}
    assert counts == {"upper": 342, "lower": 784, "slave": 19, "master": 28, "top": 19, "bottom": 28, "x0": 46}
    a = Hertz.plane(FORCE).radius
    for name, part in (("slave", 4), ("master", 6)):
        assert np.unique(skin(mesh, name)[:, 0])[1] == pytest.approx(a / part)
    x, y, _ = skin(mesh, "slave").T
    np.testing.assert_allclose(np.hypot(x, y - RADIUS), RADIUS, rtol=1e-12)


@pytest.mark.parametrize(("cell", "rigid"), [("QUAD8", False), ("TRIA3", True), ("HEXA8", False), ("HEXA8", True)])
def test_lines_of_half_spaces_do_not_match(cell, rigid):
    mesh = half_spaces(cell, 4, 0.5, rigid=rigid)
    groups = {"upper", "slave", "master", "far_upper", "axis_x"} | (set() if rigid else {"lower", "far_lower"})
    lines = [np.unique(skin(mesh, name)[:, 0]) for name in ("slave", "master")]
    one, other = (x[(x > 0.1) & (x < REACH - 0.1)] for x in lines)
    assert groups <= set(mesh.cell_groups) and np.isclose(one[:, None], other[None]).any(axis=1).mean() < 0.5
