"""Press fits of pins and holes with six to twelve linear faces around, whose edges turn by up to 60 degrees.

The exact pressure is Lame's. What is left of the error is that of so few cells, and falls with their size squared.
"""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
import lacsolver
from lacmesh.cells import CELLS
from lacsolver.cli import main
from lacsolver.problem.problem import Problem
from tests.coarse_rings import rings
from tests.samples import each_option
from verification.exact.lame import Fit, Shell
from verification.solving import solve

INTERFERENCE = 0.01
EXACT = Fit(
    Shell("plane_strain", 0.4, 1.0, 100.0, 0.3), Shell("plane_strain", 1.0, 2.0, 100.0, 0.3), interference=INTERFERENCE
).between
HEIGHTS = (0.0, 0.4, 0.8)


def case(dim=2, more="", **contact):
    held = "kx = 1e-4\nky = 1e-4\n" + ("kz = 1e-4\n" if dim == 3 else "")
    keys = "\n".join(f"{name} = {value!r}".replace("'", '"') for name, value in contact.items())
    ends = '[[displacement]]\ngroup = "ends"\nuz = 0.0\n' if dim == 3 else ""
    return f"""mesh = "mesh.msh"
model = "{"plane_strain" if dim == 2 else "3d"}"
{more}
[[material]]
young = 100.0
poisson = 0.3
[[contact]]
slave = "slave"
master = "master"
clearance = {-INTERFERENCE}
{keys}
[[spring]]
group = "pin"
{held}
[[spring]]
group = "hole"
{held}
{ends}"""


def pressed(kind, inner, outer, cells=(3, 4), turned=0.0):
    """A pin with a hole along its axis, of `inner` faces around, in a ring of `outer`, which is turned."""
    dim = CELLS[kind].dim
    both = {"kind": kind, "heights": HEIGHTS if dim == 3 else (0.0,)}
    pin = {"n": inner, "radii": np.linspace(0.4, 1, cells[0] + 1), "names": ("pin", "bore", "slave")} | both
    hole = {
        "n": outer,
        "radii": np.linspace(1, 2, cells[1] + 1),
        "turn": turned,
        "names": ("hole", "master", "rim"),
    } | both
    made = rings(pin, hole, dim=dim)
    ends = np.flatnonzero(np.isin(made.points[:, 2], [HEIGHTS[0], HEIGHTS[-1]]))
    return replace(made, node_groups={"ends": ends} if dim == 3 else {})


def quietly(text, mesh):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", lacmesh.LacmeshWarning)
        return solve(text, mesh).state.zones[0]


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


@pytest.mark.parametrize(
    ("kind", "inner", "outer", "allowed", "normals"),
    each_option(
        ((*fit, normals) for fit in FITS for normals in ("facet", "smoothed")), of=lambda row: [row[:3], row[4]]
    ),
)
def test_press_fits_of_few_faces(kind, inner, outer, allowed, normals):
    mesh = pressed(kind, inner, outer)
    zone = quietly(case(3 if mesh.space_dim == 3 else 2, normals=normals), mesh)
    assert (zone.pressure > 0).all()
    assert mean(zone) == pytest.approx(EXACT, rel=allowed)


@pytest.mark.parametrize("normals", ["facet", "smoothed"])
def test_the_error_falls_with_the_size_of_the_faces_squared(normals):
    """From edges that are over the crease angle to such that are below it, with no jump between them."""
    few, more = (
        mean(quietly(case(normals=normals), pressed("QUAD4", 8 * n, 12 * n, (4 * n, 6 * n)))) - EXACT for n in (1, 2)
    )
    assert 0 < more < 0.3 * few


def test_finite_strains():
    text = case(more='kinematics = "finite"').replace("young", 'law = "saint_venant_kirchhoff"\nyoung')
    assert mean(quietly(text, pressed("QUAD4", 8, 12))) == pytest.approx(EXACT, rel=0.15)


def test_a_crease_angle_that_is_given_is_kept(recwarn):
    """Eight faces are then a polygon, whose sides the twelve of the hole do not touch."""
    zone = solve(case(crease_angle=40.0), pressed("QUAD4", 8, 12)).state.zones[0]
    assert (zone.pressure == 0).all()
    assert [str(one.message).partition(":")[0] for one in recwarn.list] == ["nothing acts on the bodies"]


def test_a_square_stays_a_square(recwarn):
    """A peg and a hole of four faces are pressed over their whole sides, and nothing is said."""
    zone = solve(case(), pressed("QUAD4", 4, 4)).state.zones[0]
    assert not recwarn.list
    assert zone.gap == pytest.approx(0, abs=1e-12) and (zone.pressure > 0).all()


def test_cells_that_are_less_deep_than_the_faces_are_off():
    """Corners of one polygon reach into the other by more than its cells are deep: they are found all the same."""
    zone = quietly(case(), pressed("QUAD4", 8, 8, (24, 24), turned=0.2))
    assert mean(zone) == pytest.approx(EXACT, rel=0.25) and zone.coverage == pytest.approx(1)


def test_what_was_taken_is_said(tmp_path, capsys):
    """By validate and run, with the group, the angle, the shape, and what to write if the edges are sharp."""
    lacmesh.write(tmp_path / "mesh.msh", pressed("HEXA8", 8, 12))
    file = tmp_path / "pin.toml"
    file.write_text(case(3))
    said = "slave 'slave': 16 faces that turn by up to 45 degrees lie on one cylinder of radius 1 and are taken as it"
    assert main(["validate", str(file)]) == 0
    told = " ".join(capsys.readouterr().err.split())
    assert said in told and "give crease_angle = 40 if the edges are sharp" in told and "master" not in told
    assert main(["run", str(file), "-o", str(tmp_path / "out")]) == 0
    assert said in " ".join(capsys.readouterr().err.split())
    with pytest.warns(lacmesh.LacmeshWarning, match="taken as it"):
        Problem.of(lacsolver.parse_case(case(3)), pressed("HEXA8", 8, 12))
