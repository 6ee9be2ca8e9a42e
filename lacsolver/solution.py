"""Solutions of cases in Python: a case and a mesh in, displacements, pressures and stresses out, without a file.

    case, mesh -> problem                                     (problem: slaves that are not cut are cut here)
    for state in the march of the problem: a Solution         (solve.stepping)
    displacement, contact, stress: evaluated when asked for   (results)

What the last problem was made of is kept: with the same mesh, `solve` takes the cut, the paired surfaces and the factor
of the stiffness again as far as the new case leaves them unchanged.
"""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh import __version__
from lacmesh.errors import RequestError
from lacmesh.facts import ByName, Described
from lacmesh.mesh import Mesh, MeshLike
from lacsolver.bodies.points import weights
from lacsolver.case import Case, as_case, fingerprint
from lacsolver.constraints.pretension import SectionForces
from lacsolver.doubts.rules import Doubts
from lacsolver.equilibrium.attempt import Progress
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.state import State
from lacsolver.equilibrium.stepping import NotConvergedError
from lacsolver.equilibrium.stepping import march as march_states
from lacsolver.output import Writer, create_output
from lacsolver.problem.problem import Problem
from lacsolver.problem.skin import mesh_of
from lacsolver.results.fields import point_stress, state_fields
from lacsolver.results.figures import bolt_forces, step_figures, stress_ranges
from lacsolver.results.nodal import von_mises
from lacsolver.results.results import Fields, Restart, Results, StepFigures, ZoneFields
from lacsolver.results.units import NO_UNITS, Units
from lacsolver.watch import Watch

_LOG = logging.getLogger("lacsolver")
#: what the last call of `march` has made, for the next one
_LAST: list[ReducedProblem] = []


class Picture(NamedTuple):
    """A picture in PNG, shown by notebooks. `png`: the bytes of the file."""

    png: bytes

    def _repr_png_(self) -> bytes:
        return self.png

    def __repr__(self) -> str:
        return f"Picture of {len(self.png):,} bytes in PNG; .save(path) writes it"

    def save(self, path: str | Path) -> None:
        """Write the file. Raises OSError."""
        Path(path).write_bytes(self.png)


@dataclass(frozen=True, eq=False, repr=False)
class Solution(Described):
    """A converged state of a case on its mesh, with n nodes and k cells in d dimensions.

    `mesh`: the cut mesh; `time` of the state; `iterations` of its step. `u` (n, d): displacement. `contact`: by the
    name of each contact and tie, `ZoneFields` with `pressure`, `gap`, `status`, `area`, `centre`, `normal`,
    `recovered` and `force`. In the units of the case; `units` has the names that it gives them.

    >>> import lacsolver as ls
    >>> from lacmesh import example
    >>> solution = ls.solve(example("two_blocks.toml"))
    >>> solution.u.shape, solution.contact["joint"].pressure.shape
    ((512, 3), (36,))
    """

    mesh: Mesh
    time: float
    iterations: int
    evaluate: Callable[[], Fields]
    _solved: tuple[Problem, State, int] | None = None
    units: Units = NO_UNITS
    _of_step: Mapping[str, Mapping[str, NDArray[np.floating]]] = field(default_factory=lambda: defaultdict(dict))

    @classmethod
    def of(cls, problem: Problem, state: State, number: int = 1) -> Solution:
        """Return the solution of a state, the one after `number` steps."""
        mesh = problem.space.mesh
        return cls(
            mesh,
            state.time,
            state.iterations,
            lambda: state_fields(problem, state),
            (problem, state, number),
            Units.of(problem.case.output.units),
        )

    @cached_property
    def fields(self) -> Fields:
        """All fields at the nodes and of the contacts."""
        return self.evaluate()

    @property
    def u(self) -> NDArray[np.floating]:
        """Displacement (n, d) of the nodes."""
        return self.fields.displacement

    @property
    def reaction(self) -> NDArray[np.floating]:
        """Forces (n, d) of the supports on the nodes."""
        return self.fields.reaction

    @property
    def contact(self) -> Mapping[str, ZoneFields]:
        """Fields of each contact and tie, by its name."""
        return ByName(self.fields.zones)

    @property
    def reactions(self) -> Mapping[str, NDArray[np.floating]]:
        """Force (d,) of each prescribed displacement and rigid body on the bodies, by the name of its group."""
        return ByName(self._of_step["reactions"] if self._solved is None else self.figures.reactions)

    @property
    def probes(self) -> Mapping[str, NDArray[np.floating]]:
        """Displacement (d,) of each probe, by its name."""
        return ByName(self._of_step["probes"] if self._solved is None else self.figures.probes)

    @property
    def pretension(self) -> Mapping[str, SectionForces]:
        """`force`, `shortening`, `moment` and `resultant` of each section of a bolt, by its name.

        Raises RequestError for a solution that was read from a folder, whose history has them.
        """
        problem, state, _ = self._own("forces of bolts")
        return bolt_forces(problem, state)

    def stress(self, at: str = "nodes") -> NDArray[np.floating]:
        """Return the stress xx, yy, zz, xy in a plane (zz: hoop), xx, yy, zz, xy, yz, xz in space.

        `at="nodes"`: (n, 4 or 6), extrapolated to the nodes and averaged over the cells of each; `at="cells"`: (k, 4 or
        6), the mean of each cell. NaN for nodes and cells that belong to no body. Cauchy stress with large
        displacements. Raises ValueError, and RequestError for cells of a solution that was read from a folder.
        """
        if at == "nodes":
            return self.fields.stress
        if at != "cells":
            raise ValueError(f'at is "nodes" or "cells", not {at!r}')
        problem, state, _ = self._own("stresses of cells")
        space = problem.space
        out = np.full((self.mesh.n_cells, space.model.n_stress), np.nan)
        for block, values, w in zip(space.blocks, point_stress(problem, state), weights(space), strict=True):
            out[block.cell] = np.einsum("cq,cqk->ck", w, values) / w.sum(axis=1)[:, None]
        return out

    def von_mises(self, at: str = "nodes") -> NDArray[np.floating]:
        """Return the equivalent stress of von Mises, (n,) at nodes or (k,) of the mean of each cell, see `stress`."""
        return von_mises(self.stress(at))

    @property
    def plastic_strain(self) -> NDArray[np.floating] | None:
        """Accumulated plastic strain (n,) at the nodes, extrapolated as a stress is; None if no material yields."""
        return self.fields.plastic_strain

    @property
    def figures(self) -> StepFigures:
        """Figures of the step that led here, such as reactions, and `plastic` where a material yields.

        Raises RequestError for a solution that was read from a folder.
        """
        problem, state, _ = self._own("figures of a step")
        return step_figures(problem, state)

    def to_pyvista(self) -> Any:
        """Return a `pyvista.UnstructuredGrid` of the undeformed mesh with the fields of the solution.

        On points: `displacement` and `reaction` (n, 3), `stress`, `von_mises`, `plastic_strain` where a material
        yields; on cells: `pressure`, `gap` and `status`
        of the contacts, NaN (status -2) on cells that are not their slave faces; `shear` and `slip` (n, 3) of contacts
        with friction. Raises RequestError without pyvista.
        """
        from lacmesh.exchange.libraries import to_pyvista

        grid = to_pyvista(self.mesh)
        order = slice(None) if self.mesh.file_order is None else np.asarray(self.mesh.file_order)
        for name, values in (("displacement", self.u), ("reaction", self.reaction)):
            grid.point_data[name] = np.pad(values, ((0, 0), (0, 3 - values.shape[1])))
        grid.point_data["stress"], grid.point_data["von_mises"] = self.stress(), self.von_mises()
        if self.plastic_strain is not None:
            grid.point_data["plastic_strain"] = self.plastic_strain
        for name in ("pressure", "gap", "status", "shear", "slip"):
            vectors = name in ("shear", "slip")
            out = np.full((self.mesh.n_cells, 3)[: 1 + vectors], -2 if name == "status" else np.nan)
            for zone in self.contact.values():
                if not vectors or name in zone.of_friction:
                    on, values = zone.macro >= 0, zone.of_friction[name] if vectors else getattr(zone, name)
                    values = np.pad(values, ((0, 0), (0, 3 - values.shape[1]))) if vectors else values
                    out[zone.surface.cell[on]] = values[zone.macro[on]]
            if not vectors or not np.isnan(out).all():
                grid.cell_data[name] = out[order]
        return grid

    def plot(
        self,
        path: str | Path | None = None,
        *,
        field: str = "pressure",
        zone: Sequence[str] = (),
        zoom: bool = False,
        ring: bool = False,
        title: str | None = None,
    ) -> Picture:
        """Draw the contact of this state: the deformed model, small, and beside it each zone by itself.

        Writes the picture to `path` (.png) if one is given; `field`, `zone`, `zoom`, `ring`, `title` as of
        `lacsolver.plot`.
        Raises RequestError if there is no contact, for a field or zone that is not there, or if a package is missing;
        WriteError.
        """
        from lacmesh.formats.output import replace_file
        from lacsolver.output.ring import described, fields_of_ring, sector_of
        from lacsolver.pictures.drawing import ContactPicture, check_plot

        target = Path("picture.png" if path is None else path)
        check_plot(target, self.mesh.dim)
        mesh, fields = self.mesh, self.fields
        if ring:
            mesh, fields = fields_of_ring(
                mesh, fields, sector_of({"cyclic": described(self._own("whole rings")[0].case)})
            )
        drawn = ContactPicture.of(mesh, fields, field, zone, self.units, zoom=zoom, title=title)
        picture = Picture(drawn.png())
        if path is not None:
            replace_file(target, picture.png)
        return picture

    def save(self, folder: str | Path, *, force: bool = False) -> None:
        """Write the solution into a folder, with the files of `lacsolver run` (docs/output.md) for its one time.

        `force`: replace results that are there. Raises RequestError if there are any, WriteError.
        """
        problem, state, number = self._own("files of results")
        writer = Writer(
            create_output(folder, force=force), problem.case, problem.space, fingerprint(problem.case, self.mesh)
        )
        ranges = stress_ranges(problem.space, point_stress(problem, state))
        results = Results(
            __version__, steps=(step_figures(problem, state),), stress=ranges, units=problem.case.output.units or ""
        )
        writer.step(results, lambda: self.fields, Restart.of(state, problem.case.steps.last, number))
        writer.finish(replace(results, status="done"))

    def _own(self, wanted: str) -> tuple[Problem, State, int]:
        """Return the problem, the state, and the number of its step. Raises RequestError for what was read."""
        if self._solved is None:
            raise RequestError(f"{wanted} need the problem, which a solution read from a folder does not have")
        return self._solved

    def _facts(self) -> dict[str, str]:
        d = self.u.shape[1]
        largest = float(np.linalg.norm(self.u, axis=1).max(initial=0.0))
        facts = {
            "time": f"{self.time:.6g}, after {self.iterations} iterations",
            "u": f"({len(self.u)}, {d}), at most {largest:.6g}",
        }
        for name, zone in list(self.contact.items())[:6]:
            on, top = int((zone.status >= 1).sum()), float(zone.pressure.max(initial=0.0))
            facts[f"contact[{name!r}]"] = (
                f"{on} of {len(zone.status)} macro-elements closed, pressure at most {top:.6g}"
            )
        if len(self.contact) > 6:
            facts["contact"] = f"{len(self.contact) - 6} more"
        return facts


def solve(case: Case | str | Path, mesh: MeshLike | None = None, *, progress: bool = False) -> Solution:
    """Solve a case on a mesh and return its last state; slaves that are not cut are cut here.

    `case`: a case, or the path of a case file. `mesh`: a mesh, or the path of its file; None for the one that the case
    names. `progress`: show a line for each step on stderr, and on a terminal or in a notebook iterations too.
    Solved again with the same mesh and another case, what the change leaves as it was is taken again: the cut, the
    pairing, the stiffness and its factor.

    Raises CaseError, ReadError, CutError, DataError and RequestError for what is wrong in the case or the mesh, and
    NotConvergedError.

    >>> import lacsolver as ls
    >>> from lacmesh import example
    >>> ls.solve(example("two_blocks.toml"))
    Solution
      time              1, after 1 iterations
      u                 (512, 3), at most 0.0139538
      contact['joint']  36 of 36 macro-elements closed, pressure at most 17.539
    """
    *_, last = march(case, mesh, progress=progress)
    return last


def march(case: Case | str | Path, mesh: MeshLike | None = None, *, progress: bool = False) -> Iterator[Solution]:
    """Yield the solution of every step of a case on a mesh, as it converges; arguments and errors as of `solve`.

    >>> import lacsolver as ls
    >>> from lacmesh import example
    >>> [(solution.time, solution.contact["joint"].pressure.shape) for solution in ls.march(example("two_blocks.toml"))]
    [(0.5, (36,)), (1.0, (36,))]
    """
    case = as_case(case)
    before = _LAST[-1] if _LAST else None
    problem = Problem.of(case, mesh_of(case, mesh), like=before.problem if before else None)
    watch = Watch(case, "stderr", quiet=not progress)

    def iterated(now: Progress) -> None:
        _log(now)
        watch.iterated(now)

    doubts = Doubts(problem)
    doubts.ask("undeformed")
    with watch:
        try:
            for number, state in enumerate(march_states(problem, progress=iterated, kept=_LAST), start=1):
                _LOG.info("t = %.6g: %d iterations, %d halvings", state.time, state.iterations, state.halvings)
                doubts.after(state)
                if progress:
                    watch.stepped(step_figures(problem, state))
                yield Solution.of(problem, state, number)
        except NotConvergedError:
            doubts.ask("failed")
            raise
    doubts.ask("end")


def _log(now: Progress) -> None:
    _LOG.debug(
        "towards t = %.6g, iteration %d: %d closed, balance %.1e, gaps %.1e",
        now.time, now.number, now.closed, now.balance, now.gap,
    )  # fmt: skip
