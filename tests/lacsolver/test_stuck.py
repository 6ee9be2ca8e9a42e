"""Macro-elements that nothing can move any more: all nodes of both skins are prescribed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lacsolver.case import CaseError
from lacsolver.results.state import CONTACT, OPEN, UNPAIRED
from tests.lacsolver.contact_cases import JOINT, held, only, pressed, resultant
from tests.lacsolver.patch_meshes import stack
from tests.problem_meshes import overhang

TIE = JOINT.replace("[[contact]]", "[[tie]]")
LOW = held("lower", ux=0.0, uy=0.0, uz=0.0)


def high(uz):
    return held("upper", ux=0.0, uy=0.0, uz=uz)


@pytest.mark.parametrize(
    "kind", [JOINT, JOINT + 'geometry = "current"\n', JOINT + 'type = "bilateral"\n', TIE],
    ids=["reference", "current", "bilateral", "tie"],
)  # fmt: skip
def test_skins_that_fit_are_what_they_are(kind):
    _, state = only(stack("HEXA8", "TETRA4", 3), kind + LOW + high(0.0))
    (zone,) = state.zones
    assert (zone.status == (CONTACT if "bilateral" in kind or kind is TIE else OPEN)).all()
    assert (zone.pressure == 0).all() and np.abs(zone.gap).max() <= 1e-15


def test_an_open_gap_is_told():
    _, state = only(stack("HEXA8", "TETRA4", 3), JOINT + LOW + high(0.01))
    (zone,) = state.zones
    assert (zone.status == OPEN).all() and (zone.pressure == 0).all()
    np.testing.assert_allclose(zone.gap, 0.01, rtol=1e-12)


@pytest.mark.parametrize(
    "kind, uz, says",
    [
        (
            JOINT,
            -0.01,
            "contact: 9 macro-elements overlap by up to 0.01 at time 1, most near .*all nodes of both skins",
        ),
        (JOINT + 'type = "bilateral"\n', 0.02, "contact: 9 macro-elements are apart by up to 0.02"),
        (TIE, 0.02, "tie: 9 macro-elements are apart by up to 0.02"),
        (JOINT, [[0, 0], [0.5, 0.1], [1, -0.1]], "overlap by up to 0.1 at time 1"),
    ],
)
def test_what_cannot_be_is_refused(kind, uz, says):
    with pytest.raises(CaseError, match=says):
        only(stack("HEXA8", "TETRA4", 3), kind + LOW + high(uz))


def test_a_tie_of_which_a_component_is_held_carries_the_others():
    """Nothing moves along y, on either side: what is left of the tie is in force, and says so."""
    fixed = held("bottom", ux=0.0, uy=0.0, uz=0.0) + held("lower", uy=0.0) + held("upper", uy=0.0)
    load = '[[traction]]\ngroup = "top"\ntx = 0.5\ntz = 2.0\n'
    problem, state = only(stack("HEXA8", "TETRA4", 3), TIE + fixed + load)
    (zone,) = state.zones
    assert (zone.status == CONTACT).all() and zone.gap.max() <= 1e-14
    np.testing.assert_allclose(resultant(zone, problem)[[0, 2]], [0.5, 2.0], rtol=1e-10)
    assert (zone.traction[:, 1] == 0).all()


def test_some_that_are_stuck_among_others_that_are_not():
    """The slave's far end is clamped, and its master's: the others bear the load."""
    mesh = stack("QUAD4", "QUAD4", 2, counts=(4, 4), even=True)
    x = mesh.points
    faces = [row for name in ("slave", "master") for row in mesh.select(mesh.cells_of(name))]
    end = np.concatenate([cells[(x[nodes, 0] > 0.7).all(axis=1)] for _, cells, nodes in faces])
    made = replace(mesh, cell_groups={**mesh.cell_groups, "end": np.sort(end)})
    fixed = held("bottom", ux=0.0, uy=0.0) + held("end", ux=0.0, uy=0.0)
    _, state = only(made, JOINT + fixed + pressed("top", 1.0), "plane_strain")
    (zone,) = state.zones
    order = np.argsort(zone.centre[:, 0])
    status, gap = zone.status[order], zone.gap[order]
    assert (status != UNPAIRED).all() and status[0] == CONTACT and status[3] == OPEN
    assert gap[3] == pytest.approx(0, abs=1e-15) and zone.pressure[order][3] == 0 < zone.pressure[order][0]


def test_what_has_no_master_stays_without():
    _, state = only(overhang(), JOINT + held("lower", ux=0.0, uy=0.0) + held("upper", ux=0.0, uy=0.0), "plane_strain")
    (zone,) = state.zones
    assert sorted(zone.status) == [UNPAIRED, OPEN, OPEN, OPEN] and np.isnan(zone.gap).sum() == 1
