"""tools/portable.py: each configuration computes as it says, a failure is told, and the others are run."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy
import pytest
import scipy

ROOT = Path(__file__).resolve().parents[1]


def loaded():
    spec = importlib.util.spec_from_file_location("portable", ROOT / "tools" / "portable.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["portable"] = module
    spec.loader.exec_module(module)
    return module


portable = loaded()
ALL = {made.name: made for made in portable.configurations("")}
CORES = [name for name, made in ALL.items() if made.cores]


look = portable.look  # a test replaces portable.look by `seen`


@cache
def own():
    return look(ALL["own"])


def configuration(name):
    """Configuration of this name on this machine, which may be unable to run it (`lacking`)."""
    (made,) = (c for c in portable.configurations(" ".join(own()["numpy"])) if c.name == name)
    return made


def lacking(name):
    """Reason why this machine cannot run a configuration, which `make portable` prints instead; or nothing."""
    return portable.lacking(configuration(name), own())


@cache
def seen(name):
    """Libraries that compute in a configuration, which is asked once."""
    return own() if name == "own" else look(configuration(name))


def printed(name, code):
    """Words that Python code prints in a configuration."""
    return portable.started(configuration(name), ["-c", code], stdout=subprocess.PIPE).stdout.split()


# ---- what is set takes effect


@pytest.mark.parametrize("name", [name for name, made in ALL.items() if "OPENBLAS_CORETYPE" in made.sets])
def test_numpy_and_scipy_take_the_kernels_of_openblas_that_are_named(name):
    """Both builds. One that has no kernels of that name takes those of another configuration, which is seen."""
    if lacking(name):
        assert lacking(name).startswith("the processor has no ")
        return
    asked, got = ALL[name].sets["OPENBLAS_CORETYPE"], set(seen(name)["openblas"].values())
    wanted = [{asked}]
    if asked in ("Zen", "Sapphirerapids"):  # what pip installs lacks them; other builds have them
        wanted += [set(seen(other)["openblas"].values()) for other in ("haswell", "own") if not lacking(other)]
    assert got in wanted


def test_the_libraries_of_numpy_and_of_scipy_are_both_looked_at():
    wheels = {Path(package.__file__).parent.with_name(f"{package.__name__}.libs") for package in (numpy, scipy)}
    assert {folder.name for folder in wheels if folder.is_dir()} <= set(own()["openblas"])


COMPILED = "from tests.small_kernels import double; made = double.compile(); made(1.0); "
COMPILED += "print(made.targetctx.codegen().magic_tuple()[1:], made.stats.cache_misses)"


@pytest.mark.slow
def test_numba_compiles_for_any_processor_and_keeps_that_apart(tmp_path, monkeypatch):
    """In one folder: what is compiled for one kind of processor is not taken for another, nor compiled twice."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    kept = []
    for name in ("own", "generic", "own", "generic"):
        told = " ".join(printed(name, COMPILED))
        assert ("('generic', '')" in told) == (name == "generic")
        kept.append(("Counter()" in told, len(list(tmp_path.rglob("*.nbc")))))
    assert kept == [(False, 1), (False, 2), (True, 2), (True, 2)]


USED = "from numpy.lib.introspect import opt_func_info as told; "
USED += "print(*{loop['current'] for loop in told('^add$', 'float64')['add'].values()})"


def test_numpy_uses_nothing_that_can_be_switched_off():
    assert seen("plain-numpy")["numpy"] == [] and seen("plain-numpy")["openblas"] == own()["openblas"]
    assert printed("plain-numpy", USED)[0].startswith("baseline")
    if own()["numpy"]:
        assert not printed("own", USED)[0].startswith("baseline")


@pytest.mark.parametrize("name", CORES)
def test_there_are_as_many_threads_as_it_says(name):
    assert seen(name)["threads"] == [ALL[name].cores]


def test_the_oldest_has_the_least_of_each():
    least = {"openblas": "nehalem", "numba": "generic", "numpy": "plain-numpy", "threads": "one-thread"}
    assert {key: seen("oldest")[key] for key in least} == {key: seen(name)[key] for key, name in least.items()}


def test_what_is_set_outside_does_not_matter(monkeypatch):
    for name in portable.TAKEN_AWAY:
        monkeypatch.setenv(name, {"OPENBLAS_CORETYPE": "Nehalem", "NUMBA_CPU_NAME": "generic"}.get(name, "1"))
    monkeypatch.setenv("NPY_DISABLE_CPU_FEATURES", " ".join(own()["numpy"]))
    monkeypatch.delenv("NPY_ENABLE_CPU_FEATURES")
    assert portable.look(ALL["own"]) == own()


def test_a_processor_that_lacks_something_is_left_out():
    poor = {"features": ["SSE42", "AVX2", "FMA3"], "threads": [1]}
    assert {n: reason for n, c in ALL.items() if (reason := portable.lacking(c, poor))} == {
        "skylakex": "the processor has no AVX512_SKX",
        "sapphirerapids": "the processor has no AVX512_SPR",
        "two-threads": "there are fewer than 2 cores",
    }


# ---- what is run, and what is said of it

TEST = """
import os

def test_well():
    pass

def test_threads():
    assert len(os.sched_getaffinity(0)) > 1
"""


@pytest.mark.skipif(len(getattr(os, "sched_getaffinity", lambda _: ())(0)) < 2, reason="takes two cores")
@pytest.mark.slow
def test_it_goes_on_after_a_failure_and_says_so(tmp_path, monkeypatch, capsys):
    (tmp_path / "test_it.py").write_text(TEST)
    start = portable.started
    monkeypatch.setattr(portable, "started", lambda c, words, **rest: "compile" in words or start(c, words, **rest))
    monkeypatch.setattr(portable, "look", lambda made: seen(made.name))
    monkeypatch.setattr(portable, "LOGS", tmp_path / "logs")
    names = ["one-thread", "two-threads", "own"]  # run in the order of the table
    monkeypatch.setattr(sys, "argv", ["portable.py", *names, "--tests", str(tmp_path / "test_it.py")])
    assert portable.main() == 1
    lines = capsys.readouterr().out.splitlines()
    assert re.match(r"own +2 passed, 0 failed, 0 skipped in \d+ s; OpenBLAS ", lines[0])
    assert re.match(
        r"one-thread +1 passed, 1 failed, 0 skipped in \d+ s \(exit status 1, .*one-thread.txt\); ", lines[1]
    )
    same = seen("two-threads") == own()
    assert re.match(r"two-threads +" + ("computes as own does; " if same else "2 passed, 0 failed, "), lines[2])
    assert lines[3:] == ["tests fail in: one-thread"]
    assert "test_threads" in (tmp_path / "logs" / "one-thread.txt").read_text()


def test_a_name_that_is_none_is_refused(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["portable.py", "haswel"])
    with pytest.raises(SystemExit) as caught:
        portable.main()
    assert caught.value.code == 2 and "no configuration haswel; there are own, nehalem" in capsys.readouterr().err


def test_no_report_is_no_success(tmp_path):
    assert portable.counts(tmp_path / "none.xml") == {}


MUST_RUN = (
    "tests/lacsolver/test_schur.py::test_the_saddle_system[factor-4-free to move, two sets]",
    "tests/lacsolver/test_contact_held.py::test_a_beam_on_a_foundation_lifts_its_ends[QUAD4-QUAD8-none]",
    "tests/lacsolver/test_contact_held.py::test_the_status_at_the_start_does_not_change_the_answer",
)


def test_the_tests_that_have_shown_a_processor_are_run():
    """The tests that failed with AVX-512 and passed without it are among those that are run."""
    assert all((ROOT / path).exists() for path in portable.TESTS)
    files = sorted({test.partition("::")[0] for test in MUST_RUN})
    assert all(any(Path(file).is_relative_to(path) for path in portable.TESTS) for file in files)
    words = ["-m", "pytest", "--collect-only", "-q", "-m", portable.MARKS, "-p", "no:cacheprovider", *files]
    done = portable.started(ALL["own"], words, stdout=subprocess.PIPE)
    assert set(MUST_RUN) <= set(done.stdout.splitlines())
