"""What is installed beside the package: little by default, and errors name what else is needed."""

import re
import subprocess
import sys
import tomllib
from importlib import metadata
from itertools import chain
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from lineament import LineamentError
from lineament.errors import EXTRAS, needed_by
from lineament.kernels import by_numba
from lineament.output import open_writer

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))
#: Packages whose name on the index is not that of the module.
MODULES = {"foxglove-sdk": "foxglove", "rerun-sdk": "rerun"}


def packages(requirements):
    plain = [one for one in requirements if isinstance(one, str)]
    names = [re.match(r"[\w-]+", requirement)[0] for requirement in plain]
    return {MODULES.get(name, name) for name in names}


def test_errors_know_the_extras_of_the_project_and_checks_install_them_all():
    extras = PROJECT["project"]["optional-dependencies"]
    of_size = sorted(extras, key=lambda name: len(extras[name]), reverse=True)
    smallest = {package: name for name in of_size for package in packages(extras[name])}
    assert smallest == EXTRAS
    assert set(EXTRAS) <= packages(chain(*PROJECT["dependency-groups"].values()))
    assert not set(EXTRAS) & packages(PROJECT["project"]["dependencies"])


def pins(name):
    """Each package of a file of versions, with all that it says of it."""
    text = (Path(__file__).parents[1] / name).read_text(encoding="utf-8")
    return re.findall(r"^([\w-]+)(==.*\n(?:    .*\n)+)", text, re.MULTILINE)


def test_a_demo_needs_the_versions_that_the_checks_have():
    base, every = pins("requirements-base.lock"), pins("requirements.lock")
    assert set(base) < set(every)
    asked = PROJECT["project"]["dependencies"] + PROJECT["dependency-groups"]["base"]
    asked = {re.match(r"[\w-]+", requirement)[0] for requirement in asked}
    needed, there = set(), {name for name, _ in every}
    while asked:
        needed |= asked
        lines = [line for name in asked for line in metadata.requires(name) or ()]
        names = {canonicalize_name(Requirement(line).name) for line in lines if "extra" not in line}
        asked = (names & there) - needed
    assert {name for name, _ in base} == needed


@pytest.mark.parametrize("package", EXTRAS)
def test_missing_package_is_named_with_what_installs_it(package, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    line = rf"^it needs {package}, which .*: pip install 'lineament\[{EXTRAS[package]}\]'$"
    with pytest.raises(LineamentError, match=line), needed_by("it"):
        __import__(package)
    with pytest.raises(ModuleNotFoundError), needed_by("it"):
        raise ModuleNotFoundError(name="numpy")


@pytest.mark.parametrize(
    ("ending", "package"), [("rrd", "rerun"), ("mcap", "foxglove"), ("dxf", "ezdxf")]
)
def test_format_whose_package_is_missing(ending, package, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    for module in ("rrd", "foxglove", "dxf"):
        monkeypatch.delitem(sys.modules, f"lineament.output.{module}", raising=False)
    with pytest.raises(LineamentError, match=rf"a\.{ending}: needs {package}, .*pip install"):
        open_writer(tmp_path / f"a.{ending}")


@pytest.mark.slow
def test_commands_work_without_any_extra(tmp_path):
    script = """
import sys
from importlib.metadata import distribution
from lineament.cli import run
from lineament.errors import EXTRAS
class Missing:  # None in sys.modules is a module to the extensions of pyarrow
    def find_spec(name, path=None, target=None):
        if name.partition(".")[0] in {*EXTRAS, "rosbags"} - set(sys.argv[1:]):
            raise ModuleNotFoundError(name=name)
sys.meta_path.insert(0, Missing)
log = "log.npz"
assert run(["simulate", "room", "-o", log, "--scans", "3", "-q"]) == 0
for ending in ("parquet", "csv", "jsonl", "svg", "ros2.mcap"):
    assert run(["extract", log, "-o", f"a.{ending}", "-q"]) == 0, ending
assert run(["info", log, "-q"]) == 0
assert run(["plot", log, "-o", "a.png"]) == 0
assert run(["plot", log, "-o", "b.png", "--trace", "-m", "liu"]) == 0
assert run(["demo", log, "-o", "demo", "-q"]) == 0
assert run(["live", "--from", log, "--ros", "0", "--rate", "0", "-q"]) == 0
import lineament.view
assert run(["extract", log, "-o", "a.dxf", "-q"]) == 1
assert run(["map", log, "-o", "a.svg", "-q"]) == 1
"""
    # Without compiled kernels numba is there.
    words = [sys.executable, "-c", script, *(["numba"] if by_numba else [])]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    # Kernels may have to be compiled, which is said.
    lines = [line for line in done.stderr.splitlines() if not line.startswith("compil")]
    assert [line for line in lines if "lineament[" in line] == lines
    named = [re.search(r"lineament\[\w+\]", line)[0] for line in lines]
    assert named == ["lineament[cad]", "lineament[mapping]"]
    assert not (tmp_path / "a.dxf").exists()
    assert (tmp_path / "demo" / "index.html").exists()


OF_TF = "R().schema('tf2_msgs/msg/TFMessage')"


@pytest.mark.parametrize(
    ("code", "heavy"),
    [
        ("from lineament.cli import run; run(['--help'])", "numpy rich"),
        ("import lineament as ln; ln.LaserScan([1.0], 0, 1)", "rosbags mcap ezdxf rerun"),
        ("import lineament.logs", "rosbags mcap lineament.logs.npz lineament.logs.carmen"),
        ("import lineament.output.figures, lineament.output.page", "rosbags mcap ezdxf rerun"),
        (f"from lineament.output.ros_messages import RosMessages as R; {OF_TF}", "rosbags mcap"),
        ("import lineament.simulation", "scipy shapely"),
        ("import lineament_lab.evaluation", "scipy shapely"),
    ],
)
def test_imports_are_light(code, heavy):
    heavy = f"numba pyarrow matplotlib lineament.tasks.bulk {heavy}".split()
    code = f"import sys; {code}; print(sorted({{*{heavy}}} & set(sys.modules)))"
    done = subprocess.check_output([sys.executable, "-c", code], text=True)
    assert done.splitlines()[-1] == "[]"


@pytest.mark.parametrize("ending", ["parquet", "csv"])
def test_tables_do_not_import_pandas_where_it_is_installed(tmp_path, ending):
    """It takes longer than all else."""
    pytest.importorskip("pandas")
    code = f"""
import sys, lineament as ln
from lineament.cli import main
from lineament.logs import save_npz
save_npz({str(tmp_path / "log.npz")!r}, [ln.LaserScan([2.0] * 9, -0.04, 0.01)])
sys.argv = ["lineament", "extract", {str(tmp_path / "log.npz")!r}, "-o",
            {str(tmp_path / f"table.{ending}")!r}]
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
assert "pandas" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=300)
    assert (tmp_path / f"table.{ending}").exists()
