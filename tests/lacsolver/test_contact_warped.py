"""Slave faces that are slightly warped: forces are continuous as faces bend, and a mirrored model answers mirrored."""

from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh
from lacsolver.case import parse_case
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem

#: fifteen slave faces, warped by 0.01 (z - 0.4)^2 at most, over six flat master faces
MESH = Path(__file__).with_name("meshes") / "warped.msh"
CASE = """mesh = "warped.msh"
model = "3d"
kinematics = "finite"
[[material]]
young = 2000.0
poisson = 0.3
law = "neo_hookean"
[[contact]]
slave = "up.y0"
master = "lo.y1"
hexa = "hexa"
normals = "{normals}"
[[displacement]]
group = "lo.y0"
ux = 0.0
uy = 0.0
uz = 0.0
[[displacement]]
group = "up.y1"
ux = 0.01
uy = -0.02
uz = {uz}
"""
#: nodes of the cells of the mirrored mesh
REVERSED = {"HEXA8": [1, 0, 3, 2, 5, 4, 7, 6], "QUAD4": [1, 0, 3, 2]}


def solved(mesh, normals, uz):
    problem = Problem.of(parse_case(CASE.format(normals=normals, uz=uz)), mesh)
    (state,) = march(problem)
    return state.iterations, state.zones[0]


@pytest.mark.parametrize("normals", ["facet", "smoothed"])
def test_warped_faces_converge_and_mirrored_ones_answer_mirrored(normals):
    mesh = lacmesh.read(MESH)
    over = np.array([1.0, 1.0, -1.0])
    blocks = [(block.type, block.nodes[:, REVERSED[block.type]]) for block in mesh.blocks]
    mirrored = Mesh.create(mesh.points * over, blocks, cell_groups=mesh.cell_groups)
    iterations, zone = solved(mesh, normals, 0.004)
    again, other = solved(mirrored, normals, -0.004)
    assert iterations <= 6 and again == iterations
    order = [int(((other.centre * over - centre) ** 2).sum(axis=1).argmin()) for centre in zone.centre]
    assert sorted(order) == list(range(15))
    assert np.abs(other.pressure[order] - zone.pressure).max() < 1e-11 * zone.pressure.max()
    assert np.abs(other.gap[order] - zone.gap).max() < 1e-11
