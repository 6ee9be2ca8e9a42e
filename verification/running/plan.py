"""The plan of a suite: its cases, the code that each depends on, and the order of their results."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from lacmesh.errors import GroupNotFoundError, RequestError
from verification import families
from verification.records import SUITES, Case
from verification.running.folder import CaseResult, parameters_of

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Planned:
    """A case to run on so many levels. `sources`: a digest of the code that it depends on."""

    case: Case
    levels: int
    sources: str

    def is_done(self, done: CaseResult | None) -> bool:
        """True if an outcome belongs to this very case (same problem, levels and code) and is no failure."""
        if done is None or done.failure:
            return False
        return (done.levels, done.parameters, done.sources) == (self.levels, parameters_of(self.case), self.sources)


def plan(suite: str, family: str | None = None, name: str | None = None) -> list[Planned]:
    """The cases of a suite, of one family, or one case; a case that is named is run though its suite has it not.

    `name`: of a case, or `family/name`. Raises GroupNotFoundError for names that there are not, and RequestError where
    the suite has no case of the family.
    """
    of, _, own = (name or "").rpartition("/")
    if family is not None and of not in ("", family):
        raise RequestError(f"case {name} is not of family {family}; leave --family out")
    names = _known(family or of)
    cases = _named(own, names) if name is not None else list(families.cases(suite, names))
    if not cases:
        raise RequestError(f"suite {suite} has no case of family {family}; try --suite {_first_suite(names)}")
    return [Planned(case, _levels(case, suite), sources(case.family)) for case in cases]


def suite_of(suite: str | None, family: str | None, default: str) -> str:
    """The suite that is asked for; else the default one, or the first that has cases of the family."""
    if suite or family not in families.MODULES or any(families.cases(default, (family,))):
        return suite or default
    return _first_suite((family,))


def in_order(finished: Iterable[CaseResult]) -> tuple[CaseResult, ...]:
    """By family, each in the order of its cases."""
    outcomes = list(finished)
    names = {done.family for done in outcomes}
    order = [case.id for case in families.cases(names=tuple(name for name in families.MODULES if name in names))]
    place = {name: k for k, name in enumerate(order)}
    return tuple(sorted(outcomes, key=lambda done: place.get(done.id, len(place))))


def _known(family: str) -> tuple[str, ...]:
    """Names of the requested family; all if none is named."""
    if family and family not in families.MODULES:
        raise GroupNotFoundError(family, families.MODULES, "family")
    return (family,) if family else tuple(families.MODULES)


def _named(name: str, names: tuple[str, ...]) -> list[Case]:
    everything = list(families.cases(names=names))
    named = [case for case in everything if name == case.name]
    if not named:
        raise GroupNotFoundError(name, [case.name for case in everything], "case")
    return named


def _levels(case: Case, suite: str) -> int:
    """Number of levels of a case in a suite, or in the next larger suite that has it."""
    return next(filter(None, (families.levels_in(case, name) for name in SUITES[SUITES.index(suite) :])))


def _first_suite(names: tuple[str, ...]) -> str:
    return next(suite for suite in SUITES if any(families.cases(suite, names)))


@cache
def sources(family: str) -> str:
    """A digest of lacmesh, lacsolver and the modules of the harness that a family is made of."""
    digest = hashlib.sha256()
    start = f"verification.families.{families.MODULES[family]}"
    ours = sorted(_imported(start, set()))
    paths = [*sorted((ROOT / "lacmesh").rglob("*.py")), *sorted((ROOT / "lacsolver").rglob("*.py"))]
    for path in (*paths, *map(_path, ours)):
        digest.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def _imported(module: str, known: set[str]) -> set[str]:
    """Modules of the harness that a module imports, directly or not, and itself."""
    known.add(module)
    for name in set(_names(ast.parse(_path(module).read_text(encoding="utf-8")))) - known:
        _imported(name, known)
    return known


def _names(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "verification":
            inside = [f"{node.module}.{a.name}" for a in node.names]
            yield from (name for name in (node.module, *inside) if _path(name).is_file())


def _path(module: str) -> Path:
    place = ROOT.joinpath(*module.split("."))
    return place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
