"""Frames of a film of a run: at each time the deformed bodies, their visible faces, and a value at each node.

fields = those of the written times of a folder                                           (read_frames)
visible surface, once for all times: split into triangles around the faces' centres       (DrawnSurface)
value = von Mises' stress, or the recovered pressure on the slave skins; NaN elsewhere    (COLOURS)

A natural mode has frames too: one period of its vibration, drawn with an amplitude that can be seen (`read_mode`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import lacmesh
from lacmesh.cells import CELLS
from lacmesh.errors import DataError, RequestError
from lacmesh.formats.vtu import read_pvd
from lacmesh.grids import FLAT, bodies_of, grid_of, outer_faces
from lacmesh.mesh import Floats, Ints, Mesh
from lacsolver.output.names import MODES_PVD
from lacsolver.output.states import StoredFields
from lacsolver.pictures.quantities import QUANTITIES, ends_of
from lacsolver.pictures.skins import ring
from lacsolver.results.nodal import von_mises
from lacsolver.results.results import Fields

#: quantities that bodies may be coloured by, and their labels beside the scale
COLOURS = {"stress": "von Mises stress", "pressure": "contact pressure"}
#: that of a natural mode
SHAPE = "displacement, relative to the largest"
#: amplitude of a natural mode, relative to the largest side of the bodies
_AMPLITUDE = 0.08
#: children of a cell lie in the same face of it if the cosine between their normals is larger than this
_FLAT = 0.9


@dataclass(frozen=True, eq=False)
class DrawnSurface:
    """The visible surface of a mesh of `n_nodes` nodes, in triangles. Points are the nodes, then the centres of faces.

    `triangles` (t, 3) cover the faces; `edges` (e, 2): edges of cells, without those between flat children of a cell
    that was cut; `outline` (r, 2): edges of one face only (of bodies in a plane, none in space); `segments`
    (s, 2): skin cells in a plane. `centres`: for each type of face the nodes (f, k) whose mean is a centre.
    """

    dim: int
    n_nodes: int
    triangles: Ints
    edges: Ints
    outline: Ints
    segments: Ints
    centres: tuple[Ints, ...]

    @classmethod
    def of(cls, mesh: Mesh) -> DrawnSurface:
        """Triangulate the visible surface: all cells in a plane; in space outer faces, and skins without solids."""
        every = _visible(mesh)
        faces = [face for face in every if CELLS[face[0]].dim == 2]
        segments = [_split(kind, nodes) for kind, nodes, _ in every if CELLS[kind].dim == 1]
        lines = [np.empty((0, 2), np.int64), *segments]
        first = mesh.n_nodes + np.cumsum([0, *(len(nodes) for _, nodes, _ in faces)])
        fans = [_fan(nodes, ring(kind), k) for (kind, nodes, _), k in zip(faces, first, strict=False)]
        triangles = np.concatenate([np.empty((0, 3), np.int64), *fans])
        centres = tuple(nodes for _, nodes, _ in faces)
        x = _with_means(mesh.points, centres)[triangles]
        parent = _parents(mesh)
        owner = [np.repeat(parent[own[2]], len(fan) // len(own[2])) for own, fan in zip(faces, fans, strict=True)]
        edges, count = _edges(triangles, np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), np.concatenate([[], *owner]))
        outline = edges[count == 1] if mesh.dim == 2 else edges[:0]
        return cls(mesh.dim, mesh.n_nodes, triangles, edges, outline, np.concatenate(lines), centres)

    def points(self, nodal: Floats) -> NDArray[np.floating]:
        """Return values at nodes (n_nodes, ...), followed by their means over each face."""
        return _with_means(nodal, self.centres)

    @cached_property
    def drawn(self) -> Ints:
        """Points (k,) of triangles and segments, each once."""
        return np.unique(np.concatenate([self.triangles.ravel(), self.segments.ravel()]))


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame: at a time the coordinates `x` (p, 3) of the points, and the `value` (p,), NaN where there is none.

    `words`: the time in words.
    """

    time: float
    x: Floats
    value: Floats
    words: str


@dataclass(frozen=True, eq=False)
class Frames:
    """The visible surface, and the frames at all times."""

    surface: DrawnSurface
    frames: tuple[Frame, ...]

    @property
    def box(self) -> NDArray[np.floating]:
        """The least and the largest coordinates over all times, (2, 3)."""
        x = np.concatenate([frame.x[self.surface.drawn] for frame in self.frames])
        return np.stack([x.min(axis=0), x.max(axis=0)])

    @property
    def span(self) -> tuple[float, float]:
        """Ends of a scale for the values of all times, 0 among them; 0 and 1 if there is no value but 0."""
        return ends_of(np.concatenate([frame.value for frame in self.frames]), zero=True)


def read_frames(folder: Path, colour: str, count: int | None = None) -> Frames:
    """Read the frames of all times with fields in a run's folder, or of at most `count` of them, evenly spaced.

    Raises RequestError for an unknown colour and if there are no fields, ReadError for damaged files.
    """
    if colour not in COLOURS:
        others = [name for name in QUANTITIES if name not in COLOURS]
        words = f"bodies are coloured by {' or '.join(COLOURS)}, and contacts by {' or '.join(others)}"
        raise RequestError(f"{words}, not by {colour!r}")
    stored = StoredFields(folder)
    if not stored.times:
        raise RequestError(f"{folder} holds no fields to film; run the case again")
    surface, frames = DrawnSurface.of(stored.mesh), []
    for k in even_times(stored.times, count):
        fields = stored.read(k)
        value = von_mises(fields.stress) if colour == "stress" else _pressure(fields, folder)
        x = stored.mesh.points + np.pad(fields.displacement, ((0, 0), (0, 3 - fields.displacement.shape[1])))
        frames.append(Frame(fields.time, surface.points(x), surface.points(value), f"t = {fields.time:.4g}"))
    return Frames(surface, tuple(frames))


def even_times(times: Sequence[float], count: int | None) -> list[int]:
    """Return the indices of at most `count` times, evenly spaced, the last among them; all for None.

    >>> even_times([0.0, 1.0, 2.0, 3.0, 4.0], 3), even_times([0.0, 1.0], None), even_times([0.0, 1.0], 1)
    ([0, 2, 4], [0, 1], [1])
    """
    if count is None or count >= len(times):
        return list(range(len(times)))
    even = np.linspace(times[-1 if count == 1 else 0], times[-1], count)
    chosen: list[int] = np.unique(np.abs(np.asarray(times) - even[:, None]).argmin(axis=1)).tolist()
    return chosen


def read_mode(folder: Path, number: int, count: int) -> Frames:
    """Read a natural mode of a folder of modes as `count` frames, evenly over a period, from the largest displacement.

    Raises RequestError if the folder has no such mode, ReadError, DataError for damaged files.
    """
    files = list(read_pvd(folder / MODES_PVD).values())
    if not files:
        raise RequestError(f"{folder} holds no natural modes (modes.pvd); name a folder that lacsolver modes wrote")
    if not 1 <= number <= len(files):
        raise RequestError(f"{folder} holds the modes 1 to {len(files)}, and not {number}")
    path = folder / files[number - 1]
    mesh = lacmesh.read(path)
    shape, surface = _field(mesh, "displacement", path), DrawnSurface.of(mesh)
    size, far = np.linalg.norm(shape, axis=1), np.ptp(mesh.points, axis=0).max()
    amplitude = _AMPLITUDE * far / (size.max() or 1.0)
    frames = []
    for k in range(count):
        part = np.cos(2 * np.pi * k / count)
        x, value = mesh.points + amplitude * part * shape, abs(part) * size
        frames.append(Frame(k / count, surface.points(x), surface.points(value), f"{k / count:.2f} of the period"))
    return Frames(surface, tuple(frames))


def _field(mesh: Mesh, name: str, path: Path) -> NDArray[np.floating]:
    if name not in mesh.node_data:
        raise DataError(f"{path} has no field {name!r}; run the case again")
    return np.asarray(mesh.node_data[name], float)


def _pressure(fields: Fields, folder: Path) -> NDArray[np.floating]:
    """Return the recovered pressure (n_nodes,) on the slave skins of all zones, the larger one where two meet.

    Raises RequestError if there is no zone.
    """
    if not fields.zones:
        raise RequestError(f"{folder} holds no contact to colour by its pressure; --colour stress needs none")
    value: NDArray[np.floating] = np.fmax.reduce([zone.pressure_recovered for zone in fields.zones.values()])
    return value


def _visible(mesh: Mesh) -> list[tuple[str, Ints, Ints]]:
    """Return the type, the nodes (f, k) and the cells (f,) of visible faces: outer ones in space, cells in a plane."""
    if mesh.dim < 3:
        return [(kind, nodes, cells) for kind, cells, nodes in mesh.select(np.flatnonzero(bodies_of(mesh)))]
    grid = grid_of(mesh)
    faces = outer_faces(grid.extract_cells(bodies_of(mesh)[np.asarray(grid["cell"])]))
    node, cell = np.asarray(faces["node"]), np.asarray(faces["cell"])
    return [(FLAT[kind], node[nodes], cell[faces.celltypes == kind]) for kind, nodes in faces.cells_dict.items()]


def _with_means(nodal: Floats, faces: Iterable[Ints]) -> NDArray[np.floating]:
    return np.concatenate([nodal, *(nodal[nodes].mean(axis=1) for nodes in faces)])


def _parents(mesh: Mesh) -> Ints:
    """Return the parent of each cell, (n_cells,), -1 for none."""
    return np.asarray(mesh.cell_data.get("lac_parent", np.full(mesh.n_cells, -1)), np.int64)


def _fan(nodes: Ints, places: Ints, first: int) -> Ints:
    """Return triangles (f k, 3) between the centre of each face, numbered from `first`, and its edges.

    `places` (k,): those of the nodes around a face, in order.
    """
    around = nodes[:, places]
    centre = np.broadcast_to(first + np.arange(len(nodes))[:, None], around.shape)
    return np.stack([centre, around, np.roll(around, -1, axis=1)], axis=-1).reshape(-1, 3)


def _edges(triangles: Ints, normal: Floats, parent: Ints) -> tuple[Ints, Ints]:
    """Return the outer edges (e, 2) of triangles, each once, and the number of triangles (e,) that share each.

    Edges between two children of the same cell that lie in one of its faces are left out.
    """
    n = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    ends = np.sort(triangles[:, 1:], axis=1)
    ends, first, of, count = np.unique(ends, axis=0, return_index=True, return_inverse=True, return_counts=True)
    of = of.ravel()
    alike = (parent >= 0) & (parent == parent[first][of]) & (np.einsum("td,td->t", n, n[first][of]) > _FLAT)
    inner = np.bincount(of, alike, minlength=len(ends)) == 2
    return ends[(count != 2) | ~inner], count[(count != 2) | ~inner]


def _split(kind: str, nodes: Ints) -> Ints:
    """Return the ends of segments, (s, 2); a segment with a node in between is split in two."""
    path = nodes[:, [0, *range(2, CELLS[kind].n_nodes), 1]]
    return np.concatenate([path[:, k : k + 2] for k in range(path.shape[1] - 1)])
