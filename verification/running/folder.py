"""The folder of a run: a file for each case, as soon as it is done, and all results in one.

    results.json                version, suite, environment, results: the results of every case
    junit.xml                   the same for programs that watch tests
    cases/FAMILY/NAME.json      a case: what it is, its results, plots, names of its pictures
    cases/FAMILY/NAME-K.png     its pictures
    cases/FAMILY/NAME.log       what a case said that has no outcome
    report.html, report.md      made from these by `verification.report`

Numbers that are not finite are null in JSON. Every file is written beside and renamed.
"""

from __future__ import annotations

import json
import math
import types
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from itertools import count, takewhile
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from lacmesh import LacmeshError
from lacmesh.formats.output import replace_file
from verification.pages.charts import Plot
from verification.records import Case, Outcome, Result

#: of the files of a folder; a folder of another format is not resumed
FORMAT = 1
#: in a folder: the results of all cases
RESULTS = "results.json"


class FolderError(LacmeshError):
    """A folder that is not one of a run, or cannot be gone on with."""

    status = 3


@dataclass(frozen=True)
class StoredPicture:
    """A stored picture: `file` is its name beside the case's file."""

    title: str
    alt: str
    file: str


@dataclass(frozen=True)
class CaseResult:
    """Stored result of a case. `parameters`: what it is made of; `levels`: on how many meshes; `memory`: bytes.

    `failure`: why there is no outcome, in a sentence; it is empty where there is one. `sources`: a digest of the code.
    """

    family: str
    case: str
    description: str
    parameters: Mapping[str, Any]
    levels: int
    seconds: float
    memory: int
    results: tuple[Result, ...] = ()
    plots: tuple[Plot, ...] = ()
    pictures: tuple[StoredPicture, ...] = ()
    failure: str = ""
    sources: str = ""
    format: int = FORMAT

    @property
    def id(self) -> str:
        """`family/case`."""
        return f"{self.family}/{self.case}"

    @property
    def passed(self) -> bool:
        """True if there is an outcome and every result is met."""
        return not self.failure and all(result.passed for result in self.results)


@dataclass(frozen=True)
class Run:
    """All that a folder holds. `environment`: versions and the machine; `done`: by family, in the order of the cases.

    `seconds`: of the clock, all sessions together.
    """

    path: Path
    version: str
    suite: str
    environment: Mapping[str, str]
    seconds: float
    done: tuple[CaseResult, ...]


def write_case_result(
    case: Case, levels: int, seconds: float, memory: int, outcome: Outcome, path: Path, sources: str
) -> CaseResult:
    """Write the outcome of a case, or why there is none, into the folder of a run; return the stored result."""
    place = _place(path, case.family, case.name)
    place.parent.mkdir(parents=True, exist_ok=True)
    pictures = []
    for k, picture in enumerate(outcome.pictures):
        pictures.append(StoredPicture(picture.title, picture.alt, _picture(place, k).name))
        replace_file(_picture(place, k), picture.png)
    done = CaseResult(
        case.family, case.name, case.description, parameters_of(case), levels, seconds, memory,
        outcome.results, outcome.plots, tuple(pictures), outcome.failure, sources,
    )  # fmt: skip
    replace_file(place, _json(plain(done)))
    return done


def read_case_result(path: Path, family: str, name: str) -> CaseResult | None:
    """Read the outcome of a case from a folder; None if there is none that can be read."""
    try:
        stored = json.loads(_place(path, family, name).read_text(encoding="utf-8"))
        return None if stored.get("format") != FORMAT else made_of(CaseResult, stored)
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None


def forget(path: Path, family: str, name: str) -> None:
    """Remove what a folder has of a case."""
    place = _place(path, family, name)
    place.unlink(missing_ok=True)
    for picture in takewhile(Path.exists, (_picture(place, k) for k in count())):
        picture.unlink()


def sweep(path: Path) -> None:
    """Remove files that were being written when their process was killed; nothing else may be at work in the folder."""
    written = [path.glob(f".{name}-*") for name in ("results", "junit", "report")]
    for left in (*path.glob("cases/*/.*"), *(file for paths in written for file in paths)):
        with suppress(OSError):
            left.unlink()


def write_results(path: Path, run: Run) -> None:
    """Write `results.json`."""
    listed = [row for done in run.done for row in rows(done)]
    content = {
        "version": run.version,
        "environment": dict(run.environment),
        "suite": run.suite,
        "seconds": run.seconds,
        "results": listed,
    }
    replace_file(path / RESULTS, _json(content))


def rows(done: CaseResult) -> Iterator[dict[str, Any]]:
    """The results of a case as `results.json` has them; a case without an outcome is a result that fell short."""
    case = {"family": done.family, "case": done.case}
    results = done.results
    if done.failure:
        results = (Result("outcome", math.nan, None, None, False, "", done.failure, "informative"),)
    for result in results:
        yield {**case, **plain(result), "seconds": done.seconds}


def read_run(path: Path) -> Run:
    """Read the folder of a run. Raises FolderError, with what is wrong."""
    try:
        stored = json.loads((path / RESULTS).read_text(encoding="utf-8"))
        names = dict.fromkeys((row["family"], row["case"]) for row in stored["results"])
        outcomes = [read_case_result(path, *name) for name in names]
        missing = [f"{f}/{c}" for (f, c), done in zip(names, outcomes, strict=True) if done is None]
        if missing:
            raise FolderError(
                f"{path}: the file of case {missing[0]} is missing or damaged; run it again with --resume"
            )
        cases = tuple(done for done in outcomes if done is not None)
        return Run(path, stored["version"], stored["suite"], stored["environment"], stored["seconds"], cases)
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise FolderError(f"{path} is not the folder of a run ({error}); name one that `run -o` made") from error


def read_results(path: Path) -> Run:
    """Read a run from `results.json` alone: results, but neither plots nor the definitions of the cases.

    Raises FolderError.
    """
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        rows: dict[tuple[str, str], list[dict[str, Any]]] = {}
        for row in stored["results"]:
            rows.setdefault((row["family"], row["case"]), []).append(row)
        done = tuple(_case_of(*name, own) for name, own in rows.items())
        return Run(path.parent, stored["version"], stored["suite"], stored["environment"], stored["seconds"], done)
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise FolderError(f"{path} does not hold the results of a run ({error})") from error


def _case_of(family: str, case: str, listed: list[dict[str, Any]]) -> CaseResult:
    """A case from its rows: the inverse of `rows`."""
    own = ("family", "case", "seconds")
    results = tuple(made_of(Result, {k: v for k, v in row.items() if k not in own}) for row in listed)
    levels = max(len(result.levels) for result in results)
    failure = results[0].reason if results[0].quantity == "outcome" else ""
    return CaseResult(
        family, case, "", {}, max(levels, 1), listed[0]["seconds"], 0, () if failure else results, failure=failure
    )


def parameters_of(case: Case) -> dict[str, Any]:
    """Definition of a case, as JSON data."""
    parameters: dict[str, Any] = plain(case.parameters)
    return parameters


def plain(value: Any) -> Any:
    """A record as JSON has it. Raises TypeError for what JSON cannot have: what a case is made of must be data."""
    if isinstance(value, (np.generic, np.ndarray)):
        return plain(value.tolist())
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(own) for key, own in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(own) for own in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (str, int)):
        return value
    raise TypeError(f"{type(value).__name__} is no data: {value!r}")


def made_of(kind: Any, value: Any) -> Any:
    """A record of a kind from what JSON has: the inverse of `plain`."""
    if is_dataclass(kind):
        hints = _hints(kind)  # type: ignore[arg-type]
        return kind(**{name: made_of(hints[name], own) for name, own in value.items()})  # type: ignore[operator]
    if get_origin(kind) is tuple:
        return tuple(made_of(get_args(kind)[0], own) for own in value)
    if get_origin(kind) in (Union, types.UnionType):
        (own,) = (a for a in get_args(kind) if a is not type(None))
        return None if value is None else made_of(own, value)
    return math.nan if kind is float and value is None else float(value) if kind is float else value


@cache
def _hints(kind: type) -> dict[str, Any]:
    """The types of a record's fields, which are words until they are asked for."""
    return get_type_hints(kind)


def _json(value: Any) -> bytes:
    return (json.dumps(value, indent=1, allow_nan=False) + "\n").encode()


def _picture(place: Path, k: int) -> Path:
    return place.with_name(f"{place.stem}-{k}.png")


def _place(path: Path, family: str, name: str) -> Path:
    return path / "cases" / family / f"{name}.json"
