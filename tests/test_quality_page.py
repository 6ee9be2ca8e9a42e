"""docs/quality.md: what it shows is what the commands print, and it names every key of the JSON."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from lacmesh import cut_skin
from lacmesh.cli import main
from lacmesh.quality import measure_cells, measure_quality
from lacmesh.quality.measures import SCALES, default_measures, measures_of, primary_metric
from lacmesh.quality.verdict import ACCEPTED
from lacmesh.report import children_quality, cut_report
from tests.meshes import random_mesh
from tests.quality_cells import ideal

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "quality.md").read_text(encoding="utf-8")


def test_what_the_commands_print_is_what_stands_there(tmp_path, monkeypatch, capsys):
    """Line by line; `...` stands for lines left out."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "build").mkdir()
    shutil.copytree(ROOT / "data", "data")
    shown = 0
    for block in re.findall(r"^```console\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE):
        for command, expected in re.findall(r"^\$ lacmesh (.*)\n((?:(?!\$ ).*\n)*)", block, re.MULTILINE):
            main(command.split())
            said = capsys.readouterr()
            lines = [line.rstrip() for line in (said.out + said.err).splitlines()]
            for part in re.split(r"^\.\.\.\n", expected, flags=re.MULTILINE):
                wanted = part.splitlines()
                starts = [k for k in range(len(lines)) if lines[k : k + len(wanted)] == wanted]
                assert starts, f"not in what `lacmesh {command}` prints:\n{part}"
                lines = lines[starts[0] + len(wanted) :]
                shown += len(wanted)
    assert shown > 40


def keys(told):
    """Every key of a JSON object, at any depth."""
    for key, value in told.items():
        yield key
        for part in [value] if isinstance(value, dict) else value if isinstance(value, list) else []:
            if isinstance(part, dict):
                yield from keys(part)


def test_every_key_of_the_json_is_named():
    mesh = random_mesh(np.random.default_rng(3), 3, 1, slaves=5)
    cut = cut_skin(mesh, "slave")
    quality = {**measure_quality(mesh).as_json(), "file": "", "cut": children_quality(cut).as_json()}
    report = {"name": "", **cut_report(mesh, cut).as_json()}
    data = {*ACCEPTED, *SCALES, *mesh.cell_groups, *mesh.cells_by_type, *cut.mesh.cells_by_type, *cut.zones}
    places = {"corner", "mid-node or centre", "integration point"}
    told = json.loads(json.dumps(quality))
    assert set(keys(told)) - data - places <= set(re.findall(r"`(\w+)`", PAGE.split("## JSON")[1]))
    assert set(report) <= set(re.findall(r"`(\w+)`", PAGE.split("## JSON")[1]))


@pytest.mark.vtk
@pytest.mark.parametrize("kind", ACCEPTED)
def test_every_measure_has_its_row(kind):
    table = PAGE.split(f"### {kind}\n")[1].split("\n#")[0]
    rows = re.findall(r"^\| (\**)`(\w+)`\**(, ranks)? \| .+? \| (.*?) \| (.*?) \|$", table, re.MULTILINE)
    assert [name for _, name, *_ in rows] == list(ACCEPTED[kind])
    x = ideal(kind)
    best = measure_cells(kind, x, np.arange(len(x))[None], ACCEPTED[kind])
    for bold, name, ranks, value, limits in rows:
        accepted = ACCEPTED[kind][name]
        told = "" if accepted is None else f"{accepted[0]:.4g} to {accepted[1]:.4g}".replace("to inf", "and more")
        assert limits.strip() == told
        assert bool(bold) == (name in default_measures(kind)) and bool(ranks) == (name == primary_metric(kind))
        size = name in ("area", "volume", "jacobian")
        assert value.strip() == ("" if size else f"{round(float(best[name][0]), 4):g}"), name
    own = PAGE.split("<!-- own: begin -->")[1].split("<!-- own: end -->")[0]
    assert set(measures_of(kind)) <= {*ACCEPTED[kind], *re.findall(r"^\| `(\w+)`", own, re.MULTILINE)}
