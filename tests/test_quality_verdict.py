"""Our numbers are Verdict's: every measure of every linear type, on cells of all kinds, as pyvista computes them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from lacmesh.quality import measure_cells
from lacmesh.quality.measures import ACCEPTED, RELATIVE, TYPES
from tests.quality_cells import IDEAL, LINEAR, degenerate, distorted, near_ideal
from tests.samples import each_option

pytestmark = pytest.mark.vtk

UNDEFINED = -12345.0
#: beyond this both are infinite: round-off in one of them decides by how much
HUGE = 1e10


def grid(name, x):
    import pyvista

    k, n = x.shape[:2]
    return pyvista.UnstructuredGrid({pyvista.CellType[TYPES[name]]: np.arange(k * n).reshape(k, n)}, x.reshape(-1, 3))


def verdict(name, x, measure="all"):
    """{measure: (k,)} as pyvista has them, those that are defined for the type."""
    found = grid(name, x).cell_quality(measure, null_value=UNDEFINED).cell_data
    found = {m: np.array(found[m]) for m in found.keys()}  # noqa: SIM118
    return {m: v for m, v in found.items() if not (v == UNDEFINED).all()}


def ours(name, x, measures=None):
    k, n = x.shape[:2]
    return measure_cells(name, x.reshape(-1, 3), np.arange(k * n).reshape(k, n), measures or ACCEPTED[name])


def differences(mine, theirs):
    """(k,): relative; 0 where both are undefined, or both huge."""
    with np.errstate(invalid="ignore"):
        error = np.abs(mine - theirs) / np.maximum(np.abs(theirs), 1e-3)
    error[np.isnan(mine) & np.isnan(theirs)] = 0
    error[(np.abs(mine) > HUGE) & (np.abs(theirs) > HUGE)] = 0
    return np.where(np.isnan(error), np.inf, error)


def nothing_over_nothing(measure, x, mine, theirs):
    """(k,): a prism or hexahedron without volume: 0 / 0, but for round-off of one of them."""
    if measure not in ("distortion", "dimension") or x.shape[1] not in (6, 8):
        return np.zeros(len(x), bool)
    volume = ours("PENTA6" if x.shape[1] == 6 else "HEXA8", x, ["volume"])["volume"]
    return np.abs(volume) < 1e-12


def a_corner_across_the_face(measure, x, mine, theirs):
    """(k,): a quadrangle with a corner at right angles to the face: which side it is on is round-off."""
    if measure != "distortion" or x.shape[1] != 4:
        return np.zeros(len(x), bool)
    L = np.roll(x, -1, axis=1) - x
    normals = np.cross(np.roll(L, 1, axis=1), L)
    face = np.cross(L[:, 0] - L[:, 2], L[:, 1] - L[:, 3])
    lengths = np.linalg.norm(normals, axis=2) * np.linalg.norm(face, axis=1)[:, None]
    return (np.abs(np.einsum("kcs,ks->kc", normals, face)) <= 1e-12 * lengths).any(axis=1)


#: where Verdict's own number is decided by round-off
ROUNDED = (nothing_over_nothing, a_corner_across_the_face)


@pytest.mark.rows(
    "TRIA3-distorted-0",
    "QUAD4-degenerate-0",
    "TETRA4-distorted-2",
    "HEXA8-degenerate-2",
    "PENTA6-degenerate-1",
    "PYRAM5-degenerate-0",
)
@pytest.mark.parametrize(
    ("name", "cells", "seed"),
    each_option(
        itertools.product(LINEAR, (distorted, degenerate, near_ideal), range(4)), of=lambda row: [row[:2], row[2]]
    ),
)
def test_every_measure_equals_verdicts(name, cells, seed):
    x = cells(name, seed=seed)
    mine, theirs = ours(name, x), verdict(name, x)
    assert set(mine) == set(theirs)  # those that Verdict defines
    for measure, values in mine.items():
        differ = differences(values, theirs[measure]) > 1e-10
        rounded = differ & np.any([rule(measure, x, values, theirs[measure]) for rule in ROUNDED], axis=0)
        wrong = np.flatnonzero(differ & ~rounded)
        assert not len(wrong), (measure, [(x[k].tolist(), values[k], theirs[measure][k]) for k in wrong[:3]])
        assert rounded.mean() <= (0.025 if cells is degenerate else 0), f"{measure}: {rounded.sum()} are passed over"


@pytest.mark.parametrize("name", ["TETRA4", "HEXA8"])
def test_sizes_in_a_mesh_that_is_mostly_inside_out(name):
    """The mean size is negative, and no cell is as good as the others for being like them."""
    x = np.array(IDEAL[name]) * np.array([[1, 1, -3], [1, 1, -2], [1, 1, -1], [1, 2, 1.0]])[:, None]
    mine, theirs = ours(name, x), verdict(name, x)
    for measure in set(RELATIVE) & set(mine):
        assert not (mine[measure] > 0).any()
        np.testing.assert_allclose(mine[measure], theirs[measure], rtol=1e-10, err_msg=measure)


@pytest.mark.parametrize("name", LINEAR)
def test_ideal_cells_have_the_values_that_pyvista_gives(name):
    import pyvista

    x = np.array([IDEAL[name]])
    mine = ours(name, x)
    for measure, limits in ACCEPTED[name].items():
        try:
            info = pyvista.cell_quality_info(pyvista.CellType[TYPES[name]], measure)
        except ValueError:
            assert limits is None or measure in ("relative_size_squared",)
            continue
        assert mine[measure][0] == pytest.approx(info.unit_cell_value, abs=1e-12), measure
        assert limits == pytest.approx(info.acceptable_range), measure


def test_min_dihedral_is_the_angle_that_verdict_means():
    """Verdict's least angle of a tetrahedron depends on how its nodes are listed, by its own error; ours does not.

    Over the ways to list them that keep the orientation, ours is the least that Verdict finds.
    """
    x = distorted("TETRA4", k=50)[:100]
    turned = [[0, 1, 2, 3], [1, 2, 0, 3], [2, 0, 1, 3], [1, 0, 3, 2], [3, 1, 0, 2], [0, 2, 3, 1]]
    theirs = np.array([verdict("TETRA4", x[:, order], ["min_angle"])["min_angle"] for order in turned])
    mine = [ours("TETRA4", x[:, order], ["min_dihedral"])["min_dihedral"] for order in turned]
    np.testing.assert_allclose(mine, [mine[0]] * len(turned), rtol=1e-9)
    assert np.ptp(theirs, axis=0).max() > 1
    assert (theirs.min(axis=0) <= mine[0] + 1e-6).all()
