"""Models whose natural modes are known: strips and boxes on rollers, with a group of nodes for each side."""

from dataclasses import replace

import numpy as np

from lacsolver.case import Material
from lacsolver.problem.problem import Problem
from lacsolver.vibration.natural_modes import natural_modes
from tests.lacsolver.bodies import body
from tests.problems import case_of

YOUNG, POISSON, DENSITY = 2.5, 0.25, 1.6
SOLID = Material(young=YOUNG, poisson=POISSON, density=DENSITY)


def problem_of(mesh, *records, law=SOLID, model="plane_strain", **keys):
    """The problem of a body of one material."""
    return Problem.of(case_of(mesh, law, *records, model=model, **keys), mesh)


def modes_of(mesh, *records, count=10, mass="consistent", **case):
    """The natural modes of a body."""
    return natural_modes(problem_of(mesh, *records, **case), count=count, mass=mass)


def with_groups(mesh):
    """The mesh with the nodes of each side of its bounding box as groups x0, x1, y0 ..."""
    x, groups = mesh.points, {}
    for s, axis in enumerate("xyz"[: mesh.space_dim]):
        for end, at in enumerate((x[:, s].min(), x[:, s].max())):
            groups[f"{axis}{end}"] = np.flatnonzero(np.abs(x[:, s] - at) < 1e-9)
    return replace(mesh, node_groups=groups)


def block(name, n, model="plane_strain", size=(1.0, 1.0, 1.0), shift=0.0):
    """A box at the origin, or `shift` along x, n cells along each side."""
    low = np.array([shift, 0.0, 0.0])
    dim = 3 if model == "3d" else 2
    return with_groups(body(name, n, low[:dim], (low + size)[:dim]))


def strip(name, nx, ny, length, height):
    """A strip of nx by ny quadrangles, linear or quadratic."""
    return with_groups(body(name, 0, (0.0, 0.0), (length, height), (nx, ny)))


def waves(young=YOUNG, poisson=POISSON, density=DENSITY):
    """Speeds of longitudinal and of transverse waves in an infinite body."""
    mu = young / (2 * (1 + poisson))
    lam = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    return np.sqrt((lam + 2 * mu) / density), np.sqrt(mu / density)
