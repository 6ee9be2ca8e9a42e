"""Frames of a film of a run: at each time the deformed bodies, their visible faces, and a value at each node.

fields = the VTU files named by solid.pvd and contact_NAME.pvd                            (read_shots)
visible faces, once for all times: split into triangles around their centres              (Sight)
value = von Mises' stress, or the recovered pressure on the slave skins; NaN elsewhere    (COLOURS)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import lacmesh
from lacmesh.cells import CELLS
from lacmesh.errors import DataError, RequestError
from lacmesh.mesh import Floats, Ints, Mesh, codes
from lacmesh.topology.faces import cells_of_dim
from lacmesh.topology.facets import boundary_faces
from lacmesh.topology.skin import FACE_TYPES, N_NODES, Faces
from lacsolver.output.names import CONTACT, SOLID
from lacsolver.output.vtu import read_pvd

#: quantities that bodies may be coloured by, and their labels beside the scale
COLOURS = {"stress": "von Mises stress", "pressure": "contact pressure"}
#: children of a cell lie in the same face of it if the cosine between their normals is larger than this
_FLAT = 0.9


@dataclass(frozen=True, eq=False)
class Sight:
    """The visible faces of a mesh of `n_nodes` nodes. Points are the nodes, then the centre of each face.

    `triangles` (t, 3) cover the faces; `edges` (e, 2): edges of cells, without those between flat children of a cell
    that was cut; `rims` (r, 2): edges of one face only (the outlines of bodies in a plane, none in space); `bare`
    (b, 2): segments of skin cells in a plane. `centres`: for each type of face the nodes (f, k) whose mean is a centre.
    """

    dim: int
    n_nodes: int
    triangles: Ints
    edges: Ints
    rims: Ints
    bare: Ints
    centres: tuple[Ints, ...]

    @classmethod
    def of(cls, mesh: Mesh) -> Sight:
        """Find the visible faces: all cells in a plane, the outer faces and the skin cells of the mesh in space."""
        faces = list(_outer(mesh) if mesh.dim == 3 else cells_of_dim(mesh, 2))
        first = mesh.n_nodes + np.cumsum([0, *(len(nodes) for _, nodes, _ in faces)])
        fans = [_fan(nodes, _ring(kind), k) for (kind, nodes, _), k in zip(faces, first, strict=False)]
        triangles = np.concatenate([np.empty((0, 3), np.int64), *fans])
        centres = tuple(nodes for _, nodes, _ in faces)
        x = _with_means(mesh.points, centres)[triangles]
        cut = _parents(mesh)
        owner = [np.repeat(cut[cells], len(fan) // len(cells)) for (_, _, cells), fan in zip(faces, fans, strict=True)]
        edges, count = _edges(triangles, np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), np.concatenate([[], *owner]))
        bare = [_split(kind, nodes) for kind, nodes, _ in cells_of_dim(mesh, 1)] if mesh.dim == 2 else []
        rims = edges[count == 1] if mesh.dim == 2 else edges[:0]
        return cls(mesh.dim, mesh.n_nodes, triangles, edges, rims, np.concatenate([edges[:0], *bare]), centres)

    def points(self, nodal: Floats) -> NDArray[np.floating]:
        """Return values at nodes (n_nodes, ...), followed by their means over each face."""
        return _with_means(nodal, self.centres)


@dataclass(frozen=True, eq=False)
class Shot:
    """A frame: at a time the coordinates `x` (p, 3) of the points, and the `value` (p,), NaN where there is none."""

    time: float
    x: Floats
    value: Floats


@dataclass(frozen=True, eq=False)
class Shots:
    """The visible faces, and the frames at all times."""

    sight: Sight
    shots: tuple[Shot, ...]

    @property
    def box(self) -> NDArray[np.floating]:
        """The least and the largest coordinates over all times, (2, 3)."""
        x = np.concatenate([shot.x for shot in self.shots])
        return np.stack([x.min(axis=0), x.max(axis=0)])

    @property
    def span(self) -> tuple[float, float]:
        """The least and the largest value over all times; 0 and 1 if there is no value."""
        found = np.concatenate([shot.value for shot in self.shots])
        found = found[np.isfinite(found)]
        return (float(found.min()), float(found.max())) if len(found) else (0.0, 1.0)


def read_shots(folder: Path, colour: str, count: int | None = None) -> Shots:
    """Read the frames of all times with fields in a run's folder, or of at most `count` of them, evenly spaced.

    Raises RequestError for an unknown colour and if there are no fields, ReadError, DataError for damaged files.
    """
    if colour not in COLOURS:
        raise RequestError(f"bodies are coloured by {' or '.join(COLOURS)}, not by {colour!r}")
    entries = read_pvd(folder / f"{SOLID}.pvd")
    if not entries:
        wanted = 'name the folder of a run whose [output] has format = "vtu"'
        raise RequestError(f"{folder} holds no fields to film (solid.pvd and the files that it names); {wanted}")
    zones = _zones(folder) if colour == "pressure" else []
    if count is not None and count < len(entries):
        times = np.array([entry.time for entry in entries])
        even = np.linspace(times[-1 if count == 1 else 0], times[-1], count)
        entries = [entries[k] for k in np.unique(np.abs(times - even[:, None]).argmin(axis=1)).tolist()]
    first = lacmesh.read(folder / entries[0].file)
    sight, shots = Sight.of(first), []
    for entry in entries:
        mesh = lacmesh.read(folder / entry.file)
        if mesh.n_nodes != first.n_nodes:
            raise DataError(f"{folder / entry.file} is of another mesh than the files before; run the case again")
        value = _mises(mesh) if colour == "stress" else _pressure(mesh, folder, entry.time, zones)
        x = mesh.points + _field(mesh, "displacement", folder / entry.file)
        shots.append(Shot(entry.time, sight.points(x), sight.points(value)))
    return Shots(sight, tuple(shots))


def _zones(folder: Path) -> list[Mapping[float, str]]:
    """Return the file of each time, for each zone. Raises RequestError if there is no zone."""
    found: list[Mapping[float, str]] = [
        {e.time: e.file for e in read_pvd(p)} for p in sorted(folder.glob(f"{CONTACT}*.pvd"))
    ]
    if not found:
        raise RequestError(f"{folder} holds no contact to colour by its pressure; --colour stress needs none")
    return found


def _field(mesh: Mesh, name: str, path: Path) -> NDArray[np.floating]:
    if name not in mesh.node_data:
        raise DataError(f"{path} has no field {name!r}; run the case again")
    return np.asarray(mesh.node_data[name], float)


def _mises(mesh: Mesh) -> NDArray[np.floating]:
    """Return the von Mises stress (n_nodes,) of the stress with components XX YY ZZ XY YZ XZ."""
    xx, yy, zz, xy, yz, xz = _field(mesh, "stress", Path(SOLID)).T
    normal = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2
    return np.asarray(np.sqrt(normal / 2 + 3 * (xy**2 + yz**2 + xz**2)))


def _pressure(mesh: Mesh, folder: Path, time: float, zones: Iterable[Mapping[float, str]]) -> NDArray[np.floating]:
    """Return the recovered pressure (n_nodes,) on the slave skins of all zones, the larger one where two meet."""
    value = np.full(mesh.n_nodes, np.nan)
    order = np.argsort(mesh.node_number)
    for files in zones:
        if time in files:
            path = folder / files[time]
            skin = lacmesh.read(path)
            at = order[np.searchsorted(mesh.node_number, skin.node_number, sorter=order)]
            value[at] = np.fmax(value[at], _field(skin, "pressure_recovered", path))
    return value


def _with_means(nodal: Floats, faces: Iterable[Ints]) -> NDArray[np.floating]:
    return np.concatenate([nodal, *(nodal[nodes].mean(axis=1) for nodes in faces)])


def _parents(mesh: Mesh) -> Ints:
    """Return the parent of each cell, (n_cells,), -1 for none."""
    return np.asarray(mesh.cell_data.get("lac_parent", np.full(mesh.n_cells, -1)), np.int64)


def _outer(mesh: Mesh) -> Iterable[tuple[str, Ints, Ints]]:
    """Yield (type, nodes, cells): the faces that belong to one solid only, and the mesh's skin cells."""
    faces, cells = boundary_faces(mesh) if mesh.dim == 3 else (Faces.join([]), np.empty(0, np.int64))
    for code in codes(faces.type):
        rows = np.flatnonzero(faces.type == code)
        yield FACE_TYPES[code], faces.nodes[rows, : N_NODES[code]], cells[rows]
    yield from cells_of_dim(mesh, 2)


def _ring(kind: str) -> Ints:
    """Return the nodes around a face, in order."""
    facets = [np.asarray(facet.nodes) for facet in CELLS[kind].facets]
    return np.concatenate([[nodes[0], *nodes[2:]] for nodes in facets])


def _fan(nodes: Ints, ring: Ints, first: int) -> Ints:
    """Return triangles (f k, 3) between the centre of each face, numbered from `first`, and its edges."""
    around = nodes[:, ring]
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
