"""What a run prints at its end."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lacmesh.cli.terminal import print_table
from lacsolver.equilibrium.motion import ENERGIES, STORED
from lacsolver.output.summary import zone_content
from lacsolver.output.words import force_in_words, vector_in_words, zone_rows

if TYPE_CHECKING:
    from lacsolver.problem.resultants import Resultant
    from lacsolver.results.results import Results, StepFigures

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
    for name, zone in last.contact.items() if last else ():
        yield ()
        yield "contact", name
        yield from zone_rows(zone_content(zone, results, name), axisymmetric=axisymmetric)
    if last:
        yield from _joints(last)
        yield from resultants(results.loads, last.time, axisymmetric=axisymmetric)


def resultants(loads: Sequence[Resultant], t: float, *, axisymmetric: bool = False) -> Iterator[tuple[str, ...]]:
    """Yield rows of the resultants of loads at time t, after a line."""
    if loads:
        yield ()
    for load in loads:
        force = force_in_words(np.array(load.force), axisymmetric)
        yield f"resultant, t = {t:g}", f"{load.section} {load.where}: {force}"


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


def _joints(step: StepFigures) -> Iterator[tuple[str, str]]:
    """Yield what bolts, couplings and equations carry at the end of a step."""
    for name, bolt in step.pretension.items():
        yield f"bolt {name}", f"force {bolt.force:.6g}, shortening {bolt.shortening:.6g}"
    for name, point in step.couplings.items():
        moved, force = vector_in_words(point.displacement), vector_in_words(point.force)
        yield f"coupling {name}", f"moved by {moved}; force {force}"
        if point.moment.size:
            yield "", f"rotated by {vector_in_words(point.rotation)}; moment {vector_in_words(point.moment)}"
    for name, size in step.equations.items():
        yield f"equation {name}", f"force {size:.6g}"
