"""Fixtures that tests of several formats have in common."""

import pytest


@pytest.fixture
def gmsh():
    """Yield gmsh without a model, with the options that it starts with."""
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield gmsh
    gmsh.finalize()
