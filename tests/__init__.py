"""The tests of all packages; with noise in the last bits of results where $NOISE_SEED is set (`noise.py`)."""

import os
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]

if os.environ.get("NOISE_SEED"):
    import tests.noise  # noqa: F401 - before the packages are imported, whose names it would not change
