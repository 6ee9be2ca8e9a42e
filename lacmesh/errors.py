"""Errors and warnings of lacmesh, one class for each way to react; a message is one sentence: what, where, what to try.

Each class carries the exit status of the command (docs/conventions.md lists them). Sentences for all messages, too.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any


class LacmeshError(Exception):
    """Root of every error that lacmesh raises for wrong data, a wrong request or a file it cannot use.

    >>> from lacmesh import read
    >>> try:
    ...     read("missing.msh")
    ... except LacmeshError as error:
    ...     print(error, error.status)
    missing.msh: cannot be read (No such file or directory) 3
    """

    status = 1


class LacmeshWarning(UserWarning):
    """Warning: something was left out or looks wrong, but the work went on.

    >>> import warnings
    >>> from lacmesh import read
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", LacmeshWarning)  # stop where something is left out
    ...     mesh = read("data/two_blocks.msh")
    """


class DataError(LacmeshError):
    """The mesh does not allow the requested operation; `cells` holds the ids in the file of the cells at fault."""

    def __init__(self, message: str, cells: Iterable[int] = ()) -> None:
        super().__init__(message)
        self.cells = tuple(int(c) for c in cells)


class CutError(DataError):
    """The slave skin cannot be cut; `cells` holds the file's numbers of the faces or cells concerned."""


class RequestError(LacmeshError):
    """The request itself is wrong: an option, or a group that the file lacks."""

    status = 2


class GroupNotFoundError(RequestError):
    """The mesh lacks the group `name`; the message names near matches and ends with `hint`.

    >>> GroupNotFoundError("slav", ["slave", "master"])
    GroupNotFoundError("no cell group named 'slav'; did you mean slave?")
    """

    def __init__(self, name: str, known: Iterable[str], what: str = "cell group", hint: str = "") -> None:
        super().__init__(f"no {what} named {name!r}{did_you_mean(name, known)}{hint}")


class FileError(LacmeshError):
    """A file that cannot be used; `path` and `place` (a line, a byte, a path inside the file) say where.

    `reason`: the message without these.

    >>> ReadError("part.msh", "is cut short", "line 7")
    ReadError('part.msh, line 7: is cut short')
    """

    status = 3

    def __init__(self, path: Any, reason: str, place: str | None = None) -> None:
        self.path, self.reason, self.place = str(path), reason, place
        super().__init__(f"{self.path}{'' if place is None else f', {place}'}: {reason}")


class ReadError(FileError):
    """A file that cannot be read."""


class WriteError(FileError):
    """A file that cannot be written, or a mesh that the format cannot hold; nothing was left behind."""


@contextmanager
def reading(path: Any) -> Iterator[None]:
    """Turn an error of the operating system in this context into a ReadError about a path."""
    try:
        yield
    except OSError as error:
        raise ReadError(path, f"cannot be read ({error.strerror or error})") from error


@contextmanager
def writing(path: Any, failed: str = "cannot be written") -> Iterator[None]:
    """Turn an error of the operating system in this context into a WriteError about a path, in the words `failed`."""
    try:
        yield
    except OSError as error:
        raise WriteError(path, f"{failed} ({error.strerror or error})") from error


def check_installed(package: str, extra: str, what: str = "this") -> None:
    """Raise RequestError where a package of the extra `extra` is missing, which `what` needs."""
    if find_spec(package) is None:
        raise RequestError(f"{what} needs {package}; pip install 'lacmesh[{extra}]' brings it")


def on_page(name: str) -> str:
    """The command that opens a page of the documentation, for messages; the pages come with the packages.

    >>> on_page("solver")
    '`lacsolver docs solver`'
    """
    return f"`lacsolver docs {name}`"


def did_you_mean(name: str, known: Iterable[str], limit: int = 8) -> str:
    """Return the end of a sentence: near matches of `name`, or the first few known names.

    >>> did_you_mean("slav", ["slave", "master"])
    '; did you mean slave?'
    >>> did_you_mean("x", ["slave", "master"])
    '; there are: master, slave'
    >>> did_you_mean("x", [])
    '; there are none'
    """
    names = sorted(set(known))
    if not names:
        return "; there are none"
    lower = {n.lower(): n for n in reversed(names)}
    likeness = {n: difflib.SequenceMatcher(None, name.lower(), n).ratio() for n in lower}
    near = [lower[n] for n in sorted(lower, key=lambda n: (-likeness[n], n)) if likeness[n] >= 0.6][:3]
    if near:
        return f"; did you mean {' or '.join(near)}?"
    more = f" and {len(names) - limit} more" if len(names) > limit else ""
    return f"; there are: {', '.join(names[:limit])}{more}"


def some(numbers: Iterable[int], limit: int = 10) -> str:
    """Format the first few numbers of a list for a message.

    >>> some(range(3)), some(range(12), limit=3)
    ('0, 1, 2', '0, 1, 2 and 9 more')
    """
    listed = [str(int(n)) for n in numbers]
    more = f" and {len(listed) - limit} more" if len(listed) > limit else ""
    return ", ".join(listed[:limit]) + more


def listed(names: Sequence[str], last: str) -> str:
    """Join names for a sentence; `last`: the word before the last name.

    >>> listed(["msh", "VTU", "XDMF"], "and"), listed(["msh"], "or")
    ('msh, VTU and XDMF', 'msh')
    """
    return f" {last} ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def counted(n: int, one: str, many: str | None = None) -> str:
    """Format a count and its noun for a sentence, in the singular or the plural.

    >>> counted(1, "face turns", "faces turn"), counted(2000, "node")
    ('1 face turns', '2,000 nodes')
    """
    return f"{n:,} {one if n == 1 else many or one + 's'}"
