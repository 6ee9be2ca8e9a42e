"""Slip over anchors: its derivative against differences, its objectivity, which anchors are kept; and the multipliers
of the manual (R5.03.55, 3.3.4), which are on nodes where those of the solver are on macro-elements.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from lacmesh import aster_multipliers, cut_skin
from lacsolver.contact import Pairing, Zone, integrate
from lacsolver.contact.anchors import Anchors, renewed, slip
from lacsolver.contact.tangent import motion_of
from tests.lacsolver.patch_meshes import stack, ways
from tests.lacsolver.test_interface import PAIRS, wavy
from tests.lacsolver.test_tangent import ANY, MEASURES, NORMALS, STRAIGHT
from tests.samples import each_option
from verification.meshes.stacks import PLANE_KINDS, SOLID_KINDS

#: of a difference
STEP, EXACT = 1e-5, 1e-9
OPTIONS = list(itertools.product([*PAIRS, ("QUAD4", "QUAD8", 2)], MEASURES, NORMALS))


class Anchored:
    """A zone with anchors from one deformed state; `slip` in others."""

    def __init__(
        self, pair, measure="reference", normals="facet", counts=(2, 3), margin=0.15, surface="smooth", **options
    ):
        mesh, self.zone = wavy(*pair, gap=0.1, counts=counts, margin=margin, surface=surface)
        self.dim, self.rng = pair[2], np.random.default_rng(4)
        self.pairing = Pairing(search_distance=0.6, normals=normals, measure=measure, friction=True, **options)
        self.before = self.shaken(mesh.points, 4e-3)
        self.face = self.at(self.before)
        self.anchors = renewed(Anchors.none(), self.face, np.ones(self.zone.n_macros, bool))

    def shaken(self, x, size):
        out = x.copy()
        out[:, : self.dim] += size * self.rng.uniform(-1, 1, (len(x), self.dim))
        return out

    def at(self, x):
        return integrate(self.zone, self.dim, self.pairing, x=x)

    def slip(self, x, anchors=None):
        anchors, face = self.anchors if anchors is None else anchors, self.at(x)
        return slip(anchors, face, self.pairing, self.before, motion=lambda: self.motion(face))

    def motion(self, face):
        return motion_of(face, face.slave, face.master, self.pairing, self.dim)

    def slip_of_anchors(self, x):
        """Return the slip of anchors, for which it does not matter what is in front of each other at x."""
        face = replace(self.face, slave=self.zone.slave.at(x), master=self.zone.master.at(x))
        return slip(self.anchors, face, self.pairing, self.before)


def error(case, slip_at, x):
    """Return the error of D_T at x in a random direction against differences of fourth order."""
    v = np.zeros_like(x)
    v[:, : case.dim] = case.rng.uniform(-1, 1, (len(x), case.dim))
    far, near = ((slip_at(x + h * v).S - slip_at(x - h * v).S).ravel() / (2 * h) for h in (2 * STEP, STEP))
    want = (4 * near - far) / 3
    return np.abs(slip_at(x).D_T @ v[:, : case.dim].ravel() - want).max() / np.abs(want).max()


@pytest.mark.rows("('QUAD4', 'QUAD8', 2)-current-master")
@pytest.mark.parametrize("pair, measure, normals", each_option(OPTIONS), ids=str)
def test_the_derivative(pair, measure, normals):
    """Anchors in a state that is far from theirs; there S is 0."""
    case = Anchored(pair, measure, normals)
    np.testing.assert_allclose(case.slip_of_anchors(case.before).S, 0, atol=1e-15)
    x = case.shaken(case.before, 4e-3)
    there = case.slip_of_anchors(x)
    assert (np.abs(there.S).max(axis=0) > 1e-5).all()
    assert error(case, case.slip_of_anchors, x) <= EXACT


@pytest.mark.parametrize(
    "pair, normals", each_option(itertools.product([*PAIRS, ("QUAD4", "QUAD8", 2)], NORMALS)), ids=str
)
def test_a_rotation_is_no_slip(pair, normals):
    """A rotation of both skins by 1.4, and then by half a turn, changes no slip, whatever it is before."""
    case = Anchored(pair, normals=normals)
    x = case.shaken(case.before, 4e-3)
    for start, angle in itertools.product((case.before, x), (1.4, np.pi)):
        R = rotation(case.dim, angle)
        turned = case.slip_of_anchors(start @ R.T + 0.3)
        np.testing.assert_allclose(turned.S, case.slip_of_anchors(start).S, atol=1e-14)


def rotation(dim, angle):
    """(3, 3): about z in a plane."""
    axis = np.array([0, 0, 1.0]) if dim == 2 else np.array([1.0, 2.0, -2.0]) / 3
    W = np.cross(np.eye(3), axis)
    return np.eye(3) - np.sin(angle) * W + (1 - np.cos(angle)) * W @ W


@pytest.mark.rows("('TRIA6', 'QUAD8', 2)-smooth", "('HEXA8', 'TETRA4', 3)-faces")
@pytest.mark.parametrize("pair, surface", list(itertools.product(PAIRS, ("faces", "smooth"))), ids=str)
def test_where_the_anchors_are_slip_is_that_of_the_rows(pair, surface):
    """Along normals of faces and of smooth surfaces over them, tractions do the work that their slip asks for."""
    case = Anchored(pair, surface=surface)
    there, face = case.slip(case.before), case.at(case.before)
    np.testing.assert_allclose((there.D_T - face.B_T).toarray(), 0, atol=1e-13 * np.abs(face.B_T).max())
    np.testing.assert_allclose(there.w, face.w, rtol=1e-13)


@pytest.mark.parametrize("pair", [PAIRS[0], PAIRS[2]], ids=str)
def test_ten_cycles_end_where_they_began(pair):
    """Macro-elements that stick keep their anchors; those that slide have new ones, and their slip begins at 0."""
    case = Anchored(pair)
    anchors, states = case.anchors, [case.shaken(case.before, 4e-3) for _ in range(3)]
    sticks = np.arange(case.zone.n_macros) % 2 == 0
    for x in [*states * 3, case.before]:
        anchors = renewed(anchors, case.at(x), ~sticks)
        np.testing.assert_allclose(case.slip(x, anchors).S[~sticks], 0, atol=1e-15)
    assert (np.diff(anchors.macro) >= 0).all()
    np.testing.assert_allclose(case.slip(states[0], anchors).S[sticks], case.slip(states[0]).S[sticks], atol=1e-16)


@pytest.mark.rows("('QUAD4', 'TRIA3', 2)-facet", "('HEXA8', 'TETRA4', 3)-master")
@pytest.mark.parametrize("pair, normals", each_option(itertools.product(PAIRS, NORMALS)), ids=str)
def test_without_anchors_slip_is_that_since_the_last_state(pair, normals):
    """Points without anchors are objective too, and their slip is to first order what the anchors would have said."""
    case = Anchored(pair, normals=normals)
    x = case.shaken(case.before, 1e-6)
    none, there = case.slip(x, Anchors.none()), case.slip(x)
    size = np.abs(there.S).max()
    np.testing.assert_allclose(none.S, there.S, atol=1e-3 * size if normals == "facet" else 0.1 * size)
    face = case.at(x)
    assert (
        abs(slip(Anchors.none(), face, case.pairing, case.before).D_T - face.B_T).max() <= 1e-14 * abs(face.B_T).max()
    )
    turned = x @ rotation(case.dim, 1.4).T
    np.testing.assert_allclose(case.slip(turned, Anchors.none()).S, none.S, atol=1e-14)
    some = renewed(case.anchors, case.at(x), np.zeros(case.zone.n_macros, bool))
    some = Anchors._make(values[some.macro > 0] for values in some)
    mixed = case.slip(x, some)
    np.testing.assert_allclose(mixed.S[1:], there.S[1:], atol=1e-16)
    np.testing.assert_allclose(mixed.S[0], none.S[0], atol=1e-16)


@pytest.mark.parametrize("pair, measure, normals", each_option(itertools.product(ANY, MEASURES, NORMALS)), ids=str)
def test_the_derivative_without_anchors(pair, measure, normals):
    """In front of one face of the master the integrals are exact; the last state is far away."""
    case = Anchored(pair, measure, normals, counts=(2, 1))
    x = case.shaken(case.before, 4e-3)
    assert error(case, lambda x: case.slip(x, Anchors.none()), x) <= EXACT


@pytest.mark.parametrize("pair, margin", each_option(itertools.product(STRAIGHT, (0.15, -0.05))), ids=str)
def test_the_derivative_without_anchors_has_moving_edges(pair, margin):
    """Slaves with straight faces, in front of several, and beyond the master's boundary."""
    case = Anchored(pair, counts=(3, 4), margin=margin, surface="faces")
    x = case.shaken(case.before, 4e-3)
    assert error(case, lambda x: case.slip(x, Anchors.none()), x) <= (EXACT if margin > 0 or pair[2] == 2 else 1e-5)


# ---- multipliers on nodes

CUT = [(kind, 2, "pyramid") for kind in PLANE_KINDS] + [(kind, 3, way) for kind in SOLID_KINDS for way in ways(kind)]


@pytest.mark.rows("TRIA6-2-pyramid", "HEXA8-3-hexa")
@pytest.mark.parametrize("kind, dim, way", CUT)
def test_halves_and_quarters_make_one_row_a_macro_element(kind, dim, way):
    """Each face's share (1, 1/2 or 1/4) and the sum over the nodes that carry it give B, the master's side included."""
    cut = cut_skin(stack(kind, "mixed 2", dim, counts=(2, 2)), "slave", hexa=way)
    zone = Zone.of(cut.mesh, "slave", "master")
    faces = np.arange(len(zone.slave))  # each a macro-element of its own
    whole, apart = integrate(zone, dim), integrate(replace(zone, macro=faces, number=faces), dim)
    multipliers = aster_multipliers(cut)
    row_of, B = {cell: row for row, cell in enumerate(zone.slave.cell)}, np.zeros(whole.B.shape)
    for cell, carried, share in zip(multipliers.faces, multipliers.nodes, multipliers.share, strict=True):
        for node in carried[carried >= 0]:
            macro = multipliers.patch_of_node[node] - 1
            B[np.searchsorted(zone.number, macro)] += share * apart.B[[row_of[cell]]].toarray()[0]
    np.testing.assert_allclose(B, whole.B.toarray(), atol=1e-15)
    assert np.abs(B).max() > 1e-3


def test_the_multipliers_of_a_hexahedron_cut_into_hexahedra_are_at_the_corners_of_its_middle_face():
    """Matrix (42): each of the faces around gives its row to two corners, the middle one to all four."""
    cut = cut_skin(stack("HEXA8", "HEXA8", 3, counts=(1, 3)), "slave", hexa="hexa")
    multipliers = aster_multipliers(cut)
    (faces,) = cut.faces_of_macro
    corners = {
        cell: set(nodes) for _, cells, rows in cut.mesh.select(faces) for cell, nodes in zip(cells, rows, strict=True)
    }
    (middle,) = [cell for cell in faces if all(len(corners[cell] & corners[other]) > 1 for other in faces)]
    for cell, carried in zip(multipliers.faces, multipliers.nodes, strict=True):
        assert set(carried[carried >= 0]) == corners[cell] & corners[middle]
    assert sorted(multipliers.share) == [0.25, 0.5, 0.5, 0.5, 0.5]
