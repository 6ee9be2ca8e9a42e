"""A sphere above a rigid wall, axisymmetric, of QUAD4 that are small near its lowest point."""

from __future__ import annotations

import numpy as np

from lacmesh import Mesh
from verification.grids import lines, quarter_disc
from verification.meshes.blocks import assembled
from verification.meshes.blocks import joined as together
from verification.meshes.bodies import body, joined


def sphere_on_wall(contact: float, gap: float, fineness: int = 10) -> Mesh:
    """A sphere of radius 1 whose lowest point is at height `gap`; `contact`: radius of the contact, about.

    Cells near it have a size of contact / fineness. Groups: `ball`, `slave` (an arc around the lowest point), `wall`.
    """
    h = contact / fineness / (np.pi / 4)
    along = lines(1.0, h, 2 * contact, 1.25)
    up, far = lines(1.0, h, 1.5 * contact, 1.25), np.linspace(0, 1, 7)
    lower, upper = quarter_disc(1.0, along, up), quarter_disc(1.0, along, far)
    upper = (upper * [1.0, -1.0] + [0.0, 2.0])[:, ::-1]  # turned over, still right-handed

    def slave(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return (np.abs(np.hypot(x, y - 1) - 1) < 1e-9) & (y < 1 - np.sqrt(0.5) + 1e-9)

    made = body(lower, upper, skins={"slave": slave})
    ball = joined({"ball": made._replace(points=made.points + np.array([0.0, gap]))})
    x = np.array([[1.5, 0.0, 0.0], [0.0, 0.0, 0.0]])  # it faces up
    wall = assembled(x, {("SEG2", "wall"): np.array([[0, 1]])}, 2)
    return together([(ball, {"ball": "ball", "slave": "slave"}), (wall, {"wall": "wall"})])
