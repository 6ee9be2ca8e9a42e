"""A quarter of a thick ring or tube, or of a sphere, 1 <= r <= 2, under inner pressure, and its exact displacement."""

import numpy as np

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacsolver.case import Material, Pressure
from tests.lacsolver.bodies import body
from tests.problems import case_of, fix


def ring(name, n, radial=0):
    """n x n (x n) cells; `radial`: axis of the cube that becomes the radius (2: prisms stand on the inner skin)."""
    made = body(name, n)
    at = np.roll(made.points, -radial, axis=1)
    at[:, 0] += CELLS[name].dim == 3
    r, angle = at[:, 0], at[:, 1] * np.pi / 2
    points = np.column_stack([r * np.cos(angle), r * np.sin(angle), 0.25 * at[:, 2]])
    points[np.abs(points) < 1e-12] = 0.0
    planes = {"inner": at[:, 0] == 1, "x0": points[:, 0] == 0, "y0": points[:, 1] == 0}
    if CELLS[name].dim == 3:
        planes |= {"z0": at[:, 2] == 0, "z1": at[:, 2] == 1}
    blocks, groups = [(b.type, b.nodes) for b in made.blocks], {}
    faces = {}
    for block in made.blocks:
        for facet in CELLS[block.type].facets:
            nodes = block.nodes[:, list(facet.nodes)]
            faces.setdefault(facet.type, []).append(nodes[planes["inner"][nodes].all(axis=1)])
    skin = [(kind, np.concatenate(rows)) for kind, rows in faces.items() if sum(map(len, rows))]
    n_cells = sum(len(nodes) for _, nodes in blocks)
    groups = {"inner": n_cells + np.arange(sum(len(rows) for _, rows in skin)), "rubber": np.arange(n_cells)}
    nodes = {key: np.flatnonzero(on) for key, on in planes.items() if key != "inner"}
    return Mesh.create(points, blocks + skin, cell_groups=groups, node_groups=nodes)


def case_on(mesh, model, poisson, law="elastic", **keys):
    """The case of a ring with young = 1 under an inner pressure of 1, by symmetry; `keys`: at the top of a case."""
    rubber = Material(law=law, groups=["rubber"], young=1.0, poisson=poisson)
    held = fix("y0", "y"), fix("x0", "x"), *([fix("z0", "z"), fix("z1", "z")] if model == "3d" else [])
    return case_of(mesh, rubber, *held, Pressure(group="inner", value=1.0), model=model, **keys)


def exact(poisson, sphere=False):
    """u(a) of the ring (plane strain) or of the sphere."""
    if sphere:
        return ((1 - 2 * poisson) + (1 + poisson) * 4) / 7
    return (1 + poisson) / 3 * (1 - 2 * poisson + 4)
