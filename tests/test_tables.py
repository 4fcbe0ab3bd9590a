"""The Arrow table of features: order, nulls, units, the seam, ragged scans."""

import json
from pathlib import Path

import numpy as np
import pytest

import lineament as ln
from lineament.features import TABLES, FeatureBatch, Features
from lineament.features.tables import SCHEMA, features_table

DOCS = Path(__file__).parents[1] / "docs" / "formats.md"


def random_features(seed: int, n_beams: int = 40, counts=(3, 2, 3, 1, 2), **fields) -> Features:
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
    tables["corners"]["kind"] = rng.choice(["corner", "slit"], counts[1])
    tables["edges"]["side"] = rng.choice(["start", "end"], counts[2])
    clusters = (np.arange(n_beams) // 9).astype(np.int32)
    clusters[rng.random(n_beams) < 0.1] = -1
    return Features(**tables, clusters=clusters, stamp=0.1 * seed, **fields)


def naive_rows(scans: list[Features], first_scan: int) -> list[dict]:
    """Make the rows one at a time."""
    pairs = {"start": "start_x start_y", "end": "end_x end_y", "beam": "first_beam last_beam"}
    pairs |= dict.fromkeys(("centroid", "position", "center"), "x y")
    pairs |= {"segments": "segment_before segment_after"}
    rows = []
    for i, features in enumerate(scans, first_scan):
        for name in TABLES:
            for index, record in enumerate(features.to_dict()[name]):
                row = dict.fromkeys(SCHEMA.names)
                row |= {"scan": i, "stamp": features.stamp, "kind": name[:-1], "index": index}
                row["stamp_ns"] = round(1e9 * features.stamp)
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
        rows += naive_clusters(i, features)
    return rows


def naive_clusters(scan: int, features: Features) -> list[dict]:
    """Make the rows of clusters: each begins behind the largest hole in it, that of the seam first.

    Nothing lies over the seam of a scan with ends.
    """
    labels, rows = features.clusters, []
    for label in sorted({*labels.tolist()} - {-1}):
        beams = np.flatnonzero(labels == label)
        holes = np.diff(beams, append=beams[0] + len(labels))
        is_open = "scan_end" in features.breakpoints["kind"] or holes[-1] == holes.max()
        last = -1 if is_open else int(holes.argmax())
        ends = {"first_beam": int(beams[last + 1]), "last_beam": int(beams[last])}
        row = {"scan": scan, "stamp": features.stamp, "kind": "cluster", "index": label}
        row["stamp_ns"] = round(1e9 * features.stamp)
        rows.append(dict.fromkeys(SCHEMA.names) | row | ends | {"n_points": len(beams)})
    return rows


def test_rows_equal_those_of_the_slow_twin():
    scans = [
        random_features(1),
        random_features(2, n_beams=7, counts=(0, 0, 0, 0, 0)),
        random_features(3, n_beams=0, counts=(2, 0, 1, 4, 1)),
        random_features(4, n_beams=90, counts=(1, 5, 0, 0, 0)),
        random_features(5, n_beams=1, counts=(0, 0, 0, 0, 0)),
    ]
    table = features_table(scans, first_scan=1000)
    assert table.to_pylist() == naive_rows(scans, 1000)
    assert table.schema.equals(SCHEMA)
    table.validate(full=True)
    for nothing in ([], [random_features(0, n_beams=0, counts=(0, 0, 0, 0, 0))]):
        assert features_table(nothing).num_rows == 0
        assert features_table(nothing).schema.equals(SCHEMA)


@pytest.mark.parametrize("seed", range(20))
def test_clusters_lie_over_the_seam_of_scans_without_ends(seed):
    rng = np.random.default_rng(seed)
    scans = [random_features(k, counts=(0, 0, 0, 0, k % 3)) for k in range(20)]
    for scan in scans:
        # Few labels, with gaps between them, in runs or beam by beam.
        labels = rng.choice([-1, -1, 0, 1, 3], rng.integers(0, 12))
        scan.clusters = np.repeat(labels, rng.integers(1, 4)).astype(np.int32)
        scan.breakpoints["kind"] = rng.choice(["jump", "scan_end"])
    rows = [row for k, scan in enumerate(scans) for row in naive_clusters(k, scan)]
    found = features_table(scans).to_pylist()
    assert [row for row in found if row["kind"] == "cluster"] == rows


def test_batch_gives_the_same_table_as_its_scans():
    scans = [random_features(i, counts=(i, 2, i % 2, 0, i % 3), frame_id="laser") for i in range(5)]
    offsets = np.zeros(6, [(name, "i8") for name in TABLES])
    for name in TABLES:
        offsets[name][1:] = np.cumsum([len(getattr(f, name)) for f in scans])
    batch = FeatureBatch(
        **{name: np.concatenate([getattr(f, name) for f in scans]) for name in TABLES},
        clusters=np.stack([f.clusters for f in scans]),
        offsets=offsets,
        stamps=np.array([f.stamp for f in scans]),
        noises=np.zeros((5, 5)),
        frame_id="laser",
    )
    assert batch.to_arrow(7).equals(features_table(scans, 7))
    assert batch.to_arrow().schema.metadata == features_table(scans).schema.metadata
    views = list(batch)  # slices of one large array
    assert features_table(views).equals(features_table(scans))


@pytest.mark.parametrize(
    ("table", "field", "expected"),
    [
        ("corners", "kind", "corner, slit"),
        ("edges", "side", "start, end"),
        ("breakpoints", "kind", "jump, gap, scan_end"),
    ],
)
def test_unknown_text_is_refused(table, field, expected):
    features = random_features(0)
    getattr(features, table)[field][1] = "cliff"
    message = f"^{table[:-1]} {field} is 'cliff', expected one of {expected}$"
    with pytest.raises(ValueError, match=message):
        features_table([features])


def test_metadata_and_numbers_that_are_not_finite():
    scans = [random_features(i, frame_id=f) for i, f in enumerate(["b", "a", "b"])]
    scans[0].segments["rms"] = [np.nan, np.inf, 1e-300]
    table = features_table(scans)
    assert json.loads(table.schema.metadata[b"lineament.frame_ids"]) == ["b", "a"]
    assert table.schema.metadata[b"lineament.version"].decode() == ln.__version__
    assert table.schema.field("x").metadata[b"unit"] == b"m"
    np.testing.assert_array_equal(table["rms"][:3].to_numpy(), [np.nan, np.inf, 1e-300])
    assert table["rms"][:3].null_count == 0


def test_docs_list_every_column_with_its_unit_and_type():
    lines = DOCS.read_text(encoding="utf-8").splitlines()
    start = lines.index("| column | unit | type | meaning | filled by |") + 2
    table = lines[start : start + len(SCHEMA) + 1]
    assert table.pop() == ""  # no column more than the schema has
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table]
    filled = features_table([random_features(1)]).to_pylist()
    order = ["segment", "corner", "edge", "arc", "breakpoint", "cluster"]
    for field, (name, unit, kind, about, by) in zip(SCHEMA, rows, strict=True):
        metadata = {key.decode(): value.decode() for key, value in field.metadata.items()}
        assert name == f"`{field.name}`"
        assert unit == (metadata["unit"] or "–")
        assert about == metadata["description"]
        assert kind.split()[0] in str(field.type)
        kinds = {row["kind"] for row in filled if row[field.name] is not None}
        expected = order if by == "all" else by.split(", ")
        assert sorted(expected) == sorted(kinds), field.name
