"""Make lacmesh/kernels/signatures.json again: what every kernel is called with, in the work of tests/kernels_to_try.py.

    python -m tools.record_kernels

After a kernel's arguments have changed, or there is a new one. What takes longest to compile comes first.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from lacmesh.kernels import Kernel
from lacmesh.kernels.signatures import FILE, Signature, compile_signature, described


def as_it_stands(kernel: Kernel, *arguments: Any) -> Any:
    """Run a kernel as Python."""
    return kernel.py_func(*arguments)


def recorded(folder: Path, how: Callable[..., Any] = as_it_stands) -> dict[str, list[Any]]:
    """Record the forms of the arguments with which each kernel is called; `how` runs a kernel on its arguments."""
    from tests.kernels_to_try import work

    found: dict[str, list[Any]] = {}
    before = Kernel.dispatch

    def call(self: Kernel, *arguments: Any) -> Any:
        forms = found.setdefault(f"{self.__module__}.{self.__qualname__}", [])
        form = described(arguments)
        if form not in forms:
            forms.append(form)
        return how(self, *arguments)

    Kernel.dispatch = call  # type: ignore[method-assign]
    try:
        for _, run in work(folder):
            run()
    finally:
        Kernel.dispatch = before  # type: ignore[method-assign]
    return found


def main() -> None:
    """Record, compile to see how long each takes, and write."""
    with TemporaryDirectory() as folder:
        found = recorded(Path(folder))
    took = {}
    for key, forms in found.items():
        start = time.process_time()
        for form in forms:
            compile_signature(Signature.of(key, form))
        took[key] = time.process_time() - start
    order = sorted(found, key=lambda key: -took[key])
    lines = ",\n".join(f"{json.dumps(key)}: {json.dumps(found[key])}" for key in order)
    FILE.write_text("{\n" + lines + "\n}\n")
    print(f"{sum(map(len, found.values()))} forms of {len(found)} kernels, compiled in {sum(took.values()):.0f} s:")
    for key in order:
        print(f"{took[key]:6.2f} s  {len(found[key])}  {key}")


if __name__ == "__main__":
    main()
