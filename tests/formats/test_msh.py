"""msh: what is written is read back, gmsh and we see the same; the table of entities, split where groups differ."""

from contextlib import nullcontext

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.errors import DataError, LacmeshWarning, ReadError, WriteError
from lacmesh.formats import msh
from lacmesh.formats.entities import assign
from lacmesh.gmsh import to_mesh
from lacmesh.mesh import Mesh, Model, Periodic, Step
from tests.formats.msh_meshes import as_seen, decided, entities, meshes, places, plain, seen_by, two_boxes
from tests.formats.msh_meshes import order as order_of
from tests.formats.texts import ASCII4, OLD, swapped
from tests.meshes import lenient
from tests.samples import samples

KINDS = [("4.1", True), ("4.1", False), ("2.2", True), ("2.2", False)]
kinds = pytest.mark.parametrize(("version", "binary"), KINDS)
some = settings(max_examples=samples(15, 40), deadline=None, suppress_health_check=list(HealthCheck))


TRIANGLE = [("TRIA3", [[0, 1, 2]])]


def again(tmp_path, mesh, version="4.1", binary=True):
    """A mesh written and read."""
    path = tmp_path / "again.msh"
    msh.write(path, mesh, msh=version, binary=binary)
    return msh.read(path)


@pytest.mark.rows("4.1-False", "2.2-True")
@pytest.mark.fuzz
@kinds
@some
@given(mesh=meshes())
def test_round_trip(tmp_path_factory, version, binary, mesh):
    """What was read once is written in any version, and read without any change."""
    folder = tmp_path_factory.mktemp("msh")
    with lenient():
        read = again(folder, mesh, version, binary)
        assert plain(read) == plain(mesh)
        for name, tags in mesh.group_tags.items():
            assert set(tags) <= set(read.group_tags[name])
        found = entities(read)
        assert version == "2.2" or set(found) == {"boundary", "node", *(["cell"] if mesh.n_cells else [])}
        assert found.items() <= decided(mesh).items()
        assert [b.type for b in read.blocks] == list(dict.fromkeys(plain(read)["cells"][n][0] for n in order_of(read)))
        if version == "2.2":
            assert order_of(read) == order_of(mesh)
        same = again(folder, read, version, binary)
        first = (folder / "again.msh").read_bytes()
        assert order_of(same) == order_of(read)
        again(folder, same, version, binary)
        assert (folder / "again.msh").read_bytes() == first
        if version == "4.1":
            for way in [(version, binary), *KINDS]:
                same = again(folder, same, *way)
                assert (plain(same), entities(same), same.group_tags) == (plain(read), entities(read), read.group_tags)


GMSH_TYPES = (*tuple(t for t in CELLS if t != "TRIA7"), "SEG4", "TRIA10", "QUAD16", "TETRA20")
PLAIN_NAMES = {"slave", "A", "b c", "Körper", "$End", "a'b", " pad ", "2:7", "2:12"}


def save(gmsh, path, version, binary, save_all=1):
    """Let gmsh write its model."""
    for name, value in (("MshFileVersion", float(version)), ("Binary", binary), ("SaveAll", save_all)):
        gmsh.option.setNumber(f"Mesh.{name}", value)
    gmsh.write(str(path))


@pytest.mark.gmsh
@kinds
@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(mesh=meshes(kinds=GMSH_TYPES, tidy=True))
def test_gmsh_reads_what_we_write(gmsh, tmp_path_factory, version, binary, mesh):
    folder = tmp_path_factory.mktemp("msh")
    with lenient():
        read = again(folder, mesh, version, binary)
    seen, meant = seen_by(gmsh, folder / "again.msh"), as_seen(read)
    assert seen["complaints"] == []
    if version == "2.2":  # gmsh keeps no nodes without cells, and one group for each cell
        used = {n for row in meant["elements"].values() for n in row[1:]}
        meant["points"] = {n: p for n, p in meant["points"].items() if n in used}
    assert seen["points"] == meant["points"] and seen["elements"] == meant["elements"]
    taken = set()
    for tag, (name, members) in sorted(meant["groups"].items()):
        if version == "2.2":
            members = members - taken
            taken |= members
        got_name, got = seen["groups"].pop(tag, (name, set()))
        assert got == members
        assert got_name == name or name not in PLAIN_NAMES
    assert not seen["groups"]


@pytest.mark.rows("2-0-1-2.2-True", "1-3-0-4.1-True", "1-3-0-2.2-False")
@pytest.mark.gmsh
@kinds
@pytest.mark.parametrize(("order", "parts", "save_all"), [(1, 0, 0), (2, 0, 1), (1, 3, 0)])
def test_files_of_gmsh(gmsh, tmp_path, version, binary, order, parts, save_all):
    two_boxes(gmsh, order, parts)
    path = tmp_path / "boxes.msh"
    save(gmsh, path, version, binary, save_all)
    groups, every, _ = places(to_mesh())
    with lenient():
        mesh = msh.read(path)
        got, rows, n = places(mesh)
        assert len(rows) == n
        if version == "2.2" and save_all:  # gmsh writes every group's tag as 0
            assert not any(got.values())
        else:
            assert got == groups
            assert set(mesh.group_tags["left part"]) == {(2, 9), (3, 7)}
        assert rows == every if save_all else rows == set().union(*groups.values())
        if parts:
            assert set(mesh.cell_data["partition"].tolist()) <= {-1, 1, 2, 3}
            assert (mesh.cell_data["partition"][mesh.cell_dim == 3] > 0).all()
            assert set(mesh.cell_data["entity"][mesh.cell_dim == 3, 1].tolist()) == {1}
        if version == "4.1":
            assert mesh.model.boundary[3, 1]
        assert mesh.model.periodic
        for v, b in KINDS:
            copy = again(tmp_path, mesh, v, b)
            assert plain(copy) == plain(mesh)
            assert entities(mesh).items() <= entities(copy).items()
            assert v != version or parts or order_of(copy) == order_of(mesh)
            assert not seen_by(gmsh, tmp_path / "again.msh")["complaints"]


@pytest.mark.gmsh
@kinds
def test_gmsh_sees_fields_and_keeps_our_section(gmsh, tmp_path, version, binary):
    rng = np.random.default_rng(0)
    mesh = Mesh.create(
        rng.normal(size=(9, 3)),
        [("TRIA7", [[0, 1, 2, 3, 4, 5, 6]]), ("QUAD4", [[0, 1, 2, 7], [1, 2, 7, 8]])],
        cell_data={"T": np.array([1.0, 2.0, np.nan]), "six": rng.normal(size=(3, 6))},
        node_data={"U": rng.normal(size=(9, 3))},
        node_groups={"some": [2, 5], "$End": [0]},
        steps={"T": Step("T", 2, -1, 0.75)},
        zones=("zone",),
    )
    with lenient():
        read = again(tmp_path, mesh, version, binary)
        assert plain(read) == plain(mesh)
        assert seen_by(gmsh, tmp_path / "again.msh")["complaints"] == []
    views = {gmsh.view.option.getString(t, "Name"): t for t in gmsh.view.getTags()}
    kind, tags, values, time, _ = gmsh.view.getModelData(views["T"], 2)
    assert (kind, tags.tolist(), np.concatenate(values).tolist(), time) == ("ElementData", [1, 2], [1.0, 2.0], 0.75)
    values = np.array(gmsh.view.getModelData(views["U"], 0)[2])
    assert np.allclose(values, mesh.node_data["U"], atol=0)
    save(gmsh, tmp_path / "saved.msh", "4.1", binary)
    with lenient():
        saved = msh.read(tmp_path / "saved.msh")
    assert saved.zones == ("zone",)
    if version == "4.1":  # from msh 2.2 gmsh drops the nodes without a cell, and our numbers do not fit any more
        assert plain(saved)["node_groups"] == plain(mesh)["node_groups"]
        assert plain(saved)["cells"] == plain(mesh)["cells"]


@kinds
def test_numbers_that_are_not_distinct_are_counted_again(tmp_path, version, binary):
    mesh = Mesh.create(np.eye(3), [("TRIA3", [[0, 1, 2]])], node_number=np.array([4, 4, 0]), node_groups={"g": [1]})
    with pytest.warns(LacmeshWarning, match="numbers of nodes are not positive and distinct"):
        read = again(tmp_path, mesh, version, binary)
    assert read.node_number.tolist() == [1, 2, 3]
    assert read.node_groups["g"].tolist() == [1]


@pytest.mark.parametrize("version", ["4.1", "2.2"])
def test_what_msh_cannot_hold_is_an_error(tmp_path, version):
    big = Mesh.create(np.eye(3), [("TRIA3", [[0, 1, 2]])], node_number=np.array([1, 2, 2**40]))
    if version == "4.1":
        assert again(tmp_path, big).node_number.tolist() == [1, 2, 2**40]
    else:
        with pytest.raises(WriteError, match="no numbers above 2147483647"):
            again(tmp_path, big, version)
    for values in (np.array(["a"]), np.array([2**60])):
        with pytest.raises(WriteError, match="the field 'f'"):
            again(tmp_path, Mesh.create(np.eye(3), [("TRIA3", [[0, 1, 2]])], cell_data={"f": values}), version)


def test_boxes_of_entities(tmp_path):
    points = np.array([[0, 0, 0], [2, 0, 0], [2, 3, 0], [9, 9, 9], [-5, 1, 1]])
    mesh = Mesh.create(
        points,
        [("TRIA3", [[0, 1, 2]]), ("POI1", [[1]])],
        node_data={"entity": np.array([[2, 1]] * 4 + [[1, 8]])},
    )
    again(tmp_path, mesh, "4.1", False)
    text = (tmp_path / "again.msh").read_text().split("$Entities\n")[1].splitlines()
    assert text[1:4] == ["1 2.0 0.0 0.0 0", "8 -5.0 1.0 1.0 -5.0 1.0 1.0 0 0", "1 0.0 0.0 0.0 9.0 9.0 9.0 0 0"]


#: a text in our section, another one, the warning of it, and what is read of a group of node 4
NOT_OURS = [
    ('"nodes":4', '"nodes":5', "written for 5 nodes", {}),
    ('{"g":[4]}', '{"g":[9]}', "1 values or members belong", {"g": []}),
    ('{"g":[4]}', '[{"name":"g","nodes":[3]}]', "", {"g": [2]}),  # as version 1 wrote it
    ('"version":2', '"version":3', "of a newer lacmesh", {}),
]


def test_our_section(tmp_path):
    """It has no dollar inside, is left out where it does not fit, and is not there where nothing needs it."""
    mesh = Mesh.create(np.eye(3), [], node_groups={"$EndLacMesh": [0], "a\n$EndLacMesh\n": [1]}, zones=("$",))
    path = tmp_path / "again.msh"
    assert plain(again(tmp_path, mesh)) == plain(mesh)
    assert path.read_bytes().split(b"$EndElements\n")[1].count(b"$") == 2
    for old, new, words, found in NOT_OURS:
        again(tmp_path, Mesh.create(np.eye(4)[:, :3], TRIANGLE, node_groups={"g": [3]}), "4.1", False)
        path.write_text(path.read_text().replace(old, new))
        with pytest.warns(LacmeshWarning, match=words) if words else nullcontext():
            assert {name: nodes.tolist() for name, nodes in msh.read(path).node_groups.items()} == found
    mesh = Mesh.create(np.eye(4)[:, :3], TRIANGLE, cell_groups={"g": [0]}, node_data={"U": np.eye(4, 3)})
    for version, binary in KINDS:
        again(tmp_path, mesh, version, binary)
        assert b"LacMesh" not in path.read_bytes()
        assert max(map(len, path.read_bytes().splitlines())) < 200 or binary


def data(name, partition, number, value):
    return f'$NodeData\n1\n"{name}"\n1\n0\n4\n0\n1\n1\n{partition}\n{number} {value}\n$EndNodeData\n'


def test_sections_of_one_field(tmp_path):
    """Parts of one step lie on different partitions; a name that stands again is another array."""
    path = tmp_path / "fields.msh"
    path.write_text(ASCII4 + data("T", 1, 2, 5) + data("T", 2, 3, 6) + data("U", 0, 1, 7) + data("U", 0, 1, 8))
    fields = msh.read(path).node_data
    assert np.nan_to_num(fields["T"]).tolist() == [0, 5, 6, 0]
    assert [fields["U"][0], fields["U@1"][0]] == [7, 8]
    again_format = ASCII4[: ASCII4.index("$PhysicalNames")]
    path.write_text(ASCII4 + again_format + data("T", 0, 2, 5))  # what is appended may begin like a file
    assert np.nan_to_num(msh.read(path).node_data["T"]).tolist() == [0, 5, 0, 0]
    path.write_text(ASCII4 + again_format.replace("4.1", "2.2"))
    with pytest.raises(ReadError, match="line 30: a second"):
        msh.read(path)
    path.write_text(ASCII4 + data("T", 0, 9, 5))
    with pytest.warns(LacmeshWarning, match="1 values or members"):
        assert np.isnan(msh.read(path).node_data["T"]).all()


@pytest.mark.parametrize("affine", ["16 " + "1 " * 16, "0"])
def test_periodic_links_to_nodes_that_are_not_there(tmp_path, affine):
    path = tmp_path / "periodic.msh"
    path.write_text(f"{ASCII4}$Periodic\n1\n1 2 1\n{affine}\n2\n1 3\n1 9\n$EndPeriodic\n")
    (link,) = msh.read(path).model.periodic
    assert (link.slave, link.master, len(link.affine)) == ((1, 2), (1, 1), int(affine.split()[0]))
    assert link.nodes.tolist() == [[0, 2]]


def test_the_sign_of_a_group_is_dropped_and_said(tmp_path):
    path = tmp_path / "sign.msh"
    path.write_text(ASCII4.replace("1 1 0 1 5 0\n", "1 1 0 2 -5 -6 0\n"))
    with pytest.warns(LacmeshWarning, match="left out: the sign of physical groups"):
        assert groups_of(msh.read(path)) == {"five": [1, 2], "2:6": [1, 2]}


def old(tmp_path, elements, version="2.2", names='2 5 "five"\n2 6 "six"'):
    text = OLD.format(version=version, names=names, n=len(elements), elements="\n".join(elements))
    path = tmp_path / "old.msh"
    path.write_bytes(text.encode("latin-1"))
    return path


def groups_of(mesh):
    return {name: mesh.cell_number[cells].tolist() for name, cells in mesh.cell_groups.items()}


def test_repeated_elements_are_one_cell(tmp_path):
    rows = [
        "9 2 2 6 1 1 2 3",  # three times the same cell: stays as 4, the smallest
        "4 2 2 5 1 1 2 3",
        "7 2 2 8 1 1 2 3",
        "5 2 2 5 1 1 2 3",  # truly twice in group 5
        "6 2 2 6 2 1 2 3",  # another entity
        "8 2 2 6 1 2 3 1",  # another first node
        "3 2 2 0 1 1 2 3",  # no group
        "2 3 2 5 1 1 2 3 4",
    ]
    path = old(tmp_path, rows)
    path.write_text(path.read_text() + '$ElementData\n1\n"T"\n1\n0\n3\n0\n1\n2\n9 7\n3 8\n$EndElementData\n')
    with pytest.warns(LacmeshWarning, match="2 elements repeat another"):
        mesh = msh.read(path)
    assert order_of(mesh) == [4, 5, 6, 8, 3, 2]
    assert groups_of(mesh) == {"five": [4, 5, 2], "six": [4, 6, 8], "2:8": [4]}
    assert mesh.cell_data["entity"].tolist() == [[2, 1], [2, 1], [2, 2], [2, 1], [2, 1], [2, 1]]
    assert np.nan_to_num(mesh.cell_data["T"]).tolist() == [7, 0, 0, 0, 8, 0]  # of the one that 9 repeats


def test_older_versions(tmp_path):
    """In 2.0 names have no dimension; before 2.2 the third tag is the partition."""
    mesh = msh.read(old(tmp_path, ["1 1 3 5 1 2 1 2", "2 2 3 5 3 1 1 2 3"], "2.0", '5 "five"\n6 "six"'))
    assert groups_of(mesh) == {"five": [1, 2]}
    assert mesh.group_tags == {"five": ((1, 5), (2, 5))}
    assert mesh.cell_data["partition"].tolist() == [2, 1]
    mesh = msh.read(
        old(tmp_path, ["1 2 4 5 1 1 3 1 2 3", "2 2 5 0 1 2 2 -1 1 2 3", "3 15 0 1"], names='2 5 "é"\n2 6 "b"')
    )
    assert groups_of(mesh) == {"é": [1], "b": []}
    assert mesh.cell_data["partition"].tolist() == [3, 2, -1]
    assert mesh.cell_data["entity"].tolist() == [[2, 1], [2, 1], [-1, -1]]


@pytest.mark.rows("True")
@pytest.mark.parametrize("binary", [False, True])
def test_elements_that_alternate_and_change_tags(tmp_path, binary):
    """Rows of many lengths in a random order come back as they were (the walk and the gallop meet)."""
    rng = np.random.default_rng(1)
    n = 6000
    kinds = ["POI1", "SEG2", "TRIA3", "QUAD4"]
    rows = {k: rng.integers(0, 50, (n, ALL_CELLS[k].n_nodes)) for k in kinds}
    order = rng.permutation(4 * n)
    order[2000:9000].sort()
    partition = np.where(rng.random(4 * n) < 0.3, 3, -1)
    partition[n : 2 * n] = -1
    mesh = Mesh.create(rng.normal(size=(50, 3)), rows.items(), file_order=order, cell_data={"partition": partition})
    read = again(tmp_path, mesh, "2.2", binary)
    assert plain(read) == plain(mesh)
    assert read.cell_number[read.file_order].tolist() == mesh.cell_number[order].tolist()


def test_what_is_left_out_is_said_once(tmp_path):
    extra = "".join(f"${n}\nsome 1 2\n$End{n}\n" for n in ("GhostElements", "ElementNodeData", "Strange", "Edges"))
    quiet = "".join(f"${n}\nsome\n$End{n}\n" for n in ("Comments", "LacNodeGroups"))
    text = ASCII4.replace("2 1 0 4\n", "2 1 1 4\n")
    for row in ("0 0 0\n1", "1 0 0\n", "1 1 0\n", "0 1 0\n"):
        assert text.count("\n" + row) == 1
        text = text.replace("\n" + row, "\n" + row.replace("\n", " 0.5 0.5\n"))
    path = tmp_path / "more.msh"
    path.write_text("$Comments\nhello\n$EndComments\n" + text + extra + quiet)
    with pytest.warns(LacmeshWarning) as said:
        mesh = msh.read(path)
    (words,) = (str(w.message) for w in said)
    assert "left out: parametric coordinates of nodes, $GhostElements, $ElementNodeData;" in words
    assert words.endswith("unknown sections: $Strange, $Edges")
    assert plain(mesh)["points"] == {1: (0, 0, 0), 2: (1, 0, 0), 3: (1, 1, 0), 4: (0, 1, 0)}


@kinds
def test_other_line_ends_and_byte_orders(tmp_path, version, binary):
    mesh = Mesh.create(
        np.eye(4)[:, :3], [("TRIA3", [[0, 1, 2]])], cell_groups={"g": [0]}, node_data={"U": np.eye(4, 3)}
    )
    again(tmp_path, mesh, version, binary)
    path = tmp_path / "again.msh"
    content = path.read_bytes()
    if not binary:
        path.write_bytes(content.replace(b"\n", b"\r\n"))
    else:
        path.write_bytes(swapped(content, version))
    assert plain(msh.read(path)) == plain(mesh)
    assert msh.header(path, path.read_bytes()[:2048]) == (version, binary)


# ---- the table of entities


def chain(n, **rest):
    """n segments in a row."""
    nodes = np.arange(n)[:, None] + [0, 1]
    return Mesh.create(np.eye(n + 1, 3), [("SEG2", nodes)], **rest)


def tags(mesh, on="cell"):
    table = assign(mesh)
    return [(table.entities[r].dim, table.entities[r].tag) for r in getattr(table, on)]


def test_nodes_lie_on_the_lowest_cell_and_orphans_somewhere():
    mesh = Mesh.create(
        np.eye(6, 3),
        [("POI1", [[4]]), ("TRIA3", [[0, 1, 2], [1, 2, 3]]), ("SEG2", [[0, 1]])],
        node_data={"entity": np.array([[-1, -1], [2, 9], [-1, -1], [3, 1], [-1, -1], [-1, -1]])},
    )
    assert tags(mesh, "node") == [(1, 1), (2, 9), (2, 10), (3, 1), (0, 1), (3, 1)]
    assert tags(Mesh.create(np.eye(2), []), "node") == [(2, 1), (2, 1)]
    assert assign(Mesh.create(np.empty((0, 2)), [])).entities == ()


def test_two_groups_cannot_have_one_tag():
    mesh = chain(2, cell_groups={"a": [0], "b": [1]}, group_tags={"a": ((1, 4),), "b": ((1, 4), (2, 4))})
    with pytest.warns(LacmeshWarning, match="'a' and 'b' both have the tag 1:4"):
        assert assign(mesh).group_tags == {"a": ((1, 4),), "b": ((2, 4), (1, 5))}


def test_boundaries_hold_only_what_is_there():
    surfaces = np.array([[2, 1], [2, 1], [2, 1], [2, 2]])
    model = Model(
        {(3, 1): (1, -2, 8), (2, 1): (), (2, 2): ()},
        (Periodic((0, 5), (0, 6), (), np.empty((0, 2), int)),),
    )
    rows = [("TRIA3", [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])]
    mesh = Mesh.create(np.eye(4, 3), rows, cell_data={"entity": surfaces}, cell_groups={"g": [0]}, model=model)
    table = assign(mesh)
    assert table.boundary == {(3, 1): (1, 3, -2), (2, 1): (), (2, 2): ()}  # 3 is a part of 1; 8 is unknown
    assert {(0, 5), (0, 6), (3, 1)} <= {(e.dim, e.tag) for e in table.entities}


def test_an_embedded_entity_follows_the_largest_tag():
    model = Model({(2, 1): (1, 2 + 2), (1, 1): (), (1, 2): ()})  # curve 2 lies in surface 1
    entity = np.array([[1, 1], [1, 1], [1, 2]])
    mesh = chain(3, cell_data={"entity": entity}, cell_groups={"g": [0]}, model=model)
    assert tags(mesh) == [(1, 3), (1, 1), (1, 2)]
    assert assign(mesh).boundary[2, 1] == (1, 3, 3 + 2)


@pytest.mark.parametrize("entity", [np.zeros(2, int), np.zeros((2, 2)), np.full((2, 2), 2**40)])
def test_wrong_entity_data(entity):
    with pytest.raises(DataError, match="'entity'"):
        assign(chain(2, cell_data={"entity": entity}))
