"""Functions of arrays. They know no objects, files or methods, and check nothing.

Each works on the workspace of one scan and allocates nothing. In all of them, `floats` and `ints`
are that workspace (see `layout`), `bearings` the cosines and sines of the beams, shape (2, n),
`circular` is whether the scan is a full circle, and `noise` is (sigma, proportional, bearing,
quantum), see `lineament.RangeNoise`. Parameters of a method come as a plain tuple; the kernel
names them.

They are written for numba, and compiled by it when the package is built: `library` loads the
result. Where that is not there, or not of this source, numba compiles on first use.
"""

import math
from functools import partial
from pathlib import Path

from ..errors import LineamentError, needed_by
from ..progress import hear_compiler
from .library import HERE, NoLibraryError, load, state

try:
    _library = load()
except NoLibraryError as reason:
    #: Why numba compiles the kernels; "" if they are compiled.
    by_numba = str(reason)
    with needed_by(f"{by_numba}: lineament then"):
        from numba import config, njit
        from numba.extending import register_jitable as jitable

    hear_compiler(by_numba)  # Nobody should wait for it in silence.
    _INTERNAL = {
        "nogil": True,
        "error_model": "numpy",
        "no_cpython_wrapper": True,
        "no_cfunc_wrapper": True,
    }

    def kernel_of(home):
        """Return what compiles the kernels in a folder, for Python to call: without the GIL.

        No fastmath: NaN means something here. They may call those of this package.
        """
        # Of a cached kernel numba compares its own file, not what it calls: a folder a state.
        cache = str(Path(config.CACHE_DIR or home / "__pycache__") / state(home))

        def kernel(function):
            before, config.CACHE_DIR = config.CACHE_DIR, cache
            try:
                return njit(cache=True, nogil=True, error_model="numpy")(function)
            finally:
                config.CACHE_DIR = before

        return kernel

    kernel = kernel_of(HERE)

    #: For what only kernels call: without the wrappers for Python and C, which take time to make.
    helper = njit(**_INTERNAL)
    #: For what takes tuples of arrays: to hand them over takes a tenth of a microsecond and more.
    inlined = njit(forceinline=True, **_INTERNAL)
    #: For what adds up many numbers: the order may change, so that four are added at once.
    sums = njit(fastmath={"reassoc"}, **_INTERNAL)
    #: For arithmetic whose last digit does not matter: a product and a sum are rounded at once.
    contracted = njit(fastmath={"contract"}, **_INTERNAL)
    #: Call of a kernel with arguments that stay the same, whose contents change.
    bind = partial
else:
    by_numba = ""

    def _as_it_is(function):
        # What compiled kernels call is compiled with them.
        return function

    kernel = _library.entry

    def kernel_of(home):
        """Return what gives the compiled kernels in a folder, which may call those of this package.

        What a library has is not called by what numba compiles: they have one, or all are numba's.
        """
        try:
            return load(home).entry
        except NoLibraryError as reason:
            raise LineamentError(
                f"the kernels in {home} are not compiled ({reason}): "
                "set LINEAMENT_JIT=1, by which numba compiles all kernels"
            ) from None

    helper = inlined = sums = contracted = jitable = _as_it_is

    def bind(entry, *arguments):
        """Call of a kernel with arguments that stay the same, whose contents change."""
        return entry.bind(*arguments)


#: The fourth powers of larger ranges, and of the inverse of smaller ones, are no numbers [m].
LARGEST = 1e60

#: No scanner sees nearer or farther [m], and the fourth powers of much less or more are no numbers.
NEAREST, FARTHEST = 1e-6, 1e3

#: Square of the largest correlation of errors: rounded, covariances stay positive definite.
_MOST_ALIKE = 1.0 - 2e-9


@helper
def usable(r, range_min, range_max):
    """Whether a range is finite, positive, at least `range_min` and below `range_max`."""
    return (r > 0.0) & (r >= range_min) & (r < range_max)


@helper
def as_covariance(value, first, second):
    """Bound a covariance by the variances: it is theirs where one error outweighs all others."""
    most = _MOST_ALIKE * first * second
    if value * value > most:
        return math.copysign(math.sqrt(most), value)
    return value
