"""The files that are spoilt: small ones of each format, with something in every part that the format has."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import lacmesh
from lacmesh import Mesh, cut_skin
from lacmesh.errors import WriteError
from lacmesh.formats.med.types import MED_TYPES
from lacmesh.mesh import Model, Periodic, Step
from tests.bad_input import raw
from tests.bad_input.mesh_cases import WRITERS
from tests.bad_input.raw import two_hexahedra, write_old
from tests.formats import texts
from tests.formats.decks import pressed, two
from tests.meshes import cell_with_faces, random_mesh


class Seed(NamedTuple):
    """A mesh in one file or several: the name of the first, and the contents of all."""

    main: str
    files: dict[str, bytes]


class Format(NamedTuple):
    """The suffix of a format, the ways in which `lacmesh.write` makes it, and whether it is text."""

    suffix: str
    options: tuple[dict[str, Any], ...] = ({},)
    text: bool = True


_PACKED: tuple[dict[str, Any], ...] = ({"binary": False}, {}, {"compress": True})
FORMATS = {
    "msh 2.2 ASCII": Format(".msh", ({"msh": "2.2", "binary": False},)),
    "msh 2.2 binary": Format(".msh", ({"msh": "2.2"},), text=False),
    "msh 4.1 ASCII": Format(".msh", ({"msh": "4.1", "binary": False},)),
    "msh 4.1 binary": Format(".msh", ({"msh": "4.1"},), text=False),
    "MED": Format(".med", text=False),
    "mail": Format(".mail"),
    "inp": Format(".inp", ({"target": "abaqus"},)),
    "inp deck": Format(".inp", ()),
    "vtu": Format(".vtu", _PACKED),
    "xdmf": Format(".xdmf", _PACKED),
}


@cache
def meshes() -> tuple[Mesh, ...]:
    """A cut, mixtures of cells in space and in the plane, and a mesh with all that a mesh may have."""
    rng = np.random.default_rng
    return (
        cut_skin(cell_with_faces("HEXA8", (0, 5)), "slave").mesh,
        random_mesh(rng(1), 3),
        random_mesh(rng(2), 2, order=2),
        _everything(),
    )


def _everything() -> Mesh:
    rng = np.random.default_rng(3)
    periodic = Periodic((2, 1), (2, 2), tuple(np.eye(4).ravel()), np.array([[0, 1]]))
    return Mesh.create(
        rng.normal(size=(12, 3)),
        [("TETRA4", rng.permutation(12).reshape(3, 4)), ("TRIA3", [[0, 1, 2], [3, 4, 5]]), ("POI1", [[3]])],
        cell_groups={"slave": [3], "all": [0, 1, 2], "both": [2, 4], "empty": [], "2:9": [4]},
        node_groups={"nodes": [0, 3, 4]},
        cell_data={"T": rng.normal(size=6), "entity": np.array([[3, 1]] * 3 + [[2, 1]] * 2 + [[0, 1]], np.int32)},
        node_data={"U": rng.normal(size=(12, 3)), "V@0": np.arange(12.0), "V@1": np.arange(12.0)},
        steps={"V@0": Step("V", 0, -1, 0.0), "V@1": Step("V", 1, -1, 0.5)},
        file_order=rng.permutation(6),
        group_tags={"all": ((3, 4),), "2:9": ((2, 9),)},
        model=Model({(3, 1): (1, -2), (2, 1): ()}, (periodic,)),
        zones=("z",),
    )


@cache
def seeds(name: str) -> tuple[Seed, ...]:
    """The files of a format."""
    form = FORMATS[name]
    found = list(_by_hand(name))
    for mesh in meshes():
        for options in form.options:
            with warnings.catch_warnings(), tempfile.TemporaryDirectory() as folder:
                warnings.simplefilter("ignore", lacmesh.LacmeshWarning)
                path = Path(folder, f"in{form.suffix}")
                with suppress(WriteError):  # cells that the format lacks
                    lacmesh.write(path, mesh, **options)
                    found.append(Seed(path.name, {p.name: p.read_bytes() for p in sorted(Path(folder).iterdir())}))
    return tuple(found)


def _by_hand(name: str) -> Iterator[Seed]:
    """Files that lacmesh's own writers would not make."""
    main = f"in{FORMATS[name].suffix}"
    if name == "MED":
        for version in ((2, 3, 6), (3, 0, 0)):
            yield Seed(main, {main: raw.med(two_hexahedra(), version)})
        yield Seed(main, {main: _old()})
        return
    if name == "inp deck":
        for element in ("C3D8I", "C3D10", "CPE4"):
            yield Seed(main, {main: pressed(element).encode()})
        yield Seed(main, {main: texts.DECK.encode(), "more.inp": texts.INCLUDED.encode()})
        yield Seed(main, {main: two().encode()})
        return
    yield Seed(main, {main: WRITERS[name](two_hexahedra())})
    if name == "inp":
        yield Seed(main, {main: texts.INP.encode(), "more.inp": texts.MORE.encode()})
    if name == "mail":
        yield Seed(main, {main: texts.MAIL.replace("COIN", "c\xf4t\xe9").encode("latin-1")})


def _old() -> bytes:
    """MED 2.3 with fields and families in the mesh."""
    rng = np.random.default_rng(0)
    mesh = random_mesh(rng, 3)
    mesh = replace(mesh, cell_data={"T": rng.random(mesh.n_cells)}, node_data={"U": rng.random(mesh.n_nodes)})
    mesh = replace(mesh, name="mesh", node_groups={"some": np.arange(3)})
    types = {kind.type: (kind.name, list(kind.nodes)) for kind in MED_TYPES}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "old.med")
        write_old(path, mesh, types, faces=("TRIA3", "QUAD4"))
        return path.read_bytes()
