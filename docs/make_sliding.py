"""Run the cases of data/sliding, and make their pictures, films and the table of docs/sliding.md.

    python docs/make_sliding.py [FOLDER]

Some minutes on two cores. Results go to FOLDER (default: build/sliding); a run that is done there is not repeated.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

from lacsolver.cli import main as lacsolver
from lacsolver.pictures.filming import film

DOCS = Path(__file__).parent
CASES = DOCS.parent / "data" / "sliding"
PAGE, PICTURES = DOCS / "sliding.md", DOCS / "sliding"
#: how each case is shown: its title, and options of `lacsolver.film`
SHOWN = {
    "ring": {
        "title": "A ring on a block",
        "curves": ["-probe.ends.uy:-reaction.ends.y"],
        "log": True,
        "scale": (1.0, 20000.0),
    },
    "ironing_2d": {
        "title": "Ironing, in the plane",
        "curves": ["probe.top.ux:-reaction.top.y", "probe.top.ux:reaction.top.x"],
    },
    "ironing_3d": {
        "title": "Ironing, in space",
        "curves": ["probe.top.ux:-reaction.top.z", "probe.top.ux:reaction.top.x"],
    },
    "ball": {
        "title": "A rubber ball, flattened to 60 % of its height",
        "curves": ["-probe.top_plate.uy:-reaction.top_plate.y"],
    },
    "snap_fit": {"title": "A snap-fit", "curves": ["probe.base.ux:reaction.base.x"]},
}
#: how many times are shown, and how large a file may be
SHEET, FILM = (".png", 6, 250_000), (".gif", 30, 1_500_000)


def main(folder: Path) -> None:
    """Run what is not done yet, draw all, and write the table."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for name, look in SHOWN.items():
        results = solved(name, folder / name)
        rows.append(row(name, results))
        for suffix, frames, most in (SHEET, FILM):
            path = PICTURES / f"{name}{suffix}"
            film(folder / name, path, frames=frames, rate=10.0, **look)
            assert path.stat().st_size < most, f"{path} has {path.stat().st_size} bytes"
    head = "| case | unknowns | steps | halvings | iterations | forces | moments |\n|---|---|---|---|---|---|---|\n"
    put("figures", head + "\n".join(rows))


def solved(name: str, folder: Path) -> dict:
    """The figures of a case's run, run now where it is not done."""
    told = folder / "results.json"
    if not told.exists() or json.loads(told.read_text())["status"] != "done":
        status = lacsolver(["run", str(CASES / f"{name}.toml"), "-o", str(folder), "--force"])
        if status:
            sys.exit(status)
    return json.loads(told.read_text())


def row(name: str, results: dict) -> str:
    """A case's row of the table."""
    steps = results["steps"]
    counts = [sum(step[key] for step in steps) for key in ("halvings", "iterations")]
    balance = [f"{results['balance'][key]:.1e}" for key in ("force", "moment")]
    unknowns = results["sizes"]["unknowns"]
    cells = [f"[{name}](#{name})", f"{unknowns:,}", len(steps), *counts, *balance]
    return "| " + " | ".join(map(str, cells)) + " |"


def put(part: str, text: str) -> None:
    """Put text between the marks of a part of the page."""
    marks = f"<!-- {part}: begin -->\n", f"<!-- {part}: end -->"
    page = PAGE.read_text(encoding="utf-8")
    made = re.sub(f"{marks[0]}.*?{marks[1]}", lambda _: f"{marks[0]}{text}\n{marks[1]}", page, flags=re.DOTALL)
    PAGE.write_text(made, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS.parent / "build" / "sliding")
