"""Small cases of every kind, each written so that it can be asked in other units, at another place and turned.

A `World` says how: a place X of the model is at x = length turn X + shift there, and stresses are `stress` times as
large. A case is a mesh and a function of a world that gives the text of its sections; what a run finds is told in the
model's own units, on its own nodes and macro-elements (`figures`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from lacmesh import Mesh
from lacsolver.case import parse_case
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.problem.skin import prepared
from tests.lacsolver.patch_meshes import joined, stack

YOUNG = 1000.0


@dataclass(frozen=True, eq=False)
class World:
    """Units and frame of a model; `seed` of a permutation of nodes, cells, groups and zones, None for none."""

    dim: int
    round: bool = False
    length: float = 1.0
    stress: float = 1.0
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    seed: int | None = None

    @property
    def force(self):
        """Factor of nodal forces; in a plane they are per unit thickness."""
        return self.stress * self.length ** (2 if self.dim == 3 or self.round else 1)

    def places(self, X):
        """Positions (n, 3) in the world of points X of the model."""
        return self.length * X @ self.turn.T + self.shift

    def vector(self, names, value, scale=1.0):
        """Keys of a vector: `ux = ...`; its components are numbers or formulas of the model's own x, y, z."""
        return "".join(f"{name} = {self._component(k, value, scale)}\n" for k, name in enumerate(names[: self.dim]))

    def _component(self, k, value, scale):
        if all(isinstance(v, float) for v in value):
            return repr(float(scale * (self.turn[k, : self.dim] @ value[: self.dim])))
        parts = [f"{float(scale * self.turn[k, j])!r} * ({self.formula(value[j])})" for j in range(self.dim)]
        return f'"{" + ".join(parts)}"'

    def formula(self, text):
        """Rewrite a formula of the model's x, y, z in the coordinates of the world."""
        own = {}
        for k, name in enumerate("xyz"[: self.dim]):
            parts = [
                f"{float(self.turn[j, k] / self.length)!r} * ({axis} - {float(self.shift[j])!r})"
                for j, axis in enumerate("xyz"[: self.dim])
            ]
            own[name] = f"({' + '.join(parts)})"
        return "".join(own.get(letter, letter) for letter in str(text).replace("sin", "SIN")).replace("SIN", "sin")

    def point(self, X):
        """Coordinates in the world of a point of the model, as a list."""
        return [float(x) for x in self.places(np.array([X]))[0, : self.dim]]


class Case(NamedTuple):
    """A mesh (or what makes it), a model, and the sections after [solver] as a function of a world."""

    mesh: Callable[[], Mesh]
    model: str
    sections: Callable[[World], str]
    finite: bool = False
    head: str = ""

    @property
    def dim(self):
        """Dimension of the model."""
        return 3 if self.model == "3d" else 2

    @property
    def world(self):
        """World in which the case is written as it is."""
        return World(self.dim, self.model == "axisymmetric")


# ---- what a case is written with


def held(w, group, value=(0.0, 0.0, 0.0)):
    """A group whose displacement is prescribed."""
    return f'[[displacement]]\ngroup = "{group}"\n' + w.vector(("ux", "uy", "uz"), value, w.length)


def material(w, law="elastic", poisson=0.3, more=""):
    """The law of all bodies."""
    return f'[[material]]\nlaw = "{law}"\nyoung = {YOUNG * w.stress!r}\npoisson = {poisson}\n{more}'


def contact(w, slave="slave", master="master", **options):
    """A contact; text is quoted."""
    return _joint("contact", slave, master, options)


def tie(w, slave, master):
    """A tie."""
    return _joint("tie", slave, master, {})


def _joint(section, slave, master, options):
    told = "".join(f"{k} = {v if isinstance(v, float) else chr(34) + v + chr(34)}\n" for k, v in options.items())
    return f'[[{section}]]\nname = "{slave}"\nslave = "{slave}"\nmaster = "{master}"\n{told}'


# ---- meshes


def waved(mesh, dim, size=0.05):
    """Blocks whose surfaces wave, the upper one crowned so that it stands off the lower at the rim."""
    x, up = mesh.points.copy(), dim - 1
    upper = np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(mesh.cell_groups["upper"])]))
    x[:, up] += size * np.sin(2.1 * x[:, :up].sum(axis=1) + 0.4)
    crown = {2: 0.1, 3: 0.04}[dim]
    x[upper, up] += crown * ((x[upper, :up] - x[upper, :up].mean(axis=0)) ** 2).sum(axis=1)
    return Mesh.create(x, mesh.blocks, cell_groups=mesh.cell_groups, space_dim=dim)


def blocks(slave, master, dim, *, counts=(4, 3), shift=(0, 0, 0), **options):
    """Two blocks whose surfaces wave."""
    return lambda: waved(stack(slave, master, dim, counts=counts, skew=0.1, shift=shift), dim, **options)


def two_stacks(kinds, apart=(1.5, 0.1, 0.0)):
    """Two stacks beside each other: slave0 on master0, slave1 on master1."""
    parts = []
    for k, (low, high) in enumerate(kinds):
        mesh = waved(stack(low, high, 2, number=k, counts=(4, 2), skew=0.1), 2)
        parts.append((mesh, k * np.asarray(apart), {name: name for name in mesh.cell_groups}))
    return lambda: joined(parts)


# ---- running


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


def text_of(case, w):
    """The case file in a world: sections in another order where things are permuted."""
    head = f'mesh = "none.msh"\nmodel = "{case.model}"\nkinematics = "{"finite" if case.finite else "small"}"\n'
    sections = case.sections(w)
    if w.seed is not None:
        first, *rest = sections.split("[[")
        sections = first + "".join(f"[[{part}" for part in rest[::-1])
    return head + case.head + "[solver]\nthreads = 1\n" + sections


def run(case, w, mesh=None):
    """Run a case in a world: (states, index of its own nodes there); `mesh`: a mesh to use instead."""
    place = np.arange(case.mesh().n_nodes)
    if mesh is None:
        mesh = case.mesh()
        if w.seed is not None:
            mesh, place = permuted(mesh, w.seed)
        mesh = replace(mesh, points=w.places(mesh.points))
    problem = Problem.of(parse_case(text_of(case, w)), mesh)
    return list(march(problem)), place


def brought_back(case, w):
    """The case's mesh cut in a world that is elsewhere, and brought back: its coordinates are rounded as they are."""
    mesh = case.mesh()
    there = prepared(parse_case(text_of(case, w)), replace(mesh, points=w.places(mesh.points)))
    return replace(there, points=there.points - w.shift)


class Figures(NamedTuple):
    """Results of a run in the model's units: iterations of each step, and arrays by (step, zone, quantity)."""

    iterations: tuple
    values: dict


def figures(case, w, mesh=None):
    """Run a case in a world and return its results in the model's units."""
    states, place = run(case, w, mesh)
    d, values = case.dim, {}
    back = w.turn[:d, :d]
    for k, state in enumerate(states):
        values[k, "", "displacement"] = state.u.reshape(-1, d)[place] @ back / w.length
        values[k, "", "reaction"] = state.reaction.reshape(-1, d)[place] @ back / w.force
        for zone in state.zones:
            told = {
                "centre": (zone.centre - w.shift[:d]) @ back / w.length,
                "status": zone.status,
                "pressure": zone.pressure / w.stress,
                "traction": zone.traction @ back / w.stress,
                "gap": np.nan_to_num(zone.gap) / w.length,
                "coverage": zone.coverage,
            }
            values |= {(k, zone.name, name): array for name, array in told.items()}
    return Figures(tuple(state.iterations for state in states), values)


def compared(one, other):
    """(iterations are the same, statuses are, {(step, zone, what): the largest difference, against the largest value}).

    Macro-elements are matched by their centres; gaps are measured by displacements, centres as they are.
    """
    far, same = {}, True
    for (k, zone, name), value in one.values.items():
        there = other.values[k, zone, name]
        if zone:
            own, others = (f.values[k, zone, "centre"] for f in (one, other))
            there = there[cKDTree(others).query(own)[1]]
        if name == "status":
            same &= bool((value == there).all())
            continue
        size = one.values[k, "", "displacement"] if name == "gap" else 1.0 if name == "centre" else value
        far[k, zone, name] = float(np.abs(value - there).max() / max(np.abs(size).max(), 1e-300))
    return one.iterations == other.iterations, same, far


# ---- the cases


def _pressed(w, down=(0.004, -0.03, 0.0), law="elastic", **options):
    return material(w, law) + contact(w, **options) + held(w, "bottom") + held(w, "top", down)


def _in_space(w, law="elastic", **options):
    return _pressed(w, (0.004, 0.002, -0.03), law, **options)


def _bodied(w):
    """A body force and a traction that are formulas of the place."""
    load = "[[body_force]]\n" + w.vector(("fx", "fy", "fz"), ("0", "-20 * (1 + x)", "0"), w.stress / w.length)
    load += '[[traction]]\ngroup = "top"\n' + w.vector(("tx", "ty", "tz"), ("3 * x", "-40 * t", "0"), w.stress)
    return material(w) + contact(w, normals="smoothed") + held(w, "bottom") + load + _on_springs(w)


def _on_springs(w, group="top", stiffness=30.0):
    k = stiffness * w.force / w.length
    return f'[[spring]]\ngroup = "{group}"\n' + "".join(f"k{a} = {k!r}\n" for a in "xyz"[: w.dim])


def _follower(w):
    """A pressure that follows the upper block's top, which springs hold."""
    value = f"{30 * w.stress!r} * t * (1 + {w.formula('0.3 * x')})"
    load = f'[[pressure]]\ngroup = "top"\nvalue = "{value}"\nfollower = true\n'
    return material(w, "neo_hookean") + contact(w) + held(w, "bottom") + load + _on_springs(w)


def _glued(w):
    """A tie in space, pulled."""
    return material(w) + tie(w, "slave", "master") + held(w, "bottom") + held(w, "top", (0.01, 0.004, 0.02))


def _bilateral(w):
    """Skins that slide and do not part, under forces at the nodes of the top."""
    force = '[[force]]\ngroup = "top"\n' + w.vector(("fx", "fy", "fz"), (0.4, 1.5, 0.0), w.force)
    return material(w) + contact(w, type="bilateral") + held(w, "bottom") + force + _on_springs(w)


def _on_a_body(w):
    """The upper block's top is a rigid body, free to move and turn, under a force, a moment and springs."""
    rigid = f'[[rigid]]\ngroup = "top"\ncentre = {w.point([0.5, 2.0, 0.0])}\n'
    rigid += w.vector(("fx", "fy", "fz"), (2.0, -15.0, 0.0), w.force)
    turning = np.linalg.det(w.turn) * w.force * w.length
    rigid += f"moment = {float(1.5 * turning)!r}\n" + _on_springs(w, "inner")
    return material(w, "neo_hookean") + contact(w) + held(w, "bottom") + rigid


def _several(w):
    """Two stacks, one in contact and one tied."""
    down = held(w, "bottom") + held(w, "top", (0.004, -0.03, 0.0))
    return material(w) + contact(w, "slave0", "master0", normals="smoothed") + contact(w, "slave1", "master1") + down


def _overlapping(w):
    """Blocks that overlap at first, and are held where they are."""
    zone = contact(w, geometry="current", clearance=-0.01 * w.length)
    return material(w) + zone + held(w, "bottom") + held(w, "top")


def _warm(w):
    """Held along normals, pressed by its own warmth, which is a formula of the place."""
    sides = "".join(f'[[displacement]]\ngroup = "{name}"\nun = 0.0\n' for name in ("bottom", "x0", "top"))
    warmth = f'[[temperature]]\nvalue = "20 * t * (1 + {w.formula("x")})"\n'
    return material(w, more="expansion = 2e-3\n") + contact(w) + sides + warmth


def _about_the_axis(w, law="elastic", **options):
    """Pressed along the axis, free sideways."""
    top = f'[[displacement]]\ngroup = "top"\nuy = "{float(-0.03 * w.turn[1, 1] * w.length)!r} * t"\n'
    return material(w, law) + contact(w, **options) + held(w, "bottom") + top


def with_inner_nodes(make):
    """The mesh with a group `inner` of the upper block's nodes that are not on its top."""

    def made():
        mesh = make()
        upper = np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(mesh.cell_groups["upper"])]))
        top = np.concatenate([n.ravel() for _, _, n in mesh.select(mesh.cell_groups["top"])])
        return replace(mesh, node_groups={"inner": np.setdiff1d(upper, top)})

    return made


CASES = {
    "plane strain": Case(blocks("QUAD4", "TRIA3", 2), "plane_strain", _pressed),
    "plane stress, smoothed, bodied, sprung": Case(
        blocks("QUAD8", "QUAD4", 2), "plane_stress", _bodied, head="thickness = 3.0\n"
    ),
    "plane, finite": Case(
        blocks("TRIA6", "QUAD4", 2), "plane_strain", lambda w: _pressed(w, law="neo_hookean"), finite=True
    ),
    "plane, finite, follower": Case(blocks("QUAD4", "QUAD4", 2), "plane_strain", _follower, finite=True),
    "bilateral": Case(blocks("TRIA3", "QUAD4", 2), "plane_strain", _bilateral),
    "rigid, finite": Case(with_inner_nodes(blocks("QUAD4", "TRIA3", 2)), "plane_strain", _on_a_body, finite=True),
    "two zones": Case(two_stacks((("QUAD4", "TRIA3"), ("TRIA6", "QUAD4"))), "plane_strain", _several),
    "overlap": Case(blocks("QUAD4", "TRIA3", 2), "plane_strain", _overlapping),
    "warm, held along normals": Case(blocks("QUAD8", "QUAD4", 2), "plane_strain", _warm),
    "axisymmetric": Case(blocks("QUAD4", "TRIA3", 2, shift=(0.5, 0, 0)), "axisymmetric", _about_the_axis),
    "axisymmetric, finite, smoothed": Case(
        blocks("QUAD8", "QUAD4", 2, shift=(0.5, 0, 0)),
        "axisymmetric",
        lambda w: _about_the_axis(w, "neo_hookean", normals="smoothed"),
        finite=True,
    ),
    "in space": Case(blocks("HEXA8", "TETRA4", 3, counts=(2, 2)), "3d", _in_space),
    "in space, finite, smoothed": Case(
        blocks("HEXA8", "HEXA8", 3, counts=(2, 1)),
        "3d",
        lambda w: _in_space(w, "neo_hookean", normals="smoothed"),
        finite=True,
    ),
    "tie in space": Case(blocks("TETRA4", "HEXA8", 3, counts=(2, 1)), "3d", _glued),
}
