"""Output of a run, in one folder: tables and figures of every step, fields and states of some (docs/output.md).

    folder = checked before anything is solved, when nothing is written or lost yet     (folder, names)
    writer = writes after every step, and at the end                                    (writer)
        results.json                                                                    (summary)
        history.csv, contact_NAME.csv                                                   (tables)
        mesh.npz, state_NUMBER.npz: fields, and what a restart needs                    (states, store)
        solid.pvd, contact_NAME.pvd and their VTU files, for ParaView                   (parts, vtu)
    restart = a state of an earlier run of the same case                                (states)
    export = results.med, from the files of a finished run                              (med)

The writers use only the records of `lacsolver.results.results`, and do not depend on the solver.
"""

from lacsolver.output.folder import OutputFolder, create_output
from lacsolver.output.states import check_same, read_state
from lacsolver.output.writer import Writer

__all__ = ["OutputFolder", "Writer", "check_same", "create_output", "read_state"]
