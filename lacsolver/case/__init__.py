"""The case: description of the problem to solve, as a record that is filled from a TOML file or from Python.

    lines, document = the TOML text and the lines of its keys                          (lines, read)
    case = records of the sections, models of pydantic, by the table of keys           (keys, kinds, value, entry)
    mistakes = those of all keys at once; if there are none, what keys show together   (read, entry, rules)

The rows of the table also give the schemas and the page of docs (schema). numpy is loaded when a value is evaluated.
"""

from lacsolver.case.case import Case, Dynamics, Initial, Output, Probe, Solver, Steps
from lacsolver.case.digest import changed, digest, fingerprint
from lacsolver.case.errors import CaseError, EvaluationError, Issue
from lacsolver.case.groups import check_groups
from lacsolver.case.joints import Coupling, Cyclic, Equation, Pretension, Spring
from lacsolver.case.read import as_case, parse_case, read_case
from lacsolver.case.records import (
    BodyForce,
    Contact,
    Displacement,
    Force,
    Gravity,
    Material,
    Pressure,
    Rigid,
    Temperature,
    Tie,
    Traction,
)
from lacsolver.case.value import Value

__all__ = [
    "BodyForce",
    "Case",
    "CaseError",
    "Contact",
    "Coupling",
    "Cyclic",
    "Displacement",
    "Dynamics",
    "Equation",
    "EvaluationError",
    "Force",
    "Gravity",
    "Initial",
    "Issue",
    "Material",
    "Output",
    "Pressure",
    "Pretension",
    "Probe",
    "Rigid",
    "Solver",
    "Spring",
    "Steps",
    "Temperature",
    "Tie",
    "Traction",
    "Value",
    "as_case",
    "changed",
    "check_groups",
    "digest",
    "fingerprint",
    "parse_case",
    "read_case",
]
