"""Motion of bars: parts of a case file, and the account of energy."""

import numpy as np

from lacsolver.equilibrium.motion import ENERGIES

#: signs of the energies in their account
SIGNS = np.array([-1.0 if name == "external" else 1.0 for name in ENERGIES])
YOUNG, POISSON, DENSITY = 1.0, 0.3, 1.0
#: speed of waves in a bar that cannot move sideways
SPEED = np.sqrt(YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON)) / DENSITY)
PLANE = 'mesh = "bars.msh"\nmodel = "plane_strain"\n'
SPACE = 'mesh = "bars.msh"\nmodel = "3d"\n'
_SOLID = f"young = {YOUNG}\npoisson = {POISSON}\ndensity = {DENSITY}\n"
SMALL = f"[[material]]\n{_SOLID}"
WALL = '[[contact]]\nslave = "slave"\nmaster = "wall"\n[[rigid]]\ngroup = "wall"\n'


def unbalanced(motions):
    """The largest error of the account of energy, relative to the largest energy."""
    table = np.array([m.energies for m in motions])
    return np.abs(table @ SIGNS).max() / np.abs(table).max()
