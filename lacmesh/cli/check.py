"""`lacmesh check`: test whether a mesh will work with the LAC method, and report where it will not."""

from __future__ import annotations

import argparse
import sys
import warnings
from typing import TYPE_CHECKING, Any

from lacmesh.cli.options import (
    add_command,
    add_facing_options,
    add_mesh_option,
    add_recognition_options,
    add_skin_options,
    check_skins,
    facing_options,
    sides,
    skins,
)
from lacmesh.cli.terminal import Stages, as_json, console, table
from lacmesh.errors import DataError, LacmeshWarning

if TYPE_CHECKING:
    from lacmesh.checks import Finding, Findings

_STYLE = {"error": "bold red", "warning": "yellow", "info": "dim"}


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "check",
        run,
        "check whether a mesh is usable for LAC, and where not; exit status 1 if any finding is an error",
    )
    parser.add_argument("input", metavar="IN", help="mesh, cut or not")
    add_skin_options(parser, "slave skin", "master skin")
    add_facing_options(parser)
    add_recognition_options(parser)
    parser.add_argument("--json", action="store_true", help="one JSON object: {findings, summary}")
    add_mesh_option(parser)


def run(args: argparse.Namespace) -> None:
    """Check a file; raises DataError (status 1) where a finding is an error."""
    check_skins(args)
    from lacmesh.formats import read
    from lacmesh.origin import size_of

    stage = Stages(args, ("read", "check"))
    with stage("read"):
        mesh = read(args.input, mesh=args.mesh)
    with stage("check"):
        from lacmesh.checks import check

        findings = check(mesh, **sides(skins(mesh, args)), recognise=args.recognise, **facing_options(args))
    if args.json:
        print(as_json(findings.as_dict()))
    elif not args.quiet:
        _print_findings(findings, size_of(mesh))
        print(f"{args.input}: {stage.spent()}")
    else:
        warn_of(findings)
    sys.stdout.flush()
    if findings.errors:
        rules = ", ".join(dict.fromkeys(f.rule for f in findings.errors))
        raise DataError(f"{args.input} is not usable for LAC: {_count(findings, 'error')} ({rules})")


def warn_of(findings: Findings) -> None:
    """Issue the findings of severity warning as warnings of the command."""
    for finding in findings.warnings:
        warnings.warn(f"{finding.rule}: {finding.message}", LacmeshWarning, stacklevel=1)


def _count(findings: Findings, severity: str) -> str:
    n = len(findings.of_severity(severity))
    return f"{n} {severity}{'' if n == 1 else 's'}"


def _print_findings(findings: Findings, size: float) -> None:
    from rich.text import Text

    out = console()
    if findings.findings:
        rows = table("finding", "rule", "what, where, what to do")
        for column in rows.columns[:2]:
            column.no_wrap = True
        for f in findings:
            rows.add_row(Text(f.severity, _STYLE[f.severity]), f.rule, _sentence(f, size))
        out.print(rows)
    rows = table("summary", "")
    for name, value in _figures(findings.summary):
        rows.add_row(name, value)
    out.print(rows)
    verdict = _count(findings, "error") if findings.errors else "no errors"
    print(f"{verdict}, {_count(findings, 'warning')}" + (", not cut yet" if findings.of_rule("not-cut") else ""))


def _sentence(f: Finding, size: float) -> str:
    """Message of a finding, with its group and its box; `size` of the mesh sets the digits."""
    from lacmesh.origin import told

    places = [f"in {f.where.group}"] if f.where.group and not f.where.pair else []
    if f.where.box and f.severity != "info":
        axes = zip("xyz", *(told(corner, size) for corner in f.where.box), strict=True)
        places.append(", ".join(f"{a} {lo}" if lo == hi else f"{a} {lo} to {hi}" for a, lo, hi in axes))
    return f"{f.message} [{'; '.join(places)}]" if places else f.message


def _figures(s: Any) -> list[tuple[str, str]]:
    """Rows (name, value) of the check's summary, for people."""
    rows = [
        (what, f"{s[f'{what}_faces']:,} faces in {', '.join(s[what])}") for what in ("slave", "master") if what in s
    ]
    if "macro_elements" in s:
        macros, inside, free = s["macro_elements"], s["with_internal_dof"], s["with_free_internal_dof"]
        text = f"{inside:,} of {macros:,}" + (f", {free:,} of them free" if free != inside else "")
        rows.append(("macro-elements with an internal dof", text))
    if s.get("shapes"):
        from lacmesh.smooth.fitted import in_words

        rows += [(f"shape of {group}", in_words(shapes)) for group, shapes in s["shapes"].items()]
    if "bodies" in s:
        rows.append(("bodies", f"{s['bodies']:,}"))
    if "worst_quality" in s:
        rows.append(("worst scaled Jacobian", f"{s['worst_quality']:.3f}"))
    rows += _facing_rows(s)
    for pair in s.get("pairs", ()):
        rows.append(("pair", f"{pair['slave']} on {pair['master']}"))
        rows += _facing_rows(pair)
    return rows


def _facing_rows(s: Any) -> list[tuple[str, str]]:
    """Rows (name, value) of the gap and the coverage of a pair."""
    if "gap" not in s:
        return []
    whole, part, none = (s[f"{k}_macro_elements"] for k in ("covered", "partly_covered", "uncovered"))
    text = f"{100 * s['covered']:.4g} % of the slave; macro-elements: {whole:,} whole, {part:,} in part, {none:,} not"
    return [
        ("gap: least, mean, largest", ", ".join(f"{s['gap'][k]:.6g}" for k in ("min", "mean", "max"))),
        ("covered by the master", text),
    ]
