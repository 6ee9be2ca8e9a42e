"""Solvers that are broken on purpose: each takes pytest's monkeypatch, which puts things right again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array

import lacsolver.contact.interface as interface
import lacsolver.contact.tangent as tangent
import lacsolver.problem.pair
from lacmesh.cutting.records import Cut
from lacmesh.surface.normals import normals_of
from lacmesh.surface.place import CENTROID
from lacsolver.saddle.contact_system import ContactSystem
from verification.families import balance, sliding
from verification.families.inf_sup import uncut


def tilted_normal(patch, angle=0.01):
    """The contact normal is turned by an angle."""

    def turned(slave, master, points):
        across = points.normal[:, [1, 0, 2]] * [-1.0, 1.0, 0.0] if slave.dim == 1 else _across(points.normal)
        return np.cos(angle) * points.normal + np.sin(angle) * across

    _with_normals(patch, turned)


def masters_normal(patch):
    """The normal is the master's, while gaps and places are along the slave's."""

    def of_master(slave, master, points):
        n = normals_of(interface.tangents(master, points.master, points.xi_master))
        return -n / np.linalg.norm(n, axis=1, keepdims=True)

    _with_normals(patch, of_master)


def few_points(patch):
    """One point a piece, wherever two skins meet: right for functions that are linear, and plane faces."""
    patch.setattr("lacmesh.surface.points.pair_rule", lambda slave, *_: np.full(len(slave.type), CENTROID))
    patch.setattr("lacmesh.surface.points.gauss_points", lambda s, m, parts, *_: np.ones(len(parts.slave), np.int64))


def dropped_macro(patch):
    """The first macro-element of each zone never meets its master."""
    right = lacsolver.problem.pair.ContactPair.above_threshold

    def above_threshold(joint, face):
        found = right(joint, face)
        found[0] = False
        return found

    patch.setattr(lacsolver.problem.pair.ContactPair, "above_threshold", above_threshold)


def frozen_set(patch, blind=True):
    """Rows stay as they are, open or closed; `blind`: and the solver does not look at the conditions of contact."""
    patch.setattr(ContactSystem, "next_active", lambda self, active, p: active)
    if blind:
        patch.setattr(ContactSystem, "residuals", lambda self, p, active: np.zeros(len(self.G)))


def not_cut(patch):
    """The cut leaves all faces as they are, each a macro-element."""
    patch.setattr(
        "lacmesh.cutting.cut.cut_skin", lambda mesh, slave, **_: Cut(mesh if mesh.zones else uncut(mesh, slave))
    )


def stiff_normal(patch):
    """The tangent takes normals for fixed: they are taken at the nodes, where their derivative is left out."""
    others, motion = tangent.other_normals, tangent.motion_of

    def fixed(*given):
        right = others(*given)
        return right._replace(derivative=csr_array(right.derivative.shape))

    def at_nodes(face, slave, master, pairing, dim):
        return motion(face, slave, master, replace(pairing, normals="smoothed"), dim)

    patch.setattr(tangent, "other_normals", fixed)
    patch.setattr("lacsolver.contact.tangent.motion_of", at_nodes)


def _across(normal):
    """(n, 3): unit vectors at a right angle to unit vectors (n, 3)."""
    other = np.eye(3)[np.abs(normal).argmin(axis=1)]
    found = np.cross(normal, other)
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def _with_normals(patch, normals):
    right = interface.contact_points

    def points(slave, master, **options):
        found = right(slave, master, **options)
        return replace(found, normal=normals(slave, master, found))

    patch.setattr(interface, "contact_points", points)


def no_heights(patch):
    """Smooth surfaces are their flat faces."""
    patch.setattr("lacmesh.smooth.heights.height_of", lambda *_: None)


def apart(patch):
    """Bodies are moved so that they never meet."""
    patch.setattr(balance, "_DOWN", 0.1)


def unequal_forces(patch):
    """The largest force on the slave is a little larger than that on the master."""
    right = balance.solve

    def off(text, mesh):
        solved = right(text, mesh)
        force = solved.state.zones[0].force
        force[np.abs(force).max(axis=1).argmax()] *= 1 + 1e-9
        return solved

    patch.setattr(balance, "solve", off)


def other_pressure(patch):
    """A block that slides is pressed a little more than is asked for."""
    right = sliding.slid
    patch.setattr(sliding, "slid", lambda given, n: right(replace(given, pressure=50.1), n))
