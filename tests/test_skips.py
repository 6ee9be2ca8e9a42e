"""The skips themselves: a session on a machine that lacks what its tests need, alone and under xdist."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
TESTS = """
import pytest
from tests import skips
skips._known["medcoupling"] = {absent!r}

@pytest.mark.shared
def test_marked(): raise AssertionError

def test_fixture(shared): raise AssertionError

@pytest.mark.medcoupling
def test_peer(): pass

def test_plain(): pass

@pytest.mark.xfail(reason="known", strict=True)
def test_known(): raise AssertionError

def test_quietly():
    if {quietly}: pytest.skip("because")
"""


def session(folder, *arguments, absent=None, quietly=False, everything=False):
    """Run pytest on TESTS in a checkout of its own: its exit status and its output."""
    (folder / "tests").mkdir()
    for name in ("__init__.py", "conftest.py", "samples.py", "skips.py"):
        (folder / "tests" / name).write_bytes((HERE / name).read_bytes())
    (folder / "pyproject.toml").write_bytes((HERE.parent / "pyproject.toml").read_bytes())
    (folder / "tests" / "test_it.py").write_text(TESTS.format(absent=absent, quietly=quietly))
    env = {k: v for k, v in os.environ.items() if not k.startswith(("LACMESH_", "PYTEST_"))}
    env |= {"LACMESH_ALL": "1"} if everything else {}
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "tests", *arguments]
    child = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)
    return child.returncode, child.stdout


@pytest.mark.parametrize("workers", ["0", "2"])
def test_expected_skips_are_counted(tmp_path, workers):
    status, said = session(tmp_path, "-n", workers, absent="not installed")
    assert "skipped: 3, expected: 3" in said
    assert "2 passed, 3 skipped, 1 xfailed" in said
    assert status == 0


def test_an_unexpected_skip_fails_make_test(tmp_path):
    status, said = session(tmp_path, "-n", "2", quietly=True, everything=True)
    assert "skipped: 3, expected: 2" in said
    assert status == 1


def test_a_missing_package_fails_make_test(tmp_path):
    status, said = session(tmp_path, "-n", "0", absent="not installed", everything=True)
    assert "2 passed, 2 skipped, 1 xfailed, 1 error" in said
    assert "LACMESH_ALL=1 asks for every package; medcoupling: not installed" in said
    assert "skipped: 2, expected: 2" in said
    assert status == 1


def test_deselected_tests_are_not_expected(tmp_path):
    status, said = session(tmp_path, "-rs", "-k", "not marked", absent="not installed")
    assert f"{tmp_path.parent / 'shared' / 'reference'} is absent" in said
    assert "skipped: 2, expected: 2" in said
    assert status == 0
