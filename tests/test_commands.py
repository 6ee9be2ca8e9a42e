"""What all commands of both programs share: their start, help, streams, signals, terminals, and odd names."""

import ast
import json
import os
import pty
import re
import signal
import subprocess
import sys
import warnings
import webbrowser
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from urllib.parse import unquote, urlparse

import numpy as np
import pytest

import lacmesh
import lacsolver
from lacmesh import Cut, cli
from lacmesh.errors import LacmeshWarning
from lacmesh.pages import _html, pages, pages_folder
from lacsolver import cli as solver_cli
from tests import REPOSITORY
from tests.lacsolver.bad_cases import GOOD, blocks, put
from tests.meshes import cell_with_faces
from tests.test_packages import PROJECT

PROGRAMS = {"lacmesh": cli, "lacsolver": solver_cli}
COMMANDS = [f"{name} {command}" for name, cli in PROGRAMS.items() for command in cli.PROGRAM.group.commands]
CUT = "lacmesh cut blocks.msh --slave slave"
#: a name of a file that is no UTF-8
ODD = os.fsdecode(b"bad\xff")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A case and its mesh, in the folder that commands work in, also those in their own processes."""
    put(blocks(), tmp_path)
    (tmp_path / "case.toml").write_text(GOOD)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(p for p in sys.path if p))
    return tmp_path


def as_module(words):
    """A command as a process of its own: "lacmesh info a.msh"."""
    return [sys.executable, "-m", *words.split()]


def shell(words):
    """What a command does with its streams led elsewhere by a shell."""
    return subprocess.run(f"{sys.executable} -m {words}", shell=True, capture_output=True, text=True)


def called(words):
    """The status of a command in this process: of words, or a text of them."""
    program, *rest = words.split() if isinstance(words, str) else words
    return PROGRAMS[program].main(rest)


# ---- start


def test_help_and_version_import_no_numpy_and_importing_a_package_imports_little():
    """Every command of both programs has a help; without a word a program prints its own."""
    code = (
        "import sys, lacmesh, lacsolver\nassert not {'numpy', 'lacsolver.case'} & set(sys.modules)\n"
        "import lacmesh.cli, lacsolver.cli\n"
        "for cli in (lacmesh.cli, lacsolver.cli):\n"
        "    for words in ([], ['--help'], ['--version'], *([name, '-h'] for name in cli.PROGRAM.group.commands)):\n"
        "        assert cli.main(words) == 0\n"
        "heavy = {'numpy', 'scipy', 'h5py', 'rich', 'numba', 'gmsh', 'pyvista'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0 and not done.stderr, done.stderr
    for name, program in PROGRAMS.items():
        assert done.stdout.count(f"Usage: {name}") == 2 + len(program.PROGRAM.group.commands)
        assert done.stdout.count(f"\n{name} {lacmesh.__version__}\n") == 1
    assert "\x1b" not in done.stdout and max(map(len, done.stdout.splitlines())) <= 80


@pytest.mark.parametrize("words", COMMANDS)
def test_a_help_has_two_examples_and_the_statuses(words, capsys):
    assert called(f"{words} --help") == 0
    text = capsys.readouterr().out
    examples = re.findall(r"^  \$ (.*)$", text, re.MULTILINE)
    assert len(examples) == 2 and all(words in example for example in examples) and "Exit status: 0 done" in text
    assert ("\nContact search:\n  --dirichlet" in text) == (words in ("lacmesh cut", "lacmesh check"))


# ---- pages


def test_docs_opens_a_page_with_its_tables_whose_links_lead_to_files(monkeypatch, capsys):
    opened = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(webbrowser, "open", lambda address: opened.append(address) or True)
    assert called("lacmesh docs") == called("lacsolver docs case") == 0
    overview, case = (Path(line) for line in capsys.readouterr().out.splitlines())
    assert opened == [overview.as_uri(), case.as_uri()] and overview.name == "README.html"
    assert "<code>max_penetration</code>" in case.read_text() and "<!-- table" not in case.read_text()
    for page in case.parent.rglob("*.html"):
        for link in re.findall(r'(?:href|src)="([^"#]+)[^"]*"', page.read_text()):
            target = Path(unquote(urlparse(link).path)) if link.startswith("file:") else page.parent / link
            assert re.match(r"https?:", link) or target.exists(), (page.name, link)


def test_a_link_of_a_page_to_a_file_that_is_not_installed_is_its_text():
    page = _html("[a](none.md), [![b](figures/patterns.svg)](none.md), [c](solver.md)", pages_folder() / "README.md")
    assert re.findall('href="([^"]+)"', page) == ["solver.html"] and "a, <img" in page and page.count("</a>") == 1


def test_docs_names_the_text_of_a_page_where_there_is_no_browser(monkeypatch, capsys):
    monkeypatch.setattr(webbrowser, "open", lambda address: False)
    assert called("lacsolver docs solver --path") == called("lacsolver docs solver") == 0
    text, page = capsys.readouterr().out.splitlines()
    assert Path(text) == REPOSITORY / "docs" / "solver.md"
    assert page.endswith(f".html; there is no browser here: the same as text is {text}")
    assert called("lacsolver docs solvr") == 2 and "did you mean solver" in capsys.readouterr().err


def test_messages_name_pages_that_the_wheel_has():
    """By `on_page`: no text of a program but docstrings has the place of a page in the checkout."""
    known = pages()
    for path in (p for name in ("lacmesh", "lacsolver") for p in sorted((REPOSITORY / name).rglob("*.py"))):
        text = path.read_text(encoding="utf-8")
        assert {*re.findall(r"on_page\([\"'](\w+)", text)} <= {*known}, path
        if "docs/" not in text:
            continue
        tree = ast.parse(text)
        notes = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}  # docstrings
        words = [n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and id(n) not in notes]
        assert not [word for word in words if isinstance(word, str) and re.search(r"docs/\w+\.md", word)], path


def test_public_names_are_what_they_say_whatever_was_imported_before():
    code = (
        "import lacsolver.pictures.drawing, sys\n"
        "assert callable(lacsolver.run) and callable(lacsolver.march) and callable(lacsolver.plot)\n"
        "assert lacsolver.run is sys.modules['lacsolver.running'].run\n"
        "from lacsolver import *\nassert run is lacsolver.run and read_case is lacsolver.read_case\n"
        "assert all(getattr(lacsolver, name) is not None for name in lacsolver.__all__)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    with pytest.raises(AttributeError, match="no attribute 'runn'"):
        _ = lacsolver.runn


# ---- words, errors and warnings


@pytest.mark.parametrize("words", COMMANDS)
def test_an_unknown_option_is_one_line_and_leaves_nothing(folder, capsys, words):
    before = sorted(folder.iterdir())
    assert called(f"{words} --quickly") == 2
    said = capsys.readouterr().err
    assert said.startswith(f"{words.split()[0]}: error: no such option: --quickly (") and said.count("\n") == 1
    assert said.endswith(f"; see {words} --help\n") and sorted(folder.iterdir()) == before


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("lacmesh cut", "missing argument 'IN'; see lacmesh cut --help"),
        ("lacmesh cut a b --slave s", "got unexpected extra argument(s) (b); see lacmesh cut --help"),
        ("lacmesh cut a --slave", "option '--slave' requires an argument; see lacmesh cut --help"),
        ("lacmesh cut a --hexa tetra", "invalid value for '--hexa': 'tetra' is not one of 'pyramid', 'hexa', 'auto';"),
        ("lacmesh cut a --search-distance -1", "invalid value for '--search-distance': '-1' is no length; see"),
        ("lacmesh partition a -n two", "invalid value for '--parts' / '-n': 'two' is no whole number; see"),
        ("lacmesh cutt a", "there is no command 'cutt'; did you mean cut?; see lacmesh --help"),
        ("lacmesh blocks.msh", "blocks.msh is a file, and a command comes first: lacmesh info blocks.msh"),
        ("lacsolver film case", "missing option '--output' / '-o'; see lacsolver film --help"),
    ],
)
def test_wrong_words_are_one_sentence(folder, capsys, words, message):
    assert called(words) == 2
    assert capsys.readouterr().err.startswith(f"{words.split()[0]}: error: {message}")


@pytest.mark.vtk
def test_options_with_no_value_or_several(folder, capsys):
    """`--quality` and `--history` take what follows up to the next option."""
    assert called("lacmesh view blocks.msh --quality -o q.png -q") == 0
    assert called("lacmesh view --quality beauty blocks.msh -o r.png") == 2
    assert "beauty" in capsys.readouterr().err
    assert called("lacsolver plot case --history --zone joint") == 3  # there is no run
    assert called("lacsolver run case.toml -q") == 0
    assert called("lacsolver plot case --history --zone joint") == 2
    assert "--history draws columns over time" in capsys.readouterr().err
    assert called("lacsolver plot case --history nothing here -o h.png") == 2
    assert "nothing" in capsys.readouterr().err


@pytest.mark.parametrize("name", [".", "/", "..", "", "nofile", "nofile.msh"])
def test_what_is_no_file_cannot_be_read(name, folder, capsys):
    assert called(["lacmesh", "cut", name, "--slave", "a"]) == 3
    assert "cannot be read" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (ZeroDivisionError("of ours"), "internal error (ZeroDivisionError: of ours); --verbose"),
        (MemoryError(), "there is not enough memory for this model"),
    ],
)
def test_an_error_of_ours_or_too_little_memory_is_one_line(folder, capsys, monkeypatch, error, words):
    def fails(case, mesh):
        raise error

    monkeypatch.setattr(import_module("lacsolver.validation"), "validate", fails)
    assert called("lacsolver validate case.toml") == 1
    assert capsys.readouterr().err.startswith(f"lacsolver: error: {words}")
    if isinstance(error, ZeroDivisionError):
        with pytest.raises(ZeroDivisionError):
            called("lacsolver validate case.toml --verbose")


@pytest.mark.vtk
def test_quiet_commands_print_nothing_but_warnings(folder, capsys, monkeypatch):
    words = [CUT, "lacmesh view blocks.msh -o a.png"]
    words += [f"lacsolver {rest} case.toml" for rest in ("run", "validate", "matrices -o m.npz")]
    assert [called(f"{word} --quiet") for word in words] == [0] * 5
    assert capsys.readouterr() == ("", "")
    validation = import_module("lacsolver.validation")
    real = validation.validate

    def warned(case, mesh):
        warnings.warn("something was left out", LacmeshWarning, stacklevel=1)
        return real(case, mesh)

    monkeypatch.setattr(validation, "validate", warned)
    assert called("lacsolver validate case.toml -q") == 0
    assert capsys.readouterr() == ("", "lacsolver: warning: something was left out\n")


# ---- streams


@pytest.mark.parametrize("words", ["lacmesh info blocks.msh", "lacsolver schema"])
def test_a_reader_that_goes_away_ends_a_command_quietly(folder, words):
    with subprocess.Popen(as_module(words), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        process.stdout.close()
        said = process.stderr.read()
    assert "Traceback" not in said and "Broken" not in said
    assert process.returncode in (0, 120) or "info" in words  # tables, printed by rich


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_full_or_closed_output_is_no_internal_error(folder, monkeypatch, unbuffered):
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)
    full, closed = shell("lacmesh info blocks.msh > /dev/full"), shell("lacmesh info blocks.msh >&-")
    assert full.returncode == 3 and "No space left" in full.stderr and full.stderr.count("\n") == 1
    assert closed.returncode == 0 and not closed.stderr


def test_a_closed_error_stream_is_no_internal_error(folder):
    """What is opened next must not become stream 2 either, which libraries write to."""
    done = shell(f"{CUT} -o out.med 2>&-")
    assert done.returncode == 0 and "worst quality" in done.stdout
    assert Cut(lacmesh.read("out.med")).zones == ("slave",)
    assert shell("lacsolver run case.toml 2>&-").returncode == 0
    assert json.loads((folder / "case" / "results.json").read_text())["status"] == "done"


# ---- signals, in the commands as pip installs them

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
    module, _, function = PROJECT["scripts"][command].partition(":")
    return [sys.executable, "-c", SCRIPT.format(slow=slow, command=command, module=module, function=function)]


@pytest.mark.parametrize("command", PROGRAMS)
def test_the_installed_command_runs_and_an_interrupt_while_it_loads_is_one_line(command):
    done = subprocess.run([*script(command), "--version"], capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.startswith(f"{command} ") and not done.stderr
    words = [*script(command, f"{command}.cli.options"), "--version"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        assert child.stdout.readline() == "now\n"
        child.send_signal(signal.SIGINT)
        said = child.stderr.read()
    assert child.returncode == 130 and said == f"{command}: error: interrupted; nothing was written\n"


# ---- terminals


def on_a_terminal(command, streams=("stdout", "stderr"), **variables):
    """The status of a command some of whose streams are a terminal, and what that shows."""
    ours, its = pty.openpty()
    env = {name: value for name, value in os.environ.items() if name not in ("NO_COLOR", "TERM")}
    env |= {"TERM": "xterm-256color", "COLUMNS": "80"} | variables
    led = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL} | dict.fromkeys(streams, its)
    with os.fdopen(ours, "rb", buffering=0) as reading, subprocess.Popen(command, env=env, **led) as child:
        os.close(its)
        shown = b""
        with suppress(OSError):  # the terminal has gone
            while block := reading.read(4096):
                shown += block
    return child.returncode, shown.decode().replace("\r\n", "\n")


def test_errors_and_warnings_have_colours_on_a_terminal_and_are_plain_elsewhere():
    """NO_COLOR and a dumb terminal, or a pipe, have the words alone."""
    command = [*script("lacmesh"), "info", "no_such_file.msh"]
    plain = subprocess.run(command, capture_output=True, text=True).stderr
    assert plain.startswith("lacmesh: error: no_such_file.msh")
    coloured = plain.replace("error", "\x1b[1;31merror\x1b[0m", 1)
    for variables, expected in (({}, coloured), ({"NO_COLOR": "1"}, plain), ({"TERM": "dumb"}, plain)):
        assert on_a_terminal(command, ["stderr"], **variables) == (3, expected)
    code = "import warnings; from lacmesh.cli import PROGRAM; from lacmesh.errors import LacmeshWarning; "
    code += "PROGRAM._show_warning('coarse', LacmeshWarning, '', 0)"
    shown = on_a_terminal([sys.executable, "-c", code], ["stderr"])[1]
    assert shown == "lacmesh: \x1b[1;33mwarning\x1b[0m: coarse\n"


def test_progress_is_shown_on_a_terminal_only(folder):
    assert subprocess.run(as_module(CUT), capture_output=True).stderr == b""
    status, shown = on_a_terminal(as_module(f"{CUT} --force"), ["stderr"])
    assert status == 0 and "read" in shown


def visible(shown):
    """The lines that stay: what is erased or written over is left out."""
    kept = []
    for line in re.sub(r"\x1b\[[0-9;?]*[lhm]", "", shown).split("\n"):
        for _ in range(line.count("\x1b[1A")):
            kept.pop()
        kept.append(re.split(r"\x1b\[2K|\r", line)[-1].replace("\x1b[1A", ""))
    return kept


def test_a_terminal_shows_the_iterations_of_a_run_which_leave_a_line_a_step(folder):
    text = GOOD.replace('master = "master"\n', 'master = "master"\nfriction = 0.3\n')
    (folder / "case.toml").write_text(text + "[steps]\ncount = 3\n")
    status, shown = on_a_terminal(as_module("lacsolver run case.toml"))
    assert status == 0 and "\x1b[2K" in shown  # the display that is erased again
    assert re.search(r"towards t = [\d.]+ of 1", shown) and re.search(r"iteration +\d+  closed +3", shown)
    lines = visible(shown)
    assert not [line for line in lines if "towards" in line or "preparing" in line]
    assert len([line for line in lines if re.match(r" +[123] +[\d.]+ +\d+ +0 ", line)]) == 3
    assert max(map(len, lines)) <= 80
    assert on_a_terminal(as_module("lacsolver run case.toml --quiet --force")) == (0, "")


# ---- odd names

#: clears the screen, sets the title, rings; C1's own escape; turns what follows round
SPELL = "\x1b[2J\x1b]0;pwn\x07x\x9b31m\u202e"


def raw(text):
    return [c for c in text if not c.isprintable() and c != "\n"]


@pytest.fixture
def spelt(folder):
    """The mesh, whose slave has the name of a spell, and so have some nodes."""
    mesh = blocks()
    names = {SPELL if name == "slave" else name: cells for name, cells in mesh.cell_groups.items()}
    mesh = replace(mesh, cell_groups=names, node_groups={"n" + SPELL: np.arange(3)})
    lacmesh.write("a.vtu", mesh)
    put(mesh, folder)
    return folder


@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
@pytest.mark.parametrize(
    "words",
    [
        *("lacmesh info a.vtu", "lacmesh info a.vtu --json", "lacmesh check a.vtu --slave SPELL"),
        *("lacmesh check a.vtu --slave SPELL --json", "lacmesh check a.vtu --slave nobody", "lacmesh quality a.vtu"),
        *("lacmesh quality a.vtu --json", "lacmesh quality a.vtu --group SPELL"),
        *("lacmesh cut a.vtu --slave SPELL -o cut.vtu", "lacmesh cut a.vtu --slave SPELL --slave nobody -o cut.vtu"),
        *("lacmesh orient a.vtu --group SPELL -o out.vtu", "lacmesh cut a.vtu --slave SPELL -o c.vtu --report a.html"),
        *("lacsolver validate case.toml", "lacsolver run case.toml"),
    ],
)
def test_names_from_files_are_no_commands_to_the_terminal(words, spelt, capsys):
    """`lacmesh info` printed a group's name raw, which cleared the screen of who looked at the file."""
    called([word.replace("SPELL", SPELL) for word in words.split()])
    said = capsys.readouterr()
    assert not raw(said.out) and not raw(said.err)
    if "--json" in words:
        assert json.dumps(SPELL)[1:-1] in json.dumps(json.loads(said.out))
    elif words == "lacmesh info a.vtu" or "case" in words:  # among groups that are like the slave
        assert r"\x1b[2J\x1b]0;pwn\x07x\x9b31m\u202e" in said.out + said.err
    for page in spelt.glob("*.html"):
        assert "\x1b" not in page.read_text(encoding="utf-8")


def test_a_terminal_has_its_colours_and_no_others(spelt):
    """Tables are coloured where somebody looks, and names are escaped there too."""
    command = [sys.executable, "-m", "lacmesh", "check", "a.vtu", "--slave", SPELL]
    text = on_a_terminal(command, ["stdout"])[1]
    assert "\x1b[" in text, "colours"
    assert not raw(re.sub(r"\x1b\[[\d;]*m", "", text))


@pytest.mark.parametrize("suffix", [".msh", ".med", ".mail", ".inp", ".vtu"])
@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
def test_a_name_that_is_no_utf8_is_a_name(tmp_path, suffix):
    mesh = cell_with_faces("TETRA4")
    lacmesh.write(tmp_path / f"{ODD}{suffix}", mesh)
    assert lacmesh.read(tmp_path / f"{ODD}{suffix}").n_nodes == mesh.n_nodes


@pytest.mark.parametrize(
    "words",
    [
        *(f"cut {ODD}.msh --slave slave -o x.msh --report r.{kind}" for kind in ("html", "md", "json")),
        pytest.param(f"view {ODD}.msh -o v.png --title {ODD}", marks=pytest.mark.vtk),
        f"quality {ODD}.msh --plot q.png",
    ],
)
def test_reports_and_pages_of_a_file_whose_name_is_no_utf8(words, folder, capsys):
    (folder / "blocks.msh").rename(f"{ODD}.msh")
    assert called(f"lacmesh {words}") == 0, capsys.readouterr().err


def test_outputs_whose_names_are_no_utf8(folder, capsys):
    """A folder of results is written and gone on with; XML cannot name a second file so."""
    (folder / "case.toml").write_text(GOOD + '[output]\nformat = "med"\n[steps]\ncount = 2\n')
    assert called(f"lacsolver run case.toml -q -o {ODD}") == 0, capsys.readouterr().err
    (folder / ODD / "state_0002.npz").unlink()
    assert called(f"lacsolver run case.toml -q -o {ODD} --restart {ODD}") == 0, capsys.readouterr().err
    assert json.loads((folder / ODD / "results.json").read_text())["status"] == "done"
    before = sorted(folder.iterdir())
    assert called(f"{CUT} -o {ODD}.xdmf") == 3
    assert "its name is no UTF-8" in capsys.readouterr().err and sorted(folder.iterdir()) == before


# ---- completion

#: what is typed -> what is offered, and what is not
TYPED = {
    "lacmesh cut --hexa ": ({"pyramid", "hexa", "auto"}, {"--slave"}),
    "lacmesh c": ({"cut", "check", "convert", "compile"}, {"info"}),
    "lacsolver film --for": ({"--force"}, {"--frames"}),
}


@pytest.mark.rows("lacsolver film --for")
@pytest.mark.parametrize("line", TYPED)
def test_bash_completes(line):
    program, wanted, unwanted = line.split()[0], *TYPED[line]
    words = line.split() + [""] * line.endswith(" ")
    variables = {"COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1), f"_{program.upper()}_COMPLETE": "complete_bash"}
    done = subprocess.run(script(program), env=os.environ | variables, capture_output=True, text=True, timeout=60)
    assert wanted <= {*done.stdout.split()} and not unwanted & {*done.stdout.split()}, done.stderr
