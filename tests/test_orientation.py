"""Skins turned outward: faces with a cell behind, bare skins, macro-elements; nothing else changes."""

from __future__ import annotations

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh, cut_skin
from lacmesh.cells import CELLS
from lacmesh.cli import main
from lacmesh.cutting.earlier import recognise
from lacmesh.errors import DataError, GroupNotFoundError
from lacmesh.reference.quadrature import measure, rule, signed_area
from lacmesh.reference.shapes import jacobian
from lacmesh.surface import Surface
from lacmesh.topology.orientation import analyse_orientation, orient, reverse, skin_cells
from lacmesh.topology.winding import REVERSED
from tests import properties
from tests.checks.blocks import SOLIDS, block, join, skin, two_blocks
from tests.checks.corpus import reversed_group, without_records
from tests.meshes import cell_with_faces, random_mesh


def normals(mesh, cells):
    """{cell: normal of its corners}: to the right of a segment, by the right hand around a face."""
    out = {}
    for kind, ids, nodes in mesh.select(np.sort(cells)):
        x = mesh.points[nodes]
        if CELLS[kind].dim == 1:
            t = x[:, 1] - x[:, 0]
            n = np.stack([t[:, 1], -t[:, 0], 0 * t[:, 0]], axis=1)
        else:
            n = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
        out |= dict(zip(ids.tolist(), n, strict=True))
    return out


def some_reversed(mesh, group, rng):
    """The mesh with about half of a group's faces turned over, as a plain test of ours does it."""
    cells = mesh.cell_groups[group]
    chosen = cells[rng.random(len(cells)) < 0.5]
    named = Mesh.create(
        mesh.points, mesh.blocks, cell_groups={**mesh.cell_groups, "some": chosen}, space_dim=mesh.space_dim
    )
    return reversed_group(named, "some"), chosen


@pytest.mark.parametrize("name", SOLIDS)
def test_the_top_of_a_block_looks_up(name):
    mesh, turned = some_reversed(two_blocks(name), "slave", np.random.default_rng(1))
    up = 1 if mesh.space_dim == 2 else 2
    after = orient(mesh, "slave")
    cells = mesh.cell_groups["slave"]
    assert all(n[up] > 0 for n in normals(after, cells).values())
    assert set(analyse_orientation(mesh, cells).to_flip.tolist()) == set(turned.tolist())
    assert all(n[up] < 0 for n in normals(orient(mesh, "master"), mesh.cell_groups["master"]).values())


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
        mesh = Mesh.create(
            points, [(kind, [cell]), (facets[0].type, listed)], cell_groups={"s": 1 + np.arange(len(facets))}
        )
        assert len(analyse_orientation(mesh, mesh.cell_groups["s"]).to_flip) == wrong
        assert orient(mesh, "s").block(facets[0].type).tolist() == np.array(right).tolist()
        assert Surface.of(mesh, mesh.cell_groups["s"]).faces.nodes[:, :2].tolist() == np.array(right)[:, :2].tolist()
        found = lacmesh.check(mesh, "s")
        assert ("orientation" in {f.rule for f in found}) == bool(wrong)
        if facets[0].type == "SEG2":
            made, as_oriented = cut_skin(mesh, "s", orient="outward"), cut_skin(orient(mesh, "s"), "s")
            assert made.mesh.block("SEG2").tolist() == as_oriented.mesh.block("SEG2").tolist()


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


def test_everything_else_is_kept():
    mesh = random_mesh(np.random.default_rng(4), 3, order=2, slaves=8)
    after = orient(mesh, "slave")
    for name in ("points", "node_number", "cell_number", "file_order"):
        np.testing.assert_array_equal(getattr(after, name), getattr(mesh, name))
    assert after.cell_groups.keys() == mesh.cell_groups.keys()
    assert all((after.cell_data[k] == v).all() for k, v in mesh.cell_data.items())
    for a, b in zip(after.blocks, mesh.blocks, strict=True):
        assert (np.sort(a.nodes, axis=1) == np.sort(b.nodes, axis=1)).all()
    assert len(analyse_orientation(after, after.cell_groups["slave"]).to_flip) == 0
    assert any((a.nodes != b.nodes).any() for a, b in zip(after.blocks, mesh.blocks, strict=True))


@pytest.mark.parametrize("inward", [False, True])
@pytest.mark.parametrize("name", ["QUAD8", "TETRA10", "HEXA8", "PENTA15", "PYRAM14"])
def test_each_facet_of_a_cell(name, inward):
    mesh = cell_with_faces(name, range(len(CELLS[name].facets)), rotation=1, inward=inward)
    after = orient(mesh, "slave")
    centre = mesh.points.mean(axis=0)
    for cell, n in normals(after, mesh.cell_groups["slave"]).items():
        (_, _, nodes) = next(after.select(np.array([cell])))
        assert n @ (mesh.points[nodes[0]].mean(axis=0) - centre) > 0
    np.testing.assert_array_equal(
        measure(name, after.points[after.block(name)]), measure(name, mesh.points[mesh.block(name)])
    )


def test_a_body_inside_out_has_the_same_outward():
    mesh = two_blocks("HEXA8")
    hexa = mesh.block("HEXA8")[:, [4, 5, 6, 7, 0, 1, 2, 3]]
    blocks = [(b.type, hexa if b.type == "HEXA8" else b.nodes) for b in mesh.blocks]
    wrong = Mesh.create(mesh.points, blocks, cell_groups=mesh.cell_groups)
    assert len(analyse_orientation(wrong, wrong.cell_groups["slave"]).to_flip) == 0


def test_faces_between_two_cells_stay_and_are_named():
    points, cells = block((2, 2, 2), (0, 0, 0), (1, 1, 1))
    low = {"HEXA8": cells["HEXA8"][points[cells["HEXA8"]].mean(axis=1)[:, 2] < 0.5]}
    inside = skin(points, low, lambda x: np.abs(x[..., 2] - 0.5) < 1e-9)
    mesh = join([(points, cells, {"inside": inside})])
    found = analyse_orientation(mesh, mesh.cell_groups["inside"])
    assert set(found.interface.tolist()) == set(mesh.cell_groups["inside"].tolist())
    assert not len(found.to_flip)


# ---- bare skins


def sphere(n=4):
    """The skin of a block of hexahedra as a bare closed skin of quadrangles and triangles."""
    points, cells = block((n, n, n), (0, 0, 0), (1, 1, 1))
    faces = skin(points, cells, lambda x: np.abs(x - 0.5).max(axis=-1) > 0.499)["QUAD4"]
    outside = np.abs(points[faces].mean(axis=1) - 0.5).max(axis=1) > 0.499
    faces = faces[outside]
    split = faces[:6][:, [(0, 1, 2), (0, 2, 3)]].reshape(-1, 3)
    n_cells = len(faces) - 6 + len(split)
    blocks = [("QUAD4", faces[6:]), ("TRIA3", split)]
    return Mesh.create(points, blocks, cell_groups={"s": np.arange(n_cells)}, space_dim=3)


@pytest.mark.parametrize("seed", range(4))
def test_a_closed_bare_skin_encloses_a_positive_volume(seed):
    mesh, _ = some_reversed(sphere(), "s", np.random.default_rng(seed))
    after = orient(mesh, "s")
    for cell, n in normals(after, after.cell_groups["s"]).items():
        (_, _, nodes) = next(after.select(np.array([cell])))
        assert n @ (after.points[nodes[0]].mean(axis=0) - 0.5) > 0
    found = analyse_orientation(mesh, mesh.cell_groups["s"])
    assert len(found.parentless) == len(mesh.cell_groups["s"]) and not len(found.open) and not len(found.one_sided)


def test_an_open_bare_skin_is_made_to_agree_with_its_majority():
    points, cells = block((3, 3, 1), (0, 0, 0), (1, 1, 1))
    top = skin(points, cells, lambda x: np.abs(x[..., 2] - 1) < 1e-9)["QUAD4"]
    top[:3] = top[:3][:, ::-1]
    mesh = Mesh.create(points, [("QUAD4", top)], cell_groups={"s": np.arange(9)}, space_dim=3)
    found = analyse_orientation(mesh, np.arange(9))
    assert found.to_flip.tolist() == [0, 1, 2] and len(found.open) == 9
    assert all(n[2] > 0 for n in normals(orient(mesh, "s"), np.arange(9)).values())


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
    mesh = Mesh.create(square, [("SEG2", edges)], cell_groups={"s": np.arange(4)})
    mesh = Mesh.create(
        np.vstack([square, [[5, 5], [6, 5], [5, 6]]]),
        [("SEG2", edges), ("TRIA3", [[4, 5, 6]])],
        cell_groups={"s": np.arange(4)},
    )
    after = orient(mesh, "s").block("SEG2")
    x = square[after]
    area = (x[:, 0, 0] * x[:, 1, 1] - x[:, 0, 1] * x[:, 1, 0]).sum() / 2
    assert area == pytest.approx(1)


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
        np.testing.assert_array_equal(
            lacmesh.aster_multipliers(view).share.sum(), lacmesh.aster_multipliers(cut).share.sum()
        )
    properties.owns_internal_dofs(mesh, view)


def places(cut):
    """The macro-elements: their faces E1, E2 ..., each the places of its nodes as it lists them."""
    rows = {}
    for _, cells, nodes in cut.mesh.select(np.flatnonzero(cut.macro_of_face >= 0)):
        x = cut.mesh.points[nodes].round(9) + 0.0
        rows |= {int(c): tuple(map(tuple, face)) for c, face in zip(cells, x, strict=True)}
    return {tuple(rows[int(f)] for f in faces) for faces in cut.faces_of_macro}


def test_turning_twice_changes_nothing():
    cut = cut_skin(two_blocks("HEXA20"), "slave", hexa="hexa").mesh
    cells = cut.cell_groups["slave"]
    again = reverse(reverse(cut, cells), cells)
    for a, b in zip(again.blocks, cut.blocks, strict=True):
        np.testing.assert_array_equal(a.nodes, b.nodes)
    np.testing.assert_array_equal(again.cell_data["lac_child"], cut.cell_data["lac_child"])


# ---- what cannot be done, and the command


def test_groups_that_hold_no_skin():
    mesh = two_blocks("HEXA8")
    with pytest.raises(GroupNotFoundError):
        orient(mesh, "slvae")
    with pytest.raises(DataError, match="no skin"):
        orient(mesh, "body0")
    empty = Mesh.create(mesh.points, mesh.blocks, cell_groups={"none": []})
    with pytest.raises(DataError, match="no skin"):
        orient(empty, "none")
    carried = Mesh.create(
        np.random.default_rng(0).random((20, 3)),
        [("TRIA10", [range(10)]), ("TETRA4", [[10, 11, 12, 13]])],
        cell_groups={"s": [0]},
    )
    with pytest.raises(DataError, match="cannot be flipped"):
        orient(carried, "s")


def test_entities_and_tags_name_a_skin_too():
    mesh = two_blocks("HEXA8")
    entity = np.zeros((mesh.n_cells, 2), int)
    entity[mesh.cell_groups["slave"]] = [2, 7]
    mesh = Mesh.create(mesh.points, mesh.blocks, cell_data={"entity": entity})
    assert len(skin_cells(mesh, "entity:2:7")) == 4


def test_the_command(tmp_path, capsys):
    source, target = tmp_path / "part.msh", tmp_path / "part.out.msh"
    mesh = reversed_group(two_blocks("HEXA8"), "slave")
    lacmesh.write(source, mesh)
    assert main(["orient", str(source), "--group", "slave", "--group", "master"]) == 0
    said = capsys.readouterr().out
    assert "slave: 4 of 4 faces flipped" in said and "master: 0 of 9 faces flipped" in said
    after = lacmesh.read(target)
    assert all(n[2] > 0 for n in normals(after, after.cell_groups["slave"]).values())
    assert main(["orient", str(source), "--group", "slave"]) == 2, "an output that exists"
    assert main(["orient", str(source), "--group", "slave", "--force", "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    assert main(["orient", str(source), "--group", "body0", "-o", str(tmp_path / "x.msh")]) == 1
    assert main(["orient", str(source), "--group", "nobody", "-o", str(tmp_path / "x.msh")]) == 2
    assert not (tmp_path / "x.msh").exists()
