"""Placing of the eye, of bodies moved apart to show the skin between them, and of the camera of a picture."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from lacmesh.errors import LacmeshWarning
from lacmesh.mesh import Floats, Mesh
from lacmesh.scene.visible import MASTER, SLAVE, Vector, VisibleSurface, diagonal, is_segment, unit

#: where the eye is by default, and how far from straight on it may see the slave skin, in degrees
OBLIQUE, SEEN_AT = (1.0, -1.6, 0.9), 40.0
#: gap left by default between the bodies, as a part of the diagonal: in space, in the plane where a master is shown
GAP, PLANE_GAP = 0.05, 0.03
#: a skin whose mean normal is less than this looks every way
ONE_WAY = 0.3


@dataclass(frozen=True)
class ExplodedView:
    """Motion of the bodies that carry slave faces: rotation by `angle` about `axis` through `centre`, then a shift.

    `shift` (3,) keeps them clear of the other bodies, and leaves a gap.
    """

    centre: Floats
    axis: Floats
    angle: float
    shift: Floats

    @property
    def words(self) -> str:
        """The motion in words: opened, tilted, or both."""
        return ", ".join(["opened"] * bool(self.shift.any()) + ["tilted"] * (self.angle != 0))

    def of(self, x: Floats) -> Floats:
        """Apply the motion to points (n, 3)."""
        return self.centre + rotated(x - self.centre, self.axis, self.angle) + self.shift


def find_eye(mesh: Mesh, visible: VisibleSurface, camera: Vector | None) -> Floats:
    """Direction from the mesh towards the eye, (3,)."""
    if camera is not None:
        return unit(camera)
    if mesh.space_dim == 2:
        return np.array([0.0, 0.0, 1.0])
    outward = find_outward(mesh.points, visible)
    return unit((0 if visible.hidden else outward) + 0.6 * unit(OBLIQUE))


def find_outward(points: Floats, visible: VisibleSurface) -> Floats:
    """Mean unit normal (3,) of the slave skin, out of its bodies; 0 if the skin faces every way."""
    rows = visible.rows(SLAVE)
    if not len(rows):
        return np.zeros(3)
    slaves = visible.faces.take(rows)
    corners = slaves.corners
    x = points[np.where(corners < 0, corners[:, :1], corners)]
    third = np.where(is_segment(slaves)[:, None], x[:, 0] + [0.0, 0.0, 1.0], x[:, 2])
    normals = np.cross(x[:, 1] - x[:, 0], third - x[:, 0])
    own = (visible.role != SLAVE) & np.isin(visible.body, visible.slave_bodies)
    inside = points[visible.faces.nodes[own, 0]].mean(axis=0) if own.any() else x[:, 0].mean(axis=0)
    mean = normals.sum(axis=0)
    if np.linalg.norm(mean) <= ONE_WAY * np.linalg.norm(normals, axis=1).sum():
        return np.zeros(3)
    return unit(mean if mean @ (x[:, 0].mean(axis=0) - inside) >= 0 else -mean)


def find_exploded_view(
    mesh: Mesh, visible: VisibleSurface, eye: Floats, explode: float | None = None, tilt: float | None = None
) -> ExplodedView | None:
    """Find the motion of the bodies that carry slave faces which shows these; None if nothing has to move.

    Warns where a gap is asked for by `explode`, and nothing moves.
    """
    points, outward, plane = mesh.points, find_outward(mesh.points, visible), mesh.space_dim == 2
    if not outward.any() or not visible.hidden:
        if explode:
            warnings.warn(LacmeshWarning(f"explode {explode:g} moves nothing: {_why_still(visible)}"), stacklevel=2)
        return None
    if tilt is None:
        tilt = 0.0 if plane else max(0.0, float(np.degrees(np.arccos(np.clip(outward @ eye, -1, 1)))) - SEEN_AT)
    shown = points[np.isin(visible.body_of_node, visible.body)]
    gap = explode if explode is not None else GAP if not plane else PLANE_GAP if (visible.role == MASTER).any() else 0.0
    if tilt == gap == 0:
        return None
    mine, other = moving(visible)
    centre = (points[mine].min(axis=0) + points[mine].max(axis=0)) / 2
    axis = unit(eye if plane else np.cross(outward, eye))
    turned = centre + rotated(points[mine] - centre, axis, np.radians(tilt))
    overlap = (turned @ outward).max() - (points[other] @ outward).min()
    return ExplodedView(centre, axis, float(np.radians(tilt)), -(overlap + gap * diagonal(shown)) * outward)


def drawn_bodies(
    mesh: Mesh, visible: VisibleSurface, eye: Floats, view: ExplodedView | None, opened: bool = False
) -> str:
    """Return how bodies are drawn by default: `solid`, or `ghost` where they hide the slave skin and none is moved.

    `opened`: True where only a part of the cells is drawn, which shows the skin.
    """
    if view is not None or opened or mesh.space_dim == 2 or not visible.hidden:
        return "solid"
    return "ghost" if find_outward(mesh.points, visible) @ eye <= 0 else "solid"


def _why_still(visible: VisibleSurface) -> str:
    """Say why no body moves, and what to try."""
    if not len(visible.rows(SLAVE)):
        return "only bodies that carry a slave skin are moved, and none is shown; name the skin by slave"
    if not visible.hidden:
        return "no other body is in sight than those that carry the slave skin"
    return "the slave skin faces every way, so that there is none to move its body in; try a cutaway"


def moving(visible: VisibleSurface) -> tuple[Any, Any]:
    """Masks (n_nodes,) of the nodes of the bodies that carry slave faces, and of the others in sight."""
    mine = np.isin(visible.body_of_node, visible.slave_bodies)
    return mine, np.isin(visible.body_of_node, visible.body) & ~mine


def exploded(mesh: Mesh, visible: VisibleSurface, view: ExplodedView | None) -> Floats:
    """Points of the mesh, (n_nodes, 3), those of the bodies that carry slave faces moved."""
    if view is None:
        return mesh.points
    mine, _ = moving(visible)
    points = mesh.points.copy()
    points[mine] = view.of(points[mine])
    return points


def rotated(x: Floats, axis: Floats, angle: float) -> Floats:
    """Rotate vectors (n, 3) about an axis by an angle in radians (Rodrigues' formula)."""
    along = np.outer(x @ axis, axis)
    return along + np.cos(angle) * (x - along) + np.sin(angle) * np.cross(axis, x)


def screen_axes(eye: Floats) -> Floats:
    """Columns (3, 3) right, up and towards the eye; upright is y if seen along z, else z."""
    upright = np.array([0.0, 1.0, 0.0] if abs(eye[2]) > 0.999 else [0.0, 0.0, 1.0])
    right = unit(np.cross(upright, eye))
    return np.stack([right, np.cross(eye, right), eye], axis=1)


def fit_camera(points: Floats, eye: Floats, size: tuple[int, int], low: float, high: float) -> dict[str, Any]:
    """A camera of parallel rays that looks along -eye, upright, with all points in sight between two heights.

    `low`, `high`: the part of the picture's height that the points may take, from 0 at its foot to 1.
    """
    axes = screen_axes(eye)
    projected = points @ axes
    extent, middle = np.ptp(projected, axis=0), axes @ (projected.min(axis=0) + projected.max(axis=0)) / 2
    half = max(extent[1] / (high - low), extent[0] / 0.94 * size[1] / size[0]) / 2
    middle -= (high + low - 1) * half * axes[:, 1]
    distance = float(np.linalg.norm(extent)) or 1.0
    position = middle + distance * eye
    return {
        "focal": middle.tolist(),
        "position": position.tolist(),
        "up": axes[:, 1].tolist(),
        "scale": float(half) or 1.0,
    }
