"""The command as a user meets it: its output, its exit statuses, what it leaves on the disk."""

from __future__ import annotations

import json
import os
import pty
import re
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh import Cut, Mesh, cut_skin
from lacmesh.cells import CELLS
from lacmesh.cli import main
from lacmesh.errors import GroupNotFoundError
from lacmesh.formats import detect_format
from lacmesh.report import describe
from tests.meshes import cell_with_faces, random_mesh

CASES = [
    case
    for case in json.loads((Path(__file__).parent / "reference" / "cases.json").read_text())["cases"]
    if case["kind"] == "cut_counts"
]


@pytest.fixture
def mesh():
    return random_mesh(np.random.default_rng(5), 3, slaves=5)


@pytest.fixture
def msh(tmp_path, mesh):
    path = tmp_path / "part.msh"
    lacmesh.write(path, mesh)
    return path


def run(*args, **options):
    return subprocess.run([sys.executable, "-m", "lacmesh", *map(str, args)], capture_output=True, text=True, **options)


def fails(capsys, *args):
    """The status of a command that is run in this process, and what it says of its errors."""
    capsys.readouterr()
    try:
        status = main([str(a) for a in args])
    except SystemExit as error:
        status = error.code
    return status, capsys.readouterr().err


def info(path, capsys):
    capsys.readouterr()
    assert main(["info", str(path), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


# ---- start


@pytest.mark.parametrize("args", [["--help"], ["--version"], ["cut", "--help"]])
def test_help_and_version_import_no_numpy(args):
    code = (
        f"import sys\nfrom lacmesh.cli import main\ntry: main({args!r})\nexcept SystemExit as e: assert e.code == 0\n"
        "heavy = {'numpy', 'scipy', 'h5py', 'rich', 'gmsh', 'pyvista'} & set(sys.modules)\nassert not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "lacmesh" in done.stdout


def test_importing_the_package_imports_no_numpy():
    code = "import sys, lacmesh; assert 'numpy' not in sys.modules"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_types_lists_every_pattern(capsys):
    assert main(["types"]) == 0
    out = capsys.readouterr().out
    for name in CELLS:
        assert name in out
    assert "5 PYRAM5" in out and "6 HEXA20" in out


# ---- the main job


@pytest.mark.shared
@pytest.mark.parametrize("case", CASES, ids=lambda c: c["id"])
def test_code_aster_counts(case, tmp_path, shared, capsys):
    """Every cut_counts row of code_aster's suite, through the command line, from MED to MED or by turns to msh."""
    suffix = (".med", ".msh")[CASES.index(case) % 2]
    source = shared / "reference" / case["mesh"]
    counts(case, source, suffix, tmp_path, capsys)


@pytest.mark.parametrize("case", CASES, ids=lambda c: c["id"])
def test_code_aster_counts_on_twins(case, tmp_path, capsys):
    """Every cut_counts row holds on generated meshes with the same cells and groups."""
    source = tmp_path / "twin.med"
    lacmesh.write(source, twin(case["id"].rsplit("-", 1)[0]))
    counts(case, source, ".med", tmp_path, capsys)


def counts(case, source, suffix, tmp_path, capsys):
    if case["prepare"]:
        order = "2-full" if "full" in case["prepare"] else "2"
        assert main(["convert", str(source), str(tmp_path / "q.med"), "--order", order]) == 0
        source = tmp_path / "q.med"
    slave = [a for group in case["slave"] for a in ("--slave", group)]
    hexa = ["--hexa", case["hexa"]] if case["hexa"] else []
    target = tmp_path / f"out{suffix}"
    assert main(["cut", str(source), *slave, *hexa, "-o", str(target)]) == 0
    found = info(target, capsys)
    assert {"cells": found["cells"], "nodes": found["nodes"]} == case["expect"]
    assert found["lac"]["zones"] == case["slave"]


def twin(name):
    """One QUAD4, TRIA3 or HEXA8 with all its sides and points, or 12 TETRA4: the meshes of zzzz383a to d."""
    from lacmesh import Mesh
    from lacmesh.cells import CELLS

    if name == "zzzz383d":
        return cube_of_tetrahedra()
    cell = CELLS[{"zzzz383a": "QUAD4", "zzzz383b": "TRIA3", "zzzz383c": "HEXA8"}[name]]
    blocks = {cell.name: [list(range(cell.n_nodes))]}
    for facet in cell.facets:
        blocks.setdefault(facet.type, []).append(list(facet.nodes))
    if cell.dim == 3:
        blocks["SEG2"] = [list(e) for e in cell.edges]
    if name == "zzzz383b":
        blocks["SEG2"] = blocks["SEG2"][:3]
    groups = {f"{'Face' if cell.dim == 3 else 'Edge'}_{k + 1}": [1 + k] for k in range(len(cell.facets))}
    return Mesh.create(np.array(cell.reference), blocks.items(), cell_groups=groups)


def cube_of_tetrahedra():
    """A cube cut into 12 tetrahedra from its centre, all faces and edges of its skin as cells, Face_2 one side."""
    from lacmesh import Mesh

    x = np.array([[a, b, c] for a in (0, 1) for b in (0, 1) for c in (0, 1)] + [[0.5] * 3], float)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))]
    edges = sorted({tuple(sorted((s[k], s[(k + 1) % 4]))) for s in sides for k in range(4)})
    tetrahedra = [(a, c, b, 8) for a, b, c in triangles]
    return Mesh.create(
        x, [("TETRA4", tetrahedra), ("TRIA3", triangles), ("SEG2", edges)], cell_groups={"Face_2": [14, 15]}
    )


def test_output_stands_beside_the_input(msh, capsys):
    assert main(["cut", str(msh), "--slave", "slave"]) == 0
    out = capsys.readouterr().out
    target = msh.with_name("part.lac.msh")
    assert target.exists()
    for word in ("macro-elements of slave", "worst quality", "nodes", "cells", "read", "peak memory"):
        assert word in out
    found = info(target, capsys)
    assert found["lac"] == {"macro_elements": len(lacmesh.read(msh).cell_groups["slave"]), "zones": ["slave"]}


def test_summary_counts_are_those_of_the_meshes(msh, mesh, capsys):
    main(["cut", str(msh), "--slave", "slave", "--hexa", "hexa"])
    out = capsys.readouterr().out
    cut = cut_skin(mesh, "slave", hexa="hexa").mesh
    assert f"+{cut.n_nodes - mesh.n_nodes:,}" in out and f"{cut.n_cells:,}" in out


@pytest.mark.parametrize(("version", "ascii_"), [("4.1", False), ("4.1", True), ("2.2", False), ("2.2", True)])
def test_output_keeps_the_inputs_version_and_kind(tmp_path, mesh, version, ascii_):
    source = tmp_path / "in.msh"
    lacmesh.write(source, mesh, msh=version, binary=not ascii_)
    assert main(["cut", str(source), "--slave", "slave", "-q"]) == 0
    kind = detect_format(tmp_path / "in.lac.msh")
    assert (kind.version, kind.binary) == (version, not ascii_)
    assert main(["cut", str(source), "--slave", "slave", "-q", "--force", "--msh", "2.2", "--ascii"]) == 0
    kind = detect_format(tmp_path / "in.lac.msh")
    assert (kind.version, kind.binary) == ("2.2", False)


@pytest.mark.parametrize("suffix", [".msh", ".med"])
def test_a_cut_written_is_a_cut_when_read_back(tmp_path, mesh, suffix):
    mesh = replace(mesh, cell_groups={**mesh.cell_groups, "one": mesh.cell_groups["slave"][:1]})
    cut = cut_skin(mesh, ["one", "slave"])
    path = tmp_path / f"cut{suffix}"
    lacmesh.write(path, cut.mesh)
    back = Cut(lacmesh.read(path))
    assert back.zones == ("one", "slave") and back.n_macros == cut.n_macros
    for view in ("macro_of_face", "zone_of_face", "child_kind", "parent_of_cell"):
        ours = dict(zip(cut.mesh.cell_number.tolist(), getattr(cut, view).tolist(), strict=True))
        theirs = dict(zip(back.mesh.cell_number.tolist(), getattr(back, view).tolist(), strict=True))
        assert ours == theirs, view
    nodes = lambda c: [sorted(c.mesh.node_number[n].tolist()) for n in c.internal_nodes]  # noqa: E731
    assert nodes(back) == nodes(cut)
    again = cut_skin(back.mesh, ["one", "slave"])
    assert again.mesh is back.mesh


def test_cutting_a_cut_file_writes_it_as_it_was(msh, capsys):
    main(["cut", str(msh), "--slave", "slave", "-q"])
    first = msh.with_name("part.lac.msh")
    assert main(["cut", str(first), "--slave", "slave"]) == 0
    assert "already cut" in capsys.readouterr().out
    a, b = info(first, capsys), info(msh.with_name("part.lac.lac.msh"), capsys)
    assert a == b


@pytest.mark.parametrize(
    ("options", "check"),
    [
        (["--hexa", "auto"], lambda c: True),
        (["--orient", "outward"], lambda c: True),
        (["--node-groups", "keep"], lambda c: len(c.mesh.node_groups["all"]) == 8),
        (["--node-groups", "extend"], lambda c: len(c.mesh.node_groups["all"]) == c.mesh.n_nodes),
        (["--hexa", "hexa"], lambda c: c.mesh.cells_by_type["HEXA8"] == 6),
    ],
)
def test_options_reach_the_cut(tmp_path, options, check):
    source = tmp_path / "h.med"
    lacmesh.write(source, cell_with_faces("HEXA8", inward=True))
    assert main(["cut", str(source), "--slave", "slave", *options, "-q"]) == 0
    assert check(Cut(lacmesh.read(tmp_path / "h.lac.med")))


def test_interface_and_skin_only_reach_the_cut(tmp_path, capsys):
    from tests.test_cut import two_hexas

    lacmesh.write(tmp_path / "two.msh", two_hexas())
    assert main(["cut", str(tmp_path / "two.msh"), "--slave", "slave", "--interface", "refuse"]) == 1
    assert "between two cells" in capsys.readouterr().err
    shell = lacmesh.Mesh.create([[0, 0, 1], [1, 0, 1], [0, 1, 2]], [("TRIA3", [[0, 1, 2]])], cell_groups={"s": [0]})
    lacmesh.write(tmp_path / "shell.med", shell)
    assert main(["cut", str(tmp_path / "shell.med"), "--slave", "s"]) == 1
    assert main(["cut", str(tmp_path / "shell.med"), "--slave", "s", "--skin-only", "-q"]) == 0
    assert Cut(lacmesh.read(tmp_path / "shell.lac.med")).n_macros == 1


def test_groups_by_tag_and_entity(tmp_path):
    mesh = cell_with_faces("HEXA8", (0, 5))
    mesh = replace(
        mesh,
        cell_groups={"2:5": np.array([1]), "top": np.array([2]), "body": np.array([0])},
        group_tags={"2:5": ((2, 5),), "top": ((2, 6),), "body": ((3, 5),)},
        cell_data={"entity": np.array([[3, 1], [2, 17], [2, 18]], np.int32)},
    )
    source = tmp_path / "t.msh"
    lacmesh.write(source, mesh)
    for spec, n in (("2:5", 1), ("6", 1), ("entity:2:17", 1), ("top", 1)):
        assert main(["cut", str(source), "--slave", spec, "-q", "--force"]) == 0
        assert Cut(lacmesh.read(tmp_path / "t.lac.msh")).n_macros == n
    assert main(["cut", str(source), "--slave", "5", "-q", "--force"]) == 2  # 2:5 or 3:5?


# ---- info and convert


def test_info_counts_distinct_cells(msh, mesh, capsys):
    found = info(msh, capsys)
    assert set(found) == {
        "nodes", "cells", "cells_by_type", "groups", "node_groups", "entities", "bounding_box", "lac",
    }  # fmt: skip
    assert found["cells"] == mesh.n_cells and found["nodes"] == mesh.n_nodes
    assert found["cells_by_type"] == mesh.cells_by_type
    volume = found["groups"]["all"].pop("size")
    assert found["groups"]["all"] == {"dim": 3, "cells": mesh.n_cells} and volume > 0
    assert found["groups"]["slave"]["dim"] == 2
    assert found["node_groups"]["every"] == mesh.n_nodes
    np.testing.assert_allclose(found["bounding_box"], [mesh.points.min(axis=0), mesh.points.max(axis=0)])
    assert found["lac"] is None
    assert main(["info", str(msh)]) == 0
    out = capsys.readouterr().out
    assert "msh 4.1 binary" in out and "slave" in out


def in_entities():
    """Three squares in a row and a segment, in entities: surfaces 7 and 8, a curve 7; no groups."""
    points = [[x, y] for y in (0, 1) for x in range(4)]
    squares = [[k, k + 1, k + 5, k + 4] for k in range(3)]
    entity = np.array([[2, 8], [2, 7], [2, 8], [1, 7]], np.int32)
    return Mesh.create(points, [("QUAD4", squares), ("SEG2", [[1, 2]])], cell_data={"entity": entity})


@pytest.mark.parametrize("options", [{}, {"msh": "2.2", "binary": False}])
def test_entities_are_listed_where_there_are_no_groups(options, tmp_path, capsys):
    path = tmp_path / "e.msh"
    lacmesh.write(path, in_entities(), **options)
    found = info(path, capsys)["entities"]
    assert found == [
        {"dim": 1, "tag": 7, "cells": 1, "box": [[1, 0, 0], [2, 0, 0]]},
        {"dim": 2, "tag": 7, "cells": 1, "box": [[1, 0, 0], [2, 1, 0]]},
        {"dim": 2, "tag": 8, "cells": 2, "box": [[0, 0, 0], [3, 1, 0]]},
    ]
    assert main(["info", str(path)]) == 0
    said = capsys.readouterr().out
    assert re.search(r"entity:1:7 +1 +\(1, 0, 0\) \.\. \(2, 0, 0\)", said)
    assert re.search(r"entity:2:8 +2 +\(0, 0, 0\) \.\. \(3, 1, 0\)", said)
    assert main(["cut", str(path), "--slave", "skin", "-o", str(tmp_path / "c.msh")]) == 2
    said = capsys.readouterr().err
    assert "no cell group named 'skin'; there are none, but entity:DIM:TAG names an entity, as entity:1:7" in said
    assert main(["cut", str(path), "--slave", "entity:1:7", "-o", str(tmp_path / "c.msh")]) == 0


def test_entities_among_groups_are_in_the_json_only(tmp_path, capsys):
    path = tmp_path / "e.msh"
    lacmesh.write(path, replace(in_entities(), cell_groups={"skin": np.array([3])}))
    assert len(info(path, capsys)["entities"]) == 3
    assert main(["info", str(path)]) == 0
    assert "entity:" not in capsys.readouterr().out
    assert main(["cut", str(path), "--slave", "skim", "-o", str(tmp_path / "c.msh")]) == 2
    assert capsys.readouterr().err.strip().endswith("did you mean skin?")


def test_a_mesh_with_cells_of_no_entity(capsys):
    """Cells that a group alone added have (-1, -1), and a field of another program may have that name."""
    mesh = in_entities()
    entity = np.where(np.arange(4)[:, None] == 0, -1, mesh.cell_data["entity"])
    found = describe(replace(mesh, cell_data={"entity": entity}))["entities"]
    assert [(e["dim"], e["tag"], e["cells"], e["box"][0][0]) for e in found] == [
        (1, 7, 1, 1),
        (2, 7, 1, 1),
        (2, 8, 1, 2),
    ]
    for other in (np.arange(4), np.ones((4, 2))):
        plain = replace(mesh, cell_data={"entity": other})
        assert plain.entities == describe(plain)["entities"] == []
        with pytest.raises(GroupNotFoundError, match=r"'entity:2:8'; there are none$"):
            plain.cells_of("entity:2:8")


def test_many_entities_are_cut_short_in_the_table(tmp_path, capsys):
    points = np.arange(141)[:, None] * [1.0, 0]
    entity = np.stack([np.ones(140, np.int32), np.arange(140, 0, -1, dtype=np.int32)], axis=1)
    cells = np.arange(140)[:, None] + [0, 1]
    lacmesh.write(tmp_path / "m.msh", Mesh.create(points, [("SEG2", cells)], cell_data={"entity": entity}))
    assert main(["info", str(tmp_path / "m.msh")]) == 0
    said = capsys.readouterr().out
    assert said.count("entity:1:") == 60 and "and 80 entities more, which --json lists" in said


def test_brackets_in_names_are_printed_as_they_are(tmp_path, capsys):
    mesh = replace(cell_with_faces("TETRA4"), cell_groups={"[red]slave[/red] :smile:": np.array([1])})
    lacmesh.write(tmp_path / "b.msh", mesh)
    main(["info", str(tmp_path / "b.msh")])
    assert "[red]slave[/red] :smile:" in capsys.readouterr().out


def test_convert_there_and_back(msh, mesh, tmp_path, capsys):
    med, again = tmp_path / "a.med", tmp_path / "b.msh"
    assert main(["convert", str(msh), str(med)]) == 0
    assert main(["convert", str(med), str(again), "--msh", "2.2", "--ascii"]) == 0
    a, b = info(msh, capsys), info(again, capsys)
    for found in (a, b):
        found["cells_by_type"] = dict(sorted(found["cells_by_type"].items()))
        found["groups"] = dict(sorted(found["groups"].items()))
        found["node_groups"] = dict(sorted(found["node_groups"].items()))
        found.pop("bounding_box")
    assert a == b


# ---- mistakes (tests/bad_input has the others)


def test_no_command_prints_the_help(capsys):
    assert main([]) == 0
    assert "usage: lacmesh" in capsys.readouterr().out


def test_an_output_that_cannot_be_written_whole_leaves_nothing(tmp_path, capsys):
    mesh = cell_with_faces("PENTA18", (0,))
    source = tmp_path / "p.msh"
    lacmesh.write(source, mesh)
    target = tmp_path / "p.med"
    target.write_text("precious")
    assert main(["cut", str(source), "--slave", "slave", "-o", str(target), "--force"]) == 3
    assert "PYRAM14" in capsys.readouterr().err
    assert target.read_text() == "precious"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["p.med", "p.msh"]


def test_a_full_disk_leaves_the_old_file(msh, monkeypatch, capsys):
    target = msh.with_name("part.lac.msh")
    target.write_text("precious")

    def full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("lacmesh.formats.os.fsync", full)
    assert main(["cut", str(msh), "--slave", "slave", "--force"]) == 3
    assert "No space left" in capsys.readouterr().err
    assert target.read_text() == "precious" and len(list(msh.parent.iterdir())) == 2


def test_a_closed_pipe_is_no_error(msh):
    done = subprocess.run(
        f"{sys.executable} -m lacmesh types | head -1", shell=True, capture_output=True, text=True, check=True
    )
    assert "Traceback" not in done.stderr and "Broken" not in done.stderr


def test_progress_is_shown_on_a_terminal_only(msh):
    done = run("cut", msh, "--slave", "slave")
    assert done.stderr == ""
    master, slave = pty.openpty()
    env = {**os.environ, "TERM": "xterm-256color"}
    command = [sys.executable, "-m", "lacmesh", "cut", str(msh), "--slave", "slave", "--force"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=slave, env=env) as child:
        os.close(slave)
        shown = b""
        deadline = time.monotonic() + 300
        while time.monotonic() < deadline:
            try:
                piece = os.read(master, 4096)
            except OSError:
                break
            if not piece:
                break
            shown += piece
    os.close(master)
    assert child.returncode == 0
    assert b"read" in shown and b"write" in shown


@pytest.mark.parametrize("name", [".", "/", "..", "", "nofile", "nofile.msh"])
def test_what_is_no_file_cannot_be_read(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    status, said = fails(capsys, "cut", name, "--slave", "a")
    assert status == 3 and "cannot be read" in said
    assert not list(tmp_path.iterdir())


def test_a_file_without_suffix_gets_its_formats(tmp_path, mesh):
    lacmesh.write(tmp_path / "x.msh", mesh)
    (tmp_path / "x.msh").rename(tmp_path / "bare")
    assert main(["cut", str(tmp_path / "bare"), "--slave", "slave", "-q"]) == 0
    assert Cut(lacmesh.read(tmp_path / "bare.lac.msh")).zones == ("slave",)


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_full_or_closed_output_is_no_internal_error(msh, monkeypatch, unbuffered):
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([sys.executable, "-m", "lacmesh", "info", str(msh)], stdout=full, stderr=subprocess.PIPE)
    assert done.returncode == 3 and b"No space left" in done.stderr and done.stderr.count(b"\n") == 1
    closed = subprocess.run(f"{sys.executable} -m lacmesh info {msh} >&-", shell=True, capture_output=True, text=True)
    assert closed.returncode == 0 and not closed.stderr


def test_a_closed_error_stream_is_no_internal_error(msh):
    """`2>&-`: what is opened next must not become stream 2 either, which libraries write to."""
    words = f"{sys.executable} -m lacmesh cut {msh} --slave slave -o {msh.with_name('out.med')} 2>&-"
    done = subprocess.run(words, shell=True, capture_output=True, text=True)
    assert done.returncode == 0 and "worst quality" in done.stdout
    assert Cut(lacmesh.read(msh.with_name("out.med"))).zones == ("slave",)


ODD = os.fsdecode(b"bad\xff")


@pytest.mark.parametrize("suffix", [".msh", ".med", ".mail", ".inp", ".vtu"])
@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
def test_a_name_that_is_no_utf8_is_a_name(tmp_path, suffix):
    mesh = cell_with_faces("TETRA4")
    lacmesh.write(tmp_path / f"{ODD}{suffix}", mesh)
    assert lacmesh.read(tmp_path / f"{ODD}{suffix}").n_nodes == mesh.n_nodes


def test_xml_cannot_name_a_second_file_that_is_no_utf8(msh, capsys):
    before = sorted(msh.parent.iterdir())
    assert main(["cut", str(msh), "--slave", "slave", "-o", str(msh.with_name(f"{ODD}.xdmf"))]) == 3
    assert "its name is no UTF-8; choose another name" in capsys.readouterr().err
    assert sorted(msh.parent.iterdir()) == before


@pytest.mark.parametrize(
    "words",
    [
        *(("cut", "--slave", "slave", "-o", "x.msh", "--report", f"r.{kind}") for kind in ("html", "md", "json")),
        ("view", "-o", "v.html"),
        ("view", "-o", "v.html", "--title", ODD),
        ("quality", "--plot", "q.png"),
    ],
    ids=" ".join,
)
def test_reports_and_pages_of_a_file_whose_name_is_no_utf8(words, msh, monkeypatch, capsys):
    monkeypatch.chdir(msh.parent)
    source = msh.rename(f"{ODD}.msh")
    assert main([words[0], str(source), *words[1:]]) == 0, capsys.readouterr().err


def test_summary_says_the_worst_quality_before_and_after(tmp_path, capsys):
    from lacmesh.quality import worst

    mesh = cell_with_faces("TETRA4")
    lacmesh.write(tmp_path / "t.msh", mesh)
    main(["cut", str(tmp_path / "t.msh"), "--slave", "slave"])
    after = cut_skin(mesh, "slave").mesh
    line = next(row for row in capsys.readouterr().out.splitlines() if "worst quality" in row)
    figures = [float(word) for word in line.split()[-2:]]
    assert figures == [round(worst(m, np.arange(m.n_cells)), 3) for m in (mesh, after)]
    assert figures[1] < figures[0]


def test_a_link_to_a_file_stays_a_link(tmp_path, mesh):
    (tmp_path / "real.msh").write_text("old")
    (tmp_path / "link.msh").symlink_to("real.msh")
    lacmesh.write(tmp_path / "link.msh", mesh)
    assert (tmp_path / "link.msh").is_symlink()
    assert lacmesh.read(tmp_path / "real.msh").n_cells == mesh.n_cells


def test_coordinates_that_are_no_numbers_are_not_written(tmp_path, mesh):
    points = mesh.points.copy()
    points[3] = np.nan
    with pytest.raises(lacmesh.LacmeshError, match=f"nodes {mesh.node_number[3]} are not finite"):
        lacmesh.write(tmp_path / "n.msh", replace(mesh, points=points))
    assert not list(tmp_path.iterdir())


def test_info_says_the_tags_that_groups_go_by(tmp_path, capsys):
    mesh = replace(cell_with_faces("HEXA8"), group_tags={"slave": ((2, 5),), "body": ((3, 5),)})
    lacmesh.write(tmp_path / "t.msh", mesh)
    assert main(["info", str(tmp_path / "t.msh")]) == 0
    out = capsys.readouterr().out
    assert "2:5" in out and "3:5" in out
    assert main(["info", str(tmp_path / "t.msh"), "--mesh", "other"]) == 2


@pytest.mark.parametrize("command", [["convert"], ["orient", "--group", "slave"], ["cut", "--slave", "slave"]])
@pytest.mark.parametrize(
    ("target", "option", "told"),
    [
        ("b.med", ["--msh", "2.2"], "--msh is for a .msh output, and "),
        ("b.vtu", ["--msh", "2.2"], "--msh is for a .msh output, and "),
        ("b.med", ["--ascii"], "--ascii is for a .msh, .vtu or .xdmf output, and "),
        ("b.inp", ["--ascii"], "--ascii is for a .msh, .vtu or .xdmf output, and "),
        ("b.msh", ["--all-cells"], "--all-cells is for an .inp output, and "),
    ],
)
def test_an_option_that_the_format_does_not_take(command, target, option, told, msh, tmp_path, capsys):
    """It was ignored: `convert x.msh b.med --msh 2.2 --ascii` wrote what it could."""
    place = [str(tmp_path / target)] if command == ["convert"] else ["-o", str(tmp_path / target)]
    assert main([command[0], str(msh), *command[1:], *place, *option]) == 2
    assert told in capsys.readouterr().err
    assert not (tmp_path / target).exists()


#: clears the screen, sets the title, rings; C1's own escape; turns what follows round
_SPELL = "\x1b[2J\x1b]0;pwn\x07x\x9b31m\u202e"


def _raw(text):
    return [c for c in text if not c.isprintable() and c != "\n"]


@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
@pytest.mark.parametrize(
    "command",
    [
        ["info"],
        ["info", "--json"],
        ["check", "--slave", _SPELL],
        ["check", "--slave", _SPELL, "--json"],
        ["check", "--slave", "nobody"],
        ["quality"],
        ["quality", "--json"],
        ["quality", "--group", _SPELL],
        ["cut", "--slave", _SPELL, "-o", "cut.vtu"],
        ["cut", "--slave", _SPELL, "--slave", "nobody", "-o", "cut.vtu"],
        ["orient", "--group", _SPELL, "-o", "out.vtu"],
        ["view", "-o", "a.html", "--slave", _SPELL],
    ],
    ids=lambda c: " ".join(c[:1] + c[2:]).replace(_SPELL, "SPELL"),
)
def test_names_from_files_are_no_commands_to_the_terminal(command, mesh, tmp_path, capsys, monkeypatch):
    """`lacmesh info` printed a group's name raw, which cleared the screen of who looked at the file."""
    monkeypatch.chdir(tmp_path)
    names = {_SPELL if name == "slave" else name: cells for name, cells in mesh.cell_groups.items()}
    lacmesh.write("a.vtu", replace(mesh, cell_groups=names, node_groups={"n" + _SPELL: np.arange(3)}))
    main([command[0], "a.vtu", *command[1:]])
    said = capsys.readouterr()
    assert not _raw(said.out) and not _raw(said.err)
    if "--json" in command:
        assert json.dumps(_SPELL)[1:-1] in json.dumps(json.loads(said.out))
    elif command == ["info"]:
        assert r"\x1b[2J\x1b]0;pwn\x07x\x9b31m\u202e" in said.out
    for page in tmp_path.glob("*.html"):
        assert "\x1b" not in page.read_text(encoding="utf-8")


def test_a_terminal_has_its_colours_and_no_others(mesh, tmp_path):
    """Tables are coloured where somebody looks, and names are escaped there too."""
    groups = {_SPELL if name == "slave" else name: cells for name, cells in mesh.cell_groups.items()}
    lacmesh.write(tmp_path / "a.vtu", replace(mesh, cell_groups=groups))
    ours, theirs = pty.openpty()
    command = [sys.executable, "-m", "lacmesh", "check", str(tmp_path / "a.vtu"), "--slave", _SPELL]
    with subprocess.Popen(command, stdout=theirs, stderr=subprocess.DEVNULL, env=os.environ | {"TERM": "xterm"}) as run:
        os.close(theirs)
        text = b""
        with suppress(OSError):  # the other end is closed
            while piece := os.read(ours, 4096):
                text += piece
        run.wait()
    os.close(ours)
    text = text.decode()
    assert "\x1b[" in text, "colours"
    assert not _raw(re.sub(r"\x1b\[[\d;]*m", "", text).replace("\r\n", "\n"))
