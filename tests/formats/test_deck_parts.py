"""Decks of parts and instances: carried as they stand, and written without parts once their mesh has changed."""

from __future__ import annotations

import shutil
import warnings
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
from lacmesh import LacmeshWarning, cut_skin, raise_order
from lacmesh.cli import main
from lacmesh.cutting.records import Cut
from lacmesh.errors import DataError
from tests.formats.decks import solved as run_calculix
from tests.formats.decks import tables
from tests.formats.inp_texts import PARTS
from tests.formats.test_deck import read_text, written
from tests.lacsolver.deck_texts import Block, solved

PROGRAM = shutil.which("ccx")
LOWER = Block(cells=(2, 2, 1))
UPPER = Block("C", (0, 0, 1), (1, 1, 2), (3, 3, 1))
#: two parts with numbers of their own, and names that a part and the assembly share, as Abaqus/CAE writes them
TWO = """\
*Heading
a press
*Part, name=Lower
{lower}*Nset, nset=Set-1
1
*Orientation, name=Ori
1., 0., 0., 0., 1., 0.
*Solid Section, elset=B, material=Steel, orientation=Ori
,
*End Part
*Part, name=Upper
{upper}*Solid Section, elset=C, material=Steel
,
*End Part
** the assembly
*Assembly, name=Assembly
*Instance, name=Lower-1, part=Lower
*End Instance
*Instance, name=Upper-1, part=Upper
0., 0., {gap}
*End Instance
*Elset, elset=_Press, internal, instance=Upper-1
 C_EZ1
*Surface, type=ELEMENT, name=Press
_Press, S2
*Surface, type=ELEMENT, name=Upper
Upper-1.C_EZ0, S1
*Surface, type=ELEMENT, name=Lower
Lower-1.B_EZ1, S2
*Nset, nset=Set-1, instance=Lower-1
B_Z0
*End Assembly
** the material
*Material, name=Steel
*Elastic
1000., 0.
*Surface Interaction, name=Touch
*Surface Behavior, pressure-overclosure=LINEAR
1e5
*Contact Pair, interaction=Touch, type=SURFACE TO SURFACE
Upper, Lower
*Boundary
Set-1, 1, 3
Upper-1.C_X0, 1
 Upper-1.{node}, 2
*Step, name=Press, nlgeom=NO
*Static
1., 1., 1e-05, 1.
*Dsload
Press, P, 20.
*Cload
Upper-1.{node}, 1, 0.5
*Node print, nset=Set-1, totals=only
RF
*Node print, nset=Upper-1.C_Z1
U
*End Step
"""
SURFACES = "*SURFACE, NAME=Upper\nC_EZ0, S1\n*SURFACE, NAME=Lower\nB_EZ1, S2\n"
NODE = int(UPPER.at(2, 2)[0])


def two(**parts):
    made = {"lower": LOWER.text(), "upper": UPPER.text(), "gap": "0.", "node": NODE} | parts
    return TWO.format(**made)


def quiet_read(folder, text, name="a.inp"):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LacmeshWarning)
        return read_text(folder, text, name)


def flat(folder, mesh, **options):
    """A deck of a mesh that has changed, and what was said of it."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", LacmeshWarning)
        text = written(folder, mesh, **options)
    return text, " ".join(str(one.message) for one in said)


def test_unchanged_decks_are_carried_as_they_stand(tmp_path):
    for text in (PARTS.replace("*End Assembly", "*End Assembly\n*Material, name=M"), two()):
        mesh = quiet_read(tmp_path, text)
        assert mesh.deck.apart
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert written(tmp_path, mesh) == text


def test_a_part_and_the_assembly_may_share_a_name(tmp_path):
    """Names of the only instance stand before those of its sets where the assembly has a set of the same name."""
    text = two().partition("*Instance, name=Upper-1")
    text = text[0] + "*Nset, nset=Set-1, instance=Lower-1\nB_Z0\n*End Assembly\n"
    groups = quiet_read(tmp_path, text).node_groups
    assert len(groups["Lower-1.Set-1"]) == 1
    assert len(groups["Set-1"]) == 9


def test_a_cut_deck_has_no_parts(tmp_path):
    """All cards are there, with names of both programs; what is read of it is the mesh that was written."""
    mesh = quiet_read(tmp_path, two())
    cut = cut_skin(mesh, "Upper", hexa="hexa").mesh
    text, said = flat(tmp_path, cut)
    assert "written without parts and instances" in said
    assert not [line for line in text.splitlines() if line.upper().startswith(("*PART", "*INSTANCE", "*ASSEMBLY"))]
    for line in ("** the material", "*Nset, nset=Set-1", "Upper-1_C_X0, 1", "*Heading", "a press", "Upper, Lower"):
        assert line.upper() in text.upper()
    node = NODE + LOWER.numbers.max()
    assert f" {node}, 2\n" in text and f"{node}, 1, 0.5\n" in text
    lines = text.splitlines()
    assert lines.index("*Material, name=Steel") < lines.index("*Orientation, NAME=Lower-1_Ori")
    assert "*Solid Section, ELSET=Lower-1_B, material=Steel, ORIENTATION=Lower-1_Ori" in lines
    back = quiet_read(tmp_path, text, "c.inp")
    assert back.cells_by_type == cut.cells_by_type
    assert {name.replace(".", "_"): len(cells) for name, cells in cut.cell_groups.items()} == {
        name: len(cells) for name, cells in back.cell_groups.items()
    }
    assert np.array_equal(np.sort(back.node_number), np.sort(cut.node_number))


def nodes_of_faces(cut):
    return [nodes for _, _, nodes in cut.mesh.select(np.flatnonzero(cut.macro_of_face >= 0))]


def test_records_of_the_cut_are_beside_the_deck(tmp_path):
    """New nodes follow the first card of nodes, and so stand in another order in the mesh that is read."""
    for name, text in (("parts", two()), ("cards", LOWER.text() + replace(UPPER, first=100).text() + SURFACES)):
        cut = cut_skin(quiet_read(tmp_path, text), "Upper", hexa="hexa")
        _, said = flat(tmp_path, cut.mesh, name=f"{name}.inp")
        assert "records" not in said
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LacmeshWarning)
            back = Cut(lacmesh.read(tmp_path / f"{name}.inp"))
        assert not np.array_equal(back.mesh.points, cut.mesh.points)
        there = [c.mesh.points[np.unique(np.concatenate([f.ravel() for f in nodes_of_faces(c)]))] for c in (cut, back)]
        assert np.allclose(*(np.sort(points, axis=0) for points in there))
        assert back.n_macros == cut.n_macros == 9


@pytest.mark.calculix
@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
def test_calculix_runs_it(tmp_path):
    """The force, and the shortening under 20 over two lengths of 1 and a contact of 1e5."""
    mesh = quiet_read(tmp_path, two().replace(", 1, 0.5", ", 1, 0."))
    flat(tmp_path, cut_skin(mesh, "Upper", hexa="hexa").mesh)
    (_, force), (_, u) = tables(run_calculix(tmp_path / "b.inp", PROGRAM))
    assert force[-1][2] == pytest.approx(20.0, rel=1e-6)
    assert np.allclose(u[:, 3], -20 * (2 / 1000 + 1 / 1e5), rtol=1e-6)


def test_lacsolver_imports_it(tmp_path):
    found = solved(tmp_path, two().replace(", 1, 0.5", ", 1, 0."))
    assert np.allclose(found.zone.pressure, 20, rtol=1e-9)
    assert {record.group for record in found.made.case.displacement} >= {"Set-1", "Upper-1.C_X0"}
    (node,) = found.made.mesh.node_groups[f"node_{NODE + LOWER.numbers.max()}"]
    assert np.allclose(found.made.mesh.points[node], UPPER.points[NODE - 1])


@pytest.mark.calculix
def test_convert_for_calculix(tmp_path, monkeypatch):
    """An unchanged deck of parts is carried, and written without them where CalculiX is named."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.inp").write_text(two())
    assert (
        main(["convert", "a.inp", "same.inp", "-q"])
        == main(["convert", "a.inp", "b.inp", "--for", "calculix", "-q"])
        == 0
    )
    assert (tmp_path / "same.inp").read_text() == two()
    (_, force), (_, u) = tables(run_calculix(tmp_path / "b.inp", PROGRAM))
    assert np.allclose(force[-1], [0, 0, 20.0], atol=1e-5)
    assert len(u) == len(UPPER.at(2, 2))


def test_two_instances_of_one_part(tmp_path):
    """A part that stands twice is written twice, each with its section; one of them is cut."""
    text = two().replace("*Instance, name=Upper-1", "*Instance, name=Lower-2, part=Lower\n5., 0., 0.\n*End Instance\n"
                         "*Instance, name=Upper-1")  # fmt: skip
    mesh = quiet_read(tmp_path, text)
    out, _ = flat(tmp_path, cut_skin(mesh, "Upper", hexa="hexa").mesh)
    assert out.count("*Solid Section, ELSET=Lower-1_B") == out.count("*Solid Section, ELSET=Lower-2_B") == 1
    back = quiet_read(tmp_path, out, "c.inp")
    assert np.ptp(back.points[back.node_groups["Lower-2_B_N"]], axis=0).tolist() == [1, 1, 1]
    assert back.points[back.node_groups["Lower-2_B_N"]].min(axis=0).tolist() == [5, 0, 0]


def test_a_part_without_an_instance(tmp_path):
    """It is no part of the model, whatever it says."""
    unused = (
        "*Part, name=Spare\n*Node\n1, 0., 0., 0.\n2, 1., 0., 0.\n*Element, type=B31\n1, 1, 2, 3\n*MPC\nBEAM, 1, 2\n"
    )
    mesh = quiet_read(tmp_path, two().replace("*Part, name=Lower\n", unused + "*End Part\n*Part, name=Lower\n"))
    out, _ = flat(tmp_path, cut_skin(mesh, "Upper", hexa="hexa").mesh)
    assert "MPC" not in out and "B31" not in out


def test_nodes_of_the_assembly(tmp_path):
    """A node of the assembly has a raised number, also where a card names it."""
    text = two().replace("*Nset, nset=Set-1, instance", "*Node\n1, 9., 9., 9.\n*Nset, nset=Set-1, instance")
    text = text.replace("*Boundary\n", "*Rigid Body, ref node=Ref, elset=Upper-1.C\n*Boundary\n1, 1, 6\n")
    text = text.replace("*End Assembly", "*Nset, nset=Ref\n1\n*End Assembly")
    mesh = quiet_read(tmp_path, text)
    last = int(mesh.node_number.max())
    out, _ = flat(tmp_path, cut_skin(mesh, "Lower", hexa="hexa").mesh)
    assert f"*Boundary\n{last}, 1, 6\n" in out
    assert "elset=Upper-1_C\n" in out.replace("ELSET", "elset")


#: text to be replaced, what replaces it, the card that the error names, words of its message
REFUSED = {
    "a card of a part": ("*Nset, nset=Set-1\n1\n", "*MPC\nBEAM, 1, 2\n", "MPC", "names and numbers are the part's"),
    "a number": ("Set-1, 1, 3", "7, 1, 3", "BOUNDARY", "name a set, or write instance.number"),
    "beams": (
        "*Nset, nset=Set-1\n1\n", "*Element, type=B31\n901, 1, 2, 3\n", "ELEMENT", "more than their nodes",
    ),
    "directions": (
        "0., 0., 0.\n*End", "0., 0., 0.\n0., 0., 0., 0., 0., 1., 90.\n*End", "ORIENTATION", "which the rotation",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_written_without_parts(tmp_path, name):
    old, new, card, words = REFUSED[name]
    text = two()
    if name == "directions":
        text = text.replace("*Solid Section, elset=C", "*Orientation, name=O\n1,0,0,0,1,0\n*Solid Section, elset=C")
    text = text.replace(old, new, 1)
    mesh = quiet_read(tmp_path, text)
    changed = replace(mesh, points=mesh.points * 2)
    with pytest.raises(DataError, match=rf"a.inp, line \d+: \*{card}: .*{words}"):
        flat(tmp_path, changed)
    line = f"*{card}".upper()
    out, said = flat(tmp_path, changed, lenient=True)
    assert "it is left out" in said
    assert name == "a number" or out.upper().count(line) < text.upper().count(line)


def test_a_mesh_with_other_elements_is_written_anew(tmp_path):
    _, said = flat(tmp_path, raise_order(quiet_read(tmp_path, two())))
    assert "written without parts" in said
    mesh = quiet_read(tmp_path, two())
    fewer = lacmesh.Mesh.create(mesh.points, [("HEXA8", mesh.block("HEXA8")[:2])])
    _, said = flat(tmp_path, replace(fewer, deck=mesh.deck))
    assert "written anew and not as the deck" in said
