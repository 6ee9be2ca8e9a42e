"""The command `python -m verification`: its commands are the functions of `commands`."""

from __future__ import annotations

from lacmesh.cli.program import Program
from verification.cli.commands import compare, list_, report, run_command

EPILOG = """\
Exit status: 0 every result is met, 1 some are missed, 2 the command is wrong,
3 a file cannot be read or written, 130 interrupted, 143 terminated."""

PROGRAM = Program(
    "verification",
    "Compare lacsolver with known solutions, case by case.",
    EPILOG,
    (list_, run_command, report, compare),
    too_large="there is not enough memory; run fewer processes at once (-j 1)",
)
#: runs the command and returns its exit status
main = PROGRAM.main
