"""The gallery: a picture of every case in data/ and of every tutorial, with its file and the page about it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from web.markdown import escaped

ROOT = Path(__file__).resolve().parents[2]


class Entry(NamedTuple):
    """A picture and the page about it, paths from docs/, and the file that makes what is shown, from the repository."""

    title: str
    picture: str
    file: str
    page: str


#: the pictures, in the order of the page
ENTRIES = (
    Entry("Two blocks", "figures/two_blocks_pressure.png", "data/two_blocks.toml", "tutorials/first_run.md"),
    Entry("A press fit", "figures/press_fit_smooth.png", "data/press_fit.toml", "solver.md"),
    Entry("A mesh of one's own", "tutorials/pressure.png", "docs/tutorials/own_mesh.py", "tutorials/own_mesh.md"),
    Entry("A pin in a lug, from CAD", "tutorials/lug_pressure.png", "data/pin_in_lug.step", "tutorials/step_to_med.md"),
    Entry("A pin of linear cells", "tutorials/pin_smooth.png", "data/make_pin_in_lug.py", "tutorials/pin_in_lug.md"),
    Entry("A clamp", "tutorials/clamp.png", "data/friction/clamp.toml", "tutorials/friction.md"),
    Entry("Sheared cylinders", "tutorials/cylinders.png", "data/friction/cylinders.toml", "tutorials/friction.md"),
    Entry("A flange joint", "tutorials/flange.png", "data/flange/flange.toml", "tutorials/flange.md"),
    Entry("An imprint in steel", "figures/imprint.png", "data/plastic/imprint.toml", "case.md"),
    Entry("A ring on a block", "sliding/ring.gif", "data/sliding/ring.toml", "tutorials/friction.md"),
    Entry("Ironing in the plane", "sliding/ironing_2d.gif", "data/sliding/ironing_2d.toml", "tutorials/friction.md"),
    Entry("Ironing in space", "sliding/ironing_3d.gif", "data/sliding/ironing_3d.toml", "tutorials/friction.md"),
    Entry("A ball between plates", "sliding/ball.gif", "data/sliding/ball.toml", "tutorials/friction.md"),
    Entry("A snap fit", "sliding/snap_fit.gif", "data/sliding/snap_fit.toml", "tutorials/friction.md"),
    Entry("A fit, in felupe", "figures/press_fit_faces.png", "docs/bridges/bridge_felupe.py", "bridges.md"),
)  # fmt: skip


def page() -> str:
    """The page: for each entry the picture, the first sentence of its file or page, and links to both."""
    return "\n".join(["# Gallery", "", "Every case and tutorial, with the file that makes it.", "", *_entries()])


def _entries() -> Iterator[str]:
    for entry in ENTRIES:
        yield from (f"## {entry.title}", "", f"[![{entry.title}](docs/{entry.picture})](docs/{entry.page})", "")
        yield from (f"{sentence(ROOT / entry.file, ROOT / 'docs' / entry.page)}", "")
        yield from (f"[The file]({entry.file}) · [the page about it](docs/{entry.page})", "")


def sentence(file: Path, about: Path) -> str:
    """The first sentence of a case's comment; of another file, that of the page about it."""
    if file.suffix == ".toml":
        comment = " ".join(
            line[1:].strip() for line in file.read_text(encoding="utf-8").splitlines() if line[:1] == "#"
        )
        return escaped(re.split(r"(?<=\w)(?:: `|\. |:\s)", comment)[0]) + "."
    body = re.sub(r"^#.*$", "", about.read_text(encoding="utf-8"), flags=re.MULTILINE).strip()
    first = " ".join(body.split("\n\n")[0].split())
    first = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", first)
    return re.split(r"(?<=[\w`)])[.:](?:\s|$)", first)[0] + "."
