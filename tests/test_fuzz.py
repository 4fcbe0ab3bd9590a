"""Some hundreds of damaged logs; for more, see fuzzing.py."""

import gc
import tempfile
from random import Random

import pytest
from fuzzing import OPTIONS, check, chosen, scratch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mutations import Sample, mutated, own_samples, recorded_samples

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


@pytest.fixture(scope="module")
def samples(tmp_path_factory):
    return own_samples(tmp_path_factory.mktemp("samples"))


@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_samples_are_logs(samples, folders, options):
    """Else damage would show nothing."""
    for sample in samples:
        assert check(sample, folders, options)


@settings_of_all
@given(st.integers(min_value=0))
def test_damaged_logs(samples, folders, seed):
    chance = Random(seed)
    sample = mutated(chosen(samples, chance), samples, chance)
    check(sample, folders, chance.choice(OPTIONS))


@settings_of_all
@given(st.sampled_from(MAGICS), st.binary())
def test_any_bytes(folders, magic, data):
    check(Sample("any", {"log": magic + data}, "log"), folders, {})


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
