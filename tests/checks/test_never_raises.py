"""Whatever is wrong with a mesh that could be read, the check says it and does not raise."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest

from lacmesh import Mesh, cut_skin
from lacmesh.cells import ALL_CELLS
from lacmesh.checks import check
from lacmesh.errors import GroupNotFoundError, LacmeshError, LacmeshWarning, RequestError
from tests.checks.blocks import SOLIDS, cut_blocks, two_blocks
from tests.meshes import random_mesh
from tests.samples import samples

BAD = (np.nan, np.inf, -np.inf, 1e300, 0.0, -1e-320, 5.0)


def base(rng):
    """A mesh to mangle: cut or not, of any cells."""
    kind = rng.integers(4)
    if kind == 0:
        return two_blocks(list(SOLIDS)[rng.integers(len(SOLIDS))], n=1, m=2)
    if kind == 1:
        return cut_blocks(list(SOLIDS)[rng.integers(len(SOLIDS))], ("pyramid", "hexa")[rng.integers(2)], n=1, m=2)
    mesh = random_mesh(rng, int(rng.integers(2, 4)), int(rng.integers(1, 4)), slaves=4, interior=bool(rng.integers(2)))
    if kind == 3:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LacmeshWarning)
            mesh = cut_skin(mesh, "slave").mesh
    return mesh


def places(rng, mesh):
    points = mesh.points.copy()
    if len(points):
        rows = rng.integers(len(points), size=int(rng.integers(1, 4)))
        points[rows, rng.integers(3, size=len(rows))] = BAD[rng.integers(len(BAD))]
    return replace(mesh, points=points)


def all_places(rng, mesh):
    """All nodes at one place, in one plane, or very far away."""
    by = [(0, 0, 0), (1, 0, 1), (1, 1, 0), (1e160, 1, 1), (1e-200, 1e-200, 1e-200)][rng.integers(5)]
    with np.errstate(all="ignore"):  # places may be infinite already
        return replace(mesh, points=mesh.points * by)


def nodes_of_cells(rng, mesh):
    """Some cells list other nodes, repeated ones too."""
    blocks = []
    for b in mesh.blocks:
        nodes = b.nodes.copy()
        for _ in range(int(rng.integers(3)) if len(nodes) else 0):
            nodes[rng.integers(len(nodes)), rng.integers(nodes.shape[1])] = rng.integers(mesh.n_nodes)
        blocks.append(b._replace(nodes=nodes))
    return replace(mesh, blocks=tuple(blocks))


def numbers(rng, mesh):
    cell, node = mesh.cell_number.astype(np.int64), mesh.node_number.astype(np.int64)
    for values in (cell, node):
        if len(values):
            values[rng.integers(len(values))] = rng.integers(-3, 5)
    return replace(mesh, cell_number=cell, node_number=node)


def groups(rng, mesh):
    """Groups of any cells, empty ones, of every dimension."""
    some = {n: np.flatnonzero(rng.random(mesh.n_cells) < rng.random()) for n in ("slave", "master", "more", "fixed")}
    return replace(mesh, cell_groups={**mesh.cell_groups, **some, "none": np.empty(0, np.int64)})


def records(rng, mesh):
    """Data that resemble the records of a cut but are not."""
    data = {k: rng.integers(-1, 4, mesh.n_cells) for k in ("lac_macro", "lac_zone", "lac_child") if rng.random() < 0.8}
    return replace(mesh, cell_data={**mesh.cell_data, **data}, zones=("slave",) * int(rng.integers(3)))


def rebuilt(mesh, blocks):
    groups = {k: v[v < sum(len(n) for _, n in blocks)] for k, v in mesh.cell_groups.items()}
    return Mesh.create(mesh.points, blocks, cell_groups=groups, space_dim=mesh.space_dim)


def blocks_gone(rng, mesh):
    return rebuilt(mesh, [(b.type, b.nodes) for b in mesh.blocks if rng.random() < 0.6])


def cells_again(rng, mesh):
    """Copies of some cells."""
    return rebuilt(mesh, [(b.type, np.concatenate([b.nodes, b.nodes[: int(rng.integers(4))]])) for b in mesh.blocks])


def higher_order(rng, mesh):
    """Cells of order 3, on nodes of the mesh."""
    kind = ("SEG4", "TRIA10", "QUAD16", "TETRA20", "HEXA64", "PENTA40", "PYRAM30")[rng.integers(7)]
    if any(b.type == kind for b in mesh.blocks) or not mesh.n_nodes:
        return mesh
    nodes = rng.integers(mesh.n_nodes, size=(2, ALL_CELLS[kind].n_nodes))
    made = rebuilt(mesh, [*((b.type, b.nodes) for b in mesh.blocks), (kind, nodes)])
    return replace(made, cell_groups={**made.cell_groups, "slave": np.arange(made.n_cells - 2, made.n_cells)})


def other_space(rng, mesh):
    return replace(mesh, space_dim=5 - mesh.space_dim)


MANGLES = [
    places, all_places, nodes_of_cells, numbers, groups, records, blocks_gone, cells_again, higher_order, other_space,
]  # fmt: skip


def asked(rng, mesh):
    """Groups of the mesh as slave, master and Dirichlet groups."""
    names = list(mesh.cell_groups)
    pick = lambda k: [names[i] for i in rng.integers(len(names), size=k)]  # noqa: E731
    usual = "slave" in names and rng.random() < 0.6
    slave = ["slave"] if usual else pick(int(rng.integers(1, 3)))
    master = ["master"] if usual and "master" in names else pick(int(rng.integers(0, 3)))
    held = pick(int(rng.integers(0, 2)))
    if len(slave) > 1 and len(master) > 1:
        return {"pairs": list(zip(slave, master, strict=True)), "dirichlet": held}
    return {"slave": slave, "master": master, "dirichlet": held}


@pytest.mark.fuzz
def test_mangled_meshes():
    rules = set()
    for seed in range(samples(75, 500)):
        rng = np.random.default_rng([7, seed])
        mesh = base(rng)
        for _ in range(int(rng.integers(1, 4))):
            mesh = MANGLES[rng.integers(len(MANGLES))](rng, mesh)
        if not mesh.cell_groups:
            mesh = replace(mesh, cell_groups={"slave": np.arange(mesh.n_cells)})
        found = check(mesh, **asked(rng, mesh))
        assert "not-checked" not in found.rules, (seed, [f.message for f in found.of_rule("not-checked")])
        json.dumps(found.as_dict(), allow_nan=False)
        assert found.summary["ok"] == (not found.errors)
        rules |= set(found.rules)
    assert len(rules) > 30, "the mangling is too gentle"


def test_a_part_that_fails_says_so_and_the_others_go_on(monkeypatch):
    def broken(subject):
        raise ZeroDivisionError("by nothing")

    monkeypatch.setattr("lacmesh.checks.skins.check_shape", broken)
    found = check(two_blocks(), "slave", "master")
    assert "not-checked" in found.rules and "not-cut" in found.rules
    assert "by nothing" in found.of_rule("not-checked")[0].message


@pytest.mark.parametrize(
    ("ask", "error"),
    [
        ({"slave": "slvae"}, GroupNotFoundError),
        ({"slave": "slave", "master": "mastre"}, GroupNotFoundError),
        ({"slave": "slave", "dirichlet": "fixde"}, GroupNotFoundError),
        ({"slave": []}, RequestError),
        ({}, RequestError),
        ({"slave": "slave", "master": "master", "axisymmetric": True}, RequestError),
        ({"slave": "slave", "axisymmetric": True}, RequestError),
        ({"slave": "slave", "master": "master", "search_distance": -1.0}, RequestError),
    ],
)
def test_what_was_asked_wrongly_is_an_error_of_status_2(ask, error):
    with pytest.raises(error) as caught:
        check(two_blocks(), **ask)
    assert caught.value.status == 2 and isinstance(caught.value, LacmeshError)
