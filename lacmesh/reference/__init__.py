"""Reference elements: shape functions and quadrature."""
