"""Meshing of a geometry that gmsh has opened: groups, sizes, cells, their validity. Runs in the child process."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lacmesh.errors import DataError, GroupNotFoundError, LacmeshWarning, RequestError, some
from lacmesh.formats import write
from lacmesh.gmsh import geometry
from lacmesh.gmsh.model import read_model
from lacmesh.mesh import Ints, Tag
from lacmesh.topology.orientation import analyse_orientation, reverse

#: where nothing is said of sizes, and the file is no script: edges along the diagonal, and around a full turn
_ALONG, _AROUND = 20, 12
#: a box may miss what it should hold by this part of the diagonal
_SLACK = 1e-4
#: growth of edges away from a slave group, for each length
_GRADE = 0.25
_LARGE = 1e22


def write_mesh(gmsh: Any, request: Mapping[str, Any], dim: int, target: Path) -> None:
    """Mesh the current model as a request says (`cad.mesh_cad`), and write it. Raises RequestError, DataError."""
    path = Path(request["path"])
    skin = geometry.skin_dim(gmsh, dim)
    for name, parts in request["groups"].items():
        _add_group(gmsh, name, [_entities(gmsh, skin, name, part) for part in parts])
    faces = [(skin, tag) for spec in request["slave"] for tag in _slave_entities(gmsh, skin, spec)]
    _set_sizes(gmsh, path, request["size"], faces, request["slave_size"])
    if request["order"]:
        gmsh.option.setNumber("Mesh.ElementOrder", request["order"])
    curved = gmsh.option.getNumber("Mesh.ElementOrder") > 1
    if curved and not gmsh.option.getNumber("Mesh.HighOrderOptimize"):
        gmsh.option.setNumber("Mesh.HighOrderOptimize", 2)
    _generate(gmsh, dim)
    check_cells(gmsh, dim)
    mesh = read_model(_kept(gmsh, dim)).raw
    mesh = reverse(mesh, analyse_orientation(mesh, np.flatnonzero(mesh.cell_dim == dim - 1)).to_flip)
    write(target, mesh)


def _entities(gmsh: Any, skin: int, name: str, part: Mapping[str, Any]) -> list[Tag]:
    """Entities that a part of a group means; `skin`: their dimension if none is given. Raises RequestError."""
    d = skin if part["dim"] is None else part["dim"]
    known = [int(t) for _, t in gmsh.model.getEntities(d)]
    what = ("point", "curve", "surface", "volume")[d]
    if part["tags"]:
        lost = sorted(set(part["tags"]) - set(known))
        if lost:
            near = f"it has {some(known)}" if known else "it has none"
            raise RequestError(f"group {name!r}: there is no {what} {some(lost)}; {near} (--list shows them)")
        return [(d, t) for t in part["tags"]]
    box = np.array(part["box"])
    slack = _SLACK * geometry.diagonal(gmsh)
    boxes = {t: np.array(gmsh.model.getBoundingBox(d, t)) for t in known}
    inside = [t for t, b in boxes.items() if (b[:3] >= box[:3] - slack).all() and (b[3:] <= box[3:] + slack).all()]
    if not inside:
        raise RequestError(f"group {name!r}: no {what} lies in that box as a whole; --list shows their boxes")
    return [(d, t) for t in inside]


def _add_group(gmsh: Any, name: str, parts: Iterable[Sequence[Tag]]) -> None:
    there = {gmsh.model.getPhysicalName(*g) for g in gmsh.model.getPhysicalGroups()}
    if name in there:
        raise RequestError(f"it has a group named {name!r} already; say another name")
    tags = sorted({tag for part in parts for tag in part})
    for d in sorted({d for d, _ in tags}):
        gmsh.model.addPhysicalGroup(d, [t for e, t in tags if e == d], name=name)


def _slave_entities(gmsh: Any, skin: int, spec: str) -> list[int]:
    """The entities of dimension `skin` in a group: named, or by tag, as in a mesh. Raises RequestError."""
    groups: dict[str, list[int]] = {}
    numbers = spec.split(":")
    for d, tag in gmsh.model.getPhysicalGroups(skin):
        members = [abs(int(t)) for t in gmsh.model.getEntitiesForPhysicalGroup(d, tag)]
        groups[gmsh.model.getPhysicalName(d, tag) or f"{d}:{tag}"] = members
        if spec in (str(tag), f"{d}:{tag}"):
            return members
    if spec in groups:
        return groups[spec]
    known = [int(t) for _, t in gmsh.model.getEntities(skin)]
    if numbers[:2] == ["entity", str(skin)] and numbers[2:] in [[str(t)] for t in known]:
        return [int(numbers[2])]
    raise GroupNotFoundError(spec, groups, f"group of {'surfaces' if skin == 2 else 'curves'}")


def _set_sizes(gmsh: Any, path: Path, size: float | None, faces: Sequence[Tag], slave_size: float | None) -> None:
    """Set the lengths of edges everywhere, and on the slave faces and around them."""
    options = {}
    if size is not None:
        options = {"MeshSizeMin": 0.0, "MeshSizeMax": size, "MeshSizeFactor": 1.0}
        options |= {"MeshSizeFromPoints": 0.0, "MeshSizeFromCurvature": 0.0}
    elif not path.suffix.lower().startswith(".geo"):
        options = {"MeshSizeMax": geometry.diagonal(gmsh) / _ALONG, "MeshSizeFromCurvature": _AROUND}
    for name, value in options.items():
        gmsh.option.setNumber(f"Mesh.{name}", value)
    if slave_size is not None:
        _refine(gmsh, faces, slave_size, min(gmsh.option.getNumber("Mesh.MeshSizeMax"), _size_of_points(gmsh)))


def _size_of_points(gmsh: Any) -> float:
    """Largest size that the file gives to a point; if it gives none, gmsh's default, a tenth of the diagonal."""
    points = gmsh.model.getEntities(0) if gmsh.option.getNumber("Mesh.MeshSizeFromPoints") else []
    sizes = gmsh.model.mesh.getSizes(points) if points else np.zeros(1)
    return float(max(sizes)) or geometry.diagonal(gmsh) / 10


def _refine(gmsh: Any, faces: Sequence[Tag], h: float, far: float) -> None:
    """Add fields that give faces edges of length h, and make cells around them grow (or shrink) to the length `far`."""
    field = gmsh.model.mesh.field
    kind, tags = "SurfacesList" if faces[0][0] == 2 else "CurvesList", [tag for _, tag in faces]
    distance, grading, on = field.add("Distance"), field.add("Threshold"), field.add("Constant")
    field.setNumbers(distance, kind, tags)
    field.setNumber(distance, "Sampling", min(max(20, int(2 * _extent(gmsh, faces) / h)), 400))
    for name, value in (("InField", distance), ("SizeMin", h), ("SizeMax", far), ("DistMin", h / 2)):
        field.setNumber(grading, name, value)
    field.setNumber(grading, "DistMax", h / 2 + abs(far - h) / _GRADE + 1e-9 * far)
    field.setNumbers(on, kind, tags)
    field.setNumber(on, "VIn", h)
    field.setNumber(on, "VOut", _LARGE if h <= far else 0)
    both = field.add("Min" if h <= far else "Max")
    field.setNumbers(both, "FieldsList", [grading, on])
    field.setAsBackgroundMesh(both)
    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", max(h, gmsh.option.getNumber("Mesh.MeshSizeMax")))
    around = gmsh.model.getBoundary(faces, combined=False, oriented=False, recursive=True)
    gmsh.model.mesh.setSize([p for p in around if p[0] == 0], h)


def _extent(gmsh: Any, faces: Sequence[Tag]) -> float:
    """The longest side of the faces' boxes."""
    boxes = np.array([gmsh.model.getBoundingBox(*tag) for tag in faces])
    return float((boxes[:, 3:] - boxes[:, :3]).max())


def _generate(gmsh: Any, dim: int) -> None:
    """Make the mesh. Raises DataError where gmsh fails, or leaves a body empty."""
    cure = "try a smaller --size, or repair the geometry"
    try:
        gmsh.model.mesh.generate(dim)
    except Exception as error:  # gmsh's own class of errors
        said = geometry.errors(gmsh) or [str(error)]
        raise DataError(f"gmsh cannot mesh it ({'; '.join(said[:2])}); {cure}") from error
    empty = [t for _, t in gmsh.model.getEntities(dim) if not len(gmsh.model.mesh.getElementTypes(dim, t))]
    if empty:
        what = "volumes" if dim == 3 else "surfaces"
        why = "".join(f" ({line})" for line in geometry.errors(gmsh)[:1])
        raise DataError(f"gmsh left {what} {some(empty)} without cells{why}; {cure}")


def check_cells(gmsh: Any, dim: int) -> None:
    """Improve curved cells that are inverted or degenerate, and warn of those that remain so."""
    bad = _invalid(gmsh, dim)
    if len(bad) and gmsh.option.getNumber("Mesh.ElementOrder") > 1:
        for method in ("HighOrderElastic", "HighOrder"):
            gmsh.model.mesh.optimize(method)
        bad = _invalid(gmsh, dim)
    if len(bad):
        message = f"{len(bad)} cells are inverted or degenerate ({some(bad)}); a smaller --size may cure them"
        warnings.warn(LacmeshWarning(message), stacklevel=3)


def _invalid(gmsh: Any, dim: int) -> Ints:
    """Numbers of the bodies' cells whose Jacobian determinant is not positive everywhere (by gmsh's bounds)."""
    cells = np.concatenate([np.empty(0, np.uint64), *gmsh.model.mesh.getElements(dim)[1]])
    least = np.array(gmsh.model.mesh.getElementQualities(cells, "minDetJac"))
    turned = dim == 2 and np.median(least) < 0  # a plane seen from behind
    numbers: Ints = cells[(least >= 0 if turned else least <= 0)].astype(np.int64)
    return numbers


def _kept(gmsh: Any, dim: int) -> set[Tag]:
    """The entities whose cells are kept: bodies, skin, and lower ones in a group."""
    entities = [(int(d), int(t)) for d, t in gmsh.model.getEntities()]
    return {t for t in entities if dim - 1 <= t[0] <= dim or len(gmsh.model.getPhysicalGroupsForEntity(*t))}
