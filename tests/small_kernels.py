"""Small kernels for tests of how kernels are compiled and kept: a process that takes one imports little else."""

import numpy as np

from lacmesh.kernels import kernel


@kernel
def double(x):
    return 2 * x


@kernel
def fractions(a, b):
    """Operations that plain Python treats otherwise: a number or an array entry over zero, the root of a negative."""
    return 1.0 / b, a[0] / b, a[0] / a[1], np.sqrt(a[2])
