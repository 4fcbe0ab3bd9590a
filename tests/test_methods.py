"""Methods by name, and what their parameters may be."""

import dataclasses
import math

import numpy as np
import pytest

import lineament as ln
from lineament import Extractor
from lineament.methods import DEFAULT_METHOD, get_method, method_names
from lineament.methods.liu import Liu
from lineament.methods.parameters import MOST_VERTICES

NAN, INF = math.nan, math.inf
NOT_NUMBERS = ["1", None, True, 1j, [1.0]]
FITS = ("total", "y_of_x", "weighted", "slope_intercept")
ENDS = ("intersection", "beam")

#: By method and parameter: the least whole number; "> 0"; "≥ 0"; "acute" angles; or the choices.
SHARED = {
    "clusters": ("borges_aldon", "fixed", "none"),
    "distance": "> 0",
    "settling": bool,
    "reach": "≥ 0",
    "corner_trim": 0,
    "grazing_angle": "acute",
    "max_missing": 0,
    "max_vertices": 0,
}
MERGED = SHARED | {"threshold": "≥ 0", "unevenness": "≥ 0", "min_points": 2}
NEAR = SHARED | {"epsilon": "≥ 0", "sigmas": "≥ 0", "fit": FITS, "noise_factor": "≥ 0"}
RUNS = NEAR | {"min_points": 3, "min_length": "≥ 0", "max_misses": 0}
BOUNDS = {
    "optimal": {"evidence": "> 0", "max_missing": 0, "max_vertices": 0},
    "liu": {
        "sigma_d": "> 0",
        "sigma_r": "> 0",
        "half_width": 0,
        "spacing_scale": "> 0",
        "noise_floor": "≥ 0",
        "density_k": "≥ 0",
        "min_points": 2,
        "support_radius": 1,
        "threshold": "≥ 0",
        "response": ("tangent", "product", "relative", "chord_scaled", "product_scaled"),
        "recursion": ("both", "after"),
        "ends": ("truncated", "excluded"),
        "fit": FITS,
        "measure": ("raw", "filtered"),
        "corner": ENDS,
        "corner_trim": 0,
        "max_vertices": 0,
    },
    "pdbs": {
        "rule": ("borges_aldon", "fixed", "dietmayer", "santos", "lee"),
        "distance": "> 0",
        "c0": "≥ 0",
        "beta": "acute",
        "ratio": "> 0",
        "grazing_angle": "acute",
        "noise_factor": "≥ 0",
        "max_missing": 0,
        "min_points": 1,
    },
    "iepf": MERGED | {"proportion": "≥ 0", "noise_factor": "≥ 0", "min_piece": 2, "corner": ENDS},
    "split_and_merge": MERGED | {"noise_factor": "≥ 0", "min_piece": 2},
    "line_tracking": MERGED | {"noise_factor": "> 0", "max_misses": 0, "min_piece": 3},
    "hough": RUNS | {"angles": 4, "distances": 4, "resolution": "> 0"},
    "ransac": RUNS | {"trials": 1, "window": 1, "seed": 1},
    "ple": {k: v for k, v in MERGED.items() if k != "threshold"}
    | {"rise": "> 0", "line_error": "> 0", "corner": ENDS},
    "falko": {
        "a": "> 0",
        "b": "≥ 0",
        "least_neighbours": 1,
        "flatness": "≥ 0",
        "sectors": 2,
        "suppression": "> 0",
        "least_score": "≥ 0",
    },
    "flirt": {
        "scales": 1,
        "scale": "> 0",
        "step": "> 0",
        "least_signal": "≥ 0",
        "rise": "≥ 0",
        "trees": 1,
    },
    "region_growing": NEAR | {"s_num": 3, "p_min": 3, "l_min": "≥ 0", "delta": "≥ 0"},
}
ACCEPTED = {
    "> 0": [5e-324, 2, np.float32(2), 1e300],
    "≥ 0": [0, 0.0, 2.5],
    "acute": [1e-9, 1.57],
    bool: [True, False],
}
REFUSED = {
    "> 0": [0, -1.0, NAN, INF, 10**400, *NOT_NUMBERS],
    "≥ 0": [-1e-9, NAN, INF, 10**400, *NOT_NUMBERS],
    "acute": [0, -0.1, math.pi / 2, 10, *NOT_NUMBERS],
    bool: [1, 0, None, "yes"],
}


def accepted(bound):
    if isinstance(bound, int):
        return [bound, np.int64(bound + 40)]
    return bound if isinstance(bound, tuple) else ACCEPTED[bound]


def refused(bound):
    if isinstance(bound, tuple):
        return ["", "chord", None, 1, ["total"]]
    if isinstance(bound, int) and not isinstance(bound, bool):
        return [bound - 1, bound + 1.0, NAN, INF, *NOT_NUMBERS]
    return REFUSED[bound]


@pytest.mark.parametrize("name", BOUNDS)
def test_bounds(name):
    """Bounds themselves are accepted, with the type of the default; what is beyond is refused."""
    default = get_method(name)
    assert {field.name for field in dataclasses.fields(default)} == set(BOUNDS[name])
    for parameter, bound in BOUNDS[name].items():
        # A tolerance of 0 in all its parts is refused elsewhere.
        others = {"threshold": 1.0} if "min_piece" in BOUNDS[name] else {}
        for value in accepted(bound):
            kept = getattr(get_method(name, **{**others, parameter: value}), parameter)
            assert kept == value
            assert type(kept) is type(getattr(default, parameter))
        for value in refused(bound):
            with pytest.raises(ValueError, match=f"^{parameter} is .*, expected ") as error:
                get_method(name, **{parameter: value})
            assert repr(value) in str(error.value)


def test_refusals_name_what_is_expected():
    for name, changes, message in (
        ("liu", {"fit": "huber"}, "fit is 'huber', expected one of: total, y_of_x, weighted"),
        ("liu", {"min_points": 1}, "min_points is 1, expected a whole number ≥ 2"),
        ("liu", {"sigma_d": 0}, "sigma_d is 0, expected a number > 0"),
        ("pdbs", {"beta": 2}, r"beta is 2, expected a number > 0 and < 1\.57079632679"),
        ("iepf", {"settling": 1}, "settling is 1, expected True or False"),
        ("ransac", {"seed": 2**31 - 1}, "seed is 2147483647, .* ≥ 1 and < 2147483647$"),
        ("liu", {"half_width": 10**11}, "half_width is 100000000000, .* ≥ 0 and < 2147483648$"),
        ("liu", {"max_vertices": 10**6}, f"max_vertices is 1000000, .* ≥ 0 and < {MOST_VERTICES}$"),
        (
            "iepf",
            {"proportion": 0, "noise_factor": 0},
            "threshold, proportion and noise_factor are all 0, expected one > 0",
        ),
        ("split_and_merge", {"noise_factor": 0}, "threshold and noise_factor are both 0"),
    ):
        with pytest.raises(ValueError, match=f"^{message}"):
            get_method(name, **changes)
    assert get_method("ransac", seed=2**31 - 2).seed == 2**31 - 2


@pytest.mark.parametrize("name", ["lui", "", "liu:papers", "paper", "LIU", "liu:paper:x"])
def test_unknown_names_are_refused_with_the_choices(name):
    with pytest.raises(ValueError, match=rf"method {name!r} is unknown, .*: .*liu, liu:paper"):
        get_method(name)
    with pytest.raises(ValueError, match="is unknown"):
        ln.extract(ln.LaserScan([1.0], 0.0, 0.1), method=name)


@pytest.mark.parametrize("name", ["liu", "liu:paper"])
def test_unknown_parameters_are_refused_with_the_choices(name):
    with pytest.raises(
        ValueError,
        match=r"'liu' has no parameter 'radius': is it support_radius\? .*: sigma_d, .*corner",
    ):
        get_method(name, radius=3)
    with pytest.raises(ValueError, match="no parameter 'presets'"):
        Extractor(name, presets=("x",))


def test_methods_are_values():
    method = get_method("liu", threshold=0.5)
    assert method == Liu(threshold=0.5) != get_method("liu:")
    assert hash(method) == hash(Liu(threshold=0.5))
    with pytest.raises(dataclasses.FrozenInstanceError):
        method.threshold = 0.1
    assert "threshold=0.5" in repr(method)
    assert Extractor(method).method is method
    with pytest.raises(ValueError, match="made before"):
        Extractor(method, threshold=0.2)


def test_presets():
    paper = get_method("liu:paper")
    assert (paper.noise_floor, paper.fit, paper.measure) == (0.0, "y_of_x", "filtered")
    assert (paper.corner, get_method("liu:paper", fit="total").fit) == ("beam", "total")
    free = get_method("liu:scale_free", support_radius=4)
    assert (free.response, free.threshold, free.support_radius) == ("relative", 0.25, 4)
    plain = get_method("iepf:paper")
    assert (plain.threshold, plain.proportion, plain.noise_factor) == (0.15, 0.0, 0.0)
    assert (plain.clusters, plain.settling, plain.corner) == ("none", False, "beam")
    assert get_method("pdbs:paper").grazing_angle == math.radians(10)


METHODS = method_names(presets=False)


def test_every_method_is_there():
    assert DEFAULT_METHOD in METHODS
    assert set(METHODS) == set(BOUNDS)
    scan = ln.LaserScan([2.0] * 20, 0.0, 0.01)
    for name in METHODS:
        method = get_method(name)
        assert method.name == name
        assert len(ln.extract(scan, method=name).segments) == (
            name not in ("pdbs", "falko", "flirt")
        )
        for preset in method.presets:
            assert get_method(f"{name}:{preset}").name == name


@pytest.mark.parametrize("name", METHODS)
def test_docstrings_list_each_parameter_with_default_and_bounds(name):
    method = get_method(name)
    for field in dataclasses.fields(method):
        kind = type(field.default).__name__
        assert f"{field.name} : {kind}, default {field.default!r}\n" in method.__doc__
        assert field.metadata["meaning"].split()[-1] in method.__doc__
