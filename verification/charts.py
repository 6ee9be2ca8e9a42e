"""Charts of the report, drawn by matplotlib, and pictures as addresses."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Line:
    """A line of a plot; `expected`: drawn in black, without points."""

    label: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    expected: bool = False


@dataclass(frozen=True)
class Plot:
    """Lines to draw."""

    title: str
    x_label: str
    y_label: str
    lines: tuple[Line, ...]
    log_x: bool = False
    log_y: bool = False


def sloping(lines: Sequence[Line], slope: float) -> Line:
    """A line of a slope in logarithmic axes, below the others."""
    points = [(x, y) for line in lines for x, y in zip(line.x, line.y, strict=True) if x > 0 and y > 0]
    factor = 0.6 * min((y / x**slope for x, y in points), default=1.0)
    ends = tuple(sorted({x for x, _ in points}))
    return Line(f"slope {slope:.3g}", ends, tuple(factor * x**slope for x in ends), expected=True)


def drawn(plots: Sequence[Plot]) -> str:
    """Plots beside and below each other in one picture, as a `data:` address."""
    from matplotlib.figure import Figure

    across = min(3, len(plots))
    down = -(-len(plots) // across)
    figure = Figure(figsize=(4.6 * across, 3.7 * down))
    figure.subplots_adjust(0.2 / across, 0.15 / down, 1 - 0.03 / across, 1 - 0.12 / down, 0.25, 0.4)
    for k, plot in enumerate(plots):
        axes = figure.add_subplot(down, across, k + 1)
        for line in plot.lines:
            axes.plot(line.x, line.y, "k-" if line.expected else ".-", label=line.label or None)
        for scaled, asked, name in ((axes.set_xscale, plot.log_x, "x"), (axes.set_yscale, plot.log_y, "y")):
            positive = any(v > 0 for line in plot.lines for v in getattr(line, name))
            scaled("log" if asked and positive else "linear")
        axes.set_title(plot.title, fontsize=8, wrap=True)
        axes.set_xlabel(plot.x_label, fontsize=8)
        axes.set_ylabel(plot.y_label, fontsize=8)
        if plot.lines:
            axes.legend(fontsize=6)
    content = io.BytesIO()
    figure.savefig(content, format="webp", pil_kwargs={"quality": 80})
    return address("webp", content.getvalue())


def address(kind: str, content: bytes) -> str:
    """A picture as a `data:` address."""
    return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"
