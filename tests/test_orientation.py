"""Skins turned outward: faces with a cell behind, bare skins, macro-elements; nothing else changes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh, cut_skin, generate
from lacmesh.cells import CELLS
from lacmesh.cutting.recognition import recognise
from lacmesh.cutting.records import without_records
from lacmesh.errors import DataError, GroupNotFoundError
from lacmesh.reference.quadrature import measure, rule, signed_area
from lacmesh.reference.shapes import jacobian
from lacmesh.surface import Surface
from lacmesh.topology.orientation import REVERSED, analyse_orientation, orient, reverse, skin_cells
from tests.checks.blocks import two_blocks
from tests.checks.corpus import reversed_group
from tests.meshes import cell_with_faces, random_mesh, same_nodes
from tests.properties import DOFS, hold
from verification.measures.cutting import same_up_to_numbers


def normals(mesh, group):
    """(n, 3), (n, 3): normals of the faces of a group, to the right of a segment or by the right hand, and centres."""
    out, centres = [], []
    for kind, _, nodes in mesh.select(np.sort(mesh.cell_groups[group])):
        x = mesh.points[nodes]
        out.append(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0] if CELLS[kind].dim == 2 else [0, 0, 1]))
        centres.append(x.mean(axis=1))
    return np.concatenate(out), np.concatenate(centres)


def face_up(mesh, group):
    return normals(mesh, group)[0][:, mesh.space_dim - 1] > 0


def face_out(mesh, group, centre):
    n, x = normals(mesh, group)
    return np.einsum("kx,kx->k", n, x - centre) > 0


def some_reversed(mesh, group, rng):
    """The mesh with about half of a group's faces turned over; and these."""
    chosen = mesh.cells_of(group)[rng.random(len(mesh.cells_of(group))) < 0.5]
    return reverse(mesh, chosen), chosen


#: plane cells whose least corner turns the other way: a dart, and quadratic cells with a side bent far inward
_DART = [[0, 0], [4, 0], [1, 1], [0, 4]]
_CONCAVE = {
    "QUAD4": _DART,
    "QUAD8": [*_DART, [2, 0], [2.5, 0.5], [0.5, 2.5], [0, 2]],
    "TRIA6": [[0, 0], [1, 0], [0, 1], [0.5, 0.45], [0.5, 0.5], [0, 0.5]],
    "TRIA7": [[0, 0], [1, 0], [0, 1], [0.5, 0.45], [0.5, 0.5], [0, 0.5], [0.33, 0.35]],
    "QUAD9": [[0, 0], [2, 0], [2, 1], [0, 1], [1, 0.8], [2, 0.5], [1, 1], [0, 0.5], [1, 0.9]],
    "bulge": [[0, 0], [1, -0.1], [2, 0], [1, -0.15], [0.5, -0.05], [1.5, -0.05], [1.5, 1], [0.5, 1]],
}


@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize("name", _CONCAVE)
def test_a_concave_plane_cell(name, back):
    """A cell is inverted where its area is negative, whatever its corners do: right faces stay, wrong ones turn."""
    kind = "QUAD8" if name == "bulge" else name
    points = np.add(_CONCAVE[name], [1e3, -2e3])
    cell = np.array(REVERSED[kind] if back else range(CELLS[kind].n_nodes))
    facets = CELLS[kind].facets
    right = [np.array(f.nodes) if not back else cell[list(f.nodes)][list(REVERSED[f.type])] for f in facets]
    for listed, wrong in ((right, 0), ([face[list(REVERSED[facets[0].type])] for face in right], len(facets))):
        blocks = [(kind, [cell]), (facets[0].type, listed)]
        mesh = Mesh.create(points, blocks, cell_groups={"s": 1 + np.arange(len(facets))})
        assert len(analyse_orientation(mesh, mesh.cell_groups["s"]).to_flip) == wrong
        assert orient(mesh, "s").block(facets[0].type).tolist() == np.array(right).tolist()
        assert Surface.of(mesh, mesh.cell_groups["s"]).faces.nodes[:, :2].tolist() == np.array(right)[:, :2].tolist()
        assert ("orientation" in {f.rule for f in lacmesh.check(mesh, "s")}) == bool(wrong)
        assert same_nodes(cut_skin(mesh, "s", orient="outward").mesh, cut_skin(orient(mesh, "s"), "s").mesh)


@pytest.mark.parametrize("name", ["TRIA3", "QUAD4", "TRIA6", "TRIA7", "QUAD8", "QUAD9"])
def test_the_signed_area_is_the_integral_of_the_determinant(name):
    rng = np.random.default_rng(8)
    x = np.zeros((20, CELLS[name].n_nodes, 3))
    x[..., :2] = np.array(CELLS[name].reference) + rng.normal(0, 0.4, (20, CELLS[name].n_nodes, 2))
    x[::2] = x[::2, REVERSED[name]]
    X, w = rule(CELLS[name].family, 6)
    expected = np.linalg.det(jacobian(name, x, X)[..., :2, :]) @ w
    assert (expected < 0).any() and (expected > 0).any()
    np.testing.assert_allclose(signed_area(name, x), expected, atol=1e-12)


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("dim", [2, 3])
def test_everything_else_is_kept(dim, order):
    """A cut that turns faces outward is the cut of these faces turned, with the same cells as if they were not."""
    mesh = random_mesh(np.random.default_rng(order), dim, order, slaves=12, interior=True)
    after = orient(mesh, "slave")
    for name in ("points", "node_number", "cell_number", "file_order"):
        np.testing.assert_array_equal(getattr(after, name), getattr(mesh, name))
    assert after.cell_groups.keys() == mesh.cell_groups.keys()
    assert all((after.cell_data[k] == v).all() for k, v in mesh.cell_data.items())
    for a, b in zip(after.blocks, mesh.blocks, strict=True):
        assert (np.sort(a.nodes, axis=1) == np.sort(b.nodes, axis=1)).all()
    assert len(analyse_orientation(after, after.cell_groups["slave"]).to_flip) == 0 and not same_nodes(after, mesh)
    outward = cut_skin(mesh, "slave", orient="outward")
    assert same_nodes(outward.mesh, cut_skin(after, "slave").mesh)
    assert same_up_to_numbers(outward.mesh, cut_skin(mesh, "slave").mesh)


@pytest.mark.parametrize("inward", [False, True])
@pytest.mark.parametrize("name", ["TRIA3", "QUAD8", "TETRA10", "HEXA8", "PENTA15", "PYRAM14"])
def test_each_facet_of_a_cell(name, inward):
    """Also of one that is inside out."""
    mesh = cell_with_faces(name, range(len(CELLS[name].facets)), rotation=1, inward=inward)
    for mirror in (1, -1):
        mesh = replace(mesh, points=mesh.points * ([1, 1, mirror] if CELLS[name].dim == 3 else [1, mirror, 1]))
        after = orient(mesh, "slave")
        assert face_out(after, "slave", mesh.points.mean(axis=0)).all()
        sizes = [measure(name, m.points[m.block(name)]) for m in (after, mesh)]
        np.testing.assert_array_equal(*sizes)


# ---- bare skins


def sphere(n=4):
    """The skin of a box as a bare closed skin of quadrangles and triangles."""
    mesh = generate.box(n)
    faces = mesh.block("QUAD4")
    split = faces[:6][:, [(0, 1, 2), (0, 2, 3)]].reshape(-1, 3)
    return Mesh.create(mesh.points, [("QUAD4", faces[6:]), ("TRIA3", split)], cell_groups={"s": range(len(faces) + 6)})


@pytest.mark.parametrize("seed", range(4))
def test_a_closed_bare_skin_encloses_a_positive_volume(seed):
    mesh, _ = some_reversed(sphere(), "s", np.random.default_rng(seed))
    assert face_out(orient(mesh, "s"), "s", 0.5).all()
    found = analyse_orientation(mesh, mesh.cell_groups["s"])
    assert len(found.parentless) == len(mesh.cell_groups["s"]) and not len(found.open) and not len(found.one_sided)


def test_an_open_bare_skin_is_made_to_agree_with_its_majority():
    mesh = generate.box((3, 3, 1)).only("top")
    top = mesh.block("QUAD4").copy()
    top[:3] = top[:3][:, ::-1]
    mesh = Mesh.create(mesh.points, [("QUAD4", top)], cell_groups={"s": np.arange(9)}, space_dim=3)
    found = analyse_orientation(mesh, np.arange(9))
    assert found.to_flip.tolist() == [0, 1, 2] and len(found.open) == 9
    assert face_up(orient(mesh, "s"), "s").all()


def test_a_moebius_strip_stays_and_is_named():
    n = 8
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False)

    def ring(r):
        out = 2 + r * np.cos(angle / 2)
        return np.stack([out * np.cos(angle), out * np.sin(angle), r * np.sin(angle / 2)], axis=1)

    points = np.vstack([ring(-0.5), ring(0.5)])
    quads = [[k, k + 1, n + k + 1, n + k] for k in range(n - 1)] + [[n - 1, n, 0, 2 * n - 1]]
    mesh = Mesh.create(points, [("QUAD4", quads)], cell_groups={"s": np.arange(n)}, space_dim=3)
    found = analyse_orientation(mesh, np.arange(n))
    assert len(found.one_sided) == n and not len(found.to_flip)


@pytest.mark.parametrize("clockwise", [False, True])
def test_a_closed_bare_line_goes_round_with_the_inside_on_its_left(clockwise):
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    edges = [[0, 1], [2, 1], [2, 3], [3, 0]] if not clockwise else [[1, 0], [1, 2], [3, 2], [0, 3]]
    points, triangle = np.vstack([square, [[5, 5], [6, 5], [5, 6]]]), ("TRIA3", [[4, 5, 6]])
    mesh = Mesh.create(points, [("SEG2", edges), triangle], cell_groups={"s": np.arange(4)})
    after = orient(mesh, "s").block("SEG2")
    (x0, y0), (x1, y1) = np.moveaxis(square[after], 0, 2)
    assert (x0 * y1 - y0 * x1).sum() / 2 == pytest.approx(1)


def test_a_bare_skin_cut_by_itself_can_be_turned_too():
    mesh, _ = some_reversed(sphere(3), "s", np.random.default_rng(2))
    cut = cut_skin(mesh, "s", skin_only=True, orient="outward")
    faces = cut.mesh.cell_groups["s"]
    assert len(analyse_orientation(cut.mesh, faces).to_flip) == 0


# ---- macro-elements


@pytest.mark.parametrize("hexa", ["pyramid", "hexa"])
@pytest.mark.parametrize(
    "name", ["TRIA3", "QUAD4", "TETRA4", "TETRA10", "HEXA8", "HEXA20", "PENTA15", "PYRAM5", "HEXA27"]
)
def test_a_turned_macro_element_is_that_of_a_turned_face(name, hexa):
    """Turning a cut skin gives what cutting the turned skin gives, up to numbers: E1 ... in the new face's order."""
    mesh = reversed_group(two_blocks(name), "slave")
    cut = cut_skin(mesh, "slave", hexa=hexa)
    turned = orient(cut.mesh, "slave")
    wanted = cut_skin(orient(mesh, "slave"), "slave", hexa=hexa)
    view = lacmesh.Cut(turned)
    assert places(view) == places(wanted)
    same = recognise(without_records(turned), "slave")
    assert same is not None and same.n_macros == cut.n_macros
    if name != "HEXA27":
        shares = [lacmesh.aster_multipliers(one).share.sum() for one in (view, cut)]
        np.testing.assert_allclose(*shares, rtol=1e-12)
    hold(mesh, view, DOFS)
    again = reverse(reverse(cut.mesh, cut.mesh.cell_groups["slave"]), cut.mesh.cell_groups["slave"])
    assert same_nodes(again, cut.mesh) and (again.cell_data["lac_child"] == cut.mesh.cell_data["lac_child"]).all()


def places(cut):
    """The macro-elements: their faces E1, E2 ..., each the places of its nodes as it lists them."""
    rows = {}
    for _, cells, nodes in cut.mesh.select(np.flatnonzero(cut.macro_of_face >= 0)):
        x = cut.mesh.points[nodes].round(9) + 0.0
        rows |= {int(c): tuple(map(tuple, face)) for c, face in zip(cells, x, strict=True)}
    return {tuple(rows[int(f)] for f in faces) for faces in cut.faces_of_macro}


# ---- what cannot be done, and the command


def test_groups_that_hold_no_skin():
    mesh = two_blocks("HEXA8")
    entity = np.zeros((mesh.n_cells, 2), int)
    entity[mesh.cell_groups["slave"]] = [2, 7]
    mesh = replace(mesh, cell_data={"entity": entity})
    assert len(skin_cells(mesh, "entity:2:7")) == 4
    points = np.random.default_rng(0).random((20, 3))
    blocks = [("TRIA10", [range(10)]), ("TETRA4", [[10, 11, 12, 13]])]
    for asked, group, error, words in (
        (mesh, "slvae", GroupNotFoundError, None),
        (mesh, "body0", DataError, "has no lines"),
        (replace(mesh, cell_groups={"none": np.empty(0, int)}), "none", DataError, "has no lines"),
        (Mesh.create(points, blocks, cell_groups={"s": [0]}), "s", DataError, "cannot be flipped"),
    ):
        with pytest.raises(error, match=words):
            orient(asked, group)


def test_the_command(run):
    lacmesh.write("part.msh", reversed_group(two_blocks("HEXA8"), "slave"))
    said = run("orient part.msh --group slave --group master")
    assert "slave: 4 of 4 faces flipped" in said and "master: 0 of 9 faces flipped" in said
    assert face_up(lacmesh.read("part.out.msh"), "slave").all()
    run("orient part.msh --group slave", 2)  # an output that exists
    assert run("orient part.msh --group slave --force --quiet") == ""
    for group, status in (("body0", 1), ("nobody", 2)):
        run(f"orient part.msh --group {group} -o x.msh", status)
    assert not Path("x.msh").exists()
