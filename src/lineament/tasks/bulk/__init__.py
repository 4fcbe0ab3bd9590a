"""Many logs into one data set, over threads, processes or a cluster.

A log is the unit of work: it goes to one worker and comes out as one file, whole or not at all.
What became of each stands in the manifest of the data set.
"""

from .manifest import MANIFEST, Manifest, Row
from .run import Bulk, extract_logs
from .workers import Processes, Threads, dask_executor

__all__ = [
    "MANIFEST",
    "Bulk",
    "Manifest",
    "Processes",
    "Row",
    "Threads",
    "dask_executor",
    "extract_logs",
]
