"""Noise in the commands that tests start: Python runs this module first where its folder is in PYTHONPATH."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))
import tests.noise  # noqa: F401

del sys.path[0]
