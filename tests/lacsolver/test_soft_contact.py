"""Soft contact, `[[contact]] stiffness = K`: a pressure of K per overlap, against springs in series."""

from __future__ import annotations

import numpy as np
import pytest

from lacsolver.case import CaseError, parse_case
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from tests.lacsolver.contact_cases import HEAD, JOINT, SLIDING, held
from tests.lacsolver.patch_meshes import stack

YOUNG = 1000.0
SOFT = "[[material]]\nyoung = 1000.0\npoisson = 0.0\n"


def columns(stiffness, moved, options="", head=HEAD, **mesh):
    """Two columns of height 1 pressed together by a displacement: the states."""
    kinds = mesh.pop("kinds", ("HEXA8", "TETRA4"))
    model = "3d" if mesh.get("dim", 3) == 3 else "plane_strain"
    blocks = stack(*kinds, mesh.get("dim", 3), counts=mesh.get("counts", (3, 2)))
    up = "z" if model == "3d" else "y"
    sides = SLIDING if model == "3d" else held("x0", ux=0.0)
    joint = JOINT + f"stiffness = {stiffness}\n{options}"
    text = head.format(model=model) + SOFT + joint + sides + held("bottom", **{f"u{up}": 0.0})
    text += held("top", **{f"u{up}": moved})
    return list(march(Problem.of(parse_case(text), blocks)))


@pytest.mark.parametrize("stiffness", [1.0, 500.0, 1e9])
@pytest.mark.parametrize("backend", ["superlu", "multigrid"])
@pytest.mark.parametrize("geometry", ["reference", "current"])
def test_a_spring_between_two_columns(stiffness, backend, geometry):
    """p = u / (2 / E + 1 / K), from softer than the bodies to almost rigid; what overlaps is p / K."""
    head = HEAD.replace("threads = 1", f'threads = 1\nbackend = "{backend}"')
    (state,) = columns(stiffness, -0.01, f'geometry = "{geometry}"\n', head)
    p = 0.01 / (2 / YOUNG + 1 / stiffness)
    np.testing.assert_allclose(state.zones[0].pressure, p, rtol=1e-8)
    np.testing.assert_allclose(state.zones[0].gap, -p / stiffness, rtol=1e-6, atol=1e-12)
    assert (state.zones[0].status == 1).all()


@pytest.mark.parametrize("kind", ["unilateral", "bilateral"])
def test_a_spring_that_is_pulled(kind):
    """It opens without force, or pulls back with K per gap."""
    (state,) = columns(500.0, 0.01, f'type = "{kind}"\n')
    p = 0.0 if kind == "unilateral" else -0.01 / (2 / YOUNG + 1 / 500.0)
    np.testing.assert_allclose(state.zones[0].pressure, p, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(state.zones[0].gap, 0.01 + p * 2 / YOUNG, rtol=1e-9)


def test_a_spring_in_the_plane_and_in_finite_kinematics():
    (state,) = columns(500.0, -0.01, kinds=("QUAD4", "TRIA3"), dim=2)
    np.testing.assert_allclose(state.zones[0].pressure, 0.01 / (2 / YOUNG + 1 / 500.0), rtol=1e-9)
    head = HEAD.replace("[solver]", 'kinematics = "finite"\n[solver]')
    soft = SOFT + 'law = "saint_venant_kirchhoff"\n'
    text = head.format(model="3d") + soft + JOINT + "stiffness = 500.0\n" + SLIDING
    text += held("bottom", uz=0.0) + held("top", uz=-0.3)
    *_, state = march(Problem.of(parse_case(text), stack("HEXA8", "HEXA8", 3)))
    p, stretch = state.zones[0].pressure.mean(), 1 - (0.3 + state.zones[0].gap.mean()) / 2
    assert np.ptp(state.zones[0].pressure) < 1e-8 * p
    assert p == pytest.approx(-YOUNG * stretch * (stretch**2 - 1) / 2, rel=1e-8)  # nominal stress of the law
    assert p == pytest.approx(-500.0 * state.zones[0].gap.mean(), rel=1e-8)


def test_skins_that_are_prescribed_press_by_their_overlap():
    """No unknown moves the rows: with rigid contact this is an error, with springs it is the answer."""
    blocks = stack("HEXA8", "HEXA8", 3, counts=(2, 2))
    fixed = held("slave", ux=0.0, uy=0.0, uz=0.0) + held("master", ux=0.0, uy=0.0, uz=-0.002)
    fixed += held("bottom", ux=0.0, uy=0.0, uz=0.0) + held("top", ux=0.0, uy=0.0, uz=0.0)
    text = HEAD.format(model="3d") + SOFT + JOINT
    (state,) = march(Problem.of(parse_case(text + "stiffness = 300.0\n" + fixed), blocks))
    np.testing.assert_allclose(state.zones[0].pressure, 0.6, rtol=1e-12)
    with pytest.raises(CaseError, match="all nodes of both skins are prescribed"):
        list(march(Problem.of(parse_case(text + fixed), blocks)))


def test_a_stiffness_without_meaning_is_refused():
    with pytest.raises(CaseError, match="stiffness"):
        parse_case(HEAD.format(model="3d") + SOFT + JOINT + "stiffness = 0.0\n")
