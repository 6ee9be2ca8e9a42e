"""Multigrid by smoothed aggregation, in one process and in several: hierarchy of levels, V-cycle, Krylov iteration."""
