"""Some hundreds of inputs of each kind; for a million, see fuzzing.py."""

import gc
import json
import pickle
import subprocess
import sys
import tempfile
from contextlib import closing
from pathlib import Path
from random import Random

import pytest
from fuzz_forms import Forms, Results
from fuzz_plans import Locating, Plans
from fuzz_readers import OPTIONS, Readers, check, scratch
from fuzz_targets import Messages, Methods, Viewer, Writers
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mutations import Sample, mutated, recorded_samples, sizes

pytestmark = pytest.mark.filterwarnings("ignore::lineament.LineamentWarning")

settings_of_all = settings(
    max_examples=250, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
MAGICS = [b"", b"PK\3\4", b"\x1f\x8b\x08", b"#ROSBAG V2.0\n"]
BEGINNINGS = ["", "FLASER 3 ", "Laser 2 1 1\n", "angle,range\n", '{"readings":', '{"a":[[1']


@pytest.fixture
def folders(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", None)
    gc.disable()  # Temporary files must not wait for it.
    yield scratch(tmp_path)
    gc.enable()


@pytest.mark.slow
@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_samples_are_logs(samples, folders, options):
    """Else damage would show nothing."""
    for sample in samples:
        assert check(sample, folders, options)


@settings_of_all
@given(st.sampled_from(MAGICS), st.binary())
def test_any_bytes(folders, magic, data):
    check(Sample("any", {"log": magic + data}, "log"), folders, {})


@pytest.mark.slow
@settings_of_all
@given(st.text(alphabet='0123456789.,-+e;\t\n {}[]":naifx', max_size=300))
def test_any_text(folders, text):
    for beginning in BEGINNINGS:
        check(Sample("any", {"log": (beginning + text).encode()}, "log"), folders, {})


def test_damaged_beginnings_of_recordings(data_dir, folders):
    samples = recorded_samples(data_dir)
    chance = Random(2)
    for sample in samples:
        check(mutated(sample, samples, chance), folders, {})


def test_where_lengths_and_offsets_stand(samples):
    """Structure-aware damage finds the fields that formats have by their own definitions."""
    files = {sample.kind: next(iter(sample.files.values())) for sample in samples}
    mcap, bag, archive = files["mcap"], files["rosbag1"], files["zip"]
    assert (9, "<Q") in sizes(mcap)  # length of the first record, behind magic and opcode
    assert (13, "<I") in sizes(bag)  # length of the first header, behind the line of the version
    end = archive.rindex(b"PK\5\6")
    assert {(end + 12, "<I"), (end + 16, "<I"), (end + 10, "<H")} <= set(sizes(archive))
    database = next(data for s in samples if s.kind == "sqlite3" for data in s.files.values())
    assert (28, ">I") in sizes(database) or b"SQLite" not in database  # size in pages


@pytest.mark.slow
@pytest.mark.parametrize(
    ("target", "inputs"),
    [
        *((Methods, 300), (Messages, 1000), (Viewer, 200), (Writers, 60)),
        *((Forms, 300), (Results, 60), (Plans, 100), (Locating, 6), (Readers, 250)),
    ],
    ids=lambda value: getattr(value, "__name__", value),
)
@pytest.mark.usefixtures("folders")
def test_inputs_of_each_kind(target, inputs, tmp_path):
    made = target(tmp_path)
    with closing(made):
        outcomes = {made.check(made.make(Random(seed))) for seed in range(inputs)}
    assert len(outcomes) > 1


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="there are no limits of memory")
def test_a_run_goes_on_where_it_was_interrupted(tmp_path):
    script = Path(__file__).with_name("fuzzing.py")
    for inputs in (40, 40, 60):
        words = [sys.executable, script, "--inputs", inputs, "--workers", 1, "--state", tmp_path]
        done = subprocess.run(list(map(str, words)), capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        assert f"{inputs} inputs in " in done.stdout
    state = json.loads((tmp_path / "worker-0.json").read_text())
    assert state["next"] == sum(state["counts"].values()) == 60
    number, name, made = pickle.loads((tmp_path / "worker-0.now").read_bytes())
    kept = tmp_path / f"{number:08}-{name}.pickle"
    kept.write_bytes(pickle.dumps(made))
    words = [sys.executable, str(script), "--again", str(kept)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert f"{name}/{done.stdout.strip()}" in state["counts"]
