# ruff: noqa: E501 (a row a line)
"""Bad inputs of lacsolver: cases that are wrong by themselves, and what a command is asked for.

`MISTAKES`: a text with one mistake, which a reader sees without a mesh (`test_case_read`). `CASES`: a case file (the
good one with a change), a command, a status, a part of the message (`test_cli_bad`): what cases ask of a mesh, and where
results go. The corpus of lacmesh (tests/bad_input) is about files of meshes.
"""

from __future__ import annotations

import json
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
BOTH = ("validate", "run")
RUN = ("run",)
MATRICES = ("matrices CASE -o m.npz",)
MODES = ("modes CASE -o m",)
SOLID = GOOD.replace("plane_strain", "3d").replace("uy = 0.0", "uz = 0.0")
SOLID_MESH = stack("HEXA8", "TETRA4", 3, counts=(3, 2))
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


def _hinge(folder: Path) -> None:
    """One body of two squares that share a node: one may turn about it, and costs nothing."""
    points = [[0, 0], [1, 0], [1, 1], [0, 1], [2, 1], [2, 2], [1, 2], [0, 2], [0, 3], [-1, 3], [-1, 2]]
    cells = [("QUAD4", [[0, 1, 2, 3], [2, 4, 5, 6]]), ("SEG2", [[0, 1], [5, 6]])]
    put(Mesh.create(points, cells, cell_groups={"bottom": [2], "top": [3]}, space_dim=2), folder)


def without_bodies(mesh: Mesh) -> Mesh:
    """The skins of a mesh alone, as gmsh writes them where only surfaces are physical groups."""
    kept = mesh.cell_dim < mesh.dim
    new = np.cumsum(kept) - 1
    groups = {name: new[cells[kept[cells]]] for name, cells in mesh.cell_groups.items() if kept[cells].any()}
    return Mesh.create(mesh.points, [(k, n) for k, _, n in mesh.select(np.flatnonzero(kept))], cell_groups=groups)


def _folded(points: np.ndarray) -> None:
    inside = np.flatnonzero((points[:, 0] > 0.1) & (points[:, 0] < 0.9) & (points[:, 1] > 1.1) & (points[:, 1] < 1.9))
    points[inside[0], :2] += 5.0


def _no_number(folder: Path) -> None:
    lacmesh.write(folder / "blocks.msh", blocks(), binary=False, force=True)
    text = (folder / "blocks.msh").read_text()
    head, nodes = text.split("$Nodes")
    assert " 2.0 0.0\n" in nodes
    (folder / "blocks.msh").write_text(head + "$Nodes" + nodes.replace(" 2.0 0.0\n", " nan 0.0\n", 1))


def _file(name: str, content: bytes = b"an older result") -> Callable[[Path], object]:
    """A file that is there before the command."""

    def make(folder: Path) -> None:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content)

    return make


def _failed(folder: Path) -> None:
    told = json.loads((folder / "case" / "results.json").read_text())
    assert told["status"] == "failed" and told["message"]
    assert (folder / "case" / "unconverged" / "solid.pvd").exists()


def _nothing_written(folder: Path) -> None:
    assert not list(folder.rglob("*.vtu")) and not list(folder.rglob("state_*.npz"))


HINGE = without("contact", "x0").replace("uy = 0.0", "ux = 0.0\nuy = 0.0")
HARD = changed("uy = 0.0", "uy = 0.0\n[[force]]\nat = [1, 2]\nfy = -5.0")
HARD = HARD.replace('slave = "slave"', 'slave = "slave"\ngeometry = "current"')
HARD += "[steps]\nmax_halvings = 0\n[solver]\nmax_iterations = 1\n"

CASES: list[Bad] = [
    Bad("the case is not there", "", r"^nowhere\.toml: cannot be read \(No such file or directory\)", 3, ("validate nowhere.toml", "run nowhere.toml -o r", "matrices nowhere.toml -o m.npz")),
    Bad("the case is a folder", "", r"^\.: is a folder, not a case; it has case\.toml", 3, ("validate .",)),
    Bad("the case is no TOML", GOOD + "[[contact\n", r"case\.toml, line 19: ", 3),
    Bad("the case is no text", b"mesh = \"\xff\"\n", r"case\.toml, line 1: is not UTF-8 text", 3),
    Bad("several mistakes, all told with their lines", changed("young = 1000.0", "young = -1.0").replace("uy = 0.0", "uq = 0.0").replace("value", "valu"), ("line 4: material.young is -1", "line 12: displacement.uq is not a key", r"line 16: \[\[pressure\]\] needs value", "line 18: pressure.valu is not a key")),
    Bad("a group of a contact that the mesh lacks", changed('slave = "slave"', 'slave = "slav"'), r"case\.toml, line 6: contact\.slave: no cell group named 'slav'; did you mean slave\?", commands=(*BOTH, *MATRICES)),
    Bad("several groups that the mesh lacks, all told", changed('"bottom"', '"botom"').replace('"top"', '"tip"'), (r"line 10: displacement\.group: no group named 'botom'; did you mean bottom", r"line 16: pressure\.group: no cell group named 'tip'; did you mean top")),
    Bad("a pressure on cells of the body", changed('group = "top"', 'group = "upper"'), "line 16: pressure: a load on a surface needs cells of dimension 1, and cells [0-9, ]+ have another; name a group of faces"),
    Bad("cells without a material", changed("young = 1000.0", 'groups = ["lower"]\nyoung = 1000.0'), r"\d+ cells have no material: .*; name a group that holds them"),
    Bad("cells with two materials", changed("poisson = 0.3", 'poisson = 0.3\ngroups = ["lower"]\n[[material]]\nyoung = 1.0\npoisson = 0.3\ngroups = ["upper", "lower"]'), "which an earlier"),
    Bad("a material for faces", changed("young = 1000.0", 'groups = ["slave"]\nyoung = 1000.0'), "group 'slave' has no cell of dimension 2"),
    Bad("a spring between a face and a node", GOOD + '[[spring]]\ngroup = "top"\nto = "corner"\nky = 1.0\n', r"line 19: spring: the group 'top' has \d+ nodes, and a spring between two nodes has one at each end"),
    Bad("a hinge inside a body", HINGE, r"the stiffness is singular: a part of .+ can move without any force, most of all node \d+ \(.*\) along [xy]; check", make=_hinge, commands=RUN, then=_nothing_written),
    Bad("nothing holds a body sideways", changed('group = "x0"\nux', 'group = "bottom"\nux'), r"nothing supports a part of the model: 'upper' moves along x; add a displacement, a spring or a contact"),
    Bad("slave and master share faces", changed('master = "master"', 'master = "twin"'), "line 6: contact: slave 'slave' and master 'twin' share faces", commands=(*BOTH, *MATRICES)),
    Bad("skins that look away from one another", changed('"slave"', '"bottom"').replace('"master"', '"top"'), r"line 6: contact: no face of slave 'bottom' has master 'top' in front of it; check"),
    Bad("a slave without its cut in a mesh that carries one", GOOD, r"line 6: the mesh carries a cut of master, and none of slave 'slave'; cut all slaves at once", make=lambda folder: put(lacmesh.cut_skin(blocks(), "master").mesh, folder), commands=(*BOTH, *MATRICES)),
    Bad("a load that is no number at a place", changed("value = 1.0", 'value = "1 / (x - x)"'), r"line 18: pressure\.value.* (nan|inf)"),
    Bad("a clearance that is no number at a place", changed('master = "master"', 'master = "master"\nclearance = "log(x - 5)"'), r"line 10: contact\.clearance"),
    Bad("a displacement that is no number at a time", changed("ux = 0.0", 'ux = "sqrt(0.5 - t)"'), r"line 15: displacement\.ux"),
    Bad("the mesh is not there", changed("blocks.msh", "blocs.msh"), r"^case\.toml, line 1: mesh is 'blocs\.msh', a file that does not exist; did you mean blocks\.msh\?$", 3, (*BOTH, *MATRICES)),
    Bad("the mesh is cut short", GOOD, r"blocks\.msh", 3, (*BOTH, *MATRICES), make=lambda folder: (folder / "blocks.msh").write_bytes((folder / "blocks.msh").read_bytes()[:1000])),
    Bad("the mesh has a coordinate that is no number", GOOD, r"blocks\.msh.*(nan|finite|number)", 3, make=_no_number),
    Bad("a plane mesh for a model in space", changed("plane_strain", "3d").replace("uy", "uz"), "the model 3d needs volumes, and the mesh [a-z.]+ is plane; take model = .plane_strain"),
    Bad("a mesh in space for a plane model", GOOD, r"the model plane_strain is plane, and the mesh blocks\.msh has volumes; take model = .3d", make=lambda folder: put(SOLID_MESH, folder)),
    Bad("a plane mesh without its bodies", GOOD, r"needs surfaces: the mesh blocks\.msh has no surfaces, only cells of type .*Mesh\.SaveAll = 1", commands=(*BOTH, "modes CASE -q"), make=lambda folder: put(without_bodies(blocks()), folder)),
    Bad("a mesh in space without its bodies", SOLID, r"needs volumes: the mesh blocks\.msh has no volumes, only cells of type .*Mesh\.SaveAll = 1", commands=(*BOTH, "modes CASE -q"), make=lambda folder: put(without_bodies(SOLID_MESH), folder)),
    Bad("a plane mesh that is none", GOOD, "the model plane_strain needs a mesh in a plane z = constant", make=moved(lambda x: np.add(x[:, 2], x[:, 0], out=x[:, 2]))),
    Bad("a radius below 0", changed("plane_strain", "axisymmetric"), r"node \d+ has radius x = -0\.5; an axisymmetric mesh lies at x >= 0", make=moved(lambda x: np.subtract(x[:, 0], 0.5, out=x[:, 0]))),
    Bad("a folded cell", GOOD, r"cells [\d, ]+ are folded, or have no volume", make=moved(_folded)),
    Bad("no convergence", HARD, r"no equilibrium found at time 1 after 1 iterations.*; try .* \(no step has converged; the last state tried is in case/unconverged\)", 4, RUN, then=_failed),
    Bad("a body that is pulled off", changed("value = 1.0", "value = -1.0"), r"no equilibrium found at time .*: 'upper' moves along y, and no contact .*case/unconverged", 4, RUN, then=_failed),
    Bad("the folder holds results", GOOD, "^case holds results already; --force replaces them, or -o names another folder", 2, RUN, make=_file("case/results.json")),
    Bad("the folder is a file", GOOD, "^case: is a file, and results are a folder", 3, RUN, make=_file("case")),
    Bad("the folder would lie nowhere", GOOD, "^no/where: the folder no does not exist", 3, ("run CASE -o no/where",)),
    Bad("the folder takes no files", GOOD, "no file may be made in the folder", 3, RUN, make=lambda folder: folder.chmod(0o555), nobody=True),
    Bad("the disk is full", GOOD, r"^case/\S+: cannot be written \(File too large\)", 3, RUN, file_size=1000, then=_nothing_written),
    Bad("--from without --restart", GOOD, "--from chooses a state in the folder of --restart", 2, ("run CASE --from 0.5",)),
    Bad("a restart from nowhere", GOOD, "^old: cannot be read|^old has no state", 3, ("run CASE --restart old",)),
    Bad("a restart from a folder without states", GOOD, r"^\. has no state to go on from", 2, ("run CASE --restart .",)),
    Bad("a restart from a damaged state", GOOD, r"^old/state_0001\.npz: is damaged or no state .*; no other state is in old: start anew", 3, ("run CASE --restart old",), make=_file("old/state_0001.npz", b"PK\x03\x04 nothing")),
    Bad("a plot that is no picture", GOOD, r"^p\.jpg: a picture is written as \.png", 2, ("run CASE --plot p.jpg",)),
    Bad("a plot without a contact", without("contact") + '[[spring]]\ngroup = "top"\nky = 1.0\n', r"a plot shows contacts and ties, and the case has no \[\[contact\]\]", 2, ("run CASE --plot p.png",)),
    Bad("matrices of no zone", without("contact"), r"needs a \[\[contact\]\] or a \[\[tie\]\]", commands=MATRICES),
    Bad("matrices that are no .npz", GOOD, r"^m\.mat: matrices are written as \.npz", 2, ("matrices CASE -o m.mat",)),
    Bad("matrices that exist", GOOD, r"^m\.npz exists already; --force replaces it", 2, MATRICES, make=_file("m.npz")),
    Bad("matrices that exist in the other format", GOOD, r"^m\.mtx exists already; --force replaces it", 2, ("matrices CASE -o m.npz --mtx",), make=_file("m.mtx")),
    Bad("a plot of a run that is none", GOOD, r"^cas: a run with this folder does not exist; there are none$", 3, ("plot cas",)),
    Bad("modes without a density", GOOD, r"^case\.toml: group 'lower', 'upper': 19 cells have no density: .*; a mass needs the density of their \[\[material\]\]", commands=MODES),
    Bad("no modes", HEAVY, r"^-k is the number of modes to find, 1 or more, not 0$", 2, ("modes CASE -k 0",)),
    Bad("modes that exist", HEAVY, r"^m holds natural modes already; --force replaces them, or -o names another folder$", 2, ("modes CASE -o m",), make=_file("m/modes.json")),
    Bad("modes at a time of no state", HEAVY, r"^--from chooses a state in the folder of --state; give both$", 2, ("modes CASE --from 1",)),
    Bad("modes by multigrid", HEAVY + '[solver]\nbackend = "multigrid"\n', 'natural modes need a factorisation; take \\[solver\\] backend = "auto"', 2, MODES),
    Bad("modes with PETSc", HEAVY + '[solver]\nengine = "petsc"\n', 'natural modes are found by one process, not with PETSc; take \\[solver\\] engine = "serial"', 2, MODES),
    Bad("modes of a folder that has none", HEAVY, r"^\. holds no natural modes \(modes\.pvd\)", 2, ("film . --mode 1 -o f.gif",)),
    Bad("no command", GOOD, r"^case\.toml is a file, and a command comes first: lacsolver run case\.toml$", 2, ("CASE",)),
    Bad("a command that nobody knows", GOOD, "there is no command 'solve'", 2, ("solve CASE",)),
    Bad("an option that nobody knows", GOOD, "no such option: --quickly", 2, ("run CASE --quickly",)),
    Bad("no case", GOOD, r"missing argument 'CASE\.toml'", 2, ("run --quiet", "validate --quiet", "matrices -o m.npz")),
]  # fmt: skip

# ---- cases that are wrong by themselves

HEAD = 'mesh = "a.msh"\nmodel = "3d"\n'
STEEL = "[[material]]\nyoung = 1.0\npoisson = 0.3\n"
BODY = HEAD + STEEL
PLATE = BODY.replace("3d", "plane_strain")
RING = BODY.replace("3d", "axisymmetric")
BIG = HEAD + 'kinematics = "finite"\n' + STEEL.replace("[[material]]", '[[material]]\nlaw = "neo_hookean"')
PAIR = '[[contact]]\nslave = "s"\nmaster = "m"\n'
WOOD = '[[material]]\nlaw = "orthotropic"\nyoung = [1, 1, 1]\nshear = [1, 1, 1]\n'

#: mistakes that the table of keys shows, so that the JSON schema has them; each type of value and rule of a section once:
#: which keys have it stands in the page of keys, which is current (test_case_read)
SHOWN = [
    ('model = "3d"\n' + STEEL, "the top of the file needs mesh"),
    ('mesh = "a.msh"\n' + STEEL, "the top of the file needs model (dimension and plane hypothesis; 3d, plane"),
    (BODY.replace('"a.msh"', "3 #!"), "mesh is 3; it takes a path"),
    (BODY.replace('"3d"', '"3D" #!'), 'model is "3D"; did you mean 3d?'),
    (BODY.replace('"3d"', "3 #!"), "model is 3; it takes one of 3d, plane_strain"),
    ("thickness = { pin = -2.0 } #!\n" + BODY.replace("3d", "plane_stress"), "thickness has an entry 'pin' that is -2; it must be > 0"),
    ("modle = 1 #!\n" + BODY, "modle is not a key of a case; did you mean model?"),
    (BODY + "[[contacts]] #!\n", "contacts is not a section of a case; did you mean contact?"),
    (HEAD + STEEL.replace("[[material]]", "[material] #!"), "[material] may occur several times; write [[material]]"),
    (BODY + "[[steps]]\n[[steps]] #!\n", "[[steps]] is a single section; write [steps]"),
    ("steps = 4 #!\n" + BODY, "steps is 4; write [steps] and its keys below it"),
    ("pressure = 25.0 #!\n" + BODY, "pressure is 25; write [[pressure]] and its keys below it"),
    ("pressure = [25.0] #!\n" + BODY, "pressure is a list of 1; write [[pressure]]"),
    (BODY + PAIR + 'hex = "hexa" #!\n', "contact.hex is not a key of [[contact]]; did you mean hexa?"),
    (BODY + PAIR + 'kinematics = "small" #!\n', "it belongs at the top of the file, before the first section"),
    (HEAD + "[[material]] #!\nyoung = 1.0\n", "[[material]] needs poisson (Poisson's ratio"),
    (HEAD + "[[material]]\nyoung = 0 #!\npoisson = 0.3\n", "material.young is 0; it must be > 0"),
    (HEAD + "[[material]]\nyoung = true #!\npoisson = 0.3\n", "material.young is true; it takes a number"),
    (HEAD + '[[material]]\nyoung = "1e3" #!\npoisson = 0.3\n', 'material.young is the text "1e3"; it takes a number'),
    (HEAD + "[[material]]\nyoung = [1, 2] #!\npoisson = 0.3\n", "material.young is a list of 2; it takes a number > 0, or three"),
    (BODY + "density = -1.0 #!\n", "material.density is -1; it must be >= 0"),
    (BODY + 'law = "plastic"\nhardening = [2.0, 0.0] #!\n', "has an item (number 1) that is 2"),
    (BODY + 'groups = "lower" #!\n', 'material.groups is the text "lower"; it takes a list of groups, as ["lower"]'),
    (BODY + "groups = [] #!\n", "material.groups is an empty list; remove the key if the whole mesh is meant"),
    (BODY + 'groups = [\n"a",\n1.5, #!\n]\n', "material.groups has an item (number 2) that is 1.5; it takes the name of a group"),
    (HEAD + WOOD.replace("shear = [1, 1, 1]", "shear = [1, 1] #!") + "poisson = [0, 0, 0]\n", "is a list of 2; it takes three numbers > 0"),
    (HEAD + WOOD + "poisson = [0, 0, 0]\naxes = [1, 0, 0] #!\n", "material.axes is a list of 3; it takes two vectors"),
    (BODY + '[[contact]] #!\nmaster = "m"\n', "[[contact]] needs slave or surfaces"),
    (BODY + '[[contact]]\nsurfaces = ["a"] #!\n', "contact.surfaces has 1 groups; it takes two"),
    (BODY + '[[contact]]\nslave = "a"\nsurfaces = ["a", "b"] #!\n', "contact.surfaces cannot be combined with slave"),
    (BODY + PAIR + "friction = [[0, 0.1], [1, -0.3]] #!\n", "contact.friction is -0.3; it must be >= 0"),
    (BODY + PAIR + "friction = 0.1\nshear_limit = 0 #!\n", "contact.shear_limit is 0; it must be > 0"),
    (BODY + PAIR + 'law = "table"\npressures = [[0, 0]] #!\n', "it takes two or more rows [[pressure, overlap], ...]"),
    (BODY + PAIR + 'normals = "smoothed"\ncrease_angle = 181.0 #!\n', "contact.crease_angle is 181; it must be >= 0 and <= 180"),
    (BODY + '[[contact]]\nslave = ["s"] #!\nmaster = "m"\n', "contact.slave is a list of 1; it takes the name of a group"),
    (BODY + '[[contact]]\nslave = -1 #!\nmaster = "m"\n', "contact.slave is -1; it takes the name of a group"),
    (BODY + PAIR + "clearance = true #!\n", "contact.clearance is true; it takes a number, a formula of x, y, z, t, or a table"),
    (BODY + PAIR + "clearance = 1979-05-27 #!\n", "contact.clearance is a date; it takes a number"),
    (BODY + PAIR + "clearance = [] #!\n", "contact.clearance is an empty table of times"),
    (BODY + PAIR + "clearance = [\n[0, 1],\n[1], #!\n]\n", "contact.clearance has a list of 1 in its table of times"),
    (BODY + PAIR + "clearance = [\n[0, 1],\n[1, true], #!\n]\n", "contact.clearance has an entry in its table of times that is true"),
    (BODY + '[[displacement]] #!\nux = 0.0\n', "[[displacement]] needs group or at"),
    (BODY + '[[displacement]]\ngroup = "g"\nat = [0, 0, 0] #!\nux = 0.0\n', "displacement.at cannot be combined with group"),
    (BODY + '[[displacement]] #!\ngroup = "g"\n', "[[displacement]] needs at least one of ux, uy, uz, un"),
    (BODY + '[[displacement]]\ngroup = "g"\nun = 0.0\nux = 0.0 #!\n', "displacement.ux cannot be combined with un"),
    (BODY + "[[displacement]]\nat = [0] #!\nux = 0.0\n", "displacement.at is a list of 1; it takes [x, y, z]"),
    (BIG + '[[pressure]]\ngroup = "g"\nvalue = 1.0\nfollower = 1 #!\n', "pressure.follower is 1; it takes true or false"),
    (BODY + '[[equation]]\ngroup = "g"\nsame = ["ux", "ux"] #!\n', "equation.same names the component 'ux' twice"),
    (BODY + '[[equation]]\ngroup = "g"\nsame = "ux" #!\n', 'is the text "ux"; it takes a list of components'),
    (BODY + '[[equation]]\ngroup = "g"\nsame = ["un"] #!\n', 'that is "un"; there are: ux, uy, uz'),
    (BODY + "[[equation]]\nterms = [] #!\n", "equation.terms is a list of 0; it takes a list of"),
    (BODY + '[[equation]]\nterms = [{ component = "ux", node = 1 }] #!\n', "needs factor; it takes"),
    (BODY + '[[equation]]\nterms = [{ factor = 1, component = "ux" }] #!\n', "needs one of node, group, at; it takes"),
    (BODY + '[[equation]]\nterms = [{ factor = 0, component = "ux", node = 1 }] #!\n', "has the factor 0; remove the term"),
    (BODY + '[[equation]]\nterms = [{ factor = 1, component = "ux", nodes = 1 }] #!\n', "has nodes; did you mean node?"),
    (BODY + '[[equation]]\nterms = [{ factor = "a", component = "ux", node = 1 }] #!\n', 'has factor, which is the text "a"'),
    (BODY + '[[displacement]]\ngroup = "g"\nux = 0\naxes = { origin = [0, 0, 0] } #!\n', "needs x, or axis, and not both"),
    (BODY + '[[displacement]]\ngroup = "g"\nux = 0\naxes = { axis = [0, 0, 1] } #!\n', "displacement.axes is cylindrical, so it needs origin and axis, and no xy"),
    (BODY + '[[coupling]]\ngroup = "g"\nux = 1\nweights = [] #!\n', "coupling.weights is an empty list"),
    (BODY + '[[coupling]]\ngroup = "g"\nrotation = ["free", 0.1] #!\n', "coupling.rotation is a list of 2; it takes three values of time"),
    (BODY + "[steps]\ncount = 0 #!\n", "steps.count is 0; it must be >= 1"),
    (BODY + "[steps]\ncount = 99999999999 #!\n", "steps.count is too large"),
    (BODY + "[steps]\ntimes = 1.0 #!\n", "steps.times is 1; it takes a list of increasing times > 0"),
    (BODY + '[solver]\nbackend = "pardisso" #!\n', 'solver.backend is "pardisso"; did you mean pardiso?'),
    (BODY + "[solver]\ntolerance = 1.0 #!\n", "solver.tolerance is 1; it must be > 0 and < 1"),
    (BODY + "[solver]\nmax_iterations = true #!\n", "solver.max_iterations is true; it takes a whole number"),
]  # fmt: skip
#: mistakes that depend on the model, other keys, other sections, a formula's names
BEYOND = [
    ("thickness = 2.0 #!\n" + BODY, "thickness applies to the models plane_strain, plane_stress, and the model is 3d"),
    (HEAD, "needs a [[material]]"),
    (HEAD + "[[material]]\nyoung = inf #!\npoisson = 0.3\n", "material.young is inf; it takes a number, and a finite one"),
    (HEAD + "[[material]]\nyoung = 1\npoisson = 0.5 #!\n", "material.poisson is 0.5; it must be > -1 and < 0.5; use 0.49"),
    (HEAD + "[[material]]\nyoung = [1, 2, 3] #!\npoisson = 0.3\n", 'has three numbers; only law = "orthotropic" takes three'),
    (BODY + "shear = [1.0, 1.0, 1.0] #!\n", 'material.shear has an effect only with law = "orthotropic"'),
    (BODY.replace("]]", "]] #!") + 'law = "plastic"\n', "needs hardening = [[yield stress, 0.0], ...]"),
    (BODY + 'law = "plastic"\nhardening = [[2.0, 0.1]] #!\n', "begins at a plastic strain of 0.1; the first row must be at 0"),
    (BODY + 'law = "plastic"\nhardening = [[0.0, 0.0]] #!\n', "has the yield stress 0; yield stresses must be above 0"),
    (BODY + 'law = "plastic"\nhardening = [[2.0, 0.0], [3.0, 0.0]] #!\n', "has the plastic strain 0 after 0; plastic strains must increase"),
    (BODY + 'law = "plastic"\nhardening = [[2.0, 0.0], [1.0, 0.1]] #!\n', "falls from 2 to 1; a metal that softens is not available"),
    (BODY + 'law = "neo_hookean" #!\n', 'which needs kinematics = "finite"; with "small" it is one of elastic, orthotropic'),
    (HEAD + 'kinematics = "finite"\n[[material]] #!\nyoung = 1\npoisson = 0\n', 'material.law is "elastic", which needs kinematics'),
    (BODY + 'groups = ["a", "a"] #!\n', "material.groups names the group 'a' twice"),
    (BODY + '[[material]] #!\nyoung = 1\npoisson = 0\n'.replace("#!", "") , "has no groups, so it applies to the whole mesh and to cells of other sections"),
    (BODY + 'groups = ["a"]\n' + STEEL + 'groups = ["b", "a"] #!\n', "material.groups names 'a', which an earlier [[material]] names too"),
    (HEAD + WOOD.replace("shear = [1, 1, 1]\n", "").replace("]]", "]] #!") + "poisson = [0, 0, 0]\n", "needs shear = [G12, G13, G23]"),
    (HEAD + WOOD + "poisson = 0.3 #!\n", 'material.poisson is one number; law = "orthotropic" takes three'),
    (HEAD + WOOD.replace("young = [1, 1, 1]", "young = 1 #!") + "poisson = [0, 0, 0]\n", 'material.young is one number; law = "orthotropic"'),
    (HEAD + WOOD + "poisson = [0.6, 0.6, 0.6] #!\n", "material.poisson gives, with these young, a strain energy below 0"),
    (HEAD + WOOD + "poisson = [-2.0, 2.0, 4.0] #!\n", "nu_ij² < E_i / E_j must hold"),
    (HEAD + WOOD + "poisson = [0, 0, 0]\naxes = [[1, 0, 0], [2, 0, 0]] #!\n", "material.axes has vectors that lie on one line"),
    (HEAD + WOOD + "poisson = [0, 0, 0]\naxes = [[1, 0, 0], [0, 1]] #!\n", "has vectors of different dimensions"),
    (HEAD + WOOD + "poisson = [0, 0, 0]\naxes = [[1, 0], [0, 1]] #!\n", "has vectors of 2 components; 3d has 3"),
    (PLATE.replace(STEEL, WOOD) + "poisson = [0, 0, 0]\naxes = [[1, 0, 1], [0, 1, 0]] #!\n", "has vectors out of the plane"),
    (BODY + '[[contact]]\nslave = "s"\nmaster = "s" #!\n', "contact.master is 's', the same group as the slave"),
    (BODY + PAIR + '[[tie]]\nslave = "s" #!\nmaster = "n"\nname = "t"\n', "tie.slave is 's', which is the slave of an earlier section too"),
    (BODY + PAIR + '[[rigid]]\ngroup = "s"\n'.replace('"s"', '"s"'), "contact.slave is 's', which is [[rigid]]"),
    (BODY + PAIR + '[[contact]]\nname = "s" #!\nslave = "q"\nmaster = "m"\n', "contact.name is 's', which is the name of an earlier section too"),
    (BODY + PAIR + "cohesion = inf #!\n", "contact.cohesion is inf; it takes a number"),
    (BODY + PAIR + 'law = "exponential" #!\npressure_at_contact = 1\n', 'needs clearance_at_zero with law = "exponential"'),
    (BODY + PAIR + 'law = "table" #!\n', 'needs pressures with law = "table"'),
    (BODY + PAIR + 'stiffness = 1 #!\nlaw = "table"\npressures = [[0, 0], [1, 1]]\n', 'contact.stiffness cannot be combined with law = "table"'),
    (BODY + PAIR + 'law = "table"\npressures = [[1, 0], [2, 1]] #!\n', "begins with the pressure 1; the first pressure must be 0"),
    (BODY + PAIR + 'law = "table"\npressures = [[0, 0], [1, 0]] #!\n', "goes from [0, 0] to [1, 0]; pressure and overlap must both increase"),
    (BODY + PAIR + "shear_limit = 2 #!\n", "contact.shear_limit has an effect only with friction or cohesion"),
    (BODY + PAIR + "friction = inf\ncohesion = 1 #!\n", "contact.cohesion has no effect with friction = inf, which excludes slip"),
    (BODY + PAIR + 'type = "bilateral"\nfriction = 0.1 #!\n', 'contact.friction needs contact that can open, and type is "bilateral"'),
    (BODY + PAIR + 'measure = "current" #!\n', 'contact.measure is "current", which needs geometry = "current"'),
    (BIG + PAIR + 'geometry = "reference"\nmeasure = "current" #!\n', 'contact.measure is "current", which needs geometry'),
    (BODY + '[[contact]]\nslave = " " #!\nmaster = "m"\n', "contact.slave is empty"),
    (BODY + PAIR + 'clearance = "r ** 2" #!\n', "contact.clearance has the unknown name 'r' in its formula"),
    (BODY + PAIR + "clearance = [\n[0, 1],\n[0, 2], #!\n]\n", "contact.clearance has time 0 after 0 in its table; times must increase"),
    (BODY + PAIR + 'clearance = """x +\n y ^ 2""" #!\n'.replace('"""x', '"""x').replace(" #!", ""), "write ** for a power"),
    (PLATE + PAIR + 'clearance = "z" #!\n', "contact.clearance uses z, which the model plane_strain does not have"),
    (BODY + '[[displacement]]\ngroup = "g"\nkind = "node"\nun = 0.0 #!\n', "displacement.un is along the normal of faces"),
    (BODY + "[[displacement]]\nat = [0, 0] #!\nux = 0.0\n", "displacement.at has 2 coordinates; 3d has 3"),
    (BODY + '[[displacement]]\ngroup = "g"\nux = 0.0\n[[displacement]]\ngroup = "g"\nux = 1.0 #!\n', "displacement.ux is prescribed at 'g' by the [[displacement]] of"),
    (BODY + '[[rigid]]\ngroup = "g"\n[[displacement]]\ngroup = "g" #!\nux = 0.0\n', "displacement.group is 'g', which is [[rigid]]; prescribe the motion in [[rigid]]"),
    (BODY + '[[spring]]\ngroup = "g"\nk = 1.0 #!\n', "spring.k is the stiffness along the line to another node; give this node as to, or use kx, ky, kz"),
    (BODY + '[[spring]]\ngroup = "g"\nto = "g" #!\nk = 1.0\n', "spring.to is 'g', the group itself; name the node at the other end"),
    (BODY + '[[spring]]\ngroup = "g"\nto = "h"\nkx = 1.0\naxes = { origin = [0, 0, 0], axis = [0, 0, 1] } #!\n', "spring.axes are cylindrical; a spring between two nodes needs Cartesian axes"),
    (BODY + '[[pressure]]\ngroup = "g"\nvalue = 1.0\nfollower = true #!\n', 'pressure.follower has an effect only with kinematics = "finite"'),
    (BODY + "[gravity] #!\ngz = -9.81\n", "[gravity] has no effect: no [[material]] has a density"),
    (BODY + "[[temperature]] #!\nvalue = 1.0\n", "[[temperature]] has no effect: no [[material]] has an expansion"),
    (BODY + '[[rigid]]\ngroup = "g"\n[[rigid]]\ngroup = "g" #!\n', "rigid.group is 'g', the group of an earlier [[rigid]] too"),
    (BODY + '[[rigid]]\ngroup = "g"\nrotation = [0, 0, 1]\nmoment = [0, 0, 1] #!\n', "rigid.moment cannot be combined with rotation"),
    (BODY + '[[rigid]]\ngroup = "g"\nrotation = 0.5 #!\n', "rigid.rotation is one value; a 3d model needs a vector of three"),
    (PLATE + '[[rigid]]\ngroup = "g"\nmoment = [0, 0, 1] #!\n', "rigid.moment is a vector; a plane model needs one value"),
    (BODY + '[[rigid]]\ngroup = "g"\nux = "x" #!\n', "rigid.ux depends on x, y or z, and is one value for a whole body; write a formula of t"),
    (BODY + '[[rigid]]\ngroup = "g"\nmoment = [0, 0, "y * t"] #!\n', "rigid.moment has an item (number 3) that depends on x, y or z"),
    (BODY + '[[equation]]\nsame = ["ux"] #!\n', "equation.same needs a group, whose nodes share the component"),
    (PLATE + '[[equation]]\ngroup = "g"\nsame = ["uz"] #!\n', "equation.same has uz, which a plane model does not have"),
    (BODY + '[[equation]]\nterms = [{ factor = 1, component = "ux", at = [0, 0] }] #!\n', "has a term whose at has 2 coordinates"),
    (PLATE + '[[equation]]\nterms = [{ factor = 1, component = "uz", node = 1 }] #!\n', "has uz, which a plane model"),
    (BODY + '[[displacement]]\ngroup = "g"\nux = 0\naxes = { x = [1, 0, 0] } #!\n', "displacement.axes needs xy, a second vector"),
    (BODY + '[[displacement]]\ngroup = "g"\nux = 0\naxes = { origin = [0, 0, 0], axis = [0, 0, 0] } #!\n', "has an axis of length 0"),
    (BODY + '[[displacement]]\ngroup = "g"\nux = 0\naxes = { x = [1, 0, 0], xy = [2, 0, 0] } #!\n', "vectors that lie on one line"),
    (PLATE + '[[displacement]]\ngroup = "g"\nux = 0\naxes = { origin = [0, 0], axis = [1, 0, 0] } #!\n', "has an axis that is not z, the only one in a plane model"),
    (PLATE + '[[displacement]]\ngroup = "g"\nux = 0\naxes = { x = [1, 0, 0] } #!\n', "has x of 3 components; the model has 2"),
    (RING + '[[force]]\ngroup = "g"\nfx = 1\naxes = { origin = [0, 0], axis = [0, 0, 1] } #!\n', "are cylindrical, as ux and uy of an axisymmetric"),
    (BODY + '[[coupling]]\ngroup = "g"\nux = 1\nweights = "t" #!\n', "coupling.weights depends on t"),
    (BODY + '[[coupling]]\ngroup = "g"\nux = 1\nweights = [[1, 1], [1, 2]] #!\n', "coupling.weights names a node twice"),
    (BODY + '[[coupling]]\ngroup = "g"\nux = 1\nweights = [[1.5, 1]] #!\n', "coupling.weights is of node 1.5"),
    (BODY + '[[coupling]]\ngroup = "g"\nux = 1\naxes = { origin = [0, 0, 0], axis = [0, 0, 1] } #!\n', "the point of a coupling needs Cartesian axes"),
    (BODY + '[[coupling]]\ngroup = "g"\nrotation = ["free", 0.1, 0]\nmoment = [0, 1, 0] #!\n', "coupling.moment has a component about an axis whose rotation is prescribed"),
    (BODY + '[[rigid]]\ngroup = "g"\nrotation = "free" #!\n', "rigid.rotation is one value; a 3d model needs a vector of three"),
    (BODY + '[[force]]\ngroup = "g"\nmoment = [0, 0, 1] #!\n', "force.moment acts on the whole group; set total = true, which makes fx, fy and fz totals too"),
    (BODY + '[[pretension]]\ngroup = "g"\nforce = 1.0\nnormal = [0, 0, 0] #!\n', "pretension.normal has length 0; give a direction"),
    (BODY + '[[displacement]]\ngroup = "g"\nux = 1.0\nbegin = 1.0 #!\n', "displacement.begin is 1, and the steps end at 1; choose an earlier time"),
    (BODY + '[[displacement]]\ngroup = "g"\nux = 1.0\nreached = 1.0 #!\n', "displacement.reached has an effect only with begin, the time at which the support begins"),
    (BODY + '[[pretension]]\ngroup = "g"\nforce = 1.0\nlock = 1.0 #!\n', "pretension.lock is 1, and the steps end at 1; remove it, or lock earlier"),
    (BODY + '[[pretension]]\ngroup = "g"\nforce = 1.0\n[[pretension]]\ngroup = "g" #!\nname = "h"\nforce = 1.0\n', "pretension.group is 'g', the group of an earlier section too"),
    (BODY + '[[cyclic]]\nslave = "a"\nmaster = "b"\nsectors = 3\nharmonic = 1 #!\n', "cyclic.harmonic is 1; only 0 is available: all sectors deform alike"),
    (BODY + '[[cyclic]]\nslave = "a"\nmaster = "a" #!\nsectors = 3\n', "cyclic.master is 'a', the same group as the slave"),
    (BODY + '[[cyclic]]\nslave = "a"\nmaster = "b"\nsectors = 3\naxis = [0, 0, 0] #!\n', "cyclic.axis has the length 0"),
    (BODY + '[[cyclic]]\nslave = "a"\nmaster = "b"\nsectors = 3\nring = true #!\n[output]\nformat = "med"\n', "cyclic.ring is written for ParaView"),
    (RING + '[[cyclic]] #!\nslave = "a"\nmaster = "b"\nsectors = 3\n', "[[cyclic]] is a sector, and an axisymmetric model is a whole ring"),
    (BODY + "[[probe]] #!\nat = [0, 0, 0]\n", "[[probe]] needs a name, since it has no group to be named after"),
    (BODY + '[[probe]]\ngroup = "g"\n[[probe]]\ngroup = "g" #!\n', "probe.group is 'g', which is the name of an earlier section too"),
    *((BODY + f'[[{kind}]]\nname = "n"\ngroup = "g"\n{key}\n[[{kind}]]\nname = "n" #!\ngroup = "h"\n{key}\n', f"{kind}.name is 'n', which is the name of an earlier section too") for kind, key in (("equation", 'same = ["ux"]'), ("coupling", "ux = 1"), ("pretension", "force = 1"))),
    (BODY + '[[probe]]\ngroup = "g"\nname = "a\\u0007" #!\n', "probe.name is empty or cannot be printed"),
    (BODY + "[steps]\ncount = 2.0 #!\n", "steps.count is 2; it takes a whole number"),
    (BODY + "[steps]\ntimes = [\n0.5,\n0.5, #!\n]\n", "steps.times has 0.5 after 0.5; times must increase"),
    (BODY + '[solver]\nengine = "serial"\nbackend = "gamg" #!\n', 'solver.backend is "gamg"; the linear solvers of engine = "serial" are auto, rslab'),
    (BODY + '[solver]\nengine = "petsc"\nbackend = "rslab" #!\n', 'solver.backend is "rslab"; the linear solvers of engine = "petsc" are auto, multigrid, gamg, hypre, mumps'),
    (BODY + "[output]\ntimes = [0.5, 1.5] #!\n", "output.times has 1.5, after the end of the steps at 1"),
]  # fmt: skip
#: (a text whose one mistake is on the line that ends in `#!`, or on none; a part of the message)
MISTAKES = SHOWN + BEYOND
