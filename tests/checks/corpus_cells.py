"""Broken meshes: numbers, places, cells, and how these fit together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lacmesh import Mesh, cut_skin
from lacmesh.cells import CELLS
from tests.checks.blocks import block, cut_blocks, join, skin
from tests.checks.corpus import at, changed, defect, merged, moved, of_type


@defect("no-cells", slave="line", master=None)
def only_lines():
    return Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])], cell_groups={"line": [0]})


@defect("no-cells", slave="none", master=None)
def nothing_at_all():
    return Mesh.create(np.zeros((0, 3)), [], cell_groups={"none": []})


@defect("not-finite")
def a_coordinate_that_is_no_number():
    mesh = cut_blocks()
    return moved(mesh, at(mesh, 0.33, 0.33, 1.67), np.nan)


@defect("not-finite")
def an_infinite_coordinate():
    mesh = cut_blocks("TETRA10")
    return moved(mesh, at(mesh, 0.33, 0.33, 1.67), np.inf)


@defect("repeated-number")
def two_cells_of_one_number():
    mesh = cut_blocks()
    number = mesh.cell_number.copy()
    number[3] = number[7]
    return replace(mesh, cell_number=number)


@defect("repeated-number")
def a_negative_node_number():
    mesh = cut_blocks()
    number = mesh.node_number.copy()
    number[-1] = -4
    return replace(mesh, node_number=number)


@defect("repeated-node")
def a_hexahedron_that_lists_a_node_twice():
    mesh = cut_blocks()
    rows, nodes = of_type(mesh, "HEXA8", "body1")
    last = nodes[-1].copy()
    last[6] = last[7]
    return changed(mesh, "HEXA8", rows[-1], last)


@defect("repeated-cell")
def the_same_hexahedron_twice():
    mesh = cut_blocks()
    _, nodes = of_type(mesh, "HEXA8", "body1")
    return changed(mesh, add=[("HEXA8", nodes[-1], ["body1"])])


@defect("repeated-cell")
def a_cell_inside_the_body_listed_again_from_another_corner():
    mesh = cut_blocks("TETRA4")
    _, nodes = of_type(mesh, "TETRA4", "body1")
    return changed(mesh, add=[("TETRA4", nodes[80][[1, 2, 0, 3]], ["body1"])])


@defect("invalid-cell")
def a_node_pushed_through_its_cells():
    mesh = cut_blocks()
    return moved(mesh, at(mesh, 1 / 3, 1 / 3, 1 + 2 / 3), [0.5, 0.5, 0.0])


@defect("invalid-cell")
def a_mid_node_beyond_the_quarter_of_its_edge():
    mesh = cut_blocks("TETRA10")
    mid = mesh.block("TETRA10")[of_type(mesh, "TETRA10", "body1")[0][-1]]
    a, b = mesh.points[mid[0]], mesh.points[mid[1]]
    return moved(mesh, mid[4], 0.4 * (b - a))


@defect("invalid-cell")
def a_flat_tetrahedron():
    mesh = cut_blocks("TETRA4")
    corner = at(mesh, 1, 1, 2.01)
    points = np.vstack([mesh.points, mesh.points[corner] + [0.3, 0.0, 0.0], mesh.points[corner] + [0.0, 0.3, 0.0]])
    points = np.vstack([points, mesh.points[corner] + [0.3, 0.3, 0.0]])
    n = mesh.n_nodes
    return changed(mesh, points=points, add=[("TETRA4", [corner, n, n + 1, n + 2], ["body1"])])


@defect("inverted-cell")
def a_hexahedron_inside_out():
    mesh = cut_blocks()
    rows, nodes = of_type(mesh, "HEXA8", "body1")
    return changed(mesh, "HEXA8", rows[-1], nodes[-1][[4, 5, 6, 7, 0, 1, 2, 3]])


@defect("inverted-cell")
def a_quadratic_tetrahedron_inside_out():
    mesh = cut_blocks("TETRA10")
    rows, nodes = of_type(mesh, "TETRA10", "body1")
    return changed(mesh, "TETRA10", rows[90], nodes[90][[0, 2, 1, 3, 6, 5, 4, 7, 9, 8]])


@defect("clockwise-cell")
def a_plane_cell_listed_clockwise():
    mesh = cut_blocks("QUAD4")
    rows, nodes = of_type(mesh, "QUAD4", "body1")
    return changed(mesh, "QUAD4", rows[-1], nodes[-1][[0, 3, 2, 1]])


@defect("poor-cell")
def a_cell_almost_flat():
    mesh = cut_blocks()
    return moved(mesh, at(mesh, 1, 1, 2.01), np.full(3, -0.32 / 3))  # at 1/3 the corner is flat


@defect("crowded-facet")
def a_third_cell_on_a_facet():
    mesh = cut_blocks()
    _, nodes = of_type(mesh, "HEXA8", "body1")
    inner = nodes[0][list(CELLS["HEXA8"].facets[5].nodes)]
    points = np.vstack([mesh.points, mesh.points[inner].mean(axis=0) + np.array([0, 0, 0.1])])
    return changed(mesh, points=points, add=[("PYRAM5", [*inner, mesh.n_nodes], ["body1"])])


@defect("overlapping-cells")
def two_cells_on_one_side_of_a_facet():
    mesh = cut_blocks()
    _, nodes = of_type(mesh, "HEXA8", "body1")
    top = nodes[-1][list(CELLS["HEXA8"].facets[5].nodes)][::-1]
    points = np.vstack([mesh.points, mesh.points[top].mean(axis=0) - [0, 0, 0.1]])
    return changed(mesh, points=points, add=[("PYRAM5", [*top, mesh.n_nodes], ["body1"])])


@defect("mid-nodes-differ")
def a_mid_node_of_its_own():
    mesh = cut_blocks("HEXA20")
    rows, nodes = of_type(mesh, "HEXA20", "body1")
    mine = nodes[13].copy()
    points = np.vstack([mesh.points, mesh.points[mine[8]]])
    mine[8] = mesh.n_nodes
    return changed(mesh, "HEXA20", rows[13], mine, points=points)


@defect("mid-nodes-differ")
def a_slave_face_with_a_mid_node_of_its_own():
    mesh = cut_blocks("TETRA10")
    rows, nodes = of_type(mesh, "TRIA6", "slave")
    mine = nodes[0].copy()
    points = np.vstack([mesh.points, mesh.points[mine[3]]])
    mine[3] = mesh.n_nodes
    return changed(mesh, "TRIA6", rows[0], mine, points=points)


@defect("mid-nodes-differ")
def linear_beside_quadratic():
    mesh = cut_blocks("HEXA20")
    _, nodes = of_type(mesh, "HEXA20", "body1")
    return changed(mesh, drop=[mesh.cell_groups["body1"][-1]], add=[("HEXA8", nodes[-1][:8], ["body1"])])


@defect("torn-body")
def a_node_inside_an_edge_away_from_the_skins():
    low = block((2, 2, 2), (0, 0, 0), (1, 1, 1))
    high = block((2, 2, 2), (0, 0, 1.01), (1, 1, 2))
    on = lambda z: lambda x: np.abs(x[..., 2] - z) < 1e-9  # noqa: E731
    fine = block((4, 2, 2), (0, 0, 2), (1, 1, 3))
    mesh = join([(*low, {"slave": skin(*low, on(1))}), (*high, {"master": skin(*high, on(1.01))}), (*fine, {})])
    return cut_skin(merged(mesh), "slave").mesh


@defect("coincident-nodes")
def a_body_torn_along_a_plane():
    mesh = cut_blocks()
    rows, nodes = of_type(mesh, "HEXA8", "body1")
    upper = mesh.points[nodes].mean(axis=1)[:, 2] > 1.4
    torn = np.unique(nodes[upper])
    torn = torn[(np.abs(mesh.points[torn, 2] - (1.01 + 1 / 3)) < 1e-9) & (mesh.points[torn, 0] < 0.5)]
    new = np.arange(mesh.n_nodes)
    new[torn] = mesh.n_nodes + np.arange(len(torn))
    return changed(mesh, "HEXA8", rows[upper], new[nodes[upper]], points=np.vstack([mesh.points, mesh.points[torn]]))


@defect("unreferenced-node")
def a_node_of_no_cell():
    mesh = cut_blocks()
    return changed(mesh, points=np.vstack([mesh.points, [5.0, 5.0, 5.0]]))
