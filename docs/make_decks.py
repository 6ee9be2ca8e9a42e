"""Write the tables of docs/decks.md: decks of CalculiX's own tests, and impacts, by CalculiX and by lacsolver.

    python docs/make_decks.py [FOLDER]    FOLDER: of the decks (default: ../shared/reference/decks)

It needs CalculiX (`ccx`), and takes some minutes, most of them for the impacts. Each deck is run by ccx as it stands,
after `lacmesh convert`, and after `lacmesh cut` of its first slave; it is imported, solved, and its displacements are
compared at the end.
"""

from __future__ import annotations

import re
import shutil
import sys
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import lacmesh
from lacmesh import LacmeshError, cut_skin
from lacsolver.decks import import_deck
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.results.figures import step_figures

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
from tests.formats.decks import solved, tables  # noqa: E402 (the checkout's tests are no package that is installed)
from tests.lacsolver.deck_texts import Block, bar_on_wall, impact, printed  # noqa: E402

PAGE = ROOT / "docs" / "decks.md"
DECKS = ROOT.parent / "shared" / "reference" / "decks"
_HEAD = "| deck | elements | after `convert` | its slave cut | `lacsolver import` | displacements |"
_IMPACTS = "| deck | impulse, ccx | lacsolver | largest force, ccx | lacsolver | its time | displacement |"
_PRINT = "*NODE PRINT, NSET=everynode\nU\n*END STEP"


def main() -> None:
    """Write the table."""
    program = shutil.which("ccx")
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else DECKS
    if program is None or not folder.is_dir():
        sys.exit(
            f"make_decks.py needs CalculiX (ccx) and a folder of decks; there is no {folder if program else 'ccx'}"
        )
    warnings.simplefilter("ignore")
    rows = [_HEAD, "|---|---|---|---|---|---|"]
    for deck in sorted(folder.glob("*.inp")):
        with tempfile.TemporaryDirectory() as work:
            rows.append("| " + " | ".join(_row(deck, Path(work), program)) + " |")
        print(rows[-1], flush=True)
    _write("decks", rows)
    _write("impacts", [_IMPACTS, "|---|---|---|---|---|---|---|", *_impacts(program)])


def _write(name: str, rows: list[str]) -> None:
    """Write a table between its marks in the page."""
    begin, end = f"<!-- {name}: begin -->\n", f"<!-- {name}: end -->"
    before, _, rest = PAGE.read_text().partition(begin)
    PAGE.write_text(before + begin + "\n".join(rows) + "\n" + end + rest.partition(end)[2])


def _row(deck: Path, work: Path, program: str) -> Iterator[str]:
    """Yield the cells of the row of a deck."""
    mesh = lacmesh.read(deck)
    assert mesh.deck is not None
    types = dict.fromkeys(card.options.get("TYPE", "").strip().upper() for card in mesh.deck.named("ELEMENT"))
    yield deck.stem
    yield ", ".join(types)
    shutil.copy(deck, work / "a.inp")
    before = _run(work / "a.inp", program)
    lacmesh.write(work / "b.inp", mesh)
    yield _same(before, _run(work / "b.inp", program))
    yield _cut(mesh, work / "c.inp", program)
    yield from _imported(deck, work, program)


def _run(path: Path, program: str) -> list[tuple[str, np.ndarray]] | None:
    """Return the tables of a deck's .dat, None if CalculiX does not run it to its end."""
    try:
        return tables(solved(path, program))
    except AssertionError:
        return None


def _same(before: list | None, after: list | None) -> str:
    if before is None or after is None:
        return "is run by neither" if before is after else "differs"
    if not before and not after:
        return "runs; nothing is printed"
    same = len(before) == len(after) and all(
        what == other and np.array_equal(a, b, equal_nan=True)
        for (what, a), (other, b) in zip(before, after, strict=True)
    )
    return "same digits" if same else "differs"


def _cut(mesh: lacmesh.Mesh, path: Path, program: str) -> str:
    """Cut the slave of the first contact pair, and run the deck."""
    assert mesh.deck is not None
    pairs = [card for card in mesh.deck.named("CONTACTPAIR") if card.data]
    there = mesh.deck.surface_group(pairs[0].data[0].fields[0]) if pairs else None
    if there is None:
        return ""
    if there[0] == "NODE":
        return "its slave is a surface of nodes"
    try:
        lacmesh.write(path, cut_skin(mesh, there[1], hexa="hexa").mesh)
    except LacmeshError as error:
        return str(error).rpartition("/")[2].partition(";")[0]
    return "runs" if _run(path, program) is not None else "does not run"


def _imported(deck: Path, work: Path, program: str) -> Iterator[str]:
    """Yield how a deck is imported, and how far its displacements are from those of CalculiX."""
    try:
        import_deck(deck, work / "case.toml")
    except LacmeshError as refused:
        names = dict.fromkeys(re.findall(r"line \d+: \*([A-Z -]+): ", str(refused)))
        yield "refused: " + ", ".join(f"`*{name}`" for name in names)
        yield ""
        return
    yield "yes"
    text = deck.read_text()
    full = re.sub(r"(?i)(TYPE\s*=\s*C\w*?\d)[RI]\b", r"\1", text)
    found = [_difference(text, work, program)]
    if full != text:
        found.append(f"{_difference(full, work, program)} with full integration")
    yield ", ".join(found)


def _difference(text: str, work: Path, program: str) -> str:
    """Return the largest difference of the displacements at the end, of all nodes, relative to the largest of them."""
    first = re.search(r"(?im)^\*STEP", text)
    assert first is not None
    text = f"{text[: first.start()]}*NSET, NSET=everynode, GENERATE\n1, 99999\n{text[first.start() :]}"
    (work / "model.inp").write_text(re.sub(r"(?im)^\*END STEP", _PRINT, text))
    printed = _run(work / "model.inp", program)
    rows = [rows for head, rows in printed or [] if head.startswith("displacements") and "EVERYNODE" in head]
    made = import_deck(work / "model.inp", work / "case.toml")
    try:
        problem = Problem.of(made.case, made.mesh)
        *_, last = march(problem)
    except LacmeshError as error:
        return f"not solved ({str(error).partition(':')[0]})"
    place = {int(number): k for k, number in enumerate(problem.space.mesh.node_number)}
    dim, attached = problem.space.dim, problem.space.attached
    nodes = np.array([place.get(int(number), -1) for number in rows[-1][:, 0]])
    there = (nodes >= 0) & attached[nodes]
    mine, theirs = last.u.reshape(-1, dim)[nodes[there]], rows[-1][there, 1 : 1 + dim]
    return f"{np.abs(mine - theirs).max() / np.abs(theirs).max():.0e}"


def _impacts(program: str) -> Iterator[str]:
    """Yield the rows of the impacts: impulse and largest force at the supports, and the flying body's mean motion."""
    decks = {
        "a bar of 16 C3D8 on a wall": bar_on_wall(16, 80),
        "the same with NLGEOM": bar_on_wall(16, 80, options=", NLGEOM"),
        "a ball of 8 by 8 by 8 C3D8 on a block": ball_on_block(8, 150),
    }
    for name, text in decks.items():
        with tempfile.TemporaryDirectory() as work:
            row = f"| {name} | {_impact(text, Path(work), program)} |"
        print(row, flush=True)
        yield row


def ball_on_block(cells: int, count: int, gap: float = 0.004) -> str:
    """Return the deck of a ball of radius 1, a cube of bricks blown up, which hits a block that is held at its base."""
    block = Block("W", (-1.2, -1.2, -1), (1.2, 1.2, 0), (3 * cells // 2, 3 * cells // 2, cells // 2), first=10000)
    ball = Block("B", (-1, -1, -1), (1, 1, 1), (cells,) * 3)
    x, y, z = (ball.points**2).T / 2
    blown = np.sqrt(np.stack([1 - y - z + 4 * y * z / 3, 1 - x - z + 4 * x * z / 3, 1 - x - y + 4 * x * y / 3], axis=1))
    ball.places = ball.points * blown + [0, 0, 1 + gap]
    return impact(block, ball, "W_Z0", 0.3, "", 1e5, 2.0, 0.002, count, ", NLGEOM")


def _impact(text: str, work: Path, program: str) -> str:
    """Return the cells of an impact."""
    (work / "model.inp").write_text(text)
    report = solved(work / "model.inp", program)
    times, rows = printed(report, "displacements")
    theirs = np.array([part[:, 3].mean() for part in rows])
    forces = np.array([part[0, 2] for part in printed(report, "total force")[1]])
    made = import_deck(work / "model.inp", work / "case.toml")
    problem = Problem.of(made.case, made.mesh)
    states = list(march(problem))
    nodes = np.isin(problem.space.mesh.node_number, rows[0][:, 0])
    t = np.array([state.time for state in states])
    mine = np.array([state.u.reshape(-1, 3)[nodes, 2].mean() for state in states])
    support = made.case.displacement[0].group
    pushes = np.array([step_figures(problem, state).reactions[support][2] for state in states])
    cells = [f"{np.diff(s) @ (f[1:] + f[:-1]) / 2:.3g}" for s, f in ((times, forces), (t, pushes))]
    cells += [f"{forces.max():.3g}", f"{pushes.max():.3g}"]
    cells.append(f"{times[forces.argmax()]:.3f}, {t[pushes.argmax()]:.3f}")
    cells.append(f"{np.abs(np.interp(times, t, mine) - theirs).max() / np.abs(theirs).max():.1%}")
    return " | ".join(cells)


if __name__ == "__main__":
    main()
