"""Rules of the check and their findings: a rule is a function that yields places, each with a sentence about it.

`docs/check.md` lists the rules; the docstring of the function says what a finding of the rule means.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple, TypeVar

from lacmesh.facts import Described
from lacmesh.mesh import Ints

SEVERITIES = ("error", "warning", "info")

Corner = tuple[float, float, float]
Function = TypeVar("Function", bound=Callable[..., Any])


class Place(NamedTuple):
    """Cells or nodes, by their indices, about which a rule has something to say, and the group that they are in.

    `advice`: what to do, None for the rule's own; it ends the sentence of an error or a warning.
    """

    message: str
    cells: Ints | None = None
    nodes: Ints | None = None
    group: str | None = None
    advice: str | None = None


class Rule(NamedTuple):
    """A rule: `severity` (error, warning, info), what it `means`, what to do (`advice`), and its functions.

    Each of the `functions` has a scope: "mesh", all slaves at once; "group", the groups of each skin; "skin", the faces
    of each skin, and "slave", those of the slave, if it has some; "pair", a slave with its master; "skin of pair".
    A function of (request) or, for groups and skins, of (request, skin) yields places, and dicts: figures of the
    summary.
    """

    severity: str
    means: str
    advice: str
    functions: list[tuple[str, Callable[..., Any]]]


#: all rules by their names, in the order of their findings; the modules of this package fill it
RULES: dict[str, Rule] = {}


def rule(name: str, severity: str = "", advice: str = "", scope: str = "mesh") -> Callable[[Function], Function]:
    """Declare the function of a rule, whose docstring says what it means; further functions give name and scope."""

    def declare(function: Function) -> Function:
        if severity:
            means = " ".join((function.__doc__ or "").split()).rstrip(".")
            RULES[name] = Rule(severity, means[:1].lower() + means[1:], advice, [])
        RULES[name].functions.append((scope, function))
        return function

    return declare


def named(message: str, rule: str) -> str:
    """Return the message of another program about what a rule of the check finds, with the name of the rule.

    >>> named("master 'top' is in front of 30 % of slave 'low'", "partial-coverage")
    "master 'top' is in front of 30 % of slave 'low' (lacmesh check: partial-coverage)"
    """
    return f"{message} (lacmesh check: {rule})"


@dataclass(frozen=True)
class Where:
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
        plain = asdict(self)
        if self.where.pair is None:
            del plain["where"]["pair"]
        return plain


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
