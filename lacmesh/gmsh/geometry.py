"""Geometry of a CAD file opened by gmsh: its shapes, with the measures of each. Runs in the child process."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.errors import DataError, LacmeshWarning, ReadError, some
from lacmesh.gmsh import stl
from lacmesh.gmsh.cad import SUFFIXES, CadShape
from lacmesh.gmsh.model import read_model
from lacmesh.mesh import Floats, Mesh, Tag
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import jacobian, shape
from lacmesh.topology.orientation import analyse_orientation, reverse

#: options of the mesh that measures what gmsh's kernels cannot: 40 edges to a circle, curved ones. (Sizes by curvature
#: are very slow in the built-in kernel: 50 s for gmsh's t2.geo.)
_PLAIN = {
    "MeshSizeFromPoints": 0,
    "MeshSizeFromCurvature": 0,
    "MinimumCircleNodes": 40,
    "MeshSizeFactor": 1,
    "MeshSizeMin": 0,
    "ElementOrder": 2,
    "SecondOrderLinear": 0,
}
#: normals of a plane agree to the first; a cylinder or sphere fits points and normals to the second
_FLAT, _ROUND = 1e-4, 0.02


def open_file(gmsh: Any, path: Path, dim: int | None) -> int:
    """Open a file and return the dimension of its bodies. Raises ReadError, DataError."""
    file_type = SUFFIXES[path.suffix.lower()]
    if path.suffix.lower() == ".geo":
        _check_last_line(path)
    _open(gmsh, path, file_type)
    gmsh.option.setNumber("Geometry.OCCBoundsUseStl", 1)  # boxes that fit, where OCC would leave room
    if file_type == "STL":
        stl.make_geometry(gmsh, path, volumes=dim != 2)
    if file_type == "IGES" and dim != 2 and gmsh.model.getDimension() == 2:
        _sew(gmsh, path)
    there = gmsh.model.getDimension()
    if there < (dim or 2):
        what = {0: "points", 1: "curves", 2: "surfaces"}[there]
        raise DataError(f"the file holds {what} and no {'volume' if dim == 3 else 'surface'}")
    _warn_of_loose(gmsh, dim or there)
    return dim or there


def _open(gmsh: Any, path: Path, file_type: str) -> None:
    try:
        gmsh.open(str(path))
    except Exception as error:  # gmsh's own class of errors
        said = str(error).replace(f"'{path}', ", "").replace(str(path), path.name)
        raise ReadError(path, f"gmsh cannot read it as {file_type} ({said})") from error
    if not gmsh.model.getEntities():
        raise ReadError(path, f"there is no geometry in it; is it {file_type}?")
    if failed := errors(gmsh):
        raise ReadError(path, f"gmsh reads it with errors ({failed[0]})")


def _check_last_line(path: Path) -> None:
    """Warn of a script without a line end after its last statements: gmsh 4.15 reads the first of them only."""
    last = path.read_bytes().rpartition(b"\n")[2]
    if last.count(b";") > 1:
        message = "its last line has no end, and gmsh may leave out what stands on it; add a line end"
        warnings.warn(LacmeshWarning(message), stacklevel=2)


def _warn_of_loose(gmsh: Any, dim: int) -> None:
    """Warn of surfaces (in the plane, of curves) that bound no body: a body may be broken."""
    bounds = {abs(tag) for around in boundary(gmsh, dim).values() for tag in around}
    inside = {t for tag in gmsh.model.getEntities(dim) for d, t in gmsh.model.mesh.getEmbedded(*tag) if d == dim - 1}
    loose = [int(t) for _, t in gmsh.model.getEntities(dim - 1) if t not in bounds | inside]
    if loose:
        what, of = ("surfaces", "volume") if dim == 3 else ("curves", "surface")
        message = f"{len(loose)} {what} bound no {of} ({some(loose)}); is a body open, or a part of it lost?"
        warnings.warn(LacmeshWarning(message), stacklevel=2)


def _sew(gmsh: Any, path: Path) -> None:
    """Reopen an IGES file of surfaces only with these sewn to volumes. Raises DataError if some are lost."""
    before = sum(gmsh.model.occ.getMass(*tag) for tag in gmsh.model.getEntities(2))
    gmsh.clear()
    gmsh.option.setNumber("Geometry.OCCSewFaces", 1)
    gmsh.option.setNumber("Geometry.OCCMakeSolids", 1)
    _open(gmsh, path, "IGES")
    after = sum(gmsh.model.occ.getMass(*tag) for tag in gmsh.model.getEntities(2))
    if not gmsh.model.getEntities(3) or abs(after - before) > _FLAT * before:
        cure = "save it as STEP, or mesh it as a shell (--dim 2)"
        raise DataError(f"its surfaces cannot be sewn to volumes without loss (IGES has no volumes); {cure}")


def skin_dim(gmsh: Any, dim: int) -> int:
    """Dimension of the entities that a tag alone names: 1 if the geometry is plane, else 2; `dim`: of the bodies.

    A geometry is plane if it has no volumes and its surfaces lie in one plane, of any orientation; in others a tag
    names a surface even if only surfaces are meshed.
    """
    if dim == 3 or gmsh.model.getEntities(3):
        return 2
    points = np.concatenate([_some_of(gmsh, int(tag)) for _, tag in gmsh.model.getEntities(2)])
    across = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[-1]
    return 1 if across <= _FLAT * diagonal(gmsh) else 2


def _some_of(gmsh: Any, tag: int) -> Floats:
    """Points (m, 3) of a surface: its nodes if it has any, else samples, also beyond its bounds if it is trimmed."""
    nodes: Floats = gmsh.model.mesh.getNodes(2, tag, includeBoundary=True)[1].reshape(-1, 3)
    if len(nodes):
        return nodes
    low, high = (np.array(p) for p in gmsh.model.getParametrizationBounds(2, tag))
    points: Floats = gmsh.model.getValue(2, tag, (low + _PLACES * (high - low)).ravel()).reshape(-1, 3)
    return points


def errors(gmsh: Any) -> list[str]:
    """Errors that gmsh has logged so far, each once."""
    return list(dict.fromkeys(line.removeprefix("Error: ") for line in gmsh.logger.get() if line.startswith("Error: ")))


def boundary(gmsh: Any, dim: int) -> dict[int, list[int]]:
    """Signed tags of the entities that bound each body of dimension `dim`."""
    bodies = [tag for _, tag in gmsh.model.getEntities(dim)]
    bounds = {b: gmsh.model.getBoundary([(dim, b)], combined=False, oriented=True) for b in bodies}
    return {b: [int(tag) for _, tag in bounding] for b, bounding in bounds.items()}


def shapes(gmsh: Any, dim: int) -> list[CadShape]:
    """Shapes of the bodies, of dimension `dim`, and of the entities that bound them."""
    bounds = boundary(gmsh, dim)
    exact = {(int(d), int(t)) for d, t in gmsh.model.occ.getEntities()} if _is_occ(gmsh) else set()
    wanted = [(d, int(t)) for d in (dim, dim - 1) for _, t in gmsh.model.getEntities(d)]
    measured = {} if dim == 3 and exact.issuperset(wanted) else _from_mesh(gmsh, dim, bounds)
    listed = []
    for d, tag in wanted:
        row = replace(measured.get((d, tag), _NONE), dim=d, tag=tag, type=_type(gmsh, d, tag))
        if (d, tag) in exact:
            centre = gmsh.model.occ.getCenterOfMass(d, tag)
            row = replace(row, measure=gmsh.model.occ.getMass(d, tag), centre=_triple(centre))
        bodies = tuple(b for b, around in bounds.items() if d < dim and tag in map(abs, around))
        if d == 2 and dim == 3 and (d, tag) in exact:
            normal, radius = _turned_outward(gmsh, tag, bodies)
            row = replace(row, normal=normal, radius=radius)
        box = gmsh.model.getBoundingBox(d, tag)
        listed.append(
            replace(
                row, box=(_triple(box[:3]), _triple(box[3:])), bodies=bodies, groups=_groups(gmsh, d, tag),
                name=gmsh.model.getEntityName(d, tag).rpartition("/")[2],
            )
        )  # fmt: skip
    return listed


_NONE = CadShape(0, 0, "", 0.0, (0.0, 0.0, 0.0), ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))


def _triple(values: Any) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return x, y, z


def _type(gmsh: Any, dim: int, tag: int) -> str:
    name: str = gmsh.model.getType(dim, tag)
    return name.removesuffix(" surface") if dim == 2 and name != "Discrete surface" else name


def _groups(gmsh: Any, dim: int, tag: int) -> tuple[str, ...]:
    tags = [abs(int(g)) for g in gmsh.model.getPhysicalGroupsForEntity(dim, tag)]
    return tuple(gmsh.model.getPhysicalName(dim, g) or f"{dim}:{g}" for g in tags)


def _is_occ(gmsh: Any) -> bool:
    try:
        return bool(gmsh.model.occ.getEntities())
    except Exception:  # gmsh's own class: no such kernel in this model
        return False


def _turned_outward(gmsh: Any, tag: int, bodies: tuple[int, ...]) -> tuple[Any, float | None]:
    """Normal, or signed radius, of a surface of OCC, oriented out of its first body."""
    points, normals = _places_on(gmsh, tag)
    behind = points[0] - 1e-5 * diagonal(gmsh) * normals[0]
    if bodies and not gmsh.model.isInside(3, bodies[0], behind):
        normals = -normals
    return _facing(points, normals)


def diagonal(gmsh: Any) -> float:
    """The diagonal of the box around the current model."""
    box = np.array(gmsh.model.getBoundingBox(-1, -1))
    return float(np.linalg.norm(box[3:] - box[:3]))


def _places_on(gmsh: Any, tag: int) -> tuple[Floats, Floats]:
    """Points of a trimmed surface, and gmsh's normals there."""
    low, high = (np.array(p) for p in gmsh.model.getParametrizationBounds(2, tag))
    at = low + _PLACES * (high - low)
    inside = [gmsh.model.isInside(2, tag, p, parametric=True) for p in at]
    at = (at[np.array(inside, bool)] if any(inside) else at).ravel()
    return gmsh.model.getValue(2, tag, at).reshape(-1, 3), gmsh.model.getNormal(tag, at).reshape(-1, 3)


#: points of the unit square, spread evenly however many are taken
_PLACES = np.array([[0.5, 0.5]] + [[(k * 0.618034) % 1, (k * 0.414214) % 1] for k in range(1, 40)])


def _facing(points: Floats, normals: Floats) -> tuple[tuple[float, float, float] | None, float | None]:
    """Normal of a flat shape, or radius of a round one, from points (n, 3) and outward unit normals there.

    On a cylinder or sphere p = R n, except along the axis, where normals do not change.
    """
    mean = normals.mean(axis=0)
    n, p = normals - mean, points - points.mean(axis=0)
    if np.abs(n).max() < _FLAT:
        return _triple(mean / np.linalg.norm(mean)), None
    _, sizes, axes = np.linalg.svd(n, full_matrices=False)
    across = axes[sizes > 1e-3 * sizes[0]]
    p = p @ across.T @ across
    radius = float((p * n).sum() / (n * n).sum())
    return None, radius if np.linalg.norm(p - radius * n) < _ROUND * np.linalg.norm(p) else None


@dataclass(frozen=True)
class _Integrals:
    """Integrals over an entity's cells: the measure, those of x, of x.n (n the normal) and of x_i^2 n_i.

    `points`, `normals` (m, 3): quadrature points, and n there.
    """

    measure: float
    first: Floats
    flux: float
    second: Floats
    points: Floats
    normals: Floats


def _from_mesh(gmsh: Any, dim: int, bounds: dict[int, list[int]]) -> dict[Tag, CadShape]:
    """Measure the shapes on a fine mesh of their surfaces (for an STL, on its own triangles)."""
    mesh = _fine_mesh(gmsh)
    plane = dim == 2 and bool(np.ptp(mesh.points[:, 2]) <= 1e-12 * diagonal(gmsh))
    if plane:
        mesh = reverse(mesh, analyse_orientation(mesh, np.flatnonzero(mesh.cell_dim == 1)).to_flip)
    integrals = {tag: _integrate(mesh, tag, plane) for tag in mesh.entities if tag[0] in (1, 2)}
    if dim == 2:
        measured = {tag: _measured(i, 1.0) for tag, i in integrals.items()}
        return {t: s if plane or t[0] == 2 else replace(s, normal=None, radius=None) for t, s in measured.items()}
    shapes = {tag: _measured(i, 1.0) for tag, i in integrals.items()}
    first: dict[Tag, int] = {}
    for body, around in bounds.items():
        tags = [(2, abs(t)) for t in around if (2, abs(t)) in integrals]
        out = _outward(gmsh, mesh, tags, integrals)
        volume = sum(out[tag] * integrals[tag].flux for tag in tags) / 3
        second = np.sum([out[tag] * integrals[tag].second for tag in tags], axis=0) / 2
        shapes[3, body] = replace(_NONE, measure=float(volume), centre=_triple(second / volume if volume else second))
        shapes |= {tag: _measured(integrals[tag], out[tag]) for tag in tags if first.setdefault(tag, body) == body}
    return shapes


def _outward(gmsh: Any, mesh: Mesh, surfaces: list[Tag], integrals: Mapping[Tag, _Integrals]) -> dict[Tag, float]:
    """Sign of each surface: 1 if its cells' normals point out of the body that the surfaces enclose, -1 if into it.

    A closed shell is oriented out of what it encloses; of several shells the largest is the outer one, others voids.
    """
    entity = mesh.cell_data["entity"]
    cells = {tag: np.flatnonzero((entity == tag).all(axis=1)) for tag in surfaces}
    turned = analyse_orientation(mesh, np.sort(np.concatenate(list(cells.values())))).to_flip
    out = {tag: -1.0 if here[0] in turned else 1.0 for tag, here in cells.items()}
    shells = stl.connected(gmsh, [tag for _, tag in surfaces])
    volumes = [sum(out[2, tag] * integrals[2, tag].flux for tag in shell) for shell in shells]
    voids = {(2, tag) for k, shell in enumerate(shells) if k != np.argmax(volumes) for tag in shell}
    return {tag: -sign if tag in voids else sign for tag, sign in out.items()}


def _fine_mesh(gmsh: Any) -> Mesh:
    """Mesh of the surfaces, as fine as their curvature requires, whatever the file says; for an STL its triangles."""
    if not any(gmsh.model.mesh.getElementTypes(2)):
        for tag in gmsh.model.mesh.field.list():
            gmsh.model.mesh.field.remove(tag)
        gmsh.model.mesh.removeSizeCallback()
        for option, value in {**_PLAIN, "MeshSizeMax": diagonal(gmsh) / 20}.items():
            gmsh.option.setNumber(f"Mesh.{option}", value)
        try:
            gmsh.model.mesh.generate(2)
        except Exception as error:  # gmsh's own class of errors
            raise DataError(f"gmsh cannot mesh the surfaces to measure them ({error}); repair the geometry") from error
    return read_model().raw


def _integrate(mesh: Mesh, tag: Tag, plane: bool) -> _Integrals:
    """Integrals over an entity; n: normal of surfaces, and, in the plane, of curves with the body on their left."""
    cells = np.flatnonzero((mesh.cell_data["entity"] == tag).all(axis=1))
    points, weighted = [], []
    for cell_type, _, nodes in mesh.select(cells):
        X, w = rule(CELLS[cell_type].family, 6)
        x = mesh.points[nodes]
        J = jacobian(cell_type, x, X)
        points.append(np.einsum("pn,cns->cps", shape(cell_type, X), x).reshape(-1, 3))
        if tag[0] == 2:
            n = np.cross(J[..., 0], J[..., 1])
        else:
            n = np.cross(J[..., 0], [0.0, 0.0, 1.0]) if plane else J[..., 0]
        weighted.append((n * w[:, None]).reshape(-1, 3))
    y, n = np.concatenate(points), np.concatenate(weighted)
    size = np.linalg.norm(n, axis=1)
    unit = n / np.maximum(size, 1e-300)[:, None]
    return _Integrals(size.sum(), size @ y, (n * y).sum(), (y * y * n).sum(axis=0), y, unit)


def _measured(i: _Integrals, out: float) -> CadShape:
    """Shape of a surface or curve from its integrals; `out`: 1 if its normal points out of the body, else -1."""
    normal, radius = _facing(i.points, out * i.normals)
    return replace(_NONE, measure=float(i.measure), centre=_triple(i.first / i.measure), normal=normal, radius=radius)
