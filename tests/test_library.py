"""The library of compiled kernels: what it refuses, when it is not taken, and what is said then."""

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

from lineament import kernels
from lineament.kernels import library
from lineament.kernels.mapping.votes import choose

HERE = Path(kernels.__file__).parent
compiled = pytest.mark.skipif(bool(kernels.by_numba), reason=f"no library: {kernels.by_numba}")
POSES = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [5.0, 0.0, 0.0]])
ORDER = np.array([2, 1, 0])


@compiled
def test_a_kernel_of_the_library_is_called_as_its_function_is():
    chosen = np.empty(3, np.int64)
    assert choose.__doc__.startswith("Choose poses")
    assert choose(POSES, ORDER, 1.0, 1.0, chosen) == 2
    assert chosen[:2].tolist() == [2, 1]
    call = choose.bind(POSES.copy(), ORDER, 1.0, 1.0, chosen)
    assert [call(), call()] == [2, 2]
    # Bound arrays stay, and their contents are read anew.
    changing = POSES.copy()
    call = choose.bind(changing, ORDER, 1.0, 1.0, chosen)
    changing[1, 0] = 2.5
    assert call() == 3


@compiled
@pytest.mark.parametrize(
    ("poses", "order"),
    [
        (POSES[:, ::2], ORDER),  # not contiguous
        (np.asfortranarray(POSES), ORDER),
        (POSES.astype(np.float32), ORDER),
        (POSES.astype(">f8"), ORDER),
        (POSES[0], ORDER),  # of another dimension
        (POSES, ORDER.astype(np.int32)),
        (POSES, ORDER.astype(np.uint64)),
        (POSES, ORDER.astype(float)),
    ],
)
def test_arrays_of_other_types_are_refused_and_not_read(poses, order):
    chosen = np.full(3, 7)
    with pytest.raises(TypeError, match="kernel choose takes contiguous arrays of its types"):
        choose(poses, order, 1.0, 1.0, chosen)
    assert chosen.tolist() == [7, 7, 7]


@compiled
@pytest.mark.parametrize("arguments", [(), (POSES,), (POSES, ORDER, 1.0, 1.0, ORDER, 3)])
def test_the_wrong_number_of_arguments_is_refused(arguments):
    with pytest.raises(Exception, match="expected 6 items"):
        choose(*arguments)


def test_words_of_a_table():
    words = "".join(library.words_of(tuple[int, float, tuple[bool, float]]))
    assert words == "qdqd"
    annotations = getattr(choose, "py_func", choose).__annotations__
    assert "".join("".join(library.words_of(kind)) for kind in annotations.values()) == "qqddqq"


V2 = "flags\t\t: fpu cx16 lahf_lm popcnt sse4_1 sse4_2 ssse3"
V3 = f"{V2} abm avx avx2 bmi1 bmi2 f16c fma movbe"


@pytest.mark.parametrize(
    ("about", "expected"),
    [
        (V3, ["x86-64-v3", "x86-64-v2"]),
        (V3.replace(" avx2", ""), ["x86-64-v2"]),
        (V2.replace(" popcnt", ""), []),
        ("processor: 0", []),
    ],
)
def test_levels_are_what_the_cpu_has(about, expected, tmp_path, monkeypatch):
    (tmp_path / "cpuinfo").write_text(f"processor: 0\n{about}\nbugs: none\n")
    monkeypatch.setattr(library.sys, "platform", "linux")
    monkeypatch.setattr(library.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(library, "Path", lambda _: tmp_path / "cpuinfo")
    assert library.levels() == expected


def test_levels_of_other_machines(monkeypatch):
    monkeypatch.setattr(library.platform, "machine", lambda: "AArch64")
    assert library.levels() == ["aarch64"]
    monkeypatch.setattr(library.platform, "machine", lambda: "AMD64")
    monkeypatch.setattr(library.sys, "platform", "win32")
    assert library.levels() == ["x86-64-v2"]


@pytest.fixture
def copy(tmp_path):
    """A copy of the package, and a function that runs Python with it, without numba."""
    package = tmp_path / "lineament"
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(HERE.parent, package, ignore=ignored)

    def run(code, **variables):
        prelude = "import sys; sys.modules['numba'] = None\n"
        environment = {
            name: value
            for name, value in os.environ.items()
            if name not in library._BY_NUMBA and name != "NUMBA_CACHE_DIR"
        }
        environment |= {"PYTHONPATH": str(tmp_path), **variables}
        command = [sys.executable, "-c", prelude + code]
        return subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True
        )

    run.kernels = package / "kernels"
    return run


FEATURES = """
import lineament as ln
print(len(ln.extract([2.0] * 90, angle_min=-0.2, angle_increment=0.005).segments))
"""
COMMAND = "from lineament.cli import run; sys.exit(run(['extract', 'a.csv', '-o', 'b.csv']))"


@compiled
def test_features_need_neither_numba_nor_a_folder_to_write_to(copy):
    before = sorted(copy.kernels.rglob("*"))
    done = copy(FEATURES, HOME="/nonexistent", PYTHONDONTWRITEBYTECODE="1")
    assert (done.stdout, done.stderr) == ("1\n", "")
    assert sorted(copy.kernels.rglob("*")) == before  # an image may be read-only


def seal(path):
    """Seal a library in a copy of the package, as the copy itself would."""
    whole = library.state().encode() + path.read_bytes()
    library.seal(path).write_text(hashlib.sha256(whole).hexdigest())


def each(harm):
    """Harm each library in a folder."""
    return lambda folder: [harm(path) for path in [*folder.glob(f"*{library.SUFFIX}")]]


@pytest.mark.slow
@compiled
@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda _: None, "LINEAMENT_JIT is set"),
        (each(Path.unlink), "the package was built without compiled kernels"),
        (
            lambda folder: (folder / "noise.py").write_text("changed = True"),
            "the kernels are not those that were compiled",
        ),
        (
            each(lambda path: path.write_bytes(path.read_bytes()[:5000])),
            "the kernels are not those that were compiled",
        ),
        (each(lambda path: (path.write_bytes(b"none"), seal(path))), "cannot be loaded ("),
        (
            each(lambda path: path.rename(path.with_name(f"ppc64{library.SUFFIX}"))),
            "no compiled kernels are for this CPU",
        ),
    ],
    ids=["asked", "missing", "changed", "cut off", "not a library", "another CPU"],
)
def test_without_a_library_one_line_says_why_and_what_helps(spoil, reason, copy):
    spoil(copy.kernels)
    asked = {"LINEAMENT_JIT": "1"} if reason.startswith("LINEAMENT") else {}
    (copy.kernels.parents[1] / "a.csv").write_text("0.0,1.0\n0.1,1.0\n0.2,1.0\n")
    done = copy(COMMAND, **asked)
    (line,) = done.stderr.splitlines()
    assert reason in line
    assert line.endswith("pip install 'lineament[jit]'")
    assert done.returncode == 1
    assert not (copy.kernels.parents[1] / "b.csv").exists()


def test_the_source_of_every_kernel_is_in_its_hash(tmp_path, monkeypatch):
    before = library.state()
    assert len(before) == 16
    copied = tmp_path / "kernels"
    shutil.copytree(HERE, copied, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(HERE.parent / "features", tmp_path / "features")
    monkeypatch.setattr(library, "HERE", copied)
    assert library.state() == before
    for path in library.sources():
        text = path.read_text()
        path.write_text(text + "#")
        assert library.state() != before, path.name
        path.write_text(text)
    assert library.state() == before


@pytest.mark.slow
@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="numba compiles nothing")
def test_numba_sees_that_a_kernel_calls_a_changed_function(copy):
    """Of what it has cached, numba itself compares only the file of the kernel."""
    kernels = copy.kernels
    (kernels / "inner.py").write_text(
        "from . import helper\n\n@helper\ndef inner(x):\n    return x + 1\n"
    )
    (kernels / "outer.py").write_text(
        "from . import kernel\nfrom .inner import inner\n\n"
        "@kernel\ndef outer(x):\n    return inner(x)\n"
    )
    code = "del sys.modules['numba']\nfrom lineament.kernels.outer import outer\nprint(outer(1))"
    assert copy(code, LINEAMENT_JIT="1").stdout == "2\n"
    text = (kernels / "inner.py").read_text()
    (kernels / "inner.py").write_text(text.replace("x + 1", "x + 2"))
    assert copy(code, LINEAMENT_JIT="1").stdout == "3\n"
