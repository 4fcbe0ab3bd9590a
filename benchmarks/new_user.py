"""A new user with nothing but the wheel: each step in an empty environment, and how long it takes.

Run: python benchmarks/new_user.py dist/lineament-*.whl (`make new-user`). The steps are commands
that README names, and a notebook that is executed. With
LINEAMENT_DATA a recorded log is tried as well. A step that fails ends it, with exit status 1.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Callable
from pathlib import Path

HERE = Path(__file__).resolve().parent
DATA = Path(os.environ.get("LINEAMENT_DATA", HERE.parent.parent / "shared" / "data"))
RECORDED = DATA / "rosbag1" / "jackal_mocap.bag"

NOTEBOOK = """
import nbformat
from nbclient import NotebookClient

cells = "import lineament as ln", "features = ln.extract(ln.open_log('drive.npz')[40])", "features"
notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
NotebookClient(notebook, timeout=300).execute()
shown = notebook.cells[-1].outputs[0]["data"]["text/html"]
assert "<svg" in shown and "<table" in shown, shown[:200]
"""


class NewUser:
    """An environment and a folder to work in; every step is timed, and written down."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.steps = folder, list[tuple[str, str, float]]()
        self.bin = folder / "env" / ("Scripts" if os.name == "nt" else "bin")
        kept = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        self.env = kept | {"MPLBACKEND": "agg"}

    def timed(self, step: str, shown: str, work: Callable[[], object]) -> None:
        print(f"{step} ...", flush=True)
        start = time.perf_counter()
        work()
        seconds = time.perf_counter() - start
        print(f"{step}: {seconds:.1f} s", flush=True)
        self.steps.append((step, shown, seconds))

    def runs(self, step: str, *words: object, makes: str = "", shown: str = "") -> None:
        """A command of the environment must succeed, and make a file that is not empty."""

        def work() -> None:
            command = [str(self.bin / str(words[0])), *map(str, words[1:])]
            done = subprocess.run(
                command, cwd=self.folder, env=self.env, text=True, capture_output=True, timeout=900
            )
            made = not makes or list(self.folder.glob(makes))
            if done.returncode or not made:
                wrong = f"exit status {done.returncode}" if done.returncode else f"no {makes}"
                sys.exit(f"{step}: {wrong}\n{done.stdout[-2000:]}{done.stderr[-4000:]}")
            print(*(f"    {line}" for line in done.stdout.splitlines()[-3:]), sep="\n")

        self.timed(step, shown or " ".join(map(str, words)).replace(str(DATA), "DATA"), work)

    def report(self) -> None:
        print("\n|step|command|seconds|\n|---|---|---|")
        for step, shown, seconds in self.steps:
            print(f"|{step}|`{shown}`|{seconds:.1f}|")
        print(f"|all||{sum(step[2] for step in self.steps):.1f}|")


def constraints(folder: Path) -> Path:
    """The versions that requirements.lock pins, without its hashes."""
    lock = (HERE.parent / "requirements.lock").read_text(encoding="utf-8")
    path = folder / "constraints.txt"
    path.write_text("\n".join(re.findall(r"^[a-z].*==.*?(?= *\\?$)", lock, re.MULTILINE)))
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("wheel", type=Path)
    wheel = parser.parse_args().wheel.resolve()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        user, pins = NewUser(folder), constraints(folder)
        pip = ("python", "-m", "pip", "install", "--quiet", "--constraint", pins)
        user.timed(
            "empty environment",
            "python -m venv env",
            lambda: venv.create(folder / "env", with_pip=True),
        )
        user.runs("install", *pip, wheel, shown="pip install lineament-*.whl")
        user.runs("what came with it", "python", HERE / "installed.py", shown="installed.py")
        user.runs("help, for the first time", "lineament", "--help")
        user.runs("help, again", "lineament", "--help")
        drive = ("lineament", "simulate", "building", "--scans", "400", "-o")
        user.runs("a log to try", *drive, "drive.npz", makes="drive.npz")
        first = ("lineament", "extract", "drive.npz", "-o", "features.csv")
        user.runs("first extract", *first, makes="features.csv")
        user.runs("second extract", *first[:-1], "features.parquet", makes="features.parquet")
        plot = ("lineament", "plot", "drive.npz", "--scan", "40", "-o", "scan.png")
        user.runs("first plot", *plot, makes="scan.png")
        if RECORDED.exists():
            user.runs("a recorded log", "lineament", "info", RECORDED)
            found = ("lineament", "extract", RECORDED, "-o", "recorded.csv")
            user.runs("its features", *found, makes="recorded.csv")
        user.runs("notebook: install", *pip, "nbclient", "ipykernel", shown="pip install ipykernel")
        user.runs("notebook: three cells", "python", "-c", NOTEBOOK, shown="features")
        (folder / "logs").mkdir()
        for seed in "123":
            made = f"logs/{seed}.npz"
            user.runs(f"log {seed} of a folder", *drive, made, "--seed", seed, makes=made)
        folders = ("lineament", "extract", "logs", "-o", "table/")
        user.runs("a folder of logs", *folders, makes="table/log=*/*.parquet")
        extra = f"{wheel}[live]"
        user.runs("live: install", *pip, extra, shown="pip install 'lineament[live]'")
        user.runs("live from a log", "lineament", "live", "--from", "drive.npz", "--rate", "0")
        user.report()


if __name__ == "__main__":
    main()
