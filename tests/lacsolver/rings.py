"""A quarter of a thick ring or tube, or of a sphere, 1 <= r <= 2, under inner pressure, and its exact displacement."""

from __future__ import annotations

import numpy as np

from lacmesh import Mesh
from lacmesh.cells import CELLS
from tests.lacsolver.bodies import body

#: sections of a case: symmetry, and inner pressure 1
TEXT = """
[[displacement]]
group = "y0"
uy = 0.0
[[displacement]]
group = "x0"
ux = 0.0
[[pressure]]
group = "inner"
value = 1.0
[[probe]]
group = "inner"
name = "a"
"""


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


def case_text(model, poisson, material="", law="elastic", more=""):
    """The text of a case of a ring with young = 1."""
    flat = "".join(f'[[displacement]]\ngroup = "z{k}"\nuz = 0.0\n' for k in (0, 1)) if model == "3d" else ""
    constants = material or f"young = 1.0\npoisson = {poisson}\n"
    head = f'mesh = "ring.msh"\nmodel = "{model}"\n{more}[[material]]\nlaw = "{law}"\ngroups = ["rubber"]\n{constants}'
    return head + flat + TEXT


def exact(poisson, sphere=False):
    """u(a) of the ring (plane strain) or of the sphere."""
    if sphere:
        return ((1 - 2 * poisson) + (1 + poisson) * 4) / 7
    return (1 + poisson) / 3 * (1 - 2 * poisson + 4)
