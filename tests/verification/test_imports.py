"""The harness is a user: it sees of lacmesh and lacsolver what these export."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import lacmesh
import lacsolver

MODULES = sorted((Path(__file__).resolve().parents[2] / "verification").rglob("*.py"))
#: whole modules that are for users
FOR_USERS = dict.fromkeys(("lacmesh.reference.quadrature", "lacmesh.reference.shapes"))
#: what commands of the project are made of: how they read arguments, print, fail, and write files
COMMANDS = dict.fromkeys(
    ("lacmesh.cli.program", "lacmesh.cli.options", "lacmesh.cli.terminal", "lacmesh.errors", "lacmesh.formats.output")
)
#: stages for users who take one and replace another: the names that were once public in the package itself
STAGES = {(module, name) for package in (lacmesh, lacsolver) for name, module in package._MOVED.items()}
EXPORTED = {"lacmesh": lacmesh, "lacsolver": lacsolver, **FOR_USERS, **COMMANDS}


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.stem)
def test_only_what_is_exported_is_used(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            assert {a.name for a in node.names if a.name.startswith("lac")} <= set(EXPORTED)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("lac"):
            names = {a.name for a in node.names if (node.module, a.name) not in STAGES}
            package = EXPORTED[node.module] if names else None
            assert package is None or names <= {*package.__all__, "__version__"}
        elif isinstance(node, ast.Attribute) and ast.unparse(node.value) in ("lacmesh", "lacsolver"):
            assert node.attr in (*EXPORTED[ast.unparse(node.value)].__all__, "__version__")


def test_there_are_modules_to_look_at():
    assert {"sources", "blocks", "norms", "manufactured"} <= {path.stem for path in MODULES}
