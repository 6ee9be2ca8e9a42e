"""HDF5 files that are changed: all changes are in the file at the end, or none."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from lacmesh.errors import WriteError
from lacmesh.formats.journal import Journal
from lacmesh.formats.med.hdf5 import changing


@pytest.mark.parametrize("seed", range(5))
def test_a_journal_is_a_file(tmp_path, seed):
    """Random writes, reads and cuts give what they give on a plain file; before the end, what is old is untouched."""
    rng = np.random.default_rng(seed)
    start = rng.bytes(int(rng.integers(1, 20000)) if seed else 0)
    path, twin = tmp_path / "a", bytearray(start)
    path.write_bytes(start)
    with path.open("r+b", buffering=0) as file:
        journal = Journal(file)
        for _ in range(200):
            at = int(rng.integers(0, len(twin) + 1))
            data = rng.bytes(int(rng.integers(0, 9000)))
            journal.seek(at)
            if rng.random() < 0.5:
                journal.write(data)
                twin[at : at + len(data)] = data
            else:
                back = bytearray(len(data))
                journal.readinto(back)
                assert back == (twin[at : at + len(data)]).ljust(len(data), b"\0")
            assert journal.seek(0, 2) == len(twin)
        assert path.read_bytes()[: len(start)] == start
        journal.finish()
    assert path.read_bytes() == bytes(twin)


def test_an_error_inside_leaves_the_file(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["x"] = np.arange(1000.0)
    before = path.read_bytes()
    with pytest.raises(ZeroDivisionError), changing(path) as root:
        del root["x"]
        root["y"] = np.arange(2000.0)
        raise ZeroDivisionError
    assert path.read_bytes()[: len(before)] == before
    with h5py.File(path) as file:
        assert list(file) == ["x"]
    with changing(path) as root:  # over what is left behind the end
        root["z"] = np.arange(3000.0)
    with h5py.File(path) as file:
        assert file["x"][-1] == 999 and file["z"][-1] == 2999


def test_a_file_that_is_no_hdf5_is_told(tmp_path):
    (tmp_path / "a.h5").write_bytes(b"no HDF5" * 100)
    with pytest.raises(WriteError, match=r"a\.h5: cannot be written \(HDF5"), changing(tmp_path / "a.h5"):
        pass
