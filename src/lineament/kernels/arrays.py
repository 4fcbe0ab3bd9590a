"""Types of what kernels take: they are compiled for these when the package is built.

A name has the kind of the numbers and the dimensions. All arrays are contiguous, rows first.
"""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray

Floats1 = Annotated[NDArray[np.float64], 1]
Floats2 = Annotated[NDArray[np.float64], 2]
Floats3 = Annotated[NDArray[np.float64], 3]
Singles2 = Annotated[NDArray[np.float32], 2]
Ints1 = Annotated[NDArray[np.int64], 1]
Ints2 = Annotated[NDArray[np.int64], 2]
Shorts2 = Annotated[NDArray[np.int32], 2]
Bytes1 = Annotated[NDArray[np.int8], 1]
