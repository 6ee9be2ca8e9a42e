"""Reference of the Python library, from docstrings: all that `dir(lacmesh)` and `dir(lacsolver)` list, and more."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from dataclasses import is_dataclass
from importlib import import_module
from types import ModuleType
from typing import Any

from web.markdown import of_docstring

#: the pages, and the modules that each describes
PAGES = {
    "lacmesh": ("lacmesh", "lacmesh.errors", "lacmesh.surface", "lacmesh.quality", "lacmesh.gmsh", "lacmesh.exchange"),
    "lacsolver": ("lacsolver", "lacsolver.errors", "lacsolver.contact.laws", "lacsolver.contact.friction"),
}


def page(package: str) -> str:
    """The page of a package."""
    lines = [f"# Python library: {package}", ""]
    for name in PAGES[package]:
        lines += _module(import_module(name))
    return "\n".join(lines)


def public(module: ModuleType) -> dict[str, Any]:
    """The functions and classes that a module offers, by name: those it lists, or else those it defines."""
    listed = getattr(module, "__all__", None) or [n for n in dir(module) if not n.startswith("_")]
    values = {name: getattr(module, name) for name in listed}
    ours = {n: v for n, v in values.items() if inspect.isclass(v) or inspect.isfunction(v)}
    package = module.__name__.split(".")[0]
    return {n: v for n, v in ours.items() if v.__module__.split(".")[0] == package}


def _module(module: ModuleType) -> Iterator[str]:
    yield from (f"## {module.__name__}", "", *of_docstring(module.__doc__ or ""))
    for name, value in public(module).items():
        yield from _described(f"### {module.__name__}.{name}", name, value)
        if inspect.isclass(value) and not issubclass(value, BaseException):
            yield from _members(value)


def _described(heading: str, name: str, value: Any) -> Iterator[str]:
    yield from (heading, "")
    if not (inspect.isclass(value) and issubclass(value, BaseException)):
        yield from ("```python", name + _signature(value), "```", "")
    yield from of_docstring(inspect.getdoc(value) or "")


def _signature(value: Any) -> str:
    """Arguments and what is returned; a line for each argument where there are many."""
    try:
        signature = inspect.signature(value)
    except (TypeError, ValueError):
        return ""
    line = _unquoted(signature)
    if len(line) < 90:
        return line
    _, _, answer = line.partition(") -> ")
    arguments = [_unquoted(p) for p in signature.parameters.values()]
    keywords = [k for k, p in enumerate(signature.parameters.values()) if p.kind is p.KEYWORD_ONLY]
    if keywords:
        arguments.insert(keywords[0], "*")
    end = f") -> {answer}" if answer else ")"
    return "(\n" + "".join(f"    {argument},\n" for argument in arguments) + end


def _unquoted(part: inspect.Signature | inspect.Parameter) -> str:
    """The text of a signature whose annotations are not evaluated: they are strings, whose quotes go."""
    return re.sub(r"(: |-> )'([^']*)'", r"\1\2", str(part))


def _members(value: type) -> Iterator[str]:
    """Methods and properties that the class defines itself, with their docstrings."""
    for name, member in vars(value).items():
        function = getattr(member, "__func__", getattr(member, "fget", getattr(member, "func", member)))
        written = inspect.isfunction(function) and function.__doc__ and function.__qualname__.startswith(value.__name__)
        if name.startswith("_") or not written or (is_dataclass(value) and name == "replace"):
            continue
        called = _signature(function).replace("(self, ", "(").replace("(self)", "()") if callable(member) else ""
        yield from (f"**`{name}`**{f' `{called}`' if called and len(called) < 90 else ''}", "")
        yield from of_docstring(function.__doc__ or "")
