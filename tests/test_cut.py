"""The cut on whole meshes: the eight properties on random mixtures, and every case that code_aster gets wrong."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lacmesh import Cut, LacmeshWarning, Mesh, cut_skin, raise_order
from lacmesh.cells import CELLS
from lacmesh.errors import CutError, DataError, GroupNotFoundError, RequestError
from lacmesh.mesh import Model, Periodic
from lacmesh.reference.quadrature import measure
from tests import properties
from tests.meshes import affine, box, cell_with_faces, facets_of, random_mesh, rotate
from tests.samples import samples

VARIANTS = ("pyramid", "hexa", "auto")


@pytest.mark.fuzz
@settings(max_examples=samples(25, 60), deadline=None)
@given(
    seed=st.integers(0, 10**9),
    dim=st.sampled_from([2, 3]),
    order=st.sampled_from([1, 2, 3]),
    hexa=st.sampled_from(VARIANTS),
    interior=st.booleans(),
    twins=st.booleans(),
    slaves=st.integers(1, 8),
)
def test_random_meshes(seed, dim, order, hexa, interior, twins, slaves):
    rng = np.random.default_rng(seed)
    mesh = random_mesh(rng, dim, order, slaves, interior, twins)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LacmeshWarning)
        cut = cut_skin(mesh, "slave", hexa=hexa)
    properties.all_hold(mesh, cut)
    np.testing.assert_allclose(cut.mesh.node_data["heat"], cut.mesh.points @ [1.0, 2.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(cut.mesh.node_data["where"], cut.mesh.points, atol=1e-12)
    assert len(cut.mesh.node_groups["every"]) == cut.mesh.n_nodes


@pytest.mark.fuzz
@settings(max_examples=samples(10, 25), deadline=None)
@given(seed=st.integers(0, 10**9), order=st.sampled_from([1, 2]), hexa=st.sampled_from(VARIANTS))
def test_order_does_not_matter(seed, order, hexa):
    """Permuting slave faces, cells or groups gives the same mesh up to numbering."""
    rng = np.random.default_rng(seed)
    mesh = random_mesh(rng, 3, order, slaves=6, interior=True)
    other = shuffled(rng, mesh)
    assert properties.canonical(cut_skin(other, "slave", hexa=hexa).mesh) == properties.canonical(
        cut_skin(mesh, "slave", hexa=hexa).mesh
    )


def shuffled(rng, mesh):
    """Copy of a mesh with its blocks, the cells in them and its groups in another order."""
    names = rng.permutation([b.type for b in mesh.blocks])
    blocks, source = [], []
    for name in names:
        k = [b.type for b in mesh.blocks].index(name)
        rows = rng.permutation(len(mesh.blocks[k].nodes))
        blocks.append((str(name), mesh.blocks[k].nodes[rows]))
        source.append(mesh.offsets[k] + rows)
    source = np.concatenate(source)
    place = np.argsort(source)
    groups = {n: place[g] for n, g in reversed(list(mesh.cell_groups.items()))}
    return Mesh.create(mesh.points, blocks, space_dim=mesh.space_dim, cell_groups=groups)


def two_hexas(inward=False, order="1"):
    """Two HEXA8 one beside the other; their common face is the slave."""
    points, hexas = box(2)
    points, hexas = affine(points), hexas[[0, 4]]
    (common,) = [o for o in facets_of(Mesh.create(points, [("HEXA8", hexas)])).values() if len(o) == 2]
    face = rotate(common[0][3], "QUAD4", 1, inward)
    used = np.unique(hexas)
    new = np.full(len(points), -1)
    new[used] = np.arange(len(used))
    return Mesh.create(points[used], [("QUAD4", [new[face]]), ("HEXA8", new[hexas])], cell_groups={"slave": [0]})


# ---- what code_aster gets wrong, and we get right


@pytest.mark.parametrize("hexa", VARIANTS)
def test_face_between_two_volumes_is_cut_on_both_sides(hexa):
    mesh = two_hexas()
    cut = cut_skin(mesh, "slave", hexa=hexa)
    properties.all_hold(mesh, cut)
    assert set(cut.parent_of_cell.tolist()) == {1, 2, 3}  # the face and both cells
    with pytest.raises(CutError, match="between two cells"):
        cut_skin(mesh, "slave", interface="refuse")


@pytest.mark.parametrize("name", ["HEXA8", "TETRA4", "HEXA20", "TETRA10"])
@pytest.mark.parametrize("hexa", ["pyramid", "hexa"])
def test_inward_skin_does_not_invert_children(name, hexa):
    for j in range(len(CELLS[name].facets)):
        mesh = cell_with_faces(name, (j,), inward=True)
        cut = cut_skin(mesh, "slave", hexa=hexa)
        assert (properties.volumes(cut.mesh) > 0).all()
        properties.skin_is_in_order(mesh, cut)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_mixed_orientation_is_turned_outward(dim, order):
    rng = np.random.default_rng(order)
    mesh = random_mesh(rng, dim, order, slaves=10)
    cut = cut_skin(mesh, "slave", orient="outward")
    outward = {frozenset(n.tolist()): (t, n) for o in facets_of(cut.mesh).values() if len(o) == 1 for _, _, t, n in o}
    turned = 0
    for face in np.flatnonzero(cut.macro_of_face >= 0):
        _, _, nodes = next(cut.mesh.select(np.array([face])))
        kind, there = outward[frozenset(nodes[0].tolist())]
        n = CELLS[kind].n_corners
        corners, ring = nodes[0][:n].tolist(), there[:n].tolist()
        start = ring.index(corners[0])
        assert corners == ring[start:] + ring[:start]
        turned += 1
    assert turned >= 10
    kept = cut_skin(mesh, "slave")
    assert properties.canonical(kept.mesh) == properties.canonical(cut.mesh)


def test_a_face_between_two_cells_has_no_outward_and_stays():
    for inward in (False, True):
        mesh = two_hexas(inward)
        kept, turned = cut_skin(mesh, "slave").mesh, cut_skin(mesh, "slave", orient="outward").mesh
        np.testing.assert_array_equal(kept.block("TRIA3"), turned.block("TRIA3"))


def prism_beside_hexa():
    """A HEXA8, a PENTA6 on its side; the slave is their common face and another face of the hexahedron."""
    points = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1), (2, 0.5))], float)
    hexa, prism = [0, 1, 2, 3, 5, 6, 7, 8], [1, 4, 2, 6, 9, 7]
    faces = [[1, 2, 7, 6], [0, 5, 8, 3]]
    return Mesh.create(
        affine(points),
        [("HEXA8", [hexa]), ("PENTA6", [prism]), ("QUAD4", faces)],
        cell_groups={"both": [2], "far": [3], "slave": [2, 3]},
    )


@pytest.mark.parametrize("hexa", VARIANTS)
def test_neighbour_that_forces_the_cone_spreads_to_the_whole_parent(hexa):
    mesh = prism_beside_hexa()
    cut = cut_skin(mesh, "slave", hexa=hexa)
    properties.all_hold(mesh, cut)
    assert "HEXA8" not in cut.mesh.cells_by_type and "QUAD4" not in cut.mesh.cells_by_type
    alone = cut_skin(mesh, "far", hexa="hexa")  # the prism's face is no slave: nothing forces the cone
    assert alone.mesh.cells_by_type["HEXA8"] == 6


def test_the_cone_spreads_to_a_fixed_point_along_shared_slave_faces():
    """A row of hexahedra with slave faces between them, a prism at its end: one forced cone turns them all."""
    points = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in range(5)] + [[4.7, 0.5, 0], [4.7, 0.5, 1]])
    low = lambda x, y: x + 5 * y  # noqa: E731
    hexas = [[low(x, 0), low(x + 1, 0), low(x + 1, 1), low(x, 1)] for x in range(4)]
    hexas = [[*h, *(n + 10 for n in h)] for h in hexas]
    prism = [4, 20, 9, 14, 21, 19]
    between = [[x, x + 5, x + 15, x + 10] for x in range(1, 5)]
    mesh = Mesh.create(
        affine(points),
        [("HEXA8", hexas), ("PENTA6", [prism]), ("QUAD4", between)],
        cell_groups={"slave": range(5, 9), "chain": range(5, 8)},
    )
    for hexa in VARIANTS:
        cut = cut_skin(mesh, "slave", hexa=hexa)
        properties.all_hold(mesh, cut)
        assert "HEXA8" not in cut.mesh.cells_by_type
    free = cut_skin(mesh, "chain", hexa="hexa")
    properties.all_hold(mesh, free)
    assert "PYRAM5" not in free.mesh.cells_by_type


def test_quadrangle_beside_triangle_in_2d_takes_the_cone():
    mesh = Mesh.create(
        [[0, 0], [1, 0], [1, 1], [0, 1], [1.8, 0.4]],
        [("QUAD4", [[0, 1, 2, 3]]), ("TRIA3", [[1, 4, 2]]), ("SEG2", [[1, 2]])],
        cell_groups={"slave": [2]},
    )
    cut = cut_skin(mesh, "slave")
    properties.all_hold(mesh, cut)
    assert cut.mesh.cells_by_type == {"TRIA3": 5, "SEG2": 2}  # 3 for the quadrangle, 2 for the triangle


@pytest.mark.parametrize("listed", [True, False])
def test_duplicate_skin_cells_are_cut_too(listed):
    """A second skin cell on the same nodes, in the slave group or in another, of a lower number than the volume."""
    points, hexas = box(1)
    face = facets_of(Mesh.create(points, [("HEXA8", hexas)]))[4, 5, 6, 7][0][3]
    mesh = Mesh.create(
        points,
        [("QUAD4", [face, rotate(face, "QUAD4", 2, True)]), ("HEXA8", hexas)],
        cell_groups={"slave": [0, 1] if listed else [1], "other": [0]},
    )
    if listed:
        with pytest.warns(LacmeshWarning, match="stand twice"):
            cut = cut_skin(mesh, "slave")
    else:
        cut = cut_skin(mesh, "slave")
    properties.is_conforming(mesh, cut)
    assert cut.n_macros == 1 and cut.mesh.cells_by_type == {"TRIA3": 8, "PYRAM5": 5}
    assert len(cut.mesh.cell_groups["other"]) == 4
    a, b = cut.mesh.cell_groups["other"], cut.faces_of_macro[0]
    assert not set(a) & set(b) if not listed else True
    key = lambda cells: {frozenset(n.tolist()) for _, _, rows in cut.mesh.select(cells) for n in rows}  # noqa: E731
    assert key(a) == key(b)


def test_face_in_two_listed_groups_belongs_to_the_first_zone():
    points, hexas = box(2)
    table = facets_of(Mesh.create(points, [("HEXA8", hexas)]))
    top = [o[0][3] for k, o in table.items() if all(points[n, 2] == 1 for n in k)]
    mesh = Mesh.create(
        points, [("HEXA8", hexas), ("QUAD4", top)], cell_groups={"a": [8, 9, 10], "b": [10, 11], "unused": [0]}
    )
    cut = cut_skin(mesh, ["b", "a"])
    properties.all_hold(mesh, cut)
    assert cut.n_macros == 4 and cut.zones == ("b", "a")
    for group, zone in (("b", {0}), ("a", {0, 1})):
        assert set(cut.zone_of_face[cut.mesh.cell_groups[group]].tolist()) == zone


@pytest.mark.parametrize("name", ["QUAD9", "PENTA18", "TRIA7", "PYRAM14", "HEXA27"])
def test_types_that_code_aster_lacks(name):
    for j in range(len(CELLS[name].facets)):
        mesh = cell_with_faces(name, (j,))
        cut = cut_skin(mesh, "slave")
        properties.all_hold(mesh, cut)


def test_penta18_cut_by_a_triangle_gives_pyram14():
    cut = cut_skin(cell_with_faces("PENTA18", (0,)), "slave")
    assert cut.mesh.cells_by_type == {"TRIA6": 3, "PYRAM14": 3, "TETRA10": 1}


def test_face_without_a_parent_is_an_error_that_names_it():
    mesh = Mesh.create(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [5, 5, 5], [6, 5, 5], [5, 6, 5]],
        [("TETRA4", [[0, 1, 2, 3]]), ("TRIA3", [[0, 2, 1], [4, 5, 6]])],
        cell_number=[10, 20, 77],
        cell_groups={"slave": [1, 2]},
    )
    with pytest.raises(CutError, match="77 have no parent cell") as caught:
        cut_skin(mesh, "slave")
    assert caught.value.cells == (77,)


@pytest.mark.parametrize("group", ["volume", "edge", "mixed"])
def test_group_of_the_wrong_dimension_is_an_error_that_names_its_cells(group):
    mesh = Mesh.create(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [("TETRA4", [[0, 1, 2, 3]]), ("TRIA3", [[0, 2, 1]]), ("SEG2", [[0, 1]])],
        cell_number=[7, 8, 9],
        cell_groups={"volume": [0], "edge": [2], "mixed": [0, 1]},
    )
    with pytest.raises(CutError, match="dimension"):
        cut_skin(mesh, group)


def test_lower_cells_in_a_slave_group_are_left_with_a_warning():
    mesh = Mesh.create(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [("TETRA4", [[0, 1, 2, 3]]), ("TRIA3", [[0, 2, 1]]), ("SEG2", [[0, 1]])],
        cell_groups={"slave": [1, 2]},
    )
    with pytest.warns(LacmeshWarning, match="lower dimension"):
        assert cut_skin(mesh, "slave").mesh.cells_by_type == {"TETRA4": 3, "TRIA3": 3, "SEG2": 1}


def test_a_linear_face_on_a_quadratic_cell_is_an_error():
    mesh = cell_with_faces("TETRA10", (0,))
    linear = Mesh.create(
        mesh.points,
        [("TETRA10", mesh.block("TETRA10")), ("TRIA3", mesh.block("TRIA6")[:, :3])],
        cell_groups={"slave": [1]},
    )
    with pytest.raises(CutError, match="mid-nodes"):
        cut_skin(linear, "slave")


@pytest.mark.parametrize("hexa", VARIANTS)
@pytest.mark.parametrize("order", [1, 2, 3])
def test_skin_only_cuts_a_shell(hexa, order):
    rng = np.random.default_rng(3)
    plane = random_mesh(rng, 2, 1, orphans=False)
    x = plane.points[:, 0]
    shell = Mesh.create(
        np.column_stack([plane.points[:, :2], np.sin(x)]),
        [b for b in plane.blocks if b.type != "SEG2"],
        cell_groups={"slave": np.arange(sum(len(b.nodes) for b in plane.blocks if b.type != "SEG2"))},
    )
    mesh = raise_order(shell, "2" if order == 2 else "2-full") if order > 1 else shell
    cut = cut_skin(mesh, "slave", hexa=hexa, skin_only=True)
    properties.skin_is_in_order(mesh, cut)
    properties.owns_internal_dofs(mesh, cut)
    properties.groups_follow(mesh, cut)
    assert cut.n_macros == mesh.n_cells
    with pytest.raises(CutError, match=r"has no volumes, only cells of type [A-Z0-9, ]+; .*--skin-only"):
        cut_skin(mesh, "slave")


def test_skin_only_refuses_faces_with_cells_behind():
    with pytest.raises(CutError, match="have cells behind them"):
        cut_skin(cell_with_faces("TETRA4"), "slave", skin_only=True)


# ---- what else a user meets


def test_a_cut_mesh_is_not_cut_again():
    mesh = cell_with_faces("HEXA8", (0, 5))
    mesh = replace(mesh, cell_groups={**mesh.cell_groups, "one": np.array([1]), "other": np.array([2])})
    cut = cut_skin(mesh, "slave")
    assert cut_skin(cut.mesh, "slave").mesh is cut.mesh
    assert cut_skin(cut.mesh, "one").mesh is cut.mesh
    half = cut_skin(mesh, "one")
    with pytest.raises(CutError, match="cut already"):
        cut_skin(half.mesh, "slave")


def test_wrong_requests_name_what_is_near():
    mesh = cell_with_faces("HEXA8")
    with pytest.raises(GroupNotFoundError, match="did you mean slave"):
        cut_skin(mesh, "Slav")
    with pytest.raises(RequestError, match="twice"):
        cut_skin(mesh, ["slave", "slave"])
    for options in ({"hexa": "tetra"}, {"ring": 1.0}, {"depth": 0}, {"interface": "x"}, {"orient": "x"}):
        with pytest.raises(RequestError):
            cut_skin(mesh, "slave", **options)
    with pytest.raises(RequestError):
        cut_skin(mesh, [])
    empty = replace(mesh, cell_groups={"slave": np.empty(0, int)})
    with pytest.raises(CutError, match="empty"):
        cut_skin(empty, "slave")


def test_a_cut_is_a_view_of_a_cut_mesh_only():
    with pytest.raises(CutError, match="no cut"):
        Cut(cell_with_faces("HEXA8"))


@pytest.mark.parametrize("name", ["HEXA8", "HEXA20", "QUAD4"])
def test_ring_and_depth_are_adjustable(name):
    mesh = cell_with_faces(name)
    areas = {}
    for ring in (0.2, 1 / 3, 0.6):
        for depth in (0.25, 0.5, 0.75):
            cut = cut_skin(mesh, "slave", hexa="hexa", ring=ring, depth=depth)
            properties.all_hold(mesh, cut)
            faces = cut.faces_of_macro[0]
            ((kind, _, nodes),) = cut.mesh.select(faces)
            areas[ring] = measure(kind, cut.mesh.points[nodes])
    centre = -1 if name != "QUAD4" else 1
    dim = CELLS[name].dim - 1
    for ring, area in areas.items():
        np.testing.assert_allclose(area[centre] / area.sum(), ring**dim, rtol=1e-12)


def test_auto_takes_the_variant_whose_worst_child_is_better():
    from lacmesh.quality import worst

    points, hexas = box(1)
    for scale in (0.05, 1.0, 20.0):
        top = facets_of(Mesh.create(points, [("HEXA8", hexas)]))[1, 3, 5, 7][0][3]
        mesh = Mesh.create(points * [1, 1, scale], [("HEXA8", hexas), ("QUAD4", [top])], cell_groups={"slave": [1]})
        both = {v: cut_skin(mesh, "slave", hexa=v) for v in VARIANTS}
        least = {v: worst(c.mesh, np.arange(c.mesh.n_cells)) for v, c in both.items()}
        assert least["auto"] == max(least["pyramid"], least["hexa"])
        assert least["pyramid"] != least["hexa"]


def test_node_groups_are_extended_or_left():
    mesh = cell_with_faces("HEXA8")
    face = mesh.block("QUAD4")[0]
    mesh = replace(mesh, node_groups={"face": np.sort(face), "three": np.sort(face[:3]), "all": np.arange(8)})
    grown, kept = (
        cut_skin(mesh, "slave", hexa="hexa").mesh,
        cut_skin(mesh, "slave", hexa="hexa", node_groups="keep").mesh,
    )
    assert [len(grown.node_groups[n]) for n in mesh.node_groups] == [8, 3, 16]
    assert [len(kept.node_groups[n]) for n in mesh.node_groups] == [4, 3, 8]


def test_integer_node_data_is_never_interpolated():
    mesh = cell_with_faces("HEXA8")
    face = mesh.block("QUAD4")[0]
    same = np.ones(8, int)
    mixed = np.arange(8)
    on_face = np.zeros(8, int)
    on_face[face] = 5
    mesh = replace(mesh, node_data={"same": same, "mixed": mixed, "on_face": on_face})
    data = cut_skin(mesh, "slave", hexa="hexa").mesh.node_data
    assert data["same"][8:].tolist() == [1] * 8
    assert data["mixed"][8:].tolist() == [-1] * 8
    assert sorted(data["on_face"][8:].tolist()) == [-1] * 4 + [5] * 4


def test_entities_of_new_nodes_are_those_of_what_they_lie_on():
    mesh = cell_with_faces("HEXA20")
    mesh = replace(
        mesh,
        cell_data={"entity": np.array([[3, 1], [2, 9]], np.int32)},
        node_data={"entity": np.tile(np.array([0, 4], np.int32), (20, 1))},
    )
    after = cut_skin(mesh, "slave").mesh
    new = after.node_data["entity"][20:].tolist()
    assert new.count([2, 9]) == 5 and new.count([3, 1]) == 4
    assert {tuple(e) for e in after.cell_data["entity"]} == {(3, 1), (2, 9)}


def test_the_input_is_not_touched():
    mesh = random_mesh(np.random.default_rng(0), 3, 1)
    copies = (
        [b.nodes.copy() for b in mesh.blocks],
        mesh.points.copy(),
        {k: g.copy() for k, g in mesh.cell_groups.items()},
    )
    cut_skin(mesh, "slave", orient="outward", hexa="auto")
    for block, nodes in zip(mesh.blocks, copies[0], strict=True):
        np.testing.assert_array_equal(block.nodes, nodes)
    np.testing.assert_array_equal(mesh.points, copies[1])
    for name, members in copies[2].items():
        np.testing.assert_array_equal(mesh.cell_groups[name], members)


def test_a_cut_with_twins_is_not_cut_again():
    points, hexas = box(1)
    face = facets_of(Mesh.create(points, [("HEXA8", hexas)]))[4, 5, 6, 7][0][3]
    mesh = Mesh.create(points, [("QUAD4", [face, face]), ("HEXA8", hexas)], cell_groups={"slave": [0, 1], "twin": [1]})
    with pytest.warns(LacmeshWarning, match="stand twice"):
        cut = cut_skin(mesh, "slave")
    assert cut_skin(cut.mesh, "slave").mesh is cut.mesh
    assert cut_skin(cut.mesh, "twin").mesh is cut.mesh


def test_node_inside_enters_a_group_of_all_corners_of_the_cell_it_was_cut_from():
    """Also where the cell is cut again: the corners that count are the mesh's, not a child's."""
    mesh = cell_with_faces("HEXA20", (0, 1))
    for left_out in range(8):
        some = np.setdiff1d(np.arange(20), [left_out])
        grown = cut_skin(replace(mesh, node_groups={"some": some}), "slave").mesh
        on_faces = sum(left_out not in CELLS["HEXA20"].facets[j].nodes[:4] for j in (0, 1))
        assert len(grown.node_groups["some"]) == 19 + 5 * on_faces


@pytest.mark.parametrize("name", ["TETRA4", "TRIA3", "HEXA20", "QUAD8"])
def test_outward_is_outward_also_from_a_cell_that_turns_the_wrong_way(name):
    for inward in (False, True):
        mesh = cell_with_faces(name, tuple(range(len(CELLS[name].facets))), inward=inward)
        mirror = [1, 1, -1] if CELLS[name].dim == 3 else [1, -1, 1]
        mesh = replace(mesh, points=mesh.points * mirror)
        cut = cut_skin(mesh, "slave", orient="outward")
        centre = mesh.points.mean(axis=0)
        for face in np.flatnonzero(cut.macro_of_face >= 0):
            _, _, nodes = next(cut.mesh.select(np.array([face])))
            x = cut.mesh.points[nodes[0]]
            normal = np.cross(x[1] - x[0], x[2] - x[0] if CELLS[name].dim == 3 else [0, 0, 1])
            assert normal @ (x.mean(axis=0) - centre) > 0


def in_file(mesh, cells):
    """Some cells in the order of the file: (type, number, nodes) each."""
    order = np.arange(mesh.n_cells) if mesh.file_order is None else mesh.file_order
    found = {}
    for kind, ids, nodes in mesh.select(np.asarray(cells)):
        found |= {int(i): (kind, int(mesh.cell_number[i]), row.tolist()) for i, row in zip(ids, nodes, strict=True)}
    return [found[int(c)] for c in order if int(c) in found]


def test_a_child_that_is_cut_again_is_replaced_where_it_stood():
    """The order is that of code_aster's sequence of cuts: in a hexahedron's five pyramids, the one that owns the second
    face becomes four tetrahedra in its place."""
    for second in range(1, 6):
        once = cut_skin(cell_with_faces("HEXA8", (0,)), "slave")
        twice = cut_skin(cell_with_faces("HEXA8", (0, second)), "slave")
        base = set(CELLS["HEXA8"].facets[second].nodes)
        pyramids = in_file(once.mesh, np.flatnonzero(once.parent_of_cell == 1))
        (place,) = [k for k, (_, _, nodes) in enumerate(pyramids) if set(nodes[:4]) == base]
        types = [kind for kind, _, _ in in_file(twice.mesh, np.flatnonzero(twice.parent_of_cell == 1))]
        assert types == ["PYRAM5"] * place + ["TETRA4"] * 4 + ["PYRAM5"] * (4 - place)


def test_new_numbers_grow_along_the_file():
    for seed in range(5):
        mesh = random_mesh(np.random.default_rng(seed), 3, slaves=6)
        after = cut_skin(mesh, "slave").mesh
        numbers = after.cell_number if after.file_order is None else after.cell_number[after.file_order]
        new = numbers[numbers > mesh.cell_number.max()]
        assert len(new) and (np.diff(new) == 1).all()


def test_a_face_with_other_mid_nodes_than_its_cell_is_an_error():
    mesh = cell_with_faces("TETRA10", (0,))
    face = mesh.block("TRIA6").copy()
    face[0, 3] = mesh.n_nodes
    points = np.vstack([mesh.points, mesh.points[mesh.block("TRIA6")[0, 3]]])
    torn = Mesh.create(points, [("TETRA10", mesh.block("TETRA10")), ("TRIA6", face)], cell_groups={"slave": [1]})
    with pytest.raises(CutError, match="mid-nodes"):
        cut_skin(torn, "slave")


@pytest.mark.parametrize("skin_only", [True, False])
@pytest.mark.parametrize("kind", ["TRIA10", "TETRA20", "SEG4"])
def test_cells_of_higher_order_on_a_slave_face_are_refused(kind, skin_only):
    """They are never cut, so cutting what lies on them would tear the mesh."""
    n = int(kind.lstrip("SEGTRIA"))
    points = np.random.default_rng(0).random((n, 3))
    face = ("TRIA3", [[0, 1, 2]]) if kind == "TETRA20" else ("SEG2", [[0, 1]])
    blocks = [(kind, [range(n)]), face, *([("TRIA3", [[0, 1, 2]])] if kind == "SEG4" else [])]
    mesh = Mesh.create(points, blocks, cell_number=[70, 5, 6][: len(blocks)], cell_groups={"slave": [1]})
    with pytest.raises(CutError, match=f"the {kind} 70 has a slave face") as caught:
        cut_skin(mesh, "slave", skin_only=skin_only)
    assert caught.value.cells == (70,)


def test_cells_of_higher_order_elsewhere_are_carried_through():
    mesh = cell_with_faces("TETRA4", (0,))
    points = np.vstack([mesh.points, np.random.default_rng(0).random((20, 3)) + 9])
    blocks = [*((b.type, b.nodes) for b in mesh.blocks), ("TETRA20", [np.arange(4, 24)])]
    cut = cut_skin(Mesh.create(points, blocks, cell_groups={"slave": [1], "far": [2]}), "slave")
    assert cut.mesh.cells_by_type["TETRA20"] == 1 and cut.mesh.cells_by_type["TETRA4"] == 3


def test_a_mesh_of_lines_has_no_skin():
    line = Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]]), ("POI1", [[0]])], cell_groups={"slave": [1]})
    with pytest.raises(CutError, match="no skin"):
        cut_skin(line, "slave")


def test_records_that_are_not_a_cuts_are_refused():
    mesh = cell_with_faces("HEXA8")
    odd = replace(mesh, cell_data={"lac_macro": np.array([0, -1])})
    for call in (lambda: Cut(odd), lambda: cut_skin(odd, "slave")):
        with pytest.raises(CutError, match="not those of a cut"):
            call()


@pytest.mark.parametrize(
    ("dtype", "becomes"),
    [("u1", "i2"), ("u4", "i8"), ("u8", "i8"), ("?", "i1"), ("i2", "i2"), ("c16", "c16"), ("f4", "f4")],
)
def test_node_data_of_every_kind_of_number(dtype, becomes):
    mesh = cell_with_faces("HEXA8")
    values = np.arange(8).astype(dtype)
    data = cut_skin(replace(mesh, node_data={"v": values}), "slave").mesh.node_data["v"]
    assert data.dtype == np.dtype(becomes)
    np.testing.assert_array_equal(data[:8], values.astype(becomes))
    face = mesh.block("QUAD4")[0]
    expected = values[face].mean() if np.dtype(dtype).kind in "fc" else -1
    if dtype != "?":
        assert data[8] == pytest.approx(expected)


def test_node_data_that_are_no_numbers_are_refused():
    mesh = replace(cell_with_faces("HEXA8"), node_data={"label": np.array(list("abcdefgh"))})
    with pytest.raises(DataError, match="only numbers"):
        cut_skin(mesh, "slave")


def test_numbers_that_do_not_tell_cells_apart_are_refused():
    mesh = cell_with_faces("HEXA8")
    for numbers in ([3, 3], [-1, 2]):
        with pytest.raises(CutError, match="not distinct"):
            cut_skin(replace(mesh, cell_number=np.array(numbers)), "slave")
    with pytest.raises(ValueError, match="integers"):
        Mesh.create(mesh.points, mesh.blocks, cell_number=[1.0, 2.0])


def test_a_tag_may_be_a_number_and_a_zone_without_faces_is_said():
    mesh = cell_with_faces("HEXA8")
    mesh = replace(mesh, group_tags={"slave": ((2, 5),)}, cell_data={"entity": np.array([[3, 1], [2, 7]], np.int32)})
    assert cut_skin(mesh, 5).zones == ("slave",)
    assert cut_skin(mesh, "entity:2:07").zones == ("entity:2:7",)
    with pytest.raises(RequestError, match="twice"):
        cut_skin(mesh, ["entity:2:7", "entity:2:07"])
    with pytest.warns(LacmeshWarning, match="in an earlier slave group"):
        assert cut_skin(mesh, ["slave", "entity:2:7"]).n_macros == 1


def test_periodic_faces_are_warned_of():
    mesh = cell_with_faces("HEXA8")
    link = Periodic((2, 7), (2, 8), (), np.empty((0, 2), int))
    mesh = replace(mesh, cell_data={"entity": np.array([[3, 1], [2, 7]], np.int32)}, model=Model(periodic=(link,)))
    with pytest.warns(LacmeshWarning, match="periodic entities .2:7."):
        cut_skin(mesh, "slave")
    with pytest.warns(LacmeshWarning, match="periodic links"):
        raise_order(mesh)
