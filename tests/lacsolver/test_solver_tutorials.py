"""The tutorials of lacsolver: scripts that run, pages that tell them word for word, and figures that are true."""

from __future__ import annotations

import importlib.util
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from tests.test_tutorials import TUTORIALS, pictures_of, shows_what_the_page_shows, size_of

ROOT = Path(__file__).resolve().parents[2]
PAGES = ("p0_mortar", "own_solver")


def loaded(name, path):
    """A script of the tutorials, as a module."""
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    finally:
        del sys.modules[name]
    return module


@pytest.fixture(scope="module")
def tutorials():
    return loaded("tutorials_run", TUTORIALS / "run.py")


@pytest.fixture(scope="module")
def p0_mortar():
    return loaded("p0_mortar", TUTORIALS / "p0_mortar.py")


@pytest.fixture(scope="module")
def own_solver():
    return loaded("own_solver", TUTORIALS / "own_solver.py")


@pytest.fixture(scope="module", params=[pytest.param("p0_mortar", marks=pytest.mark.slow), "own_solver"])
def page(request, tutorials, tmp_path_factory):
    """A page's name, the folder in which its commands have run, and what each printed."""
    folder = tmp_path_factory.mktemp(request.param)
    for name in (f"docs/tutorials/{request.param}.py", "data/disc_on_block.msh"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    return request.param, folder, list(tutorials.run_page(TUTORIALS / f"{request.param}.md", folder))


def shades(path):
    """Number of pixels of a picture that are neither white nor grey."""
    import matplotlib.image

    pixels = matplotlib.image.imread(path)[..., :3]
    return int((np.ptp(pixels, axis=2) > 0.2).sum())


# ---- the pages


def test_the_commands_print_what_the_page_shows(page):
    _, _, done = page
    assert len(done) == 1 and done[0][0].shown and shows_what_the_page_shows(done)


def test_the_picture_is_made_again(page):
    name, folder, _ = page
    (picture,) = pictures_of(TUTORIALS / f"{name}.md")
    assert size_of(folder / picture) == size_of(TUTORIALS / picture) and size_of(folder / picture)[0] >= 1000
    coloured = shades(folder / picture), shades(TUTORIALS / picture)
    assert min(coloured) > 2000 and max(coloured) < 1.05 * min(coloured)


@pytest.mark.parametrize("name", PAGES)
def test_the_page_is_the_script(tutorials, name):
    """All of the script, in its order, word for word, but for its first line."""
    whole = (TUTORIALS / f"{name}.py").read_text(encoding="utf-8").partition('"""\n\n')[2]
    told = "".join(tutorials.blocks(TUTORIALS / f"{name}.md", "python"))
    assert [line for line in told.splitlines() if line] == [line for line in whole.splitlines() if line]


@pytest.mark.parametrize("name", PAGES)
def test_links_lead_somewhere(name):
    text = (TUTORIALS / f"{name}.md").read_text(encoding="utf-8")
    for target, anchor in re.findall(r"\]\(([^)#\s]+)(?:#([^)]+))?\)", text):
        there = (TUTORIALS / target).resolve()
        assert there.is_file(), target
        if anchor:
            headings = re.findall(r"^#+ +(.+)$", there.read_text(encoding="utf-8"), re.MULTILINE)
            assert anchor in {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}, target


# ---- the P0 mortar


def turns(p):
    return int((np.diff(np.sign(np.diff(p))) != 0).sum())


@pytest.mark.parametrize("n", [25, 49])
def test_faces_oscillate_and_macro_elements_do_not(p0_mortar, n):
    uncut = p0_mortar.pad(n)
    cut = lacmesh.cut_skin(uncut, "slave").mesh
    p, smooth = p0_mortar.pressures(uncut, p0_mortar.p0_mortar), p0_mortar.pressures(cut, p0_mortar.lac)
    assert turns(smooth) == 1 and turns(p) >= n - 3
    away = np.abs(p - smooth)[1:-1] / smooth.max()
    assert np.median(away) > 0.15
    assert p.sum() == pytest.approx(smooth.sum(), rel=0.04)


def test_the_inf_sup_constant_is_zero_uncut_and_that_of_no_mesh_cut(p0_mortar):
    """The hypothesis, seen: theory.md and p0_mortar.md say so."""
    uncut, cut = [], []
    for n in (9, 25, 49):
        mesh = p0_mortar.pad(n)
        uncut.append(p0_mortar.inf_sup(mesh, p0_mortar.p0_mortar))
        cut.append(p0_mortar.inf_sup(lacmesh.cut_skin(mesh, "slave").mesh, p0_mortar.lac))
    uncut, cut = np.array(uncut), np.array(cut)
    assert uncut[:, 0].max() < 1e-6
    assert (uncut[1:, 1] < 0.6 * uncut[:-1, 1]).all()
    assert cut.min() > 0.57 and np.ptp(cut[:, 0]) < 0.01


def test_the_alternating_pressure_moves_nothing_on_the_uncut_mesh_only(p0_mortar):
    mesh = p0_mortar.pad(25)
    z = (-1.0) ** np.arange(25)
    felt = []
    for at, stage in ((mesh, p0_mortar.p0_mortar), (lacmesh.cut_skin(mesh, "slave").mesh, p0_mortar.lac)):
        B, _, w = stage(at)
        T = p0_mortar.held(at).problem.constraints.T
        felt.append(np.abs(T.T @ (B.T @ z)).max() / w.max())
    assert felt[0] < 1e-14 and felt[1] > 0.1


def test_no_solution_has_every_face_closed(p0_mortar):
    """The gaps' sum with alternating signs is not zero, no displacement changes it, and faces open at both ends."""
    mesh = p0_mortar.pad(25)
    _, G, _ = p0_mortar.p0_mortar(mesh)
    assert abs(G @ (-1.0) ** np.arange(25)) > 1e-5 * np.abs(G).sum()
    opened = np.flatnonzero(p0_mortar.pressures(mesh, p0_mortar.p0_mortar) == 0)
    assert len(opened) == 2 and opened[0] < 3 and opened[1] > 21


def test_no_equilibrium_is_an_error(p0_mortar, monkeypatch):
    tolerance = p0_mortar.ConvergenceTolerance
    few = lambda max_iterations, **rest: tolerance(max_iterations=1, **rest)  # noqa: E731
    monkeypatch.setattr(p0_mortar, "ConvergenceTolerance", few)
    with pytest.raises(RuntimeError, match=r"no equilibrium: forces are off by .*, gaps by .* of the displacement"):
        p0_mortar.pressures(p0_mortar.pad(25), p0_mortar.p0_mortar)


def test_with_free_flanks_the_constant_falls_but_is_not_zero(p0_mortar, monkeypatch):
    case = p0_mortar.Case
    monkeypatch.setattr(p0_mortar, "Case", lambda displacement, **rest: case(displacement=displacement[:1], **rest))
    least = np.array([p0_mortar.inf_sup(p0_mortar.pad(n), p0_mortar.p0_mortar)[0] for n in (9, 25, 49)])
    assert least.min() > 1e-3 and (least[1:] < 0.6 * least[:-1]).all()
    cut = lacmesh.cut_skin(p0_mortar.pad(25), "slave").mesh
    assert p0_mortar.inf_sup(cut, p0_mortar.lac)[0] > 0.5


# ---- the own solver


def test_both_solvers_agree(own_solver):
    path = ROOT / "data" / "disc_on_block.msh"
    pair, found = own_solver.solve(path)
    case = ls.Case(
        model="plane_strain",
        material=[ls.Material(young=own_solver.YOUNG, poisson=own_solver.POISSON)],
        contact=[ls.Contact(slave="slave", master="master")],
        displacement=[
            ls.Displacement(group="bottom", ux=0.0, uy=0.0),
            ls.Displacement(group="symmetry_x", ux=0.0),
            ls.Displacement(group="top", uy=-own_solver.PRESSED),
        ],
    )
    reference = ls.solve(case, path)
    contact = reference.contact["slave"]
    assert np.abs(found.u - reference.u.ravel()).max() < 1e-9 * np.abs(reference.u).max()
    assert np.abs(found.pressure - contact.pressure).max() < 1e-9 * contact.pressure.max()
    assert 3 < found.status.sum() < (pair.coverage > 0.5).sum() < len(found.status)


def test_it_has_forty_lines(own_solver):
    """Without the picture, blank lines and docstrings."""
    text = (TUTORIALS / "own_solver.py").read_text(encoding="utf-8")
    draw = text[text.index("def draw(") : text.index("def main(")]
    lines = [
        line for line in text.replace(draw, "").splitlines() if line.strip() and not line.strip().startswith('"""')
    ]
    assert len(lines) <= 45
