"""The corpus: small problems that together have every key of a case, each with what it must come to.

    problem = PROBLEMS["coupled"]
    problem.case() = its records as a case, on its mesh; `problem.case(records)`: with others in their place

Its answer in closed form is in tests/answers.py; the laws that hold for every problem are in tests/test_laws.py. A new
capability adds a row here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from lacmesh import Mesh
from lacsolver.case import (
    BodyForce,
    Case,
    Contact,
    Coupling,
    Cyclic,
    Displacement,
    Dynamics,
    Equation,
    Force,
    Gravity,
    Initial,
    Material,
    Output,
    Pressure,
    Pretension,
    Probe,
    Rigid,
    Solver,
    Spring,
    Steps,
    Temperature,
    Tie,
    Traction,
)
from tests.lacsolver.sectors import sector
from tests.problem_meshes import (
    apart,
    bolted,
    cube,
    gapped,
    joint,
    linked,
    overhang,
    pair,
    plane,
    punch,
    roof,
    solid,
    tower,
    towers,
    two_stacks,
    waving,
    wedge,
)

ELASTIC = Material(young=1000.0, poisson=0.3)


def contact(**keys: Any) -> Contact:
    """Contact of the groups `slave` and `master`."""
    return Contact(**{"slave": "slave", "master": "master"} | keys)


def move(group: str, **components: Any) -> Displacement:
    """Displacements of a group: `move("top", uz=-0.01)`."""
    return Displacement(group=group, **components)


def fix(group: str, axes: str, **rest: Any) -> Displacement:
    """No displacement of a group along some axes: `fix("bottom", "xyz")`."""
    return move(group, **{f"u{axis}": 0.0 for axis in axes}, **rest)


def case_of(mesh: Any, *records: Any, **keys: Any) -> Case:
    """A case of records in any order; `keys`: those at the top of a case file, as `kinematics`."""
    for name, kind in Case.SECTIONS.items():
        if own := [record for record in records if type(record) is kind]:
            keys[name] = own if kind.SECTION.several else own[0]
    return Case(mesh=mesh, **keys)


@dataclass(frozen=True)
class Problem:
    """Records on a mesh; `keys`: those at the top of a case file."""

    mesh: Callable[[], Mesh]
    records: Sequence[Any]
    keys: dict[str, Any]

    def case(self, records: Sequence[Any] | None = None, mesh: Any = None, **keys: Any) -> Case:
        """The case of these records, or of others in their place, on its mesh or on another one."""
        given = self.records if records is None else records
        return case_of(self.mesh() if mesh is None else mesh, *given, **self.keys | keys)


def problem(mesh: Callable[[], Mesh], model: str, *records: Any, **keys: Any) -> Problem:
    """A problem of the corpus; `keys`: those at the top of a case file."""
    return Problem(mesh, records, {"model": model, **keys})


# ---- problems that differ by a record or an option


def falling(**keys: Any) -> Problem:
    """A square that flies up, away from the one it stands on."""
    held, speed = (fix("x0", "x"), fix("lower", "y")), Initial(groups=["upper"], vy=0.5)
    material, motion = Material(young=1000.0, poisson=0.3, density=2.0), Steps(end=1.0, count=4)
    return problem(pair, "plane_strain", material, contact(), *held, Dynamics(**keys), speed, motion)


def ring(hexa: str, **macro: str) -> Problem:
    """A sector of a ring that grows evenly; its sides do not match."""
    sides = Cyclic(
        name="side",
        slave="a",
        master="b",
        sectors=6,
        axis=[1, 0, 0],
        origin=[0, 1, 0],
        harmonic=0,
        ring=True,
        hexa=hexa,
        **macro,
    )
    grown = {"ux": 0.0, "uy": "0.01 * (y - 1) * t", "uz": "0.01 * z * t"}
    grow = move("in", **grown), move("out", **grown)
    return problem(wedge, "3d", Material(young=1000.0, poisson=0.0), sides, *grow, Steps(count=2))


def columns(value: Any, joint: Contact, law: Any = ELASTIC, mesh: Any = plane, **keys: Any) -> Problem:
    """Two blocks that slide along two of their sides, under a pressure on the top."""
    follower = keys.pop("follower", False)
    load = Pressure(group="top", value=value, follower=follower)
    held = fix("bottom", "y"), fix("x0", "x")
    return problem(mesh, "plane_strain", law, joint, *held, load, Probe(group="top"), **keys)


def press(slave: str, master: str, model: str, law: str, thickness: float | None = None, **keys: Any) -> Problem:
    """Two blocks of some cells at a uniform finite strain, under a pressure on the top."""
    up = "z" if model == "3d" else "y"
    held = [fix("bottom", up), fix("x0", "x")] + ([fix("y0", "y")] if model == "3d" else [])
    load = Pressure(group="top", value=100.0, follower=keys.pop("follower", False))
    given = Material(law=law, young=1000.0, poisson=0.3), contact(**keys), *held, load, Solver(tolerance=1e-11)
    mesh = partial(solid if model == "3d" else plane, slave, master)
    more = {} if thickness is None else {"thickness": thickness}
    return problem(mesh, model, *given, Steps(count=2), kinematics="finite", **more)


def slanted(joint: Any) -> Problem:
    """A roof below a plane, both held."""
    return problem(
        roof, "plane_strain", Material(young=100.0, poisson=0.3), joint, fix("bottom", "xy"), fix("top", "xy")
    )


def pressed(*records: Any) -> Problem:
    """A parabola that is pressed into a flat body."""
    held = fix("bottom", "xy"), move("top", ux=0.0, uy=-0.04)
    return problem(punch, "plane_strain", ELASTIC, contact(geometry="current"), *held, *records)


def dragged(mesh: Callable[[], Mesh], model: str, **keys: Any) -> Problem:
    """A block of rubber that is pressed on another one and pulled over it, until all of it slides."""
    axes = "xyz" if model == "3d" else "xy"
    down = {f"u{axes[-1]}": [[0, 0], [1, -0.04]]} | ({"uy": 0.0} if model == "3d" else {})
    rubber = Material(law="neo_hookean", young=1000.0, poisson=0.3)
    held = fix("bottom", axes), move("top", ux=[[0, 0], [1, 0], [2, 0.1]], **down), Steps(end=2.0, count=2)
    return problem(mesh, model, rubber, contact(friction=0.2, **keys), *held, kinematics="finite")


def stacked(height: float, *records: Any, **options: str) -> Problem:
    """Three blocks of hexahedra on one another, in contact and tied; `options`: of the macro-elements."""
    joints = Contact(slave="slave1", master="master1", **options), Tie(slave="slave2", master="master2", **options)
    held = fix("bottom", "z"), fix("x0", "x"), fix("y0", "y"), Pressure(group="top", value=1.0)
    return problem(lambda: tower(height), "3d", ELASTIC, *joints, *held, *records)


def chosen(kind: type) -> Problem:
    """Surfaces of which one is in front of a half of the other."""
    joint = kind(name="joint", surfaces=["master", "slave"], search_distance=0.7)
    held = fix("bottom", "xy"), move("top", ux=0.0, uy=-0.7)
    return problem(lambda: overhang(0.6), "plane_stress", Material(young=1000.0, poisson=0.0), joint, *held)


# ---- the corpus

TURNED = {"x": [3.0, 4.0, 0.0], "xy": [0.0, 1.0, 0.0]}
PROBLEMS = {
    "thrown": problem(
        apart, "3d",
        Material(young=1000.0, poisson=0.3, density=2.0),
        Rigid(group="lower", fx=1.5, moment=[0.0, 0.0, 0.6], mass=3.0, inertia=[1.0, 2.0, 2.5]),
        Dynamics(scheme="newmark", beta=0.4, gamma=0.6, rayleigh=[0.5, 0.01]),
        Initial(
            groups=["upper"], vx=0.1, vy="0.2", vz=0.3, rotation=[0.0, 0.0, 0.4], centre=[0.25, 0.5, 1.6], ux=0.01,
            uy=0.02, uz=0.03,
        ),
        Steps(end=1.0, count=4),
    ),
    "damped": problem(
        plane, "plane_strain",
        Material(young=1000.0, poisson=0.3, density=2.0),
        contact(stiffness=50.0, damping=5.0),
        fix("x0", "x"),
        fix("bottom", "y"),
        Dynamics(),
        Initial(groups=["upper"], vy=-0.1),
        Steps(end=0.2, count=4),
    ),
    "loads": problem(
        cube, "3d",
        Material(groups=["left"], law="elastic", young=1000.0, poisson=0.3, density=2.0),
        Material(groups=["right"], young=500.0, poisson=0.25, density=1.0),
        fix("z0", "xyz", kind="cell"),
        Traction(group="z1", tx=1.0, ty="2 + x", tz=[[0, 0], [1, 3]]),
        Pressure(group="x1", value="1 + y * t"),
        Force(group="z1", kind="node", fx=0.1, fy=0.2, fz=0.3),
        Force(group="y1", kind="cell", fy=0.01),
        Force(group="y1", fx=0.04, total=True),
        Force(at=[1.0, 1.0, 1.0], fx=0.07),
        BodyForce(groups=["right"], fx=0.5, fy="x", fz=[[0, 0], [2, 0.8]]),
        Gravity(gx=0.05, gy=-0.03, gz=-9.81),
        Steps(end=2.0, count=4),
        Output(format="vtu", every=2),
        kinematics="small",
    ),
    "fields": problem(
        cube, "3d",
        Material(
            groups=["left"], law="orthotropic", young=[1000.0, 2000.0, 500.0], poisson=[0.2, 0.3, 0.25],
            shear=[400.0, 300.0, 200.0], axes=[[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], expansion=[0.0001, 0.0002, 0.0003],
            reference_temperature=20.0,
        ),
        Material(groups=["right"], young=1500.0, poisson=0.1, expansion=5e-05),
        Temperature(groups=["left"], value=50.0),
        Temperature(groups=["right"], value="10 * t"),
        move("x0", ux="1e-3 * (y + z) * t", uy="1e-3 * (2 * y - z) * t", uz="1e-3 * (y - 2 * z) * t"),
        move("x1", ux="1e-3 * (3 + y + z) * t", uy="1e-3 * (4 + 2 * y - z) * t", uz="1e-3 * (5 + y - 2 * z) * t"),
        move("y0", ux="1e-3 * (3 * x + z) * t", uy="1e-3 * (4 * x - z) * t", uz="1e-3 * (5 * x - 2 * z) * t"),
        move("y1", un="1e-3 * (4 * x + 2 - z) * t"),
        Displacement(at=[0.5, 1.0, 0.5], ux=0.003, uz=0.0025),
        Displacement(at=[0.5, 1.0, 0.0], ux=0.0025, uz=0.0035),
        move(
            "z0", kind="node", ux="1e-3 * (3 * x + y + 1) * t", uy="1e-3 * (4 * x + 2 * y - 1) * t",
            uz="1e-3 * (5 * x + y - 2) * t",
        ),
        Displacement(at=[0.5, 0.5, 0.0], ux=0.002, uy=0.003, uz=0.003),
        Displacement(at=[0.5, 0.5, 0.5], ux=0.0025, uy=0.0025, uz=0.002),
        Probe(group="z1", kind="node", name="corners"),
        Probe(group="y1", kind="cell"),
        Probe(at=[0.5, 1.0, 0.5], name="middle"),
    ),
    "springs": problem(
        cube, "3d",
        Material(young=10000000.0, poisson=0.0),
        Spring(group="z0", kind="cell", kx=1.0, ky=2.0, kz=3.0),
        Spring(group="z1", kind="node", kx=4.0, ky=5.0, kz=6.0),
        Spring(at=[1.0, 0.5, 0.5], ky=7.0),
        Force(at=[1.0, 1.0, 1.0], fx=0.5, fy=-0.25, fz=1.0),
        Probe(at=[1.0, 1.0, 1.0], name="corner"),
        Probe(at=[0.0, 1.0, 0.0], name="other"),
    ),
    "linked": problem(
        linked, "3d",
        ELASTIC,
        Rigid(group="lower"),
        Rigid(group="upper", fx=1.0, fy=-2.0, fz=0.5),
        Spring(group="eye", to="hook", k=7.0),
        Spring(group="eye", to="hook", kx=2.0, ky=3.0, kz=4.0, axes=TURNED),
        Probe(group="hook"),
    ),
    "equated": problem(
        cube, "3d",
        ELASTIC,
        fix("z0", "xyz", kind="cell"),
        Force(at=[1.0, 1.0, 1.0], fx=10.0, fz=5.0),
        Equation(
            name="sum",
            terms=[
                {"factor": 2, "component": "ux", "at": [1, 1, 1]},
                {"factor": -1, "component": "uy", "group": "y1", "kind": "node"},
            ],
            value=0.03,
        ),
        Equation(group="x1", kind="cell", same=["uy"]),
        Equation(name="two", group="z1", kind="node", same=["uz"]),
        Probe(at=[1.0, 1.0, 1.0], name="corner"),
        Probe(at=[1.0, 0.5, 0.5], name="middle"),
        Probe(at=[0.0, 0.0, 1.0], name="a"),
        Probe(at=[0.0, 0.5, 1.0], name="b"),
        Steps(count=2),
    ),
    "axes": problem(
        cube, "3d",
        Material(young=10000000.0, poisson=0.0),
        fix("z0", "z"),
        Displacement(at=[1.0, 0.5, 0.5], ux=1e-06, axes=TURNED),
        Spring(group="z0", kx=2.0, ky=3.0, kz=5.0, axes=TURNED),
        Force(
            group="x1", fx=1.0, fy=2.0, fz=4.0, total=True,
            axes={"origin": [1.0, -1.0, 0.0], "axis": [1.0, 0.0, 0.0]},
        ),
    ),
    "coupled": problem(
        cube, "3d",
        ELASTIC,
        fix("z0", "xyz", kind="cell"),
        Coupling(
            name="hook", group="x1", kind="distributing", at=[2.0, 0.5, 0.75], weights="1 + z",
            axes={"x": [0.0, 1.0, 0.0], "xy": [1.0, 0.0, 0.0]}, ux=0.001, fy=0.25, fz="0.5 * t",
            moment=[0.0, 0.0, 0.125],
        ),
        Coupling(group="z1", kind="rigid", components=["ux", "uz"], fx=0.5, uz=0.002, rotation=[0.0, 0.001, 0.0]),
        Coupling(name="pin", group="x0", uy=[[0, 0], [1, 0.001]]),
        Force(group="z1", moment=[0.0, 0.0, 0.375], total=True),
    ),
    "tightened": problem(
        bolted, "3d",
        Material(young=1000.0, poisson=0.0),
        fix("z0", "xyz"),
        fix("z1", "xyz"),
        Pretension(group="shank", name="bolt", normal=[0.0, 0.3, 1.0], force=[[0, 0], [1, 10], [2, 20]], lock=1.0),
        Pretension(group="second", shortening="0.015 * t"),
        Steps(times=[1.0, 2.0]),
    ),
    "late": problem(
        cube, "3d",
        Material(young=1000.0, poisson=0.0),
        fix("x0", "xyz"),
        move("x1", ux=0.05, begin=1.0, reached=1.5),
        Traction(group="x1", tx=[[0, 0], [1, 10], [2, 30]]),
        Steps(times=[1.5, 2.0]),
    ),
    "rigid": problem(
        towers, "3d",
        ELASTIC,
        fix("bottom", "xyz"),
        fix("top", "xyz"),
        Rigid(
            group="low", kind="cell", centre=[0.25, 0.0, 1.0], ux=0.001, uy="2e-3 * t", uz=[[0, 0], [1, 0.003]],
            rotation=[0.001, "-2e-3 * t", [[0, 0], [1, 0.004]]],
        ),
        Rigid(
            group="master", kind="node", centre=[0.5, 0.25, 2.5], fx=1.0, fy="2 * t", fz=[[0, 0], [1, 3]],
            moment=[0.25, "0.5 * t", -1.0],
        ),
        Probe(at=[1.0, 1.0, 1.0], name="corner"),
        Steps(count=2),
    ),
    "searched": problem(
        lambda: overhang(0.6), "plane_stress",
        ELASTIC,
        contact(
            name="joint", type="unilateral", search_distance=0.7, coverage_threshold=0.55, initial="all",
            clearance="0.01 + 0.02 * x", geometry="reference", measure="reference", normals="facet",
        ),
        fix("bottom", "xy"),
        fix("top", "xy"),
        thickness=2.5,
    ),
    "rubbed": problem(
        plane, "plane_strain",
        ELASTIC,
        contact(name="joint", friction=0.3, cohesion=0.2, shear_limit=4.8),
        fix("bottom", "xy"),
        move("top", ux=0.1, uy=-0.04),
        Steps(count=2),
    ),
    "dragged": dragged(plane, "plane_strain"),
    "dragged, smooth": dragged(plane, "plane_strain", normals="smoothed", measure="current"),
    "dragged in space": dragged(apart, "3d", normals="master", clearance=-0.1),
    "sunk": problem(
        lambda: overhang(-0.8), "plane_stress",
        Material(young=1000.0, poisson=0.0),
        contact(max_penetration=0.9),
        fix("bottom", "xy"),
        fix("top", "xy"),
    ),
    "glued": problem(
        lambda: overhang(0.6), "plane_stress",
        Material(young=1000.0, poisson=0.0),
        Tie(name="glue", slave="slave", master="master", search_distance=0.7, coverage_threshold=0.55),
        fix("bottom", "y"),
        fix("x0", "x"),
        Pressure(group="top", value=-2.0),
        thickness=2.5,
    ),
    "yielding": problem(
        cube, "3d",
        Material(law="plastic", young=1000.0, poisson=0.2, hardening=[[2.0, 0.0], [3.0, 0.02]], kinematic=40.0),
        move("x0", ux=[[0, 0], [1, -0.01], [2, 0.004]]),
        fix("y0", "y"),
        fix("z0", "z", kind="cell"),
        fix("x1", "x"),
        Steps(end=2.0, count=2),
    ),
    "round": problem(
        plane, "axisymmetric",
        Material(young=1000.0, poisson=0.0),
        contact(initial="none", clearance=-0.004),
        Rigid(group="top", fy=-6.0),
        fix("bottom", "y"),
        Steps(times=[0.25, 1.0, 2.0]),
        Output(format="med", units="kN, m, kPa", times=[0.5, 2.0]),
    ),
    "slid": problem(
        plane, "plane_strain",
        Material(young=100.0, poisson=0.3),
        contact(geometry="current", clearance=0.01),
        fix("bottom", "xy"),
        move("top", ux=0.5, uy=-0.005),
        Steps(count=2),
    ),
    **{f"massless {name}": falling(**keys) for name, keys in {
        "skins": {"scheme": "hht", "massless": "skins", "mass": "consistent", "alpha": 0.1, "rayleigh": [0.5, 0.0]},
        "slave": {"massless": "slave", "mass": "lumped"},
        "internal": {"massless": "internal"},
        "none": {"massless": "none", "start": 0.5, "rayleigh": [0.0, 0.0]},
    }.items()},
    **{f"sector {hexa}": ring(hexa) for hexa in ("pyramid", "hexa", "auto")},
    "sector stars": ring("pyramid", macro="stars"),
    "chosen": chosen(Contact),
    "tied chosen": chosen(Tie),
    "strain": columns(-2.0, contact(type="bilateral", stiffness=500.0)),
    "thick": columns(6.0, contact(), Material(young=1000.0, poisson=0.0), thickness={"lower": 2.0, "upper": 5.0}),
    "adjusted": columns(2.0, contact(adjust=0.02), mesh=gapped),
    "soft linear": columns(2.0, contact(law="linear", stiffness=400.0)),
    "soft exponential": columns(2.0, contact(law="exponential", pressure_at_contact=0.5, clearance_at_zero=0.002)),
    "soft table": columns(2.0, contact(law="table", pressures=[[0.0, 0.0], [1.0, 0.004], [3.0, 0.006]])),
    "measured": columns(
        10.0, contact(geometry="current", measure="current", initial="gap"), Material(young=100.0, poisson=0.3),
    ),
    "saint venant": columns(
        100.0, contact(), Material(law="saint_venant_kirchhoff", young=1000.0, poisson=0.3), kinematics="finite",
        follower=True,
    ),
    "neo-hookean": columns(
        100.0, contact(), Material(law="neo_hookean", young=1000.0, poisson=0.3), kinematics="finite", follower=True,
    ),
    "press 1": press("HEXA8", "TETRA10", "3d", "neo_hookean", measure="current", normals="smoothed"),
    "press 2": press("TETRA10", "HEXA20", "3d", "saint_venant_kirchhoff", normals="facet", follower=True),
    "press 3": press("QUAD4", "TRIA6", "axisymmetric", "neo_hookean", measure="current"),
    "press 4": press("QUAD9", "mixed 2", "plane_stress", "saint_venant_kirchhoff", 2.5, measure="current"),
    "smooth": slanted(contact(normals="smoothed", surface="faces")),
    "by the master": slanted(contact(normals="master", surface="faces")),
    "by the slave": slanted(contact(normals="slave", surface="faces")),
    "creased": slanted(contact(surface="smooth", crease_angle=20.0)),
    "tied faces": slanted(Tie(slave="slave", master="master", surface="faces")),
    "tied creased": slanted(Tie(slave="slave", master="master", surface="smooth", crease_angle=20.0)),
    "tolerant": pressed(Solver(tolerance=1e-3)),
    "symmetric": pressed(Solver(tangent="symmetric")),
    "consistent": pressed(Solver(tangent="consistent")),
    "halved": pressed(Solver(max_iterations=4), Steps(growth=1.0)),
    "given up": pressed(Solver(max_iterations=3), Steps(max_halvings=1)),
    "pyramid": stacked(4.0, hexa="pyramid"),
    "hexa": stacked(1.0, hexa="hexa"),
    "auto": stacked(4.0, hexa="auto"),
    "stars": stacked(4.0, Steps(count=2), macro="stars"),
}  # fmt: skip


# ---- hard problems without an answer in closed form, for the laws of units, places, turns and orders alone

SOFTLY = Spring(group="top", kx=30.0, ky=30.0)
DOWN, PUSHED = move("top", ux=0.004, uy=-0.03), move("top", ux=0.004, uy=0.002, uz=-0.03)
HUNG = Coupling(
    name="pin", group="top", ux=0.002, fy=-20.0, moment=0.2, axes={"x": [1.0, 0.0], "xy": [0.0, 1.0]},
)  # fmt: skip


def hard(mesh: Callable[[], Mesh], *records: Any, model: str = "plane_strain", **keys: Any) -> Problem:
    """Two blocks in contact, the lower one held; records may have a material of their own."""
    if not any(isinstance(one, Material) for one in records):
        law = "neo_hookean" if keys.get("kinematics") == "finite" else "elastic"
        records = (Material(young=1000.0, poisson=0.3, law=law), *records)
    return problem(mesh, model, fix("bottom", "xyz" if model == "3d" else "xy"), *records, **keys)


FINITE = {"kinematics": "finite"}
HARD = {
    "plane strain": hard(waving("QUAD4", "TRIA3"), contact(), DOWN),
    "plane stress, smoothed, bodied, sprung": hard(
        waving("QUAD8", "QUAD4"), contact(normals="smoothed"), SOFTLY,
        BodyForce(fx="0", fy="-20 * (1 + x)"), Traction(group="top", tx="3 * x", ty="-40 * t"),
        model="plane_stress", thickness=3.0,
    ),
    "plane, finite": hard(waving("TRIA6", "QUAD4"), contact(), DOWN, **FINITE),
    "plane, finite, follower": hard(
        waving("QUAD4", "QUAD4"), contact(), SOFTLY,
        Pressure(group="top", value="30 * t * (1 + 0.3 * x)", follower=True), **FINITE,
    ),
    "bilateral": hard(
        waving("TRIA3", "QUAD4"), contact(type="bilateral"), SOFTLY, Force(group="top", fx=0.4, fy=1.5),
    ),
    "rigid, finite": hard(
        waving("QUAD4", "TRIA3"), contact(), replace(SOFTLY, group="inner"),
        Rigid(group="top", centre=[0.5, 2.0], fx=2.0, fy=-15.0, moment=1.5), **FINITE,
    ),
    "two zones": hard(
        two_stacks, DOWN, Contact(slave="slave0", master="master0", normals="smoothed"),
        Contact(slave="slave1", master="master1"),
    ),
    "overlap": hard(waving("QUAD4", "TRIA3"), contact(geometry="current", clearance=-0.01), fix("top", "xy")),
    "warm, held along normals": problem(
        waving("QUAD8", "QUAD4"), "plane_strain", contact(), Material(young=1000.0, poisson=0.3, expansion=2e-3),
        *(move(group, un=0.0) for group in ("bottom", "x0", "top")), Temperature(value="20 * t * (1 + x)"),
    ),
    "axisymmetric": hard(
        waving("QUAD4", "TRIA3", shift=(0.5, 0, 0)), contact(), move("top", uy="-0.03 * t"), model="axisymmetric",
    ),
    "axisymmetric, finite, smoothed": hard(
        waving("QUAD8", "QUAD4", shift=(0.5, 0, 0)), contact(normals="smoothed"), move("top", uy="-0.03 * t"),
        model="axisymmetric", **FINITE,
    ),
    "in space": hard(waving("HEXA8", "TETRA4", (2, 2)), contact(), PUSHED, model="3d"),
    "in space, finite, smoothed": hard(
        waving("HEXA8", "HEXA8", (2, 1)), contact(normals="smoothed"), PUSHED, model="3d", **FINITE,
    ),
    "tie in space": hard(
        waving("TETRA4", "HEXA8", (2, 1)), Tie(slave="slave", master="master"),
        move("top", ux=0.01, uy=0.004, uz=0.02), model="3d",
    ),
    # rows of contact, whose size is an area, beside rows of equality, whose size is 1; they hold bodies that are free
    "coupled, tied": hard(
        waving("QUAD4", "QUAD4"), Tie(slave="slave", master="master"), Traction(group="top", tx=0.5, ty=-4.0),
        Coupling(name="pin", group="top", ux=0.002, uy=-0.01, rotation=0.001),
    ),
    "coupled, tied, in space": hard(
        waving("HEXA8", "HEXA8", (2, 1)), Tie(slave="slave", master="master"),
        Coupling(name="pin", group="top", ux=0.002, uy=-0.01, uz=0.001, rotation=[0.0, 0.0, 0.0]),
        Traction(group="top", tx=0.5, ty=-4.0, tz=0.5), model="3d",
    ),
    "held by contact and a coupling": hard(waving("QUAD4", "TRIA3"), contact(), HUNG),
    "held by contact and a coupling, finite": hard(waving("QUAD4", "QUAD4"), contact(), HUNG, **FINITE),
    "rubbing": hard(waving("QUAD4", "TRIA3"), contact(friction=0.3), move("top", ux=0.02, uy=-0.03)),
    "rubbing in space": hard(
        waving("HEXA8", "HEXA8", (2, 2)), contact(friction=0.3), move("top", ux=0.02, uy=0.002, uz=-0.03), model="3d",
    ),
    "rubbing, finite": hard(
        waving("QUAD4", "QUAD4"), contact(friction=0.3), move("top", ux=0.02, uy=-0.03), **FINITE,
    ),
    "soft contact": hard(
        waving("QUAD4", "TRIA3"), DOWN, contact(law="exponential", pressure_at_contact=0.5, clearance_at_zero=0.002),
    ),
    "bolted": problem(
        joint, "3d", Material(young=1000.0, poisson=0.0), contact(), fix("foot", "xyz"),
        Rigid(
            group="head", centre=[1.5, 0.5, 2.0], rotation=[0.0, 0.0, 0.0], fx=[[0, 0], [1, 0], [3, 0]],
            fy=[[0, 0], [1, 0], [3, 0]], fz=[[0, 0], [1, 0], [3, 10]],
        ),
        Pretension(group="shank", force=[[0, 0], [1, 10]], lock=1.0), Steps(times=[1.0, 2.0, 3.0]),
    ),
    "sector": problem(
        lambda: sector("QUAD4", (3, 3), 4, skew=0.1), "plane_strain", ELASTIC,
        Cyclic(slave="b", master="a", sectors=4, origin=[0.0, 0.0]), Pressure(group="out", value=20.0),
        move("in", ux="0.01 * x * (1 + t)", uy="0.01 * y * (1 + t)"),
    ),
    "yielding": hard(
        waving("QUAD4", "QUAD4"), contact(), move("top", ux=0.0005, uy=-0.006),
        Material(law="plastic", young=1000.0, poisson=0.3, hardening=[[2.0, 0.0], [3.0, 0.02]], kinematic=40.0),
    ),
    "thrown": hard(
        waving("QUAD4", "QUAD4"), contact(friction=0.3), Material(young=1000.0, poisson=0.3, density=1.0),
        Initial(groups=["upper"], vx=1.0, vy=-2.0), Dynamics(rayleigh=[0.1, 0.0]), Steps(end=0.05, count=5),
    ),
    "multigrid": hard(waving("QUAD4", "TRIA3"), contact(), HUNG, Solver(backend="multigrid")),
}  # fmt: skip
