"""Hold features of the kernels equal to those of their slow twins."""

from __future__ import annotations

import math
from dataclasses import astuple

import naive
import numpy as np
from liu_2023 import bilateral_filter

from lineament import Extractor
from lineament.checks.sound import first_problem
from lineament.kernels import LARGEST
from lineament.methods import method_names

#: Keypoints have no kernels, and corners without an opening: tests/test_keypoints.py.
KEYPOINTS = ("falko", "flirt")
WITH_KERNELS = [name for name in method_names() if not name.startswith(KEYPOINTS)]


def assert_same_run(scan, extractor: Extractor) -> dict:
    """Run both on one scan; the twin works on the kernel's filtered ranges, once held equal."""
    trace = extractor.trace(scan)
    method = extractor.method
    ranges = np.where(naive.valid(scan), scan.ranges, np.nan)
    own = bilateral_filter(ranges, scan.is_full_circle, naive.paper_of(method))
    assert_same_filtered(trace.filtered, own, method.sigma_r, method.half_width)
    noise = extractor.noise
    given = None
    if noise is not None:
        given = astuple(noise)
    twin = naive.liu(scan, method, trace.filtered, given)
    assert_same_trace(trace, twin)
    assert_same_features(trace.features, twin)
    return twin


def assert_same_filtered(filtered, twin, sigma_r=0.3, half_width=8, **_):
    # Each weight of the kernel is good to 6e-6; what it weighs is some 3 σ_r at most.
    atol = 6e-6 * 3 * sigma_r * 2 * half_width + 1e-6
    np.testing.assert_allclose(filtered, twin, rtol=3e-7, atol=atol)


def assert_same_trace(trace, twin):
    found = twin["found"]
    for name in ("spacing", "distance_threshold", "density_threshold"):
        np.testing.assert_allclose(
            getattr(trace, name), getattr(found, name), rtol=1e-6, atol=1e-12
        )
    assert trace.clusters.tolist() == twin["clusters"].tolist()
    assert trace.candidates["beam"].tolist() == [beam for beam, _, _ in twin["candidates"]]
    for name, k in (("chord_distance", 1), ("response", 2)):
        expected = [candidate[k] for candidate in twin["candidates"]]
        np.testing.assert_allclose(trace.candidates[name], expected, rtol=1e-7, atol=1e-9)


def assert_same_features(features, twin, rtol=1e-7, atol=1e-9):
    def equal(table, records, name):
        expected = [record[name] for record in records]
        np.testing.assert_allclose(
            table[name], np.reshape(expected, table[name].shape), rtol, atol, err_msg=name
        )

    assert features.clusters.tolist() == twin["clusters"].tolist()
    for table, records in (
        (
            features.segments,
            [r | {"length": math.dist(r["start"], r["end"])} for r in twin["segments"]],
        ),
        (features.corners, twin["corners"]),
    ):
        assert len(table) == len(records)
        for name in table.dtype.names:
            if name == "angle":
                turn = table["angle"] - [record["angle"] for record in records]
                np.testing.assert_allclose(np.sin(turn), 0, atol=1e-8)
                assert (np.cos(turn) > 0).all()
                assert (abs(table["angle"]) <= math.pi).all()
            elif name == "covariance":
                assert_same_covariances(table, records)
            elif name == "convex":
                # Arms that lie upon each other, or in one line, open to neither side.
                opens = (table["opening"] > 1e-9) & (table["opening"] < math.pi - 1e-9)
                expected = np.array([record["convex"] for record in records], bool)
                assert table["convex"][opens].tolist() == expected[opens].tolist()
            elif name == "kind":
                assert table["kind"].tolist() == [record["kind"] for record in records]
            elif name == "misfit":
                # The root of a difference that may be nearly 0.
                np.testing.assert_allclose(
                    table["misfit"] ** 2, [record["misfit"] ** 2 for record in records], atol=1e-10
                )
            else:
                equal(table, records, name)
    assert len(features.breakpoints) == len(twin["breakpoints"])
    for own, (beams, position, kind, occluder) in zip(
        features.breakpoints, twin["breakpoints"], strict=True
    ):
        assert (tuple(own["beam"]), str(own["kind"]), own["occluder"]) == (beams, kind, occluder)
        np.testing.assert_allclose(own["position"], position, rtol=1e-12)


def assert_same_covariances(table, records):
    for own, record in zip(table["covariance"], records, strict=True):
        scale = np.sqrt(np.diag(record["covariance"]))
        unit = np.outer(scale, scale)
        np.testing.assert_allclose(own / unit, record["covariance"] / unit, atol=1e-6)


def direction_of(line):
    return np.array([math.cos(line["angle"]), math.sin(line["angle"])])


def assert_sound(features, scan, method):
    """Hold what is true of the features of any scan, by a method without edges and slits."""
    assert first_problem(features, scan) == ""
    segments, corners, n = features.segments, features.corners, len(scan)
    assert np.isfinite(corners["response"]).all()
    if method.name in KEYPOINTS:  # They are of no segment.
        assert len(segments) == 0
        assert (corners["segments"] == -1).all()
        return
    assert (segments["n_points"] >= (method.min_points if method.name == "liu" else 2)).all()
    # What is farther than any scanner sees, or nearer, is missing, as beams are that are not valid.
    usable = scan.valid & (scan.ranges >= 1 / LARGEST) & (scan.ranges < LARGEST)
    valid = np.flatnonzero(usable)
    for line in segments:
        first, last = int(line["first_beam"]), int(line["last_beam"])
        assert usable[[first, last]].all()
        beams = valid[(valid - first) % n <= (last - first) % n]
        # On a ring, the measurement at which it was opened belongs to its first and its last line.
        assert line["n_points"] == len(beams)
        assert set(features.clusters[beams]) == {line["cluster"]}
    for corner in corners:
        before, after = corner["segments"]
        assert 0 <= min(before, after) <= max(before, after) < len(segments)
        assert segments["cluster"][before] == segments["cluster"][after]
        assert corner["beam"] == segments["first_beam"][after]
        assert 0 <= corner["opening"] <= math.pi
        assert corner["kind"] == "corner"
    for point in features.breakpoints:
        known = point["beam"][point["beam"] >= 0]
        assert usable[known].all()
        assert (point["occluder"] in known) == (point["kind"] == "jump")
    assert (features.clusters[~usable] == -1).all()
    # Clusters are runs of usable beams, numbered in their order; one may go over the seam.
    labels = features.clusters[usable]
    parts = np.split(labels, np.flatnonzero(np.diff(labels)) + 1)
    runs = [int(part[0]) for part in parts if len(part) and part[0] >= 0]
    if scan.is_full_circle and len(runs) > 1 and runs[0] == runs[-1]:
        runs = runs[:-1]
    assert runs == list(range(len(runs)))
