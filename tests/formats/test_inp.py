""".inp: what is written is read back, decks by hand are understood, damaged ones are errors with a line."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import lacmesh
from lacmesh.cells import CELLS
from lacmesh.cli import main
from lacmesh.errors import LacmeshWarning, ReadError, RequestError, WriteError
from lacmesh.formats import inp
from lacmesh.formats import text as text_files
from lacmesh.formats.inp.scope import ElementCard, NodesOf
from lacmesh.formats.inp.types import FACETS, element
from lacmesh.formats.inp.writer_types import card
from lacmesh.formats.labels import labels
from lacmesh.formats.table import WriteOptions
from lacmesh.mesh import Mesh
from lacmesh.reference.quadrature import measure
from tests.formats.inp_texts import MORE, PARTS, WHOLE
from tests.formats.msh_meshes import lenient
from tests.meshes import cell_with_faces, random_mesh

some = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
KINDS = [kind for kind in CELLS if card(kind, "abaqus", None, False)]


def read_text(folder, text):
    (folder / "a.inp").write_text(text)
    return inp.read(folder / "a.inp")


def again(folder, mesh, **options):
    path = folder / "again.inp"
    inp.write(path, mesh, WriteOptions(**options))
    return inp.read(path)


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("inp")


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


def nodes_of(mesh, cells):
    return sorted({int(n) for _, _, nodes in mesh.select(cells) for n in mesh.node_number[nodes].ravel()})


cases = st.tuples(
    st.integers(0, 2**32 - 1), st.sampled_from([2, 3]), st.sampled_from([1, 2]), st.booleans(), st.booleans()
)


@some
@given(case=cases)
def test_round_trip_of_all_cells(folder, case):
    """With all_cells everything but fields and empty groups comes back."""
    seed, dim, order, twins, _ = case
    mesh = random_mesh(np.random.default_rng(seed), dim, order, twins=twins)
    target = "abaqus" if {"PYRAM5"} & set(mesh.cells_by_type) else ("calculix", "abaqus")[seed % 2]
    if "PYRAM13" in mesh.cells_by_type:
        with pytest.raises(WriteError, match="no element for PYRAM13"), lenient():
            again(folder, mesh, target=target)
        return
    with lenient():
        read = again(folder, mesh, target=target, all_cells=True, plane=["CPS", "CPE", "CAX"][seed % 3])
    every = np.arange(mesh.n_cells)
    assert read.space_dim == dim
    assert read.node_number.tolist() == mesh.node_number.tolist()
    assert np.allclose(read.points, mesh.points, rtol=2e-12, atol=0)
    assert cells_of(read, every) == cells_of(mesh, every)
    assert groups(read.cell_groups, read.cell_number) == groups(mesh.cell_groups, mesh.cell_number)


@some
@given(case=cases)
def test_round_trip(folder, case):
    """Elements, groups and skin groups come back; skin as facets that point out of their parents."""
    seed, dim, order, twins, interior = case
    mesh = random_mesh(np.random.default_rng(seed), dim, order, twins=twins, interior=interior)
    if {"PYRAM5", "PYRAM13"} & set(mesh.cells_by_type):
        with pytest.raises(WriteError, match=r"CalculiX has no element for PYRAM.*--hexa hexa"), lenient():
            again(folder, mesh)
        return
    with lenient():
        read = again(folder, mesh)
    whole = [c for c in np.arange(mesh.n_cells) if mesh.cell_dim[c] == dim]
    assert cells_of(read, np.flatnonzero(read.cell_dim == dim)) == cells_of(mesh, whole)
    assert (read.space_dim, read.node_number.tolist()) == (dim, mesh.node_number.tolist())
    for name, members in mesh.cell_groups.items():
        if not len(members):
            assert name not in read.cell_groups
            continue
        inner, skin = members[mesh.cell_dim[members] == dim], members[mesh.cell_dim[members] < dim]
        found = read.cell_groups[name]
        assert cells_of(read, found[read.cell_dim[found] == dim]) == cells_of(mesh, inner)
        seen = corners_of(read, found[read.cell_dim[found] < dim])
        assert seen == corners_of(mesh, skin)
        if len(skin):
            assert sorted(read.node_number[read.node_groups[name]].tolist()) == nodes_of(mesh, skin)
    for name, members in mesh.node_groups.items():
        assert set(read.node_number[read.node_groups[name]]) == set(mesh.node_number[members])
    assert_outward(read)
    number = read.cell_number[read.cell_dim < dim]
    assert len(set(read.cell_number.tolist())) == read.n_cells
    assert number.min(initial=10**9) > mesh.cell_number[whole].max()


def assert_outward(mesh):
    """Each skin cell lists its corners as a facet of a cell behind it does, and has that facet's nodes."""
    facets = {}
    for block in mesh.blocks:
        if CELLS[block.type].dim == mesh.dim:
            for facet in CELLS[block.type].facets:
                for row in block.nodes[:, facet.nodes].tolist():
                    facets.setdefault(rotated(row, facet.type), set()).add(frozenset(row))
    for block in mesh.blocks:
        if CELLS[block.type].dim == mesh.dim - 1:
            for row in block.nodes.tolist():
                assert frozenset(row) in facets[rotated(row, block.type)]


def rotated(row, kind):
    """The corners of a face in turn, from the least on."""
    corners = row[: CELLS[kind].n_corners]
    k = corners.index(min(corners))
    return (kind, *corners[k:], *corners[:k]) if len(corners) > 2 else (kind, *corners)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("target", ["calculix", "abaqus"])
def test_every_facet_of_every_type(tmp_path, kind, target):
    """A surface of each facet alone comes back as that facet, however the skin cell was listed."""
    cell = CELLS[kind]
    if cell.dim < 2:
        return
    if card(kind, target, "CPS" if cell.dim == 2 else None, False) is None:
        with pytest.raises(WriteError, match=rf"no element (in the plane )?for {kind}, and the mesh has 1; "):
            inp.write(tmp_path / "a.inp", cell_with_faces(kind, facets=()), WriteOptions(target=target))
        return
    for j, facet in enumerate(cell.facets):
        mesh = cell_with_faces(kind, facets=[j], rotation=j, inward=bool(j % 2))
        read = again(tmp_path, mesh, target=target, plane="CPS")
        assert read.cell_groups["slave"].tolist() == [1]
        assert read.cells_by_type == {kind: 1, facet.type: 1}
        assert read.block(facet.type).tolist() == [list(facet.nodes)]
        assert read.block(kind).tolist() == [list(range(cell.n_nodes))]
        assert set(read.node_groups["slave"]) == set(facet.nodes)


#: Abaqus's Elements Guide: the edges on which mid-nodes stand, by corners from 1, in the order of the file.
ORDER = {
    "TRIA6": "12 23 31",
    "QUAD8": "12 23 34 41",
    "QUAD9": "12 23 34 41 1234",
    "TETRA10": "12 23 31 14 24 34",
    "PENTA15": "12 23 31 45 56 64 14 25 36",
    "PENTA18": "12 23 31 45 56 64 14 25 36 1254 2365 3146",
    "HEXA20": "12 23 34 41 56 67 78 85 15 26 37 48",
    "HEXA27": "12 23 34 41 56 67 78 85 15 26 37 48 12345678 1234 5678 1265 2376 3487 4158",
}


@pytest.mark.parametrize("kind", KINDS)
def test_order_of_nodes(tmp_path, kind):
    mesh = cell_with_faces(kind, facets=())
    if kind == "QUAD9":  # a shell only
        mesh = Mesh.create(mesh.points + np.array([0, 0, 1]), [(kind, mesh.block(kind))])
    with lenient():
        inp.write(tmp_path / "a.inp", mesh, WriteOptions(target="abaqus"))
    text = (tmp_path / "a.inp").read_text()
    numbers = re.search(r"\*ELEMENT[^\n]*\n([\d,\s]*)", text)[1].replace(",", " ").split()
    at = mesh.points[np.array(numbers[1:], int) - 1]
    n = CELLS[kind].n_corners
    if kind == "SEG3":
        assert np.allclose(at[1], (at[0] + at[2]) / 2)
        return
    for k, corners in enumerate(ORDER.get(kind, "").split()):
        assert np.allclose(at[n + k], at[[int(c) - 1 for c in corners]].mean(axis=0), atol=1e-12)
    assert len(at) == n + len(ORDER.get(kind, "").split()) == CELLS[kind].n_nodes
    if CELLS[kind].dim == 3:
        assert measure(CELLS[kind].linear, at[None, :n])[0] > 0


def test_grammar(tmp_path):
    (tmp_path / "more.inp").write_text(MORE)
    mesh = read_text(tmp_path, WHOLE)
    with pytest.warns(LacmeshWarning) as said:
        lacmesh.write(tmp_path / "mesh.med", mesh)
    assert [str(w.message) for w in said] == [
        f"left out of the deck {tmp_path / 'a.inp'}: *MATERIAL, *ELASTIC, *STEP, *STATIC, *NODE PRINT, *END STEP, "
        "the formulation of the elements C3D8R (written as HEXA8), C3D8I (written as HEXA8); an .inp output keeps them"
    ]
    assert mesh.name == "two cubes"
    assert mesh.node_number.tolist() == [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 21, 22, 11]
    assert mesh.points[3].tolist() == [0, 1, 0]
    skin = mesh.cell_number > 200
    assert cells_of(mesh, np.flatnonzero(~skin)) == {
        100: ("HEXA8", [1, 2, 3, 4, 5, 6, 7, 8]),
        200: ("HEXA8", [5, 6, 7, 8, 9, 10, 21, 22]),
        7: ("QUAD4", [1, 4, 3, 2]),
    }
    cells = {name: mesh.cell_number[members].tolist() for name, members in mesh.cell_groups.items()}
    assert (cells["Low"], cells["High"], cells["Plate"], cells["Both"], cells["Early"]) == (
        [100],
        [200],
        [7],
        [100, 200],
        [200],
    )
    assert cells["Under"] == [7]  # the shell lies there already
    assert len(cells["Joint"]) == 1  # one face, named from both sides
    assert sorted(map(len, (cells["Side"], cells["Skin"]))) == [2, 10]
    assert not set(cells["Joint"]) & set(cells["Skin"])
    nodes = {name: sorted(mesh.node_number[members].tolist()) for name, members in mesh.node_groups.items()}
    assert nodes["Nall"] == [1, 2, 3, 4, 5, 6, 7, 8]
    assert nodes["Odd"] == [1, 2, 3, 5, 7, 9, 21, 22]
    assert nodes["With Blank"] == sorted({*nodes["Odd"], 22})
    assert nodes["OfHigh"] == [5, 6, 7, 8, 9, 10, 21, 22]
    assert nodes["Points"] == nodes["Odd"]


def test_parts_and_their_instances(tmp_path):
    with pytest.warns(LacmeshWarning, match="instance Upper are raised, nodes by 8 and cells by 1") as said:
        mesh = read_text(tmp_path, PARTS)
    assert len(said) == 1
    assert mesh.node_number.tolist() == list(range(1, 18))
    assert mesh.cells_by_type == {"HEXA8": 2, "QUAD4": 2}
    upper = mesh.points[8:16]
    assert np.allclose(upper[1], [0, 1, 1])  # (1, 0, 0), moved up and turned by a quarter
    assert np.allclose(mesh.points[16], 5)
    nodes = {name: mesh.node_number[members].tolist() for name, members in mesh.node_groups.items()}
    assert nodes == {"Ref": [17], "Feet": [1, 2], "Mixed": [3, 11]}
    cells = {name: mesh.cell_number[members].tolist() for name, members in mesh.cell_groups.items()}
    assert cells["Lower.Body"] == [1]
    assert cells["Upper.Body"] == [2]
    assert cells["All"] == [1, 2]
    assert cells["Upper.Top"] == cells["Lid"]
    assert set(cells) == {"Lower.Body", "Upper.Body", "All", "Lower.Top", "Upper.Top", "Lid"}
    assert np.allclose(mesh.points[mesh.block("QUAD4")[1]][:, 2], 2)


def test_the_assemblys_sets_list_its_own_nodes_wherever_these_stand(tmp_path):
    """A set, its GENERATE and a surface of nodes before the assembly's *NODE were of the first instance's node 1."""
    sets = "*Nset, nset=Ref\n1\n*Nset, nset=Run, generate\n1, 1\n*Surface, name=Touch, type=NODE\n1\n"
    sets += "*Nset, nset=Of, instance=Lower\n1\n*Nset, nset=Named\nLower.1\n"
    before, after = PARTS.split("*Node\n1, 5., 5., 5.\n")
    after = after.replace("*Nset, nset=Ref\n1\n", "")
    node = "*Node\n1, 5., 5., 5.\n"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LacmeshWarning)
        first, last = (read_text(tmp_path, before + text + after) for text in (node + sets, sets + node))
    for mesh in (first, last):
        at = {name: mesh.points[members].tolist() for name, members in mesh.node_groups.items()}
        assert at["Ref"] == at["Run"] == at["Touch"] == [[5, 5, 5]] and at["Of"] == at["Named"] == [[0, 0, 0]]
        assert set(at) == {"Ref", "Run", "Touch", "Of", "Named", "Feet", "Mixed"}


def test_one_instance_keeps_its_numbers_and_names(tmp_path):
    text = (
        PARTS.split("*Instance, name=Upper")[0]
        + "*Nset, nset=Feet, instance=Lower\n1, 2\n*Elset, elset=B\nLower.Body\n"
    )
    mesh = read_text(tmp_path, text)
    assert mesh.node_number.tolist() == list(range(1, 9))
    assert set(mesh.cell_groups) == {"Body", "B", "Top"}
    assert mesh.node_groups["Feet"].tolist() == [0, 1]


def test_a_part_alone(tmp_path):
    mesh = read_text(tmp_path, PARTS.split("*Assembly")[0])
    assert (mesh.n_nodes, set(mesh.cell_groups)) == (8, {"Body", "Top"})


def test_cylindrical_coordinates(tmp_path):
    mesh = read_text(tmp_path, "*NODE, SYSTEM=C\n1, 2., 90., 3.\n")
    assert np.allclose(mesh.points, [[0, 2, 3]])


def test_the_middle_of_a_line_is_found(tmp_path):
    """Abaqus and CalculiX list it second, gmsh last."""
    nodes = "*NODE\n1, 0.\n2, 1.\n3, 2.\n"
    assert read_text(tmp_path, nodes + "*ELEMENT, TYPE=T3D3\n1, 1, 2, 3\n").block("SEG3").tolist() == [[0, 2, 1]]
    with pytest.warns(LacmeshWarning, match="1 lines have their middle node last"):
        read = read_text(tmp_path, nodes + "*ELEMENT, TYPE=T3D3\n1, 1, 3, 2\n")
    assert read.block("SEG3").tolist() == [[0, 2, 1]]


def test_what_is_left_out_is_said(tmp_path):
    text = "*NODE\n1, 0.\n2, 1.\n3, 0., 1.\n*ELEMENT, TYPE=B31, ELSET=A\n1, 1, 2, 3\n"
    text += "*ELEMENT, TYPE=D, ELSET=A\n7, 1, 2, 3\n"
    text += "*ELSET, ELSET=A\n99\n*SURFACE, NAME=S\n1, S2\n*SURFACE, NAME=R, TYPE=REVOLUTION\n"
    with pytest.warns(LacmeshWarning) as said:
        mesh = read_text(tmp_path, text)
    words = (
        "orientation nodes of 1 beams|1 elements of type D are|1 members of sets|S2 of SEG2|SURFACE of type REVOLUTION"
    )
    assert len(said) == 1
    assert set(re.findall(words, str(said[0].message))) == set(words.split("|"))
    assert mesh.block("SEG2").tolist() == [[0, 1]]


_LONG = "".join(f"{k}, {k}.\n" for k in range(1, 12))


@pytest.mark.parametrize("end", ["", ",", ", "])
def test_further_numbers_on_a_line_are_left_out(tmp_path, end):
    """CalculiX takes the nodes that an element has from its line and goes on at the next; some of its tests do so."""
    text = f"*NODE\n{_LONG}*ELEMENT, TYPE=C3D8\n"
    text += f"1, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10{end}\n2, 8, 7, 6, 5, 4, 3, 2, 1, 9, 9{end}\n"
    with pytest.warns(LacmeshWarning, match="2 elements of type C3D8 list more nodes than these have"):
        mesh = read_text(tmp_path, text)
    assert mesh.block("HEXA8").tolist() == [list(range(8)), list(range(7, -1, -1))]
    with pytest.raises(ReadError, match="should have 8 nodes"):  # one long line: an end of line is missing
        read_text(tmp_path, text + "3, 1, 2, 3, 4, 5, 6, 7, 8\n")


def test_an_instance_in_a_file_without_parts(tmp_path):
    """Abaqus' own sets in a file that was made flat."""
    flat = "*NODE\n1, 0.\n2, 1.\n*NSET, NSET=A, INSTANCE=Part-1-1\n1\n*NSET, NSET=B\n2\n"
    with pytest.warns(LacmeshWarning, match="sets name an instance, and this file has no parts"):
        mesh = read_text(tmp_path, flat)
    assert {name: nodes.tolist() for name, nodes in mesh.node_groups.items()} == {"A": [0], "B": [1]}
    with pytest.raises(ReadError, match="there is no instance named Part-1-2"):
        read_text(tmp_path, PARTS.replace("*End Assembly", "*NSET, NSET=C, INSTANCE=Part-1-2\n1\n*End Assembly"))


@pytest.mark.shared
@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
def test_decks_of_calculix(shared):
    """All available decks of CalculiX's own tests are read."""
    decks = sorted((shared / "reference" / "decks").glob("*.inp"))
    assert len(decks) > 20
    for deck in decks:
        assert inp.read(deck).n_nodes > 0


_SQUARE = "*NODE\n1, 1, 0\n2, 2, 0\n3, 2, 1\n4, 1, 1\n5, 3, 0\n6, 3, 1\n"


def said_of(folder, text, number=1):
    """Read a text: the warning (one or, with `number` 0, none) and the mesh."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        mesh = read_text(folder, text)
    assert len(said) == number
    return "".join(str(w.message) for w in said), mesh


@pytest.mark.parametrize(
    "name",
    [
        *["C3D8R", "C3D8I", "C3D20RH", "DC3D4", "S4R", "S8R", "M3D4", "B31", "SPRINGA", "SPRING1"],
        *["CAX4R", "CPEG4", "CGAX4", "DC2D4"],
    ],
)
def test_elements_that_become_plain_are_named(tmp_path, name):
    """Whatever the letters of a name mean, a cell does not keep it; a deck does."""
    cell = element(name).type
    row = ", ".join(map(str, range(1, CELLS[cell].n_nodes + 1)))
    nodes = "*NODE\n" + "".join(f"{k}, {k}., {k * k}., {k % 3 if CELLS[cell].dim == 3 else 0}.\n" for k in range(1, 21))
    text = nodes + f"*ELEMENT, TYPE={name.lower()}\n1, {row}\n*ELEMENT, TYPE={name}\n2, {row}\n"
    _, mesh = said_of(tmp_path, text, 0)
    with pytest.warns(LacmeshWarning, match=rf"formulation of the elements {name} \(written as {cell}\)"):
        lacmesh.write(tmp_path / "a.msh", mesh)
    inp.write(tmp_path / "b.inp", mesh)
    assert [c.options["TYPE"] for c in inp.read(tmp_path / "b.inp").deck.named("ELEMENT")] == [name.lower(), name]


@pytest.mark.parametrize("name", ["C3D8", "C3D15V", "C3D5", "S3", "STRI65", "S9R5", "CPE4", "T2D2", "T3D3", "MASS"])
def test_plain_elements_need_no_word(tmp_path, name):
    row = ", ".join(map(str, range(1, CELLS[element(name).type].n_nodes + 1)))
    nodes = "*NODE\n" + "".join(f"{k}, {k}., {k * k}.\n" for k in range(1, 21))
    assert said_of(tmp_path, nodes + f"*ELEMENT, TYPE={name}\n1, {row}\n", 0)[0] == ""


def test_skin_elements_are_plain_beside_solids_only(tmp_path):
    nodes = "*NODE\n" + "".join(f"{k}, {k}., {k * k}., {k % 3}.\n" for k in range(1, 9))
    solid = "*ELEMENT, TYPE=C3D8\n1, 1, 2, 3, 4, 5, 6, 7, 8\n"
    for name in ("M3D4", "SFM3D4"):
        skin = f"*ELEMENT, TYPE={name}\n2, 1, 2, 3, 4\n"
        assert inp.losses(said_of(tmp_path, nodes + solid + skin, 0)[1].deck) == ""
        assert f"{name} (written as QUAD4)" in inp.losses(said_of(tmp_path, nodes + skin, 0)[1].deck)


@pytest.mark.parametrize("plane", ["CPS", "CPE", "CAX"])
def test_the_plane_is_kept(tmp_path, plane):
    _, mesh = said_of(tmp_path, _SQUARE + f"*ELEMENT, TYPE={plane}4\n1, 1, 2, 3, 4\n", 0)
    assert mesh.plane == plane
    assert again(tmp_path, mesh).plane == plane  # a warning would be an error here
    assert f"TYPE={plane}4\n" in (tmp_path / "again.inp").read_text()
    assert again(tmp_path, mesh, plane="CPE").plane == "CPE"


def test_a_plane_that_nobody_named_is_said(tmp_path):
    mesh = cell_with_faces("QUAD4", facets=[0])
    with pytest.warns(LacmeshWarning, match=r"^.inp: written as CPS \(plane stress\); --plane CPE or CAX"):
        read = again(tmp_path, mesh)
    assert read.plane == "CPS"
    lines = Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])])
    assert again(tmp_path, lines).plane == ""


def test_two_kinds_of_the_plane_are_kept(tmp_path):
    text = _SQUARE + "*ELEMENT, TYPE=CPE4\n1, 1, 2, 3, 4\n*ELEMENT, TYPE=CAX4\n2, 2, 5, 6, 3\n"
    _, mesh = said_of(tmp_path, text, 0)
    assert mesh.plane == ""
    assert [c.options["TYPE"] for c in again(tmp_path, mesh).deck.named("ELEMENT")] == ["CPE4", "CAX4"]
    assert [c.options["TYPE"] for c in again(tmp_path, mesh, plane="CPS").deck.named("ELEMENT")] == ["CPS4", "CPS4"]


def test_elements_on_the_edges_of_others_are_said_and_can_be_kept(tmp_path):
    shells = _SQUARE + "*ELEMENT, TYPE=S4, ELSET=plate\n1, 1, 2, 3, 4\n"
    text = shells + "*ELEMENT, TYPE=B31, ELSET=beam\n2, 1, 2\n3, 2, 5\n"
    _, mesh = said_of(tmp_path, text, 0)
    words = (
        r"2 elements of lower dimension than the mesh \(B31\) become .*, unless --all-cells \(all_cells=True\) keeps"
    )
    with pytest.warns(LacmeshWarning, match=words):
        inp.write(tmp_path / "mesh.inp", mesh)
    inp.write(tmp_path / "all.inp", mesh, WriteOptions(all_cells=True))
    kept = inp.read(tmp_path / "all.inp")
    assert sorted(kept.cell_number[kept.cell_groups["beam"]].tolist()) == [2, 3]
    assert [c.options["TYPE"] for c in kept.deck.named("ELEMENT")] == ["S4", "B31"]
    again(tmp_path, said_of(tmp_path, shells, 0)[1])
    solved = said_of(tmp_path, text + "*BEAM SECTION, ELSET=beam, MATERIAL=M\n1.\n*MATERIAL, NAME=M\n", 0)[1]
    assert again(tmp_path, solved).cells_by_type == {"QUAD4": 1, "SEG2": 2}  # a warning would be an error here


def test_a_collapsed_brick_is_kept(tmp_path):
    nodes = "*NODE\n" + "".join(f"{k}, {k}., {k * k}., {k % 3}.\n" for k in range(1, 7))
    with pytest.warns(LacmeshWarning, match="1 elements HEXA8 have a node twice, kept so: 12"):
        mesh = read_text(tmp_path, nodes + "*ELEMENT, TYPE=C3D8\n12, 1, 2, 3, 3, 4, 5, 6, 6\n")
    assert mesh.block("HEXA8").tolist() == [[0, 1, 2, 2, 3, 4, 5, 5]]


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        *[("C3D8" + s, "HEXA8") for s in ("", "R", "H", "I", "RH", "T", "RT", "P", "RPHT", "E", "S")],
        *[("C3D20" + s, "HEXA20") for s in ("R", "RH", "RHT", "P", "E", "RP")],
        *[("C3D10" + s, "TETRA10") for s in ("M", "MH", "MHT", "HS", "I")],
        *[
            ("C3D15V", "PENTA18"),
            ("C3D15H", "PENTA15"),
            ("C3D27RH", "HEXA27"),
            ("C3D6T", "PENTA6"),
            ("C3D5H", "PYRAM5"),
        ],
        *[("DC3D8", "HEXA8"), ("AC3D20", "HEXA20"), ("COH3D8", "HEXA8"), ("SC8R", "HEXA8"), ("F3D8", "HEXA8")],
        *[("CPS4R", "QUAD4"), ("CPE6MH", "TRIA6"), ("CPEG8RHT", "QUAD8"), ("CAX3", "TRIA3"), ("CGAX4RHT", "QUAD4")],
        *[("S3", "TRIA3"), ("S4R5", "QUAD4"), ("S4RSW", "QUAD4"), ("S8R", "QUAD8"), ("S9R5", "QUAD9"), ("S6", "TRIA6")],
        *[("STRI3", "TRIA3"), ("STRI65", "TRIA6"), ("M3D9R", "QUAD9"), ("SFM3D4R", "QUAD4"), ("R3D3", "TRIA3")],
        *[
            ("T2D3", "SEG3"),
            ("B31", "SEG2"),
            ("B32R", "SEG3"),
            ("B31OSH", "SEG2"),
            ("PIPE32H", "SEG3"),
            ("SAX2", "SEG3"),
        ],
        *[
            ("SPRINGA", "SEG2"),
            ("GAPUNI", "SEG2"),
            ("CONN3D2", "SEG2"),
            ("MASS", "POI1"),
            ("B21", "SEG2"),
            ("RAX2", "SEG2"),
        ],
        *[("C3D9", None), ("XYZ", None), ("D", None), ("DCOUP3D", None), ("C3D8XX", None), ("CPS5", None), ("", None)],
    ],
)
def test_names_of_elements(name, kind):
    found = element(name)
    assert (found.type if found else None) == kind


@pytest.mark.parametrize("family", FACETS)
def test_faces_are_numbered_once(family):
    assert sorted(FACETS[family]) == list(range(len(FACETS[family])))


def test_an_error_in_an_included_file_names_it(tmp_path):
    (tmp_path / "more.inp").write_text("1, 0.\n2, 0.\nx, 0.\n")
    with pytest.raises(ReadError, match=r"more\.inp, line 3: 'x, 0\.'"):
        read_text(tmp_path, "*NODE\n7, 0.\n*INCLUDE, INPUT=more.inp\n")


def test_files_in_files_have_an_end(tmp_path):
    for k in range(30):
        (tmp_path / f"{k}.inp").write_text(f"*INCLUDE, INPUT={k + 1}.inp\n")
    with pytest.raises(ReadError, match="16th file inside others"):
        inp.read(tmp_path / "0.inp")


def test_compiled_lines_are_the_plain_ones():
    rng = np.random.default_rng(5)
    pieces = [b"1", b"23", b",", b", ", b" ", b"\t", b"\n", b"\r\n", b"999999999", b",\n"]
    for _ in range(500):
        text = b"".join(pieces[k] for k in rng.integers(0, len(pieces), rng.integers(0, 15))) + b"\n"
        plain = (
            text_files.values_in_lines_by_arrays(text),
            text_files.parsed(text.translate(text_files.AS_INTEGERS), np.int64),
        )
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(text_files, "_COMPILED", 0)
            compiled = text_files.values_in_lines(text), text_files.integers(text)
        assert compiled[0].tolist() == plain[0].tolist()
        assert (compiled[1] is None) == (plain[1] is None)
        assert plain[1] is None or compiled[1].tolist() == plain[1].tolist()


def test_pieces_of_a_large_file(tmp_path, monkeypatch):
    mesh = random_mesh(np.random.default_rng(4), order=2)
    with lenient():
        whole = again(tmp_path, mesh, target="abaqus")
        monkeypatch.setattr(text_files, "_CHUNK", 100)
        monkeypatch.setattr(text_files, "_COMPILED", 50)
        read = inp.read(tmp_path / "again.inp")
    assert np.array_equal(read.points, whole.points)
    assert cells_of(read, np.arange(read.n_cells)) == cells_of(whole, np.arange(whole.n_cells))


def test_names_for_each_program(tmp_path):
    names = ["rive gauche", "Été", "2nd", "a" * 90, "TOP", "top", "a,b"]
    mesh = Mesh.create([[0, 0, 0], [1, 0, 0]], [("SEG2", [[0, 1]])], cell_groups={n: [0] for n in names}, space_dim=3)
    with pytest.warns(LacmeshWarning, match="'rive gauche' is rive_gauche"):
        read = again(tmp_path, mesh)
    assert list(read.cell_groups) == ["rive_gauche", "Ete", "G_2nd", "a" * 80, "TOP", "top_2", "a_b"]
    with pytest.warns(LacmeshWarning, match="'Été' is Ete"):
        read = again(tmp_path, mesh, target="abaqus")
    assert list(read.cell_groups) == ["rive gauche", "Ete", "G_2nd", "a" * 80, "TOP", "top_2", "a,b"]


def test_what_the_file_loses_is_said_once(tmp_path):
    cube = cell_with_faces("HEXA8", facets=[0, 1])
    blocks = [*((b.type, b.nodes) for b in cube.blocks), ("SEG2", [[0, 1]]), ("POI1", [[3]])]
    mesh = Mesh.create(
        cube.points,
        blocks,
        cell_groups={"edge": [3], "none": [], "face": [1], "point": [4]},
        cell_data={"T": np.zeros(5)},
        zones=("z",),
    )
    with pytest.warns(LacmeshWarning) as said:
        read = again(tmp_path, mesh)
    assert [str(w.message) for w in said] == [
        ".inp: fields are left out: cell data T; the zones of the cut are left out: z; cells of lower dimension become "
        "sets of nodes: edge, point; empty groups are left out: none; 1 cells of lower dimension are in no group, and "
        "left out"
    ]
    assert {name: members.tolist() for name, members in read.node_groups.items()} == {
        "edge": [0, 1],
        "point": [3],
        "face": sorted(cube.blocks[1].nodes[0].tolist()),
    }


def test_cells_and_nodes_may_share_a_name(tmp_path):
    """Surfaces and sets of nodes are named apart, so that a deck's *CONTACT PAIR finds both."""
    cube = cell_with_faces("HEXA8", facets=[0])
    same = {"slave": np.unique(cube.blocks[1].nodes)}
    mesh = replace(cube, cell_groups={"slave": np.array([1])}, node_groups=same)
    read = again(tmp_path, mesh)
    assert set(read.cell_groups) == set(read.node_groups) == {"slave"}
    assert read.node_groups["slave"].tolist() == same["slave"].tolist()
    assert again(tmp_path, read).node_groups.keys() == {"slave"}


@pytest.mark.parametrize("target", ["calculix", "abaqus"])
def test_nodes_of_cells_are_kept_beside_a_group_of_other_nodes(tmp_path, target):
    cube = cell_with_faces("HEXA8", facets=[0])
    blocks = [*((b.type, b.nodes) for b in cube.blocks), ("SEG2", [[0, 1]])]
    mesh = Mesh.create(
        cube.points,
        blocks,
        cell_groups={"edge": [2], "slave": [1]},
        node_groups={"edge": [5, 6], "slave": [7], "edge_nodes": [2]},
    )
    with pytest.warns(LacmeshWarning, match="those of 'edge' are edge_nodes_2, those of 'slave' are slave_nodes"):
        read = again(tmp_path, mesh, target=target)
    assert {name: members.tolist() for name, members in read.node_groups.items()} == {
        "edge": [5, 6],
        "slave": [7],
        "edge_nodes": [2],
        "edge_nodes_2": [0, 1],
        "slave_nodes": np.unique(cube.blocks[1].nodes).tolist(),
    }
    assert list(read.cell_groups) == ["slave"]


def test_nodes_of_elements_of_every_width(tmp_path):
    nodes = "".join(f"{k}, {k}, {k * k}, {k % 3}\n" for k in range(1, 10))
    text = (
        f"*NODE\n{nodes}*ELEMENT, TYPE=C3D8\n30, 1, 2, 3, 4, 5, 6, 7, 8\n*ELEMENT, TYPE=DCOUP3D\n15, 9\n"
        "*ELEMENT, TYPE=T3D2\n20, 8, 9\n10, 3, 1\n*ELSET, ELSET=E\n20, 10\n*NSET, NSET=N, ELSET=E\n*ELSET, ELSET=F\n"
        "30, 20\n*NSET, NSET=M, ELSET=F\n"
    )
    with pytest.warns(LacmeshWarning, match="1 elements of type DCOUP3D are no cells"):
        mesh = read_text(tmp_path, text)
    assert {n: mesh.node_number[m].tolist() for n, m in mesh.node_groups.items()} == {
        "N": [1, 3, 8, 9],
        "M": [1, 2, 3, 4, 5, 6, 7, 8, 9],
    }


def test_sets_of_nodes_of_elements_look_at_each_card_once():
    """The cost does not grow with sets times cards; it was quadratic for as many sets as cards."""
    looked = []

    class Card(ElementCard):
        def __getattribute__(self, name):
            if name == "number":
                looked.append(self)
            return super().__getattribute__(name)

    line = element("T3D2")
    cards = [Card(None, line, np.array([k]), np.array([[k, k + 1]])) for k in range(1, 51)]
    nodes_of = NodesOf(cards)
    assert [nodes_of(np.array([k])).tolist() for k in range(1, 51)] == [[k, k + 1] for k in range(1, 51)]
    assert len(looked) <= 100


def test_real_numbers_have_20_characters(tmp_path):
    """Numbers have at most 20 characters, as CalculiX and Abaqus read no more."""
    values = np.array([-1.2345678901234567e-05, 1e-300, -123456.78901234567, 0.1, -0.12345678901234567, 1e22])
    mesh = Mesh.create(np.stack([values, values[::-1], values], axis=1), [], space_dim=3)
    read = again(tmp_path, mesh)
    words = re.findall(r"-?\d[^,\s]*", (tmp_path / "again.inp").read_text())
    assert max(map(len, words)) == 20
    assert np.allclose(read.points, mesh.points, rtol=1e-12, atol=0)
    assert read.points[3:5].tolist() == mesh.points[3:5].tolist() or np.allclose(read.points, mesh.points, rtol=1e-12)


def test_numbers_that_do_not_fit(tmp_path):
    mesh = Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])], node_number=[7, 1_000_000_000], cell_number=[5])
    with pytest.warns(LacmeshWarning, match="the numbers of nodes are not distinct from 1 to 999999999"):
        read = again(tmp_path, mesh)
    assert (read.node_number.tolist(), read.cell_number.tolist()) == ([1, 2], [5])


def test_wrong_options(tmp_path):
    mesh = Mesh.create([[0, 0]], [])
    for options in ({"target": "nastran"}, {"plane": "CPX"}):
        with pytest.raises(RequestError, match=r"an \.inp file is for calculix or abaqus"):
            inp.write(tmp_path / "a.inp", mesh, WriteOptions(**options))


def test_lines_of_16_numbers(tmp_path):
    mesh = cell_with_faces("HEXA27", facets=[0])
    mesh = Mesh.create(mesh.points, [("HEXA27", mesh.block("HEXA27"))], node_groups={"all": range(27)})
    inp.write(tmp_path / "a.inp", mesh, WriteOptions(target="abaqus"))
    lines = (tmp_path / "a.inp").read_text().splitlines()
    assert max(len([w for w in line.split(",") if w.strip()]) for line in lines) == 16
    assert sum(line.endswith(",") for line in lines) == 1  # the element goes on; the set's lines are whole


@pytest.mark.parametrize("back", [False, True])
def test_of_two_cells_behind_a_face_the_one_it_turns_from(tmp_path, back):
    """An interface listed outward of its second cell is that cell's face."""
    points = [[x, y, z] for z in (0, 1, 2) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    solid = [list(range(8)), list(range(4, 12))]
    face = [4, 7, 6, 5] if back else [4, 5, 6, 7]
    mesh = Mesh.create(points, [("HEXA8", solid), ("QUAD4", [face])], cell_groups={"middle": [2]})
    inp.write(tmp_path / "a.inp", mesh)
    assert (
        f"*SURFACE, NAME=middle, TYPE=ELEMENT\n{2 if back else 1}, S{1 if back else 2}\n"
        in (tmp_path / "a.inp").read_text()
    )


def test_the_options_of_the_command(tmp_path, capsys):
    source, target = tmp_path / "a.inp", tmp_path / "b.inp"
    source.write_text(_SQUARE + "*ELEMENT, TYPE=CAX4\n1, 1, 2, 3, 4\n*ELEMENT, TYPE=T2D2, ELSET=slave\n2, 1, 2\n")
    cut = ["cut", str(source), "--slave", "slave", "-q", "--force", "-o"]
    for more, elements in (([], ["CAX4"]), (["--plane", "CPE"], ["CPE4"]), (["--all-cells"], ["CAX4", "T2D2"])):
        assert main([*cut, str(target), *more]) == 0
        assert ("--all-cells" in capsys.readouterr().err) == (more != ["--all-cells"])
        assert set(re.findall(r"TYPE=(\w+)[,\n]", target.read_text())) >= set(elements)
    for option in (["--plane", "CPE"], ["--all-cells"]):
        assert main([*cut, str(tmp_path / "b.med"), *option]) == 2
        assert f"{option[0]} is for an .inp output" in capsys.readouterr().err
    assert not (tmp_path / "b.med").exists()


@pytest.mark.parametrize(
    ("line", "members"), [(" 2, 4", [2, 4]), ("GENERATE\n 2, 4, 2", [2, 4]), ("UNSORTED\n 4,", [4])]
)
def test_a_keyword_line_that_ends_with_a_comma(tmp_path, line, members):
    """CalculiX takes the next line for data, Abaqus for parameters: one with numbers is data."""
    mesh = read_text(tmp_path, "*NODE\n1, 0.\n2, 1.\n3, 2.\n4, 3.\n*NSET, NSET=A,\n" + line + "\n")
    assert mesh.node_number[mesh.node_groups["A"]].tolist() == members
