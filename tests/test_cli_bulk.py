"""The command `extract` with a folder as output."""

from __future__ import annotations

import pytest
from bulk_logs import corner_log

from lineament.cli import run


@pytest.fixture
def logs(tmp_path):
    return [str(corner_log(tmp_path / f"{name}.npz", 4 + k)) for k, name in enumerate("ab")]


def test_several_logs_go_into_a_folder(logs, tmp_path, capsys):
    out = tmp_path / "out"
    arguments = ["extract", *logs, "-o", f"{out}/", "--threads", "1"]
    assert run(arguments) == 0
    said = capsys.readouterr().out
    assert f"2 logs -> {out}/\n  2 done, 0 failed, 0 whole before\n  9 scans, " in said
    parts = sorted(str(path.relative_to(out)) for path in out.rglob("*.parquet"))
    assert parts == ["log=a.npz/part-0.parquet", "log=b.npz/part-0.parquet"]
    # Without --resume all is done again; a folder that is there needs no slash.
    assert run([*arguments[:4], str(out), "--threads", "2"]) == 0
    assert "2 done" in capsys.readouterr().out
    assert run([*arguments, "--resume"]) == 0
    assert "0 done, 0 failed, 2 whole before" in capsys.readouterr().out


def test_logs_that_fail_are_counted_in_one_line(logs, tmp_path, capfd):
    out = tmp_path / "out"
    given = [logs[0], "/none.bag", "/none.npz"]
    assert run(["extract", *given, "-q", "-o", f"{out}/", "--processes", "1"]) == 1
    output, errors = capfd.readouterr()
    assert output == ""
    assert errors == f"lineament: 2 of 3 logs failed, see {out}/_manifest.jsonl\n"
    assert (out / "log=a.npz" / "part-0.parquet").exists()


def test_a_folder_of_other_files_than_tables(logs, tmp_path):
    arguments = ["extract", logs[0], "-q", "-o", f"{tmp_path}/out/", "--threads", "1"]
    assert run([*arguments, "--format", "jsonl"]) == 0
    assert [path.name for path in (tmp_path / "out").rglob("part*")] == ["part-0.jsonl"]
    assert run([*arguments, "--format", "xls"]) == 1


def test_nothing_is_appended_to_a_file(logs, tmp_path, capsys):
    target = tmp_path / "features.parquet"
    assert run(["extract", logs[0], "--append", "-o", str(target)]) == 2
    assert "--append: a file is written whole" in capsys.readouterr().err
    assert not target.exists()
