"""Each broken mesh of the corpus is named by its rule, and no other error is reported."""

from __future__ import annotations

import json

import pytest

from lacmesh.checks import RULES, check
from tests.checks import corpus_cells, corpus_contact, corpus_skins  # noqa: F401 (they enter their meshes)
from tests.checks.blocks import SOLIDS, cut_blocks
from tests.checks.corpus import CORPUS


@pytest.mark.parametrize("name", CORPUS)
def test_one_defect_is_named_and_no_other_error(name):
    case = CORPUS[name]
    found = check(case.make(), **case.asked)
    assert case.rule in found.rules, found.rules
    errors = {f.rule for f in found.errors}
    allowed = {case.rule, *case.also} if RULES[case.rule].severity == "error" else set(case.also)
    assert errors <= allowed, [f.message for f in found.errors]
    for f in found:
        assert f.severity == RULES[f.rule].severity
        assert f.message and f.message[-1] != "."
    json.dumps(found.as_dict(), allow_nan=False)


def test_the_corpus_covers_every_rule():
    assert len(CORPUS) >= 30
    always = {"bodies", "internal-dof", "gap"}  # said of healthy meshes
    assert set(RULES) - {case.rule for case in CORPUS.values()} == always | {"not-checked"}


@pytest.mark.parametrize(
    ("name", "hexa"), [*((name, "pyramid") for name in SOLIDS), *((n, "hexa") for n in SOLIDS if n.startswith("HEXA"))]
)
def test_a_healthy_cut_mesh_has_no_error_and_no_warning(name, hexa):
    found = check(cut_blocks(name, hexa, reach=0.2), "slave", "master", "fixed")
    assert not found.errors and not found.warnings, [f.message for f in found.errors + found.warnings]
    assert found.summary["with_free_internal_dof"] == found.summary["macro_elements"] > 0
    assert found.summary["covered"] == pytest.approx(1, abs=1e-9)
    assert found.summary["gap"]["mean"] == pytest.approx(0.01, abs=1e-9)
