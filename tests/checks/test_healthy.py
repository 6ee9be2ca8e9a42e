"""Nothing is said against healthy meshes: every type, before and after the cut, curved, closed, warped, cut off."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
from lacmesh import cut_skin, generate, orient
from lacmesh.cells import CELLS
from lacmesh.checks import check
from lacmesh.cutting.patterns import WHOLE_FACES
from lacmesh.generate.parts import SEAM, sew
from tests.checks.blocks import SOLIDS, cut_blocks, two_blocks
from tests.samples import each_option

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


def ring(x):
    """The first parameter goes round, the last outward."""
    angle, r = -2 * np.pi * x[0], 3 + x[1]
    return [r * np.cos(angle), r * np.sin(angle)]


def arc(x):
    """A quarter of a ring, which ends at symmetry lines."""
    angle, r = np.pi / 2 * x[0], 3 + x[1]
    return [r * np.sin(angle), r * np.cos(angle)]


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
EVERY = pytest.mark.parametrize(
    "name", each_option([(name,) for name in SOLIDS], of=lambda row: [CELLS[row[0]].family])
)


#: every type in every shape, the largest of which is tried with one type of each family and order
IN_SHAPES = [(name, shape) for name in SOLID for shape in SHAPES if shape is not torus]
IN_SHAPES += [(name, torus) for name in ("HEXA8", "TETRA10", "HEXA20", "PENTA6", "PYRAM13")]


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
    quarter = layers(name, (4, 2), (5, 2), 0.05).moved(arc)
    all_well_before_and_after(quarter, held=("left", "right"), axisymmetric=axisymmetric)
    blocks = two_blocks(name, reach=0.2)
    elsewhere = replace(blocks, points=blocks.points + np.array([0, 0, 7.0]), space_dim=3)
    all_well_before_and_after(elsewhere, held=("fixed",))


@pytest.mark.parametrize("name", SOLIDS)
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


@EVERY
def test_skins_that_touch(name):
    """Slave and master at one place, node on node, where nothing is known of the master and where it is."""
    mesh = two_blocks(name, gap=0.0, matching=True)
    for master in ("master", None):
        all_well_before_and_after(mesh, master=master, held=("fixed",))


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
