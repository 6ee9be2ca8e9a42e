"""Bodies held by contact alone: messages and warnings about them."""

from __future__ import annotations

import json
import re
import warnings

import numpy as np
import pytest

import lacsolver as ls
from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.errors import LacmeshWarning
from lacsolver.case import Case, Contact, Displacement, Force, Material, Solver, Steps, parse_case
from lacsolver.equilibrium.stepping import NotConvergedError
from lacsolver.output import create_output
from lacsolver.running import run
from verification.meshes.blocks import bent, joined
from verification.meshes.half_spaces import piece

#: a bar of rough faces between two jaws, the lower one fixed, the upper one pressed down; contact alone holds the bar
CASE = """
mesh = "nowhere.msh"
model = "plane_strain"
kinematics = "{kinematics}"
[[material]]
law = "{law}"
young = 2000.0
poisson = 0.3
[[contact]]
name = "below"
slave = "bar_below"
master = "jaw_below"
search_distance = 1.0
surface = "faces"
[[contact]]
name = "above"
slave = "bar_above"
master = "jaw_above"
search_distance = 1.0
surface = "faces"
[[displacement]]
group = "floor"
ux = 0.0
uy = 0.0
[[displacement]]
group = "roof"
ux = 0.0
uy = -0.05
{more}
"""
PUSHED = """
[[traction]]
group = "end"
tx = {force}
"""


def rows(n, x, low, high):
    """(points, quads, lower edges, upper edges) of a row of n squares between two lines y = low(x) and y = high(x)."""
    points = np.concatenate([np.stack([x, f + 0 * x], axis=1) for f in (low, high)])
    a = np.arange(n)
    below, above = np.stack([a + 1, a], axis=1), np.stack([n + 1 + a, n + 2 + a], axis=1)
    return points, np.column_stack([a, a + 1, n + 2 + a, n + 1 + a]), below, above


def clamped(slope):
    """Jaws and bar: the bar's skins, of y = 1 and 2, have facets that fall and rise by turns with this slope.

    An end of the jaws, beside the bar, is worn: of plane masters the normals would be the direction of contact.
    """
    n = 8
    x = np.linspace(0.0, 4.0, n + 1)
    tooth = slope * (x[1] - x[0]) * (np.arange(n + 1) % 2)
    saw = np.where(np.arange(n + 1) % 4 == 2, 0.0, tooth)
    jaw = np.linspace(-1.0, 5.0, n + 1)
    worn = 0.05 * (jaw < -0.9)
    parts = [rows(n, jaw, 0.0, 1.0 - worn), rows(n, x, 1.0 + saw, 2.0 - saw), rows(n, jaw, 2.0 + worn, 3.0)]
    start = 2 * (n + 1) * np.arange(3)
    quads = np.concatenate([q + s for (_, q, _, _), s in zip(parts, start, strict=True)])
    (floor, jaw_below), (bar_below, bar_above), (jaw_above, roof) = (
        (b + s, a + s) for (_, _, b, a), s in zip(parts, start, strict=True)
    )
    end = np.array([[start[1], start[1] + n + 1]])
    named = {"floor": floor, "jaw_below": jaw_below, "bar_below": bar_below, "bar_above": bar_above}
    named |= {"jaw_above": jaw_above, "roof": roof, "end": end[:, ::-1]}
    first = len(quads) + np.cumsum([0, *(len(lines) for lines in named.values())])
    groups = {name: f + np.arange(len(lines)) for (name, lines), f in zip(named.items(), first, strict=False)}
    groups["bar"] = n + np.arange(n)
    points = np.concatenate([p for p, *_ in parts])
    return Mesh.create(points, [("QUAD4", quads), ("SEG2", np.concatenate(list(named.values())))], cell_groups=groups)


def solved(folder, slope, more="", kinematics="small"):
    """The results of a run, and what it warned of."""
    law = "elastic" if kinematics == "small" else "saint_venant_kirchhoff"
    case = parse_case(CASE.format(kinematics=kinematics, law=law, more=more))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        results = run(case, create_output(folder / "out"), mesh=clamped(slope))
    return results, [str(w.message) for w in caught if isinstance(w.message, LacmeshWarning)]


def test_a_body_that_contact_holds_well_is_told_of_and_no_more(tmp_path):
    """Teeth that rise by a hundredth hold it: motions are named, and nothing is warned of."""
    results, warned = solved(tmp_path, 1e-2, PUSHED.format(force=1e-3))
    assert results.held == ("'bar' moves along x", "'bar' moves along y", "'bar' turns about the point (2, 1.549)")
    assert warned == [] and results.message == ""
    assert results.steps[-1].displacement == pytest.approx(0.05, rel=1e-2)


@pytest.mark.parametrize("slope", [1e-4, 1e-5])
def test_roughness_that_holds_a_body_is_warned_of(tmp_path, slope):
    """The resistance goes as the square of the slope; a small load moves the bar far, and the run warns of it."""
    results, warned = solved(tmp_path, slope, PUSHED.format(force=100 * slope))
    hardly, small = warned
    part = re.fullmatch(
        r"'bar' moves along x by [\d.e+]+, farther than it is long \(4\): contact alone resists that, with "
        r"(\d\.\de-\d\d) of its stiffness, as little as the roughness of a mesh gives; hold it by a displacement or "
        r"a spring, or look where its load takes it",
        hardly,
    )
    assert part is not None and 0.5 < float(part[1]) / slope**2 < 2
    assert re.match(r"node \d+ \(.*\) moves by .* and its cells are 1 long: small kinematics takes displace", small)
    assert results.status == "done" and results.message == "\n".join(warned)
    told = json.loads((tmp_path / "out" / "results.json").read_text())
    assert (told["status"], told["message"]) == ("done", results.message)


def test_roughness_is_warned_of_without_any_load_along_it(tmp_path):
    (warned,) = solved(tmp_path, 1e-4)[1]
    assert warned.startswith("'bar' moves along x by ") and "of its stiffness" in warned and "farther" not in warned


def test_a_body_that_goes_farther_than_it_is_long_is_warned_of(tmp_path):
    """Teeth that hold it a little, and a load that is too large for them."""
    far, small = solved(tmp_path, 2e-3, PUSHED.format(force=1.0))[1]
    assert re.match(r"'bar' moves along x by .*, farther than it is long \(4\): contact alone resists that; hold", far)
    assert "small kinematics" in small


def test_a_body_that_nothing_touches_is_warned_of(tmp_path):
    """In the end the jaws are open."""
    warned = [line for line in solved(tmp_path, 0.3)[1] if "curvature" not in line]  # of teeth that are this high
    assert [line.split(":")[0] for line in warned] == [
        "'bar' moves along x by 0",
        "'bar' moves along y by 0",
        "'bar' turns about the point (2, 1.541) by 0",
    ]
    assert all("contact alone could stop that, and no closed macro-element does; hold it" in line for line in warned)


# ---- a pin in a bore


def ring(n, r, rough):
    """A ring of n wedges between two radii, three layers high: points, HEXA8, the cells' inner and outer faces."""
    angle = 2 * np.pi * np.arange(n) / n
    k, j, i = np.meshgrid(np.arange(4), np.arange(n), [0, 1], indexing="ij")
    radius = np.asarray(r)[i] + rough * np.random.default_rng(0).normal(size=i.shape)
    points = np.stack([radius * np.cos(angle[j]), radius * np.sin(angle[j]), 0.5 * k], axis=-1).reshape(-1, 3)

    def at(layer, wedge, side):
        return (layer * n + wedge % n) * 2 + side

    lay, wedge = (v.ravel() for v in np.meshgrid(np.arange(3), np.arange(n), indexing="ij"))
    corners = [(0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0), (1, 0, 0), (1, 0, 1), (1, 1, 1), (1, 1, 0)]
    cells = np.stack([at(lay + a, wedge + b, side) for a, b, side in corners], axis=1)
    inner, outer = (cells[:, list(CELLS["HEXA8"].facets[f].nodes)] for f in (4, 2))
    return points, cells, inner, outer


BORE = """
mesh = "nowhere.msh"
model = "3d"
kinematics = "{kinematics}"
[[material]]
law = "{law}"
young = 2000.0
poisson = 0.3
[[contact]]
slave = "pin_skin"
master = "bore"
search_distance = 0.5
surface = "faces"
[[displacement]]
group = "lug_skin"
ux = 0.0
uy = 0.0
uz = 0.0
[[body_force]]
groups = ["pin"]
fz = {force}
"""


def pin_in_bore(rough):
    """A pin that is a little thicker than its bore, of facets that lie on the bore's; its skin is `rough`."""
    (x, pin, _, pin_skin), (y, lug, bore, lug_skin) = ring(12, (0.5, 1.002), rough), ring(12, (1.0, 1.5), 0.0)
    quads = {"pin_skin": pin_skin, "bore": bore + len(x), "lug_skin": lug_skin + len(x)}
    groups = {"pin": np.arange(36)} | {name: 72 + 36 * k + np.arange(36) for k, name in enumerate(quads)}
    cells = [("HEXA8", np.concatenate([pin, lug + len(x)])), ("QUAD4", np.concatenate(list(quads.values())))]
    return Mesh.create(np.concatenate([x, y]), cells, cell_groups=groups)


@pytest.mark.parametrize("kinematics", ["small", "finite"])
def test_a_pin_that_its_bore_hardly_holds_along_the_axis(tmp_path, kinematics):
    """Its facets are rough by 1e-5 and it is pushed along: it may go, and turn in the bore, and nothing else."""
    law = "elastic" if kinematics == "small" else "saint_venant_kirchhoff"
    case = parse_case(BORE.format(kinematics=kinematics, law=law, force=1e-11))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        results = run(case, create_output(tmp_path / "out"), mesh=pin_in_bore(1e-5))
    assert len(results.held) == 6
    said = [str(w.message) for w in caught if isinstance(w.message, LacmeshWarning)]
    axial, turning = said[:2]
    assert axial.startswith("'pin' moves along z by ") and "of its stiffness" in axial
    assert turning.startswith("'pin' turns about an axis along z through ") and "of its stiffness" in turning
    rest = ("small kinematics", "curved skins may be off")  # where its roughness alone drives it out
    assert all(any(words in line for words in rest) for line in said[2:])


@pytest.mark.filterwarnings("ignore:.*its curvature changes within few faces")
def test_a_pin_that_nothing_holds_along_its_smooth_bore_is_named():
    """An oval bore of coarse faces is smooth but for its roughness, which stops no pin: no step is small enough."""
    lines = (np.array([0.3, 1.0]), np.linspace(0, np.pi / 2, 7), np.linspace(0, 2, 5))
    hub = (np.array([1.0, 1.8]), np.linspace(0, np.pi / 2, 6), np.linspace(-1, 3, 5))

    def oval(x):
        angle = x[:, 1] + 0.12 * np.sin(2 * x[:, 1]) * np.sin(1.7 * x[:, 2] + x[:, 1])
        return np.stack([1.25 * x[:, 0] * np.cos(angle), x[:, 0] * np.sin(angle), x[:, 2]], axis=1)

    names = {"x1": "pin", "y0": "y", "y1": "x", "z0": "end", "": "body"}, {"x0": "bore", "x1": "out"}
    mesh = bent(joined([(piece("HEXA8", own), n) for own, n in zip((lines, hub), names, strict=True)]), oval)
    case = Case(
        model="3d", kinematics="finite", material=[Material(law="neo_hookean", young=1000.0, poisson=0.3)],
        contact=[Contact(slave="pin", master="bore", clearance=-0.02)],
        displacement=[Displacement(group="out", ux=0, uy=0, uz=0), Displacement(group="y", uy=0),
                      Displacement(group="x", ux=0)],
        force=[Force(group="end", fz=1.0, total=True)],
        steps=Steps(count=1, max_halvings=0), solver=Solver(max_iterations=3),
    )  # fmt: skip
    with pytest.raises(NotConvergedError, match="'body' moves along z along its load, and contact resists that with"):
        ls.solve(case, mesh)
