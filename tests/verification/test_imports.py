"""The harness is a user: it sees of lacmesh and lacsolver what these export."""

from __future__ import annotations

import ast
from pathlib import Path

import lacmesh
import lacsolver

MODULES = sorted((Path(__file__).resolve().parents[2] / "verification").rglob("*.py"))
#: whole modules: for users, and of commands, how they read arguments, print, fail and write files
WHOLE = {
    *("lacmesh.reference.quadrature", "lacmesh.reference.shapes"),
    *("lacmesh.cli.program", "lacmesh.cli.options", "lacmesh.cli.terminal", "lacmesh.errors", "lacmesh.formats.output"),
    *("lacmesh.generate", "lacmesh.generate.parts"),  # shapes, and what shapes of one's own are made of
    # parts of a mesh, and the processes that share a model (docs/partition.md, docs/install_petsc.md)
    *("lacmesh.partition", "lacsolver.distributed.launch", "lacsolver.distributed.processes"),
    # what its reports are made of, as lacmesh's own are
    *("lacmesh.report", *(f"lacmesh.report.{name}" for name in ("blocks", "charts", "markup", "pages"))),
}
PACKAGES = {"lacmesh": lacmesh, "lacsolver": lacsolver}
#: module and name: the public ones, and the stages for users who take one and replace another
NAMES = {
    *((module, name) for module, package in PACKAGES.items() for name in (*package.__all__, "__version__")),
    *(("lacmesh.mesh", name) for name in ("Block",)),
    *(("lacmesh.cells", name) for name in ("CELLS",)),
    *(("lacmesh.__main__", name) for name in ("start",)),
    *(("lacmesh.kernels.threads", name) for name in ("peak_memory",)),
    *(("lacsolver.case", name) for name in (*lacsolver.__all__, "Value")),
    *(("lacsolver.problem.problem", name) for name in ("Problem",)),
    *(("lacsolver.equilibrium.stepping", name) for name in ("march",)),
    *(("lacsolver.output", name) for name in ("OutputFolder", "create_output", "read_state")),
    # one linear system of contact: how many times it takes K^-1
    *(("lacsolver.equilibrium.load_step", name) for name in ("LoadStep",)),
    *(("lacsolver.equilibrium.reduced", name) for name in ("ReducedProblem",)),
    *(("lacsolver.saddle.saddle", name) for name in ("SaddleProblem",)),
    *(("lacsolver.saddle.schur", name) for name in ("solve_saddle",)),
    *(("lacsolver.saddle.tolerances", name) for name in ("ConvergenceTolerance",)),
    *(("lacsolver.problem.resultants", name) for name in ("resultants",)),
    *(("lacsolver.results.fields", name) for name in ("point_stress", "state_fields")),
    *(("lacsolver.results.figures", name) for name in ("step_figures",)),
    *(("lacsolver.results.state", name) for name in ("State", "StepState", "ZoneFriction", "ZoneState")),
    *(("lacsolver.results.results", name) for name in ("Fields", "Restart", "Results", "StepFigures", "ZoneFields")),
    *(("lacsolver.space.space", name) for name in ("Space",)),
    *(("lacsolver.bodies.material", name) for name in ("Elastic", "Materials", "Orthotropic")),
    *(("lacsolver.bodies.small", name) for name in ("assemble_stiffness", "stress")),
    *(("lacsolver.constraints", name) for name in ("Constraints",)),
    *(("lacsolver.contact", name) for name in ("Interface", "Pairing", "Zone", "integrate")),
    *((f"{package}.errors", name) for package in PACKAGES for name in ("CaseError", "LinearError", "DataError")),
}


def taken(path):
    """Modules and names of lacmesh and lacsolver that a module takes; the name is empty for a module itself."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names if alias.name.startswith("lac"))
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("lac"):
            yield from ((node.module, alias.name) for alias in node.names)
        elif isinstance(node, ast.Attribute) and ast.unparse(node.value) in PACKAGES:
            yield ast.unparse(node.value), node.attr


def test_only_what_is_exported_is_used():
    allowed = {*NAMES, *((module, "") for module in PACKAGES)}
    others = [(path, *name) for path in MODULES for name in taken(path) if name not in allowed and name[0] not in WHOLE]
    assert others == []


def test_there_are_modules_to_look_at():
    assert {"sources", "outline", "norms", "manufactured"} <= {path.stem for path in MODULES}
