"""The names of what is written, and which zone goes to which file."""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import chain, count
from pathlib import Path

RESULTS, HISTORY, MED = "results.json", "history.csv", "results.med"
SOLID, CONTACT = "solid", "contact_"
#: in the folder: where the VTU files are, and the last state tried of a run that failed
FIELDS, UNCONVERGED = "fields", "unconverged"
_STATE = re.compile(r"state_(\d{4,})\.npz")
_VTU = re.compile(r"(?:solid|contact_.+)_(\d{4,})\.vtu")
_OURS = re.compile(r"results\.json|history\.csv|results\.med|solid\.pvd|contact_.+\.(?:csv|pvd)|state_\d{4,}\.npz")
#: what is ours, hidden while it is written: a stem that may be shortened, a token, a suffix
_HIDDEN = re.compile(
    r"\.(?:results|history|solid.*|contact_.+|state_\d{4,})-(?:[0-9a-f]{16}|[0-9a-f]{24})\.(?:json|csv|med|pvd|npz|vtu)"
)
#: a zone's part of a file's name, at most
_LENGTH = 80


def state_file(number: int) -> str:
    """The file of the state after a number of steps."""
    return f"state_{number:04d}.npz"


def vtu_file(stem: str, number: int) -> str:
    """Where in the folder the fields after a number of steps are, as a PVD names it."""
    return f"{FIELDS}/{stem}_{number:04d}.vtu"


def number_of(path: Path) -> int | None:
    """The number of steps that a state's or VTU's name tells; None for any other file."""
    found = _STATE.fullmatch(path.name) or _VTU.fullmatch(path.name)
    return int(found[1]) if found else None


def states_in(folder: Path) -> list[Path]:
    """The files of states in a folder, first to last. Raises OSError."""
    found = [path for path in folder.iterdir() if _STATE.fullmatch(path.name)]
    return sorted(found, key=lambda path: number_of(path) or 0)


def results_in(folder: Path) -> list[Path]:
    """The files in a folder that a run would write, by their names. Raises OSError."""
    found = [path for path in folder.iterdir() if _OURS.fullmatch(path.name)]
    for inside in _inside(folder):
        found += [path for path in inside.iterdir() if _OURS.fullmatch(path.name) or _VTU.fullmatch(path.name)]
    return sorted(found)


def collections_in(folder: Path) -> list[Path]:
    """The PVD files of a run in a folder. Raises OSError."""
    return [path for path in sorted(folder.glob("*.pvd")) if _OURS.fullmatch(path.name)]


def leftovers_in(folder: Path) -> list[Path]:
    """Hidden files in a folder that a run was writing when it was killed, or is. Raises OSError."""
    return [path for place in (folder, *_inside(folder)) for path in place.iterdir() if _HIDDEN.fullmatch(path.name)]


def _inside(folder: Path) -> list[Path]:
    """The folders inside that a run made."""
    inside = (folder / FIELDS, folder / UNCONVERGED, folder / UNCONVERGED / FIELDS)
    return [path for path in inside if path.is_dir()]


def contact_stems(zones: Iterable[str]) -> dict[str, str]:
    """For each zone the stem of its files: `contact_`, and its name with `_` for what a file's name should not have.

    Stems that differ by case alone would be one file on some systems: the later gets a number.

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
