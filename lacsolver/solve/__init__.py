"""Solution of the equilibrium with contact: linear systems, active sets, Newton's method, steps of a case."""
