"""Decks of CalculiX and Abaqus as cases: `import_deck` makes the mesh and the case file of what lacsolver has.

A deck is read card by card, without parts (`lacmesh.formats.inp.carry`): `interpret` takes each card to its handler in
`table` (`material_cards`, `model_cards`, `step_cards`), which adds to a `DeckContent`. `model_records`, `load_records`,
`body_records` and `motion_records` then draft the records of the case, and `groups` the groups of its mesh. What
lacsolver has no place for is an error with file, line and card if it changes the answer, else a note.
"""

from __future__ import annotations

from lacsolver.decks.importing import Imported, import_deck

__all__ = ["Imported", "import_deck"]
