"""Plots of columns of a run's history over time, one panel for each kind of quantity."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from importlib import import_module
from pathlib import Path

import numpy as np

from lacmesh.errors import RequestError, check_installed, did_you_mean
from lacmesh.formats.output import replace_file
from lacmesh.mesh import Floats
from lacsolver.output.names import HISTORY
from lacsolver.output.tables import read_table
from lacsolver.pictures.plane import level_out

#: size of a panel in inches, and points per inch
_WIDE, _HIGH, _DPI = 8.0, 2.6, 150


def check_plot_history(path: Path) -> None:
    """Raise RequestError if no plot can be drawn: another file than .png, or a package that is missing."""
    if path.suffix.lower() != ".png":
        raise RequestError(f"{path}: a plot is written as .png")
    check_installed("matplotlib", "view", "a plot")


def plot_history(
    folder: str | os.PathLike[str], path: str | os.PathLike[str], columns: Sequence[str], *, title: str | None = None
) -> None:
    """Draw columns of a run's history over time into a PNG file.

    `columns`: names of columns, or patterns such as `energy.*`; by default all energies, and if there are none, all
    reactions. Columns of one kind (`energy`, `contact`, ...) share a
    panel. Raises RequestError for columns that the history does not have, ReadError, WriteError.

    >>> from tempfile import TemporaryDirectory
    >>> from lacsolver import read_case, run
    >>> from lacsolver.output import create_output
    >>> with TemporaryDirectory() as folder:
    ...     done = run(read_case("data/two_blocks.toml"), create_output(folder))
    ...     plot_history(folder, f"{folder}/forces.png", ["reaction.bottom.*"])
    """
    folder, path = Path(folder), Path(path)
    check_plot_history(path)
    table = read_table(folder / HISTORY)
    panels: dict[str, dict[str, Floats]] = {}
    for name, values in chosen(table, columns).items():
        panels.setdefault(_kind(name), {})[name] = values
    replace_file(path, _drawn(table["time"], panels, title or folder.name))


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


def _drawn(time: Floats, panels: Mapping[str, Mapping[str, Floats]], title: str) -> bytes:
    """Return the picture as PNG."""
    size = _WIDE, 0.5 + _HIGH * len(panels)
    figure = import_module("matplotlib.figure").Figure(size, dpi=_DPI, layout="constrained")
    figure.suptitle(title.replace("$", r"\$"))
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for ax, (kind, curves) in zip(axes, panels.items(), strict=True):
        for name, values in curves.items():
            ax.plot(time, values, label=name.replace("$", r"\$"), linewidth=1.2)
        level_out(ax, np.concatenate(list(curves.values())))
        ax.set_ylabel(kind)
        ax.grid(alpha=0.3)
        ax.legend(fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    axes[-1].set_xlabel("time")
    png = io.BytesIO()
    figure.savefig(png, format="png", metadata={"Software": None})
    return png.getvalue()
