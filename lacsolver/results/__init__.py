"""Results of a solution: states, figures, fields, the recovered pressure."""
