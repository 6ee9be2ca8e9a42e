"""Sectors of rings with radii from 1 to 2, and whole rings of the same cells (`verification.meshes.sectors`)."""

from __future__ import annotations

from verification.meshes import sectors as meshes

RADII = (1.0, 2.0)


def sector(cell, counts, sectors, *, skew=0.0):
    """One of `sectors` of a ring; `skew`: how far radii shift from one side to the other."""
    return meshes.sector(cell, counts, RADII, sectors, skew=skew)


def ring(cell, counts, sectors):
    """The whole ring of the same cells."""
    return meshes.whole(cell, counts, RADII, sectors)
