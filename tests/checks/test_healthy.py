"""Nothing is said against healthy meshes, curved, closed, warped, cut off; of mangled ones whatever is wrong."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh, cut_skin, generate, orient
from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.checks import check
from lacmesh.cutting.patterns import WHOLE_FACES
from lacmesh.errors import GroupNotFoundError, RequestError
from lacmesh.generate.parts import SEAM, sew
from tests.checks.blocks import SOLIDS, cut_blocks, two_blocks
from tests.meshes import lenient, random_mesh
from tests.samples import each_option, samples

PLANE = [name for name in SOLIDS if CELLS[name].dim == 2]
SOLID = [name for name in SOLIDS if CELLS[name].dim == 3]


def layers(name, n, m, gap=0.02, reach=0.0):
    """Two bodies in parameters, `n` and `m` cells a direction: the last parameter in 0..1 and in 1 + gap..2 + gap."""
    make, more = (generate.rectangle, [0]) if len(n) == 2 else (generate.box, [0, 0])
    wide = np.array([reach, *more])
    wide[1:-1] = reach
    return generate.stack(make(n, 1.0, name), make(m, 1 + 2 * wide, name, corner=-wide), gap=gap, slave="lower")


def closed(mesh, place, *ends):
    """A mesh moved by `place`, and closed where its ends meet."""
    return sew(mesh.renamed(**dict.fromkeys(ends, SEAM)).moved(place), SEAM)


def ring(x, turn=2 * np.pi):
    """The first parameter goes round, the last outward."""
    return [(3 + x[1]) * np.cos(turn * x[0]), -(3 + x[1]) * np.sin(turn * x[0])]


def tube(x, turn=2 * np.pi):
    """The first parameter goes round, the second along, the last outward."""
    return [(3 + x[2]) * np.sin(turn * x[0]), 4 * x[1], (3 + x[2]) * np.cos(turn * x[0])]


def quarter(x):
    """A quarter of a tube, which ends at symmetry planes."""
    return tube(x, np.pi / 2)


def torus(x):
    """No skin has a rim."""
    a, b, r = 2 * np.pi * x[0], 2 * np.pi * x[1], 1.5 + x[2]
    across = 9 + r * np.cos(b)
    return [across * np.cos(a), across * np.sin(a), r * np.sin(b)]


def dome(x):
    """Every face is curved both ways, and quadrangles are warped."""
    return [x[0], x[1], x[2] + 0.04 * (np.sin(2.2 * x[0]) * np.cos(1.7 * x[1] + 0.3) - x[0] * x[1])]


def turned(x):
    """Somewhere else, turned about a skew axis, in other units."""
    axis = np.array([1.0, 2.0, 3.0])[:, None] / np.sqrt(14)
    c, s = np.cos(0.7), np.sin(0.7)
    cross = np.cross(axis, x, axis=0)
    return 1e-3 * (c * x + s * cross + (1 - c) * axis * (axis * x).sum(axis=0)) + [[4.0], [-2.0], [7.0]]


#: place -> how many cells of the two bodies, gap, reach of the master, groups that are held, ends that meet
SHAPES = {
    tube: ((12, 2, 1), (14, 3, 1), 0.2, 0.0, ("front", "back"), ("left", "right")),
    torus: ((28, 12, 1), (30, 13, 1), 0.2, 0.0, (), ("left", "right", "front", "back")),
    quarter: ((5, 4, 1), (6, 5, 1), 0.05, 0.0, ("left", "right", "front", "back"), ()),
    dome: ((3, 3, 2), (4, 4, 2), 0.05, 0.2, ("left", "right", "front", "back"), ()),
    turned: ((2, 2, 2), (3, 3, 3), 0.05, 0.0, ("left", "back"), ()),
}


def all_well(mesh, slave="slave", master="master", held=(), but=(), **options):
    """No error and no warning, also of a mesh that is not cut yet."""
    found = check(mesh, slave, master, held, **options)
    against = [f for f in found.errors + found.warnings if f.rule not in but]
    assert not against, [f.message for f in against]
    return found


def all_well_before_and_after(mesh, slave="slave", master="master", held=(), but=(), **options):
    before = all_well(mesh, slave, master, held, **options)
    faces = mesh.cell_groups["slave"]
    whole = sum(len(cells) for kind, cells, _ in mesh.select(faces) if kind in WHOLE_FACES)
    assert before.summary["with_internal_dof"] == whole
    assert sum(len(f.cells) for f in before.of_rule("not-cut")) == len(faces) - whole
    for hexa in ("pyramid", "hexa") if any(b.type.startswith("HEXA") for b in mesh.blocks) else ("pyramid",):
        after = all_well(cut_skin(mesh, slave, hexa=hexa).mesh, slave, master, held, but, **options)
        assert not after.errors
        assert after.summary["with_free_internal_dof"] == after.summary["macro_elements"] == len(faces)
        if master:
            assert after.summary["covered"] > 0.99
    return after


#: every type, one of each family in short
EVERY = pytest.mark.parametrize("name", each_option([(name,) for name in SOLIDS], of=lambda k: [CELLS[k[0]].family]))


#: every type in every shape, the largest of which is tried with one type of each family and order
IN_SHAPES = [(name, shape) for name in SOLID for shape in SHAPES if shape is not torus]
IN_SHAPES += [(name, torus) for name in ("HEXA8", "TETRA10", "HEXA20", "PENTA6", "PYRAM13")]


@pytest.mark.rows("HEXA20-turned", "PENTA18-dome")
@pytest.mark.parametrize(("name", "shape"), each_option(IN_SHAPES, of=lambda row: [row[0], row[1].__name__]))
def test_bodies_of_other_shapes(name, shape):
    n, m, gap, reach, held, ends = SHAPES[shape]
    mesh = closed(layers(name, n, m, gap, reach), shape, *ends)
    # where a twisted prism or a slender tetrahedron is cut, the children are as poor as the check says
    all_well_before_and_after(mesh, held=held, but=("poor-cell",) if shape is torus else ())


@pytest.mark.parametrize(("name", "axisymmetric"), each_option(itertools.product(PLANE, (False, True))))
def test_plane_bodies(name, axisymmetric):
    whole = closed(layers(name, (12, 2), (16, 2), 0.2), ring, "left", "right")
    all_well_before_and_after(whole.moved((10, 0)), axisymmetric=axisymmetric)
    quarter = layers(name, (4, 2), (5, 2), 0.05).moved(lambda x: ring(x, np.pi / 2))
    all_well_before_and_after(quarter, held=("left", "right"), axisymmetric=axisymmetric)
    blocks = two_blocks(name, reach=0.2)
    elsewhere = replace(blocks, points=blocks.points + np.array([0, 0, 7.0]), space_dim=3)
    all_well_before_and_after(elsewhere, held=("fixed",))


@EVERY
def test_blocks_and_blocks_whose_orientation_is_healed(name):
    after = all_well_before_and_after(two_blocks(name, reach=0.2), held="fixed").summary
    assert after["covered"] == pytest.approx(1, abs=1e-9) and after["gap"]["mean"] == pytest.approx(0.01, abs=1e-9)
    all_well(orient(orient(cut_blocks(name, reach=0.2), "slave"), "master"))
    all_well(orient(two_blocks(name, reach=0.2), "slave"))


@EVERY
def test_a_skin_that_goes_all_round(name):
    """Cells with two and three slave faces, no rim, convex edges."""
    mesh = generate.box(2, kind=name) if CELLS[name].dim == 3 else generate.rectangle(2, kind=name)
    sides = [side for side in mesh.cell_groups if side != "body"]
    all_well_before_and_after(mesh.renamed(**dict.fromkeys(sides, "slave")), master=None)


@EVERY
def test_one_body_that_meets_itself(name):
    """Slave and master are the walls of a slot, which end at its bottom."""
    deep = [(3, 1), (1, 1), (3, 1)] if CELLS[name].dim == 2 else [(3, 3, 1), (1, 3, 1), (3, 3, 1)]
    make, up = generate.rectangle if CELLS[name].dim == 2 else generate.box, CELLS[name].dim - 1
    parts = [make(n, n, name, corner=up * (0,) + (k,)) for k, n in enumerate(deep)]
    mesh = sew(lacmesh.join(*(one.renamed(bottom=SEAM, top=SEAM) for one in parts)), SEAM)
    wall = {role: lambda x, v=v: (x[up] == v) & (x[0] >= 1) for role, v in (("slave", 1), ("master", 2))}
    all_well_before_and_after(mesh.only("body").with_groups(**wall))


# ---- code_aster's own meshes, whose findings were confirmed by other means


TURNED, CLOCKWISE = "orientation", "clockwise-cell"
#: mesh, slave, master, groups that are held -> errors and warnings, with how many cells each is about, that stay
REAL = [
    ("ssnp150c", "BAS", "MAITRE", ["HAUT"], {}),
    ("ssnp170a", "Group_1", "Group_2", ["Sym", "Group_3"], {TURNED: 17}),
    ("ssnp170e", "Group_1", "Group_2", ["Sym", "Group_3"], {CLOCKWISE: 260, TURNED: 16}),
    ("ssnp170e", "Group_2", "Group_1", ["Sym", "Group_3"], {CLOCKWISE: 260, TURNED: 16}),
    ("ssnp170k", "Group_1", "Group_2", ["Symx", "Symy", "Group_3"], {}),
    ("ssnp170m", "Group_1", "Group_2", ["Symx", "Symy", "Group_3"], {}),
    ("ssnp173a", "Group_2", "Group_1", ["Symx", "Symy"], {CLOCKWISE: 851, TURNED: 23}),
    ("ssnv104k", "CON2", "CON1", ["AXE", "SPHSUP"], {CLOCKWISE: 2008, TURNED: 44, "partial-coverage": 5}),
    ("ssnv104l", "CON2", "CON1", ["AXE", "SPHSUP"], {CLOCKWISE: 2008, TURNED: 47, "partial-coverage": 7}),
    ("ssnv219e", "ESCLAVE", "MAITRE", ["HAUT"], {"inverted-cell": 4}),
    ("zzzz383a", ("Edge_1", "Edge_2"), None, [], {TURNED: 1, "zones-share-nodes": 0}),
    ("zzzz383b", "Edge_1", None, [], {}),
    ("zzzz383c", "Face_2", None, [], {}),
    ("zzzz383d", "Face_2", None, [], {}),
]
#: faces that own no internal dof before the cut: all, where they are not SEG3
WHOLE = {("ssnp150c", "BAS"), ("ssnp170e", "Group_1"), ("ssnp173a", "Group_2"), ("ssnv104l", "CON2")}
#: what the cut adds: ssnp170k has slender tetrahedra
POOR = {"ssnp170k": 10}


@pytest.mark.shared
@pytest.mark.parametrize(("name", "slave", "master", "held", "stays"), REAL)
@pytest.mark.filterwarnings("ignore:.*left out")
def test_real_meshes_before_and_after_the_cut(shared, name, slave, master, held, stays):
    def said(found):
        of = [(f.rule, len(f.cells)) for f in found.errors + found.warnings]
        return {rule: sum(n for other, n in of if other == rule) for rule, _ in of}

    mesh = lacmesh.read(shared / "reference" / "meshes" / f"{name}.med")
    axisymmetric = name in ("ssnp173a", "ssnv104k", "ssnv104l")
    before = check(mesh, slave, master, held, axisymmetric=axisymmetric)
    uncut = sum(len(f.cells) for f in before.of_rule("not-cut"))
    assert said(before) == stays and uncut == (0 if (name, slave) in WHOLE else before.summary["slave_faces"])
    for hexa in ("pyramid", "hexa"):
        after = check(cut_skin(mesh, slave, hexa=hexa).mesh, slave, master, held, axisymmetric=axisymmetric)
        assert set(said(after)) == set(stays) | ({"poor-cell"} if name in POOR else set())
        assert said(after).get("poor-cell", 0) == POOR.get(name, 0)
        assert after.summary["with_free_internal_dof"] == before.summary["slave_faces"]


# ---- mangled meshes


BAD = (np.nan, np.inf, -np.inf, 1e300, 0.0, -1e-320, 5.0)


def base(rng):
    """A mesh to mangle: cut or not, of any cells."""
    kind = rng.integers(4)
    if kind == 0:
        return two_blocks(list(SOLIDS)[rng.integers(len(SOLIDS))], n=1, m=2)
    if kind == 1:
        return cut_blocks(list(SOLIDS)[rng.integers(len(SOLIDS))], ("pyramid", "hexa")[rng.integers(2)], n=1, m=2)
    mesh = random_mesh(rng, int(rng.integers(2, 4)), int(rng.integers(1, 4)), slaves=4, interior=bool(rng.integers(2)))
    if kind == 3:
        with lenient():
            mesh = cut_skin(mesh, "slave").mesh
    return mesh


def places(rng, mesh):
    points = mesh.points.copy()
    if len(points):
        rows = rng.integers(len(points), size=int(rng.integers(1, 4)))
        points[rows, rng.integers(3, size=len(rows))] = BAD[rng.integers(len(BAD))]
    return replace(mesh, points=points)


def all_places(rng, mesh):
    """All nodes at one place, in one plane, or very far away."""
    by = [(0, 0, 0), (1, 0, 1), (1, 1, 0), (1e160, 1, 1), (1e-200, 1e-200, 1e-200)][rng.integers(5)]
    with np.errstate(all="ignore"):  # places may be infinite already
        return replace(mesh, points=mesh.points * by)


def nodes_of_cells(rng, mesh):
    """Some cells list other nodes, repeated ones too."""
    blocks = []
    for b in mesh.blocks:
        nodes = b.nodes.copy()
        for _ in range(int(rng.integers(3)) if len(nodes) else 0):
            nodes[rng.integers(len(nodes)), rng.integers(nodes.shape[1])] = rng.integers(mesh.n_nodes)
        blocks.append(b._replace(nodes=nodes))
    return replace(mesh, blocks=tuple(blocks))


def numbers(rng, mesh):
    cell, node = mesh.cell_number.astype(np.int64), mesh.node_number.astype(np.int64)
    for values in (cell, node):
        if len(values):
            values[rng.integers(len(values))] = rng.integers(-3, 5)
    return replace(mesh, cell_number=cell, node_number=node)


def groups(rng, mesh):
    """Groups of any cells, empty ones, of every dimension."""
    some = {n: np.flatnonzero(rng.random(mesh.n_cells) < rng.random()) for n in ("slave", "master", "more", "fixed")}
    return replace(mesh, cell_groups={**mesh.cell_groups, **some, "none": np.empty(0, np.int64)})


def records(rng, mesh):
    """Data that resemble the records of a cut but are not."""
    data = {k: rng.integers(-1, 4, mesh.n_cells) for k in ("lac_macro", "lac_zone", "lac_child") if rng.random() < 0.8}
    return replace(mesh, cell_data={**mesh.cell_data, **data}, zones=("slave",) * int(rng.integers(3)))


def cells(rng, mesh, *more):
    """Some types of cells gone, copies of some cells, and others."""
    some = [(b.type, np.concatenate([b.nodes, b.nodes[: rng.integers(4)]])) for b in mesh.blocks if rng.random() < 0.8]
    total = sum(len(nodes) for _, nodes in (*some, *more))
    groups = {name: own[own < total] for name, own in mesh.cell_groups.items()}
    return Mesh.create(mesh.points, [*some, *more], cell_groups=groups, space_dim=mesh.space_dim)


def higher_order(rng, mesh):
    """Cells of order 3, on nodes of the mesh."""
    kind = ("SEG4", "TRIA10", "QUAD16", "TETRA20", "HEXA64", "PENTA40", "PYRAM30")[rng.integers(7)]
    if any(b.type == kind for b in mesh.blocks) or not mesh.n_nodes:
        return mesh
    made = cells(rng, mesh, (kind, rng.integers(mesh.n_nodes, size=(2, ALL_CELLS[kind].n_nodes))))
    return replace(made, cell_groups={**made.cell_groups, "slave": np.arange(made.n_cells - 2, made.n_cells)})


def other_space(rng, mesh):
    return replace(mesh, space_dim=5 - mesh.space_dim)


MANGLES = [places, all_places, nodes_of_cells, numbers, groups, records, cells, higher_order, other_space]


def asked(rng, mesh):
    """Groups of the mesh as slave, master and Dirichlet groups."""
    names = list(mesh.cell_groups)
    pick = lambda k: [names[i] for i in rng.integers(len(names), size=k)]  # noqa: E731
    usual = "slave" in names and rng.random() < 0.6
    slave = ["slave"] if usual else pick(int(rng.integers(1, 3)))
    master = ["master"] if usual and "master" in names else pick(int(rng.integers(0, 3)))
    held = pick(int(rng.integers(0, 2)))
    if len(slave) > 1 and len(master) > 1:
        return {"pairs": list(zip(slave, master, strict=True)), "dirichlet": held}
    return {"slave": slave, "master": master, "dirichlet": held}


@pytest.mark.fuzz
def test_mangled_meshes():
    rules = set()
    for seed in range(samples(75, 500)):
        rng = np.random.default_rng([7, seed])
        mesh = base(rng)
        for _ in range(int(rng.integers(1, 4))):
            mesh = MANGLES[rng.integers(len(MANGLES))](rng, mesh)
        if not mesh.cell_groups:
            mesh = replace(mesh, cell_groups={"slave": np.arange(mesh.n_cells)})
        found = check(mesh, **asked(rng, mesh))
        assert "not-checked" not in found.rules, (seed, [f.message for f in found.of_rule("not-checked")])
        json.dumps(found.as_dict(), allow_nan=False)
        assert found.summary["ok"] == (not found.errors)
        rules |= set(found.rules)
    assert len(rules) > 30, "the mangling is too gentle"


def test_a_part_that_fails_says_so_and_the_others_go_on(monkeypatch):
    def broken(subject):
        raise ZeroDivisionError("by nothing")

    monkeypatch.setattr("lacmesh.checks.skins.edge_uses", broken)
    found = check(two_blocks(), "slave", "master")
    assert "not-checked" in found.rules and "not-cut" in found.rules
    assert "by nothing" in found.of_rule("not-checked")[0].message


@pytest.mark.parametrize(
    ("ask", "error"),
    [
        ({"slave": "slvae"}, GroupNotFoundError),
        ({"slave": "slave", "master": "mastre"}, GroupNotFoundError),
        ({"slave": "slave", "dirichlet": "fixde"}, GroupNotFoundError),
        ({"slave": []}, RequestError),
        ({}, RequestError),
        ({"slave": "slave", "master": "master", "axisymmetric": True}, RequestError),
        ({"slave": "slave", "master": "master", "search_distance": -1.0}, RequestError),
    ],
)
def test_what_was_asked_wrongly_is_an_error_of_status_2(ask, error):
    with pytest.raises(error) as caught:
        check(two_blocks(), **ask)
    assert caught.value.status == 2
