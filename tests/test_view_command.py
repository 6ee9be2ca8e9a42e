"""`lacmesh view`: pictures, and what is said where nothing can be drawn or written."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh
from lacmesh.errors import RequestError, WriteError
from lacmesh.scene import colours, make_scene
from lacmesh.scene.marks import cell_values
from lacmesh.view import page, picture, png
from tests.test_view import Said, cube, two_cubes
from tests.viewing import cut_blocks, status, tones

DATA = Path(__file__).resolve().parents[1] / "data"


@pytest.fixture
def blocks(tmp_path):
    return cut_blocks(tmp_path)


@pytest.mark.vtk
def test_a_picture_of_a_cut(blocks, tmp_path, capsys):
    from PIL import Image

    images = []
    for name in ("one.png", "two.png"):
        code, said = status(capsys, blocks, "--master", "master", "-o", tmp_path / name, "--size", "480x300")
        assert code == 0, said
        assert said.startswith(f"{tmp_path / name}: ")
        with Image.open(tmp_path / name) as image:
            images.append(np.asarray(image.convert("RGB")))
    assert images[0].shape == (300, 480, 3)
    np.testing.assert_array_equal(*images)
    assert 0.3 < (images[0] == 255).all(axis=-1).mean() < 0.9
    assert min(tones(tmp_path / "one.png", *colours.PALETTE[:4], colours.MASTER)) > 60
    assert sorted(p.name for p in tmp_path.iterdir()) == ["blocks.msh", "one.png", "two.png"]


@pytest.mark.vtk
def test_findings_and_values_in_a_picture(tmp_path):
    mesh = two_cubes()
    findings = [Said("error", "bad", cells=(1, 2), nodes=(1,)), Said("warning", "poor", cells=(20,))]
    size = (480, 300)
    picture(mesh, tmp_path / "marked.png", slave="slave", findings=findings, size=size)
    picture(mesh, tmp_path / "plain.png", slave="slave", size=size)
    picture(mesh, tmp_path / "valued.png", values=cell_values(mesh, "corner_jacobian"), size=size)
    wrong = (colours.SEVERITIES["error"], colours.SEVERITIES["warning"])
    assert min(tones(tmp_path / "marked.png", *wrong)) > 200
    assert max(tones(tmp_path / "plain.png", *wrong)) < 20
    assert tones(tmp_path / "valued.png", colours.RAMP[-1])[0] > 5000  # cubes are ideal


@pytest.mark.vtk
@pytest.mark.parametrize(
    ("mesh", "size"),
    [
        (two_cubes(), (1, 1)),
        (Mesh.create([[0, 0], [1, 0], [2, 1]], [("SEG2", [[0, 1], [1, 2]])]), (60, 200)),
    ],
)
def test_small_and_strange_pictures(mesh, size, tmp_path):
    from PIL import Image

    picture(mesh, tmp_path / "a.png", size=size)
    with Image.open(tmp_path / "a.png") as image:
        assert image.size == size


# what goes wrong


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["-o", "a"], 2, "nothing is drawn as ''"),
        (["-o", "a.html", "--master", "mastre"], 2, "did you mean master"),
        (["-o", "a.png", "--camera", "nan", "0", "0"], 2, "--camera nan 0 0 is no direction"),
        (["-o", "a.html", "--camera", "0", "inf", "0"], 2, "--camera 0 inf 0 is no direction"),
        (["-o", "a.html", "--cutaway", "0", "0", "0"], 2, "no direction"),
        (["-o", "a.png", "--cutaway", "0", "0", "inf"], 2, "--cutaway 0 0 inf is no direction"),
        (["-o", "a.html", "--cutaway", "1", "nan", "0"], 2, "--cutaway 1 nan 0 is no direction"),
        *(
            (
                ["-o", f"a.{kind}", "--explode", gap],
                2,
                f"--explode {float(gap):g} is no gap; say a number from 0 to 100",
            )
            for gap, kind in (("nan", "png"), ("inf", "html"), ("-1", "png"), ("1e300", "html"), ("100.1", "png"))
        ),
        (["-o", "a.html", "--quality", "corner_jacobia"], 2, "did you mean corner_jacobian"),
        (["-o", "a.html", "--mesh", "other"], 2, "other"),
        (["-o", "a.html", "--size", "300x200"], 2, "--size is for a picture (.png), and a.html is a page"),
    ],
)
def test_a_wrong_request(arguments, code, words, blocks, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found, said = status(capsys, blocks, *arguments)
    assert found == code
    assert words in said
    assert len(said.strip().splitlines()) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["blocks.msh"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"camera": (0, float("nan"), 1)}, "camera 0 nan 1 is no direction"),
        ({"camera": (1, 0)}, "camera 1 0 is no direction"),
        ({"cutaway": (0, 0, 0)}, "cutaway 0 0 0 is no direction"),
        ({"explode": float("nan")}, "explode nan is no gap"),
        ({"explode": -0.1}, "explode -0.1 is no gap"),
        ({"near": float("nan"), "slave": "slave"}, "near nan is no distance"),
    ],
)
def test_a_wrong_request_from_python(options, words, tmp_path, monkeypatch):
    monkeypatch.setattr(png, "find_spec", lambda name: True)
    for draw, name in ((picture, "a.png"), (page, "a.html")):
        with pytest.raises(RequestError, match=f"^{words}"):
            draw(two_cubes(), tmp_path / name, **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("scale", [1e-320, 1e-200, 1e300])
def test_a_direction_of_any_length(scale, tmp_path):
    drawn = make_scene(two_cubes(), camera=(scale, 0, scale), cutaway=(0, 0, scale))
    plain = make_scene(two_cubes(), camera=(1, 0, 1), cutaway=(0, 0, 1))
    np.testing.assert_allclose(drawn.eye, plain.eye, rtol=1e-3)
    np.testing.assert_array_equal(drawn.layers[0].points, plain.layers[0].points)


@pytest.mark.parametrize("size", ["100", "0x5", "axb", "-3x4"])
def test_a_size_that_is_none(size, blocks, capsys):
    with pytest.raises(SystemExit) as ended:
        status(capsys, blocks, "-o", "a.png", f"--size={size}")
    assert ended.value.code == 2
    assert "write it as 1600x1000" in capsys.readouterr().err


def test_force_replaces_a_page(blocks, tmp_path, capsys):
    target = tmp_path / "a.html"
    target.write_text("old")
    assert status(capsys, blocks, "-o", target, "--force", "-q") == (0, "")
    assert target.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_a_picture_without_the_extra(tmp_path, monkeypatch):
    monkeypatch.setattr(png, "find_spec", lambda name: None)
    with pytest.raises(RequestError, match=r"pip install 'lacmesh\[view\]'"):
        picture(cube(), tmp_path / "a.png")
    page(cube(), tmp_path / "a.html")  # needs none


def fake_pyvista(folder, code):
    """An environment in which `import pyvista` runs some code."""
    (folder / "fake" / "pyvista").mkdir(parents=True)
    (folder / "fake" / "pyvista" / "__init__.py").write_text(code)
    return {**os.environ, "PYTHONPATH": str(folder / "fake")}


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (
            "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)",
            "nothing can be drawn here; apt-get install libegl1",
        ),
        ("import os; os.abort()", "here; apt-get install libegl1"),
        ("raise ImportError('libX11.so.6: no such file')", "(ImportError: libX11.so.6: no such file)"),
        ("import sys; sys.exit(0)", "nothing can be drawn here"),
    ],
)
def test_a_renderer_that_dies_is_one_sentence(code, words, blocks, tmp_path, capsys, monkeypatch):
    monkeypatch.syspath_prepend(fake_pyvista(tmp_path, code)["PYTHONPATH"])
    found, said = status(capsys, blocks, "-o", tmp_path / "a.png")
    assert found == 3
    assert words in said
    assert len(said.strip().splitlines()) == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["blocks.msh", "fake"]


SLEEP = "import os, pathlib, sys, time; pathlib.Path({!r}).write_text(str(os.getpid())); time.sleep(600)"


def alive(pid):
    """True if a process runs; a zombie does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_drawing_that_takes_too_long(tmp_path, monkeypatch):
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-c", "import numpy"], check=True)
    enough = 4 + 10 * (time.perf_counter() - begin)  # for a child to begin to draw, as busy as the machine is
    pid = tmp_path / "pid"
    fake_pyvista(tmp_path, SLEEP.format(str(pid)))
    monkeypatch.syspath_prepend(str(tmp_path / "fake"))
    with pytest.raises(WriteError, match=f"was not drawn within {enough:g} s"):
        picture(cube(), tmp_path / "a.png", timeout=enough)
    assert not alive(pid.read_text())
    assert not (tmp_path / "a.png").exists()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interruption_ends_the_drawing_too(number, code, blocks, tmp_path):
    pid, scratch = tmp_path / "pid", tmp_path / "scratch"
    scratch.mkdir()
    env = {**fake_pyvista(tmp_path, SLEEP.format(str(pid))), "TMPDIR": str(scratch)}
    command = [sys.executable, "-m", "lacmesh", "view", str(blocks), "-o", str(tmp_path / "a.png")]
    with subprocess.Popen(command, env=env, stderr=subprocess.PIPE, text=True, start_new_session=True) as running:
        for _ in range(6000):
            if pid.exists() and pid.read_text():
                break
            time.sleep(0.05)
        running.send_signal(number)
        said = running.stderr.read()
    assert running.returncode == code
    assert "nothing was written" in said
    assert len(said.strip().splitlines()) == 1
    assert not alive(pid.read_text())
    assert not list(scratch.iterdir())
    assert not (tmp_path / "a.png").exists()


def test_a_picture_into_a_folder_that_is_not_there(tmp_path, monkeypatch):
    monkeypatch.setattr(png, "find_spec", lambda name: True)
    monkeypatch.setattr(png, "render", lambda *arguments, **options: [b"image"])
    with pytest.raises(WriteError, match="nowhere"):
        picture(cube(), tmp_path / "nowhere" / "a.png")
    with pytest.raises(RequestError, match="is written as"):
        picture(cube(), tmp_path / "a.jpg")
    with pytest.raises(RequestError, match="is written as"):
        page(cube(), tmp_path / "a.png")


def test_a_gap_that_moves_nothing_is_told(tmp_path, capsys):
    """Picture or page: the file is the same as without the gap."""
    mesh, single = tmp_path / "blocks.msh", tmp_path / "cube.msh"
    lacmesh.write(mesh, two_cubes())
    lacmesh.write(single, cube())
    for path, slave, says in (
        (mesh, [], "explode 0.5 moves nothing: only bodies that carry a slave skin are moved, and none is shown"),
        (single, ["--slave", "slave"], "explode 0.5 moves nothing: no other body is in sight"),
    ):
        code, said = status(capsys, path, *slave, "-o", tmp_path / "a.html", "--explode", 0.5, "--force")
        assert code == 0 and says in said
    for gap in ("0", "0.5"):
        code, said = status(capsys, mesh, "--slave", "slave", "-o", tmp_path / "a.html", "--explode", gap, "--force")
        assert code == 0 and "moves nothing" not in said
