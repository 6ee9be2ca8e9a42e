"""A small mesh as plain lists, and writers that check nothing: what no careful program would write comes from here.

Two hexahedra in a row, SLAVE faces above, MASTER faces below, all with numbers of their own (nodes from 11, cells from
101), so that a sentence that speaks of an index instead of the file's number is seen.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any

import h5py
import numpy as np

from lacmesh.formats.med import families_of
from lacmesh.formats.orders import MED_CELLS

_MSH = {"HEXA8": 5, "QUAD4": 3, "TRIA3": 2, "SEG2": 1}
_INP = {"HEXA8": "C3D8", "QUAD4": "S4", "TRIA3": "S3", "SEG2": "B31"}
_VTK = {"HEXA8": 12, "QUAD4": 9, "TRIA3": 5, "SEG2": 3}
_XDMF = {"HEXA8": 9, "QUAD4": 5, "TRIA3": 4}
_DIM = {"HEXA8": 3, "QUAD4": 2, "TRIA3": 2, "SEG2": 1}


@dataclass
class Cell:
    """A cell: number, type (or a code of the format that stands for none), the numbers of its nodes, its group."""

    number: int
    type: Any
    nodes: list[int]
    group: str


@dataclass
class Raw:
    """The mesh; `count` overrides what a file announces: "nodes", "cells" (of a block where there are blocks)."""

    points: list[list[float]]
    node_number: list[int]
    cells: list[Cell]
    count: dict[str, int] = field(default_factory=dict)

    def runs(self):
        """Cells of one type and group, in order of appearance."""
        found = {}
        for cell in self.cells:
            found.setdefault((cell.type, cell.group), []).append(cell)
        return list(found.values())

    def groups(self):
        return list(dict.fromkeys(c.group for c in self.cells))


def two_hexahedra():
    """The mesh without a fault."""
    points = [[float(x), float(y), float(z)] for z in (0, 1) for y in (0, 1) for x in (0, 1, 2)]
    at = lambda x, y, z: 11 + x + 3 * y + 6 * z  # noqa: E731
    cells = []
    for k in (0, 1):
        low = [at(k, 0, 0), at(k + 1, 0, 0), at(k + 1, 1, 0), at(k, 1, 0)]
        high = [at(k, 0, 1), at(k + 1, 0, 1), at(k + 1, 1, 1), at(k, 1, 1)]
        cells += [Cell(101 + k, "HEXA8", low + high, "BODY"), Cell(103 + k, "QUAD4", high, "SLAVE")]
        cells.append(Cell(105 + k, "QUAD4", low[::-1], "MASTER"))
    cells.sort(key=lambda c: c.number)
    return Raw(points, list(range(11, 23)), cells)


# ---- msh


def _tag(raw, group):
    return raw.groups().index(group) + 1


def _names(raw):
    lines = [f'{_DIM.get(run[0].type, 3)} {_tag(raw, run[0].group)} "{run[0].group}"' for run in raw.runs()]
    return "\n".join(["$PhysicalNames", str(len(lines)), *lines, "$EndPhysicalNames", ""]).encode("latin-1")


def _begun(raw, version, binary):
    head = f"$MeshFormat\n{version} {int(binary)} 8\n".encode() + (b"\1\0\0\0\n" if binary else b"")
    return [head, b"$EndMeshFormat\n", _names(raw)]


def msh22(raw, binary=False):
    """msh 2.2."""
    end = b"\n" if binary else b""
    out = [*_begun(raw, "2.2", binary), f"$Nodes\n{raw.count.get('nodes', len(raw.points))}\n".encode()]
    for number, xyz in zip(raw.node_number, raw.points, strict=True):
        out.append(struct.pack("<i3d", number, *xyz) if binary else _line(number, *xyz))
    out.append(end + f"$EndNodes\n$Elements\n{raw.count.get('cells', len(raw.cells))}\n".encode())
    for cell in raw.cells:
        tag, kind = _tag(raw, cell.group), _MSH.get(cell.type, cell.type)
        row = [cell.number, tag, tag, *cell.nodes]
        out.append(struct.pack(f"<{3 + len(row)}i", kind, 1, 2, *row) if binary else _line(row[0], kind, 2, *row[1:]))
    return b"".join([*out, end, b"$EndElements\n"])


def msh41(raw, binary=False):
    """msh 4.1."""
    out = _begun(raw, "4.1", binary)

    def numbers(layout, *values):
        out.append(struct.pack("<" + layout, *values) if binary else _line(*values))

    def section(end, begin=""):
        out.append((b"\n" if binary and end else b"") + "".join(f"${one}\n" for one in (end, begin) if one).encode())

    runs = raw.runs()
    section("", "Entities")
    dims = [_DIM.get(run[0].type, 3) for run in runs]
    numbers("4q", *(dims.count(d) for d in range(4)))
    for _, run in sorted(zip(dims, runs, strict=True), key=lambda pair: pair[0]):
        tag = _tag(raw, run[0].group)
        numbers("i6dqiq", tag, *[0.0] * 3, 2.0, 1.0, 1.0, 1, tag, 0)
    section("EndEntities", "Nodes")
    numbers("4q", 1, len(raw.points), 1, 99)
    numbers("3iq", 3, 1, 0, raw.count.get("nodes", len(raw.points)))
    for number in raw.node_number:
        numbers("q", number)
    for xyz in raw.points:
        numbers("3d", *xyz)
    section("EndNodes", "Elements")
    numbers("4q", len(runs), len(raw.cells), 1, 999)
    for k, (dim, run) in enumerate(zip(dims, runs, strict=True)):
        n = raw.count.get("cells", len(run)) if k == 0 else len(run)
        numbers("3iq", dim, _tag(raw, run[0].group), _MSH.get(run[0].type, run[0].type), n)
        for cell in run:
            numbers(f"{1 + len(cell.nodes)}q", cell.number, *cell.nodes)
    section("EndElements")
    return b"".join(out)


def _line(*values):
    return (" ".join(repr(v) for v in values) + "\n").encode()


# ---- MED


def med(raw, version=(4, 1, 0)):
    """MED of a version, in its layout: before 3.0 the mesh holds what later stands in its step."""
    image, old = BytesIO(), version < (3, 0)
    with h5py.File(image, "w", libver=("earliest", "v110")) as file:
        _made(file, "INFOS_GENERALES", **dict(zip(("MAJ", "MIN", "REL"), version, strict=True)))
        home = _made(file, "ENS_MAA/mesh", DIM=3, ESP=3, REP=0, TYP=0)
        _put_cells(home if old else _made(home, f"{-1:020d}{-1:020d}", NDT=-1, NOR=-1, PDT=0.0), raw)
        families = _made(home, "FAS") if old else _made(file, "FAS/mesh")
        _made(families, "FAMILLE_ZERO", NUM=0)
        for group in raw.groups():
            names = _made(_made(families, f"ELEME/FAM_{_tag(raw, group)}", NUM=-_tag(raw, group)), "GRO", NBR=1)
            names["NOM"] = np.frombuffer(group.encode("latin-1").ljust(80, b"\0"), np.int8).reshape(1, 80)
    return image.getvalue()


def _put_cells(step, raw):
    """Nodes and cells in their group."""
    n, index = len(raw.points), {number: k + 1 for number, k in _places(raw).items()}
    nodes = step.create_group("NOE")
    _array(nodes, "COO", np.array(raw.points).T.ravel(), raw.count.get("nodes", n))
    _array(nodes, "NUM", np.array(raw.node_number), n)
    for kind in dict.fromkeys(c.type for c in raw.cells):
        cells = [c for c in raw.cells if c.type == kind]
        part = step.create_group(f"MAI/{MED_CELLS[kind].name if kind in MED_CELLS else kind}")
        rows = np.array([[index.get(number, number) for number in c.nodes] for c in cells])
        places = MED_CELLS[kind].nodes if kind in MED_CELLS else range(rows.shape[1])
        _array(part, "NOD", rows[:, list(places)].T.ravel(), raw.count.get("cells", len(cells)))
        _array(part, "NUM", np.array([c.number for c in cells]), len(cells))
        _array(part, "FAM", np.array([-_tag(raw, c.group) for c in cells]), len(cells))


def _array(parent, name, values, count):
    if name != "COO":
        values = values.astype("i8" if np.abs(values).max(initial=0) >= 2**31 else "i4")
    parent.create_dataset(name, data=values).attrs["NBR"] = np.int64(count) if abs(count) >= 2**31 else np.int32(count)


# ---- mail, inp


def mail(raw):
    """code_aster's own text."""
    lines = ["TITRE", "two hexahedra", "FINSF", "COOR_3D"]
    lines += [f"N{number} {' '.join(map(repr, xyz))}" for number, xyz in zip(raw.node_number, raw.points, strict=True)]
    lines.append("FINSF")
    for run in raw.runs():
        lines.append(str(run[0].type))
        lines += [f"M{c.number} " + " ".join(f"N{n}" for n in c.nodes) for c in run]
        lines.append("FINSF")
    for group in raw.groups():
        lines += [f"GROUP_MA NOM={group}", *(f"M{c.number}" for c in raw.cells if c.group == group), "FINSF"]
    return "\n".join([*lines, "FIN", ""]).encode("latin-1")


def inp(raw):
    """Abaqus and CalculiX: volumes and skin as elements, groups as sets."""
    lines = ["*HEADING", "two hexahedra", "*NODE"]
    lines += [f"{number}, {', '.join(map(repr, xyz))}" for number, xyz in zip(raw.node_number, raw.points, strict=True)]
    for run in raw.runs():
        lines.append(f"*ELEMENT, TYPE={_INP.get(run[0].type, run[0].type)}, ELSET={run[0].group}")
        lines += [f"{c.number}, " + ", ".join(map(str, c.nodes)) for c in run]
    return "\n".join([*lines, ""]).encode("latin-1")


# ---- vtu, xdmf


def _places(raw):
    """Number -> place from 0: cells name nodes as they were before anybody changed numbers."""
    return {**{number: k for k, number in enumerate(raw.node_number)}, **{11 + k: k for k in range(12)}}


def _indices(raw):
    """Node indices from 0; a number that no node has gives an index past the end."""
    index = _places(raw)
    return [[index.get(n, n) for n in c.nodes] for c in raw.cells]


def vtu(raw):
    """VTK's XML, ASCII; numbers and groups as arrays."""
    rows = _indices(raw)
    ends = np.cumsum([len(r) for r in rows]).tolist()
    n, m = raw.count.get("nodes", len(raw.points)), raw.count.get("cells", len(raw.cells))

    def array(kind, name, values, width=1):
        flat = " ".join(map(str, np.ravel(values).tolist()))
        head = f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{width}" format="ascii">'
        return f"{head}\n{flat}\n</DataArray>\n"

    text = (
        '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
        f'header_type="UInt64">\n<UnstructuredGrid>\n<Piece NumberOfPoints="{n}" NumberOfCells="{m}">\n'
        f"<Points>\n{array('Float64', 'Points', raw.points, 3)}</Points>\n<Cells>\n"
        + array("Int64", "connectivity", np.array([i for r in rows for i in r]))
        + array("Int64", "offsets", ends)
        + array("UInt8", "types", [_VTK.get(c.type, c.type) for c in raw.cells])
        + "</Cells>\n<PointData>\n"
        + array("Int64", "node_number", raw.node_number)
        + "</PointData>\n<CellData>\n"
        + array("Int64", "cell_number", [c.number for c in raw.cells])
        + "".join(array("UInt8", f"group:{g}", [int(c.group == g) for c in raw.cells]) for g in raw.groups())
        + "</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"
    )
    return text.encode("latin-1")


def xdmf(raw):
    """XDMF 3 with its numbers in the XML."""
    rows = _indices(raw)
    flat = [i for c, r in zip(raw.cells, rows, strict=True) for i in (_XDMF.get(c.type, c.type), *r)]
    n, m = raw.count.get("nodes", len(raw.points)), raw.count.get("cells", len(raw.cells))
    points = "\n".join(" ".join(map(repr, xyz)) for xyz in raw.points)
    text = (
        '<?xml version="1.0"?>\n<Xdmf Version="3.0">\n<Domain>\n<Grid Name="mesh" GridType="Uniform">\n'
        f'<Topology TopologyType="Mixed" NumberOfElements="{m}">\n'
        f'<DataItem Dimensions="{len(flat)}" NumberType="Int" Precision="8" Format="XML">\n'
        f"{' '.join(map(str, flat))}\n</DataItem>\n</Topology>\n"
        f'<Geometry GeometryType="XYZ">\n<DataItem Dimensions="{n} 3" NumberType="Float" Precision="8" Format="XML">\n'
        f"{points}\n</DataItem>\n</Geometry>\n"
        + _attribute("Node", "node_number", raw.node_number)
        + _attribute("Cell", "cell_number", [c.number for c in raw.cells])
        + "".join(_attribute("Cell", f"group:{g}", [int(c.group == g) for c in raw.cells]) for g in raw.groups())
        + "</Grid>\n</Domain>\n</Xdmf>\n"
    )
    return text.encode("latin-1")


def _attribute(on, name, values):
    item = f'<DataItem Dimensions="{len(values)}" NumberType="Int" Precision="8" Format="XML">'
    head = f'<Attribute Name="{name}" AttributeType="Scalar" Center="{on}">'
    return f"{head}\n{item}\n{' '.join(map(str, values))}\n</DataItem>\n</Attribute>\n"


# ---- MED 2.3 of meshes as they are


def write_old(path, mesh, med_types, faces=(), esp=True):
    """Write a whole mesh in the layout of MED 2.3, as code_aster and Salome did before 2011.

    Facts from libmed's 2.3 writers (MEDmaaCr, MEDcoordEcr, MEDconnEcr, MEDfamCr232, MEDchampEcr233), proved by
    experiment: libmed 4.2 reads these files. No step under the mesh; families inside the mesh; all names of a family in
    one array of single characters filled up with blanks, one character more than they need; in fields the support
    stands above the step; 32 bytes a name; no group tracks the order of its links.
    `med_types`: our type -> (MED's name, places); types in `faces` are kept as faces (FAC), as old files may."""
    with h5py.File(path, "w", libver=("earliest", "v110")) as file:
        _made(file, "INFOS_GENERALES", MAJ=2, MIN=3, REL=6)
        home = _made(_made(file, "ENS_MAA"), mesh.name, DIM=3 if esp else mesh.space_dim, TYP=0, DES="d")
        if esp:
            _attrs(home, ESP=mesh.space_dim)
        cell_family, cell_families = families_of(mesh.cell_groups, mesh.cell_dim)
        node_family, node_families = families_of(mesh.node_groups, np.zeros(mesh.n_nodes, int))
        nodes = _made(home, "NOE")
        n, blank = mesh.n_nodes, " " * (16 * mesh.space_dim)
        _put(nodes, "COO", mesh.points[:, : mesh.space_dim].T.ravel(), NBR=n, REP=0, NOM=blank, UNI=blank)
        _put(nodes, "FAM", node_family, NBR=n)
        _put(nodes, "NUM", mesh.node_number.astype("i4"), NBR=n)
        for block, lo in zip(mesh.blocks, mesh.offsets, strict=False):
            name, places = med_types[block.type]
            here = slice(lo, lo + len(block.nodes))
            part = home.require_group("FAC" if block.type in faces else "MAI").create_group(name)
            _put(part, "NOD", (block.nodes[:, places] + 1).T.ravel().astype("i4"), NBR=len(block.nodes))
            _put(part, "FAM", -cell_family[here], NBR=len(block.nodes))
            _put(part, "NUM", mesh.cell_number[here].astype("i4"), NBR=len(block.nodes))
        _old_families(_made(home, "FAS"), cell_families, node_families)
        _old_fields(file, mesh, med_types, faces)


def _old_families(home, cell_families, node_families):
    _made(home, "FAMILLE_ZERO", NUM=0)
    for place, families, sign in (("ELEME", cell_families, -1), ("NOEUD", node_families, 1)):
        for k, names in enumerate(families[1:], 1):
            groups = _made(_made(home, f"{place}/FAM_{k}", NUM=sign * k), "GRO", NBR=len(names))
            raw = b"".join(n.encode("latin-1").ljust(80) for n in names) + b"\0"
            kind = h5py.h5t.C_S1.copy()
            kind.set_size(1)
            dataset = h5py.h5d.create(groups.id, b"NOM", kind, h5py.h5s.create_simple((len(raw),)))
            dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, np.frombuffer(raw, "S1").copy(), mtype=kind)


def _old_fields(file, mesh, med_types, faces):
    """Whole real fields on cells, real fields on nodes over the profile of what is not NaN; one step without number."""
    for name, values in mesh.cell_data.items():
        field = _field(file, name, values)
        for block, lo in zip(mesh.blocks, mesh.offsets, strict=False):
            part = values[lo : lo + len(block.nodes)]
            _leaf(field, f"{'FAC' if block.type in faces else 'MAI'}.{med_types[block.type][0]}", mesh.name, part, "")
    for name, values in mesh.node_data.items():
        places = np.flatnonzero(~np.isnan(values))
        _put(_made(file, "PROFILS/some", NBR=len(places)), "PFL", (places + 1).astype("i4"))
        _leaf(_field(file, name, values), "NOE", mesh.name, values[places], "some")


def _field(file, name, values):
    width = 1 if values.ndim == 1 else values.shape[1]
    return _made(file, f"CHA/{name}", NCO=width, TYP=6, NOM=" " * 16 * width, UNI=" " * 16 * width)


def _leaf(field, support, mesh, values, profile):
    step = _made(field, f"{support}/{-1:20d}{-1:20d}", NDT=-1, PDT=0.0, NOR=-1, UNI=" " * 16, MAI=mesh)
    leaf = _made(step, mesh, NBR=len(values), PFL=profile or " " * 32, GAU=" " * 32, NGA=1)
    leaf.create_dataset("CO", data=values.T.ravel())


def _made(parent, name, **attributes):
    group = parent.create_group(name)
    _attrs(group, **attributes)
    return group


def _attrs(holder, **attributes):
    for name, value in attributes.items():
        if isinstance(value, str):
            holder.attrs.create(name, np.bytes_(value.encode("latin-1")))
        else:
            holder.attrs.create(name, np.int32(value) if isinstance(value, int) else np.float64(value))


def _put(parent, name, values, **attributes):
    _attrs(parent.create_dataset(name, data=values), **attributes)
