"""The Arrow table of features: order, nulls, units, the seam, ragged scans."""

import json
from pathlib import Path

import numpy as np
import pytest

import lineament as ln
from lineament.features import BREAKPOINT, TABLES, FeatureBatch, Features
from lineament.features.tables import SCHEMA, batch_table, features_table

DOCS = Path(__file__).parents[1] / "docs" / "formats.md"


def random_features(seed: int, n_beams: int = 40, counts=(3, 2, 1, 2), **fields) -> Features:
    rng = np.random.default_rng(seed)
    tables = {}
    for (name, dtype), count in zip(TABLES.items(), counts, strict=True):
        table = np.zeros(count, dtype)
        for field in dtype.names:
            shape, kind = table[field].shape, table[field].dtype.kind
            table[field] = {
                "f": lambda shape=shape: rng.normal(size=shape),
                "i": lambda shape=shape: rng.integers(0, 99, shape),
                "b": lambda shape=shape: rng.random(shape) < 0.5,
                "U": lambda shape=shape: rng.choice(["jump", "gap"], shape),
            }[kind]()
        tables[name] = table
    tables["corners"]["kind"] = rng.choice(["corner", "slit", "edge"], counts[1])
    clusters = (np.arange(n_beams) // 9).astype(np.int32)
    clusters[rng.random(n_beams) < 0.1] = -1
    return Features(**tables, clusters=clusters, stamp=0.1 * seed, **fields)


def with_clusters(labels: list[int], *, ends: bool = False) -> Features:
    features = random_features(0, counts=(0, 0, 0, 0))
    if ends:
        features.breakpoints = np.zeros(2, BREAKPOINT)
        features.breakpoints["kind"] = "scan_end"
    features.clusters = np.array(labels, dtype=np.int32)
    return features


def cluster_rows(*scans: Features) -> list[tuple[int, int, int, int, int]]:
    rows = features_table(scans).to_pylist()
    names = ("scan", "index", "first_beam", "last_beam", "n_points")
    return [tuple(r[n] for n in names) for r in rows if r["kind"] == "cluster"]


def naive_rows(scans: list[Features], first_scan: int) -> list[dict]:
    """Make the rows of everything but clusters, one at a time."""
    pairs = {"start": "start_x start_y", "end": "end_x end_y", "beam": "first_beam last_beam"}
    pairs |= dict.fromkeys(("centroid", "position", "center"), "x y")
    pairs |= {"segments": "segment_before segment_after"}
    rows = []
    for i, features in enumerate(scans, first_scan):
        for name in TABLES:
            for index, record in enumerate(features.to_dict()[name]):
                row = dict.fromkeys(SCHEMA.names)
                row |= {"scan": i, "stamp": features.stamp, "kind": name[:-1], "index": index}
                for key, value in record.items():
                    if key == "kind":
                        row[name[:-1]] = value
                    elif key == "covariance":
                        size = range(len(value))
                        row |= {f"cov_{a}{b}": value[a][b] for a in size for b in size if a <= b}
                    elif isinstance(value, list):
                        row |= zip(pairs[key].split(), value, strict=True)
                    else:
                        row[key] = value
                rows.append(row)
    return rows


def test_rows_equal_those_of_the_slow_twin():
    scans = [
        random_features(1),
        random_features(2, n_beams=7, counts=(0, 0, 0, 0)),
        random_features(3, n_beams=0, counts=(2, 0, 4, 1)),
        random_features(4, n_beams=90, counts=(1, 5, 0, 0)),
    ]
    table = features_table(scans, first_scan=1000)
    rows = table.to_pylist()
    assert [r for r in rows if r["kind"] != "cluster"] == naive_rows(scans, 1000)
    assert table["scan"].to_pylist() == sorted(table["scan"].to_pylist())
    order = ["segment", "corner", "arc", "breakpoint", "cluster"]
    kinds = [order.index(r["kind"]) for r in rows if r["scan"] == 1000]
    assert kinds == sorted(kinds)
    assert table.schema.equals(SCHEMA)
    table.validate(full=True)


def test_batch_gives_the_same_table_as_its_scans():
    scans = [random_features(i, counts=(i, 2, 0, i % 3), frame_id="laser") for i in range(5)]
    offsets = np.zeros(6, [(name, "i8") for name in TABLES])
    for name in TABLES:
        offsets[name][1:] = np.cumsum([len(getattr(f, name)) for f in scans])
    batch = FeatureBatch(
        **{name: np.concatenate([getattr(f, name) for f in scans]) for name in TABLES},
        clusters=np.stack([f.clusters for f in scans]),
        offsets=offsets,
        stamps=np.array([f.stamp for f in scans]),
        noises=np.zeros((5, 4)),
        frame_id="laser",
    )
    assert batch_table(batch, 7).equals(features_table(scans, 7))
    assert batch.to_arrow().schema.metadata == features_table(scans).schema.metadata
    views = list(batch)  # slices of one large array
    assert features_table(views).equals(features_table(scans))


def test_empty_inputs():
    for table in (features_table([]), features_table([with_clusters([])])):
        assert table.num_rows == 0
        assert table.schema.equals(SCHEMA)
    assert cluster_rows(with_clusters([-1, -1])) == []


def test_clusters_are_spans_of_beams():
    assert cluster_rows(with_clusters([-1, 0, 0, -1, 0, 1, 1, -1])) == [
        (0, 0, 1, 4, 3),
        (0, 1, 5, 6, 2),
    ]


@pytest.mark.parametrize(
    ("labels", "expected"),
    [
        ([0, 0, -1, 1, 1, 1, 0, 0], [(0, 0, 6, 1, 4), (0, 1, 3, 5, 3)]),
        ([0, -1, -1, -1, 0, -1, 0, -1], [(0, 0, 4, 0, 3)]),
        ([-1, 0, 0, -1, -1, -1, 0, 0], [(0, 0, 6, 2, 4)]),
        ([0, 0, 0, 0], [(0, 0, 0, 3, 4)]),
        ([2, -1, 2, -1], [(0, 2, 0, 2, 2)]),  # a tie lies not over the seam; labels may have gaps
    ],
)
def test_clusters_over_the_seam_begin_behind_their_largest_hole(labels, expected):
    assert cluster_rows(with_clusters(labels)) == expected
    assert cluster_rows(with_clusters([]), with_clusters(labels))[0][1:] == expected[0][1:]


def test_no_cluster_lies_over_the_seam_of_a_scan_with_ends():
    labels = [0, 0, -1, -1, 0, 0]
    assert cluster_rows(with_clusters(labels)) == [(0, 0, 4, 1, 4)]
    assert cluster_rows(with_clusters(labels, ends=True)) == [(0, 0, 0, 5, 4)]


def test_interleaved_clusters_and_ragged_scans():
    a, b = with_clusters([1, 0, 1, 0, 1, -1, -1, -1]), with_clusters([0])
    assert cluster_rows(a, b) == [(0, 0, 1, 3, 2), (0, 1, 0, 4, 3), (1, 0, 0, 0, 1)]


def test_numbers_stay_what_they_are_nan_too():
    features = random_features(5)
    features.segments["rms"] = [np.nan, np.inf, 1e-300]
    rms = features_table([features])["rms"].to_pylist()[:3]
    assert np.isnan(rms[0])
    assert rms[1:] == [np.inf, 1e-300]


@pytest.mark.parametrize(
    ("table", "expected"),
    [("corners", "corner, slit, edge"), ("breakpoints", "jump, gap, scan_end")],
)
def test_unknown_kind_is_refused(table, expected):
    features = random_features(0)
    getattr(features, table)["kind"][1] = "cliff"
    message = f"^{table[:-1]} kind is 'cliff', expected one of {expected}$"
    with pytest.raises(ValueError, match=message):
        features_table([features])


def test_metadata_name_frames_version_and_units():
    scans = [random_features(i, frame_id=f) for i, f in enumerate(["b", "a", "b"])]
    schema = features_table(scans).schema
    assert json.loads(schema.metadata[b"lineament.frame_ids"]) == ["b", "a"]
    assert schema.metadata[b"lineament.version"].decode() == ln.__version__
    assert schema.field("x").metadata[b"unit"] == b"m"


def test_docs_list_every_column_with_its_unit_and_type():
    lines = DOCS.read_text(encoding="utf-8").splitlines()
    start = lines.index("| column | unit | type | meaning | filled by |") + 2
    table = lines[start : start + len(SCHEMA) + 1]
    assert table.pop() == ""  # no column more than the schema has
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table]
    filled = features_table([random_features(1)]).to_pylist()
    order = ["segment", "corner", "arc", "breakpoint", "cluster"]
    for field, (name, unit, kind, about, by) in zip(SCHEMA, rows, strict=True):
        metadata = {key.decode(): value.decode() for key, value in field.metadata.items()}
        assert name == f"`{field.name}`"
        assert unit == (metadata["unit"] or "–")
        assert about == metadata["description"]
        assert kind.split()[0] in str(field.type)
        kinds = {row["kind"] for row in filled if row[field.name] is not None}
        expected = order if by == "all" else by.split(", ")
        assert sorted(expected) == sorted(kinds), field.name
