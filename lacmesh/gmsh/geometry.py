"""Geometry of a CAD file in a session of gmsh: the file opened, its shapes with their measures, its mesh."""

from __future__ import annotations

import os
import re
import signal
import sys
import tempfile
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.errors import DataError, LacmeshWarning, ReadError, RequestError, some
from lacmesh.gmsh.model import load, to_mesh
from lacmesh.mesh import Floats, Mesh
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import jacobian, shape
from lacmesh.topology.orientation import analyse_orientation, reverse

#: suffix -> what the file is
SUFFIXES = {
    ".geo": "a gmsh script",
    ".geo_unrolled": "a gmsh script",
    ".step": "STEP",
    ".stp": "STEP",
    ".iges": "IGES",
    ".igs": "IGES",
    ".brep": "BREP",
    ".stl": "STL",
}
#: options of the mesh that measures what is not of OpenCASCADE: 40 edges to a circle, curved ones
_FINE = {"MeshSizeFromPoints": 0, "MeshSizeFromCurvature": 0, "MinimumCircleNodes": 40, "MeshSizeFactor": 1}
_FINE |= {"MeshSizeMin": 0, "ElementOrder": 2, "SecondOrderLinear": 0}
#: normals of a plane agree to the first; a cylinder or sphere fits points and normals to the second
FLAT, _ROUND = 1e-4, 0.02
#: points of the unit square, spread evenly however many are taken
PLACES = np.array([[0.5, 0.5]] + [[(k * 0.618034) % 1, (k * 0.414214) % 1] for k in range(1, 40)])


@dataclass(frozen=True)
class CadShape:
    """An entity of a geometry. `measure`: length, area or volume; `centre` of it; `box`: least and greatest corner.

    `normal`: out of the first body, where it is the same all over. `radius`: of circles, cylinders, spheres; negative
    where the body is outside (a bore). `bodies`: tags of the bodies that it bounds. `groups`: names of its groups.
    `name`: that of the part in a STEP file, "" without one.
    """

    dim: int
    tag: int
    type: str
    measure: float
    centre: tuple[float, float, float]
    box: tuple[tuple[float, float, float], tuple[float, float, float]]
    normal: tuple[float, float, float] | None = None
    radius: float | None = None
    bodies: tuple[int, ...] = ()
    groups: tuple[str, ...] = ()
    name: str = ""


@contextmanager
def opened(path: Path, dim: int | None) -> Iterator[tuple[Any, int]]:
    """Open a file in a session of gmsh: the package, and the dimension of its bodies. An interrupt ends the process.

    Warns of what the file lacks. Raises ReadError, DataError, RequestError where gmsh runs already.
    """
    gmsh = load()
    if gmsh.isInitialized():
        raise RequestError("gmsh runs in this program already; mesh the file with gmsh, then use lacmesh.gmsh.to_mesh")
    main = threading.current_thread() is threading.main_thread()
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM) if main}
    gmsh.initialize(interruptible=False)
    try:
        for number in handlers:
            signal.signal(number, signal.SIG_DFL)  # gmsh does not listen
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.logger.start()
        dim = _open(gmsh, path, dim)
        yield gmsh, dim
    except (DataError, RequestError) as error:
        raise type(error)(f"{path}: {error}") if type(error) in (DataError, RequestError) else error from None
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        gmsh.logger.stop()
        gmsh.finalize()


def _open(gmsh: Any, path: Path, dim: int | None) -> int:
    """Open a file and return the dimension of its bodies. Raises ReadError, DataError."""
    file_type = SUFFIXES[path.suffix.lower()]
    script = path.read_bytes() if path.suffix.lower() == ".geo" else b""
    if re.search(rb"\bExit\b", re.sub(rb'"[^"]*"|//[^\n]*|/\*.*?\*/', b"", script, flags=re.DOTALL)):
        raise ReadError(path, "its statement Exit would end this program; take it out")
    if script.rpartition(b"\n")[2].count(b";") > 1:
        warn(f"{path}: its last line has no end, and gmsh may leave out what stands on it; add a line end")
    failed: ReadError | None = None
    with tempfile.TemporaryFile() as printed:  # gmsh's readers of STEP and IGES print their errors
        try:
            with _printing_into(printed.fileno()):
                _merge(gmsh, path, file_type)
                if file_type == "IGES" and dim != 2 and gmsh.model.getDimension() == 2:
                    _sew(gmsh, path)
        except ReadError as error:
            failed = error
        printed.seek(0)
        text = re.sub(r"\x1b\[[0-9;]*m", "", printed.read().decode(errors="replace"))
    complaints = list(dict.fromkeys(re.findall(r"\*\* ERR \w+ : (.*?)\s*\*\*", text)))
    if failed is not None:
        raise ReadError(path, "; ".join([str(failed).removeprefix(f"{path}: "), *complaints[:1]]))
    for complaint in complaints:
        warn(f"{path}: its reader says {complaint}; shapes may be missing")
    if not gmsh.model.getEntities():
        raise ReadError(path, f"there is no geometry in it; is it {file_type}?")
    if not np.isfinite(gmsh.model.mesh.getNodes()[1]).all():  # of the triangles of an STL
        raise ReadError(path, "some of its coordinates are not finite numbers")
    if errors := gmsh_errors(gmsh):
        raise ReadError(path, f"gmsh reads it with errors ({errors[0]})")
    gmsh.option.setNumber("Geometry.OCCBoundsUseStl", 1)  # boxes that fit, where OCC would leave room
    there = gmsh.model.getDimension()
    if there < (dim or 2):
        what = {0: "points", 1: "curves", 2: "surfaces"}[there]
        raise DataError(f"the file holds {what} and no {'volume' if dim == 3 else 'surface'}")
    dim = dim or there
    bounds = {abs(tag) for around in _boundary(gmsh, dim).values() for tag in around}
    bounds |= {t for e in gmsh.model.getEntities(dim) for d, t in gmsh.model.mesh.getEmbedded(*e) if d == dim - 1}
    loose = [int(t) for _, t in gmsh.model.getEntities(dim - 1) if t not in bounds]
    if loose:
        what, of = ("surfaces", "volume") if dim == 3 else ("curves", "surface")
        warn(f"{path}: {len(loose)} {what} bound no {of} ({some(loose)}); is a body open, or a part of it lost?")
    return dim


@contextmanager
def _printing_into(file: int) -> Iterator[None]:
    """Let what this process prints, also in C++, go into a file inside the block."""
    sys.stdout.flush()
    outputs = {number: os.dup(number) for number in (1, 2)}
    try:
        for number in outputs:
            os.dup2(file, number)
        yield
    finally:
        for number, copy in outputs.items():
            os.dup2(copy, number)
            os.close(copy)


def _merge(gmsh: Any, path: Path, file_type: str) -> None:
    try:
        gmsh.open(str(path))
        if file_type == "STL":  # surfaces between edges of 40 degrees, each with a parametrization
            gmsh.model.mesh.removeDuplicateNodes()
            gmsh.model.mesh.classifySurfaces(np.radians(40), True, True, np.pi)
            gmsh.model.mesh.createGeometry()
            gmsh.model.removeEntities(gmsh.model.getEntities(3))
            gmsh.model.geo.synchronize()
    except Exception as error:  # gmsh's own class of errors
        message = str(error).replace(f"'{path}', ", "").replace(str(path), path.name)
        raise ReadError(path, f"gmsh cannot read it as {file_type} ({message})") from error


def _sew(gmsh: Any, path: Path) -> None:
    """Open an IGES file of surfaces again, sewn to volumes. Raises DataError if some are lost."""
    before = sum(gmsh.model.occ.getMass(*tag) for tag in gmsh.model.getEntities(2))
    gmsh.clear()
    gmsh.option.setNumber("Geometry.OCCSewFaces", 1)
    gmsh.option.setNumber("Geometry.OCCMakeSolids", 1)
    _merge(gmsh, path, "IGES")
    after = sum(gmsh.model.occ.getMass(*tag) for tag in gmsh.model.getEntities(2))
    if not gmsh.model.getEntities(3) or abs(after - before) > FLAT * before:
        cure = "save it as STEP, or mesh it as a shell (--dim 2)"
        raise DataError(f"its surfaces cannot be sewn to volumes without loss (IGES has no volumes); {cure}")


def warn(message: str) -> None:
    """Warn of a CAD file."""
    warnings.warn(LacmeshWarning(message), stacklevel=5)


def gmsh_errors(gmsh: Any) -> list[str]:
    """Errors that gmsh has logged so far, each once."""
    return list(dict.fromkeys(line.removeprefix("Error: ") for line in gmsh.logger.get() if line.startswith("Error: ")))


def _boundary(gmsh: Any, dim: int) -> dict[int, list[int]]:
    """Tags of the entities that bound each body of dimension `dim`."""
    bodies = gmsh.model.getEntities(dim)
    around = (gmsh.model.getBoundary([body], combined=False, oriented=False) for body in bodies)
    return {int(tag): [int(t) for _, t in bounds] for (_, tag), bounds in zip(bodies, around, strict=True)}


def diagonal(gmsh: Any) -> float:
    """The diagonal of the box around the current model."""
    box = np.array(gmsh.model.getBoundingBox(-1, -1))
    return float(np.linalg.norm(box[3:] - box[:3]))


# ---- shapes


def shapes(gmsh: Any, dim: int) -> list[CadShape]:
    """Shapes of the bodies, of dimension `dim`, and of the entities that bound them."""
    bounds = _boundary(gmsh, dim)
    wanted = [(d, int(t)) for d in (dim, dim - 1) for _, t in gmsh.model.getEntities(d)]
    try:
        known = {(int(d), int(t)) for d, t in gmsh.model.occ.getEntities()}
    except Exception:  # gmsh's own class: no such kernel in this model
        known = set()
    exact = dim == 3 and set(wanted) <= known
    mesh = None if exact else _fine_mesh(gmsh, dim)
    listed = []
    for d, tag in wanted:
        bodies = tuple(body for body, around in bounds.items() if d < dim and tag in around)
        if mesh is None:
            measure, centre = 0.0, (0.0, 0.0, 0.0)
            normal, radius = _facing_outward(gmsh, tag, bodies) if d == 2 else (None, None)
        else:
            measure, centre, normal, radius = _measured(mesh, d, tag, len(bodies))
        if (d, tag) in known:
            measure, centre = gmsh.model.occ.getMass(d, tag), _triple(gmsh.model.occ.getCenterOfMass(d, tag))
        kind, box = gmsh.model.getType(d, tag), gmsh.model.getBoundingBox(d, tag)
        name = gmsh.model.getEntityName(d, tag).rpartition("/")[2]  # of a path of assemblies
        groups = [abs(int(g)) for g in gmsh.model.getPhysicalGroupsForEntity(d, tag)]
        listed.append(
            CadShape(
                dim=d,
                tag=tag,
                type=kind.removesuffix(" surface") if d == 2 and kind != "Discrete surface" else kind,
                measure=measure,
                centre=centre,
                box=(_triple(box[:3]), _triple(box[3:])),
                normal=normal,
                radius=radius,
                bodies=bodies,
                groups=tuple(gmsh.model.getPhysicalName(d, g) or f"{d}:{g}" for g in groups),
                name="" if name.startswith("Open CASCADE STEP translator") else name,
            )
        )
    return listed


def _triple(values: Any) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return x, y, z


def _facing_outward(gmsh: Any, tag: int, bodies: tuple[int, ...]) -> tuple[Any, float | None]:
    """Normal and radius of a surface of OpenCASCADE; the normal points out of its first body."""
    low, high = (np.array(p) for p in gmsh.model.getParametrizationBounds(2, tag))
    at = low + PLACES * (high - low)
    inside = np.array([gmsh.model.isInside(2, tag, p, parametric=True) for p in at], bool)
    at = (at[inside] if inside.any() else at).ravel()
    points, normals = gmsh.model.getValue(2, tag, at).reshape(-1, 3), gmsh.model.getNormal(tag, at).reshape(-1, 3)
    behind = points[0] - 1e-5 * diagonal(gmsh) * normals[0]
    if bodies and not gmsh.model.isInside(3, bodies[0], behind):
        normals = -normals
    return _facing(points, normals)


def _facing(points: Floats, normals: Floats) -> tuple[tuple[float, float, float] | None, float | None]:
    """Normal of a flat shape, or radius of a round one, from points (n, 3) and outward unit normals there.

    On a cylinder or sphere p = R n, except along the axis, where normals do not change.
    """
    mean = normals.mean(axis=0)
    n, p = normals - mean, points - points.mean(axis=0)
    if np.abs(n).max() < FLAT:
        return _triple(mean / np.linalg.norm(mean)), None
    _, sizes, axes = np.linalg.svd(n, full_matrices=False)
    across = axes[sizes > 1e-3 * sizes[0]]
    p = p @ across.T @ across
    radius = float((p * n).sum() / (n * n).sum())
    return None, radius if np.linalg.norm(p - radius * n) < _ROUND * np.linalg.norm(p) else None


def _fine_mesh(gmsh: Any, dim: int) -> Mesh:
    """Mesh as fine as the curvature requires, whatever the file says, its skin oriented outward; an STL's own cells."""
    if not any(gmsh.model.mesh.getElementTypes(2)):
        for tag in gmsh.model.mesh.field.list():
            gmsh.model.mesh.field.remove(tag)
        for option, value in {**_FINE, "MeshSizeMax": diagonal(gmsh) / 20}.items():
            gmsh.option.setNumber(f"Mesh.{option}", value)
        generate_mesh(gmsh, dim)
    mesh = to_mesh()
    return reverse(mesh, analyse_orientation(mesh, np.flatnonzero(mesh.cell_dim == dim - 1)).to_flip)


def _measured(
    mesh: Mesh, d: int, tag: int, n_bodies: int
) -> tuple[float, tuple[float, float, float], Any, float | None]:
    """Measure, centre, normal and radius of a shape from its cells; no normal between bodies."""
    cells = np.flatnonzero((mesh.cell_data["entity"] == [d, tag]).all(axis=1))
    plane = not np.ptp(mesh.points[:, 2]) > 0
    points, vectors, weights = [], [], []
    for kind, _, nodes in mesh.select(cells):
        X, w = rule(CELLS[kind].family, 6)
        J = jacobian(kind, mesh.points[nodes], X)
        points.append(np.einsum("pn,cns->cps", shape(kind, X), mesh.points[nodes]).reshape(-1, 3))
        weights.append((np.sqrt(np.abs(np.linalg.det(J.swapaxes(2, 3) @ J))) * w).ravel())
        if d < 3:
            n = np.cross(J[..., 0], J[..., 1] if d == 2 else [0.0, 0.0, 1.0])
            vectors.append((n / np.maximum(np.linalg.norm(n, axis=-1, keepdims=True), 1e-300)).reshape(-1, 3))
    if not points:
        raise DataError(f"gmsh leaves the shape {d}:{tag} without cells, and cannot measure it; repair the geometry")
    x, w = np.concatenate(points), np.concatenate(weights)
    faces = n_bodies < 2 and (d == 2 or (d == 1 and plane))
    facing = _facing(x, np.concatenate(vectors)) if faces else (None, None)
    return float(w.sum()), _triple(w @ x / w.sum()), facing[0], facing[1]


def generate_mesh(gmsh: Any, dim: int) -> None:
    """Make the mesh. Raises DataError where gmsh fails, or leaves a body empty."""
    cure = "try a smaller --size, or repair the geometry"
    try:
        gmsh.model.mesh.generate(dim)
    except Exception as error:  # gmsh's own class of errors
        messages = gmsh_errors(gmsh) or [str(error)]
        raise DataError(f"gmsh cannot mesh it ({'; '.join(messages[:2])}); {cure}") from error
    empty = [t for _, t in gmsh.model.getEntities(dim) if not len(gmsh.model.mesh.getElementTypes(dim, t))]
    if empty:
        why = "".join(f" ({line})" for line in gmsh_errors(gmsh)[:1])
        raise DataError(f"gmsh left {'volumes' if dim == 3 else 'surfaces'} {some(empty)} without cells{why}; {cure}")
