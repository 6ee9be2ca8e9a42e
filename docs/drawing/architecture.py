"""The drawing of the three packages: their folders in the order in which they import one another."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def tree() -> Iterator[str]:
    """Each package as a list of its folders and modules, the first stage on top; a later one may import an earlier one.

    The order is that of the import contracts in `pyproject.toml`, which a test holds the code to.
    """
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    layers = {one["containers"][0]: one["layers"] for one in contracts if one["type"] == "layers"}
    yield "```"
    for package in ("lacmesh", "lacsolver", "verification"):
        yield f"{package}/"
        for layer in reversed(layers[package]):
            for name in layer.split(" | "):
                yield from _stage(ROOT / package / name)
    yield "```"


def _stage(path: Path) -> Iterator[str]:
    """One line for a folder or a module: its name, how many modules it has, and the first line of its docstring."""
    if path.name == "__main__":
        return
    folder = path.is_dir()
    source = path / "__init__.py" if folder else path.with_suffix(".py")
    words = (ast.get_docstring(ast.parse(source.read_text(encoding="utf-8"))) or "").split("\n")[0]
    name = f"{path.name}/" if folder else f"{path.name}.py"
    count = f"{sum(1 for _ in path.rglob('*.py'))}" if folder else ""
    yield f"  {name:<14}{count:>3}  {words}"
