"""Verdict's measures are those that pyvista computes, whatever the size of a cell; ranges, relative sizes, angles."""

import numpy as np
import pytest

from lacmesh.quality import measure_cells
from lacmesh.quality.measures import ACCEPTED, RELATIVE, TYPES
from tests.quality_cells import IDEAL, LINEAR, distorted

pytestmark = pytest.mark.vtk


def verdict(name, x, measures):
    """{measure: (k,)} of cells x (k, n, 3), as pyvista has them."""
    import pyvista

    cells = {pyvista.CellType[TYPES[name]]: np.arange(x.shape[0] * x.shape[1]).reshape(x.shape[:2])}
    found = pyvista.UnstructuredGrid(cells, x.reshape(-1, 3)).cell_quality(list(measures)).cell_data
    return {m: np.array(found[m]) for m in measures}


def ours(name, x, measures=None):
    k, n = x.shape[:2]
    return measure_cells(name, x.reshape(-1, 3), np.arange(k * n).reshape(k, n), measures or ACCEPTED[name])


@pytest.mark.parametrize("name", LINEAR)
def test_measures_of_cells_of_any_size_are_verdicts(name):
    x = distorted(name)
    mine, theirs = ours(name, x), verdict(name, x, ACCEPTED[name])
    for measure, values in mine.items():
        np.testing.assert_allclose(values, theirs[measure], rtol=1e-9, atol=1e-12, err_msg=measure)


@pytest.mark.parametrize("name", ["TRIA3", "TETRA4", "PENTA6"])
def test_the_scaled_jacobian_of_valid_simplices_and_prisms_is_the_corner_jacobian(name):
    x = distorted(name)
    verdicts, corner = (np.maximum(v, 0) for v in ours(name, x, ["scaled_jacobian", "corner_jacobian"]).values())
    np.testing.assert_allclose(verdicts, corner, atol=1e-12)


@pytest.mark.parametrize("name", ["TETRA4", "HEXA8"])
def test_sizes_in_a_mesh_that_is_mostly_inside_out(name):
    """The mean size is negative, and no cell is as good as the others for being like them."""
    x = np.array(IDEAL[name]) * np.array([[1, 1, -3], [1, 1, -2], [1, 1, -1], [1, 2, 1.0]])[:, None]
    relative = sorted(set(RELATIVE) & set(ACCEPTED[name]))
    mine, theirs = ours(name, x, relative), verdict(name, x, relative)
    for measure in relative:
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
