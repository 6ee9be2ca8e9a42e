"""Placing of the eye, of bodies moved apart to show the skin between them, and of the camera of a picture."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from lacmesh.errors import LacmeshWarning
from lacmesh.mesh import Floats, Mesh
from lacmesh.scene.request import Placing
from lacmesh.scene.visible import MASTER, SLAVE, Vector, VisibleSurface, diagonal, is_segment, unit
from lacmesh.topology.bodies import label_components

#: where the eye is by default, and how far from straight on it may see the slave skin, in degrees
OBLIQUE, SEEN_AT = (1.0, -1.6, 0.9), 40.0
#: gap left by default between the bodies, as a part of the diagonal: in space, in the plane where a master is shown
GAP, PLANE_GAP = 0.05, 0.03
#: a skin whose mean normal is less than this looks every way
ONE_WAY = 0.3
#: a skin is in sight if this part of each patch is; patches that are looked at, and faces of each, at most; by how much
#: what hides a face is nearer to the eye, as a part of the diagonal
_IN_SIGHT, _PATCHES, _LOOKED_AT, _APART = 0.25, 16, 40, 1e-4


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


def arrange(mesh: Mesh, visible: VisibleSurface, eye: Floats, placing: Placing) -> tuple[ExplodedView | None, str]:
    """Return the motion of the bodies that carry slave faces, and how bodies are drawn, so that the skin is seen.

    Bodies are see-through where they hide it for all that may be moved, which then stays by default.
    """
    explode, tilt, bodies = placing.explode, placing.tilt, placing.bodies
    free = explode is None and tilt is None
    if bodies in ("ghost", "hidden") and free:
        explode, tilt = 0.0, 0.0  # nothing hides the skin
    view = find_exploded_view(mesh, visible, eye, explode, tilt)
    if bodies:
        return view, bodies
    shown = placing.part or mesh.space_dim == 2 or not visible.hidden
    if shown or shows_skin(exploded(mesh, visible, view), visible, eye):
        return view, "solid"
    return None if free else view, "ghost"


def shows_skin(points: Floats, visible: VisibleSurface, eye: Floats) -> bool:
    """True if, from the eye, a quarter of each patch of the slave skin, at points (n_nodes, 3), lies bare."""
    axes, corners = screen_axes(eye), visible.faces.corners
    corners = np.where(corners < 0, corners[:, :1], corners)
    x = (points @ axes)[corners]
    triangles = np.concatenate([x[:, :3], x[:, [0, 2, 3]]])
    boxes = triangles.min(axis=1), triangles.max(axis=1)
    least = _APART * diagonal(points[corners].reshape(-1, 3))
    slaves = visible.rows(SLAVE)
    joined = corners[slaves]
    patch = label_components(np.repeat(joined[:, 0], 4), joined.ravel(), len(points))[joined[:, 0]]
    for label in np.unique(patch)[:_PATCHES]:
        rows = slaves[patch == label]
        centres = x[rows[:: -(-len(rows) // _LOOKED_AT)]].mean(axis=1)
        if sum(not _hidden(centre, triangles, boxes, least) for centre in centres) < _IN_SIGHT * len(centres):
            return False
    return True


def _hidden(point: Floats, triangles: Floats, boxes: tuple[Floats, Floats], least: float) -> bool:
    """True if one of some triangles (t, 3, 3) is nearer to the eye than a point (3,), and in front of it.

    Coordinates are to the right, upwards and towards the eye. `boxes`: least and largest of each triangle (t, 3);
    `least`: by how much it has to be nearer.
    """
    low, high = boxes
    around = (low[:, :2] <= point[:2]).all(axis=1) & (high[:, :2] >= point[:2]).all(axis=1)
    a, b, c = np.moveaxis(triangles[around & (high[:, 2] > point[2] + least)], 1, 0)
    u, v, w = b - a, c - a, point - a
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    flat = area == 0
    r, s = ((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]) / np.where(flat, 1.0, area) for p, q in ((w, v), (u, w)))
    inside = (r >= 0) & (s >= 0) & (r + s <= 1) & ~flat
    return bool((inside & (r * u[:, 2] + s * v[:, 2] > w[:, 2] + least)).any())


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
