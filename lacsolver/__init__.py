"""The LAC contact solver: a case says what, lacmesh cuts the mesh. Nothing is loaded until it is used."""

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
    "Space": "lacsolver.space",
    "Elastic": "lacsolver.material",
    "Materials": "lacsolver.material",
    "Orthotropic": "lacsolver.material",
    "assemble_stiffness": "lacsolver.assemble",
    "stress": "lacsolver.assemble",
    "Constraints": "lacsolver.constraints",
    "Interface": "lacsolver.interface",
    "Pairing": "lacsolver.interface",
    "Zone": "lacsolver.interface",
    "integrate": "lacsolver.interface",
    "ContactMatrices": "lacsolver.matrices",
    "contact_matrices": "lacsolver.matrices",
    "write_matrices": "lacsolver.matrices",
    "Problem": "lacsolver.problem",
    "State": "lacsolver.state",
    "ZoneState": "lacsolver.state",
    "NotConvergedError": "lacsolver.stepping",
    "march": "lacsolver.stepping",
    "validate": "lacsolver.validation",
    "run": "lacsolver.running",
    "Answer": "lacsolver.answer",
    "OutputFolder": "lacsolver.output",
    "create": "lacsolver.output",
    "read_state": "lacsolver.output",
    "Fields": "lacsolver.results",
    "Restart": "lacsolver.results",
    "Results": "lacsolver.results",
    "StepFigures": "lacsolver.results",
    "ZoneFields": "lacsolver.results",
    "ZoneFigures": "lacsolver.results",
    "plot": "lacsolver.drawing",
    "film": "lacsolver.filming",
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
    from lacsolver.answer import Answer
    from lacsolver.assemble import assemble_stiffness, stress
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
    from lacsolver.drawing import plot
    from lacsolver.filming import film
    from lacsolver.interface import Interface, Pairing, Zone, integrate
    from lacsolver.material import Elastic, Materials, Orthotropic
    from lacsolver.matrices import ContactMatrices, contact_matrices, write_matrices
    from lacsolver.output import OutputFolder, create, read_state
    from lacsolver.problem import Problem
    from lacsolver.results import Fields, Restart, Results, StepFigures, ZoneFields, ZoneFigures
    from lacsolver.running import run
    from lacsolver.space import Space
    from lacsolver.state import State, ZoneState
    from lacsolver.stepping import NotConvergedError, march
    from lacsolver.validation import validate


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'lacsolver' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_PUBLIC})
