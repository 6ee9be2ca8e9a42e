"""A cut whose records are gone is recognised on request, and without the request a mesh without records is uncut."""

import json
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
from lacmesh import Cut, LacmeshWarning, Mesh, cut_skin
from lacmesh.cutting.recognition import find_macros, recognise
from lacmesh.cutting.records import without_records
from lacmesh.cutting.select import slave_skin
from lacmesh.errors import CutError, GroupNotFoundError, RequestError
from tests.checks.blocks import SOLIDS, cut_blocks, two_blocks
from tests.meshes import cell_with_faces, lenient, random_mesh, renumbered
from tests.samples import samples
from tests.test_cut_cells import BODIES, CUTS, after_aster, cuts


def facts(cut):
    """The file's numbers of the faces of the macro-elements, E1 first, and of their internal nodes; zones of faces."""
    number, nodes = cut.mesh.cell_number, cut.mesh.node_number
    faces = {tuple(number[of].tolist()) for of in cut.faces_of_macro}
    internal = sorted(sorted(nodes[of].tolist()) for of in cut.internal_nodes)
    return faces, internal, {int(number[f]): cut.zones[z] for f, z in enumerate(cut.zone_of_face) if z >= 0}


def same(cut, found):
    assert found is not None
    assert facts(found) == facts(cut)


# ---- what we cut


@pytest.mark.parametrize("name", BODIES)
def test_cells_by_every_facet_turn_variant_and_set_of_facets(name):
    for _, cut in cuts(name):
        same(cut, recognise(without_records(cut.mesh), "slave"))


@pytest.mark.rows("4-3-1", "5-2-2")
@pytest.mark.fuzz
@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("seed", range(samples(6, 12)))  # six: with interior faces and twins, or without
def test_random_meshes(seed, dim, order):
    """Mixtures with faces between cells, duplicates, both orientations, any numbering; and uncut ones find nothing."""
    rng = np.random.default_rng([seed, dim, order])
    with lenient():  # of duplicates
        mesh = random_mesh(rng, dim, order, slaves=8 if dim == 2 else 6, interior=bool(seed % 2), twins=seed % 3 == 0)
        assert find_macros(mesh, slave_skin(mesh, ["slave"])).n_cut == 0
        for hexa in ("pyramid", "hexa"):
            cut = cut_skin(mesh, "slave", hexa=hexa)
            same(cut, recognise(without_records(cut.mesh), "slave"))


@pytest.mark.parametrize("name", ["QUAD4", "HEXA8", "HEXA20"])
@pytest.mark.parametrize("ring", [0.2, 0.5])
def test_another_ring(name, ring):
    """A cut of ours can have one, code_aster's cannot."""
    cut = cut_skin(two_blocks(name), "slave", hexa="hexa", ring=ring, depth=0.3)
    mesh = without_records(cut.mesh)
    same(cut, recognise(mesh, "slave"))
    same(cut, cut_skin(mesh, "slave", recognise=True))


@pytest.mark.parametrize("hexa", ["pyramid", "hexa"])
@pytest.mark.parametrize(
    "blocks",
    [
        [("TRIA3", [[0, 1, 2], [1, 3, 2]])],
        [("QUAD4", [[0, 1, 3, 2], [1, 4, 5, 3]])],
        [("SEG2", [[0, 1], [1, 4]]), ("TRIA3", [[2, 3, 5]])],
    ],
)
def test_a_skin_without_cells_behind(blocks, hexa):
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0.2], [1, 1, 0.0], [2, 0, 0], [2, 1, 0]]
    points = np.array(points) * [1, 1, len(blocks) == 1]  # in the plane with a cell elsewhere
    mesh = Mesh.create(points, blocks, cell_groups={"s": [0, 1]}, space_dim=3 - (len(blocks) > 1))
    cut = cut_skin(mesh, "s", skin_only=True, hexa=hexa)
    same(cut, recognise(without_records(cut.mesh), "s"))


def test_zones_keep_their_order():
    mesh = two_blocks("HEXA8")
    cut = cut_skin(mesh, ["slave", "loaded"])
    assert recognise(cut.mesh, ["slave", "loaded"]).mesh is cut.mesh, "records that are there are taken"
    found = recognise(without_records(cut.mesh), ["slave", "loaded"])
    same(cut, found)
    assert found.zones == ("slave", "loaded")
    np.testing.assert_array_equal(found.macro_of_face, cut.macro_of_face)
    np.testing.assert_array_equal(found.child_kind, cut.child_kind)
    np.testing.assert_array_equal(found.macro_of_node, cut.macro_of_node)
    assert (found.parent_of_cell == -1).all(), "what was replaced is not in the mesh any more"


def test_numbers_and_places_of_another_program():
    """Other numbers, another order of cells, coordinates with seven digits."""
    rng = np.random.default_rng(3)
    names = ("HEXA8", "pyramid"), ("HEXA8", "hexa"), ("TETRA10", "pyramid"), ("PENTA6", "pyramid"), ("QUAD4", "hexa")
    for name, hexa in (*names, ("TRIA3", "pyramid")):
        cut = cut_skin(two_blocks(name), "slave", hexa=hexa)
        mesh, new = renumbered(without_records(cut.mesh), rng)
        mesh = replace(mesh, points=mesh.points.astype(np.float32).astype(float))
        assert cut_skin(mesh, "slave").n_macros > cut.n_macros, "nobody requested recognition"
        found = recognise(mesh, "slave")
        wanted = {frozenset(new[faces].tolist()) for faces in cut.faces_of_macro}
        assert {frozenset(faces.tolist()) for faces in found.faces_of_macro} == wanted


# ---- what code_aster cuts


#: QUAD9_face1 is there to show that code_aster stops on it: it has no cut to recognise
ASTER_CUTS = sorted(path for path in CUTS.glob("*_face*.json") if path.stem != "QUAD9_face1")


@pytest.mark.parametrize("path", ASTER_CUTS, ids=lambda p: p.stem)
def test_code_aster_cut(path):
    data = json.loads(path.read_text())
    assert facts(recognise(after_aster(data), "ESCL"))[0] == {tuple(data["after"]["groups"]["ESCL"])}


# ---- what is not cut


@pytest.mark.parametrize("name", SOLIDS)
def test_uncut_blocks(name):
    mesh = two_blocks(name)
    assert find_macros(mesh, slave_skin(mesh, ["slave"])).n_cut == 0
    whole = name in ("TRIA6", "TRIA7", "QUAD8", "QUAD9", "HEXA27", "PYRAM14")  # their faces own an internal dof
    assert (recognise(mesh, "slave") is not None) == whole


def fan(*triangles):
    """Triangles around the middle of an edge of the boundary, which is the last node."""
    points = [[0, 0], [2, 0], [2, 2], [0, 2], [1, 0]]
    blocks = [("TRIA3", triangles), ("SEG2", [[0, 4], [4, 1]])]
    return Mesh.create(points, blocks, cell_groups={"slave": len(triangles) + np.arange(2)})


@pytest.mark.parametrize(
    ("mesh", "macros"),
    [
        (fan([0, 4, 3], [4, 2, 3], [4, 1, 2]), 2),  # a cut makes three only at an interface
        # on a line with an even spacing every pair and every triple stands as a cut would put them
        *((two_blocks(kind, n=n), n) for kind in ("TRIA3", "QUAD4") for n in (2, 3, 4, 6)),
    ],
)
def test_what_a_mesher_makes_is_no_cut(mesh, macros):
    assert recognise(mesh, "slave") is None
    assert cut_skin(mesh, "slave").n_macros == macros


def test_a_tetrahedron_at_the_centre_of_a_triangle_but_not_quite():
    """Three triangles around a node are a cut only where the node is at their centre."""
    cut = cut_skin(cell_with_faces("TETRA4"), "slave")
    points = cut.mesh.points.copy()
    points[-1] += 1e-3 * (points[0] - points[-1])
    assert recognise(replace(without_records(cut.mesh), points=points), "slave") is None


def o_grid(half):
    """A hexahedron of height 1 divided around a square of some half-width, with its top for a slave skin."""
    ring = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)
    points = np.concatenate([np.column_stack([s * ring, np.full(4, z)]) for z in (0, 1) for s in (1.0, half)])
    k = np.arange(4)
    faces = np.vstack([np.column_stack([k, np.roll(k, -1), np.roll(k, -1) + 4, k + 4]), k + 4])
    blocks = [("HEXA8", np.hstack([faces, faces + 8])), ("QUAD4", faces + 8)]
    return Mesh.create(points, blocks, cell_groups={"slave": 5 + np.arange(5)})


#: a square that a mesher has divided at its middle, in a mesh that was never cut
DIVIDED = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
MIDDLE = Mesh.create(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0], [0.5, 0.5, 1]],
    [("TRIA3", DIVIDED), ("TETRA4", [[*face, 5] for face in DIVIDED])],
    cell_groups={"slave": range(4)},
)


@pytest.mark.parametrize(
    ("mesh", "faces", "macros"),
    [
        (without_records(cut_skin(two_blocks("TETRA4"), "slave").mesh), 24, 8),
        (without_records(cut_skin(two_blocks("HEXA8"), "slave", hexa="hexa").mesh), 20, 4),
        (without_records(cut_skin(two_blocks("QUAD4"), "slave").mesh), 6, 2),
        (MIDDLE, 4, 1),
        (o_grid(0.5), 5, 1),
        (o_grid(1 / 3), 5, 1),
    ],
)
def test_faces_that_look_like_a_cut_are_cut_unless_recognition_is_requested(mesh, faces, macros):
    for option, count in ((None, faces), (False, faces), (True, macros)):  # the check takes them as the cut does
        assert cut_skin(mesh, "slave", recognise=option).n_macros == count
        found = lacmesh.check(mesh, "slave", recognise=option)
        assert found.summary["macro_elements"] == count
        assert ("recognised" in {f.rule for f in found}) == (option is True)


def test_an_o_grid_beside_more_faces_is_cut():
    """It was refused, as cut before."""
    grid = o_grid(0.5)
    points = np.vstack([grid.points, np.add(grid.points, [2, 0, 0])])
    more = [np.vstack([grid.block(kind), grid.block(kind) + 16]) for kind in ("HEXA8", "QUAD4")]
    mesh = Mesh.create(points, [("HEXA8", more[0]), ("QUAD4", more[1][:9])], cell_groups={"slave": 10 + np.arange(9)})
    assert cut_skin(mesh, "slave").n_macros == 9


@pytest.mark.parametrize("zone", ["slave", "loaded"])
@pytest.mark.parametrize("name", ["HEXA8", "TETRA4"])
def test_one_of_two_zones(name, zone):
    """The nodes of the other zone's cut come after those of this one's, or before, or among them."""
    cut = cut_skin(two_blocks(name), ["slave", "loaded"], hexa="hexa")
    twice = cut_skin(without_records(cut_skin(two_blocks(name), "slave", hexa="hexa").mesh), "loaded", hexa="hexa")
    for mesh in (cut.mesh, twice.mesh):
        macros = np.count_nonzero(cut.zone_of_face[[f[0] for f in cut.faces_of_macro]] == cut.zones.index(zone))
        assert recognise(without_records(mesh), zone).n_macros == macros


# ---- what is asked for


def test_a_cut_with_records_is_cut_again_on_request():
    cut = cut_skin(two_blocks("HEXA8"), "slave", hexa="hexa")
    with pytest.warns(LacmeshWarning, match=r"records \(of slave\) are replaced"):
        again = cut_skin(cut.mesh, "slave", hexa="hexa", recognise=False)
    assert again.n_macros == 20
    same(again, cut_skin(without_records(cut.mesh), "slave", hexa="hexa", recognise=False))
    for option, macros in ((None, 4), (True, 4), (False, 20)):
        found = lacmesh.check(cut.mesh, "slave", recognise=option)
        assert found.summary["macro_elements"] == macros
        assert ("not-cut" in {f.rule for f in found}) == (macros == 20)


def test_the_command_decides(run):
    cut = without_records(cut_blocks("HEXA8", "hexa"))
    for mesh, option, macros in ((o_grid(0.5), "--recut", 5), (o_grid(0.5), "--recognise", 1), (cut, "", 20)):
        lacmesh.write("o.vtu", mesh)
        assert "lacmesh: " not in run(f"cut o.vtu --slave slave -o a.vtu --force {option}")
        assert Cut(lacmesh.read("a.vtu")).n_macros == macros
    run("cut o.vtu --slave slave -o a.vtu --force --recut --recognise", 2)


def test_a_skin_that_is_cut_in_part_is_not_recognised():
    cut = cut_skin(two_blocks("TETRA4", n=2, m=2), "slave")
    mesh = without_records(cut.mesh)
    with pytest.warns(LacmeshWarning, match="cut in part"):
        assert recognise(mesh, ["slave", "loaded"]) is None
    with pytest.raises(CutError, match="no earlier cut") as caught:
        cut_skin(mesh, ["slave", "loaded"], recognise=True)
    assert cut_skin(mesh, ["slave", "loaded"], recognise=False).n_macros == 32
    assert set(caught.value.cells) == set(mesh.cell_number[mesh.cell_groups["loaded"]].tolist())
    with pytest.raises(CutError, match="no earlier cut"):
        cut_skin(two_blocks("HEXA8"), "slave", recognise=True)


def test_groups_that_are_missing_or_have_no_faces():
    with pytest.raises(GroupNotFoundError):
        recognise(two_blocks(), "slvae")
    with pytest.raises(RequestError):
        recognise(two_blocks(), [])
    mesh = replace(two_blocks(), cell_groups={"none": np.empty(0, int), "body": np.arange(3)})
    assert recognise(mesh, "none") is None and recognise(mesh, "body") is None


def test_a_recognised_cut_has_the_multipliers_of_code_aster():
    cut = cut_blocks("HEXA20", "hexa")
    a, b = (lacmesh.aster_multipliers(one) for one in (Cut(cut), recognise(without_records(cut), "slave")))
    assert np.array_equal(a.nodes, b.nodes) and np.array_equal(a.patch_code, b.patch_code)
