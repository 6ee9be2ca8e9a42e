""".inp and .mail: what is written is read back, files by hand are understood, and what is odd in them is said.

Damaged files are in `test_formats_table.py`; what becomes of a deck's other cards is in `test_deck.py`."""

import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import lacmesh
from lacmesh.cells import CELLS
from lacmesh.errors import LacmeshWarning, ReadError, WriteError
from lacmesh.formats import inp, mail
from lacmesh.formats.inp.elements import element
from lacmesh.formats.mail import NODES
from lacmesh.formats.text import labels
from lacmesh.mesh import Mesh
from lacmesh.topology.orientation import analyse_orientation
from tests.formats.msh_meshes import meshes
from tests.formats.texts import INP, MAIL, MORE, PARTS
from tests.meshes import cell_with_faces, lenient, random_mesh
from verification.measures.cutting import facets

some = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))


def read_text(folder, text):
    (folder / "a.inp").write_text(text)
    return inp.read(folder / "a.inp")


def again(folder, mesh, **options):
    path = folder / "again.inp"
    inp.write(path, mesh, **options)
    return inp.read(path)


def cells_of(mesh, cells):
    """Cells by number: {number: (type, node numbers)}."""
    return {
        int(mesh.cell_number[c]): (kind, mesh.node_number[row].tolist())
        for kind, chosen, nodes in mesh.select(cells)
        for c, row in zip(chosen, nodes, strict=True)
    }


def corners_of(mesh, cells):
    """The corners of skin cells, by number: a set for each."""
    return {
        frozenset(row)
        for kind, _, nodes in mesh.select(cells)
        for row in mesh.node_number[nodes][:, : CELLS[kind].n_corners].tolist()
    }


def groups(found, number):
    made = labels(found, "A-Za-z0-9_-", 80)
    return {made[name]: sorted(number[members].tolist()) for name, members in found.items() if len(members)}


THREE = "*NODE\n1, 0.\n2, 1.\n3, 2.\n"
SQUARE = "*NODE\n1, 1, 0\n2, 2, 0\n3, 2, 1\n4, 1, 1\n5, 3, 0\n6, 3, 1\n"


def nodes(n, flat=False):
    """A card of n nodes that lie on no plane, or on one."""
    return "*NODE\n" + "".join(f"{k}, {k}., {k * k}., {0 if flat else k % 3}.\n" for k in range(1, n + 1))


def numbered(found, number):
    return {name: sorted(number[members].tolist()) for name, members in found.items()}


cases = st.tuples(
    st.integers(0, 2**32 - 1), st.sampled_from([2, 3]), st.sampled_from([1, 2]), st.booleans(), st.booleans()
)


@some
@given(case=cases)
def test_round_trip(tmp_path_factory, case):
    """Elements and groups come back, skin as facets that point out of their parents; with all_cells, as its cells."""
    seed, dim, order, twins, interior = case
    folder = tmp_path_factory.mktemp("inp")
    mesh = random_mesh(np.random.default_rng(seed), dim, order, twins=twins, interior=interior)
    kinds = set(mesh.cells_by_type)
    if kinds & {"PYRAM5", "PYRAM13"}:
        with pytest.raises(WriteError, match=r"CalculiX has no element for PYRAM"), lenient():
            again(folder, mesh)
        if "PYRAM13" in kinds:
            return
    target = "abaqus" if "PYRAM5" in kinds else ("calculix", "abaqus")[seed % 2]
    with lenient():
        every = again(folder, mesh, target=target, all_cells=True, plane=["CPS", "CPE", "CAX"][seed % 3])
        read = again(folder, mesh, target=target)
    assert (read.space_dim, read.node_number.tolist()) == (dim, mesh.node_number.tolist())
    assert np.allclose(read.points, mesh.points, rtol=2e-12, atol=0)
    assert cells_of(every, np.arange(mesh.n_cells)) == cells_of(mesh, np.arange(mesh.n_cells))
    assert groups(every.cell_groups, every.cell_number) == groups(mesh.cell_groups, mesh.cell_number)
    whole = np.flatnonzero(mesh.cell_dim == dim)
    assert cells_of(read, np.flatnonzero(read.cell_dim == dim)) == cells_of(mesh, whole)
    for name, members in mesh.cell_groups.items():
        if not len(members):
            assert name not in read.cell_groups
            continue
        inner, skin = members[mesh.cell_dim[members] == dim], members[mesh.cell_dim[members] < dim]
        found = read.cell_groups[name]
        assert cells_of(read, found[read.cell_dim[found] == dim]) == cells_of(mesh, inner)
        assert corners_of(read, found[read.cell_dim[found] < dim]) == corners_of(mesh, skin)
        if len(skin):
            nodes = {int(n) for _, _, rows in mesh.select(skin) for n in mesh.node_number[rows].ravel()}
            assert set(read.node_number[read.node_groups[name]].tolist()) == nodes
    for name, members in mesh.node_groups.items():
        assert set(read.node_number[read.node_groups[name]]) == set(mesh.node_number[members])
    assert_outward(read)
    assert len(set(read.cell_number.tolist())) == read.n_cells
    assert read.cell_number[read.cell_dim < dim].min(initial=10**9) > mesh.cell_number[whole].max()


def assert_outward(mesh):
    """Each skin cell has the nodes of a facet of a cell behind it, and points away from that cell."""
    skin = np.flatnonzero(mesh.cell_dim == mesh.dim - 1)
    known = {frozenset(row.tolist()) for own in facets(mesh).values() for _, row in own}
    assert {frozenset(row) for _, _, nodes in mesh.select(skin) for row in nodes.tolist()} <= known
    assert not len(analyse_orientation(mesh, skin).to_flip)


def test_grammar(tmp_path):
    (tmp_path / "more.inp").write_text(MORE)
    mesh = read_text(tmp_path, INP)
    with pytest.warns(LacmeshWarning) as said:
        lacmesh.write(tmp_path / "mesh.med", mesh)
    (left_out,) = (str(w.message) for w in said)
    for word in ("*MATERIAL, *ELASTIC, *STEP, *STATIC, *NODE PRINT, *END STEP", "C3D8R", "C3D8I (written as HEXA8)"):
        assert word in left_out
    assert mesh.name == "two cubes"
    assert mesh.node_number.tolist() == [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 21, 22, 11]
    assert mesh.points[3].tolist() == [0, 1, 0]
    assert cells_of(mesh, np.flatnonzero(mesh.cell_number <= 200)) == {
        100: ("HEXA8", [1, 2, 3, 4, 5, 6, 7, 8]),
        200: ("HEXA8", [5, 6, 7, 8, 9, 10, 21, 22]),
        7: ("QUAD4", [1, 4, 3, 2]),
    }
    cells = numbered(mesh.cell_groups, mesh.cell_number)
    assert [cells[name] for name in ("Low", "High", "Plate", "Both", "Early")] == [[100], [200], [7], [100, 200], [200]]
    assert cells["Under"] == [7]  # the shell lies there already
    assert len(cells["Joint"]) == 1  # one face, named from both sides
    assert sorted(map(len, (cells["Side"], cells["Skin"]))) == [2, 10]
    assert not set(cells["Joint"]) & set(cells["Skin"])
    nodes = {name: [1, 2, 3, 5, 7, 9, 21, 22] for name in ("Odd", "With Blank", "Points")}
    nodes |= {"Nall": list(range(1, 9)), "OfHigh": [5, 6, 7, 8, 9, 10, 21, 22]}
    assert nodes.items() <= numbered(mesh.node_groups, mesh.node_number).items()


def test_parts_and_their_instances(tmp_path):
    with pytest.warns(LacmeshWarning, match="are raised, nodes by 8 and cells by 1") as said:
        mesh = read_text(tmp_path, PARTS)
    assert len(said) == 1
    assert mesh.node_number.tolist() == list(range(1, 18))
    assert mesh.cells_by_type == {"HEXA8": 2, "QUAD4": 2}
    assert np.allclose(mesh.points[9], [0, 1, 1])  # (1, 0, 0), moved up and turned by a quarter
    assert np.allclose(mesh.points[16], 5)
    assert numbered(mesh.node_groups, mesh.node_number) == {"Ref": [17], "Feet": [1, 2], "Mixed": [3, 11]}
    cells = numbered(mesh.cell_groups, mesh.cell_number)
    assert set(cells) == {"Lower.Body", "Upper.Body", "All", "Lower.Top", "Upper.Top", "Lid"}
    assert (cells["Lower.Body"], cells["Upper.Body"], cells["All"]) == ([1], [2], [1, 2])
    assert cells["Upper.Top"] == cells["Lid"]
    assert np.allclose(mesh.points[mesh.block("QUAD4")[1]][:, 2], 2)
    alone = read_text(tmp_path, PARTS.split("*Assembly")[0])
    assert (alone.n_nodes, set(alone.cell_groups)) == (8, {"Body", "Top"})
    text = (
        PARTS.split("*Instance, name=Upper")[0]
        + "*Nset, nset=Feet, instance=Lower\n1, 2\n*Elset, elset=B\nLower.Body\n"
    )
    mesh = read_text(tmp_path, text)  # one instance keeps its numbers and names
    assert mesh.node_number.tolist() == list(range(1, 9)) and mesh.node_groups["Feet"].tolist() == [0, 1]
    assert set(mesh.cell_groups) == {"Body", "B", "Top"}


def test_the_assemblys_sets_list_its_own_nodes_wherever_these_stand(tmp_path):
    """A set, its GENERATE and a surface of nodes before the assembly's *NODE were of the first instance's node 1."""
    sets = "*Nset, nset=Ref\n1\n*Nset, nset=Run, generate\n1, 1\n*Surface, name=Touch, type=NODE\n1\n"
    sets += "*Nset, nset=Of, instance=Lower\n1\n*Nset, nset=Named\nLower.1\n"
    before, after = PARTS.split("*Node\n1, 5., 5., 5.\n")
    after = after.replace("*Nset, nset=Ref\n1\n", "")
    node = "*Node\n1, 5., 5., 5.\n"
    with lenient():
        first, last = (read_text(tmp_path, before + text + after) for text in (node + sets, sets + node))
    for mesh in (first, last):
        at = {name: mesh.points[members].tolist() for name, members in mesh.node_groups.items()}
        assert at["Ref"] == at["Run"] == at["Touch"] == [[5, 5, 5]] and at["Of"] == at["Named"] == [[0, 0, 0]]
        assert set(at) == {"Ref", "Run", "Touch", "Of", "Named", "Feet", "Mixed"}


#: text, words of the warning, and what the mesh is all the same
LEFT_OUT = {
    "the middle of a line last, as gmsh lists it": (
        THREE + "*ELEMENT, TYPE=T3D3\n1, 1, 3, 2\n", "1 lines have their middle node last",
        lambda mesh: mesh.block("SEG3").tolist() == [[0, 2, 1]],
    ),
    "an instance in a file without parts": (
        THREE + "*NSET, NSET=A, INSTANCE=Part-1-1\n1\n*NSET, NSET=B\n2\n", "this file has no parts",
        lambda mesh: numbered(mesh.node_groups, mesh.node_number) == {"A": [1], "B": [2]},
    ),
    "a collapsed brick": (
        nodes(6) + "*ELEMENT, TYPE=C3D8\n12, 1, 2, 3, 3, 4, 5, 6, 6\n", "a node twice, kept so: 12",
        lambda mesh: mesh.block("HEXA8").tolist() == [[0, 1, 2, 2, 3, 4, 5, 5]],
    ),
    "beams, points, sets and surfaces": (
        THREE + "*ELEMENT, TYPE=B31, ELSET=A\n1, 1, 2, 3\n*ELEMENT, TYPE=D, ELSET=A\n7, 1, 2, 3\n"
        "*ELSET, ELSET=A\n99\n*SURFACE, NAME=S\n1, S2\n*SURFACE, NAME=R, TYPE=REVOLUTION\n",
        "orientation nodes of 1 beams.*1 elements of type D are.*1 members of sets.*S2 of SEG2.*SURFACE of type REVOL",
        lambda mesh: mesh.block("SEG2").tolist() == [[0, 1]],
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", LEFT_OUT)
def test_what_is_left_out_is_said_once(tmp_path, what):
    text, words, holds = LEFT_OUT[what]
    with pytest.warns(LacmeshWarning) as said:
        assert holds(read_text(tmp_path, text))
    assert len(said) == 1
    assert all(word in str(said[0].message) for word in words.split(".*"))


@pytest.mark.parametrize("end", ["", ",", ", "])
def test_further_numbers_on_a_line_are_left_out(tmp_path, end):
    """CalculiX takes the nodes that an element has from its line and goes on at the next; some of its tests do so."""
    text = f"{nodes(11)}*ELEMENT, TYPE=C3D8\n"
    text += f"1, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10{end}\n2, 8, 7, 6, 5, 4, 3, 2, 1, 9, 9{end}\n"
    with pytest.warns(LacmeshWarning, match="2 elements of type C3D8 list more nodes"):
        mesh = read_text(tmp_path, text)
    assert mesh.block("HEXA8").tolist() == [list(range(8)), list(range(7, -1, -1))]
    with pytest.raises(ReadError, match="should have 8 nodes"):  # one long line: an end of line is missing
        read_text(tmp_path, text + "3, 1, 2, 3, 4, 5, 6, 7, 8\n")


def test_small_files(tmp_path):
    """Lines with their middle second, cylindrical coordinates, errors that name an included file or an instance."""
    lines = read_text(tmp_path, THREE + "*ELEMENT, TYPE=T3D3\n1, 1, 2, 3\n")
    assert lines.block("SEG3").tolist() == [[0, 2, 1]]
    assert np.allclose(read_text(tmp_path, "*NODE, SYSTEM=C\n1, 2., 90., 3.\n").points, [[0, 2, 3]])
    (tmp_path / "more.inp").write_text("1, 0.\n2, 0.\nx, 0.\n")
    with pytest.raises(ReadError, match=r"more\.inp, line 3: 'x, 0\.'"):
        read_text(tmp_path, "*NODE\n7, 0.\n*INCLUDE, INPUT=more.inp\n")
    with pytest.raises(ReadError, match="no instance named Part-1-2"):
        read_text(tmp_path, PARTS.replace("*End Assembly", "*NSET, NSET=C, INSTANCE=Part-1-2\n1\n*End Assembly"))


def one_element(name):
    """A file of an element."""
    cell = CELLS[element(name).type]
    return nodes(20, cell.dim < 3) + f"*ELEMENT, TYPE={name}\n1, {', '.join(map(str, range(1, cell.n_nodes + 1)))}\n"


PLAIN_AS_CELLS = "C3D8R C3D8I C3D20RH DC3D4 S4R S8R M3D4 B31 SPRINGA SPRING1 CAX4R CPEG4 CGAX4 DC2D4"


@pytest.mark.parametrize("name", PLAIN_AS_CELLS.split())
def test_elements_that_become_plain_are_named(tmp_path, name):
    """Whatever the letters of a name mean, a cell does not keep it; a deck does."""
    text = one_element(name)
    card = text[text.index("*ELEMENT") :]
    mesh = read_text(tmp_path, text + card.replace(name, name.lower()).replace("\n1, ", "\n2, "))
    with pytest.warns(LacmeshWarning, match=rf"elements {name} \(written as {element(name).type}\)"):
        lacmesh.write(tmp_path / "a.msh", mesh)
    assert [c.options["TYPE"] for c in again(tmp_path, mesh).deck.named("ELEMENT")] == [name, name.lower()]


def test_plain_elements_need_no_word(tmp_path):
    """Skin elements are plain beside solids only."""
    for name in ("C3D8", "C3D15V", "C3D5", "S3", "STRI65", "S9R5", "CPE4", "T2D2", "T3D3", "MASS"):
        assert inp.losses(read_text(tmp_path, one_element(name)).deck) == "", name
    for name in ("M3D4", "SFM3D4"):
        skin = f"*ELEMENT, TYPE={name}\n2, 1, 2, 3, 4\n"
        assert inp.losses(read_text(tmp_path, one_element("C3D8") + skin).deck) == ""
        assert f"{name} (written as QUAD4)" in inp.losses(read_text(tmp_path, nodes(8) + skin).deck)


@pytest.mark.parametrize("plane", ["CPS", "CPE", "CAX"])
def test_the_plane_is_kept(tmp_path, plane):
    mesh = read_text(tmp_path, SQUARE + f"*ELEMENT, TYPE={plane}4\n1, 1, 2, 3, 4\n")
    assert mesh.plane == plane
    assert again(tmp_path, mesh).plane == plane  # a warning would be an error here
    assert f"TYPE={plane}4\n" in (tmp_path / "again.inp").read_text()
    assert again(tmp_path, mesh, plane="CPE").plane == "CPE"


def test_a_plane_that_nobody_named_is_said_and_two_are_kept(tmp_path):
    with pytest.warns(LacmeshWarning, match=r"--plane CPE or CAX"):
        assert again(tmp_path, cell_with_faces("QUAD4", facets=[0])).plane == "CPS"
    assert again(tmp_path, Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])])).plane == ""
    text = SQUARE + "*ELEMENT, TYPE=CPE4\n1, 1, 2, 3, 4\n*ELEMENT, TYPE=CAX4\n2, 2, 5, 6, 3\n"
    mesh = read_text(tmp_path, text)
    assert mesh.plane == ""
    for options, types in (({}, ["CPE4", "CAX4"]), ({"plane": "CPS"}, ["CPS4", "CPS4"])):
        assert [c.options["TYPE"] for c in again(tmp_path, mesh, **options).deck.named("ELEMENT")] == types


def test_elements_on_the_edges_of_others_are_said_and_can_be_kept(tmp_path):
    shells = SQUARE + "*ELEMENT, TYPE=S4, ELSET=plate\n1, 1, 2, 3, 4\n"
    text = shells + "*ELEMENT, TYPE=B31, ELSET=beam\n2, 1, 2\n3, 2, 5\n"
    mesh = read_text(tmp_path, text)
    with pytest.warns(LacmeshWarning, match=r"2 elements of lower dimension .* unless --all-cells"):
        again(tmp_path, mesh)
    kept = again(tmp_path, mesh, all_cells=True)
    assert sorted(kept.cell_number[kept.cell_groups["beam"]].tolist()) == [2, 3]
    assert [c.options["TYPE"] for c in kept.deck.named("ELEMENT")] == ["S4", "B31"]
    again(tmp_path, read_text(tmp_path, shells))  # a warning would be an error here, and below
    solved = read_text(tmp_path, text + "*BEAM SECTION, ELSET=beam, MATERIAL=M\n1.\n*MATERIAL, NAME=M\n")
    assert again(tmp_path, solved).cells_by_type == {"QUAD4": 1, "SEG2": 2}


def test_an_element_goes_on_over_lines(tmp_path):
    """A comma at the end of a line adds no field, a blank line has none."""
    rng = np.random.default_rng(5)
    nodes = "".join(f"{k}, {k % 2}., {k // 2 % 2}., {k // 4}.\n" for k in range(1, 9))
    rows = [[k, *rng.permutation(np.arange(1, 9)).tolist()] for k in range(1, 40)]
    between = (",", ", ", "\t, ", ",\n", ", \r\n", ",\n  \n", ",\n\n")
    lines = []
    for row in rows:
        text = "".join(f"{number}{between[rng.integers(len(between))]}" for number in row)
        lines.append(text.rstrip(" \r\n") + rng.choice(["\n", "\r\n", "\n \n"]))
    elements = "".join(lines)
    assert elements.count("\n") > 2 * len(rows)
    mesh = read_text(tmp_path, f"*NODE\n{nodes}*ELEMENT, TYPE=C3D8\n{elements}")
    assert mesh.node_number[mesh.block("HEXA8")].tolist() == [row[1:] for row in rows]


@pytest.mark.parametrize(("target", "like"), [("calculix", ["rive_gauche", "a_b"]), ("abaqus", ["rive gauche", "a,b"])])
def test_names_for_each_program(tmp_path, target, like):
    names = ["rive gauche", "Été", "2nd", "a" * 90, "TOP", "top", "a,b"]
    mesh = Mesh.create([[0, 0, 0], [1, 0, 0]], [("SEG2", [[0, 1]])], cell_groups={n: [0] for n in names}, space_dim=3)
    with pytest.warns(LacmeshWarning, match="'Été' is Ete"):
        read = again(tmp_path, mesh, target=target)
    assert list(read.cell_groups) == [like[0], "Ete", "G_2nd", "a" * 80, "TOP", "top_2", like[1]]


def with_edge(**groups):
    """A brick with a face, an edge and a point: cells 1, 2 and 3."""
    cube = cell_with_faces("HEXA8", facets=[0])
    blocks = [*((b.type, b.nodes) for b in cube.blocks), ("SEG2", [[0, 1]]), ("POI1", [[3]])]
    return Mesh.create(cube.points, blocks, **groups)


@pytest.mark.parametrize("target", ["calculix", "abaqus"])
def test_nodes_of_cells_are_kept_beside_a_group_of_other_nodes(tmp_path, target):
    nodes = {"edge": [5, 6], "slave": [7], "edge_nodes": [2]}
    mesh = with_edge(cell_groups={"edge": [2], "slave": [1], "point": [3]}, node_groups=nodes)
    with pytest.warns(LacmeshWarning, match="'edge' are edge_nodes_2, those of 'slave' are slave_nodes"):
        read = again(tmp_path, mesh, target=target)
    slave = np.unique(mesh.blocks[1].nodes).tolist()
    assert {name: members.tolist() for name, members in read.node_groups.items()} == {
        **nodes, "edge_nodes_2": [0, 1], "slave_nodes": slave, "point": [3],
    }  # fmt: skip
    assert list(read.cell_groups) == ["slave"]


def test_numbers_that_do_not_fit_and_lines(tmp_path):
    """Real numbers have at most 20 characters, and lines 16 numbers, as CalculiX and Abaqus read no more."""
    mesh = Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])], node_number=[7, 1_000_000_000], cell_number=[5])
    with pytest.warns(LacmeshWarning, match="not distinct from 1 to 999999999"):
        read = again(tmp_path, mesh)
    assert (read.node_number.tolist(), read.cell_number.tolist()) == ([1, 2], [5])
    values = np.array([-1.2345678901234567e-05, 1e-300, -123456.78901234567, 0.1, -0.12345678901234567, 1e22])
    mesh = Mesh.create(np.stack([values, values[::-1], values], axis=1), [], space_dim=3)
    assert np.allclose(again(tmp_path, mesh).points, mesh.points, rtol=1e-12, atol=0)
    assert max(map(len, re.findall(r"-?\d[^,\s]*", (tmp_path / "again.inp").read_text()))) == 20
    brick = cell_with_faces("HEXA27", facets=())
    mesh = Mesh.create(brick.points, brick.blocks, node_groups={"all": range(27)})
    again(tmp_path, mesh, target="abaqus")
    lines = (tmp_path / "again.inp").read_text().splitlines()
    assert max(len([w for w in line.split(",") if w.strip()]) for line in lines) == 16
    assert sum(line.endswith(",") for line in lines) == 1  # the element goes on; the set's lines are whole


@pytest.mark.parametrize(
    ("line", "members"), [(" 2, 4", [2, 4]), ("GENERATE\n 2, 4, 2", [2, 4]), ("UNSORTED\n 4,", [4])]
)
def test_a_keyword_line_that_ends_with_a_comma(tmp_path, line, members):
    """CalculiX takes the next line for data, Abaqus for parameters: one with numbers is data."""
    mesh = read_text(tmp_path, f"{nodes(4)}*NSET, NSET=A,\n{line}\n")
    assert mesh.node_number[mesh.node_groups["A"]].tolist() == members


#: names of elements, by the cells that they are; "" for those that are none
NAMES = {
    "HEXA8": "C3D8 C3D8R C3D8H C3D8I C3D8RH C3D8T C3D8RT C3D8P C3D8RPHT C3D8E C3D8S DC3D8 COH3D8 SC8R F3D8",
    "HEXA20": "C3D20R C3D20RH C3D20RHT C3D20P C3D20E C3D20RP AC3D20", "HEXA27": "C3D27RH",
    "TETRA10": "C3D10M C3D10MH C3D10MHT C3D10HS C3D10I", "PENTA18": "C3D15V", "PENTA15": "C3D15H", "PENTA6": "C3D6T",
    "PYRAM5": "C3D5H", "QUAD4": "CPS4R CGAX4RHT S4R5 S4RSW SFM3D4R", "TRIA6": "CPE6MH S6 STRI65",
    "QUAD8": "CPEG8RHT S8R", "QUAD9": "S9R5 M3D9R", "TRIA3": "CAX3 S3 STRI3 R3D3",
    "SEG3": "T2D3 B32R PIPE32H SAX2", "SEG2": "B31 B31OSH SPRINGA GAPUNI CONN3D2 B21 RAX2", "POI1": "MASS",
    "": "C3D9 XYZ D DCOUP3D C3D8XX CPS5 -",
}  # fmt: skip


@pytest.mark.parametrize(("name", "kind"), [(name, kind) for kind, names in NAMES.items() for name in names.split()])
def test_names_of_elements(name, kind):
    found = element(name.strip("-"))
    assert (found.type if found else "") == kind


TWO = "COOR_2D\nN1 0. 0.\nN2 1. 0.\nN3 1. 1.\nFINSF\n"


def read_mail(folder, text):
    (folder / "a.mail").write_bytes(text if isinstance(text, bytes) else text.encode())
    return mail.read(folder / "a.mail")


def mail_again(folder, mesh):
    mail.write(folder / "again.mail", mesh)
    return mail.read(folder / "again.mail")


def in_file_order(mesh):
    """Cells type by type in the file's order: (type, number, node numbers)."""
    order = np.arange(mesh.n_cells) if mesh.file_order is None else mesh.file_order
    cells = [(b.type, mesh.node_number[row].tolist()) for b in mesh.blocks for row in b.nodes]
    blocks = np.searchsorted(mesh.offsets, order, side="right")
    return [(cells[c][0], int(mesh.cell_number[c]), cells[c][1]) for c in order[np.argsort(blocks, kind="stable")]]


def members_of(mesh):
    """Groups by the numbers of their nodes and cells."""
    pairs = (mesh.node_groups, mesh.node_number), (mesh.cell_groups, mesh.cell_number)
    return [{name: number[ids].tolist() for name, ids in found.items()} for found, number in pairs]


def kept(mesh):
    """Contents of a mesh that a .mail file keeps, by number and with the file's group names."""
    groups = []
    for found in members_of(mesh):
        made = labels(found, "A-Za-z0-9_", 24, ["FIN", "FINSF"])
        groups.append({made[name]: sorted(numbers) for name, numbers in found.items()})
    plane = mesh.space_dim == 2 and mesh.dim < 3 and not mesh.points[:, 2].any()
    points = dict(zip(mesh.node_number.tolist(), map(tuple, mesh.points.tolist()), strict=True))
    return points, in_file_order(mesh), 2 if plane else 3, groups


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(mesh=meshes(kinds=tuple(NODES)))
def test_mail_round_trip(tmp_path_factory, mesh):
    folder = tmp_path_factory.mktemp("mail")
    with lenient():
        read = mail_again(folder, mesh)
        if max(mesh.node_number.max(), mesh.cell_number.max(initial=0)) <= 9_999_999:
            assert (kept(read), read.name) == (kept(mesh), mesh.name)
        same = mail_again(folder, read)
        first = (folder / "again.mail").read_bytes()
        assert kept(same) == kept(read)
        mail_again(folder, same)
        assert (folder / "again.mail").read_bytes() == first


def test_mail_grammar(tmp_path):
    mesh = read_mail(tmp_path, MAIL)
    assert (mesh.name, mesh.space_dim) == ("a plate of two squares", 2)
    assert mesh.node_number.tolist() == [1, 2, 3, 4, 5, 6, 77]
    assert mesh.points[:, :2].tolist() == [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [3.5, -1.5]]
    quads = [("QUAD4", 1, [1, 2, 5, 4]), ("QUAD4", 12, [2, 3, 6, 5]), ("QUAD4", 4, [4, 5, 2, 1])]
    assert in_file_order(mesh) == [*quads, ("SEG2", 3, [1, 2])]
    assert mesh.cell_number[mesh.file_order].tolist() == [1, 12, 3, 4]
    assert members_of(mesh) == [{"COIN": [1, 77], "RIEN": []}, {"BAS": [3], "TOUT": [1, 12, 4, 3]}]
    for old, new in (("\n", "\r\n"), (" ", "\t"), ("whatever", "\0")):
        assert kept(read_mail(tmp_path, MAIL.replace(old, new))) == kept(mesh)
    for encoding in ("utf-8", "latin-1"):
        assert "été" in read_mail(tmp_path, MAIL.replace("BAS", "été").encode(encoding)).cell_groups
    line = read_mail(tmp_path, "COOR_1D\nN1 0.5\nN2 1.5\nFINSF\nSEG2\nM1 N1 N2\nFINSF\nFIN\n")
    assert line.points.tolist() == [[0.5, 0, 0], [1.5, 0, 0]]


#: a change of a small file, words of the warnings, and its cells all the same
MAIL_NAMES = {
    "names without numbers": (
        TWO.replace("N3", "N-3") + "SEG2\nS1 N1 N2\nFINSF\nPOI1\nP1 N-3\nFINSF\n",
        ["names of nodes .as N-3", "names of cells .as P1"], [("SEG2", 1, [1, 2]), ("POI1", 2, [3])],
    ),
    "prefixes that differ": (
        TWO.replace("N2", "B2") + "SEG2\nS10 N1 B2\nFINSF\nPOI1\nP11 B2\nFINSF\n",
        [], [("SEG2", 10, [1, 2]), ("POI1", 11, [2])],
    ),
    "leading zeros are other names": (
        TWO.replace("N3", "N01") + "SEG2\nS1 N1 N01\nFINSF\n", ["names of nodes"], [("SEG2", 1, [1, 3])]
    ),
    "what is no mesh": (
        TWO + "SYS_UNIT\nm kg\nFINSF\nMATERIAU\nsteel\nFINSF\n", ["no part of a mesh: SYS_UNIT, MATERIAU"], []
    ),
    "a node twice in a cell": (
        TWO + "QUAD4\nM1 N1 N2 N3 N3\nFINSF\n", ["a node twice, the first M1"], [("QUAD4", 1, [1, 2, 3, 3])]
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", MAIL_NAMES)
@pytest.mark.filterwarnings("always")
def test_names_become_numbers_and_what_is_odd_is_said(tmp_path, what, recwarn):
    text, words, cells = MAIL_NAMES[what]
    last = text.split()[-2] if cells else "N1"  # a member of both groups
    mesh = read_mail(tmp_path, f"{text}GROUP_NO NOM=G\n{last if cells else 'N1'}\nFINSF\nFIN\n")
    assert in_file_order(mesh) == cells
    assert [mesh.node_number[mesh.node_groups["G"]].tolist()] == [[cells[-1][2][-1]] if cells else [1]]
    said = [str(one.message) for one in recwarn]
    assert len(said) == bool(words) and all(re.search(word, said[0]) for word in words)


def test_lines_numbers_and_names_are_what_code_aster_reads(tmp_path):
    """80 characters a line; a real number has a point before its exponent; names have 24 letters, digits and _."""
    values = [1e-5, -1.2345678901234567e-5, 1e22, -1.2345678901234567e-105, 5e-324, 0.1, 123456789.0, -0.0, 1e16]
    points = np.array([values, values[::-1], values[3:] + values[:3]]).T
    number = np.arange(9) + 9_999_991
    names = {
        "a" * 30: "a" * 24, "a" * 31: "a" * 22 + "_2", "rive gauche": "rive_gauche_2", "rive_gauche": "rive_gauche",
        "été": "ete", "2nd": "G_2nd", "FIN": "FIN_2", "": "G_",
    }  # fmt: skip
    hexa = [("HEXA8", [range(8)])]
    groups = {name: [0] for name in names}
    mesh = Mesh.create(points, hexa, node_number=number, node_groups={"a": range(9)}, cell_groups=groups)
    with pytest.warns(LacmeshWarning, match="'été' is ete"):
        read = mail_again(tmp_path, mesh)
    assert list(read.cell_groups) == list(names.values())
    lines = (tmp_path / "again.mail").read_text().splitlines()
    assert max(map(len, lines)) <= 80
    for word in re.findall(r"(?<=\s)-?[0-9][^\s]*", "\n".join(lines)):
        assert re.fullmatch(r"-?\d+\.\d+(e[+-]\d+)?", word)
    assert np.array_equal(read.points, points)
    with pytest.warns(LacmeshWarning, match="not distinct from 0 to 9999999"):
        read = mail_again(tmp_path, Mesh.create(points, hexa, node_number=number + 1, cell_number=[5]))
    assert (read.node_number.tolist(), read.cell_number.tolist()) == ([*range(1, 10)], [5])
