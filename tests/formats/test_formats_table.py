"""The table of formats, cell by cell: what is written is read again, and kept, lost with a word, or refused."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest

from lacmesh.errors import LacmeshError, LacmeshWarning, WriteError
from lacmesh.formats import SUFFIXES, read, write
from lacmesh.formats.fidelity import BY_TYPE, FEATURES, KEPT, LOST, REFUSED, ROWS
from lacmesh.formats.table import FORMATS, OF_NAME
from tests.formats import feature_cases as cases

#: formats of surfaces, whose features are tried on triangles
SURFACES = ("ply", "stl", "obj", "off")


def observed(row, path, mesh, kept, word):
    """What becomes of a mesh that has a feature."""
    meshio = OF_NAME[row.format].meshio
    if meshio:
        pytest.importorskip("meshio")
    if row.format == "exodus":
        pytest.importorskip("netCDF4")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            write(path, mesh, **row.options)
        except LacmeshError as error:
            assert isinstance(error, WriteError) and not list(path.parent.iterdir())
            return REFUSED
        back = read(path)
    if kept(mesh, back, cases.matched(mesh, back)):
        return KEPT
    said = [str(w.message) for w in caught if issubclass(w.category, LacmeshWarning)]
    if re.search(word, " ".join(said)):
        return LOST
    return BY_TYPE if kept is cases.FEATURES["order"].kept else f"lost without a word ({said})"


@pytest.mark.parametrize("row", ROWS, ids=lambda r: r.title.replace(" ", "_"))
@pytest.mark.parametrize("feature", FEATURES)
def test_a_feature_is_kept_as_the_table_says(row, feature, tmp_path):
    case = cases.FEATURES[feature]
    mesh = case.mesh(cases.skin if row.format in SURFACES else cases.bare)
    path = tmp_path / f"mesh{OF_NAME[row.format].suffixes[0]}"
    assert observed(row, path, mesh, case.kept, case.word) == row.keeps(feature)


@pytest.mark.parametrize("row", ROWS, ids=lambda r: r.title.replace(" ", "_"))
@pytest.mark.parametrize("kind", cases.TYPES)
def test_a_type_of_cell_is_kept_or_refused(row, kind, tmp_path):
    def kept(before, after, to):
        return before.cells_by_type == after.cells_by_type and bool((to.cell >= 0).all())

    path = tmp_path / f"mesh{OF_NAME[row.format].suffixes[0]}"
    wanted = KEPT if kind in row.takes else REFUSED
    assert observed(row, path, cases.one_cell(kind), kept, "\0") == wanted


def test_every_feature_and_format_is_in_the_table():
    assert set(cases.FEATURES) == set(FEATURES)
    assert {r.format for r in ROWS} == {f.name for f in FORMATS}
    assert all(r.lost | r.refused <= set(FEATURES) for r in ROWS)
    assert len({r.title for r in ROWS}) == len(ROWS)


def test_a_case_can_fail():
    """Every case sees a mesh that has lost its feature."""
    for key, case in cases.FEATURES.items():
        mesh = case.mesh(cases.bare)
        spoilt = _without(mesh, key)
        assert case.kept(mesh, mesh, cases.matched(mesh, mesh)), key
        assert not case.kept(mesh, spoilt, cases.matched(mesh, spoilt)), key


def _without(mesh, key):
    """A mesh of the same cells and nothing else, and where these are the feature, of others."""
    points, blocks = mesh.points, [(b.type, b.nodes) for b in mesh.blocks]
    rest = {"space_dim": mesh.space_dim}
    if key == "loose":
        blocks = [(kind, nodes[:1]) for kind, nodes in blocks]
    if key == "orphan":
        points = points[:-1]
    if key in ("plane", "flat"):
        rest["space_dim"] = 5 - mesh.space_dim
    if key == "digits":
        points = np.nextafter(points, np.inf)
    return type(mesh).create(points, blocks, **rest)


def test_suffixes_are_those_of_the_table():
    assert {s for f in FORMATS for s in f.suffixes} == set(SUFFIXES)
    assert SUFFIXES[".msh"] == "msh" and SUFFIXES[".h5m"] == "h5m"


def test_meshio_has_no_other_format():
    """What meshio knows is taken, or left for a reason."""
    pytest.importorskip("meshio")
    from meshio._helpers import extension_to_filetypes, reader_map

    from lacmesh.formats.by_meshio import NOT_TAKEN
    from lacmesh.formats.table import OF_MESHIO

    known = {suffix: name for suffix, names in extension_to_filetypes.items() for name in names}
    assert {s: n for s, n in known.items() if n not in NOT_TAKEN} == OF_MESHIO
    assert set(OF_MESHIO.values()) <= set(reader_map)
