"""A run that is made up: a cut mesh of two blocks, fields that are known functions, figures, and its case."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

import lacmesh
from lacmesh import Mesh, Surface, cut_skin, generate
from lacsolver.case import Case, Contact, Displacement, Material, Output, Pressure, Steps, Tie, fingerprint
from lacsolver.equilibrium.state import Histories, Iterate, State, StepState, ZoneState
from lacsolver.output import Writer, create_output
from lacsolver.results.results import Fields, Restart, Results, StepFigures, ZoneFields, ZoneFigures
from lacsolver.space.space import Space
from tests.problems import case_of

MODELS = ("3d", "plane_strain", "axisymmetric")
#: zones of every run: one with a plain name, one that no file can be called by
ZONES = ("joint", "glue/left: é")


def two_blocks(dim=3, kinds=None, plate=True):
    """Two blocks, one above the other, cut on the lower one's top; and, apart from them, a bare skin (`plate`)."""
    make, corner = (generate.box, (0, 0, 0)) if dim == 3 else (generate.rectangle, (1, 0))
    ways = zip(kinds or (("HEXA8", "TETRA4") if dim == 3 else ("QUAD4", "TRIA3")), (2, 1), strict=True)
    parts = [make(n, kind=kind, corner=corner).only("body", ("bottom", "top")[n - 1]) for kind, n in ways]
    mesh = generate.stack(*parts, gap=0.25, slave="lower")
    if plate:
        x, kind = np.eye(dim) * 0.5 + 5.0 * np.eye(dim)[-1], "TRIA3" if dim == 3 else "SEG2"
        bare = Mesh.create(x, [(kind, [range(dim)])], cell_groups={"plate": [0]}, space_dim=dim)
        mesh = lacmesh.join(mesh, bare)
    numbers = {"node_number": 10 + 2 * np.arange(mesh.n_nodes), "cell_number": 1000 + 3 * np.arange(mesh.n_cells)}
    return cut_skin(replace(mesh, node_groups={"first": np.arange(2)}, name="blocks", **numbers), "slave").mesh


@dataclass
class Run:
    """A run of a case, and what it would tell at any time."""

    case: Case
    space: Space
    folder: Path
    results: Results = field(default_factory=lambda: Results("1.2.3", sizes={"nodes": 5}, timings={"solve": 0.5}))
    calls: int = 0

    def writer(self, force=False, restart=None, folder=None):
        prints = fingerprint(self.case, lacmesh.read(self.case.mesh))  # a file has its own order
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


def made_up(folder, model="3d", **output):
    """A run whose mesh is a file of a folder; `output`: keys of [output]."""
    mesh = two_blocks(3 if model == "3d" else 2)
    lacmesh.write(folder / "blocks.msh", mesh)
    case = case_of(
        folder / "blocks.msh",
        Material(young=2000.0, poisson=0.3),
        Contact(name=ZONES[0], slave="slave", master="master"),
        Tie(name=ZONES[1], slave="plate", master="master"),
        Displacement(group="lower", **{"uz" if model == "3d" else "uy": 0.0}),
        Pressure(group="master", value=25.0),
        Steps(count=4),
        Output(**output),
        model=model,
    )
    return Run(case, Space.of(mesh, model), folder / "out")


def displacement(x, time):
    """(n, 3), a known function."""
    return time * np.column_stack([0.01 * x[:, 0] + 0.02 * x[:, 1], -0.03 * x[:, 1], 0.04 * x[:, 2] - 0.05])


def fields(space, time):
    """Fields at a time; stress is NaN off the body, the first macro-element is unpaired."""
    x, d = space.mesh.points, space.dim
    stress = time * (np.arange(1.0, 1 + space.model.n_stress) + x[:, :1])
    stress[~space.attached] = np.nan
    reaction = -2 * displacement(x, time)[:, :d]
    zones = {name: zone_fields(space, time, k) for k, name in enumerate(ZONES)}
    return Fields(time, displacement(x, time)[:, :d], stress, reaction, zones)


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
    return ZoneFields(
        **vars(zone_state(space, time, k)), surface=surface, macro=macro, number=np.arange(n) + 100 * k,
        recovered=time * (rows + 0.5), pressure_recovered=nodal,
    )  # fmt: skip


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
