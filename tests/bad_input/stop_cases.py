"""A command that is stopped by SIGINT or SIGTERM, wherever it is; each in a process of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from tests.bad_input.case import PRECIOUS, Outcome, listing
from tests.bad_input.command_cases import GOOD

_CUT = ("cut", "in.msh", "--slave", "SLAVE", "--force", "-o")
#: What is run instead of `lacmesh`; {} makes the command wait at its stage.
_RUN = """
import sys, time
sys.argv = ["lacmesh", *sys.argv[1:]]
def wait(seconds=120):
    print("now", flush=True)
    for _ in range(100 * seconds):  # in short steps: a signal that comes just before one is seen after it
        time.sleep(0.01)
{}
from lacmesh.__main__ import main
sys.exit(main())
"""


@dataclass(frozen=True)
class Stage:
    """Stage at which a command is stopped: `at` runs the code `first`, waits for `lasts` seconds, and goes on.

    A stage that lasts one second is not stopped in the middle. `written`: the output exists afterwards. `when`: a
    condition on the calls of `at`; the others do not wait.
    """

    what: str
    at: str
    command: tuple[str, ...] = (*_CUT, "out.msh")
    first: str = "pass"
    lasts: float = 120
    written: bool = False
    when: str = "True"

    def code(self) -> str:
        """Python code that makes the function wait."""
        module, _, name = self.at.rpartition(".")
        return f"""
import {module} as at
real = at.{name}
def slow(*given, **more):
    if {self.when}:
        {self.first}
        wait({self.lasts})
    return real(*given, **more)
at.{name} = slow"""

    @property
    def output(self) -> str:
        """Name of the output file; "" for a command without one."""
        return self.command[self.command.index("-o") + 1] if "-o" in self.command else ""


class _Loading(Stage):
    """While the command itself is imported."""

    def code(self) -> str:
        return """
class Slow:
    def find_spec(self, name, *rest):
        if name == "lacmesh.cli.options": wait()
sys.meta_path.insert(0, Slow())"""


_HALF = "given[0].write_bytes(b'half of it')"
STAGES = (
    _Loading("while Python loads the command", ""),
    Stage("while the file is read", "lacmesh.formats.msh.read"),
    Stage("while the mesh is cut", "lacmesh.cutting.cut.cut_skin"),
    Stage("while a msh file is written", "lacmesh.formats.msh.write", first=_HALF),
    Stage("while HDF5 writes a MED file", "lacmesh.formats.med.notes.write", (*_CUT, "out.med"), lasts=1),
    Stage("while the two files of XDMF are written", "lacmesh.formats.xdmf.write", (*_CUT, "out.xdmf"), _HALF),
    Stage("before the new file takes its place", "lacmesh.formats.output._finish"),
    Stage(
        "when one of the two files of XDMF is in its place",
        "os.replace",
        (*_CUT, "out.xdmf"),
        lasts=1,
        written=True,
        when="str(given[1]).endswith('.xdmf')",
    ),
    Stage("while a report is written", "lacmesh.report.writing.report_bytes", (*_CUT, "out.msh", "--report", "r.html")),
    Stage("when the new file is there", "lacmesh.cli.cut._print_summary", written=True),
    Stage("while a mesh is checked", "lacmesh.checks.check", ("check", "in.msh", "--slave", "SLAVE")),
    Stage("while a plot is drawn", "lacmesh.report.plot_quality", ("quality", "in.msh", "--plot", "q.png", "--force")),
    Stage("while a page is made", "lacmesh.view.page", ("view", "in.msh", "--force", "-o", "out.html")),
    Stage(
        "while a skin is turned",
        "lacmesh.topology.orientation.analyse_orientation",
        ("orient", "in.msh", "--group", "SLAVE", "--force", "-o", "out.msh"),
    ),
)


@dataclass(frozen=True)
class Stop:
    """A signal at a stage."""

    stage: Stage
    number: signal.Signals

    kind = "stopped"
    format = "any"

    @property
    def what(self) -> str:
        """Description of the case, as on the page."""
        return f"{self.number.name} {self.stage.what}"

    @property
    def key(self) -> str:
        """A name for the case."""
        return f"stopped: {self.what}"

    @property
    def status(self) -> int:
        """Exit status that a shell reports for a process ended by the signal."""
        return 128 + self.number

    @property
    def says(self) -> str:
        """The words that are expected."""
        word = "interrupted" if self.number == signal.SIGINT else "terminated"
        return f"{word}; " + (
            f"{self.stage.output} was written before that" if self.stage.written else "nothing was written"
        )


def run(stop: Stop, folder: Path) -> Outcome:
    """Start the command, send the signal where it waits, and see that the folder is as it was."""
    stage = stop.stage
    (folder / "in.msh").write_bytes(GOOD)
    for name in {stage.output, "r.html", "q.png"} - {""}:
        (folder / name).write_bytes(PRECIOUS)
    before = listing(folder)
    args = [sys.executable, "-c", _RUN.format(stage.code()), *stage.command]
    with tempfile.TemporaryDirectory() as other:
        env = dict(os.environ, TMPDIR=other)
        with subprocess.Popen(
            args, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder, env=env
        ) as child:
            assert child.stdout is not None
            if child.stdout.readline() != "now\n":
                raise AssertionError(child.communicate())
            child.send_signal(stop.number)
            _, said = child.communicate(timeout=100)
        assert not listing(Path(other)), "the command left temporary files"
    after = listing(folder)
    if stage.written:
        assert after[stage.output] != PRECIOUS and not any(name.startswith(".") for name in after)
        assert (folder / stage.output).with_suffix(".h5").exists() == stage.output.endswith(".xdmf")
    else:
        assert after == before
    return Outcome(child.returncode, said.splitlines(), 0.0)


def cases() -> list[Stop]:
    """Both signals at every stage; before the command is loaded SIGTERM is left to the system."""
    return [
        Stop(stage, number)
        for stage in STAGES
        for number in (signal.SIGINT, signal.SIGTERM)
        if not (isinstance(stage, _Loading) and number == signal.SIGTERM)
    ]
