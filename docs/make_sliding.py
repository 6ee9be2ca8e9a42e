"""Run the cases of data/sliding, and make their pictures and films (docs/tutorials/friction.md).

    python docs/make_sliding.py [FOLDER]

Some minutes on two cores. Results go to FOLDER (default: build/sliding); a run that is done there is not repeated.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from lacsolver.cli import main as lacsolver
from lacsolver.pictures.filming import film

DOCS = Path(__file__).parent
CASES = DOCS.parent / "data" / "sliding"
PICTURES = DOCS / "sliding"
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
    """Run the cases that are not done yet, and draw all."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, look in SHOWN.items():
        solve(name, folder / name)
        for suffix, frames, most in (SHEET, FILM):
            path = PICTURES / f"{name}{suffix}"
            film(folder / name, path, frames=frames, rate=10.0, **look)
            assert path.stat().st_size < most, f"{path} has {path.stat().st_size} bytes"


def solve(name: str, folder: Path) -> None:
    """Run a case that is not done yet."""
    results = folder / "results.json"
    if not results.exists() or json.loads(results.read_text())["status"] != "done":
        status = lacsolver(["run", str(CASES / f"{name}.toml"), "-o", str(folder), "--force"])
        if status:
            sys.exit(status)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS.parent / "build" / "sliding")
