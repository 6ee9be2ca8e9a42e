"""MED (Salome, code_aster), versions 2.3 to 4.2 read, 4.1.1 written, on h5py.

Why our own, measured on the 1778 MED files of code_aster's tests: meshio inverts 3D cells and loses groups, gmsh
loses node groups and orphan nodes, medcoupling aborts the process on a third of damaged files and has no wheel for
macOS and aarch64. Version 4.1.1 is the newest that gmsh reads.

A mesh keeps its name, points, 2 or 3 coordinates, numbers, groups of nodes and cells (empty and overlapping ones too)
and data; descriptions, units and the names of components are dropped silently. MED stores cells by type, and
arrays component by component: all first nodes of the cells, then all second nodes. A group is that of some families:
each node has a family (positive), each cell another (negative), and family 0 is in no group. What MED has no place for
stands in the root group LACMESH, which libmed, medcoupling and gmsh leave alone, and drop when they write.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from lacmesh.errors import LacmeshWarning, ReadError, RequestError, WriteError, did_you_mean
from lacmesh.formats import hdf5
from lacmesh.formats import med_fields as fields
from lacmesh.formats.builder import MeshBuilder
from lacmesh.formats.notes import dump
from lacmesh.formats.orders import MED_CELLS, MED_NOT_READ, FormatCell, blocks_in_order, check_types, is_plane
from lacmesh.indices import by_value, divided, repeated
from lacmesh.mesh import Ints, Mesh, concatenated

_OF_NAME = {cell.name: cell for cell in MED_CELLS.values()}
_BIT = {name: cell.bit for name, cell in _OF_NAME.items()}
#: where a file may keep cells: as cells, or in old files as faces and edges (the first that has a type counts)
_ENTITIES = ("MAI", "FAC", "ARE")
#: parts of a file that no mesh has a place for
_NO_PLACE = {
    "EQS": "equivalences", "JNT": "joints", "NUM_DATA": "parameters", "LIENS": "links to other files",
    "STR": "structure elements", "INTERP": "interpolation functions",
}  # fmt: skip
#: bytes of a group's name
_NAME_SIZE = 80
#: the group and the dataset of lacmesh's notes
_HOME, _NOTES = "LACMESH", "notes"
#: family number: names of its groups
_Families = dict[int, list[str]]


class _Part(NamedTuple):
    """Cells of one type in a file: nodes (k, n) counted from 1, numbers or None, families (k,)."""

    kind: FormatCell
    support: str
    place: str
    nodes: Ints
    number: Ints | None
    family: Ints


# ---- reading


def read(path: Path, mesh: str | None = None) -> Mesh:
    """Read the mesh of a MED file, or the one named `mesh` if it has several.

    Raises ReadError for a file that is damaged or holds what a Mesh cannot (polygons, grids); RequestError for the
    choice of the mesh. What is left out is named in one LacmeshWarning.
    """
    out = MeshBuilder(path, rows_from=1)
    with hdf5.opened(path) as root:
        if "INFOS_GENERALES" not in root:
            raise ReadError(path, "is an HDF5 file, but not MED (it has no INFOS_GENERALES)")
        about = hdf5.member(root, "INFOS_GENERALES")
        version = hdf5.attribute(about, "MAJ", int), hdf5.attribute(about, "MIN", int, 0)
        if not (2, 2) <= version < (5, 0):
            raise hdf5.error_at(about, f"MED version {version[0]}.{version[1]} is not read; versions 2.2 to 4.2 are")
        link = _chosen(path, root, mesh)
        name, home = hdf5.text(link), root["ENS_MAA"][link]
        if hdf5.attribute(home, "TYP", int, 0) != 0:
            message = "is a structured grid, which is not read; turn it into cells (MEDCoupling: buildUnstructured)"
            raise hdf5.error_at(home, message)
        step = _step(home, out.warnings)
        dim, families = _read_nodes(home, step, out)
        parts = list(_parts(step, out.warnings))
        _add_cells(parts, out)
        of_cells, of_nodes = _families(root, home, link, out.warnings)
        _add_groups("cell", concatenated(part.family for part in parts), of_cells, out)
        _add_groups("node", families, of_nodes, out)
        starts = np.cumsum([1, *(len(part.nodes) for part in parts)]).tolist()
        supports = {part.support: range(*bounds) for part, bounds in zip(parts, pairwise(starts), strict=True)}
        supports["NOE"] = range(1, out.size("node") + 1)
        steps = fields.read(root, link, supports, out)
        if _HOME in root:
            out.read_note(hdf5.raw(hdf5.member(root, _HOME), _NOTES))
            if out.note.get("of", out.note.get("mesh", name)) != name:  # it is of another mesh
                out.note = {}
        for place, what in _NO_PLACE.items():
            if any(place in group and len(group[place]) for group in (root, home, step)):
                out.warnings.append(f"{what} are left out")
        return out.mesh(name=name, space_dim=max(dim, 2), steps=steps)


def _chosen(path: Path, root: h5py.File, wanted: str | None) -> str | bytes:
    """Return the link to the mesh of that name, or to the only one. Raises ReadError, RequestError."""
    meshes = hdf5.groups_in(hdf5.member(root, "ENS_MAA")) if "ENS_MAA" in root else []
    links = {hdf5.text(name): name for name, _ in meshes}
    if not links:
        raise ReadError(path, "holds no mesh")
    if wanted is None and len(links) > 1:
        raise RequestError(f"{path} holds {len(links)} meshes, say which: {', '.join(sorted(links))}")
    if wanted is not None and wanted not in links:
        raise RequestError(f"{path} holds no mesh named {wanted!r}{did_you_mean(wanted, links)}")
    return links[wanted] if wanted is not None else next(iter(links.values()))


def _step(home: h5py.Group, left_out: list[str]) -> h5py.Group:
    """Return the group of nodes and cells: the mesh's step without a number, or its first; in MED 2.3 the mesh."""
    if any(place in home for place in ("NOE", *_ENTITIES)):
        return home
    steps = [step for _, step in hdf5.groups_in(home) if "NDT" in step.attrs]
    if not steps:
        raise hdf5.error_at(home, "has neither nodes nor steps")
    if len(steps) > 1:
        left_out.append(f"only one of the {len(steps)} steps of the mesh is read")
    timeless = [one for one in steps if hdf5.attribute(one, "NDT", int) == hdf5.attribute(one, "NOR", int, -1) == -1]
    return (timeless or steps)[0]


def _read_nodes(home: h5py.Group, step: h5py.Group, out: MeshBuilder) -> tuple[int, Ints]:
    """Add the nodes; return the number of coordinates in the file, and the nodes' families (n,)."""
    nodes = hdf5.member(step, "NOE")
    coordinates = hdf5.member(nodes, "COO", h5py.Dataset)
    points = hdf5.values(nodes, "COO", "f")
    n = hdf5.attribute(coordinates, "NBR", int, None)
    dim = hdf5.attribute(home, "ESP", int, len(points) // n if n else hdf5.attribute(home, "DIM", int))
    n = len(points) // dim if n is None and 1 <= dim <= 3 else n
    if not 1 <= dim <= 3 or len(points) != n * dim:
        raise hdf5.error_at(nodes, f"holds {len(points)} values for {n} nodes in {dim} dimensions", "COO")
    if hdf5.attribute(home, "REP", int, hdf5.attribute(coordinates, "REP", int, 0)) != 0:
        raise hdf5.error_at(nodes, "is cylindrical or spherical; only Cartesian coordinates are read", "COO")
    number, place = _numbers(nodes, n), f"{nodes.name}/COO"
    out.nodes(number, points.reshape(dim, n).T, error=lambda message: ReadError(out.path, message, place))
    return dim, _family(nodes, n)


def _numbers(part: h5py.Group, n: int) -> Ints | None:
    return hdf5.values(part, "NUM", "iu", n).astype(np.int64) if "NUM" in part else None


def _family(part: h5py.Group, n: int) -> Ints:
    return hdf5.values(part, "FAM", "iu", n).astype(np.int64) if "FAM" in part else np.zeros(n, np.int64)


def _parts(step: h5py.Group, left_out: list[str]) -> Iterator[_Part]:
    """Yield the cells of each type, in the order of the file where it has one, or else in libmed's."""
    supports = dict[str, str]()
    named = "NOM" in hdf5.member(step, "NOE")
    for entity in _ENTITIES:
        inside = hdf5.groups_in(hdf5.member(step, entity)) if entity in step else []
        if inside and not step[entity].id.get_create_plist().get_link_creation_order():
            inside.sort(key=lambda item: _BIT.get(hdf5.text(item[0]), len(_BIT)))
        for name, part in ((hdf5.text(link), part) for link, part in inside):
            named = named or "NOM" in part
            if name in supports:
                left_out.append(f"{entity}/{name} is left out, {supports[name]} has such cells too")
            elif (cells := _cells_of(part, name, f"{entity}.{name}")) is not None:
                supports[name] = cells.support
                yield cells
    if named:
        left_out.append("names of single nodes and cells are left out")


def _cells_of(part: h5py.Group, name: str, support: str) -> _Part | None:
    """Return the cells of one type; None where there are none."""
    if name not in _OF_NAME:
        raise hdf5.error_at(part, f"{MED_NOT_READ.get(name, f'cells of type {name}')} are not read")
    if "NOD" not in part:
        if "DES" in part:
            raise hdf5.error_at(part, "gives cells by their faces (descending connectivity), which is not read")
        return None
    kind, listed = _OF_NAME[name], hdf5.values(part, "NOD", "iu")
    width = len(kind.nodes)
    n = hdf5.attribute(part["NOD"], "NBR", int, len(listed) // width)
    if n < 0 or len(listed) != n * width:
        raise hdf5.error_at(part, f"holds {len(listed)} values for {n} cells of {width} nodes", "NOD")
    nodes = np.empty((n, width), listed.dtype)
    nodes[:, kind.nodes] = listed.reshape(width, n).T
    return _Part(kind, support, f"{part.name}/NOD", nodes, _numbers(part, n), _family(part, n)) if n else None


def _add_cells(parts: list[_Part], out: MeshBuilder) -> None:
    """Add the cells with the file's numbers if they are distinct, or else counted; types count in libmed's order."""
    first, following = dict[str, int](), 1
    for part in sorted(parts, key=lambda part: part.kind.bit):
        first[part.support], following = following, following + len(part.nodes)
    counted = {part.support: first[part.support] + np.arange(len(part.nodes)) for part in parts}
    numbers = {part.support: counted[part.support] if part.number is None else part.number for part in parts}
    again = repeated(concatenated(numbers.values()))
    if again is not None:
        out.warnings.append(f"cells are numbered from 1, the file gives several the number {again}")
    for part in parts:
        number = (numbers if again is None else counted)[part.support]
        error = lambda message, place=part.place: ReadError(out.path, message, place)  # noqa: E731
        out.cells(part.kind.type, number, part.nodes, error=error)


def _families(root: h5py.File, mesh: h5py.Group, link: str | bytes, left_out: list[str]) -> tuple[_Families, _Families]:
    """Read the families of cells, and those of nodes, of a mesh; MED 2.3 may keep them inside the mesh."""
    home = mesh if "FAS" in mesh else hdf5.member(root, "FAS") if "FAS" in root else None
    name = "FAS" if "FAS" in mesh else link
    of_cells, of_nodes = _Families(), _Families()
    for place, group in hdf5.groups_in(hdf5.member(home, name)) if home is not None and name in home else ():
        for family in [group] if "NUM" in group.attrs else [inner for _, inner in hdf5.groups_in(group)]:
            number = hdf5.attribute(family, "NUM", int)
            table = {"ELEME": of_cells, "NOEUD": of_nodes}.get(hdf5.text(place), of_cells if number < 0 else of_nodes)
            names = table.setdefault(number, [])
            if "GRO" in family:
                groups = hdf5.member(family, "GRO")
                text = hdf5.raw(groups, "NOM")
                n = hdf5.attribute(groups, "NBR", int, len(text) // _NAME_SIZE)
                if not 0 <= n * _NAME_SIZE <= len(text):
                    raise hdf5.error_at(groups, f"holds {len(text)} bytes for {n} names of {_NAME_SIZE}", "NOM")
                names += [hdf5.text(text[k * _NAME_SIZE : (k + 1) * _NAME_SIZE]) for k in range(n)]
            if "ATT" in family:
                left_out.append("attributes of families are left out")
    return of_cells, of_nodes


def _add_groups(on: str, family: Ints, families: _Families, out: MeshBuilder) -> None:
    """Add the groups of nodes or cells, from the family (n,) of each; groups without members included."""
    rows = dict(by_value(family, np.arange(1, len(family) + 1)))
    pairs = [(name, number) for number, names in families.items() for name in names]
    for name, number in sorted(pairs, key=lambda pair: pair[0]):
        out.group(on, name, rows.get(number))
    unknown = [number for number in rows if number and number not in families]
    if unknown:
        out.warnings.append(f"{on}s in {len(unknown)} undefined families (as {unknown[0]}) get no group from them")


# ---- writing


def write(path: Path, mesh: Mesh) -> None:
    """Write a mesh as MED 4.1.1, replacing what `path` holds.

    Cells go by type, within a type as in `mesh.file_order`. Raises WriteError for cells or names that MED cannot hold;
    what is changed or left out is named in one LacmeshWarning.
    """
    left_out: list[str] = []
    check_types(path, mesh, MED_CELLS, "MED")
    _check_names(path, mesh)
    name = fields.title(path, mesh.name or "mesh", "mesh", left_out)
    cells = [(MED_CELLS[block.type], lo, block.nodes, here) for block, lo, here in blocks_in_order(mesh)]
    cell_family, cell_families = families_of(mesh.cell_groups, mesh.cell_dim)
    node_family, node_families = families_of(mesh.node_groups, np.zeros(mesh.n_nodes, np.int8))
    with hdf5.image(path) as root:
        hdf5.add_group(root, "INFOS_GENERALES", MAJ=4, MIN=1, REL=1)
        step = _write_home(root, mesh, name)
        _write_nodes(step, mesh, node_family)
        inside = hdf5.add_group(step, "MAI", CGT=1) if cells else None
        for kind, lo, nodes, here in cells:
            rows = nodes if mesh.file_order is None else nodes[here - lo]
            _write_cells(inside, mesh, kind, rows, here, -cell_family[here])
        families = hdf5.add_group(hdf5.add_group(root, "FAS"), name)
        hdf5.add_group(families, "FAMILLE_ZERO", NUM=0)
        _write_families(families, "ELEME", cell_families, -1)
        _write_families(families, "NOEUD", node_families, 1)
        fields.write(root, mesh, name, [(kind, here) for kind, _, _, here in cells], left_out)
        noted = ("zones", "group_tags", "model")
        if dump(mesh, *noted):
            note = np.frombuffer(dump(mesh, *noted, of=name).encode(), np.uint8)
            hdf5.add_array(hdf5.add_group(root, _HOME), _NOTES, note)
    if left_out:  # `path` may stand for another file (`formats.write`)
        warnings.warn("MED: " + "; ".join(left_out), LacmeshWarning, stacklevel=2)


def _check_names(path: Path, mesh: Mesh) -> None:
    for name in (*mesh.cell_groups, *mesh.node_groups):
        if len(hdf5.encoded(name)) > _NAME_SIZE:
            raise WriteError(path, f"a group's name has {_NAME_SIZE} bytes at most in MED; shorten {name!r}")
        if hdf5.text(name) != name or not name:
            reason = "empty, a blank at the end or NUL"
            raise WriteError(path, f"MED cannot hold the group name {name!r} ({reason}); rename it")


def _write_home(root: h5py.Group, mesh: Mesh, name: str) -> h5py.Group:
    """Create the group of the mesh, and return that of its only step."""
    esp = 2 if is_plane(mesh) else 3
    blank = " " * (16 * esp)
    about: dict[str, Any] = {"DIM": mesh.dim if mesh.n_cells else esp, "ESP": esp, "REP": 0, "SRT": 0, "TYP": 0}
    about |= {"NXI": -1, "NXT": -1, "DES": "", "NOM": blank, "UNI": blank, "UNT": ""}
    step: dict[str, Any] = {"CGT": 1, "NDT": -1, "NOR": -1, "NXI": -1, "NXT": -1, "PDT": 0.0, "PVI": -1, "PVT": -1}
    return hdf5.add_group(hdf5.add_group(hdf5.add_group(root, "ENS_MAA"), name, **about), f"{-1:020d}{-1:020d}", **step)


def _write_nodes(step: h5py.Group, mesh: Mesh, family: Ints) -> None:
    nodes = hdf5.add_group(step, "NOE", CGT=1, CGS=1, PFL=fields.NO_PROFILE)
    points = np.ascontiguousarray(mesh.points[:, : 2 if is_plane(mesh) else 3].T, float)
    for name, values in (("COO", points.reshape(-1)), ("FAM", family), ("NUM", hdf5.compact(mesh.node_number))):
        hdf5.add_array(nodes, name, values, CGT=1, NBR=mesh.n_nodes)


def _write_cells(home: h5py.Group, mesh: Mesh, kind: FormatCell, nodes: Ints, here: Ints, family: Ints) -> None:
    listed = np.empty((len(kind.nodes), len(nodes)), np.int32 if mesh.n_nodes < 2**31 else np.int64)
    for row, place in zip(listed, kind.nodes, strict=True):
        np.add(nodes[:, place], 1, out=row, casting="unsafe")
    part = hdf5.add_group(home, kind.name, CGT=1, CGS=1, GEO=kind.number, PFL=fields.NO_PROFILE)
    number = hdf5.compact(mesh.cell_number[here])
    for name, values in (("NOD", listed.reshape(-1)), ("FAM", family), ("NUM", number)):
        hdf5.add_array(part, name, values, CGT=1, NBR=len(nodes))


def families_of(groups: Mapping[str, Ints], dim: Ints) -> tuple[Ints, list[tuple[str, ...]]]:
    """Family number (n,) of each cell or node, and the groups of families 0, 1, 2, ...

    One family for each dimension `dim` (n,) and combination of groups (of a family with several dimensions gmsh names
    only the highest), and one more, without members, for all empty groups.
    """
    names = list(groups)
    label, _, inside = divided(dim, 4, groups.values())
    used = [k for k, places in enumerate(inside) if places]
    number = np.zeros(len(inside), np.int32)
    number[used] = 1 + np.arange(len(used))
    empty = tuple(name for name, members in groups.items() if not len(members))
    combined = [tuple(names[g] for g in inside[k]) for k in used]
    return number[label], [(), *combined, *([empty] if empty else [])]


def _write_families(parent: h5py.Group, place: str, families: list[tuple[str, ...]], sign: int) -> None:
    """Write the families of cells (`place` ELEME, `sign` -1) or nodes (NOEUD, 1), except family 0."""
    home = hdf5.add_group(parent, place) if len(families) > 1 else None
    for k, names in enumerate(families[1:], 1):
        groups = hdf5.add_group(hdf5.add_group(home, f"FAM_{sign * k}", NUM=sign * k), "GRO", NBR=len(names))
        rows = np.frombuffer(b"".join(hdf5.encoded(name).ljust(_NAME_SIZE, b"\0") for name in names), np.int8)
        kind = h5py.h5t.array_create(h5py.h5t.STD_I8LE, (_NAME_SIZE,))
        dataset = h5py.h5d.create(groups.id, b"NOM", kind, h5py.h5s.create_simple((len(names),)))
        dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, rows.reshape(-1, _NAME_SIZE).copy(), mtype=kind)
