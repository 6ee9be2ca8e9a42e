"""What records ask of a mesh: places, nodes of a cut, supports that begin late, which of two surfaces is a slave."""

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.errors import LacmeshError, LacmeshWarning
from lacmesh.generate import box, kinds, rectangle, stack
from lacsolver.case import CaseError, Force, Material, Probe, Rigid, Spring, Traction, fingerprint
from lacsolver.cli import main
from lacsolver.output import create_output
from lacsolver.output.states import read_state
from lacsolver.problem.problem import Problem
from lacsolver.problem.roles import with_roles
from lacsolver.running import run
from lacsolver.space.cut_nodes import made_by_cut
from lacsolver.space.places import nodes_of
from lacsolver.space.space import Space
from lacsolver.validation import validate
from tests.lacsolver.patch_meshes import stack as upright
from tests.problem_meshes import plane
from tests.problems import case_of, contact, fix, move
from tests.samples import each_option
from tests.worlds import permuted

E = 1000.0
SOFT = Material(young=E, poisson=0.0)

# ---- places


def test_the_node_at_a_place():
    space = Space.of(box(2), "3d")
    assert nodes_of(space, Probe(at=(0.5, 0.5 + 9e-7, 1.0), name="p")).tolist() == [14]
    message = r"^force: no node at \[0\.5, 0\.503, 1\]; the nearest is node 15 at \[0\.5, 0\.5, 1\], 0\.003 away$"
    with pytest.raises(CaseError, match=message):
        nodes_of(space, Force(at=(0.5, 0.503, 1.0), fx=1.0))
    flat = Space.of(rectangle(1).moved((0, 0, 4.0)), "plane_strain")
    assert nodes_of(flat, Probe(at=(1.0, 1.0), name="p")).tolist() == [3]
    mesh = stack(box(1), box(1))  # bodies that touch have two nodes at a place
    mesh = Mesh.create(np.vstack([mesh.points, [[0, 0, 0], [3, 3, 3]]]), mesh.blocks)
    space = Space.of(mesh, "3d")
    with pytest.raises(CaseError, match=r"nodes \d+, \d+ are all at \[0, 0, 1\]; name a group of nodes"):
        nodes_of(space, Probe(at=(0.0, 0.0, 1.0), name="p"))
    assert nodes_of(space, Probe(at=(0.0, 0.0, 0.0), name="p")).tolist() == [0]  # not the node of no cell
    assert nodes_of(space, Probe(at=(3.0, 3.0, 3.0), name="p")).tolist() == [17]


def test_groups_of_cells_and_of_nodes():
    mesh = rectangle(1, kind="QUAD8")
    nodes, tags = (
        {"left": [3], "dots": [5, 1], "none": []},
        {"right": ((1, 7),), "bottom": ((1, 8),), "body": ((2, 8),)},
    )
    cells = {**mesh.cell_groups, "empty": []}
    mesh = Mesh.create(mesh.points, mesh.blocks, cell_groups=cells, node_groups=nodes, group_tags=tags)
    space = Space.of(mesh, "plane_strain")
    left, right = (mesh.nodes_on(mesh.cells_of(name)).tolist() for name in ("left", "right"))
    for group, kind, found in (
        ("left", None, left),
        ("left", "node", [3]),
        ("dots", None, [1, 5]),
        ("7", None, right),
        ("empty", None, "the group 'empty' is empty"),
        ("none", None, "the group 'none' is empty"),
        ("dots", "cell", "no cell group named 'dots'"),
        ("bottom", "node", "no node group named 'bottom'; there are: dots, left, none"),
        ("dot", None, "no group named 'dot'; did you mean dots"),
        ("8", None, "tag 8 means several groups"),
    ):
        probe = Probe(group=group, kind=kind)
        if isinstance(found, list):
            assert nodes_of(space, probe).tolist() == found
            continue
        with pytest.raises(CaseError, match=f"probe: {found}"):
            nodes_of(space, probe)


# ---- forces and springs at nodes: their totals are those of the mesh before the cut

CUTS = [(kind, hexa) for kind in (*kinds(2), *kinds(3)) if " " not in kind and "mixed" not in kind
        for hexa in ("pyramid", "hexa")[: 1 + kind.startswith("HEXA")]]  # fmt: skip


def blocks(kind):
    """Two blocks with a slave between them, whose nodes are a group as well, and the number of these."""
    make = box if CELLS[kind].dim == 3 else rectangle
    mesh = stack(make(2, kind=kind), make(2, kind=kind))
    nodes = mesh.nodes_on(mesh.cells_of("slave"))
    return replace(mesh, node_groups={"nodes": nodes}), len(nodes)


def loaded(mesh, hexa):
    records = (
        contact(hexa=hexa),
        Force(group="slave", fx=2.0),
        Force(group="nodes", fy=3.0),
        Spring(group="slave", kx=5.0),
    )
    return Problem.of(case_of(mesh, SOFT, *records, model="3d" if mesh.dim == 3 else "plane_strain"), mesh)


@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
@pytest.mark.parametrize(("kind", "hexa"), each_option(CUTS, of=lambda row: [(CELLS[row[0]].dim, row[1])]))
def test_totals_are_those_before_the_cut(tmp_path, kind, hexa):
    mesh, count = blocks(kind)
    cut = lacmesh.cut_skin(mesh, "slave", hexa=hexa).mesh
    lacmesh.write(tmp_path / "cut.msh", cut)
    assert np.array_equal(np.flatnonzero(made_by_cut(cut)), np.arange(mesh.n_nodes, cut.n_nodes))
    for given in (mesh, lacmesh.read(tmp_path / "cut.msh")):
        problem = loaded(given, hexa)
        f = problem.load(1.0).reshape(-1, problem.space.dim)
        assert f.sum(axis=0)[:2] == pytest.approx([2.0 * count, 3.0 * count])
        assert not f[made_by_cut(problem.space.mesh)].any()
        assert problem.springs.sum() == pytest.approx(5.0 * count)


@pytest.mark.parametrize("kind", ["HEXA8", "TETRA10", "QUAD4", "TRIA3"])
def test_a_cut_that_was_recognised(kind):
    """Without the records of parents the new nodes on slave faces are those inside macro-elements."""
    mesh, count = blocks(kind)
    cut = lacmesh.cut_skin(mesh, "slave", hexa="hexa").mesh
    known = lacmesh.recognise(replace(cut, cell_data={}, node_data={}, zones=()), ["slave"]).mesh
    made = np.intersect1d(known.nodes_on(known.cells_of("slave")), np.arange(mesh.n_nodes, cut.n_nodes))
    assert np.array_equal(np.flatnonzero(made_by_cut(known)), made)
    f = loaded(known, "hexa").load(1.0).reshape(-1, known.dim)
    assert f.sum(axis=0)[:2] == pytest.approx([2.0 * count, 3.0 * count])


def test_a_group_of_new_nodes_alone():
    cut = lacmesh.cut_skin(blocks("HEXA8")[0], "slave", hexa="hexa").mesh
    groups = {**cut.node_groups, "nodes": np.flatnonzero(made_by_cut(cut))}
    with pytest.raises(CaseError, match="'nodes' has only nodes that the cut made"):
        loaded(replace(cut, node_groups=groups), "hexa").load(1.0)


# ---- supports that begin late; a restart from where they begin, and their file, are laws of the corpus


def bar(*late):
    """A bar, pulled by 10 at t = 1 and 30 at t = 2, whose length, section and E / 1000 are 1; `late`: its supports."""
    pull, steps = Traction(group="right", tx=[[0, 0], [1, 10], [2, 30]]), ls.Steps(times=(0.5, 1.5, 2.0))
    return case_of(box(2), SOFT, fix("left", "xyz"), *late, pull, steps, model="3d")


def ways(case):
    """[(time, displacement of the end, its reaction)] of all steps: all nodes of the end move alike."""
    out = []
    for solution in ls.march(case):
        right = case.mesh.nodes_on(case.mesh.cells_of("right"))
        along, force = solution.u[right, 0], solution.figures.reactions["right"][0]
        np.testing.assert_allclose(along, along.mean(), rtol=1e-9, atol=1e-12)
        assert solution.reaction[right, 0].sum() == pytest.approx(force, abs=1e-9)
        out.append((solution.time, along.mean(), force))
    return np.array(out)


@pytest.mark.parametrize(
    "late, moved",
    [
        ({"ux": 0.0}, [0.01, 0.01]),
        ({"ux": [[0, 0.3], [1, 0.3], [2, 0.35]]}, [0.035, 0.06]),
        ({"ux": 0.05}, [0.035, 0.06]),
        ({"ux": 0.0, "reached": 2.0}, [0.005, 0.0]),
        ({"ux": 0.05, "reached": 1.5}, [0.025, 0.05]),
        ({"uy": 0.01, "axes": {"x": [0, 1, 0], "xy": [-1, 0, 0]}}, [0.005, 0.0]),
    ],
)
def test_an_end_is_held_where_it_is_or_goes_to_the_value(late, moved):
    """Free, u = F / E; held, the support takes what the bar's stiffness does not: R = E u - F."""
    steps = ways(bar(move("right", begin=1.0, **late)))
    np.testing.assert_allclose(steps[:, 0], [0.5, 1.0, 1.5, 2.0], rtol=1e-12)
    np.testing.assert_allclose(steps[:, 1], [0.005, 0.01, *moved], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(steps[:, 2], [0, 0, E * moved[0] - 20, E * moved[1] - 30], rtol=1e-9, atol=1e-9)


def pushed(*supports, load=((0, 0), (1, -10), (2, 10)), joint=True):
    """A block pressed on another one; nothing else holds it along z from the start."""
    mesh = stack(box(2), box(2))
    late = supports or (fix("bottom", "xyz"), fix("top", "xy"), fix("top", "z", begin=1.0))
    pull = Traction(group="top", tz=[list(row) for row in load])
    return case_of(mesh, SOFT, *[contact()] * joint, *late, pull, ls.Steps(times=(1.0, 2.0)), model="3d")


def test_contact_holds_a_body_until_its_support_begins():
    """The blocks shorten by 2 F / E; the support then keeps the far end, and takes the change of the load."""
    case = pushed()
    assert any("moves along z" in words for words in validate(case).held)
    first, last = ls.march(case)
    far = case.mesh.nodes_on(case.mesh.cells_of("top"))
    for solution in (first, last):
        np.testing.assert_allclose(solution.u[far, 2], -0.02, rtol=1e-9)
    assert first.figures.reactions["top"][2] == pytest.approx(0, abs=1e-9)
    assert last.figures.reactions["top"][2] == pytest.approx(-20, rel=1e-9)
    assert last.figures.contact["slave"].resultant[2] == pytest.approx(10, rel=1e-9)


def test_a_support_that_does_not_hold_yet_holds_nothing():
    (problem,) = validate(pushed(joint=False)).problems
    assert "nothing supports a part of the model" in problem.message
    with pytest.raises(LacmeshError, match="nothing supports a part of the model"):
        ls.solve(pushed(joint=False))


def test_supports_that_agree_on_shared_nodes():
    """Nodes of the end and of the side have the same condition twice, or one that holds from the start."""
    end, side = fix("right", "x", begin=1.0), fix("front", "x", begin=1.0)
    *_, both = ls.march(bar(end, side))
    total = sum(both.figures.reactions[name][0] for name in ("left", "right", "front"))
    assert total == pytest.approx(-30, rel=1e-9)
    *_, again = ls.march(bar(end, fix("front", "y"), fix("right", "y", begin=0.5)))
    assert again.figures.reactions["right"][0] == pytest.approx(-20, rel=1e-9)


HELD = fix("right", "x", begin=1.0)


@pytest.mark.parametrize(
    "records, words",
    [
        (
            [HELD, replace(HELD, group=None, at=(1, 0.5, 0.5), ux=0.01)],
            "is prescribed by displacement 'right' too",
        ),
        ([HELD, fix("front", "x", begin=1.5)], "is prescribed by displacement 'right' too"),
        ([HELD, move("front", ux=0.01, begin=1.0)], r"contradicts displacement 'left', which constrains node \d+"),
        ([fix("front", "x", begin=1.0), Rigid(group="right", fx=0.0)], r"prescribes ux of .*, which rigid 'right'"),
    ],
)
def test_supports_that_contradict(records, words):
    with pytest.raises(CaseError, match=words):
        ls.solve(bar(*records))


@pytest.mark.parametrize(
    "keys, more, words",
    [
        ({"begin": 2.0}, [], "is 2, and the steps end at 2"),
        ({"reached": 1.0}, [], "has an effect only with begin"),
        ({"begin": 1.0, "reached": 1.0}, [], "is 1, and the support begins at 1"),
        ({"begin": 1.0}, [ls.Dynamics(start=0.5)], r"\[dynamics\] starts at 0.5"),
    ],
)
def test_times_of_supports_that_are_refused(keys, more, words):
    with pytest.raises(CaseError, match=words):
        bar(fix("right", "x", **keys), *more)


# ---- warnings


def test_a_support_of_a_body_that_was_not_saved():
    """Without its volume the master is rigid, and what holds its lower side holds nothing."""
    mesh = stack(box(2), box(2), slave="upper").only("slave", "master", "bottom", "top", "upper", "left", "front")
    records = contact(), fix("bottom", "z"), fix("left", "x"), fix("front", "y"), ls.Pressure(group="top", value=0.01)
    with pytest.warns(LacmeshWarning, match="displacement 'bottom' has no effect: none of its nodes belongs"):
        ls.solve(case_of(mesh, SOFT, *records, model="3d"))


def test_skins_that_never_meet_are_warned_of(tmp_path):
    """The upper block is lifted beyond where the slave looks; the run is done, and says so."""
    law, mesh = Material(law="neo_hookean", young=E, poisson=0.3), plane("QUAD4", "QUAD4")
    records = law, contact(search_distance=0.5), fix("bottom", "xy"), move("top", ux=0.0, uy=0.8)
    lifted = case_of(mesh, *records, model="plane_strain", kinematics="finite")
    with pytest.warns(LacmeshWarning, match="never had master 'master' in front of it"):
        done = run(lifted, create_output(tmp_path / "out"))
    assert done.status == "done" and done.steps[-1].contact["slave"].unpaired > 0


# ---- two surfaces of which a rule chooses the slave: each rule in every unit, numbering and order of their names

GROUND, PUSH = fix("bottom", "xy"), move("top", ux=0.0, uy=-0.01)


def sides(upper=4, lower=2, wide=1.0):
    """Two blocks in a plane: `a` is the lower's skin, `b` the upper's; `wide`: how wide the upper one is."""
    mesh = stack(rectangle(lower), rectangle(upper, (wide, 1.0)).moved(((1 - wide) / 2, 0, 0)))
    return mesh.renamed(master="a", slave="b")


def either(mesh, surfaces=("a", "b"), young=(1.0, 1.0), supports=(GROUND, PUSH), kind=ls.Contact, **keys):
    """A case on the blocks; `keys`: of its contact."""
    materials = [Material(groups=[g], young=e, poisson=0.3) for g, e in zip(("lower", "upper"), young, strict=True)]
    joint = kind(**({"surfaces": surfaces} if surfaces else {}), **keys)
    return case_of(mesh, *materials, joint, *supports, model="plane_strain")


def chosen(own, mesh):
    roles = with_roles(own, mesh)
    (record,) = roles.contact or roles.tie
    assert {record.slave, record.master} == {"a", "b"} and record.name == record.slave
    return record.slave, record.why


RULES = {
    "free": ({"supports": (GROUND, replace(PUSH, group="upper"))}, sides(), "a", "displacement of 'b' is prescribed"),
    "rigid": ({"supports": (GROUND, Rigid(group="upper", uy=-0.01))}, sides(), "a", "that of a rigid body"),
    "few": ({"young": (1.0, 0.5)}, sides(1, 4), "a", "'b' has few faces, 1"),
    "covered": ({"young": (1.0, 2.0)}, sides(3, 8, wide=0.4), "b", "it faces 'a' with its whole area"),
    "softer": ({"young": (2.0, 1.0)}, sides(3, 5), "b", "it is softer: Young's modulus 1 beside 2"),
    "finer": ({}, sides(4, 2), "b", "it is finer"),
    "alike": ({}, sides(3, 3), "a", "its name comes first"),
    "of a tie": ({"kind": ls.Tie}, sides(4, 2), "b", "it is finer"),
    "held at a side": (
        {"young": (2.0, 1.0), "supports": (GROUND, PUSH, fix("left", "x"))}, sides(3, 3), "b", "it is softer",
    ),
    "cut": ({}, lacmesh.cut_skin(sides(4, 2), ["a"]).mesh, "a", "it has macro-elements in the mesh"),
    "taken": (
        {"supports": (GROUND, PUSH, ls.Tie(slave="b", master="top"))}, sides(4, 2), "a", "'b' is the slave of another",
    ),
}  # fmt: skip


@pytest.mark.parametrize("rule", RULES)
def test_each_rule_chooses_the_slave_and_says_why(rule):
    keys, mesh, slave, why = RULES[rule]
    own = either(mesh, **keys)
    found = chosen(own, mesh)
    assert found[0] == slave and why in found[1]
    assert chosen(either(mesh, ("b", "a"), **keys), mesh) == found
    assert rule == "cut" or chosen(own, permuted(mesh, seed=1)[0]) == found
    assert chosen(own, replace(mesh, points=1e3 * mesh.points + np.array([5e5, -2e5, 0.0])))[0] == slave


def test_faces_of_few_nodes_are_held_by_the_group_of_all_nodes_of_their_body():
    """Both bodies are held, so that neither is freer: also where a skin has triangles beside quadrangles."""
    mesh = upright("mixed", "HEXA8", 3, counts=(2, 2), slave_below=False).renamed(master="a", slave="b")
    skin, nodes = mesh.cells_of("b"), mesh.nodes_on(mesh.cells_of("upper"))
    assert {name for name, _, _ in mesh.select(skin)} == {"QUAD4", "TRIA3"}
    joint, held = ls.Contact(surfaces=("a", "b")), (fix("lower", "xyz"), fix("nodes", "xyz"))
    own = case_of(mesh, SOFT, joint, *held, model="3d")
    assert "prescribed" not in chosen(own, replace(mesh, node_groups={"nodes": nodes}))[1]


def test_the_more_convex_of_two_like_skins_is_the_slave():
    mesh = sides(4, 4)
    points = mesh.points.copy()
    up = mesh.nodes_on(mesh.cells_of("upper"))
    points[up, 1] += 0.05 * (2 * points[up, 0] - 1) ** 2 * (2 - points[up, 1])
    assert chosen(either(mesh), replace(mesh, points=points)) == ("b", "it is more convex")


def test_results_say_which_and_why_and_are_those_of_roles_by_hand(tmp_path):
    mesh = sides(4, 2)
    own, by_hand = either(mesh), either(mesh, None, slave="b", master="a")
    (zone,) = validate(own).zones
    assert (zone.name, zone.slave, zone.master) == ("b", "b", "a") and zone.why.startswith("it is finer")
    results, same = (run(one, create_output(tmp_path / name)) for name, one in (("out", own), ("same", by_hand)))
    assert same.steps[-1].energy == results.steps[-1].energy
    told, by = (json.loads((tmp_path / n / "results.json").read_text())["contact"]["b"] for n in ("out", "same"))
    assert (told["slave"], told["master"], told["why"]) == ("b", "a", zone.why)
    assert by["master"] == "a" and "why" not in by
    for other in (own, by_hand, either(mesh, ("b", "a"))):
        assert read_state(tmp_path / "out", other, mesh=mesh).time == 1.0
    assert fingerprint(with_roles(own, mesh), mesh) == fingerprint(by_hand, mesh)


def test_the_commands_take_surfaces(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    lacmesh.write("a.msh", sides(4, 2))
    either("a.msh").write("case.toml")
    assert main(["validate", "case.toml"]) == 0
    assert "slave chosen" in capsys.readouterr().out
    assert main(["run", "case.toml"]) == 0
    assert "b, with master a: it is finer" in " ".join(capsys.readouterr().out.split())
    assert main(["matrices", "case.toml", "-o", "m.npz", "-q"]) == 0
    assert len(np.load("m.npz")["G"]) == 4
    (problem,) = validate(either("a.msh", ("a", "c")), sides()).problems
    assert "contact.surfaces" in problem.message


def test_surfaces_are_taken_in_the_order_of_the_alphabet():
    own = either(sides(4, 2), ("b", "a"), type="bilateral")
    (record,) = own.contact
    assert record.surfaces == ("a", "b") and record.slave is None and record.name is None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (pair,) = Problem.of(own, own.mesh).joints
    assert (pair.name, pair.record.master, pair.record.type) == ("b", "a", "bilateral")
    assert own.skins == ("a", "b")
