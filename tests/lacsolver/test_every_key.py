"""Every key of a case has its effect: each case comes to what it should, and to something else without any one line.

A line may be without effect where it says the default, and then the case without it is the same one.
"""

from __future__ import annotations

import tomllib
import warnings
from pathlib import Path

import pytest

import lacmesh
import lacsolver.problem.problem
import lacsolver.saddle.stiffness
from lacmesh.errors import LacmeshError, LacmeshWarning
from lacsolver.case import Case, read_case
from lacsolver.case.keys import keys_of, sections_of
from lacsolver.case.kinds import Choice
from lacsolver.equilibrium.stepping import NotConvergedError
from lacsolver.linear import analyse, backends
from lacsolver.output import create_output
from lacsolver.running import run
from tests.lacsolver.key_cases import CASES, ENGINES, SOLVERS
from tests.lacsolver.key_checks import CHECKS, Ran, check_tower
from tests.samples import samples

#: cores that the process has, here
CORES = 7


class Shop:
    """Runs cases in a folder; the mesh of each is written once."""

    def __init__(self, folder, monkeypatch):
        self.folder, self.count = folder, 0
        self.meshes: dict[int, Path] = {}
        self.asked: list[tuple[str, int]] = []
        monkeypatch.setattr(lacsolver.problem.problem, "available_cores", lambda: CORES)
        monkeypatch.setattr(lacsolver.saddle.stiffness, "analyse", self.analyse)

    def analyse(self, K, *, backend, threads, **rest):
        """Replace `lacsolver.linear.analyse`, and record the backends and threads that are requested."""
        made = analyse(K, backend=backend, threads=threads, **rest)
        self.asked.append((made.backend, threads))
        return made

    def read(self, case, text):
        """(the case, its mesh)."""
        mesh = case.mesh()
        if id(mesh) not in self.meshes:
            place = self.folder / f"mesh_{len(self.meshes)}"
            place.mkdir()
            lacmesh.write(place / "blocks.msh", mesh)
            self.meshes[id(mesh)] = place
        file = self.meshes[id(mesh)] / "case.toml"
        file.write_text(text)
        return read_case(file), mesh

    def run(self, case, text):
        """Run a case; an equilibrium that is not found is kept."""
        made, mesh = self.read(case, text)
        self.count += 1
        ran = Ran(made, mesh, self.folder / f"out_{self.count}")
        self.asked = ran.asked
        try:
            run(made, create_output(ran.folder), mesh=mesh, progress=ran.told.append)
        except NotConvergedError as error:
            ran.error = error
        return ran


@pytest.fixture
def shop(tmp_path, monkeypatch):
    return Shop(tmp_path, monkeypatch)


@pytest.mark.filterwarnings("ignore:.* small kinematics takes displacements for small:lacmesh.errors.LacmeshWarning")
@pytest.mark.filterwarnings("ignore:tie .* across a gap of up to:lacmesh.errors.LacmeshWarning")
@pytest.mark.filterwarnings(
    "ignore:steps are too long for the energy that friction takes:lacmesh.errors.LacmeshWarning"
)
@pytest.mark.filterwarnings("ignore:massless nodes change the inertia:lacmesh.errors.LacmeshWarning")
@pytest.mark.fuzz
@pytest.mark.parametrize("name", CASES)
def test_every_line_of_a_case_has_its_effect(shop, name):
    case = CASES[name]
    ran = shop.run(case, case.text)
    CHECKS[name](ran)
    lines = [*without_a_line(case.text)][:: samples(14, 1)]
    idle = [line for line, text in lines if is_idle(shop, case, ran.case, text, CHECKS[name])]
    assert set(idle) <= {'kind = "cell"'}, "what is so without being said"


def without_a_line(text):
    """Yield (line, the text without it) for every line with a key whose effect is tested."""
    lines = text.splitlines()
    for k, line in enumerate(lines):
        if "=" in line and not line.endswith("# held"):
            yield line, "\n".join(lines[:k] + lines[k + 1 :])


def is_idle(shop, case, whole, text, check):
    """True if a changed text gives another case with the same result; warnings are ignored."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LacmeshWarning)
            ran = shop.run(case, text)
        check(ran)
    except (LacmeshError, AssertionError, LookupError, FileNotFoundError):
        return False
    return ran.case != whole


@pytest.mark.parametrize("backend", SOLVERS)
def test_every_backend_is_asked_or_said_to_be_missing(shop, backend):
    case = SOLVERS[backend]
    known = backends()
    if backend != "auto" and not known[backend].installed:
        with pytest.raises(LacmeshError, match=f"{backend} is not installed; pip install"):
            shop.run(case, case.text)
        return

    def check(ran):
        check_tower(ran, 34 + 13 * 4)
        wanted = backend if backend != "auto" else next(b.name for b in known.values() if b.direct and b.installed)
        assert ran.asked == [(wanted, 3)]

    ran = shop.run(case, case.text)
    check(ran)
    text = case.text.replace("threads = 3", "")
    assert not is_idle(shop, case, ran.case, text, check) and shop.asked[-1][1] == CORES
    if backend not in ("auto", ran.asked[0][0]):
        assert not is_idle(shop, case, ran.case, case.text.replace(f'backend = "{backend}"', ""), check)


@pytest.mark.parametrize("word", ENGINES)
def test_every_engine_is_taken_or_refused(shop, word):
    """The engine petsc solves elsewhere (tests/lacsolver/distributed): here it is not taken for the serial one."""
    case = ENGINES[word]
    if word in ("auto", "serial"):
        check_tower(shop.run(case, case.text), 34 + 13 * 4)
    else:
        with pytest.raises(LacmeshError, match=r"engine petsc.* lacsolver run"):
            shop.run(case, case.text)


# ---- the table, and what is in the cases


def used():
    """(section, key) and (section, key, option) that the cases have."""
    found = set()
    for case in (*CASES.values(), *SOLVERS.values(), *ENGINES.values()):
        for section, keys in sections(tomllib.loads(looked_at(case.text))):
            for name, value in keys.items():
                found |= {(section, name), (section, name, str(value))}
    return found


def looked_at(text):
    """Lines of a text whose effect is tested."""
    return "\n".join(line for line in text.splitlines() if not line.endswith("# held"))


def sections(document):
    """(section, keys) of a case's text."""
    yield "", {name: value for name, value in document.items() if not isinstance(value, (dict, list))}
    for name, held in document.items():
        for keys in held if isinstance(held, list) else [held] if isinstance(held, dict) else []:
            yield name, keys


def table():
    """The place of every key of the schema, and of every option of every choice."""
    for section, record in {"": Case, **sections_of(Case)}.items():
        for name, key in keys_of(record).items():
            if name == "constants":  # of laws that a program adds: test_added_*.py
                continue
            yield section, name
            for word in key.kind.options if isinstance(key.kind, Choice) else ():
                yield section, name, word


def test_every_key_and_every_option_is_in_some_case():
    found = used()
    for place in table():
        assert place in found, place
