"""Decks of CalculiX and Abaqus as cases: `import_deck` makes the mesh and the case file of what lacsolver has.

A deck is read card by card, without parts (`lacmesh.formats.inp.carry`): `importing` takes each card to its handler in
`table`, `HANDLERS[name](import_, card)`, which adds records of the case to an `Import`, or leaves to its end what later
cards decide (`histories` of loads, reference nodes); `groups` writes the groups of the mesh. The case then checks
itself. What lacsolver has no place for is an error with file, line and card if it changes the answer, else a note.
`exporting` writes a case as a deck: what CalculiX has no place for is an error with the line of the case.
"""

from __future__ import annotations

from lacsolver.decks.exporting import export_deck
from lacsolver.decks.importing import Imported, import_deck

__all__ = ["Imported", "export_deck", "import_deck"]
