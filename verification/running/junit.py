"""The results as JUnit has them, so that programs that watch tests can read them: a suite a family, a test a case."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from itertools import groupby

from lacmesh.cli.program import on_one_line
from verification.running.folder import CaseResult, Run


def junit(run: Run) -> bytes:
    """The XML of a run."""
    root = ET.Element("testsuites", name=f"verification {run.suite}", time=f"{run.seconds:.3f}")
    for family, group in groupby(run.done, key=lambda done: done.family):
        cases = list(group)
        short, errors = (sum(map(f, cases)) for f in (_short, lambda done: bool(done.failure)))
        count = {"tests": str(len(cases)), "failures": str(short), "errors": str(errors)}
        time = f"{sum(done.seconds for done in cases):.3f}"
        suite = ET.SubElement(root, "testsuite", {"name": family, "time": time, **count})
        for done in cases:
            suite.append(_case(done))
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True))


def _short(done: CaseResult) -> bool:
    return not done.failure and not done.passed


def _case(done: CaseResult) -> ET.Element:
    element = ET.Element("testcase", classname=done.family, name=done.case, time=f"{done.seconds:.3f}")
    if done.failure:
        ET.SubElement(element, "error", message=on_one_line(done.failure))
    for result in done.results:
        if not result.passed:
            message = f"{result.quantity} is {result.value:.6g}, {result.bound} {result.expected}"
            ET.SubElement(element, "failure", message=on_one_line(message)).text = on_one_line(result.reason)
    return element
