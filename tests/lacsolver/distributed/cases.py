"""Problems for several processes, on more cells than those of the corpus: what joins nodes, slides, flows and flies."""

from functools import partial

from lacmesh import join
from lacmesh.generate import box, line, rectangle, stack
from lacsolver.case import (
    Coupling,
    Cyclic,
    Dynamics,
    Equation,
    Gravity,
    Initial,
    Material,
    Pretension,
    Probe,
    Rigid,
    Steps,
    Tie,
    Traction,
)
from tests.lacsolver.sectors import sector
from tests.problems import contact, fix, move, problem

SOFT = Material(young=1.0, poisson=0.3, density=1.0)
FINITE = Material(law="neo_hookean", young=1.0, poisson=0.3, density=1.0)
METAL = Material(young=1000.0, poisson=0.3)
YIELDING = Material(law="plastic", young=1000.0, poisson=0.3, hardening=[[2.0, 0.0], [3.0, 0.1]], kinematic=20.0)
END = Probe(group="top", name="end")
TOUCH = contact(name="zone")


# ---- meshes


def bars(upper, lower, gap=0.0):
    """A maker of two bars on one another, which meet at 0: of each the kind, cells across and cells along."""

    def body(kind, across, along):
        flat = kind[:4] in ("TRIA", "QUAD")
        sides = 1 if flat else 2
        return (rectangle if flat else box)((*(across,) * sides, along), (*(0.25,) * sides, 1.0), kind)

    low, high = body(*lower), body(*upper)
    return lambda: stack(low, high, gap=gap).moved((0, -1) if low.space_dim == 2 else (0, 0, -1))


def on_wall(kind, along, across, gap=0.0):
    """A maker of a bar over a rigid wall, a face that is longer than the bar is wide."""
    bar = rectangle((across, along), (0.25, 1.0), kind).moved((0, gap)).renamed(bottom="slave", body="bar")
    return lambda: join(bar, line(1, (0.625, 0), (-0.375, 0)).renamed(body="wall"))


def bolted():
    """A bolt of two bodies that differ, on 0 < x < 1; and beside it a foot and a lid on 2 < x < 3."""
    low, high = box(2), box((3, 3, 2), corner=(0, 0, 1))
    foot, lid = box(2, corner=(2, 0, 0)), box((3, 3, 2), corner=(2, 0, 1))
    return join(
        low.renamed(bottom="foot", top="shank_a"), high.renamed(bottom="shank_b", top="head"),
        foot.renamed(bottom="foot", top="slave"), lid.renamed(bottom="master", top="head"),
    )  # fmt: skip


def two_sectors(skew=0.0):
    """A sixth of a ring on another; `skew`: radii shift from one side to the other."""
    low, high = (sector("HEXA8", counts, 6, skew=skew) for counts in ((3, 4, 2), (2, 3, 2)))
    return join(
        low.renamed(body="lower", top="slave"), high.moved((0, 0, 1)).renamed(body="upper", bottom="master", top="lid")
    )


# ---- problems

HELD = partial(fix, "bottom")
SIDES = Cyclic(slave="a", master="b", sectors=6)
LID = {"name": "lid", "group": "lid", "fz": "-20 * t", "moment": [0.0, 0.0, "2 * t"]}
TURNED = {"group": "top", "at": [0.2, 0.0, 1.5], "ux": 0.0, "uy": 0.0, "uz": "-0.05 * t"}
TURNED["rotation"] = [0.0, "0.02 * t", "0.1 * t"]
TERMS = Equation(
    terms=[
        {"factor": 2.0, "at": [0.0, 0.0, 1.0], "component": "uz"},
        {"factor": -1.0, "at": [0.25, 0.25, 1.0], "component": "ux"},
        {"factor": 1.0, "at": [0.25, 0.25, -0.5], "component": "uy"},
    ],
    value="0.01 * t",
)
SPACE = bars(("HEXA8", 2, 4), ("TETRA4", 1, 3))
SIDEWAYS = fix("left", "x"), fix("right", "x")


def flying(mesh, *records, model="plane_strain", law=SOFT, **keys):
    """Bodies in motion; a probe on the top."""
    return problem(mesh, model, law, END, *records, **keys)


def hit(mesh, speed, *records, zone=None, **keys):
    """A bar that flies onto a rigid wall."""
    zone = zone or contact(name="zone", master="wall")
    return flying(mesh, zone, Initial(groups=["bar"], vy=-speed), *records, **keys)


def rubbed(mesh, joint, moves, count, **keys):
    """A bar that is pressed on another and moved to and fro."""
    moved = {"ux": "0.07 * sin(5 * t)"} | moves
    law = FINITE if keys.get("kinematics") else SOFT
    flat = mesh().space_dim == 2
    model, axes = ("plane_strain", "xy") if flat else ("3d", "xyz")
    return problem(mesh, model, law, joint, HELD(axes), move("top", **moved), Steps(count=count), **keys)


def cyclic(joint, lid, *records, skew=0.0, count=2):
    """A sector whose lid is pressed and turned on it, with friction."""
    zone = contact(name="zone", friction=0.3, **joint)
    return problem(partial(two_sectors, skew), "3d", METAL, SIDES, zone, HELD("xyz"), lid, *records, Steps(count=count))


DOWN = "-0.05 * t - 0.1 * x * t"
#: at rest: bodies that are pressed, tied, adjusted, rubbed
STATIC = {
    "finite, smoothed": problem(
        SPACE, "3d", FINITE, contact(normals="smoothed"), HELD("xyz"),
        move("top", ux=0.01, uy=0.0, uz="-0.05 * t"), kinematics="finite",
    ),
    "a rigid top that is tied, finite": problem(
        bars(("TETRA4", 2, 4), ("HEXA8", 1, 3)), "3d", FINITE, Tie(slave="slave", master="master"), HELD("xyz"),
        Rigid(group="top", fx=0.0, fy=1e-6, fz="-1e-4 * t", moment=[0.0, "1e-6 * t", 0.0]), Steps(count=2),
        kinematics="finite",
    ),
    "a bare plate that contact alone stops": problem(
        on_wall("QUAD8", 8, 2), "plane_strain", SOFT, contact(name="zone", master="wall"), fix("top", "xy"),
        Rigid(group="wall", fy="0.01 * t", moment=0.0), Steps(count=2),
    ),
    "rubbed in a plane, finite": rubbed(
        bars(("QUAD8", 4, 4), ("TRIA6", 3, 3)), contact(name="zone", friction=0.1, cohesion=0.001), {"uy": DOWN}, 4,
        kinematics="finite",
    ),
    "rubbed in space, in the current geometry": rubbed(
        bars(("TETRA4", 3, 4), ("HEXA8", 2, 3)), contact(name="zone", friction=0.3, geometry="current"),
        {"ux": "0.07 * sin(2.5 * t)", "uy": "0.025 * t", "uz": "-0.025 * t - 0.05 * x * t"}, 3,
    ),
    "held by contact alone": problem(  # loads act on nodes of some processes only
        bars(("QUAD4", 2, 4), ("TRIA3", 2, 4)), "plane_strain", SOFT, contact(name="zone", friction=0.1), HELD("xy"),
        Traction(group="top", tx="2e-4 * t", ty="-5e-3 * t"), Steps(count=2),
    ),
    "metal": problem(  # pressed, relieved, and pressed more
        bars(("QUAD8", 3, 4), ("QUAD4", 2, 3)), "plane_strain", YIELDING, contact(), HELD("xy"),
        move("top", ux=0.0, uy=[[0, 0], [1, -0.01], [2, -0.004], [3, -0.02]]), Steps(end=3.0, count=3),
    ),
}  # fmt: skip
#: bodies that fly; the last one has no contact: no process has nodes of both bars, one of which stays at rest
MOVING = {
    "preloaded, pushed by a foot, damped": flying(
        bars(("TRIA3", 2, 5), ("QUAD4", 3, 4)), TOUCH, *SIDEWAYS, move("bottom", uy="0.01 * t ** 2"),
        Gravity(gy=-0.05), Dynamics(alpha=0.1, rayleigh=[0.02, 0.01], start=0.5), Steps(end=2.0, count=4),
    ),
    "in space, finite, thrown with a spin": flying(
        bars(("HEXA8", 2, 4), ("TETRA4", 1, 3), 0.02), TOUCH, Dynamics(scheme="newmark"), Steps(end=0.6, count=4),
        Initial(groups=["upper"], vz=-0.15, rotation=[0.0, 0.1, 0.05]), model="3d", law=FINITE, kinematics="finite",
    ),
    "a wall of its own mass, finite": hit(
        on_wall("QUAD4", 6, 1, 0.05), 0.53, Rigid(group="wall", fx=0.0, fy=0.0, moment=0.0, mass=0.5, inertia=0.01),
        Gravity(gx=0.1), Dynamics(), Initial(groups=["wall"], rotation=2.0), Steps(end=0.4, count=4), law=FINITE,
        kinematics="finite",
    ),
    "thrown so far in a step that it would pass through the wall": hit(
        on_wall("QUAD4", 4, 1, 0.7), 1.5, Rigid(group="wall"), *SIDEWAYS, Dynamics(), Steps(),
        zone=contact(name="zone", master="wall", geometry="current", search_distance=0.2),
    ),
    "thrown away from a bar at rest": flying(
        bars(("QUAD4", 2, 4), ("TRIA3", 2, 4), 0.1), *SIDEWAYS, Dynamics(), Steps(count=2),
        Initial(groups=["upper"], uy="0.01 * y", vy=0.15),
    ),
}  # fmt: skip
#: equations, couplings, bolts and sectors, whose nodes are those of several processes before they are put together
JOINED = {
    "a moved point of a coupling, finite": problem(
        SPACE, "3d", FINITE, TOUCH, HELD("xyz"), Coupling(**TURNED), Steps(count=2), kinematics="finite",
    ),
    "an equation of three nodes, in motion": flying(
        bars(("HEXA8", 2, 4), ("HEXA8", 1, 2)), TOUCH, HELD("xyz"), TERMS, Gravity(gz=-0.01), Dynamics(),
        Steps(count=4), model="3d",
    ),
    "a bolt of halves that do not match, finite": problem(
        bolted, "3d", Material(law="neo_hookean", young=1000.0, poisson=0.3), TOUCH, fix("foot", "xyz"),
        Rigid(group="head", ux=0.0, uy=0.0, fz=[[0, 0], [1, 0], [2, 6]]), Steps(end=2.0, count=2),
        Pretension(group="shank", force=[[0, 0], [1, 10]]), kinematics="finite",
    ),
    "a sector with friction": cyclic({}, Coupling(**LID), Equation(group="lid", same=["uz"])),
    "a sector of sides that do not match": cyclic(
        {"law": "table", "pressures": [[0, 0], [1, 0.002], [30, 0.02]]}, Coupling(**LID), skew=0.2
    ),
    "a support that begins late, and an equation": problem(
        bars(("HEXA8", 2, 4), ("HEXA8", 1, 2)), "3d", SOFT, contact(name="zone", friction=0.3), HELD("xyz"), TERMS,
        move("top", uy=0.0, uz=[[0, 0], [1, -0.01]]),
        move("top", ux=[[0, 0], [1, 0], [2, 0.005]], begin=1.0, reached=2.0), Steps(end=2.0, count=4),
    ),
}  # fmt: skip
CASES = {**STATIC, **MOVING, **JOINED}
