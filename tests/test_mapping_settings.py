"""Settings of maps and places that were tuned on recordings, and that no single case shows.

The figures of docs/results.md and docs/notebook.md are theirs: `benchmarks/mapping.py`,
`benchmarks/locating.py` and `benchmarks/sessions.py` measure them again.
"""

import importlib

import numpy as np
import pytest

SETTINGS = {
    "adjust": {"_KERNEL": 3.0, "_WIDE": 256.0, "_WIDER": 4, "_ROUNDS": 4, "_SMALL": 1e-4,
               "_HELD": 1e11, "_BATCH": 200, "_DENSE": 6000},
    "again": {"APART": 0.015, "_KNOWN": 0.1, "_NEAR": 1.0, "_ROUNDS": 3},
    "around": {"ROUGHNESS": 0.01, "_MILD": -0.8, "_PASSED": 0.5, "_ROUNDS": 4, "_SURE": 0.75,
               "_SURER": 0.97, "_STEPS": 3, "_FARTHEST": 5.0, "_BEAMS": 120,
               "_SIFTED": ((12, 150), (40, 32)), "_WIDE": 0.12, "_FINAL": 0.07, "_TIGHT": 0.04,
               "_APART": (0.15, 0.06), "_CHOSEN": 12, "USUAL": 0.5, "_FREEDOM": 3.0, "_LOST": 0.38,
               "_AGREE": 0.75, "_CLEAR": 10.0, "_LAST": 60.0, "_OTHER": 0.3, "_DOUBT": 4.0,
               "_NEAR": np.diag((0.05, 0.05, 0.02)) ** 2},
    "chain": {"TWICE": 25.0, "_LEAST": np.diag((0.02, 0.02, 0.01)) ** 2, "_LASTING": 2.5,
              "_FEW": 10.0, "_USUAL": 0.2, "_BESIDE": 6, "_SAME": (0.3, 0.3)},
    "drive_map": {"REMEMBERED": 30, "_SLOWEST": 3.0, "_LASTING": 0.5, "_CONTRADICTED": 5.0,
                  "_ADDED_UP": np.diag((0.2, 0.2, 0.0)) ** 2, "_SOON": 0.1,
                  "UNKNOWN": np.diag((10.0, 10.0, 1.0)) ** 2},
    "parts": {"_LEAST": 5.0},
    "evidence": {"RIGHT_ON_MAP": (0.84, 0.13, 0.03), "WRONG_ON_MAP": (0.19, 0.43, 0.38),
                 "OF_MAPS": ((0.80, 0.17, 0.03), (0.39, 0.33, 0.28)), "DENSITY": 0.3,
                 "GOES_ON": 4.0},
    "following": {"DENIED": 0.12, "SEEN": 1.0, "_TIGHT": 0.03},
    "gone": {"_PIECE": 0.5, "_BEAMS": 360, "_THROUGH": 2},
    "hypotheses": {"ALIKE": np.radians(12), "OF_ENDS": 0.5, "LEAST_TURN": 0.3, "BOX": 0.6,
                   "TURN": np.radians(12)},
    "index": {"MAPPED": 0.045, "_CELL": 0.75, "_MOST_CELLS": 4_000_000},
    "joining": {"_SPREADS": ((0.8, 0.12), (0.3, 0.06)), "_AGREE": 16.0,
                "_BENT": np.diag((0.1, 0.1, 0.02)) ** 2, "_FEWEST": 2, "_MORE": 3},
    "locate": {"TRIED": 800, "SIFTED": 60, "REFINED": 24, "JUDGED": 20, "_FEWEST_BEAMS": 12,
               "_FEW_BEAMS": 40, "_NEAR": (0.15, 0.06), "_SAME": (0.06, 0.02), "_WIDE": 0.12,
               "_TIGHT": 0.02, "VOTED": 16, "SURE_ON_MAP": np.log(100),
               "LEAD": 12.0, "FAR": 0.5, "BOTH": 18.0, "BOTH_ON_MAP": 30.0,
               "_SLIDES": np.kron((0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0), (-1.0, 1.0))},
    "loops": {"_QUERY": 5.0, "_PLAN": 5.0, "_EVERY": 2.0, "_BEFORE": 12.0, "_STRETCHES": 3,
              "_NEAR": 2.0, "_FARTHEST": 25.0, "_SCANS": 6,
              "FLOOR": np.diag((0.02, 0.02, 0.005)) ** 2},
    "making": {"_ROUGH": 0.01, "_OFTEN": 8, "_SMOOTHEST": 1e-5, "_ROUGHEST": 0.05,
               "VIEWS": 3},
    "placing": {"PLACES": 3.0, "_AGREE": (0.5, 0.05), "_OFF": 3.0, "_NEAR": (0.2, 0.05),
                "_LOOK_THROUGH": 0.5, "FEWEST": 3, "_MORE": 3},
    "refine": {"COARSE": (0.25, 0.07), "FINE": (0.06, 0.02), "ROUGH": 0.01, "_ROUNDS": 6},
    "sessions": {"_ROUNDS": 3, "_ALONG": 0.7},
    "walls.sights": {"LEAST_SURE": 0.2, "_TURN": 0.35},
}  # fmt: skip


@pytest.mark.parametrize("name", SETTINGS)
def test_settings_are_those_that_the_results_were_measured_with(name):
    home = "lineament" if "." in name else "lineament.mapping"
    module = importlib.import_module(f"{home}.{name}")
    for key, value in SETTINGS[name].items():
        np.testing.assert_allclose(getattr(module, key), value, rtol=1e-12, err_msg=key)
