"""Distributed solution with PETSc over MPI: start of the processes (ranks), their errors, and the share of each."""
