"""Programs in several processes of `mpiexec`, on as many cores as there are."""

from __future__ import annotations

import subprocess

from verification.mpiexec import ROOT, environment
from verification.mpiexec import words as words_of

__all__ = ["ROOT", "environment", "in_ranks", "own_lines", "words"]


def words(n, code, *arguments):
    """The words of a command that runs some code in n processes."""
    return words_of(n, "-c", code, *arguments)


def in_ranks(n, code, *arguments, timeout=60, **more):
    """Run some code in n processes, to their end; a hang is an error."""
    return subprocess.run(
        words(n, code, *arguments),
        env=environment(**more),
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def own_lines(text):
    """Lines of lacsolver in a text to which mpiexec adds its own."""
    return [line for line in text.splitlines() if line.startswith("lacsolver: ")]
