"""Models whose natural modes are known: strips and boxes on rollers, with a group of nodes for each side."""

from __future__ import annotations

import numpy as np

from lacmesh import Mesh
from lacsolver.case import parse_case
from lacsolver.problem.problem import Problem
from lacsolver.vibration.natural_modes import natural_modes
from tests.lacsolver.bodies import body

YOUNG, POISSON, DENSITY = 2.5, 0.25, 1.6
#: a mesh that is given to the problem, and no file
HEAD = 'mesh = "given.msh"\nmodel = "{model}"\n{more}[[material]]\nyoung = {young}\npoisson = {poisson}\n'


def text(model="plane_strain", sections="", *, young=YOUNG, poisson=POISSON, density=DENSITY, more=""):
    """A case file with one material."""
    head = HEAD.format(model=model, more=more, young=young, poisson=poisson)
    return head + (f"density = {density}\n" if density else "") + sections


def hold(**sides):
    """Displacements of 0 at groups: hold(x0="ux uy") holds both components there."""
    parts = []
    for group, names in sides.items():
        parts += ["[[displacement]]", f'group = "{group}"', *(f"{name} = 0.0" for name in names.split())]
    return "\n".join(parts) + "\n"


def modes_of(mesh, case, count=10, **options):
    """The natural modes of a case file's text on a mesh."""
    return natural_modes(Problem.of(parse_case(case), mesh), count=count, **options)


def with_groups(mesh):
    """The mesh with the nodes of each side of its bounding box as groups x0, x1, y0 ..."""
    x, groups = mesh.points, {}
    for s, axis in enumerate("xyz"[: mesh.space_dim]):
        for end, at in enumerate((x[:, s].min(), x[:, s].max())):
            groups[f"{axis}{end}"] = np.flatnonzero(np.abs(x[:, s] - at) < 1e-9)
    return Mesh.create(x, mesh.blocks, node_groups=groups, space_dim=mesh.space_dim, cell_groups=mesh.cell_groups)


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
