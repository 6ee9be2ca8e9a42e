"""Small cases of joints, memory and motion, each written for any units and any place as those of `invariant_cases` are.

Rows of contact, whose size is an area, stand beside rows of equality, whose size is 1; they hold bodies that are free.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from lacsolver.case import parse_case
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from tests.lacsolver.invariant_cases import Case, blocks, contact, held, material, text_of, tie, waved
from tests.lacsolver.patch_meshes import joined, stack
from tests.lacsolver.sectors import sector
from tests.lacsolver.test_pretension import joint


def _point(w, more, name="pin", group="top"):
    """A distributing coupling at the group's centre."""
    return f'[[coupling]]\nname = "{name}"\ngroup = "{group}"\n{more}'


def _tied(w):
    """A block tied to another one, whose top does not turn and is moved at its centre, under a traction."""
    turned = "rotation = 0.001\n" if w.dim == 2 else "rotation = [0.0, 0.0, 0.0]\n"
    top = w.vector(("ux", "uy", "uz"), (0.002, -0.01, 0.001), w.length) + turned.replace("0.001", sign(w, 0.001))
    load = '[[traction]]\ngroup = "top"\n' + w.vector(("tx", "ty", "tz"), (0.5, -4.0, 0.5), w.stress)
    return material(w) + tie(w, "slave", "master") + held(w, "bottom") + _point(w, top) + load


def sign(w, value):
    """A turn about z in a plane, whose sign changes in a mirror."""
    return repr(float(np.linalg.det(w.turn) * value))


def _hung(w, **options):
    """A block that contact and one displacement of a coupling's point hold, under a force and a moment at its point."""
    axes = f"axes = {{ x = {[float(c) for c in w.turn[:2, 0]]}, xy = {[float(c) for c in w.turn[:2, 1]]} }}\n"
    down, turn = repr(float(-20.0 * w.force)), sign(w, 0.2 * w.force * w.length)
    point = axes + f"ux = {0.002 * w.length!r}\nfy = {down}\nmoment = {turn}\n"
    return material(w) + contact(w, **options) + held(w, "bottom") + _point(w, point)


def _rubbing(w, law="elastic", friction=0.3):
    down = (0.02, -0.03, 0.0) if w.dim == 2 else (0.02, 0.002, -0.03)
    return material(w, law) + contact(w, friction=friction) + held(w, "bottom") + held(w, "top", down)


def _soft(w):
    zone = contact(w, law="exponential", pressure_at_contact=0.5 * w.stress, clearance_at_zero=0.002 * w.length)
    return material(w) + zone + held(w, "bottom") + held(w, "top", (0.004, -0.03, 0.0))


def _bolted(w):
    """A bolt that is tightened, locked, and pulled."""
    heads = f'[[rigid]]\ngroup = "head"\ncentre = {w.point([1.5, 0.5, 2.0])}\nrotation = [0.0, 0.0, 0.0]\n'
    pull = [float(c) for c in w.turn @ (0.0, 0.0, 10.0)]
    for name, value in zip(("fx", "fy", "fz"), pull, strict=True):
        heads += f"{name} = [[0, 0], [1, 0], [3, {value * w.force!r}]]\n"
    bolt = f'[[pretension]]\ngroup = "shank"\nforce = [[0, 0], [1, {10 * w.force!r}]]\nlock = 1.0\n'
    steps = "[steps]\ntimes = [1.0, 2.0, 3.0]\n"
    return material(w, poisson=0.0) + contact(w) + held(w, "foot") + heads + bolt + steps


def _sector(w):
    """A sector of a ring whose outside moves outwards in some places more than in others."""
    sides = f'[[cyclic]]\nslave = "b"\nmaster = "a"\nsectors = 4\norigin = {w.point([0.0, 0.0, 0.0])}\n'
    out = ("0.01 * x * (1 + t)", "0.01 * y * (1 + t)", "0")
    load = '[[pressure]]\ngroup = "out"\nvalue = ' + f"{20 * w.stress!r}\n"
    return material(w) + sides + held(w, "in", out) + load


def _yielding(w):
    law = f"hardening = [[{2 * w.stress!r}, 0.0], [{3 * w.stress!r}, 0.02]]\nkinematic = {40 * w.stress!r}\n"
    return material(w, "plastic", more=law) + contact(w) + held(w, "bottom") + held(w, "top", (0.0005, -0.006, 0.0))


def _thrown(w):
    """A block that falls on another one, with friction."""
    density = f"density = {w.stress / w.length**2!r}\n"
    speed = '[[initial]]\ngroups = ["upper"]\n' + w.vector(("vx", "vy", "vz"), (1.0, -2.0, 0.0), w.length)
    zone = contact(w, friction=0.3)
    steps = "[dynamics]\nrayleigh = [0.1, 0.0]\n[steps]\nend = 0.05\ncount = 5\n"
    return material(w, more=density) + zone + held(w, "bottom") + speed + steps


JOINED = {
    "coupled, tied": Case(blocks("QUAD4", "QUAD4", 2), "plane_strain", _tied),
    "coupled, tied, in space": Case(blocks("HEXA8", "HEXA8", 3, counts=(2, 1)), "3d", _tied),
    "held by contact and a coupling": Case(blocks("QUAD4", "TRIA3", 2), "plane_strain", _hung),
    "held by contact and a coupling, finite": Case(
        blocks("QUAD4", "QUAD4", 2),
        "plane_strain",
        lambda w: _hung(w).replace('law = "elastic"', 'law = "neo_hookean"'),
        finite=True,
    ),
    "rubbing": Case(blocks("QUAD4", "TRIA3", 2), "plane_strain", _rubbing),
    "rubbing in space": Case(blocks("HEXA8", "HEXA8", 3, counts=(2, 2)), "3d", _rubbing),
    "rubbing, finite": Case(
        blocks("QUAD4", "QUAD4", 2), "plane_strain", lambda w: _rubbing(w, "neo_hookean"), finite=True
    ),
    "soft contact": Case(blocks("QUAD4", "TRIA3", 2), "plane_strain", _soft),
    "bolted": Case(lambda: joint("HEXA8"), "3d", _bolted),
    "sector": Case(lambda: sector("QUAD4", (3, 3), 4, skew=0.1), "plane_strain", _sector),
    "yielding": Case(blocks("QUAD4", "QUAD4", 2), "plane_strain", _yielding),
    "thrown": Case(blocks("QUAD4", "QUAD4", 2), "plane_strain", _thrown),
    "multigrid": Case(blocks("QUAD4", "TRIA3", 2), "plane_strain", lambda w: 'backend = "multigrid"\n' + _hung(w)),
}


# ---- two contacts in one model, one much smaller than the other


def _pushed(w, k, size):
    return held(
        w,
        f"top{k}",
        (0.004 * size, -0.03 * size, 0.002 * size) if w.dim == 2 else (0.004 * size, 0.002 * size, -0.03 * size),
    )


def _hung_of(w, k, size):
    force = repr(-20.0 * size ** (w.dim - 1))
    fixed, along = ("ux = 0.0\n", "fy") if w.dim == 2 else ("ux = 0.0\nuy = 0.0\nrotation = [0.0, 0.0, 0.0]\n", "fz")
    return _point(w, f"{fixed}{along} = {force}\n", f"pin{k}", f"top{k}")


#: cells of slave and master, dimension, finite kinematics, and what moves the upper block
OF_TWO_SIZES = {
    "pushed": ("QUAD4", "TRIA3", 2, False, _pushed),
    "pushed, finite": ("QUAD4", "TRIA3", 2, True, _pushed),
    "pushed in space": ("HEXA8", "HEXA8", 3, False, _pushed),
    "hung": ("QUAD4", "TRIA3", 2, False, _hung_of),
    "hung in space": ("HEXA8", "HEXA8", 3, False, _hung_of),
    "hung, finite": ("QUAD4", "TRIA3", 2, True, _hung_of),
    "hung in space, finite": ("HEXA8", "HEXA8", 3, True, _hung_of),
}


@cache
def _alone(name, k):
    return solved_stacks(name, (1.0, 1.0), (k,))


def two_sizes(name, ratio):
    """The last state of a model of two stacks, the second so many times smaller, and those of each in a model alone."""
    return solved_stacks(name, (1.0, 1 / ratio), (0, 1)), _alone(name, 0), _alone(name, 1)


def solved_stacks(name, sizes, stacks, solver=""):
    """The last state of a model of some stacks of these sizes; `solver`: keys of [solver]."""
    low, high, dim, finite, moved = OF_TWO_SIZES[name]
    parts = []
    for k in stacks:
        mesh = waved(stack(low, high, dim, number=str(k), counts=(4, 3) if dim == 2 else (2, 2), skew=0.1), dim)
        names = {name: name if name.endswith(str(k)) else f"{name}{k}" for name in mesh.cell_groups}
        parts.append((replace(mesh, points=mesh.points * sizes[k]), np.array([3.0 * k, 0, 0]), names))

    def sections(w):
        text = solver + material(w, "neo_hookean" if finite else "elastic")
        for k in stacks:
            text += contact(w, f"slave{k}", f"master{k}") + held(w, f"bottom{k}") + moved(w, k, sizes[k])
        return text

    case = Case(lambda: joined(parts), "plane_strain" if dim == 2 else "3d", sections, finite)
    *_, state = march(Problem.of(parse_case(text_of(case, case.world)), case.mesh()))
    return state
