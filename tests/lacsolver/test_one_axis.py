"""Rotations that are prescribed about some axes and free about the others, of rigid bodies and of couplings."""

from __future__ import annotations

import numpy as np
import pytest

import lacsolver as ls
from lacsolver.case import Case, CaseError, Coupling, Displacement, Material, Rigid
from tests.checks.blocks import block, join, skin

E, NU = 1000.0, 0.3
#: moments about x and y, and a force aside
MX, MY, FX = 3.0, 2.0, 1.0


def column():
    """A column of 1 x 2 x 3 on its foot, with a lid."""
    made = block((2, 2, 3), (0, 0, 0), (1, 2, 3))

    def side(at):
        return skin(*made, lambda x: abs(x[..., 2] - at) < 1e-9)

    return join([(*made, {"foot": side(0), "lid": side(3)})])


def solved(finite=False, rigid=None, **keys):
    law = {"law": "saint_venant_kirchhoff"} if finite else {}
    record = {"rigid": Rigid(group="lid", **keys)} if rigid else {"coupling": Coupling(group="lid", **keys)}
    case = Case(
        model="3d", kinematics="finite" if finite else "small", material=Material(young=E, poisson=NU, **law),
        displacement=Displacement(group="foot", ux=0.0, uy=0.0, uz=0.0), **record,
    )  # fmt: skip
    return ls.solve(case, column())


def moved(solution):
    """Rotation of the lid, and the moment on its nodes."""
    point = solution.figures.couplings.get("lid")
    if point is not None:
        return point.rotation, point.moment
    problem, state, _ = solution._solved
    reaction = problem.constraints.rigid_reactions(state.reaction, state.rigid)["lid"]
    return state.rigid["lid"][3:], reaction[3:]


KINDS = {
    "distributing": {"kind": "distributing"},
    "distributing at a place": {"kind": "distributing", "at": (0.2, 0.7, 3.5), "ux": 0.002},
    "distributing along other axes": {"kind": "distributing", "axes": {"x": [0.8, 0.6, 0.0], "xy": [-0.6, 0.8, 0.0]}},
    "rigid": {"kind": "rigid"},
    "rigid, components": {"kind": "rigid", "components": ["ux", "uz"]},
    "rigid, other axes": {"kind": "rigid", "axes": {"x": [0.8, 0.6, 0.0], "xy": [-0.6, 0.8, 0.0]}},
    "body": {"rigid": True, "fx": 0.0, "fy": 0.0, "fz": 0.0},
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_rotation_that_a_moment_would_give(kind):
    """Prescribed about y as a moment has turned it, free about x and z: the same answer, with that moment about y."""
    keys = KINDS[kind]
    free = solved(**keys, moment=(MX, MY, 0.0))
    theta, moment = moved(free)
    R = np.eye(3)
    if "axes" in keys:
        x, y = np.array(keys["axes"]["x"]), np.array(keys["axes"]["xy"])
        R = np.stack([x, y, np.cross(x, y)])
    hinged = solved(**keys, rotation=("free", (R @ theta)[1], "free"), moment=(MX, 0.0, 0.0))
    np.testing.assert_allclose(hinged.u, free.u, atol=1e-9 * np.abs(free.u).max())
    np.testing.assert_allclose(moved(hinged)[0], theta, atol=1e-9 * np.abs(theta).max())
    np.testing.assert_allclose(moved(hinged)[1], moment, atol=1e-8)


@pytest.mark.parametrize("keys", [KINDS["rigid"], KINDS["body"]])
def test_large_rotations_about_one_axis(keys):
    """Rotations with 0.3 about y: the one that is found has the least energy, whose derivatives by the others are 0."""
    hinged = solved(finite=True, **keys, rotation=("free", 0.3, "free"))
    theta = moved(hinged)[0]
    assert theta[1] == pytest.approx(0.3, rel=1e-12)

    def energy(x, z):
        return solved(finite=True, **keys, rotation=(theta[0] + x, 0.3, theta[2] + z)).figures.energy

    least, h = hinged.figures.energy, 1e-3
    for way in ((h, 0.0), (0.0, h)):
        more, less = energy(*way), energy(-way[0], -way[1])
        assert more > least < less
        assert abs(more - less) < 2e-3 * (more + less - 2 * least)


def test_large_rotations_under_a_moment_about_a_free_axis():
    """About x alone the body turns as if it were free about all axes, by symmetry."""
    free = solved(finite=True, kind="rigid", moment=(60.0, 0.0, 0.0))
    hinged = solved(finite=True, kind="rigid", rotation=("free", 0.0, 0.0), moment=(60.0, 0.0, 0.0))
    assert moved(free)[0][0] > 0.1
    np.testing.assert_allclose(hinged.u, free.u, atol=1e-7)


def test_components_that_follow_large_rotations():
    """Along its axes all components follow: the equations are those of a rigid body."""
    turned = {"rotation": (0.0, 0.4, 0.1), "fx": FX, "at": (0.3, 1.0, 3.2)}
    body = solved(finite=True, kind="rigid", **turned)
    axes = {"x": [1.0, 0.0, 0.0], "xy": [0.0, 1.0, 0.0]}
    along = solved(finite=True, kind="rigid", axes=axes, **turned)
    np.testing.assert_allclose(along.u, body.u, atol=1e-9)
    for one, other in zip(along.figures.couplings["lid"], body.figures.couplings["lid"], strict=True):
        np.testing.assert_allclose(one, other, atol=1e-6)
    partly = solved(finite=True, kind="rigid", components=["ux", "uz"], **turned)
    lid = column().nodes_on(column().cells_of("lid"))
    np.testing.assert_allclose(partly.u[lid][:, [0, 2]] - partly.u[lid[0], [0, 2]],
                               body.u[lid][:, [0, 2]] - body.u[lid[0], [0, 2]], atol=1e-9)  # fmt: skip
    assert abs(partly.u[lid] - body.u[lid])[:, 1].max() > 1e-3


@pytest.mark.parametrize(
    "keys, words",
    [
        ({"kind": "distributing", "rotation": ("free", 0.1, 0.0)}, "turns freely about all axes or about none"),
        ({"kind": "rigid", "components": ["uz"], "rotation": ("free", 0.1, 0.0)}, "only as they are prescribed"),
        ({"kind": "rigid", "components": ["uz"], "fz": 1.0}, "only as they are prescribed"),
    ],
)
def test_large_rotations_that_are_refused(keys, words):
    with pytest.raises(CaseError, match=words):
        solved(finite=True, **keys)


def test_a_moment_about_a_prescribed_axis_is_refused():
    with pytest.raises(CaseError, match="has a part about an axis whose rotation is prescribed"):
        solved(rotation=("free", 0.1, 0.0), moment=(0.0, 1.0, 0.0))
    with pytest.raises(CaseError, match="stands beside rotation"):
        solved(rotation=(0.0, 0.1, 0.0), moment=(0.0, 1.0, 0.0))
