"""Broken meshes: macro-elements without a free internal dof, and slaves and masters that do not meet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lacmesh import cut_skin
from tests.checks.blocks import cut_blocks, two_blocks
from tests.checks.corpus import at, changed, defect, reversed_group, without_records


@defect("not-cut")
def a_mesh_that_is_not_cut():
    return two_blocks("TETRA4")


@defect("not-cut", slave="slave", master=None)
def a_single_face_that_is_not_cut():
    return two_blocks("QUAD4", n=1)


@defect("rim-dof")
def macro_elements_with_dofs_on_the_rim_only():
    return macro_elements_of_one_face(2)


@defect("no-internal-dof", also=("rim-dof",))
def a_macro_element_of_one_face_inside_the_skin():
    return macro_elements_of_one_face(3)


def macro_elements_of_one_face(n):
    """Records of a cut in which each slave face, of n in a row, is a macro-element."""
    mesh = two_blocks("HEXA8", n=n)
    faces = mesh.cell_groups["slave"]
    macro, zone, child = (np.full(mesh.n_cells, -1, np.int32) for _ in range(3))
    macro[faces], zone[faces], child[faces] = np.arange(len(faces)), 0, 1
    records = {"lac_macro": macro, "lac_zone": zone, "lac_child": child}
    return replace(mesh, cell_data=records, zones=("slave",))


@defect("fixed-internal-dof", dirichlet=["held"])
def internal_dofs_that_are_held():
    mesh = cut_blocks("TETRA10")
    return changed(mesh, groups={"held": set(mesh.cell_groups["slave"][:6].tolist())})


@defect("recognised", recognise=True)
def a_cut_without_records():
    return without_records(cut_blocks("HEXA20", "hexa"))


@defect("half-cut", also=("no-internal-dof", "no-coverage"), slave=["slave", "loaded"], master="master")
def a_cut_of_another_group_only():
    return cut_blocks()


@defect("broken-records")
def records_of_no_cut():
    mesh = cut_blocks()
    zone = mesh.cell_data["lac_zone"].copy()
    zone[mesh.cell_groups["slave"][0]] = 7
    return replace(mesh, cell_data={**mesh.cell_data, "lac_zone": zone})


def recorded(mesh, **changes):
    """A cut with other records: name -> (cells or nodes, values)."""
    data = {**mesh.cell_data, **mesh.node_data}
    for name, (where, values) in changes.items():
        data[name] = data[name].copy()
        data[name][where] = values
    cells = {name: data[name] for name in mesh.cell_data}
    return replace(mesh, cell_data=cells, node_data={name: data[name] for name in mesh.node_data})


@defect("broken-records")
def an_internal_dof_recorded_at_a_vertex():
    mesh = cut_blocks()
    internal = mesh.node_data["lac_internal"]
    vertex = at(mesh, 0.5, 0.5, 1)
    node = np.flatnonzero(internal == 0)
    return recorded(mesh, lac_internal=([*node, vertex], [-1] * len(node) + [0]))


@defect("broken-records")
def an_internal_dof_recorded_at_a_vertex_of_the_rim():
    mesh = cut_blocks("TETRA4")
    faces = np.flatnonzero(mesh.cell_data["lac_macro"] == mesh.cell_data["lac_macro"].max())
    nodes = np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(faces)]))
    corner = nodes[np.abs(mesh.points[nodes, :2] - 0.5).min(axis=1).argmax()]
    number = mesh.cell_data["lac_macro"][faces[0]]
    centre = np.flatnonzero(mesh.node_data["lac_internal"] == number)
    return recorded(mesh, lac_internal=([*centre, corner], [-1] * len(centre) + [number]))


@defect("broken-records")
def internal_dofs_that_are_not_recorded():
    mesh = cut_blocks("QUAD8")
    return replace(mesh, node_data={})


@defect("broken-records")
def faces_of_macro_elements_that_are_all_the_first():
    mesh = cut_blocks()
    return recorded(mesh, lac_child=(mesh.cell_groups["slave"], 1))


@defect("broken-records", slave=["slave", "master"], master=None)
def macro_elements_of_two_bodies_with_one_number():
    mesh = cut_skin(two_blocks("TETRA4"), ["slave", "master"]).mesh
    macro = mesh.cell_data["lac_macro"]
    return recorded(mesh, lac_macro=(macro == macro.max(), 0))


@defect("broken-records", slave=["slave", "master"], master=None)
def a_macro_element_in_two_zones():
    mesh = cut_skin(two_blocks("QUAD4"), ["slave", "master"]).mesh
    return recorded(mesh, lac_zone=(np.flatnonzero(mesh.cell_data["lac_macro"] == 0)[:1], 1))


@defect("broken-records")
def a_huge_number_of_a_macro_element():
    mesh = cut_blocks("TETRA10")
    return recorded(mesh, lac_macro=(mesh.cell_data["lac_macro"] == 3, 10**9))


@defect("no-coverage", master="loaded")
def the_wrong_master():
    return cut_blocks()


@defect("no-coverage", slave=["slave", "fixed"])
def one_zone_of_two_that_faces_nothing():
    return cut_skin(two_blocks("QUAD4", reach=0.2), ["slave", "fixed"]).mesh


@defect("no-coverage")
def a_bare_master_that_turns_its_back():
    mesh = reversed_group(cut_blocks(), "master")
    return changed(mesh, drop=mesh.cell_groups["body1"])


@defect("wrong-side")
def a_bare_master_of_which_a_part_turns_its_back():
    mesh = cut_blocks("HEXA27", n=3, matching=True)
    half = {int(c) for c in mesh.cell_groups["master"][:3]}
    bare = changed(mesh, drop=mesh.cell_groups["body1"])
    assert len(half) == 3
    turned = replace(bare, cell_groups={**bare.cell_groups, "some": bare.cell_groups["master"][:3]})
    return reversed_group(turned, "some")


@defect("wrong-side")
def a_master_deep_inside_the_slave():
    return cut_blocks(gap=-0.4, n=3, m=2, reach=0.1)


@defect("wrong-side", also=("no-coverage",))
def a_master_too_deep_to_be_seen():
    return cut_blocks(gap=-0.6, n=3, m=2, reach=0.1)


@defect("partial-coverage")
def a_master_smaller_than_the_slave():
    return cut_blocks(reach=-0.1)


@defect("size-ratio")
def a_master_much_finer_than_the_slave():
    return cut_blocks("QUAD4", n=2, m=14)


@defect("size-ratio")
def a_master_much_coarser_than_the_slave():
    return cut_blocks("QUAD4", n=14, m=2)


@defect("better-slave")
def a_master_finer_than_the_slave():
    return cut_blocks(n=2, m=5)


@defect("facing-left-out")
def segments_in_a_tilted_plane():
    mesh = cut_blocks("QUAD9")
    points = mesh.points.copy()
    points[:, 2] = points[:, 0]
    return replace(mesh, points=points, space_dim=3)
