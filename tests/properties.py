"""Properties of every cut: those that the verification counts, and where the children of a cell stand in the file."""

import numpy as np

from verification.measures.cutting import PROPERTIES, violations

FILLED, POSITIVE, CONFORMING, UNTOUCHED, IN_ORDER, DOFS, KEPT = PROPERTIES


def hold(before, cut, *names):
    """Assert that a cut has the properties of these names, or all; where groups and numbers are kept, see `follow`."""
    found = violations(before, cut)
    assert not {name: count for name, count in found.items() if count and name in (names or PROPERTIES)}
    if not names or KEPT in names:
        follow(before, cut)


def follow(before, cut):
    """Groups keep their order; children stand where their cell stood, the first with its number; rings end alike."""
    after = cut.mesh
    assert list(after.cell_groups) == list(before.cell_groups)
    origin, first = np.where(cut.parent_of_cell >= 0, cut.parent_of_cell, after.cell_number), {}
    for cell in np.arange(after.n_cells) if after.file_order is None else after.file_order:
        first.setdefault(int(origin[cell]), int(after.cell_number[cell]))
    assert all(a == b for a, b in first.items())
    old_order = np.arange(before.n_cells) if before.file_order is None else before.file_order
    assert list(first) == before.cell_number[old_order].tolist()
    for *ring, centre in (faces for faces in cut.faces_of_macro if len(faces) == 5):
        inner, *outer = (next(after.select(np.array([face])))[2][0].tolist() for face in (centre, *ring))
        assert [nodes[3] for nodes in outer] == inner[:4]
