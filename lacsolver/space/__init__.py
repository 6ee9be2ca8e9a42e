"""The displacement space: unknowns, quadrature, fields, and the nodes that a record of the case acts on."""
