"""Skipping what a machine lacks (`skips.py`), and the folder of reference data."""

from __future__ import annotations

import gc
import shutil
import signal

import pytest
from _pytest.doctest import DoctestModule
from hypothesis import settings

from tests import skips
from tests.samples import FUZZ

# no example is too slow by the clock; but for `make fuzz`, which seeks new ones, the same examples in every run
settings.register_profile("any machine", deadline=None, derandomize=not FUZZ)
settings.load_profile("any machine")


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(file_path):
    """Seek no examples in the tests themselves, which have none: it takes a second for every hundred files."""
    found = yield
    return [one for one in found if not (isinstance(one, DoctestModule) and "tests" in file_path.parts)]


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_collection(session):
    """Collect the tests without Python's search for garbage, which is also spared what they are made of: they stay."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_configure(config):
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # `nohup make test &`: commands that tests start, and
        signal.signal(signal.SIGINT, signal.default_int_handler)  # interrupt, would inherit that they do not listen
    config.pluginmanager.register(skips.Tally(config), "lacmesh-skips")


@pytest.fixture(scope="session")
def shared():
    """The folder `../shared`, or $LACMESH_SHARED: `shared / "reference"` is there."""
    if skips.absence("shared"):
        pytest.skip(skips.absence("shared"))
    return skips.shared_folder()


@pytest.fixture
def every_thread(monkeypatch):
    """Take as many threads as are asked for, however few rows or cells there are."""
    monkeypatch.setattr("lacmesh.kernels.threads._WORTH", 1)


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    """A folder with `data/`, as a user's checkout has it."""
    data = skips.REPOSITORY / "data"
    shutil.copytree(data, tmp_path / "data", ignore=shutil.ignore_patterns("*.lac.*"))
    monkeypatch.chdir(tmp_path)
    return tmp_path
