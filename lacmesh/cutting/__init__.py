"""The cut of a slave skin into macro-elements: the plan, the new cells, the new mesh, and the records of the cut."""
