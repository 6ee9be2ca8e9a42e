"""A first case for a mesh: its groups, the skins that lie opposite one another, and what is left to fill in.

bodies = connected cells; groups of cells, and groups of faces on their skins
pairs = two groups of faces on different bodies, each of which faces the other            (`facing_pairs`)
text = a case with a material, a contact for each pair, and loads as comments             (`first_case`)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lacmesh.errors import LacmeshError, RequestError
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.origin import from_origin, origin_of_mesh
from lacmesh.surface import Surface, contact_points, coverage
from lacmesh.topology.bodies import label_bodies
from lacsolver.case.entry import Entry
from lacsolver.case.records import Contact, Displacement, Material, Pressure
from lacsolver.case.toml import section_text

#: gap between two skins in contact at most, relative to the smaller of them; part of either that faces the other
_GAP, _PART = 0.2, 0.05
#: largest number of groups of faces that pairs are sought among
_MOST = 60


class _Skin(NamedTuple):
    """A group of faces: its name, its surface, the bodies that it lies on, its nodes and box (2, 3)."""

    name: str
    surface: Surface
    bodies: frozenset[int]
    nodes: Ints
    box: np.ndarray

    @property
    def size(self) -> float:
        """Longest side of its box."""
        return float(np.ptp(self.box, axis=0).max())


def facing_pairs(mesh: Mesh) -> list[tuple[str, str]]:
    """Return pairs of groups of faces that lie opposite one another, on different bodies, in the mesh's order.

    Two skins are a pair if, along their normals, some part of each faces the other within a fifth of the size of the
    smaller. Of groups that contain one another only the smallest are taken. A surface without parent cells is a body
    of its own.

    >>> import lacmesh
    >>> facing_pairs(lacmesh.read(lacmesh.example("two_blocks.msh")))
    [('slave', 'master')]
    """
    skins = list(_skins(mesh))
    pairs = []
    for a, b in combinations(skins, 2):
        if a.bodies & b.bodies or np.isin(a.nodes, b.nodes).any():
            continue
        reach = _GAP * min(a.size, b.size)
        apart = np.maximum(a.box[0] - b.box[1], b.box[0] - a.box[1]).max()
        if apart <= reach and _face_each_other(a, b, reach):
            pairs.append((a, b))
    return [(a.name, b.name) for a, b in pairs if not any(_within(c, d, a, b) for c, d in pairs)]


def _skins(mesh: Mesh) -> Iterator[_Skin]:
    """Yield the groups of faces of a mesh, the first of them."""
    local = from_origin(mesh, origin_of_mesh(mesh))
    body = label_bodies((block.nodes for block in local.blocks), local.n_nodes)
    names = [name for name in mesh.cell_groups if mesh.group_dim(name) == mesh.dim - 1 and len(mesh.cell_groups[name])]
    for name in names[:_MOST]:
        try:
            surface = Surface.of(local, mesh.cells_of(name))
        except LacmeshError:  # faces of several dimensions, or no faces
            continue
        nodes = surface.faces.distinct_nodes
        x = local.points[nodes]
        box = np.stack([x.min(axis=0), x.max(axis=0)])
        yield _Skin(name, surface, frozenset(np.unique(body[nodes]).tolist()), nodes, box)


def _face_each_other(a: _Skin, b: _Skin, reach: float) -> bool:
    """True if a twentieth of one of two skins faces the other within a distance, and some of that one the first."""
    parts = []
    for mine, other in ((a.surface, b.surface), (b.surface, a.surface)):
        try:
            met = coverage(contact_points(mine, other, search_distance=reach), mine)
        except LacmeshError:
            return False
        parts.append(float(met.covered.sum() / met.area.sum()))
    return min(parts) > 0 and max(parts) > _PART


def _within(c: _Skin, d: _Skin, a: _Skin, b: _Skin) -> bool:
    """True if one pair of skins is another one, with one of them smaller."""
    if {c.name, d.name} == {a.name, b.name}:
        return False
    ways = ((c, d), (d, c))
    return any(
        set(x.nodes.tolist()) <= set(a.nodes.tolist())
        and set(y.nodes.tolist()) <= set(b.nodes.tolist())
        and len(x.nodes) + len(y.nodes) < len(a.nodes) + len(b.nodes)
        for x, y in ways
    )


def first_case(mesh: Mesh, path: str | Path, pairs: Sequence[tuple[str, str]]) -> str:
    """Return the text of a case for a mesh, whose file has the path, relative to the case's.

    `pairs`: groups that may touch, as of `facing_pairs`. The case is complete but for what holds and loads the bodies,
    which stands as comments. Raises RequestError for a mesh without bodies.

    >>> import lacmesh, tomllib
    >>> mesh = lacmesh.read(lacmesh.example("two_blocks.msh"))
    >>> text = first_case(mesh, "two_blocks.msh", [("master", "slave")])
    >>> tomllib.loads(text)["contact"]
    [{'name': 'master', 'surfaces': ['master', 'slave']}]
    """
    dim = mesh.dim
    if dim < 2:
        raise RequestError("the mesh has no body: cells of a plane or of space")
    model = {"mesh": Path(path).as_posix(), "model": "3d" if dim == 3 else "plane_strain"}
    head = [
        "A first case, to be filled in: material, supports, loads. `lacsolver validate` says what is missing,",
        "`lacsolver schema` lists every key.",
        *_groups(mesh),
        *([] if dim == 3 else ["model: plane_strain, plane_stress or axisymmetric (y is the axis)"]),
    ]
    units = section_text("[output]", {"units": "N, mm, MPa"}, ["names for pictures and reports: the units you use"])
    parts = [section_text("", model, head), *_materials(mesh), *_contacts(pairs), *_loads(mesh, pairs), units]
    return "\n".join(parts)


def _groups(mesh: Mesh) -> Iterator[str]:
    """Yield lines on the groups of a mesh."""
    yield "Groups of the mesh:"
    for name, cells in mesh.cell_groups.items():
        if len(cells):
            chosen = list(mesh.select(cells))
            x = mesh.points[np.unique(np.concatenate([nodes.ravel() for _, _, nodes in chosen]))]
            low, high = (_point(end[: mesh.space_dim]) for end in (x.min(axis=0), x.max(axis=0)))
            yield f"  {name}: {len(cells)} {', '.join(sorted(kind for kind, _, _ in chosen))}, {low} .. {high}"
    for name, nodes in mesh.node_groups.items():
        yield f"  {name}: {len(nodes)} nodes"


def _point(x: Floats) -> str:
    """Return coordinates as words."""
    return f"({', '.join(f'{part + 0.0:.4g}' for part in x.tolist())})"


def _comment(record: type[Entry], *names: str) -> list[str]:
    """Return lines on keys of a record, from the schema."""
    keys = record.KEYS
    return [f"{name}: {keys[name].meaning}{', ' + keys[name].unit if keys[name].unit else ''}" for name in names]


def _materials(mesh: Mesh) -> Iterator[str]:
    """Yield a material for each group of bodies that are not in another, one for all where there is none."""
    groups = [name for name in mesh.cell_groups if mesh.group_dim(name) == mesh.dim and len(mesh.cell_groups[name])]
    whole = np.concatenate([mesh.cell_groups[name] for name in groups] or [np.zeros(0, int)])
    disjoint = len(np.unique(whole)) == len(whole) == int((mesh.cell_dim == mesh.dim).sum())
    lines = _comment(Material, "young", "poisson")
    for name in groups if disjoint and len(groups) > 1 else [None]:
        own = {} if name is None else {"groups": [name]}
        yield section_text("[[material]]", {"young": 210000.0, "poisson": 0.3} | own, lines)
        lines = []


def _contacts(pairs: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Yield a contact for each pair, whose slave is chosen by the rules of docs/case.md."""
    lines = [*_comment(Contact, "surfaces"), "friction = 0.2 is one more line"]
    names: set[str] = set()
    for a, b in pairs:
        name = a if a not in names else f"{a}-{b}"
        names.add(name)
        yield section_text("[[contact]]", {"name": name, "surfaces": [a, b]}, lines)
        lines = []
    if not pairs:
        yield (
            "# No two groups of faces on different bodies lie opposite one another; name those that may touch:\n"
            '# [[contact]]\n# surfaces = ["ONE", "OTHER"]\n'
        )


def _loads(mesh: Mesh, pairs: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Yield supports and loads as comments, with the groups that they may act on."""
    taken = {name for pair in pairs for name in pair}
    skins = [name for name in mesh.cell_groups if mesh.group_dim(name) < mesh.dim and name not in taken]
    free = [*skins, *mesh.node_groups]
    zero = {f"u{axis}": 0.0 for axis in "xyz"[: mesh.dim]}
    for record, header, keys in (
        (Displacement, "[[displacement]]", {"group": free[0] if free else "GROUP"} | zero),
        (Pressure, "[[pressure]]", {"group": free[-1] if free else "GROUP", "value": 1.0}),
    ):
        lines = [f"of {', '.join(free)}" if free else "of a group of faces", *section_text(header, keys).splitlines()]
        yield "".join(f"# {line}\n" for line in (record.SECTION.meaning, *lines))
