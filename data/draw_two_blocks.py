"""Draw the cut two blocks: `python data/draw_two_blocks.py MESH PICTURE`."""

from __future__ import annotations

import sys

import lacmesh
from lacmesh.view import picture


def main(source: str, target: str) -> None:
    """Draw the cut mesh in `source` into `target`."""
    mesh = lacmesh.read(source)
    title = f"two_blocks: each of the {lacmesh.Cut(mesh).n_macros} slave faces has become a macro-element"
    picture(mesh, target, camera=(-1.0, -1.6, 1.1), title=title)


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except lacmesh.LacmeshError as error:
        sys.exit(str(error))
