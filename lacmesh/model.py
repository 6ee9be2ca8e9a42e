"""What msh knows behind a mesh, its entities, periodic links and time steps; and what makes a mesh read-only."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from lacmesh.indices import Ints

Tag = tuple[int, int]  # (dimension, tag), gmsh's way to name a physical group or an entity


class Fixed(dict):
    """A dictionary that cannot be changed."""

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError("groups and data of a mesh are not changed; dataclasses.replace makes another mesh")

    __setitem__ = __delitem__ = __ior__ = _refuse
    update = setdefault = pop = popitem = clear = _refuse

    def __reduce__(self) -> tuple[type, tuple[dict]]:
        return type(self), (dict(self),)


def fixed(array: Any) -> NDArray:
    """Return a read-only view of an array."""
    array = np.asarray(array)
    if array.flags.writeable:
        array = array.view()
        array.flags.writeable = False
    return array


def fixed_mapping(mapping: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a read-only copy of a mapping, with read-only arrays."""
    return Fixed({name: fixed(v) if isinstance(v, np.ndarray) else v for name, v in mapping.items()})


@dataclass(frozen=True)
class Step:
    """Position of an array of `cell_data` or `node_data` in a field of several time steps."""

    field: str
    number: int = -1
    order: int = -1
    time: float = 0.0


@dataclass(frozen=True)
class Periodic:
    """A periodic link of msh: entity `slave` repeats `master`; `nodes` (n, 2) are slave and master nodes."""

    slave: Tag
    master: Tag
    affine: tuple[float, ...]
    nodes: Ints

    def __post_init__(self) -> None:
        object.__setattr__(self, "nodes", fixed(self.nodes))


@dataclass(frozen=True)
class Model:
    """Geometry behind a mesh, from msh: the signed entities that bound each entity, and the periodic links.

    A bound with a tag beyond the largest of its dimension is gmsh's way to write an entity embedded in another.
    """

    boundary: Mapping[Tag, tuple[int, ...]] = field(default_factory=dict)
    periodic: tuple[Periodic, ...] = ()
