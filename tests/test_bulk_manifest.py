"""What a run over many logs writes down: manifest, names, states of logs, progress."""

from __future__ import annotations

import json

import pytest
from bulk_logs import corner_log, outcomes
from hypothesis import given
from hypothesis import strategies as st

from lineament.tasks.bulk import MANIFEST, Manifest, Row
from lineament.tasks.bulk.manifest import names_of, part_path
from lineament.tasks.bulk.parts import log_state
from lineament.tasks.bulk.run import _Progress

PATHS = st.lists(st.lists(st.sampled_from("aAbé=%"), min_size=1, max_size=4), max_size=9)


@given(PATHS, PATHS)
def test_names_are_unique_whatever_the_paths_and_stay(first, second):
    names = names_of(["/" + "/".join(path) for path in first], {})
    later = names_of(["/" + "/".join(path) for path in second], names)
    together = names | later
    assert all(later.get(log, name) == name for log, name in names.items())
    parts = {part_path(name, ".csv").casefold() for name in together.values()}
    assert len(parts) == len(together)
    assert all(part.count("/") == 1 and part.startswith("log=") for part in parts)


def test_a_name_is_as_short_as_it_can_be():
    logs = ["/r1/mon/a.bag", "/r2/mon/a.bag", "/r1/tue/a.bag", "s3://store/b.bag", "/x/B.bag"]
    assert list(names_of(logs, {}).values()) == [
        *("r1/mon/a.bag", "r2/mon/a.bag", "tue/a.bag", "store/b.bag", "x/B.bag")
    ]
    assert names_of(["/A", "/a"], {}) == {"/A": "A~1", "/a": "a~2"}


def test_the_manifest_survives_what_is_no_row(tmp_path):
    first = Row(log="/a", name="a", outcome="done", scans=3)
    lines = [
        "[" * 100_000,
        "7",
        '{"log": 5, "name": "x", "outcome": "done", "output": ""}',
        '{"log": "/x"}',
        first.to_json().strip(),
        json.dumps({**json.loads(first.to_json()), "scans": 4, "of a later version": 1}),
        "\0\xff",
        Row(log="/b", name="b").to_json()[:40],
    ]
    (tmp_path / MANIFEST).write_bytes("\n".join(lines).encode("latin-1"))
    manifest = Manifest(tmp_path)
    assert {log: row.scans for log, row in manifest.rows.items()} == {"/a": 4}
    with manifest.recording() as record:
        record(Row(log="/b", name="b", outcome="done"))
        # On the disk at once, after all that was good before.
        assert outcomes(tmp_path) == {"a": "done", "b": "done"}
    assert len((tmp_path / MANIFEST).read_text().splitlines()) == 2


def test_the_state_of_what_is_at_an_address_is_known(tmp_path):
    fsspec = pytest.importorskip("fsspec")
    system = fsspec.filesystem("memory")
    try:
        log = corner_log(tmp_path / "a.npz")
        system.pipe("/bulk/a.npz", log.read_bytes())
        size, state = log_state("memory://bulk/a.npz")
        assert size == log.stat().st_size
        assert state
        assert log_state("memory://bulk/a.npz") == (size, state)
        assert log_state("memory://bulk/b.npz") == log_state("nonsense://a") == (None, "")
    finally:
        system.rm("/bulk", recursive=True)


def test_progress_tells_a_throughput_and_the_time_left(monkeypatch):
    clock = [100.0]
    monkeypatch.setattr("lineament.tasks.bulk.run.time.monotonic", lambda: clock[0])
    sizes = {"a": (3000, "1"), "b": (1000, "1"), "c": (None, "")}
    monkeypatch.setattr("lineament.tasks.bulk.run.log_state", sizes.__getitem__)
    progress = _Progress(["a", "b", "c"])
    assert str(progress) == "0/3 logs, 0 scans/s"
    clock[0] += 10.0
    progress.report("a", 500, 1000)  # half of three of six parts
    assert str(progress) == "0/3 logs, 50 scans/s, 0:30 left"
    progress.finish(Row(log="a", name="a", outcome="done", scans=1000))
    assert str(progress) == "1/3 logs, 100 scans/s, 0:10 left"
    progress.finish(Row(log="b", name="b", outcome="failed"))
    progress.finish(Row(log="c", name="c", outcome="done", scans=10))
    assert str(progress) == "3/3 logs, 1 failed, 101 scans/s, 0:00 left"
