"""A kernel, for tests of how kernels are kept."""

from lacmesh.kernels import kernel


@kernel
def double(x):
    return 2 * x
