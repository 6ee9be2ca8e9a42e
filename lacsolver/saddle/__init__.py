"""The linear system with contact of one active set: the saddle-point problem of q and the pressures, and its solution.

rows of one pair: B and D, gap integrals, and the law that they obey           (row_group)
contact matrices B, D, G and w of all pairs, and the law of each row          (contact_system)
stiffness K on the remaining unknowns q, with its factor or its V-cycle       (stiffness, shared_stiffness)
K q + B^T p = f, D q = G, with the rows that are closed                       (saddle)
its solution: pressures first, with a factor; both together, with multigrid   (schur, coupled)
first active set of a linear problem, from a coarser level of multigrid       (coarse_start)
accuracy that solutions need                                                  (tolerances)
"""
