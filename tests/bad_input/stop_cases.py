"""A command that is stopped by SIGINT or SIGTERM, wherever it is; each in a process of its own."""

from __future__ import annotations

import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from tests.bad_input.case import PRECIOUS, Outcome, listing
from tests.bad_input.command_cases import GOOD

_WAIT = "print('now', flush=True); time.sleep({})"
_RUN = "from lacmesh.__main__ import main; sys.exit(main())"
#: Where the command waits for its signal -> what is run instead of `lacmesh`.
STAGES = {
    "while Python loads the command": f"""
class Slow:
    def find_spec(self, name, *rest):
        if name == 'lacmesh.cli.options': {_WAIT.format(30)}
sys.meta_path.insert(0, Slow())
{_RUN}""",
    "while the file is read": f"""
import lacmesh.formats.msh as at
def slow(*given, **more): {_WAIT.format(30)}
at.read = slow
{_RUN}""",
    "while the mesh is cut": f"""
import lacmesh.cut as at
def slow(*given, **more): {_WAIT.format(30)}
at.cut_skin = slow
{_RUN}""",
    "while a msh file is written": f"""
import lacmesh.formats.msh as at
def slow(path, *given, **more):
    path.write_bytes(b'half of it')
    {_WAIT.format(30)}
at.write = slow
{_RUN}""",
    "while HDF5 writes a MED file": f"""
import lacmesh.formats.med_notes as at
def slow(*given, **more): {_WAIT.format(1)}
at.write = slow
{_RUN}""",
    "before the new file takes its place": f"""
import lacmesh.formats as at
def slow(*given, **more): {_WAIT.format(30)}
at._settle = slow
{_RUN}""",
    "when the new file is there": f"""
import lacmesh.cli.cut as at
def slow(*given, **more): {_WAIT.format(30)}
at._print_summary = slow
{_RUN}""",
}


@dataclass(frozen=True)
class Stop:
    """A signal at a stage."""

    what: str
    number: signal.Signals

    kind = "stopped"
    format = "any"

    @property
    def key(self) -> str:
        """A name for the case, as in the page."""
        return f"stopped: {self.number.name} {self.what}"

    @property
    def status(self) -> int:
        """What a shell calls the status of a process that the signal ends."""
        return 128 + self.number

    @property
    def says(self) -> str:
        """The words that are expected."""
        word = "interrupted" if self.number == signal.SIGINT else "terminated"
        there = "was written before that" if self.what == "when the new file is there" else "nothing was written"
        return f"{word}; (out.msh )?{there}"


def run(stop: Stop, folder: Path) -> Outcome:
    """Start the command, send the signal where it waits, and see that the folder is as it was."""
    out = "out.med" if "MED" in stop.what else "out.msh"
    (folder / "bad.msh").write_bytes(GOOD)
    (folder / out).write_bytes(PRECIOUS)
    before = listing(folder)
    code = f"import sys, time\nsys.argv = ['lacmesh', *sys.argv[1:]]{STAGES[stop.what]}"
    args = [sys.executable, "-c", code, "cut", "bad.msh", "--slave", "SLAVE", "-o", out, "--force"]
    with subprocess.Popen(args, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder) as child:
        assert child.stdout is not None
        if child.stdout.readline() != "now\n":
            raise AssertionError(child.communicate())
        child.send_signal(stop.number)
        _, said = child.communicate(timeout=20)
    after = listing(folder)
    if stop.what == "when the new file is there":
        assert after.keys() == before.keys() and after["out.msh"] != PRECIOUS
    else:
        assert after == before
    return Outcome(child.returncode, said.splitlines(), 0.0)


def cases() -> list[Stop]:
    """Both signals at every stage; before the command is loaded SIGTERM is left to the system."""
    return [
        Stop(what, number)
        for what in STAGES
        for number in (signal.SIGINT, signal.SIGTERM)
        if (what, number) != ("while Python loads the command", signal.SIGTERM)
    ]
