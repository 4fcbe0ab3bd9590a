"""Features written by hand, and how features are compared with each other."""

import math
from dataclasses import replace

import numpy as np

from lineament.features import ARC, BREAKPOINT, CORNER, EDGE, SEGMENT, TABLES, Features


def _row(dtype, **fields):
    """Return a record of these fields; the others are 0."""
    row = np.zeros((), dtype)
    for name, value in fields.items():
        row[name] = value
    return row


def segment(start, end, first, last, *, sigma=(0.01, 0.01), n_points=None):
    """Return a segment whose centroid is its middle; of as many points as it has beams."""
    (x1, y1), (x2, y2) = start, end
    return _row(
        SEGMENT,
        start=start,
        end=end,
        centroid=((x1 + x2) / 2, (y1 + y2) / 2),
        angle=math.atan2(y2 - y1, x2 - x1),
        length=math.dist(start, end),
        covariance=np.diag(np.square(sigma)),
        first_beam=first,
        last_beam=last,
        n_points=last - first + 1 if n_points is None else n_points,
    )


def corner(x, y, *, segments=(0, 0), sigma=0.01, kind="corner"):
    spread = np.square(sigma) * np.eye(2)
    return _row(CORNER, position=(x, y), covariance=spread, segments=segments, kind=kind)


def edge(x, y, *, segment=0, side="end", sigma=0.01):
    spread = np.square(sigma) * np.eye(2)
    return _row(EDGE, position=(x, y), covariance=spread, segment=segment, side=side)


def arc(x, y, radius, first, last, *, sigma=0.01):
    beams = {"first_beam": first, "last_beam": last, "n_points": last - first + 1}
    spread = np.square(sigma) * np.eye(3)
    return _row(ARC, center=(x, y), radius=radius, covariance=spread, **beams)


def breakpoint_at(before, after, kind="jump"):
    return _row(BREAKPOINT, beam=(before, after), kind=kind)


def features(n=100, segments=(), corners=(), arcs=(), breakpoints=(), clusters=None, edges=()):
    """Features of a scan of n beams, all of them in one cluster if nothing else is said."""
    rows = {"segments": segments, "corners": corners, "edges": edges, "arcs": arcs}
    rows |= {"breakpoints": breakpoints}
    tables = {name: np.array(list(rows[name]), TABLES[name]) for name in TABLES}
    labels = np.zeros(n) if clusters is None else np.array(clusters)
    return Features(**tables, clusters=labels.astype(np.int32))


#: A large segment out of everyone's way, for corners to name as their sides.
SIDE = segment((9, -1), (9, 1), 80, 99)


def random_features(seed, n=200, least=6):
    """A full circle cut into walls and arcs of at least so many beams, in some clusters."""
    rng = np.random.default_rng(seed)
    sizes = []
    while n - sum(sizes) >= 2 * least + 30:
        sizes.append(int(rng.integers(least, 30)))
    sizes.append(n - sum(sizes))
    begin = int(rng.integers(n)) + np.cumsum([0, *sizes[:-1]])
    segments, arcs, corners, breakpoints = [], [], [], []
    clusters, label = np.empty(n, np.int32), 0
    for k, size in enumerate(sizes):
        first, last = int(begin[k] % n), int((begin[k] + size - 1) % n)
        bearing = 2 * math.pi * np.array([first, (first + size - 1)]) / n
        a, b = (rng.uniform(1, 6) * np.array((math.cos(t), math.sin(t))) for t in bearing)
        if rng.random() < 0.2:
            arcs.append(arc(*a, rng.uniform(0.1, 0.5), first, last))
            arcs[-1]["n_points"] = size
        else:
            segments.append(segment(a, b, first, last, n_points=size))
            corners.append(corner(*b, segments=(len(segments) - 1, -1)))
        clusters[(begin[k] + np.arange(size)) % n] = label
        if k + 1 < len(sizes) and rng.random() < 0.5:
            breakpoints.append(breakpoint_at(last, (last + 1) % n))
            label += 1
    for row in corners:
        row["segments"][1] = rng.integers(len(segments))
    return features(n, segments, corners, arcs, breakpoints, clusters)


def shaken(truth, seed):
    """Features like these: a little off, some missing, and each table in another order."""
    rng = np.random.default_rng(seed)
    tables = {}
    for name in TABLES:
        table = getattr(truth, name)
        table = table[rng.permutation(len(table))[: math.ceil(0.8 * len(table))]].copy()
        for field in ("start", "end", "centroid", "position", "center"):
            if field in table.dtype.names:
                table[field] += 0.02 * rng.normal(size=table[field].shape)
        tables[name] = table
    # The corners name no segments of another order.
    tables["corners"]["segments"] = -1
    return replace(truth, **tables)


def shuffled(truth, seed):
    """Return the same features in another order, clusters under other numbers."""
    rng = np.random.default_rng(seed)
    order = {name: rng.permutation(len(getattr(truth, name))) for name in TABLES}
    tables = {name: getattr(truth, name)[order[name]] for name in TABLES}
    new_index = np.append(np.argsort(order["segments"]), -1)
    tables["corners"]["segments"] = new_index[tables["corners"]["segments"]]
    numbers = np.append(rng.permutation(truth.clusters.max() + 1), -1)
    return replace(truth, **tables, clusters=numbers[truth.clusters].astype(np.int32))


def assert_alike(found, expected):
    """Hold features equal but for rounding, in every field of every table."""
    np.testing.assert_array_equal(found.clusters, expected.clusters)
    for name, dtype in TABLES.items():
        for field in dtype.names:
            a, b = getattr(found, name)[field], getattr(expected, name)[field]
            if field == "angle":
                a, b = np.exp(1j * a), np.exp(1j * b)
            if a.dtype.kind not in "fc":
                assert a.tolist() == b.tolist(), field
                continue
            np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-9, err_msg=field)
