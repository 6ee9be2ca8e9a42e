"""gmsh's window with the parameters and buttons of LAC: choose the skins, cut, check, solve, look at the results.

    open_model(path)          the file becomes gmsh's current model
    set_parameters()          LAC/Slave, LAC/Master and the buttons, in gmsh's tree (ONELAB)
    act(path, "lac cut")      what a button does; its messages go to gmsh's console
    show(path)                the window: all of this until it is closed

Solving is the work of the command `lacsolver`, which runs as a process of its own.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from lacmesh.checks import check
from lacmesh.errors import DataError, LacmeshWarning, ReadError, RequestError
from lacmesh.formats import read, write
from lacmesh.formats.ids import Index
from lacmesh.formats.vtu import read_pvd
from lacmesh.gmsh import cut_model, from_mesh, geometry, session, to_mesh
from lacmesh.gmsh.cad import SUFFIXES, check_source
from lacmesh.gmsh.views import RESULT_MARK
from lacmesh.mesh import Mesh

SLAVE, MASTER, RESULT = "LAC/Slave", "LAC/Master", "LAC/}4Result"
#: name of a button's parameter (gmsh sorts by it), its label, its action
_BUTTONS = (
    ("LAC/}1Cut", "Cut for LAC", "lac cut"),
    ("LAC/}2Check", "Check", "lac check"),
    ("LAC/}3Solve", "Solve", "lac solve"),
)
#: seconds after which the window looks whether the program shall end
_WAIT = 0.2


def open_model(path: Path) -> None:
    """Make a file gmsh's current model: geometry as `lacmesh mesh` takes it, or a mesh in any format of lacmesh.

    gmsh must be initialised. Raises RequestError, ReadError, DataError.
    """
    gmsh = session.running()
    gmsh.logger.start()
    try:
        if path.suffix.lower() in SUFFIXES:
            geometry.open_file(gmsh, check_source(path), None)
        elif path.suffix.lower() == ".msh" and path.is_file():
            gmsh.open(str(path))
        else:
            from_mesh(read(path), path.stem)
    except Exception as error:
        if type(error) is Exception:  # gmsh's own
            raise ReadError(path, f"gmsh cannot read it ({error})") from error
        raise
    finally:
        gmsh.logger.stop()


def set_parameters() -> None:
    """Set the parameters and buttons where they are missing, and the choices where the model has other groups now.

    What was chosen stays while there are groups of that name.
    """
    gmsh = session.running()
    choices = _skins(gmsh)
    for name, wanted in ((SLAVE, "slave"), (MASTER, "master")):
        known = json.loads(gmsh.onelab.get(name) or '{"choices": null}')["choices"]
        if known != (choices or [""]):
            alike = [c for c in choices if wanted in c.lower()]
            kept = set(_chosen(gmsh, name, choices)) & set(choices)
            value = ", ".join(_chosen(gmsh, name, choices)) if kept else next(iter(alike), "")
            _set(gmsh, name, wanted.capitalize(), value, choices=choices or [""])
    for name, label, action in _BUTTONS:
        if not gmsh.onelab.get(name):
            _set(gmsh, name, label, action, attributes={"Macro": "Action", "Aspect": "Button"})
    if not gmsh.onelab.get(RESULT):
        _set(gmsh, RESULT, "Result", "", readOnly=True)


def act(path: Path, action: str) -> str:
    """Do what a button of the window asks for, and return the line that becomes the parameter Result.

    `path`: the model's file, beside which Solve writes. Whatever goes wrong is said in gmsh's messages, and raises
    nothing.
    """
    gmsh = session.running()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", LacmeshWarning)
        try:
            result = _ACTIONS[action](gmsh, path)
            _say(gmsh, "info", result)
        except Exception as error:  # gmsh's own class among them; the window must stay
            result = str(error) or type(error).__name__
            _say(gmsh, "error", result)
    for warning in caught:
        _say(gmsh, "warning", str(warning.message))
    _set(gmsh, RESULT, "Result", result.splitlines()[0], readOnly=True)
    return result


def show(path: Path) -> None:
    """Show the window and do what its buttons ask for, until it is closed. Raises RequestError without a display."""
    gmsh = session.running()
    gmsh.option.setNumber("General.ShowMessagesOnStartup", 1)
    gmsh.option.setNumber("General.MenuWidth", 300)
    set_parameters()
    _open_window(gmsh)
    gmsh.fltk.openTreeItem("LAC")
    while gmsh.fltk.isAvailable():
        action = next(iter(gmsh.onelab.getString("ONELAB/Action")), "")
        if action in _ACTIONS:
            act(path, action)
            if not gmsh.fltk.isAvailable():  # closed while lacsolver was running
                return
            gmsh.fltk.update()
            gmsh.graphics.draw()
        if action:
            gmsh.onelab.setString("ONELAB/Action", [""])  # also what was pressed in the meantime
        set_parameters()
        gmsh.fltk.wait(_WAIT)


def _open_window(gmsh: Any) -> None:
    """Open the window, which would take the signals that end the program."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        gmsh.fltk.initialize()
    except Exception as error:  # gmsh's own class of errors
        raise RequestError(f"gmsh cannot open its window: {error}") from error
    for number, handler in before.items():
        signal.signal(number, handler)


def _skins(gmsh: Any) -> list[str]:
    """The physical groups of faces (of curves, in a plane); the faces themselves where there is no group."""
    dim = max(gmsh.model.getDimension() - 1, 1)
    groups = gmsh.model.getPhysicalGroups(dim)
    if not groups:
        return [f"entity:{dim}:{tag}" for _, tag in gmsh.model.getEntities(dim)]
    return [gmsh.model.getPhysicalName(dim, tag) or f"{dim}:{tag}" for _, tag in groups]


def _chosen(gmsh: Any, name: str, choices: Collection[str]) -> list[str]:
    """The groups that a parameter names: one of the choices, or several with commas between them."""
    text = next(iter(gmsh.onelab.getString(name)), "").strip()
    return [text] if text in choices else [part.strip() for part in text.split(",") if part.strip()]


def _set(gmsh: Any, name: str, label: str, value: str, **more: Any) -> None:
    gmsh.onelab.set(json.dumps([{"type": "string", "name": name, "label": label, "values": [value], **more}]))


def _say(gmsh: Any, level: str, text: str) -> int:
    """Write lines to gmsh's console, and return their number; `level` is info, warning or error."""
    lines = text.split("\n") if text else []
    for line in lines:
        with suppress(Exception):  # gmsh writes an error, and raises it, too
            gmsh.logger.write(line, level)
    return len(lines)


def _slaves(gmsh: Any) -> list[str]:
    chosen = _chosen(gmsh, SLAVE, _skins(gmsh))
    if not chosen:
        raise RequestError(f"choose {SLAVE} first: a group of faces, or several with commas between them")
    return chosen


def _check_meshed(gmsh: Any) -> None:
    if not gmsh.model.mesh.getMaxNodeTag():
        raise RequestError("the model has no mesh yet: Modules > Mesh > 3D (or 2D, in a plane) makes one")


def _cut(gmsh: Any, path: Path) -> str:
    _check_meshed(gmsh)
    slaves = _slaves(gmsh)
    remove_results(gmsh)
    cut = cut_model(slaves)
    return f"{', '.join(cut.zones)} cut: {cut.n_macros:,} macro-elements"


def _check(gmsh: Any, path: Path) -> str:
    _check_meshed(gmsh)
    findings = check(to_mesh(), _slaves(gmsh), _chosen(gmsh, MASTER, _skins(gmsh)) or None)
    for finding in findings:
        where = f" [in {finding.where.group}]" if finding.where.group else ""
        _say(gmsh, finding.severity, f"{finding.rule}: {finding.message}{where}")
    errors, others = len(findings.errors), len(findings.warnings)
    return f"{errors or 'no'} error{'s' * (errors != 1)}, {others} warning{'s' * (others != 1)}"


def _solve(gmsh: Any, path: Path) -> str:
    """Write the mesh and, at the first time, its case; later run the case and show its results."""
    _check_meshed(gmsh)
    mesh = to_mesh()
    if not mesh.zones:
        raise RequestError("the mesh is not cut yet: press Cut for LAC first")
    stem = path.with_name(path.stem.removesuffix(".lac"))
    cut, case, folder = (stem.with_name(f"{stem.name}.lac{end}") for end in (".msh", ".toml", ".results"))
    write(cut, mesh, force=True)
    _say(gmsh, "info", f"{cut} holds the cut mesh")
    if not case.exists():
        _lacsolver(gmsh, "new", cut, "-o", case)
        return f"fill in materials, supports and loads in {case}, then press Solve again"
    _lacsolver(gmsh, "run", case, "-o", folder, "--force")
    shown = show_results(gmsh, to_mesh(), folder)
    return f"solved; views: {', '.join(shown)}; all results are in {folder}"


def _lacsolver(gmsh: Any, *words: str | Path) -> None:
    """Run the command lacsolver, whose lines become messages; it ends with the window. Raises DataError if it fails."""
    command = [sys.executable, "-m", "lacsolver", *map(str, words)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=subprocess.STDOUT, text=True, encoding="utf-8") as child:
        lines = _follow(gmsh, child)
    if child.returncode:
        raise DataError(_complaint(lines) or f"lacsolver ended with status {child.returncode}")


def _follow(gmsh: Any, child: subprocess.Popen[str]) -> list[str]:
    """Write the lines of a process to the console until it ends, while the window answers; return the lines."""
    lines: list[str] = []
    reader = threading.Thread(target=_collect, args=(child.stdout, lines), daemon=True)
    reader.start()
    window, written = gmsh.fltk.isAvailable(), 0
    try:
        while reader.is_alive():
            if not window:
                reader.join(_WAIT)
            elif gmsh.fltk.isAvailable():
                gmsh.fltk.wait(_WAIT)
            else:
                raise RequestError("the window was closed")
            written += _say(gmsh, "info", "\n".join(lines[written:]))
    except BaseException:
        child.terminate()
        raise
    finally:
        reader.join()
    _say(gmsh, "info", "\n".join(lines[written:]))
    return lines


def _collect(stream: Iterable[str], lines: list[str]) -> None:
    for line in stream:
        lines.append(line.rstrip())  # noqa: PERF401 (they are read meanwhile)


def _complaint(lines: Iterable[str]) -> str:
    """The error among lines that lacsolver wrote: its last message, which may have several lines."""
    return "\n".join(["", *lines]).rpartition("\nlacsolver: error: ")[2].strip()


_ACTIONS: Mapping[str, Callable[[Any, Path], str]] = MappingProxyType(
    {"lac cut": _cut, "lac check": _check, "lac solve": _solve}
)


# ---- results of lacsolver as gmsh's views of the current model: the displacement, and the pressure of each contact


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
    frames = [(time, read(path.parent / file)) for time, file in read_pvd(path).items()]
    if not frames:
        raise ReadError(path, "names no file that is there; run the case again")
    if not all(_part_of(mesh, frame) for _, frame in frames):
        raise DataError(f"{path} is of another mesh than gmsh's: the case names another, or cuts other faces")
    return frames


def _part_of(mesh: Mesh, frame: Mesh) -> bool:
    """True if each node of the frame has its number and place in the mesh, and each cell its number."""
    if not (np.isin(frame.node_number, mesh.node_number).all() and np.isin(frame.cell_number, mesh.cell_number).all()):
        return False
    place = mesh.points[Index(mesh.node_number).places(frame.node_number)]
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
