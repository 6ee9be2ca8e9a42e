"""Natural modes in a folder: modes.json, and modes.pvd with a VTU file for the shape of each mode.

Rigid-body modes come first. The time of a mode in modes.pvd is its number, from 1.
"""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lacmesh import __version__
from lacmesh.errors import RequestError, writing
from lacmesh.formats import write
from lacmesh.formats.output import replace_file
from lacmesh.formats.vtu import write_pvd
from lacsolver.output.folder import check_folder
from lacsolver.output.names import FIELDS, MODES, MODES_PVD, mode_file, modes_in
from lacsolver.output.parts import body
from lacsolver.output.summary import read_json
from lacsolver.output.vtu import wide
from lacsolver.results.modes import NaturalModes
from lacsolver.space.space import Space


def check_modes_folder(path: str | os.PathLike[str], *, force: bool = False) -> Path:
    """Return the folder for natural modes; nothing is written yet.

    Raises RequestError if it holds modes already (unless `force`), WriteError if no files can be made there.
    """
    folder = Path(path)
    with writing(folder, "cannot be used"):
        check_folder(folder)
        if not force and folder.is_dir() and modes_in(folder):
            message = f"{folder} holds natural modes already"
            raise RequestError(f"{message}; --force replaces them, or -o names another folder")
    return folder


def write_modes(folder: Path, modes: NaturalModes, space: Space) -> None:
    """Write natural modes into a folder, in place of those that it holds. Raises WriteError."""
    with writing(folder):
        (folder / FIELDS).mkdir(parents=True, exist_ok=True)
        for path in modes_in(folder):
            path.unlink()
    part = body(space)
    files: dict[float, str] = {}
    for number, shape in enumerate(np.concatenate([modes.rigid_shapes, modes.shapes]), 1):
        data = {"displacement": wide(shape[part.nodes], 3)}
        write(folder / mode_file(number), replace(part.mesh, node_data={**part.mesh.node_data, **data}), compress=True)
        files[float(number)] = mode_file(number)
    write_pvd(folder / MODES_PVD, files)
    replace_file(folder / MODES, (json.dumps(_summary(modes), ensure_ascii=False, indent=1) + "\n").encode())


def read_modes(folder: Path) -> dict[str, Any]:
    """Return the content of modes.json. Raises ReadError."""

    def is_ours(modes: Any) -> bool:
        return isinstance(modes, dict) and isinstance(modes["rigid"], int) and isinstance(modes["frequencies"], list)

    modes: dict[str, Any] = read_json(folder / MODES, is_ours, advice="; name a folder that lacsolver modes wrote")
    return modes


def _summary(modes: NaturalModes) -> dict[str, Any]:
    """Return the content of modes.json, in its order."""
    axes = range(len(modes.axes))
    return {
        "version": __version__,
        "frequencies": modes.frequencies.tolist(),
        "rigid": len(modes.rigid),
        "rigid_motions": list(modes.rigid),
        "modal_masses": modes.modal_masses.tolist(),
        "effective_masses": {modes.axes[k]: modes.effective_masses[:, k].tolist() for k in axes},
        "rigid_effective_masses": {modes.axes[k]: float(modes.rigid_masses[k]) for k in axes},
        "mass": modes.mass,
        "unknowns": modes.unknowns,
        "closed_rows": modes.held,
        "time": modes.time,
        "sectors": modes.sectors,
    }
