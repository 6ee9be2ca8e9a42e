"""A finished run, read from its folder: what pictures, films, reports and `read_results` are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacsolver.output.names import HISTORY
from lacsolver.output.states import StoredFields
from lacsolver.output.summary import read_summary
from lacsolver.output.tables import read_table
from lacsolver.results.units import Units


@dataclass(frozen=True, eq=False, repr=False)
class FinishedRun:
    """A run as its folder has it; each file is read when it is asked for. Raises ReadError."""

    folder: Path

    @cached_property
    def summary(self) -> Mapping[str, Any]:
        """Content of results.json."""
        return read_summary(self.folder)

    @cached_property
    def history(self) -> Mapping[str, NDArray[np.floating]]:
        """Columns of history.csv."""
        return read_table(self.folder / HISTORY)

    @cached_property
    def units(self) -> Units:
        """Names of the units of the case."""
        return Units.of(self.summary.get("units"))

    @cached_property
    def stored(self) -> StoredFields:
        """Mesh, and fields at the times at which they were written."""
        self.summary  # noqa: B018 (raises for a folder that no run has written)
        return StoredFields(self.folder)
