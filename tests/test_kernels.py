"""Kernels: when they are compiled, that both forms give the same, where they are cached, and what is logged."""

from __future__ import annotations

import copy
import json
import logging
import math
import os
import subprocess
import sys
from collections import Counter
from threading import Lock

import numpy as np
import pytest
from numba import typeof

from lacmesh import kernels
from lacmesh.kernels import SIGNATURES, Kernel, listed
from lacmesh.threads import in_threads, worthwhile
from tests import REPOSITORY
from tests.kernels_to_try import DATA
from tests.samples import each_option, samples
from tests.small_kernels import double, fractions
from tools.record_kernels import described, recorded


def ran(*words, folder, **variables):
    """Run Python with words, with kernels kept in a folder of its own; it must succeed."""
    env = {**os.environ, "PYTHONPATH": str(REPOSITORY), "NUMBA_CACHE_DIR": str(folder), **variables}
    done = subprocess.run([sys.executable, *words], cwd=REPOSITORY, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done


COMPILED = """
import logging, resource, signal
logging.basicConfig(level=logging.INFO)
if {full}:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (16, resource.RLIM_INFINITY))
from tests.small_kernels import double
print(double.fast(2.0), double.compiled.stats.cache_misses.total(), file=__import__("sys").stderr)
"""


def compiled(folder, full=False):
    """What a process prints in which a kernel is compiled or taken from a folder, on a full disk or not; its log."""
    words = ["-B"] * full  # Python would keep half of a module that it compiles
    *log, last = ran(*words, "-c", COMPILED.format(full=full), folder=folder).stderr.splitlines()
    return last, any("compiling" in line for line in log)


@pytest.fixture
def compiled_here(tmp_path, monkeypatch, caplog):
    """As `compiled`, with another kernel of the same code in this process, which knows nothing of the others."""
    monkeypatch.setattr(kernels, "cache_folder", lambda: tmp_path)
    caplog.set_level(logging.INFO, "lacmesh")

    def once():
        caplog.clear()
        kernels._log_compilation.cache_clear()
        one = Kernel(double.function)
        Kernel.known.remove(one)
        return f"{one.fast(2.0)} {one.compiled.stats.cache_misses.total()}", "compiling" in caplog.text

    return once


@pytest.mark.rows("*.nbi")
@pytest.mark.parametrize("damaged", ["*.nbc", "*.nbi"])
def test_a_kernel_is_cached_and_its_compilation_is_logged_and_a_damaged_cache_is_made_again(
    compiled_here, tmp_path, damaged
):
    assert compiled_here() == ("4.0 1", True)
    assert compiled_here() == ("4.0 0", False)
    for path in tmp_path.rglob(damaged):
        path.write_bytes(path.read_bytes()[:100])
    assert compiled_here()[0].startswith("4.0")
    assert compiled_here() == ("4.0 1", True)
    assert compiled_here() == ("4.0 0", False)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits of files as Linux has them")
def test_a_full_disk_keeps_nothing_and_stops_nothing(tmp_path):
    assert compiled(tmp_path, full=True)[0].startswith("4.0")
    assert compiled(tmp_path)[1]


@pytest.mark.parametrize("cores", [1, 3])
def test_there_are_as_many_threads_as_cores_that_may_be_used_but_one_for_few_rows(monkeypatch, cores):
    """Not as the machine has: a process may be held to some, as by taskset or in a container."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(cores)), raising=False)
    assert [worthwhile(3, n) for n in (0, 1023, 1024, 2000)] == [1, 1, 2, 3]
    parts = []
    in_threads(parts.append, 12)
    assert parts == [slice(0, 12)]
    parts.clear()
    in_threads(parts.append, 12_000)
    size = 12_000 // cores
    assert sorted((part.start, part.stop) for part in parts) == [(k, k + size) for k in range(0, 12_000, size)]


# ---- the two forms


def same(a, b):
    """True if two results, or arguments that were overwritten, agree to rounding."""
    if isinstance(a, tuple):
        return len(a) == len(b) and all(same(*pair) for pair in zip(a, b, strict=True))
    a, b = np.asarray(a), np.asarray(b)
    if a.dtype.kind not in "fc":
        return np.array_equal(a, b)
    scale = np.abs(a[np.isfinite(a)]).max(initial=0.0)
    room = 1e-4 if a.dtype == np.float32 else 1e-9
    return a.shape == b.shape and np.allclose(a, b, rtol=room, atol=room * scale, equal_nan=True)


@pytest.mark.fuzz
def test_every_kernel_gives_the_same_compiled_and_as_it_stands_and_is_listed(tmp_path):
    """Compared in the first calls of each form; after a change of arguments: `python -m tools.record_kernels`."""
    different, alone, calls, most = [], Lock(), Counter(), samples(6, math.inf)

    def both(kernel, *arguments):
        with alone:  # other threads write into the same arrays
            form = kernel, str(described(arguments))
            calls[form] += 1
            if calls[form] > most:
                return kernel.fast(*arguments)
            mine = copy.deepcopy(arguments)
            plain = kernel.py_func(*mine)
            made = kernel.fast(*arguments)
            if not (same(made, plain) and same(arguments, mine)):
                different.append(kernel.__name__)
        return made

    compared = recorded(tmp_path, both)
    assert not different
    assert compared == json.loads(SIGNATURES.read_text())
    inside = {value for one in Kernel.known for name in one.function.__code__.co_names
              if isinstance(value := one.function.__globals__.get(name), Kernel)}  # fmt: skip
    own = {f"{k.__module__}.{k.__qualname__}" for k in Kernel.known if k not in inside}
    assert {name for name in own if not name.startswith(("tests.", "test_", "benchmarks."))} <= set(compared)


@pytest.mark.parametrize("by", [2.0, 0.0, np.float64(0.0)])
def test_numbers_are_divided_by_zero_as_numpy_does_it(by):
    a = np.array([1.0, 0.0, -1.0])
    plain, made = fractions.py_func(a, by), fractions.fast(a, by)
    assert np.array_equal(plain, made, equal_nan=True)
    assert math.isnan(plain[3]) and plain[2] == np.inf


@pytest.fixture
def fresh(monkeypatch, tmp_path):
    """Kernels before their first call: one, one that is cached, one that takes long to compile."""
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    monkeypatch.setattr(kernels, "cache_folder", lambda: tmp_path)

    def twice(x):
        return 2 * x

    monkeypatch.setattr(Kernel, "known", [])
    one = {"": Kernel(twice), "cached": Kernel(twice, borrows=True), "costly": Kernel(twice, costly=3)}
    one["cached"].folder.mkdir()
    return one


@pytest.mark.parametrize(
    ("kind", "sizes", "compiled"),
    [
        ("", (kernels.CACHED_FROM - 1, kernels.COMPILED_FROM - 1), False),
        ("", (kernels.COMPILED_FROM,), True),
        ("cached", (kernels.CACHED_FROM - 1,), False),
        ("cached", (kernels.CACHED_FROM,), True),
        ("costly", (3 * kernels.COMPILED_FROM - 1,), False),
        ("costly", (3 * kernels.COMPILED_FROM,), True),
    ],
)
def test_small_work_is_done_as_it_stands_and_large_work_compiled(fresh, kind, sizes, compiled):
    for size in sizes:
        assert (fresh[kind](np.ones(size)) == 2).all() and (fresh[kind].compiled is not None) == compiled


def test_the_form_of_a_call_does_not_depend_on_earlier_calls(fresh, monkeypatch):
    """Small calls are done as they stand, whatever their sum, also after a large one for which it was compiled."""
    one, small, large = fresh[""], np.ones(kernels.COMPILED_FROM - 1), np.ones(kernels.COMPILED_FROM)
    for _ in range(kernels.WORTH_CACHING // len(small) + 2):
        one(small)
    assert one.compiled is None and one.folder.is_dir()  # for the next process
    one(large)
    monkeypatch.setattr(one, "compiled", lambda x: "compiled")
    assert one(large) == "compiled" and (one(small) == 2).all()
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")  # where people debug
    assert len(fresh["cached"](large)) and fresh["cached"].compiled is None


def test_a_kernel_that_had_much_work_is_compiled_by_the_next_process(tmp_path):
    code = "import numpy as np\nfrom lacmesh import kernels\nfrom tests.small_kernels import double\n"
    code += "for _ in range(2 * kernels.WORTH_CACHING // kernels.COMPILED_FROM):\n"
    code += "    double(np.ones(kernels.COMPILED_FROM // 2))\nprint(double.compiled is not None)"
    said = [ran("-c", code, folder=tmp_path, NUMBA_DISABLE_JIT="0").stdout.strip() for _ in range(2)]
    assert said == ["False", "True"]


COMMANDS = {
    "check": ["lacmesh", "check", str(DATA / "two_blocks.msh"), "--slave", "slave", "--master", "master"],
    "quality": ["lacmesh", "quality", str(DATA / "two_blocks.msh")],
    "view": ["lacmesh", "view", str(DATA / "two_blocks.msh"), "-o", "{folder}/page.html"],
    "run": ["lacsolver", "run", str(DATA / "two_blocks.toml"), "-o", "{folder}/results"],
}


@pytest.mark.rows("check-0", "run-1")
@pytest.mark.parametrize(
    ("name", "debug"), each_option([*((name, "0") for name in COMMANDS), ("check", "1"), ("run", "1")])
)
def test_a_first_command_on_a_small_model_compiles_nothing(name, debug, tmp_path):
    words = [word.format(folder=tmp_path) for word in COMMANDS[name]]
    done = ran("-m", *words, folder=tmp_path / "kept", NUMBA_DISABLE_JIT=debug)
    assert "internal error" not in done.stderr and "compiling" not in done.stderr
    assert not list(tmp_path.rglob("*.nbc"))


# ---- what is cached, and where


def of_code(code, name):
    """A kernel that code defines."""
    space = {"kernel": kernels.kernel, "np": np, "__name__": "some"}
    before = len(Kernel.known)
    exec(code, space)
    del Kernel.known[before:]
    return space[name]


def test_the_folder_of_a_kernel_is_named_by_its_code_and_by_the_kernels_and_constants_that_it_names():
    text = "LEAST = {}\n@kernel\ndef inner(x):\n    return x + {} * LEAST\n"
    text += "@kernel\ndef outer(x):\n    '{}'\n    return inner(x)\n"
    rows = [(1, 1, "one word"), (1, 1, "another"), (2, 1, ""), (1, 2, ""), ("np.ones(2)", 1, "")]
    folders = [of_code(text.format(*row), "outer").folder for row in rows]
    assert folders[0] == folders[1] and len(set(folders)) == 4


def test_what_cannot_be_cached_beside_the_package_is_cached_for_the_user(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "mine"))
    monkeypatch.setattr(kernels, "__file__", str(tmp_path / "package" / "kernels.py"))
    folder = kernels.cache_folder.__wrapped__
    assert folder().parent == tmp_path / "mine"  # there is no such package
    (tmp_path / "package").mkdir()
    assert folder() == tmp_path / "package" / "__pycache__" / "kernels"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "chosen"))
    assert folder().parent == tmp_path / "chosen"


def test_the_cache_of_earlier_sources_is_removed(tmp_path, monkeypatch):
    monkeypatch.setattr(kernels, "cache_folder", lambda: tmp_path)
    now = Kernel(double.function)
    Kernel.known.remove(now)
    earlier, other = now.folder.with_suffix(".earlier"), tmp_path / "tests.small_kernels.other.cpython.digest"
    earlier.mkdir()
    other.mkdir()
    assert now.fast(2.0) == 4.0 and sorted(tmp_path.iterdir()) == sorted([now.folder, other])


def test_compile_compiles_all_that_is_listed_or_says_where_it_cannot(tmp_path):
    words, env = [sys.executable, "-m", "lacmesh", "compile"], {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    done = subprocess.run(words, cwd=tmp_path, env=env, capture_output=True, text=True)
    assert done.returncode == 0 and f"compiling: {len(listed())} of {len(listed())}\ncompiled" in done.stdout
    code = "import sys\nfrom lacmesh.kernels import Kernel, compile_listed, listed\n"
    code += "for name in listed():\n    compile_listed(name)\n"
    code += "print(sum(k.compiled.stats.cache_misses.total() for k in Kernel.known if k.compiled))"
    again = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True)
    assert again.stdout == "0\n"
    (tmp_path / "file").write_text("")
    done = subprocess.run(words, env=env | {"NUMBA_CACHE_DIR": str(tmp_path / "file")}, capture_output=True, text=True)
    assert done.returncode == 3 and "by NUMBA_CACHE_DIR" in done.stderr


@pytest.mark.parametrize(
    ("part", "refused"),
    [("x", True), ("x[1:]", True), ("(x, 1.0)", True), ("np.zeros(2)[0]", True), ("x[1] + x[2]", False)],
)
def test_a_part_that_borrows_arrays_makes_none_and_returns_none(part, refused, tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    code = f"@kernel(borrows=True)\ndef part(x):\n    return {part}\n@kernel\ndef whole(x):\n    return part(x)\n"
    whole = of_code(code, "whole")
    if not refused:
        assert whole.fast(np.ones(3)) == 2.0
        whole.check_parts()
        return
    with pytest.raises(Exception, match=r"borrows arrays|NRT required|returning of array"):
        whole.compile().compile((typeof(np.ones(3)),))
        whole.check_parts()
