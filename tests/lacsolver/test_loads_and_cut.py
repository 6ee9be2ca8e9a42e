"""Forces and springs at nodes do not hang on the cut: their totals are those of the mesh before it."""

from dataclasses import replace

import numpy as np
import pytest

import lacmesh
from lacmesh.cells import CELLS
from lacsolver import CaseError
from lacsolver.case import parse_case
from lacsolver.problem.problem import Problem
from lacsolver.space.cut_nodes import made_by_cut
from tests.samples import each_option
from verification.meshes.blocks import BLOCK_TYPES, block, joined

CUTS = [(kind, hexa) for kind in BLOCK_TYPES for hexa in ("pyramid", "hexa")[: 1 + kind.startswith("HEXA")]]
RECORDS = """
mesh = "blocks.msh"
model = "{model}"
[[material]]
young = 1.0
poisson = 0.0
[[contact]]
slave = "slave"
master = "master"
hexa = "{hexa}"
[[force]]
group = "slave"
fx = 2.0
[[force]]
group = "nodes"
fy = 3.0
[[spring]]
group = "slave"
kx = 5.0
"""


def blocks(kind):
    """Two blocks with a slave between them, and its nodes as a group of nodes as well."""
    dim = CELLS[kind].dim
    up, side = [0.0] * (dim - 1) + [1.0], [1.0] * dim
    low = block(kind, 2, [0.0] * dim, side)
    high = block(kind, 2, up, [a + b for a, b in zip(up, side, strict=True)])
    name = "xyz"[dim - 1]
    mesh = joined([(low, {f"{name}1": "master"}), (high, {f"{name}0": "slave"})])
    nodes = np.unique(np.concatenate([part.ravel() for _, _, part in mesh.select(mesh.cell_groups["slave"])]))
    return lacmesh.Mesh.create(
        mesh.points, [(b.type, b.nodes) for b in mesh.blocks], space_dim=dim, cell_groups=mesh.cell_groups,
        node_groups={"nodes": nodes},
    ), len(nodes)  # fmt: skip


@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
@pytest.mark.parametrize(("kind", "hexa"), each_option(CUTS, of=lambda row: [(CELLS[row[0]].dim, row[1])]))
def test_totals_are_those_before_the_cut(tmp_path, kind, hexa):
    mesh, count = blocks(kind)
    model = "3d" if CELLS[kind].dim == 3 else "plane_strain"
    case = parse_case(RECORDS.format(model=model, hexa=hexa))
    cut = lacmesh.cut_skin(mesh, "slave", hexa=hexa).mesh
    lacmesh.write(tmp_path / "cut.msh", cut)
    assert np.array_equal(np.flatnonzero(made_by_cut(cut)), np.arange(mesh.n_nodes, cut.n_nodes))
    for given in (mesh, lacmesh.read(tmp_path / "cut.msh")):
        problem = Problem.of(case, given)
        f = problem.load(1.0).reshape(-1, problem.space.dim)
        assert f.sum(axis=0)[:2] == pytest.approx([2.0 * count, 3.0 * count])
        assert not f[made_by_cut(problem.space.mesh)].any()
        assert problem.springs.sum() == pytest.approx(5.0 * count)


@pytest.mark.parametrize("kind", ["HEXA8", "TETRA10", "QUAD4"])
def test_a_cut_that_was_recognised(kind):
    """Without the records of parents the new nodes on slave faces are those inside macro-elements."""
    mesh, count = blocks(kind)
    cut = lacmesh.cut_skin(mesh, "slave", hexa="hexa").mesh
    bare = replace(cut, cell_data={}, node_data={}, zones=())
    known = lacmesh.recognise(bare, ["slave"]).mesh
    case = parse_case(RECORDS.format(model="3d" if CELLS[kind].dim == 3 else "plane_strain", hexa="hexa"))
    f = Problem.of(case, known).load(1.0).reshape(-1, known.dim)
    assert f.sum(axis=0)[:2] == pytest.approx([2.0 * count, 3.0 * count])


def test_a_group_of_new_nodes_alone():
    mesh, _ = blocks("HEXA8")
    cut = lacmesh.cut_skin(mesh, "slave", hexa="hexa").mesh
    groups = {**cut.node_groups, "nodes": np.flatnonzero(made_by_cut(cut))}
    case = parse_case(RECORDS.format(model="3d", hexa="hexa"))
    with pytest.raises(CaseError, match="force: the group 'nodes' has only nodes that the cut made"):
        Problem.of(case, replace(cut, node_groups=groups)).load(1.0)
