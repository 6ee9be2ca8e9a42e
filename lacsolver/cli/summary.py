"""What a run prints at its end."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lacmesh.cli.terminal import print_table
from lacsolver.results.motion import ENERGIES, STORED

if TYPE_CHECKING:
    from lacmesh.mesh import Floats
    from lacsolver.problem.adjust import Adjustment
    from lacsolver.problem.resultants import Resultant
    from lacsolver.results.results import Results, StepFigures, ZoneFigures

#: rigid-body modes without support that are listed
_MODES = 3


def print_summary(results: Results, folder: Path, fields: str, *, axisymmetric: bool = False) -> None:
    """Print the summary of a finished run; `fields`: the format of its fields; `axisymmetric`: the model is that."""
    print_table(("run", ""), _rows(results, axisymmetric))
    opened = "results.med for Salome" if fields == "med" else "solid.pvd for ParaView"
    print(f"results: {folder} (results.json, history.csv, {opened})")


def _rows(results: Results, axisymmetric: bool) -> Iterator[tuple[str, ...]]:
    """Yield the rows of the summary of a run."""
    yield from _figures(results)
    last = results.steps[-1] if results.steps else None
    for zone, figures in last.contact.items() if last else ():
        yield ()
        yield "contact", zone
        slave, master, why = results.roles.get(zone, ("", "", ""))
        if why:
            yield "slave chosen", f"{slave}, with master {master}: {why}"
        if zone in results.adjusted:
            yield "slave nodes adjusted", adjusted_in_words(results.adjusted[zone])
        yield from _zone(figures, axisymmetric)
        if results.overlap.get(zone, 0.0) > 0:
            yield "deepest overlap at the start", f"{results.overlap[zone]:.6g}"
        if zone in results.bridged:
            yield "widest gap that the tie bridges", f"{results.bridged[zone]:.6g}"
    if last:
        yield from _joints(last)
        yield from resultants(results.loads, last.time, axisymmetric=axisymmetric)


def resultants(loads: Sequence[Resultant], t: float, *, axisymmetric: bool = False) -> Iterator[tuple[str, ...]]:
    """Yield rows of the resultants of loads at time t, after a line."""
    if loads:
        yield ()
    for load in loads:
        force = _force(np.array(load.force), axisymmetric)
        yield f"resultant, t = {t:g}", f"{load.section} {load.where}: {force}"


def adjusted_in_words(moved: Adjustment) -> str:
    """Describe how far slave nodes were moved onto the master."""
    if not moved.count:
        return "none: all within the distance are on the master"
    return f"{moved.count:,}, by {moved.largest:.4g} at most, {moved.mean:.4g} in the mean"


def _figures(results: Results) -> Iterator[tuple[str, str]]:
    steps = results.steps
    halvings, iterations = (sum(getattr(step, name) for step in steps) for name in ("halvings", "iterations"))
    yield "steps", f"{len(steps):,}" + (f", {halvings:,} cutbacks" if halvings else "")
    yield "iterations", f"{iterations:,}"
    if steps:
        force, moment = np.max([step.balance for step in steps], axis=0)
        yield "contact imbalance", f"force {force:.1e}, moment {moment:.1e} (relative, largest over the steps)"
        yield "strain energy", f"{steps[-1].energy:.6g}"
        if steps[-1].motion is not None:
            yield from _energies(steps)
        if steps[-1].work is not None:
            yield "work", ", ".join(f"{name} {value:.6g}" for name, value in steps[-1].work._asdict().items())
        yield "largest displacement", f"{steps[-1].displacement:.6g}"
    for motion in results.held[:_MODES]:
        yield "rigid-body mode without support", motion
    if len(results.held) > _MODES:
        yield "", f"and {len(results.held) - _MODES} more, which `lacsolver validate` lists"
    if results.sizes:
        yield "sizes", ", ".join(f"{count:,} {name.replace('_', '-')}" for name, count in results.sizes.items())
    phases = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in results.timings.items())
    yield "time", phases or "no step was left"
    yield "peak memory", f"{results.memory / 1e6:.0f} MB"


def _energies(steps: Sequence[StepFigures]) -> Iterator[tuple[str, str]]:
    """Yield the kinetic energy at the end, and what has been taken until then, relative to the largest energy."""
    table = [step.motion.energies for step in steps if step.motion is not None]
    largest = np.nanmax([sum(energies[ENERGIES[k]] for k in STORED) for energies in table]) or 1.0
    yield "kinetic energy", f"{table[-1]['kinetic']:.6g}"
    takers = (("damping", "damped"), ("contact", "contact"), ("friction", "friction"), ("the time scheme", "numerical"))
    rubs = any(zone.friction is not None for zone in steps[-1].contact.values())
    taken = ", ".join(f"{who} {table[-1][name] / largest:.2%}" for who, name in takers if rubs or name != "friction")
    yield "energy taken by", f"{taken} (of the largest)"


def _zone(zone: ZoneFigures, axisymmetric: bool) -> Iterator[tuple[str, str]]:
    yield "macro-elements", f"{zone.active:,} in contact, {zone.open:,} open, {zone.unpaired:,} without a master"
    mean = f", mean {zone.pressure_mean:.6g}" if np.isfinite(zone.pressure_mean) else ""
    yield "pressure", _span(zone.pressure_min, zone.pressure_max) + mean
    yield "mean gaps", _span(zone.gap_min, zone.gap_max)
    yield "coverage", _span(zone.coverage_min, zone.coverage_max)
    yield "contact area", f"{zone.contact_area:.6g}"
    yield "force on the slave", _force(zone.resultant, axisymmetric)
    if not axisymmetric:  # a ring has none
        yield "moment on the slave", _vector(zone.moment)
    if zone.friction is not None:
        rubbing = zone.friction
        states = f"{rubbing.sticking:,} macro-elements stick, {rubbing.sliding:,} slide"
        yield "friction", f"{states}; largest slip of the step {rubbing.slip_max:.6g}"
        yield "friction on the slave", _force(rubbing.friction, axisymmetric)


def _joints(step: StepFigures) -> Iterator[tuple[str, str]]:
    """Yield what bolts, couplings and equations carry at the end of a step."""
    for name, bolt in step.pretension.items():
        yield f"bolt {name}", f"force {bolt.force:.6g}, shortening {bolt.shortening:.6g}"
    for name, point in step.couplings.items():
        yield f"coupling {name}", f"moved by {_vector(point.displacement)}; force {_vector(point.force)}"
        if point.moment.size:
            yield "", f"rotated by {_vector(point.rotation)}; moment {_vector(point.moment)}"
    for name, force in step.equations.items():
        yield f"equation {name}", f"force {force:.6g}"


def _force(force: Floats, axisymmetric: bool) -> str:
    """Format a force; that on a ring is along the axis, and its radial part has no resultant, but an integral."""
    if not axisymmetric:
        return _vector(force)
    radial, axial = _vector(force).split(", ")
    return f"axial {axial}; radial integral {radial}"


def _span(low: float, high: float) -> str:
    return f"{low:.6g} to {high:.6g}"


def _vector(values: Floats) -> str:
    """Format a vector or a number; components that are round-off relative to the largest one are shown as 0."""
    values = np.atleast_1d(values)
    rounding = 1e-12 * float(np.abs(values).max(initial=0.0))
    return ", ".join(f"{v if abs(v) > rounding else 0.0:.6g}" for v in values)
