"""What a run writes, into one folder: tables and figures of every step, fields and states of some (docs/output.md).

    folder = where, checked before anything is solved; nothing is written or lost yet   (folder, names)
    writer = what is written when: after every step, and at the end                     (writer)
        results.json                                                                    (summary)
        history.csv, contact_NAME.csv                                                   (tables)
        solid.pvd, contact_NAME.pvd and their VTU files, or results.med                 (parts, vtu, med, journal)
        state_NUMBER.npz                                                                (states)
    restart = a state that was written, for the same case                               (states)

The writers know records (`lacsolver.results.results`), and nothing of how they were found.
"""

from lacsolver.output.folder import OutputFolder, create
from lacsolver.output.states import check_same, read_state
from lacsolver.output.writer import Writer

__all__ = ["OutputFolder", "Writer", "check_same", "create", "read_state"]
