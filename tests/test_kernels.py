"""Kernels: when they are compiled, that both forms give the same, where they are kept, and what is said of it."""

from __future__ import annotations

import copy
import json
import math
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path
from threading import Lock

import numpy as np
import pytest

from lacmesh import kernels
from lacmesh.kernels import Kernel, kept
from lacmesh.kernels.signatures import FILE, compile_signature, declared, described
from lacmesh.kernels.threads import in_threads, worthwhile
from tests.kernels_to_try import DATA
from tests.samples import each_option, samples
from tests.small_kernels import double, fractions
from tools.record_kernels import recorded

ROOT = Path(__file__).parent.parent
CODE = """
import logging, resource
logging.basicConfig(level=logging.INFO)
{limit}
from tests.small_kernels import double
print(double.compile()(2.0), double.compiled.stats.cache_misses)
"""


def ran(folder, limit=""):
    code = CODE.format(limit=limit)
    env = {**os.environ, "NUMBA_CACHE_DIR": str(folder)}
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=env, capture_output=True, text=True, check=True)
    return done.stdout.split(), "compiling" in done.stderr


def test_a_kernel_is_kept_and_said_to_be_compiled_at_first_and_where_it_is_damaged(tmp_path):
    assert ran(tmp_path) == (["4.0", "Counter({(float64,):", "1})"], True)
    assert ran(tmp_path) == (["4.0", "Counter()"], False)
    for path in tmp_path.rglob("*.nbc"):
        path.write_bytes(path.read_bytes()[:100])
    assert ran(tmp_path)[0][0] == "4.0"
    assert not ran(tmp_path)[1]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits of files as Linux has them")
def test_a_full_disk_keeps_nothing_and_stops_nothing(tmp_path):
    limit = "import signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN); "
    limit += "resource.setrlimit(resource.RLIMIT_FSIZE, (16, resource.RLIM_INFINITY))"
    assert ran(tmp_path, limit)[0][0] == "4.0"
    assert ran(tmp_path)[1]


@pytest.mark.parametrize("cores", [1, 3])
@pytest.mark.usefixtures("every_thread")
def test_there_are_as_many_threads_as_cores_that_may_be_used(monkeypatch, cores):
    """Not as the machine has: a process may be held to some, as by taskset or in a container."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(cores)), raising=False)
    parts = []
    in_threads(parts.append, 12)
    assert sorted((part.start, part.stop) for part in parts) == [
        (k, k + 12 // cores) for k in range(0, 12, 12 // cores)
    ]


def test_few_rows_have_one_thread(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2}, raising=False)
    parts = []
    in_threads(parts.append, 12)
    assert parts == [slice(0, 12)] and [worthwhile(3, n) for n in (0, 1023, 1024, 2000)] == [1, 1, 2, 3]


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
                return kernel.compile()(*arguments)
            mine = copy.deepcopy(arguments)
            plain = kernel.py_func(*mine)
            made = kernel.compile()(*arguments)
            if not (same(made, plain) and same(arguments, mine)):
                different.append(kernel.__name__)
        return made

    compared = recorded(tmp_path, both)
    assert not different
    assert compared == json.loads(FILE.read_text())
    inside = {value for one in Kernel.known for _, value in one.named() if isinstance(value, Kernel)}
    own = {f"{k.__module__}.{k.__qualname__}" for k in Kernel.known if k not in inside}
    assert {name for name in own if not name.startswith(("tests.", "test_", "benchmarks."))} <= set(compared)


@pytest.mark.parametrize("by", [2.0, 0.0, np.float64(0.0)])
def test_numbers_are_divided_by_zero_as_numpy_does_it(by):
    a = np.array([1.0, 0.0, -1.0])
    plain, made = fractions.py_func(a, by), fractions.compile()(a, by)
    assert np.array_equal(plain, made, equal_nan=True)
    assert math.isnan(plain[3]) and plain[2] == np.inf


@pytest.fixture
def fresh(monkeypatch):
    """Two kernels that nothing was asked of yet; the second is kept."""
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    monkeypatch.setattr(kernels, "has", lambda key: "is_kept" in key)

    def twice(x):
        return 2 * x

    def is_kept(x):
        return 2 * x

    monkeypatch.setattr(Kernel, "known", [])
    return Kernel(twice), Kernel(is_kept)


@pytest.mark.parametrize(
    ("kept", "sizes", "compiled"),
    [
        (0, (kernels.KEPT_FROM - 1, kernels.COMPILED_FROM - 1), False),
        (0, (kernels.COMPILED_FROM,), True),
        (1, (kernels.KEPT_FROM - 1,), False),
        (1, (kernels.KEPT_FROM,), True),
    ],
)
def test_small_work_is_done_as_it_stands_and_large_work_compiled(fresh, kept, sizes, compiled):
    for size in sizes:
        assert (fresh[kept](np.ones(size)) == 2).all() and (fresh[kept].compiled is not None) == compiled


def test_kernels_that_take_long_to_compile_are_compiled_for_more_work(fresh):
    costly = Kernel(fresh[0].function, costly=3)
    costly(np.ones(3 * kernels.COMPILED_FROM - 1))
    assert costly.compiled is None
    assert (costly(np.ones(3 * kernels.COMPILED_FROM)) == 2).all() and costly.compiled is not None


def test_the_form_of_a_call_does_not_hang_on_earlier_calls(fresh, monkeypatch):
    """Small calls are done as they stand, whatever their sum, also after a large one for which it was compiled."""
    monkeypatch.setattr(kernels, "save", lambda *_: None)
    for _ in range(kernels.WORTH_KEEPING // (kernels.COMPILED_FROM - 1) + 2):
        fresh[0](np.ones(kernels.COMPILED_FROM - 1))
    assert fresh[0].compiled is None
    fresh[0](np.ones(kernels.COMPILED_FROM))
    monkeypatch.setattr(fresh[0], "compiled", lambda x: "compiled")
    assert fresh[0](np.ones(kernels.COMPILED_FROM)) == "compiled"
    assert (fresh[0](np.ones(kernels.COMPILED_FROM - 1)) == 2).all()


def test_what_much_work_was_done_for_is_compiled_by_the_next_process(tmp_path):
    code = """
import numpy as np
from lacmesh import kernels
from tests.small_kernels import double
for _ in range(2 * kernels.WORTH_KEEPING // kernels.COMPILED_FROM):
    double(np.ones(kernels.COMPILED_FROM // 2))
print(double.compiled is not None)
"""
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "0"}
    for compiled in ("False", "True"):
        done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=env, capture_output=True, text=True)
        assert done.stdout.strip() == compiled, done.stderr


def test_nothing_is_compiled_where_people_debug(fresh, monkeypatch):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert len(fresh[0](np.ones(2 * kernels.COMPILED_FROM))) and fresh[0].compiled is None


COMMANDS = {
    "check": ["lacmesh", "check", str(DATA / "two_blocks.msh"), "--slave", "slave", "--master", "master"],
    "quality": ["lacmesh", "quality", str(DATA / "two_blocks.msh")],
    "view": ["lacmesh", "view", str(DATA / "two_blocks.msh"), "-o", "page.html"],
    "run": ["lacsolver", "run", str(DATA / "two_blocks.toml"), "-o", "results"],
}


@pytest.mark.parametrize(
    ("name", "debug"), each_option([*((name, "0") for name in COMMANDS), ("check", "1"), ("run", "1")])
)
def test_a_first_command_on_a_small_model_compiles_nothing(name, debug, tmp_path):
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept"), "NUMBA_DISABLE_JIT": debug, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-m", *COMMANDS[name]], cwd=tmp_path, env=env, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "internal error" not in done.stderr and "compiling" not in done.stderr
    assert not list(tmp_path.rglob("*.nbc"))


def test_kernels_of_a_check_load_nothing_of_scipy_and_no_compiler():
    load = """
import sys
from lacmesh.kernels.signatures import compile_signature, declared
for signature in declared():
    if signature.module.startswith(("lacmesh.surface", "lacmesh.checks", "lacmesh.topology")):
        compile_signature(signature)
sys.exit(" ".join({"scipy.linalg", "numba.np.arrayobj"} & set(sys.modules)) or None)
"""
    for _ in range(2):  # the first may have to compile some
        done = subprocess.run([sys.executable, "-c", load], cwd=ROOT)
    assert done.returncode == 0


# ---- what is kept, and where


def test_a_kernel_s_key_changes_with_the_kernels_it_calls_and_what_they_name():
    def key(code):
        names = {"kernel": kernels.kernel, "np": np, "__name__": "some"}
        exec(code, names)
        del Kernel.known[-2:]
        return names["outer"].key

    text = "LEAST = {least}\n@kernel\ndef inner(x):\n    return x + {more} * LEAST\n"
    text += "@kernel\ndef outer(x):\n    return inner(x)\n"
    keys = {key(text.format(least=a, more=b)) for a, b in ((1, 1), (1, 1), (2, 1), (1, 2), ("np.ones(2)", 1))}
    assert len(keys) == 4


def test_a_kernel_s_key_does_not_change_with_its_docstring():
    def key(words):
        names = {"kernel": kernels.kernel, "__name__": "some"}
        exec(f"@kernel\ndef one(x):\n    '{words}'\n    return x + 1\n", names)
        return Kernel.known.pop().key

    assert key("One word.") == key("Another.")


def test_what_cannot_be_kept_beside_the_package_is_kept_for_the_user(tmp_path, monkeypatch):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "mine"))
    monkeypatch.setattr(kept, "_PACKAGE", tmp_path / "package")
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "__pycache__").write_text("not a folder: nobody can write into it")
    monkeypatch.setattr(kept, "folders", kept.folders.__wrapped__)
    kept.save("some.kernel.py.old", "some.kernel.py.old.types", b"older")
    kept.save("some.kernel.py.new", "some.kernel.py.new.types", b"newer")
    assert kept.read("some.kernel.py.new.types") == b"newer"
    assert kept.read("some.kernel.py.old.types") is None  # of sources that are gone
    assert kept.writable() in list((tmp_path / "mine").iterdir())
    (tmp_path / "package" / "__pycache__").unlink()
    assert kept.writable() == tmp_path / "package" / "__pycache__"
    assert kept.read("some.kernel.py.new.types") == b"newer"  # read from both


# ---- compiling beforehand


def test_compile_compiles_all_that_is_listed(tmp_path):
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-m", "lacmesh", "compile"], cwd=tmp_path, env=env, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    count = len(declared())
    assert f"compiling: {count} of {count}\ncompiled {count} kernels in " in done.stdout
    kept._names.cache_clear()
    for one in declared():
        compile_signature(one)
    assert double.compiled is None or not double.compiled.stats.cache_misses


def test_a_folder_that_cannot_be_written_is_told(tmp_path):
    (tmp_path / "file").write_text("")
    env = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path / "file")}
    done = subprocess.run([sys.executable, "-m", "lacmesh", "compile"], env=env, capture_output=True, text=True)
    assert done.returncode == 3
    assert "cannot be written; name another folder by NUMBA_CACHE_DIR" in done.stderr


# ---- parts that borrow arrays


def _calling(part):
    """A kernel that calls a part of its own, which borrows arrays, and returns what it returns."""
    code = "@kernel(borrows=True)\ndef part(x):\n    return {}\n@kernel\ndef whole(x):\n    return part(x)\n"
    names = {"kernel": kernels.kernel, "np": np, "__name__": "some"}
    exec(code.format(part), names)
    del Kernel.known[-2:]
    return names["whole"]


@pytest.mark.parametrize("part", ["x", "x[1:]", "(x, 1.0)", "np.zeros(2)[0]"])
def test_a_part_that_borrows_arrays_makes_none_and_returns_none(part, tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    with pytest.raises(Exception, match=r"borrows arrays|NRT required|returning of array"):
        _calling(part).compile()(np.ones(3))


def test_a_part_that_borrows_arrays_returns_numbers(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert _calling("x[1] + x[2]").compile()(np.ones(3)) == 2.0
