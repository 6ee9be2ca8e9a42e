"""Number of cases of a random test: a share in `make test`, all in `make fuzz`, which sets LACMESH_FUZZ."""

from __future__ import annotations

import os

FUZZ = os.environ.get("LACMESH_FUZZ") == "1"


def samples(few, all_of_them):
    """Choose between two numbers of cases; a test that calls this is marked `fuzz`, by which `make fuzz` finds it."""
    return all_of_them if FUZZ else few
