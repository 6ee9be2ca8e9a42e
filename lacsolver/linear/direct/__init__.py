"""Direct solution of linear systems: factorisation of K by any of the libraries, and what all of these need."""
