"""Reading XDMF 2 and 3: what lacmesh, dolfinx, legacy FEniCS, meshio and VTK write.

Uniform grids on the same points make one mesh: their cells are put together, and cells that a later grid repeats (the
tags of dolfinx) only get its attributes. A temporal collection makes one mesh, with the attributes of every step.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import LacmeshWarning, ReadError, RequestError, did_you_mean, reading, some
from lacmesh.formats import notes
from lacmesh.formats.arrays import GROUP, assembled, merged
from lacmesh.formats.vtu.reader import VtkCells, blocks_of, joined, stray_node
from lacmesh.formats.vtu.types import OF_TYPE as VTK_OF_TYPE
from lacmesh.formats.vtu.xml import parsed
from lacmesh.formats.xdmf.items import ItemElement, XdmfSource
from lacmesh.formats.xdmf.types import ALIASES, OF_NAME, OF_NUMBER, XDMF_TYPES
from lacmesh.formats.xdmf.writer import ID, NOTES, PLACE, told
from lacmesh.mesh import Floats, Ints, Mesh, Step
from lacmesh.topology.skin import label_rows

#: Grids inside grids that are read.
_DEEPEST = 50


class _Grid(NamedTuple):
    """A uniform grid: its name and time, its element's children, and keys that identify its points and its cells."""

    name: str
    time: float | None
    children: list[ItemElement]
    points: str
    cells: str


#: cells that came from one grid, and the attributes on them
_Part = tuple[VtkCells, dict[str, NDArray]]


def read(path: Path, mesh: str | None = None) -> Mesh:
    """Read the mesh of an XDMF file, or its grid `mesh`. Raises ReadError, RequestError; warns of what is left out."""
    said: list[str] = []
    with reading(path):
        text = path.read_bytes()
    root = parsed(path, text)
    domain = root.find("Domain")
    if root.tag != "Xdmf" or domain is None:
        raise ReadError(path, "has no <Xdmf> and <Domain>")
    with ExitStack() as stack:
        source = XdmfSource(path, root, stack)
        notes_of = _told(domain, said)
        _check_halves(source, notes_of.get(ID))
        grids = _chosen(source, list(_grids(source, domain)), mesh, said)
        whole = _mesh(source, grids, notes_of.get(NOTES), said)
    if said:
        warnings.warn(f"{path}: " + "; ".join(dict.fromkeys(said)), LacmeshWarning, stacklevel=3)
    return whole


def _told(domain: ItemElement, said: list[str]) -> dict[str, str]:
    """Texts that lacmesh wrote into Information elements beside the arrays, by name."""
    texts: dict[str, str] = {}
    for information in domain.iter("Information"):
        name = information.get("Name", "")
        if name in (ID, NOTES):
            try:
                texts[name] = told(information)
            except ValueError:
                said.append(f"lacmesh's own notes ({name}) are damaged and left out")
    return texts


def _check_halves(source: XdmfSource, mark: str | None) -> None:
    """Raise ReadError where the HDF5 file is not the one that was written with this file."""
    if not mark:
        return
    item = source.root.find(".//Geometry/DataItem")
    name = "".join(item.itertext()).strip().rpartition(":")[0] if item is not None else ""
    if name and source.file(name).string(ID) != mark:
        raise source.error(f"{name} is not the file that was written with it; write both again")


def _grids(
    source: XdmfSource, parent: ItemElement, time: float | None = None, inside: tuple[ItemElement, ...] = ()
) -> Iterator[_Grid]:
    """Yield the uniform grids of a domain or collection; `inside`: the elements that contain it. Raises ReadError."""
    if parent in inside or len(inside) > _DEEPEST:
        raise source.error("includes itself, or stands too deep inside others", f"<Grid Name={parent.get('Name')!r}>")
    for element in (child for child in source.children(parent) if child.tag == "Grid"):
        grid_type = element.get("GridType", element.get("CollectionType", "Uniform"))
        children = source.children(element)
        when = next((_time(source, c) for c in children if c.tag == "Time"), time)
        if grid_type in ("Collection", "Tree"):
            yield from _grids(source, element, when, (*inside, parent))
        elif grid_type != "Uniform":
            raise source.error(f"grids of type {grid_type} are not read", f"<Grid Name={element.get('Name')!r}>")
        else:
            keys = (_key(source, children, tag) for tag in ("Geometry", "Topology"))
            yield _Grid(element.get("Name", ""), when, children, *keys)


def _time(source: XdmfSource, element: ItemElement) -> float | None:
    try:
        return float(element.get("Value", ""))
    except ValueError:
        return None


def _key(source: XdmfSource, children: list[ItemElement], tag: str) -> str:
    """Key that is equal for two grids with the same points (tag Geometry) or cells (Topology)."""
    only = _only(source, children, tag)
    return f"{only.get('TopologyType')} {source.item(only)[1]}"


def _only(source: XdmfSource, children: list[ItemElement], tag: str) -> ItemElement:
    for child in children:
        if child.tag == tag:
            return child
    raise source.error(f"a grid has no <{tag}>")


def _chosen(source: XdmfSource, grids: list[_Grid], wanted: str | None, said: list[str]) -> list[_Grid]:
    """Grids that make the mesh: those named `wanted`, or all; all share points. Raises ReadError, RequestError."""
    if not grids:
        raise source.error("holds no grid")
    if wanted is not None:
        named = [g for g in grids if g.name == wanted]
        if not named:
            names = {g.name for g in grids}
            raise RequestError(f"{source.path} holds no grid named {wanted!r}{did_you_mean(wanted, names)}")
        return [g for g in named if g.points == named[0].points]
    if all(g.time is not None for g in grids):
        steps = [g for g in grids if g.points == grids[0].points]
        if len(steps) < len(grids):
            said.append(f"only the first of the {len(grids)} steps, whose meshes differ, is read")
        return steps
    if len({g.points for g in grids}) > 1:
        listed = ", ".join(dict.fromkeys(g.name for g in grids))
        raise RequestError(f"{source.path} holds grids on different points, say which: {listed}")
    return grids


def _mesh(source: XdmfSource, grids: list[_Grid], noted_text: str | None, said: list[str]) -> Mesh:
    points = _points(source, _only(source, grids[0].children, "Geometry"))
    fields, noted = notes.from_json(noted_text, len(points), said) if noted_text else ({}, {})
    times = sorted({g.time for g in grids if g.time is not None})
    parts: dict[str, _Part] = {}
    node: dict[str, NDArray] = {}
    steps: dict[str, Step] = {}
    for grid in grids:
        part = parts.get(grid.cells)
        if part is None:
            cells = _cells(source, _only(source, grid.children, "Topology"), len(points))
            part = parts[grid.cells] = cells, {}
        for center, attribute in _attributes(source, grid):
            key = attribute.get("Name", "")
            if grid.time is not None and (len(times) > 1 or grid.time):
                k = times.index(grid.time)
                step = Step(key, k, -1, grid.time)
                key = f"{key}@{k}" if len(times) > 1 else key
                steps[key] = step
            size = len(part[0].ends) if center == "Cell" else len(points)
            (part[1] if center == "Cell" else node)[key] = _values(source, attribute, size)
    fields.setdefault("steps", {}).update(steps)
    return _put_together(source, points, list(parts.values()), node, fields, noted, said)


def _points(source: XdmfSource, geometry: ItemElement) -> Floats:
    geometry_type = geometry.get("GeometryType", geometry.get("Type", "XYZ")).upper()
    if geometry_type not in ("XYZ", "XY"):
        raise source.error(f"points of type {geometry_type} are not read", "<Geometry>")
    values = source.array(geometry).reshape(-1)
    width = len(geometry_type)
    if values.dtype.kind != "f" or len(values) % width:
        raise source.error(
            f"holds {len(values)} values of type {values.dtype} for points {geometry_type}", "<Geometry>"
        )
    points = np.zeros((len(values) // width, 3))
    points[:, :width] = values.reshape(-1, width)
    if not np.isfinite(points).all():
        bad = some(np.flatnonzero(~np.isfinite(points).all(axis=1)))
        raise source.error(f"the coordinates of points {bad} (from 0) are not finite numbers", "<Geometry>")
    return points


def _cells(source: XdmfSource, topology: ItemElement, n_points: int) -> VtkCells:
    name = topology.get("TopologyType", topology.get("Type", ""))
    values = source.array(topology).reshape(-1)
    if values.dtype.kind not in "iu":
        raise source.error(f"nodes should be integers, not {values.dtype}", f"<Topology {name}>")
    values = values.astype(np.int64)
    cells = _mixed(source, topology, values) if name.lower() == "mixed" else _uniform(source, topology, name, values)
    base = topology.get("BaseOffset", "0")
    nodes = cells.connectivity - (int(base) if base.isdigit() and len(base) < 19 else 0)
    if len(nodes) and (nodes.min() < 0 or nodes.max() >= n_points):
        raise stray_node(source, cells._replace(connectivity=nodes), n_points, f"<Topology {name}>")
    return cells._replace(connectivity=nodes)


def _uniform(source: XdmfSource, topology: ItemElement, name: str, values: NDArray[np.int64]) -> VtkCells:
    lower = name.lower()
    kind = OF_NAME.get(ALIASES.get(lower, lower))
    if lower == "polygon":
        kind = {"3": OF_NAME["triangle"], "4": OF_NAME["quadrilateral"]}.get(topology.get("NodesPerElement", ""))
    width = len(VTK_OF_TYPE[kind.type].nodes) if kind else 0
    if kind is None or (kind.counted and topology.get("NodesPerElement", str(width)) != str(width)):
        raise source.error(f"cells of type {name} are not read", "<Topology>")
    n = topology.get("NumberOfElements", topology.get("Dimensions", str(len(values) // width))).strip()
    if n != str(len(values) // width) or len(values) % width:
        raise source.error(f"holds {len(values)} nodes for {n[:20]} cells of {width}", f"<Topology {name}>")
    k = len(values) // width
    number = VTK_OF_TYPE[kind.type].number
    return VtkCells(values, width * np.arange(1, k + 1), np.full(k, number, np.uint8))


def _mixed(source: XdmfSource, topology: ItemElement, values: NDArray[np.int64]) -> VtkCells:
    from lacmesh.formats.xdmf.mixed import starts

    before = np.zeros(max(OF_NUMBER) + 1, np.int64)
    width = np.zeros_like(before)
    vtk = np.zeros(len(width), np.uint8)
    for kind in XDMF_TYPES:
        before[kind.number] = 2 if kind.counted else 1
        width[kind.number] = before[kind.number] + len(VTK_OF_TYPE[kind.type].nodes)
        vtk[kind.number] = VTK_OF_TYPE[kind.type].number
    begins = np.empty(len(values) // 2 + 1, np.int64)
    n = starts(values, width, begins)
    if n < 0:
        number = values[-1 - n]
        raise source.error(f"cells of XDMF's type {number} are not read, or the mixture is damaged", "<Topology Mixed>")
    announced = topology.get("NumberOfElements", topology.get("Dimensions", str(n))).strip()
    if announced != str(n):
        raise source.error(f"holds {n} cells, and announces {announced[:20]}", "<Topology Mixed>")
    first = begins[:n]
    number = values[first]
    counted = np.flatnonzero(before[number] == 2)
    if (values[first[counted] + 1] != width[number[counted]] - 2).any():
        raise source.error("lines and vertices of several pieces are not read", "<Topology Mixed>")
    inside = np.ones(len(values), bool)
    inside[first] = False
    inside[first[counted] + 1] = False
    return VtkCells(values[inside], np.cumsum(width[number] - before[number]), vtk[number])


def _attributes(source: XdmfSource, grid: _Grid) -> Iterator[tuple[str, ItemElement]]:
    for child in grid.children:
        if child.tag == "Attribute":
            center = child.get("Center", "Node")
            if center not in ("Cell", "Node"):
                raise source.error(f"attributes on {center} are not read", f"<Attribute Name={child.get('Name')!r}>")
            yield center, child


def _values(source: XdmfSource, attribute: ItemElement, size: int) -> NDArray:
    values = source.array(attribute)
    if (size and values.size % size) or (not size and values.size):
        place = f"<Attribute Name={attribute.get('Name')!r}>"
        raise source.error(f"holds {values.size} values for {size} rows", place)
    width = values.size // size if size else values.shape[-1] if values.ndim == 2 else 1
    return values.reshape(size) if width == 1 else values.reshape(size, width)


def _put_together(
    source: XdmfSource,
    points: Floats,
    parts: list[_Part],
    node: dict[str, NDArray],
    fields: dict[str, Any],
    noted: dict[str, Any],
    said: list[str],
) -> Mesh:
    """Assemble the mesh from all parts."""
    sizes = [len(cells.ends) for cells, _ in parts]
    blocks, place = blocks_of(source, joined([cells for cells, _ in parts], [0] * len(parts)), old=False)
    data = merged(((data, n) for (_, data), n in zip(parts, sizes, strict=True)), said, "cell")
    if noted:
        data, place = _own(data, place, noted)
    elif len(parts) > 1:
        blocks, place, data = _without_repeats(blocks, place, data, parts, np.repeat(np.arange(len(parts)), sizes))
    return assembled(points, blocks, place, (data, node), fields, noted, said, {"cell": _noted_groups(noted)})


def _own(data: dict[str, NDArray], place: Ints, noted: dict[str, Any]) -> tuple[dict[str, NDArray], Ints]:
    """Data without the attributes that lacmesh's writer added, and the cells' positions in the order that it noted."""
    own = noted.get("own", [])
    order = data.get(PLACE)
    data = {name: values for name, values in data.items() if name not in own}
    if order is None or order.dtype.kind not in "iu" or PLACE not in own:
        return data, place
    if not np.array_equal(np.sort(order), np.arange(len(place))):
        return data, place
    back = np.argsort(order)
    return {name: values[back] for name, values in data.items()}, order[place]


def _noted_groups(noted: dict[str, Any]) -> dict[str, Ints]:
    """All groups noted in a file of lacmesh, in order and still empty: a group without cells has no attribute."""
    names = noted.get("names", {}).get("cell", {})
    keys = noted.get("groups", ())
    return {names.get(key, key.removeprefix(GROUP)): np.empty(0, np.int64) for key in keys}


def _without_repeats(
    blocks: dict[str, Ints], place: Ints, data: dict[str, NDArray], parts: list[_Part], part: Ints
) -> tuple[dict[str, Ints], Ints, dict[str, NDArray]]:
    """Leave out cells that repeat one of an earlier part, which gets their attributes; `part` (n,): of each cell."""
    first = np.arange(len(place))
    begin = 0
    for nodes in blocks.values():
        here = place[begin : begin + len(nodes)]
        label, _ = label_rows(np.sort(nodes, axis=1))
        first[here] = here[np.unique(label, return_index=True)[1][label]]
        begin += len(nodes)
    repeated = np.flatnonzero(part[first] < part)
    for name, values in data.items():
        has = np.array([name in of_part for _, of_part in parts])
        wanted = repeated[has[part[repeated]] & ~has[part[first[repeated]]]]
        values[first[wanted]] = values[wanted]
    kept = np.ones(len(place), bool)
    kept[repeated] = False
    bounds = np.cumsum([0, *(len(n) for n in blocks.values())])
    left = {
        cell_type: n[kept[place[a:b]]] for (cell_type, n), a, b in zip(blocks.items(), bounds, bounds[1:], strict=False)
    }
    renumbered = np.cumsum(kept) - 1
    return left, renumbered[place[kept[place]]], {name: values[kept] for name, values in data.items()}
