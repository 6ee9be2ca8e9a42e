"""What a mesh holds (`content`), the cells that a cut touched (`touched`), and reports on the cut and on quality."""

from lacmesh.report.content import describe
from lacmesh.report.cut_report import (
    ChildrenQuality,
    CutReport,
    CutSummary,
    check_report,
    children_quality,
    cut_report,
    number,
    report_bytes,
    summarise,
    write_report,
)
from lacmesh.report.quality_plot import check_plot, plot_quality
from lacmesh.report.touched import refuse_poor, refuse_poor_children, touched

__all__ = [
    "ChildrenQuality",
    "CutReport",
    "CutSummary",
    "check_plot",
    "check_report",
    "children_quality",
    "cut_report",
    "describe",
    "number",
    "plot_quality",
    "refuse_poor",
    "refuse_poor_children",
    "report_bytes",
    "summarise",
    "touched",
    "write_report",
]
