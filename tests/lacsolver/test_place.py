"""Forces, gaps and their derivatives of whole problems, as Newton's method meets them, against central differences.

Where slave faces are straight and have their own normals, or one master face is in front of all, all of it is exact, to
what the differences are good for; elsewhere, see `test_tangent`, the contact part is off by as much as gaps are open.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.reduced import ReducedProblem
from tests.lacsolver.contact_cases import JOINT, held
from tests.lacsolver.finite_cases import YOUNG, problem_of, waves
from tests.samples import each_option

#: the skins of these bodies are waves of a few faces
pytestmark = pytest.mark.filterwarnings("ignore:contact 'slave'. .* its curvature changes within few faces")

#: of a central difference, and what it is good for
STEP, EXACT = 1e-6, 1e-7


class Moved:
    """A problem at a random displacement, under random pressures."""

    def __init__(self, mesh, sections, *, t=1.0, **options):
        self.model = ReducedProblem(problem_of(mesh, sections, **options))
        self.now, self.rng = LoadStep(self.model, t), np.random.default_rng(0)
        self.q = 4e-3 * self.direction()  # where cells are a fifth to a third of 1
        self.there = self.now.linearize(self.q)
        contact = self.there.contact
        assert all(face.coverage.min() > 1 - 1e-9 for face in self.now.interfaces(self.q)), "nothing at the rim"
        self.p = np.where(contact.enforceable, 0.02 * YOUNG * self.rng.uniform(0.5, 1.5, len(contact.G)), 0.0)

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


FOLLOWER = '[[pressure]]\ngroup = "x0"\nvalue = "50 * (1 + y)"\nfollower = true\n'
WARM = '[[temperature]]\ngroups = ["upper"]\nvalue = "80 * t * (1 + 0.3 * x)"\n[[spring]]\ngroup = "x1"\nky = 300.0\n'
MODELS = ("plane_strain", "plane_stress", "axisymmetric", "3d")
LAWS = ("saint_venant_kirchhoff", "neo_hookean")
MEASURES = ("reference", "current")
OF = {2: "plane_strain", 3: "3d"}
PAIRS = {2: ("QUAD4", "TRIA3"), 3: ("HEXA8", "PENTA6 triangle")}
BODIES = {
    "2d, free": (2, "fx = 30.0\nfy = -40.0\nmoment = 25.0\n"),
    "2d, free to turn": (2, "uy = -0.02\nmoment = 25.0\n"),
    "2d, prescribed": (2, "uy = -0.02\nrotation = 0.05\n"),
    "3d, free": (3, "fx = 30.0\nfy = -40.0\nfz = -70.0\nmoment = [15.0, -20.0, 30.0]\n"),
    "3d, free to turn": (3, "uz = -0.02\nmoment = [15.0, -20.0, 30.0]\n"),
    "3d, prescribed": (3, "fz = -20.0\nrotation = [0.03, -0.05, 0.04]\n"),
}


def on_top(dim):
    """The upper block's top is held where it is moved to, but for one component."""
    return held("top", **{f"u{a}": v for a, v in zip("xyz"[: dim - 1], (0.002, -0.001), strict=False)})


def made(model, sections, measure="reference", normals="facet", pair=None, gap=0.1, counts=(3, 4), **options):
    """A problem of two blocks that wave; the lower one's bottom is held. Gaps are open by a tenth of the block."""
    dim = 3 if model == "3d" else 2
    joint = JOINT + f'measure = "{measure}"\nnormals = "{normals}"\nsearch_distance = 0.6\n'
    mesh = waves(*(pair or PAIRS[dim]), dim, gap=gap, counts=counts)
    ground = held("bottom", **{f"u{a}": 0.0 for a in "xyz"[:dim]})
    return Moved(mesh, joint + ground + sections, model=model, **options)


@pytest.mark.parametrize("model, law, measure", each_option(itertools.product(MODELS, LAWS, MEASURES)))
def test_every_model_and_law(model, law, measure):
    """Straight slave faces with their own normals in front of many."""
    own = made(model, on_top(3 if model == "3d" else 2) + FOLLOWER, measure, law=law)
    assert own.errors().max() <= EXACT


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
    own = made(OF[dim], f'[[rigid]]\ngroup = "upper"\n{body}', measure)
    (rigid,) = own.model.problem.constraints.rigid
    turns = np.asarray(rigid.columns)[dim:][rigid.free[dim:]]
    assert len(turns) == (0 if "prescribed" in name else 2 * dim - 3)
    own.q[turns] = [0.1, -0.06, 0.2][: len(turns)]
    own.there = own.now.linearize(own.q)
    assert own.now.interfaces(own.q)[0].coverage.min() > 1 - 1e-9 and own.errors().max() <= EXACT


@pytest.mark.parametrize("model", MODELS)
def test_warm_bodies_on_springs(model):
    """Temperature is in the law; springs pull where nodes were."""
    own = made(model, on_top(3 if model == "3d" else 2) + WARM, more="expansion = 1e-3\n")
    cold, hot = (own.model.problem.kinematics.internal_force(own.now.u(own.q), t) for t in (0.0, 1.0))
    assert np.abs(hot - cold).max() > 0.1 * np.abs(hot).max() and own.errors().max() <= EXACT


SHAPES = [(2, "QUAD8", "TRIA6"), (3, "TETRA10", "HEXA8"), (3, "HEXA8", "HEXA20")]


@pytest.mark.parametrize(
    "shapes, normals, measure", each_option(itertools.product(SHAPES, ("facet", "smoothed"), MEASURES))
)
def test_faces_of_any_shape_in_front_of_one(shapes, normals, measure):
    dim, *pair = shapes
    own = made(OF[dim], on_top(dim), measure, normals, pair=pair, counts=(2, 1))
    assert own.errors().max() <= EXACT


# ---- foreseen from another displacement

FORESEEN = {
    "prescribed displacement": (2, held("top", ux="0.3 * t", uy="-0.2 * t")),
    "prescribed rotation": (2, '[[rigid]]\ngroup = "upper"\nrotation = "0.1 * t"\nuy = "-0.1 * t"\n'),
    "free and prescribed": (3, '[[rigid]]\ngroup = "upper"\nmoment = [1.0, 0, 2.0]\nuz = "-0.1 * t"\n'),
    "dead load": (3, held("top", ux="0.3 * t", uy=0.0) + '[[traction]]\ngroup = "top"\ntz = "-5 * t"\n'),
    "follower": (2, held("top", ux="0.3 * t", uy="-0.2 * t") + FOLLOWER),
    "temperature": (2, held("top", ux="0.3 * t") + '[[temperature]]\nvalue = "40 * t"\n'),
}


@pytest.mark.rows("prescribed rotation", "temperature")
@pytest.mark.parametrize("name", FORESEEN)
def test_what_is_foreseen_is_the_first_order_of_what_comes(name):
    """From 10 times nearer, 100 times better; from where it is, the same."""
    dim, sections = FORESEEN[name]
    own = made(OF[dim], sections, "current", more="expansion = 1e-3\n" if name == "temperature" else "")
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
    first = made("3d", held("top", ux=0.01, uy=0.0, uz=-0.05))
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
