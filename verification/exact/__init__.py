"""Exact solutions, from the literature or derived here; never from the solver that is tested."""
