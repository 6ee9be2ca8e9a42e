"""Two bodies along a plane, its fillet and another plane, whose tangent points lie inside faces, pressed all round.

The exact stress is that pressure, everywhere, and so is the pressure of contact: what differs are the gaps of faces.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
from lacmesh import join
from lacmesh.generate.parts import linear
from lacmesh.smooth import fit_surface
from lacmesh.smooth.heights import smooth_of
from lacmesh.surface import Surface
from lacsolver.results.faceted import faceted
from verification.solving import solve

#: angle of the fillet of radius 1, and where along the profile the mesh begins and ends; the planes touch at 0 and TURN
TURN = np.pi / 3
BEGIN, END = -1.5, TURN + 1.0
DEPTH, LAYERS = 0.3, 3


def profile(s, depth):
    """Points (n, 2) at positions s along the profile, at a depth (n,) along its normal."""
    a, beyond = np.clip(s, 0, TURN), np.clip(s - TURN, 0, None)
    x = np.where(s < 0, s, np.sin(a)) + beyond * np.cos(TURN)
    y = np.where(s < 0, 0.0, 1 - np.cos(a)) + beyond * np.sin(TURN)
    return np.stack([x - depth * np.sin(a), y + depth * np.cos(a)], axis=-1)


def body(n, offset, side, heights):
    """Nodes (n + 1, layers + 1, heights) of a body of n faces; `offset`: shift of inner nodes, in faces."""
    s = BEGIN + (END - BEGIN) * (np.arange(n + 1) + offset * ((np.arange(n + 1) % n) > 0)) / n
    s, d, z = np.meshgrid(s[::side], np.linspace(0, DEPTH, LAYERS + 1) * side, heights, indexing="ij")
    return np.concatenate([profile(s, d), z[..., None]], axis=-1)


def fillet(counts, offsets=(0.3, 0.1), kind="QUAD4", heights=(0.0,)):
    """The mesh: groups upper, lower, slave, master, around (the pressed faces), and nodes: ends (z = constant)."""
    dim, parts = 2 if len(heights) == 1 else 3, []
    names = (("upper", "slave"), ("lower", "master"))
    for n, offset, side, (name, skin) in zip(counts, offsets, (1, -1), names, strict=True):
        x = body(n, offset, side, heights)
        sides = ("around", "around"), (skin, "around"), ("ends", "ends")
        parts.append(linear(x if dim == 3 else x[:, :, 0, :2], kind, sides).renamed(body=name))
    mesh = join(*parts)
    ends = {"ends": mesh.nodes_on(mesh.cell_groups["ends"])} if dim == 3 else {}
    return replace(mesh.only("upper", "lower", "slave", "master", "around"), node_groups=ends)


def case(mesh):
    """The text of a case in which the pressure of contact is 1."""
    springs = "".join(
        f'[[spring]]\ngroup = "{name}"\n' + "".join(f"k{a} = 1e-4\n" for a in "xyz"[: mesh.space_dim])
        for name in ("upper", "lower")
    )
    text = f"""mesh = "mesh.msh"
model = "{"plane_strain" if mesh.space_dim == 2 else "3d"}"
[[material]]
young = 1000.0
poisson = 0.3
[[contact]]
slave = "slave"
master = "master"
[[pressure]]
group = "around"
value = 1.0
{springs}"""
    if mesh.space_dim == 3:
        text += '[[displacement]]\ngroup = "ends"\nuz = 0.0\n'
    return text


def pressed(mesh):
    """The pressures of contact."""
    return solve(case(mesh), mesh).state.zones[0].pressure


def quietly(mesh):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", lacmesh.LacmeshWarning)
        return pressed(mesh)


@pytest.mark.parametrize("offsets", [(0.0, 0.0), (0.3, 0.1), (0.5, 0.25), (0.7, 0.6)])
def test_a_face_that_is_partly_a_plane(offsets):
    """Pressures were 0 to 2.6; twice as fine, 0 to 2."""
    coarse, fine = (quietly(fillet((12 * n, 16 * n), offsets)) for n in (2, 4))
    assert np.abs(coarse - 1).max() < 0.3 and np.abs(fine - 1).max() < 0.12


@pytest.mark.parametrize("offset", [0.0, 0.15, 0.4, 0.75])
def test_heights_of_such_a_face_have_the_mean_of_the_skin(offset):
    """The area between the chord and the profile, wherever in the face the tangent point is."""
    mesh = fillet((24, 32), (offset, 0.1))
    surface = Surface.of(mesh, mesh.cells_of("slave"))
    x = surface.x[surface.faces.nodes[:, :2], 0]
    (at,) = np.flatnonzero((x.min(axis=1) < 0) & (x.max(axis=1) > 1e-9))
    high, wide = x[at].max(), np.ptp(x[at])
    rise = 1 - np.sqrt(1 - high**2)
    between = high - (high * np.sqrt(1 - high**2) + np.arcsin(high)) / 2 - rise * wide / 2
    length = np.hypot(wide, rise)
    height = smooth_of(mesh, surface, None).heights[0][at, 0]
    assert height == pytest.approx(-1.5 * between / length, abs=0.02 * length**2 / 8) and height >= 0


def test_shapes_on_both_sides_stay():
    found = sorted((one.shape, len(one.faces)) for one in fit_surface(fillet((24, 32)), "slave"))
    assert [name for name, _ in found] == ["circle", "free form", "free form", "line", "line"]
    assert [n for name, n in found if name == "free form"] == [1, 1]


def test_in_space():
    """One row of quadrangles between plane and fillet is plane itself: pressures were 0 to 1.8."""
    p = quietly(fillet((20, 24), (0.5, 0.25), "HEXA8", (0.0, 0.2, 0.4)))
    assert np.abs(p - 1).max() < 0.15


def test_what_is_left_is_said():
    """Triangles have means of their own: pressures that differ by what their heights may be off are told by `run`."""
    mesh = fillet((20, 24), (0.5, 0.25), "TETRA4", (0.0, 0.2, 0.4))
    solved = solve(case(mesh), mesh)
    (message,) = faceted(solved.problem, solved.state)
    assert "heights of curved skins may be off by 0.00" in message


def test_a_fillet_of_too_few_faces_is_said():
    """Two faces to it are no circle that could be found; what is said has the place and the size of the error."""
    mesh = fillet((8, 10))
    with pytest.warns(lacmesh.LacmeshWarning, match="its curvature changes within few faces") as told:
        p = pressed(mesh)
    assert np.abs(p - 1).max() > 0.5
    said = [str(one.message) for one in told]
    assert "slave 'slave'" in said[0] and "near (" in said[0] and "refine it there" in said[0]
    found = lacmesh.check(lacmesh.cut_skin(mesh, "slave").mesh, "slave", "master")
    (one, *_) = [one for one in found.findings if one.rule == "faceted"]
    words = re.search(r"curvature changes .* 0\.\d+ of a face's size", one.message)
    assert words and words[0] in said[0] and said[0].endswith("(lacmesh check: faceted)")  # both say the same


def test_one_that_is_too_coarse_for_its_pressure_is_said():
    """Three faces to the fillet: what is left of the gaps is little, and yet more than the pressure is worth."""
    mesh = fillet((12, 16))
    solved = solve(case(mesh), mesh)
    assert np.abs(solved.state.zones[0].pressure - 1).max() > 0.5
    (message,) = faceted(solved.problem, solved.state)
    assert "heights of curved skins may be off by 0.0037 of a face's size" in message


def test_a_fine_fillet_is_not_warned_of(recwarn):
    pressed(fillet((48, 64)))
    assert not recwarn.list


@pytest.mark.parametrize("scale, shift", [(1e-3, 0.0), (1e3, 0.0), (1.0, 1e6)])
def test_units_and_origin(scale, shift):
    mesh = fillet((24, 32))
    own, other = (
        smooth_of(m, Surface.of(m, m.cells_of("slave")), None).heights[0]
        for m in (mesh, replace(mesh, points=(mesh.points + shift * np.array([1, 1, 0])) * scale))
    )
    np.testing.assert_allclose(other, scale * own, atol=scale * max(1e-12, 1e-9 * shift))
