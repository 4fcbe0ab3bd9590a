"""The recordings that benchmarks read: their folder, and logs with corrected poses by name."""

import os
from pathlib import Path

DATA = Path(os.environ.get("LINEAMENT_DATA", "../shared/data"))
LOGS = {
    "Intel lab": "truth/intel_graph.npz",
    "fr079": "truth/fr079_graph.npz",
    "ACES": "carmen/aces-corrected.log.gz",
    "CSAIL": "carmen/csail-corrected.log.gz",
    "Acapulco": "carmen/acapulco-corrected.log.gz",
    "Killian": "graph/killian.g2o.zip",
}


def logs(*names: str) -> dict[str, str]:
    """Return some of the logs, in this order."""
    return {name: LOGS[name] for name in names}
