"""Skipping what a machine lacks (`skips.py`), and the folder of reference data."""

from __future__ import annotations

import pytest

from tests import skips


def pytest_configure(config):
    config.pluginmanager.register(skips.Tally(config), "lacmesh-skips")


def pytest_runtest_setup(item):
    lacks = skips.missing(item)
    refused = [f"{need}: {why}" for need, why in lacks if not skips.forgiven(need)]
    if refused:
        pytest.fail(f"LACMESH_ALL=1 asks for every package; {'; '.join(refused)}", pytrace=False)
    if lacks:
        pytest.skip("; ".join(why for _, why in lacks))


@pytest.fixture(scope="session")
def shared():
    """The folder `../shared`, or $LACMESH_SHARED: `shared / "reference"` is there."""
    if skips.absence("shared"):
        pytest.skip(skips.absence("shared"))
    return skips.shared_folder()
