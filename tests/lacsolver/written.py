"""A run that is made up: a cut mesh of two blocks, fields that are known functions, figures, and its case."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from lacmesh import Mesh, Surface, cut_skin, read, write
from lacmesh.cells import CELLS
from lacsolver.case import Case, fingerprint, read_case
from lacsolver.output import Writer, create_output
from lacsolver.results.results import Fields, Restart, Results, StepFigures, ZoneFields, ZoneFigures
from lacsolver.results.state import Histories, Iterate, State, StepState, ZoneState
from lacsolver.space.space import Space
from tests.lacsolver.bodies import cube, square

MODELS = ("3d", "plane_strain", "axisymmetric")
#: zones of every run: one with a plain name, one that no file can be called by
ZONES = ("joint", "glue/left: é")


def two_blocks(dim=3, kinds=None, plate=True):
    """Two blocks, one above the other, cut on the lower one's top; and, apart from them, a bare skin (`plate`)."""
    kinds = kinds or (("HEXA8", "TETRA4") if dim == 3 else ("QUAD4", "TRIA3"))
    make = cube if dim == 3 else square
    lower, upper = make(kinds[0], 2), make(kinds[1], 1)
    up = np.eye(3)[dim - 1]
    shift = lower.n_nodes
    points = np.vstack([lower.points, upper.points + 1.25 * up])
    solids = [(b.type, b.nodes + at) for m, at in ((lower, 0), (upper, shift)) for b in m.blocks]
    tops = facets_at(lower, dim - 1, 1.0)
    bottoms = [(t, n + shift) for t, n in facets_at(upper, dim - 1, 0.0)]
    rows = [*solids, *tops, *bottoms]
    groups = {"lower": solids[:1], "upper": solids[1:], "slave": tops, "master": bottoms}
    if plate:
        far = len(points)
        points = np.vstack([points, np.eye(3)[:dim] * 0.5 + 5.0 * up])
        rows.append(
            ("TRIA3", np.array([[far, far + 1, far + 2]])) if dim == 3 else ("SEG2", np.array([[far, far + 1]]))
        )
        groups["plate"] = rows[-1:]
    mesh = _mesh(points, rows, groups, 3 if dim == 3 else 2)
    return cut_skin(mesh, "slave").mesh


def facets_at(mesh, axis, value):
    """Facets of a mesh of one type whose nodes all have a coordinate: (type, nodes) pairs."""
    (block,) = mesh.blocks
    found = {}
    for facet in CELLS[block.type].facets:
        nodes = block.nodes[:, list(facet.nodes)]
        at = (np.abs(mesh.points[nodes, axis] - value) < 1e-9).all(axis=1)
        found.setdefault(facet.type, []).append(nodes[at])
    return [(kind, np.concatenate(rows)) for kind, rows in found.items() if sum(map(len, rows))]


def _mesh(points, rows, groups, space_dim):
    blocks = {}
    for kind, nodes in rows:
        blocks.setdefault(kind, []).append(nodes)
    start, at = {}, 0
    for parts in blocks.values():
        for nodes in parts:
            start[id(nodes)] = at
            at += len(nodes)
    members = {
        name: np.concatenate([start[id(nodes)] + np.arange(len(nodes)) for _, nodes in parts])
        for name, parts in groups.items()
    }
    return Mesh.create(
        points,
        [(kind, np.concatenate(parts)) for kind, parts in blocks.items()],
        space_dim=space_dim,
        cell_groups=members,
        node_groups={"first": [0, 1]},
        node_number=10 + 2 * np.arange(len(points)),
        cell_number=1000 + 3 * np.arange(at),
        name="blocks",
    )


@dataclass
class Run:
    """A run of a case, and what it would tell at any time."""

    case: Case
    space: Space
    folder: Path
    results: Results = field(default_factory=lambda: Results("1.2.3", sizes={"nodes": 5}, timings={"solve": 0.5}))
    calls: int = 0

    def writer(self, force=False, restart=None, folder=None):
        prints = fingerprint(self.case, read(self.case.mesh))  # a file has its own order
        return Writer(create_output(folder or self.folder, force=force, restart=restart), self.case, self.space, prints)

    def step(self, writer, number, time):
        """Let a writer write a step."""
        self.results = replace(self.results, steps=(*self.results.steps, figures(self.space, time)), memory=10**6)

        def made():
            self.calls += 1
            return fields(self.space, time)

        return writer.step(self.results, made, restart(self.space, number, time))

    def steps(self, writer, count, first=1, size=0.25):
        return [self.step(writer, k, size * k) for k in range(first, first + count)]

    def finish(self, writer, status="done", **rest):
        self.results = replace(self.results, status=status, message=rest.pop("message", ""))
        writer.finish(self.results, **rest)


def made_up(folder, model="3d", output="", mesh=None):
    """A run whose case and mesh are files of a folder."""
    mesh = two_blocks(3 if model == "3d" else 2) if mesh is None else mesh
    write(folder / "blocks.msh", mesh)
    last = "z" if model == "3d" else "y"
    text = f"""
mesh = "blocks.msh"
model = "{model}"
[[material]]
young = 2000.0
poisson = 0.3
[[contact]]
name = "{ZONES[0]}"
slave = "slave"
master = "master"
[[tie]]
name = "{ZONES[1]}"
slave = "plate"
master = "master"
[[displacement]]
group = "lower"
u{last} = 0.0
[[pressure]]
group = "master"
value = 25.0
[steps]
count = 4
{output}
"""
    (folder / "case.toml").write_text(text, encoding="utf-8")
    return Run(read_case(folder / "case.toml"), Space.of(mesh, model), folder / "out")


def displacement(x, time):
    """(n, 3), a known function."""
    return time * np.column_stack([0.01 * x[:, 0] + 0.02 * x[:, 1], -0.03 * x[:, 1], 0.04 * x[:, 2] - 0.05])


def fields(space, time):
    """Fields at a time; stress is NaN off the body, the first macro-element is unpaired."""
    x, d, n = space.mesh.points, space.dim, space.mesh.n_nodes
    stress = time * (np.arange(1.0, 1 + space.model.n_stress) + x[:, :1])
    stress[~space.attached] = np.nan
    reaction = -2 * displacement(x, time)[:, :d]
    zones = {name: zone_fields(space, time, k) for k, name in enumerate(ZONES)}
    return Fields(time, displacement(x, time)[:, :d], stress, reaction, zones) if n else None


def zone_fields(space, time, k=0):
    mesh = space.mesh
    cells = np.random.default_rng(1).permutation(np.flatnonzero(mesh.cell_data["lac_macro"] >= 0))
    surface = Surface.of(mesh, cells)
    macro = mesh.cell_data["lac_macro"][surface.cell]
    n = macro.max() + 1
    nodal = np.full(mesh.n_nodes, np.nan)
    slave = np.unique(surface.faces.nodes[surface.faces.nodes >= 0])
    nodal[slave] = time * mesh.points[slave, 0]
    rows = np.arange(float(n))
    return ZoneFields.of(zone_state(space, time, k), surface, macro, np.arange(n) + 100 * k, time * (rows + 0.5), nodal)


def zone_state(space, time, k=0):
    mesh, d = space.mesh, space.dim
    n = mesh.cell_data["lac_macro"].max() + 1
    rows = np.arange(float(n))
    gap = 0.1 * rows
    gap[0] = np.nan
    status = np.where(rows % 2 == 1, 1, 0)
    status[0] = -1
    normal = np.tile(np.eye(d)[-1], (n, 1))
    return ZoneState(
        ZONES[k], k == 1, time * (rows + k), time * normal * (rows + 1)[:, None], gap, status, 1 / (1 + rows),
        2.0 + rows, rows[:, None] + np.arange(float(d)), normal, time * mesh.points[:, :d],
    )  # fmt: skip


def figures(space, time):
    d = space.dim
    zone = ZoneFigures(
        0.0, 10 * time, 5 * time, float("nan"), 0.5, 4.0, np.arange(1.0, d + 1),
        np.ones(3) if d == 3 else np.array(2.5), 0.25, 1.0, 3, 2, 1,
    )  # fmt: skip
    return StepFigures(
        time, 5, 1, (1.0, 1e-12), {"base": time * np.arange(1.0, d + 1)}, {"PA, top": np.full(d, -time)},
        {"joint": zone}, (1e-15 / time, 2e-15 * time), 3.0 * time,
    )  # fmt: skip


def restart(space, number, time):
    x = displacement(space.mesh.points, time)[:, : space.dim].ravel()
    zones = tuple(zone_state(space, time, k) for k in (0, 1))
    now = Iterate(3 * x, np.arange(4.0), np.arange(4) > 1)
    earlier = None if number == 1 else (time / 2, Iterate(2 * x, -np.arange(4.0), np.arange(4) > 2))
    histories = Histories((np.full((2, 3, 1), time),), (np.arange(4.0)[:, None],), {"velocity": -x})
    step = StepState(time, now, earlier, 0.125, histories)
    state = State(time, x, -2 * x, zones, {"ball": np.array([time, 0.0, 1.0])}, 5, 1, (), step)
    return Restart.of(state, 0.125, number)
