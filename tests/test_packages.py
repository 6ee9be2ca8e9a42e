"""Files for the forge, conda and containers agree with the project: targets, dependencies, commands."""

from __future__ import annotations

import re
import shutil
import subprocess
from itertools import chain
from pathlib import Path

import pytest
import yaml

import lacmesh
from tests.packaging import PROJECT, ROOT, bare, build, user_environment

WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
CONTAINER = ROOT / "packaging" / "Dockerfile"
RECIPE = yaml.safe_load((ROOT / "packaging" / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
#: of conda-forge there is no package
PYPI_ONLY = {"rslab"}


def steps(workflow):
    """The steps of all jobs of a workflow."""
    jobs = yaml.safe_load(workflow.read_text(encoding="utf-8"))["jobs"]
    return [step for job in jobs.values() for step in job["steps"]]


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.stem)
def test_workflows_call_what_is_there(workflow):
    """Targets of the Makefile, files of the checkout, commands of the wheel; the actions have a version."""
    targets = set(re.findall(r"^(\w+):.* ## ", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    for step in steps(workflow):
        assert len({"run", "uses"} & set(step)) == 1
        assert re.fullmatch(r"[\w-]+/[\w-]+@(v\d+|release/v1)", step.get("uses", "a/b@v1"))
        words = step.get("run", "make help").removeprefix("sudo ").split()
        match words:
            case ["make", *named]:
                assert named and set(named) <= targets, words
            case ["bash", script, *_]:
                assert (ROOT / script).is_file(), words
            case _:
                assert words[0] in PROJECT["scripts"] or words[:3] in (
                    ["python", "-m", "pip"],
                    ["python", "-m", "verification"],
                ), words


def test_the_workflows_are_those_of_tests_wheels_and_the_site():
    assert [path.stem for path in WORKFLOWS] == ["site", "tests", "wheels"]
    systems = {step for path in WORKFLOWS for step in re.findall(r"(ubuntu|macos|windows)-", path.read_text())}
    assert systems == {"ubuntu", "macos", "windows"}


def test_the_recipe_has_the_dependencies_and_the_programs():
    assert RECIPE["context"]["version"] == lacmesh.__version__
    ours = {r.replace(">=", " >=") for r in PROJECT["dependencies"] if bare(r) not in PYPI_ONLY}
    assert set(RECIPE["requirements"]["run"]) == ours | {f"python {PROJECT['requires-python']}"}
    points = RECIPE["build"]["python"]["entry_points"]
    assert points == [f"{name} = {target}" for name, target in PROJECT["scripts"].items()]


def instructions():
    """(instruction, what follows) of the container file."""
    text = CONTAINER.read_text(encoding="utf-8")
    return [tuple(line.split(maxsplit=1)) for line in text.splitlines() if line and not line.startswith("#")]


def test_the_container_installs_the_libraries_that_the_system_script_does():
    (line,) = [rest for name, rest in instructions() if name == "RUN" and "apt-get" in rest]
    named = set(line.partition("--no-install-recommends ")[2].partition(" &&")[0].split())
    script = (ROOT / "tools" / "system.sh").read_text(encoding="utf-8")
    of_script = set(re.findall(r"^  need (\S+)", script.partition("programs()")[0], re.MULTILINE))
    assert named == of_script | {"python3", "python3-venv"}


@pytest.mark.slow
@pytest.mark.index
def test_the_commands_of_the_container_file_run(tmp_path):
    """All but those of Debian's packages, in a folder that takes the place of its root; then a case is solved in it."""
    build(tmp_path / "dist")
    places = {"/opt/lacmesh": str(tmp_path / "prefix"), "/tmp/dist": str(tmp_path / "image")}
    env = user_environment(tmp_path / "prefix")
    for name, rest in instructions():
        for place, ours in places.items():
            rest = rest.replace(place, ours)
        if name == "ARG":
            env |= dict([rest.split("=")])
        elif name == "COPY":
            source, target = rest.split()
            Path(target).mkdir()
            for path in tmp_path.glob(source):
                shutil.copy(path, target)
        elif name == "RUN" and "apt-get" not in rest:
            subprocess.run(rest, shell=True, check=True, env=env, cwd=tmp_path, capture_output=True)
    for name in ("two_blocks.msh", "two_blocks.toml"):
        shutil.copy(ROOT / "data" / name, tmp_path)
    line = "lacsolver run two_blocks.toml -o results --plot pressure.png"
    subprocess.run(line, shell=True, check=True, env=env, cwd=tmp_path, capture_output=True)
    assert (tmp_path / "pressure.png").stat().st_size > 10_000


def test_every_dependency_has_a_row_in_the_table():
    """Base and extras: for each package its keeper, its age, its replacement, in docs/decisions.md."""
    text = (ROOT / "docs" / "decisions.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([\w, -]+) \| ([^|]+) \| (\d{4}) \| ([^|]+) \| ([^|]+) \|$", text, re.MULTILINE)
    needs = chain(PROJECT["dependencies"], *PROJECT["optional-dependencies"].values())
    assert {name for row in rows for name in row[0].split(", ")} == {bare(need) for need in needs} - {"lacmesh"}
