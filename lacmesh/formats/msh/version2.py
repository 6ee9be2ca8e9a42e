"""The sections of msh 2.0, 2.1 and 2.2: nodes, elements one by one, periodic links.

In ASCII an element is its number, type, count of tags, tags and nodes. In binary such elements follow a header: type,
count of elements, count of tags; gmsh writes one element per header. gmsh writes a cell of several physical groups once
for each of them: such elements are made one cell again. We write it once, with the first physical group of its entity.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.formats.entities import Assignment
from lacmesh.formats.msh.reader import LARGEST_TAG, TYPE_NAMES, UNKNOWN_TYPE, Elements, MshReader
from lacmesh.formats.msh.streams import Output
from lacmesh.formats.orders import file_order
from lacmesh.indices import by_value, repeated
from lacmesh.kernels import kernel
from lacmesh.mesh import Ints, Mesh, Tag, concatenated, mask_of, positions
from lacmesh.topology.skin import label_rows

#: Nodes of an element by gmsh's number of its type, 0 where it is unknown.
N_NODES = np.zeros(max(TYPE_NAMES) + 1, np.int64)
N_NODES[list(TYPE_NAMES)] = [ALL_CELLS[name].n_nodes for name in TYPE_NAMES.values()]


class Reader2(MshReader):
    """Reads the sections of msh 2.0, 2.1 and 2.2."""

    def read_section(self, name: str) -> bool:
        """Read the section that starts here, if it is one of those that differ between versions. Raises ReadError."""
        source = self.source
        if name == "Nodes":
            n = source.count(name)
            source.begin(name)
            self.out.nodes(*source.numbered(n, 3, "node"), error=self.error(name))
        elif name == "Elements":
            self._read_elements()
        elif name == "Periodic":
            self._read_periodic()
        elif name == "ParametricNodes":
            raise source.error("nodes with parametric coordinates in msh 2 are not read; save as msh 4.1")
        else:
            return False
        source.end()
        return True

    def complete(self) -> None:
        """Merge elements that repeat a cell for a group, and warn of them. Raises ReadError."""
        number = concatenated(e.number for e in self.elements)
        twice, further = (repeated(number) if number.min(initial=1) > 0 else None), list[tuple[Tag, Ints]]()
        if twice is not None:
            raise self.error("Elements")(f"two cells have the number {twice}")
        for e in self.elements:
            dim, (repeats, tags) = ALL_CELLS[e.type].dim, _merge(e)
            self.repeats = np.concatenate([self.repeats, repeats], axis=1)
            self.members += (((dim, tag), some) for tag, some in by_value(e.physical, e.number) if tag)
            further += (((dim, tag), some) for tag, some in by_value(tags, repeats[1]) if tag)
        self.members += further
        n_merged = self.repeats.shape[1]
        if not n_merged:
            return
        places = np.sort(concatenated(e.at for e in self.elements if e.at is not None))
        for e in self.elements:
            e.at = positions(places, e.at) if e.at is not None else None
        self.out.warnings.append(
            f"{n_merged} elements repeat another one for a further physical group, as gmsh writes overlapping "
            "groups in msh 2.2: each is one cell with its group"
        )

    def _read_elements(self) -> None:
        source = self.source
        n = source.count("Elements")
        source.begin("Elements", integers=True)
        table = source.left().astype(np.int64, copy=False)
        start = np.empty(min(n, len(table)), np.int64)
        kind, n_tags = np.empty_like(start), np.empty_like(start)
        n_found, end = find_elements(table, n, source.binary, N_NODES, start, kind, n_tags)
        source.take("int", end)
        if n_found < n:
            self._refuse(table[end : end + 3].tolist(), n - n_found)
        gmsh_types, first = np.unique(kind, return_index=True)
        for gmsh_type in gmsh_types[np.argsort(first)].tolist():
            at = np.flatnonzero(kind == gmsh_type)
            self.elements.append(self._elements(TYPE_NAMES[gmsh_type], at, table, start[at], n_tags[at]))

    def _refuse(self, head: list[int], left: int) -> None:
        """Raise the ReadError for what stands where an element should."""
        source = self.source
        source.take("int", len(head))
        early = source.binary and source.data[source.position - 12 : source.position - 4].lstrip().startswith(b"$End")
        if len(head) == 3 and not early and (kind := head[0 if source.binary else 1]) not in TYPE_NAMES:
            raise source.here(UNKNOWN_TYPE.format(kind))
        raise source.here(f"the elements end too early, or no element stands here: {left} more were announced")

    def _elements(self, name: str, at: Ints, table: Ints, start: Ints, n_tags: Ints) -> Elements:
        """The elements of one type, whose numbers are at `start`, their tags behind these. Raises ReadError."""
        source, cell = self.source, ALL_CELLS[name]
        tags_at = start + (1 if source.binary else 3)

        def tag(j: int) -> Ints:
            """The j-th tag of each element, 0 where it has no such tag."""
            return np.where(n_tags > j, table[np.minimum(tags_at + j, len(table) - 1)], 0).astype(np.int64)

        physical, elementary = tag(0), tag(1)
        partition = tag(3) if source.version == "2.2" else tag(2)
        for tags in (physical, elementary, partition):
            if tags.max() > LARGEST_TAG or tags.min() < -LARGEST_TAG:
                raise source.error("an element has a tag beyond all limits")
        nodes = np.stack([table[tags_at + n_tags + j] for j in range(cell.n_nodes)], axis=1)
        entity = np.stack([np.full(len(at), cell.dim), elementary], axis=1)
        entity[elementary <= 0] = -1
        parted = np.where(partition > 0, partition, -1) if partition.any() else -1
        return Elements(name, table[start].astype(np.int64), nodes, entity, parted, (), np.abs(physical), at)

    def _read_periodic(self) -> None:
        """Read periodic links, text in binary files too; `Affine` precedes the 16 numbers of a map, if there is one."""
        source = self.source
        source.begin("Periodic", text=True, signs=(b"Affine", b" -16 "))
        for _ in range(int(source.take("int", 1)[0])):
            dim, slave, master, n = source.take("int", 4).tolist()
            affine: tuple[float, ...] = ()
            if n == -16:
                affine = tuple(source.take("real", 16).tolist())
                n = int(source.take("int", 1)[0])
            self.check_tag(dim, slave), self.check_tag(dim, master)
            if n < 0 or not np.isfinite(affine).all():
                raise source.here("this is no periodic link")
            self.links.append((dim, slave, dim, master, affine, source.take("int", 2 * n)))


@kernel
def find_elements(table, n, binary, n_nodes, start, kind, n_tags):  # type: ignore[no-untyped-def]
    """Write the place of the number, gmsh's type and the count of tags of n elements; return how many, and their end.

    `table` (m,): the numbers of the section; `n_nodes`: those of an element by its type, 0 where it is unknown. It ends
    early at something that is no element.
    """
    n_found = place = 0
    while n_found < n and place + 3 <= len(table):
        first, second, third = table[place], table[place + 1], table[place + 2]
        gmsh_type = first if binary else second
        follow = second if binary else 1
        if gmsh_type < 0 or gmsh_type >= len(n_nodes) or n_nodes[gmsh_type] == 0:
            break
        if follow < 1 or follow > n - n_found or third < 0 or third > len(table):
            break
        size = third + n_nodes[gmsh_type]
        length = 3 + follow * (1 + size) if binary else 3 + size
        if place + length > len(table):
            break
        for k in range(follow):
            start[n_found] = place + 3 + k * (1 + size) if binary else place
            kind[n_found], n_tags[n_found] = gmsh_type, third
            n_found += 1
        place += length
    return n_found, place


def _merge(e: Elements) -> tuple[Ints, Ints]:
    """Remove elements that repeat another one for a further group; return `MshReader.repeats` and their groups' tags.

    Repeats have the same nodes in the same order and the same entity, and each another group; the smallest number is
    kept.
    """
    assert e.at is not None
    rows = np.flatnonzero(e.physical)
    if not len(rows) or e.physical.min() == e.physical.max():
        return np.empty((2, 0), np.int64), np.empty(0, np.int64)
    label, n = label_rows(np.column_stack([e.nodes, e.entity[:, 1]])[rows])
    several = np.flatnonzero(np.bincount(label, minlength=n)[label] > 1)
    several = several[np.argsort(e.number[rows[several]])]
    first, groups, merged = dict[int, int](), dict[int, set[int]](), list[tuple[int, int]]()
    alike = (label[several], rows[several], e.physical[rows[several]])
    for same, row, tag in zip(*(part.tolist() for part in alike), strict=True):
        if tag not in groups.setdefault(same, set()):  # one of a group that is there repeats it truly
            if groups[same]:
                merged.append((row, first[same]))
            first.setdefault(same, row)
            groups[same].add(tag)
    rows, keeper = np.array(merged, np.int64).reshape(-1, 2).T
    repeats, tags = np.stack([e.number[rows], e.number[keeper]]), e.physical[rows]
    kept = ~mask_of(len(e.number), rows)
    e.number, e.nodes, e.entity, e.at, e.physical = (a[kept] for a in (e.number, e.nodes, e.entity, e.at, e.physical))
    e.partition = e.partition if isinstance(e.partition, int) else e.partition[kept]
    return repeats, tags


# ---- writing


def first_group(entities: Assignment) -> Ints:
    """Tag of the one physical group of each entity that msh 2.2 has room for, 0 for none."""
    return np.array([e.groups[0] if e.groups else 0 for e in entities.entities], np.int64)


def write_sections(
    out: Output, mesh: Mesh, entities: Assignment, node_number: Ints, cell_number: Ints, partition: Ints | None
) -> None:
    """Write $Nodes, $Elements, $Periodic; `partition` (n_cells,) or None becomes tags. Types msh lacks are skipped.

    Elements are in the file's order, in runs of one type and one count of tags. Links are text in binary files too.
    """
    out.text(f"$Nodes\n{mesh.n_nodes}\n")
    out.rows(("<i4", "<f8"), node_number, mesh.points)
    out.end("Nodes")
    order = file_order(mesh)
    block = np.searchsorted(mesh.offsets, order, side="right") - 1
    kinds = np.array([ALL_CELLS[b.type].msh or 0 for b in mesh.blocks], np.int64)
    here = kinds[block] > 0
    order, block = order[here], block[here]
    group, tag = first_group(entities), np.array([e.tag for e in entities.entities], np.int64)
    parted = np.zeros(len(order), bool) if partition is None else partition[order] > 0
    alike = 2 * block + parted
    begin = np.flatnonzero(np.append(True, alike[1:] != alike[:-1])[: len(alike)])
    out.text(f"$Elements\n{len(order)}\n")
    for a, b in pairwise([*begin.tolist(), len(order)]):
        cells, k = order[a:b], int(block[a])
        tags = [group[entities.cell[cells]], tag[entities.cell[cells]]]
        if parted[a] and partition is not None:
            tags += [np.ones(b - a, np.int64), partition[cells]]
        nodes = node_number[mesh.blocks[k].nodes[cells - mesh.offsets[k]]]
        if out.binary:
            out.record("3i", kinds[k], b - a, len(tags))
            out.array(np.column_stack([cell_number[cells], *tags, nodes]).astype("<i4"))
        else:
            head = np.broadcast_to([kinds[k], len(tags)], (b - a, 2))
            out.rows((), cell_number[cells], head, *tags, nodes)
    out.end("Elements")
    links = () if mesh.model is None else mesh.model.periodic
    if not links:
        return
    out.text(f"$Periodic\n{len(links)}\n")
    for link in links:
        out.text(f"{link.slave[0]} {link.slave[1]} {link.master[1]}\n")
        if len(link.affine) == 16:
            out.text(f"Affine {' '.join(map(str, link.affine))}\n")
        pairs = node_number[np.asarray(link.nodes, np.int64).reshape(-1, 2)]
        out.text(f"{len(pairs)}\n" + "".join(f"{a} {b}\n" for a, b in pairs.tolist()))
    out.text("$EndPeriodic\n")
