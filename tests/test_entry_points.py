"""The commands as pyproject.toml installs them: what pip's script calls is what `python -m` runs."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tomllib
from contextlib import suppress
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]

#: what pip makes of an entry point; while `SLOW` is imported the command waits
SCRIPT = """
import sys, time
class Slow:
    def find_spec(self, name, *rest):
        if name == "{slow}":
            print("now", flush=True)
            for _ in range(12000):  # in short steps: a signal that comes just before one is seen after it
                time.sleep(0.01)
sys.meta_path.insert(0, Slow())
sys.argv = ["{command}", *sys.argv[1:]]
from {module} import {function}
sys.exit({function}())
"""


def script(command, slow=""):
    """The installed command as code, which waits while the module `slow` is imported."""
    module, _, function = SCRIPTS[command].partition(":")
    return [sys.executable, "-c", SCRIPT.format(slow=slow, command=command, module=module, function=function)]


def test_both_commands_are_installed():
    assert set(SCRIPTS) == {"lacmesh", "lacsolver"}


@pytest.mark.parametrize("command", SCRIPTS)
def test_an_interrupt_while_the_installed_command_loads_is_one_line(command):
    words = [*script(command, f"{command}.cli.options"), "--version"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        assert child.stdout.readline() == "now\n"
        child.send_signal(signal.SIGINT)
        said = child.stderr.read()
    assert child.returncode == 130 and said == f"{command}: error: interrupted; nothing was written\n"


@pytest.mark.parametrize("command", SCRIPTS)
def test_the_installed_command_runs(command):
    done = subprocess.run([*script(command), "--version"], capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.startswith(f"{command} ") and not done.stderr


def test_commands_can_be_interrupted_in_tests_that_are_started_with_nohup():
    """A shell starts what runs behind it with SIGINT ignored, and children inherit that."""
    code = (
        "import signal, sys, pytest\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "sys.exit(pytest.main(['-q', '-p', 'no:cacheprovider', *sys.argv[1:]]))"
    )
    one = f"{Path(__file__)}::test_an_interrupt_while_the_installed_command_loads_is_one_line[lacmesh]"
    done = subprocess.run([sys.executable, "-c", code, one], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stdout


def on_a_terminal(command, **variables):
    """Output of a command whose standard error is a terminal."""
    import pty  # not on Windows

    ours, its = pty.openpty()
    env = {name: value for name, value in os.environ.items() if name not in ("NO_COLOR", "TERM")}
    with os.fdopen(ours, "rb", buffering=0) as reading:
        child = subprocess.Popen(
            command, stderr=its, stdout=subprocess.DEVNULL, env=env | {"TERM": "xterm"} | variables
        )
        os.close(its)
        received = b""
        with suppress(OSError):  # the terminal has gone
            while block := reading.read(4096):
                received += block
        child.wait()
    return received.decode().replace("\r\n", "\n")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals")
def test_errors_are_red_on_a_terminal_and_plain_elsewhere():
    """NO_COLOR and a dumb terminal, or a pipe, have the words alone."""
    command = [*script("lacmesh"), "info", "no_such_file.msh"]
    plain = subprocess.run(command, capture_output=True, text=True).stderr
    assert plain.startswith("lacmesh: error: no_such_file.msh")
    assert on_a_terminal(command) == plain.replace("error", "\x1b[1;31merror\x1b[0m", 1)
    assert on_a_terminal(command, NO_COLOR="1") == on_a_terminal(command, TERM="dumb") == plain


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals")
def test_warnings_are_yellow_on_a_terminal():
    code = "import warnings; from lacmesh.cli import PROGRAM; from lacmesh.errors import LacmeshWarning; "
    code += "PROGRAM._show_warning('coarse', LacmeshWarning, '', 0)"
    assert on_a_terminal([sys.executable, "-c", code]) == "lacmesh: \x1b[1;33mwarning\x1b[0m: coarse\n"
