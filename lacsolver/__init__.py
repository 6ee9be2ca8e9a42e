"""The LAC contact solver: a case says what, lacmesh cuts the mesh. Nothing is loaded until it is used."""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
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
    "NotConvergedError": "lacsolver.march",
    "march": "lacsolver.march",
    "validate": "lacsolver.validation",
    "run": "lacsolver.run",
    "OutputFolder": "lacsolver.output",
    "create": "lacsolver.output",
    "read_state": "lacsolver.output",
    "Restart": "lacsolver.results",
    "Results": "lacsolver.results",
    "StepFigures": "lacsolver.results",
    "ZoneFigures": "lacsolver.results",
    "plot": "lacsolver.plot",
}

__all__ = [
    "BodyForce",
    "Case",
    "CaseError",
    "Constraints",
    "Contact",
    "ContactMatrices",
    "Displacement",
    "Elastic",
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
    "ZoneFigures",
    "ZoneState",
    "__version__",
    "assemble_stiffness",
    "contact_matrices",
    "create",
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
    from lacsolver.interface import Interface, Pairing, Zone, integrate
    from lacsolver.march import NotConvergedError, march
    from lacsolver.material import Elastic, Materials, Orthotropic
    from lacsolver.matrices import ContactMatrices, contact_matrices, write_matrices
    from lacsolver.output import OutputFolder, create, read_state
    from lacsolver.plot import plot
    from lacsolver.problem import Problem
    from lacsolver.results import Restart, Results, StepFigures, ZoneFigures
    from lacsolver.run import run
    from lacsolver.space import Space
    from lacsolver.state import State, ZoneState
    from lacsolver.validation import validate


class _Package(ModuleType):
    """Some functions are called as the module that holds them (`run`): here the function has the name."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in _PUBLIC and isinstance(value, ModuleType)):
            super().__setattr__(name, value)

    def __getattr__(self, name: str) -> Any:
        if name in _PUBLIC:
            return getattr(import_module(_PUBLIC[name]), name)
        raise AttributeError(f"module 'lacsolver' has no attribute {name!r}")

    def __dir__(self) -> list[str]:
        return sorted({*self.__dict__, *_PUBLIC})


sys.modules[__name__].__class__ = _Package
