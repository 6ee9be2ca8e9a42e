"""Rules of the check, and what they find: a rule is a function that yields places, each with a sentence about it.

`docs/check.md` lists the rules; the docstring of the function says what a finding of the rule means.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple, TypeVar

from lacmesh.facts import Described
from lacmesh.mesh import Ints

SEVERITIES = ("error", "warning", "info")
#: what a rule examines: the mesh with all slaves; the groups of each skin; the faces of each skin, or of the slave, if
#: it has some; a slave with its master, which are several pairs if the request names them; each skin of a pair
SCOPES = ("mesh", "group", "skin", "slave", "pair", "skin of pair")
#: modules of the rules, in the order of their findings
_MODULES = ("cells", "skins", "dofs", "bodies", "facing")

Corner = tuple[float, float, float]
Function = TypeVar("Function", bound=Callable[..., Any])


class Place(NamedTuple):
    """Cells or nodes, by their indices, about which a rule has something to say, and the group that they are in."""

    message: str
    cells: Ints | None = None
    nodes: Ints | None = None
    group: str | None = None


class Rule(NamedTuple):
    """A rule: `severity` (error, warning, info), what it `means`, what to do (`advice`), and its `scope`, of SCOPES."""

    severity: str
    means: str
    advice: str
    scope: str = "mesh"


class Examination(NamedTuple):
    """A function of (request) or, for groups and skins, of (request, skin) that yields places; figures return a dict.

    `rule`: the name of the rule; "" for figures of the summary.
    """

    rule: str
    scope: str
    function: Callable[..., Any]


_RULES: dict[str, Rule] = {}
_EXAMINATIONS: dict[str, list[Examination]] = {}


def rule(name: str, severity: str, advice: str, scope: str = "mesh") -> Callable[[Function], Function]:
    """Declare a function that yields the places of a rule's findings; its docstring says what they mean."""

    def declare(function: Function) -> Function:
        means = " ".join((function.__doc__ or "").split()).rstrip(".")
        _RULES[name] = Rule(severity, means[:1].lower() + means[1:], advice, scope)
        return also(name, scope)(function)

    return declare


def also(name: str, scope: str = "mesh") -> Callable[[Function], Function]:
    """Declare a further function of a rule."""

    def declare(function: Function) -> Function:
        _EXAMINATIONS.setdefault(function.__module__, []).append(Examination(name, scope, function))
        return function

    return declare


def figures(scope: str = "mesh") -> Callable[[Function], Function]:
    """Declare a function of (request) that returns figures for the summary."""
    return also("", scope)


def examinations() -> list[Examination]:
    """Return all examinations, in the order of their findings."""
    modules = [import_module(f"lacmesh.checks.{name}") for name in _MODULES]
    return [one for module in modules for one in _EXAMINATIONS[module.__name__]]


def all_rules() -> dict[str, Rule]:
    """Return every rule by its name."""
    names = dict.fromkeys(one.rule for one in examinations() if one.rule)
    return {name: _RULES[name] for name in names} | {
        "not-checked": Rule("error", "a part of the check failed", "report it, with the mesh")
    }


def severity_of(rule: str) -> str:
    """Return the severity of a rule."""
    return _RULES[rule].severity if rule in _RULES else "error"


def named(message: str, rule: str) -> str:
    """Return the message of another program about what a rule of the check finds, with the name of the rule.

    >>> named("master 'top' is in front of 30 % of slave 'low'", "partial-coverage")
    "master 'top' is in front of 30 % of slave 'low' (lacmesh check: partial-coverage)"
    """
    return f"{message} (lacmesh check: {rule})"


class Where(NamedTuple):
    """Place of a finding: the `group` it was found in, and the `box` (lowest, highest corner) of its cells or nodes.

    `pair`: slave and master that it is about, of several pairs; None for a single one, and for what is of no pair.
    """

    group: str | None = None
    box: tuple[Corner, Corner] | None = None
    pair: tuple[str, str] | None = None


@dataclass(frozen=True, repr=False)
class Finding(Described):
    """One finding: `rule` (a key of RULES), `severity`, ids of `cells` and `nodes` in the file, `where`, a sentence.

    >>> from lacmesh import check, read
    >>> finding = next(iter(check(read("data/two_blocks.msh"), "slave", "master")))
    >>> finding.rule, finding.severity, len(finding.cells)
    ('not-cut', 'info', 36)
    """

    rule: str
    severity: str
    cells: tuple[int, ...]
    nodes: tuple[int, ...]
    where: Where
    message: str

    def __repr__(self) -> str:
        return f"{self.severity} {self.rule}: {self.message}"

    def as_dict(self) -> dict[str, Any]:
        """Return the finding as plain data for JSON."""
        return {
            "rule": self.rule,
            "severity": self.severity,
            "cells": list(self.cells),
            "nodes": list(self.nodes),
            "where": {
                "group": self.where.group,
                "box": self.where.box and [list(c) for c in self.where.box],
                **({"pair": list(self.where.pair)} if self.where.pair else {}),
            },
            "message": self.message,
        }


@dataclass(frozen=True, repr=False)
class Findings(Described):
    """All findings, errors first; `summary`: counts, and figures of the internal dofs, the gap and the coverage.

    >>> from lacmesh import check, read
    >>> findings = check(read("data/two_blocks.msh"), "slave", "master")
    >>> len(findings.errors), findings.rules, findings.summary["slave_faces"]
    (0, ('not-cut', 'bodies', 'gap'), 36)
    """

    findings: tuple[Finding, ...]
    summary: Mapping[str, Any]

    @classmethod
    def of(cls, findings: list[Finding], figures: Mapping[str, Any]) -> Findings:
        """Sort findings, errors first, and add the summary."""
        ranked = sorted(findings, key=lambda f: SEVERITIES.index(f.severity))
        counts = {severity: sum(f.severity == severity for f in findings) for severity in SEVERITIES}
        return cls(tuple(ranked), {"ok": counts["error"] == 0, **counts, **figures})

    def _title(self) -> str:
        return f"Findings: {', '.join(f'{len(self.of_severity(kind))} {kind}' for kind in SEVERITIES)}"

    def _facts(self) -> dict[str, str]:
        return {f"{one.severity} {one.rule}": one.message for one in self.findings}

    def __iter__(self) -> Iterator[Finding]:
        return iter(self.findings)

    def __len__(self) -> int:
        return len(self.findings)

    @property
    def errors(self) -> tuple[Finding, ...]:
        """The findings of severity error: the mesh will not work."""
        return self.of_severity("error")

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """The findings of severity warning: the mesh may not work."""
        return self.of_severity("warning")

    @property
    def rules(self) -> tuple[str, ...]:
        """The rules that have findings, each once, in the order of the findings."""
        return tuple(dict.fromkeys(f.rule for f in self.findings))

    def of_severity(self, severity: str) -> tuple[Finding, ...]:
        """The findings of one severity."""
        return tuple(f for f in self.findings if f.severity == severity)

    def of_rule(self, rule: str) -> tuple[Finding, ...]:
        """The findings of one rule."""
        return tuple(f for f in self.findings if f.rule == rule)

    def as_dict(self) -> dict[str, Any]:
        """Return plain data for JSON: {findings, summary}."""
        return {"findings": [f.as_dict() for f in self.findings], "summary": dict(self.summary)}


def counted(n: int, one: str, many: str | None = None) -> str:
    """Format a count and its noun for a sentence, in the singular or the plural.

    >>> counted(1, "face turns", "faces turn"), counted(2000, "node")
    ('1 face turns', '2,000 nodes')
    """
    return f"{n:,} {one if n == 1 else many or one + 's'}"
