"""The table of formats, cell by cell: what is written is read again, and kept, lost with a word, or refused.

Damaged files of every format: an error in one sentence, or a sound mesh. What is wrong in one place of a file is in
`tests/bad_input`; files that are damaged at random are in `tests/fuzz`.
"""

import json
import random
import re
import warnings
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import lacmesh
from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.errors import LacmeshError, LacmeshWarning, ReadError, RequestError, WriteError
from lacmesh.formats import detect_format, read, write
from lacmesh.formats.by_meshio import AT_RISK
from lacmesh.formats.mail import NODES
from lacmesh.formats.registry import FORMATS, OF_NAME
from tests.bad_input.case import SECONDS, alarm
from tests.formats import feature_cases as cases
from tests.formats.feature_cases import BY_TYPE, KEPT, LOST, OF_MESHIO, OURS, REFUSED, TABLE
from tests.samples import samples

#: formats of surfaces, whose features are tried on triangles
SURFACES = ("ply", "stl", "obj", "off")

#: Words on what was chosen for the elements of an .inp, not on what the file lost: a plane that the mesh does not tell.
CHOSEN = re.compile(
    r"\.inp: written as CPS \(plane stress\)|--plane CPE or CAX \(plane=\) for plane strain or axisymmetry"
)


#: further codings of a file, which keep the same
CODINGS = {"binary": {"binary": False}, "compress": {"compress": True}}
WAYS = [
    pytest.param(OF_NAME[row.form], row, options, id="-".join([row.form, *(f"{k}={v}" for k, v in options.items())]))
    for row in TABLE
    for options in (
        {**dict(row.options), **coding}
        for coding in ({}, *(CODINGS[o] for o in CODINGS if o in OF_NAME[row.form].options))
    )
]


def observed(form, row, options, path, mesh, case):
    """Outcome of writing and reading a mesh that has a feature."""
    if form.meshio:
        pytest.importorskip("meshio")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            write(path, mesh, **options)
        except LacmeshError as error:
            assert isinstance(error, WriteError) and not list(path.parent.iterdir())
            return REFUSED
        back = read(path)
    assert all(issubclass(w.category, LacmeshWarning) for w in caught)
    said = [clause for w in caught for clause in str(w.message).split("; ")]
    said = [clause for clause in said if form.name != "inp" or not CHOSEN.fullmatch(clause)]
    for other in case.also:
        if row.keeps(other) == LOST:
            said = [clause for clause in said if not re.search(cases.FEATURES[other].word, clause)]
    if case.kept(mesh, back, cases.matched(mesh, back)):
        ours = said and all("only lacmesh reads" in clause for clause in said)
        if said:
            return OURS if ours else f"kept, and yet warned: {said}"
        return KEPT
    if re.search(case.word, " ".join(said)):
        return LOST
    return BY_TYPE if case is cases.FEATURES["order"] else f"lost without a word ({said})"


def file_in(folder, form):
    """The path of a file of a format in a new folder."""
    folder.mkdir()
    return folder / f"mesh{form.suffixes[0]}"


@pytest.mark.parametrize(("form", "row", "options"), WAYS)
def test_features_are_kept_as_the_table_says(form, row, options, tmp_path):
    bodies = cases.skin if form.name in SURFACES else cases.bare
    outcomes = {}
    for name, case in cases.FEATURES.items():
        outcomes[name] = observed(form, row, options, file_in(tmp_path / name, form), case.mesh(bodies), case)
    assert outcomes == {name: row.keeps(name) for name in cases.FEATURES}


@pytest.mark.parametrize(("form", "row", "options"), WAYS)
def test_types_of_cells_are_kept_or_refused(form, row, options, tmp_path):
    case = cases.Feature(None, cases.same_cells, "\0", also=("digits",))
    outcomes = {}
    for name in cases.TYPES:
        outcomes[name] = observed(form, row, options, file_in(tmp_path / name, form), cases.one_cell(name), case)
    assert outcomes == {name: row.keeps_cells(name) for name in cases.TYPES}


#: suffix -> the numbers of nodes, or one less, that a file of one cell lists; and how the reference calls the format
LISTED = {
    ".med": ("med", lambda path: _in_med(path)),
    ".vtu": ("vtk", lambda path: re.search(r'"connectivity"[^>]*>([^<]*)<', path.read_text())[1]),
    ".inp": ("inp", lambda path: re.search(r"\*ELEMENT[^\n]*\n\d+,([\d,\s]*)", path.read_text())[1].replace(",", " ")),
    ".mail": ("mail", lambda path: re.search(r"\nM1 (.*?)FINSF", path.read_text(), re.DOTALL)[1].replace("N", " ")),
}
#: Orders that the reference lacks: corners as ours, then nodes in the middle of some (U3.01.00, Elements Guide).
MIDDLES = {
    "mail:SEG3": "12", "mail:TRIA6": "12 23 31", "mail:TRIA7": "12 23 31 123", "mail:QUAD8": "12 23 34 41",
    "mail:QUAD9": "12 23 34 41 1234", "mail:TETRA10": "12 23 31 14 24 34", "mail:PYRAM13": "12 23 34 41 15 25 35 45",
    "mail:PENTA15": "12 23 31 14 25 36 45 56 64", "mail:PENTA18": "12 23 31 14 25 36 45 56 64 1254 2365 3146",
    "mail:HEXA20": "12 23 34 41 15 26 37 48 56 67 78 85",
    "mail:HEXA27": "12 23 34 41 15 26 37 48 56 67 78 85 1234 1265 2376 3487 4158 5678 12345678",
    "inp:PENTA18": "12 23 31 45 56 64 14 25 36 1254 2365 3146",
}  # fmt: skip
REFERENCE = json.loads((Path(__file__).parents[1] / "reference" / "node_orders.json").read_text())


def _in_med(path):
    with h5py.File(path) as file:
        (cell,) = file[f"ENS_MAA/mesh/{-1:020d}{-1:020d}/MAI"].values()
        return " ".join(map(str, cell["NOD"][()]))


@pytest.mark.filterwarnings("ignore::lacmesh.errors.LacmeshWarning")
@pytest.mark.parametrize("suffix", LISTED)
def test_order_of_nodes(suffix, tmp_path):
    """Each cell lists its nodes in the order of the reference: those of the programs that define the formats."""
    form, listed = LISTED[suffix]
    options = {".inp": {"target": "abaqus"}, ".vtu": {"binary": False}}.get(suffix, {})
    tried = 0
    for kind, cell in CELLS.items():
        known = next((row for key, row in REFERENCE.get(kind, {}).items() if key.startswith(f"{form}:")), None)
        if (middles := MIDDLES.get(f"{form}:{kind}")) is not None or (form == "mail" and cell.order == 1):
            corners = [tuple(sorted(one)) for one in cell.corners_of_node]
            there = [tuple(sorted(int(k) - 1 for k in word)) for word in (middles or "").split()]
            known = [*range(cell.n_corners), *map(corners.index, there)]
        if known is None:
            continue
        path = tmp_path / f"{kind}{suffix}"
        write(path, replace(cases.one_cell(kind), space_dim=3, name="mesh"), **options)
        found = [int(word) for word in listed(path).split()]
        assert found == [n + (suffix != ".vtu") for n in known], kind
        tried += 1
    assert tried >= 14


OPTIONS = [
    *[("med", "compress", True), ("med", "plane", "CAX"), ("med", "msh", "banana"), ("med", "msh", "2.2")],
    *[("med", "binary", False), ("med", "binary", True), ("vtk", "msh", "2.2")],
]


def test_options_reach_the_format_they_are_for(tmp_path):
    mesh = cases.plane(2)
    for suffix, option, value in OPTIONS:
        with pytest.raises(RequestError, match=f"the option '{option}' is for .*, not for {OF_NAME[suffix].title}"):
            write(tmp_path / f"a.{suffix}", mesh, **{option: value})
    write(tmp_path / "a.inp", mesh, target="abaqus", plane="CAX")
    assert "CAX3" in (tmp_path / "a.inp").read_text()
    for wrong in ({"plane": "S"}, {"target": "ansys"}):
        with pytest.raises(RequestError, match=r"calculix or abaqus, in CPS, CPE, CAX"):
            write(tmp_path / "b.inp", mesh, **wrong)
    with pytest.raises(RequestError, match=r"did you mean \.msh"):
        write(tmp_path / "b.mshh", mesh)
    assert [p.name for p in tmp_path.iterdir()] == ["a.inp"]


@pytest.mark.filterwarnings("ignore::lacmesh.errors.LacmeshWarning")
@pytest.mark.parametrize("form", [form for form in FORMATS if form.begins or form.hdf5], ids=lambda form: form.name)
def test_content_tells_the_format_where_the_suffix_does_not(form, tmp_path):
    """Files of all kinds; the suffix tells a format that is not `sure`, whose text may be that of others."""
    if form.meshio:
        pytest.importorskip("meshio")
    mesh = cases.skin() if form.name in SURFACES else cases.bare()
    for k, options in enumerate(({}, *(CODINGS[o] for o in CODINGS if o in form.options))):
        path = tmp_path / f"{k}{form.suffixes[0]}"
        write(path, mesh, **options)
        assert detect_format(path).format == form.name
        for suffix in (".msh", ".vtu", ".dat", ".unknown") if form.sure else ():
            other = path.rename(path.with_suffix(suffix))
            assert detect_format(other).format == form.name, suffix
            other.rename(path)


def test_the_table_has_the_keywords_of_mail_files():
    for keyword in (*NODES, "TITRE", "COOR_1D", "COOR_2D", "COOR_3D", "GROUP_NO", "GROUP_MA"):
        for before in ("", "% a mesh\n", "% two\n  % comments\n "):
            assert re.match(OF_NAME["mail"].begins, f"{before}{keyword}\nN1".encode()), keyword
    assert not re.match(OF_NAME["mail"].begins, b"COOR_3DX\n")


@pytest.mark.filterwarnings("ignore::lacmesh.errors.LacmeshWarning")
@pytest.mark.parametrize("form", [form for form in FORMATS if not form.meshio], ids=lambda form: form.name)
def test_cells_that_are_refused_are_named_and_nothing_is_left(form, tmp_path):
    for kind in ALL_CELLS:
        try:
            write(tmp_path / f"mesh{form.suffixes[0]}", cases.one_cell(kind))
        except WriteError as error:
            assert re.search(rf"{kind}\b.*the mesh has 1; \w+", str(error)) and not list(tmp_path.iterdir())
        else:
            assert kind not in CELLS or next(row for row in TABLE if row.form == form.name).keeps_cells(kind) != REFUSED
            for file in tmp_path.iterdir():
                file.unlink()


@pytest.mark.parametrize("form", [form for form in FORMATS if not form.meshio], ids=lambda form: form.name)
def test_a_file_that_is_not_there_is_an_error_of_ours(form, tmp_path):
    with pytest.raises(ReadError, match=r"none\.\w+: cannot be read \(No such file"):
        form.read(tmp_path / f"none{form.suffixes[0]}")
    with pytest.raises(WriteError, match="does not exist"):
        write(tmp_path / "nowhere" / f"a{form.suffixes[0]}", cases.bare())


HERE = Path(__file__).parent
POINTS = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
MESHES = {
    "surface": [("triangle", [[0, 1, 3], [0, 3, 2], [4, 5, 7], [4, 7, 6]])],
    "solid": [("tetra", [[0, 1, 3, 5], [0, 3, 2, 6], [0, 5, 3, 6], [4, 6, 5, 0]])],
    "both": [("hexahedron", [[0, 1, 3, 2, 4, 5, 7, 6]]), ("quad", [[0, 1, 3, 2], [4, 5, 7, 6]])],
}
# ---- formats of meshio: refused at once, whatever meshio's reader would do with them


@pytest.mark.meshio
@pytest.mark.parametrize("path", sorted((HERE / "truncated").iterdir()), ids=lambda path: path.name)
def test_a_truncated_file_is_refused_at_once(path):
    with alarm(SECONDS), pytest.raises(ReadError, match=rf"{path.name}: "):
        lacmesh.read(path)


def written(folder, suffix, name):
    """Small files of a format, in text where it has one; what meshio cannot write so is left out."""
    meshio = pytest.importorskip("meshio")
    for cells in MESHES.values():
        for options in ({}, {"binary": False}):
            path = folder / f"whole{suffix}"
            try:
                meshio.write(path, meshio.Mesh(POINTS, cells), file_format=name, **options)
                yield path.read_bytes(), lacmesh.read(path)
            except (Exception, SystemExit):
                continue


def same(one, other):
    cells = zip(one.blocks, other.blocks, strict=False)
    alike = all(np.array_equal(a.nodes, b.nodes) for a, b in cells)
    return np.array_equal(one.points, other.points) and one.n_cells == other.n_cells and alike


#: beginnings of each file that are tried
N = samples(30, 300)


@pytest.mark.fuzz
@pytest.mark.meshio
@pytest.mark.parametrize("suffix", OF_MESHIO)
@pytest.mark.filterwarnings("ignore")
def test_no_beginning_of_a_file_is_taken_for_another_mesh(suffix, tmp_path):
    name, tried = OF_MESHIO[suffix], 0
    for content, whole in written(tmp_path, suffix, name):
        for n in random.Random(suffix).sample(range(1, len(content)), min(len(content) - 1, N)):
            path = tmp_path / f"cut{suffix}"
            path.write_bytes(content[:n])
            tried += 1
            try:
                with alarm(SECONDS):
                    found = lacmesh.read(path)
            except LacmeshError:
                continue
            ends = content[:n].endswith(b"\n")
            assert same(found, whole) or (name in AT_RISK and ends), (n, len(content), content[max(n - 40, 0) : n])
    assert tried >= N or suffix == ".hmf"


@pytest.mark.meshio
def test_a_whole_last_line_may_be_without_its_end_where_words_end_the_format(tmp_path):
    facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet"
    (tmp_path / "a.stl").write_text(f"solid\n{facet}\nendsolid")
    assert lacmesh.read(tmp_path / "a.stl").n_cells == 1
