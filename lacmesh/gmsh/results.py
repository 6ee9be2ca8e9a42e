"""Results of lacsolver as gmsh's views of the current model: the displacement, and the pressure of each contact.

They are read from the VTU files that a `.pvd` of the results folder names, and belong to the nodes and cells of the
model by their numbers.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from lacmesh.errors import DataError, ReadError
from lacmesh.formats import read
from lacmesh.gmsh.views import RESULT_MARK
from lacmesh.mesh import Mesh

#: the largest displacement is drawn this long, in diagonals of the mesh
_DRAWN = 0.05
#: nodes within this part of the mesh's size are at the same place
_SAME_PLACE = 1e-9


def show_results(gmsh: Any, mesh: Mesh, folder: Path) -> list[str]:
    """Show the results in a folder of `lacsolver run`, in place of those shown before; return the names of the views.

    `mesh`: that of the current model. Raises ReadError, and DataError where the results are of another mesh.
    """
    solid = folder / "solid.pvd"
    if not solid.exists():
        raise ReadError(solid, 'is missing: gmsh shows fields of format = "vtu" (in [output] of the case) only')
    moved = _frames(solid, mesh)
    zones = {path.stem.removeprefix("contact_"): _frames(path, mesh) for path in sorted(folder.glob("contact_*.pvd"))}
    remove_results(gmsh)
    shown = {"displacement": _add(gmsh, "displacement", "displacement", moved)}
    for zone, frames in zones.items():
        if all("pressure" in frame.cell_data for _, frame in frames):  # a tie has tractions
            shown[f"pressure {zone}"] = _add(gmsh, f"pressure {zone}", "pressure", frames)
    gmsh.option.setNumber("Mesh.SurfaceEdges", 0)
    gmsh.option.setNumber("Mesh.VolumeEdges", 0)
    for view in gmsh.view.getTags():
        gmsh.view.option.setNumber(int(view), "Visible", int(view) in shown.values())
    _deform(gmsh, shown["displacement"], mesh)
    return list(shown)


def remove_results(gmsh: Any) -> None:
    """Remove the views that `show_results` made."""
    for view in gmsh.view.getTags().tolist():
        if gmsh.view.option.getString(view, "Attributes") == RESULT_MARK:
            gmsh.view.remove(view)


def _frames(path: Path, mesh: Mesh) -> list[tuple[float, Mesh]]:
    """The times and meshes of a .pvd file; each is part of the current model's mesh. Raises DataError where not."""
    sets = ElementTree.parse(path).getroot().iter("DataSet")
    frames = [(float(s.get("timestep", 0)), read(path.parent / s.get("file", ""))) for s in sets]
    if not all(_part_of(mesh, frame) for _, frame in frames):
        raise DataError(f"{path} is of another mesh than gmsh's: the case names another, or cuts other faces")
    return frames


def _part_of(mesh: Mesh, frame: Mesh) -> bool:
    """True if each node of the frame has its number and place in the mesh, and each cell its number."""
    if not (np.isin(frame.node_number, mesh.node_number).all() and np.isin(frame.cell_number, mesh.cell_number).all()):
        return False
    order = np.argsort(mesh.node_number)
    place = mesh.points[order[np.searchsorted(mesh.node_number, frame.node_number, sorter=order)]]
    return bool((np.abs(place - frame.points) <= _SAME_PLACE * np.ptp(mesh.points, axis=0).max()).all())


def _add(gmsh: Any, name: str, key: str, frames: list[tuple[float, Mesh]]) -> int:
    """Add the field `key` of the frames as a view, a step for each; return its tag."""
    view: int = gmsh.view.add(name)
    gmsh.view.option.setString(view, "Attributes", RESULT_MARK)
    model = gmsh.model.getCurrent()
    for step, (time, frame) in enumerate(frames):
        nodal = key in frame.node_data
        number, values = (
            (frame.node_number, frame.node_data[key]) if nodal else (frame.cell_number, frame.cell_data[key])
        )
        rows = np.asarray(values, float).reshape(len(number), -1)
        kind = "NodeData" if nodal else "ElementData"
        gmsh.view.addHomogeneousModelData(view, step, model, kind, number, rows.ravel(), time, rows.shape[1])
    gmsh.view.option.setNumber(view, "TimeStep", len(frames) - 1)
    gmsh.view.option.setNumber(view, "ShowTime", 1)  # two steps are not a complex number
    return view


def _deform(gmsh: Any, view: int, mesh: Mesh) -> None:
    """Draw a view of displacements on the deformed mesh, enlarged so that it can be seen."""
    step = int(gmsh.view.option.getNumber(view, "NbTimeStep")) - 1
    values = gmsh.view.getHomogeneousModelData(view, step)[2].reshape(-1, 3)
    largest = float(np.linalg.norm(values, axis=1).max())
    gmsh.view.option.setNumber(view, "VectorType", 5)
    if largest > 0:
        diagonal = float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
        gmsh.view.option.setNumber(view, "DisplacementFactor", _DRAWN * diagonal / largest)
