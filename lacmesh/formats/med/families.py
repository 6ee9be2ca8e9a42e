"""Groups and MED's families: a family is a set of cells (negative number) or nodes (positive) in the same groups.

A node or cell belongs to one family, a family to any number of groups, family 0 to none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import h5py
import numpy as np

from lacmesh.formats.med.hdf5 import Branch, Name, add_group, add_names, text
from lacmesh.mesh import Ints

#: family number -> the names of its groups
Families = dict[int, list[str]]

#: Bytes of a group's name.
NAME_SIZE = 80


def derive(groups: Mapping[str, Ints], dim: Ints) -> tuple[Ints, list[tuple[str, ...]]]:
    """Family number (n,) of each cell or node, and the groups of families 0, 1, 2, ...

    One family for each dimension `dim` (n,) and combination of groups (of a family with several dimensions gmsh names
    only the highest), and one more, without members, for all empty groups.
    """
    family = np.zeros(len(dim), np.int32)
    combined: list[tuple[str, ...]] = [()]
    for name, members in groups.items():
        before = family[members]
        families = np.flatnonzero(np.bincount(before))
        after = np.zeros(int(before.max(initial=0)) + 1, np.int32)
        after[families] = len(combined) + np.arange(len(families))
        family[members] = after[before]
        combined += [(*combined[k], name) for k in families]
    split = np.where(family > 0, 4 * family + dim, 0)
    used = np.union1d(0, np.flatnonzero(np.bincount(split)))
    number = np.zeros(4 * len(combined), np.int32)
    number[used] = np.arange(len(used))
    empty = tuple(name for name, members in groups.items() if not len(members))
    return number[split], [combined[k // 4] for k in used] + ([empty] if empty else [])


def write(parent: h5py.Group, place: str, families: Sequence[tuple[str, ...]], sign: int) -> None:
    """Write the families of cells (`place` ELEME, `sign` -1) or nodes (NOEUD, 1), except family 0."""
    if len(families) < 2:
        return
    home = add_group(parent, place)
    for k, names in enumerate(families[1:], 1):
        family = add_group(home, f"FAM_{sign * k}", NUM=sign * k)
        add_names(add_group(family, "GRO", NBR=len(names)), list(names), NAME_SIZE)


def read(root: Branch, mesh: Branch, name: Name, said: list[str]) -> tuple[Families, Families]:
    """Read the families of cells and those of nodes of the mesh `name`; MED 2.3 keeps them inside the mesh."""
    of_cells: Families = {}
    of_nodes: Families = {}
    for place, home in _homes(root, mesh, name):
        for family in [home] if home.has_attribute("NUM") else [f for _, f in home.branches()]:
            number = family.integer("NUM")
            table = {"ELEME": of_cells, "NOEUD": of_nodes}.get(place, of_cells if number < 0 else of_nodes)
            table.setdefault(number, []).extend(_names(family))
            if family.has("ATT") and "attributes of families are left out" not in said:
                said.append("attributes of families are left out")
    return of_cells, of_nodes


def _homes(root: Branch, mesh: Branch, name: Name) -> list[tuple[str, Branch]]:
    if mesh.has("FAS"):
        return [(text(n), b) for n, b in mesh.branch("FAS").branches()]
    if root.has("FAS") and root.branch("FAS").has(name):
        return [(text(n), b) for n, b in root.branch("FAS").branch(name).branches()]
    return []


def _names(family: Branch) -> list[str]:
    if not family.has("GRO"):
        return []
    groups = family.branch("GRO")
    raw = groups.raw("NOM")
    count = groups.integer("NBR", len(raw) // NAME_SIZE)
    if not 0 <= count * NAME_SIZE <= len(raw):
        raise groups.error(f"holds {len(raw)} bytes for {count} names of {NAME_SIZE}", "NOM")
    return [text(raw[k * NAME_SIZE : (k + 1) * NAME_SIZE]) for k in range(count)]


def members(family: Ints, families: Families) -> dict[str, Ints]:
    """Sorted indices of each group, from the family number of each cell or node; groups without members included."""
    order = np.argsort(family, kind="stable")
    ordered = family[order]
    starts = np.flatnonzero(np.diff(ordered, prepend=ordered[:1] - 1))
    pieces: dict[str, list[Ints]] = {name: [] for names in families.values() for name in names}
    for lo, hi in pairwise([*starts, len(ordered)]):
        for name in families.get(int(ordered[lo]), ()):
            pieces[name].append(order[lo:hi])
    return {name: np.sort(np.concatenate([*pieces[name], order[:0]])) for name in sorted(pieces)}


def undefined(used: Ints, families: Families, what: str) -> list[str]:
    """Message about those of the family numbers in use, ascending, that the file does not define; none if it does."""
    unknown = [number for number in used.tolist() if number and number not in families]
    return [f"{what} in {len(unknown)} undefined families (as {unknown[0]}) get no group from them"] if unknown else []
