"""Nothing is said against healthy meshes: every type, before and after the cut, curved, closed, warped, cut off."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from lacmesh import cut_skin, orient
from lacmesh.cells import CELLS
from lacmesh.checks import check
from lacmesh.cutting.patterns import WHOLE_FACES
from tests.checks import healthy
from tests.checks.blocks import SOLIDS, cut_blocks, two_blocks
from tests.samples import each_option

PLANE = [name for name in SOLIDS if CELLS[name].dim == 2]
SOLID = [name for name in SOLIDS if CELLS[name].dim == 3]
#: shape -> how many cells of the two bodies, gap, reach of the master, groups that are held
SHAPES = {
    "tube": ((12, 2, 1), (14, 3, 1), 0.2, 0.0, ("end10", "end11")),
    "torus": ((28, 12, 1), (30, 13, 1), 0.2, 0.0, ()),
    "quarter": ((5, 4, 1), (6, 5, 1), 0.05, 0.0, ("end00", "end01", "end10", "end11")),
    "dome": ((3, 3, 2), (4, 4, 2), 0.05, 0.2, ("end00", "end01", "end10", "end11")),
    "turned": ((2, 2, 2), (3, 3, 3), 0.05, 0.0, ("end00", "end11")),
}


def all_well(mesh, slave, master=None, held=(), but=(), **options):
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


#: every type, one of each family in short
EVERY = pytest.mark.parametrize(
    "name", each_option([(name,) for name in SOLIDS], of=lambda row: [CELLS[row[0]].family])
)


#: every type in every shape, the largest of which is tried with one type of each family and order
IN_SHAPES = [(name, shape) for name in SOLID for shape in SHAPES if shape != "torus"]
IN_SHAPES += [(name, "torus") for name in ("HEXA8", "TETRA10", "HEXA20", "PENTA6", "PYRAM13")]


@pytest.mark.parametrize(("name", "shape"), each_option(IN_SHAPES))
def test_bodies_of_other_shapes(name, shape):
    n, m, gap, reach, held = SHAPES[shape]
    mesh = healthy.bent(healthy.layers(name, n, m, gap, reach), getattr(healthy, shape))
    # where a twisted prism or a slender tetrahedron is cut, the children are as poor as the check says
    all_well_before_and_after(mesh, held=held, but=("poor-cell",) if shape == "torus" else ())


@pytest.mark.parametrize(("name", "axisymmetric"), each_option(itertools.product(PLANE, (False, True))))
def test_plane_bodies(name, axisymmetric):
    ring = healthy.bent(healthy.layers(name, (12, 2), (16, 2), 0.2), healthy.ring)
    shifted = replace(ring, points=ring.points + np.array([10, 0, 0]))
    all_well_before_and_after(shifted, axisymmetric=axisymmetric)
    quarter = healthy.bent(healthy.layers(name, (4, 2), (5, 2), 0.05), healthy.arc)
    all_well_before_and_after(quarter, held=("end00", "end01"), axisymmetric=axisymmetric)
    all_well_before_and_after(healthy.plane_elsewhere(two_blocks(name, reach=0.2)), held=("fixed",))


@EVERY
def test_a_skin_that_goes_all_round(name):
    all_well_before_and_after(healthy.all_round(name), master=None)


@EVERY
def test_one_body_that_meets_itself(name):
    all_well_before_and_after(healthy.slot(name))


@EVERY
def test_skins_that_touch(name):
    """Slave and master at one place, node on node, where nothing is known of the master and where it is."""
    mesh = two_blocks(name, gap=0.0, matching=True)
    for master in ("master", None):
        all_well_before_and_after(mesh, master=master, held=("fixed",))


@EVERY
def test_orientation_is_healed(name):
    mesh = two_blocks(name, reach=0.2)
    all_well(orient(orient(cut_blocks(name, reach=0.2), "slave"), "master"), "slave", "master")
    all_well_before_and_after(orient(mesh, "slave"))
