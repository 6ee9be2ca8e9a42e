"""One case in a process of its own: `python -m verification.running.worker FAMILY CASE LEVELS FOLDER`.

Its outcome, or the error that stopped it, goes into the folder; the traceback goes to standard error.
"""

from __future__ import annotations

import os
import sys
import threading
import time
import traceback
from pathlib import Path

from lacmesh.threads import peak_memory
from verification import families
from verification.records import Case, Outcome
from verification.running.folder import write_case_result
from verification.running.plan import sources

#: seconds between two looks whether the run is still there
_PAUSE = 1.0


def main(family: str, name: str, levels: int, folder: Path) -> None:
    """Solve a case and keep what it yields."""
    code = sources(family)
    (case,) = (case for case in families.family(family).cases if case.name == name)
    began = time.perf_counter()
    outcome = _solved(case, levels)
    write_case_result(case, levels, time.perf_counter() - began, peak_memory(), outcome, folder, code)


def _solved(case: Case, levels: int) -> Outcome:
    """Solve a case and return its outcome, or the reason why there is none."""
    try:
        outcome = case.solve(levels=levels)
    except Exception as error:  # whatever it is, it is this case's alone
        traceback.print_exc()
        return Outcome(failure=f"{type(error).__name__}: {error}".removesuffix(": "))
    return outcome if outcome.results else Outcome(failure="there is no result")


def end_with(parent: int) -> None:
    """End this process soon after its parent, however that ends."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_PAUSE)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


if __name__ == "__main__":
    end_with(os.getppid())
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]), Path(sys.argv[4]))
