"""Friction on undeformed skins is inexact where a gap that opens at an angle closes: `run` and `validate` say so."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import lacsolver as ls
from lacmesh.errors import LacmeshWarning
from lacsolver.case import Case, Contact, Displacement, Material, Steps
from lacsolver.validation import validate
from tests.lacsolver.friction.test_sliding import block_on_block

MU, RADIUS, TILT = 0.3, 5.0, 0.1


def pressed(shape, **contact):
    """A block over one with a flat skin, pressed on it: `round`, `tilted`, `apart` in parallel, or `flat` on it."""
    mesh = block_on_block(((0, 3), (0, 1), 24, 2), ((1.0, 2.0), (1, 2), 12, 2))
    points = mesh.points.copy()
    upper = np.unique(np.concatenate([b.nodes[b.nodes[:, 0] >= 25 * 3].ravel() for b in mesh.blocks]))
    x = points[upper, 0] - 1.5
    rise = {"round": RADIUS - np.sqrt(RADIUS**2 - x**2), "tilted": TILT * (x + 0.5), "apart": 0.01 + 0 * x}
    points[upper, 1] += rise.get(shape, 0 * x)
    case = Case(
        model="plane_strain", material=[Material(young=1.0, poisson=0.3)],
        contact=[Contact(name="joint", slave="above", master="below", **{"friction": MU, **contact})],
        displacement=[
            Displacement(group="bottom", ux=0, uy=0), Displacement(group="top", ux="0.01 * t", uy="-0.02 * t"),
        ],
        steps=Steps(end=1.0, count=1),
    )  # fmt: skip
    return case, replace(mesh, points=points)


def told(tmp_path, shape, **contact):
    """Return what `validate` and `run` say of the angle, one message of each at most."""
    case, mesh = pressed(shape, **contact)
    before = [said for zone in validate(case, mesh).zones for said in zone.told]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", LacmeshWarning)
        ls.run(case, tmp_path / f"{len([*tmp_path.iterdir()])}", mesh=mesh)
    both = before, [str(one.message) for one in caught]
    return [[one for one in messages if "at an angle" in one] for messages in both]


def test_a_round_skin_over_a_gap_is_warned_of(tmp_path):
    """The outermost macro-element is at 5.5 degrees, of 17.2 that friction may take; in the end less has closed."""
    (before,), (after,) = told(tmp_path, "round")
    start = "friction of contact 'joint' may be off by up to "
    assert before.startswith(start) and after.startswith(start) and 'take geometry = "current"' in after
    middle = np.arcsin((0.5 - 1 / 24) / RADIUS)
    assert float(before.split(" degrees")[0].split()[-1]) == pytest.approx(np.degrees(middle), abs=0.05)
    assert float(before.split(" %")[0].split()[-1]) == pytest.approx(100 * middle / MU, abs=0.5)
    assert 5 < float(after.split(" %")[0].split()[-1]) < float(before.split(" %")[0].split()[-1])


@pytest.mark.parametrize(
    ("shape", "contact"),
    [
        ("flat", {}),
        ("apart", {}),
        ("flat", {"clearance": "(x - 1.5)**2 / 10"}),
        ("round", {"geometry": "current"}),
        ("round", {"friction": 1.5}),
        ("round", {"friction": 0.0}),
        ("round", {"friction": float("inf")}),
    ],
)
def test_others_are_not(tmp_path, shape, contact):
    """Parallel skins, a gap that is a clearance, deformed skins; friction that is large beside the angle, or none."""
    assert told(tmp_path, shape, **contact) == [[], []]


def test_a_tilted_skin_is_as_a_round_one_and_cohesion_is_judged_at_the_pressure(tmp_path):
    (before,), _ = told(tmp_path, "tilted")
    assert f"up to {100 * np.arctan(TILT) / MU:.2g} % of its bound" in before
    assert [len(each) for each in told(tmp_path, "round", friction=0.0, cohesion=1e-4)] == [0, 1]
    assert [len(each) for each in told(tmp_path, "round", friction=0.0, cohesion=1.0)] == [0, 0]
