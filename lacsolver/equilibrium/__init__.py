"""Solution of the equilibrium with contact: active sets, Newton's method, time schemes, steps of a case."""
