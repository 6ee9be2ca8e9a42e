"""The commands as pyproject.toml installs them: interrupts, colours on a terminal, and their completion in shells."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress

import pytest

from lacmesh.cli import COMMANDS as OF_LACMESH
from lacmesh.cli import main as lacmesh
from lacsolver.cli import COMMANDS as OF_LACSOLVER
from lacsolver.cli import main as lacsolver
from tests import REPOSITORY
from tests.test_packages import PROJECT

SCRIPTS = PROJECT["scripts"]
#: what pip makes of an entry point; while the module `slow` is imported the command waits
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


@pytest.mark.parametrize("command", ["lacmesh", "lacsolver"])
def test_the_installed_command_runs_and_an_interrupt_while_it_loads_is_one_line(command):
    done = subprocess.run([*script(command), "--version"], capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.startswith(f"{command} ") and not done.stderr
    words = [*script(command, f"{command}.cli.options"), "--version"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        assert child.stdout.readline() == "now\n"
        child.send_signal(signal.SIGINT)
        said = child.stderr.read()
    assert child.returncode == 130 and said == f"{command}: error: interrupted; nothing was written\n"


def test_commands_can_be_interrupted_in_tests_that_are_started_with_nohup():
    """A shell starts what runs behind it with SIGINT ignored, and children inherit that."""
    code = (
        "import signal, sys, pytest\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "sys.exit(pytest.main(['-q', '-p', 'no:cacheprovider', *sys.argv[1:]]))"
    )
    words = [sys.executable, "-c", code, __file__, "-k", "interrupt_while_it_loads and lacmesh"]
    done = subprocess.run(words, capture_output=True, text=True, cwd=REPOSITORY)
    assert done.returncode == 0, done.stdout


def on_a_terminal(command, **variables):
    """Output of a command whose standard error is a terminal."""
    import pty  # not on Windows

    ours, its = pty.openpty()
    env = {name: value for name, value in os.environ.items() if name not in ("NO_COLOR", "TERM")}
    env |= {"TERM": "xterm"} | variables
    with os.fdopen(ours, "rb", buffering=0) as reading:
        child = subprocess.Popen(command, stderr=its, stdout=subprocess.DEVNULL, env=env)
        os.close(its)
        received = b""
        with suppress(OSError):  # the terminal has gone
            while block := reading.read(4096):
                received += block
        child.wait()
    return received.decode().replace("\r\n", "\n")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals")
def test_errors_and_warnings_have_colours_on_a_terminal_and_are_plain_elsewhere():
    """NO_COLOR and a dumb terminal, or a pipe, have the words alone."""
    command = [*script("lacmesh"), "info", "no_such_file.msh"]
    plain = subprocess.run(command, capture_output=True, text=True).stderr
    assert plain.startswith("lacmesh: error: no_such_file.msh")
    assert on_a_terminal(command) == plain.replace("error", "\x1b[1;31merror\x1b[0m", 1)
    assert on_a_terminal(command, NO_COLOR="1") == on_a_terminal(command, TERM="dumb") == plain
    code = "import warnings; from lacmesh.cli import PROGRAM; from lacmesh.errors import LacmeshWarning; "
    code += "PROGRAM._show_warning('coarse', LacmeshWarning, '', 0)"
    assert on_a_terminal([sys.executable, "-c", code]) == "lacmesh: \x1b[1;33mwarning\x1b[0m: coarse\n"


# ---- completion in bash, as it does it: commands, options, choices, files by suffix


#: what is typed -> what is offered, and what is not
TYPED = {
    "lacmesh cut --hexa ": ({"pyramid", "hexa", "auto"}, {"part.msh"}),
    "lacmesh cut pa": ({"part.msh", "part.inp"}, {"part.toml", "part.png", "part.step"}),
    "lacmesh mesh pa": ({"part.step"}, {"part.msh", "part.toml"}),
    "lacmesh check --surf": ({"--surface"}, {"--slave"}),
    "lacmesh ": (set(OF_LACMESH), set()),
    "lacsolver ": (set(OF_LACSOLVER), set()),
    "lacsolver run pa": ({"part.toml"}, {"part.msh", "part.png"}),
    "lacsolver run part.toml --plot pa": ({"part.png"}, {"part.msh", "part.toml"}),
    "lacsolver modes part.toml --mass ": ({"consistent", "lumped"}, {"part.msh"}),
    "lacsolver film --for": ({"--force"}, {"--frames"}),
}
BASH = r"""
source "$1"
words=($2); [[ $2 == *" " ]] && words+=("")
COMP_WORDS=("${words[@]}"); COMP_CWORD=$((${#words[@]} - 1)); COMP_LINE=$2; COMP_POINT=${#2}
function=$(complete -p "${words[0]}" | sed 's/.*-F \([^ ]*\) .*/\1/')
$function "${words[0]}" "${words[COMP_CWORD]}" "${words[COMP_CWORD-1]}"
printf '%s\n' "${COMPREPLY[@]}"
"""


@pytest.mark.parametrize(("program", "main"), [("lacmesh", lacmesh), ("lacsolver", lacsolver)])
def test_bash_completes(program, main, tmp_path, capsys):
    for shell in ("zsh", "fish", "bash"):
        assert main(["completion", shell]) == 0
        script = capsys.readouterr().out
        assert all(name in script for name in ("compare" if program == "lacsolver" else "convert", "--output"))
    (tmp_path / "script").write_text(script)
    for name in ("part.msh", "part.toml", "part.png", "part.inp", "part.step"):
        (tmp_path / name).touch()
    for line, (wanted, unwanted) in TYPED.items():
        if line.startswith(program):
            words = ["bash", "--norc", "-c", BASH, "bash", "./script", line]
            done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=True)
            assert wanted <= {*done.stdout.split()} and not unwanted & {*done.stdout.split()}, line
    with pytest.raises(SystemExit) as stopped:
        main(["completion", "csh"])
    assert stopped.value.code == 2 and "bash" in capsys.readouterr().err
