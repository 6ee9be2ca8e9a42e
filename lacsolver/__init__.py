"""The LAC contact solver, for a case file and a mesh cut by lacmesh. Its modules are imported on first use."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lacmesh import __version__ as __version__
from lacmesh import _named

#: public name -> the module that holds it: verbs in the order of the stages, records, errors
_PUBLIC = {
    "read_case": "lacsolver.case",
    "parse_case": "lacsolver.case",
    "validate": "lacsolver.validation",
    "contact_matrices": "lacsolver.matrices",
    "write_matrices": "lacsolver.matrices",
    "march": "lacsolver.solve.stepping",
    "natural_modes": "lacsolver.vibration.natural_modes",
    "create": "lacsolver.output",
    "run": "lacsolver.running",
    "read_state": "lacsolver.output",
    "plot": "lacsolver.pictures.drawing",
    "film": "lacsolver.pictures.filming",
    "Case": "lacsolver.case",
    "Problem": "lacsolver.problem.problem",
    "ContactMatrices": "lacsolver.matrices",
    "State": "lacsolver.results.state",
    "ZoneState": "lacsolver.results.state",
    "Answer": "lacsolver.results.answer",
    **dict.fromkeys(
        ("Fields", "Restart", "Results", "StepFigures", "ZoneFields", "ZoneFigures"), "lacsolver.results.results"
    ),
    "CaseError": "lacsolver.case",
    "EvaluationError": "lacsolver.case.errors",
    "LinearError": "lacsolver.linear.errors",
    "SingularError": "lacsolver.linear.errors",
    "NotConvergedError": "lacsolver.solve.stepping",
}
#: names that were public here -> the module to import them from
_MOVED = {
    **dict.fromkeys(
        (
            *("BodyForce", "Contact", "Displacement", "Force", "Gravity", "Material", "Output", "Pressure", "Probe"),
            *("Rigid", "Solver", "Spring", "Steps", "Temperature", "Tie", "Traction", "Value"),
        ),
        "lacsolver.case",
    ),
    "Space": "lacsolver.space.space",
    **dict.fromkeys(("Elastic", "Materials", "Orthotropic"), "lacsolver.bodies.material"),
    **dict.fromkeys(("assemble_stiffness", "stress"), "lacsolver.bodies.small"),
    "Constraints": "lacsolver.constraints",
    **dict.fromkeys(("Interface", "Pairing", "Zone", "integrate"), "lacsolver.contact"),
    "OutputFolder": "lacsolver.output",
}
__all__ = sorted(_PUBLIC)

if TYPE_CHECKING:
    from lacsolver.case import Case as Case
    from lacsolver.case import CaseError as CaseError
    from lacsolver.case import parse_case as parse_case
    from lacsolver.case import read_case as read_case
    from lacsolver.case.errors import EvaluationError as EvaluationError
    from lacsolver.linear.errors import LinearError as LinearError
    from lacsolver.linear.errors import SingularError as SingularError
    from lacsolver.matrices import ContactMatrices as ContactMatrices
    from lacsolver.matrices import contact_matrices as contact_matrices
    from lacsolver.matrices import write_matrices as write_matrices
    from lacsolver.output import create as create
    from lacsolver.output import read_state as read_state
    from lacsolver.pictures.drawing import plot as plot
    from lacsolver.pictures.filming import film as film
    from lacsolver.problem.problem import Problem as Problem
    from lacsolver.results.answer import Answer as Answer
    from lacsolver.results.results import Fields as Fields
    from lacsolver.results.results import Restart as Restart
    from lacsolver.results.results import Results as Results
    from lacsolver.results.results import StepFigures as StepFigures
    from lacsolver.results.results import ZoneFields as ZoneFields
    from lacsolver.results.results import ZoneFigures as ZoneFigures
    from lacsolver.results.state import State as State
    from lacsolver.results.state import ZoneState as ZoneState
    from lacsolver.running import run as run
    from lacsolver.solve.stepping import NotConvergedError as NotConvergedError
    from lacsolver.solve.stepping import march as march
    from lacsolver.validation import validate as validate
    from lacsolver.vibration.natural_modes import natural_modes as natural_modes


def __getattr__(name: str) -> Any:
    return _named("lacsolver", name, _PUBLIC, _MOVED)


def __dir__() -> list[str]:
    return __all__
