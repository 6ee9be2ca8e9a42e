"""Files of a run: its tables, its fields as VTU and MED as other programs find them."""

import json
import math
import shutil
from dataclasses import fields as fields_of
from dataclasses import replace

import h5py
import numpy as np
import pytest

from lacmesh import Surface, read
from lacmesh.cells import CELLS
from lacmesh.errors import ReadError, WriteError
from lacmesh.formats.orders import MED_CELLS
from lacmesh.formats.vtu import read_pvd
from lacsolver.equilibrium.state import StepState
from lacsolver.output import summary, tables
from lacsolver.output.med import check_names, write_med
from lacsolver.output.names import contact_stems
from lacsolver.output.states import TimeWriter
from lacsolver.output.tables import History
from lacsolver.output.vtu import VtuSeries
from lacsolver.results.nodal import PRINCIPAL, principal, von_mises
from lacsolver.results.results import Fields, Restart, Results, ZoneFigures
from lacsolver.space.space import Space
from tests.bad_input.case import small_files
from tests.formats.med_peer import ask
from tests.lacsolver.bodies import PLANES, SOLIDS, cube, mixture, square
from tests.lacsolver.written import MODELS, ZONES, displacement, fields, figures, made_up, two_blocks, zone_fields

TIMES = (0.25, 0.5, 0.75)
#: the second zone by its file's name
SECOND = ZONES[1].replace("/", "_")
SHOWN = ("pressure", "gap", "coverage", "status")


def three_steps(folder, model="3d", **output):
    made = made_up(folder, model, **output)
    made.steps(made.writer(), len(TIMES))
    return made


@pytest.fixture(scope="module", params=MODELS)
def run(request, tmp_path_factory):
    return three_steps(tmp_path_factory.mktemp("vtu"), request.param)


@pytest.fixture(scope="module", params=MODELS)
def in_med(request, tmp_path_factory):
    made = three_steps(tmp_path_factory.mktemp("med"), request.param)
    write_med(made.folder)
    return made


def told(folder):
    """What results.json holds; it has no word that JSON does not know, such as NaN."""

    def no_constant(name):
        raise ValueError(f"{name} is no JSON")

    return json.loads((folder / "results.json").read_text(encoding="utf-8"), parse_constant=no_constant)


# ---- results.json


@pytest.mark.parametrize("model", MODELS)
def test_results_are_whole_after_every_step_and_at_the_end(tmp_path, model):
    run = made_up(tmp_path, model)
    writer, d = run.writer(), run.space.dim
    for number in (1, 2):
        run.step(writer, number, 0.25 * number)
        found = told(run.folder)
        assert (found["status"], len(found["steps"])) == ("running", number)
    run.results = replace(run.results, stress={"body": {"xx": (-1.0, 2.0), "zz": (math.nan, math.inf)}})
    run.finish(writer)
    found = told(run.folder)
    first, second = found.pop("steps")
    assert first["time"] == 0.25 and second == {
        "time": 0.5, "iterations": 5, "halvings": 1, "residuals": [1.0, 1e-12],
        "reactions": {"base": [0.5 * k for k in range(1, d + 1)]}, "probes": {"PA, top": [-0.5] * d},
    }  # fmt: skip
    zone = found.pop("contact")["joint"]
    assert set(zone) - {"overlap_at_start"} == {f.name for f in fields_of(ZoneFigures) if f.name != "friction"}
    assert (zone["pressure_max"], zone["gap_min"], zone["active"], zone["overlap_at_start"]) == (5.0, None, 3, None)
    assert zone["moment"] == ([1.0] * 3 if d == 3 else 2.5) and zone["resultant"] == [1.0, 2.0, 3.0][:d]
    balance = {"force": 4e-15, "moment": 1e-15}  # of the first step, of the second
    assert found == {
        "version": "1.2.3", "status": "done", "balance": balance, "loads": [], "energy": 1.5, "sizes": {"nodes": 5},
        "stress": {"body": {"xx": [-1.0, 2.0], "zz": [None, None]}}, "timings": {"solve": 0.5}, "memory": 10**6,
    }  # fmt: skip


def test_a_run_that_fails_before_its_first_step_says_so_and_a_word_that_is_no_status_is_refused(tmp_path):
    run = made_up(tmp_path)
    run.finish(run.writer(), "failed", message='no material\non "lower"')
    found = told(run.folder)
    assert (found["status"], found["message"]) == ("failed", 'no material\non "lower"')
    assert (found["steps"], found["contact"], found["energy"]) == ([], {}, None)
    assert found["balance"] == {"force": None, "moment": None}
    with pytest.raises(ValueError, match="'finished'"):
        Results("1", status="finished")


@pytest.fixture(scope="module")
def space():
    return Space.of(two_blocks(), "3d")


def test_a_balance_that_is_no_number_is_not_lost_among_others(space, tmp_path):
    steps = [replace(figures(space, t), balance=(b, 1e-16)) for t, b in ((0.1, 1e-14), (0.2, math.nan), (0.3, 0.0))]
    summary.Summary(tmp_path).write(Results("1", steps=tuple(steps)))
    assert told(tmp_path)["balance"] == {"force": None, "moment": 1e-16}


def test_a_step_adds_its_line_and_the_file_is_as_if_written_at_once(space, tmp_path):
    growing, results = summary.Summary(tmp_path), Results("1", message="two\nlines" + "x" * 3000)
    for k in range(1, 5):
        results = replace(results, steps=(*results.steps, figures(space, 0.25 * k)), memory=10 ** (9 - k))
        growing.write(results)
        one = tmp_path / f"{k}"
        one.mkdir()
        summary.Summary(one).write(results)
        assert (tmp_path / "results.json").read_bytes() == (one / "results.json").read_bytes()
    before = (tmp_path / "results.json").read_bytes()
    more = replace(results, steps=(*results.steps, figures(space, 1.25)))
    with small_files(len(before) + 5), pytest.raises(WriteError, match=r"results\.json: cannot be written"):
        growing.write(more)
    assert (tmp_path / "results.json").read_bytes() == before
    growing.write(replace(results, status="done"))
    assert told(tmp_path)["status"] == "done"


# ---- tables


def test_history_keeps_every_digit_has_an_empty_field_for_nan_and_refuses_other_names(space, tmp_path):
    step, history = figures(space, 0.1 * 3), History(tmp_path)
    history.add(replace(step, contact={"joint": replace(step.contact["joint"], pressure_max=math.nan)}))
    assert (tmp_path / "history.csv").read_text().splitlines()[1].split(",")[::12] == ["0.30000000000000004", ""]
    with pytest.raises(ValueError, match=r"probe\.new"):
        history.add(replace(step, probes={"new": np.zeros(3)}))


def test_a_table_that_cannot_grow_stays_as_it_was(tmp_path, monkeypatch):
    path = tmp_path / "t.csv"
    path.write_bytes(b"one\n")

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tables.os, "fsync", full)
    with pytest.raises(WriteError, match=r"t\.csv: cannot be written"):
        tables.append(path, b"two\n")
    assert path.read_bytes() == b"one\n"


PVD = b'<VTKFile><Collection><DataSet file="a"/></Collection></VTKFile>'


@pytest.mark.parametrize(
    ("name", "content", "opened", "words"),
    [
        ("history.csv", b"a,b\n1,2\n", lambda path: History(path.parent, end=1.0), "no table of lacsolver"),
        (
            *("history.csv", b"time,iterations\n0.25,5\n0.5", lambda path: History(path.parent, end=1.0)),
            "line 3: has a row",
        ),
        ("history.csv", b"time\nnever\n", lambda path: History(path.parent, end=1.0), r"\(could not convert .*never"),
        ("history.csv", None, lambda path: History(path.parent, end=1.0), r"cannot be read \(Is a directory\)"),
        ("solid.pvd", PVD, read_pvd, "cannot be gone on"),
    ],
)
def test_a_file_that_cannot_be_gone_on_with_is_told(tmp_path, name, content, opened, words):
    if content is None:
        (tmp_path / name).mkdir()
    else:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(ReadError, match=words):
        opened(tmp_path / name)


def test_names_of_files_are_safe_and_differ():
    names = ["..", "a/b", "a\\b", "x" * 300, "tab\t\0", "Ä", "ä"]
    stems = list(contact_stems(names).values())
    assert len({s.lower() for s in stems}) == len(names)
    assert all(len(s) < 100 and not set(s) & set('/\\\0\t:*?"<>|') for s in stems)


# ---- fields as VTU


@pytest.mark.vtk
def test_the_body_and_the_skins_of_the_slaves_are_shown(run):
    """Displacements and stresses are compared by a law (test_laws.py), which reads figures of contact from tables."""
    import pyvista

    space, mesh, d, grids = run.space, run.space.mesh, run.space.dim, {}
    for stem in ("solid", *contact_stems(ZONES).values()):
        reader = pyvista.PVDReader(str(run.folder / f"{stem}.pvd"))
        assert tuple(reader.time_values) == TIMES
        reader.set_active_time_value(TIMES[-1])
        (grids[stem],) = reader.read()
    solid, first, _ = grids.values()
    nodes = np.searchsorted(mesh.node_number, solid.point_data["node_number"])
    moved = displacement(mesh.points, TIMES[-1])[nodes] * (np.arange(3) < d)
    np.testing.assert_allclose(solid.warp_by_vector("displacement").points, mesh.points[nodes] + moved, atol=1e-15)
    stress = fields(space, TIMES[-1]).stress[nodes]
    for name, values in zip(("von_mises", *PRINCIPAL), (von_mises(stress), *principal(stress).T), strict=True):
        np.testing.assert_array_equal(solid.point_data[name], values)
    assert np.array_equal(np.isnan(solid.point_data["stress"][:, 0]), ~space.attached[nodes])
    solids = mesh.cell_number[mesh.cell_dim == d]
    assert set(solid.cell_data["cell_number"]) == {*solids, *mesh.cell_number[mesh.cell_groups["plate"]]}
    assert {n for n in solid.cell_data if n.startswith("group:")} == {"group:lower", "group:upper", "group:plate"}
    lower = solid.cell_data["cell_number"][solid.cell_data["group:lower"] == 1]
    assert set(lower) == set(mesh.cell_number[mesh.cell_groups["lower"]])
    sizes = solid.compute_cell_sizes(length=False)["Volume" if d == 3 else "Area"]
    kept = np.isin(solid.cell_data["cell_number"], solids)
    assert sizes[kept].min() > 0 and sizes[kept].sum() == pytest.approx(2.0, rel=1e-6)
    zone, nodes = zone_fields(space, TIMES[-1]), np.searchsorted(mesh.node_number, first.point_data["node_number"])
    numbers = mesh.cell_number[zone.surface.cell]
    rows = np.argsort(numbers)[np.searchsorted(np.sort(numbers), first.cell_data["cell_number"])]
    np.testing.assert_array_equal(numbers[rows], first.cell_data["cell_number"])
    for name, values in {"macro": zone.number, **{name: getattr(zone, name) for name in SHOWN}}.items():
        np.testing.assert_array_equal(first.cell_data[name], values[zone.macro[rows]])
    np.testing.assert_array_equal(first.cell_data["normal"][:, :d], zone.normal[zone.macro[rows]])
    np.testing.assert_array_equal(first.point_data["pressure_recovered"], zone.pressure_recovered[nodes])
    np.testing.assert_array_equal(first.point_data["contact_force"][:, :d], zone.contact_force[nodes])
    if d == 3:  # faces turn outward, as the normals do
        turned = first.extract_surface(algorithm="dataset_surface").compute_normals(
            auto_orient_normals=False, consistent_normals=False, cell_normals=True, point_normals=False
        )
        assert np.allclose(turned.cell_data["Normals"], (0, 0, 1), atol=1e-6)


def test_faces_of_several_types_keep_their_values(tmp_path):
    mesh = two_blocks(3, ("HEXA8", "HEXA8"), plate=False)
    space = Space.of(mesh, "3d")
    surface = Surface.of(mesh, np.random.default_rng(3).permutation(np.flatnonzero(mesh.cell_dim == 2)))
    rows = np.arange(len(surface))
    own = {name: rows * 1.0 for name in ("pressure", "gap", "coverage")}
    own |= {"surface": surface, "macro": rows, "number": rows, "status": rows, "normal": np.eye(3)[rows % 3]}
    zone = replace(zone_fields(space, 1.0), **own)
    VtuSeries(tmp_path, space).write(replace(fields(space, 1.0), zones={"a": zone}), 1)
    back = read(tmp_path / "fields" / "contact_a_0001.vtu")
    assert set(back.cells_by_type) == {"TRIA3", "QUAD4"}
    expected = dict(zip(mesh.cell_number[surface.cell].tolist(), rows, strict=True))
    assert [expected[n] for n in back.cell_number.tolist()] == back.cell_data["pressure"].tolist()


def whole_fields(space):
    n = space.mesh.n_nodes
    return Fields(1.0, np.zeros((n, space.dim)), np.ones((n, space.model.n_stress)), np.zeros((n, space.dim)), {})


@pytest.mark.rows("PYRAM14", "TRIA3")
@pytest.mark.vtk
@pytest.mark.filterwarnings("ignore:6 PYRAM14 are written as PYRAM13")
@pytest.mark.parametrize("name", [*SOLIDS, *PLANES])
def test_every_cell_of_a_body_is_shown(tmp_path, name):
    """And those of MED are the same."""
    import pyvista

    space = Space.of(*((cube(name, 1), "3d") if CELLS[name].dim == 3 else (square(name, 1), "plane_stress")))
    VtuSeries(tmp_path, space).write(whole_fields(space), 1)
    grid = pyvista.read(tmp_path / "fields" / "solid_0001.vtu")
    assert grid.n_cells == sum(len(b.nodes) for b in space.blocks)
    exported(tmp_path, space, whole_fields(space))
    in_vtu, in_med = (read(tmp_path / of).cells_by_type for of in ("fields/solid_0001.vtu", "results.med"))
    assert in_vtu == in_med
    if name != "TRIA7":  # VTK has no measure of it
        sizes = grid.compute_cell_sizes(length=False)["Volume" if space.dim == 3 else "Area"]
        assert sizes.min() > 0 and sizes.sum() == pytest.approx(1.0, rel=1e-6)


# ---- fields as MED


def write_time(folder, space, shown, number=1):
    TimeWriter(folder, space, {}, {}).write(Restart(StepState(1.0), number, np.zeros(space.n_dof), {}, {}, {}), shown)


def exported(folder, space, shown):
    """Write fields as a time of a folder without any other file, and all times there as MED."""
    write_time(folder, space, shown)
    return write_med(folder)


def expected(run, time):
    """Name -> values on all nodes, or (faces' cells, values on them)."""
    told = fields(run.space, time)
    arrays = {"DEPL": told.displacement, "SIEF_NOEU": told.stress, "REAC_NODA": told.reaction}
    arrays["SIEQ_NOEU"] = np.column_stack([von_mises(told.stress), principal(told.stress)[:, ::-1]])
    for name, zone in zip((ZONES[0], SECOND), told.zones.values(), strict=True):
        arrays[f"{name}.contact_force"] = zone.contact_force
        arrays[f"{name}.pressure_recovered.nodes"] = zone.pressure_recovered
        on_faces = {"pressure_recovered": zone.recovered, **{what: getattr(zone, what) for what in SHOWN}}
        arrays |= {f"{name}.{what}": (zone.surface.cell, own[zone.macro]) for what, own in on_faces.items()}
    return arrays


@pytest.mark.rows("plane_strain")
@pytest.mark.medcoupling
def test_medcoupling_reads_every_field_at_every_time(in_med):
    (said,) = ask("say", in_med.folder / "results.med").values()
    mesh, d = in_med.space.mesh, in_med.space.dim
    assert said["name"] == "blocks" and said["space_dim"] == d
    assert set(said["groups"]) == {"lower", "upper", "slave", "master", "plate"}
    assert said["node_number"] == mesh.node_number.tolist()
    med_name = {kind.type: kind.name for kind in MED_CELLS.values()}
    ours = {name: steps for name, steps in said["fields"].items() if not name.startswith("lac_")}
    assert set(ours) == set(expected(in_med, 1.0))
    for name, steps in ours.items():
        assert [(number, time) for number, _, time, _ in steps] == list(enumerate(TIMES, 1)), name
        for _, _, time, parts in steps:
            values = expected(in_med, time)[name]
            if isinstance(values, tuple):
                cells, on_faces = values
                known = on_faces >= (0 if name.endswith("status") else -np.inf)  # false for NaN
                assert known.all() == (not name.endswith((".gap", ".status")))
                cells, on_faces = cells[known], on_faces[known]
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


def test_lacmesh_reads_it_and_its_times_and_components_are_named(in_med):
    mesh, d = read(in_med.folder / "results.med"), in_med.space.dim
    assert mesh.steps["DEPL@2"].time == 0.75 and mesh.steps["DEPL@2"].number == 3
    np.testing.assert_array_equal(mesh.node_data["DEPL@1"], fields(in_med.space, 0.5).displacement)
    assert np.array_equal(np.sort(mesh.cell_data["lac_macro"]), np.sort(in_med.space.mesh.cell_data["lac_macro"]))
    with h5py.File(in_med.folder / "results.med") as file:
        names, moves = (file[f"CHA/{of}"].attrs["NOM"].decode().split() for of in ("SIEF_NOEU", "DEPL"))
        assert file[f"CHA/{SECOND}.status"].attrs["TYP"] == 24
        assert len(file["PROFILS"]) <= 8  # of fields: slave nodes, two types of faces; of the records of the cut
        assert all((np.diff(profile["PFL"]) > 0).all() for profile in file["PROFILS"].values())
    assert names == ["SIXX", "SIYY", "SIZZ", "SIXY", "SIYZ", "SIXZ"][: 4 if d == 2 else 6]
    assert moves == ["DX", "DY", "DZ"][:d]


def test_times_are_counted_as_libmed_wants_them(in_med, tmp_path):
    """Steps in all (LAA), on nodes (LNA), on cells (LCA); also where some were taken out."""
    folder = shutil.copytree(in_med.folder, tmp_path / "out")
    for last, count in ((3, 3), (1, 1)):
        for number in range(last + 1, 4):
            (folder / f"state_{number:04d}.npz").unlink()
        with h5py.File(write_med(folder, tmp_path / "results.med")) as file:
            for name in expected(in_med, 1.0):
                home = file["CHA"][name]
                on = "LNA" if "LGN" in home.attrs else "LCA"
                assert (len(home), home.attrs["LAA"], home.attrs[on]) == (count,) * 3


def test_zones_of_names_that_med_takes_for_one_are_two_and_a_longer_one_is_refused_at_once(space, tmp_path):
    with pytest.raises(WriteError, match="64 bytes at most"):
        check_names(tmp_path, ["x" * 40])
    check_names(tmp_path, ["x" * 39])  # as docs/output.md says
    shown = fields(space, 0.5)
    zones = dict(zip(("a/b", "a_b"), shown.zones.values(), strict=True))
    with h5py.File(exported(tmp_path, space, replace(shown, zones=zones))) as file:
        assert {"a_b.gap", "a_b.gap_2"} <= set(file["CHA"])


@pytest.mark.parametrize("part", [0, 0.1, 0.5, 0.99])
def test_where_an_export_does_not_fit_the_file_is_as_it_was(tmp_path, part):
    space = Space.of(mixture(), "3d")
    path = exported(tmp_path, space, whole_fields(space))
    before = path.read_bytes()
    write_time(tmp_path, space, whole_fields(space), 2)
    growth = write_med(tmp_path, tmp_path / "both.med").stat().st_size - len(before)
    with (
        small_files(len(before) + int(part * growth)),
        pytest.raises(WriteError, match=r"results\.med: cannot be written \(File too large"),
    ):
        write_med(tmp_path)
    assert path.read_bytes() == before
    assert {s.number for s in read(write_med(tmp_path)).steps.values()} == {1, 2}
