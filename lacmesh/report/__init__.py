"""Reports on the content and quality of a mesh and on the effect of a cut: plain records, and files made of them.

records = what a mesh holds, what a cut counts, the table of patterns     (`records`)
touched = the cells that a cut replaced, and those it made               (`touched`)
report = the mesh against its cut: quality, sizes, the worst new cells    (`compare`)
children = the same for a cut whose original mesh is not available        (`parents`)
blocks = what a report says, in order: titles, tables, figures            (`outline`)
files = a report as HTML, Markdown or JSON, quality as a picture          (`writing`, `drawing`)

The blocks, each as HTML and as Markdown, and what puts them on pages (`blocks`, `charts`, `histograms`, `images`,
`pages`) serve any report.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from lacmesh.report.records import CutSummary, PatternRow, describe, pattern_table, summarise

#: name -> the module that holds it, imported when it is used
_LATE = {
    "ChildrenQuality": "parents",
    "CutReport": "compare",
    "children_quality": "parents",
    "cut_report": "compare",
    "plot_quality": "drawing",
    "refuse_poor": "touched",
    "write_report": "writing",
}

__all__ = [
    "ChildrenQuality",
    "CutReport",
    "CutSummary",
    "PatternRow",
    "children_quality",
    "cut_report",
    "describe",
    "pattern_table",
    "plot_quality",
    "refuse_poor",
    "summarise",
    "write_report",
]

if TYPE_CHECKING:
    from lacmesh.report.compare import CutReport, cut_report
    from lacmesh.report.drawing import plot_quality
    from lacmesh.report.parents import ChildrenQuality, children_quality
    from lacmesh.report.touched import refuse_poor
    from lacmesh.report.writing import write_report


def __getattr__(name: str) -> Any:
    if name in _LATE:
        return getattr(import_module(f"lacmesh.report.{_LATE[name]}"), name)
    raise AttributeError(f"module 'lacmesh.report' has no attribute {name!r}")
