"""Numba functions of arrays. They know no objects, files or methods, and check nothing.

Each works on the workspace of one scan and allocates nothing. In all of them, `floats` and `ints`
are that workspace (see `layout`), `bearings` the cosines and sines of the beams, shape (2, n),
`circular` is whether the scan is a full circle, and `noise` is (sigma, proportional, bearing,
quantum), see `lineament.RangeNoise`. Parameters of a method come as a plain tuple, which Python
passes in half the time of a named one; the kernel names them.
"""

from numba import njit

#: Compiled on first use, cached on disk, without the GIL. No fastmath: NaN means something here.
kernel = njit(cache=True, nogil=True, error_model="numpy")

_INTERNAL = {
    "nogil": True,
    "error_model": "numpy",
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
}

#: For what only kernels call: without the wrappers for Python and C, which take time to compile.
helper = njit(**_INTERNAL)

#: For what takes tuples of arrays: to hand them over takes a tenth of a microsecond and more.
inlined = njit(forceinline=True, **_INTERNAL)

#: For what adds up many numbers: the order may change, so that four are added at once.
sums = njit(fastmath={"reassoc"}, **_INTERNAL)

#: For arithmetic whose last digit does not matter: a product and a sum are rounded at once.
contracted = njit(fastmath={"contract"}, **_INTERNAL)

#: The fourth powers of larger ranges, and of the inverse of smaller ones, are no numbers [m].
LARGEST = 1e60

#: No scanner sees nearer or farther [m], and the fourth powers of much less or more are no numbers.
NEAREST, FARTHEST = 1e-6, 1e3


@helper
def usable(r, range_min, range_max):
    """Whether a range is finite, positive, at least `range_min` and below `range_max`."""
    return (r > 0.0) & (r >= range_min) & (r < range_max)
