"""Scene of a mesh to be drawn: the faces in sight, as triangles, lines and dots with their colours, and the camera.

    visible = the visible faces of bodies, slave skin and master               (`visible`)
    points = the bodies moved apart, to show the skin between them             (`placing`)
    marks, values = what findings name, a value for each cell                  (`marks`)
    layers = triangles, lines and dots with their colours                      (`layers`)

Numbers only: `view` draws them, as a picture or as a page. Curved faces follow their cells' own shape functions; cells
of order 3 and more are drawn by their corners.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.checks.findings import counted
from lacmesh.errors import some
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.origin import from_origin, origin_of_mesh
from lacmesh.scene.colours import BODIES, DOT, INK, INVALID, MASTER, PALETTE, SEVERITIES, pale, rgb
from lacmesh.scene.layers import Layer, make_layers
from lacmesh.scene.marks import MarkedFinding, Marks, Values, find_marks
from lacmesh.scene.placing import arrange, exploded, find_eye, fit_camera
from lacmesh.scene.request import Placing
from lacmesh.scene.visible import MASTER as IS_MASTER
from lacmesh.scene.visible import SLAVE, Groups, VisibleSurface, find_visible, names_of_bodies

#: the part of the picture's height above which the mesh ends, and what a line of the legend takes below it
HIGH, FOOT, LEGEND_LINE = 0.93, 0.035, 0.04
#: lines of the legend beside which a ramp stands: its name, its ends, its bar
RAMP_LINES = 3
#: in units (`unit_of`): where words begin beside a box of the legend, what a ramp takes, a letter of a legend's words
INDENT, RAMP_ROOM, LETTER = 82, 480, 12.4
#: bodies that the legend names
NAMED = 4
#: findings that get a line in the legend, and cells of theirs that get a label
LISTED, LABELLED = 5, 8


class Entry(NamedTuple):
    """A line of the legend: an `area`, an `outline` or a `dot` in one or several colours, and words."""

    kind: str
    words: str
    colours: tuple[str, ...]


class Label(NamedTuple):
    """Words at a point of the mesh, in a colour."""

    point: tuple[float, float, float]
    words: str
    colour: str


@dataclass(frozen=True)
class Scene:
    """All that is drawn, and `eye` (3,): the direction from it towards the eye. `values`: what a ramp stands for.

    `moved`: in words, how the bodies with the slave skin are moved to show it; "" if they are not.
    """

    layers: tuple[Layer, ...]
    eye: Floats
    title: str
    legend: tuple[Entry, ...]
    labels: tuple[Label, ...] = ()
    values: Values | None = None
    moved: str = ""

    @property
    def heading(self) -> str:
        """The title, with what was moved."""
        return f"{self.title} ({self.moved})" if self.title and self.moved else self.title

    @property
    def low(self) -> float:
        """The part of the picture's height below which words stand."""
        rows = max(len(self.legend), RAMP_LINES * (self.values is not None))
        return min(0.6, FOOT + LEGEND_LINE * rows)


def make_scene(
    mesh: Mesh,
    slave: Groups = None,
    master: Groups = None,
    *,
    findings: Iterable[MarkedFinding] | None = None,
    values: Values | None = None,
    **options: Any,
) -> Scene:
    """Make the scene that `view.picture` draws; `options`: of `Placing`.

    Raises RequestError, GroupNotFoundError, DataError.
    """
    placing = Placing(**options)
    given, mesh = mesh, from_origin(mesh, origin_of_mesh(mesh))  # a graphics card counts with seven digits
    visible = find_visible(mesh, slave, master, near=placing.near, cutaway=placing.cutaway)
    eye = find_eye(mesh, visible, placing.camera)
    view, bodies = arrange(mesh, visible, eye, placing)
    points = exploded(mesh, visible, view)
    marks = None if findings is None else find_marks(mesh, findings, visible.kept)
    return Scene(
        layers=make_layers(points, visible, eye, marks, values, bodies),
        eye=eye,
        title=title_of(mesh),
        legend=(
            *legend_of(visible, marked=marks is not None and marks.wrong, valued=values is not None),
            *([] if bodies == "hidden" else _bodies_legend(given, visible)),
            *_values_legend(mesh, values),
            *_marks_legend(marks),
        ),
        labels=() if marks is None else _labels(mesh, points, marks),
        values=values,
        moved="" if view is None else view.words,
    )


def laid_out(scene: Scene, size: tuple[int, int]) -> Scene:
    """The scene with its legend broken into lines that a picture of `size` has room for, no more than two an entry."""
    unit = unit_of(size)
    room = size[0] * 0.96 - INDENT * unit - (RAMP_ROOM * unit if scene.values is not None else 0)
    legend: list[Entry] = []
    for entry in scene.legend:
        wide = max(8, int(room / (LETTER * unit)))
        first, *rest = textwrap.wrap(entry.words, wide, max_lines=2, placeholder=" ...") or [""]
        indented = "none" if entry.kind == "none" else "area"
        legend += [entry._replace(words=first), *(Entry(indented, words, ()) for words in rest)]
    return replace(scene, legend=tuple(legend))


def unit_of(size: tuple[int, int]) -> float:
    """Pixels of a unit of length in words and lines: a thousandth of the height, less in a narrow picture."""
    return min(size[1] / 1000, size[0] / 1200)


def camera_of(scene: Scene, size: tuple[int, int]) -> dict[str, Any]:
    """A camera of parallel rays that looks along -eye, upright, with all in sight and room for the words."""
    points = np.vstack([layer.points for layer in scene.layers])
    return fit_camera(points, scene.eye, size, scene.low, HIGH)


def title_of(mesh: Mesh) -> str:
    """A line that says what the mesh holds."""
    cells = (f"{count:,} {kind}" for kind, count in mesh.cells_by_type.items() if ALL_CELLS[kind].dim == mesh.dim)
    return f"{mesh.n_nodes:,} nodes, {', '.join(cells)}"


def legend_of(visible: VisibleSurface, *, marked: bool = False, valued: bool = False) -> tuple[Entry, ...]:
    """Legend of slave, master and dots: paler if findings are `marked`, outlined if cells are coloured by values."""
    slaves, masters = visible.rows(SLAVE), visible.rows(IS_MASTER)
    kind = "outline" if valued else "area"
    shades: tuple[str, ...] = PALETTE[:3]
    if marked:
        shades = tuple(bytes(colour).hex() for colour in pale(rgb(shades)))
    entries = []
    if len(slaves):
        macros = len(np.unique(visible.macro[slaves]))
        cut = f"{counted(macros, 'macro-element')}, made of {counted(len(slaves), 'slave face')}"
        words = cut if len(visible.internal) else counted(len(slaves), "slave face")
        entries.append(Entry(kind, words, (INK,) if valued else shades))
    if len(masters):
        entries.append(Entry(kind, counted(len(masters), "master face"), (MASTER,)))
    if len(visible.internal):
        words = f"{counted(len(visible.internal), 'internal node')}, each with a dof of its own"
        entries.append(Entry("dot", words, (INK if marked else DOT,)))
    return tuple(entries)


def _bodies_legend(mesh: Mesh, visible: VisibleSurface) -> list[Entry]:
    """Legend of the bodies that groups of their cells name: one line, with the colours in the order of the names."""
    names = {k: name for k, name in names_of_bodies(mesh, visible).items() if not name.startswith("the body with ")}
    if len(np.unique(visible.body)) < 2 or not names:
        return []
    shown = list(names)[:NAMED]
    words = ", ".join(names[k].replace("the body ", "that ") for k in shown)
    more = f", and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return [Entry("area", f"bodies: {words}{more}", tuple(BODIES[k % len(BODIES)] for k in shown))]


def _values_legend(mesh: Mesh, values: Values | None) -> list[Entry]:
    """Legend of the values: the worst cells of all, in sight or not, and those that no solver can use."""
    if values is None:
        return []
    entries = []
    if len(worst := values.worst(3)):
        words = ", ".join(f"{values.values[c]:.3g} (cell {mesh.cell_number[c]})" for c in worst)
        entries.append(Entry("none", f"worst: {words}", ()))
    if not values.on_skin and np.isnan(values.values[mesh.cell_dim > 1]).any():
        entries.append(Entry("area", f"{values.what} is not defined on these cells", (BODIES[0],)))
    if len(cells := np.flatnonzero(values.invalid)):
        words = f"{counted(len(cells), 'invalid cell')}: {some(mesh.cell_number[cells], 6)}"
        entries.append(Entry("area", words, (INVALID,)))
    return entries


def _marks_legend(marks: Marks | None) -> list[Entry]:
    """Legend of the findings: a line for each of the first."""
    if marks is None:
        return []
    if not len(marks):
        return [Entry("none", "the check found nothing to say", ())]
    rows = zip(marks.severity, marks.message, strict=True)
    entries = [
        Entry("area", f"{severity}: {message}", () if severity == "info" else (SEVERITIES[severity],))
        for severity, message in rows
    ]
    more = len(entries) - LISTED
    if more > 1:
        entries = [*entries[:LISTED], Entry("area", f"and {more} more findings", ())]
    return entries


def _labels(mesh: Mesh, points: Floats, marks: Marks) -> tuple[Label, ...]:
    """The numbers of some cells and nodes that errors and warnings name: one each of every finding, then more."""
    labels: list[tuple[int, Label]] = []
    for node, index, of in ((False, marks.cell, marks.of), (True, marks.nodes, marks.node_of)):
        named = np.unique(np.stack([of, index], axis=1), axis=0)
        turn = _turns(named[:, 0])
        for row in np.lexsort((named[:, 0], turn))[:LABELLED]:
            finding, what = named[row].tolist()
            nodes = np.array([what]) if node else np.unique(marks.faces.nodes[marks.cell == what])
            x, y, z = points[nodes[nodes >= 0]].mean(axis=0).tolist()
            words = f"node {mesh.node_number[what]}" if node else str(mesh.cell_number[what])
            if (severity := marks.severity[finding]) != "info":
                labels.append((int(turn[row]), Label((x, y, z), words, SEVERITIES[severity])))
    return tuple(label for _, label in sorted(labels, key=lambda pair: pair[0])[:LABELLED])


def _turns(of: Ints) -> Ints:
    """Number of equal values before each one in a sorted list.

    >>> _turns(np.array([0, 0, 0, 2, 2])).tolist()
    [0, 1, 2, 0, 1]
    """
    return np.arange(len(of)) - np.searchsorted(of, of)
