"""A mesh that is split: sides, copies of nodes, front and junctions against plain searches; nothing else changes."""

from __future__ import annotations

import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh import LacmeshWarning, Mesh, check, cut_skin, measure_quality, split
from lacmesh.cells import CELLS
from lacmesh.cli import main
from lacmesh.cutting.split import split_skins
from lacmesh.errors import CutError, DataError, GroupNotFoundError, RequestError
from lacmesh.reference.quadrature import measure
from lacmesh.topology.faces import faces_of
from lacmesh.topology.orientation import reverse
from lacmesh.topology.winding import face_normals
from tests.checks.blocks import SOLIDS, block, join, skin
from tests.meshes import facets_of, random_mesh


def with_group(mesh):
    """A random mesh with the group 'G' of its skin cells between two cells; the keys of these faces."""
    table = facets_of(mesh)
    cells, keys = [], []
    for kind, ids, nodes in mesh.select(mesh.cell_groups["slave"]):
        for cell, row in zip(ids.tolist(), nodes, strict=True):
            key = tuple(sorted(row[: CELLS[kind].n_corners].tolist()))
            if len(table[key]) == 2:
                cells.append(cell)
                keys.append(key)
    return replace(mesh, cell_groups={**mesh.cell_groups, "G": np.sort(cells).astype(int)}), sorted(set(keys))


def plain_copies(mesh, keys):
    """{node: number of sides of each of the things around it}, by a search cell by cell."""
    table = facets_of(mesh)
    cells = {int(mesh.offsets[k]) + r: set(nodes.tolist()) for k, b in enumerate(mesh.blocks)
             if CELLS[b.type].dim == mesh.dim for r, nodes in enumerate(b.nodes)}  # fmt: skip
    out = {}
    for node in {n for key in keys for n in table[key][0][3].tolist()}:
        around = [c for c, nodes in cells.items() if node in nodes]
        counts = []
        for barred in (set(), set(keys)):
            label = {c: c for c in around}
            for key, owners in table.items():
                if len(owners) == 2 and key not in barred and all(node in o[3] for o in owners):
                    one, other = label[owners[0][0]], label[owners[1][0]]
                    label = {c: one if v == other else v for c, v in label.items()}
            counts.append(len(set(label.values())))
        out[node] = counts[1] - counts[0] + 1
    return out


def opened_keys(mesh, keys):
    """The faces that open: those with a corner of more sides than it has on their own; shrunk until all do."""
    table, keys = facets_of(mesh), set(keys)
    while True:
        parts = {node: corner_parts(mesh, keys, node, table) for key in keys for node in key}
        closed = {key for key in keys if all(parts[n][table[key][0][0]] == parts[n][table[key][1][0]] for n in key)}
        if not closed:
            return keys
        keys -= closed


def corner_parts(mesh, barred, node, table):
    """{cell: part} around a node, without the barred facets."""
    label = {}
    for key, owners in table.items():
        if node in key:
            for owner in owners:
                label.setdefault(owner[0], owner[0])
    for key, owners in table.items():
        if node in key and len(owners) == 2 and key not in barred:
            one, other = label[owners[0][0]], label[owners[1][0]]
            label = {c: one if v == other else v for c, v in label.items()}
    return label


def solid_volume(mesh):
    return sum(
        float(np.abs(measure(kind, mesh.points[nodes])).sum())
        for kind, nodes in mesh.blocks
        if CELLS[kind].dim == mesh.dim
    )


@pytest.mark.filterwarnings("ignore:.*stay closed")
@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("seed", range(6))
def test_random_faces_of_random_meshes(dim, order, seed):
    """Sides by a plain search; facets that do not open are shared as before; points, numbers, data, groups are kept."""
    rng = np.random.default_rng([dim, order, seed])
    mesh, keys = with_group(random_mesh(rng, dim, order, slaves=int(rng.integers(8, 24)), interior=True))
    if not keys:
        pytest.skip("no face of this mesh lies inside")
    opened = opened_keys(mesh, keys)
    if not opened:
        with pytest.raises(DataError, match="no face of the group 'G' can open"):
            split(mesh, "G")
        return
    parts = split_skins(mesh, ["G"])
    new = parts.mesh
    sides = plain_copies(mesh, opened)
    assert new.n_nodes - mesh.n_nodes == sum(sides.values()) - len(sides)
    assert sorted(parts.n_sides.tolist()) == sorted(sides.values())
    assert len(new.cell_groups["G_a"]) == len(new.cell_groups["G_b"]) == len(opened)
    assert len(set(map(int, parts.closed))) >= len(keys) - len(opened)
    same_solids(mesh, new, opened)
    outward_pairs(mesh, new, "G")
    kept_data(mesh, new)


def same_solids(mesh, new, opened):
    """Each cell has the points it had; each facet that did not open is shared as before, the others are apart."""
    for old, now in zip(mesh.blocks, new.blocks, strict=True):
        if CELLS[old.type].dim == mesh.dim:
            assert np.array_equal(mesh.points[old.nodes], new.points[now.nodes])
    assert solid_volume(new) == pytest.approx(solid_volume(mesh), rel=1e-14)
    pairs, pairs_now = (
        {frozenset((int(m.cell_number[o[0]]), o[1]) for o in owners): key for key, owners in facets_of(m).items()}
        for m in (mesh, new)
    )
    for pair, key in pairs.items():
        if key in opened:
            assert pair not in pairs_now and all(frozenset([side]) in pairs_now for side in pair)
        else:
            assert pair in pairs_now


def outward_pairs(mesh, new, name):
    """Each face of a skin belongs to one cell, points out of it, and has one of the other skin at its place."""
    at = []
    for end in "ab":
        cells = new.cell_groups[f"{name}_{end}"]
        table = facets_of(new)
        places = []
        for kind, _, nodes in new.select(cells):
            for row in nodes:
                (owner,) = table[tuple(sorted(row[: CELLS[kind].n_corners].tolist()))]
                assert same_winding(row, owner[3], CELLS[kind].n_corners)
                places.append(tuple(sorted(map(tuple, np.round(new.points[row], 12).tolist()))))
        at.append(sorted(places))
    assert at[0] == at[1]


def same_winding(one, other, n):
    one, other = one[:n].tolist(), other[:n].tolist()
    k = other.index(one[0])
    return one == other[k:] + other[:k] if n > 2 else one == other


def kept_data(mesh, new):
    n = mesh.n_nodes
    assert np.array_equal(new.node_number[:n], mesh.node_number)
    assert new.node_number[n:].tolist() == (mesh.node_number.max() + 1 + np.arange(new.n_nodes - n)).tolist()
    source = np.concatenate([np.arange(n), [copied_from(mesh, new, k) for k in range(n, new.n_nodes)]]).astype(int)
    assert np.array_equal(new.points, mesh.points[source])
    for name, values in mesh.node_data.items():
        assert np.array_equal(new.node_data[name], values[source]), name
    for name, members in mesh.node_groups.items():
        assert new.node_groups[name].tolist() == np.flatnonzero(np.isin(source, members)).tolist()
    for name, cells in mesh.cell_groups.items():
        full = lambda m, ids: sorted(m.cell_number[ids[m.cell_dim[ids] == m.dim]].tolist())  # noqa: E731
        assert full(mesh, cells) == full(new, new.cell_groups[name])


def copied_from(mesh, new, node):
    """The old node that a new one repeats, by a cell that has both."""
    for old, now in zip(mesh.blocks, new.blocks, strict=True):
        if CELLS[old.type].dim == mesh.dim:
            row, column = np.nonzero(now.nodes == node)
            if len(row):
                return int(old.nodes[row[0], column[0]])
    raise AssertionError(node)


# ---- shapes: sections, cracks, junctions


def skins_of(kind, where, n=4):
    """A block of cells of one type with groups of inner facets: name -> condition on the facet's corners."""
    linear, order = SOLIDS[kind]
    dim = CELLS[linear].dim
    points, cells = block((n,) * dim, (0,) * dim, (1,) * dim, linear)
    groups = {}
    for name, condition in where.items():
        facets = skin(points, cells, condition)
        groups[name] = {
            k: rows[np.unique(np.sort(rows, axis=1), axis=0, return_index=True)[1]] for k, rows in facets.items()
        }
    mesh = join([(points, cells, groups)])
    return lacmesh.raise_order(mesh, order) if order else mesh


def plane_of(axis, at, low=-1.0, high=2.0, along=0):
    """A condition on points: on a plane, and between two values along another axis."""
    return lambda x: (abs(x[..., axis] - at) < 1e-9) & (x[..., along] > low - 1e-9) & (x[..., along] < high + 1e-9)


BODIES = [name for name, cell in CELLS.items() if cell.dim > 1]


@pytest.mark.parametrize("kind", BODIES)
def test_a_section_makes_two_bodies(kind):
    up = CELLS[kind].dim - 1
    mesh = skins_of(kind, where={"G": plane_of(up, 0.5)})
    parts = split_skins(mesh, ["G"])
    assert parts.bodies == (1, 2) and set(parts.n_sides.tolist()) == {2}
    after, before = (measure_quality(m, "body0").as_json() for m in (parts.mesh, mesh))
    assert after["types"] == before["types"]
    on = np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(mesh.cell_groups["G"])]))
    assert parts.mesh.n_nodes == mesh.n_nodes + len(on)
    assert not check(parts.mesh, "G_a", "G_b").of_severity("warning")
    cut = cut_skin(parts.mesh, "G_a")
    findings = check(cut, master="G_b")
    assert not findings.errors and not findings.warnings
    assert findings.summary["gap"]["max"] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("kind", BODIES)
def test_an_edge_crack_keeps_its_front_closed(kind):
    up = CELLS[kind].dim - 1
    mesh = skins_of(kind, where={"G": plane_of(up, 0.5, high=0.5)})
    parts = split_skins(mesh, ["G"])
    assert parts.bodies == (1, 1)
    on = np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(mesh.cell_groups["G"])]))
    front = on[np.isclose(mesh.points[on, 0], 0.5)]
    assert (parts.n_sides == 1).sum() == len(front) and parts.mesh.n_nodes - mesh.n_nodes == len(on) - len(front)
    findings = check(cut_skin(parts.mesh, "G_a"), master="G_b")
    assert not findings.errors and [f.rule for f in findings.of_severity("info") if "front" in f.rule] == [
        "crack-front"
    ]


@pytest.mark.parametrize(("kind", "per_node"), [("QUAD4", 1), ("HEXA20", None), ("TETRA10", None)])
@pytest.mark.parametrize(("half", "sides"), [(True, 3), (False, 4)])
def test_junctions_have_a_node_for_each_side(kind, per_node, half, sides):
    """Two groups that meet in a T, or cross in an X."""
    dim = CELLS[kind].dim
    mesh = skins_of(kind, where={
        "G": plane_of(dim - 1, 0.5), "H": plane_of(0, 0.5, high=0.5 if half else 2.0, along=dim - 1)
    })  # fmt: skip
    parts = split_skins(mesh, ["G", "H"])
    assert parts.bodies == (1, sides)
    line = np.isclose(mesh.points[:, dim - 1], 0.5) & np.isclose(mesh.points[:, 0], 0.5)
    assert (parts.n_sides == sides).sum() == line.sum() and per_node in (None, line.sum())
    one = split(mesh, "G")
    assert parts.mesh.n_cells == split(one, "H").n_cells


def test_a_junction_in_one_group():
    """A sheet that branches: its parts have sides of their own."""
    cross = skins_of("QUAD8", where={"G": plane_of(1, 0.5), "H": plane_of(0, 0.5)})
    both = np.union1d(cross.cell_groups["G"], cross.cell_groups["H"])
    parts = split_skins(replace(cross, cell_groups={"G": both}), ["G"])
    assert parts.bodies == (1, 4)
    assert len(parts.mesh.cell_groups["G_a"]) == len(parts.mesh.cell_groups["G_b"]) == len(both)


def side_a(mesh):
    """The points of the cells behind G_a, sorted."""
    table = facets_of(mesh)
    owners = set()
    for kind, _, nodes in mesh.select(mesh.cell_groups["G_a"]):
        owners |= {table[tuple(sorted(row[: CELLS[kind].n_corners].tolist()))][0][0] for row in nodes}
    centres = [mesh.points[nodes].mean(axis=1) for _, _, nodes in mesh.select(np.array(sorted(owners)))]
    return np.array(sorted(np.concatenate(centres).round(9).tolist()))


def reversed_faces(mesh, cells):
    return reverse(mesh, np.sort(cells))


@pytest.mark.parametrize("kind", ["TRIA6", "TETRA4", "PENTA15"])
def test_the_normal_points_from_a_to_b_wherever_the_model_lies(kind):
    up = CELLS[kind].dim - 1
    mesh = skins_of(kind, where={"G": plane_of(up, 0.5)})
    cells = mesh.cell_groups["G"]
    up_normals = face_normals(mesh, faces_of(mesh, cells))[:, up] > 0
    alike = reversed_faces(mesh, cells[~up_normals])  # all normals along +up: b is above
    below = side_a(split(alike, "G"))
    assert below[:, up].max() < 0.5
    assert side_a(split(reversed_faces(alike, cells), "G"))[:, up].min() > 0.5
    few = reversed_faces(alike, cells[: len(cells) // 3])
    assert np.array_equal(side_a(split(few, "G")), below), "most of the faces decide"
    half = reversed_faces(alike, cells[: len(cells) // 2])
    assert np.array_equal(side_a(split(half, "G")), below), "b is where the coordinate grows"
    assert np.array_equal(side_a(split(reversed_faces(half, cells), "G")), below)
    shift = np.array([1e4, -3e4, 5e4 * (up == 2)])
    assert np.allclose(side_a(split(replace(alike, points=alike.points + shift), "G")), below + shift)


def test_a_closed_sheet_has_side_a_inside():
    centre = lambda x: np.isclose(abs(x - 0.5).max(axis=-1), 0.25)  # noqa: E731
    mesh = skins_of("HEXA8", where={"G": lambda x: centre(x) & centre(x.mean(axis=-2, keepdims=True))})
    parts = split_skins(mesh, ["G"])
    assert len(mesh.cell_groups["G"]) == 24 and parts.bodies == (1, 2)
    assert (abs(side_a(parts.mesh) - 0.5) < 0.25).all()


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


def test_what_cannot_be_split_is_said():
    mesh = skins_of("HEXA8", where={"G": plane_of(2, 0.5), "top": plane_of(2, 1.0), "one": plane_of(2, 0.5, 0.25, 0.5)})
    with pytest.raises(GroupNotFoundError):
        split(mesh, "g")
    for name, match in (
        ("top", "lie on the surface already"),
        ("body0", "holds no skin"),
        ("none", "'none' is empty"),
        ("line", "'line' has lines"),
        ("air", "are no facets of cells"),
    ):
        with pytest.raises(DataError, match=match):
            split(_with_odd_cells(mesh), name)
    with pytest.raises(RequestError, match="'G_b' already"):
        split(replace(mesh, cell_groups={**mesh.cell_groups, "G_b": mesh.cell_groups["top"]}), "G")
    with pytest.raises(RequestError, match="given twice"):
        split(mesh, ["G", "G"])
    with pytest.raises(RequestError, match="no group"):
        split(mesh, [])
    with pytest.raises(CutError, match="before it is cut"):
        split(cut_skin(mesh, "top").mesh, "G")


def _with_odd_cells(mesh):
    blocks = {b.type: b.nodes for b in mesh.blocks}
    start = sum(map(len, blocks.values()))
    odd = {"SEG2": [[0, 1]], "TRIA3": [[0, 7, 31]]}
    return Mesh.create(
        mesh.points, [*blocks.items(), *odd.items()],
        cell_groups={**mesh.cell_groups, "none": [], "line": [start], "air": [start + 1]},
    )  # fmt: skip


def test_faces_that_cannot_open_are_said():
    one = lambda x: plane_of(1, 0.5, 0.24, 0.51)(x)  # noqa: E731
    mesh = skins_of("QUAD4", where={"G": one})
    with pytest.raises(DataError, match="no face of the group 'G' can open"):
        split(mesh, "G")
    strip = skins_of("TETRA4", n=4, where={"G": plane_of(2, 0.5, high=0.5)})
    cells = strip.cell_groups["G"]
    x = np.array([strip.points[n].mean(axis=0) for _, _, nodes in strip.select(cells) for n in nodes])
    jag = cells[~((x[:, 0] > 0.3) & (x[:, 1] < 0.5))]
    jagged = replace(strip, cell_groups={"G": jag})
    opened = opened_keys(jagged, _keys(jagged, "G"))
    assert 0 < len(opened) < len(jag)
    with pytest.warns(LacmeshWarning, match="stay closed and are in neither skin"):
        parts = split_skins(jagged, ["G"])
    assert len(parts.mesh.cell_groups["G_a"]) == len(opened) and len(parts.closed) == len(jag) - len(opened)


def _keys(mesh, name):
    chosen = mesh.select(mesh.cell_groups[name])
    return {tuple(sorted(row[: CELLS[kind].n_corners].tolist())) for kind, _, nodes in chosen for row in nodes}


# ---- files and the command


@pytest.mark.parametrize("suffix", [".msh", ".med", ".mail", ".inp", ".vtu", ".xdmf"])
def test_the_command_writes_every_format(suffix, tmp_path, capsys):
    mesh = skins_of("HEXA20", where={"CRACK": plane_of(2, 0.5, high=0.5), "TOP": plane_of(2, 1.0)})
    source, target = tmp_path / "in.msh", tmp_path / f"out{suffix}"
    lacmesh.write(source, mesh)
    assert main(["split", str(source), "--faces", "CRACK", "-o", str(target)]) == 0
    printed = capsys.readouterr().out
    assert "faces of CRACK in CRACK_a, CRACK_b" in printed and "on the front" in printed
    new = lacmesh.read(target)
    wanted = split(lacmesh.read(source), "CRACK")
    names = {name.upper(): name for name in new.cell_groups}
    for end in "AB":
        assert len(new.cell_groups[names[f"CRACK_{end}"]]) == len(wanted.cell_groups[f"CRACK_{end.lower()}"]) == 8
    assert new.n_nodes == wanted.n_nodes and solid_volume(new) == pytest.approx(1.0)
    pair = names["CRACK_A"], names["CRACK_B"]
    assert not check(cut_skin(new, pair[0]), master=pair[1]).errors


def test_the_commands_of_the_page_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    lacmesh.write("part.msh", skins_of("TETRA10", where={"crack": plane_of(2, 0.5, high=0.5)}))
    page = (Path(__file__).parents[2] / "docs" / "split.md").read_text(encoding="utf-8")
    commands = re.findall(r"^\$ lacmesh (.*)$", page, re.MULTILINE)
    statuses = [main(shlex.split(command)) for command in commands]
    assert [c.split()[0] for c in commands] == ["split", "cut", "check"] and statuses == [0, 0, 0]


def test_the_command_asks_before_it_replaces(tmp_path, capsys):
    source = tmp_path / "in.msh"
    lacmesh.write(source, skins_of("TRIA3", where={"G": plane_of(1, 0.5)}))
    assert main(["split", str(source), "--faces", "G", "-q"]) == 0
    assert lacmesh.read(tmp_path / "in.split.msh").cell_groups.keys() >= {"G_a", "G_b"}
    assert main(["split", str(source), "--faces", "G"]) == 2
    assert "--force" in capsys.readouterr().err
    assert main(["split", str(source), "--faces", "G", "--force", "-q"]) == 0
    assert main(["split", str(source), "--faces", "H", "--force"]) == 2
    assert main(["split", str(source), "--faces", "body0", "--force"]) == 1


def test_a_deck_is_written_as_it_has_become(tmp_path):
    """Elements of side b take the copies, a node set has them too, a condition of a node by number holds its copy."""
    mesh = skins_of("HEXA8", n=2, where={"G": plane_of(2, 0.5)})
    source, target = tmp_path / "in.inp", tmp_path / "out.inp"
    lacmesh.write(source, mesh)
    node = int(mesh.node_number[np.flatnonzero(np.isclose(mesh.points[:, 2], 0.5))[0]])
    text = source.read_text() + f"*MATERIAL, NAME=M\n*ELASTIC\n1., 0.\n*BOUNDARY\n{node}, 1, 3\n"
    source.write_text(text)
    assert main(["split", str(source), "--faces", "G", "-o", str(target), "-q"]) == 0
    new = lacmesh.read(target)
    assert new.n_nodes == mesh.n_nodes + 9
    fixed = [line.split(",")[0] for line in target.read_text().split("*BOUNDARY")[1].splitlines()[1:] if line.strip()]
    assert str(node) in fixed and str(mesh.node_number.max() + 1) in fixed
