"""Completion in bash, zsh and fish, as the shells do it: commands, options, choices, files by suffix."""

from __future__ import annotations

import subprocess
import sys

import pytest

from lacmesh.cli import COMMANDS as OF_LACMESH
from lacmesh.cli import main as lacmesh
from lacsolver.cli import COMMANDS as OF_LACSOLVER
from lacsolver.cli import main as lacsolver

PROGRAMS = {"lacmesh": (lacmesh, OF_LACMESH), "lacsolver": (lacsolver, OF_LACSOLVER)}
FILES = ("part.msh", "part.toml", "part.png", "part.inp", "part.step")
#: what is typed -> what a shell offers, and what it does not
TYPED = {
    "lacmesh cut --hexa ": ({"pyramid", "hexa", "auto"}, {"part.msh"}),
    "lacmesh cut pa": ({"part.msh", "part.inp"}, {"part.toml", "part.png", "part.step"}),
    "lacmesh mesh pa": ({"part.step"}, {"part.msh", "part.toml"}),
    "lacmesh check --surf": ({"--surface"}, {"--slave"}),
    "lacsolver run pa": ({"part.toml"}, {"part.msh", "part.png"}),
    "lacsolver run part.toml --plot pa": ({"part.png"}, {"part.msh", "part.toml"}),
    "lacsolver modes part.toml --mass ": ({"consistent", "lumped"}, {"part.msh"}),
    "lacsolver film --for": ({"--force"}, {"--frames"}),
}
typed = pytest.mark.parametrize("line", TYPED)

BASH = r"""
source "$1"
words=($2); [[ $2 == *" " ]] && words+=("")
COMP_WORDS=("${words[@]}"); COMP_CWORD=$((${#words[@]} - 1)); COMP_LINE=$2; COMP_POINT=${#2}
function=$(complete -p "${words[0]}" | sed 's/.*-F \([^ ]*\) .*/\1/')
$function "${words[0]}" "${words[COMP_CWORD]}" "${words[COMP_CWORD-1]}"
printf '%s\n' "${COMPREPLY[@]}"
"""
#: a shell in a terminal of zsh's own, in which a line is typed and completed
ZSH = r"""
zmodload zsh/zpty
zpty -b shell zsh -f -i
zpty -w shell "PS1='> '; stty columns 200; fpath+=($1); autoload -Uz compinit; compinit -D -u; echo RE''ADY"
zpty -r shell seen '*READY*'
zpty -n -w shell $2$'\t\t'
zpty -r -m shell seen "*$3*"
print -r -- $seen
zpty -d shell
"""


@pytest.fixture(scope="module")
def scripts(tmp_path_factory):
    """Script of each program for each shell, as printed by the command."""
    folder = tmp_path_factory.mktemp("scripts")
    for program in PROGRAMS:
        for shell in ("bash", "zsh", "fish"):
            words = [sys.executable, "-m", program, "completion", shell]
            done = subprocess.run(words, capture_output=True, text=True, check=True)
            name = f"_{program}" if shell == "zsh" else f"{program}.{shell}"
            (folder / name).write_text(done.stdout)
    return folder


@pytest.fixture
def files(tmp_path):
    for name in FILES:
        (tmp_path / name).touch()
    return tmp_path


def run(words, files):
    done = subprocess.run(words, cwd=files, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout


@typed
def test_bash_completes(scripts, files, line):
    wanted, unwanted = TYPED[line]
    offered = set(
        run(["bash", "--norc", "-c", BASH, "bash", str(scripts / f"{line.split()[0]}.bash"), line], files).split()
    )
    assert wanted <= offered and not unwanted & offered


@pytest.mark.fish
@typed
def test_fish_completes(scripts, files, line):
    wanted, unwanted = TYPED[line]
    code = f"source {scripts / line.split()[0]}.fish; complete -C '{line}'"
    offered = {row.split("\t")[0] for row in run(["fish", "--no-config", "-c", code], files).splitlines()}
    assert wanted <= offered and not unwanted & offered


@pytest.mark.zsh
@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("lacmesh cut --hexa ", "pyramid"),
        ("lacmesh mesh pa", "rt.step"),
        ("lacsolver run pa", "rt.toml"),
        ("lacsolver comp", "compare"),
    ],
)
def test_zsh_completes(scripts, files, line, wanted):
    assert wanted in run(["zsh", "-f", "-c", ZSH, "zsh", str(scripts), line, wanted], files)


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_command_is_completed(scripts, files, program):
    script = str(scripts / f"{program}.bash")
    assert set(run(["bash", "--norc", "-c", BASH, "bash", script, f"{program} "], files).split()) >= set(
        PROGRAMS[program][1]
    )


@pytest.mark.parametrize("program", PROGRAMS)
def test_another_shell_is_refused(program, capsys):
    with pytest.raises(SystemExit) as stopped:
        PROGRAMS[program][0](["completion", "csh"])
    assert stopped.value.code == 2 and "bash" in capsys.readouterr().err


@pytest.mark.parametrize("program", PROGRAMS)
def test_other_commands_do_not_load_it(program):
    code = (
        f"import sys\nfrom {program}.cli import main\ntry: main(['{PROGRAMS[program][1][1]}', '--help'])\n"
        "except SystemExit: pass\n"
        f"assert 'shtab' not in sys.modules and '{program}.cli.completion' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
