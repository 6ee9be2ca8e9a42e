"""Tables that a run writes, by column."""

import csv

import numpy as np


def table(path):
    """Columns of a table; what is left empty is NaN."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name] or "nan") for row in rows]) for name in rows[0]}
