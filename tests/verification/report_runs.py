"""The folder of a run that never was: every kind of result, plot and picture that a report has to show."""

from __future__ import annotations

import math
import struct
import zlib
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from lacmesh.report.charts import Line, Plot
from verification.records import (
    Case,
    Outcome,
    Picture,
    Published,
    at_least,
    at_most,
    equal,
    informative,
    levels_of,
    rate,
)
from verification.running.folder import Run, read_run, write_case_result, write_results

TYPES = ("TRIA3", "TRIA6", "QUAD4", "QUAD8", "QUAD9", "TETRA4", "TETRA10", "HEXA8", "HEXA20", "HEXA27", "PENTA15")
#: markup and signs, which must stay text
NASTY = '<img src=x onerror=alert(1)> & </script> | `a` "b"'
ASTER = "code_aster 2020, LAC"


@dataclass(frozen=True)
class Given:
    """Definition of a case."""

    type: str
    young: tuple[float, float] = (210000.0, 70000.0)
    poisson: float = 0.3
    sizes: tuple[int, ...] = (4, 8, 16, 32)
    rigid: bool = False


def png(width=320, height=200, seed=0):
    """Bytes of a picture: smooth colours."""
    x, y = np.meshgrid(np.linspace(0, 1, width), np.linspace(0, 1, height))
    wave = np.exp(-8 * ((x - 0.5) ** 2 + (y - 0.5 - 0.02 * seed) ** 2))
    pixels = np.stack([60 + 190 * wave, 90 + 60 * x, 200 - 150 * wave], axis=-1).astype(np.uint8)
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def converging(wanted, first=0.1, seed=0, count=4):
    """Levels of an error that falls at about a rate."""
    h = [1 / 2**k for k in range(2, 2 + count)]
    jitter = 1 + 0.06 * np.sin(np.arange(count) * 2.3 + seed)
    return levels_of(
        h, [40 * 4**k for k in range(count)], [first * s**wanted * j for s, j in zip(h, jitter, strict=True)]
    )


def profile(title):
    """A pressure against the exact curve: steps, points and two exact lines."""
    r = np.linspace(0, 1.4, 60)
    exact = np.sqrt(np.maximum(0, 1 - r**2))
    ends = np.linspace(0, 1.4, 12)
    middle = (ends[1:] + ends[:-1]) / 2
    lines = (
        Line("exact", tuple(r), tuple(exact), "line"),
        Line("exact, finite bodies", tuple(r), tuple(exact * 1.02), "line"),
        Line("p_m", tuple(ends), tuple(np.sqrt(np.maximum(0, 1 - middle**2))), "steps"),
        Line("recovered", tuple(ends), tuple(np.sqrt(np.maximum(0, 1 - ends**2)) + 0.01), "both"),
        Line("gaps", (0.0, 0.5, math.nan, 1.0), (0.2, 0.3, 0.1, math.nan), "points"),
    )
    return Plot("pressure", title, "r / a", "p / p0", lines)


def newton(title, seed):
    """Residuals, step by step."""
    lines = tuple(
        Line(f"step {k + 1}", tuple(range(5 + k)), tuple(10.0 ** -(i**1.7 + seed / 9) for i in range(5 + k)))
        for k in range(2)
    )
    return Plot("Newton", title, "iteration", "residual", lines, log_y=True)


def hertz(k, name):
    """Rates met and missed, published figures, a plot of each kind, a picture."""
    quadratic = name not in ("TRIA3", "QUAD4", "TETRA4", "HEXA8")
    wanted = 1.4 if quadratic else 0.95
    theirs = (Published(ASTER, 1.45 if quadratic else 0.97, "R5.03.55, table 4"),)
    published = (Published("Kratos 10.4, dual mortar", 0.32, "measured here"), Published(ASTER, 0.31, "V6.04.104"))
    results = (
        rate("u in the energy norm", converging(wanted + 0.1, seed=k), wanted, source="Theorem 1, s < 5/2",
             published=theirs),
        rate("p_m in L2", converging(0.8 if k == 2 else 1.0, 0.5, k), 0.9, source="the square-root edge of p",
             reason="the edge of contact falls within a macro-element"),
        informative("rms error of the recovered pressure, %", 0.29 + 0.01 * k, reason="beside the peers",
                 published=published),
        equal("p0", 0.9997 + 1e-5 * k, 1.0, 1e-3, source="Hertz 1881", reason="the coarsest mesh gives 5e-4",
              published=(Published(ASTER, 1.0004, "V6.04.104"),)),
        at_most("balance of forces", 2e-14, 1e-12, source="action and reaction"),
    )  # fmt: skip
    plots = (profile(f"Pressure on {name}"), newton(f"Newton's residuals on {name}", k))
    pictures = (Picture(f"{name}, deformed", f"two bodies of {name} pressed together", png(seed=k)),) if k % 2 else ()
    return Outcome(results, plots, pictures)


def inf_sup(k, name):
    """A constant that stays, or falls: told or bounded; plots of a line each, which are joined."""
    h = (0.5, 0.25, 0.125)
    beta = tuple(0.3 + 0.01 * k if k != 3 else 0.3 * s for s in h)
    found = at_least("inf-sup constant", beta[-1], 0.1, source="bounded below", reason="uncut: named counter-example")
    decay = informative("decay", math.nan if k == 5 else 0.01, reason="not bounded by the theory")
    line = (Line("β", h, beta),)
    return Outcome((found, decay), (Plot("inf-sup", f"{name}", "h", "β", line, log_x=True, log_y=True),))


def patch(k, name):
    """Figures alone; one of a case is at a name with markup."""
    quantity = NASTY if k == 1 else "stress"
    return Outcome(tuple(
        at_most(q, v * (1 + k), 1e-10, source="uniform stress (Taylor & Papadopoulos 1991)",
                published=(Published("CalculiX 2.20, mortar", 3.4e-6, "measured here"),))
        for q, v in ((quantity, 3e-13), ("p_m", 8e-13), ("u", 1e-14))
    ))  # fmt: skip


SOLVED = {"patch": patch, "hertz": hertz, "inf-sup": inf_sup, "unheard-of": patch}


def make_run(path, types=TYPES[:6], twist=False):
    """Write the folder of a run, and read it again. `twist`: as a later version might find it."""
    done = []
    for family, solve in SOLVED.items():
        for k, name in enumerate(types):
            case = Case(family, f"plane-{name}", f"{family} on {name}", partial(solve, Given(name)), {"quick": 3})
            outcome = (
                Outcome(failure="SolverError: no equilibrium in step 3; try smaller steps")
                if (family, k) == ("patch", 4)
                else solve(k, name)
            )
            if twist and not outcome.failure:
                outcome = twisted(outcome, k)
            if not (twist and (family, k) == ("inf-sup", 0)):
                done.append(write_case_result(case, 4, 1.7 ** (k % 9), 200_000_000, outcome, path, ""))
    environment = {
        "lacmesh": "1.2",
        "commit": "abc1234",
        "Python": "3.11.7",
        "processor": "a processor",
        "numpy": "2.1",
    }
    write_results(path, Run(path, "1.2", "full", environment, 754.0, tuple(done)))
    return read_run(path)


def twisted(outcome, k):
    """One figure of the first case missed, errors of the second grown, the third without its last figure."""
    first = outcome.results[0]
    if k == 0:
        return replace(outcome, results=(replace(first, passed=False), *outcome.results[1:]))
    if k == 1:
        grown = tuple(replace(level, error=level.error * 1.5) for level in first.levels)
        return replace(outcome, results=(replace(first, levels=grown), *outcome.results[1:]))
    return replace(outcome, results=outcome.results[:-1]) if k == 2 else outcome
