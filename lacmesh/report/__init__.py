"""What a mesh holds (`content`), the cells that a cut touched (`touched`), and reports on the cut and on quality."""

from lacmesh.report.content import describe as describe
from lacmesh.report.cut_report import ChildrenQuality as ChildrenQuality
from lacmesh.report.cut_report import CutReport as CutReport
from lacmesh.report.cut_report import CutSummary as CutSummary
from lacmesh.report.cut_report import check_report as check_report
from lacmesh.report.cut_report import children_quality as children_quality
from lacmesh.report.cut_report import cut_report as cut_report
from lacmesh.report.cut_report import number as number
from lacmesh.report.cut_report import report_bytes as report_bytes
from lacmesh.report.cut_report import values as values
from lacmesh.report.cut_report import write_report as write_report
from lacmesh.report.quality_plot import check_plot as check_plot
from lacmesh.report.quality_plot import plot_quality as plot_quality
from lacmesh.report.touched import refuse_poor as refuse_poor
from lacmesh.report.touched import touched as touched
