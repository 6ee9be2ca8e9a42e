"""The boundary value problem of a case: its mesh and cut, loads, rigid-body motions, and overlap of bodies."""
