"""Nodes whose displacement several records prescribe: taken where they agree, refused with both lines where not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacsolver.case import Case, CaseError, Coupling, Displacement, Material, Rigid, Steps, parse_case, read_case
from tests.checks.blocks import block, join, skin

E = 1000.0
FINITE = {"kinematics": "finite", "material": Material(young=E, poisson=0.0, law="saint_venant_kirchhoff")}


def quarter():
    """A cube with planes of symmetry x0 and y0, held at z0; its lid z1."""
    made = block((2, 2, 2), (0, 0, 0), (1, 1, 1))

    def side(axis, at):
        return skin(*made, lambda x: abs(x[..., axis] - at) < 1e-9)

    return join([(*made, {"z0": side(2, 0), "z1": side(2, 1), "x0": side(0, 0), "y0": side(1, 0)})])


SYMMETRIC = (
    Displacement(group="z0", uz=0.0),
    Displacement(group="x0", ux=0.0),
    Displacement(group="y0", uy=0.0),
)


def lidded(*more, **keys):
    given = {"model": "3d", "material": Material(young=E, poisson=0.0), "displacement": [*SYMMETRIC, *more]}
    return Case(**(given | keys))


HELD = {"ux": 0.0, "uy": 0.0, "uz": 0.01, "rotation": (0, 0, 0)}


@pytest.mark.parametrize(
    "keys",
    [
        {"coupling": Coupling(group="z1", kind="rigid", **HELD)},
        {"rigid": Rigid(group="z1", uz=0.01)},
        {"coupling": Coupling(group="z1", kind="rigid", ux=0.0, uz=0.01)},
        {"coupling": Coupling(group="z1", kind="rigid", fz=10.0)},
        {"coupling": Coupling(group="z1", kind="rigid", **HELD), **FINITE},
    ],
)
def test_a_lid_on_planes_of_symmetry(keys):
    """A column of nu = 0 under a rigid lid, whose nodes on the planes have a component twice: u = F / E."""
    solution = ls.solve(lidded(**keys), quarter())
    np.testing.assert_allclose(solution.u[:, 2], 0.01 * solution.mesh.points[:, 2], atol=1e-12)
    np.testing.assert_allclose(solution.u[:, :2], 0.0, atol=1e-12)
    force = 10.0 if "kinematics" not in keys else E * (1.01**2 - 1) / 2 * 1.01
    reactions = solution.figures.reactions
    assert reactions["z1"][2] == pytest.approx(force, rel=1e-9)
    assert reactions["z0"][2] == pytest.approx(-force, rel=1e-9)


def test_reactions_of_a_plane_on_a_rigid_lid():
    """The lid is pushed along x: the plane x0 and the lid's own nodes on it take all of it, and so reactions add up."""
    solution = ls.solve(
        lidded(coupling=Coupling(group="z1", kind="rigid", at=(0.5, 0.5, 1.5), fx=7.0, fz=10.0)), quarter()
    )
    reactions, lid = solution.figures.reactions, solution.figures.couplings["z1"]
    np.testing.assert_allclose(lid.force, [7, 0, 10], atol=1e-9)
    np.testing.assert_allclose(lid.moment, 0, atol=1e-9)
    total = sum(reactions[name] for name in ("z0", "x0", "y0"))
    np.testing.assert_allclose(total, [-7, 0, -10], atol=1e-9)
    on_plane = solution.mesh.nodes_on(solution.mesh.cells_of("x0"))
    np.testing.assert_allclose(solution.u[on_plane, 0], 0.0, atol=1e-12)


def test_a_lid_that_turns_freely_by_finite_rotations_is_refused():
    with pytest.raises(CaseError, match="turns freely by finite rotations; prescribe its rotation"):
        ls.solve(lidded(coupling=Coupling(group="z1", kind="rigid", uz=0.01), **FINITE), quarter())


def test_a_lid_on_a_plane_of_symmetry_that_tilts():
    """It turns freely about x by finite rotations: nodes on the plane x = 0 hold it along x, as its own ux = 0 does."""
    mesh = quarter()
    below = np.flatnonzero((mesh.points[:, 0] < 1e-9) & (mesh.points[:, 2] < 1 - 1e-9))
    mesh = replace(mesh, node_groups={"below": below})
    keys = {"ux": 0.0, "rotation": ("free", 0, 0), "moment": (25.0, 0, 0)}
    lid, foot = Coupling(group="z1", kind="rigid", **keys), Displacement(group="z0", ux=0.0, uy=0.0, uz=0.0)
    steps = Steps(count=2)
    one, other = (
        ls.solve(lidded(coupling=lid, steps=steps, **FINITE | {"displacement": [foot, plane]}), mesh)
        for plane in (Displacement(group="x0", ux=0.0), Displacement(group="below", ux=0.0))
    )
    assert one.figures.couplings["z1"].rotation[0] > 0.2
    np.testing.assert_allclose(one.u, other.u, atol=1e-9)


def test_both_lines_of_a_contradiction(tmp_path):
    lacmesh.write(tmp_path / "cube.msh", quarter())
    text = 'mesh = "cube.msh"\nmodel = "3d"\n[[material]]\nyoung = 1.0\npoisson = 0.0\n'
    text += '[[displacement]]\ngroup = "z0"\nuz = 0.0\n[[displacement]]\ngroup = "x0"\nux = 0.0\n'
    text += '[[rigid]]\ngroup = "z1"\nux = 0.1\nuz = 0.1\n'
    (tmp_path / "case.toml").write_text(text)
    with pytest.raises(CaseError) as error:
        ls.solve(read_case(tmp_path / "case.toml"))
    assert "displacement 'x0' (" in str(error.value) and "line 9) at node" in str(error.value)
    assert "line 12) contradicts what its terms are prescribed to: it is off by" in str(error.value)


def test_a_component_that_two_records_prescribe_alike():
    """Equal values are taken, in other axes too; another value is a mistake, and the message has both lines."""
    turned = {"x": [0.0, 1.0, 0.0], "xy": [-1.0, 0.0, 0.0]}
    again = [Displacement(group="x0", ux=0.0), Displacement(group="x0", uy=0.0, axes=turned)]
    solution = ls.solve(lidded(*again, Displacement(group="z1", uz=0.01)), quarter())
    assert solution.figures.reactions["z1"][2] == pytest.approx(10.0, rel=1e-9)
    text = 'mesh = "a.msh"\nmodel = "3d"\n[[material]]\nyoung = 1.0\npoisson = 0.0\n'
    twice = text + '[[displacement]]\ngroup = "g"\nux = 0.1\n[[displacement]]\ngroup = "g"\nux = {}\n'
    assert len(parse_case(twice.format("0.1")).displacement) == 2
    with pytest.raises(CaseError, match=r"line 11: displacement.ux is prescribed at 'g' by .*line 6 too, otherwise"):
        parse_case(twice.format("0.2"))
