"""Marks of features: as the plain ways of numpy have them."""

import math

import numpy as np
from handmade import arc, corner, features
from hypothesis import given
from hypothesis import strategies as st

from lineament import LaserScan
from lineament.output.markers import arc_span, ellipses_of, markers_of
from lineament.output.scene import Layer, layers_of


@given(st.integers(0, 10_000))
def test_ellipses_are_those_of_the_eigenvectors(seed):
    rng = np.random.default_rng(seed)
    roots = rng.normal(size=(6, 2, 2)) * 10.0 ** rng.uniform(-6, 1, (6, 1, 1))
    covariances = roots @ roots.swapaxes(1, 2)
    _, _, longer, shorter, direction = ellipses_of(np.zeros((6, 2)), covariances, 0.5).T
    variances, axes = np.linalg.eigh(covariances)
    scale = -2 * math.log(0.5)
    np.testing.assert_allclose(longer**2, scale * variances[:, 1], rtol=1e-12)
    np.testing.assert_allclose(
        shorter**2 / longer**2, variances[:, 0] / variances[:, 1], atol=1e-14
    )
    along = np.abs(np.cos(direction) * axes[:, 0, 1] + np.sin(direction) * axes[:, 1, 1])
    np.testing.assert_allclose(along, 1, rtol=1e-9)
    assert ((direction >= 0) & (direction <= math.pi)).all()


def test_ellipses_of_covariances_that_are_none():
    flat, round_, nowhere = np.diag([4.0, 0.0]), np.eye(2), np.full((2, 2), np.nan)
    impossible = np.diag([1.0, -1.0])
    found = ellipses_of(np.zeros((4, 2)), np.stack([flat, round_, nowhere, impossible]), 0.5)
    size = math.sqrt(-2 * math.log(0.5))
    np.testing.assert_allclose(found[0], [0, 0, 2 * size, 0, 0])
    np.testing.assert_allclose(found[1, 2:4], size)
    np.testing.assert_allclose(found[2, 2:4], [size, 0])
    assert ellipses_of(np.zeros((0, 2)), np.zeros((0, 2, 2))).shape == (0, 5)


@given(st.integers(0, 10_000), st.integers(0, 99), st.integers(0, 99))
def test_span_of_an_arc_is_that_of_its_unwrapped_directions(seed, first, last):
    rng = np.random.default_rng(seed)
    ranges = np.where(rng.random(100) < 0.1, np.nan, rng.uniform(1, 3, 100))
    scan = LaserScan(ranges, 0.0, 2 * math.pi / 100)
    record = features(100, arcs=[arc(*rng.uniform(-2, 2, 2), 1, first, last)]).arcs[0]
    beams = np.arange(first, last + 1 if first <= last else last + 101) % 100
    points = scan.points[beams[scan.valid[beams]]] - record["center"]
    expected = 0.0, 2 * math.pi
    if len(points):
        directions = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
        expected = directions.min(), directions.max()
    np.testing.assert_allclose(arc_span(record, scan), expected, atol=1e-12)


def test_edges_are_marks_of_their_own():
    kinds = ("corner", "edge", "slit", "edge")
    found = features(corners=[corner(k, 1, kind=kind) for k, kind in enumerate(kinds)])
    found.corners["position"][3] = np.nan
    markers = markers_of(found)
    assert markers.corners.tolist() == [[0, 1], [2, 1]]
    assert markers.edges.tolist() == [[1, 1]]
    assert markers.ellipses[:, 0].tolist() == [0, 1, 2]
    assert [1, 1] in markers.points.tolist()
    layers = {layer.name: layer for layer in layers_of(markers)}
    corners, edges = layers["corners"], layers["edges"]
    assert edges.points.tolist() == [[1, 1]]
    assert edges.size < corners.size
    assert min(edges.color) > min(corners.color)  # lighter


def test_pieces_of_strips_are_the_same_in_one_array():
    strips = np.arange(12.0).reshape(2, 3, 2)
    expected = [[0, 1], [2, 3], [2, 3], [4, 5], [6, 7], [8, 9], [8, 9], [10, 11]]
    for given_strips in (strips, list(strips)):
        layer = Layer("a", (0, 0, 0, 1), 0.1, given_strips, np.zeros((0, 2)))
        assert layer.pairs.tolist() == expected
    for nothing in (strips[:0], []):
        assert Layer("a", (0, 0, 0, 1), 0.1, nothing, np.zeros((0, 2))).pairs.shape == (0, 2)
