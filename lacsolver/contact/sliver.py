"""Slivers: macro-elements of which the master covers little, whose contact condition fades with their coverage.

The rows of a macro-element with the covered measure w are of size w, but the mean gap over what is covered does not
vanish with it: a node that an edge of the master just passes would jump out of its overlap, and back. So where the
covered part is less than w_0, a twentieth of the macro-element, an overlap is allowed that grows as w falls,

    G_m + h_m w_0 (1 - w / w_0)^2 / 10 >= 0

in place of G_m >= 0: pressures of rows that come and go begin and end with 0. With w >= w_0 nothing is changed.
"""

from __future__ import annotations

import numpy as np

from lacmesh.mesh import Floats
from lacsolver.contact.interface import Interface, Pairing

#: largest part of a macro-element that is covered in a sliver
_COVERED = 0.05
#: overlap allowed where an edge of the master has crossed (3 - 5^(1/2)) / 2 of w_0, as a fraction of h
_OVERLAP = 0.1


def allowed_overlap(face: Interface, pairing: Pairing) -> tuple[Floats, Floats]:
    """Return the overlap that slivers are allowed, times w (m,), and its derivative by w, a length (m,); 0 elsewhere.

    Sizes are those of the undeformed macro-elements, or that of the whole master if it is smaller than these.
    """
    zone = face.zone
    own = zone.area
    size = np.minimum(own, zone.area_of_master)
    whole = (zone.area_of_revolution if pairing.axisymmetric else own) * pairing.thickness
    w_0, h = _COVERED * whole * size / own, size ** (1 / zone.slave.dim)
    missing = np.where(face.w > 0, np.maximum(1 - face.w / w_0, 0.0), 0.0)
    return _OVERLAP * h * w_0 * missing**2, -2 * _OVERLAP * h * missing
