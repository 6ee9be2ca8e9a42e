"""How many cases of a random test are tried: a share in `make test`, all in `make fuzz`, which sets LACMESH_FUZZ."""

from __future__ import annotations

import os

FUZZ = os.environ.get("LACMESH_FUZZ") == "1"


def samples(few, all_of_them):
    """One of two numbers; a test that asks is marked `fuzz`, by which `make fuzz` finds it."""
    return all_of_them if FUZZ else few
