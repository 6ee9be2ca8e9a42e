"""Comparison of two parts, field by field."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from lacmesh.mesh import Block, Mesh, Model, Periodic
from lacmesh.partition.parts import WholeMesh


def differences(one, other, place="part"):
    """The places at which two values differ, in value or type."""
    if isinstance(one, (Mesh, Model, Periodic, WholeMesh)) or place == "part":
        pairs = {f.name: (getattr(one, f.name), getattr(other, f.name)) for f in fields(one)}
    elif isinstance(one, dict):
        if one.keys() != other.keys():
            return [place]
        pairs = {name: (one[name], other[name]) for name in one}
    elif isinstance(one, (tuple, Block)) and isinstance(other, tuple):
        if len(one) != len(other):
            return [place]
        pairs = dict(enumerate(zip(one, other, strict=True)))
    elif isinstance(one, np.ndarray):
        same = one.dtype.kind == other.dtype.kind and one.shape == other.shape
        return [] if same and np.array_equal(one, other, equal_nan=one.dtype.kind == "f") else [place]
    else:
        return [] if one == other else [f"{place}: {one} {other}"]
    return [where for name, (a, b) in pairs.items() for where in differences(a, b, f"{place}.{name}")]
