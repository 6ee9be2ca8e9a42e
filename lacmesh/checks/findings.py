"""Findings of a check, each with its rule, its severity, its place, and a sentence that says what to do."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from lacmesh.checks.rules import SEVERITIES
from lacmesh.facts import Described

Corner = tuple[float, float, float]


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

    def _title(self) -> str:
        counts = ", ".join(f"{len(self.of_severity(kind))} {kind}" for kind in ("error", "warning", "info"))
        return f"Findings: {counts}"

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


def collect(findings: list[Finding], figures: Mapping[str, Any]) -> Findings:
    """Sort the findings, errors first, and add the summary."""
    ranked = sorted(findings, key=lambda f: SEVERITIES.index(f.severity))
    counts = {severity: sum(f.severity == severity for f in findings) for severity in SEVERITIES}
    return Findings(tuple(ranked), {"ok": counts["error"] == 0, **counts, **figures})
