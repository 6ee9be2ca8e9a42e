"""The request of a check: the mesh, its slave and master skins, the constrained nodes; pairs of groups."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from shlex import quote
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.checks.findings import RULES, Finding, Place, Where
from lacmesh.cutting.select import nodes_of_group, skin_faces
from lacmesh.errors import RequestError, counted, did_you_mean, some
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

    def counted(self, n: int, verb: str) -> str:
        """Format a number of its faces and a verb, for one and for several faces: `2 slave faces turn`."""
        one, _, many = verb.partition("|")
        return counted(n, f"{self.what} face {one}", f"{self.what} faces {many or one}")

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
    options: dict[str, Any]
    origin: NDArray[np.floating]
    recognise: bool | None = None
    _results: dict[tuple[Any, ...], Any] = field(default_factory=dict, init=False)

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        origin: NDArray[np.floating],
        slave: tuple[str, ...] = (),
        master: tuple[str, ...] = (),
        dirichlet: tuple[str, ...] = (),
        recognise: bool | None = None,
        **options: Any,
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

    @property
    def n_bodies(self) -> int:
        """The number of bodies."""
        return int(self.bodies.max(initial=-1)) + 1

    @cached_property
    def body_names(self) -> list[str]:
        """The name of each body, for a sentence."""
        return body_names(replace(self.mesh, points=self.mesh.points + self.origin), self.bodies, self.n_bodies)

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
        self, cells: Ints, verb: str, text: str, skin: CheckedSkin | None = None, *, noun: str = "", advice: str = ""
    ) -> Iterator[Place]:
        """Yield the place of some cells, or of nodes if the `noun` is `node ...`; nothing if there are none.

        The sentence: `3 slave faces have no parent cell (7, 8, 9)`, with the numbers in the file. `verb`: for one and,
        after `|`, for several, e.g. `has|have`. `noun`: by default a cell, or a face of the skin.
        """
        if len(cells):
            of_nodes, (one, _, many) = noun.startswith("node"), verb.partition("|")
            noun = noun or (f"{skin.what} face" if skin is not None else "cell")
            first, _, rest = noun.partition(" of ")  # `node of the skin`, `nodes of the skin`
            plural = f"{first}s of {rest}" if rest else f"{noun}s"
            numbers = self.node_numbers(cells) if of_nodes else self.numbers(cells)
            message = f"{counted(len(cells), f'{noun} {one}', f'{plural} {many}')} {text} ({numbers})"
            place = Place(message, group=None if skin is None else skin.group, advice=advice or None)
            yield place._replace(nodes=cells) if of_nodes else place._replace(cells=cells)

    def finding(self, rule: str, place: Place, group: str | None = None, *, severity: str = "") -> Finding:
        """Return the finding of a rule about a place, with the numbers of the file.

        `group`: that of a place that names none; `severity`: in place of the rule's.
        """
        severity = severity or RULES[rule].severity
        advice = RULES[rule].advice if place.advice is None else place.advice
        cells, nodes = (np.asarray([] if k is None else k, np.int64) for k in (place.cells, place.nodes))
        in_box = nodes if len(nodes) else concatenated(n.ravel() for _, _, n in self.mesh.select(cells))
        x = self.mesh.points[in_box[self.finite[in_box]]] + self.origin
        return Finding(
            rule,
            severity,
            tuple(self.mesh.cell_number[cells].tolist()),
            tuple(self.mesh.node_number[nodes].tolist()),
            Where(
                place.group or group, (tuple(x.min(axis=0).tolist()), tuple(x.max(axis=0).tolist())) if len(x) else None
            ),
            place.message if severity == "info" or not advice else f"{place.message}; {advice}",
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
    missing = [name for name in sides[0] if not _is_group(mesh, name)] if len(sides) == 1 else []
    if pairs:
        readings = " or ".join(f"slave {slave!r} with master {master!r}" for slave, master in pairs)
        reason = f" is {readings}; name one of the groups by its tag, or rename it"
    elif not sides:
        reason = " has no colon; write it as SLAVE:MASTER"
    elif missing:
        reason = f": no cell group named {missing[0]!r}{did_you_mean(missing[0], [*mesh.cell_groups])}"
    else:
        reason = " is no SLAVE:MASTER: no colon in it has a group on both sides"
    raise RequestError(f"--pair {quote(text)}{reason}")


def _is_group(mesh: Mesh, name: str) -> bool:
    try:
        return bool(name) and len(mesh.cells_of(name)) >= 0
    except RequestError:
        return False


def check_one_pair(slave: Sequence[str], master: Sequence[str], command: str = "lacmesh check IN") -> None:
    """Raise RequestError for several slaves with several masters, of which it is not known which belong together."""
    slave, master = (list(dict.fromkeys(names)) for names in (slave, master))
    if len(slave) < 2 or len(master) < 2:
        return
    n = max(len(slave), len(master))
    a, b = ([*names, *[names[-1]] * (n - len(names))] for names in (slave, master))
    words = " ".join(f"--pair {quote(f'{one}:{other}')}" for one, other in zip(a, b, strict=True))
    message = f"{len(slave)} slaves and {len(master)} masters do not say which of them belong together; name the pairs "
    raise RequestError(f"{message}with --pair (pairs=[...] in Python), for example: {command} {words}")
