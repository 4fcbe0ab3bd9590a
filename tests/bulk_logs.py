"""Small logs for the tests of bulk extraction, and a method that its worker does not survive."""

import json
import os
import signal
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow.dataset as ds
from lineament_lab.methods.iepf import IEPF

from lineament import LaserScan
from lineament.logs import save_npz
from lineament.methods.parameters import parameter


def corner_log(path, scans=3, beams=121):
    """Write scans of the corners of a room."""
    bearings = np.linspace(-1.0, 1.0, beams)
    step = 2.0 / (beams - 1)
    path.parent.mkdir(parents=True, exist_ok=True)
    corner = 2.0 / np.maximum(np.cos(bearings), 1.2 * np.abs(np.sin(bearings)))
    nearness = np.random.default_rng(scans).uniform(0.5, 1.0, scans)
    items = [LaserScan(near * corner, -1.0, step, stamp=0.1 * k) for k, near in enumerate(nearness)]
    save_npz(path, items)
    return path


def flaser_log(path, scans):
    """Write a log that takes a while."""
    ranges = " ".join(f"{2 + 0.01 * (k % 60):.2f}" for k in range(181))
    path.write_text(f"FLASER 181 {ranges} 0 0 0 0 0 0 1.0 robot 1.0\n" * scans)
    return path


def rows_of(folder):
    """Read the manifest as anyone would, by name."""
    lines = Path(folder, "_manifest.jsonl").read_text(encoding="utf-8").splitlines()
    return {row["name"]: row for row in map(json.loads, lines)}


def outcomes(folder):
    return {name: row["outcome"] for name, row in rows_of(folder).items()}


def table_of(folder):
    """Read a data set as one table."""
    table = ds.dataset(folder, partitioning="hive").to_table()
    return table.unify_dictionaries().combine_chunks()


def halves(folder):
    return [path for path in Path(folder).rglob("*") if path.name.endswith(".part")]


@dataclass(frozen=True)
class Deadly(IEPF):
    """Ends its process at scans of so many beams: always, or while there is the file MARKER."""

    fatal_beams: int = parameter(0, "beams of the scans at which the process ends")
    is_once: bool = parameter(False, "whether it ends only where it can remove the marker")

    def own_arrays(self, beams):
        if beams == self.fatal_beams:
            if not self.is_once:
                os._exit(3)
            marker = Path(os.environ["MARKER"])
            if marker.exists():
                marker.unlink()
                os.kill(os.getpid(), signal.SIGKILL)
        return super().own_arrays(beams)
