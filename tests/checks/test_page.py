"""docs/check.md says what the code says."""

from __future__ import annotations

import re

import pytest

from lacmesh.checks import RULES, check
from tests.checks import page
from tests.checks.blocks import cut_blocks, two_blocks

TEXT = page.PAGE.read_text(encoding="utf-8")


def test_the_page_is_current():
    assert page.with_parts(TEXT) == TEXT, "run: python -m tests.checks.page"


def test_a_changed_rule_is_seen(monkeypatch):
    monkeypatch.setitem(page.PARTS, "example", lambda: "")
    changed = dict(RULES) | {"no-parent": RULES["no-parent"]._replace(severity="info")}
    monkeypatch.setattr(page, "RULES", changed)
    assert page.with_parts(TEXT) != TEXT and "| `no-parent` | info |" in page.with_parts(TEXT)


def keys_of(table):
    """The keys that the table under a heading lists."""
    rows = TEXT.split(f"| {table} | value |")[1].split("\n\n")[0].splitlines()[2:]
    return {key for row in rows for key in re.findall(r"`(\w+)`", row.split("|")[1])}


@pytest.mark.parametrize("mesh", [two_blocks(), cut_blocks("TETRA10")])
def test_the_json_has_the_keys_of_the_page(mesh):
    said = check(mesh, "slave", "master", "fixed").as_dict()
    assert said.keys() == {"findings", "summary"}
    assert said["summary"].keys() == keys_of("key of the summary") - {"pairs"}
    pairs = check(mesh, pairs=[("slave", "master")] * 2).as_dict()["summary"]["pairs"]
    assert set(pairs[0]) <= keys_of("key of the summary") | {"slave", "master"}
    for finding in said["findings"]:
        assert finding.keys() == keys_of("key of a finding")
        assert finding["where"].keys() == {"group", "box"}
