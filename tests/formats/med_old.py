"""A writer of the MED 2.3 layout, for tests: what code_aster and Salome wrote before 2011.

Facts from libmed's 2.3 writers (MEDmaaCr, MEDcoordEcr, MEDconnEcr, MEDfamCr232, MEDchampEcr233), proved by experiment:
libmed 4.2 reads these files. No step under the mesh; families inside the mesh; all names of a family in one array of
single characters filled up with blanks, one character more than they need; in fields the support stands above the
step; 32 bytes a name; no group tracks the order of its links.
"""

from __future__ import annotations

import h5py
import numpy as np

from lacmesh.formats.med.families import derive


def write_old(path, mesh, med_types, faces=(), esp=True):
    """`med_types`: our type -> (MED's name, places); types in `faces` are kept as faces (FAC), as old files may."""
    with h5py.File(path, "w", libver=("earliest", "v110")) as file:
        _group(file, "INFOS_GENERALES", MAJ=2, MIN=3, REL=6)
        home = _group(_group(file, "ENS_MAA"), mesh.name, DIM=3 if esp else mesh.space_dim, TYP=0, DES="d")
        if esp:
            _attributes(home, ESP=mesh.space_dim)
        cell_family, cell_families = derive(mesh.cell_groups, mesh.cell_dim)
        node_family, node_families = derive(mesh.node_groups, np.zeros(mesh.n_nodes, int))
        nodes = _group(home, "NOE")
        n, blank = mesh.n_nodes, " " * (16 * mesh.space_dim)
        _array(nodes, "COO", mesh.points[:, : mesh.space_dim].T.ravel(), NBR=n, REP=0, NOM=blank, UNI=blank)
        _array(nodes, "FAM", node_family, NBR=n)
        _array(nodes, "NUM", mesh.node_number.astype("i4"), NBR=n)
        for block, lo in zip(mesh.blocks, mesh.offsets, strict=False):
            name, places = med_types[block.type]
            here = slice(lo, lo + len(block.nodes))
            part = home.require_group("FAC" if block.type in faces else "MAI").create_group(name)
            _array(part, "NOD", (block.nodes[:, places] + 1).T.ravel().astype("i4"), NBR=len(block.nodes))
            _array(part, "FAM", -cell_family[here], NBR=len(block.nodes))
            _array(part, "NUM", mesh.cell_number[here].astype("i4"), NBR=len(block.nodes))
        _families(_group(home, "FAS"), cell_families, node_families)
        _fields(file, mesh, med_types, faces)


def _families(home, cell_families, node_families):
    _group(home, "FAMILLE_ZERO", NUM=0)
    for place, families, sign in (("ELEME", cell_families, -1), ("NOEUD", node_families, 1)):
        for k, names in enumerate(families[1:], 1):
            groups = _group(_group(home, f"{place}/FAM_{k}", NUM=sign * k), "GRO", NBR=len(names))
            raw = b"".join(n.encode("latin-1").ljust(80) for n in names) + b"\0"
            kind = h5py.h5t.C_S1.copy()
            kind.set_size(1)
            dataset = h5py.h5d.create(groups.id, b"NOM", kind, h5py.h5s.create_simple((len(raw),)))
            dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, np.frombuffer(raw, "S1").copy(), mtype=kind)


def _fields(file, mesh, med_types, faces):
    """Whole real fields on cells, real fields on nodes over the profile of what is not NaN; one step without number."""
    for name, values in mesh.cell_data.items():
        field = _field(file, name, values)
        for block, lo in zip(mesh.blocks, mesh.offsets, strict=False):
            part = values[lo : lo + len(block.nodes)]
            _leaf(field, f"{'FAC' if block.type in faces else 'MAI'}.{med_types[block.type][0]}", mesh.name, part, "")
    for name, values in mesh.node_data.items():
        places = np.flatnonzero(~np.isnan(values))
        _array(_group(file, "PROFILS/some", NBR=len(places)), "PFL", (places + 1).astype("i4"))
        _leaf(_field(file, name, values), "NOE", mesh.name, values[places], "some")


def _field(file, name, values):
    width = 1 if values.ndim == 1 else values.shape[1]
    return _group(file, f"CHA/{name}", NCO=width, TYP=6, NOM=" " * 16 * width, UNI=" " * 16 * width)


def _leaf(field, support, mesh, values, profile):
    step = _group(field, f"{support}/{-1:20d}{-1:20d}", NDT=-1, PDT=0.0, NOR=-1, UNI=" " * 16, MAI=mesh)
    leaf = _group(step, mesh, NBR=len(values), PFL=profile or " " * 32, GAU=" " * 32, NGA=1)
    leaf.create_dataset("CO", data=values.T.ravel())


def _group(parent, name, **attributes):
    group = parent.create_group(name)
    _attributes(group, **attributes)
    return group


def _attributes(holder, **attributes):
    for name, value in attributes.items():
        if isinstance(value, str):
            holder.attrs.create(name, np.bytes_(value.encode("latin-1")))
        else:
            holder.attrs.create(name, np.int32(value) if isinstance(value, int) else np.float64(value))


def _array(parent, name, values, **attributes):
    _attributes(parent.create_dataset(name, data=values), **attributes)
