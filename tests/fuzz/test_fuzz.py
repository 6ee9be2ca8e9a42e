"""Files that are spoilt, small ones of each format with something in every part; each is read, and looked through.

An error of lacmesh is an answer, every other exception a failure.
"""

from __future__ import annotations

import json
import random
import re
import sys
import tempfile
import warnings
from contextlib import nullcontext, suppress
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import lacmesh
from lacmesh import LacmeshError, Mesh, cut_skin
from lacmesh.checks import check
from lacmesh.errors import WriteError
from lacmesh.formats.orders import MED_CELLS
from lacmesh.mesh import Model, Periodic, Step
from lacmesh.quality import measure_quality
from lacmesh.report import describe
from lacmesh.view import picture
from tests.bad_input import raw
from tests.bad_input.case import BYTES, SECONDS, alarm, room
from tests.bad_input.mesh_cases import WRITERS
from tests.bad_input.raw import two_hexahedra, write_old
from tests.formats import texts
from tests.formats.decks import pressed, two
from tests.fuzz import mutate
from tests.meshes import cell_with_faces, random_mesh
from tests.samples import each_option, samples


class Seed(NamedTuple):
    """A mesh in one file or several: the name of the first, and the contents of all."""

    main: str
    files: dict[str, bytes]


class Format(NamedTuple):
    """The suffix of a format, the ways in which `lacmesh.write` makes it, and whether it is text."""

    suffix: str
    options: tuple[dict[str, Any], ...] = ({},)
    text: bool = True


_PACKED = ({"binary": False}, {}, {"compress": True})
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
def meshes():
    """A cut, mixtures of cells in space and in the plane, and a mesh with all that a mesh may have."""
    rng = np.random.default_rng
    return (
        cut_skin(cell_with_faces("HEXA8", (0, 5)), "slave").mesh,
        random_mesh(rng(1), 3),
        random_mesh(rng(2), 2, order=2),
        _everything(),
    )


def _everything():
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
def seeds(name):
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


def _by_hand(name):
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


def _old():
    """MED 2.3 with fields and families in the mesh."""
    rng = np.random.default_rng(0)
    mesh = random_mesh(rng, 3)
    mesh = replace(mesh, cell_data={"T": rng.random(mesh.n_cells)}, node_data={"U": rng.random(mesh.n_nodes)})
    mesh = replace(mesh, name="mesh", node_groups={"some": np.arange(3)})
    types = {kind.type: (kind.name, list(kind.nodes)) for kind in MED_CELLS.values()}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "old.med")
        write_old(path, mesh, types, faces=("TRIA3", "QUAD4"))
        return path.read_bytes()


#: suffixes of the formats that lacmesh writes itself
OWN = (".msh", ".med", ".mail", ".inp", ".vtu", ".xdmf")
READ, REFUSED = "read", "refused"


def spoilt(name, number):
    """The spoilt file of that number; always the same."""
    rng = random.Random(f"{name}: {number}")
    seed = rng.choice(seeds(name))
    files = dict(seed.files)
    file = rng.choice([*files, seed.main])
    hdf5 = files[file].startswith(b"\x89HDF")
    if hdf5 and rng.random() < 0.6:
        files[file] = mutate.mutated_hdf5(rng, files[file])
    else:
        others = [other.files.get(file, b"\n") for other in seeds(name)]
        files[file] = mutate.mutated(rng, files[file], others, FORMATS[name].text and not hdf5)
    return Seed(seed.main, files)


def tried(seed, folder, commands=False):
    """Write and read a file in a folder, and do with the mesh what commands do; READ or REFUSED, all else raises."""
    for old in folder.iterdir():
        old.unlink()
    for file, content in seed.files.items():
        (folder / file).write_bytes(content)
    unraised, path = [], folder / seed.main
    before, sys.unraisablehook = sys.unraisablehook, lambda args: unraised.append(repr(args.exc_value))
    try:
        with warnings.catch_warnings(), alarm(SECONDS):
            warnings.simplefilter("ignore")
            mesh = allowed(lacmesh.read, path)
            if mesh is not None:
                consistent(mesh)
                if commands:
                    commanded(mesh, path)
    finally:
        sys.unraisablehook = before
    assert not unraised, "an exception in the background"
    return REFUSED if mesh is None else READ


def allowed(work, *given, **options):
    """Do what may be refused in a sentence: the result, or None. A lack of memory is no answer."""
    try:
        return work(*given, **options)
    except LacmeshError as error:
        behind = error
        while behind is not None:
            assert not isinstance(behind, MemoryError)
            behind = behind.__cause__ or behind.__context__
        assert str(error).strip() and len(str(error)) < 2000
        return None


def commanded(mesh, path):
    json.dumps(describe(mesh), allow_nan=False)
    json.dumps(measure_quality(mesh).as_json(), allow_nan=False)
    out = path.with_name("cut.inp")
    for group in list(mesh.cell_groups)[:2]:
        allowed(cut_skin, mesh, group)
        found = allowed(check, mesh, group)
        assert found is None or not found.of_rule("not-checked")
        json.dumps(found and found.as_dict(), allow_nan=False)
        cut = mesh.deck and allowed(cut_skin, mesh, group, hexa="hexa")
        if cut:
            allowed(lacmesh.write, out, cut.mesh, lenient=True)
        if out.exists():
            assert lacmesh.read(out).n_nodes == cut.mesh.n_nodes, "a deck that was cut and written"
            out.unlink()
    allowed(partial(picture, size=(64, 48)), mesh, path.with_name("out.png"))
    for suffix in OWN:
        allowed(lacmesh.write, path.with_name(f"out{suffix}"), mesh)


def consistent(mesh):
    """Raise where the parts of a mesh do not fit together."""
    n, k = mesh.n_nodes, mesh.n_cells
    assert mesh.points.shape == (n, 3) and mesh.points.dtype == float and bool(np.isfinite(mesh.points).all()), "points"
    assert mesh.space_dim in (1, 2, 3), "space_dim"
    for block in mesh.blocks:
        assert block.nodes.dtype.kind in "iu" and block.nodes.ndim == 2, f"nodes of {block.type}"
        assert not block.nodes.size or (block.nodes.min() >= 0 and block.nodes.max() < n), f"nodes of {block.type}"
    for numbers, size in ((mesh.node_number, n), (mesh.cell_number, k)):
        assert numbers.shape == (size,) and numbers.dtype.kind in "iu" and len(np.unique(numbers)) == size, "numbers"
    if mesh.file_order is not None:
        assert np.array_equal(np.sort(mesh.file_order), np.arange(k)), "file_order"
    for groups, size in ((mesh.cell_groups, k), (mesh.node_groups, n)):
        for name, members in groups.items():
            assert isinstance(name, str) and members.dtype.kind in "iu", f"group {name!r}"
            assert not len(members) or (members[0] >= 0 and members[-1] < size), f"group {name!r}"
            assert bool((np.diff(members) > 0).all()), f"group {name!r}"
    for data, size in ((mesh.cell_data, k), (mesh.node_data, n)):
        for key, values in data.items():
            assert isinstance(key, str) and len(values) == size and values.dtype.kind in "iuf", f"data {key!r}"
    assert set(mesh.steps) <= {*mesh.cell_data, *mesh.node_data}, "steps"
    assert set(mesh.group_tags) <= set(mesh.cell_groups), "group_tags"
    for tags in mesh.group_tags.values():
        assert all(isinstance(x, int) for tag in tags for x in tag) and all(len(tag) == 2 for tag in tags), "group_tags"
    assert all(isinstance(zone, str) for zone in mesh.zones), "zones"
    for link in mesh.model.periodic if mesh.model else ():
        nodes = np.asarray(link.nodes)
        assert nodes.shape == (len(nodes), 2) and (not nodes.size or (nodes.min() >= 0 and nodes.max() < n)), "periodic"


# ---- the tests: 10,000 files of each format by `make verify FUZZ=1`, and a thin slice in every run

#: files of each format that commands try, in parts of as many, and those that are read alone, from another number on
PARTS, FILES = samples(1, 20), samples(16, 500)
FIRST, ALONE = 24, samples(60, 1000)
SPOILT = [(True, part * FILES, FILES) for part in range(PARTS)] + [(False, FIRST, ALONE)]
TRIES = [(name, *spoilt) for name in FORMATS for spoilt in SPOILT]


def tried_alone(row):
    """Option of a try: the format that is read alone; commands take files of any, of HDF5 or not."""
    name, commands, *_ = row
    return [FORMATS[name].suffix in (".med", ".xdmf") if commands else name]


@pytest.mark.fuzz
@pytest.mark.parametrize(("name", "commands", "first", "n"), each_option(TRIES, of=tried_alone))
def test_spoilt_files_are_sound_meshes_or_refused(name, commands, first, n, tmp_path):
    """Within limits of time and memory; the number of a file that fails is that of the last try."""
    tried(seeds(name)[0], tmp_path, commands)  # which loads what may need to be compiled
    with room(BYTES) if commands else nullcontext():
        outcomes = [tried(spoilt(name, number), tmp_path, commands) for number in range(first, first + n)]
    assert outcomes.count(READ) > n / 30 and outcomes.count(REFUSED) > n / (4 if commands else 30)


def may_end(name, content):
    """True if a file of the format may be whole: `inp` after any line, msh after a section, .mail after FIN."""
    ends = {"inp": rb"", "msh": rb"\$End\w+\s*\Z|\A\s*\Z", "mail": rb"(?m)^\s*FIN\b"}
    end = ends.get(name.split()[0])
    return end is not None and re.search(end, content) is not None


@pytest.mark.fuzz
@pytest.mark.parametrize("name", FORMATS)
def test_a_file_that_ends_too_early_is_refused(name, tmp_path):
    rng = random.Random(name)
    for seed in seeds(name):
        for file, content in seed.files.items():
            # a VTU file has all its arrays before its last tags
            tail = re.search(rb"\s*(</AppendedData>\s*)?(</VTKFile>)?\s*\Z", content)
            for n in rng.sample(range(tail.start() - 1), samples(12, 200)):
                outcome = tried(seed._replace(files={**seed.files, file: content[:n]}), tmp_path)
                assert outcome == REFUSED or may_end(name, content[:n]), (file, n)
