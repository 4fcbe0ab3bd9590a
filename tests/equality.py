"""Hold features of the kernels equal to those of their slow twins."""

from __future__ import annotations

import math

import naive
import numpy as np

from lineament import Extractor


def assert_same_run(scan, extractor: Extractor) -> dict:
    """Run both on one scan; the twin works on the kernel's filtered ranges, once held equal."""
    trace = extractor.trace(scan)
    method = extractor.method
    own = naive.bilateral(scan, method.sigma_d, method.sigma_r, method.half_width)
    assert_same_filtered(trace.filtered, own, method.sigma_r, method.half_width)
    noise = extractor.noise
    given = None
    if noise is not None:
        given = (noise.sigma, noise.proportional, noise.bearing, noise.quantum)
    twin = naive.liu(scan, method, given, trace.filtered)
    assert_same_trace(trace, twin)
    assert_same_features(trace.features, twin)
    return twin


def assert_same_filtered(filtered, twin, sigma_r=0.3, half_width=8, **_):
    # Each weight of the kernel is good to 6e-6; what it weighs is some 3 σ_r at most.
    atol = 6e-6 * 3 * sigma_r * 2 * half_width + 1e-6
    np.testing.assert_allclose(filtered, twin, rtol=3e-7, atol=atol)


def assert_same_trace(trace, twin):
    found, scan = twin["found"], trace.scan
    by_beam = (
        (trace.spacing, found.spacing),
        (trace.distance_threshold, found.distance_threshold),
        (trace.density_threshold, found.density_threshold),
    )
    for kernel, slow in by_beam:
        expected = np.full(len(scan), np.nan)
        expected[list(slow)] = list(slow.values())
        np.testing.assert_allclose(kernel, expected, rtol=1e-6, atol=1e-12)
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
        (features.segments, twin["segments"]),
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
                # Arms that lie upon each other open to neither side.
                opens = table["opening"] > 1e-9
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
