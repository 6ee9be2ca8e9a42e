"""Large sliding: meshes, the exact answer of a block on a plate, and how Newton's method and swings are measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lacmesh.reference.quadrature import measure
from verification.families.sliding import (
    FAMILY,
    MESHES,
    Slider,
    alternation,
    dragged,
    last_pairs,
    newton,
    profiles,
    quadratic,
    slid,
    slide,
    variation,
)
from verification.meshes.sliding import IRONED, slider


def case(name):
    return next(case for case in FAMILY.cases if case.name == name)


def skin(mesh, name):
    return np.concatenate([mesh.points[nodes] for _, _, nodes in mesh.select(mesh.cell_groups[name])])


# ---- meshes

SIZES = {
    "ring": (30, 250 * 50 + np.pi * (100**2 - 90**2) / 2, 0.01),
    "ironing_2d": (32, IRONED[0] * IRONED[1] + np.pi * 1.5**2 / 2, 0.01),
    "ironing_3d": (24, 6 * 1.5 * 1.5 + np.pi * 0.9 / 2 * (1 - 2 * 0.06 / 3 + 0.06**2 / 5), 0.02),
}


@pytest.mark.parametrize("name", MESHES)
def test_bodies_are_whole_and_do_not_match(name):
    size, whole, within = SIZES[name]
    mesh = MESHES[name](size)
    body = np.flatnonzero(mesh.cell_dim == mesh.space_dim)
    sizes = np.concatenate([measure(t, mesh.points[nodes]).ravel() for t, _, nodes in mesh.select(body)])
    assert (sizes > 0).all() and sizes.sum() == pytest.approx(whole, rel=within)
    low, high = sorted((skin(mesh, n)[..., mesh.space_dim - 1].mean(), n) for n in ("slave", "master"))
    assert low[0] < high[0]
    # below its die, the block's nodes are not where the die's are
    above, below = (np.unique(skin(mesh, n)[..., 0].round(6)) for n in (high[1], low[1]))
    assert not set(above) <= set(below) and not set(below) <= set(above)


def test_a_plate_is_longer_than_its_slider_and_turns_up():
    mesh = slider("HEXA8", 2, 17, wave=0.02)
    plate = skin(mesh, "plate")
    assert plate[..., 0].min() == -0.5 and plate[..., 0].max() == 3.5
    assert plate[..., 2].max() <= 0.0 and plate[..., 2].min() == pytest.approx(-0.04, abs=2e-3)
    assert (np.cross(plate[:, 1] - plate[:, 0], plate[:, 2] - plate[:, 0])[:, 2] > 0).all()


# ---- the block on the plate


@pytest.mark.parametrize(
    "name",
    ["block_QUAD4_facet", "block_QUAD8_smoothed", "block_HEXA8_smoothed", "waves_QUAD4_smoothed", "waves_HEXA8_facet"],
)
def test_a_block_keeps_its_pressure_on_a_plate_and_newton_is_quadratic_over_waves(name):
    given = replace(case(name).solve.args[0], steps=3, way=0.8)
    outcome = slide(given, name, levels=1)
    assert len(outcome.results) >= 6 and all(result.passed for result in outcome.results), outcome.results


def test_another_pressure_is_found_out(monkeypatch):
    given = Slider("QUAD4", "facet", steps=2, way=0.5)
    monkeypatch.setattr("verification.families.sliding.slid", lambda own, n: slid(replace(own, pressure=50.1), n))
    missed = [result.quantity for result in slide(given, "", levels=1).results if not result.passed]
    assert len(missed) == 2 and all("worst of all steps" in name for name in missed)


# ---- what is dragged


def test_a_ring_meets_its_block():
    """Five of twenty steps: nothing until 20 mm of way, then two faces beside the middle share the force."""
    given = case("ring").solve.args[0]
    down = (("ux", ((0.0, 0.0), (1.0, 0.0))), ("uy", ((0.0, 0.0), (0.25, -22.5))))
    own = dragged(replace(given, path=down, end=0.25), 30, 5)
    pressed = [float(state.zones[0].pressure.max()) for state in own.states]
    assert pressed[:4] == [0.0] * 4 and pressed[4] > 0
    (line,) = {line.label: line for line in profiles("", own.states).lines}.values()
    x, p = np.array(line.x), np.array(line.y)
    assert (np.abs(x[p > 0]) < 10).all() and np.ptp(p[p > 0]) < 1e-6 * p.max()


# ---- how it is measured


def test_swings():
    smooth = np.sqrt(np.maximum(1 - np.linspace(-1.2, 1.2, 25) ** 2, 0))
    assert alternation(smooth) == 0 and variation(smooth) == pytest.approx(0, abs=1e-12)
    rough = smooth + 0.1 * (-1.0) ** np.arange(25) * (smooth > 0)
    assert 0.05 < alternation(rough) < 0.1 and variation(rough) > 0.5
    two = np.concatenate([smooth, smooth])
    assert alternation(two) == 0 and variation(two) == pytest.approx(1)


def test_newton_is_judged_by_its_last_iterations():
    class State:
        halvings = 0

        def __init__(self, *residuals, settled=None):
            self.residuals = residuals
            self.n_unchanged_sets = len(residuals) if settled is None else settled

    good, slow = State(1.0, 1e-3, 2e-6, 3e-11), State(1.0, 1e-3, 2e-4, 5e-5, 1e-5, 1e-11)
    assert last_pairs(good.residuals, 1e-10) == [(1e-3, 2e-6), (2e-6, 3e-11)]
    assert quadratic(last_pairs(good.residuals, 1e-10), 1e-10) and not quadratic([(5e-5, 1e-5)], 1e-10)
    halved, told, share, *_ = newton([good, slow], 1e-10)
    assert halved.passed and told.value == 2 and share.value == 0.5 and not share.passed
    assert newton([good], 1e-10)[2].passed


def test_newton_is_not_judged_while_the_set_changes():
    class State:
        halvings, residuals = 0, (1e-3, 5e-4, 1e-13)

        def __init__(self, settled):
            self.n_unchanged_sets = settled

    assert not newton([State(3)], 1e-10)[2].passed and newton([State(2)], 1e-10)[2].passed
    assert len(newton([State(1)], 1e-10)) == 1
