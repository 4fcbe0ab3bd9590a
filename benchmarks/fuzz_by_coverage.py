"""Damaged logs that are chosen by the branches of the readers that they reach.

Run: pip install atheris; python benchmarks/fuzz_by_coverage.py --seconds 600. It ends at the first
input that breaks the promise of the readers, which is kept in a folder.
"""

import argparse
import sys
import tempfile
import warnings
from pathlib import Path
from random import Random

import atheris

with atheris.instrument_imports(include=["lineament.logs"]):
    import lineament.logs.opening

    lineament.logs.opening.readers()

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from fuzzing import OPTIONS, check, scratch
from mutations import Sample, damaged, own_samples


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    work = Path(tempfile.mkdtemp(prefix="fuzzing-"))
    with tempfile.TemporaryDirectory() as own:
        samples = own_samples(Path(own))
    files = [data for sample in samples for data in sample.files.values()]
    folders = scratch(work)
    start = work / "corpus"
    start.mkdir()
    for number, data in enumerate(files):
        (start / str(number)).write_bytes(data)
    warnings.simplefilter("error")

    def one_input(data: bytes) -> None:
        check(Sample("any", {"log": data}, "log"), folders, OPTIONS[len(data) % len(OPTIONS)])

    def other_input(data: bytes, size: int, seed: int) -> bytes:
        chance = Random(seed)
        if chance.random() < 0.5:
            return bytes(atheris.Mutate(data, size))
        return damaged(data, chance, chance.choice(files))[:size]

    limits = [f"-max_total_time={given.seconds}", "-timeout=60", "-rss_limit_mb=2048"]
    flags = [*limits, f"-seed={given.seed}", "-max_len=32768", f"-artifact_prefix={work}/"]
    atheris.Setup([sys.argv[0], *flags, str(start)], one_input, custom_mutator=other_input)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
