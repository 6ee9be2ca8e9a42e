"""Written times: a file state_NUMBER.npz for each, with its fields and all that a restart needs; and the mesh, once.

    mesh.npz           = the mesh, with the records of its cut, without other data of its file
    state_NUMBER.npz   = version, time; `restart`: a `Restart`; `fields`: its `Fields`, if they were due

Both are records as `lacsolver.output.store` writes them. Pictures, films, reports, exports and restarts read them, and
nothing else of a folder but its tables.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cutting.records import CELL_RECORDS, NODE_RECORD
from lacmesh.errors import DataError, ReadError, RequestError, reading
from lacmesh.mesh import Block, Floats, Ints, Mesh
from lacsolver.case import Case, changed, fingerprint
from lacsolver.distributed.share import Share
from lacsolver.output.names import MESH, state_file, states_in
from lacsolver.output.store import DAMAGE, load, opened, pack, rows_in, save, tree_of, unpack
from lacsolver.output.tables import same_time
from lacsolver.problem.roles import with_roles
from lacsolver.problem.skin import mesh_of
from lacsolver.results.results import Fields, Restart
from lacsolver.results.whole import Order, grows
from lacsolver.space.space import Space

#: raised when the meaning of a file's data changes; 4: fields and what a restart needs in one file
VERSION = 5
OLDER = "is of an older lacsolver, whose files hold other things; run the case again from its start"
_RESTART, _FIELDS = "restart", "fields"


class Written(NamedTuple):
    """A written time. `fields`: None where the state alone was due; their surfaces are without coordinates."""

    version: int
    time: float
    restart: Restart
    fields: Fields | None


class _StoredMesh(NamedTuple):
    """A mesh as a file has it: keywords of `Mesh.create`."""

    points: Floats
    blocks: tuple[Block, ...]
    space_dim: int
    node_number: Ints
    cell_number: Ints
    file_order: Ints | None
    cell_groups: Mapping[str, Ints]
    node_groups: Mapping[str, Ints]
    cell_data: Mapping[str, NDArray]
    node_data: Mapping[str, NDArray]
    zones: tuple[str, ...]
    name: str


class TimeWriter:
    """Writes the mesh of a space, and times, into a folder. All of several processes call the same methods.

    `prints`: the fingerprint of the case; `orders`: those of `lacsolver.results.whole.orders_of`. Raises WriteError.
    """

    def __init__(self, folder: Path, space: Space, prints: Mapping[str, str], orders: Mapping[str, Order]) -> None:
        self._folder, self._share, self._prints, self._orders = folder, space.share, prints, orders
        share, mesh = space.share, space.mesh
        self._nodes = None if share.own is None or share.node is None else Order(share, share.node, share.own)
        stored = _StoredMesh(
            mesh.points, mesh.blocks, mesh.space_dim, mesh.node_number, mesh.cell_number, mesh.file_order,
            mesh.cell_groups, mesh.node_groups, {k: mesh.cell_data[k] for k in CELL_RECORDS if k in mesh.cell_data},
            {k: mesh.node_data[k] for k in (NODE_RECORD,) if k in mesh.node_data}, mesh.zones, mesh.name,
        )  # fmt: skip
        save(folder / MESH, *((stored, share) if self._nodes is None else _gathered(stored, mesh, share, self._nodes)))

    def write(self, state: Restart, fields: Fields | None) -> None:
        """Write a time; an existing file is replaced at the end. Raises WriteError, on all processes."""
        orders = {f"{_RESTART}.{name}": order for name, order in self._orders.items()}
        shown = None if fields is None else replace(fields, zones=self._zones(fields))
        if self._nodes is not None and shown is not None:
            orders |= dict.fromkeys(_nodal(shown), self._nodes)
        restart = replace(state, folder=None, case=dict(self._prints))
        written = Written(VERSION, float(state.time), restart, shown)
        save(self._folder / state_file(state.number), written, self._share, orders)

    def _zones(self, fields: Fields) -> dict[str, Any]:
        """Return the fields of zones on the whole mesh, which has the coordinates of their faces."""
        node, cell, zones = self._share.node, self._share.cell, {}
        for name, zone in fields.zones.items():
            surface = replace(zone.surface, x=np.empty((0, 3)), height=None)
            if node is not None and cell is not None:
                nodes = surface.faces.nodes
                faces = replace(surface.faces, nodes=np.where(nodes >= 0, node[nodes], -1))
                surface = replace(surface, faces=faces, cell=cell[surface.cell])
            zones[name] = replace(zone, surface=surface)
        return zones


def _nodal(fields: Fields) -> Iterator[str]:
    """Yield the paths of fields that have a row for each node of the mesh."""
    for name in ("displacement", "stress", "reaction", "velocity", "acceleration", "plastic_strain"):
        yield f"{_FIELDS}.{name}"
    for k in range(len(fields.zones)):
        for name in ("force", "pressure_recovered", "shear_recovered"):
            yield f"{_FIELDS}.zones.{k}.{name}"


def _gathered(
    part: _StoredMesh, mesh: Mesh, share: Share, nodes: Order
) -> tuple[_StoredMesh, Share, Mapping[str, Order]]:
    """Return this process's part of a mesh with the indices of the whole one, and the orders of its arrays.

    A cell is given by the process that owns its first node.
    """
    node, index, own = share.node, share.cell, np.zeros(mesh.n_cells, bool)
    assert node is not None and index is not None and share.own is not None
    orders: dict[str, Order] = dict.fromkeys(
        ("points", "node_number", *(f"node_data.{k}" for k in range(len(part.node_data)))), nodes
    )
    for k, block in enumerate(mesh.blocks):
        here = slice(mesh.offsets[k], mesh.offsets[k + 1])
        own[here] = share.own[block.nodes[:, 0]]
        orders[f"blocks.{k}.nodes"] = Order(share, index[here], own[here])
    cells = Order(share, index, own)
    orders |= dict.fromkeys(("cell_number", *(f"cell_data.{k}" for k in range(len(part.cell_data)))), cells)

    def members(kind: str, groups: Mapping[str, Ints], place: Ints, mine: NDArray[np.bool_]) -> dict[str, Ints]:
        for k, ids in enumerate(groups.values()):
            orders[f"{kind}.{k}"] = Order(share, place[ids], mine[ids])
        return {name: place[ids].astype(np.int64) for name, ids in groups.items()}

    whole = part._replace(
        blocks=tuple(Block(kind, node[rows]) for kind, rows in part.blocks),
        file_order=None,
        cell_groups=members("cell_groups", part.cell_groups, index, own),
        node_groups=members("node_groups", part.node_groups, node, share.own),
    )
    return whole, share, orders


class StoredFields:
    """Fields that a run has written into a folder: their `times`, and `numbers` of steps. Raises ReadError."""

    def __init__(self, folder: Path) -> None:
        with reading(folder):
            paths = states_in(folder)
        trees = [(path, _tree(path)) for path in paths]
        chosen = [(tree, path) for path, tree in trees if tree[_FIELDS] is not None]
        self._paths = [path for _, path in chosen]
        self.times: Sequence[float] = [float(tree["time"]) for tree, _ in chosen]
        self.numbers: Sequence[int] = [int(tree[_RESTART]["number"]) for tree, _ in chosen]
        self._folder = folder

    @cached_property
    def mesh(self) -> Mesh:
        """The mesh of the run, cut. Raises ReadError."""
        path = self._folder / MESH
        with _damage_in(path, "run the case again"):
            return Mesh.create(**load(path, _StoredMesh)._asdict())

    def read(self, i: int) -> Fields:
        """Return the fields at the i-th time. Raises ReadError."""
        with _damage_in(self._paths[i], "run the case again"):
            fields: Fields = load(self._paths[i], Fields, _FIELDS)
        if len(fields.displacement) != self.mesh.n_nodes:
            raise ReadError(self._paths[i], f"is of another mesh than {MESH}; run the case again")
        zones = {k: replace(z, surface=replace(z.surface, x=self.mesh.points)) for k, z in fields.zones.items()}
        return replace(fields, zones=zones)


def read_state(
    folder: str | os.PathLike[str], case: Case, from_time: float | None = None, *, mesh: Mesh | None = None,
    large: bool = True,
) -> Restart:  # fmt: skip
    """Read a state that an earlier run of the same case wrote: the last one, or the one at time `from_time`.

    `mesh`: the mesh of the run, as for `run`; the case's file is read if None. `large`: False leaves the arrays that
    grow with the model empty, for several processes, which `run` gives their shares of the file, and leaves it to `run`
    to compare case and mesh. Raises RequestError if there is no state (or none at that time; the message lists the
    others), DataError if the case or the mesh differs (the message names the differences), ReadError for a folder or
    file that cannot be read.

    >>> from tempfile import TemporaryDirectory
    >>> from lacsolver import read_case, run
    >>> from lacsolver.output import create_output
    >>> case = read_case("data/two_blocks.toml")
    >>> with TemporaryDirectory() as folder:
    ...     done = run(case, create_output(folder))
    ...     read_state(folder, case).time
    1.0
    """
    folder = Path(folder)
    with reading(folder):
        paths = states_in(folder)
    if not paths:
        raise RequestError(f"{folder} has no state to go on from (state_*.npz); name the folder of an earlier run")
    path = paths[-1] if from_time is None else _at(folder, paths, from_time)
    advice = _others(folder, paths, path)
    _tree(path, advice)
    with _damage_in(path, advice):
        state: Restart = load(path, Restart, _RESTART, lambda name: not large and grows(name))
    state = replace(state, folder=folder)
    if large:
        check_same(state, case, mesh_of(case, mesh))
    return state


def scatter_state(state: Restart, share: Share, orders: Mapping[str, Order]) -> Restart:
    """Return the share of this process in a state, of which the first process has the whole arrays, or their file.

    All processes call this. Raises RequestError for a state with histories of an added time scheme, ReadError.
    """
    if state.step.histories.scheme and state.step.motion is None:
        raise RequestError("a state with histories of an added time scheme goes on in one process only")
    arrays: dict[str, NDArray] = {}
    tree, failed = pack(replace(state, folder=None), arrays), None
    for name in [name for name in arrays if name in orders]:
        source = _Source(state, name, arrays[name]) if share.rank == 0 else None
        arrays[name] = orders[name].deal(source.read if source else lambda n: np.empty(0))
        failed = failed or (source.failed if source else None)
    share.agree(failed)
    return replace(unpack(tree, Restart, arrays), folder=state.folder)


class _Source:
    """The rows of an array of a state, from memory, or from its file if they were left there; `failed`: an error."""

    def __init__(self, state: Restart, name: str, values: NDArray) -> None:
        self.failed: Exception | None = None
        self._values, self._start = values, 0
        self._path = state.folder / state_file(state.number) if state.folder and not len(values) else None
        self._rows = None if self._path is None else rows_in(self._path, f"{_RESTART}.{name}")

    def read(self, n: int) -> NDArray:
        """Return the next n rows; zeros after an error, which is kept until all processes have been served."""
        self._start += n
        if self._rows is None or self._path is None:
            return self._values[self._start - n : self._start]
        if self.failed is not None:
            return np.zeros((n, *self._values.shape[1:]))
        try:
            with _damage_in(self._path, "start anew"):
                if self._start == n:
                    next(self._rows)
                return self._rows.send(n)
        except ReadError as error:
            self.failed = error
            return np.zeros((n, *self._values.shape[1:]))


def check_same(state: Restart, case: Case, mesh: Mesh, prints: Mapping[str, str] | None = None) -> None:
    """Raise DataError if a state belongs to another case or mesh; `prints`: the fingerprint of these, if known."""
    if state.case is None:
        return
    differs = changed(state.case, fingerprint(with_roles(case, mesh), mesh) if prints is None else prints)
    if differs:
        whose = "the state to go on from is" if state.folder is None else f"the states in {state.folder} are"
        raise DataError(f"{whose} of another case: {', '.join(differs)} changed; restore it, or start anew")


def _tree(path: Path, advice: str = "run the case again") -> dict[str, Any]:
    """Return what a file has beside its arrays. Raises ReadError for a damaged file, or one of another version."""
    with _damage_in(path, advice), opened(path) as file:
        older = "about" in file
        tree: dict[str, Any] = {} if older else tree_of(file)
        version = 0 if older else int(tree["version"])
    if version != VERSION:
        newer = "is of a newer lacsolver; go on with that one"
        raise ReadError(path, newer if version > VERSION else OLDER)
    return tree


def _at(folder: Path, paths: list[Path], time: float) -> Path:
    """Return the file of the state at a time. Raises RequestError."""
    times = {path: _time(path) for path in paths}
    matching = [path for path, there in times.items() if there is not None and same_time(there, time)]
    if not matching:
        known = ", ".join(f"{there:.9g}" for there in times.values() if there is not None) or "none that can be read"
        raise RequestError(f"{folder} has no state at t = {time:.9g}; there are: {known}")
    return matching[-1]


def _time(path: Path) -> float | None:
    """Return the time of a state, None if its file cannot be read."""
    try:
        return float(_tree(path)["time"])
    except (ReadError, *DAMAGE):
        return None


def _others(folder: Path, paths: list[Path], path: Path) -> str:
    """Return advice for a damaged state: an earlier time to restart from, if there is one."""
    times = [f"{there:.9g}" for other in paths if other != path and (there := _time(other)) is not None]
    return f"go on from an earlier time, --from {times[-1]}" if times else f"no other state is in {folder}: start anew"


@contextmanager
def _damage_in(path: Path, advice: str) -> Iterator[None]:
    try:
        yield
    except DAMAGE as error:
        raise ReadError(path, f"is damaged or no state ({error}); {advice}") from error
