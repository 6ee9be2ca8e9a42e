"""Whole files, cut, written, and opened by the programs that people use; a generated twin of each always runs."""

import numpy as np
import pytest

import lacmesh
from lacmesh.cells import CELLS
from lacmesh.cutting.recognition import find_macros, recognise
from lacmesh.cutting.records import without_records
from lacmesh.cutting.select import slave_skin
from tests.checks.test_healthy import REAL
from tests.formats.med_peer import ask
from tests.formats.msh_meshes import seen_by
from tests.meshes import random_mesh
from tests.properties import CONFORMING, DOFS, KEPT, UNTOUCHED, hold
from tests.samples import each_option, samples
from tests.test_recognition import same
from verification.measures.cutting import sizes

#: code_aster's meshes and the groups that its tests take as slave
SLAVE = {name: [slave] if isinstance(slave, str) else list(slave) for name, slave, *_ in REAL}
OF_EACH_TEST = each_option([(name,) for name in sorted(SLAVE)], of=lambda row: [row[0][:-1]])


def opens_everywhere(mesh, slave, gmsh, folder):
    """Cut; gmsh and medcoupling find the same groups, cell by cell, and the cut's records as fields."""
    cut = lacmesh.cut_skin(mesh, slave)
    hold(mesh, cut, CONFORMING, UNTOUCHED, DOFS, KEPT)
    after = cut.mesh
    same_sign_as_parents(mesh, cut)
    msh, med = folder / "cut.msh", folder / "cut.med"
    lacmesh.write(msh, after)
    lacmesh.write(med, after)
    seen, found = seen_by(gmsh, msh), {}
    assert len(seen["points"]) == after.n_nodes
    for name, numbers in seen["groups"].values():
        found.setdefault(name, set()).update(numbers)
    expected = {name: set(after.cell_number[g].tolist()) for name, g in after.cell_groups.items() if len(g)}
    assert found == expected
    views = {gmsh.view.option.getString(tag, "Name") for tag in gmsh.view.getTags()}
    records = {"lac_macro", "lac_zone", "lac_child", "lac_internal"}
    assert records | ({"lac_parent"} if (cut.parent_of_cell >= 0).any() else set()) <= views
    said = ask("say", str(med))[str(med)]
    numbers = {kind: part["number"] for kind, part in said["types"].items()}
    groups = {name: {numbers[kind][row] for kind, row in cells} for name, cells in said["groups"].items() if cells}
    assert groups == expected
    named = {name: len(members) for name, members in after.node_groups.items() if len(members)}
    assert {name: len(members) for name, members in said["node_groups"].items() if members} == named


def same_sign_as_parents(mesh, cut):
    """code_aster's meshes have cells that turn the other way; children turn as their parents do."""
    row = {int(n): k for k, n in enumerate(mesh.cell_number)}
    children = np.flatnonzero(cut.parent_of_cell >= 0)
    parents = [row[int(n)] for n in cut.parent_of_cell[children]]
    assert (sizes(cut.mesh)[children] * sizes(mesh)[parents] > 0).all()


@pytest.mark.rows("ssnp150c", "ssnv219e")
@pytest.mark.shared
@pytest.mark.gmsh
@pytest.mark.medcoupling
@pytest.mark.parametrize("name", OF_EACH_TEST)
@pytest.mark.filterwarnings("ignore:.*left out")
def test_code_aster_mesh(name, shared, gmsh, tmp_path):
    mesh = lacmesh.read(shared / "reference" / "meshes" / f"{name}.med")
    opens_everywhere(mesh, SLAVE[name], gmsh, tmp_path)


@pytest.mark.shared
@pytest.mark.parametrize("name", OF_EACH_TEST)
@pytest.mark.filterwarnings("ignore:.*left out")
def test_cuts_of_code_aster_meshes_are_recognised(shared, name):
    """Linear and quadratic, both variants: nothing is found before the cut, the whole cut after it."""
    mesh, slave = lacmesh.read(shared / "reference" / "meshes" / f"{name}.med"), SLAVE[name]
    quadratic = any(CELLS[b.type].order == 2 for b in mesh.blocks)
    for base in [mesh] if quadratic else [mesh, lacmesh.raise_order(mesh, "2")]:
        assert find_macros(base, slave_skin(base, slave)).n_cut == 0
        for hexa in ("pyramid", "hexa"):
            cut = lacmesh.cut_skin(base, slave, hexa=hexa)
            same(cut, recognise(without_records(cut.mesh), slave))


@pytest.mark.rows("1-1-2", "1-1-3")
@pytest.mark.fuzz
@pytest.mark.gmsh
@pytest.mark.medcoupling
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("seed", range(1, 1 + samples(1, 3)))
def test_generated_twin(dim, order, seed, gmsh, tmp_path):
    mesh = random_mesh(np.random.default_rng(seed), dim, order, slaves=6)
    assert any(CELLS[b.type].dim == dim for b in mesh.blocks)
    opens_everywhere(mesh, "slave", gmsh, tmp_path)
