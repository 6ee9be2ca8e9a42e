"""Reading XDMF 2 and 3: what lacmesh, dolfinx, legacy FEniCS, meshio and VTK write.

meshio reads one grid of a file, without includes or times, so that it would lose groups, and fails on mixtures of
quadratic cells. Uniform grids on the same points make one mesh: their cells are put together, and cells that a later
grid repeats (the tags of dolfinx) only get its attributes. A temporal collection makes one mesh, with the attributes of
every step.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from functools import partial, reduce
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import h5py
import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import ReadError, RequestError, did_you_mean, reading
from lacmesh.formats.arrays import (
    GROUP,
    NOTE,
    VtkCells,
    add_arrays,
    add_cells,
    checked_cells,
    mesh_with_tags,
    numbers_in,
)
from lacmesh.formats.builder import MeshBuilder
from lacmesh.formats.hdf5 import attribute, member, opened
from lacmesh.formats.hdf5 import values as dataset
from lacmesh.formats.orders import VTK_CELLS, XDMF_ALIASES, XDMF_CELLS, XDMF_COUNTED
from lacmesh.formats.vtu import DAMAGE, from_text, parsed
from lacmesh.mesh import Floats, Ints, Mesh, Step
from lacmesh.topology.skin import label_rows

Element = ElementTree.Element

ID, PLACE = "lacmesh_id", "file_place"
_KINDS = {"Float": "f", "Int": "i", "UInt": "u"}
_POINTER = re.compile(r"\s*(?:xpointer\()?(/[^()]*?)(?:/\*\[([^\]]*)\])?\)?\s*")
_OF_NAME = {cell.name.lower(): cell for cell in XDMF_CELLS.values()}
_OF_NUMBER = {cell.number: cell for cell in XDMF_CELLS.values()}
#: grids inside grids that are read
_DEEPEST = 50


class _Grid(NamedTuple):
    """A uniform grid: its name and time, its element's children, and keys that identify its points and its cells."""

    name: str
    time: float | None
    children: list[Element]
    points: str
    cells: str


class _Part(NamedTuple):
    """Cells that came from one grid, the row of the first among all, and the arrays on them."""

    cells: VtkCells
    first: int
    arrays: dict[str, NDArray]

    @property
    def rows(self) -> slice:
        return slice(self.first, self.first + len(self.cells.types))


def read(path: Path, mesh: str | None = None) -> Mesh:
    """Read the mesh of an XDMF file, or its grid `mesh`. Raises ReadError, RequestError; warns of what is left out."""
    with reading(path):
        text = path.read_bytes()
    root = parsed(path, text)
    domain = root.find("Domain")
    if root.tag != "Xdmf" or domain is None:
        raise ReadError(path, "has no <Xdmf> and <Domain>")
    out = MeshBuilder(path, rows_from=0)
    with ExitStack() as stack:
        source = _Source(path, root, stack, {})
        _read_information(source, domain, out)
        grids = _wanted(source, list(_grids(source, domain)), mesh, out)
        points = _points(source, _only(source, grids[0].children, "Geometry"))
        parts, on_nodes, steps = _parts(source, grids, len(points))
    number = numbers_in(on_nodes, "node", len(points), out)
    out.nodes(number, points, error=partial(source.error, place="<Geometry>"))
    _add_parts(source, parts, out)
    add_arrays(out, "node", on_nodes)
    return mesh_with_tags(out, {name for part in parts for name in part.arrays}, steps=steps)


class _Source(NamedTuple):
    """An XDMF file that is being read, with the HDF5 files that it names."""

    path: Path
    root: Element
    stack: ExitStack
    heavy: dict[str, h5py.File]

    def error(self, message: str, place: Element | str | None = None) -> ReadError:
        """Return a ReadError about the file, at an element."""
        if isinstance(place, Element):
            name = place.get("Name")
            place = f"<{place.tag}>" if name is None else f"<{place.tag} Name={name!r}>"
        return ReadError(self.path, message, place)

    def hdf5(self, name: str) -> h5py.File:
        """Return an HDF5 file, named as in the XML."""
        if name not in self.heavy:
            path = self.path.parent / name
            if not path.is_file():
                raise self.error(f"names the HDF5 file {name}, which is not beside it")
            self.heavy[name] = self.stack.enter_context(opened(path))
        return self.heavy[name]

    def children(self, element: Element) -> list[Element]:
        """Return the children of an element, and those that it refers to elsewhere in the file. Raises ReadError."""
        items: list[Element] = []
        for child in element:
            if child.tag.endswith("}include") or child.tag == "xi:include":
                items += self._included(child.get("xpointer", ""))
            elif child.get("Reference") == "XML":
                items += self._included("".join(child.itertext()))
            else:
                items.append(child)
        return items

    def _included(self, pointer: str) -> list[Element]:
        pointed = _POINTER.fullmatch(pointer.replace("element(", "xpointer("))
        path = pointed[1].replace("//", "/.//").strip("/") if pointed else ""
        try:
            place = self.root.find(path.removeprefix("Xdmf/")) if path.startswith(("Xdmf/", ".//")) else None
        except (SyntaxError, KeyError):
            place = None
        if place is None or pointed is None:
            raise self.error(f"refers to {pointer[:80]!r}, which is not found")
        return [child for child in place if child.tag in re.findall(r"\w+", pointed[2])] if pointed[2] else [place]

    def item(self, parent: Element) -> tuple[Element, str]:
        """Return the DataItem of an element, and its text, which is equal for the same array. Raises ReadError."""
        for child in self.children(parent):
            if child.tag == "DataItem":
                return child, " ".join("".join(child.itertext()).split())
        raise self.error("has no DataItem", parent)

    def array(self, parent: Element) -> NDArray:
        """Return the values of an element's DataItem, in the shape that its Dimensions say."""
        item, text = self.item(parent)
        if item.get("ItemType", "Uniform") != "Uniform":
            raise self.error(f"the item type {item.get('ItemType')!r} is not read", parent)
        dimensions, form = item.get("Dimensions"), item.get("Format", "XML")
        if dimensions is not None and not re.fullmatch(r"\s*\d{1,18}(\s+\d{1,18})*\s*", dimensions):
            raise self.error(f"dimensions {dimensions[:40]!r} are no numbers", parent)
        shape = None if dimensions is None else tuple(map(int, dimensions.split()))
        try:
            if form == "HDF":
                name, _, inside = text.rpartition(":")
                if not name or not inside.strip("/"):
                    raise ValueError(f"{text[:60]!r} does not name an array as file:/place")
                *groups, last = inside.strip("/").split("/")
                values = dataset(reduce(member, groups, self.hdf5(name)), last)
            elif form == "XML":
                values = from_text(text, _kind(item))
            elif form == "Binary" and shape is not None:
                values = self._from_bytes(item, text, int(np.prod(shape, dtype=object)))
            else:
                raise ValueError(f"the format {form!r} is not known")
            if shape is not None and int(np.prod(shape, dtype=object)) != values.size:
                raise ValueError(f"{values.size} values for dimensions {dimensions}")
            return values if shape is None else values.reshape(shape)
        except DAMAGE as error:
            raise self.error(f"cannot be read ({error})", parent) from None

    def _from_bytes(self, item: Element, name: str, count: int) -> NDArray:
        order = {"Native": "=", "Little": "<", "Big": ">"}.get(item.get("Endian", "Native").removesuffix("Endian"))
        kind, seek, path = _kind(item), int(item.get("Seek", "0")), self.path.parent / name
        if order is None or item.get("Compression", "Raw") != "Raw" or not path.is_file():
            raise ValueError(f"an item of bytes is not there, or packed: {name}")
        if count * kind.itemsize + seek > path.stat().st_size:
            raise ValueError(f"{name} is too short")
        return np.fromfile(path, kind.newbyteorder(order), count, offset=seek).astype(kind)  # type: ignore[arg-type]


def _kind(item: Element) -> np.dtype:
    """Return the type of an item's numbers. Raises ValueError."""
    name, size = item.get("NumberType", item.get("DataType", "Float")), item.get("Precision", "4")
    if name in ("Char", "UChar"):
        name, size = {"Char": "Int", "UChar": "UInt"}[name], "1"
    if name not in _KINDS or size not in ("4", "8", *(("1", "2") if name != "Float" else ())):
        raise ValueError(f"numbers of type {name} and {size} bytes are not known")
    return np.dtype(f"{_KINDS[name]}{size}")


def _read_information(source: _Source, domain: Element, out: MeshBuilder) -> None:
    """Read the note. Raises ReadError where the HDF5 file is not the one that was written with this file."""
    texts: dict[str, str] = {}
    for information in domain.iter("Information"):
        if (name := information.get("Name", "")) in (ID, NOTE):
            try:
                texts[name] = ElementTree.fromstring("".join(information.itertext())).get("value", "")
            except (ElementTree.ParseError, ValueError):
                out.warnings.append(f"lacmesh's own note ({name}) is damaged and left out")
    if texts.get(NOTE):
        out.read_note(texts[NOTE])
    item = source.root.find(".//Geometry/DataItem")
    name = "".join(item.itertext()).strip().rpartition(":")[0] if item is not None and texts.get(ID) else ""
    if name and attribute(source.hdf5(name), ID, str, "") != texts[ID]:
        raise source.error(f"{name} is not the file that was written with it; write both again")


def _grids(
    source: _Source, parent: Element, time: float | None = None, inside: tuple[Element, ...] = ()
) -> Iterator[_Grid]:
    """Yield the uniform grids of a domain or collection; `inside`: the elements that contain it. Raises ReadError."""
    if parent in inside or len(inside) > _DEEPEST:
        raise source.error("includes itself, or stands too deep inside others", parent)
    for element in (child for child in source.children(parent) if child.tag == "Grid"):
        kind = element.get("GridType", element.get("CollectionType", "Uniform"))
        children, when = source.children(element), time
        for child in children:
            if child.tag == "Time" and re.fullmatch(r"\s*[-+.\deE]+\s*", child.get("Value", "")):
                when = float(child.get("Value", "0"))
        if kind in ("Collection", "Tree"):
            yield from _grids(source, element, when, (*inside, parent))
        elif kind != "Uniform":
            raise source.error(f"grids of type {kind} are not read", element)
        else:
            elements = [_only(source, children, tag) for tag in ("Geometry", "Topology")]
            keys = [f"{only.get('TopologyType')} {source.item(only)[1]}" for only in elements]
            yield _Grid(element.get("Name", ""), when, children, *keys)


def _only(source: _Source, children: list[Element], tag: str) -> Element:
    """Return the first child of that tag. Raises ReadError."""
    child = next((child for child in children if child.tag == tag), None)
    if child is None:
        raise source.error(f"a grid has no <{tag}>")
    return child


def _wanted(source: _Source, grids: list[_Grid], name: str | None, out: MeshBuilder) -> list[_Grid]:
    """Return the grids that make the mesh: those of a name, or all, on the same points. Raises RequestError."""
    if not grids:
        raise source.error("holds no grid")
    if name is not None:
        named = [grid for grid in grids if grid.name == name]
        if not named:
            known = {grid.name for grid in grids}
            raise RequestError(f"{source.path} holds no grid named {name!r}{did_you_mean(name, known)}")
        return [grid for grid in named if grid.points == named[0].points]
    same = [grid for grid in grids if grid.points == grids[0].points]
    if len(same) < len(grids) and all(grid.time is not None for grid in grids):
        out.warnings.append(f"only the first of the {len(grids)} steps, whose meshes differ, is read")
    elif len(same) < len(grids):
        names = ", ".join(dict.fromkeys(grid.name for grid in grids))
        raise RequestError(f"{source.path} holds grids on different points, say which: {names}")
    return same


def _points(source: _Source, geometry: Element) -> Floats:
    kind = geometry.get("GeometryType", geometry.get("Type", "XYZ")).upper()
    if kind not in ("XYZ", "XY"):
        raise source.error(f"points of type {kind} are not read", "<Geometry>")
    values = source.array(geometry).reshape(-1)
    if values.dtype.kind != "f" or len(values) % len(kind):
        raise source.error(f"holds {len(values)} values of type {values.dtype} for points {kind}", "<Geometry>")
    return values.reshape(-1, len(kind))


def _parts(
    source: _Source, grids: Sequence[_Grid], n_points: int
) -> tuple[list[_Part], dict[str, NDArray], dict[str, Step]]:
    """Return the cells of all grids, each once, with their arrays; the arrays on nodes; steps of arrays by name."""
    times = sorted({grid.time for grid in grids if grid.time is not None})
    parts: dict[str, _Part] = {}
    on_nodes, steps = dict[str, NDArray](), dict[str, Step]()
    following = 0
    for grid in grids:
        if grid.cells not in parts:
            cells = _cells(source, _only(source, grid.children, "Topology"), n_points)
            parts[grid.cells] = _Part(cells, following, {})
            following += len(cells.types)
        part = parts[grid.cells]
        for element in (child for child in grid.children if child.tag == "Attribute"):
            center, key = element.get("Center", "Node"), element.get("Name", "")
            if center not in ("Cell", "Node"):
                raise source.error(f"attributes on {center} are not read", element)
            if grid.time is not None and (len(times) > 1 or grid.time):
                k = times.index(grid.time)
                step = Step(key, k, -1, grid.time)
                key = f"{key}@{k}" if len(times) > 1 else key
                steps[key] = step
            if center == "Cell":
                part.arrays[key] = _values(source, element, len(part.cells.types))
            else:
                on_nodes[key] = _values(source, element, n_points)
    return list(parts.values()), on_nodes, steps


def _values(source: _Source, element: Element, size: int) -> NDArray:
    values = source.array(element)
    if values.size % size if size else values.size:
        raise source.error(f"holds {values.size} values for {size} rows", element)
    width = values.size // size if size else values.shape[-1] if values.ndim == 2 else 1
    return values.reshape(size) if width == 1 else values.reshape(size, width)


def _cells(source: _Source, topology: Element, n_points: int) -> VtkCells:
    name = topology.get("TopologyType", topology.get("Type", ""))
    place = f"<Topology {name}>"
    values = source.array(topology).reshape(-1)
    if values.dtype.kind not in "iu":
        raise source.error(f"nodes should be integers, not {values.dtype}", place)
    values = values.astype(np.int64)
    cells = _mixed(source, values) if name.lower() == "mixed" else _uniform(source, topology, name, values)
    announced = topology.get("NumberOfElements", topology.get("Dimensions", str(len(cells.types)))).strip()
    if announced != str(len(cells.types)):
        raise source.error(f"holds {len(cells.types)} cells, and announces {announced[:20]}", place)
    base = topology.get("BaseOffset", "0")
    nodes = cells.connectivity - (int(base) if base.isdigit() and len(base) < 19 else 0)
    return checked_cells(cells._replace(connectivity=nodes), n_points, lambda message: source.error(message, place))


def _uniform(source: _Source, topology: Element, name: str, values: Ints) -> VtkCells:
    stem, _, number = name.lower().partition("_")
    if stem == "polygon":
        stem = {"3": "triangle", "4": "quadrilateral"}.get(topology.get("NodesPerElement", ""), stem)
    cell = _OF_NAME.get("_".join([XDMF_ALIASES.get(stem, stem), *([number] if number else [])]))
    width = len(cell.nodes) if cell else 0
    if cell is None or (cell.number in XDMF_COUNTED and topology.get("NodesPerElement", str(width)) != str(width)):
        raise source.error(f"cells of type {name} are not read", "<Topology>")
    n = len(values) // width
    if len(values) % width:
        raise source.error(f"holds {len(values)} nodes for cells of {width}", f"<Topology {name}>")
    return VtkCells(values, width * np.arange(1, n + 1), np.full(n, VTK_CELLS[cell.type].number, np.uint8))


def _mixed(source: _Source, values: Ints) -> VtkCells:
    """Cells of a mixture: each is its number, for lines and vertices how many nodes follow, and its nodes."""
    listed, at, place = values.tolist(), 0, "<Topology Mixed>"
    nodes, ends, types = list[int](), list[int](), list[int]()
    while at < len(listed):
        cell = _OF_NUMBER.get(listed[at])
        begin = at + 1 + (listed[at] in XDMF_COUNTED)
        end = begin + (len(cell.nodes) if cell else 0)
        if cell is None or end > len(listed):
            raise source.error(f"cells of XDMF's type {listed[at]} are not read, or the mixture is damaged", place)
        if begin == at + 2 and listed[at + 1] != len(cell.nodes):
            raise source.error("lines and vertices of several pieces are not read", place)
        nodes += listed[begin:end]
        ends.append(len(nodes))
        types.append(VTK_CELLS[cell.type].number)
        at = end
    return VtkCells(np.array(nodes, np.int64), np.array(ends, np.int64), np.array(types, np.uint8))


def _add_parts(source: _Source, parts: list[_Part], out: MeshBuilder) -> None:
    """Add the cells of all parts, and the arrays on them."""
    starts = np.cumsum([0, *(len(part.cells.connectivity) for part in parts)])
    cells = VtkCells(
        np.concatenate([part.cells.connectivity for part in parts]),
        np.concatenate([part.cells.ends + start for part, start in zip(parts, starts, strict=False)]),
        np.concatenate([part.cells.types for part in parts]),
    )
    n = len(cells.types)
    extra = out.note.get("own", ())
    extra = [name for name in extra if isinstance(name, str)] if isinstance(extra, list) else []
    rows, at = np.arange(n), np.arange(n)  # the row of each cell in the mesh, and -1 where it is not added again
    if out.note:
        places = [part.arrays[PLACE] for part in parts if PLACE in extra and PLACE in part.arrays]
        if places and np.array_equal(np.sort(order := np.concatenate(places)), rows):
            rows = at = order.astype(np.int64)
        names = out.note.get("groups", ())
        for name in names if isinstance(names, list) else ():
            out.group("cell", str(name).removeprefix(GROUP))
    elif len(parts) > 1:
        first = _first_of_equal(cells)
        rows = (np.cumsum(first == np.arange(n)) - 1)[first]
        at = np.where(first == np.arange(n), rows, -1)
    listed = [numbers_in(part.arrays, "cell", len(part.cells.types), out) for part in parts]
    whole = [number for number in listed if number is not None]
    number = np.concatenate(whole) if len(whole) == len(parts) else None
    add_cells(out, cells, number, lambda message: source.error(message, "<Topology>"), at=at)
    for name in dict.fromkeys(name for part in parts for name in part.arrays if name not in extra):
        for part in reversed(parts):  # values of an earlier part count
            if name in part.arrays:
                add_arrays(out, "cell", {name: part.arrays[name]}, rows[part.rows])


def _first_of_equal(cells: VtkCells) -> Ints:
    """Return for each cell (n,) the first one of the same type on the same nodes."""
    first = np.arange(len(cells.types))
    for _, _, rows, nodes in cells.by_kind():
        label, _ = label_rows(np.sort(nodes, axis=1))
        first[rows] = rows[np.unique(label, return_index=True)[1][label]]
    return first
