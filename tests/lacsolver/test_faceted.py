"""Skins that are curved between their nodes: press fits of few faces, a fillet between two planes, and what is said.

Pins and holes have six to twelve linear faces around, whose edges turn by up to 60 degrees. The exact pressure is
Lame's; what is left of the error is that of so few cells, and falls with their size squared.

Two bodies along a plane, its fillet and another plane, whose tangent points lie inside faces, are pressed all round.
The exact stress is that pressure, everywhere, and so is the pressure of contact: what differs are the gaps of faces.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh import join
from lacmesh.cells import CELLS
from lacmesh.generate.parts import linear
from lacmesh.smooth.heights import smooth_of
from lacmesh.surface import Surface
from lacsolver.case import Material, Pressure, Spring
from lacsolver.doubts.neighbours import faceted
from lacsolver.doubts.run import Run
from lacsolver.equilibrium.stepping import march
from lacsolver.output import create_output
from lacsolver.problem.problem import Problem
from lacsolver.running import run
from lacsolver.validation import validate
from tests import REPOSITORY
from tests.coarse_rings import rings
from tests.problems import ELASTIC, case_of, contact, fix
from tests.samples import each_option
from verification.exact.lame import Fit, Shell
from verification.families import press_fit
from verification.meshes.rings import pair, ring

DATA = REPOSITORY / "data"
INTERFERENCE = 0.01
EXACT = Fit(
    Shell("plane_strain", 0.4, 1.0, 100.0, 0.3), Shell("plane_strain", 1.0, 2.0, 100.0, 0.3), interference=INTERFERENCE
).between
HEIGHTS = (0.0, 0.4, 0.8)


def held(mesh, *bodies):
    """Weak springs on bodies, the ends of those in space on planes, and the keys of the case."""
    springs = [Spring(group=name, **{f"k{a}": 1e-4 for a in "xyz"[: mesh.space_dim]}) for name in bodies]
    ends = [fix("ends", "z")] if mesh.space_dim == 3 else []
    return [*springs, *ends], {"model": "3d" if mesh.space_dim == 3 else "plane_strain"}


def solved(case):
    """(problem, its last state)."""
    problem = Problem.of(case)
    *_, state = march(problem)
    return problem, state


def zone_of(case):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", lacmesh.LacmeshWarning)
        return solved(case)[1].zones[0]


# ---- press fits


def fit_case(mesh, law="elastic", kinematics="small", **options):
    records, keys = held(mesh, "pin", "hole")
    material = Material(young=100.0, poisson=0.3, law=law)
    return case_of(mesh, material, contact(clearance=-INTERFERENCE, **options), *records, kinematics=kinematics, **keys)


def pin_in_hole(kind, inner, outer, cells=(3, 4), turned=0.0):
    """A pin with a hole along its axis, of `inner` faces around, in a ring of `outer`, which is turned."""
    dim = CELLS[kind].dim
    both = {"kind": kind, "heights": HEIGHTS if dim == 3 else (0.0,)}
    pin = {"n": inner, "radii": np.linspace(0.4, 1, cells[0] + 1), "names": ("pin", "bore", "slave")}
    hole = {"n": outer, "radii": np.linspace(1, 2, cells[1] + 1), "turn": turned, "names": ("hole", "master", "rim")}
    made = rings(pin | both, hole | both, dim=dim)
    ends = np.flatnonzero(np.isin(made.points[:, 2], [HEIGHTS[0], HEIGHTS[-1]]))
    return replace(made, node_groups={"ends": ends} if dim == 3 else {})


def mean(zone):
    return float(np.average(zone.pressure, weights=zone.area))


#: cells, faces of the inner and the outer ring, the error that the mean pressure may have
FITS = [
    ("QUAD4", 6, 6, 0.26),
    ("QUAD4", 6, 12, 0.18),
    ("QUAD4", 8, 8, 0.15),
    ("QUAD4", 8, 12, 0.14),
    ("QUAD4", 12, 8, 0.12),
    ("TRIA3", 8, 12, 0.2),
    ("HEXA8", 8, 12, 0.16),
    ("PENTA6", 8, 12, 0.23),
    ("TETRA4", 8, 12, 0.23),
]


@pytest.mark.rows("QUAD4-6-6-0.26-facet", "TRIA3-8-12-0.2-smoothed")
@pytest.mark.parametrize(
    ("kind", "inner", "outer", "allowed", "normals"),
    each_option(
        ((*fit, normals) for fit in FITS for normals in ("facet", "smoothed")), of=lambda row: [row[:3], row[4]]
    ),
)
def test_press_fits_of_few_faces(kind, inner, outer, allowed, normals):
    zone = zone_of(fit_case(pin_in_hole(kind, inner, outer), normals=normals))
    assert (zone.pressure > 0).all()
    assert mean(zone) == pytest.approx(EXACT, rel=allowed)


@pytest.mark.parametrize("normals", ["facet", "smoothed"])
def test_the_error_falls_with_the_size_of_the_faces_squared(normals):
    """From edges that are over the crease angle to such that are below it, with no jump between them."""
    meshes = (pin_in_hole("QUAD4", 8 * n, 12 * n, (4 * n, 6 * n)) for n in (1, 2))
    few, more = (mean(zone_of(fit_case(mesh, normals=normals))) - EXACT for mesh in meshes)
    assert 0 < more < 0.3 * few


def test_finite_strains():
    case = fit_case(pin_in_hole("QUAD4", 8, 12), law="saint_venant_kirchhoff", kinematics="finite")
    assert mean(zone_of(case)) == pytest.approx(EXACT, rel=0.15)


def test_edges_that_stay(recwarn):
    """With a crease angle eight faces are a polygon, whose sides the twelve of the hole do not touch.

    A peg and a hole of four faces are pressed over their whole sides, and nothing is said.
    """
    (zone,) = solved(fit_case(pin_in_hole("QUAD4", 4, 4)))[1].zones
    assert not recwarn.list
    assert zone.gap == pytest.approx(0, abs=1e-12) and (zone.pressure > 0).all()
    (zone,) = solved(fit_case(pin_in_hole("QUAD4", 8, 12), crease_angle=40.0))[1].zones
    assert (zone.pressure == 0).all()
    assert [str(one.message).partition(":")[0] for one in recwarn.list] == ["nothing acts on the bodies"]


def test_cells_that_are_less_deep_than_the_faces_are_off():
    """Corners of one polygon reach into the other by more than its cells are deep: they are found all the same."""
    zone = zone_of(fit_case(pin_in_hole("QUAD4", 8, 8, (24, 24), turned=0.2)))
    assert mean(zone) == pytest.approx(EXACT, rel=0.25) and zone.coverage == pytest.approx(1)


def test_what_was_taken_is_said():
    """By validate and run, with the group, the angle, the shape, and what to write if the edges are sharp."""
    case = fit_case(pin_in_hole("HEXA8", 8, 12))
    said = "16 faces that turn by up to 45 degrees lie on one cylinder of radius 1 and are taken as it"
    with pytest.warns(lacmesh.LacmeshWarning, match=said) as told:
        Problem.of(case)
    assert "give crease_angle = 40" in str(told[0].message) and "master" not in str(told[0].message)
    with pytest.warns(lacmesh.LacmeshWarning, match=said):
        validate(case)


# ---- the warning of pressures that are those of flat faces

FLAT = (DATA / "press_fit.toml").read_text().replace('master = "master"', 'master = "master"\nsurface = "faces"')


def messages(case):
    problem, state = solved(case)
    return [doubt.text for doubt in faceted(Run(problem, problem.joints, last=state))]


def of_data(name, text=None):
    text = (DATA / f"{name}.toml").read_text() if text is None else text
    return replace(ls.parse_case(text), mesh=lacmesh.read(DATA / f"{name}.msh"))


def test_a_press_fit_of_flat_faces_is_told(tmp_path):
    """The estimated error of flat faces is as large as the pressure, far from 63.46, and the warning names a remedy."""
    (message,) = messages(of_data("press_fit", FLAT))
    assert "pressures of contact 'fit' differ by" in message and 'take surface = "smooth"' in message
    with pytest.warns(lacmesh.LacmeshWarning, match="E h / 8R"):
        results = run(of_data("press_fit", FLAT), create_output(tmp_path / "out"))
    assert message in results.message


def quadratic_fit():
    given = press_fit.PressFit("TRIA6", "plane_strain", "facet")
    return replace(ls.parse_case(press_fit.case_of(given)), mesh=press_fit.mesh_of(given, 0))


@pytest.mark.parametrize(
    "case",
    [
        lambda: of_data("press_fit"),  # cylinders
        lambda: of_data("two_blocks"),  # flat skins
        quadratic_fit,
        lambda: of_data("press_fit", FLAT.replace("clearance = -0.02", "clearance = 0.2")),  # no pressure
    ],
)
def test_others_are_not(case):
    assert messages(case()) == []


@pytest.mark.parametrize("count, said", [(3, True), (24, False)])
def test_a_skin_of_free_form_that_is_too_coarse(count, said):
    """Two ellipses, hardly pressed: twelve faces to a turn are too few for a fit, and a hundred are not."""
    given = press_fit.PressFit("TRIA3", "plane_strain", "facet", pressure=2.0)
    bodies = (ring("TRIA3", (2, n), radii) for n, radii in ((count, (20, 30)), (count + 1, (30, 40))))
    mesh = pair(*bodies)
    mesh = replace(mesh, points=mesh.points * [1.3, 1.0, 1.0])
    with warnings.catch_warnings(record=True) as before:
        warnings.simplefilter("always")
        assert bool(messages(replace(ls.parse_case(press_fit.case_of(given)), mesh=mesh))) == said
    assert any("its curvature changes within few faces" in str(one.message) for one in before) == said


# ---- a fillet

#: angle of the fillet of radius 1, and where along the profile the mesh begins and ends; the planes touch at 0 and TURN
TURN = np.pi / 3
BEGIN, END = -1.5, TURN + 1.0
DEPTH, LAYERS = 0.3, 3
IN_SPACE = (0.0, 0.2, 0.4)


def profile(s, depth):
    """Points (n, 2) at positions s along the profile, at a depth (n,) along its normal."""
    a, beyond = np.clip(s, 0, TURN), np.clip(s - TURN, 0, None)
    x = np.where(s < 0, s, np.sin(a)) + beyond * np.cos(TURN)
    y = np.where(s < 0, 0.0, 1 - np.cos(a)) + beyond * np.sin(TURN)
    return np.stack([x - depth * np.sin(a), y + depth * np.cos(a)], axis=-1)


def fillet(counts, offsets=(0.3, 0.1), kind="QUAD4", heights=(0.0,)):
    """The mesh: groups upper, lower, slave, master, around (the pressed faces), and nodes: ends (z = constant).

    `offsets`: shift of inner nodes, in faces.
    """
    dim, parts = 2 if len(heights) == 1 else 3, []
    names = (("upper", "slave"), ("lower", "master"))
    for n, offset, side, (name, skin) in zip(counts, offsets, (1, -1), names, strict=True):
        s = BEGIN + (END - BEGIN) * (np.arange(n + 1) + offset * ((np.arange(n + 1) % n) > 0)) / n
        s, d, z = np.meshgrid(s[::side], np.linspace(0, DEPTH, LAYERS + 1) * side, heights, indexing="ij")
        x = np.concatenate([profile(s, d), z[..., None]], axis=-1)
        sides = ("around", "around"), (skin, "around"), ("ends", "ends")
        parts.append(linear(x if dim == 3 else x[:, :, 0, :2], kind, sides).renamed(body=name))
    mesh = join(*parts)
    ends = {"ends": mesh.nodes_on(mesh.cell_groups["ends"])} if dim == 3 else {}
    return replace(mesh.only("upper", "lower", "slave", "master", "around"), node_groups=ends)


def fillet_case(*arguments):
    """The case in which the pressure of contact is 1."""
    mesh = fillet(*arguments)
    records, keys = held(mesh, "upper", "lower")
    return case_of(mesh, ELASTIC, contact(), Pressure(group="around", value=1.0), *records, **keys)


@pytest.mark.rows("offsets1", "offsets2")
@pytest.mark.parametrize("offsets", [(0.0, 0.0), (0.3, 0.1), (0.5, 0.25), (0.7, 0.6)])
def test_a_face_that_is_partly_a_plane(offsets):
    """Pressures were 0 to 2.6; twice as fine, 0 to 2."""
    coarse, fine = (zone_of(fillet_case((12 * n, 16 * n), offsets)).pressure for n in (2, 4))
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


def test_in_space():
    """One row of quadrangles between plane and fillet is plane itself: pressures were 0 to 1.8."""
    p = zone_of(fillet_case((20, 24), (0.5, 0.25), "HEXA8", IN_SPACE)).pressure
    assert np.abs(p - 1).max() < 0.15


@pytest.mark.parametrize(
    "arguments, size, coarse",
    [(((20, 24), (0.5, 0.25), "TETRA4", IN_SPACE), "0.00", False), (((12, 16),), "0.0037 of a face's size", True)],
)
def test_what_is_left_is_said(arguments, size, coarse):
    """Triangles have means of their own: pressures that differ by what their heights may be off are told by `run`.

    With three faces to the fillet what is left of the gaps is little, and yet more than the pressure is worth.
    """
    problem, state = solved(fillet_case(*arguments))
    (doubt,) = faceted(Run(problem, problem.joints, last=state))
    assert f"heights of curved surfaces are uncertain by {size}" in doubt.text
    assert not coarse or np.abs(state.zones[0].pressure - 1).max() > 0.5


def test_a_fillet_of_too_few_faces_is_said():
    """Two faces to it are no circle that could be found; what is said has the place and the size of the error."""
    case = fillet_case((8, 10))
    with pytest.warns(lacmesh.LacmeshWarning, match="its curvature changes within few faces") as told:
        (zone,) = solved(case)[1].zones
    assert np.abs(zone.pressure - 1).max() > 0.5
    said = str(told[0].message)
    assert "slave 'slave'" in said and "near (" in said and "refine it there" in said
    found = lacmesh.check(lacmesh.cut_skin(case.mesh, "slave").mesh, "slave", "master")
    (one, *_) = [one for one in found.findings if one.rule == "faceted"]
    words = re.search(r"curvature changes .* 0\.\d+ of a face's size", one.message)
    assert words and words[0] in said  # both say the same


def test_a_fine_fillet_is_not_warned_of(recwarn):
    solved(fillet_case((48, 64)))
    assert not recwarn.list
