"""Drawing of a mesh in pyvista: bodies, skins in colours, findings, words, and the place of the eye.

Curved faces follow their cells' shape functions; PYRAM14 and cells of order 3 and higher are drawn by their corners.
"""

from __future__ import annotations

import textwrap
import warnings
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.cutting.cut import is_cut
from lacmesh.errors import LacmeshWarning, RequestError, counted, some
from lacmesh.grids import (
    LINEAR,
    PALETTE,
    Groups,
    Vector,
    bodies_of,
    face_colours,
    grid_of,
    outer_faces,
    outlines,
    skin_cells,
    unit,
    visible_cells,
)
from lacmesh.mesh import Floats, Ints, Mesh, mask_of
from lacmesh.origin import from_origin, origin_of_mesh
from lacmesh.topology.bodies import body_names, label_bodies

BODIES = ("#eceae4", "#dbe1e6", "#e6e0ec", "#dfe8dc")
MASTER, INK, CREASE, EDGE, DOT = "#8093b0", "#1b1f24", "#5c646c", "#8a929a", "#b3122f"
SEVERITIES = {"error": "#cc1f1a", "warning": "#e87500", "info": "#5b6b7d"}
#: a value from its bad end to its good one, dark to light
RAMP = ("#231a4c", "#34489b", "#2f7fb5", "#56b4b8", "#a9d9b2", "#f4f3d0")
#: ways to draw bodies, and their opacity
OPACITY = {"solid": 1.0, "ghost": 0.16, "hidden": 0.0}
#: the eye by default; gap between the bodies of a plane mesh with a master, as a part of the diagonal
_OBLIQUE, _PLANE_GAP = (1.0, -1.6, 0.9), 0.03
#: a skin whose mean normal is shorter than this faces every way
_ONE_WAY = 0.3
#: findings named in words; cells of theirs with a number; offset that brings faces before everything
_LISTED, _LABELLED, _BEFORE_ALL = 5, 8, 2e7
#: bodies of a mesh whose bodies are named
_NAMED = 200


class Drawing:
    """A mesh in pyvista, and the plotter to which its parts are added; bodies may be moved apart."""

    def __init__(
        self, mesh: Mesh, slave: Groups, master: Groups, cutaway: Vector | None, size: tuple[int, int], off_screen: bool
    ) -> None:
        """Choose the cells in sight. Raises RequestError, GroupNotFoundError, DataError for places too far away."""
        self.origin = origin_of_mesh(mesh)
        self.mesh = mesh = from_origin(mesh, self.origin)  # a graphics card counts with seven digits
        visible = self.visible = visible_cells(mesh, cutaway)
        slaves, masters = skin_cells(mesh, slave), skin_cells(mesh, master if master else ())
        self.slaves, self.masters = slaves[visible[slaves]], np.setdiff1d(masters[visible[masters]], slaves)
        self.bodies = np.flatnonzero(visible & bodies_of(mesh))
        if not len(self.bodies) + len(self.slaves) + len(self.masters):
            raise RequestError("there is nothing to draw: no cells of dimension 1, 2 or 3, or none left in sight")
        joined = (b.nodes for b in mesh.blocks if ALL_CELLS[b.type].dim >= min(2, mesh.dim))
        self.body, in_sight = label_bodies(joined, mesh.n_nodes), self._nodes(self.bodies)
        self.of_slave = np.isin(self.body, self.body[self._nodes(self.slaves)])
        self.hidden = bool(len(self.slaves)) and not self.of_slave[in_sight].all()
        self.whole, self.plane = cutaway is None, mesh.space_dim == 2
        diagonal = float(np.linalg.norm(np.ptp(mesh.points[in_sight], axis=0))) if len(in_sight) else 0.0
        self.span = diagonal or 1.0  # of nodes that all lie at one point
        self.grid, self.size, self.unit = grid_of(mesh), size, min(size[1] / 1000, size[0] / 1200)
        curved = np.count_nonzero(~np.isin(self.grid.celltypes, LINEAR))
        self.level = 3 if curved < 3_000 else 2 if curved < 100_000 else 1
        self.plot = import_module("pyvista").Plotter(off_screen=off_screen, window_size=list(size))
        self.plot.set_background("white")
        self.legend: list[tuple[str, str]] = []
        self.scale: tuple[str, Any] | None = None
        self.foot = 0

    @property
    def title(self) -> str:
        """What the mesh holds, in a line."""
        kinds = self.mesh.cells_by_type.items()
        cells = (f"{n:,} {kind}" for kind, n in kinds if ALL_CELLS[kind].dim == self.mesh.dim)
        return f"{self.mesh.n_nodes:,} nodes, {', '.join(cells)}"

    def _nodes(self, cells: Ints) -> Ints:
        """Nodes of some cells, each once."""
        return np.flatnonzero(mask_of(self.mesh.n_nodes, *(nodes for _, _, nodes in self.mesh.select(cells))))

    def part(self, cells: Ints) -> Any:
        """Return some cells as a grid: the outer faces of solids, other cells themselves."""
        return outer_faces(self.grid.extract_cells(np.isin(self.grid["cell"], cells)))

    # ---- the eye, and the places of bodies

    def outward(self) -> Floats:
        """Mean unit normal (3,) of the slave skin, out of its bodies; 0 if the skin faces every way."""
        x, parts = self.mesh.points, [np.zeros((2, 1, 3))]
        for kind, _, nodes in self.mesh.select(self.slaves):
            a, b = x[nodes[:, 0]], x[nodes[:, 1]]
            other = x[nodes[:, 2]] - a if ALL_CELLS[kind].dim == 2 else [0.0, 0.0, 1.0]
            parts.append(np.stack([a, np.cross(b - a, other)]))
        places, normals = np.concatenate(parts, axis=1)[:, 1:]
        mean = normals.sum(axis=0)
        if np.linalg.norm(mean) <= _ONE_WAY * np.linalg.norm(normals, axis=1).sum():
            return np.zeros(3)
        return unit(mean if mean @ (places.mean(axis=0) - x[self.of_slave].mean(axis=0)) >= 0 else -mean)

    def eye(self, camera: Vector | None) -> Floats:
        """Direction from the mesh towards the eye, (3,)."""
        if camera is not None:
            return unit(camera)
        if self.plane:
            return np.array([0.0, 0.0, 1.0])
        return unit((0 if self.hidden else self.outward()) + 0.6 * unit(_OBLIQUE))

    def move_apart(self, explode: float | None) -> bool:
        """Shift the bodies with slave faces off the others, by a part of the diagonal; True if they were moved.

        Warns of a gap that moves nothing.
        """
        if explode is None:
            explode = _PLANE_GAP if self.plane and self.hidden and len(self.masters) else 0.0
        outward = self.outward() if explode else np.zeros(3)
        if not self.hidden or not outward.any():
            if explode:
                why = "the slave surface faces every way" if self.hidden else "no other body hides a slave surface"
                warnings.warn(LacmeshWarning(f"explode {explode:g} moves nothing: {why}"), stacklevel=4)
            return False
        x, mine, others = self.mesh.points, self.of_slave, self._nodes(self.bodies)
        overlap = (x[mine] @ outward).max() - (x[others[~mine[others]]] @ outward).min()
        self.grid.points[mine] -= (overlap + explode * self.span) * outward
        return True

    # ---- what is drawn

    def add_bodies(self, opacity: float, values: Any = None) -> None:
        """Add bodies in greys, or in the colours of values, with their edges and creases."""
        part = self.part(self.bodies)
        if not opacity or not part.n_cells:
            return
        first = np.empty(self.mesh.n_cells, np.int64)
        for k, (_, nodes) in enumerate(self.mesh.blocks):
            first[self.mesh.offsets[k] : self.mesh.offsets[k + 1]] = nodes[:, 0]
        cell = np.asarray(part["cell"])
        body = self.body[first[cell]]
        if values is None or values.on_skin:
            self._faces(part, rgb(BODIES)[body % len(BODIES)], opacity)
        else:
            self._faces(part, None, opacity, values)
            self._faces(part.extract_cells(values.invalid[cell]), rgb([SEVERITIES["error"]]), opacity, before=1)
            self._name_worst(values)
        if opacity == 1:
            self._edges(part, np.arange(len(cell)), EDGE, 1.5)
        surface = part.extract_surface(algorithm="dataset_surface", nonlinear_subdivision=self.level)
        kinds = {"manifold_edges": False, "non_manifold_edges": False}  # the latter lie between bodies that touch
        self._lines(surface.clean().extract_feature_edges(40, **kinds), CREASE, 3.2)
        bodies = np.unique(body).tolist()
        if len(bodies) > 1 and self.body.max() < _NAMED and (values is None or values.on_skin):
            names = body_names(self.mesh, self.body, int(self.body.max()) + 1)
            named = [(f"body {names[k]}", BODIES[k % len(BODIES)]) for k in bodies if names[k].startswith("'")]
            self.legend += named[:4]

    def _name_worst(self, values: Any) -> None:
        """Add the worst cells of all to the legend, in sight or not, and those that no solver can use."""
        number, known = self.mesh.cell_number, np.flatnonzero(np.isfinite(values.values))
        worst = known[np.argsort(values.values[known] * (1 if values.good >= values.bad else -1), kind="stable")[:3]]
        words = ", ".join(f"{values.values[c]:.3g} (cell {number[c]})" for c in worst)
        self.legend += [(f"worst: {words}", "")] if len(worst) else []
        if values.invalid.any():
            cells = counted(int(values.invalid.sum()), "invalid cell")
            self.legend.append((f"{cells}: {some(number[values.invalid], 6)}", SEVERITIES["error"]))

    def add_skins(self, values: Any = None, *, pale: bool = False) -> None:
        """Add slave and master faces, the outlines of macro-elements, and internal nodes."""
        master, slave = self.part(self.masters), self.part(self.slaves)
        macro = self._macros(slave)
        n_macros, mix = len(np.unique(macro)), 0.45 if pale else 1.0
        colours = (255 - mix * (255.0 - rgb([MASTER, *PALETTE]))).astype(np.uint8)
        if values is None:
            self._faces(master, colours[:1], before=1)
            self._faces(slave, colours[1 + face_colours(slave, macro)], before=2)
        elif values.on_skin:
            self._faces(slave, None, 1.0, values, before=2)
        for grid, group, colour, width in (
            (master, np.arange(master.n_cells), CREASE, 1.8),
            (master, np.zeros(master.n_cells), MASTER if values else INK, 6.0),
            (slave, np.arange(slave.n_cells), CREASE, 1.8),
            (slave, macro, INK, 5.0),
            (slave, np.zeros(slave.n_cells), INK, 5.0),
        ):
            self._edges(grid, group, colour, width)
        shown = self._nodes(self.slaves)
        owner = self.mesh.node_data.get("lac_internal", np.full(self.mesh.n_nodes, -1))
        internal = shown[owner[shown] >= 0]
        self._dots(internal, INK if pale else DOT, 0.006)
        faces = counted(len(self.slaves), "slave face")
        words = f"{counted(n_macros, 'macro-element')}, made of {faces}" if len(internal) else faces
        self.legend += [(words, PALETTE[0] if values is None else INK)] if len(self.slaves) else []
        self.legend += [(counted(len(self.masters), "master face"), MASTER)] if len(self.masters) else []
        words = f"{counted(len(internal), 'internal node')}, each with a dof of its own"
        self.legend += [(words, INK if pale else DOT)] if len(internal) else []

    def _macros(self, slave: Any) -> Ints:
        """Macro-element of each slave face; a face that is part of none counts by itself."""
        rows = np.asarray(slave["cell"]) if slave.n_cells else np.empty(0, np.int64)
        macro = np.array(self.mesh.cell_data["lac_macro"][rows] if is_cut(self.mesh) else np.full(len(rows), -1))
        alone = np.flatnonzero(macro < 0)
        macro[alone] = macro.max(initial=-1) + 1 + np.arange(len(alone))
        return macro

    def add_findings(self, findings: Sequence[Any] | None) -> None:
        """Add what findings name: cells in the colour of their severity, which show through all else, and numbers."""
        if findings is None:
            return
        mesh = self.mesh
        findings = sorted(findings, key=lambda finding: [*SEVERITIES].index(finding.severity))
        for finding in reversed([f for f in findings if f.severity != "info"]):  # the worst is drawn last
            colour, few = SEVERITIES[finding.severity], 1 + _LABELLED // len(findings)
            cells = np.flatnonzero(np.isin(mesh.cell_number, finding.cells) & self.visible)
            nodes = np.flatnonzero(np.isin(mesh.node_number, finding.nodes))
            part = self.part(cells)
            self._faces(part, rgb([colour]), before=4)
            self._faces(part, rgb([colour]), 0.3, before=_BEFORE_ALL)
            self._edges(part, part["cell"] if part.n_cells else (), INK, 2.5)
            self._dots(nodes, colour, 0.008)
            for cell in cells[:few]:
                middle = self.grid.points[self._nodes(cells[cells == cell])].mean(axis=0)
                self.add_label(middle, str(mesh.cell_number[cell]), colour)
            for node in nodes[:few]:
                self.add_label(self.grid.points[node], f"node {mesh.node_number[node]}", colour)
        lines = [(f"{f.severity}: {f.message}", SEVERITIES[f.severity]) for f in findings]
        more = [(f"and {len(lines) - _LISTED} more findings", INK)] if len(lines) > _LISTED + 1 else []
        self.legend += [*lines[: _LISTED if more else None], *more] or [("the check found nothing to say", INK)]

    def add_label(self, point: Floats, text: str, colour: str) -> None:
        """Add words at a point, before everything."""
        style = {"shape_color": colour, "text_color": "white", "shape_opacity": 1.0, "margin": 4, "show_points": False}
        self.plot.add_point_labels([point], [text], font_size=round(22 * self.unit), always_visible=True, **style)

    def _faces(self, grid: Any, colours: Any, opacity: float = 1.0, values: Any = None, before: float = 0.0) -> None:
        """Add the cells of a grid in `colours` (n or 1, 3), or those of `values`, `before` faces that they lie on."""
        if not grid.n_cells:
            return
        grid = grid.copy(deep=False)
        style: dict[str, Any] = {"rgb": True}
        if values is None:
            grid["colour"] = np.array(np.broadcast_to(colours, (grid.n_cells, 3)))
        else:
            ramp = [*values.ramp] if values.good >= values.bad else [*values.ramp][::-1]
            table = import_module("matplotlib.colors").LinearSegmentedColormap.from_list("values", ramp)
            grid["colour"] = values.values[np.asarray(grid["cell"])]
            style = {"cmap": table, "clim": sorted((values.bad, values.good)), "nan_color": BODIES[0]}
        surface = grid.extract_surface(algorithm="dataset_surface", nonlinear_subdivision=self.level)
        style |= {"ambient": 0.7, "diffuse": 0.4, "specular": 0.0}
        style["line_width"] = (18 if before else 4) * self.unit
        actor = self.plot.add_mesh(surface, scalars="colour", opacity=opacity, show_scalar_bar=False, **style)
        actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
        actor.mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(-before, -2 * before)
        self.scale = self.scale if values is None else (values.what, actor.mapper)

    def _edges(self, grid: Any, group: Any, colour: str, width: float) -> None:
        """Add the edges of a grid's faces between groups (n,) and at the end of all, thinner where cells are small."""
        lines = outlines(grid, np.asarray(group), self.level) if grid.n_cells else grid
        if not lines.n_cells:
            return
        a, b = lines.points[lines.lines.reshape(-1, 3)[:, 1:]].swapaxes(0, 1)
        parts = 1 if np.isin(grid.celltypes, LINEAR).all() else 2**self.level  # of the edge of a curved face
        length = parts * float(np.median(np.linalg.norm(b - a, axis=1)))
        thin = min(1.0, length / (0.03 * self.span))
        if thin < 0.25 and width < 5:
            return  # they would only darken the faces
        self._lines(lines, colour, width * max(thin, 0.4))

    def _lines(self, lines: Any, colour: str, width: float) -> None:
        """Add lines of a width in thousandths of the picture's height, before the faces that they lie on."""
        if not lines.n_cells:
            return
        actor = self.plot.add_mesh(lines, color=colour, line_width=width * self.unit, lighting=False)
        actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
        actor.mapper.SetRelativeCoincidentTopologyLineOffsetParameters(-4.0, -20 - 4 * width)

    def _dots(self, nodes: Ints, colour: str, radius: float) -> None:
        """Add balls at nodes, of a radius that is a part of the diagonal, or less where they are close."""
        if not len(nodes):
            return
        pyvista, x = import_module("pyvista"), self.grid.points[nodes]
        near = import_module("scipy.spatial").cKDTree(x).query(x, k=2)[0][:, 1]
        radius = min(radius, 0.2 * float(np.sort(near)[len(near) // 4]) / self.span)
        around = int(np.clip(np.sqrt(1e6 / len(nodes)), 6, 24))
        ball = pyvista.Sphere(radius=radius * self.span, theta_resolution=around, phi_resolution=around)
        balls = pyvista.PolyData(x).glyph(geom=ball, scale=False, orient=False)
        self.plot.add_mesh(balls, color=colour, smooth_shading=True)

    def add_words(self, title: str) -> None:
        """Add the title above, and the legend below, each line of it beside a box in its colour."""
        unit, style = self.unit, {"font_size": round(11 * self.unit), "viewport": True}
        if title:
            self.plot.add_text(title, position=(0.02, 0.945), color=INK, **style | {"font_size": round(13 * unit)})
        room = int((0.96 * self.size[0] - (560 if self.scale else 80) * unit) / (12.4 * unit))
        lines = []
        for words, colour in self.legend:
            first, *rest = textwrap.wrap(words, max(8, room), max_lines=2, placeholder=" ...")
            lines += [(first, colour), *((words, "") for words in rest)]
        self.foot = max(len(lines), 3 * (self.scale is not None))
        if self.scale:
            bar = {"position_x": 0.7, "position_y": 0.03, "width": 0.27, "height": 0.07, "fmt": "%.3g", "n_labels": 2}
            bar |= {"title_font_size": round(22 * unit), "label_font_size": round(20 * unit), "color": INK}
            self.plot.add_scalar_bar(self.scale[0], mapper=self.scale[1], vertical=False, **bar)
        for k, (words, colour) in enumerate(reversed(lines)):
            y = (26 + 40 * k) * unit / self.size[1]
            self.plot.add_text(words, position=(0.02 + 60 * unit / self.size[0], y), color=INK, **style)
            if colour:  # letters of the colour, on the same
                box = self.plot.add_text("MM", position=(0.02, y), color=colour, **style)
                box.prop.background_color, box.prop.background_opacity = colour, 1.0

    def set_camera(self, eye: Floats) -> None:
        """Look along -eye with all in sight, and room for the words."""
        x = self.grid.points[self._nodes(np.concatenate([self.bodies, self.slaves, self.masters]))]
        fit_camera(self.plot, x, eye, self.size, min(0.6, 0.035 + 0.04 * self.foot), 0.93)


def fit_camera(plot: Any, x: Floats, eye: Floats, size: tuple[int, int], low: float, high: float) -> None:
    """Look along -eye with parallel rays, upright, with points (n, 3) between two parts of the picture's height."""
    axes = screen_axes(eye)
    place = x @ axes
    extent, middle = np.ptp(place, axis=0), axes @ (place.min(axis=0) + place.max(axis=0)) / 2
    half = max(extent[1] / (high - low), extent[0] / 0.94 * size[1] / size[0]) / 2 or 1.0
    focal = middle - (high + low - 1) * half * axes[:, 1]
    plot.enable_parallel_projection()
    plot.camera_position = [focal + (np.linalg.norm(extent) or 1.0) * eye, focal, axes[:, 1]]
    plot.camera.parallel_scale = half
    plot.renderer.ResetCameraClippingRange()
    if size[0] * size[1] <= 4_000_000:  # this costs four times the memory of the picture
        plot.enable_anti_aliasing("ssaa")


def rgb(colours: Sequence[str]) -> NDArray[np.uint8]:
    """Colours in hexadecimal as numbers from 0 to 255, (n, 3).

    >>> rgb(["#77aadd"])
    array([[119, 170, 221]], dtype=uint8)
    """
    return np.array([[int(c[k : k + 2], 16) for k in (1, 3, 5)] for c in colours], np.uint8).reshape(-1, 3)


def screen_axes(eye: Floats) -> Floats:
    """Columns (3, 3) right, up and towards the eye; upright is y if seen along z, else z."""
    upright = np.array([0.0, 1.0, 0.0] if abs(eye[2]) > 0.999 else [0.0, 0.0, 1.0])
    right = unit(np.cross(upright, eye))
    return np.stack([right, np.cross(eye, right), eye], axis=1)
