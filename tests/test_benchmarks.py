"""The benchmarks of `make bench` run, in small sizes: they use inner parts, which change."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
LOOP = r"for name in ([\w ]+); do OPENBLAS_NUM_THREADS=1 \$\(BIN\)/python benchmarks"
NAMES = re.search(LOOP, (ROOT / "Makefile").read_text())[1].split()
#: `start` has one size, and takes half a minute
QUICK = [name for name in NAMES if "--quick" in (ROOT / f"benchmarks/{name}.py").read_text()]


def test_all_but_one_have_small_sizes():
    assert set(NAMES) - set(QUICK) == {"start"}


@pytest.mark.slow
@pytest.mark.parametrize("name", QUICK)
def test_a_benchmark_gives_its_table(name):
    words = [sys.executable, f"benchmarks/{name}.py", "--quick"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("|") > 8, done.stdout
