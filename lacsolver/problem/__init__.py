"""The problem of a case: its mesh and cut, what acts on its bodies, their rigid-body motions, their overlap."""
