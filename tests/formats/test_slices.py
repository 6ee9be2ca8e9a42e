"""Slices of a MED or msh file: together they are the whole, each reads its rows, damage is told as by one."""

from __future__ import annotations

import warnings
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lacmesh import Mesh, cut_skin, read, write
from lacmesh.cells import ALL_CELLS
from lacmesh.communicator import Communicator
from lacmesh.errors import LacmeshError, LacmeshWarning
from lacmesh.formats.med import fields
from lacmesh.formats.med.reader import read_slice
from lacmesh.formats.msh.reader import slice_of
from lacmesh.formats.slices import Slice
from tests.formats.msh_meshes import meshes
from tests.formats.texts import swapped
from tests.lacsolver.distributed.mpi import ROOT
from tests.meshes import random_mesh
from tests.samples import samples


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


def in_threads(n, work):
    """Return what `work`, a function of a communicator, returns or raises in each of n threads."""
    barrier, given = Barrier(n, timeout=20), [None] * n

    def one(rank):
        try:
            return work(Thread(rank, n, barrier, given))
        except Exception as error:
            return error

    with ThreadPoolExecutor(n) as pool:
        return list(pool.map(one, range(n)))


def in_slices(slice_of, path, n):
    """Return the slices of a file, or the error of each of its readers."""
    return in_threads(n, lambda comm: slice_of(path, comm))


some = settings(max_examples=samples(25, 200), deadline=None, suppress_health_check=list(HealthCheck))
#: `two_boxes(gmsh, parts=2)` of `msh_gmsh`, as gmsh 4.15.2 wrote it: entities in two partitions, a periodic link
OF_GMSH = ROOT / "tests" / "reference" / "two_boxes_gmsh.msh"
IN_MSH = tuple(name for name, cell in ALL_CELLS.items() if cell.msh is not None)


def check(path, n):
    """Compare n slices with the whole."""
    whole, slices = slice_of(path), in_slices(slice_of, path, n)
    by_row = [(Slice(k, n).rows(whole.rows.size), one) for k, one in enumerate(slices)]
    assert [one.rows for one in slices] == [rows for rows, _ in by_row]
    for name in ("points", "node_number"):
        assert same(np.concatenate([getattr(one, name) for one in slices]), getattr(whole, name))
    for k, c in enumerate(whole.cells):
        assert same(np.concatenate([one.cells[k].nodes for one in slices]), c.nodes)
    index = np.argsort(np.concatenate([whole_index(one) for one in slices]))
    assert same(np.concatenate([one.cell_number for one in slices])[index], whole.cell_number)
    if whole.cell_place is not None:
        assert same(np.concatenate([one.cell_place for one in slices])[index], whole.cell_place)
    for on, place in (("cell", whole_index), ("node", lambda one: np.arange(one.rows.start, one.rows.stop))):
        for name, members in getattr(whole, f"{on}_groups").items():
            parts = [place(one)[getattr(one, f"{on}_groups")[name]] for one in slices]
            assert same(np.unique(np.concatenate(parts)), np.unique(members)), name
        for name, values in getattr(whole, f"{on}_data").items():
            joined = np.concatenate([getattr(one, f"{on}_data")[name] for one in slices])
            assert same(joined[index] if on == "cell" else joined, values), name
    for one in slices:
        assert [(c.type, c.rows.size) for c in one.cells] == [(c.type, c.rows.size) for c in whole.cells]
        assert (one.cell_place is None) == (whole.cell_place is None)
        for name in ("cell_groups", "node_groups", "cell_data", "node_data"):
            assert list(getattr(one, name)) == list(getattr(whole, name))
        assert (one.space_dim, one.said) == (whole.space_dim, whole.said)
        assert repr(one.noted) == repr(whole.noted)


def same(one, other):
    """True for equal arrays of one kind of number."""
    return one.dtype.kind == other.dtype.kind and np.array_equal(one, other, equal_nan=one.dtype.kind == "f")


def whole_index(one):
    """Indices in the whole mesh of the cells of a slice."""
    first = np.cumsum([0, *(c.rows.size for c in one.cells)])
    return np.concatenate(
        [np.empty(0, int), *(a + np.arange(*c.rows[:2]) for a, c in zip(first, one.cells, strict=False))]
    )


@some
@given(mesh=meshes(kinds=IN_MSH), n=st.integers(2, 5))
def test_slices_together_are_the_whole(tmp_path_factory, mesh, n):
    path = tmp_path_factory.mktemp("slices") / "mesh.msh"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write(path, mesh)
        check(path, n)


def test_slices_of_a_file_of_gmsh():
    whole = slice_of(OF_GMSH)
    assert len(whole.noted["model"].periodic[0].nodes) and set(whole.cell_data["partition"]) == {1, 2}
    check(OF_GMSH, 3)


@pytest.fixture(scope="module")
def cut(tmp_path_factory):
    """A file of a mesh that was cut, with the records of the cut."""
    path = tmp_path_factory.mktemp("cut") / "cut.msh"
    write(path, cut_skin(read(ROOT / "data" / "two_blocks.msh"), "slave").mesh)
    return path


def test_slices_of_a_cut(cut):
    assert slice_of(cut).cell_data["lac_macro"].max() > 7
    check(cut, 3)


def test_slices_in_the_other_byte_order(tmp_path):
    path = tmp_path / "swapped.msh"
    fields = {"node_number": [1, 2, 3, 7], "node_data": {"U": np.eye(4, 3)}, "cell_groups": {"g": [0]}}
    write(path, Mesh.create(np.eye(4)[:, :3], [("TRIA3", [[0, 1, 2]])], **fields))
    path.write_bytes(swapped(path.read_bytes(), "4.1"))
    check(path, 2)


def test_what_is_read_as_a_whole(tmp_path):
    path = tmp_path / "mesh.msh"
    triangle = Mesh.create(np.eye(3), [("TRIA3", [[0, 1, 2]])])
    for options in ({"binary": False}, {"msh": "2.2"}, {"msh": "2.2", "binary": False}):
        write(path, triangle, **options)
        assert in_slices(slice_of, path, 2) == [None, None]
    with pytest.warns(LacmeshWarning, match="msh has no TRIA7"):
        write(path, Mesh.create(np.eye(7)[:, :3], [("TRIA7", [np.arange(7)])]))
    assert in_slices(slice_of, path, 2) == [None, None]


@some
@given(data=st.data())
def test_damage_is_told_as_by_one(cut, tmp_path_factory, data):
    path = tmp_path_factory.mktemp("damage") / "damaged.msh"
    content = bytearray(data.draw(st.sampled_from([cut, OF_GMSH])).read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(60, len(content) - 1))
        content[at : at + 8] = data.draw(st.sampled_from([b"", b"\0" * 8, b"\xff" * 8, b"\x7f\xff", b"\1", b"$"]))
    path.write_bytes(content)
    try:
        slice_of(path)
    except LacmeshError as error:
        assert {str(one) for one in in_slices(slice_of, path, 3)} == {str(error)}
    else:
        check(path, 3)


def check_med(path, n):
    """Compare n slices, one after the other, with the whole."""
    whole, slices = read_slice(path, Slice()), [read_slice(path, Slice(k, n)) for k in range(n)]
    assert len({len(one.points) for one in slices}) <= 2
    for name in ("points", "node_number", "node_family"):
        assert np.array_equal(np.concatenate([getattr(one, name) for one in slices]), getattr(whole, name))
    for k, cells in enumerate(whole.cells):
        for name in ("nodes", "number", "family"):
            joined = np.concatenate([getattr(one.cells[k], name) for one in slices])
            assert np.array_equal(joined, getattr(cells, name)) and joined.dtype == getattr(cells, name).dtype
    for name, values in whole.data.node_data.items():
        joined = np.concatenate([one.data.node_data[name] for one in slices])
        assert np.array_equal(joined, values, equal_nan=values.dtype.kind == "f") and joined.dtype == values.dtype
    for name, values in whole.data.cell_data.items():
        parts = [by_type(one, one.data.cell_data[name]) for one in slices]
        joined = np.concatenate([part[k] for k in range(len(whole.cells)) for part in parts])
        assert np.array_equal(joined, values, equal_nan=values.dtype.kind == "f") and joined.dtype == values.dtype
    for one in slices:
        assert (one.cell_families, one.node_families) == (whole.cell_families, whole.node_families)
        assert (one.name, one.space_dim, one.said) == (whole.name, whole.space_dim, whole.said)


def by_type(content, values):
    """Data of the cells of a slice, by their types."""
    return np.split(values, np.cumsum([len(cells.nodes) for cells in content.cells])[:-1])


@pytest.mark.parametrize("seed", range(4))
def test_slices_of_med(seed, tmp_path):
    mesh = random_mesh(np.random.default_rng(seed), dim=2 + seed % 2, order=1 + seed // 2, twins=True)
    write(tmp_path / "mesh.med", mesh)
    for n in (2, 3, 50) if seed == 0 else (2, 3):
        check_med(tmp_path / "mesh.med", n)


def test_values_with_profiles_are_read_piece_by_piece(tmp_path, monkeypatch):
    monkeypatch.setattr(fields, "_PIECE", 7)
    write(tmp_path / "cut.med", cut_skin(read("data/two_blocks.msh"), "slave").mesh)
    assert read(tmp_path / "cut.med").cell_data["lac_macro"].max() > 7
    check_med(tmp_path / "cut.med", 3)


def test_a_slice_reads_its_rows_alone(tmp_path, monkeypatch):
    write(tmp_path / "mesh.med", read("data/two_blocks.msh"))
    seen = []
    plain = h5py.Dataset.__getitem__

    def get(dataset, what, *more):
        got = plain(dataset, what, *more)
        if dataset.name.rsplit("/")[-1] in ("COO", "NOD", "NUM", "FAM"):
            seen.append(np.size(got) / dataset.size)
        return got

    monkeypatch.setattr(h5py.Dataset, "__getitem__", get)
    read_slice(tmp_path / "mesh.med", Slice(1, 5))
    assert len(seen) > 10 and max(seen) < 0.21
