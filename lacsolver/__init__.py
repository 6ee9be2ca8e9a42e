"""LAC contact in Python: a case and a mesh in, pressures out; or the matrices for a solver of your own.

    solution = lacsolver.solve(case, mesh)      and march for every step, run for a folder of files
    system = lacsolver.assemble(case, mesh)     and contact_matrices, solve_contact for your own program

Names are imported on first use. What else there is has modules of its own; errors are in `lacsolver.errors`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lacmesh import __version__ as __version__
from lacmesh import _named

#: public name -> the module that holds it: verbs in the order of the work, records of a case, other records, errors
_PUBLIC = {
    "read_case": "lacsolver.case",
    "parse_case": "lacsolver.case",
    "validate": "lacsolver.validation",
    "solve": "lacsolver.solution",
    "march": "lacsolver.solution",
    "assemble": "lacsolver.system",
    "contact_matrices": "lacsolver.matrices",
    "read_matrices": "lacsolver.matrices",
    "solve_contact": "lacsolver.equilibrium.given",
    "natural_modes": "lacsolver.vibration.natural_modes",
    "run": "lacsolver.running",
    "read_results": "lacsolver.reading",
    "plot": "lacsolver.pictures.drawing",
    "film": "lacsolver.pictures.filming",
    **dict.fromkeys(
        (
            *("BodyForce", "Case", "Contact", "Coupling", "Cyclic", "Displacement", "Dynamics", "Equation", "Force"),
            *("Gravity", "Initial", "Material", "Output", "Pressure", "Pretension", "Probe", "Rigid", "Solver"),
            *("Spring", "Steps", "Temperature", "Tie", "Traction"),
        ),
        "lacsolver.case",
    ),
    "Solution": "lacsolver.solution",
    "System": "lacsolver.system",
    "ContactMatrices": "lacsolver.matrices",
    "ContactSolution": "lacsolver.equilibrium.given",
    "RunResults": "lacsolver.reading",
    "CaseError": "lacsolver.case",
    "NotConvergedError": "lacsolver.equilibrium.stepping",
}
__all__ = sorted(_PUBLIC)

if TYPE_CHECKING:
    from lacsolver.case import BodyForce as BodyForce
    from lacsolver.case import Case as Case
    from lacsolver.case import CaseError as CaseError
    from lacsolver.case import Contact as Contact
    from lacsolver.case import Coupling as Coupling
    from lacsolver.case import Cyclic as Cyclic
    from lacsolver.case import Displacement as Displacement
    from lacsolver.case import Dynamics as Dynamics
    from lacsolver.case import Equation as Equation
    from lacsolver.case import Force as Force
    from lacsolver.case import Gravity as Gravity
    from lacsolver.case import Initial as Initial
    from lacsolver.case import Material as Material
    from lacsolver.case import Output as Output
    from lacsolver.case import Pressure as Pressure
    from lacsolver.case import Pretension as Pretension
    from lacsolver.case import Probe as Probe
    from lacsolver.case import Rigid as Rigid
    from lacsolver.case import Solver as Solver
    from lacsolver.case import Spring as Spring
    from lacsolver.case import Steps as Steps
    from lacsolver.case import Temperature as Temperature
    from lacsolver.case import Tie as Tie
    from lacsolver.case import Traction as Traction
    from lacsolver.case import parse_case as parse_case
    from lacsolver.case import read_case as read_case
    from lacsolver.equilibrium.given import ContactSolution as ContactSolution
    from lacsolver.equilibrium.given import solve_contact as solve_contact
    from lacsolver.equilibrium.stepping import NotConvergedError as NotConvergedError
    from lacsolver.matrices import ContactMatrices as ContactMatrices
    from lacsolver.matrices import contact_matrices as contact_matrices
    from lacsolver.matrices import read_matrices as read_matrices
    from lacsolver.pictures.drawing import plot as plot
    from lacsolver.pictures.filming import film as film
    from lacsolver.reading import RunResults as RunResults
    from lacsolver.reading import read_results as read_results
    from lacsolver.running import run as run
    from lacsolver.solution import Solution as Solution
    from lacsolver.solution import march as march
    from lacsolver.solution import solve as solve
    from lacsolver.system import System as System
    from lacsolver.system import assemble as assemble
    from lacsolver.validation import validate as validate
    from lacsolver.vibration.natural_modes import natural_modes as natural_modes


def __getattr__(name: str) -> Any:
    return _named("lacsolver", name, _PUBLIC)


def __dir__() -> list[str]:
    return __all__
