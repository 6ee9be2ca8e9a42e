"""gmsh's current model as a mesh, by a temporary msh file; the cut put into the model by gmsh's functions."""

from __future__ import annotations

import warnings
import zlib
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.cutting.records import without_records
from lacmesh.errors import LacmeshWarning, RequestError
from lacmesh.formats import read, write
from lacmesh.formats.output import signals_wait, temporary_folder
from lacmesh.mesh import Floats, Ints, Mesh

if TYPE_CHECKING:
    from lacmesh.cutting.cut import Cut

#: options with which gmsh writes all that a model holds
_WHOLE = {
    "Mesh.SaveAll": 1,
    "Mesh.Binary": 1,
    "Mesh.MshFileVersion": 4.1,
    "Mesh.SaveParametric": 0,
    "Mesh.ScalingFactor": 1,
    "PostProcessing.SaveMesh": 0,
}
#: mark of views that lacmesh made: with the model's name, and a checksum of the slave faces
_MARK, _SHOWN = "lacmesh", "lac_macro"


def load() -> Any:
    """Import the gmsh package. Raises RequestError, with the line that installs what is missing."""
    try:
        return import_module("gmsh")
    except ModuleNotFoundError as error:
        raise RequestError("this needs gmsh; pip install 'lacmesh[gmsh]' brings it") from error
    except OSError as error:  # the package is there, a system library is not
        libraries = "libglu1-mesa libgl1 libxrender1 libxcursor1 libxft2 libxinerama1 libgomp1"
        raise RequestError(f"gmsh cannot be loaded ({error}); on Debian: apt-get install {libraries}") from error


def running() -> Any:
    """Return the gmsh package, which the caller must have initialised. Raises RequestError."""
    gmsh = load()
    if not gmsh.isInitialized():
        raise RequestError("gmsh is not running: call gmsh.initialize(), then open or build a model")
    return gmsh


def to_mesh() -> Mesh:
    """Read gmsh's current model as a mesh: numbers, groups (also unnamed ones), entities, periodic links, order, views.

    The mesh is the one that `lacmesh.read` makes of the model saved as msh 4.1 with everything in it. Warns of records
    of a cut that were made for an earlier mesh of the model, and leaves them out. Raises RequestError where gmsh is
    missing or holds no mesh.
    """
    gmsh = running()
    name = gmsh.model.getCurrent()
    if not gmsh.model.mesh.getMaxNodeTag():
        raise RequestError(f"gmsh's current model {name!r} has no mesh; gmsh.model.mesh.generate() makes one")
    views = _views_of(gmsh, name)
    mesh = _saved(gmsh, views)
    if any(mark and mark[1] != _checksum(mesh) for mark in views.values()):
        message = f"gmsh's views of a cut were made for an earlier mesh of the model {name!r}: left out"
        warnings.warn(LacmeshWarning(message), stacklevel=2)
        mesh = replace(_saved(gmsh, [view for view, mark in views.items() if not mark]), zones=())
    return replace(mesh, name=name) if mesh.name == "mesh" else mesh


def from_mesh(mesh: Mesh, name: str | None = None) -> None:
    """Make a mesh gmsh's current model: a new one called `name` (the mesh's own name by default), of discrete entities.

    Fields become views; TRIA7 cells are kept in the model's attribute only. Raises RequestError where gmsh is missing
    or has a model of that name, DataError for a mesh that no msh file can hold.
    """
    gmsh = running()
    name = mesh.name if name is None else name
    if name in gmsh.model.list():
        raise RequestError(f"gmsh has a model named {name!r} already; choose another name")
    with temporary_folder() as folder:
        path = Path(folder, "mesh.msh")
        write(path, mesh)
        gmsh.model.add(name)
        _merge(gmsh, path, mesh)


def cut_model(slave: str | int | Sequence[str | int], *, views: bool = True, **options: Any) -> Cut:
    """Cut the mesh of gmsh's current model in place; `options`: of `lacmesh.cut_skin`.

    Geometry, parametric coordinates, physical groups, periodic links and all nodes stay as they are; the cells of the
    entities that the cut touches are put in anew. `views`: the records of the cut become gmsh's views, of which
    `lac_macro` is shown, so that `Cut(to_mesh())` finds the cut again. Views of other fields are made anew, with values
    for the new nodes and cells. Whatever is wrong is found before the model is changed. Raises as `lacmesh.cut_skin`,
    and RequestError where gmsh is missing or holds no mesh, or a partitioned one.
    """
    from lacmesh.cutting.cut import cut_skin

    gmsh = running()
    before = to_mesh()
    if gmsh.model.getNumberOfPartitions():
        raise RequestError("the model is partitioned; call gmsh.model.mesh.unpartition() first")
    cut = cut_skin(before, slave, **options)
    if cut.mesh is not before:
        with temporary_folder() as folder, signals_wait():
            path = Path(folder, "cut.msh")
            write(path, cut.mesh if views else without_records(cut.mesh))
            content = path.read_bytes()  # without its mesh: the head, and what follows the cells
            head, end = b"$EndMeshFormat\n", b"$EndElements\n"
            path.write_bytes(content[: content.index(head) + len(head)] + content[content.index(end) + len(end) :])
            for view in _views_of(gmsh, gmsh.model.getCurrent()):
                gmsh.view.remove(view)
            _replace_cells(gmsh, before, cut.mesh)
            _merge(gmsh, path, cut.mesh)
    return cut


def _replace_cells(gmsh: Any, old: Mesh, new: Mesh) -> None:
    """Add the nodes of a cut to their entities, and put the cells anew into the entities whose cells differ."""
    born = np.flatnonzero(~np.isin(new.node_number, old.node_number))
    entities = np.unique(new.cell_data["entity"], axis=0).tolist()
    changed = []
    for entity in entities:
        before, after = ({k: rows.tobytes() for k, rows in _cells_on(mesh, *entity).items()} for mesh in (old, new))
        if before != after:
            changed.append(entity)
    for dim, tag in changed:
        gmsh.model.mesh.removeElements(dim, tag)
    for dim, tag in np.unique(new.node_data["entity"][born], axis=0).tolist():
        rows = born[(new.node_data["entity"][born] == [dim, tag]).all(axis=1)]
        points = new.points[rows].ravel()
        gmsh.model.mesh.addNodes(dim, tag, new.node_number[rows], points, _parameters(gmsh, dim, tag, points))
    for dim, tag in changed:
        for kind, rows in _cells_on(new, dim, tag).items():
            gmsh.model.mesh.addElementsByType(tag, ALL_CELLS[kind].msh, rows[:, 0], rows[:, 1:].ravel())


def _cells_on(mesh: Mesh, dim: int, tag: int) -> dict[str, Ints]:
    """Number, then nodes by number, of an entity's cells by type; without the types that gmsh lacks."""
    cells = np.flatnonzero((mesh.cell_data["entity"] == [dim, tag]).all(axis=1))
    return {
        kind: np.column_stack([mesh.cell_number[ids], mesh.node_number[nodes]]).astype(np.int64)
        for kind, ids, nodes in mesh.select(cells)
        if ALL_CELLS[kind].msh is not None
    }


def _parameters(gmsh: Any, dim: int, tag: int, points: Floats) -> Floats:
    """Parametric coordinates of points on an entity, if its nodes have such; otherwise an empty array."""
    if dim in (1, 2) and not gmsh.model.getType(dim, tag).startswith("Discrete"):
        nodes, _, parameters = gmsh.model.mesh.getNodes(dim, tag, returnParametricCoord=True)
        if len(parameters) == dim * len(nodes):
            return gmsh.model.getParametrization(dim, tag, points)
    return np.empty(0)


# ---- files and views


def _saved(gmsh: Any, views: Iterable[int]) -> Mesh:
    """The current model as gmsh saves it, with the data of some views; warnings name the model, not the file."""
    options = {name: gmsh.option.getNumber(name) for name in _WHOLE}
    with temporary_folder() as folder:
        path = Path(folder, "model.msh")
        try:
            for name, value in _WHOLE.items():
                gmsh.option.setNumber(name, value)
            gmsh.write(str(path))
            for view in views:
                gmsh.view.write(view, str(path), append=True)
        finally:
            for name, value in options.items():
                gmsh.option.setNumber(name, value)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            mesh = read(path)
    for message in (str(warning.message).removeprefix(f"{path}: ") for warning in caught):
        lost = [part for part in message.split("; ") if not part.startswith("what a mesh has no place for")]
        if lost:
            text = f"gmsh's model {gmsh.model.getCurrent()!r}: {'; '.join(lost)}"
            warnings.warn(LacmeshWarning(text), stacklevel=3)
    return mesh


def _merge(gmsh: Any, path: Path, mesh: Mesh) -> None:
    """Let gmsh read a file into the current model; the views that this makes get lacmesh's mark."""
    there = set(gmsh.view.getTags().tolist())
    gmsh.merge(str(path))
    mark = f"{_MARK}:{_checksum(mesh)}:{gmsh.model.getCurrent()}"
    for view in sorted(set(gmsh.view.getTags().tolist()) - there):
        shown = gmsh.view.option.getString(view, "Name") == _SHOWN
        gmsh.view.option.setString(view, "Attributes", mark)
        gmsh.view.option.setNumber(view, "Visible", shown)
        if shown:
            gmsh.view.option.setNumber(view, "ShowElement", 1)


def _views_of(gmsh: Any, model: str) -> dict[int, list[str]]:
    """The views of data on nodes and cells of a model, and lacmesh's marks of them; [] for views of others.

    Views of others belong to the model that was read from the same file, or to the only model.
    """
    views = {}
    alone = [name for name in gmsh.model.list() if name] in ([model], [])
    for view in gmsh.view.getTags().tolist():
        mark = gmsh.view.option.getString(view, "Attributes").split(":", 2)
        ours = mark[0] == _MARK
        file = gmsh.view.option.getString(view, "FileName")
        if mark[2:] == [model] if ours else alone or (file and file == gmsh.model.getFileName()):
            with suppress(Exception):  # gmsh's own class: a view that is a list of shapes, without a mesh
                if gmsh.view.getHomogeneousModelData(view, 0)[0] in ("NodeData", "ElementData"):
                    views[view] = mark if ours else []
    return views


def _checksum(mesh: Mesh) -> str:
    """Checksum of the slave faces of a cut: their numbers and nodes."""
    faces = np.flatnonzero(np.asarray(mesh.cell_data.get(_SHOWN, np.empty(0))) >= 0)
    total = 0
    for _, cells, nodes in sorted(mesh.select(faces), key=lambda part: part[0]):
        rows = np.column_stack([mesh.cell_number[cells], mesh.node_number[nodes]]).astype(np.int64)
        total = zlib.crc32(rows[np.argsort(rows[:, 0])].tobytes(), total)
    return f"{total:08x}"
