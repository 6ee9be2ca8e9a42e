"""Curves drawn by matplotlib: panels of them, and columns of a run's history over time, a panel for each quantity."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lacmesh.errors import RequestError, did_you_mean
from lacmesh.formats.output import replace_file
from lacmesh.mesh import Floats
from lacsolver.output.names import HISTORY
from lacsolver.output.tables import read_table
from lacsolver.pictures.drawing import check_plot
from lacsolver.pictures.plane import level_out, png_of

#: size of a panel in inches, and points per inch
_WIDE, _HIGH, _DPI = 8.0, 2.6, 150


class Panel(NamedTuple):
    """Curves of one quantity, x and y (n,) by their names, and the labels of the axes; `log`: y is logarithmic."""

    up: str
    curves: Mapping[str, tuple[Sequence[float] | Floats, Sequence[float] | Floats]]
    across: str = "time"
    log: bool = False


def plot_history(
    folder: str | os.PathLike[str], path: str | os.PathLike[str], columns: Sequence[str], *, title: str | None = None
) -> None:
    """Draw columns of a run's history over time into a PNG file.

    `columns`: names of columns, or patterns such as `energy.*`; by default all energies, and if there are none, all
    reactions. Columns of one kind (`energy`, `contact`, ...) share a panel. Raises RequestError for columns that the
    history does not have, ReadError, WriteError.

    >>> from tempfile import TemporaryDirectory
    >>> from lacsolver import read_case, run
    >>> from lacsolver.output import create_output
    >>> with TemporaryDirectory() as folder:
    ...     done = run(read_case("data/two_blocks.toml"), create_output(folder))
    ...     plot_history(folder, f"{folder}/forces.png", ["reaction.bottom.*"])
    """
    folder, path = Path(folder), Path(path)
    check_plot(path, 2)
    table = read_table(folder / HISTORY)
    kinds: dict[str, dict[str, tuple[Floats, Floats]]] = {}
    for name, values in chosen(table, columns).items():
        kinds.setdefault(_kind(name), {})[name] = table["time"], values
    replace_file(path, draw_panels([Panel(kind, curves) for kind, curves in kinds.items()], title or folder.name))


def chosen(table: Mapping[str, Floats], columns: Sequence[str]) -> dict[str, Floats]:
    """Return the values of the columns that are named, in this order, by their names. Raises RequestError.

    >>> import numpy as np
    >>> table = {"time": np.r_[0, 1], "energy.kinetic": np.r_[2, 1], "energy.strain": np.r_[0, 1]}
    >>> list(chosen(table, ["energy.s*"])), list(chosen(table, []))
    (['energy.strain'], ['energy.kinetic', 'energy.strain'])
    """
    usual = [pattern for pattern in ("energy.*", "reaction.*") if any(fnmatchcase(name, pattern) for name in table)]
    out: dict[str, Floats] = {}
    for pattern in columns or usual[:1]:
        names = [name for name in table if name == pattern] or [name for name in table if fnmatchcase(name, pattern)]
        if not names:
            raise RequestError(f"{HISTORY} has no column {pattern!r}{did_you_mean(pattern, table)}")
        out |= {name: table[name] for name in names}
    if not out:
        raise RequestError(f"{HISTORY} has no energies and no reactions to draw; name columns by --history")
    return out


def _kind(name: str) -> str:
    """Return the kind of a column: its first word, and the quantity of a probe or a contact."""
    parts = name.split(".")
    if parts[0] == "probe":
        return {"u": "displacement", "v": "velocity", "a": "acceleration"}.get(parts[-1][:1], "probe")
    if parts[0] == "contact":
        if "impulse" in parts[-2:]:
            return "impulse"
        return "contact force" if parts[-1] in ("fx", "fy", "fz") else parts[-1].replace("_", " ")
    if parts[:2] == ["momentum", "angular"]:
        return "angular momentum"
    return parts[0]


def draw_panels(panels: Sequence[Panel], title: str = "", *, columns: int = 1) -> bytes:
    """Return a picture of panels, in so many columns, as PNG; panels of one column have the same x."""
    rows = math.ceil(len(panels) / columns)
    figure = import_module("matplotlib.figure").Figure((_WIDE, 0.5 + _HIGH * rows), dpi=_DPI, layout="constrained")
    figure.suptitle(title.replace("$", r"\$"))
    every = figure.subplots(rows, columns, sharex=columns == 1, squeeze=False).flat
    for ax, panel in zip(every, panels, strict=False):
        for name, (x, y) in panel.curves.items():
            marker = "." if len(x) < 2 else ""
            ax.plot(x, np.asarray(y, float), marker=marker, label=name.replace("$", r"\$"), linewidth=1.2)
        if panel.log:
            ax.set_yscale("log", nonpositive="clip")
        else:
            level_out(ax, np.concatenate([np.asarray(y, float) for _, y in panel.curves.values()]))
        ax.set_ylabel(panel.up)
        ax.grid(alpha=0.3)
        if columns == 1:
            ax.legend(fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
        else:
            ax.set_xlabel(panel.across)
            ax.legend(fontsize="x-small", frameon=False)
    for ax in list(every)[len(panels) :]:
        ax.set_axis_off()
    if columns == 1:
        ax.set_xlabel(panels[-1].across)
    return png_of(figure)
