# ruff: noqa: E501 (a row a line)
"""Bad inputs of lacsolver: what is done, and what the command must say of it.

The corpus of lacmesh (tests/bad_input) is about files of meshes; this one is about cases, what they ask of a mesh, and
where results go. A row is a case file (the good one with a change), a command, a status, and a part of what is said.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

import lacmesh
from lacmesh import Mesh
from tests.lacsolver.patch_meshes import stack

GOOD = """\
mesh = "blocks.msh"
model = "plane_strain"
[[material]]
young = 1000.0
poisson = 0.3
[[contact]]
name = "joint"
slave = "slave"
master = "master"
[[displacement]]
group = "bottom"
uy = 0.0
[[displacement]]
group = "x0"
ux = 0.0
[[pressure]]
group = "top"
value = 1.0
"""
PRECIOUS = "an older result"
BOTH = ("validate", "run")
RUN = ("run",)
MATRICES = ("matrices CASE -o m.npz",)
MODES = ("modes CASE -o m",)
#: the good case, with a mass
HEAVY = GOOD.replace("poisson = 0.3\n", "poisson = 0.3\ndensity = 1.0\n")


@dataclass(frozen=True)
class Bad:
    """Bad input. `text`: the case file; `commands`: each must end in `status` and say `says` (a pattern per error).

    A command is its words, CASE the file's name; one word stands for that command on the case. `make` prepares the
    folder, in which the good mesh lies already. `then` looks at it after; without it nothing may have changed.
    """

    what: str
    text: str | bytes
    says: str | tuple[str, ...]
    status: int = 1
    commands: tuple[str, ...] = BOTH
    make: Callable[[Path], object] | None = None
    then: Callable[[Path], object] | None = None
    nobody: bool = False
    file_size: int | None = None

    @property
    def patterns(self) -> tuple[str, ...]:
        """One for each error."""
        return (self.says,) if isinstance(self.says, str) else self.says


@cache
def blocks() -> Mesh:
    """Two blocks of quadrangles on one another: groups slave (and twin), master, bottom, top, x0, x1, lower, upper."""
    mesh = stack("QUAD4", "QUAD4", 2, counts=(3, 2))
    groups = {**mesh.cell_groups, "twin": mesh.cell_groups["slave"]}
    corner = {"corner": np.flatnonzero((mesh.points[:, :2] == 0).all(axis=1))}
    return Mesh.create(mesh.points, mesh.blocks, cell_groups=groups, node_groups=corner, space_dim=2)


def put(mesh: Mesh, folder: Path) -> None:
    """The mesh of the case."""
    lacmesh.write(folder / "blocks.msh", mesh, force=True)


def moved(change: Callable[[np.ndarray], object]) -> Callable[[Path], None]:
    """The good mesh with other points: `change` works on them in place."""

    def make(folder: Path) -> None:
        points = blocks().points.copy()
        change(points)
        dim = 3 if points[:, 2].any() else 2
        put(Mesh.create(points, blocks().blocks, cell_groups=blocks().cell_groups, space_dim=dim), folder)

    return make


def without(*sections: str) -> str:
    """The good case without its sections that hold one of some words."""
    head, *parts = GOOD.split("[[")
    return head + "".join(f"[[{part}" for part in parts if not any(word in part for word in sections))


def changed(old: str, new: str) -> str:
    """The good case with one part of its text replaced."""
    assert GOOD.count(old) == 1, old
    return GOOD.replace(old, new)


def _cut_elsewhere(folder: Path) -> None:
    put(lacmesh.cut_skin(blocks(), "master").mesh, folder)


def _hinge(folder: Path) -> None:
    """One body of two squares that share a node: one may turn about it, and costs nothing."""
    points = [[0, 0], [1, 0], [1, 1], [0, 1], [2, 1], [2, 2], [1, 2], [0, 2], [0, 3], [-1, 3], [-1, 2]]
    cells = [("QUAD4", [[0, 1, 2, 3], [2, 4, 5, 6]]), ("SEG2", [[0, 1], [5, 6]])]
    put(Mesh.create(points, cells, cell_groups={"bottom": [2], "top": [3]}, space_dim=2), folder)


def _folded(points: np.ndarray) -> None:
    inside = np.flatnonzero((points[:, 0] > 0.1) & (points[:, 0] < 0.9) & (points[:, 1] > 1.1) & (points[:, 1] < 1.9))
    points[inside[0], :2] += 5.0


def _short(folder: Path) -> None:
    content = (folder / "blocks.msh").read_bytes()
    (folder / "blocks.msh").write_bytes(content[: len(content) // 2])


def _no_number(folder: Path) -> None:
    lacmesh.write(folder / "blocks.msh", blocks(), binary=False, force=True)
    text = (folder / "blocks.msh").read_text()
    head, nodes = text.split("$Nodes")
    assert " 2.0 0.0\n" in nodes
    (folder / "blocks.msh").write_text(head + "$Nodes" + nodes.replace(" 2.0 0.0\n", " nan 0.0\n", 1))


def _modes(folder: Path) -> None:
    (folder / "m").mkdir()
    (folder / "m" / "modes.json").write_text(PRECIOUS)


def _no_modes(folder: Path) -> None:
    assert not (folder / "m" / "modes.json").exists()


def _results(folder: Path) -> None:
    (folder / "case").mkdir()
    (folder / "case" / "results.json").write_text(PRECIOUS)


def _file(name: str) -> Callable[[Path], object]:
    return lambda folder: (folder / name).write_text(PRECIOUS)


def _closed(folder: Path) -> None:
    folder.chmod(0o555)


def _states(content: bytes) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        (folder / "old").mkdir()
        (folder / "old" / "state_0001.npz").write_bytes(content)

    return make


def _failed(folder: Path) -> None:
    import json

    told = json.loads((folder / "case" / "results.json").read_text())
    assert told["status"] == "failed" and told["message"]
    assert (folder / "case" / "unconverged" / "solid.pvd").exists()


def _nothing_written(folder: Path) -> None:
    assert not list(folder.rglob("*.vtu")) and not list(folder.rglob("state_*.npz"))


HINGE = 'mesh = "blocks.msh"\nmodel = "plane_strain"\n[[material]]\nyoung = 1.0\npoisson = 0.3\n[[displacement]]\ngroup = "bottom"\nux = 0.0\nuy = 0.0\n[[pressure]]\ngroup = "top"\nvalue = 1.0\n'
HARD = (
    changed("uy = 0.0", "uy = 0.0\n[[force]]\nat = [1, 2]\nfy = -5.0").replace(
        'slave = "slave"', 'slave = "slave"\ngeometry = "current"'
    )
    + "[steps]\nmax_halvings = 0\n[solver]\nmax_iterations = 1\n"
)

CASES: list[Bad] = [
    # the case file; each mistake that it shows by itself is in case_mistakes
    Bad("the case is not there", "", r"^nowhere\.toml: cannot be read \(No such file or directory\)", 3, ("validate nowhere.toml", "run nowhere.toml -o r", "matrices nowhere.toml -o m.npz")),
    Bad("the case is a folder", "", r"^\.: is a folder, and not a case; it holds case\.toml", 3, ("validate .",)),
    Bad("the case is no TOML", GOOD + "[[contact\n", r"case\.toml, line 19: ", 3),
    Bad("the case is no text", b"mesh = \"\xff\"\n", r"case\.toml, line 1: is not UTF-8 text", 3),
    Bad("several mistakes, all told with their lines", changed("young = 1000.0", "young = -1.0").replace("uy = 0.0", "uq = 0.0").replace("value", "valu"), ("line 4: material.young is -1", "line 10: .* at least one of ux", "line 12: displacement.uq is no key", r"line 16: \[\[pressure\]\] needs value", "line 18: pressure.valu is no key")),
    # groups
    Bad("a group of a contact that the mesh lacks", changed('slave = "slave"', 'slave = "slav"'), r"case\.toml, line 6: contact\.slave: no cell group named 'slav'; did you mean slave\?", commands=(*BOTH, *MATRICES)),
    Bad("several groups that the mesh lacks, all told", changed('"bottom"', '"botom"').replace('"top"', '"tip"'), (r"line 10: displacement\.group: no group named 'botom'; did you mean bottom", r"line 16: pressure\.group: no cell group named 'tip'; did you mean top")),
    Bad("a group of nodes where faces are meant", changed('"top"', '"corner"'), "pressure.group: 'corner' is a group of nodes, and a group of cells is needed"),
    Bad("a place without a node", changed('group = "x0"', "at = [0.123, 0.456]"), r"line 13: displacement: no node at \[0\.123, 0\.456\]; the nearest is node \d+ at "),
    Bad("a pressure on cells of the body", changed('group = "top"', 'group = "upper"'), "line 16: pressure: a load on a surface needs cells of dimension 1, and cells [0-9, ]+ are none; name a group of skin cells"),
    # material
    Bad("cells without a material", changed("young = 1000.0", 'groups = ["lower"]\nyoung = 1000.0'), r"\d+ cells have no material: .*; name a group that holds them"),
    Bad("cells with two materials", changed("poisson = 0.3", 'poisson = 0.3\ngroups = ["lower"]\n[[material]]\nyoung = 1.0\npoisson = 0.3\ngroups = ["upper", "lower"]'), "which an earlier"),
    Bad("a material for faces", changed("young = 1000.0", 'groups = ["slave"]\nyoung = 1000.0'), "group 'slave' has no cell of dimension 2"),
    # stiffness
    Bad("a spring without stiffness", GOOD + '[[spring]]\ngroup = "top"\nkx = 0.0\n', "spring.kx is 0; it must be > 0"),
    Bad("a spring between a face and a node", GOOD + '[[spring]]\ngroup = "top"\nto = "corner"\nky = 1.0\n', r"line 19: spring: the group 'top' has \d+ nodes, and a spring between two nodes has one at each end"),
    Bad("a hinge inside a body", HINGE, r"the stiffness is singular: a part of .+ can move without any force, most of all node \d+ \(.*\) along [xy]; look", make=_hinge, commands=RUN, then=_nothing_written),
    # what is free to move
    Bad("nothing holds a body sideways", changed('group = "x0"\nux', 'group = "bottom"\nux'), r"nothing holds a part of the model: 'upper' moves along x; add a displacement, a spring or a contact"),
    Bad("nothing holds anything", without("displacement"), r"nothing holds a part of the model: .*'lower'.*"),
    Bad("a body without contact", without("contact"), r"'upper' moves along y"),
    # zones
    Bad("the slave is its own master", changed('"master"\n', '"slave"\n'), "line 9: contact.master is 'slave', the slave itself", commands=(*BOTH, *MATRICES)),
    Bad("slave and master share faces", changed('master = "master"', 'master = "twin"'), "line 6: contact: slave 'slave' and master 'twin' share faces", commands=(*BOTH, *MATRICES)),
    Bad("skins that look away from one another", changed('"slave"', '"bottom"').replace('"master"', '"top"'), r"line 6: contact: no face of slave 'bottom' has master 'top' in front of it; check"),
    Bad("a slave that is a body", changed('"slave"', '"lower"'), "line 6: .*'lower'", commands=(*BOTH, *MATRICES)),
    Bad("a slave without its cut in a mesh that carries one", GOOD, r"line 6: the mesh carries a cut of master, and none of slave 'slave'; cut all slaves at once", make=_cut_elsewhere, commands=(*BOTH, *MATRICES)),
    # numbers and formulas
    Bad("a load that is no number at a place", changed("value = 1.0", 'value = "1 / (x - x)"'), r"line 18: pressure\.value.* (nan|inf)"),
    Bad("a clearance that is no number at a place", changed('master = "master"', 'master = "master"\nclearance = "log(x - 5)"'), r"line 10: contact\.clearance"),
    Bad("a displacement that is no number at a time", changed("ux = 0.0", 'ux = "sqrt(0.5 - t)"'), r"line 15: displacement\.ux"),
    # the mesh
    Bad("the mesh is not there", changed("blocks.msh", "blocs.msh"), r"^case\.toml, line 1: mesh is 'blocs\.msh', a file that does not exist; did you mean blocks\.msh\?$", 3, (*BOTH, *MATRICES)),
    Bad("the mesh is cut short", GOOD, r"blocks\.msh", 3, (*BOTH, *MATRICES), make=_short),
    Bad("the mesh has a coordinate that is no number", GOOD, r"blocks\.msh.*(nan|finite|number)", 3, make=_no_number),
    Bad("a plane mesh for a model in space", changed("plane_strain", "3d").replace("uy", "uz"), "the model 3d needs volumes, and the mesh [a-z.]+ is plane; take model = .plane_strain"),
    Bad("a plane mesh that is none", GOOD, "the model plane_strain needs a mesh in a plane z = constant", make=moved(lambda x: np.add(x[:, 2], x[:, 0], out=x[:, 2]))),
    Bad("a radius below 0", changed("plane_strain", "axisymmetric"), r"node \d+ has radius x = -0\.5; an axisymmetric mesh lies at x >= 0", make=moved(lambda x: np.subtract(x[:, 0], 0.5, out=x[:, 0]))),
    Bad("a folded cell", GOOD, r"cells [\d, ]+ are folded, or have no volume", make=moved(_folded)),
    # the solver
    Bad("no convergence", HARD, r"no equilibrium found at time 1 after 1 iterations.*; try .* \(no step has converged; the last state tried is in case/unconverged\)", 4, RUN, then=_failed),
    Bad("a body that is pulled off", changed("value = 1.0", "value = -1.0"), r"no equilibrium found at time .*: 'upper' moves along y, and no contact .*case/unconverged", 4, RUN, then=_failed),
    # results
    Bad("the folder holds results", GOOD, "^case holds results already; --force replaces them, or -o names another folder", 2, RUN, make=_results),
    Bad("the folder is a file", GOOD, "^case: is a file, and results are a folder", 3, RUN, make=_file("case")),
    Bad("the folder would lie nowhere", GOOD, "^no/where: the folder no does not exist", 3, ("run CASE -o no/where",)),
    Bad("the folder takes no files", GOOD, "no file may be made in the folder", 3, RUN, make=_closed, nobody=True),
    Bad("the disk is full", GOOD, r"^case/\S+: cannot be written \(File too large\)", 3, RUN, file_size=1000, then=_nothing_written),
    Bad("the disk is full, at once", GOOD, r"^case/\S+: cannot be written \(File too large\)", 3, RUN, file_size=0, then=_nothing_written),
    # restart
    Bad("--from without --restart", GOOD, "--from says where in the folder of --restart to begin", 2, ("run CASE --from 0.5",)),
    Bad("a restart from nowhere", GOOD, "^old: cannot be read|^old holds no state", 3, ("run CASE --restart old",)),
    Bad("a restart from a folder without states", GOOD, r"^\. holds no state to go on from", 2, ("run CASE --restart .",)),
    Bad("a restart from a damaged state", GOOD, r"^old/state_0001\.npz: is damaged or no state .*; no other state is in old: start anew", 3, ("run CASE --restart old",), make=_states(b"PK\x03\x04 nothing")),
    Bad("a restart from an empty state", GOOD, r"^old/state_0001\.npz: is damaged or no state", 3, ("run CASE --restart old",), make=_states(b"")),
    Bad("a time that is no number", GOOD, "--from: invalid float value: 'soon'", 2, ("run CASE --restart old --from soon",)),
    # pictures and matrices
    Bad("a plot that is no picture", GOOD, r"^p\.jpg: a picture is written as \.png", 2, ("run CASE --plot p.jpg",)),
    Bad("a plot that exists", GOOD, r"^p\.png exists already; --force replaces it", 2, ("run CASE --plot p.png",), make=_file("p.png")),
    Bad("a plot without a contact", without("contact") + '[[spring]]\ngroup = "top"\nky = 1.0\n', r"a plot shows contacts and ties, and the case has no \[\[contact\]\]", 2, ("run CASE --plot p.png",)),
    Bad("matrices of no zone", without("contact"), r"needs a \[\[contact\]\] or a \[\[tie\]\]", commands=MATRICES),
    Bad("matrices that are no .npz", GOOD, r"^m\.mat: matrices are written as \.npz", 2, ("matrices CASE -o m.mat",)),
    Bad("matrices that exist", GOOD, r"^m\.npz exists already; --force replaces it", 2, MATRICES, make=_file("m.npz")),
    Bad("matrices that exist in the other format", GOOD, r"^m\.mtx exists already; --force replaces it", 2, ("matrices CASE -o m.npz --mtx",), make=_file("m.mtx")),
    Bad("matrices on a full disk", GOOD, r"^m\.npz: cannot be written \(File too large\)", 3, MATRICES, file_size=100),
    Bad("a plot of a run that is none", GOOD, r"^cas: a run with this folder does not exist; there are none$", 3, ("plot cas",)),
    Bad("a report of a run that is none", GOOD, r"^case: a run with this folder does not exist; there are none$", 3, ("report case.toml",)),
    # natural modes
    Bad("modes without a density", GOOD, r"^case\.toml: group 'lower', 'upper': 19 cells have no density: .*; a mass needs the density of their \[\[material\]\]", commands=MODES),
    Bad("no modes", HEAVY, r"^-k is the number of modes to find, 1 or more, not 0$", 2, ("modes CASE -k 0",)),
    Bad("a number of modes that is none", HEAVY, "-k/--count: invalid int value: 'all'", 2, ("modes CASE -k all",)),
    Bad("modes that exist", HEAVY, r"^m holds natural modes already; --force replaces them, or -o names another folder$", 2, ("modes CASE -o m",), make=_modes),
    Bad("modes into a file", HEAVY, r"^m: is a file, and results are a folder; choose another name$", 3, ("modes CASE -o m",), make=_file("m")),
    Bad("modes into nowhere", HEAVY, r"^a/m: the folder a does not exist$", 3, ("modes CASE -o a/m",)),
    Bad("modes where nothing may be written", HEAVY, r"^m: no file may be made in the folder \.", 3, ("modes CASE -o m",), make=_closed, nobody=True),
    Bad("modes on a full disk", HEAVY, r"^m/\S+: cannot be written \(File too large\)", 3, MODES, file_size=1000, then=_no_modes),
    Bad("modes at a time of no state", HEAVY, r"^--from says which state in the folder of --state to take; give both$", 2, ("modes CASE --from 1",)),
    Bad("modes about a state from nowhere", HEAVY, "^old: cannot be read", 3, ("modes CASE --state old",)),
    Bad("modes about no state", HEAVY, r"^\. holds no state to go on from", 2, ("modes CASE --state .",)),
    Bad("modes by multigrid", HEAVY + '[solver]\nbackend = "multigrid"\n', 'natural modes need a factorisation; take \\[solver\\] backend = "auto"', 2, MODES),
    Bad("modes with PETSc", HEAVY + '[solver]\nengine = "petsc"\n', 'natural modes are found by one process, not with PETSc; take \\[solver\\] engine = "serial"', 2, MODES),
    Bad("modes of a folder that has none", HEAVY, r"^\. holds no natural modes \(modes\.pvd\)", 2, ("film . --mode 1 -o f.gif",)),
    # the command
    Bad("no command", GOOD, r"^case\.toml is a file, and a command comes first: lacsolver run case\.toml$", 2, ("CASE",)),
    Bad("a command that nobody knows", GOOD, "invalid choice: 'solve'", 2, ("solve CASE",)),
    Bad("an option that nobody knows", GOOD, "unrecognized arguments: --quickly", 2, ("run CASE --quickly",)),
    Bad("no case", GOOD, r"the following arguments are required: CASE\.toml", 2, ("run --quiet", "validate --quiet", "matrices -o m.npz")),
]  # fmt: skip
