"""Matrices (37) to (43) of the manual (R5.03.55, 3.3.4): its multipliers on nodes, and our one for a macro-element.

A HEXA8 whose slave face is cut into hexahedra has one macro-element of five faces: I to IV around, V in the middle. The
corners of the face are x_1 to x_4, those of V are d_1 to d_4, which carry the multipliers 1 to 4.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lacmesh import Cut, aster_multipliers, cut_skin
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import jacobian, shape
from lacsolver.contact import Zone, integrate
from tests.lacsolver.patch_meshes import stack, ways
from verification.meshes.stacks import PLANE_KINDS, SOLID_KINDS

#: (42): rows are multipliers 1 to 4, columns x_1 to x_4 and d_1 to d_4
CLASSICAL = """
a_I+b_IV | b_I      | 0          | a_IV       | a_V+c_I+c_IV | b_V+d_I      | c_V            | d_V+d_IV
a_I      | a_II+b_I | b_II       | 0          | a_V+c_I      | b_V+d_I+d_II | c_V+c_II       | d_V
0        | a_II     | b_II+a_III | b_III      | a_V          | b_V+d_II     | c_V+c_II+d_III | d_V+c_III
b_IV     | 0        | a_III      | b_III+a_IV | a_V+c_IV     | b_V          | c_V+d_III      | d_V+c_III+d_IV
"""
#: (43), transposed
WANTED = "a_I+b_IV | b_I+a_II | b_II+a_III | b_III+a_IV | a_V+c_I+c_IV | b_V+d_I+d_II | c_V+d_III+c_II | d_V+c_III+d_IV"
#: nodes of each face in the order of its letters a, b, c, d; in (37) c_I and d_I stand at d_2 and d_1, in (42) and (43)
#: at d_1 and d_2, which is what is kept here; the unknowns of (41) are printed as those of (40)
NODES = {
    "I": ("x1", "x2", "d1", "d2"),
    "II": ("x2", "x3", "d3", "d2"),
    "III": ("x3", "x4", "d4", "d3"),
    "IV": ("x4", "x1", "d1", "d4"),
    "V": ("d1", "d2", "d3", "d4"),
}
COLUMNS = ("x1", "x2", "x3", "x4", "d1", "d2", "d3", "d4")


@pytest.fixture(scope="module")
def face():
    """The cut, its interface with its one macro-element, and the one that has each face apart."""
    mesh = stack("HEXA8", "HEXA8", 3, counts=(1, 3))
    cut = cut_skin(mesh, "slave", hexa="hexa")
    return cut, *interfaces(cut, 3)


@pytest.fixture(scope="module")
def nodes(face):
    """The node of the mesh that each of x_1 .. d_4 is: x turns about the face as the faces I to IV do."""
    cut = face[0]
    (faces,) = cut.faces_of_macro
    (_, cells, connectivity), *_ = [part for part in cut.mesh.select(faces) if part[0] == "QUAD4"]
    ring = connectivity[np.argsort(cut.child_kind[cells])]
    found = {f"x{k + 1}": ring[k, 0] for k in range(4)}
    assert [ring[k, 1] for k in range(4)] == [found[f"x{k}"] for k in (2, 3, 4, 1)]
    for k, row in enumerate(ring[:4]):
        found[f"d{k + 1}"] = row[3]
        assert row[2] == ring[(k + 1) % 4, 3]
    assert set(ring[4]) == {found[f"d{k}"] for k in range(1, 5)}
    return found


@pytest.fixture(scope="module")
def letters(face, nodes):
    """a_I .. d_V: int N over each face of the slave, by a rule of its own."""
    cut = face[0]
    X, w = rule("QUAD", 6)
    made = {}
    for name, cell in zip(NODES, cut.faces_of_macro[0], strict=True):
        ((_, _, (corners,)),) = cut.mesh.select(np.array([cell]))
        J = jacobian("QUAD4", cut.mesh.points[corners][None], X)[0]
        area = np.linalg.norm(np.cross(J[..., 0], J[..., 1]), axis=1)
        integral = dict(zip(corners, (w * area) @ shape("QUAD4", X), strict=True))
        made |= {f"{letter}_{name}": integral[nodes[at]] for letter, at in zip("abcd", NODES[name], strict=True)}
    return made


def interfaces(cut, dim):
    """The interface of a cut's slave; and that of the same faces, each a macro-element of its own."""
    zone = Zone.of(cut.mesh, "slave", "master")
    apart = replace(zone, macro=np.arange(len(zone.slave)), number=np.arange(len(zone.slave)))
    return integrate(zone, dim), integrate(apart, dim)


def said(line, letters):
    """The numbers of a row of letters."""
    return [sum(letters[term.strip()] for term in entry.split("+")) for entry in line.split("|")]


def along_normal(B, nodes, dim=3):
    """The columns of nodes, in the direction of the height, which is the normal's."""
    return B[:, [dim * node + dim - 1 for node in nodes]].toarray()


def assembled(cut, apart, shared):
    """A row for each node that carries a multiplier: every face gives its row to each one that it carries (`nodes`)."""
    multipliers = aster_multipliers(cut)
    cells = {cell: row for row, cell in enumerate(apart.zone.slave.cell)}
    carriers = np.unique(multipliers.nodes[multipliers.nodes >= 0])
    out = np.zeros((len(carriers), apart.B.shape[1]))
    for cell, carried, share in zip(multipliers.faces, multipliers.nodes, multipliers.share, strict=True):
        for node in carried[carried >= 0]:
            row = apart.B[[cells[cell]]].toarray()[0]
            out[np.searchsorted(carriers, node)] += share * row if shared else row
    return carriers, out


def test_classical_assembly_is_42(face, nodes, letters):
    cut, _, apart = face
    carriers, rows = assembled(cut, apart, shared=False)
    order = [np.searchsorted(carriers, nodes[f"d{k}"]) for k in range(1, 5)]
    assert sorted(carriers) == sorted(nodes[f"d{k}"] for k in range(1, 5))
    found = rows[order][:, [3 * nodes[c] + 2 for c in COLUMNS]]
    wanted = [said(line, {**letters, "0": 0.0}) for line in CLASSICAL.strip().splitlines()]
    np.testing.assert_allclose(found, wanted, atol=1e-14)


def test_our_row_is_43(face, nodes, letters):
    _, interface, _ = face
    found = along_normal(interface.B, [nodes[c] for c in COLUMNS])
    np.testing.assert_allclose(found, [said(WANTED, letters)], atol=1e-14)
    np.testing.assert_allclose(found.sum(), interface.area, rtol=1e-14)


def test_42_is_not_the_coupling_with_one_pressure_a_macro_element(face, nodes, letters):
    """Neither a row of the manual's (42) nor the sum of its rows is (43)."""
    cut, interface, apart = face
    _, rows = assembled(cut, apart, shared=False)
    wanted = interface.B.toarray()[0]
    at = [3 * nodes[c] + 2 for c in COLUMNS]
    for row in (*rows, rows.sum(axis=0)):
        assert np.abs(row - wanted)[at].max() > 0.1 * np.abs(wanted).max()


KINDS = [(kind, 2, "pyramid") for kind in PLANE_KINDS]
KINDS += [(kind, 3, way) for kind in SOLID_KINDS for way in ways(kind)]


@pytest.mark.parametrize("kind, dim, way", KINDS)
def test_halves_and_quarters_make_one_row_a_macro_element(kind, dim, way):
    """Each face's share (1, 1/2 or 1/4) and the sum over the carriers give B, the master's side included."""
    mesh = stack(kind, "mixed 2", dim, counts=(2, 2))
    cut: Cut = cut_skin(mesh, "slave", hexa=way)
    interface, apart = interfaces(cut, dim)
    carriers, rows = assembled(cut, apart, shared=True)
    macro = aster_multipliers(cut).patch_of_node[carriers] - 1
    B = np.zeros(interface.B.shape)
    np.add.at(B, np.searchsorted(interface.zone.number, macro), rows)
    np.testing.assert_allclose(B, interface.B.toarray(), atol=1e-15)
    assert np.abs(B).max() > 1e-3
