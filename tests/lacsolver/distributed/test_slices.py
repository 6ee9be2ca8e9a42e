"""Parts that processes read by slices are those of the whole mesh; what cannot be read is told as by one process."""

from __future__ import annotations

import json
import shutil
import warnings
from dataclasses import replace

import h5py
import numpy as np
import pytest

from lacmesh import Mesh, cut_skin, read, write
from lacmesh.errors import DataError, ReadError
from lacmesh.formats.ids import counts_up
from lacmesh.partition import distribute_nodes
from lacsolver.cli import main as solver_main
from tests.lacsolver.distributed.allocations import box
from tests.lacsolver.distributed.mpi import ROOT, commands, own_lines, printed
from tests.meshes import random_mesh
from verification.meshes.blocks import joined

pytestmark = pytest.mark.petsc


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A folder of MED and msh files: whole, odd, damaged, and one of each in `large`."""
    folder = tmp_path_factory.mktemp("files")
    (folder / "large").mkdir()
    for name, mesh in sound():
        write(folder / f"{name}.med", mesh)
        write(folder / f"{name}.msh", mesh)
    shutil.copy(ROOT / "tests" / "reference" / "two_boxes_gmsh.msh", folder)
    blocks = read(ROOT / "data" / "two_blocks.msh")
    of_one_entity = {**blocks.node_data, "entity": np.tile([3, 1], (blocks.n_nodes, 1))}
    counted = replace(blocks, node_data=of_one_entity, node_number=np.arange(blocks.n_nodes) + 1)
    write(folder / "counted.msh", counted)
    write(folder / "skins_of_second_body.med", twice(read(folder / "random_0.med"), grouped=1))
    for name, change in CHANGES.items():
        shutil.copy(folder / "blocks.med", folder / f"{name}.med")
        with h5py.File(folder / f"{name}.med", "r+") as file:
            change(file, next(iter(next(iter(file["ENS_MAA"].values())).values())))
    for name, change in MSH_CHANGES.items():
        content = bytearray((folder / "blocks.msh").read_bytes())
        change(content)
        (folder / f"{name}.msh").write_bytes(content)
    write(folder / "ascii.msh", read(folder / "blocks.msh"), binary=False)
    return folder


def sound():
    """Names and meshes that are written in both formats."""
    blocks = read(ROOT / "data" / "two_blocks.msh")
    yield "blocks", blocks
    yield "blocks_cut", cut_skin(blocks, "slave").mesh
    hexahedra = joined([(column_of(24, -6.0, 0.0), {"z1": "master"}), (column_of(12, 0.0, 3.0), {"z0": "slave"})])
    yield "hexahedra_cut", cut_skin(hexahedra, "slave", hexa="hexa").mesh
    for seed in range(4):
        rng = np.random.default_rng(seed)
        mesh = random_mesh(rng, dim=2 + seed % 2, order=1 + seed // 2, interior=seed % 3 == 0, twins=True)
        yield f"random_{seed}", twice(mesh) if seed % 2 else mesh
    column = [(column_of(800, -200.0, 0.0), {"z1": "master"}), (column_of(4, 0.0, 1.0), {"z0": "slave"})]
    mesh = joined(column)
    yield "large/column", replace(mesh, node_number=np.random.default_rng(1).permutation(mesh.n_nodes) + 5)


def twice(mesh, grouped=0):
    """A mesh and a copy of it, apart from it, whose numbers follow; groups of cells in both, or in the copy alone."""
    n, counts = mesh.n_nodes, np.diff(mesh.offsets)
    first = np.arange(mesh.n_cells) + np.repeat(mesh.offsets[:-1], counts)
    second = first + np.repeat(counts, counts)
    order = np.argsort(np.concatenate([first, second]))
    number = np.concatenate([mesh.cell_number, mesh.cell_number + mesh.cell_number.max()])
    return Mesh.create(
        np.vstack([mesh.points, mesh.points + np.array([5.0, 0.0, 0.0])]),
        [(b.type, np.concatenate([b.nodes, b.nodes + n])) for b in mesh.blocks],
        space_dim=mesh.space_dim,
        node_number=np.concatenate([mesh.node_number, mesh.node_number + mesh.node_number.max()]),
        cell_number=number[order],
        cell_groups={
            name: np.concatenate([first[ids], second[ids]][grouped:]) for name, ids in mesh.cell_groups.items()
        },
        node_groups={name: np.concatenate([ids, ids + n]) for name, ids in mesh.node_groups.items()},
        cell_data={name: np.concatenate([v, v])[order] for name, v in mesh.cell_data.items()},
        node_data={name: np.concatenate([v, v]) for name, v in mesh.node_data.items()},
    )


def column_of(layers, low, high):
    """A column of 4 by 4 HEXA8 between two heights."""
    return box((4, 4, layers), low, high)


def repeat_numbers(file, step):
    """Give the first and the last node one number, and likewise the cells of a type."""
    step["NOE/NUM"][-1] = step["NOE/NUM"][0]
    part = next(iter(step["MAI"].values()))
    part["NUM"][-1] = part["NUM"][0]


def move_to_one_place(file, step):
    """Give all nodes the same coordinates."""
    step["NOE/COO"][:] = 1.0


def make_huge(file, step):
    """Give two nodes coordinates whose difference is not finite."""
    step["NOE/COO"][[5, 400]] = 1.7e308, -1.6e308


def leave_families_out(file, step):
    """Remove the families of the cells."""
    del next(iter(file["FAS"].values()))["ELEME"]


def forget_zones(file, step):
    """Record a cut without the names of its zones."""
    if "LACMESH" in file:
        del file["LACMESH"]
    field = file.require_group("CHA").create_group("lac_macro")
    field.attrs.update({"NCO": np.int32(1), "MAI": np.bytes_(next(iter(file["ENS_MAA"])))})
    support = field.create_group("x")
    support.attrs.update({"NDT": np.int32(-1), "NOR": np.int32(-1)})
    kind, part = next(iter(step["MAI"].items()))
    leaf = support.create_group(f"MAI.{kind}/MED_NO_PROFILE_INTERNAL")
    leaf["CO"] = np.zeros(len(part["FAM"]), np.int32)


def add_a_stray_node(file, step):
    """Let the last cell of a type have a node that is not there."""
    list(step["MAI"].values())[-1]["NOD"][-1] = 10**6


def lose_a_coordinate(file, step):
    """Let a coordinate be no number."""
    step["NOE/COO"][100] = np.nan


def cut_families_short(file, step):
    """Leave the last family of the nodes out."""
    families = step["NOE/FAM"][:-1]
    del step["NOE/FAM"]
    step["NOE/FAM"] = families


CHANGES = {
    "repeated_numbers": repeat_numbers,
    "one_place": move_to_one_place,
    "huge": make_huge,
    "no_families": leave_families_out,
    "unnamed_zones": forget_zones,
    "stray_node": add_a_stray_node,
    "no_number": lose_a_coordinate,
    "short_families": cut_families_short,
}


def put(content, place, values):
    """Write numbers into the bytes of a msh file; `place`: a mark, and the distance in bytes from it."""
    mark, distance = place
    at = content.index(mark) + distance
    content[at : at + values.nbytes] = values.tobytes()


def stray_value(content):
    """Let a value be of a node that is not there."""
    content += b'$NodeData\n1\n"T"\n0\n3\n0\n1\n2\n' + np.array([(3, 1.5), (9999, 2.5)], "<i4,<f8").tobytes()
    content += b"\n$EndNodeData\n"


#: how msh files are made of `blocks`, whose nodes begin 59 bytes after the mark, and whose last cells have 72 bytes
MSH_CHANGES = {
    "stray_value": stray_value,
    "stray_nodes": lambda content: [
        put(content, (b"\n$EndElements", distance), np.array([10**6])) for distance in (-8, -7208)
    ],
    "node_zero": lambda content: put(content, (b"$Nodes\n", 59), np.array([0])),
    "repeated_node": lambda content: put(content, (b"$Nodes\n", 59), np.array([300])),
    "repeated_cell": lambda content: put(content, (b"\n$EndElements", -72), np.array([4004])),
    "no_coordinate": lambda content: put(content, (b"\n$EndNodes", -24), np.array([np.nan])),
    "cut_short": lambda content: content.__delitem__(slice(-400, None)),
    "unknown_type": lambda content: put(content, (b"$Elements\n", 50), np.array([99], np.int32)),
}
DAMAGED = (
    *(f"{name}.med" for name in ("stray_node", "no_number", "short_families")),
    *(f"{name}.msh" for name in MSH_CHANGES if name != "stray_value"),
)


@pytest.fixture(scope="module")
def told(files):
    """The findings of each process, by the number of processes and the file."""
    return {(n, name): of_each for n, name, of_each in printed(3, "sliced", files)}


@pytest.mark.parametrize("n", [1, 2, 3])
def test_parts_read_by_slices_are_those_of_the_whole_mesh(files, told, n):
    in_parts = {name for k, name in told if k == n and not name.startswith("allocations")}
    in_parts -= {*DAMAGED, "huge.med", "unnamed_zones.med", "ascii.msh"}
    assert len(in_parts) == 21
    counted, other = (read(files / name).node_number for name in ("counted.msh", "blocks.msh"))
    assert counts_up(counted) and not counts_up(other)  # numbers that are indices, and numbers that are asked for
    for name in in_parts:
        assert told[n, name] == [[]] * n, name
    for name in ("unnamed_zones.med", "ascii.msh"):
        assert told[n, name] == ["read as a whole"] * n


@pytest.mark.parametrize("name", DAMAGED)
def test_damage_is_told_as_by_one_process(files, told, name):
    with warnings.catch_warnings(), pytest.raises(ReadError) as error:
        warnings.simplefilter("ignore")
        read(files / name)
    for n in (1, 2, 3):
        assert told[n, name] == [f"3 {error.value}"] * n


def test_coordinates_without_a_finite_box_are_told_as_by_one_process(files, told):
    mesh = read(files / "huge.med")
    for n in (2, 3):
        with pytest.raises(DataError) as error:
            distribute_nodes(mesh, n)
        assert told[n, "huge.med"] == [f"1 {error.value}"] * n


@pytest.mark.parametrize("name", ["column.med", "column.msh"])
def test_allocations_are_of_slices_and_parts(files, told, name):
    """Whatever is larger than a byte a node of the whole mesh is smaller with more processes.

    A slice of three has 0.67 of the cells of one of two, and up to 0.8 of the nodes, since faces and solids are sliced
    apart; an array of the whole mesh would not be smaller.
    """
    mesh = read(files / "large" / name)
    two, three = ({}, {})
    for largest, n in ((two, 2), (three, 3)):
        for of_each in told[n, f"allocations of {name}"]:
            for place, size in of_each.items():
                largest[place] = max(largest.get(place, 0), size)
    assert max(two.values()) > 8 * mesh.n_nodes  # what is allocated is seen
    assert {place: size for place, size in three.items() if size > max(mesh.n_nodes, 0.9 * two.get(place, 0))} == {}


@pytest.fixture(scope="module")
def commanded(files):
    """The answers of two processes to the case `two_blocks` in msh, and in MED with a slave that is not there."""
    text = (ROOT / "data" / "two_blocks.toml").read_text()
    (files / "case.toml").write_text(text.replace("two_blocks.msh", "blocks.msh"))
    wrong = text.replace("two_blocks.msh", "blocks.med").replace('slave = "slave"', 'slave = "slvae"')
    (files / "wrong.toml").write_text(wrong)
    rows = [["run", "-q", files / f"{name}.toml", "-o", files / f"{name}_of_two"] for name in ("case", "wrong")]
    return commands(2, *rows, large=0)


def test_a_case_is_solved_on_slices_as_by_one_process(files, commanded):
    assert commanded[0] == (0, [])
    assert not solver_main(["run", "-q", str(files / "case.toml"), "-o", str(files / "case_of_one")])
    one, two = (json.loads((files / f"case_of_{name}" / "results.json").read_text()) for name in ("one", "two"))
    assert two["energy"] == pytest.approx(one["energy"], rel=1e-9)
    assert two["sizes"] == one["sizes"]


def test_a_group_that_is_not_there_is_told_as_by_one_process(files, commanded, capsys):
    status, said = commanded[1]
    assert status == solver_main(["run", "-q", str(files / "wrong.toml"), "-o", str(files / "wrong")]) > 0
    assert said == own_lines(capsys.readouterr().err) != []
