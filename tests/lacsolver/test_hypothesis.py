"""Pairs whose pressures nothing determines are refused, slaves stiffer and finer than their master are warned of."""

from __future__ import annotations

import re
import warnings
from functools import cache

import numpy as np
import pytest

import lacmesh
from lacsolver.case import CaseError, parse_case, read_case
from lacsolver.equilibrium.stepping import march
from lacsolver.output import create_output
from lacsolver.problem.problem import Problem
from lacsolver.results.alternation import alternating, roughness
from lacsolver.running import run
from lacsolver.validation import validate
from verification.meshes.stacks import stack

ROLLER = '[[displacement]]\ngroup = "{}"\n{} = 0.0\n'
PRESSED = '[[displacement]]\ngroup = "upper"\n{}'
RIGID = '[[rigid]]\ngroup = "upper"\n{}'


@cache
def mesh(dim=3, n_slave=4, n_master=2, kind="HEXA8", below="QUAD4"):
    """Two blocks, the slave above; the names of groups of the lower block's sides begin with low_."""
    kinds = (kind, kind) if dim == 3 else ("QUAD4", below)
    made = stack(*kinds, dim, slave_below=False, counts=(n_master, n_slave))
    groups = dict(made.node_groups)
    for axis in "xyz"[: dim - 1]:
        side, low = (np.unique(np.concatenate([nodes.ravel() for _, _, nodes in made.select(made.cells_of(name))]))
                     for name in (f"{axis}0", "lower"))  # fmt: skip
        groups[f"low_{axis}0"] = np.intersect1d(side, low)
    return lacmesh.Mesh.create(
        made.points, made.blocks, cell_groups=made.cell_groups, node_groups=groups, space_dim=dim
    )


def text(dim=3, roles=("slave", "master"), body=RIGID, more="", stiff=1.0, kinematics="small"):
    """A case of two blocks, the upper one pressed down by 0.01."""
    up = "xyz"[dim - 1]
    moved = "".join(f"u{a} = {-0.01 if a == up else 0.0}\n" for a in "xyz"[:dim])
    law = 'law = "neo_hookean"\n' if kinematics == "finite" else ""
    made = f'mesh = "a.msh"\nmodel = "{"3d" if dim == 3 else "plane_strain"}"\nkinematics = "{kinematics}"\n'
    for group, young in (("lower", 1.0), ("upper", stiff)):
        made += f'[[material]]\ngroups = ["{group}"]\n{law}young = {young}\npoisson = 0.3\n'
    made += f'[[contact]]\nname = "c"\nslave = "{roles[0]}"\nmaster = "{roles[1]}"\n{more}'
    made += ROLLER.format("bottom", f"u{up}") + "".join(ROLLER.format(f"low_{a}0", f"u{a}") for a in "xyz"[: dim - 1])
    return made + body.format(moved)


def solved(case, of):
    problem = Problem.of(parse_case(case), of)
    *_, state = march(problem)
    return problem, state


@pytest.mark.parametrize("body, why", [(RIGID, "rigid body 'upper' moves them"), (PRESSED, "displacement is prescr")])
@pytest.mark.parametrize("dim, count, nodes", [(3, 16, 9), (2, 8, 3)])
def test_a_slave_without_displacements_of_its_own_is_refused(body, why, dim, count, nodes):
    of = mesh(dim, 4 if dim == 3 else 8, 2)
    with pytest.raises(CaseError, match=f"{count} of {count} macro-elements of slave 'slave'.*{why}") as told:
        Problem.of(parse_case(text(dim, body=body)), of)
    message = str(told.value)
    assert f"only {nodes} free nodes" in message and "exchange slave and master" in message and "line 1" in message
    (problem,) = validate(parse_case(text(dim, body=body)), of).problems
    assert problem.message == message


@pytest.mark.parametrize("body", [RIGID, PRESSED])
@pytest.mark.parametrize("dim", [2, 3])
def test_what_is_refused_is_exact_with_the_roles_exchanged(body, dim):
    """The rigid body over the elastic one: a uniform pressure of 0.01 E, in plane strain E / (1 - nu^2)."""
    _, state = solved(text(dim, ("master", "slave"), body), mesh(dim, 4 if dim == 3 else 8, 2))
    exact = 0.01 if dim == 3 else 0.01 / (1 - 0.3**2)
    np.testing.assert_allclose(state.zones[0].pressure, exact, rtol=1e-9)


def test_a_rigid_slave_of_few_faces_over_many_nodes_is_right():
    """Four pressures and 25 nodes that determine them."""
    _, state = solved(text(3), mesh(3, 2, 4))
    np.testing.assert_allclose(state.zones[0].pressure, 0.01, rtol=1e-9)


def test_a_tie_is_judged_as_well():
    case = text(3).replace("[[contact]]", "[[tie]]")
    with pytest.raises(CaseError, match="tie: 16 of 16 macro-elements"):
        Problem.of(parse_case(case), mesh(3, 4, 2))


def test_a_soft_contact_needs_no_hypothesis():
    """A contact as soft as the block: half of the displacement is in it."""
    _, state = solved(text(3, more="stiffness = 1.0\n"), mesh(3, 4, 2))
    np.testing.assert_allclose(state.zones[0].pressure, 0.005, rtol=1e-9)


def test_a_rigid_slave_that_meets_its_master_later_is_judged_before():
    of = mesh(3, 4, 2)
    up = np.unique(np.concatenate([nodes.ravel() for _, _, nodes in of.select(of.cells_of("upper"))]))
    points = of.points.copy()
    points[up, 2] += 5.0
    apart = lacmesh.Mesh.create(points, of.blocks, cell_groups=of.cell_groups, node_groups=of.node_groups, space_dim=3)
    with pytest.raises(CaseError, match="16 of 16 macro-elements"):
        Problem.of(parse_case(text(3, kinematics="finite")), apart)


def test_a_slave_fixed_at_its_sides_alone_is_good():
    """A symmetry condition on a side of the slave leaves its internal dofs free."""
    case = text(3, ("slave", "master"), '[[displacement]]\ngroup = "top"\n{}').replace("low_", "")
    _, state = solved(case, mesh(3, 4, 2))
    assert (state.zones[0].pressure > 0).all()


PUNCH = 'surface = "faces"\nclearance = "0.02 * x**2"\n'


def punched(stiff, n_slave, roles=("slave", "master")):
    body = '[[displacement]]\ngroup = "top"\n{}'
    return text(2, roles, body, PUNCH, stiff), mesh(2, n_slave, 13)


@pytest.mark.parametrize("stiff, n_slave, said", [(10.0, 30, True), (1.0, 30, False), (10.0, 13, False)])
def test_a_slave_stiffer_and_finer_than_its_master_is_warned_of(stiff, n_slave, said):
    case, of = punched(stiff, n_slave)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        Problem.of(parse_case(case), of)
    assert [bool(re.search("stiffer than master 'master' and has finer faces", str(one.message))) for one in told] == (
        [True] if said else []
    )


def test_pressures_that_alternate_are_told_with_their_cause(tmp_path):
    """Ten times as stiff, 30 faces over 13: peaks of twice the pressure; with the roles exchanged nothing is told."""
    case, of = punched(10.0, 30)
    with pytest.warns(lacmesh.LacmeshWarning) as told:
        results = run(parse_case(case), create_output(tmp_path / "out"), mesh=of)
    assert any("alternate" in str(one.message) and "exchange slave and master" in str(one.message) for one in told)
    assert "alternate" in results.message
    other = punched(10.0, 30, ("master", "slave"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = run(parse_case(other[0]), create_output(tmp_path / "other"), mesh=other[1])
    peaks = [one.steps[-1].contact["c"].pressure_max for one in (results, again)]
    assert peaks[0] > 1.7 * peaks[1] and again.message == ""


def test_the_roughness_of_a_checkerboard_is_one_and_of_what_falls_evenly_none():
    problem = Problem.of(parse_case(text(2, ("master", "slave"))), mesh(2, 8, 20))
    (joint,) = problem.joints
    n = joint.zone.n_macros
    order = np.argsort(np.argsort([joint.zone.slave.x[joint.zone.slave.faces.nodes[joint.zone.macro == k, :2], 0].mean()
                                   for k in range(n)]))  # fmt: skip
    assert roughness(joint.zone, (order % 2).astype(float)) == 1.0
    assert roughness(joint.zone, 5.0 + order) == pytest.approx(0.0, abs=1e-15)
    assert list(alternating(problem, [*march(problem)][-1])) == []


@pytest.mark.shared
@pytest.mark.parametrize("body", ["slave_rigid", "slave_prescribed"])
def test_a_flat_block_with_a_prescribed_slave_is_refused_and_right_by_the_rule(shared, body):
    """The exact pressure is 1; it was 0.547 to 1.710 with the roles of the file."""
    file = shared / "reference" / "repro" / "prescribed_slave_flat" / f"{body}.toml"
    with pytest.raises(CaseError, match="exchange slave and master"):
        Problem.of(read_case(file))
    assert np.allclose(by_rule(file).pressure, 1.0, rtol=1e-9)


@pytest.mark.shared
def test_a_rigid_cylinder_as_a_slave_is_refused_and_right_by_the_rule(shared):
    """Its largest pressure is about 3.7 on a fine mesh, and 4.1 on this one; it was 36 with the roles of the file."""
    file = shared / "reference" / "repro" / "rigid_slave" / "slave_rigid_punch.toml"
    with pytest.raises(CaseError, match="80 of 80 macro-elements"):
        Problem.of(read_case(file))
    assert 3.7 < by_rule(file).pressure.max() < 4.2


def by_rule(file):
    """The contact of a case with `surfaces` in place of its slave and master."""
    told = re.sub(r'slave="(\w+)"\nmaster="(\w+)"', r'surfaces=["\1", "\2"]', file.read_text())
    *_, state = march(Problem.of(parse_case(told, file)))
    return state.zones[0]
