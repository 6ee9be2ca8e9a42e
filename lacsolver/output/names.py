"""Names of the files that a run writes, and the files of each zone."""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import chain, count
from pathlib import Path

RESULTS, HISTORY, MED, MESH = "results.json", "history.csv", "results.med", "mesh.npz"
SOLID, CONTACT, RING = "solid", "contact_", "ring"
#: files of `lacsolver modes`
MODES, MODES_PVD = "modes.json", "modes.pvd"
#: subfolders: of the VTU files, and of the last state tried by a run that failed
FIELDS, UNCONVERGED = "fields", "unconverged"
_STATE = re.compile(r"state_(\d{4,})\.npz")
_VTU = re.compile(r"(?:solid|ring|contact_.+)_(\d{4,})(?:\.vtu|\.pvtu|\.r\d{5}\.vtu)")
_OURS = re.compile(
    r"results\.json|history\.csv|results\.med|mesh\.npz|solid\.pvd|ring\.pvd|contact_.+\.(?:csv|pvd)"
    r"|state_\d{4,}\.npz"
)
#: names of results while they are written, hidden: a stem that may be shortened, a token, a suffix
_HIDDEN = re.compile(
    r"\.(?:results|history|mesh|solid.*|ring.*|contact_.+|state_\d{4,})-(?:[0-9a-f]{16}|[0-9a-f]{24})\.(?:json|csv|med|pvd|npz|vtu|pvtu)"
)
#: longest part of a file's name for a zone
_LENGTH = 80


def state_file(number: int) -> str:
    """Return the name of the file of the state after a number of steps."""
    return f"state_{number:04d}.npz"


def vtu_file(stem: str, number: int, rank: int | None = None) -> str:
    """Return the path of the VTU file after a number of steps, relative to the folder, as a PVD names it.

    `rank`: that of the process that writes a piece of it, None for a file that is whole.
    """
    piece = "" if rank is None else f".r{rank:05d}"
    return f"{FIELDS}/{stem}_{number:04d}{piece}.vtu"


def mode_file(number: int) -> str:
    """Return the path of the VTU file of a natural mode, relative to the folder, as the PVD names it."""
    return f"{FIELDS}/mode_{number:04d}.vtu"


def modes_in(folder: Path) -> list[Path]:
    """Return the files of natural modes in a folder. Raises OSError."""
    files = [path for path in (folder / MODES, folder / MODES_PVD) if path.exists()]
    return [*files, *sorted((folder / FIELDS).glob("mode_[0-9][0-9][0-9][0-9]*.vtu"))]


def number_of(path: Path) -> int | None:
    """Return the number of steps in the name of a state or VTU file; None for any other file."""
    match = _STATE.fullmatch(path.name) or _VTU.fullmatch(path.name)
    return int(match[1]) if match else None


def states_in(folder: Path) -> list[Path]:
    """Return the files of states in a folder, first to last. Raises OSError."""
    states = [path for path in folder.iterdir() if _STATE.fullmatch(path.name)]
    return sorted(states, key=lambda path: number_of(path) or 0)


def results_in(folder: Path) -> list[Path]:
    """Return the files in a folder that have the names of a run's results. Raises OSError."""
    files = [path for path in folder.iterdir() if _OURS.fullmatch(path.name)]
    for inside in _inside(folder):
        files += [path for path in inside.iterdir() if _OURS.fullmatch(path.name) or _VTU.fullmatch(path.name)]
    return sorted(files)


def collections_in(folder: Path) -> list[Path]:
    """Return the PVD files of a run in a folder. Raises OSError."""
    return [path for path in sorted(folder.glob("*.pvd")) if _OURS.fullmatch(path.name)]


def leftovers_in(folder: Path) -> list[Path]:
    """Return the hidden files in a folder that a run is writing, or was writing when it was killed. Raises OSError."""
    return [path for place in (folder, *_inside(folder)) for path in place.iterdir() if _HIDDEN.fullmatch(path.name)]


def _inside(folder: Path) -> list[Path]:
    """Return the existing subfolders of a run."""
    inside = (folder / FIELDS, folder / UNCONVERGED, folder / UNCONVERGED / FIELDS)
    return [path for path in inside if path.is_dir()]


def contact_stems(zones: Iterable[str]) -> dict[str, str]:
    """Return the stem of each zone's files: `contact_` and its name, with `_` for characters unfit for file names.

    Stems that differ only by case would be the same file on some systems, so that the later one gets a number.

    >>> contact_stems(["joint", "a/b: 1", "a b_ 1", "Joint"])
    {'joint': 'contact_joint', 'a/b: 1': 'contact_a_b__1', 'a b_ 1': 'contact_a_b__1_2', 'Joint': 'contact_Joint_2'}
    """
    stems: dict[str, str] = {}
    taken: set[str] = set()
    for zone in zones:
        plain = CONTACT + "".join(c if c.isalnum() or c in "-_." else "_" for c in zone)[:_LENGTH]
        stem = next(s for s in chain([plain], (f"{plain}_{k}" for k in count(2))) if s.lower() not in taken)
        taken.add(stem.lower())
        stems[zone] = stem
    return stems
