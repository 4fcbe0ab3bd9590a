"""The settings of the experiments are those of docs/results.md."""

import importlib
import math
from dataclasses import fields

import pytest
from lineament_lab.evaluation import arena
from lineament_lab.methods import controls
from lineament_lab.methods.lines import PieceMethod
from lineament_lab.reproduce import EXPERIMENTS, experiment_names

SETTINGS = {
    "definitions": {"RADIUS": 6, "_CORNER": (3.0, -1.6), "_NOISY": 263, "_NOISE": 3.7,
                    "_EDGES": ((2.3, 0.5), (1.8, 2.2), (0.7, -1.75)),
                    "_WALLS": [[(0.7, -1.75), (3.0, -1.6), (3.3, 0.2)], ((2.3, 0.5), (1.8, 2.2))],
                    "_STEPS": [(3.0, -1.6), (3.0, 0.3), (1.9, 0.5), (1.7, 1.6)]},
    "grid": {"HALF_WIDTHS": (2, 8), "RADIUS": 6, "THRESHOLD": 0.66, "GATE": 0.1,
             "RADII": (3, 4, 5, 6, 7, 8, 10, 12, 16), "SCENES_A_FRAME": 2,
             "THRESHOLDS": (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.66, 0.8, 1.0, 1.5),
             "TURNS": (0.25, 0.5, 0.75)},
    "layers": {"OF_PAPER": {"liu:paper": 95.11, "pdbs, fixed": 83.55},
               "PAPER_COUNTS": (11, 5), "SOUGHT": 400, "SCANS_A_FRAME": 4},
    "museum": {"SCANS_A_FRAME": 40, "APART": 0.1, "FAR": (1.0, 5.0), "PLACES": 5},
    "noise": {"OFF": 0.1, "SIZES": [(0.1, 0.3), (0.3, 0.6), (0.6, 1.2), (1.2, math.inf)],
              "SCANS_A_FRAME": 4},
    "real": {"SCANS_A_FRAME": 3, "STILL_A_FRAME": 10, "PAIRS_A_FRAME": 12, "ARENA_A_FRAME": 10,
             "FIRST": 9, "RATE": 0.8, "QUALITIES": (0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)},
    "repetition": {"_SEEDS": range(5), "FLAT": 0.03},
    "scans": {"MOVED": 0.3, "TURNED": math.radians(15), "_SEARCHED": 200, "_STILL": (0.001, 0.001),
              "_SCENES": 20000, "_COPIES": 8, "_BATCHES": 5},
    "scenes": {"CHOICE": 5, "NEAR": 0.98},
    "sensitivity": {"DISTANCES": (0.1, 0.15, 0.2, 0.3, 0.5, 0.8, 1.2), "SCANS_A_FRAME": 6,
                    "TOLERANCES": (0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3), "VIEWS_A_FRAME": 4},
    "similarity": {"SMALL": 0.01},
    "success": {"PAPER_PARTITION": {"liu": (0.9511, (9.6, 25.3)), "pdbs": (0.8355, (15.8, 36.3))},
                "PAPER_CORNERS": {"liu": (0.9262, (21.6, 38.2)), "iepf": (0.7251, (29.9, 53.4))},
                "MORE": 10, "CLEAR": 2.0},
    "tracking": {"SCANS_A_FRAME": 300, "_WAY": (0.02, 0.1), "_TURN": (0.01, 0.1),
                 "_FAR": 10,
                 "LOGS": {"Intel lab": ("truth/intel_graph.npz", 0.0),
                          "fr079, second half": ("truth/fr079_graph.npz", 0.5),
                          "arena, moving": ("truth/jackal_mocap_02171554.npz", 0.0),
                          "arena, static": ("truth/jackal_static_data.npz", 0.0)}},
    "two_corners": {"DISTANCE": 2.302, "GATE": 0.25, "SCANS_A_FRAME": 20,
                    "_PLACES": ((0.7, 0.9, 0.5), (2.0, 0.6, -0.4), (2.9, 1.3, 0.2),
                                (1.4, 2.3, -0.6), (2.6, 2.4, 0.1))},
}  # fmt: skip

#: What is changed in the method that the paper leaves open.
OPEN = [
    [{"half_width": n} for n in (0, 1, 2, 4, 8)],
    [{"passes": n} for n in (1, 2, 3)],
    [{}, {"sigma_d": 2.0, "sigma_r": math.sqrt(0.3)}],
    [{"spacing_scale": scale} for scale in (3, 4, 6, 8, 12)],
    [{"density_k": k} for k in (0, 1, 2, 3, 5)],
]


def test_corners_of_the_arena_are_demanded_by_these_rules():
    assert (arena.GATE, arena._JOINED, arena.FACE_BEAMS) == (0.1, 0.15, 4)
    assert (arena.FACE_WIDTH, arena.FACE_FROM, arena.FACE_TO) == (0.04, 0.1, 0.6)


def module(name):
    return importlib.import_module(f"lineament_lab.reproduce.{name}")


@pytest.mark.parametrize("name", SETTINGS)
def test_settings_are_those_of_the_results(name):
    assert {key: getattr(module(name), key) for key in SETTINGS[name]} == SETTINGS[name]


def test_what_the_paper_leaves_open_is_tried_over_these_values():
    tried = [list(values.values()) for values in module("sensitivity").OPEN.values()]
    assert tried[: len(OPEN)] == OPEN
    assert {"tangent", "product", "relative"} <= {form["response"] for form in tried[len(OPEN)]}


@pytest.mark.parametrize(
    ("control", "own"),
    [
        (controls.BlindCut, {"every": (8, 2)}),
        (
            controls.OperatorCut,
            {"support_radius": (7, 1), "threshold": (0.1, 0), "response": ("relative", None)},
        ),
    ],
)
def test_controls_have_these_defaults_and_least_values(control, own):
    shared = {field.name for field in fields(PieceMethod)}
    mine = {field.name: field for field in fields(control) if field.name not in shared}
    assert mine.keys() == own.keys()
    for name, (default, least) in own.items():
        assert mine[name].default == default
        if least is not None:
            assert mine[name].metadata["bounds"].low == least


def test_an_unknown_experiment_is_told_all_names():
    papers = [name for names in EXPERIMENTS.values() for name in names]
    with pytest.raises(ValueError, match="unknown, expected") as caught:
        experiment_names(["none"])
    assert str(caught.value).partition(": ")[2].split(", ") == [*EXPERIMENTS, *papers]
