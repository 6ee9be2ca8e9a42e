"""States that some processes have written, and others go on from, as one process does: of motions, laws and parts."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from lacmesh import read, write
from lacmesh.partition import distribute_nodes, write_parts
from tests.lacsolver.distributed.mpi import ROOT, printed
from tests.lacsolver.distributed.restarts import MIDDLE, pressed, solved
from tests.lacsolver.tables import table

pytestmark = [
    pytest.mark.petsc,
    pytest.mark.filterwarnings("ignore:massless nodes change", "ignore:.*is inside its master by"),  # few cells
]
FOLDERS = ("three", "two_after_three", "one_after_three")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """For each case, folders of the motion and of its second half: by one process, and by others after others."""
    place = tmp_path_factory.mktemp("motions")
    for name in MIDDLE:
        (place / name).mkdir()
        solved(name, place / name / "one")
    spread(place / "blocks")
    printed(3, "restarts", place, timeout=450)
    for name in MIDDLE:
        solved(name, place / name / "one_after_three", place / name / "three")
    blocks, mesh = place / "blocks", place / "blocks" / "blocks.med"
    pressed(mesh, blocks / "serial_after_two", blocks / "two")
    pressed(mesh, blocks / "serial_after_parts", blocks / "parts_after_two", when=0.75)
    return place


def spread(place):
    """Put the mesh of two blocks into a folder, as a file and divided, and a run of one process in one go."""
    place.mkdir()
    mesh = read(ROOT / "data" / "two_blocks.msh")
    write(place / "blocks.med", mesh)
    mesh = read(place / "blocks.med")
    write_parts(place / "blocks.parts", mesh, distribute_nodes(mesh, 2))
    points = mesh.points.copy()
    points[-1] += 1e-6
    write(place / "moved.med", replace(mesh, points=points))
    pressed(place / "blocks.med", place / "one")


@pytest.mark.parametrize("other", FOLDERS)
@pytest.mark.parametrize("name", MIDDLE)
def test_a_run_goes_on_with_any_number_of_processes(folder, name, other):
    found, expected = (rows(folder / name / one / "history.csv") for one in (other, "one"))
    kept = expected["time"] > (MIDDLE[name] if "after" in other else 0.0) + 1e-9
    assert list(found) == list(expected) and 0 < len(found["time"]) == kept.sum()
    for key, values in expected.items():
        alike = [v for k, v in expected.items() if k.split(".")[0] == key.split(".")[0]]
        size = max(np.abs(v).max() for v in alike)
        assert np.abs(found[key] - values[kept]).max() <= 1e-9 * size, key


@pytest.mark.parametrize("other", FOLDERS)
@pytest.mark.parametrize("name", MIDDLE)
def test_its_state_is_that_of_one_process(folder, name, other):
    last = max(path.name for path in (folder / name / "one").glob("state_*.npz"))
    with np.load(folder / name / "one" / last) as one, np.load(folder / name / other / last) as found:
        assert set(one) == set(found)
        histories = [values for key, values in one.items() if key.startswith("materials_") and values.size]
        assert (
            len(histories) > 1 and all(v.max() > 1e-6 for v in histories) if name == "damaged" else "scheme_10" in one
        )
        for key in set(one) - {"about"}:
            size = np.abs(one[key]).max(initial=0.0)
            if key == "scheme_2":  # reactions, which are noise where nothing is held, beside forces
                size = max(size, np.abs(one["scheme_5"]).max())
            np.testing.assert_allclose(found[key], one[key], rtol=0, atol=1e-9 * size, err_msg=key)


@pytest.mark.parametrize(
    "other",
    ["three_after_two", "one_after_two", "serial_after_two", "two_after_one", "parts_after_two", "serial_after_parts"],
)
def test_a_run_on_parts_goes_on_with_any_number_of_processes_and_on_the_whole_mesh(folder, other):
    """A run on slices by two was interrupted; its last steps are those of a run in one go, and so is its last state."""
    place = folder / "blocks"
    found, expected = (rows(place / name / "history.csv") for name in (other, "one"))
    assert rows(place / "two" / "history.csv")["time"].tolist() == [0.25, 0.5]
    assert found["time"].tolist() == ([1.0] if other == "serial_after_parts" else [0.75, 1.0])
    for key, values in expected.items():
        assert np.abs(found[key] - values[-len(found[key]) :]).max() <= 1e-9 * max(
            np.abs(v).max() for v in expected.values()
        ), key
    name = max(path.name for path in (place / "one").glob("state_*.npz"))
    with np.load(place / "one" / name) as one, np.load(place / other / name) as last:
        assert set(one) == set(last)
        for key in set(one) - {"about"}:
            np.testing.assert_allclose(last[key], one[key], rtol=0, atol=1e-9 * np.abs(one[key]).max(initial=0.0))
        told = (json.loads(file["about"].tobytes()) for file in (one, last))
        assert len({json.dumps(about["case"], sort_keys=True) for about in told}) == 1


def test_a_mesh_with_a_node_that_was_moved_is_refused_by_all_processes(folder):
    place = folder / "blocks"
    advice = f"the states in {place / 'two'} are of another case: mesh changed; restore it, or start anew"
    assert [(place / f"refused_{rank}.txt").read_text() for rank in range(3)] == [advice] * 3
    assert not (place / "refused").exists()


def rows(path):
    """The columns of a table; static steps have no values of a motion."""
    return {key: np.nan_to_num(values) for key, values in table(path).items() if key != "iterations"}
