"""The case: what is solved, as a record that a TOML file or Python fills.

    lines, document = the text in TOML, and where its keys stand           (lines, read)
    drafts = each section, its keys read by the rows of the table          (keys, kinds, value, formula, draft)
    mistakes = what may not stand together                                 (rules)
    case = frozen records; every mistake was told at once, with its line   (records, case)

The rows of the table also make the schemas and the page of docs (schema). numpy is loaded when a value is evaluated.
"""

from lacsolver.case.case import Case, Output, Probe, Solver, Steps
from lacsolver.case.digest import changed, digest, fingerprint
from lacsolver.case.errors import CaseError, EvaluationError, Problem
from lacsolver.case.groups import check_groups
from lacsolver.case.read import parse_case, read_case
from lacsolver.case.records import (
    BodyForce,
    Contact,
    Displacement,
    Force,
    Gravity,
    Material,
    Pressure,
    Rigid,
    Spring,
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
    "Displacement",
    "EvaluationError",
    "Force",
    "Gravity",
    "Material",
    "Output",
    "Pressure",
    "Probe",
    "Problem",
    "Rigid",
    "Solver",
    "Spring",
    "Steps",
    "Temperature",
    "Tie",
    "Traction",
    "Value",
    "changed",
    "check_groups",
    "digest",
    "fingerprint",
    "parse_case",
    "read_case",
]
