"""Values at places and times, and the records as Python makes them."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lacsolver.case import (
    Case,
    CaseError,
    Contact,
    Displacement,
    EvaluationError,
    Gravity,
    Material,
    Pressure,
    Rigid,
    Steps,
    Temperature,
    Traction,
    Value,
    parse_case,
)

POINTS = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [0.5, -1.0, 2.0]])
STEEL = Material(young=1.0, poisson=0.3)


def case(**sections):
    return Case(mesh="a.msh", model="3d", material=[STEEL], **sections)


@pytest.mark.parametrize(
    ("given_", "t", "values", "place", "time"),
    [
        (2.5, 0.5, [2.5, 2.5, 2.5], False, False),
        (np.float64(2.5), 0.5, [2.5, 2.5, 2.5], False, False),
        (np.array(3), 0.5, [3.0, 3.0, 3.0], False, False),
        ("x + 2 * z", 0.5, [0.0, 7.0, 4.5], True, False),
        ("z", 0.5, [0.0, 3.0, 2.0], True, False),
        ("y", 0.5, [0.0, 2.0, -1.0], True, False),
        ("3 * t", 0.5, [1.5, 1.5, 1.5], False, True),
        ("x * t", 0.5, [0.0, 0.5, 0.25], True, True),
        ("2", 0.5, [2.0, 2.0, 2.0], False, False),
        ([[0, 0], [1, 4]], 0.25, [1.0, 1.0, 1.0], False, True),
        (np.array([[0, 1], [2, 1]]), 1.0, [1.0, 1.0, 1.0], False, False),
        (lambda x, t: x[:, 1] * t, 0.5, [0.0, 1.0, -0.5], True, True),
        (lambda x, t: 4 * t, 0.5, [2.0, 2.0, 2.0], True, True),
    ],
)
def test_value_at_points(given_, t, values, place, time):
    value = Value.of(given_)
    got = value(POINTS, t)
    assert got.shape == (3,) and got.dtype == float and got.flags.writeable
    np.testing.assert_allclose(got, values, rtol=1e-15)
    assert (value.depends_on_place, value.depends_on_time) == (place, time)


def test_in_a_plane_z_is_0_and_functions_see_two_coordinates():
    assert Value.of("x + z")(POINTS[:, :2], 0.0).tolist() == [0.0, 1.0, 0.5]
    assert Value.of(lambda x, t: np.full(len(x), x.shape[1]))(POINTS[:, :2], 0.0).tolist() == [2.0, 2.0, 2.0]


def test_no_points():
    for source in (1.0, "x", [[0, 1], [1, 2]], lambda x, t: x[:, 0]):
        assert Value.of(source)(np.empty((0, 3)), 0.5).shape == (0,)


TABLES = st.lists(st.tuples(st.floats(-5, 5), st.floats(-9, 9)), min_size=1, max_size=6, unique_by=lambda row: row[0])


@given(TABLES, st.floats(-7, 7))
def test_a_table_is_linear_in_between_and_held_at_its_ends(rows, t):
    rows = sorted(rows)
    expected = np.interp(t, [r[0] for r in rows], [r[1] for r in rows])
    assert Value.of(rows).at(t) == pytest.approx(
        expected, rel=1e-6, abs=1e-6
    )  # numpy's slopes overflow less gracefully


def test_a_table_meets_its_rows():
    value = Value.of([[0, 1], [0.1, 5], [0.3, -2]])
    assert [value.at(t) for t in (0, 0.1, 0.3)] == [1.0, 5.0, -2.0]


def test_numbers_under_a_load_are_ramped_and_nothing_else_is():
    made = case(
        steps=Steps(times=[1.0, 4.0]),
        pressure=[Pressure(group="a", value=8.0), Pressure(group="a", value="8"), Pressure(group="a", value=[[0, 8]])],
        displacement=[Displacement(group="b", ux=8.0)],
        contact=[Contact(slave="s", master="m", clearance=8.0)],
        rigid=[Rigid(group="r", rotation=[0.0, 0.0, 8.0])],
    )
    at = [p.value(POINTS[:1], 1.0)[0] for p in made.pressure]
    assert at == [2.0, 8.0, 8.0]
    assert made.displacement[0].ux(POINTS[:1], 4.0) == [8.0] and made.displacement[0].ux(POINTS[:1], 0.0) == [0.0]
    assert made.displacement[0].ux.depends_on_time and not Value(0.0, ramp_end=4.0).depends_on_time
    assert made.contact[0].clearance(POINTS[:1], 1.0) == [8.0]
    assert [v.at(2.0) for v in made.rigid[0].rotation] == [0.0, 0.0, 4.0]
    longer = replace(made, steps=Steps(end=8.0))
    assert longer.pressure[0].value(POINTS[:1], 1.0) == [1.0]
    assert made.pressure[0].value(POINTS[:1], 5.0) == [8.0]  # held after the end


def test_a_temperature_is_ramped_from_the_reference():
    made = Case(
        mesh="a.msh",
        model="3d",
        material=[Material(young=1.0, poisson=0.3, expansion=1e-5, reference_temperature=20.0)],
        temperature=[Temperature(value=120.0)],
    )
    value = made.temperature[0].value
    start = np.array([20.0, 20.0, 0.0])
    assert value(POINTS, 0.0, start=20.0).tolist() == [20.0, 20.0, 20.0]
    assert value(POINTS, 0.25, start=start).tolist() == [45.0, 45.0, 30.0]
    assert value(POINTS, 1.0, start=start).tolist() == [120.0, 120.0, 120.0]


def test_a_traction_s_function_sees_the_normals():
    normals = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    made = case(traction=[Traction(group="a", tx=lambda x, n, t: t * n[:, 0], ty="x", tz=2.0)])
    assert made.traction[0].tx(POINTS, 2.0, normals=normals).tolist() == [0.0, 2.0, 0.0]
    assert made.traction[0].ty(POINTS, 2.0, normals=normals).tolist() == [0.0, 1.0, 0.5]
    with pytest.raises(ValueError, match=r"traction.tx is a function of the normal"):
        made.traction[0].tx(POINTS, 2.0)


def test_a_function_of_a_rigid_body_has_no_place():
    made = case(rigid=[Rigid(group="a", ux=lambda x, t: 3 * t)])
    assert not made.rigid[0].ux.depends_on_place and made.rigid[0].ux.at(2.0) == 6.0
    with pytest.raises(ValueError, match="depends on the place"):
        Value.of("x").at(1.0)


# ---- not finite

LOADS = """mesh = "a.msh"
model = "3d"
material = [{young = 1, poisson = 0}]
[[pressure]]
group = "a"
value = "1 / (x - t)"
[[rigid]]
group = "b"
rotation = [
  0,
  "log(t - 1)",
  0]
"""


def test_a_formula_that_is_not_finite_names_formula_place_and_time():
    made = parse_case(LOADS, "dir/press.toml")
    with pytest.raises(EvaluationError) as error:
        made.pressure[0].value(POINTS, 0.5)
    said = "dir/press.toml, line 6: pressure.value = '1 / (x - t)' is inf at (0.5, -1, 2), t = 0.5"
    assert str(error.value).startswith(said) and error.value.status == 1
    with pytest.raises(EvaluationError, match=r"\(and 1 more places\), t = 0"):
        made.pressure[0].value(POINTS[[0, 0]], 0.0)
    with pytest.raises(EvaluationError, match=r"line 9: rigid.rotation = 'log\(t - 1\)' is nan"):
        made.rigid[0].rotation[1].at(0.5)


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda x, t: x[:2, 0], r"pressure.value gives \(2,\) for 3 points"),
        (lambda x, t: x, r"pressure.value gives \(3, 3\) for 3 points"),
        (lambda x, t: np.where(x[:, 0] > 0, np.nan, 0), r"pressure.value is nan at \(1, 2, 3\) \(and 1 more places\)"),
    ],
)
def test_a_function_that_gives_something_else(function, said):
    made = case(pressure=[Pressure(group="a", value=function)])
    with pytest.raises(EvaluationError, match=said):
        made.pressure[0].value(POINTS, 0.5)


def test_values_that_are_none():
    for wrong in (True, None, object(), {}, [], [1, 2], "x +", [[0, 0], [0, 1]], [[0, 10**400]], 10**400, float("nan")):
        with pytest.raises(ValueError, match="the value "):
            Value.of(wrong)


# ---- records from Python


def test_records_are_checked_as_files_are():
    with pytest.raises(CaseError, match=r"^pressure.follower is 3; it takes true or false"):
        Pressure(group="a", value=1.0, follower=3)
    with pytest.raises(CaseError, match=r"^material.poisson is 0.5; it must be > -1"):
        Case(mesh="a", model="3d", material=[Material(young=1, poisson=0.5)])
    with pytest.raises(CaseError, match=r"^gravity.gz is of the models 3d, and the model is plane_strain"):
        Case(
            mesh="a",
            model="plane_strain",
            material=[Material(young=1, poisson=0, density=1)],
            gravity=Gravity(gz=1.0),
        )
    with pytest.raises(CaseError) as error:
        case(
            contact=[Contact(slave="a", master="a")],
            displacement=[Displacement(group="a", ux=0), Displacement(group="a", ux=1)],
        )
    assert len(error.value.problems) == 2 and error.value.path is None
    with pytest.raises(TypeError):
        Pressure(group="a")
    with pytest.raises(TypeError, match=r"pressure is a list of Pressure records, not"):
        case(pressure=[3])
    with pytest.raises(TypeError, match=r"steps is a Steps record"):
        case(steps={"end": 2})


def test_arrays_of_numpy_are_vectors():
    wood = Material(
        law="orthotropic", young=(1, 1, 1), poisson=(0, 0, 0), shear=(1, 1, 1), axes=np.array([[0.0, 1, 0], [1, 0, 0]])
    )
    assert wood.axes == ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    assert Displacement(at=np.zeros(3), ux=np.array([[0, 0], [1, 2]])).at == (0.0, 0.0, 0.0)
    assert Steps(times=np.linspace(0.5, 2, 4)).planned == (0.5, 1.0, 1.5, 2.0)


def test_one_record_stands_for_a_list_of_one():
    assert case(pressure=Pressure(group="a", value=1.0)).pressure[0].group == "a"


def test_records_are_frozen_and_equal_by_what_they_say():
    one, other = (case(pressure=[Pressure(group="a", value="x")]) for _ in range(2))
    assert one == other
    assert one != case(pressure=[Pressure(group="a", value="y")])
    with pytest.raises(FrozenInstanceError):
        one.model = "axisymmetric"
    read = parse_case(
        'mesh = "a.msh"\nmodel = "3d"\n'
        'material = [{young = 1.0, poisson = 0.3}]\npressure = [{group = "a", value = "x"}]\n'
    )
    assert read == one


def test_a_record_is_shown_as_it_could_be_given():
    body = Rigid(group="a", ux="sin(t)", rotation=[0, "0.1 * t", [[0, 0], [1, 0.5]]])
    assert repr(body) == "Rigid(group='a', ux='sin(t)', rotation=(0.0, '0.1 * t', ((0.0, 0.0), (1.0, 0.5))))"
    assert eval(repr(body)) == body
