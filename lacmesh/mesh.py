"""The mesh: points, blocks of cells, groups and data. Frozen; indices count from 0, `*_number` are the file's ids.

Arrays and mappings are read-only too: nothing in a mesh can be written into; `dataclasses.replace` makes another mesh.
Arrays are not copied for this, so that a caller who keeps the array from which a mesh was made can still write into it.

A cell's index counts through the blocks in their order; `file_order` lists the indices in the order of the file.
Node order inside a cell is gmsh's (`cells.py`). Missing values in data are NaN, or -1 in integer data.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from importlib import import_module
from os import PathLike
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import GroupNotFoundError, RequestError, some
from lacmesh.facts import Described, listed
from lacmesh.indices import Ints as Ints
from lacmesh.indices import codes as codes
from lacmesh.indices import concatenated as concatenated
from lacmesh.indices import distinct as distinct
from lacmesh.indices import mask_of as mask_of
from lacmesh.indices import places_of as places_of
from lacmesh.indices import positions as positions
from lacmesh.model import Fixed, fixed_mapping
from lacmesh.model import Model as Model
from lacmesh.model import Periodic as Periodic
from lacmesh.model import Step as Step
from lacmesh.model import Tag as Tag
from lacmesh.model import fixed as fixed

if TYPE_CHECKING:
    from lacmesh.deck import Deck

Floats = NDArray[np.floating]
Spec = str | int | Tag  # what names a group of cells
#: makes one number of a dimension and a tag (of 32 bits), in the order of both
ENTITY_CODE = np.array([1 << 32, 1])
_NOTHING: Mapping[str, Any] = Fixed()
_MAPPINGS = ("cell_groups", "node_groups", "cell_data", "node_data", "group_tags", "steps")


class Block(NamedTuple):
    """All cells of one type: the type's name and their nodes, (n_cells, n_nodes of the type)."""

    type: str
    nodes: Ints


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(Described):
    """A mesh of any mixture of cells; see the module for the conventions.

    `points` (n, 3), `blocks` at most one a type, `node_number` (n,), `cell_number` (k,), groups name -> sorted indices,
    data name -> (n, ...) or (k, ...). `group_tags`: the physical groups of msh that a cell group stands for.
    `cell_data["entity"]` and `node_data["entity"]` (k or n, 2): dimension and tag of msh's elementary entity.
    `zones`: the names of a cut's zones, in the order of `cell_data["lac_zone"]`. `name`: the file's name for the mesh.
    `plane`: the type of the plane elements of an .inp file, CPS, CPE or CAX, if the mesh was read from one.
    `deck`: all cards of that file (`lacmesh.deck`); an .inp output is this deck with the mesh as it has become.
    Built by `Mesh.create`, which fills in absent fields and checks shapes and ranges.
    """

    points: Floats
    blocks: tuple[Block, ...]
    space_dim: int
    node_number: Ints
    cell_number: Ints
    file_order: Ints | None = None
    cell_groups: Mapping[str, Ints] = field(default_factory=dict)
    node_groups: Mapping[str, Ints] = field(default_factory=dict)
    cell_data: Mapping[str, NDArray] = field(default_factory=dict)
    node_data: Mapping[str, NDArray] = field(default_factory=dict)
    group_tags: Mapping[str, tuple[Tag, ...]] = field(default_factory=dict)
    steps: Mapping[str, Step] = field(default_factory=dict)
    zones: tuple[str, ...] = ()
    model: Model | None = None
    name: str = "mesh"
    plane: str = ""
    deck: Deck | None = None

    def __post_init__(self) -> None:
        values: dict[str, Any] = {"blocks": tuple(Block(kind, fixed(nodes)) for kind, nodes in self.blocks)}
        values |= {name: fixed(getattr(self, name)) for name in ("points", "node_number", "cell_number")}
        values |= {name: fixed_mapping(getattr(self, name)) for name in _MAPPINGS}
        if self.file_order is not None:
            values["file_order"] = fixed(self.file_order)
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as a call of the class, so that copies and unpickled meshes are read-only too."""
        return partial(Mesh, **{f.name: getattr(self, f.name) for f in fields(self)}), ()

    @classmethod
    def create(
        cls,
        points: Any,
        blocks: Iterable[tuple[str, Any]],
        *,
        space_dim: int | None = None,
        node_number: Any = None,
        cell_number: Any = None,
        file_order: Any = None,
        cell_groups: Mapping[str, Any] = _NOTHING,
        node_groups: Mapping[str, Any] = _NOTHING,
        cell_data: Mapping[str, Any] = _NOTHING,
        node_data: Mapping[str, Any] = _NOTHING,
        group_tags: Mapping[str, tuple[Tag, ...]] = _NOTHING,
        steps: Mapping[str, Step] = _NOTHING,
        zones: tuple[str, ...] = (),
        model: Model | None = None,
        name: str = "mesh",
        plane: str = "",
        deck: Deck | None = None,
    ) -> Mesh:
        """Make a mesh from points (n, 2 or 3) and (type, nodes) pairs; numbers default to 1, 2, ...

        The other arguments are fields of the class. Raises ValueError for a wrong type, shape or range.

        >>> square = Mesh.create([[0, 0], [1, 0], [1, 1], [0, 1]], [("QUAD4", [[0, 1, 2, 3]])])
        >>> square.space_dim, square.n_cells, square.cells_by_type
        (2, 1, {'QUAD4': 1})
        """
        points = np.asarray(points, dtype=float)
        if points.ndim != 2 or points.shape[1] not in (1, 2, 3):
            raise ValueError(f"points must be (n, 2) or (n, 3), not {points.shape}")
        if points.shape[1] < 3:
            points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
        typed = tuple(_block(kind, nodes, len(points)) for kind, nodes in blocks)
        if len({b.type for b in typed}) < len(typed):
            raise ValueError(f"one block a cell type, not {[b.type for b in typed]}")
        if space_dim is None:
            solid = any(ALL_CELLS[b.type].dim == 3 and len(b.nodes) for b in typed)
            space_dim = 3 if solid or np.any(points[:, 2]) else 2
        n_cells = sum(len(b.nodes) for b in typed)
        return cls(
            points=points,
            blocks=typed,
            space_dim=space_dim,
            node_number=_numbers("node_number", node_number if len(points) else None, len(points)),
            cell_number=_numbers("cell_number", cell_number if n_cells else None, n_cells),
            file_order=None if file_order is None else _numbers("file_order", file_order, n_cells),
            cell_groups={key: _members(key, ids, n_cells) for key, ids in cell_groups.items()},
            node_groups={key: _members(key, ids, len(points)) for key, ids in node_groups.items()},
            cell_data={key: _rows(f"cell data {key!r}", values, n_cells) for key, values in cell_data.items()},
            node_data={key: _rows(f"node data {key!r}", values, len(points)) for key, values in node_data.items()},
            group_tags=group_tags,
            steps=steps,
            zones=zones,
            model=model,
            name=name,
            plane=plane,
            deck=deck,
        )

    def to_meshio(self) -> Any:
        """Return the mesh as a `meshio.Mesh`, see `lacmesh.exchange.libraries.to_meshio`. Raises RequestError."""
        return _later("exchange.libraries").to_meshio(self)

    def to_pyvista(self, *, groups: bool = True, data: bool = True) -> Any:
        """Return a `pyvista.UnstructuredGrid`, with groups and data if wanted. Raises RequestError, DataError."""
        return _later("exchange.libraries").to_pyvista(self, groups=groups, data=data)

    @classmethod
    def from_pyvista(cls, grid: Any) -> Mesh:
        """Return the mesh of a `pyvista.UnstructuredGrid`, see `lacmesh.exchange.libraries.from_pyvista`."""
        return _later("exchange.libraries").from_pyvista(grid)

    def moved(self, to: Any) -> Mesh:
        """Return the mesh with its nodes elsewhere: `to` is a shift (2,) or (3,), or a function of the points.

        The function takes the coordinates x (3, n) and returns the new ones, three rows or two; a row may be a number.
        Nodes between corners move like any others, so that faces become curved. Raises RequestError.

        >>> from lacmesh.generate import rectangle
        >>> rectangle(1).moved(lambda x: [2 * x[0], x[1] + 5]).points[-1].tolist()
        [2.0, 6.0, 0.0]
        """
        if not callable(to) and np.shape(to) not in ((2,), (3,)):
            raise RequestError(f"a mesh is moved by a function or by a shift of two or three lengths, not {to!r}")
        rows = list(to(self.points.T.copy()) if callable(to) else (self.points + np.pad(to, (0, 3 - len(to)))).T)
        points = np.array([np.broadcast_to(row, self.n_nodes) for row in [*rows, 0.0][:3]], float).T
        if len(rows) not in (2, 3) or not np.isfinite(points).all():
            raise RequestError("a mesh is moved to two or three rows of finite coordinates, one for each node")
        space_dim = 3 if points[:, 2].any() else self.space_dim
        return replace(self, points=np.ascontiguousarray(points), space_dim=space_dim)

    def with_groups(self, on: str = "faces", /, **where: Any) -> Mesh:
        """Return the mesh with a group for each condition: name=function of points x (3, n), true or false for each.

        `on`: "faces" are outer faces (edges of a plane mesh) all of whose nodes meet the condition; "inner" are faces
        between two cells, as of a crack; "cells" have their centre where it is true; "nodes". Faces that are no cells
        yet become cells. A group of that name is replaced. Raises RequestError if a group would be empty.

        >>> from lacmesh.generate import box
        >>> mesh = box(4).with_groups(foot=lambda x: (x[2] == 0) & (x[0] < 0.6))
        >>> mesh = mesh.with_groups("cells", soft=lambda x: x[1] > 0.5)
        >>> len(mesh.cell_groups["foot"]), len(mesh.cell_groups["soft"])
        (8, 32)
        """
        return _later("joining").with_groups(self, on, where)

    def renamed(self, /, **names: str) -> Mesh:
        """Return the mesh with other names of groups, old=new; groups that get one name are one, "" removes a group.

        Cells and nodes stay. Raises GroupNotFoundError.

        >>> from lacmesh.generate import rectangle
        >>> list(rectangle(2).renamed(left="ends", right="ends", bottom="").cell_groups)
        ['body', 'ends', 'top']
        """
        return _later("joining").renamed(self, names)

    def only(self, *groups: Spec) -> Mesh:
        """Return the cells of some groups alone, and their nodes; numbers and data stay. Raises GroupNotFoundError.

        >>> from lacmesh.generate import box
        >>> box(2).only("top").cells_by_type
        {'QUAD4': 4}
        """
        return _later("joining").only(self, groups)

    def _title(self) -> str:
        return "Mesh in the plane" if self.space_dim == 2 else "Mesh"

    def _facts(self) -> dict[str, str]:
        facts = {
            "nodes": f"{self.n_nodes:,}",
            "cells": listed(f"{n:,} {name}" for name, n in self.cells_by_type.items()) or "none",
        }
        if self.zones:
            count = int(self.cell_data["lac_macro"].max(initial=-1)) + 1
            facts["cut"] = f"{listed(self.zones)} into {count:,} macro-elements"
        for what, groups in (("groups of cells", self.cell_groups), ("groups of nodes", self.node_groups)):
            if groups:
                facts[what] = listed(f"{name} ({len(members):,})" for name, members in groups.items())
        for what, data in (("data of cells", self.cell_data), ("data of nodes", self.node_data)):
            if data:
                facts[what] = listed(data)
        return facts

    def _repr_html_(self, picture: str = "") -> str:
        return super()._repr_html_(picture or _later("view").thumbnail(self))

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.points)

    @cached_property
    def n_cells(self) -> int:
        """Number of cells, all blocks together."""
        return sum(len(b.nodes) for b in self.blocks)

    @cached_property
    def offsets(self) -> Ints:
        """(n_blocks + 1,): the index of each block's first cell, then the number of cells."""
        return fixed(np.cumsum([0, *(len(b.nodes) for b in self.blocks)]))

    @cached_property
    def cell_dim(self) -> Ints:
        """(n_cells,): dimension of each cell."""
        dims = np.array([ALL_CELLS[b.type].dim for b in self.blocks], np.int8)
        return fixed(np.repeat(dims, np.diff(self.offsets)))

    @property
    def dim(self) -> int:
        """The highest dimension of a cell."""
        return max((ALL_CELLS[b.type].dim for b in self.blocks if len(b.nodes)), default=0)

    @property
    def cells_by_type(self) -> dict[str, int]:
        """Number of cells of each type present."""
        return {b.type: len(b.nodes) for b in self.blocks if len(b.nodes)}

    def block(self, name: str) -> Ints:
        """(k, n_nodes of the type): nodes of the cells of type `name`; no rows where there are none."""
        empty = np.empty((0, ALL_CELLS[name].n_nodes), np.int64)
        return next((b.nodes for b in self.blocks if b.type == name), empty)

    def select(self, cells: Ints) -> Iterator[tuple[str, Ints, Ints]]:
        """Iterate over some cells, block by block: (type, their indices in the mesh, their nodes)."""
        cells = np.asarray(cells)
        which = np.searchsorted(self.offsets, cells, side="right") - 1
        for k, b in enumerate(self.blocks):
            chosen = cells[which == k]
            if len(chosen):
                yield b.type, chosen, b.nodes[chosen - self.offsets[k]]

    def of_type(self, cells: Ints, types: Collection[str]) -> NDArray[np.bool_]:
        """True for those of some cells (indices) that have one of the types."""
        known = np.array([b.type in types for b in self.blocks] or [False], bool)
        return known[np.searchsorted(self.offsets, cells, side="right") - 1]

    def places_in_file(self, cells: Ints) -> Ints:
        """Return the places of some cells (indices) among all cells of the file."""
        return cells if self.file_order is None else places_of(self.file_order, self.n_cells)[cells]

    def nodes_on(self, cells: Ints) -> Ints:
        """Return the sorted nodes of some cells (indices)."""
        return np.flatnonzero(mask_of(self.n_nodes, *(nodes for _, _, nodes in self.select(cells))))

    def group_dim(self, name: str) -> int:
        """Highest dimension of a cell group's cells or, if it is empty, of its tags; -1 if it has no tags either."""
        cells = self.cell_groups[name]
        if len(cells):
            return int(self.cell_dim[cells].max())
        return max((dim for dim, _ in self.group_tags.get(name, ())), default=-1)

    def group(self, spec: Spec) -> str:
        """Return the name of the cell group that `spec` denotes: a name, a tag `5`, or `2:5` (dimension and tag).

        A tag may also be given as an integer, a dimension and a tag as the pair (2, 5). Raises GroupNotFoundError, with
        near matches, and RequestError if several groups have the tag.
        """
        spec = spec_text(spec)
        if spec in self.cell_groups:
            return spec
        parts = spec.split(":")
        if len(parts) <= 2 and all(p.strip().isdigit() for p in parts):
            wanted = tuple(int(p) for p in parts)
            names = [n for n, tags in self.group_tags.items() if any(t[-len(wanted) :] == wanted for t in tags)]
            if len(names) == 1:
                return names[0]
            if names:
                raise RequestError(f"tag {spec} means several groups ({', '.join(sorted(names))}); say dimension:tag")
        hint, known = "", [] if self.cell_groups else self.entities
        if known:  # how to name an entity instead, preferably one of the skin
            dim, tag = min(known, key=lambda entity: (entity[0] != self.dim - 1, entity))
            hint = f", but entity:DIM:TAG names an entity, as entity:{dim}:{tag} (lacmesh info lists them)"
        raise GroupNotFoundError(spec, self.cell_groups, hint=hint)

    @property
    def entities(self) -> list[Tag]:
        """Dimension and tag of the elementary entities of msh that have cells, ascending."""
        entity = self.entity_of_cell
        code = np.unique(entity[entity[:, 0] >= 0].astype(np.int64) @ ENTITY_CODE)
        dim = (code + ENTITY_CODE[0] // 2) // ENTITY_CODE[0]
        return list(zip(dim.tolist(), (code - dim * ENTITY_CODE[0]).tolist(), strict=True))

    @property
    def entity_of_cell(self) -> Ints:
        """(k, 2): dimension and tag of each cell's entity; no rows in a mesh without entities."""
        entity = self.cell_data.get("entity")
        if entity is None or entity.shape != (self.n_cells, 2) or entity.dtype.kind not in "iu":  # of that name only
            return np.empty((0, 2), np.int64)
        return entity

    def cells_of(self, spec: Spec) -> Ints:
        """Sorted indices of the cells that `spec` names: a group (see `group`), or `entity:2:17`, an entity of msh."""
        spec = spec_text(spec)
        if not spec.startswith("entity:") or spec in self.cell_groups:
            return self.cell_groups[self.group(spec)]
        parts = spec.split(":")[1:]
        if len(parts) != 2 or not all(p.isdigit() for p in parts):
            raise RequestError(f"{spec!r} is no entity; write entity:DIM:TAG, as entity:2:17")
        cells = np.flatnonzero((self.entity_of_cell == [int(p) for p in parts]).all(axis=1))
        if not len(cells):
            raise GroupNotFoundError(spec, [f"entity:{dim}:{tag}" for dim, tag in self.entities], "entity")
        return cells

    def cell_names(self, cells: Iterable[int]) -> str:
        """Format the ids in the file of some cells for a message."""
        return some(self.cell_number[np.asarray(list(cells), dtype=int)])


MeshLike = Mesh | str | PathLike[str]  # a mesh, or the path of its file


def as_mesh(mesh: MeshLike) -> Mesh:
    """Return a mesh; a path is read. Raises ReadError, RequestError for anything else."""
    if isinstance(mesh, Mesh):
        return mesh
    if isinstance(mesh, (str, PathLike)):
        return _later("formats").read(mesh)
    has_mesh = isinstance(getattr(mesh, "mesh", None), Mesh)
    advice = "give its .mesh" if has_mesh else "lacmesh.from_meshio and Mesh.from_pyvista take those of other libraries"
    raise RequestError(f"a mesh is a lacmesh.Mesh or the path of a mesh file, not {type(mesh).__name__}; {advice}")


def _later(module: str) -> Any:
    """Return a module of a later stage, which imports this one; it is loaded when it is used."""
    return import_module(f"lacmesh.{module}")


def spec_text(spec: Spec) -> str:
    """Return the specification of a group of cells as text.

    >>> spec_text("slave"), spec_text(5), spec_text((2, 5))
    ('slave', '5', '2:5')
    """
    return ":".join(str(part) for part in spec) if isinstance(spec, tuple) else str(spec)


def spec_list(specs: str | int | Iterable[str | int]) -> list[str]:
    """Return the specifications of one or several groups of cells as a list of text.

    >>> spec_list("slave"), spec_list(5), spec_list(["slave", 5])
    (['slave'], ['5'], ['slave', '5'])
    """
    return [str(s) for s in ([specs] if isinstance(specs, (str, int, np.integer)) else specs)]


def _rows(what: str, values: Any, size: int) -> NDArray:
    values = np.asarray(values)
    if len(values) != size:
        raise ValueError(f"{what} has {len(values)} rows, expected {size}")
    return values


def _numbers(name: str, values: Any, size: int) -> Ints:
    """Return integers (size,), by default 1, 2, ...; raise ValueError for others."""
    values = np.arange(1, size + 1) if values is None else np.asarray(values)
    if values.shape != (size,) or values.dtype.kind not in "iu":
        raise ValueError(f"{name} must be integers ({size},), not {values.dtype} {values.shape}")
    return values


def _block(kind: str, nodes: Any, n_nodes: int) -> Block:
    if kind not in ALL_CELLS:
        raise ValueError(f"unknown cell type {kind!r}")
    nodes = np.asarray(nodes)
    if nodes.size == 0:
        nodes = np.empty((0, ALL_CELLS[kind].n_nodes), np.int64)
    if nodes.ndim != 2 or nodes.shape[1] != ALL_CELLS[kind].n_nodes or nodes.dtype.kind not in "iu":
        raise ValueError(f"nodes of {kind} must be integers (k, {ALL_CELLS[kind].n_nodes}), not {nodes.shape}")
    if nodes.size and (nodes.min() < 0 or nodes.max() >= n_nodes):
        raise ValueError(f"a {kind} has a node outside 0..{n_nodes - 1}")
    return Block(kind, nodes)


def _members(name: str, ids: Any, size: int) -> Ints:
    """Return a group's members, distinct and sorted; raise ValueError if one lies outside the mesh."""
    ids = np.asarray(ids)
    if not ids.size:  # numpy takes an empty list for reals
        ids = np.empty(0, np.int64)
    if ids.ndim != 1 or ids.dtype.kind not in "iu":
        raise ValueError(f"group {name!r} must be a list of indices")
    if len(ids) > 1 and not (np.diff(ids) > 0).all():
        ids = np.unique(ids)
    if len(ids) and (ids[0] < 0 or ids[-1] >= size):
        raise ValueError(f"group {name!r} has an index outside 0..{size - 1}")
    return ids
