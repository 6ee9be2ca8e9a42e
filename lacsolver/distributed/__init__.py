"""Distributed solution with PETSc over MPI: the processes of a run, and the share of the model that each has."""
