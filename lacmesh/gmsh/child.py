"""The child process in which gmsh lists or meshes a CAD file: a request in a folder, an answer in the same folder."""

from __future__ import annotations

import json
import signal
import warnings
from dataclasses import asdict
from pathlib import Path
from typing import Any

from lacmesh.errors import LacmeshError, LacmeshWarning
from lacmesh.gmsh import session


def main(folder: str) -> None:
    """Answer `request.json` of a folder in its `answer.json` (and `mesh.msh`)."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # gmsh does not listen; who asked removes what is left
    place = Path(folder)
    request = json.loads((place / "request.json").read_text(encoding="utf-8"))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", LacmeshWarning)
        try:
            answer = _answer(request, place)
        except LacmeshError as error:
            message = str(error).removeprefix(f"{request['path']}: ")
            answer = {"error": {"kind": type(error).__name__, "message": message}}
    answer["warnings"] = [str(w.message) for w in caught if issubclass(w.category, LacmeshWarning)]
    beside = place / "answer.part"
    beside.write_text(json.dumps(answer), encoding="utf-8")
    beside.rename(place / "answer.json")


def _answer(request: dict[str, Any], folder: Path) -> dict[str, Any]:
    from lacmesh.gmsh import geometry, mesher

    gmsh = session.load()
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.logger.start()
    dim = geometry.open_file(gmsh, Path(request["path"]), request["dim"])
    if request["do"] == "list":
        return {"shapes": [asdict(shape) for shape in geometry.shapes(gmsh, dim)]}
    mesher.write_mesh(gmsh, request, dim, folder / "mesh.msh")
    return {}
