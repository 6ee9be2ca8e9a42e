"""The text of a case file: values and sections in TOML."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from pathlib import PurePath
from typing import Any

from lacmesh.errors import RequestError
from lacsolver.case.formula import Formula
from lacsolver.case.value import Value


def section_text(header: str, keys: Mapping[str, Any], comment: Iterable[str] = ()) -> str:
    r"""Return the text of a section, or of the top of a file for an empty header.

    >>> section_text("[[force]]", {"group": "top", "fz": -2.0}, ["pushes"])
    '# pushes\n[[force]]\ngroup = "top"\nfz = -2.0\n'
    """
    lines = [*(f"# {line}" for line in comment), *([header] if header else [])]
    return "\n".join([*lines, *(f"{name} = {written(value)}" for name, value in keys.items())]) + "\n"


def written(value: Any) -> str:
    r"""Return a value as TOML. Raises RequestError for a Python function, which a file cannot hold.

    >>> written([[0, 1.5], [1.0, 2e-9]]), written(True), written('a "b"\n'), written({"a": 1.0, "b.c": 2})
    ('[[0, 1.5], [1.0, 2e-09]]', 'true', '"a \\"b\\"\\n"', '{ a = 1.0, "b.c" = 2 }')
    """
    if isinstance(value, Value):
        return written(value.source)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (str, PurePath, Formula)):
        text = value.text if isinstance(value, Formula) else value.as_posix() if isinstance(value, PurePath) else value
        return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, tuple) and len(value) == 1 and isinstance(value[0], Value):
        return written(value[0])  # a rotation or a moment in a plane
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(written, value))}]"
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_key(name)} = {written(one)}' for name, one in value.items())} }}"
    if callable(value):
        name = getattr(value, "__qualname__", type(value).__name__)
        raise RequestError(f"the Python function {name} cannot be written into a case file; give a formula as text")
    return repr(value)


def _key(name: str) -> str:
    """Return the name of an entry as TOML: bare where it may be."""
    return name if re.fullmatch("[A-Za-z0-9_-]+", name) else written(name)
