"""The folder that a run writes into: checked when the run starts, and cleared only once the case can be solved.

In between a run may be refused because of its case or its mesh, and then no earlier results are lost. Files whose names
are not those of results are kept. A restart into the folder that its state came from continues the files there.
"""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from lacmesh.errors import RequestError, WriteError, some, writing
from lacmesh.formats.output import is_abandoned
from lacsolver.output.names import FIELDS, UNCONVERGED, leftovers_in, number_of, results_in, states_in
from lacsolver.results.results import Restart


@dataclass(frozen=True)
class OutputFolder:
    """The folder of a run. `restart`: a state of an earlier run in this folder, after which its files are continued.

    `force`: True if existing results may be lost.
    """

    path: Path
    restart: Restart | None = None
    force: bool = False

    def check(self) -> None:
        """Raise RequestError if the folder holds results that would be lost (unless `force`); OSError."""
        there = results_in(self.path) if self.path.is_dir() and not self.force else []
        if there and self.restart is None:
            raise RequestError(f"{self.path} holds results already; --force replaces them, or -o names another folder")
        if there and self.restart is not None:
            _check_states(self.path, self.restart)

    def take(self) -> None:
        """Make the folder, and remove the results of an earlier run from it, for a restart only those after its state.

        Raises RequestError if results have come there that would be lost, WriteError.
        """
        with writing(self.path):
            self.path.mkdir(exist_ok=True)
            self.check()
            for path in leftovers_in(self.path):
                if is_abandoned(path):
                    path.unlink()
            for path in results_in(self.path):
                if self.restart is None or _later(path, self.restart):
                    path.unlink()
            for inside in (UNCONVERGED + "/" + FIELDS, UNCONVERGED, FIELDS):
                with suppress(OSError):  # it is not there, or something else is in it
                    (self.path / inside).rmdir()


def create_output(path: str | os.PathLike[str], *, force: bool = False, restart: Restart | None = None) -> OutputFolder:
    """Return the folder that a run is to write into; no file is written or removed until `OutputFolder.take`.

    `restart`: state that the run starts from; if it came from the same folder, the files there are continued. Raises
    RequestError if the folder holds results that would be lost (unless `force`), WriteError if no files can be made
    there.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as place:
    ...     create_output(f"{place}/results").path.name
    'results'
    """
    path = Path(path)
    continued = restart is not None and restart.folder is not None and _same(path, restart.folder)
    folder = OutputFolder(path, restart if continued else None, force)
    with writing(path, "cannot be used"):
        check_folder(path)
        folder.check()
    return folder


def make_folder(folder: Path) -> None:
    """Make a folder and those around it, unless it is there. Raises WriteError."""
    with writing(folder, "cannot be made"):
        folder.mkdir(exist_ok=True, parents=True)


def check_folder(path: Path) -> None:
    """Raise WriteError if a folder of results cannot be made or written at a path."""
    if path.exists() and not path.is_dir():
        raise WriteError(path, "is a file, and results are a folder; choose another name")
    if not path.exists() and not path.parent.is_dir():
        raise WriteError(path, f"the folder {path.parent} does not exist")
    folder = path if path.exists() else path.parent
    if not os.access(folder, os.W_OK | os.X_OK, effective_ids=os.access in os.supports_effective_ids):
        raise WriteError(path, f"no file may be made in the folder {folder}; choose another one")


def _check_states(path: Path, restart: Restart) -> None:
    later = [number for state in states_in(path) if (number := number_of(state) or 0) > restart.number]
    if later:
        message = f"{path} holds later states (after steps {some(later)}) than t = {restart.time:.9g}"
        raise RequestError(f"{message}; --force replaces them, or -o names another folder")


def _same(one: Path, other: Path) -> bool:
    return Path(os.path.realpath(one)) == Path(os.path.realpath(other))


def _later(path: Path, restart: Restart) -> bool:
    number = number_of(path)
    return UNCONVERGED in path.parts[-3:-1] or (number is not None and number > restart.number)
