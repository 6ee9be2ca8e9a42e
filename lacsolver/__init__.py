"""The LAC contact solver, for a case file and a mesh cut by lacmesh. Its modules are imported on first use."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from lacmesh import __version__

#: public name -> the module that holds it, in the order of the stages
_PUBLIC = {
    **dict.fromkeys(
        (
            *("BodyForce", "Case", "CaseError", "Contact", "Displacement", "Force", "Gravity", "Material", "Output"),
            *("Pressure", "Probe", "Rigid", "Solver", "Spring", "Steps", "Temperature", "Tie", "Traction", "Value"),
            *("parse_case", "read_case"),
        ),
        "lacsolver.case",
    ),
    "Space": "lacsolver.space.space",
    "Elastic": "lacsolver.bodies.material",
    "Materials": "lacsolver.bodies.material",
    "Orthotropic": "lacsolver.bodies.material",
    "assemble_stiffness": "lacsolver.bodies.small",
    "stress": "lacsolver.bodies.small",
    "Constraints": "lacsolver.constraints",
    "Interface": "lacsolver.contact",
    "Pairing": "lacsolver.contact",
    "Zone": "lacsolver.contact",
    "integrate": "lacsolver.contact",
    "ContactMatrices": "lacsolver.matrices",
    "contact_matrices": "lacsolver.matrices",
    "write_matrices": "lacsolver.matrices",
    "Problem": "lacsolver.problem.problem",
    "State": "lacsolver.results.state",
    "ZoneState": "lacsolver.results.state",
    "NotConvergedError": "lacsolver.solve.stepping",
    "march": "lacsolver.solve.stepping",
    "validate": "lacsolver.validation",
    "run": "lacsolver.running",
    "Answer": "lacsolver.results.answer",
    "OutputFolder": "lacsolver.output",
    "create": "lacsolver.output",
    "read_state": "lacsolver.output",
    "Fields": "lacsolver.results.results",
    "Restart": "lacsolver.results.results",
    "Results": "lacsolver.results.results",
    "StepFigures": "lacsolver.results.results",
    "ZoneFields": "lacsolver.results.results",
    "ZoneFigures": "lacsolver.results.results",
    "plot": "lacsolver.pictures.drawing",
    "film": "lacsolver.pictures.filming",
}

__all__ = [
    "Answer",
    "BodyForce",
    "Case",
    "CaseError",
    "Constraints",
    "Contact",
    "ContactMatrices",
    "Displacement",
    "Elastic",
    "Fields",
    "Force",
    "Gravity",
    "Interface",
    "Material",
    "Materials",
    "NotConvergedError",
    "Orthotropic",
    "Output",
    "OutputFolder",
    "Pairing",
    "Pressure",
    "Probe",
    "Problem",
    "Restart",
    "Results",
    "Rigid",
    "Solver",
    "Space",
    "Spring",
    "State",
    "StepFigures",
    "Steps",
    "Temperature",
    "Tie",
    "Traction",
    "Value",
    "Zone",
    "ZoneFields",
    "ZoneFigures",
    "ZoneState",
    "__version__",
    "assemble_stiffness",
    "contact_matrices",
    "create",
    "film",
    "integrate",
    "march",
    "parse_case",
    "plot",
    "read_case",
    "read_state",
    "run",
    "stress",
    "validate",
    "write_matrices",
]

if TYPE_CHECKING:
    from lacsolver.bodies.material import Elastic, Materials, Orthotropic
    from lacsolver.bodies.small import assemble_stiffness, stress
    from lacsolver.case import (
        BodyForce,
        Case,
        CaseError,
        Contact,
        Displacement,
        Force,
        Gravity,
        Material,
        Output,
        Pressure,
        Probe,
        Rigid,
        Solver,
        Spring,
        Steps,
        Temperature,
        Tie,
        Traction,
        Value,
        parse_case,
        read_case,
    )
    from lacsolver.constraints import Constraints
    from lacsolver.contact import Interface, Pairing, Zone, integrate
    from lacsolver.matrices import ContactMatrices, contact_matrices, write_matrices
    from lacsolver.output import OutputFolder, create, read_state
    from lacsolver.pictures.drawing import plot
    from lacsolver.pictures.filming import film
    from lacsolver.problem.problem import Problem
    from lacsolver.results.answer import Answer
    from lacsolver.results.results import Fields, Restart, Results, StepFigures, ZoneFields, ZoneFigures
    from lacsolver.results.state import State, ZoneState
    from lacsolver.running import run
    from lacsolver.solve.stepping import NotConvergedError, march
    from lacsolver.space.space import Space
    from lacsolver.validation import validate


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'lacsolver' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_PUBLIC})
