"""Numba functions of arrays. They know no objects, files or methods, and check nothing.

The functions that the methods call work on the rows of a block of scans (see `layout`), so that
one call serves one scan or many. They allocate nothing.
"""

from numba import njit

#: Compiled on first use, cached on disk, without the GIL. No fastmath: NaN means something here.
kernel = njit(cache=True, nogil=True, error_model="numpy")

#: For what only kernels call: without the wrappers for Python and C, which take time to compile.
helper = njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)

#: For what adds up many numbers: the order may change, so that four are added at once.
sums = njit(
    nogil=True,
    error_model="numpy",
    fastmath={"reassoc"},
    no_cpython_wrapper=True,
    no_cfunc_wrapper=True,
)


@helper
def usable(r, range_min, range_max):
    """Whether a range is finite, positive, at least `range_min` and below `range_max`."""
    return (r > 0.0) & (r >= range_min) & (r < range_max)
