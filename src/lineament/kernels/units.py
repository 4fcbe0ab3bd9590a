"""What of the ranges is the farthest, and how many are just that."""

import numpy as np

from . import kernel
from .arrays import Floats2, Ints1


@kernel
def find_farthest(ranges: Floats2, extent: Ints1, limit: float, farthest: Floats2):
    """Fill, for each of the first rows, the largest range below a limit and how many equal it.

    `extent` has the number of rows. The largest is 0 where there is no range above it.
    """
    for k in range(extent[0]):
        # The bits of such numbers have their order, and whole numbers are compared several at once.
        farthest[k, 0] = limit
        bits, most = ranges[k].view(np.int64), farthest[k].view(np.int64)[0]
        largest = np.int64(0)
        for i in range(len(bits)):
            largest = max(largest, bits[i] if bits[i] < most else np.int64(0))
        farthest[k].view(np.int64)[0] = largest
        distance, equal = farthest[k, 0], 0
        for i in range(len(bits)):
            equal += ranges[k, i] == distance
        farthest[k, 1] = equal
