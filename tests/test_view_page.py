"""Pages of `lacmesh view`: what they hold, and what a browser shows and answers."""

from __future__ import annotations

import base64
import json
import re
import zlib
from dataclasses import replace

import numpy as np
import pytest

from lacmesh import Mesh, cut_skin
from lacmesh.cells import CELLS
from lacmesh.scene.visible import BODY, MASTER, SLAVE
from lacmesh.topology.skin import FACE_TYPES
from lacmesh.view import page
from tests.meshes import box, random_mesh
from tests.test_view import Said, two_cubes
from tests.viewing import Browser, cut_blocks, status

#: names that would be markup, script or a mark of the template if they were not text
NASTY = (
    "</script><script>document.title='owned'</script>",
    "<img src=x onerror=alert(1)>",
    "%BLOCK% & %HEAD%",
    "a\"b'c\\",
)


def unpacked(path):
    """Contents of a page: its head, and its arrays."""
    text = path.read_text(encoding="utf-8")
    head = json.loads(re.search(r'id="head">(.*?)</script>', text, re.S)[1])
    block = zlib.decompress(base64.b64decode(re.search(r'id="block">(.*?)</script>', text, re.S)[1]))
    arrays = {
        name: np.frombuffer(block, np.dtype(kind).newbyteorder("<"), count, start)
        for name, (kind, start, count) in head["arrays"].items()
    }
    return head, arrays


@pytest.mark.filterwarnings("ignore:slave faces stand twice")
@pytest.mark.parametrize(("dim", "order"), [(2, 1), (2, 2), (3, 1), (3, 2), (3, 3)])
@pytest.mark.parametrize("seed", range(3))
def test_a_page_holds_the_faces_with_their_numbers_and_groups(dim, order, seed, tmp_path):
    mesh = random_mesh(np.random.default_rng(seed), dim, order, slaves=6, twins=True)
    mesh = cut_skin(mesh, "slave").mesh
    mesh = replace(mesh, cell_number=mesh.cell_number + 2**40 * (seed == 0))  # beyond four bytes
    page(mesh, tmp_path / "a.html")
    head, arrays = unpacked(tmp_path / "a.html")
    cell_of, node_of = ({int(n): k for k, n in enumerate(numbers)} for numbers in (mesh.cell_number, mesh.node_number))
    on_face = {}
    for name, ids, nodes in mesh.select(np.flatnonzero((mesh.cell_dim < mesh.dim) & (mesh.cell_dim > 0))):
        for cell, row in zip(ids, nodes, strict=True):
            on_face.setdefault(frozenset(row[: CELLS[name].n_corners].tolist()), []).append(cell)
    start = 0
    assert len(arrays["role"]) == len(arrays["cell"]) > 0
    for f, code in enumerate(arrays["type"]):
        face = CELLS[FACE_TYPES[code]]
        own = arrays["nodes"][start : start + face.n_nodes]
        start += face.n_nodes
        nodes = [node_of[int(n)] for n in arrays["nodeNumber"][own]]
        cell = cell_of[int(arrays["cell"][f])]
        ((kind, _, _),) = mesh.select([cell])
        assert head["cellTypes"][arrays["cellType"][f]] == kind
        members = {cell, *on_face.get(frozenset(nodes[: face.n_corners]), [])}
        groups = {g for g, ids in mesh.cell_groups.items() if members & set(ids.tolist())}
        assert {head["groups"][g]["name"] for g in head["combinations"][arrays["groups"][f]]} == groups
        assert (arrays["role"][f] == SLAVE) == (arrays["skin"][f] >= 0)
        kept = np.array(head["centre"]) + head["half"] * arrays["points"].reshape(-1, 3)[own]
        np.testing.assert_allclose(kept, mesh.points[nodes], atol=1e-6 * head["half"])
    assert start == len(arrays["nodes"])
    internal = mesh.node_number[mesh.node_data["lac_internal"] >= 0]
    assert sorted(arrays["nodeNumber"][arrays["internal"]]) == sorted(internal)


def nasty():
    mesh = two_cubes()
    return Mesh.create(
        mesh.points,
        [(b.type, b.nodes) for b in mesh.blocks],
        cell_groups={**mesh.cell_groups, **{name: [k] for k, name in enumerate(NASTY)}},
    )


def test_a_page_is_whole_and_names_stay_text(tmp_path):
    target = tmp_path / "a.html"
    page(nasty(), target, slave="slave", findings=[Said("error", NASTY[0], cells=(1,))], title=NASTY[1] + "\udcff")
    text = target.read_text(encoding="utf-8")
    assert not re.search(r"""(?:src|href)\s*=\s*["'](?!data:)|@import|url\(""", text)
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", text)
    assert text.count("<script") == text.count("</script>") == 3
    assert "<img" not in text
    head, _ = unpacked(target)
    assert [g["name"] for g in head["groups"]][-len(NASTY) :] == list(NASTY)
    assert head["findings"][0]["message"] == NASTY[0]
    assert "connect-src" not in text
    assert "default-src 'none'" in text


def test_a_large_mesh_makes_a_small_page(tmp_path):
    points, hexahedra = box(70)
    page(Mesh.create(points, [("HEXA8", hexahedra)]), tmp_path / "a.html")
    assert (tmp_path / "a.html").stat().st_size < 3e6
    assert len(unpacked(tmp_path / "a.html")[1]["role"]) == 6 * 70**2


# pages, in a browser


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """A browser, started once."""
    started = Browser(tmp_path_factory.mktemp("browser"))
    yield started
    started.close()


def button(browser, text):
    """Press the button with some words on it."""
    found = f"[...document.querySelectorAll('aside button')].find(b => b.textContent.startsWith({text!r}))"
    browser.value(f"{found}.click()")


@pytest.mark.browser
def test_a_page_draws_every_face(tmp_path, capsys, browser):
    target = tmp_path / "blocks.html"
    assert status(capsys, cut_blocks(tmp_path), "--master", "master", "--quality", "-o", target)[0] == 0
    browser.open(target)
    _, arrays = unpacked(target)
    bodies, skins = (int(np.isin(arrays["role"], roles).sum()) for roles in ([BODY], [SLAVE, MASTER]))
    assert (browser.data("state"), browser.data("glError")) == ("ready", "0")
    assert int(browser.data("faces")) == bodies + skins > 600
    assert browser.value("document.title") == "blocks.msh"
    panel = browser.value("document.getElementById('panel').innerText")
    assert "36 macro-elements" in panel and "corner jacobian" in panel
    button(browser, "hidden")
    assert int(browser.data("faces")) == skins > 0
    button(browser, "solid")
    worst = browser.value("document.querySelector('#worst button').textContent")
    assert worst.startswith(f"cell {arrays['cell'][np.flatnonzero(arrays['of'] == 0)[0]]}")
    button(browser, worst[:8])
    assert int(browser.data("faces")) == bodies + skins + int((arrays["of"] == 0).sum())
    assert browser.said == []


@pytest.mark.browser
def test_a_click_tells_the_numbers_of_the_file(tmp_path, browser):
    """The middle of a 3 x 3 x 3 cube seen from above is the top of its middle column."""
    points, hexahedra = box(3)
    numbers = 7000 + 11 * np.arange(27)
    mesh = Mesh.create(
        points, [("HEXA8", hexahedra)], cell_number=numbers, cell_groups={"core": np.arange(27), "rest": [0]}
    )
    page(mesh, tmp_path / "a.html")
    browser.open(tmp_path / "a.html", "eye=0,0,1")
    middle = browser.value("(c => [c.clientWidth / 2, c.clientHeight / 2])(document.getElementById('canvas'))")

    def click_on(centre, corners):
        browser.click(*middle)
        browser.wait("!document.getElementById('details').hidden")
        lines = browser.value("[...document.querySelectorAll('#detail > div')].map(e => e.textContent)")
        nodes = browser.value("[...document.querySelectorAll('#detail td:first-child')].map(e => +e.textContent)")
        cell = np.linalg.norm(points[hexahedra].mean(axis=1) - centre, axis=1).argmin()
        assert lines == [f"cell {numbers[cell]}, HEXA8", "group core"]
        near = np.linalg.norm(points - corners, axis=1) < 0.3
        assert set(nodes) == set((np.flatnonzero(near) + 1).tolist())
        assert browser.value("document.getElementById('tip').hidden") is False
        browser.value("document.getElementById('close').click()")

    click_on([0.5, 0.5, 5 / 6], [0.5, 0.5, 1])
    browser.drag(middle, [middle[0], middle[1] - 600])  # turned over: the other way round, seen from below
    click_on([0.5, 0.5, 1 / 6], [0.5, 0.5, 0])
    browser.click(20, 20)
    browser.wait("document.getElementById('details').hidden")
    assert browser.said == []


@pytest.mark.browser
def test_names_are_not_run(tmp_path, browser):
    page(nasty(), tmp_path / "a.html", slave="slave", findings=[Said("error", NASTY[0], cells=(1,))], title="safe")
    browser.open(tmp_path / "a.html", "open=0&eye=0,0,-1&bodies=hidden")
    button(browser, NASTY[0])
    assert browser.value("document.title") == "safe"
    assert browser.value("document.querySelectorAll('img, aside script').length") == 0
    names = browser.value("[...document.querySelectorAll('#groups li span')].map(e => e.textContent)")
    assert names[-len(NASTY) :] == list(NASTY)
    assert browser.said == []


@pytest.mark.browser
def test_without_webgl_the_page_says_so(tmp_path):
    page(two_cubes(), tmp_path / "a.html", slave="slave")
    browser = Browser(tmp_path / "browser", flags=("--disable-3d-apis",))
    try:
        browser.open(tmp_path / "a.html")
        assert browser.data("state") == "failed"
        assert "This browser has no WebGL 2" in browser.value("document.body.innerText")
        assert "slave" in browser.value("document.getElementById('groups').innerText")
    finally:
        browser.close()
