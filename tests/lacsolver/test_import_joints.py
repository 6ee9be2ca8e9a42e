"""Decks with equations, local axes, couplings and sectors, with exact solutions: imported, solved, compared."""

from __future__ import annotations

import numpy as np
import pytest

from lacsolver.case import CaseError
from tests.lacsolver.deck_texts import Block, held, imported, section, solved, step
from tests.lacsolver.sectors import sector

E = 1000.0
COLUMN = Block(high=(1, 2, 3), cells=(1, 2, 2))
TOP = COLUMN.at(2, 3).tolist()
MIDDLE = [n for n in TOP if COLUMN.points[n - 1, 1] == 1]
REFERENCE = "*NODE\n999, 0.5, 1., 4.\n"
STRETCHED = 20 / (E * 2) * 3


def column(more, loads, *, nu=0.0, before="", supports=""):
    return (
        before
        + COLUMN.text()
        + "*SURFACE, NAME=TOP\nB_EZ1, S2\n"
        + section(nu=nu)
        + more
        + (supports or held())
        + step(loads)
    )


def pulled(nodes, size=20.0):
    return "*CLOAD\n" + "".join(f"{n}, 3, {size / len(nodes)}\n" for n in nodes)


def stretched(found):
    """The column is stretched evenly by 20."""
    u = found.u(COLUMN.numbers)
    exact = 20 / (E * 2) * COLUMN.points * [0, 0, 1]
    np.testing.assert_allclose(u, exact, atol=1e-12)


def test_equations_keep_a_top_level(tmp_path):
    rows = "".join(f"2\n{n}, 3, 1., {TOP[0]}, 3, -1.\n" for n in TOP[1:])
    found = solved(tmp_path, column("*EQUATION\n" + rows, pulled(MIDDLE)))
    stretched(found)
    assert len(found.made.case.equation) == len(TOP) - 1


def test_a_node_beside_the_bodies_moves_an_equation(tmp_path):
    rows = "".join(f"2\n{n}, 3, 2., 999, 1, -4.\n" for n in TOP)
    found = solved(
        tmp_path, column("*EQUATION\n" + rows, f"*BOUNDARY\n999, 1, 1, {STRETCHED / 2!r}\n", before=REFERENCE)
    )
    stretched(found)


def test_an_equation_of_many_terms_runs_over_lines(tmp_path):
    terms = [f"{n}, 3, {1 / len(TOP)!r}" for n in TOP]
    lines = ", ".join(terms[:4]) + ",\n" + ", ".join(terms[4:]) + ", 999, 2, -1.\n"
    text = column(f"*EQUATION\n{len(TOP) + 1}\n{lines}", "*BOUNDARY\n999, 2, 2, 0.1\n", nu=0.3, before=REFERENCE)
    found = solved(tmp_path, text)
    assert found.u(TOP)[:, 2].mean() == pytest.approx(0.1, rel=1e-12)


def test_a_plane_and_a_line(tmp_path):
    plane = "*MPC\nPLANE, " + ", ".join(map(str, [TOP[0], TOP[1], TOP[-1], *TOP[2:-1]])) + "\n"
    found = solved(tmp_path, column(plane, pulled(MIDDLE)))
    stretched(found)
    edge = [n for n in TOP if COLUMN.points[n - 1, 0] == 0]
    line = f"*MPC\nSTRAIGHT, {edge[0]}, {edge[2]}, {edge[1]}\n"
    bent = solved(tmp_path, column(line, pulled([edge[1]]), nu=0.3)).u(edge)
    np.testing.assert_allclose(bent[1, [0, 2]], bent[[0, 2]][:, [0, 2]].mean(axis=0), atol=1e-12)


def test_a_mean_rotation(tmp_path):
    turned = "*MPC\nMEANROT, " + ", ".join(f"{n},{n},{n}" for n in TOP[:2]) + ",\n"
    turned += ", ".join(f"{n},{n},{n}" for n in TOP[2:]) + ", 998\n"
    text = column(turned, "*BOUNDARY\n998, 1, 1, 1e-3\n", before="*NODE\n998, 0., 0., 2.\n", supports=clamped())
    u, x = solved(tmp_path, text).u(TOP), COLUMN.points[np.array(TOP) - 1] - [0.5, 1, 0]
    angle = (x[:, 0] * u[:, 1] - x[:, 1] * u[:, 0]) / (x[:, :2] ** 2).sum(axis=1)
    assert angle.mean() == pytest.approx(1e-3, rel=1e-10)


def clamped():
    return "*BOUNDARY\nB_Z0, 1, 3\n"


def test_local_axes_of_supports_and_forces(tmp_path):
    """Local 1 is y, 2 is -x, 3 is z at all nodes: the supports and forces of the column, written so."""
    axes = "*TRANSFORM, NSET=B_N\n0., 1., 0., -1., 0., 0.\n"
    supports = "*BOUNDARY\nB_Z0, 3\nB_X0, 2\nB_Y0, 1\n"
    found = solved(tmp_path, column(axes, "*DLOAD\nB_EZ1, P2, -10.\n", supports=supports))
    stretched(found)
    side = "*CLOAD\n" + "".join(f"{n}, 1, 1.\n" for n in TOP)
    turned = solved(tmp_path, column(axes, side, supports=clamped()))
    plain = solved(tmp_path, column("", side.replace(", 1, 1.", ", 2, 1."), supports=clamped()))
    np.testing.assert_allclose(turned.u(COLUMN.numbers), plain.u(COLUMN.numbers), atol=1e-13)


def test_an_equation_of_nodes_with_local_axes(tmp_path):
    axes = f"*NSET, NSET=ONE\n{TOP[-1]}\n*TRANSFORM, NSET=ONE\n1., 1., 0., 0., 1., 0.\n"
    text = column(
        f"{axes}*EQUATION\n2\n{TOP[-1]}, 1, 1., 999, 1, -1.\n", "*BOUNDARY\n999, 1, 1, 0.01\n", before=REFERENCE
    )
    u = solved(tmp_path, text).u([TOP[-1]])[0]
    assert (u[0] + u[1]) / np.sqrt(2) == pytest.approx(0.01, rel=1e-12)


def test_cylindrical_axes_hold_a_sector(tmp_path):
    """A wedge whose sides slide along the radius: supports across are local 2."""
    block = Block(low=(1, 0, 0), high=(2, 1, 1), cells=(2, 2, 1))
    angle = block.points[:, 1] * np.pi / 3
    block.points = np.stack(
        [block.points[:, 0] * np.cos(angle), block.points[:, 0] * np.sin(angle), block.points[:, 2]], 1
    )
    text = block.text() + section(nu=0.0) + "*TRANSFORM, NSET=B_N, TYPE=C\n0., 0., 0., 0., 0., 1.\n"
    sides = "".join(f"{n}, 2\n" for n in [*block.numbers[angle < 1e-9], *block.numbers[angle > np.pi / 3 - 1e-9]])
    ends = "".join(f"{n}, 1, 1, 0.01\n" for n in block.numbers[np.linalg.norm(block.points[:, :2], axis=1) < 1.001])
    text += "*BOUNDARY\nB_Z0, 3\n" + sides + step("*BOUNDARY\n" + ends)
    u = solved(tmp_path, text).u(block.numbers)
    r = np.linalg.norm(block.points[:, :2], axis=1)
    across = (-block.points[:, 1] * u[:, 0] + block.points[:, 0] * u[:, 1]) / r
    np.testing.assert_allclose(across[np.isin(angle, [angle.min(), angle.max()])], 0, atol=1e-13)


@pytest.mark.parametrize("kind", ["*KINEMATIC\n1, 3\n", "*DISTRIBUTING\n1, 6\n", "*KINEMATIC\n3, 3\n"])
def test_couplings_pull_a_column(tmp_path, kind):
    text = column(
        f"*COUPLING, REF NODE=999, SURFACE=TOP, CONSTRAINT NAME=C1\n{kind}",
        pulled([999]),
        before=REFERENCE,
        supports=clamped(),
    )
    found = solved(tmp_path, text)
    stretched(found)
    assert found.made.case.coupling[0].kind == ("rigid" if "KIN" in kind else "distributing")
    assert (found.made.case.coupling[0].components == ("uz",)) == ("3, 3" in kind)


def test_a_distributing_coupling_has_its_weights(tmp_path):
    weights = {n: 1.0 if n in MIDDLE else 0.5 for n in TOP}
    text = "*ELEMENT, TYPE=DCOUP3D, ELSET=D\n777, 999\n*DISTRIBUTING COUPLING, ELSET=D\n"
    text += "".join(f"{n}, {w}\n" for n, w in weights.items())
    found = solved(tmp_path, column(text, pulled([999]), before=REFERENCE))
    stretched(found)


def test_a_moment_at_a_reference_node_and_a_prescribed_one(tmp_path):
    text = column("*COUPLING, REF NODE=999, SURFACE=TOP\n*DISTRIBUTING\n", "*CLOAD\n999, 4, 3.\n", before=REFERENCE)
    case = imported(tmp_path, text).case
    assert [v.at(1.0) for v in case.coupling[0].moment] == [3.0, 0.0, 0.0] and case.coupling[0].at == (0.5, 1.0, 4.0)
    moved = "*BOUNDARY\n999, 3, 3, 0.1\n999, 4, 6, 0.\n"
    text = column("*COUPLING, REF NODE=999, SURFACE=TOP\n*KINEMATIC\n", moved, before=REFERENCE)
    case = imported(tmp_path, text).case
    assert case.coupling[0].uz.at(1.0) == 0.1 and [v.at(1.0) for v in case.coupling[0].rotation] == [0, 0, 0]


def test_a_rotation_about_one_axis(tmp_path):
    """Prescribed about y, free about x under a moment and about z; with NLGEOM a rigid coupling takes it too."""
    loads = "*BOUNDARY\n999, 1, 3\n999, 5, 5, 0.01\n*CLOAD\n999, 4, 3.\n"
    for head in ("*COUPLING, REF NODE=999, SURFACE=TOP\n*KINEMATIC\n", "*RIGID BODY, NSET=B_Z1, REF NODE=999\n"):
        text = column(head, loads, before=REFERENCE)
        for options in ("", ", NLGEOM"):
            case = imported(tmp_path, text.replace("*STEP\n", f"*STEP{options}\n")).case
            (one,) = (*case.coupling, *case.rigid)
            assert (one.rotation[0], one.rotation[1].source, one.rotation[2]) == ("free", 0.01, "free")
            assert [value.source for value in one.moment] == [3.0, 0.0, 0.0]
    partly = column("*COUPLING, REF NODE=999, SURFACE=TOP\n*KINEMATIC\n1\n3\n", loads, before=REFERENCE)
    assert imported(tmp_path, partly).case.coupling[0].components == ("ux", "uz")
    held = partly.replace("*STEP\n", "*STEP, NLGEOM\n").replace("999, 5, 5, 0.01", "999, 5, 5, 0.01\n999, 4\n999, 6")
    assert imported(tmp_path, held.replace("*CLOAD\n999, 4, 3.\n", "")).case.kinematics == "finite"


@pytest.mark.parametrize(
    "kind, words",
    [
        ("*DISTRIBUTING\n1, 6\n", "turns freely about all axes or about none"),
        ("*KINEMATIC\n1\n3\n", "turns only as its rotations are prescribed"),
    ],
)
def test_large_rotations_about_one_axis_that_are_refused(tmp_path, kind, words):
    text = column(f"*COUPLING, REF NODE=999, SURFACE=TOP\n{kind}", "*BOUNDARY\n999, 4\n", before=REFERENCE)
    with pytest.raises(CaseError, match=rf"line \d+: \*COUPLING: .*{words}"):
        imported(tmp_path, text.replace("*STEP\n", "*STEP, NLGEOM\n"))


def test_a_sector(tmp_path):
    """A sixth of a ring grows evenly; its sides are surfaces of nodes."""
    mesh = sector("HEXA8", (2, 2, 1), 6)
    x = mesh.points
    lines = "*NODE, NSET=N\n" + "".join(f"{k + 1}, {a!r}, {b!r}, {c!r}\n" for k, (a, b, c) in enumerate(x.tolist()))
    lines += "*ELEMENT, TYPE=C3D8, ELSET=B\n"
    lines += "".join(f"{k + 1}, " + ", ".join(map(str, row + 1)) + "\n" for k, row in enumerate(mesh.block("HEXA8")))
    for name in ("a", "b"):
        nodes = np.unique(np.concatenate([rows.ravel() for _, _, rows in mesh.select(mesh.cell_groups[name])]))
        lines += f"*NSET, NSET=S{name}\n" + "".join(f"{n + 1}\n" for n in nodes)
        lines += f"*SURFACE, NAME=SIDE_{name}, TYPE=NODE\nS{name}\n"
    lines += section(nu=0.3) + "*TIE, NAME=T1, CYCLIC SYMMETRY\nSIDE_a, SIDE_b\n"
    lines += "*CYCLIC SYMMETRY MODEL, N=6, TIE=T1\n0., 0., 0., 0., 0., 1.\n"
    r = np.linalg.norm(x[:, :2], axis=1)
    edge = np.flatnonzero((r < 1.001) | (r > 1.999))
    grown = "".join(
        f"{k + 1}, 1, 1, {0.01 * float(x[k, 0])!r}\n{k + 1}, 2, 2, {0.01 * float(x[k, 1])!r}\n{k + 1}, 3, 3, 0.\n"
        for k in edge
    )
    supports = "*BOUNDARY\n" + "".join(f"{k + 1}, 3\n" for k in range(len(x)))
    found = solved(tmp_path, lines + supports + step("*BOUNDARY\n" + grown))
    np.testing.assert_allclose(found.u(np.arange(1, len(x) + 1)), 0.01 * x * [1, 1, 0], atol=1e-12)
    assert found.made.case.cyclic[0].sectors == 6


REFUSED = {
    "rotations": ("*EQUATION\n2\n1, 4, 1., 2, 1, -1.\n", "directions of an equation should be 1 to 3"),
    "terms": ("*EQUATION\n3\n1, 1, 1., 2, 1, -1.\n", "it should have 3 terms, and has 2"),
    "set": ("*EQUATION\n2\nB_N, 1, 1., 2, 1, -1.\n", "a term of an equation should be at one node"),
    "kind": ("*MPC\nBEAM, 1, 2\n", "PLANE, STRAIGHT and MEANROT, and not BEAM"),
    "flat": ("*MPC\nPLANE, 1, 1, 2, 3\n", "are on one line, and define no plane"),
    "axes": ("*TRANSFORM, NSET=B_N\n1, 0, 0, 2, 0, 0\n", "on one line with the origin"),
    "coupling": ("*COUPLING, REF NODE=1, SURFACE=TOP\n", "it should be followed by \\*KINEMATIC or \\*DISTRIBUTING"),
    "kinematic": ("*KINEMATIC\n1, 3\n", "it belongs after \\*COUPLING"),
    "model": ("*CYCLIC SYMMETRY MODEL, N=4\n0, 0, 0, 0, 0, 1\n", "it should follow \\*TIE, CYCLIC SYMMETRY"),
    "modes": ("*SELECT CYCLIC SYMMETRY MODES, NMIN=0, NMAX=2\n", "modes with nodal diameters are not taken"),
    "free": (
        "*NODE\n99, 0, 0, 9\n*EQUATION\n2\n1, 1, 1., 99, 1, -1.\n",
        "node 99 belongs to no solid element, and is free",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused(tmp_path, name):
    more, words = REFUSED[name]
    with pytest.raises(CaseError, match=words):
        imported(tmp_path, column(more, pulled(TOP)))
