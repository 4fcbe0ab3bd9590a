"""Experiments on little: a small setting, and a folder of recordings."""

from itertools import accumulate, count
from types import SimpleNamespace

import pytest
from lineament_lab.reproduce import (
    all_methods,
    contenders,
    grid,
    layers,
    machine,
    real,
    scans,
    scenes,
    similarity,
    success,
    two_corners,
)

from lineament.simulation import SENSORS

PAPER = SENSORS["paper"]


def silent(about):
    assert about


@pytest.fixture
def small(monkeypatch):
    """Few methods, sensors, kinds and parameters; each call takes 1 µs longer than the last."""
    clock = (0.5e-6 * k for k in accumulate(count())).__next__
    few = {"METHODS": ("liu",), "RIVALS": ("pdbs", "iepf")}
    here = {"machine": lambda: "this one", "version": lambda _: "1"}
    here["os"] = SimpleNamespace(sysconf=lambda _: 2**16)
    for module, changes in (
        (contenders, few),
        (scans, {"_COPIES": 1, "_BATCHES": 2, "time": SimpleNamespace(perf_counter=clock)}),
        (machine, here),
        (grid, {"RADII": (6, 8), "THRESHOLDS": (0.25, 0.66), "SCENES_A_FRAME": 1}),
        (all_methods, {"SENSORS": {"lms181": SENSORS["lms181"]}, "SCENES": ("room", "hall")}),
        (success, {"MORE": 2}),
        (two_corners, {"SCANS_A_FRAME": 2}),
        (scenes, {"INDOORS": ("room",)}),
        (similarity, {"INDOORS": ("room",), "SHOWN": ("iepf", "pdbs, fitted")}),
        (layers, {"RULES": ("fixed", "dietmayer")}),
        (real, {"SHOWN": "iepf"}),
    ):
        for name, value in changes.items():
            monkeypatch.setattr(module, name, value)
