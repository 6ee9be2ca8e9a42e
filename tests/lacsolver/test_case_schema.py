"""The table of keys as text, as JSON Schema and as the page of docs; and that reading a case needs no numpy."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from dataclasses import fields
from pathlib import Path

import pytest

from lacmesh.surface.points import NORMALS
from lacsolver.case import Case, Contact, Cyclic, parse_case
from lacsolver.case.keys import keys_of, sections_of, told_default
from lacsolver.case.kinds import Choice
from lacsolver.case.schema import json_schema, page_tables, records, schema_text
from lacsolver.cli import main
from lacsolver.space.space import MODELS
from tests.lacsolver.case_mistakes import MISTAKES
from tests.lacsolver.case_texts import SMALL, VALID

PAGE = Path(__file__).resolve().parents[2] / "docs" / "case.md"

#: mistakes that a row of the table does not show: they depend on the model, on other sections, on a formula's names
BEYOND = (
    "of the models",
    "needs kinematics",
    "with kinematics",
    "needs a [[material]]",
    "no effect",
    "earlier",
    "after",
    "formula",
    "unknown function",
    "unknown name",
    "steps.count is 2;",
    "depends on",
    "coordinates",
    "energy",
    "three numbers, which",
    "one number; law",
    "needs shear",
    "which is [[rigid]]",
    "the slave itself",
    "the group itself",
    "to another node",
    "takes Cartesian ones",
    "whole mesh",
    "lie on one line",
    "vectors",
    "uses z",
    "cannot be printed",
    "is empty",
    "rotation is",
    "moment is",
    "normal of faces",
    "needs geometry",
    "needs a name",
    "which only law",
    "means something only",
    "no meaning with",
    "of contact that can open",
    "is inf",
    "is nan",
    "twice",
    "poisson is",
    "gives energy",
    "nu_ij",
    "after the end",
    "the linear solvers of",
    "stands once",
    "has length 0",
    "and the steps end at",
    "which an earlier one has",
    "write ** for",
    "whose nodes share it",
    "needs xy",
    "axis of length",
    "axis out of z",
    "a plane model does not have",
    "has uz, which a plane",
    "of 3 components",
    "are cylindrical",
    "has a kind",
    "with nodal diameters",
    "has the length 0",
    "written for ParaView",
    "is of a sector",
    "needs hardening",
    "begins at a plastic strain",
    "has the yield stress",
    "a metal that softens",
    "takes Cartesian",
    "weights depends on t",
    "names a node twice",
    "of node 1.5",
    "say total = true",
    "plastic strains grow",
    "needs clearance_at_zero",
    "needs pressures",
    "stands beside law",
    "begin where the pressure does",
    "overlap both grow",
    "stands beside rotation",
    "about an axis whose rotation",
    "is prescribed at 'g'",
    "means something only with begin",
)


def validator():
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft7Validator.check_schema(json_schema())
    return jsonschema.Draft7Validator(json_schema())


@pytest.mark.parametrize("text", VALID, ids=range(len(VALID)))
def test_json_schema_takes_what_the_parser_takes(text):
    errors = [e.message for e in validator().iter_errors(tomllib.loads(text))]
    assert errors == []


def test_json_schema_sees_the_mistakes_that_a_row_shows():
    schema = validator()
    for text, said in MISTAKES:
        document = json.loads(json.dumps(tomllib.loads(text), default=lambda date: {"date": str(date)}))
        assert not schema.is_valid(document) or any(word in said for word in BEYOND), said


def test_json_schema_has_every_key_with_its_meaning():
    schema = json_schema()
    for record in records():
        section = record.SECTION
        table = schema if not section.name else schema["properties"][section.name]
        table = table.get("items", table)
        for name, key in keys_of(record).items():
            assert table["properties"][name]["description"].startswith(key.meaning)
    json.dumps(schema)


def test_text_has_every_section_key_option_and_unit():
    text = schema_text()
    assert max(map(len, text.splitlines())) <= 120
    for record in records():
        section, keys = record.SECTION, keys_of(record)
        start = text.index(f"\n{section.header}  ") if section.name else 0
        part = text[start : text.find("\n\n", start) if section.name else text.index("\n\n[[")]
        for name, key in keys.items():
            assert re.search(rf"^  {name} ", part, re.MULTILINE), name
            assert not key.unit or f"[{key.unit}]" in re.sub(r"\s+", " ", part), name
            if isinstance(key.kind, Choice):
                assert all(f"  {word}: {meaning}" in part for word, meaning in key.kind.options.items())


def test_every_row_of_the_page_has_its_columns():
    for table in page_tables().values():
        rows = [line for line in table.splitlines() if line.startswith("|")]
        assert len({line.count("|") for line in rows}) == 1


def test_examples_of_the_page(fresh, capsys):
    """The TOML of the page is a case that can be run, and the same as the one made in Python beside it."""
    text = PAGE.read_text(encoding="utf-8")
    toml, *more = re.findall(r"^```toml\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    (python,) = re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    names: dict = {}
    exec(python, names)
    assert parse_case(toml) == names["case"]
    (fresh / "case.toml").write_text(toml, encoding="utf-8")
    assert main(["validate", "case.toml"]) == 0
    assert "rigid-body mode without support" in capsys.readouterr().out
    assert main(["run", "case.toml", "-q"]) == 0
    for k, other in enumerate(text for text in more if "mesh = " in text):
        (fresh / f"case_{k}.toml").write_text(other, encoding="utf-8")
        assert main(["validate", f"case_{k}.toml"]) == main(["run", f"case_{k}.toml", "-q"]) == 0


# ---- one table


def test_every_field_of_a_record_is_a_key_or_a_section():
    for record in records():
        other = {f.name for f in fields(record)} - set(keys_of(record)) - set(sections_of(record))
        assert other <= {"place", "path", "why"} or record is Cyclic, record


def test_sections_are_named_as_their_fields():
    assert all(record.SECTION.name == name for name, record in sections_of(Case).items())


def test_every_key_says_what_it_means_and_what_is_without_it():
    for record in records():
        for name, key in keys_of(record).items():
            assert key.meaning and key.kind.words, name
            default = next(f.default for f in fields(record) if f.name == name)
            assert "Value(" not in told_default(key, default)
            for names in (*record.SECTION.one_of, *record.SECTION.some_of, *record.SECTION.not_both):
                assert set(names) <= set(keys_of(record))
            if key.needs:
                needed = keys_of(record)[key.needs.key].kind
                assert isinstance(needed, Choice) and set(key.needs.values) <= set(needed.known)


def test_options_are_those_of_the_stages():
    """A word that a later stage takes stands in the table, and no other does."""
    kinds = {**keys_of(Case), **keys_of(Contact)}
    assert set(kinds["model"].kind.known) == set(MODELS)
    assert set(kinds["normals"].kind.known) == {*NORMALS, "slave"}


def test_loads_are_marked():
    """Every ramped value is a load, and every value that is not a load is named here."""
    loads = {f"{r.SECTION.name}.{n}" for r in records() for n, k in keys_of(r).items() if k.load}
    assert {name.split(".")[0] for name in loads} == {
        "displacement", "pressure", "traction", "force", "body_force", "gravity", "temperature", "rigid", "equation",
        "coupling", "pretension",
    }  # fmt: skip
    values = {f"{r.SECTION.name}.{n}" for r in records() for n, k in keys_of(r).items() if "value" in k.kind.words}
    initial = {f"initial.{n}" for n in ("vx", "vy", "vz", "rotation", "ux", "uy", "uz")}
    contact = {f"contact.{n}" for n in ("clearance", "friction", "cohesion", "shear_limit", "stiffness")}
    assert values - loads == {*contact, *initial}


def test_reading_needs_no_numpy(tmp_path):
    """Nor scipy, nor numba: validate and schema answer at once."""
    (tmp_path / "a.toml").write_text(SMALL, encoding="utf-8")
    script = (
        "import sys; from lacsolver.case import read_case; from lacsolver.case.schema import schema_text, json_schema\n"
        "case = read_case(sys.argv[1]); schema_text(); json_schema()\n"
        "assert not {'numpy', 'scipy', 'numba', 'h5py'} & set(sys.modules), 'numpy'\n"
        "case.pressure[0].value([[0.0, 0.0, 0.0]], 0.5); assert 'numpy' in sys.modules\n"
    )
    root = Path(__file__).resolve().parents[2]
    subprocess.run([sys.executable, "-c", script, str(tmp_path / "a.toml")], check=True, cwd=root)
