"""The request of a check: the mesh, its slave and master skins, the macro-elements, the constrained nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from shlex import quote
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.checks.findings import Finding, Place, Where, counted, severity_of
from lacmesh.cutting.select import nodes_of_group, skin_faces
from lacmesh.errors import GroupNotFoundError, RequestError, did_you_mean, some
from lacmesh.mesh import Ints, Mesh, concatenated
from lacmesh.topology.bodies import body_names, label_bodies
from lacmesh.topology.facets import Facets
from lacmesh.topology.skin import FaceIncidence, Faces, cells_of_dim, find_owners

Bools = NDArray[np.bool_]
T = TypeVar("T")
#: at most so many numbers in a sentence
SHOWN = 8
#: nodes nearer than this part of the length of edges (the median of what the nodes have as shortest) are at one place
PLACE = 1e-8


@dataclass(frozen=True, eq=False)
class CheckedSkin:
    """A skin: `what` (slave, master), the groups' `names`, its faces.

    `cells` (f,): the first cell on each face; `zone` (f,): the position of its group in `names`; `faces`: the faces,
    each once; `copies`: further cells on the same faces; `groups`: the cells of each group.
    """

    what: str
    names: tuple[str, ...]
    groups: tuple[Ints, ...]
    cells: Ints
    zone: Ints
    faces: Faces
    copies: Ints

    def __len__(self) -> int:
        return len(self.cells)

    @property
    def group(self) -> str:
        """The names of the groups, for the place of a finding."""
        return ", ".join(self.names)

    def subject(self, one: str, many: str) -> str:
        """Return its faces with a verb, for `Request.places`: `slave face turns|slave faces turn`."""
        return f"{self.what} face {one}|{self.what} faces {many}"

    def counted(self, n: int, one: str, many: str) -> str:
        """Format a number of its faces and a verb for a sentence: `2 slave faces turn`."""
        return counted(n, *self.subject(one, many).split("|"))

    @cached_property
    def nodes(self) -> Ints:
        """All nodes of the faces."""
        return self.faces.distinct_nodes


@dataclass(frozen=True, eq=False)
class Request:
    """The mesh and what is asked about it. `dim`: dimension of the skins. `fixed`: nodes of the Dirichlet groups.

    `recognise`: recognise the cut of a slave skin that has no records (`lacmesh.cut_skin`). The mesh's points are
    relative to `origin` (3,); findings give positions in the coordinates of the file.
    """

    mesh: Mesh
    dim: int
    slave: CheckedSkin
    master: CheckedSkin | None
    fixed: Ints
    dirichlet: tuple[str, ...]
    options: dict[str, Any] = field(default_factory=dict)
    origin: NDArray[np.floating] = field(default_factory=lambda: np.zeros(3))
    recognise: bool | None = None

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        slave: tuple[str, ...],
        master: tuple[str, ...],
        dirichlet: tuple[str, ...],
        options: dict[str, Any],
        origin: NDArray[np.floating],
        recognise: bool | None = None,
    ) -> Request:
        """Return a request. Raises GroupNotFoundError and RequestError for groups that the mesh lacks."""
        groups = {"slave": slave, "master": master} if master else {"slave": slave}
        cells = {what: tuple(np.asarray(mesh.cells_of(s)) for s in specs) for what, specs in groups.items()}
        fixed = np.unique(concatenated(nodes_of_group(mesh, spec) for spec in dirichlet))
        dim = mesh.dim - 1
        of_slave = concatenated(cells["slave"])
        if mesh.dim == 2 and mesh.space_dim == 3 and len(of_slave) and (mesh.cell_dim[of_slave] == 2).all():
            dim = 2  # faces of a shell
        sides = {}
        for what, names in groups.items():
            listed, zone, faces, rows = skin_faces(mesh, cells[what], dim)
            copies = np.setdiff1d(listed, listed[rows])
            sides[what] = CheckedSkin(what, names, cells[what], listed[rows], zone[rows], faces, copies)
        return cls(mesh, dim, sides["slave"], sides.get("master"), fixed, dirichlet, options, origin, recognise)

    @property
    def sides(self) -> tuple[CheckedSkin, ...]:
        """The skins."""
        return (self.slave,) if self.master is None else (self.slave, self.master)

    @cached_property
    def _results(self) -> dict[tuple[Any, ...], Any]:
        return {}

    def once(self, compute: Callable[..., T], *arguments: Any) -> T:
        """Return compute(request, *arguments), which several rules use and the first one computes."""
        key = compute, *map(id, arguments)
        if key not in self._results:
            self._results[key] = compute(self, *arguments)
        result: T = self._results[key]
        return result

    @cached_property
    def finite(self) -> Bools:
        """(n_nodes,): True for nodes with finite coordinates, the squares of which are finite as well."""
        return np.asarray((np.abs(self.mesh.points) < 1e150).all(axis=1))

    @cached_property
    def parents(self) -> dict[str, FaceIncidence]:
        """The parent cells of the faces, for each side."""
        blocks = list(cells_of_dim(self.mesh, self.dim + 1))
        return {side.what: find_owners(side.faces, blocks, self.mesh.n_nodes) for side in self.sides}

    @cached_property
    def facets(self) -> Facets:
        """The cells of the mesh's dimension and their facets, paired."""
        return Facets.of(self.mesh)

    @cached_property
    def bodies(self) -> Ints:
        """(n_nodes,): the body of each node, -1 for nodes of no cell."""
        return label_bodies([self.facets.solid.corners], self.mesh.n_nodes)

    @cached_property
    def body_names(self) -> list[str]:
        """The name of each body, for a sentence."""
        there = replace(self.mesh, points=self.mesh.points + self.origin)
        return body_names(there, self.bodies, int(self.bodies.max(initial=-1)) + 1)

    def n_parents(self, side: CheckedSkin) -> Ints:
        """(f,): the number of parent cells of each face of a side."""
        return np.bincount(self.parents[side.what].face, minlength=len(side))

    def numbers(self, cells: Ints) -> str:
        """Ids in the file of some cells, for a sentence."""
        return some(self.mesh.cell_number[cells], SHOWN)

    def node_numbers(self, nodes: Ints) -> str:
        """Ids in the file of some nodes, for a sentence."""
        return some(self.mesh.node_number[nodes], SHOWN)

    def places(
        self, cells: Ints, subject: str, text: str, *, on: str = "cell", skin: CheckedSkin | None = None
    ) -> Iterator[Place]:
        """Yield the place of some cells, or nodes (`on`), of the groups of a skin; nothing if there are none.

        The sentence: their count, `subject` for one and, after `|`, for several, and `text`, `#` in which stands for
        their numbers in the file.
        """
        if len(cells):
            numbers = self.numbers(cells) if on == "cell" else self.node_numbers(cells)
            message = f"{counted(len(cells), *subject.split('|'))} {text.replace('#', numbers, 1)}"
            group = None if skin is None else skin.group  # a skin without faces is false
            yield Place(message, group=group, **{f"{on}s": cells})

    def finding(self, rule: str, place: Place) -> Finding:
        """Return the finding of a rule about a place, with the numbers of the file."""
        cells, nodes = (np.asarray([] if k is None else k, np.int64) for k in (place.cells, place.nodes))
        in_box = nodes if len(nodes) else concatenated(n.ravel() for _, _, n in self.mesh.select(cells))
        x = self.mesh.points[in_box[self.finite[in_box]]] + self.origin
        return Finding(
            rule,
            severity_of(rule),
            tuple(self.mesh.cell_number[cells].tolist()),
            tuple(self.mesh.node_number[nodes].tolist()),
            Where(place.group, (tuple(x.min(axis=0).tolist()), tuple(x.max(axis=0).tolist())) if len(x) else None),
            place.message,
        )


def is_carried(name: str) -> bool:
    """True for types that are passed through unchanged: cells of order 3 and higher."""
    return name not in CELLS


# ---- pairs of a slave and a master group


def split_pairs(mesh: Mesh, texts: Sequence[str]) -> list[tuple[str, str]]:
    """Split each `SLAVE:MASTER` at the one colon on both sides of which there is a group. Raises RequestError.

    >>> mesh = Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])], cell_groups={"a": [0], "b:c": [0]})
    >>> split_pairs(mesh, ["a:b:c", "b:c:a"])
    [('a', 'b:c'), ('b:c', 'a')]
    """
    return [_split(mesh, text) for text in texts]


def _split(mesh: Mesh, text: str) -> tuple[str, str]:
    sides = [(text[:k], text[k + 1 :]) for k, letter in enumerate(text) if letter == ":"]
    pairs = [(slave, master) for slave, master in sides if _is_group(mesh, slave) and _is_group(mesh, master)]
    if len(pairs) == 1:
        return pairs[0]
    if pairs:
        readings = " or ".join(f"slave {slave!r} with master {master!r}" for slave, master in pairs)
        raise RequestError(f"--pair {quote(text)} is {readings}; name one of the groups by its tag, or rename it")
    if not sides:
        raise RequestError(f"--pair {quote(text)} has no colon; write it as SLAVE:MASTER")
    missing = [name for name in sides[0] if not _is_group(mesh, name)] if len(sides) == 1 else []
    if not missing:
        raise RequestError(f"--pair {quote(text)} is no SLAVE:MASTER: no colon in it has a group on both sides")
    hint = did_you_mean(missing[0], [*mesh.cell_groups])
    raise RequestError(f"--pair {quote(text)}: no cell group named {missing[0]!r}{hint}")


def _is_group(mesh: Mesh, name: str) -> bool:
    try:
        return bool(name) and len(mesh.cells_of(name)) >= 0
    except (GroupNotFoundError, RequestError):
        return False


def check_one_pair(slave: Sequence[str], master: Sequence[str], command: str = "lacmesh check IN") -> None:
    """Raise RequestError for several slaves with several masters, of which it is not known which belong together."""
    slave, master = (list(dict.fromkeys(names)) for names in (slave, master))
    if len(slave) < 2 or len(master) < 2:
        return
    n = max(len(slave), len(master))
    a, b = ([*names, *[names[-1]] * (n - len(names))] for names in (slave, master))
    words = " ".join(f"--pair {quote(f'{one}:{other}')}" for one, other in zip(a, b, strict=True))
    message = f"{len(slave)} slaves and {len(master)} masters were given, and not which of them belong together"
    raise RequestError(f"{message}; name the pairs with --pair (pairs=[...] in Python), as in: {command} {words}")
