"""CAD files listed (`list_cad`) and meshed with the groups that contact needs (`mesh_cad`), by gmsh in this process."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lacmesh.errors import GroupNotFoundError, ReadError, RequestError, did_you_mean, reading, some
from lacmesh.gmsh.geometry import FLAT, PLACES, SUFFIXES, CadShape, diagonal, generate_mesh, opened, shapes, warn
from lacmesh.gmsh.model import to_mesh
from lacmesh.mesh import Ints, Mesh, Tag
from lacmesh.topology.orientation import analyse_orientation, reverse

#: where nothing is said of sizes, and the file is no script: edges along the diagonal, and around a full turn
_ALONG, _AROUND = 20, 12
#: a box may miss a shape by this part of the diagonal; growth of edges away from a slave group, for each length
_SLACK, _GRADE = 1e-4, 0.25


@dataclass(frozen=True)
class EntitySelection:
    """Part of a group: entities given by tag, or those of dimension `dim` in a box (least and greatest corner).

    A dimension of None means 2, and 1 if the geometry is plane: no volumes, and all surfaces in one plane.
    """

    dim: int | None
    tags: tuple[int, ...] = ()
    box: tuple[float, ...] = ()


def parse_group(text: str) -> tuple[str, EntitySelection]:
    """Parse `NAME=TAG,TAG` or `NAME=box:x0,y0,z0,x1,y1,z1`; `DIM:` after the = sets the dimension. Raises RequestError.

    >>> parse_group("bore=17,18")
    ('bore', EntitySelection(dim=None, tags=(17, 18), box=()))
    >>> parse_group("body=3:1")[1], parse_group("top=box:0,0,1,2,2,1")[1].box
    (EntitySelection(dim=3, tags=(1,), box=()), (0.0, 0.0, 1.0, 2.0, 2.0, 1.0))
    """
    name, _, entities = text.rpartition("=")
    head, colon, rest = entities.partition(":")
    dim = int(head) if colon and head in ("0", "1", "2", "3") else None
    what = entities if dim is None else rest
    try:
        box = tuple(float(x) for x in what[4:].split(",")) if what.startswith("box:") else ()
        tags = () if box else tuple(int(t) for t in what.split(","))
        whole = len(box) == 6 and all(a <= b for a, b in zip(box[:3], box[3:], strict=True))
        if name and (whole or (tags and min(tags) > 0)):
            return name, EntitySelection(dim, tags, box)
    except ValueError:
        pass
    form = "NAME=TAG,TAG or NAME=box:x0,y0,z0,x1,y1,z1 (least, then greatest corner; DIM: before either)"
    raise RequestError(f"{text!r} says no group; write {form}")


def check_source(path: str | os.PathLike[str]) -> Path:
    """Check that a CAD file can be read, and return its path. Raises RequestError for an unknown suffix, ReadError."""
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix in (".msh", ".med"):
        raise RequestError(f"{path} is a mesh already; lacmesh cut cuts it, lacmesh convert writes it otherwise")
    if suffix not in SUFFIXES:
        raise RequestError(f"{path}: no CAD file has the suffix {suffix!r}{did_you_mean(suffix, SUFFIXES)}")
    with reading(path), path.open("rb") as file:
        if not file.read(1):
            raise ReadError(path, "is empty")
    return path


def list_cad(path: str | os.PathLike[str], *, dim: int | None = None) -> list[CadShape]:
    """List the bodies of a CAD file (volumes; surfaces if there are none, or if `dim` is 2), then their boundaries.

    Exact for STEP, IGES and BREP; from a fine mesh for .geo files of gmsh's own kernel, plane files and STL. Raises
    ReadError, DataError, and RequestError where gmsh is missing or runs already.
    """
    with opened(check_source(path), dim) as (gmsh, dim):
        return shapes(gmsh, dim)


def mesh_cad(
    path: str | os.PathLike[str],
    *,
    groups: Mapping[str, Sequence[EntitySelection]] | None = None,
    size: float | None = None,
    order: int | None = None,
    slave: Sequence[str] = (),
    slave_size: float | None = None,
    dim: int | None = None,
) -> Mesh:
    """Mesh a CAD file: its bodies, all that bounds them, and lower entities that are in a group.

    `groups`: name -> what it is made of (`parse_group`), besides those of a .geo. `size`: length of edges (default: as
    the .geo says; for other files a twentieth of the diagonal, and 12 edges to a full turn). `order`: 1 or 2 (default:
    as the .geo says, or 1); nodes of order 2 stand on the geometry. `slave`, `slave_size`: groups of the skin whose
    faces get edges of that length, and cells that grow away from them. `dim`: 2 or 3 (default: 3 where there are
    volumes; an STL has surfaces only). Cells of the skin are oriented outward.

    Raises ReadError for the file, RequestError for groups or tags that it lacks (and where gmsh is missing or runs
    already), DataError where gmsh cannot mesh it. Warns of cells that are inverted or degenerate.
    """
    path = check_source(path)
    for what, value in (("size", size), ("slave_size", slave_size)):
        if value is not None and not 0 < value < float("inf"):
            raise RequestError(f"{what} must be a positive length, not {value}")
    for what, number, allowed in (("order", order, (None, 1, 2)), ("dim", dim, (None, 2, 3))):
        if number not in allowed:
            raise RequestError(f"{what} is {allowed[1]} or {allowed[2]}, not {number}")
    if bool(slave) != (slave_size is not None):
        raise RequestError("a slave group and its size go together: give both, or neither")
    with opened(path, dim) as (gmsh, dim):
        skin = _skin_dim(gmsh, dim)
        for name, parts in (groups or {}).items():
            if name in {gmsh.model.getPhysicalName(*g) for g in gmsh.model.getPhysicalGroups()}:
                raise RequestError(f"it has a group named {name!r} already; choose another name")
            entities = {tag for part in parts for tag in _entities(gmsh, skin, name, part)}
            for d in sorted({d for d, _ in entities}):
                gmsh.model.addPhysicalGroup(d, sorted(t for e, t in entities if e == d), name=name)
        faces = [(skin, tag) for spec in slave for tag in _slave_entities(gmsh, skin, spec)]
        _set_sizes(gmsh, path, size, faces, slave_size)
        if order:
            gmsh.option.setNumber("Mesh.ElementOrder", order)
        if gmsh.option.getNumber("Mesh.ElementOrder") > 1 and not gmsh.option.getNumber("Mesh.HighOrderOptimize"):
            gmsh.option.setNumber("Mesh.HighOrderOptimize", 2)
        generate_mesh(gmsh, dim)
        check_cells(gmsh, dim)
        for d, tag in gmsh.model.getEntities():
            if d < dim - 1 and not len(gmsh.model.getPhysicalGroupsForEntity(d, tag)):
                gmsh.model.mesh.removeElements(d, tag)
        mesh = to_mesh()
    return reverse(mesh, analyse_orientation(mesh, np.flatnonzero(mesh.cell_dim == dim - 1)).to_flip)


# ---- groups and sizes


def _skin_dim(gmsh: Any, dim: int) -> int:
    """Dimension of the entities that a tag alone names: 1 if the geometry is plane, else 2; `dim`: of the bodies.

    A geometry is plane if it has no volumes and its surfaces lie in one plane, of any orientation.
    """
    if dim == 3 or gmsh.model.getEntities(3):
        return 2
    points = []
    for _, tag in gmsh.model.getEntities(2):
        nodes = gmsh.model.mesh.getNodes(2, tag, includeBoundary=True)[1]  # those of an STL
        if not len(nodes):
            low, high = (np.array(p) for p in gmsh.model.getParametrizationBounds(2, tag))
            nodes = gmsh.model.getValue(2, tag, (low + PLACES * (high - low)).ravel())
        points.append(np.reshape(nodes, (-1, 3)))
    every = np.concatenate(points)
    return 1 if np.linalg.svd(every - every.mean(axis=0), compute_uv=False)[-1] <= FLAT * diagonal(gmsh) else 2


def _entities(gmsh: Any, skin: int, name: str, part: EntitySelection) -> list[Tag]:
    """Entities that a part of a group means; `skin`: their dimension if none is given. Raises RequestError."""
    d = skin if part.dim is None else part.dim
    known = [int(t) for _, t in gmsh.model.getEntities(d)]
    what = ("point", "curve", "surface", "volume")[d]
    lost = sorted(set(part.tags) - set(known))
    if lost:
        near = f"it has {some(known)}" if known else "it has none"
        raise RequestError(f"group {name!r}: there is no {what} {some(lost)}; {near} (--list shows them)")
    if part.tags:
        return [(d, t) for t in part.tags]
    box, slack = np.array(part.box), _SLACK * diagonal(gmsh)
    boxes = {t: np.array(gmsh.model.getBoundingBox(d, t)) for t in known}
    inside = [t for t, b in boxes.items() if (b[:3] >= box[:3] - slack).all() and (b[3:] <= box[3:] + slack).all()]
    if not inside:
        raise RequestError(f"group {name!r}: no {what} lies in that box as a whole; --list shows their boxes")
    return [(d, t) for t in inside]


def _slave_entities(gmsh: Any, skin: int, spec: str) -> list[int]:
    """The entities of dimension `skin` in a group: named, or by tag, as in a mesh. Raises RequestError."""
    groups: dict[str, list[int]] = {}
    for d, tag in gmsh.model.getPhysicalGroups(skin):
        members = [abs(int(t)) for t in gmsh.model.getEntitiesForPhysicalGroup(d, tag)]
        groups[gmsh.model.getPhysicalName(d, tag) or f"{d}:{tag}"] = members
        if spec in (str(tag), f"{d}:{tag}"):
            return members
    entities = {f"entity:{skin}:{t}": [int(t)] for _, t in gmsh.model.getEntities(skin)}
    if spec not in groups | entities:
        raise GroupNotFoundError(spec, groups, f"group of {'surfaces' if skin == 2 else 'curves'}")
    return (entities | groups)[spec]


def _set_sizes(gmsh: Any, path: Path, size: float | None, faces: Sequence[Tag], slave_size: float | None) -> None:
    """Set the lengths of edges everywhere, and on the slave faces and around them."""
    options: dict[str, float] = {}
    if size is not None:
        options = {"MeshSizeMin": 0.0, "MeshSizeMax": size, "MeshSizeFactor": 1.0}
        options |= {"MeshSizeFromPoints": 0.0, "MeshSizeFromCurvature": 0.0}
    elif not path.suffix.lower().startswith(".geo"):
        options = {"MeshSizeMax": diagonal(gmsh) / _ALONG, "MeshSizeFromCurvature": _AROUND}
    for name, value in options.items():
        gmsh.option.setNumber(f"Mesh.{name}", value)
    if slave_size is not None:
        points = gmsh.model.getEntities(0) if gmsh.option.getNumber("Mesh.MeshSizeFromPoints") else []
        sizes = gmsh.model.mesh.getSizes(points) if points else np.zeros(1)
        largest = float(max(sizes)) or diagonal(gmsh) / 10  # gmsh's default
        _refine(gmsh, faces, slave_size, min(gmsh.option.getNumber("Mesh.MeshSizeMax"), largest))


def _refine(gmsh: Any, faces: Sequence[Tag], h: float, far: float) -> None:
    """Add fields that give faces edges of length h, and make cells around them grow (or shrink) to the length `far`."""
    field = gmsh.model.mesh.field
    kind, tags = "SurfacesList" if faces[0][0] == 2 else "CurvesList", [tag for _, tag in faces]
    distance, grading, on = field.add("Distance"), field.add("Threshold"), field.add("Constant")
    boxes = np.array([gmsh.model.getBoundingBox(*tag) for tag in faces])
    field.setNumbers(distance, kind, tags)
    field.setNumber(distance, "Sampling", min(max(20, int(2 * (boxes[:, 3:] - boxes[:, :3]).max() / h)), 400))
    for name, value in (("InField", distance), ("SizeMin", h), ("SizeMax", far), ("DistMin", h / 2)):
        field.setNumber(grading, name, value)
    field.setNumber(grading, "DistMax", h / 2 + abs(far - h) / _GRADE + 1e-9 * far)
    field.setNumbers(on, kind, tags)
    field.setNumber(on, "VIn", h)
    field.setNumber(on, "VOut", 1e22 if h <= far else 0)
    both = field.add("Min" if h <= far else "Max")
    field.setNumbers(both, "FieldsList", [grading, on])
    field.setAsBackgroundMesh(both)
    largest = max(h, gmsh.option.getNumber("Mesh.MeshSizeMax"))
    for name, value in (("ExtendFromBoundary", 0), ("Min", 0), ("Max", largest)):
        gmsh.option.setNumber(f"Mesh.MeshSize{name}", value)
    around = gmsh.model.getBoundary(faces, combined=False, oriented=False, recursive=True)
    gmsh.model.mesh.setSize([p for p in around if p[0] == 0], h)


def check_cells(gmsh: Any, dim: int) -> None:
    """Improve curved cells that are inverted or degenerate, and warn of those that remain so."""
    bad = _invalid(gmsh, dim)
    if len(bad) and gmsh.option.getNumber("Mesh.ElementOrder") > 1:
        for method in ("HighOrderElastic", "HighOrder"):
            gmsh.model.mesh.optimize(method)
        bad = _invalid(gmsh, dim)
    if len(bad):
        warn(f"{len(bad)} cells are inverted or degenerate ({some(bad)}); a smaller --size may cure them")


def _invalid(gmsh: Any, dim: int) -> Ints:
    """Numbers of the bodies' cells whose Jacobian determinant is not positive everywhere (by gmsh's bounds)."""
    cells = np.concatenate([np.empty(0, np.uint64), *gmsh.model.mesh.getElements(dim)[1]])
    least = np.array(gmsh.model.mesh.getElementQualities(cells, "minDetJac"))
    turned = dim == 2 and np.median(least) < 0  # a plane seen from behind
    numbers: Ints = cells[(least >= 0 if turned else least <= 0)].astype(np.int64)
    return numbers
