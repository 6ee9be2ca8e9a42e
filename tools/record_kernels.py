"""Make lacmesh/kernel_signatures.json again: what every kernel is called with, in the work of tests/kernels_to_try.py.

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

import numpy as np

from lacmesh.kernels import SIGNATURES, Kernel, compile_listed


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


def described(value: Any) -> Any:
    """Describe an argument, or a tuple of them, as text."""
    if isinstance(value, np.ndarray):
        layout = "C" if value.flags.c_contiguous else "F" if value.flags.f_contiguous else "A"
        return f"{value.dtype}[{value.ndim},{layout}{'' if value.flags.writeable else ',fixed'}]"
    if isinstance(value, tuple):
        fields, kind = [described(v) for v in value], type(value)
        return fields if kind is tuple else {f"{kind.__module__}.{kind.__qualname__}": fields}
    return str(value.dtype) if isinstance(value, np.generic) else type(value).__name__


def written(forms: dict[str, list[Any]]) -> str:
    """The text of the file, a kernel a line."""
    return "{\n" + ",\n".join(f"{json.dumps(key)}: {json.dumps(forms[key])}" for key in forms) + "\n}\n"


def main() -> None:
    """Record, compile to see how long each takes, and write."""
    with TemporaryDirectory() as folder:
        found = recorded(Path(folder))
    SIGNATURES.write_text(written(found))
    took = {}
    for key in found:
        start = time.process_time()
        compile_listed(key)
        took[key] = time.process_time() - start
    order = sorted(found, key=lambda key: -took[key])
    SIGNATURES.write_text(written({key: found[key] for key in order}))
    print(f"{sum(map(len, found.values()))} forms of {len(found)} kernels, compiled in {sum(took.values()):.0f} s:")
    for key in order:
        print(f"{took[key]:6.2f} s  {len(found[key])}  {key}")


if __name__ == "__main__":
    main()
