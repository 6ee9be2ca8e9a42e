"""The derivatives of contact forces and gaps, against central differences of the interface as it is paired anew.

Where slave faces are straight and have their own normals the integrals are exact, and so are their derivatives: 1e-8,
which is what the differences are good for. So they are, whatever the faces and normals, in front of one master face. In
front of several pieces move, and rules with a few points leave their derivatives off by what they are themselves: 1e-4,
and 1e-2 on lines that curve, whose 4 points feel it most."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from lacmesh.cells import CELLS
from lacmesh.surface import points
from lacmesh.surface.maps import N_HEIGHTS, QUADRATIC, Height
from lacmesh.surface.normals import normals_of, unit
from lacmesh.surface.place import AROUND, FAN30, FITTED
from lacsolver.contact import Pairing, integrate
from lacsolver.contact.faces import tangents
from lacsolver.contact.tangent import gap_derivative, motion_of, tangent
from tests.lacsolver.test_interface import MEASURES, NORMALS, rigid_motions, wavy, zone_of
from tests.samples import each_option
from verification.meshes.blocks import bent, block, joined, nodes_of

#: of a central difference
STEP, EXACT = 1e-6, 1e-8
#: (slave, master, dimension): straight faces, and faces of any shape
STRAIGHT = [("QUAD4", "TRIA3", 2), ("TRIA3", "QUAD4", 2), ("TETRA4", "TETRA4", 3), ("HEXA8", "PENTA6 triangle", 3)]
ANY = [("QUAD4", "QUAD4", 2), ("QUAD8", "TRIA6", 2), ("TETRA4", "HEXA8", 3), ("TETRA10", "HEXA20", 3)]


def options_of(row):
    """The pair of a row, and each of its options with the dimension."""
    pair, options = row
    return [pair, *((pair[2], *option) for option in options.items())]


def raised(surface):
    """A surface whose linear faces stand for one that is off them by a few thousandths, one number at each edge."""
    value = np.zeros((len(surface), N_HEIGHTS))
    for name, rows, nodes in surface.by_type():
        if name not in QUADRATIC:
            continue
        count = CELLS[name].n_corners
        edges = CELLS[name].edges if surface.dim == 2 else ((0, 1),)
        middles = [surface.x[nodes[:, list(edge)]].mean(axis=1) for edge in edges]
        middles += [surface.x[nodes].mean(axis=1)] if name == "QUAD4" else []
        value[rows, count : count + len(middles)] = 0.004 * np.sin(9 * np.sum(middles, axis=2)).T
        if count < 4:  # cubics, whose factors change their sign with the direction of an edge
            ends = 0.002 * np.sin(7 * surface.x[nodes].sum(axis=2))
            cubics = count + len(middles) + np.arange(len(edges))
            value[rows[:, None], cubics] = np.diff(ends[:, np.array(edges)], axis=2)[:, :, 0]
    return replace(surface, height=Height(surface.faces.type, value))


class Deformed:
    """A zone whose skins are moved at random, and what it is there; `smooth`: with heights at random.

    `surface`: of the zone; where it is not `faces` it has the heights of its waves.

    With friction among the options its forces are those of pressures and of tractions.
    """

    def __init__(
        self, slave, master, dim, options, *, gap=0.1, counts=(3, 4), size=4e-3, margin=0.15, smooth=False,
        surface="smooth",
    ):  # fmt: skip
        mesh, zone = wavy(slave, master, dim, gap=gap, counts=counts, margin=margin, surface=surface)
        if smooth:
            zone = replace(zone, slave=raised(zone.slave), master=raised(zone.master))
        self.zone, self.dim, self.pairing = zone, dim, Pairing(search_distance=0.6, **options)
        faces = [surface.faces.nodes for surface in (zone.slave, zone.master)]
        self.nodes = np.unique(np.concatenate([nodes[nodes >= 0] for nodes in faces]))
        self.rng = np.random.default_rng(0)
        self.shape = mesh.points.shape
        self.x = mesh.points + size * self.direction()
        self.face = self.at(0)
        assert (self.face.coverage.min() > 1 - 1e-9) == (margin > 0)
        self.p = self.rng.uniform(0.5, 1.5, zone.n_macros)
        self.t = self.rng.uniform(-1, 1, zone.n_macros * (dim - 1)) if self.pairing.friction else None
        face = self.face
        motion = motion_of(face, face.slave, face.master, self.pairing, dim)
        self.K, self.D = tangent(motion, self.p, self.t), gap_derivative(motion)

    def direction(self):
        """(n_nodes, 3): each node of the skins moves by up to 1 each way."""
        v = np.zeros(self.shape)
        v[self.nodes, : self.dim] = self.rng.uniform(-1, 1, (len(self.nodes), self.dim))
        return v

    def at(self, v):
        return integrate(self.zone, self.dim, self.pairing, x=self.x + v)

    def forces(self, face):
        """Return the forces of the pressures, and of the tractions, of an interface."""
        return face.B.T @ self.p + (0 if self.t is None else face.B_T.T @ self.t)

    def errors(self):
        """In a random direction, which moves all: of the forces' derivative and the gaps', each of its largest."""
        v = self.direction()
        a, b = self.at(STEP * v), self.at(-STEP * v)
        u = v[:, : self.dim].ravel()
        pairs = [(self.forces(a) - self.forces(b), self.K @ u), (b.G - a.G, self.D @ u)]
        return np.array([np.abs(d / (2 * STEP) - made).max() / np.abs(made).max() for d, made in pairs])


def rows(pairs, normals=NORMALS, **how):
    """Options of each pair: measure and normals, in a plane about an axis too; a few in `make test`; and `how`."""
    options = [
        (pair, {"measure": m, "normals": n, "axisymmetric": a})
        for pair, m, n, a in itertools.product(pairs, MEASURES, normals, (False, True))
        if not (a and pair[2] == 3)
    ]
    return [pytest.param(*row.values, how, marks=row.marks) for row in each_option(options, of=options_of)]


def within(pair, options, how):
    """The error that is allowed, and what else is given."""
    how = dict(how)
    size = how.pop("within", EXACT)
    if how.pop("several", False):
        how["counts"] = (6, 7) if pair[2] == 2 else (2, 3)
        size = 1e-2 if pair[:2] == ("QUAD8", "TRIA6") else 1e-4
    if "clearance" in how:
        options = {**options, "clearance": how.pop("clearance")}
        size = EXACT if pair[2] == 2 else 1e-5
    return size, options, how


#: of the slave, which its master's rim crosses
CLEARANCES = 0.02, lambda x, t: 0.02 + 0.3 * t * x[:, 0] ** 2
ENDS = [ANY[0], *STRAIGHT[1:]]
ROWS = [
    *rows(STRAIGHT, ("facet",), surface="faces"),
    *rows(STRAIGHT, ("facet",), within=1e-6),  # rules of a few points over normals that turn
    *rows(ANY, counts=(2, 1), smooth=True),  # in front of one master face, where no piece ends
    *rows(ANY, counts=(2, 1)),
    *rows(ANY, several=True),
    *(row for clearance in CLEARANCES for row in rows(ENDS, margin=-0.05, clearance=clearance)),
]


@pytest.mark.parametrize("pair, options, how", ROWS, ids=lambda value: str(value).split(" at 0x")[0])  # no address
def test_derivatives_of_forces_and_gaps(pair, options, how):
    """Against central differences. Faces that a rim crosses gain and lose what is there, with its clearance."""
    size, options, how = within(pair, options, how)
    assert Deformed(*pair, options, **how).errors().max() <= size


def test_derivatives_where_all_faces_meet_at_creases():
    """Each face has normals of its own there."""
    options = {"measure": "current", "normals": "smoothed", "axisymmetric": False, "crease_angle": 0.01}
    assert Deformed("QUAD8", "TRIA6", 2, options, counts=(2, 1)).errors().max() <= EXACT


@pytest.fixture
def fine_rules(monkeypatch):
    """Rules of many points, over pieces and along their edges, wherever normals turn."""
    over_faces, over_lines = points.pair_rule, points.gauss_points

    def finest(*arguments):
        code = over_faces(*arguments)
        return np.where(code % AROUND >= FITTED, code, FAN30)

    monkeypatch.setattr(points, "pair_rule", finest)
    monkeypatch.setattr(points, "gauss_points", lambda *a: np.where(over_lines(*a) == 4, 7, over_lines(*a)))
    at, weight = np.polynomial.legendre.leggauss(8)
    monkeypatch.setattr("lacsolver.contact.edges._AT", (at + 1) / 2)
    monkeypatch.setattr("lacsolver.contact.edges._WEIGHT", weight / 2)


@pytest.mark.parametrize("pair, options, _", rows(STRAIGHT, ("facet",)), ids=str)
@pytest.mark.parametrize("smooth", [False, True])
def test_heights_over_straight_faces(pair, options, _, smooth, fine_rules):
    """Derivatives with heights, whose normals turn over a face, are as exact as without where rules are."""
    made = Deformed(*pair, options, smooth=smooth)
    of = made.face.points
    assert np.ptp(of.gap - of.ray) > 0.005
    faces = unit(normals_of(tangents(made.face.slave, of.slave, of.xi_slave)))
    assert (of.normal * faces).sum(axis=1).min() < 0.9995
    assert made.errors().max() <= EXACT


@pytest.mark.parametrize("pair, options, _", rows(ANY), ids=str)
def test_moving_both_skins_changes_no_gap_and_turns_forces(pair, options, _):
    """Whatever the faces: a rotation by theta turns forces by it, a translation lets them be."""
    made = Deformed(*pair, options, counts=(2, 3))
    dim, x = pair[2], made.x
    forces = made.forces(made.face).reshape(-1, dim)
    size = np.abs(made.K).sum(axis=1).max(), np.abs(made.D).sum(axis=1).max()
    spin = [np.zeros(3)] * dim + ([np.array([0, 0, 1.0])] if dim == 2 else list(np.eye(3)))
    for k, (motion, theta) in enumerate(zip(rigid_motions(x, dim), spin, strict=True)):
        if options["axisymmetric"] and k != 1:
            continue  # about an axis, only a translation along it is a rigid motion
        turned = np.cross(theta, np.pad(forces, ((0, 0), (0, 3 - dim))))[:, :dim]
        np.testing.assert_allclose((made.K @ motion.ravel()).reshape(-1, dim), turned, atol=1e-12 * size[0])
        np.testing.assert_allclose(made.D @ motion.ravel(), 0, atol=1e-12 * size[1])


def test_a_traction_along_either_tangent_has_its_derivative_where_nothing_presses():
    """Forces are linear in tractions: the derivative with both components is the sum of those with one of them."""
    made = Deformed("TETRA4", "TETRA4", 3, {"friction": True}, counts=(2, 1))
    motion = motion_of(made.face, made.face.slave, made.face.master, made.pairing, 3)
    t, none = made.t.reshape(-1, 2), np.zeros(made.zone.n_macros)
    K, first, second = (tangent(motion, none, (t * part).ravel()) for part in ([1, 1], [1, 0], [0, 1]))
    assert min(np.abs(part).max() for part in (first, second)) > 1e-3 * np.abs(K).max()
    assert np.abs(K - first - second).max() <= 1e-14 * np.abs(K).max()


@pytest.mark.parametrize("normals", NORMALS)
def test_derivatives_are_continuous_where_an_edge_of_a_bent_master_passes_one_of_the_slave(normals):
    """There the pressure changes: with normals that differ on both sides of the edge they would jump by 0.2 of all."""
    above = block("QUAD4", (2, 1), (-1, 0), (1, 1))
    below = bent(block("QUAD4", (2, 1), (-2, -1), (2, 0)), lambda x: x - [0, 0.1, 0] * np.abs(x[:, :1]))
    parts = [(above, {"": "above", "y0": "slave"}), (below, {"": "below", "y1": "master"})]
    mesh, zone = zone_of(joined(parts), surface="faces")
    pairing = Pairing(search_distance=0.5, normals=normals, measure="current")

    def derivative(shift):
        x = mesh.points.copy()
        x[nodes_of(mesh, "slave"), 0] += shift
        face = integrate(zone, 2, pairing, x=x)
        return tangent(motion_of(face, face.slave, face.master, pairing, 2), np.array([1.0, 2.0]))

    before, after = derivative(-1e-6), derivative(1e-6)
    assert np.abs(after - before).max() <= 1e-5 * np.abs(before).max()
