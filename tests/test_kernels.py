"""Kernels: what is said of compiling, and what happens where nothing can be kept."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
CODE = """
import logging, resource
logging.basicConfig(level=logging.INFO)
{limit}
from tests.kernels_to_try import double
print(double(2.0), double.stats.cache_misses)
"""


def ran(folder, limit=""):
    code = CODE.format(limit=limit)
    env = {**os.environ, "NUMBA_CACHE_DIR": str(folder)}
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=env, capture_output=True, text=True, check=True)
    return done.stdout.split(), "compiling" in done.stderr


def test_a_kernel_is_kept_and_the_first_says_that_it_is_compiled(tmp_path):
    assert ran(tmp_path) == (["4.0", "Counter({(float64,):", "1})"], True)
    assert ran(tmp_path) == (["4.0", "Counter()"], False)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits of files as Linux has them")
def test_a_full_disk_keeps_nothing_and_stops_nothing(tmp_path):
    limit = "import signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN); "
    limit += "resource.setrlimit(resource.RLIMIT_FSIZE, (16, resource.RLIM_INFINITY))"
    assert ran(tmp_path, limit)[0][0] == "4.0"
    assert ran(tmp_path)[1]
