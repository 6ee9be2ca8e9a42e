"""results.med: medcoupling finds every field at every time; a disk that is full leaves what was there."""

from __future__ import annotations

import resource
from contextlib import contextmanager

import h5py
import numpy as np
import pytest

from lacmesh import read
from lacmesh.errors import LacmeshWarning, WriteError
from lacmesh.formats.med.types import MED_TYPES
from lacsolver.output.med import MedSeries
from lacsolver.results.nodal import principal, von_mises
from lacsolver.space.space import Space
from tests.formats.med_peer import ask
from tests.lacsolver.bodies import mixture
from tests.lacsolver.test_output_vtu import whole_fields
from tests.lacsolver.written import MODELS, ZONES, fields, made_up

TIMES = (0.25, 0.5, 0.75)
FIRST = ZONES[1].replace("/", "_")


@pytest.fixture(scope="module", params=MODELS)
def run(request, tmp_path_factory):
    made = made_up(tmp_path_factory.mktemp("med"), request.param, '[output]\nformat = "med"')
    made.steps(made.writer(), len(TIMES))
    return made


def expected(run, time):
    """Name -> values on all nodes, or (faces' cells, values on them)."""
    told = fields(run.space, time)
    arrays = {"DEPL": told.displacement, "SIEF_NOEU": told.stress, "REAC_NODA": told.reaction}
    arrays["SIEQ_NOEU"] = np.column_stack([von_mises(told.stress), principal(told.stress)[:, ::-1]])
    for name, zone in zip((ZONES[0], FIRST), told.zones.values(), strict=True):
        arrays[f"{name}.contact_force"] = zone.contact_force
        arrays[f"{name}.pressure_recovered.nodes"] = zone.pressure_recovered
        for what, values in (
            ("pressure", zone.pressure),
            ("pressure_recovered", zone.recovered),
            ("gap", zone.gap),
            ("status", zone.status),
            ("coverage", zone.coverage),
        ):
            arrays[f"{name}.{what}"] = (zone.surface.cell, values[zone.macro])
    return arrays


@pytest.mark.medcoupling
def test_medcoupling_reads_every_field_at_every_time(run):
    (said,) = ask("say", run.folder / "results.med").values()
    mesh, d = run.space.mesh, run.space.dim
    assert said["name"] == "blocks" and said["space_dim"] == d
    assert set(said["groups"]) == {"lower", "upper", "slave", "master", "plate"}
    assert said["node_number"] == mesh.node_number.tolist()
    med_name = {kind.type: kind.name for kind in MED_TYPES}
    ours = {name: steps for name, steps in said["fields"].items() if not name.startswith("lac_")}
    assert set(ours) == set(expected(run, 1.0))
    for name, steps in ours.items():
        assert [(number, time) for number, _, time, _ in steps] == list(enumerate(TIMES, 1)), name
        for _, _, time, parts in steps:
            values = expected(run, time)[name]
            if isinstance(values, tuple):
                cells, on_faces = values
                for kind, rows, _ in mesh.select(np.sort(cells)):
                    places, found = parts.pop(med_name[kind])
                    numbers = np.array(said["types"][med_name[kind]]["number"])
                    places = range(len(numbers)) if places is None else places
                    by_cell = dict(zip(numbers[places].tolist(), np.ravel(found), strict=True))
                    wanted = dict(zip(mesh.cell_number[cells].tolist(), on_faces, strict=True))
                    assert by_cell.keys() == set(mesh.cell_number[rows].tolist())
                    np.testing.assert_array_equal([wanted[n] for n in by_cell], list(by_cell.values()), name)
                assert not parts
            else:
                places, found = parts["NOE"]
                whole = np.full((mesh.n_nodes, len(found[0])), np.nan)
                whole[slice(None) if places is None else places] = found
                np.testing.assert_array_equal(whole, values.reshape(mesh.n_nodes, -1), name)


def test_lacmesh_reads_it_and_its_times(run):
    mesh = read(run.folder / "results.med")
    assert mesh.steps["DEPL@2"].time == 0.75 and mesh.steps["DEPL@2"].number == 3
    np.testing.assert_array_equal(mesh.node_data["DEPL@1"], fields(run.space, 0.5).displacement)
    assert np.array_equal(np.sort(mesh.cell_data["lac_macro"]), np.sort(run.space.mesh.cell_data["lac_macro"]))


def test_components_are_named(run):
    with h5py.File(run.folder / "results.med") as file:
        names = file["CHA/SIEF_NOEU"].attrs["NOM"].decode().split()
        moves = file["CHA/DEPL"].attrs["NOM"].decode().split()
        assert file[f"CHA/{FIRST}.status"].attrs["TYP"] == 24
    d = run.space.dim
    assert names == ["SIXX", "SIYY", "SIZZ", "SIXY", "SIYZ", "SIXZ"][: 4 if d == 2 else 6]
    assert moves == ["DX", "DY", "DZ"][:d]


def test_times_are_counted_as_libmed_wants_them(run, tmp_path):
    """Steps in all (LAA), on nodes (LNA), on cells (LCA); also where some were taken out."""
    path = tmp_path / "results.med"
    path.write_bytes((run.folder / "results.med").read_bytes())
    for end, count in ((0.75, 3), (0.3, 1)):
        MedSeries(tmp_path, run.space, ZONES, end)
        with h5py.File(path) as file:
            for name in expected(run, 1.0):
                home = file["CHA"][name]
                on = "LNA" if "LGN" in home.attrs else "LCA"
                assert (len(home), home.attrs["LAA"], home.attrs[on]) == (count,) * 3


def test_profiles_are_kept_once(run):
    with h5py.File(run.folder / "results.med") as file:
        assert sum(name.startswith("places_") for name in file["PROFILS"]) <= 3  # slave nodes, two types of faces
        assert all((np.diff(profile["PFL"]) > 0).all() for profile in file["PROFILS"].values())


def test_pyram14_are_written_as_pyram13(tmp_path):
    space = Space.of(mixture("2-full"), "3d")
    with pytest.warns(LacmeshWarning, match="PYRAM14 are written as PYRAM13"):
        series = MedSeries(tmp_path, space, [])
    series.write(whole_fields(space), 1)
    kinds = read(tmp_path / "results.med").cells_by_type
    assert kinds["PYRAM13"] == len(space.mesh.block("PYRAM14")) and "PYRAM14" not in kinds


def test_zones_of_names_that_med_takes_for_one_are_two(tmp_path):
    run = made_up(tmp_path)
    told = fields(run.space, 0.5)
    zones = dict(zip(("a/b", "a_b"), told.zones.values(), strict=True))
    MedSeries(tmp_path, run.space, zones).write(type(told)(**{**vars(told), "zones": zones}), 1)
    with h5py.File(tmp_path / "results.med") as file:
        assert {"a_b.gap", "a_b.gap_2"} <= set(file["CHA"])


def test_a_zone_whose_name_is_too_long_for_med_is_refused_at_once(tmp_path):
    run = made_up(tmp_path)
    with pytest.raises(WriteError, match="64 bytes at most; shorten the name"):
        MedSeries(tmp_path, run.space, ["x" * 40])
    MedSeries(tmp_path, run.space, ["x" * 39])  # as docs/output.md says
    assert not (tmp_path / "results.med").exists()


@contextmanager
def room(size):
    """Limit the size of files, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    import signal

    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)


@pytest.mark.parametrize("part", [0, 0.1, 0.5, 0.99])
def test_where_a_time_does_not_fit_the_file_is_as_it_was(tmp_path, part):
    space = Space.of(mixture(), "3d")
    series = MedSeries(tmp_path, space, [])
    series.write(whole_fields(space), 1)
    before = (tmp_path / "results.med").read_bytes()
    series.write(whole_fields(space), 2)
    growth = (tmp_path / "results.med").stat().st_size - len(before)
    (tmp_path / "results.med").write_bytes(before)
    with (
        room(len(before) + int(part * growth)),
        pytest.raises(WriteError, match=r"results\.med: cannot be written \(File too large"),
    ):
        series.write(whole_fields(space), 2)
    assert (tmp_path / "results.med").read_bytes() == before
    series.write(whole_fields(space), 2)
    assert {s.number for s in read(tmp_path / "results.med").steps.values()} == {1, 2}
