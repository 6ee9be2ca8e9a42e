"""Motion of bars: cases as text, and what is looked at of a run."""

import numpy as np

from lacsolver.case import parse_case
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.results.motion import ENERGIES

#: signs of the energies in their account
SIGNS = np.array([-1.0 if name == "external" else 1.0 for name in ENERGIES])
YOUNG, POISSON, DENSITY = 1.0, 0.3, 1.0
#: speed of waves in a bar that cannot move sideways
SPEED = np.sqrt(YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON)) / DENSITY)
PLANE = 'mesh = "bars.msh"\nmodel = "plane_strain"\n'
SPACE = 'mesh = "bars.msh"\nmodel = "3d"\n'
_SOLID = f"young = {YOUNG}\npoisson = {POISSON}\ndensity = {DENSITY}\n"
SMALL = f"[[material]]\n{_SOLID}"
FINITE = f'kinematics = "finite"\n[[material]]\nlaw = "neo_hookean"\n{_SOLID}'
WALL = '[[contact]]\nslave = "slave"\nmaster = "wall"\n[[rigid]]\ngroup = "wall"\n'


def held_sideways(dim=2):
    """Conditions by which waves are those of one dimension."""
    sides = [(a, f"{a}{e}") for a in "xyz"[: dim - 1] for e in "01"]
    return "".join(f'[[displacement]]\ngroup = "{side}"\nu{a} = 0.0\n' for a, side in sides)


def thrown(groups, **motion):
    """[[initial]] of some groups."""
    return f'[[initial]]\ngroups = ["{groups}"]\n' + "".join(f"{name} = {value}\n" for name, value in motion.items())


def steps(end, count):
    return f"[steps]\nend = {end}\ncount = {count}\n"


def moved(text, mesh, start=None):
    """(the problem, its states in motion, the motion of each)."""
    problem = Problem.of(parse_case(text), mesh)
    states = [s for s in march(problem, start=start) if s.step.motion is not None]
    return problem, states, [s.step.motion for s in states]


def unbalanced(motions):
    """The largest error of the account of energy, relative to the largest energy."""
    table = np.array([m.energies for m in motions])
    return np.abs(table @ SIGNS).max() / np.abs(table).max()
