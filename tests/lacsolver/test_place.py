"""Forces, gaps and their derivatives of bodies that contact alone holds or that are rigid; a step as it is foreseen.

Derivatives of all other problems are a law of the corpus (`test_laws.py`).

Where slave faces are straight and have their own normals, or one master face is in front of all, all of it is exact, to
what the differences are good for; elsewhere, see `test_tangent`, the contact part is off by as much as gaps are open.
"""

import itertools

import numpy as np
import pytest

from lacsolver.case import Material, Pressure, Rigid, Solver, Temperature, Traction
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.problem.problem import Problem
from tests.lacsolver.patch_meshes import waves
from tests.problems import case_of, contact, fix, move
from tests.samples import each_option

#: the skins of these bodies are waves of a few faces
pytestmark = pytest.mark.filterwarnings("ignore:contact 'slave'. .* its curvature changes within few faces")

#: of a central difference, and what it is good for
STEP, EXACT = 1e-6, 1e-7


class Moved:
    """A problem at a random displacement, under random pressures."""

    def __init__(self, case):
        self.model = ReducedProblem(Problem.of(case))
        self.now, self.rng = LoadStep(self.model, 1.0), np.random.default_rng(0)
        self.q = 4e-3 * self.direction()  # where cells are a fifth to a third of 1
        self.there = self.now.linearize(self.q)
        contact = self.there.contact
        assert all(face.coverage.min() > 1 - 1e-9 for face in self.now.interfaces(self.q)), "nothing at the rim"
        self.p = np.where(contact.enforceable, 0.02 * 1000.0 * self.rng.uniform(0.5, 1.5, len(contact.G)), 0.0)

    def direction(self):
        return self.rng.uniform(-1, 1, self.model.problem.constraints.n_q)

    def forces(self, q):
        """r - B^T p, and G, at q."""
        there = self.now.linearize(q)
        return there.r - there.contact.rows.B_T @ self.p, there.contact.G

    @property
    def tangent(self):
        """K + C(p)."""
        turning = self.there.geometric_stiffness(self.p)
        K = self.there.stiffness(0.0, True).K
        return K if turning is None else K + turning

    def errors(self):
        """In a random direction, which moves all: the errors of forces' and gaps' derivatives, each of its largest."""
        v = self.direction()
        up, down = self.forces(self.q + STEP * v), self.forces(self.q - STEP * v)
        made = -(self.tangent @ v), -(self.there.contact.rows.D @ v)
        found = [(b - a) / (2 * STEP) for a, b in zip(down, up, strict=True)]
        return np.array([np.abs(f - m).max() / np.abs(m).max() for f, m in zip(found, made, strict=True)])


FOLLOWER = Pressure(group="x0", value="50 * (1 + y)", follower=True)
MODELS = ("plane_strain", "plane_stress", "axisymmetric", "3d")
MEASURES = ("reference", "current")
OF = {2: "plane_strain", 3: "3d"}
PAIRS = {2: ("QUAD4", "TRIA3"), 3: ("HEXA8", "PENTA6 triangle")}
BODIES = {
    "2d, free": (2, {"fx": 30.0, "fy": -40.0, "moment": 25.0}),
    "2d, free to turn": (2, {"uy": -0.02, "moment": 25.0}),
    "2d, prescribed": (2, {"uy": -0.02, "rotation": 0.05}),
    "3d, free": (3, {"fx": 30.0, "fy": -40.0, "fz": -70.0, "moment": [15.0, -20.0, 30.0]}),
    "3d, free to turn": (3, {"uz": -0.02, "moment": [15.0, -20.0, 30.0]}),
    "3d, prescribed": (3, {"fz": -20.0, "rotation": [0.03, -0.05, 0.04]}),
}


def on_top(dim):
    """The upper block's top is held where it is moved to, but for one component."""
    return move("top", **dict(zip(("ux", "uy")[: dim - 1], (0.002, -0.001), strict=False)))


def made(model, *records, measure="reference", **keys):
    """A problem of two blocks that wave; the lower one's bottom is held. Gaps are open by a tenth of the block.

    `keys`: of the material.
    """
    dim = 3 if model == "3d" else 2
    mesh, joint = waves(*PAIRS[dim], dim, gap=0.1), contact(measure=measure, search_distance=0.6)
    material = Material(law="neo_hookean", young=1000.0, poisson=0.3, **keys)
    held = fix("bottom", "xyz"[:dim]), Solver(threads=1, tolerance=1e-11)
    return Moved(case_of(mesh, material, joint, *held, *records, model=model, kinematics="finite"))


@pytest.mark.parametrize("model", MODELS)
def test_a_body_that_only_contact_holds(model):
    """The stabilisation of the factor of K is no part of the tangent, and entries of K say little of such motions."""
    own = made(model, FOLLOWER)
    assert own.there.free.shape[1] == {"3d": 6, "axisymmetric": 1}.get(model, 3)
    assert (own.model.stabilization.springs is None) == (model == "axisymmetric") and own.errors().max() <= EXACT


@pytest.mark.rows("2d, prescribed-reference", "3d, free-current")
@pytest.mark.parametrize("name, measure", each_option(itertools.product(BODIES, MEASURES)))
def test_rigid_masters(name, measure):
    """Turned by 0.2 or so already where they are free to."""
    dim, body = BODIES[name]
    own = made(OF[dim], Rigid(group="upper", **body), measure=measure)
    (rigid,) = own.model.problem.constraints.rigid
    turns = np.asarray(rigid.columns)[dim:][rigid.free[dim:]]
    assert len(turns) == (0 if "prescribed" in name else 2 * dim - 3)
    own.q[turns] = [0.1, -0.06, 0.2][: len(turns)]
    own.there = own.now.linearize(own.q)
    assert own.now.interfaces(own.q)[0].coverage.min() > 1 - 1e-9 and own.errors().max() <= EXACT


# ---- foreseen from another displacement

FORESEEN = {
    "prescribed displacement": (2, [move("top", ux="0.3 * t", uy="-0.2 * t")]),
    "prescribed rotation": (2, [Rigid(group="upper", rotation="0.1 * t", uy="-0.1 * t")]),
    "free and prescribed": (3, [Rigid(group="upper", moment=[1.0, 0, 2.0], uz="-0.1 * t")]),
    "dead load": (3, [move("top", ux="0.3 * t", uy=0.0), Traction(group="top", tz="-5 * t")]),
    "follower": (2, [move("top", ux="0.3 * t", uy="-0.2 * t"), FOLLOWER]),
    "temperature": (2, [move("top", ux="0.3 * t"), Temperature(value="40 * t")]),
}


@pytest.mark.rows("prescribed rotation", "temperature")
@pytest.mark.parametrize("name", FORESEEN)
def test_what_is_foreseen_is_the_first_order_of_what_comes(name):
    """From 10 times nearer, 100 times better; from where it is, the same."""
    dim, records = FORESEEN[name]
    own = made(OF[dim], *records, measure="current", expansion=1e-3 if name == "temperature" else 0.0)
    wanted, G = own.forces(own.q)
    off = []
    for ahead in (1e-2, 1e-3, 0.0):
        seen = own.now.predictor(own.q, LoadStep(own.model, 1.0 - ahead).u(own.q), own.p)
        forces = seen.r - seen.contact.rows.B_T @ own.p
        pairs = (forces, wanted), (seen.contact.G, G)
        off.append([np.abs(one - other).max() / np.abs(other).max() for one, other in pairs])
    for far, near, same in zip(*off, strict=True):
        assert same <= 1e-14 and far <= 1e-2 and near <= max(far / 50, 1e-12)


def test_a_factor_serves_as_long_as_the_tangent_is_near_it():
    """The change is all that K lacks; far from it, with damping, and in the next step, there is a new factor.

    So is it where only contact holds a body: entries of the stiffness say little of motions of so little energy.
    """
    first = made("3d", move("top", ux=0.01, uy=0.0, uz=-0.05))
    K = first.there.stiffness(0.0, True)
    near, far = (first.now.linearize(factor * first.q) for factor in (1.1, 8.0))
    alone = LoadStep(first.model, 1.0).linearize(1.1 * first.q).stiffness(0.0, True)
    assert near.stiffness(0.0, True) is K and first.there.change(K) is None and alone is not K
    change = near.change(K)
    assert 1e-4 * abs(K.K).max() < abs(change).max()
    assert abs(K.K + change - alone.K).max() <= 1e-14 * abs(K.K).max()
    for other, how in ((near, (1.0, True)), (near, (0.0, False)), (far, (0.0, True))):
        new = other.stiffness(*how)
        assert new is not K and other.change(new) is None
    loose = made("3d", on_top(3))
    assert loose.now.linearize(1.001 * loose.q).stiffness(0.0, True) is not loose.there.stiffness(0.0, True)
