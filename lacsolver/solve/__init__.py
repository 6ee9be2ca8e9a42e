"""Equilibrium, from one linear system to the steps of a case."""
