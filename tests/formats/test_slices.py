"""Parts that processes read by slices of a MED or msh file are those of the whole mesh; damage is told as by one.

The processes are threads here; a run of several processes on slices is in tests/lacsolver/distributed.
"""

from __future__ import annotations

import shutil
import warnings
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from contextvars import copy_context
from dataclasses import replace
from functools import cached_property
from threading import Barrier

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lacmesh import Mesh, cut_skin, join, read, write
from lacmesh.cells import ALL_CELLS
from lacmesh.communicator import Communicator
from lacmesh.errors import DataError, LacmeshError, LacmeshWarning, ReadError
from lacmesh.formats.ids import counts_up
from lacmesh.formats.med import fields
from lacmesh.formats.msh.reader import slice_of
from lacmesh.generate import box, stack
from lacmesh.partition import cut_part, distribute_nodes, part_of, slices
from lacmesh.partition.slices import read_in_slices
from tests import REPOSITORY
from tests.formats.msh_meshes import meshes
from tests.formats.texts import swapped
from tests.lacsolver.distributed.watch import watched
from tests.meshes import random_mesh
from tests.partition.compare import differences
from tests.samples import samples

#: groups of skin faces that each part is to have, as far as the file has them
SKINS = ("slave", "master", "none", "absent", "entity:2:7", "entity:2:99", "entity:surface")
#: `two_boxes(gmsh, parts=2)` of `msh_gmsh`, as gmsh 4.15.2 wrote it: entities in two partitions, a periodic link
OF_GMSH = REPOSITORY / "tests" / "reference" / "two_boxes_gmsh.msh"
IN_MSH = tuple(name for name, cell in ALL_CELLS.items() if cell.msh is not None)
some = settings(max_examples=samples(25, 200), deadline=None, suppress_health_check=list(HealthCheck))

for one in vars(slices._Dealer).values():
    if isinstance(one, cached_property):
        one.lock = nullcontext()  # of Python 3.11, which would let one thread wait for another that waits for it


class Thread(Communicator):
    """Thread `rank` of `size`, which gives and takes what all have in a list."""

    def __init__(self, rank, size, barrier, given):
        self.rank, self.size, self._barrier, self._given = rank, size, barrier, given

    def _all(self, x):
        self._given[self.rank] = x
        self._barrier.wait()
        there = list(self._given)
        self._barrier.wait()
        return there

    def on_each(self, work):
        try:
            made, error = work(), None
        except Exception as failed:
            made, error = None, failed
        for first in self._all(error):
            if first is not None:
                raise first
        return made

    def total(self, x):
        return sum(self._all(x))

    def greatest(self, x):
        return np.max(self._all(x), axis=0)

    def before(self, count):
        return sum(self._all(count)[: self.rank])

    def gather(self, x):
        return np.concatenate(self._all(x))

    def exchange(self, x, counts, expected=None):
        parts = [np.split(rows, np.cumsum(n)[:-1])[self.rank] for rows, n in self._all((x, counts))]
        return np.concatenate(parts), np.array([len(part) for part in parts])


def in_slices(path, n, skins=SKINS):
    """The part of each of n threads, or the error that it meets."""
    barrier, given = Barrier(n, timeout=300), [None] * n

    def one(rank):
        try:
            return read_in_slices(path, Thread(rank, n, barrier, given), skins)
        except Exception as error:
            return error

    contexts = [copy_context() for _ in range(n)]  # with numpy's handler of memory
    with ThreadPoolExecutor(n) as pool:
        return list(pool.map(lambda rank, context: context.run(one, rank), range(n), contexts))


def check(path, n, skins=SKINS, cut=False):
    """Compare the parts of n threads with those of the whole mesh, as they are and cut, and their warnings.

    Without `skins`, a mesh may be read as a whole.
    """
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        parts = in_slices(path, n, skins)
    if parts == [None] * n and not skins:
        return
    with warnings.catch_warnings(record=True) as heard_of_one:
        warnings.simplefilter("always")
        mesh = read(path)
    assert not [part for part in parts if isinstance(part, Exception)]
    skins = [name for name in skins if name in mesh.cell_groups or ((2, 7) in mesh.entities and name == "entity:2:7")]
    owner = distribute_nodes(mesh, n)
    for rank, part in enumerate(parts):
        there = part_of(mesh, owner, rank, everywhere=skins)
        assert differences(there, part) == []
        if cut:
            assert differences(cut_part(there, "slave"), cut_part(part, "slave"), "part") == []
    told, of_one = ([str(one.message) for one in some] for some in (heard, heard_of_one))
    assert sorted(told) == sorted(of_one * n)


# ---- the files


def sound():
    """Names and meshes that are written in both formats."""
    blocks = read(REPOSITORY / "data" / "two_blocks.msh")
    yield "blocks", blocks
    yield "blocks_cut", cut_skin(blocks, "slave").mesh
    yield "hexahedra_cut", cut_skin(column(24, 12), "slave", hexa="hexa").mesh
    for seed in range(4):
        rng = np.random.default_rng(seed)
        mesh = random_mesh(rng, dim=2 + seed % 2, order=1 + seed // 2, interior=seed % 3 == 0, twins=True)
        yield f"random_{seed}", twice(mesh, mesh) if seed % 2 else mesh
    of_one_entity = {**blocks.node_data, "entity": np.tile([3, 1], (blocks.n_nodes, 1))}
    yield "counted", replace(blocks, node_data=of_one_entity, node_number=np.arange(blocks.n_nodes) + 1)
    yield "skins_of_second_body", twice(replace(mesh, cell_groups={}), mesh)


def column(low, high):
    """A column of 4 by 4 hexahedra on another; of each its layers."""
    lower, upper = (box((4, 4, n), (1, 1, n / 4)) for n in (low, high))
    return stack(lower, upper).only("slave", "master", "lower", "upper").renamed(lower="", upper="")


def twice(mesh, other):
    """A mesh and another one, apart from it, with the numbers of both in one order."""
    both = join(mesh, other.moved((5.0, 0.0)))
    return numbered(replace(both, space_dim=mesh.space_dim))


def numbered(mesh):
    """The mesh with numbers of nodes in a random order."""
    return replace(mesh, node_number=np.random.default_rng(1).permutation(mesh.n_nodes) + 5)


def repeat_numbers(file, step):
    """Give the first and the last node one number, and likewise the cells of a type."""
    for part in (step["NOE"], next(iter(step["MAI"].values()))):
        part["NUM"][-1] = part["NUM"][0]


def forget_zones(file, step):
    """Record a cut without the names of its zones."""
    file.pop("LACMESH", None)
    field = file.require_group("CHA").create_group("lac_macro")
    field.attrs.update({"NCO": np.int32(1), "MAI": np.bytes_(next(iter(file["ENS_MAA"])))})
    support = field.create_group("x")
    support.attrs.update({"NDT": np.int32(-1), "NOR": np.int32(-1)})
    kind, part = next(iter(step["MAI"].items()))
    support.create_group(f"MAI.{kind}/MED_NO_PROFILE_INTERNAL")["CO"] = np.zeros(len(part["FAM"]), np.int32)


def cut_families_short(file, step):
    """Leave the last family of the nodes out."""
    families = step["NOE/FAM"][:-1]
    del step["NOE/FAM"]
    step["NOE/FAM"] = families


def changed(place, at, value):
    """A change of some values."""
    return lambda file, step: step[place].__setitem__(at, value)


#: name of a file -> the change of `blocks` in MED that makes it
CHANGES = {
    "repeated_numbers.med": repeat_numbers,
    "one_place.med": changed("NOE/COO", slice(None), 1.0),
    "no_families.med": lambda file, step: next(iter(file["FAS"].values())).pop("ELEME"),
    "huge.med": changed("NOE/COO", [5, 400], [1.7e308, -1.6e308]),  # their difference is not finite
    "unnamed_zones.med": forget_zones,
    "stray_node.med": lambda file, step: list(step["MAI"].values())[-1]["NOD"].__setitem__(-1, 10**6),
    "no_number.med": changed("NOE/COO", 100, np.nan),
    "short_families.med": cut_families_short,
}


def put(mark, distance, values):
    """A change of numbers in the bytes of a msh file, at a distance in bytes from a mark."""

    def change(content):
        at = content.index(mark) + distance
        content[at : at + values.nbytes] = values.tobytes()

    return change


def stray_value(content):
    """Let a value be of a node that is not there."""
    content += b'$NodeData\n1\n"T"\n0\n3\n0\n1\n2\n' + np.array([(3, 1.5), (9999, 2.5)], "<i4,<f8").tobytes()
    content += b"\n$EndNodeData\n"


def stray_nodes(content):
    """Let two cells have nodes that are not there."""
    for distance in (-8, -7208):
        put(b"\n$EndElements", distance, np.array([10**6]))(content)


#: how msh files are made of `blocks`, whose nodes begin 59 bytes after the mark, and whose last cells have 72 bytes
MSH_CHANGES = {
    "stray_value.msh": stray_value,
    "stray_nodes.msh": stray_nodes,
    "node_zero.msh": put(b"$Nodes\n", 59, np.array([0])),
    "repeated_node.msh": put(b"$Nodes\n", 59, np.array([300])),
    "repeated_cell.msh": put(b"\n$EndElements", -72, np.array([4004])),
    "no_coordinate.msh": put(b"\n$EndNodes", -24, np.array([np.nan])),
    "cut_short.msh": lambda content: content.__delitem__(slice(-400, None)),
    "unknown_type.msh": put(b"$Elements\n", 50, np.array([99], np.int32)),
}
#: files whose parts are read, though they are odd, and files that are damaged
ODD = ("repeated_numbers.med", "one_place.med", "no_families.med", "stray_value.msh")
DAMAGED = [name for name in (*CHANGES, *MSH_CHANGES) if name not in (*ODD, "huge.med", "unnamed_zones.med")]
SOUND = {f"{name}{suffix}": mesh for name, mesh in sound() for suffix in (".med", ".msh")}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A folder of MED and msh files: whole, odd and damaged."""
    folder = tmp_path_factory.mktemp("files")
    for name, mesh in SOUND.items():
        write(folder / name, mesh)
    for name, change in CHANGES.items():
        shutil.copy(folder / "blocks.med", folder / name)
        with h5py.File(folder / name, "r+") as file:
            change(file, next(iter(next(iter(file["ENS_MAA"].values())).values())))
    for name, change in MSH_CHANGES.items():
        content = bytearray((folder / "blocks.msh").read_bytes())
        change(content)
        (folder / name).write_bytes(content)
    shutil.copy(OF_GMSH, folder / "gmsh.msh")
    return folder


@pytest.mark.parametrize("name", [*SOUND, *ODD, "gmsh.msh"])
def test_parts_read_by_slices_are_those_of_the_whole_mesh(files, name):
    for n in (2, 3):
        check(files / name, n, cut=name.startswith("blocks."))


@pytest.mark.parametrize("name", DAMAGED)
def test_damage_is_told_as_by_one(files, name):
    with warnings.catch_warnings(), pytest.raises(ReadError) as error:
        warnings.simplefilter("ignore")
        read(files / name)
    for n in (2, 3):
        assert {f"{type(one).__name__} {one}" for one in in_slices(files / name, n)} == {f"ReadError {error.value}"}


def test_coordinates_without_a_finite_box_are_told_as_by_one(files):
    with pytest.raises(DataError) as error:
        distribute_nodes(read(files / "huge.med"), 2)
    assert [str(one) for one in in_slices(files / "huge.med", 2)] == [str(error.value)] * 2


@some
@given(mesh=meshes(kinds=IN_MSH), n=st.integers(2, 5))
def test_slices_of_any_mesh_together_are_the_whole(tmp_path_factory, mesh, n):
    path = tmp_path_factory.mktemp("slices") / "mesh.msh"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write(path, mesh)
        check(path, n, skins=())


def test_numbers_that_count_up_and_others_are_found(files):
    counted, other = (read(files / name).node_number for name in ("counted.msh", "blocks.msh"))
    assert counts_up(counted) and not counts_up(other)


def test_slices_in_the_other_byte_order(tmp_path):
    path = tmp_path / "swapped.msh"
    fields = {"node_number": [1, 2, 3, 7], "node_data": {"U": np.eye(4, 3)}, "cell_groups": {"g": [0]}}
    write(path, Mesh.create(np.eye(4)[:, :3], [("TRIA3", [[0, 1, 2]])], **fields))
    one = slice_of(path)
    path.write_bytes(swapped(path.read_bytes(), "4.1"))
    other = slice_of(path)
    assert np.array_equal(one.points, other.points) and np.array_equal(one.cells[0].nodes, other.cells[0].nodes)
    assert one.node_number.tolist() == other.node_number.tolist() == [1, 2, 3, 7]
    assert np.array_equal(one.node_data["U"], other.node_data["U"]) and other.cell_groups["g"].tolist() == [0]


def test_what_is_read_as_a_whole(files, tmp_path):
    path = tmp_path / "mesh.msh"
    triangle = Mesh.create(np.eye(3), [("TRIA3", [[0, 1, 2]])])
    for options in ({"binary": False}, {"msh": "2.2"}, {"msh": "2.2", "binary": False}):
        write(path, triangle, **options)
        assert in_slices(path, 2) == [None, None]
    with pytest.warns(LacmeshWarning, match="msh has no TRIA7"):
        write(path, Mesh.create(np.eye(7)[:, :3], [("TRIA7", [np.arange(7)])]))
    assert in_slices(path, 2) == in_slices(files / "unnamed_zones.med", 2) == [None, None]


@some
@given(data=st.data())
def test_any_damage_is_told_as_by_one(files, tmp_path_factory, data):
    path = tmp_path_factory.mktemp("damage") / "damaged.msh"
    content = bytearray(data.draw(st.sampled_from([files / "blocks_cut.msh", OF_GMSH])).read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(60, len(content) - 1))
        content[at : at + 8] = data.draw(st.sampled_from([b"", b"\0" * 8, b"\xff" * 8, b"\x7f\xff", b"\1", b"$"]))
    path.write_bytes(content)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            distribute_nodes(read(path), 3)
        except LacmeshError as error:
            assert {str(one) for one in in_slices(path, 3, ())} == {str(error)}
        else:
            check(path, 3, skins=())


def test_values_with_profiles_are_read_piece_by_piece(files, monkeypatch):
    monkeypatch.setattr(fields, "_PIECE", 7)
    check(files / "blocks_cut.med", 3)


@pytest.mark.parametrize("suffix", [".med", ".msh"])
def test_allocations_are_of_slices_and_parts(suffix, tmp_path):
    """Whatever is larger than a byte a node of the whole mesh is smaller with more processes.

    A slice of three has 0.67 of the cells of one of two, and up to 0.8 of the nodes, since faces and solids are sliced
    apart; an array of the whole mesh would not be smaller. The mesh is so large that kernels run compiled in both.
    """
    mesh = numbered(column(1600, 4))
    write(tmp_path / f"column{suffix}", mesh)
    two, three = (watched(lambda n=n: in_slices(tmp_path / f"column{suffix}", n, ["slave", "master"])) for n in (2, 3))
    assert max(two.values()) > 8 * mesh.n_nodes  # what is allocated is seen
    assert {place: size for place, size in three.items() if size > max(mesh.n_nodes, 0.9 * two.get(place, 0))} == {}
