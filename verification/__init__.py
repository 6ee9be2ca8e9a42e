"""Does the solver keep what the method promises? Cases with exact solutions, run through the public API, and rates."""
