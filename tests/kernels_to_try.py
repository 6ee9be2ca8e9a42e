"""Small pieces of work that between them call every kernel there is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

import lacmesh
from lacmesh.formats.msh import version2
from lacmesh.generate import box
from lacmesh.surface import contact_points
from lacmesh.topology.boxes import meeting_each_other
from lacsolver.bodies.mass import KINDS, assemble_mass
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.case import Material, Temperature
from lacsolver.cli import main
from lacsolver.contact import Pairing, Zone, integrate
from lacsolver.contact.tangent import motion_of, tangent
from lacsolver.equilibrium.stepping import march
from lacsolver.linear import analyse
from lacsolver.linear.multigrid.cycle import Team
from lacsolver.problem.problem import Problem
from lacsolver.results.fields import state_fields
from lacsolver.saddle.node_blocks import with_held
from lacsolver.space.space import Space
from tests.lacsolver.bodies import cube
from tests.lacsolver.patch_meshes import stack
from tests.lacsolver.systems import above, rigid_modes, stiffness
from tests.problems import case_of, contact, fix, move
from tests.surface.surfaces import sheet, whole

DATA = Path(__file__).parent.parent / "data"


def work(folder: Path) -> Iterator[tuple[str, Callable[[], object]]]:
    """Work by its name, with a folder for its files. Each takes seconds where kernels run as they stand."""
    yield "formats", _formats
    for name in ("two_blocks", "sliding/ironing_2d"):
        yield f"check of {name}", partial(lacmesh.check, lacmesh.read(DATA / f"{name}.msh"), ["slave"], ["master"])
    yield "surfaces", _surfaces
    yield "stars", partial(lacmesh.cut_skin, box((6, 5, 1), kind="TETRA4"), "top", macro="stars")
    yield "multigrid", _multigrid
    yield "two blocks", lambda: main(["run", str(DATA / "two_blocks.toml"), "-q", "-o", str(folder / "run")])
    for model, law, cells, poisson, kinematics in _SOLVED:
        yield f"{model}, {law}, {cells}, {kinematics}", partial(_march, model, law, cells, poisson, kinematics)
    yield "mass", _mass
    yield "friction", _friction


#: model, law or none for the linear one, cells, Poisson's ratio, kinematics
_SOLVED = (
    ("3d", "neo_hookean", "HEXA8", 0.3, "finite"),
    ("3d", "saint_venant_kirchhoff", "TETRA4", 0.3, "finite"),
    ("plane_strain", "neo_hookean", "QUAD4", 0.49, "finite"),
    ("plane_strain", "saint_venant_kirchhoff", "QUAD8", 0.3, "finite"),
    ("axisymmetric", "neo_hookean", "QUAD4", 0.3, "finite"),
    ("plane_strain", "plastic", "QUAD4", 0.3, "finite"),
    ("plane_strain", "plastic", "QUAD4", 0.3, "small"),
    ("3d", "", "HEXA20", 0.3, "small"),
    ("plane_stress", "", "QUAD8", 0.3, "small"),
    ("axisymmetric", "", "TRIA3", 0.3, "small"),
)


def _march(model: str, law: str, cells: str, poisson: float, kinematics: str) -> None:
    dim, up = (3, "z") if model == "3d" else (2, "y")
    mesh = stack(cells, cells, dim, counts=(2, 1))
    if dim == 2:
        mesh = replace(mesh, points=mesh.points + np.array([1.0, 0.0, 0.0]))
    own = {"plastic": {"hardening": [[0.5, 0.0]]}, "": {"expansion": 1e-5}}.get(law, {})
    material = Material(young=1000.0, poisson=poisson, law=law or "elastic", **own)
    sides = [fix(f"{a}0", a) for a in "xyz"[: dim - 1] if model != "axisymmetric"]
    records = material, contact(**{"normals": "smoothed"} if law else {}), *([] if law else [Temperature(value=20.0)])
    pressing = *sides, fix("bottom", up), move("top", **{f"u{up}": -0.01})
    case = case_of(mesh, *records, *pressing, model=model, kinematics=kinematics)
    problem = Problem.of(case)
    for state in march(problem):
        state_fields(problem, state)


def _formats() -> None:
    elements = np.array([1, 15, 0, 1]), 1, False, version2.N_NODES, *np.empty((3, 1), np.int64)
    version2.find_elements(*elements)


def _surfaces() -> None:
    below, above = whole(sheet(3, kind="QUAD8")), whole(sheet(4, 0.01, kind="TRIA6", skew=0.3, down=True))
    contact_points(below, above, max_penetration=1.0)
    low = np.random.default_rng(0).random((800, 3))  # so many that they are not compared each with each
    meeting_each_other(low, low + 0.02)


def _mass() -> None:
    space = Space.of(cube("HEXA8", 2), "3d")
    for kind in KINDS:
        assemble_mass(space, Materials.of(space, Elastic(young=1.0, poisson=0.0, density=1.0)), kind)


def _friction() -> None:
    mesh = lacmesh.cut_skin(stack("HEXA8", "TETRA4", 3, counts=(2, 1)), "slave").mesh
    pairing = Pairing(friction=True)
    face = integrate(Zone.of(mesh, "slave", "master"), 3, pairing)
    m = len(face.w)
    tangent(motion_of(face, face.slave, face.master, pairing, 3), np.ones(m), np.ones(2 * m))


def _multigrid() -> None:
    space, K = stiffness(cube("HEXA8", 6), "3d")
    kept = above(space)
    with_held(K.tobsr((3, 3)), kept)
    K = csr_array(K.tocsr()[kept][:, kept])
    factor = analyse(K, backend="multigrid", modes=rigid_modes(space)[kept], block=3).factor(K)
    factor.solve(np.ones(K.shape[0]))
    A, x = np.ones((2, 9)), np.arange(9.0)
    Team(1).subtract(Team(1).dots(A, x), A, x)
