"""Problems of the corpus in other units, turned or mirrored, at another place, and in another order.

world = World(length=1e-3, turn=tilt(3), shift=(5e5, 5e6, 7.0))
case = case_in(problem, world) = the problem as it is written there; `differences` compares what is found
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial import cKDTree

from lacmesh import Mesh
from lacsolver.case import Coupling, Displacement, Equation, Force, Material, Rigid, Spring
from lacsolver.case.formula import Formula
from lacsolver.case.value import Value
from tests.problems import case_of
from verification.meshes.stacks import tilt

#: exponents of length, stress and time in each dimension; a mass is stress × length × time²
DIMENSIONS = {
    "": (0, 0, 0), "1": (0, 0, 0), "length": (1, 0, 0), "stress": (0, 1, 0), "time": (0, 0, 1), "force": (2, 1, 0),
    "mass": (1, 1, 2), "temperature": (0, 0, 0), "degree": (0, 0, 0), "radian": (0, 0, 0),
}  # fmt: skip
POWERS = {"": 1, "²": 2, "³": 3}
#: keys of rows with two units; places; directions; vectors by the first letter of their components; axial vectors
PAIRS, PLACES, DIRECTIONS = {"hardening", "pressures", "rayleigh"}, {"at", "centre", "origin"}, {"axis", "normal"}
VECTORS, AXIAL = "uftvg", ("moment", "rotation")


class CannotTurnError(Exception):
    """A record has a component that it can only have along an axis of the mesh."""


@dataclass(frozen=True)
class World:
    """A place x is at length × turn x + shift there; stresses and times are so many times as large."""

    length: float = 1.0
    stress: float = 1.0
    time: float = 1.0
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    dim: int = 3

    @property
    def mirrors(self):
        """True if the turn is a reflection along an axis of the mesh."""
        return np.linalg.det(self.turn) < 0

    @property
    def turns(self):
        return not self.mirrors and not np.array_equal(self.turn, np.eye(3))

    def places(self, x):
        return self.length * x @ self.turn.T + self.shift

    def vector(self, v):
        """A place or a direction given as a list, turned."""
        return (self.turn @ np.pad(v, (0, 3 - len(v))))[: len(v)].tolist()

    def place(self, x):
        return self.places(np.pad(x, (0, 3 - len(x))))[: len(x)].tolist()

    def factor(self, unit):
        """Factor of a value whose unit is a product such as `mass / length³`."""
        total = np.zeros(3)
        above, *below = unit.split(" / ")
        for sign, words in ((1, above), *((-1, part) for part in below)):
            for word in words.split(" × "):
                name, power = re.fullmatch(r"(.*?)([²³]?)", word).groups()
                total += sign * POWERS[power] * np.array(DIMENSIONS[name])
        return float(np.prod(np.array([self.length, self.stress, self.time]) ** total))

    def formula(self, text):
        """A formula of x, y, z and t in the coordinates and the time of the world."""
        own = {"t": f"(t / {self.time!r})"}
        for k, name in enumerate("xyz"):
            parts = [
                f"{float(self.turn[j, k])!r} * ({axis} - {float(self.shift[j])!r})"
                for j, axis in enumerate("xyz")
                if self.turn[j, k]
            ]
            own[name] = f"(({' + '.join(parts)}) / {self.length!r})"
        return re.sub(r"\b[xyzt]\b", lambda m: own[m[0]], text)

    def scaled(self, value, size):
        """A value of a key times a size: numbers, tables of time, and formulas of x, y, z and t."""
        if isinstance(value, Value):
            return self.scaled(value.source, size)
        if isinstance(value, (str, Formula)):
            return f"{size!r} * ({self.formula(value if isinstance(value, str) else value.text)})"
        if isinstance(value, (tuple, list)):
            if value and isinstance(value[0], (tuple, list)):  # a table of time
                return [[t * self.time, self.scaled(v, size)] for t, v in value]
            return [self.scaled(v, size) for v in value]
        return None if value is None else value * size


def record_in(record, world):
    """A record in a world."""
    changes = {}
    for name, key in record.KEYS.items():
        value, units = getattr(record, name), key.unit.split(", ")
        other_law = name == "axes" and isinstance(record, Material) and record.law != "orthotropic"
        if value is None or other_law or (name == "end" and record.times):
            continue
        if name in PLACES:
            changes[name] = world.place(value)
        elif name in DIRECTIONS:
            changes |= {name: world.vector(value)} if world.vector(value) != list(value) else {}
        elif name == "axes":
            changes[name] = axes_in(value, world)
        elif name == "terms":
            changes[name] = [
                {**term, "at": world.place(term["at"])} if term.get("at") else dict(term) for term in value
            ]
        elif name in PAIRS:
            rows = [value] if name == "rayleigh" else value
            made = [[v * world.factor(u) for v, u in zip(row, units, strict=True)] for row in rows]
            changes[name] = made[0] if name == "rayleigh" else made
        elif key.unit or name == "weights":
            made = world.scaled(value, world.factor(units[0]))
            changes[name] = made[0] if name in AXIAL and len(value) == 1 else made  # of a plane
    if world.mirrors or world.turns:
        changes |= turned(record, changes, world)
    return replace(record, **changes)


def axes_in(axes, world):
    """Axes of a record, or of a material, which are two vectors."""
    if isinstance(axes, dict):
        return {name: world.place(v) if name == "origin" else world.vector(v) for name, v in axes.items()}
    return [world.vector(v) for v in axes]


def turned(record, given, world):
    """The components of a record that are others in a world that is turned or mirrored."""
    if isinstance(record, Equation) or getattr(record, "inertia", None) is not None:
        raise CannotTurnError
    own = [[name for axis in "xyz"[: world.dim] if (name := first + axis) in record.KEYS] for first in VECTORS]
    if world.mirrors:
        along = given.get("axes") and not isinstance(record, Material)
        signs = np.diag(world.turn).tolist()
        if along:  # a second vector is turned as well, and the axis that follows from others is not
            signs = [1.0, 1.0, -1.0] if "xy" in record.axes else [1.0, -1.0, 1.0]
        changes = {name: times(given[name], signs[k]) for names in own for k, name in enumerate(names) if name in given}
        for name in AXIAL:
            if (value := given.get(name)) is not None:
                flat = len(getattr(record, name)) == 1
                made = [
                    times(v, -s) for v, s in zip([value] if flat else value, signs[2:] if flat else signs, strict=True)
                ]
                changes[name] = made[0] if flat else made
        return changes
    changes = {}
    if isinstance(record, (Coupling, Displacement, Force, Spring)):
        along = [name for name in record.KEYS if re.fullmatch("[ufk][xyz]", name) or name == "components"]
        if any(getattr(record, name) is not None for name in along) and record.axes is None:
            changes["axes"] = {name: world.turn[: world.dim, k].tolist() for k, name in enumerate(("x", "xy"))}
        if not isinstance(record, Force):
            return changes
        own = []
    for names in own:
        values = [given.get(name) for name in names]
        if isinstance(record, Rigid) and len({value is None for value in values}) > 1:
            raise CannotTurnError
        if any(value is not None for value in values):
            changes |= dict(zip(names, combined(values, world.turn), strict=True))
    for name in AXIAL:
        if len(value := getattr(record, name, None) or ()) == 3:
            changes[name] = combined(given[name], world.turn)
    return changes


def times(value, sign):
    """A scaled value with a sign."""
    if isinstance(value, list):
        return [[t, times(v, sign)] for t, v in value]
    return f"{sign!r} * ({value})" if isinstance(value, str) else value * sign


def combined(values, turn):
    """The components of a vector that is turned, all of which are numbers or all formulas."""
    n, kinds = len(values), {type(value) for value in values if value is not None}
    if kinds == {str}:
        parts = [[f"{float(turn[k, j])!r} * ({v})" for j, v in enumerate(values) if v] for k in range(n)]
        return [" + ".join(part) for part in parts]
    if kinds == {list}:  # tables of the same times
        (first, *_) = (value for value in values if value)
        tables = np.array([value or [[t, 0.0] for t, _ in first] for value in values])
        return [list(zip(tables[0, :, 0], row @ tables[:, :, 1], strict=True)) for row in turn[:n, :n]]
    if kinds != {float}:
        raise CannotTurnError
    return (turn[:n, :n] @ [value or 0.0 for value in values]).tolist()


def turned_world(problem):
    """A world that is turned, about an axis in space, or in the plane; mirrored along the axis of axisymmetry."""
    model = problem.keys["model"]
    return World(turn=np.diag([1.0, -1.0, 1.0]) if model == "axisymmetric" else tilt(3 if model == "3d" else 2, 2.5))


def case_in(problem, world, mesh=None, reverse=False):
    """The case of a problem in a world, on its mesh there or on another one; `reverse`: records in reverse order."""
    case = problem.case()
    world = replace(world, dim=3 if case.model == "3d" else 2)
    records = [record_in(one, world) for one in problem.records]
    if not any(one.SECTION.name == "steps" for one in problem.records):
        records.append(record_in(case.steps, world))
    keys = dict(problem.keys)
    if case.model in ("plane_strain", "plane_stress"):
        own = keys.get("thickness", 1.0)
        keys["thickness"] = (
            {k: v * world.length for k, v in own.items()} if isinstance(own, dict) else own * world.length
        )
    if mesh is None:
        mesh = replace(case.mesh, points=world.places(case.mesh.points))
    return case_of(mesh, *records[:: -1 if reverse else 1], **keys)


def permuted(mesh, seed):
    """(mesh, place): nodes, cells, blocks and groups in another order; node k of the mesh is place[k] there."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(mesh.n_nodes)
    place = np.argsort(order)
    blocks, where, first = [], np.empty(mesh.n_cells, np.int64), 0
    for k in reversed(range(len(mesh.blocks))):
        kind, nodes = mesh.blocks[k]
        rows = rng.permutation(len(nodes))
        blocks.append((kind, place[nodes[rows]]))
        where[mesh.offsets[k] + rows] = first + np.arange(len(rows))
        first += len(rows)
    groups = {name: np.sort(where[cells]) for name, cells in reversed(mesh.cell_groups.items())}
    own = {name: np.sort(place[nodes]) for name, nodes in mesh.node_groups.items()}
    made = Mesh.create(mesh.points[order], blocks, cell_groups=groups, node_groups=own, space_dim=mesh.space_dim)
    return made, place


def differences(ones, others, world, mesh, place=slice(None)):
    """{(step, zone, quantity): the largest difference of two runs, against the largest value}.

    The others are of a problem in a world; node k of its mesh is `place[k]` there. Macro-elements are matched by their
    centres; a status that differs is a difference of 1; gaps are measured by displacements.
    """
    far, d, n = {}, mesh.space_dim, mesh.n_nodes
    back = world.turn[:d, :d]
    for step, (one, other) in enumerate(zip(ones, others, strict=True)):
        u, v = (state.u.reshape(-1, d)[:n] for state in (one, other))
        size = np.abs(u).max() or np.ptp(mesh.points)  # of a body that is held, its own
        far[step, "", "displacement"] = np.abs(v[place] @ back / world.length - u).max() / size
        zones = {zone.name: zone for zone in other.zones}
        for zone in one.zones:
            there = zones[zone.name]
            away, at = cKDTree((there.centre - world.shift[:d]) @ back / world.length).query(zone.centre)
            pairs = {
                "centre": (away, 0.0, 1.0),
                "status": (there.status[at] != zone.status, 0.0, 1.0),
                "pressure": (zone.pressure, there.pressure[at] / world.stress, None),
                "traction": (zone.traction, there.traction[at] @ back / world.stress, None),
                "gap": (np.nan_to_num(zone.gap), np.nan_to_num(there.gap[at]) / world.length, size),
                "coverage": (zone.coverage, there.coverage[at], 1.0),
            }
            for name, (p, q, unit) in pairs.items():
                unit = np.abs(p).max(initial=1e-300) if unit is None else unit
                far[step, zone.name, name] = np.abs(p - q).max(initial=0.0) / unit
    return far


def assert_same(ones, others, world, mesh, place=slice(None), *, allowed=1e-8, iterations=True):
    """Assert that the states of a problem and of one in a world are the same, after the same number of `iterations`."""
    far = differences(ones, others, world, mesh, place)
    worst = max(far, key=far.get)
    assert far[worst] <= allowed, (worst, far[worst])
    assert [one.iterations for one in ones] == [other.iterations for other in others] or not iterations
