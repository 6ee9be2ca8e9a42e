"""Forces, gaps and their derivatives of whole problems, as Newton's method meets them, against central differences.

Where slave faces are straight and have their own normals, or one master face is in front of all, all of it is exact, to
what the differences are good for; elsewhere, see `test_tangent`, the contact part is off by as much as gaps are open.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from lacsolver.equilibrium.load_step import _NEAR, LoadStep
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.stepping import march
from lacsolver.saddle.stiffness import FactorCache
from tests.lacsolver.contact_cases import JOINT, held
from tests.lacsolver.finite_cases import YOUNG, problem_of, waves
from tests.samples import each_option

#: the skins of these bodies are waves of a few faces
pytestmark = pytest.mark.filterwarnings("ignore:contact 'slave'. .* its curvature changes within few faces")

#: of a central difference, and what it is good for
STEP, EXACT = 1e-6, 1e-7
#: displacements, where cells are a fifth to a third of 1
SIZE = 4e-3


class Moved:
    """A problem at a random displacement, under random pressures."""

    def __init__(self, mesh, sections, *, t=1.0, size=SIZE, **options):
        self.model = ReducedProblem(problem_of(mesh, sections, **options))
        self.now, self.rng = LoadStep(self.model, t), np.random.default_rng(0)
        self.q = size * self.direction()
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


def ground(dim, **values):
    """The lower block's bottom is held."""
    return held("bottom", **{f"u{a}": 0.0 for a in "xyz"[:dim]}, **values)


FOLLOWER = '[[pressure]]\ngroup = "x0"\nvalue = "50 * (1 + y)"\nfollower = true\n'
MODELS = ("plane_strain", "plane_stress", "axisymmetric", "3d")
LAWS = ("saint_venant_kirchhoff", "neo_hookean")
MEASURES = ("reference", "current")
PAIRS = {2: ("QUAD4", "TRIA3"), 3: ("HEXA8", "PENTA6 triangle")}


def on_top(dim):
    """The upper block's top is held where it is moved to, but for one component."""
    return held("top", **{f"u{a}": v for a, v in zip("xyz"[: dim - 1], (0.002, -0.001), strict=False)})


def dimension(model):
    return 3 if model == "3d" else 2


def joint(measure="reference", normals="facet"):
    return JOINT + f'measure = "{measure}"\nnormals = "{normals}"\nsearch_distance = 0.6\n'


@pytest.mark.parametrize("model, law, measure", each_option(itertools.product(MODELS, LAWS, MEASURES)))
def test_every_model_and_law(model, law, measure):
    """Straight slave faces with their own normals in front of many: gaps are open by a tenth of the block."""
    dim = dimension(model)
    mesh = waves(*PAIRS[dim], dim, gap=0.1)
    sections = joint(measure) + ground(dim) + on_top(dim) + FOLLOWER
    made = Moved(mesh, sections, model=model, law=law)
    assert made.errors().max() <= EXACT


@pytest.mark.parametrize("model", MODELS)
def test_a_body_that_only_contact_holds(model):
    """The stabilisation of the factor of K is no part of the tangent."""
    dim = dimension(model)
    made = Moved(waves(*PAIRS[dim], dim, gap=0.1), joint() + ground(dim) + FOLLOWER, model=model)
    assert made.there.free.shape[1] == {"3d": 6, "axisymmetric": 1}.get(model, 3)
    assert (made.model.stabilization.springs is None) == (model == "axisymmetric") and made.errors().max() <= EXACT


@pytest.mark.filterwarnings("ignore:poisson = 0.49 makes PYRAM5 far too stiff")
@pytest.mark.parametrize("model", MODELS[:1] + MODELS[2:])
def test_mean_dilatation(model):
    """Nearly incompressible, where linear cells take the volume's mean."""
    dim, kind = dimension(model), "HEXA8" if model == "3d" else "QUAD4"
    mesh = waves(kind, kind, dim, gap=0.05, counts=(2, 1))
    made = Moved(mesh, joint("current") + ground(dim) + on_top(dim), model=model, poisson=0.49)
    (law,) = made.model.problem.materials.laws
    assert law.mean_dilatation and made.errors().max() <= EXACT


BODIES = {
    "2d, free": (2, "fx = 30.0\nfy = -40.0\nmoment = 25.0\n"),
    "2d, free to turn": (2, "uy = -0.02\nmoment = 25.0\n"),
    "2d, prescribed": (2, "uy = -0.02\nrotation = 0.05\n"),
    "3d, free": (3, "fx = 30.0\nfy = -40.0\nfz = -70.0\nmoment = [15.0, -20.0, 30.0]\n"),
    "3d, free to turn": (3, "uz = -0.02\nmoment = [15.0, -20.0, 30.0]\n"),
    "3d, prescribed": (3, "fz = -20.0\nrotation = [0.03, -0.05, 0.04]\n"),
}


@pytest.mark.parametrize("name, measure", each_option(itertools.product(BODIES, MEASURES)))
def test_rigid_masters(name, measure):
    """Turned by 0.2 or so already where they are free to."""
    dim, body = BODIES[name]
    mesh = waves(*PAIRS[dim], dim, gap=0.1)
    sections = joint(measure) + ground(dim) + f'[[rigid]]\ngroup = "upper"\n{body}'
    made = Moved(mesh, sections, model="3d" if dim == 3 else "plane_strain")
    (rigid,) = made.model.problem.constraints.rigid
    turns = np.asarray(rigid.columns)[dim:][rigid.free[dim:]]
    assert len(turns) == (0 if "prescribed" in name else 2 * dim - 3)
    made.q[turns] = [0.1, -0.06, 0.2][: len(turns)]
    made.there = made.now.linearize(made.q)
    assert made.now.interfaces(made.q)[0].coverage.min() > 1 - 1e-9 and made.errors().max() <= EXACT


@pytest.mark.parametrize("model", MODELS)
def test_warm_bodies_on_springs(model):
    """Temperature is in the law; springs pull where nodes were."""
    dim = dimension(model)
    warm = (
        '[[temperature]]\ngroups = ["upper"]\nvalue = "80 * t * (1 + 0.3 * x)"\n[[spring]]\ngroup = "x1"\nky = 300.0\n'
    )
    made = Moved(
        waves(*PAIRS[dim], dim, gap=0.1),
        joint() + ground(dim) + on_top(dim) + warm,
        model=model,
        more="expansion = 1e-3\n",
    )
    cold = made.model.problem.kinematics.internal_force(made.now.u(made.q), 0.0)
    hot = made.model.problem.kinematics.internal_force(made.now.u(made.q), 1.0)
    assert np.abs(hot - cold).max() > 0.1 * np.abs(hot).max() and made.errors().max() <= EXACT


SHAPES = [(2, "QUAD8", "TRIA6"), (3, "TETRA10", "HEXA8"), (3, "HEXA8", "HEXA20")]


@pytest.mark.parametrize(
    "shapes, normals, measure", each_option(itertools.product(SHAPES, ("facet", "smoothed"), MEASURES))
)
def test_faces_of_any_shape_in_front_of_one(shapes, normals, measure):
    dim, slave, master = shapes
    mesh = waves(slave, master, dim, gap=0.1, counts=(2, 1))
    made = Moved(mesh, joint(measure, normals) + ground(dim) + on_top(dim), model="3d" if dim == 3 else "plane_strain")
    assert made.errors().max() <= EXACT


@pytest.mark.parametrize(
    "kinds, measure", each_option(itertools.product([("QUAD8", "QUAD4", 2), ("TETRA4", "HEXA8", 3)], MEASURES))
)
def test_what_smoothed_normals_leave_out_goes_with_the_gap(kinds, measure):
    """In front of many faces: 2e-3 of the largest entry at a gap of 0.1 of a block, 1e-6 at a tenth of that."""
    dim = kinds[2]
    worst = []
    for gap in (0.1, 0.01):
        mesh = waves(*kinds, gap=gap, size=0.2 * gap)
        sections = joint(measure, "smoothed") + ground(dim) + on_top(dim)
        made = Moved(mesh, sections, model="3d" if dim == 3 else "plane_strain", size=0.02 * gap)
        worst.append(made.errors())
    assert (worst[0] <= 2e-3).all() and (worst[1] <= 1e-6).all()


# ---- foreseen from another displacement


FORESEEN = {
    "prescribed displacement": (2, held("top", ux="0.3 * t", uy="-0.2 * t")),
    "prescribed rotation": (2, '[[rigid]]\ngroup = "upper"\nrotation = "0.1 * t"\nuy = "-0.1 * t"\n'),
    "free and prescribed": (3, '[[rigid]]\ngroup = "upper"\nmoment = [1.0, 0, 2.0]\nuz = "-0.1 * t"\n'),
    "dead load": (3, held("top", ux="0.3 * t", uy=0.0) + '[[traction]]\ngroup = "top"\ntz = "-5 * t"\n'),
    "follower": (2, held("top", ux="0.3 * t", uy="-0.2 * t") + FOLLOWER),
    "temperature": (2, held("top", ux="0.3 * t") + '[[temperature]]\nvalue = "40 * t"\n'),
}


@pytest.mark.parametrize("name", FORESEEN)
def test_what_is_foreseen_is_the_first_order_of_what_comes(name):
    """From 10 times nearer, 100 times better; from where it is, the same."""
    dim, sections = FORESEEN[name]
    more = "expansion = 1e-3\n" if name == "temperature" else ""
    mesh = waves(*PAIRS[dim], dim, gap=0.1)
    made = Moved(mesh, joint("current") + ground(dim) + sections, model="3d" if dim == 3 else "plane_strain", more=more)
    wanted, G = made.forces(made.q)
    off = []
    for ahead in (1e-2, 1e-3, 0.0):
        u = LoadStep(made.model, 1.0 - ahead).u(made.q)
        seen = made.now.predictor(made.q, u, made.p)
        forces = seen.r - seen.contact.rows.B_T @ made.p
        off.append(
            (np.abs(forces - wanted).max() / np.abs(wanted).max(), np.abs(seen.contact.G - G).max() / np.abs(G).max())
        )
    for far, near, same in zip(*off, strict=True):
        assert same <= 1e-14 and far <= 1e-2 and near <= max(far / 50, 1e-12)


def test_a_factor_serves_as_long_as_the_tangent_is_near_it():
    """The change is all that K lacks; far from it, with damping, and in the next step, there is a new factor."""
    mesh, sections = waves(*PAIRS[3], 3, gap=0.1), joint() + ground(3) + held("top", ux=0.01, uy=0.0, uz=-0.05)
    first = Moved(mesh, sections)
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


def test_no_earlier_factor_serves_where_only_contact_holds_a_body():
    """Entries of the stiffness say little of motions of so little energy."""
    first = Moved(waves(*PAIRS[3], 3, gap=0.1), joint() + ground(3) + on_top(3))
    K = first.there.stiffness(0.0, True)
    assert first.now.linearize(1.001 * first.q).stiffness(0.0, True) is not K


def test_steps_have_fewer_factors_than_iterations_and_the_same_end(monkeypatch):
    mesh = waves(*PAIRS[3], 3)
    sections = joint() + ground(3) + held("top", ux=0.01, uy=0.0, uz=-0.05) + "[steps]\ncount = 2\n"
    factorise, count, ends = FactorCache.factorise, [], {}
    monkeypatch.setattr(FactorCache, "factorise", lambda *a, **k: count.append(1) or factorise(*a, **k))
    for largest in (-1.0, _NEAR):  # a new one in each iteration, and as few as there are
        monkeypatch.setattr("lacsolver.equilibrium.load_step._NEAR", largest)
        count.clear()
        states = list(march(problem_of(mesh, sections)))
        ends[largest] = len(count), sum(state.iterations for state in states), states[-1].u
    (every, iterations, u), (few, others, v) = ends.values()
    assert others == iterations < every and few <= every / 2
    np.testing.assert_allclose(v, u, rtol=0, atol=1e-10 * np.abs(u).max())
