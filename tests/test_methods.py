"""Methods by name, and what their parameters may be."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import lineament as ln
from lineament import Extractor
from lineament.methods import DEFAULT_METHOD, METHODS, get_method
from lineament.methods.liu import Liu


@pytest.mark.parametrize("name", ["lui", "", "liu:", "liu:papers", "paper", "LIU", "liu:paper:x"])
def test_unknown_names_are_told_with_the_choices(name):
    if name == "liu:":
        assert get_method(name) == Liu()
        return
    with pytest.raises(ValueError, match=rf"method {name!r} is unknown, .*: .*liu, liu:paper"):
        get_method(name)
    with pytest.raises(ValueError, match="is unknown"):
        ln.extract(ln.LaserScan([1.0], 0.0, 0.1), method=name)


@pytest.mark.parametrize("name", ["liu", "liu:paper", "liu:scale_free"])
def test_unknown_parameters_are_told_with_the_choices(name):
    with pytest.raises(ValueError, match=r"'liu' has no parameter 'radius', .*: sigma_d, .*corner"):
        get_method(name, radius=3)
    with pytest.raises(ValueError, match="no parameter 'presets'"):
        Extractor(name, presets=("x",))


NAN, INF = math.nan, math.inf
NOT_NUMBERS = ["1", None, True, 1j, [1.0]]


@pytest.mark.parametrize(
    ("name", "refused"),
    [
        ("sigma_d", [0, 0.0, -1.0, NAN, INF, 10**400, *NOT_NUMBERS]),
        ("sigma_r", [0, -0.3, NAN, INF, *NOT_NUMBERS]),
        ("spacing_scale", [0, -6, NAN, INF, *NOT_NUMBERS]),
        ("noise_floor", [-1e-9, NAN, INF, *NOT_NUMBERS]),
        ("density_k", [-1e-9, NAN, INF, *NOT_NUMBERS]),
        ("threshold", [-1e-9, NAN, INF, *NOT_NUMBERS]),
        ("half_width", [-1, 1.0, NAN, *NOT_NUMBERS]),
        ("min_points", [1, 0, -3, 3.0, *NOT_NUMBERS]),
        ("support_radius", [0, -1, 6.0, *NOT_NUMBERS]),
        ("response", ["chord", "", None, 1]),
        ("fit", ["huber", "", None, 1]),
        ("measure", ["both", "", None]),
        ("corner", ["vertex", "", None]),
    ],
)
def test_bounds(name, refused):
    for value in refused:
        with pytest.raises(ValueError, match=f"{name} is ") as error:
            get_method("liu", **{name: value})
        assert str(value) in str(error.value)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("sigma_d", 1e-3),
        ("sigma_r", 1e-3),
        ("spacing_scale", 1e-3),
        ("noise_floor", 0),
        ("density_k", 0),
        ("threshold", 0),
        ("half_width", 0),
        ("half_width", np.int64(40)),
        ("min_points", 2),
        ("support_radius", 1),
        ("sigma_d", np.float32(2)),
    ],
)
def test_bounds_themselves_are_taken(name, value):
    method = get_method("liu", **{name: value})
    kept = getattr(method, name)
    assert kept == value
    assert type(kept) is type(getattr(Liu(), name))
    rng = np.random.default_rng(0)
    scan = ln.LaserScan(2 + 0.01 * rng.normal(size=50), 0.0, 0.01)
    assert isinstance(Extractor(method)(scan), ln.Features)


def test_methods_are_values():
    method = get_method("liu", threshold=0.5)
    assert method == Liu(threshold=0.5)
    assert hash(method) == hash(Liu(threshold=0.5))
    with pytest.raises(dataclasses.FrozenInstanceError):
        method.threshold = 0.1
    assert get_method("liu") == Liu()
    assert "threshold=0.5" in repr(method)


def test_presets():
    assert set(Liu.presets) >= {"paper", "scale_free"}
    paper = get_method("liu:paper")
    assert (paper.noise_floor, paper.fit, paper.measure) == (0.0, "y_of_x", "filtered")
    assert paper.corner == "beam"
    assert get_method("liu:paper", fit="total").fit == "total"
    free = get_method("liu:scale_free", support_radius=4)
    assert (free.response, free.support_radius) == ("relative", 4)
    for preset in Liu.presets:
        assert getattr(Liu, preset)(min_points=4).min_points == 4


def test_every_method_is_there():
    assert DEFAULT_METHOD in METHODS
    scan = ln.LaserScan([2.0] * 20, 0.0, 0.01)
    for name in METHODS:
        method = get_method(name)
        assert method.name == name
        assert len(ln.extract(scan, method=name).segments) == (name != "pdbs")
        for preset in method.presets:
            assert get_method(f"{name}:{preset}").name == name


def test_method_made_before_takes_no_parameters():
    assert Extractor(Liu(threshold=0.2)).method.threshold == 0.2
    with pytest.raises(ValueError, match="made before"):
        Extractor(Liu(), threshold=0.2)
