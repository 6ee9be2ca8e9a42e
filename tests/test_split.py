"""A mesh that is split: sides, copies of nodes, front and junctions against plain searches; nothing else changes."""

import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh import LacmeshWarning, Mesh, check, cut_skin, generate, measure_quality, split
from lacmesh.cells import CELLS
from lacmesh.cutting.split import split_skins
from lacmesh.errors import CutError, DataError, GroupNotFoundError, RequestError
from lacmesh.topology.orientation import analyse_orientation, face_normals, reverse
from lacmesh.topology.skin import faces_of
from tests.meshes import facets_of, random_mesh
from verification.measures.cutting import sizes

BODIES = [name for name, cell in CELLS.items() if cell.dim > 1]
DOCS = Path(__file__).parents[1] / "docs"


def keys_of(mesh, name):
    """{face of a group: its cell}, a face by its sorted corners."""
    chosen = mesh.select(mesh.cell_groups[name])
    return {
        tuple(sorted(row[: CELLS[kind].n_corners].tolist())): cell
        for kind, cells, nodes in chosen
        for cell, row in zip(cells.tolist(), nodes, strict=True)
    }


def parts_around(table, barred, node, cells):
    """{cell: part} of the cells around a node: cells that share a facet with the node are one part, unless barred."""
    label = {cell: cell for cell in cells}
    for key, owners in table.items():
        if len(owners) == 2 and key not in barred and all(node in owner[3] for owner in owners):
            one, other = label[owners[0][0]], label[owners[1][0]]
            label = {cell: one if part == other else part for cell, part in label.items()}
    return label


def plain_sides(mesh, keys):
    """The faces that open, those with a corner of which both sides are parted; and {node: number of sides there}."""
    table, keys = facets_of(mesh), set(keys)
    around = {}
    for owners in table.values():
        for cell, _, _, nodes in owners:
            for node in nodes.tolist():
                around.setdefault(node, set()).add(cell)
    while True:
        parts = {n: parts_around(table, keys, n, around[n]) for key in keys for n in key}
        closed = {key for key in keys if all(parts[n][table[key][0][0]] == parts[n][table[key][1][0]] for n in key)}
        if not closed:
            break
        keys -= closed
    nodes = {n for key in keys for n in table[key][0][3].tolist()}
    count = lambda barred, n: len(set(parts_around(table, barred, n, around[n]).values()))  # noqa: E731
    return keys, {n: count(keys, n) - count((), n) + 1 for n in nodes}


@pytest.mark.rows("0-3-1", "3-3-1")
@pytest.mark.filterwarnings("ignore:.*stay closed")
@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("seed", range(6))
def test_random_faces_of_random_meshes(dim, order, seed):
    """Sides by a plain search; facets that do not open are shared as before; points, numbers, data, groups are kept."""
    rng = np.random.default_rng([dim, order, seed])
    mesh = random_mesh(rng, dim, order, slaves=int(rng.integers(8, 24)), interior=True)
    table = facets_of(mesh)
    inner = {key: cell for key, cell in keys_of(mesh, "slave").items() if len(table[key]) == 2}
    mesh = replace(mesh, cell_groups={**mesh.cell_groups, "G": np.sort([*inner.values()]).astype(int)})
    opened, sides = plain_sides(mesh, inner)
    if not opened:
        with pytest.raises(DataError, match="no face of the group 'G' can open" if inner else "'G' is empty"):
            split(mesh, "G")
        return
    parts = split_skins(mesh, ["G"])
    new = parts.mesh
    assert new.n_nodes - mesh.n_nodes == sum(sides.values()) - len(sides)
    assert sorted(parts.n_sides.tolist()) == sorted(sides.values())
    assert len(new.cell_groups["G_a"]) == len(new.cell_groups["G_b"]) == len(opened)
    assert len(set(map(int, parts.closed))) >= len(inner) - len(opened)
    same_solids(mesh, new, opened)
    outward_pairs(new, "G")
    kept_data(mesh, new)


def same_solids(mesh, new, opened):
    """Each facet that did not open is shared as before, the others are apart."""
    np.testing.assert_allclose(solid_volume(new), solid_volume(mesh), rtol=1e-13)
    pairs, pairs_now = (
        {frozenset((int(m.cell_number[o[0]]), o[1]) for o in owners): key for key, owners in facets_of(m).items()}
        for m in (mesh, new)
    )
    for pair, key in pairs.items():
        if key in opened:
            assert pair not in pairs_now and all(frozenset([side]) in pairs_now for side in pair)
        else:
            assert pair in pairs_now


def solid_volume(mesh):
    return abs(sizes(mesh)[mesh.cell_dim == mesh.dim]).sum()


def outward_pairs(new, name):
    """Each face of a skin belongs to one cell, points out of it, and has one of the other skin at its place."""
    at = []
    for cells in (new.cell_groups[f"{name}_{end}"] for end in "ab"):
        assert not any(map(len, vars(analyse_orientation(new, cells)).values()))
        rows = (row for _, _, nodes in new.select(cells) for row in nodes)
        at.append(sorted(sorted(map(tuple, np.round(new.points[row], 12).tolist())) for row in rows))
    assert at[0] == at[1]


def kept_data(mesh, new):
    """Points, numbers, data and groups of nodes; copies of nodes follow, each with those of a node of the same cell."""
    n, source = mesh.n_nodes, np.arange(new.n_nodes)
    solids = [both for both in zip(mesh.blocks, new.blocks, strict=True) if CELLS[both[0].type].dim == mesh.dim]
    for old, now in solids:
        source[now.nodes] = old.nodes
    assert all(np.array_equal(source[now.nodes], old.nodes) for old, now in solids)
    assert source[:n].tolist() == list(range(n))
    assert np.array_equal(new.node_number[:n], mesh.node_number)
    assert new.node_number[n:].tolist() == (mesh.node_number.max() + 1 + np.arange(new.n_nodes - n)).tolist()
    for values, of in ((new.points, mesh.points), *((new.node_data[k], v) for k, v in mesh.node_data.items())):
        np.testing.assert_allclose(values, of[source], rtol=0, atol=1e-14 * abs(of).max())
    for name, members in mesh.node_groups.items():
        assert new.node_groups[name].tolist() == np.flatnonzero(np.isin(source, members)).tolist()
    for name, cells in mesh.cell_groups.items():
        full = [
            sorted(m.cell_number[ids[m.cell_dim[ids] == m.dim]].tolist())
            for m, ids in ((mesh, cells), (new, new.cell_groups[name]))
        ]
        assert full[0] == full[1]


# ---- shapes: sections, cracks, junctions


def skins_of(kind, n=4, **where):
    """A unit square or cube of cells of one type with groups of inner faces: name=condition on the points."""
    make = generate.box if CELLS[kind].dim == 3 else generate.rectangle
    return make(n, kind=kind).only("body", "top").with_groups("inner", **where)


def plane_of(axis, at, low=-1.0, high=2.0, along=0):
    """A condition on points: on a plane, and between two values along another axis."""
    return lambda x: (abs(x[axis] - at) < 1e-9) & (x[along] > low - 1e-9) & (x[along] < high + 1e-9)


@pytest.mark.parametrize("kind", BODIES)
def test_a_section_makes_two_bodies(kind):
    up = CELLS[kind].dim - 1
    mesh = skins_of(kind, n=2, G=plane_of(up, 0.5))
    parts = split_skins(mesh, ["G"])
    assert parts.bodies == (1, 2) and set(parts.n_sides.tolist()) == {2}
    after, before = (measure_quality(m, "body").as_json() for m in (parts.mesh, mesh))
    assert after["types"] == before["types"]
    on = mesh.nodes_on(mesh.cell_groups["G"])
    assert parts.mesh.n_nodes == mesh.n_nodes + len(on)
    assert not check(parts.mesh, "G_a", "G_b").of_severity("warning")
    cut = cut_skin(parts.mesh, "G_a")
    findings = check(cut, master="G_b")
    assert not findings.errors and not findings.warnings
    assert findings.summary["gap"]["max"] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("kind", ["QUAD4", "HEXA20", "TETRA10"])
@pytest.mark.parametrize(("half", "sides"), [(True, 3), (False, 4)])
def test_junctions_have_a_node_for_each_side(kind, half, sides):
    """Two groups that meet in a T, or cross in an X."""
    dim = CELLS[kind].dim
    end = 0.5 if half else 2.0
    mesh = skins_of(kind, G=plane_of(dim - 1, 0.5), H=plane_of(0, 0.5, high=end, along=dim - 1))
    parts = split_skins(mesh, ["G", "H"])
    assert parts.bodies == (1, sides)
    line = np.isclose(mesh.points[:, dim - 1], 0.5) & np.isclose(mesh.points[:, 0], 0.5)
    assert (parts.n_sides == sides).sum() == line.sum()
    one = split(mesh, "G")
    assert parts.mesh.n_cells == split(one, "H").n_cells


def side_a(mesh):
    """The centres of the cells behind G_a, sorted."""
    table = facets_of(mesh)
    owners = sorted({table[key][0][0] for key in keys_of(mesh, "G_a")})
    centres = [mesh.points[nodes].mean(axis=1) for _, _, nodes in mesh.select(np.array(owners))]
    return np.array(sorted(np.concatenate(centres).round(9).tolist()))


@pytest.mark.parametrize("kind", ["TRIA6", "TETRA4", "PENTA15"])
def test_the_normal_points_from_a_to_b_wherever_the_model_lies(kind):
    up = CELLS[kind].dim - 1
    mesh = skins_of(kind, G=plane_of(up, 0.5))
    cells = mesh.cell_groups["G"]
    up_normals = face_normals(mesh, faces_of(mesh, cells))[:, up] > 0
    alike = reverse(mesh, cells[~up_normals])  # all normals along +up: b is above
    below = side_a(split(alike, "G"))
    assert below[:, up].max() < 0.5
    assert side_a(split(reverse(alike, cells), "G"))[:, up].min() > 0.5
    few, half = (reverse(alike, cells[: len(cells) // n]) for n in (3, 2))
    for one in (few, half, reverse(half, cells)):  # most of the faces decide; b is where the coordinate grows
        assert np.array_equal(side_a(split(one, "G")), below)
    shift = np.array([1e4, -3e4, 5e4 * (up == 2)])
    assert np.allclose(side_a(split(replace(alike, points=alike.points + shift), "G")), below + shift)


def test_a_moebius_strip_is_refused():
    """A ring of twisted hexahedra around a strip of quadrangles that closes with half a turn."""
    n = 12
    t = 2 * np.pi * np.arange(n) / n
    frame = np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
    across = np.cos(t / 2)[:, None] * frame + np.sin(t / 2)[:, None] * [0, 0, 1]
    through = -np.sin(t / 2)[:, None] * frame + np.cos(t / 2)[:, None] * [0, 0, 1]
    points = np.array([3 * frame + a * across + b * through for b in (-1, 0, 1) for a in (-1, 1)]).swapaxes(0, 1)
    node = lambda k, a, b: (k % n) * 6 + ((2 - b) * 2 + 1 - a if k >= n else b * 2 + a)  # noqa: E731
    hexa = [[node(k + j, a, b + c) for c in (0, 1) for j, a in ((0, 0), (1, 0), (1, 1), (0, 1))]
            for k in range(n) for b in (0, 1)]  # fmt: skip
    quad = [[node(k, 0, 1), node(k + 1, 0, 1), node(k + 1, 1, 1), node(k, 1, 1)] for k in range(n)]
    mesh = Mesh.create(
        points.reshape(-1, 3), [("HEXA8", hexa), ("QUAD4", quad)], cell_groups={"G": 2 * n + np.arange(n)}
    )
    with pytest.raises(DataError, match="'G' has one side only"):
        split(mesh, "G")


# ---- requests that cannot be met


def test_requests_that_cannot_be_met():
    mesh = skins_of("HEXA8", G=plane_of(2, 0.5))
    n = mesh.n_cells
    odd = {"none": [], "line": [n], "air": [n + 1]}
    blocks = [*mesh.blocks, ("SEG2", [[0, 1]]), ("TRIA3", [[0, 7, 31]])]
    mesh = Mesh.create(mesh.points, blocks, cell_groups={**mesh.cell_groups, **odd})
    taken = replace(mesh, cell_groups={**mesh.cell_groups, "G_b": mesh.cell_groups["top"]})
    for asked, names, error, words in (
        (mesh, "g", GroupNotFoundError, None),
        (mesh, "top", DataError, "on the surface of the body"),
        (mesh, "body", DataError, "has no lines"),
        (mesh, "none", DataError, "is empty"),
        (mesh, "line", DataError, "has lines"),
        (mesh, "air", DataError, "not facets of any cell"),
        (taken, "G", RequestError, "'G_b' already"),
        (mesh, ["G", "G"], RequestError, "given twice"),
        (mesh, [], RequestError, "no group"),
        (cut_skin(mesh, "top").mesh, "G", CutError, "split first"),
        (skins_of("QUAD4", G=plane_of(1, 0.5, 0.24, 0.51)), "G", DataError, "'G' can open"),
    ):
        with pytest.raises(error, match=words):
            split(asked, names)


def test_faces_that_cannot_open_stay_closed():
    strip = skins_of("TETRA4", G=plane_of(2, 0.5, high=0.5))
    cells = strip.cell_groups["G"]
    x = np.array([strip.points[n].mean(axis=0) for _, _, nodes in strip.select(cells) for n in nodes])
    jagged = replace(strip, cell_groups={"G": cells[~((x[:, 0] > 0.3) & (x[:, 1] < 0.5))]})
    jag = keys_of(jagged, "G")
    opened, _ = plain_sides(jagged, jag)
    assert 0 < len(opened) < len(jag)
    with pytest.warns(LacmeshWarning, match="stay closed"):
        parts = split_skins(jagged, ["G"])
    assert len(parts.mesh.cell_groups["G_a"]) == len(opened) and len(parts.closed) == len(jag) - len(opened)


# ---- files and the command


def test_the_commands_of_the_page_run_and_ask_before_they_replace(run):
    lacmesh.write("part.msh", skins_of("TETRA10", crack=plane_of(2, 0.5, high=0.5)))
    commands = re.findall(r"^\$ lacmesh (.*)$", (DOCS / "split.md").read_text(encoding="utf-8"), re.MULTILINE)
    said = "".join(run(shlex.split(command)) for command in commands)
    assert len(commands) == 3 and "faces of crack in crack_a, crack_b" in said and "on the front" in said
    lacmesh.write("in.msh", skins_of("TRIA3", G=plane_of(1, 0.5)))
    run("split in.msh --faces G -q")
    assert lacmesh.read("in.split.msh").cell_groups.keys() >= {"G_a", "G_b"}
    assert "--force" in run("split in.msh --faces G", 2)
    for group, status in (("G", 0), ("H", 2), ("body", 1)):
        run(f"split in.msh --faces {group} --force -q", status)


def test_a_deck_follows_the_split(run):
    """Elements of side b take the copies, a set of nodes has them too; a condition of a node by number is an error."""
    mesh, source = skins_of("HEXA8", n=2, G=plane_of(2, 0.5)), Path("in.inp")
    lacmesh.write(source, mesh)
    node = int(mesh.node_number[np.isclose(mesh.points[:, 2], 0.5)][0])
    text = source.read_text() + f"*NSET, NSET=ONE\n{node}\n*MATERIAL, NAME=M\n*ELASTIC\n1., 0.\n*BOUNDARY\n"
    source.write_text(text + "ONE, 1, 3\n")
    run("split in.inp --faces G -o out.inp -q")
    divided = lacmesh.read("out.inp")
    assert divided.n_nodes == mesh.n_nodes + 9
    assert {node, int(mesh.node_number.max()) + 1} <= {*divided.node_number[divided.node_groups["ONE"]].tolist()}
    source.write_text(text + f"{node}, 1, 3\n")
    said = run("split in.inp --faces G -o out.inp -q --force", 1)
    assert "*BOUNDARY" in said and "give a set of nodes" in said
