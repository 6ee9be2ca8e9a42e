"""The commands `lacmesh cut`, `info` and `convert`: what they print, their statuses, what they leave on the disk.

What all commands share is in test_commands.py, wrong inputs are in tests/bad_input.
"""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh import Cut, Mesh, cut_skin, generate, raise_order
from lacmesh.errors import GroupNotFoundError
from lacmesh.formats import detect_format
from lacmesh.report import describe
from tests.meshes import cell_with_faces, random_mesh, worst


@pytest.fixture
def mesh():
    return random_mesh(np.random.default_rng(5), 3, slaves=5)


@pytest.fixture
def msh(tmp_path, monkeypatch, mesh):
    """A file of this mesh in the folder that is worked in."""
    monkeypatch.chdir(tmp_path)
    lacmesh.write("part.msh", mesh)
    return tmp_path / "part.msh"


@pytest.fixture
def info(run):
    return lambda path: json.loads(run(f"info {path} --json"))


# ---- the main job


def test_the_output_stands_beside_the_input_and_the_summary_counts_what_is_new(msh, mesh, run, info):
    out, cut = run("cut part.msh --slave slave"), cut_skin(mesh, "slave")
    for word in ("macro-elements of slave", "worst quality", "nodes", "cells", "read", "peak memory"):
        assert word in out
    assert f"+{cut.mesh.n_nodes - mesh.n_nodes:,}" in out and f"{cut.mesh.n_cells:,}" in out
    first = info("part.lac.msh")
    assert first["lac"] == {"macro_elements": len(mesh.cell_groups["slave"]), "zones": ["slave"]}
    assert "already cut" in run("cut part.lac.msh --slave slave")
    assert info("part.lac.lac.msh") == first


def test_the_summary_says_the_worst_quality_before_and_after(run):
    mesh = cell_with_faces("TETRA4")
    lacmesh.write("t.msh", mesh)
    rows = run("cut t.msh --slave slave").splitlines()
    figures = [float(word) for word in next(row for row in rows if "worst quality" in row).split()[-2:]]
    cut = cut_skin(mesh, "slave").mesh
    assert figures == [round(worst(m), 3) for m in (mesh, cut)] and figures[1] < figures[0]


@pytest.mark.parametrize(("version", "ascii_"), [("4.1", False), ("4.1", True), ("2.2", False), ("2.2", True)])
def test_output_keeps_the_inputs_version_and_kind(mesh, run, version, ascii_):
    lacmesh.write("in.msh", mesh, msh=version, binary=not ascii_)
    for options, expected in (("", (version, not ascii_)), ("--force --msh 2.2 --ascii", ("2.2", False))):
        run(f"cut in.msh --slave slave -q {options}")
        kind = detect_format(Path("in.lac.msh"))
        assert (kind.version, kind.binary) == expected


@pytest.mark.parametrize(
    ("options", "check"),
    [
        ("--hexa auto --orient outward", lambda c: c.n_macros == 1),
        ("--node-groups keep", lambda c: len(c.mesh.node_groups["all"]) == 8),
        ("--node-groups extend", lambda c: len(c.mesh.node_groups["all"]) == c.mesh.n_nodes),
        ("--hexa hexa", lambda c: c.mesh.cells_by_type["HEXA8"] == 6),
    ],
)
def test_options_reach_the_cut(run, options, check):
    lacmesh.write("h.med", cell_with_faces("HEXA8", inward=True))
    run(f"cut h.med --slave slave {options} -q")
    assert check(Cut(lacmesh.read("h.lac.med")))


def test_interface_and_skin_only_reach_the_cut(run):
    lacmesh.write("two.msh", generate.box((2, 1, 1)).with_groups("inner", slave=lambda x: x[0] == 0.5))
    said = run("cut two.msh --slave slave --interface refuse", 1)
    assert "between two cells" in said
    shell = Mesh.create([[0, 0, 1], [1, 0, 1], [0, 1, 2]], [("TRIA3", [[0, 1, 2]])], cell_groups={"s": [0]})
    lacmesh.write("shell.med", shell)
    run("cut shell.med --slave s", 1)
    run("cut shell.med --slave s --skin-only -q")
    assert Cut(lacmesh.read("shell.lac.med")).n_macros == 1


def test_groups_by_tag_and_entity_and_a_file_without_suffix(run):
    mesh = replace(
        cell_with_faces("HEXA8", (0, 5)),
        cell_groups={"2:5": np.array([1]), "top": np.array([2]), "body": np.array([0])},
        group_tags={"2:5": ((2, 5),), "top": ((2, 6),), "body": ((3, 5),)},
        cell_data={"entity": np.array([[3, 1], [2, 17], [2, 18]], np.int32)},
    )
    lacmesh.write("t.msh", mesh)
    out = run("info t.msh")
    assert "2:5" in out and "3:5" in out
    run("info t.msh --mesh other", 2)
    Path("t.msh").rename("bare")
    for spec in ("2:5", "6", "entity:2:17", "top"):
        run(f"cut bare --slave {spec} -q --force")
        assert Cut(lacmesh.read("bare.lac.msh")).n_macros == 1
        run(f"check bare.lac.msh --slave {spec} -q")
        run(f"quality bare.lac.msh --group {spec} -q")
        run(f"orient bare.lac.msh --group {spec} -o o.msh -q --force")
    said = run("cut bare --slave 5 -q --force", 2)
    assert "tag 5 means several groups" in said


# ---- info and convert


def test_info_counts_distinct_cells(msh, mesh, info, run):
    found = info(msh)
    assert set(found) == {
        "nodes", "cells", "cells_by_type", "groups", "node_groups", "entities", "bounding_box", "lac",
    }  # fmt: skip
    assert found["cells"] == mesh.n_cells and found["nodes"] == mesh.n_nodes and found["lac"] is None
    assert found["cells_by_type"] == mesh.cells_by_type
    volume = found["groups"]["all"].pop("size")
    assert found["groups"]["all"] == {"dim": 3, "cells": mesh.n_cells} and volume > 0
    assert found["groups"]["slave"]["dim"] == 2 and found["node_groups"]["every"] == mesh.n_nodes
    np.testing.assert_allclose(found["bounding_box"], [mesh.points.min(axis=0), mesh.points.max(axis=0)])
    out = run("info part.msh")
    assert "msh 4.1 binary" in out and "slave" in out


def in_entities():
    """Three squares in a row and a segment, in entities: surfaces 7 and 8, a curve 7; no groups."""
    points = [[x, y] for y in (0, 1) for x in range(4)]
    squares = [[k, k + 1, k + 5, k + 4] for k in range(3)]
    entity = np.array([[2, 8], [2, 7], [2, 8], [1, 7]], np.int32)
    return Mesh.create(points, [("QUAD4", squares), ("SEG2", [[1, 2]])], cell_data={"entity": entity})


@pytest.mark.parametrize("options", [{}, {"msh": "2.2", "binary": False}])
def test_entities_are_listed_where_there_are_no_groups(options, run, info):
    lacmesh.write("e.msh", in_entities(), **options)
    assert info("e.msh")["entities"] == [
        {"dim": 1, "tag": 7, "cells": 1, "box": [[1, 0, 0], [2, 0, 0]]},
        {"dim": 2, "tag": 7, "cells": 1, "box": [[1, 0, 0], [2, 1, 0]]},
        {"dim": 2, "tag": 8, "cells": 2, "box": [[0, 0, 0], [3, 1, 0]]},
    ]
    out = run("info e.msh")
    assert re.search(r"entity:1:7 +1 +\(1, 0, 0\) \.\. \(2, 0, 0\)", out)
    assert re.search(r"entity:2:8 +2 +\(0, 0, 0\) \.\. \(3, 1, 0\)", out)
    said = run("cut e.msh --slave skin -o c.msh", 2)
    assert "there are none, but entity:DIM:TAG names an entity, as entity:1:7" in said
    run("cut e.msh --slave entity:1:7 -o c.msh")


def test_entities_among_groups_are_in_the_json_only(run, info):
    lacmesh.write("e.msh", replace(in_entities(), cell_groups={"skin": np.array([3])}))
    assert len(info("e.msh")["entities"]) == 3 and "entity:" not in run("info e.msh")
    said = run("cut e.msh --slave skim -o c.msh", 2)
    assert said.strip().endswith("did you mean skin?")


def test_a_mesh_with_cells_of_no_entity():
    """Cells that a group alone added have (-1, -1), and a field of another program may have that name."""
    mesh = in_entities()
    entity = np.where(np.arange(4)[:, None] == 0, -1, mesh.cell_data["entity"])
    found = describe(replace(mesh, cell_data={"entity": entity}))["entities"]
    assert [(*(e[k] for k in ("dim", "tag", "cells")), e["box"][0][0]) for e in found] == [
        *((1, 7, 1, 1), (2, 7, 1, 1), (2, 8, 1, 2)),
    ]
    for other in (np.arange(4), np.ones((4, 2))):
        plain = replace(mesh, cell_data={"entity": other})
        assert plain.entities == describe(plain)["entities"] == []
        with pytest.raises(GroupNotFoundError, match=r"'entity:2:8'; there are none$"):
            plain.cells_of("entity:2:8")


def test_many_entities_are_cut_short_in_the_table_and_brackets_are_printed_as_they_are(run):
    entity = np.stack([np.ones(140, np.int32), np.arange(140, 0, -1, dtype=np.int32)], axis=1)
    lacmesh.write("m.msh", replace(generate.line(140, (0, 0), (1, 0)), cell_data={"entity": entity}, cell_groups={}))
    out = run("info m.msh")
    assert out.count("entity:1:") == 60 and "and 80 entities more, which --json lists" in out
    mesh = replace(cell_with_faces("TETRA4"), cell_groups={"[red]slave[/red] :smile:": np.array([1])})
    lacmesh.write("b.msh", mesh)
    assert "[red]slave[/red] :smile:" in run("info b.msh")


def test_convert_there_and_back(msh, mesh, run, info):
    run("convert part.msh a.med")
    run("convert a.med b.msh --msh 2.2 --ascii")
    one, other = info(msh), info("b.msh")
    assert one.pop("bounding_box") and other.pop("bounding_box")
    assert one == other  # groups and types are in any order
    run("convert part.msh q.med --order 2-full")
    assert info("q.med")["cells_by_type"] == raise_order(mesh, "2-full").cells_by_type


# ---- what is written


def test_an_output_that_cannot_be_written_whole_leaves_the_old_file(msh, run, monkeypatch):
    lacmesh.write("p.msh", cell_with_faces("PENTA18", (0,)))
    before = {"p.med": "precious", "part.lac.msh": "precious"}
    for name, text in before.items():
        Path(name).write_text(text)
    said = run("cut p.msh --slave slave -o p.med --force", 3)
    assert "PYRAM14" in said

    def full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("lacmesh.formats.os.fsync", full)
    said = run("cut part.msh --slave slave --force", 3)
    assert "No space left" in said
    assert {path.name: path.read_text() for path in Path().iterdir() if path.name in before} == before
    assert {path.name for path in Path().iterdir()} == {*before, "p.msh", "part.msh"}


def test_a_link_to_a_file_stays_a_link_and_coordinates_that_are_no_numbers_are_not_written(tmp_path, mesh):
    points = mesh.points.copy()
    points[3] = np.nan
    with pytest.raises(lacmesh.LacmeshError, match=f"nodes {mesh.node_number[3]} are not finite"):
        lacmesh.write(tmp_path / "n.msh", replace(mesh, points=points))
    assert not list(tmp_path.iterdir())
    (tmp_path / "real.msh").write_text("old")
    (tmp_path / "link.msh").symlink_to("real.msh")
    lacmesh.write(tmp_path / "link.msh", mesh)
    assert (tmp_path / "link.msh").is_symlink() and lacmesh.read(tmp_path / "real.msh").n_cells == mesh.n_cells
