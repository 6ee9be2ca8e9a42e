"""Unknowns of an equilibrium, and the quantities that laws keep from step to step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacsolver.contact.anchors import Anchors


class Iterate(NamedTuple):
    """Unknowns q (n,), pressures p (m,), and the active set (m,) of the last solve."""

    q: NDArray[np.floating]
    p: NDArray[np.floating]
    active: NDArray[np.bool_]


class Histories(NamedTuple):
    """Quantities that laws and the time scheme keep from step to step.

    `materials`: an array (cells, points, n) for each block of the space, () if no law has a history. `contact`: an
    array (rows, n) for each contact pair, () at the start. `scheme`: arrays of the time scheme, such as velocities, by
    name. `anchors`: those of the friction of each contact pair, () at the start.
    """

    materials: tuple[NDArray[np.floating], ...] = ()
    contact: tuple[NDArray[np.floating], ...] = ()
    scheme: Mapping[str, NDArray[np.floating]] = {}
    anchors: tuple[Anchors, ...] = ()
