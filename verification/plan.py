"""The plan of a run: its cases, and on how many meshes."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

from lacmesh.errors import GroupNotFoundError, RequestError
from verification import families
from verification.records import SUITES, Case

ROOT = Path(__file__).resolve().parents[1]
#: parts of this package that no result depends on
_AROUND = ("cli", "report", "charts", "comparison", "running", "conftest", "plan")


def plan(suite: str, family: str | None = None, name: str | None = None) -> list[tuple[Case, int]]:
    """The cases of a suite, of one family, or one case, each with its number of meshes (levels).

    `name`: of a case, or `family/name`; such a case is in the plan though the suite is without it. Raises
    GroupNotFoundError for an unknown name, and RequestError where the suite has no case of the family.
    """
    of, _, own = (name or "").rpartition("/")
    if family is not None and of not in ("", family):
        raise RequestError(f"case {name} is not of family {family}; leave --family out")
    family = family or of
    if family and family not in families.MODULES:
        raise GroupNotFoundError(family, families.MODULES, "family")
    names = (family,) if family else tuple(families.MODULES)
    cases = list(families.cases(suite if name is None else SUITES[-1], names))
    if name is not None:
        known, cases = [case.name for case in cases], [case for case in cases if case.name == own]
        if not cases:
            raise GroupNotFoundError(own, known, "case")
    if not cases:
        raise RequestError(f"suite {suite} has no case of family {family}; try --suite {_first_suite(family)}")
    larger = SUITES[SUITES.index(suite) :]
    return [(case, next(filter(None, (families.levels_in(case, one) for one in larger)))) for case in cases]


def suite_of(suite: str | None, family: str | None, default: str) -> str:
    """The requested suite; without a request the default one, or the first that has cases of the family."""
    if suite or family not in families.MODULES or any(families.cases(default, (family,))):
        return suite or default
    return _first_suite(family)


def _first_suite(family: str) -> str:
    return next(suite for suite in SUITES if any(families.cases(suite, (family,))))


@cache
def sources() -> str:
    """A digest of the code that results depend on: lacmesh, lacsolver, and this package without its reports."""
    digest = hashlib.sha256()
    around = [ROOT / "verification" / name for name in _AROUND]
    for package in ("lacmesh", "lacsolver", "verification"):
        for path in sorted((ROOT / package).rglob("*.py")):
            if not {path.with_suffix(""), path.parent} & set(around):
                digest.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]
