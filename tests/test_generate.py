"""Meshes made in a line: areas and volumes, skins outward, nodes on curved sides, groups, joints, mistakes."""

import re
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
from lacmesh.cells import CELLS
from lacmesh.errors import GroupNotFoundError, RequestError
from lacmesh.generate import box, cylinder, disc, grid, kinds, line, rectangle, ring, sphere, stack
from lacmesh.quality import validity_of
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import jacobian, shape
from lacmesh.topology.facets import ALONE, CROWDED, Facets
from tests.samples import each_option
from verification.measures.cutting import sizes

#: shape -> how it is made of a kind, its exact size, its sides
FLAT = {
    "rectangle": (
        lambda k, **o: rectangle((4, [0, 0.1, 0.3, 0.6, 1.0]), (2.0, 1.0), k, **o),
        2.0,
        "left right bottom top",
    ),
    "ring": (lambda k, **o: ring((2, 8), (1.0, 2.0), k, **o), 3 * np.pi, "inner outer"),
    "arc": (lambda k, **o: ring((2, 4), (1.0, 2.0), k, angle=90, **o), 0.75 * np.pi, "inner outer start end"),
    "disc": (lambda k, **o: disc(2, 3.0, k, **o), 9 * np.pi, "outer"),
    "half a disc": (lambda k, **o: disc(2, 3.0, k, angle=180, **o), 4.5 * np.pi, "outer start end"),
}
SOLID = {
    "box": (lambda k, **o: box((2, 2, 4), (2.0, 1.0, 1.0), k, **o), 2.0, "left right front back bottom top"),
    "tube": (lambda k, **o: ring((2, 8, 2), (1.0, 2.0), k, height=2.0, **o), 6 * np.pi, "inner outer bottom top"),
    "cylinder": (lambda k, **o: cylinder(2, 1.0, 3.0, k, **o), 3 * np.pi, "outer bottom top"),
    "quarter": (lambda k, **o: cylinder(2, 1.0, 3.0, k, angle=90, **o), 0.75 * np.pi, "outer start end bottom top"),
    "sphere": (lambda k, **o: sphere(2, 2.0, k, **o), 4 / 3 * np.pi, "outer left front bottom"),
    "hollow sphere": (lambda k, **o: sphere(2, 2.0, k, inner=1.0, **o), 7 / 6 * np.pi, "inner outer left front bottom"),
}
SHAPES = FLAT | SOLID
#: kinds of cells that leave gaps in a shape
LYING = ("PENTA6 quadrangle", "PENTA15 quadrangle", "PENTA18 quadrangle")
STANDING = tuple(f"{name}{face}" for name in ("PENTA6", "PENTA15", "PENTA18") for face in ("", " triangle"))
GAPS = {
    "cylinder": LYING,
    "quarter": LYING,
    "sphere": (*LYING, *STANDING, "mixed", "mixed 2", "mixed 2-full"),
    "hollow sphere": LYING,
}
FILLED = [
    (shape, kind)
    for dim, shapes in ((2, FLAT), (3, SOLID))
    for shape in shapes
    for kind in kinds(dim)
    if kind not in GAPS.get(shape, ())
]


def made(shape, kind, **options):
    return SHAPES[shape][0](kind, **options)


def size_of(mesh, dim=None):
    """Area or volume of the cells of a dimension, the highest by default."""
    return sizes(mesh)[mesh.cell_dim == (dim or mesh.dim)].sum()


def outflow(mesh):
    """Volume (area in the plane) by Gauss' theorem: integral of x . n over the skins, over the dimension."""
    flow = 0.0
    for kind, nodes in mesh.blocks:
        if CELLS[kind].dim == mesh.dim - 1:
            X, w = rule(CELLS[kind].family, 6)
            x, J = np.einsum("pn,kns->kps", shape(kind, X), mesh.points[nodes]), jacobian(kind, mesh.points[nodes], X)
            normal = np.cross(J[..., 0], [0.0, 0.0, 1.0] if mesh.dim == 2 else J[..., 1])
            flow += ((x * normal).sum(axis=-1) @ w).sum()
    return flow / mesh.dim


def nodes_of(mesh, group):
    return mesh.points[mesh.nodes_on(mesh.cell_groups[group])]


@pytest.mark.rows(
    "rectangle-TRIA3; rectangle-QUAD9; ring-TRIA6; arc-TRIA7; disc-QUAD4; half a disc-QUAD8; box-TETRA4; "
    "box-PENTA15 quadrangle; tube-TETRA10; tube-PENTA18; cylinder-HEXA8; quarter-HEXA20; quarter-PYRAM5 triangle; "
    "quarter-PYRAM14 triangle; sphere-HEXA27; hollow sphere-PENTA6; hollow sphere-PYRAM13 triangle"
)
@pytest.mark.parametrize("shape, kind", each_option(FILLED))
def test_every_kind_fills_every_shape(shape, kind):
    """Valid cells without gaps, of the exact size but for curved sides; all of the skin, outward, in its groups."""
    _, exact, sides = SHAPES[shape]
    for mesh in (made(shape, kind), made(shape, kind, distortion=0.125, seed=5)):
        name, _, more = kind.partition(" ")
        quadratic = more.startswith("2") if name == "mixed" else CELLS[name].order == 2
        near = 1e-12 if shape in ("rectangle", "box") else 2e-3 if quadratic else 0.15
        assert abs(size_of(mesh) / exact - 1) < near
        assert outflow(mesh) == pytest.approx(size_of(mesh), rel=1e-9 if not quadratic or near < 1e-9 else 1e-3)
        assert validity_of(mesh, mesh.cell_groups["body"]).min() > 0.25
        facets = Facets.of(mesh)
        assert not (facets.opposite == CROWDED).any() and not facets.same.any() and not len(facets.copies)
        assert (facets.opposite == ALONE).sum() == mesh.n_cells - len(mesh.cell_groups["body"])
        assert {*mesh.cell_groups} == {"body", *sides.split()}
        assert (np.sort(np.concatenate([*mesh.cell_groups.values()])) == np.arange(mesh.n_cells)).all()
        if name != "mixed":
            assert name in mesh.cells_by_type


@pytest.mark.parametrize("shape, kind", [(shape, known[-1]) for shape, known in GAPS.items()])
def test_a_kind_that_leaves_gaps_is_an_error(shape, kind):
    with pytest.raises(RequestError, match="do not match"):
        made(shape, kind)


@pytest.mark.parametrize("shape, kind", each_option(pair for pair in FILLED if pair[0] not in ("rectangle", "box")))
def test_all_nodes_of_curved_sides_lie_on_them(shape, kind):
    mesh = made(shape, kind, distortion=0.1)
    axes = 3 if "sphere" in shape else 2
    for side, radius in (
        ("outer", {"disc": 3, "half a disc": 3, "cylinder": 1, "quarter": 1}.get(shape, 2)),
        ("inner", 1),
    ):
        if side in mesh.cell_groups:
            r = np.linalg.norm(nodes_of(mesh, side)[:, :axes], axis=1)
            np.testing.assert_allclose(r, radius, rtol=1e-14)
    flat = {"left": 0, "front": 1, "start": 1, "end": 0 if shape in ("arc", "quarter") else 1, "bottom": 2}
    for side, axis in flat.items():
        if side in mesh.cell_groups:
            assert (nodes_of(mesh, side)[:, axis] == 0).all()  # a plane of symmetry, exactly


def test_lines_and_numbers_of_cells():
    mesh = box((2, [0.0, 0.5, 2.0, 5.0], 1), (2.0, 9.0, 1.0), corner=(1.0, 9.0, -1.0))
    assert mesh.cells_by_type == {"HEXA8": 6, "QUAD4": 2 * (6 + 3 + 2)}
    assert [np.unique(x).tolist() for x in mesh.points.T] == [[1.0, 2.0, 3.0], [0.0, 0.5, 2.0, 5.0], [-1.0, 0.0]]


def test_a_line_points_to_its_right():
    wall = line(2, (3, 0), (-1, 0), "SEG3")
    assert wall.cells_by_type == {"SEG3": 2} and wall.points[wall.block("SEG3")[0], 0].tolist() == [3.0, 1.0, 2.0]


@pytest.mark.parametrize("make", [lambda **o: box(3, kind="TETRA10", **o), lambda **o: sphere(2, kind="PYRAM5", **o)])
def test_distortion_is_that_of_the_seed_and_keeps_sides(make):
    even, one, again, other = make(), make(distortion=0.1, seed=1), make(distortion=0.1, seed=1), make(distortion=0.1)
    assert (one.points == again.points).all() and (one.points != other.points).any()
    for a, b in zip(even.blocks, one.blocks, strict=True):
        assert (a.nodes == b.nodes).all()
    assert {n: c.tolist() for n, c in even.cell_groups.items()} == {n: c.tolist() for n, c in one.cell_groups.items()}


@pytest.mark.parametrize("kind", ["QUAD4", "HEXA8", "PYRAM5", "TETRA4"])
def test_distorted_cells_beside_much_larger_ones_are_valid(kind):
    lines = [0.0, 1.0, 1.1, 9.0, 9.01, 20.0]
    make = rectangle if kind == "QUAD4" else box
    for seed in range(20):
        mesh = make([lines] * (2 if kind == "QUAD4" else 3), kind=kind, distortion=0.125, seed=seed)
        assert validity_of(mesh, mesh.cell_groups["body"]).min() > 0


def test_random_moves_are_those_of_pcg64():
    """The generator's numbers are the same on every machine (O'Neill, 2014): the first corner inside moves by them."""
    mesh = rectangle(2, distortion=0.1, seed=3)
    draw = np.random.Generator(np.random.PCG64(3)).uniform(-1, 1, (3, 3, 2))[1, 1]
    np.testing.assert_allclose(mesh.points[4, :2], 0.5 + 0.05 * draw, rtol=1e-15)


def test_grids_become_one_body():
    """Three grids side by side: nodes of outsides that meet are one, and faces between them are no skin."""
    u, v = np.meshgrid(np.linspace(0, 1, 3), np.linspace(0, 1, 4), indexing="ij")
    flat = np.stack([u, v], axis=-1)
    mesh = grid(flat, flat + np.array([1.0, 0.0]), flat[:, ::-1] * [1.0, -1.0])
    assert mesh.n_nodes == 3 * 12 - 4 - 3 and len(mesh.cell_groups["skin"]) == 3 * 10 - 2 * (3 + 2)
    assert size_of(mesh) == pytest.approx(3.0) and outflow(mesh) == pytest.approx(3.0)
    solid = np.stack(np.meshgrid([0.0, 1.0], [0.0, 2.0], [0.0, 1.0, 3.0], indexing="ij"), axis=-1)
    assert grid(solid, kind="TETRA10").cells_by_type == {"TETRA10": 12, "TRIA6": 20}


def test_a_stack_has_a_slave_on_a_master():
    mesh = stack(box(2), box(3, kind="TETRA4").moved((0.1, 0.0, 7.0)), gap=0.25)
    for side, heights in (("slave", [1.25] * 16), ("master", [1.0] * 9)):
        assert nodes_of(mesh, side)[:, 2].tolist() == heights
    assert {*mesh.cell_groups} == {*stack(box(1), box(1)).cell_groups}
    assert len(mesh.cell_groups["left"]) == 4 + 18 and size_of(mesh) == pytest.approx(2.0)
    below = stack(rectangle(2), rectangle(3), slave="lower")
    assert len(below.cell_groups["slave"]) == 2 and len(below.cell_groups["master"]) == 3


def test_moved_by_a_function_or_a_shift():
    mesh = rectangle(2, kind="TRIA6")
    assert (mesh.moved((1, 2)).points == mesh.points + np.array([1, 2, 0])).all()
    bent = mesh.moved(lambda x: [x[0], x[1], 0.1 * x[0] ** 2])
    assert bent.space_dim == 3 and mesh.moved(lambda x: x[:2]).space_dim == 2
    np.testing.assert_array_equal(bent.points[:, 2], 0.1 * mesh.points[:, 0] ** 2)
    assert bent.cell_groups.keys() == mesh.cell_groups.keys()
    for wrong in (1.0, (1, 2, 3, 4), lambda x: x[:1], lambda x: [x[0], np.full(len(x[0]), np.nan)]):
        with pytest.raises(RequestError, match="moved"):
            mesh.moved(wrong)


@pytest.mark.parametrize("kind", ["HEXA20", "PENTA18", "TETRA4", "mixed"])
def test_groups_by_conditions(kind):
    mesh = box(4, kind=kind)
    new = mesh.with_groups(low=lambda x: x[2] == 0, ends=lambda x: (x[0] == 0) | (x[0] == 1), top=lambda x: x[1] == 0)
    assert new.n_cells == mesh.n_cells and (new.cell_groups["low"] == mesh.cell_groups["bottom"]).all()
    assert (new.cell_groups["ends"] == np.union1d(mesh.cell_groups["left"], mesh.cell_groups["right"])).all()
    assert (new.cell_groups["top"] == mesh.cell_groups["front"]).all()  # a group of that name is replaced
    halves = new.with_groups("cells", soft=lambda x: x[0] < 0.5, stiff=lambda x: x[0] > 0.5)
    both = np.concatenate([halves.cell_groups["soft"], halves.cell_groups["stiff"]])
    assert np.sort(both).tolist() == mesh.cell_groups["body"].tolist()
    assert halves.with_groups("nodes", corner=lambda x: x.sum(axis=0) == 0).node_groups["corner"].tolist() == [0]


def test_faces_become_cells_after_those_that_there_are():
    """Numbers, order and data of a mesh that was read stay; new faces have numbers after the largest one."""
    whole = box(2, kind="PENTA6")
    bare = whole.only("body", "top")
    bare = replace(bare, cell_number=bare.cell_number[::-1].copy(), cell_data={"heat": np.arange(float(bare.n_cells))})
    new = bare.with_groups(left=lambda x: x[0] == 0, top=lambda x: x[2] == 1)
    assert new.n_cells == bare.n_cells + 4 and len(new.cell_groups["top"]) == 8
    left = new.cell_groups["left"]
    assert np.isnan(new.cell_data["heat"][left]).all() and new.cell_number[left].min() > bare.cell_number.max()
    order = np.arange(new.n_cells) if new.file_order is None else new.file_order
    assert (order[-4:] == left).all()
    old = np.setdiff1d(np.arange(new.n_cells), left)
    assert (new.cell_number[old] == bare.cell_number).all() and (
        new.cell_data["heat"][old] == bare.cell_data["heat"]
    ).all()
    flow = sum(outflow(new.only("body", name)) for name in ("left", "top"))
    assert flow == pytest.approx((0.0 + 1.0) / 3)


def test_joined_meshes_keep_groups_and_data_and_merge_nothing():
    one = replace(box(2, kind="HEXA20"), node_data={"heat": np.ones(81)}, cell_data={"entity": np.ones((32, 2), int)})
    two = replace(box(1), cell_data={"rank": np.full(7, 3)}).with_groups("nodes", corner=lambda x: x.sum(axis=0) == 0)
    mesh = lacmesh.join(one, two, line(1, (0, 0), (1, 0)))
    assert mesh.n_nodes == one.n_nodes + two.n_nodes + 2 and mesh.n_cells == one.n_cells + two.n_cells + 1
    assert mesh.cells_by_type == {"HEXA20": 8, "QUAD8": 24, "HEXA8": 1, "QUAD4": 6, "SEG2": 1}
    assert mesh.node_groups["corner"].tolist() == [one.n_nodes] and len(mesh.cell_groups["top"]) == 5
    assert (mesh.cell_data["rank"] == 3).sum() == 7 and (mesh.cell_data["rank"] == -1).sum() == 33
    assert np.isnan(mesh.node_data["heat"]).sum() == two.n_nodes + 2 and "entity" not in mesh.cell_data


def test_groups_get_other_names():
    mesh = box(2).renamed(left="sides", right="sides", top="").with_groups("nodes", left=lambda x: x[0] == 0)
    assert {*mesh.cell_groups} == {"body", "sides", "front", "back", "bottom"} and len(mesh.cell_groups["sides"]) == 8
    assert {*mesh.renamed(left="held").node_groups} == {"held"}
    with pytest.raises(GroupNotFoundError, match="did you mean left"):
        mesh.renamed(lefd="held")


def test_groups_alone():
    mesh = box(2, kind="PYRAM13").with_groups("nodes", far=lambda x: x[0] > 0.9)
    top = mesh.only("top", "left")
    assert top.cells_by_type == {"QUAD8": 8} and {*top.cell_groups} == {"left", "top"} and top.space_dim == 3
    assert size_of(top, 2) == pytest.approx(2.0) and len(top.node_groups["far"]) == 5
    with pytest.raises(GroupNotFoundError):
        mesh.only("lid")


MISTAKES = {
    "kind is one of TRIA3, .*, not 'HEXA8'": lambda: rectangle(2, kind="HEXA8"),
    "kind is one of .*, not 'HEXA9'": lambda: box(2, kind="HEXA9"),
    "kind is one of .*, not 'mixed 3'": lambda: sphere(2, kind="mixed 3"),
    "kind is one of SEG2, SEG3, not 'QUAD4'": lambda: line(2, (0, 0), (1, 0), "QUAD4"),
    "whole number from 1, not 0": lambda: box(0),
    "whole number from 1, not -3": lambda: disc((2, -3)),
    "whole number from 1, not 2.5": lambda: rectangle((2, 2.5)),
    "two or more ascending": lambda: box([[0], 1, 1]),
    "or 3 of them, one along": lambda: box((2, 2)),
    "or 3 of them, not": lambda: cylinder((2, 2)),
    "or 2 of them, not": lambda: sphere((1, 2, 3)),
    "ascending": lambda: rectangle((2, [0, 2, 1])),
    "a size is above 0, not -1.0": lambda: box(2, (1, 1, -1)),
    "a number or 2 numbers": lambda: rectangle(2, (1, 1, 1)),
    "from 0 to 0.125, not 0.3": lambda: box(2, distortion=0.3),
    "inner < outer": lambda: ring(radii=(2, 1)),
    "up to 360": lambda: ring(angle=400),
    "90, 180 or 360 degrees, not 45": lambda: disc(angle=45),
    "a height above 0": lambda: cylinder(height=-1.0),
    "inner < radius": lambda: sphere(2, 1.0, inner=1.0),
    "array of points": lambda: grid(np.zeros((2, 2))),
    "upper mesh, not on 'both'": lambda: stack(box(1), box(1), slave="both"),
    "one of the plane and one of space": lambda: stack(box(1), rectangle(1)),
    "no cell group named 'top'": lambda: stack(ring(), rectangle(1)),
    "no mesh was given": lacmesh.join,
    "carries a cut": lambda: lacmesh.join(lacmesh.cut_skin(box(1), "top").mesh),
    "would be empty: no outer face": lambda: box(1).with_groups(lid=lambda x: x[2] == 2),
    "'lid' must be true or false": lambda: box(1).with_groups(lid=lambda x: x[2]),
    "not of 'edges'": lambda: box(1).with_groups("edges", lid=lambda x: x[2] == 1),
}  # fmt: skip


@pytest.mark.parametrize("sentence", MISTAKES)
def test_mistakes_are_one_sentence(sentence):
    with pytest.raises(lacmesh.LacmeshError, match=sentence) as caught:
        MISTAKES[sentence]()
    assert "\n" not in str(caught.value) and not re.search(r"\.\s", str(caught.value))
