"""Answers of the corpus in closed form, by the name of the problem, and a run as it is recorded in its results."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.optimize import fsolve

import lacmesh
from lacmesh import Mesh
from lacmesh.errors import LacmeshError
from lacsolver.case import Case
from lacsolver.equilibrium.stepping import NotConvergedError, Progress
from lacsolver.output.states import read_state
from lacsolver.problem.problem import Problem
from lacsolver.validation import validate
from tests.lacsolver.tables import table

CONTACT, OPEN, UNPAIRED = 1, 0, -1


@dataclass
class Ran:
    """A case that was run: what it wrote, the iterations that it told of, backends and threads that it asked for."""

    case: Case
    mesh: Mesh
    folder: Path
    error: LacmeshError | None = None
    told: list[Progress] = field(default_factory=list)
    asked: list[tuple[str, int]] = field(default_factory=list)

    @property
    def results(self) -> dict[str, Any]:
        return json.loads((self.folder / "results.json").read_text())

    @property
    def steps(self) -> list[dict[str, Any]]:
        return self.results["steps"]

    @property
    def times(self) -> list[float]:
        return [step["time"] for step in self.steps]

    @property
    def stored(self) -> list[int]:
        """The numbers of steps after which a state was kept."""
        return sorted(int(path.stem.removeprefix("state_")) for path in self.folder.glob("state_*.npz"))

    def table(self, zone):
        """The last time's rows of a zone, column by column, ordered by x."""
        columns = table(self.folder / f"contact_{zone}.csv")
        rows = np.flatnonzero(columns["time"] == columns["time"][-1])
        order = rows[np.argsort(columns["x"][rows], kind="stable")]
        return {name: values[order] for name, values in columns.items()}

    def solid(self):
        """The last fields of the body."""
        return lacmesh.read(sorted((self.folder / "fields").glob("solid_*.vtu"))[-1])


def check_loads(ran):
    """Reactions are the sums of all that acts: numbers ramped to the end, formulas and tables as they are."""
    assert ran.times == [0.5, 1.0, 1.5, 2.0] and ran.stored == [2, 4]
    assert len(list((ran.folder / "fields").glob("solid_*.vtu"))) == 2
    for step in ran.steps:
        t = step["time"]
        part, table = t / 2, np.interp(t, [0, 1], [0, 3])
        mass = 0.5 * 2.0 + 0.5 * 1.0
        load = [
            part * (1.0 + 2 * 0.1 + 0.04 + 0.07 + 0.5 * 0.5 + 0.05 * mass) - (1 + 0.5 * t),
            2.5 + part * (2 * 0.2 + 9 * 0.01 - 0.03 * mass) + 0.375,
            table + part * (2 * 0.3 - 9.81 * mass) + np.interp(t, [0, 2], [0, 0.8]) * 0.5,
        ]
        np.testing.assert_allclose(step["reactions"]["z0"], -np.array(load), rtol=1e-9)


def check_equated(ran):
    """Sums have their values, nodes share what they are to share, and the forces are in balance with the supports."""
    for step in ran.steps:
        probes = step["probes"]
        assert 2 * probes["corner"][0] - probes["corner"][1] == pytest.approx(0.03 * step["time"], rel=1e-12)
        assert probes["middle"][1] == pytest.approx(probes["corner"][1], rel=1e-12)
        assert probes["a"][2] == pytest.approx(probes["b"][2], rel=1e-12) != pytest.approx(probes["corner"][2])
        assert list(step["equations"]) == ["sum", "x1", "two"] and all(step["equations"].values())
        force, t = step["equations"]["sum"], step["time"]
        np.testing.assert_allclose(step["reactions"]["z0"], [-10 * t - 2 * force, force, -5 * t], atol=1e-10)


def check_coupled(ran):
    """Points reach their motions, and take their loads along their axes, through the weights of their nodes."""
    step = ran.steps[-1]
    hook, lid, pin = (step["couplings"][name] for name in ("hook", "z1", "pin"))
    assert hook["displacement"][1] == pytest.approx(1e-3, rel=1e-9)
    np.testing.assert_allclose([hook["force"][0], hook["force"][2]], [0.25, -0.5], rtol=1e-9)
    np.testing.assert_allclose(hook["moment"], [0, 0, -0.125], atol=1e-10)
    problem = Problem.of(ran.case, ran.mesh)
    space = problem.space
    (of_hook,) = (rows.spread for rows in problem.equalities if rows.name == "coupling hook")
    w = 1 + space.mesh.points[of_hook.nodes, 2]
    np.testing.assert_allclose(of_hook.w, w / w.sum())
    np.testing.assert_allclose(of_hook.w @ space.mesh.points[of_hook.nodes] + of_hook.d, [2.0, 0.5, 0.75])
    assert lid["displacement"][2] == pytest.approx(2e-3) and lid["rotation"] == [0, pytest.approx(1e-3), 0]
    assert lid["force"][0] == pytest.approx(0.5) and lid["force"][1] == pytest.approx(0, abs=1e-12)
    assert pin["displacement"][1] == pytest.approx(1e-3)
    body = ran.solid()
    places = [np.abs(body.points - x).max(axis=1).argmin() for x in ([0, 0, 1], [0, 0.5, 1])]
    one, other = body.node_data["displacement"][places, 1]
    assert one != pytest.approx(other, rel=1e-3)  # along y nodes of the lid are free
    loads = {load["section"]: load for load in ran.results["loads"]}
    np.testing.assert_allclose(loads["force"]["moment"], [0, 0, 0.375], atol=1e-12)


def check_sector(ran, cut):
    """A body that grows evenly, tied across the sides; the whole ring is written with the fields."""
    body = ran.solid()
    wanted = 0.01 * (body.points - np.array([0, 1, 0])) * [0, 1, 1]
    np.testing.assert_allclose(body.node_data["displacement"], wanted, atol=1e-12)
    assert list(ran.results["contact"]) == ["side"] and ran.results["contact"]["side"]["unpaired"] == 0
    ring = lacmesh.read(sorted((ran.folder / "fields").glob("ring_*.vtu"))[-1])
    assert ring.n_nodes == 6 * body.n_nodes
    assert ("PYRAM5" in {block.type for block in body.blocks}) == (cut == "pyramid")


def check_axes(ran):
    """A displacement along (3, 4) / 5, springs along the same axes, and a force about x, spread by area."""
    problem = Problem.of(ran.case, ran.mesh)
    (spring, count), d = (problem.springs, 9), np.array([0.6, 0.8, 0.0])
    block = 2.0 * np.outer(d, d) + 3.0 * np.outer([-0.8, 0.6, 0.0], [-0.8, 0.6, 0.0]) + 5.0 * np.diag([0, 0, 1.0])
    whole = spring.toarray().reshape(problem.space.mesh.n_nodes, 3, problem.space.mesh.n_nodes, 3).sum(axis=(0, 2))
    np.testing.assert_allclose(whole, count * block, atol=1e-12)
    space = problem.space
    (node,) = np.flatnonzero((space.mesh.points == [1.0, 0.5, 0.5]).all(axis=1))
    step = ran.steps[-1]
    moved = ran.solid().node_data["displacement"][node]
    assert moved @ d == pytest.approx(1e-6, rel=1e-9)
    assert step["reactions"]["at [1, 0.5, 0.5]"][2] == 0.0
    np.testing.assert_allclose(np.cross(step["reactions"]["at [1, 0.5, 0.5]"], d), 0, atol=1e-12)
    on = space.mesh.points[:, 0] == 1
    f = problem.load(1.0).reshape(-1, 3)[on]
    arm = space.mesh.points[on, 1:] + np.array([1.0, 0.0])
    radius = np.linalg.norm(arm, axis=1)
    r = arm / radius[:, None]
    theta = np.stack([-r[:, 1], r[:, 0]], axis=1)
    np.testing.assert_allclose(f[:, 0].sum(), 4.0)
    np.testing.assert_allclose([(f[:, 1:] * r).sum(), (f[:, 1:] * theta).sum()], [1.0, 2.0])


def check_tightened(ran):
    """A bolt keeps its force from the lock on, along its normal; another has E A s / L."""
    n = np.array([0.0, 0.3, 1.0]) / np.linalg.norm([0.0, 0.3, 1.0])
    bolts = [step["pretension"] for step in ran.steps]
    assert ran.times == [1.0, 2.0]
    for bolt in bolts:
        assert abs(np.dot(bolt["bolt"]["resultant"], n)) == pytest.approx(10.0, rel=1e-9)
        assert bolt["bolt"]["force"] == pytest.approx(10.0, rel=1e-9)
    np.testing.assert_allclose([bolt["second"]["force"] for bolt in bolts], [5.0, 10.0], rtol=1e-9)
    np.testing.assert_allclose([bolt["second"]["shortening"] for bolt in bolts], [0.015, 0.03], rtol=1e-9)


def check_late(ran):
    """A bar is pulled; its end is held from t = 1 on, goes from 0.01 to a half of 0.05, and then to 0.05."""
    assert ran.times == [1.0, 1.5, 2.0]
    reactions = [(step["reactions"]["x1"][0], step["reactions"]["x0"][0]) for step in ran.steps]
    np.testing.assert_allclose(reactions, [[0, -10], [5, -25], [20, -50]], rtol=1e-9, atol=1e-9)


def check_fields(ran):
    """Stress is the law's of the strain that is prescribed everywhere, less the thermal one; and so is the energy."""
    H = 1e-3 * np.array([[3, 1, 1], [4, 2, -1], [5, 1, -2]])
    e = (H + H.T) / 2
    strain = np.array([*np.diag(e), 2 * e[0, 1], 2 * e[1, 2], 2 * e[0, 2]])
    # axis 1 is y, 2 is x, 3 is -z: components xx yy zz xy yz xz are those of 22 11 33 12 13 23
    S = np.zeros((6, 6))
    nu12, nu13, nu23 = 0.2 / 1000, 0.3 / 1000, 0.25 / 2000
    S[:3, :3] = [[1 / 2000, -nu12, -nu23], [-nu12, 1 / 1000, -nu13], [-nu23, -nu13, 1 / 500]]
    S[3:, 3:] = np.diag([1 / 400, 1 / 300, 1 / 200])
    wood = strain - 30.0 * np.array([2e-4, 1e-4, 3e-4, 0, 0, 0])
    mu, lam = 1500 / 2.2, 1500 * 0.1 / (1.1 * 0.8)
    metal = strain - 10 * 5e-5 * np.array([1, 1, 1, 0, 0, 0])
    want = {
        "left": np.linalg.solve(S, wood),
        "right": lam * metal[:3].sum() * np.array([1, 1, 1, 0, 0, 0]) + mu * np.array([2, 2, 2, 1, 1, 1]) * metal,
    }
    axes_of_stress = ["xx", "yy", "zz", "xy", "yz", "xz"]
    for group, sigma in want.items():
        found = ran.results["stress"][group]
        assert list(found) == [*axes_of_stress, "von_mises", "principal_1", "principal_2", "principal_3"]
        np.testing.assert_allclose(
            [found[axes] for axes in axes_of_stress], np.tile(sigma, (2, 1)).T, rtol=1e-10, atol=1e-14
        )
    energy = 0.25 * (want["left"] @ wood + want["right"] @ metal)
    assert ran.results["energy"] == pytest.approx(energy, rel=1e-10)
    probes = ran.steps[-1]["probes"]
    assert list(probes) == ["corners", "y1", "middle"]
    for name, place in (("corners", [0.0, 0.25, 1.0]), ("y1", [0.5, 1.0, 0.5]), ("middle", [0.5, 1.0, 0.5])):
        np.testing.assert_allclose(probes[name], H @ place, rtol=1e-12)


def check_springs(ran):
    """A body that is as good as rigid stands on its springs as statics says."""
    low = np.array([[x, y, 0] for x in (0, 0.5, 1) for y in (0, 0.5, 1)])
    corners = np.array([[0, 0, 1], [0, 0.5, 1]])
    places = [*((x, (1, 2, 3)) for x in low), *((x, (4, 5, 6)) for x in corners), ([1, 0.5, 0.5], (0, 7, 0))]
    K = sum(motions(x).T @ np.diag(k) @ motions(x) for x, k in places)
    at, f = [1, 1, 1], [0.5, -0.25, 1.0]
    moved = np.linalg.solve(K, motions(at).T @ f)
    probes = ran.steps[-1]["probes"]
    np.testing.assert_allclose(probes["corner"], motions(at) @ moved, rtol=1e-4)
    np.testing.assert_allclose(probes["other"], motions([0, 1, 0]) @ moved, rtol=1e-4)
    assert ran.results["energy"] == pytest.approx(0.5 * np.dot(f, motions(at) @ moved), rel=1e-4)


def check_linked(ran):
    """A rigid body hangs on another one by a spring along a line, and by one of components."""
    line, d, e = np.array([1.0, 1.0, 0.1]) / np.sqrt(2.01), np.array([0.6, 0.8, 0.0]), np.array([-0.8, 0.6, 0.0])
    K = 7.0 * np.outer(line, line) + 2.0 * np.outer(d, d) + 3.0 * np.outer(e, e) + np.diag([0, 0, 4.0])
    f = np.array([1.0, -2.0, 0.5])
    u = np.linalg.solve(K, f)
    np.testing.assert_allclose(ran.steps[-1]["probes"]["hook"], u, rtol=1e-9)
    assert ran.results["energy"] == pytest.approx(0.5 * f @ u, rel=1e-9)


def motions(x):
    """(3, 6): displacements at x of unit translations and rotations."""
    return np.hstack([np.eye(3), np.cross(np.eye(3), x).T])


def check_rigid(ran):
    """One side is moved: every node as the motion says. The other is loaded: what holds its block bears the load."""
    assert ran.times == [0.5, 1.0]
    theta = np.array([1e-3, -2e-3, 4e-3])
    x = np.array([1.0, 1, 1])
    for step, t in zip(ran.steps, (0.5, 1.0), strict=True):
        u = t * np.array([1e-3, 2e-3, 3e-3]) + np.cross(t * theta, x - [0.25, 0, 1])
        np.testing.assert_allclose(step["probes"]["corner"], u, rtol=1e-12)
        np.testing.assert_allclose(step["reactions"]["top"], -t * np.array([1.0, 2, 3]), rtol=1e-9)
    mesh = ran.solid()
    top = mesh.points[:, 2] == 3.0
    R, X = mesh.node_data["reaction"][top], mesh.points[top]
    moment = np.array([0.25, 0.5, -1.0]) + np.cross([0.5, 0.25, 2.5], [1, 2, 3])
    np.testing.assert_allclose(np.cross(X, R).sum(axis=0), -moment, rtol=1e-9)


def check_searched(ran):
    """Two faces see the master, one half of it, one nothing; the clearance is a mean over each."""
    assert ran.told[0].closed == 2
    table = ran.table("joint")
    np.testing.assert_allclose(table["x"], [0.125, 0.375, 0.625, 0.875])
    assert table["status"].tolist() == [OPEN, OPEN, UNPAIRED, UNPAIRED]
    np.testing.assert_allclose(table["gap"][:2], 0.6 + 0.01 + 0.02 * table["x"][:2], rtol=1e-12)
    np.testing.assert_allclose(table["area"], 0.25 * 2.5, rtol=1e-12)


def check_rubbed(ran):
    """Everything slides, first at the bound of Coulomb and the cohesion, then at the limit."""
    zone = ran.results["contact"]["joint"]
    assert zone["sliding"] > 0 and zone["sticking"] == 0 and zone["slip_max"] > 0.01
    history = table(ran.folder / "history.csv")
    assert len(history["time"]) == 2
    push, rub = (abs(history[f"contact.joint.{name}"][0]) for name in ("fy", "friction.x"))
    assert rub == pytest.approx(0.3 * push + 0.2, rel=1e-9) and push > 3
    assert abs(history["contact.joint.friction.x"][1]) == pytest.approx(4.8, rel=1e-9)


def check_dragged(ran):
    """All slides: friction is its coefficient times the pressure."""
    (zone,) = ran.results["contact"].values()
    assert zone["sliding"] > 0 and zone["sticking"] == 0 and zone["slip_max"] > 0.05
    table = ran.table("slave")
    shear = np.linalg.norm([table[name] for name in ("shear_1", "shear_2") if name in table], axis=0)
    np.testing.assert_allclose(shear, 0.2 * table["pressure"], rtol=1e-8)


def check_sunk(ran):
    """Bodies that lie deep in one another are parted, where the master stands over the slave."""
    table = ran.table("slave")
    assert table["status"].tolist() == [CONTACT, CONTACT, CONTACT, UNPAIRED]
    np.testing.assert_allclose(table["gap"][:3], 0, atol=1e-12)
    assert (table["pressure"][:2] > 100).all()


def check_chosen(ran):
    """The surface that faces the other with its whole area is the slave, and the results say why."""
    told = ran.results["contact"]["joint"]
    assert (told["slave"], told["master"]) == ("master", "slave") and "with its whole area" in told["why"]


def check_glued(ran):
    """Two faces alone carry the pull, though the third is half in front of the master."""
    table = ran.table("glue")
    assert table["status"].tolist() == [CONTACT, CONTACT, UNPAIRED, UNPAIRED]
    pull = 2.0 * 0.625 * 2.5
    assert table["pressure"] @ table["area"] == pytest.approx(-pull, rel=1e-10)
    assert ran.results["contact"]["glue"]["resultant"][1] == pytest.approx(pull, rel=1e-10)
    np.testing.assert_allclose(ran.steps[-1]["reactions"]["bottom"][1], -pull, rtol=1e-10)


def check_strain(ran):
    """Held together by springs of a bilateral contact, without any strain along z."""
    p, modulus, stiffness = -2.0, 1000 / (1 - 0.09), 500.0
    np.testing.assert_allclose(ran.table("slave")["pressure"], p, rtol=1e-10)
    np.testing.assert_allclose(ran.results["stress"][""]["zz"], [-0.3 * p] * 2, rtol=1e-9)
    np.testing.assert_allclose(ran.steps[-1]["probes"]["top"][1], -p * (2 / modulus + 1 / stiffness), rtol=1e-10)


def check_soft(ran, overlap):
    """Columns in plane strain, shortened by their own strain and by the overlap of the law at a pressure of 2."""
    np.testing.assert_allclose(ran.table("slave")["pressure"], 2.0, rtol=1e-9)
    np.testing.assert_allclose(ran.steps[-1]["probes"]["top"][1], -2 * 2 * 0.91 / 1000 - overlap, rtol=1e-7)


def check_thick(ran):
    """A pressure of 6 on a column of thickness 5, which stands on the slave, of thickness 2."""
    np.testing.assert_allclose(ran.table("slave")["pressure"], 6 * 5 / 2, rtol=1e-9)
    np.testing.assert_allclose(ran.steps[-1]["probes"]["top"][1], -6 * 5 / 2 / 1000 - 6 / 1000, rtol=1e-7)


def _of_exponential():
    """The overlap at a pressure of 2 of the law with 0.5 at contact and a clearance of 0.002."""
    s = fsolve(lambda s: s * np.expm1(s) - 4 * np.expm1(1.0), 2.0, xtol=1e-12)[0]
    return 0.002 * (s - 1)


def check_yielding(ran):
    """Pulled by 1 % and pushed back beyond the yield stress, with both kinds of hardening: 90 of 1090 go on."""
    pulled = 2.0 + 90 * (dp := (0.01 * 1000 - 2.0) / 1090)
    back, again = 40 * dp, (1000 * (0.004 + dp) + 40 * dp - 2.0 - 50 * dp) / 1090
    assert again > 0
    pushed = -(2.0 + 50 * (dp + again)) + back - 40 * again
    for step, stress in zip(ran.steps, (pulled, pushed), strict=True):
        assert step["reactions"]["x1"][0] == pytest.approx(stress, rel=1e-8)
    assert ran.steps[1]["plastic"]["strain_max"] == pytest.approx(dp + again, rel=1e-8)


def check_round(ran):
    """The full circle bears the force; an overlap lifts the plate. Steps also end where fields are asked for."""
    assert ran.told[0].closed < 3
    assert ran.times == [0.25, 0.5, 1.0, 2.0] and ran.stored == [2, 4]
    assert not list(ran.folder.glob("*.pvd"))
    assert json.loads((ran.folder / "results.json").read_text())["units"] == "kN, m, kPa"
    with h5py.File(ran.folder / "results.med") as med:
        assert [float(step.attrs["PDT"]) for step in med["CHA/DEPL"].values()] == [0.5, 2.0]
    for step in ran.steps:
        p = 6.0 * step["time"] / 2 / np.pi
        assert step["reactions"]["bottom"][1] == pytest.approx(np.pi * p, rel=1e-10)
    state = read_state(ran.folder, ran.case, mesh=ran.mesh)
    assert state.rigid["top"][1] == pytest.approx(0.004 - 2 * p / 1000, rel=1e-9)
    np.testing.assert_allclose(ran.table("slave")["pressure"], p, rtol=1e-9)
    assert ran.table("slave")["area"].sum() == pytest.approx(np.pi, rel=1e-12)


def check_measured(ran):
    """The pressure is the force over the area as it has grown."""
    stretch = 1 + 0.3 * 1.3 * 10.0 / 100.0
    table = ran.table("slave")
    np.testing.assert_allclose(table["pressure"], 10.0 / stretch, rtol=1e-10)
    assert table["area"].sum() == pytest.approx(stretch, rel=1e-10)


def check_slid(ran):
    """Half of the slave is left behind; a clearance stays, above the gap of the skins."""
    assert ran.results["contact"]["slave"]["coverage_min"] == 0
    table = ran.table("slave")
    assert table["coverage"] @ table["area"] == pytest.approx(0.5, rel=1e-12)
    assert set(table["status"]) == {OPEN, UNPAIRED}
    np.testing.assert_allclose(table["gap"][table["status"] == OPEN], 0.01 - 0.005, rtol=1e-9)
    assert ran.steps[0]["time"] == 0.5


def check_smooth(ran):
    """The normal turns from that of a face to the vertical one of the ridge, over the third of the face beside it."""
    np.testing.assert_allclose(ran.table("slave")["gap"], [gap_below(smooth=True)] * 2, rtol=1e-6)


def check_by_the_master(ran):
    """The direction of contact is that of the plane above."""
    np.testing.assert_allclose(ran.table("slave")["gap"], [0.5 + 0.25 / 4] * 2, rtol=1e-12)


def check_creased(ran):
    """An edge that turns by 28 degrees stays sharp, or is that of the faces."""
    np.testing.assert_allclose(ran.table("slave")["gap"], [gap_below(smooth=False)] * 2, rtol=1e-12)


def check_tied(ran):
    """A tie holds what its skins do to each other and knows no gap; `validate` tells the one that it starts with."""
    (zone,) = validate(ran.case, ran.mesh).zones
    np.testing.assert_allclose(zone.gap, [gap_below(smooth=False)] * 2, rtol=1e-12)


def gap_below(smooth):
    """The mean gap between a side of the roof and the plane above, by a Gauss rule on each third of the cut face."""
    s, w = np.polynomial.legendre.leggauss(20)
    s, w = (s + 1) / 2, w / 2
    face = np.array([0.25, 1.0]) / np.hypot(0.25, 1.0)
    total = 0.0
    for k in range(3):
        x = (k + s) / 6  # from the eave to the ridge
        turned = np.outer(1 - s, face) + np.outer(s, [0, 1])
        n = turned / np.linalg.norm(turned, axis=1)[:, None] if smooth and k == 2 else face[None]
        total += w @ ((0.5 + 0.25 * (0.5 - x)) / n[:, 1]) / 3
    return total


def check_tolerant(ran):
    assert ran.error is None and 1e-10 < ran.steps[-1]["residuals"][-1] <= 1e-3


def check_symmetric(ran):
    """Without the derivative of the normals it converges as slowly as they turn."""
    assert ran.error is None and ran.steps[-1]["residuals"][-1] <= 1e-10
    assert ran.steps[-1]["iterations"] >= 7


def check_consistent(ran):
    assert ran.error is None and ran.steps[-1]["residuals"][-1] <= 1e-10
    assert ran.steps[-1]["iterations"] <= 5


def check_halved(ran):
    """An eighth of the step converges; the steps after it stay as long as that."""
    assert ran.times == [k / 8 for k in range(1, 9)]
    assert [step["halvings"] for step in ran.steps] == [3] + 7 * [0]
    assert ran.steps[0]["iterations"] == 3 * 4 + len([told for told in ran.told if told.time == 1 / 8])
    assert max(told.number for told in ran.told) == 4


def check_given_up(ran):
    assert isinstance(ran.error, NotConvergedError) and ran.error.state.halvings == 2
    assert ran.results["status"] == "failed" and ran.steps == [] and (ran.folder / "unconverged").is_dir()
    assert [told.time for told in ran.told if told.number == 1] == [1.0, 0.5]


def check_tower(ran, cells):
    assert ran.results["sizes"]["cells"] == cells
    assert ran.steps[-1]["reactions"]["bottom"][2] == pytest.approx(1.0, rel=1e-10)
    for zone in ("slave1", "slave2"):
        np.testing.assert_allclose(ran.table(zone)["pressure"], 1.0, rtol=1e-9)


#: directions across the load in which a stack is free to widen, by model
FREE = {"plane_strain": [0], "plane_stress": [0, 2], "axisymmetric": [0, 2], "3d": [0, 1]}


def check_press(ran, law, follower=False, current=False):
    """A stack at a uniform finite strain, by the closed forms of the laws; no stress on its sides."""
    model = ran.case.model
    lam, mu = 1000 * 0.3 / (1.3 * 0.4), 1000 / 2.6
    up = 2 if model == "3d" else 1
    free = [up, *FREE[model]]

    def nominal(s):
        if law == "neo_hookean":
            return mu * (s - 1 / s) + lam * np.log(s.prod()) / s
        E = (s**2 - 1) / 2
        return s * (lam * E.sum() + 2 * mu * E)

    def left(free_stretches):
        s = np.ones(3)
        s[free] = free_stretches
        wanted = np.zeros(3)
        wanted[up] = -100.0 * (s.prod() / s[up] if follower else 1.0)
        return (nominal(s) - wanted)[free]

    s = np.ones(3)
    s[free] = fsolve(left, s[free], xtol=1e-13)
    wide, nominal_pressure = s.prod() / s[up], -nominal(s)[up]
    body = ran.solid()
    u = body.node_data["displacement"]
    np.testing.assert_allclose(u[:, : up + 1], body.points[:, : up + 1] * (s - 1)[: up + 1], atol=1e-8)
    if model == "plane_stress":
        wide = s[0]  # a skin's thickness stays as it was
    area = wide if current else 1.0
    np.testing.assert_allclose(ran.table("slave")["pressure"], nominal_pressure / area, rtol=1e-8)
    width = np.pi if model == "axisymmetric" else 2.5 if model == "plane_stress" else 1.0
    reaction = ran.steps[-1]["reactions"]["bottom"][up]
    assert reaction == pytest.approx(nominal_pressure * width, rel=1e-8)


def newmark(v, force, damping, *, dt=0.25, count=4, alpha=0.0, beta=0.25, gamma=0.5):
    """(displacement, velocity) of a unit mass after some steps of Newmark's method or HHT, under a constant force."""
    u, a = 0.0, force - damping * v
    for _ in range(count):
        w, free = u + dt * v + dt**2 * (0.5 - beta) * a, v + dt * (1 - gamma) * a
        a = (force - damping * ((1 - alpha) * free + alpha * v)) / (1 + (1 - alpha) * damping * gamma * dt)
        u, v = w + dt**2 * beta * a, free + gamma * dt * a
    return u, v


def check_thrown(ran):
    """A rigid body under constant loads, and one that is thrown, both damped by their mass; the second one turns."""
    how = {"damping": 0.5, "beta": 0.4, "gamma": 0.6}
    fields = ran.solid()
    u, x = fields.node_data["displacement"], fields.points
    lower = x[:, 2] < 1.05
    moved, turned = newmark(0.0, 1.5 / 5.0, **how)[0], newmark(0.0, 0.6 / (2.5 + 2.0 / 6), **how)[0]
    arm = x[lower] - [0.5, 0.5, 0.5]
    wanted = np.column_stack([moved - turned * arm[:, 1], turned * arm[:, 0], 0 * arm[:, 2]])
    np.testing.assert_allclose(u[lower], wanted, atol=1e-6)
    path, arm = newmark(1.0, 0.0, **how)[0], x[~lower] - [0.25, 0.5, 1.6]
    v = np.array([0.1, 0.2, 0.3]) + 0.4 * np.column_stack([-arm[:, 1], arm[:, 0], 0 * arm[:, 2]])
    np.testing.assert_allclose(u[~lower], np.array([0.01, 0.02, 0.03]) + path * v, atol=1e-6)
    assert ran.steps[-1]["energies"]["damped"] > 0


def check_damped(ran):
    """A block that strikes another on a soft contact, whose damper takes energy."""
    (zone,) = ran.case.contact
    assert zone.stiffness.source == 50.0
    assert ran.steps[-1]["energies"]["damped"] > 1e-5
    assert ran.table("slave")["pressure"].max() > 0


#: by choice of massless nodes: their number (4 + 6 nodes of the slave's three faces, 6 inside the cells behind them, 3
#: of the master), alpha, and the damping by the mass
MASSLESS = {"skins": (19, 0.1, 0.5), "slave": (16, 0.05, 0.0), "internal": (6, 0.05, 0.0), "none": (0, 0.05, 0.0)}


def check_falling(ran):
    """A square that flies up, damped by its mass where that is said; its energy is m v^2 / 2 whatever mass moves."""
    how = ran.case.dynamics
    nodes, alpha, damping = MASSLESS[how.massless]
    inertia = Problem.of(ran.case, ran.mesh).inertia
    assert inertia.massless.nodes.sum() == nodes
    start = 0.5 if how.massless == "none" else 0.0
    beta, gamma, count = (1 + alpha) ** 2 / 4, 0.5 + alpha, round((1 - start) / 0.25)
    u, v = newmark(0.5, 0.0, damping, count=count, alpha=alpha, beta=beta, gamma=gamma)
    x = ran.solid().points
    np.testing.assert_allclose(ran.solid().node_data["displacement"][x[:, 1] > 1.05, 1], u, rtol=1e-5)
    assert ran.steps[-1]["energies"]["kinetic"] == pytest.approx(v**2, rel=1e-5)
    assert (inertia.plain.nnz == inertia.plain.shape[0]) == (how.massless == "slave")  # which is lumped


ANSWERS: dict[str, Callable[[Ran], None]] = {
    "loads": check_loads,
    "tightened": check_tightened,
    "late": check_late,
    "equated": check_equated,
    "axes": check_axes,
    "coupled": check_coupled,
    **{f"sector {hexa}": partial(check_sector, cut=hexa) for hexa in ("pyramid", "hexa", "auto")},
    "sector stars": partial(check_sector, cut="stars"),
    "thrown": check_thrown,
    **{f"massless {name}": check_falling for name in MASSLESS},
    "saint venant": partial(check_press, law="saint_venant_kirchhoff", follower=True),
    "neo-hookean": partial(check_press, law="neo_hookean", follower=True),
    "press 1": partial(check_press, law="neo_hookean", current=True),
    "press 2": partial(check_press, law="saint_venant_kirchhoff", follower=True),
    "press 3": partial(check_press, law="neo_hookean", current=True),
    "press 4": partial(check_press, law="saint_venant_kirchhoff", current=True),
    "fields": check_fields,
    "springs": check_springs,
    "linked": check_linked,
    "rigid": check_rigid,
    "searched": check_searched,
    "rubbed": check_rubbed,
    **dict.fromkeys(("dragged", "dragged, smooth", "dragged in space"), check_dragged),
    "sunk": check_sunk,
    "chosen": check_chosen,
    "tied chosen": check_chosen,
    "glued": check_glued,
    "strain": check_strain,
    "yielding": check_yielding,
    "damped": check_damped,
    "thick": check_thick,
    "adjusted": partial(check_soft, overlap=0.01 * 2 * 0.91 / 1000),
    "soft linear": partial(check_soft, overlap=2.0 / 400),
    "soft exponential": partial(check_soft, overlap=_of_exponential()),
    "soft table": partial(check_soft, overlap=0.005),
    "round": check_round,
    "measured": check_measured,
    "slid": check_slid,
    "smooth": check_smooth,
    "by the master": check_by_the_master,
    "by the slave": check_creased,
    "creased": check_creased,
    "tied faces": check_tied,
    "tied creased": check_tied,
    "tolerant": check_tolerant,
    "symmetric": check_symmetric,
    "consistent": check_consistent,
    "halved": check_halved,
    "given up": check_given_up,
    # 34 hexahedra, of which 13 are behind slaves: 4 pyramids are cut off, or 5 hexahedra, and what is left stays one
    "pyramid": lambda ran: check_tower(ran, 34 + 13 * 4),
    "hexa": lambda ran: check_tower(ran, 34 + 13 * 5),
    "stars": lambda ran: check_tower(ran, 34),
    "auto": lambda ran: check_tower(ran, 34 + 13 * 5),
}
