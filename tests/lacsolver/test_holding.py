"""Warnings of a run: bodies that contact alone holds, and cells that fold between their integration points."""

import json
import re
import warnings

import numpy as np
import pytest

import lacsolver as ls
from lacmesh import Mesh, join
from lacmesh.cells import CELLS
from lacmesh.errors import LacmeshWarning
from lacmesh.generate import box, rectangle, ring
from lacsolver.bodies.folding import _FACTORS, folded, folds
from lacsolver.case import BodyForce, Contact, Coupling, Displacement, Force, Material, Solver, Steps, Traction
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.output import create_output
from lacsolver.problem.problem import Problem
from lacsolver.running import run
from lacsolver.space.space import Space
from tests.problems import case_of, contact, fix, move

LAWS = {"small": "elastic", "finite": "saint_venant_kirchhoff"}


def warned(case, folder):
    """The results of a run, and what it warned of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        results = run(case, create_output(folder / "out"))
    return results, [str(w.message) for w in caught if isinstance(w.message, LacmeshWarning)]


# ---- a bar of rough faces between two jaws


def clamped(slope):
    """Jaws and bar: the bar's skins, of y = 1 and 2, have facets that fall and rise by turns with this slope.

    An end of the jaws, beside the bar, is worn: of plane masters the normals would be the direction of contact.
    """

    def worn(x, at):
        return 0.05 * (x[0] < -0.9) * (x[1] == at)

    low, high = (rectangle((8, 1), (6, 1), corner=(-1, y)) for y in (0, 2))
    bar = rectangle((8, 1), (4, 1), corner=(0, 1))
    saw = 0.5 * slope * (np.round(2 * bar.points[:, 0]) % 2)
    return join(
        low.moved(lambda x: [x[0], x[1] - worn(x, 1)]).renamed(body="", bottom="floor", top="jaw_below", left=""),
        bar.moved(lambda x: [x[0], x[1] + saw * (3 - 2 * x[1])]).renamed(
            body="bar", bottom="bar_below", top="bar_above", left="end"
        ),
        high.moved(lambda x: [x[0], x[1] + worn(x, 2)]).renamed(body="", bottom="jaw_above", top="roof", left=""),
    )


def held(folder, slope, force=None):
    """The lower jaw is fixed, the upper one pressed down; contact alone holds the bar, which a force pushes along."""
    pairs = [
        Contact(name=name, slave=f"bar_{name}", master=f"jaw_{name}", search_distance=1.0, surface="faces")
        for name in ("below", "above")
    ]
    push = [] if force is None else [Traction(group="end", tx=force)]
    records = *pairs, fix("floor", "xy"), move("roof", ux=0.0, uy=-0.05), *push
    return warned(case_of(clamped(slope), Material(young=2000.0, poisson=0.3), *records, model="plane_strain"), folder)


def test_a_body_that_contact_holds_well_is_told_of_and_no_more(tmp_path):
    """Teeth that rise by a hundredth hold it: motions are named, and nothing is warned of."""
    results, said = held(tmp_path, 1e-2, 1e-3)
    assert results.held == ("'bar' moves along x", "'bar' moves along y", "'bar' turns about the point (2, 1.549)")
    assert said == [] and results.message == ""
    assert results.steps[-1].displacement == pytest.approx(0.05, rel=1e-2)


@pytest.mark.parametrize("slope", [1e-4, 1e-5])
def test_roughness_that_holds_a_body_is_warned_of(tmp_path, slope):
    """The resistance goes as the square of the slope; a small load moves the bar far, and the run warns of it."""
    results, said = held(tmp_path, slope, 100 * slope)
    hardly, small = said
    part = re.match(r"'bar' moves along x by .*, farther than .* with (\d\.\de-\d\d) of its stiffness", hardly)
    assert part is not None and 0.5 < float(part[1]) / slope**2 < 2
    assert "small kinematics" in small
    assert results.status == "done" and results.message == "\n".join(said)
    told = json.loads((tmp_path / "out" / "results.json").read_text())
    assert (told["status"], told["message"]) == ("done", results.message)


@pytest.mark.parametrize(
    ("slope", "force", "there", "absent"),
    [
        (1e-4, None, ["of its stiffness"], "farther"),  # without any load along it
        (2e-3, 1.0, ["farther than it is long", "small kinematics"], "of its stiffness"),  # too large for its teeth
        (0.3, None, ["along x by 0: contact alone could", "along y by 0:", "turns about"], "stiffness"),  # jaws open
    ],
)
def test_how_little_contact_holds_a_body(tmp_path, slope, force, there, absent):
    said = [line for line in held(tmp_path, slope, force)[1] if "curvature" not in line]  # of teeth that are this high
    assert len(said) == len(there)
    for line, words in zip(said, there, strict=True):
        assert words in line and absent not in line


# ---- a pin in a bore


@pytest.mark.rows("small")
@pytest.mark.parametrize("kinematics", LAWS)
def test_a_pin_that_its_bore_hardly_holds_along_the_axis(tmp_path, kinematics):
    """Its facets are rough by 1e-5 and it is pushed along: it may go, and turn in the bore, and nothing else."""
    rough = 1e-5 * np.random.default_rng(0).normal(size=96)
    pin = ring((1, 12, 3), (0.5, 1.002), "HEXA8", height=1.5)
    pin = pin.moved(lambda x: [*(x[:2] * (1 + rough[: x.shape[1]] / np.hypot(*x[:2]))), x[2]])
    lug = ring((1, 12, 3), (1.0, 1.5), "HEXA8", height=1.5).renamed(inner="bore", outer="lug_skin")
    mesh = join(pin.renamed(body="pin", outer="pin_skin"), lug.renamed(body=""))
    touching = Contact(slave="pin_skin", master="bore", search_distance=0.5, surface="faces")
    material = Material(young=2000.0, poisson=0.3, law=LAWS[kinematics])
    records = material, touching, fix("lug_skin", "xyz"), BodyForce(groups=["pin"], fz=1e-11)
    results, said = warned(case_of(mesh, *records, model="3d", kinematics=kinematics), tmp_path)
    assert len(results.held) == 6
    axial, turning = said[:2]
    assert axial.startswith("'pin' moves along z by ") and "of its stiffness" in axial
    assert turning.startswith("'pin' turns about an axis along z through ") and "of its stiffness" in turning
    rest = ("small kinematics", "curved surfaces are uncertain")  # where its roughness alone drives it out
    assert all(any(words in line for words in rest) for line in said[2:])


@pytest.mark.filterwarnings("ignore:.*its curvature changes within few faces")
def test_a_pin_that_nothing_holds_along_its_smooth_bore_is_named():
    """An oval bore of coarse faces is smooth but for its roughness, which stops no pin: no step is small enough."""

    def oval(x):
        angle = x[1] + 0.12 * np.sin(2 * x[1]) * np.sin(1.7 * x[2] + x[1])
        return [1.25 * x[0] * np.cos(angle), x[0] * np.sin(angle), x[2]]

    pin, hub = (
        box((radii, np.linspace(0, np.pi / 2, n), np.linspace(*ends, 5))).moved(oval)
        for radii, n, ends in (([0.3, 1.0], 7, (0, 2)), ([1.0, 1.8], 6, (-1, 3)))
    )
    pin = pin.renamed(right="pin", front="y", back="x", bottom="end").only("body", "pin", "y", "x", "end")
    mesh = join(pin, hub.renamed(body="hub", left="bore", right="out").only("hub", "bore", "out"))
    records = (
        Material(law="neo_hookean", young=1000.0, poisson=0.3),
        contact(slave="pin", master="bore", clearance=-0.02),
        *(fix("out", "xyz"), fix("y", "y"), fix("x", "x")),
        *(Force(group="end", fz=1.0, total=True), Steps(count=1, max_halvings=0), Solver(max_iterations=3)),
    )
    with pytest.raises(NotConvergedError, match="'body' moves along z"):
        ls.solve(case_of(mesh, *records, model="3d", kinematics="finite"))


# ---- cells that fold

QUADRATIC = [name for name, cell in CELLS.items() if cell.order == 2 and cell.family in _FACTORS]
SOFT = Material(young=1.0, poisson=0.3, law="neo_hookean")
PLANE = {"model": "plane_strain", "kinematics": "finite"}


def folded_cells(name, u, x=None):
    """Rows of the folds of a cell of a type, its reference element or with its nodes at x, under displacements."""
    reference = np.array(CELLS[name].reference) if x is None else np.array(x, float)
    mesh = Mesh.create(reference, [(name, [[*range(len(reference))]])])
    return folds(Space.of(mesh, "3d" if CELLS[name].dim == 3 else "plane_strain"), np.asarray(u).ravel())


@pytest.mark.parametrize("name", QUADRATIC)
def test_a_mid_side_node_may_be_at_a_quarter_of_its_edge_and_not_farther(name):
    """Along the edge dx/ds is 4 place - 1 at one end and 3 - 4 place at the other."""
    cell = CELLS[name]
    start, end = np.array(cell.reference)[list(cell.edges[0][:2])]
    u = np.zeros((cell.n_nodes, cell.dim))
    for place, folds_there in ((0.26, False), (0.24, True), (0.74, False), (0.76, True)):
        u[cell.n_corners] = (place - 0.5) * (end - start)
        assert len(folded_cells(name, u)) == folds_there
    turn, x = np.array([[0.0, -1.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array(cell.reference)
    assert not len(folded_cells(name, x @ turn[: cell.dim, : cell.dim].T - x))  # turned and squeezed


def test_corners_of_quadrangles():
    """One may go to the middle; in a mesh two may be at one place, as around the tip of a crack."""
    for to, folds_there in ((0.51, False), (0.49, True)):
        u = np.zeros((4, 2))
        u[2] = to - 1
        assert len(folded_cells("QUAD4", u, [[0, 0], [1, 0], [1, 1], [0, 1]])) == folds_there
    x = np.array([[0, 0], [1, 0], [1, 1], [0, 0], [0.5, 0], [1, 0.5], [0.5, 0.5], [0, 0]])
    assert not len(folded_cells("QUAD8", 0.1 * x**2, x))


def test_a_cell_may_not_be_wound_around_a_point():
    """By x + i y -> its square, in which J is 4 (x^2 + y^2): not negative anywhere, and 1 at the mid-side nodes."""
    corners = np.exp(2j * np.pi * np.arange(3) / 3)
    z = np.concatenate([corners, (corners + np.roll(corners, -1)) / 2])
    x, u = (np.stack([v.real, v.imag], axis=1) for v in (z, z**2 - z))
    (row,) = folded_cells("TRIA6", u, x)
    assert row[0] == 1


@pytest.mark.rows("2.5")
@pytest.mark.parametrize("theta", (2.5, 3.1))
def test_a_body_that_is_turned_at_once_is_not_folded(theta):
    """By 2.5 in two steps a corner changed places with its mid-side node, by 3.1 a cell was wound around a point."""
    point = Coupling(group="top", at=[0.8, 1.9], rotation=theta, ux=0.5, uy=0.5)
    problem = Problem.of(case_of(rectangle(2, kind="TRIA6"), SOFT, point, **PLANE))
    *_, last = march(problem)
    arm = problem.space.mesh.points[:, :2] - (0.8, 1.9)
    c, s = np.cos(theta), np.sin(theta)
    np.testing.assert_allclose(last.u.reshape(-1, 2), arm @ np.array([[c, s], [-s, c]]) - arm + 0.5, atol=1e-11)
    assert not last.folded


def test_a_cell_that_must_fold_is_warned_of(tmp_path):
    """A mid-side node is taken along its edge by 0.3, and is at a quarter of it at t = 0.83. Steps become an eighth."""
    corners = [Displacement(at=[x, y], ux=0.0, uy=0.0) for x in (0, 1) for y in (0, 1)]
    records = SOFT, *corners, Displacement(at=[0.5, 0], ux=-0.3, uy=0.0)
    done, (said,) = warned(case_of(rectangle(1, kind="QUAD8"), *records, **PLANE), tmp_path)
    assert [step.time for step in done.steps] == [0.5, 0.75, 0.875, 1.0]
    assert said == done.message and said.startswith("cell 1 near (0.5, 0.5) folded at time 0.875: ")
    problem = Problem.of(case_of(rectangle(1, kind="QUAD8"), Material(young=1.0, poisson=0.3), model="plane_strain"))
    assert folded(problem.kinematics, np.full(problem.space.n_dof, 9.0), 1.0) == ""  # small kinematics do not fold
