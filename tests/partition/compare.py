"""Comparison of two parts, field by field."""

from dataclasses import fields, is_dataclass

import numpy as np


def differences(one, other, place="part"):
    """The places at which two values differ, in value or type."""
    if isinstance(one, np.ndarray):
        same = one.dtype.kind == other.dtype.kind and one.shape == other.shape
        return [] if same and np.array_equal(one, other, equal_nan=one.dtype.kind == "f") else [place]
    if is_dataclass(one):
        one, other = ({f.name: getattr(k, f.name) for f in fields(k)} for k in (one, other))
    elif isinstance(one, tuple) and isinstance(other, tuple):
        one, other = (dict(enumerate(k)) for k in (one, other))
    if not isinstance(one, dict):
        return [] if one == other else [f"{place}: {one} {other}"]
    if one.keys() != other.keys():
        return [place]
    return [where for name in one for where in differences(one[name], other[name], f"{place}.{name}")]
