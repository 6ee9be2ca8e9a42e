"""Sentences for `read` about a file that is no case, and about a line that is no TOML: what is it, what was meant?"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from lacmesh.errors import ReadError

#: how a case begins, for a mesh of some name
_BEGINS = (
    'a case is a text file, .toml, that begins with mesh = "{}" and model = "3d", and has a [[material]], a '
    "[[contact]] and what holds and loads the bodies: lacsolver schema lists its keys, lacsolver validate checks it"
)
_NUMBER = re.compile(r"([+-]?)(\d*)(\.?)(\d*)(?:[eEdD]([+-]?\d+))?\.?")


def other_than_case(path: Path) -> str:
    """Return what a folder, a mesh, an empty or a binary file is instead of a case; "" if it may be a case."""
    if path.is_dir():
        if (path / "results.json").exists() or (path / "history.csv").exists():
            return f"is a folder of results, not a case; give the case file, and --restart {path} to continue"
        cases = sorted(file.name for file in path.glob("*.toml"))[:3]
        return f"is a folder, not a case{'; it has ' + ', '.join(cases) if cases else ''}"
    from lacmesh.formats.registry import HEAD, sniff  # with numpy, which reading a case does not need

    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError:
        return ""
    if not head.strip():
        return f"is empty; {_BEGINS.format('bodies.msh')}"
    try:
        format = sniff(path, head).format
    except ReadError:
        format = ""
    if format == "inp":
        return (
            f"is a deck or mesh of CalculiX or Abaqus, and not a case; lacsolver import {path.name} makes a case of it"
        )
    if format:
        return (
            f"is a mesh ({format}), and not a case; lacsolver new {path.name} writes a first case for it: "
            f"{_BEGINS.format(path.name)}"
        )
    return f"is a binary file, not a case; {_BEGINS.format('bodies.msh')}" if b"\0" in head else ""


def meant(line: str) -> str:
    """Return what to write for a line that is no TOML, such as `young = 1000.` or `slave = arc`; "" for other lines."""
    parts = re.fullmatch(r"\s*([\w.-]+)\s*=\s*(.*?)\s*", re.sub(r"#[^\"']*$", "", line))
    if parts is None:
        return ""
    key, value = parts[1], parts[2]
    if re.fullmatch(r"[+-]?\d+(,\d+)+(\.\d*)?", value):
        thousands = re.fullmatch(r"[+-]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?", value)  # 2,000 may be either, 2000,0 not
        ways = [value.replace(",", "")] if thousands else []
        ways += [value.replace(",", ".")] if value.count(",") == 1 and "." not in value else []
        if ways:
            return f"{key} = {value} has a comma, which numbers in TOML do not have; write {' or '.join(ways)}"
    if re.fullmatch(r"[.~]*/?[A-Za-z_][\w./\\ -]*", value):
        return _word(key, value)
    if "\\" in value and value.startswith('"'):
        return f"{key}: a backslash in double quotes begins a code such as \\n; write / in a path, or single quotes"
    for number in re.findall(
        r"(?<![\w.\"'])[+-]?[\d.][\w.]*(?:(?<=[eEdD])[+-]\d+\.?)?", re.sub(r"\"[^\"]*\"|'[^']*'", "", value)
    ):
        if not _is_toml(number) and (right := _number(number)):
            return (
                f"{key}: {number} is not a number in TOML, which needs digits before and after the point; write {right}"
            )
    return ""


def _word(key: str, word: str) -> str:
    """Return what to write for text without quotes."""
    if word.lower() in ("true", "false"):
        return f"{key} = {word} is not TOML; write {key} = {word.lower()}"
    if word.lower() in ("none", "null"):
        return f"{key} = {word} is not TOML; remove the key"
    return f'{key} = {word} is text without quotes; write {key} = "{word}"'


def _is_toml(number: str) -> bool:
    try:
        tomllib.loads(f"x = {number}")
    except ValueError:
        return False
    return True


def _number(text: str) -> str:
    """Return a number as TOML writes it, "" for what is none.

    >>> [_number(text) for text in ("1000.", "+.5", "1e3.", "2.1D5", "007", "1.2.3", ".")]
    ['1000.0', '+0.5', '1e3', '2.1e5', '7', '', '']
    """
    match = _NUMBER.fullmatch(text)
    if match is None or not (match[2] or match[4]):
        return ""
    sign, whole, point, rest, power = match.groups()
    digits = whole.lstrip("0") or "0"
    point = point or ("" if power or not text.endswith(".") else ".")
    return f"{sign}{digits}{'.' + (rest or '0') if point else ''}{'e' + power if power else ''}"
