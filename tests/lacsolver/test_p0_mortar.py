"""One stage of lacsolver replaced: a P0 mortar on the uncut mesh, which oscillates, against LAC, which does not.

The stages are functions between records, so that the stage that computes B, G and w can be another one. A constant
pressure on each slave face of the uncut mesh (a P0 mortar) is compared with a constant pressure on each macro-element
of the cut mesh. The pad is fixed at its flanks, so that in the solution every slave face is in contact and the boundary
of the slave is fixed: the simplest case in which pressures on faces fail (docs/theory.md).
"""

import numpy as np
import pytest

import lacmesh
from lacmesh import Surface
from lacmesh.generate import line, rectangle
from lacsolver.case import Material
from lacsolver.contact import Pairing, Zone, integrate
from lacsolver.contact.interface import positions
from lacsolver.contact.laws import Unilateral
from lacsolver.contact.rows import macro_rows
from lacsolver.equilibrium.active_set import active_set_iterates
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.search import search
from lacsolver.equilibrium.state import Iterate
from lacsolver.problem.problem import Problem
from lacsolver.saddle.contact_system import ContactSystem
from lacsolver.saddle.row_group import Rows
from lacsolver.saddle.tolerances import ConvergenceTolerance
from tests.problems import case_of, fix


def pad(n):
    """A pad of n x n/2 QUAD4 over -1 <= x <= 1, y <= 0; its upper side is the slave, one rigid segment the master."""
    body = rectangle((n, n // 2), (2, 1), corner=(-1, -1)).renamed(top="slave")
    return lacmesh.join(body, line(1, (-1, 0), (1, 0)).renamed(body="master"))


def crown(x, t):
    """Height of the punch over y = 0, negative below it; added to the gap. `x` (points, 3), t is time."""
    return -0.02 * (1 - x[:, 0] ** 2) * (1 + 0.5 * x[:, 0])


def held(mesh):
    """The pad in its frame, without any contact."""
    sides = (fix(name, "xy") for name in ("bottom", "left", "right"))
    return ReducedProblem(Problem.of(case_of(mesh, Material(young=1.0, poisson=0.3), *sides, model="plane_strain")))


def p0_mortar(mesh):
    """B (faces, n_dof), G, w (faces,): a pressure on each slave face, by the integrals of the method."""
    slave, master = (Surface.of(mesh, mesh.cells_of(name)) for name in ("slave", "master"))
    points = lacmesh.contact_points(slave, master)
    n_faces, n = len(slave), points.normal[:, :2]
    B = macro_rows(points, slave, master, points.weight[:, None] * n, n_faces)
    gap = points.gap + crown(positions(slave, points), 1.0)
    return B, np.bincount(points.macro, points.weight * gap, n_faces), np.bincount(points.macro, points.weight, n_faces)


def lac(mesh):
    """B (macro-elements, n_dof), G, w of lacsolver's own stage, on a cut mesh."""
    made = integrate(Zone.of(mesh, "slave", "master"), 2, Pairing(clearance=crown))
    return made.B, made.G, made.w


def contact(step, B, G, w):
    """Contact of a load step as a function of its unknowns q: rows of unilateral contact, and their gaps at q."""
    rows = Rows((B @ step.model.problem.constraints.T).tocsr(), w)
    undeformed = ContactSystem.of(rows, G, Unilateral(), step.reference)
    return lambda q: undeformed.with_gaps(G - rows.D @ q)


def pressures(mesh, stage):
    """Pressures (faces,) from left to right. Raises RuntimeError where no equilibrium is found."""
    step = LoadStep(held(mesh), 1.0)
    contact_at = contact(step, *stage(mesh))
    q = np.zeros(len(step.f))
    start = Iterate(q, np.zeros(len(contact_at(q).G)), contact_at(q).G < 0)
    tolerance = ConvergenceTolerance(tolerance=1e-10, max_iterations=50, length=step.model.length)
    found = search(active_set_iterates(step.reference, step.f, contact_at, start, tolerance), tolerance)
    if not found.converged:
        balance, gap = found.residuals[-1]
        raise RuntimeError(f"no equilibrium: forces are off by {balance:.0e}, gaps by {gap:.0e} of the displacement")
    return found.iterate.p


def inf_sup(mesh, stage):
    """The two smallest inf-sup constants, over all pressure fields."""
    model = held(mesh)
    B, _, w = stage(mesh)
    B = (B @ model.problem.constraints.T).toarray()
    S = B @ model.reference().solve(np.ascontiguousarray(B.T))
    return np.sqrt(np.maximum(np.linalg.eigvalsh(S / np.outer(w, w)), 0))[:2]


def uncut_and_cut(n):
    """A mesh of n faces and its cut, each with its own rows of contact."""
    mesh = pad(n)
    return (mesh, p0_mortar), (lacmesh.cut_skin(mesh, "slave").mesh, lac)


def turns(p):
    return int((np.diff(np.sign(np.diff(p))) != 0).sum())


@pytest.mark.parametrize("n", [25, 49])
def test_faces_oscillate_and_macro_elements_do_not(n):
    """Faces open at both ends; the gaps' sum with alternating signs is not zero, so not every face can be closed."""
    (mesh, mortar), cut = uncut_and_cut(n)
    p, smooth = pressures(mesh, mortar), pressures(*cut)
    assert turns(smooth) == 1 and turns(p) >= n - 3
    assert np.median(np.abs(p - smooth)[1:-1] / smooth.max()) > 0.15
    assert p.sum() == pytest.approx(smooth.sum(), rel=0.04)
    _, G, _ = mortar(mesh)
    opened = np.flatnonzero(p == 0)
    assert len(opened) == 2 and opened[0] < 3 and opened[1] > n - 4
    assert abs(G @ (-1.0) ** np.arange(n)) > 1e-5 * np.abs(G).sum()


def test_the_inf_sup_constant_is_zero_uncut_and_independent_of_the_mesh_cut():
    """The hypothesis of docs/theory.md, on meshes of 9, 25 and 49 slave faces."""
    pairs = [uncut_and_cut(n) for n in (9, 25, 49)]
    uncut, cut = (np.array([inf_sup(*pair[k]) for pair in pairs]) for k in (0, 1))
    assert uncut[:, 0].max() < 1e-6 and (uncut[1:, 1] < 0.6 * uncut[:-1, 1]).all()
    assert cut.min() > 0.57 and np.ptp(cut[:, 0]) < 0.01
    forces = []
    for mesh, stage in uncut_and_cut(25):  # the alternating pressure moves nothing on the uncut mesh
        B, _, w = stage(mesh)
        T = held(mesh).problem.constraints.T
        forces.append(np.abs(T.T @ (B.T @ (-1.0) ** np.arange(25))).max() / w.max())
    assert forces[0] < 1e-14 and forces[1] > 0.1
