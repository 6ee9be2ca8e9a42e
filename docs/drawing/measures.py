"""The table of docs/quality.md on the measures that are ours."""

from __future__ import annotations

from collections.abc import Iterator

from lacmesh.cells import CELLS
from lacmesh.quality.measures import measures_of

_OURS = {
    "validity": "least Jacobian determinant over corners, other nodes and integration points, over its mean",
    "corner_jacobian": "determinant of the edges that leave a corner, brought to length 1, over that of the ideal "
    "cell; the least of the corners",
    "edge_ratio": "longest edge over the shortest",
    "min_dihedral": "least angle between two facets, degrees",
    "max_dihedral": "largest angle between two facets, degrees",
    "min_corner_angle": "least angle between two edges, degrees",
    "max_corner_angle": "largest angle between two edges, degrees",
}
_BEST = {"validity": "1", "corner_jacobian": "1", "edge_ratio": "1"}


def own_table() -> Iterator[str]:
    """The measures that are ours, and the cells that have them."""
    yield "| measure | what it is | ideal | cells |"
    yield "|---|---|---:|---|"
    for name, what in _OURS.items():
        dims = sorted({cell.dim for cell in CELLS.values() if name in measures_of(cell.name)})
        words = {(1, 2, 3): "all but points", (2, 3): "surfaces, solids", (2,): "surfaces", (3,): "solids"}
        yield f"| `{name}` | {what} | {_BEST.get(name, '')} | {words[tuple(dims)]} |"
