"""Noise in last bits (`noise.py`): how much a number changes, that it always changes in the same way, and where."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
BEGIN = "import numpy as np; from tests.noise import shaken; x = np.random.default_rng(0).normal(size=(60, 50)); "


def printed(code: str, **environment: str) -> list[str]:
    """Lines that Python prints with noise, as a command that a test starts."""
    variables = os.environ | {"PYTHONPATH": os.pathsep.join((str(ROOT / "tests/noise_at_start"), str(ROOT)))}
    variables |= {"NOISE_SEED": "1", **environment}
    done = subprocess.run(
        [sys.executable, "-c", code], env=variables, cwd=ROOT, capture_output=True, text=True, check=True
    )
    return done.stdout.split("\n")[:-1]


def test_numbers_change_by_few_units_in_the_last_place_and_always_alike():
    code = BEGIN + (
        "y = shaken(x, 4); far = (y.view(np.int64) - x.view(np.int64)).ravel(); "
        "print(sorted(set(far.tolist())), (shaken(x, 4) == y).all(), (shaken(x[::2, 3], 4) == y[::2, 3]).all()); "
        "print((shaken(x, 4, salt=1) == y).mean() < 0.3, shaken(x.T, 4).flags.f_contiguous)"
    )
    one, other = (printed(code, NOISE_SEED=seed) for seed in "12")
    assert one == other == [f"{list(range(-4, 5))} True True", "True True"]
    sums = {printed(BEGIN + "print(float(shaken(x, 4).sum()).hex())", NOISE_SEED=seed)[0] for seed in "123"}
    assert len(sums) == 3


EXACT = "0.0, -0.0, 1.0, -3.0, 0.5, 1e6, 2.0**-1022, 5e-324, 1e-310, 1.7976931348623157e308, np.inf, -np.inf, np.nan"


def test_integers_halves_and_numbers_at_the_ends_stay():
    code = f"x = np.array([{EXACT}]); print((shaken(x, 4).view(np.uint64) == x.view(np.uint64)).all())"
    assert printed(BEGIN + code) == ["True"]


#: a function that is changed by noise: True where its result is not what it is without
CHANGED = {
    "elementary functions": "np.log(x * x)",
    "a number": "np.exp(np.linspace(0.1, 0.9, 50))",
    "sums": "np.einsum('ij,ij->i', x, x)",
    "dense equations": "np.linalg.solve(x[:50].copy(), np.ones(50))",
    "norms": "np.linalg.norm(x, axis=1)",
    "scipy": "__import__('scipy.linalg').linalg.lu_solve(__import__('scipy.linalg').linalg.lu_factor(x[:50]), x[51])",
    "a sparse factor": "splu(csc_array(x[:50].copy() + 9 * np.eye(50))).solve(x[51].copy())",
    "rslab": "factorise(csr_array(x.T @ x)).solve(x[51].copy())",
    "a kernel": "double(x)",
}
IMPORTS = """
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu
from tests.lacsolver.systems import factorise
from lacmesh.kernels import kernel
@kernel
def double(x):
    out = np.empty_like(x)
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            out[i, j] = x[i, j] * 1.1
    return out
"""


def test_what_is_computed_has_noise():
    code = (
        BEGIN + IMPORTS + "\n".join(f"print(*[float(v).hex() for v in ({each}).ravel()])" for each in CHANGED.values())
    )
    with_noise = printed(code)
    without = subprocess.run(
        [sys.executable, "-c", code.replace("from tests.noise import shaken", "pass")],
        env={k: v for k, v in os.environ.items() if k not in ("NOISE_SEED", "PYTHONPATH")} | {"PYTHONPATH": str(ROOT)},
        cwd=ROOT, capture_output=True, text=True, check=True,
    ).stdout.split("\n")[:-1]  # fmt: skip
    for name, line, plain in zip(CHANGED, with_noise, without, strict=True):
        ours, theirs = (np.array([float.fromhex(v) for v in own.split()]) for own in (line, plain))
        assert line != plain, name
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-12 * np.abs(theirs).max(), err_msg=name)


def test_arrays_that_are_not_contiguous_have_other_noise():
    code = BEGIN + "y = np.abs(x); print((np.log(y[:, 7].copy()) == np.log(y)[:, 7]).all()); "
    code += "print((np.log(y[:, 7]) == np.log(y)[:, 7]).all())"
    assert printed(code) == ["True", "False"]


def test_views_and_what_is_written_into():
    """einsum gives a diagonal to write into, and `out` is the array that was given."""
    code = BEGIN + (
        "y = np.zeros((4, 4)); np.einsum('ii->i', y)[:] += 1.0; print(y.trace())\n"
        "out = np.empty((60, 50)); same = np.exp(x, out=out); print(same is out, (out == np.exp(x)).all())"
    )
    assert printed(code) == ["4.0", "True True"]


def test_nothing_more_is_imported():
    code = (
        "import sys; print([name for name in ('numpy', 'scipy', 'numba', 'rslab', 'lacmesh') if name in sys.modules])"
    )
    assert printed(code) == ["[]"]


@pytest.mark.slow
@pytest.mark.parametrize("words", [["tests/test_sizes.py"], ["-p", "tests.noise", "lacsolver/errors.py"]])
def test_pytest_has_it_where_the_seed_is_set(words, tmp_path):
    """And the commands that tests start."""
    probe = tmp_path / "probe.py"
    probe.write_text(
        "import subprocess, sys\n"
        "def pytest_sessionfinish():\n"
        "    code = 'import numpy; print(type(numpy.log).__name__)'\n"
        "    import numpy; print('here', type(numpy.log).__name__)\n"
        "    print('there', subprocess.run([sys.executable, '-c', code], capture_output=True, text=True).stdout)\n"
    )
    variables = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | {"NOISE_SEED": "2"}
    command = [sys.executable, "-m", "pytest", "-q", "-s", "-p", "no:cacheprovider", "-p", "probe", "--co", *words]
    done = subprocess.run(
        command, env=variables | {"PYTHONPATH": str(tmp_path)}, cwd=ROOT, capture_output=True, text=True
    )
    assert "here Noisy" in done.stdout and "there Noisy" in done.stdout, done.stdout + done.stderr
