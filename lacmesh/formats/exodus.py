"""Reading Exodus II: cells, element blocks, side sets, node sets, numbers, and fields of the first time.

meshio writes the format, and reads neither blocks nor side sets. Files in HDF5 are read by h5py, as netCDF4 ends the
process on 4 of 200 damaged ones; netCDF4 reads the older ones. Blocks and sets have the names of the file, or else
their numbers. Faces of side sets become cells. Source: Schoof and Yarberry, EXODUS II, SAND92-2137, 4.5 to 4.9.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS, Facet
from lacmesh.errors import ReadError, check_installed, reading
from lacmesh.formats import hdf5
from lacmesh.formats.builder import MeshBuilder
from lacmesh.mesh import Floats, Ints, Mesh, distinct
from lacmesh.topology.skin import label_rows

#: beginnings of the names of element types -> family
_FAMILIES = {
    "HEX": "HEXA", "TET": "TETRA", "WED": "PENTA", "PYR": "PYRAM", "QUAD": "QUAD", "SHELL": "QUAD", "TRI": "TRIA",
    "BAR": "SEG", "BEAM": "SEG", "TRUSS": "SEG", "EDGE": "SEG", "ROD": "SEG", "SPHERE": "POI", "CIRCLE": "POI",
    "NODE": "POI", "POINT": "POI",
}  # fmt: skip
#: corners whose middle each node after the corners is, sorted, in the order of the format
_MIDDLES = {
    "SEG": ["01"],
    "TRIA": ["01", "12", "02", "012"],
    "QUAD": ["01", "12", "23", "03", "0123"],
    "TETRA": ["01", "12", "02", "03", "13", "23"],
    "PYRAM": ["01", "12", "23", "03", "04", "14", "24", "34", "0123"],
    "PENTA": ["01", "12", "02", "03", "14", "25", "34", "45", "35", "0134", "1245", "0235"],
    "HEXA": [
        *("01", "12", "23", "03", "04", "15", "26", "37", "45", "56", "67", "47", "01234567"),
        *("0123", "4567", "0347", "1256", "0145", "2367"),
    ],
}
#: corners of each side, in the order of the format
_SIDES = {
    "SEG": ["0", "1"],
    "TRIA": ["01", "12", "02"],
    "QUAD": ["01", "12", "23", "03"],
    "TETRA": ["013", "123", "023", "012"],
    "PYRAM": ["014", "124", "234", "034", "0123"],
    "PENTA": ["0134", "1245", "0235", "012", "345"],
    "HEXA": ["0145", "1256", "2367", "0347", "0123", "4567"],
}


#: names of fields of vectors: the same name with these endings
_VECTORS = (("X", "Y", "Z"), ("X", "Y"), ("_R", "_Z"))


def read(path: Path) -> Mesh:
    """Read a file. Raises ReadError, and RequestError where netCDF4 is missing; warns of what is left out."""
    with reading(path), path.open("rb") as beginning:
        is_hdf5 = beginning.read(4) == b"\x89HDF"
    try:
        if is_hdf5:
            with hdf5.opened(path) as root:
                datasets = _Datasets(root)
                return _mesh(path, _File(datasets, lambda name: len(datasets.get(name, ()))))
        check_installed("netCDF4", "io")
        import netCDF4

        with netCDF4.Dataset(path) as file:
            file.set_auto_mask(False)
            return _mesh(path, _File(file.variables, lambda name: len(file.dimensions.get(name, ()))))
    except (OSError, KeyError, IndexError, ValueError, TypeError, AttributeError, RuntimeError) as error:
        raise ReadError(path, f"is no whole Exodus file ({type(error).__name__}: {error})") from None


class _Datasets(Mapping[str, Any]):
    """The variables of a file of netCDF 4, and its dimensions, which are datasets of their size."""

    def __init__(self, root: h5py.File) -> None:
        self._root = root

    def __getitem__(self, name: str) -> h5py.Dataset:
        if name not in self._root:
            raise KeyError(name)
        return hdf5.dataset(self._root, name, "iufS")

    def __iter__(self) -> Iterator[str]:
        return map(hdf5.text, self._root)

    def __len__(self) -> int:
        return len(self._root)


class _File(NamedTuple):
    """The variables of a file by name, arrays or what is read as one; the size of a dimension, 0 where it is not."""

    variables: Mapping[str, Any]
    size: Callable[[str], int]


class _Part(NamedTuple):
    """Cells of one type, with their nodes (k, n) in lacmesh's order; `shell`: their first two sides are themselves."""

    type: str
    nodes: Ints
    shell: bool = False


def _mesh(path: Path, file: _File) -> Mesh:
    out, points = MeshBuilder(path, rows_from=0), _points(file)
    blocks = [_block(path, file, name, len(points)) for name in _numbered(file, "connect")]
    if not blocks:
        raise ReadError(path, "has no element blocks")
    starts = np.cumsum([0, *(len(block.nodes) for block in blocks)]).tolist()
    names = _names(file, "eb", len(blocks), {})
    faces, sets = _side_sets(path, file, blocks, starts, names)
    out.nodes(_numbers(file, "node_num_map", len(points), 0), points)
    number = _numbers(file, "elem_num_map", starts[-1], sum(len(face.nodes) for face in faces))
    for part, name in [*zip(blocks, names, strict=True), *((face, None) for face in faces)]:
        first = out.size("cell")
        numbers = None if number is None else number[first : first + len(part.nodes)]
        out.cells(part.type, numbers, part.nodes, groups=() if name is None else (name,))
    for name, members in sets.items():
        out.group("cell", name, members)
    node_sets = _numbered(file, "node_ns")
    for name, variable in zip(_names(file, "ns", len(node_sets), {}), node_sets, strict=True):
        out.group("node", name, _indices(path, file.variables[variable][:], len(points), name))
    _add_fields(file, starts, out)
    return out.mesh()


def _points(file: _File) -> Floats:
    """Return the coordinates of the nodes (n, 1 to 3), which stand together or by axis."""
    n = file.size("num_nodes")
    if "coord" in file.variables:
        return np.asarray(file.variables["coord"][:].T, float)
    axes = [file.variables[f"coord{a}"][:] if f"coord{a}" in file.variables else np.zeros(n) for a in "xyz"]
    return np.stack(axes, axis=1).astype(float)


def _numbered(file: _File, stem: str) -> list[str]:
    """Return the names of variables stem1, stem2 ..., in the order of their numbers."""
    numbered = (name for name in file.variables if re.fullmatch(rf"{stem}\d+", name))
    return sorted(numbered, key=lambda name: int(name.removeprefix(stem)))


def _block(path: Path, file: _File, name: str, n_points: int) -> _Part:
    """Return the cells of an element block. Raises ReadError for types that are not read."""
    variable = file.variables[name]
    rows, title = _indices(path, variable[:], n_points, name), _type_of(variable)
    family = next((ours for theirs, ours in _FAMILIES.items() if title.startswith(theirs)), "")
    if title.startswith("SHELL") and rows.shape[1] in (3, 6, 7):
        family = "TRIA"
    kind = f"{family}{rows.shape[1]}"
    if kind not in CELLS:
        raise ReadError(path, f"has cells of type {title} with {rows.shape[1]} nodes, which are not read", name)
    cell = CELLS[kind]
    theirs = [*((str(k),) for k in range(cell.n_corners)), *map(tuple, _MIDDLES.get(family, ()))]
    order = [theirs.index(tuple(map(str, corners))) for corners in map(sorted, cell.corners_of_node)]
    shell = cell.dim == 2 and file.size("num_dim") == 3
    return _Part(kind, rows[:, order], shell)


def _type_of(variable: Any) -> str:
    """Return the name of the type of a block's elements, in capitals."""
    if isinstance(variable, h5py.Dataset):
        return str(hdf5.attribute(variable, "elem_type", str)).strip().upper()
    return str(variable.elem_type).strip("\0 ").upper()


def _indices(path: Path, numbers: Any, n: int, name: str) -> Ints:
    """Return indices from 0 of numbers from 1 to n. Raises ReadError for others."""
    indices = np.asarray(numbers).astype(np.int64) - 1
    if indices.size and (indices.min() < 0 or indices.max() >= n):
        raise ReadError(path, f"names {numbers.max()} of {n} nodes or elements", name)
    return indices


def _names(file: _File, stem: str, n: int, known: Container[str]) -> list[str]:
    """Return names of n blocks or sets; of one without a name its number, with what it is where others have that."""
    ids = file.variables[f"{stem}_prop1"][:].tolist() if f"{stem}_prop1" in file.variables else range(1, n + 1)
    what = {"eb": "block", "ss": "side set", "ns": "node set"}[stem]
    names = _texts(file, f"{stem}_names") if f"{stem}_names" in file.variables else [""] * n
    pairs = zip(names, map(str, ids), strict=True)
    return [name or (f"{what} {number}" if number in known else number) for name, number in pairs]


def _side_sets(
    path: Path, file: _File, blocks: list[_Part], starts: list[int], known: Container[str]
) -> tuple[list[_Part], dict[str, Ints]]:
    """Return the faces of side sets, each once, and the cells of each set, in the order of the file; faces are last."""
    numbered = _numbered(file, "elem_ss")
    names = _names(file, "ss", len(numbered), known)
    whole: dict[str, list[Ints]] = {name: [] for name in names}
    rows: dict[str, list[tuple[str, Ints]]] = {}
    for name, variable in zip(names, numbered, strict=True):
        elements = _indices(path, file.variables[variable][:], starts[-1], variable)
        sides = np.asarray(file.variables[variable.replace("elem_", "side_")][:]).astype(np.int64)
        of_block = np.searchsorted(starts, elements, side="right") - 1
        for block, side in np.unique(np.stack([of_block, sides], axis=1), axis=0).tolist():
            here = elements[(of_block == block) & (sides == side)]
            part = blocks[block]
            if part.shell and side <= 2:  # the two faces of a shell are the shell itself
                whole[name].append(here)
                continue
            facet = _facet(path, part, side - 2 * part.shell, variable)
            rows.setdefault(facet.type, []).append((name, part.nodes[here - starts[block]][:, list(facet.nodes)]))
    faces, first = [], starts[-1]
    for kind, parts in rows.items():
        nodes = np.concatenate([part for _, part in parts])
        label = label_rows(np.sort(nodes[:, : CELLS[kind].n_corners], axis=1))[0]
        _, first_of, label = np.unique(label, return_index=True, return_inverse=True)
        for (name, _), members in zip(parts, np.split(label, np.cumsum([len(p) for _, p in parts])[:-1]), strict=True):
            whole[name].append(first + members)
        faces.append(_Part(kind, nodes[first_of]))
        first += len(first_of)
    none = np.empty(0, np.int64)
    return faces, {name: np.unique(np.concatenate([none, *cells])) for name, cells in whole.items()}


def _facet(path: Path, part: _Part, side: int, variable: str) -> Facet:
    """Return the facet of a type of cells that is a side of the format, counted from 1."""
    cell = CELLS[part.type]
    sides = _SIDES.get(cell.family, ())
    if not 1 <= side <= len(sides):
        raise ReadError(path, f"names side {side} of a {part.type}", variable)
    corners = set(map(int, sides[side - 1]))
    return next(f for f in cell.facets if set(f.nodes[: len(corners)]) == corners)


def _numbers(file: _File, name: str, n: int, further: int) -> Ints | None:
    """Return the numbers of nodes or elements that the file gives, and those of further cells; None if they are odd."""
    numbers = np.asarray(file.variables[name][:]).astype(np.int64) if name in file.variables else np.empty(0, np.int64)
    if len(numbers) != n or not n or numbers.min() < 1 or not distinct(numbers):
        return None
    return np.concatenate([numbers, numbers.max() + 1 + np.arange(further)])


def _add_fields(file: _File, starts: list[int], out: MeshBuilder) -> None:
    """Add the fields on cells, NaN where a block has none, and on nodes, at the first time of the file."""
    data: dict[str, dict[str, NDArray]] = {"node": {}, "cell": {}}
    for k, name in enumerate(_texts(file, "name_nod_var"), start=1):
        if f"vals_nod_var{k}" in file.variables and len(file.variables[f"vals_nod_var{k}"]):
            data["node"][name] = file.variables[f"vals_nod_var{k}"][0].astype(float)
    for k, name in enumerate(_texts(file, "name_elem_var"), start=1):
        data["cell"][name] = np.full(out.size("cell"), np.nan)
        for b, (first, last) in enumerate(pairwise(starts), start=1):
            if f"vals_elem_var{k}eb{b}" in file.variables and len(file.variables[f"vals_elem_var{k}eb{b}"]):
                data["cell"][name][first:last] = file.variables[f"vals_elem_var{k}eb{b}"][0]
    steps = [len(file.variables[name]) for name in file.variables if name.startswith(("vals_nod_var", "vals_elem_var"))]
    if (data["node"] or data["cell"]) and max(steps, default=0) > 1:
        out.warnings.append("fields are read at the first time alone")
    for on, fields in data.items():
        for name, values in _vectors(fields).items():
            out.values(on, name, None, values)


def _texts(file: _File, name: str) -> list[str]:
    rows = file.variables[name][:] if name in file.variables else ()
    return [b"".join(row.tolist()).partition(b"\0")[0].decode("utf-8", "replace").strip() for row in rows]


def _vectors(fields: dict[str, NDArray]) -> dict[str, NDArray]:
    """Return fields with those put together whose names are one name with X, Y, Z, or _R, _Z, after it."""
    out, used = dict[str, NDArray](), set[str]()
    for name, values in fields.items():
        ways = ([name.removesuffix(ends[0]) + end for end in ends] for ends in _VECTORS if name.endswith(ends[0]))
        names = next((way for way in ways if set(way) <= fields.keys() - used), [])
        if len(names) > 1:
            out[names[0][:-1].rstrip("_")] = np.stack([fields[one] for one in names], axis=1)
            used.update(names)
        elif name not in used:
            out[name] = values
    return out
