"""The report of a run: a page of HTML that needs nothing else, Markdown beside it; a summary; what changed.

what is said = pages of blocks: tables, charts, sentences     (`outline`, `brief`, `tables`, `convergence`, `judging`)
as files = the pages as HTML and as Markdown                  (`writing`; the rest by `lacmesh.report`)
problem = a drawing of each family's, with its style          (`problems/`)
two runs = which results appeared, vanished, changed          (`changes`)
"""

from __future__ import annotations

from verification.report.brief import summary
from verification.report.changes import compare
from verification.report.writing import write

__all__ = ["compare", "summary", "write"]
