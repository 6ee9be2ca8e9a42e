"""The former place of `verification.charts`."""

from verification.charts import Line, Plot

__all__ = ["Line", "Plot"]
