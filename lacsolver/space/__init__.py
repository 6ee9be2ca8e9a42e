"""The displacement space: unknowns, quadrature, fields, and where a record of the case acts."""
