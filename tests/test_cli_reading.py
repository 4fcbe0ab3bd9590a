"""How the command line reads logs: options, archives and addresses."""

from __future__ import annotations

import ast

import click
import pytest
from text_logs import FLASER, zipped

from lineament.cli import run
from lineament.cli.options import LOG_PATH, reading
from lineament.logs.base import ECHOES, ReadOptions


@click.command()
@reading
def show(reading):
    click.echo(reading)


def test_options_become_what_open_log_takes(capsys):
    show.main([], standalone_mode=False)
    given = ["--topic", "/scan", "--echo", "last", "--ring", "3", "--poses", "/odom"]
    show.main([*given, "--keep-going"], standalone_mode=False)
    plain, all_given = map(ast.literal_eval, capsys.readouterr().out.splitlines())
    assert plain == {"topic": None, "keep_going": False, **vars(ReadOptions())}
    assert list(all_given.values()) == ["/scan", True, "last", 3, "/odom"]
    for option in show.params:
        if option.name == "echo":
            assert tuple(option.type.choices) == ECHOES


@pytest.mark.parametrize("wrong", [["--echo", "second"], ["--ring", "-1"], ["--ring", "x"]])
def test_wrong_options(wrong, tmp_path, capsys):
    assert run(["info", str(tmp_path / "a.log"), *wrong]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"echo": "second"}, "echo is 'second', expected first or last or strongest"),
        ({"ring": -1}, "ring is -1, expected a whole number"),
        ({"ring": True}, "ring is True"),
        ({"pose_topic": ""}, "pose_topic is ''"),
    ],
)
def test_options_are_checked(options, problem):
    with pytest.raises(ValueError, match=problem):
        ReadOptions(**options)


def test_paths_and_addresses():
    assert LOG_PATH.convert("s3://bucket/a.log", None, None) == "s3://bucket/a.log"
    assert LOG_PATH.convert("a.log", None, None).name == "a.log"


def test_info_of_what_is_behind_archives_and_addresses(tmp_path, capsys):
    fsspec = pytest.importorskip("fsspec")
    (tmp_path / "a.zip").write_bytes(zipped(**{"x.log": FLASER, "y.log": FLASER}))
    fsspec.filesystem("memory").pipe("/cli/a.log", FLASER)
    for log in (f"{tmp_path}/a.zip/y.log", "memory://cli/a.log"):
        assert run(["info", log]) == 0
        out = capsys.readouterr().out
        assert out.startswith(f"log      {log} (carmen: FLASER)\n")
        assert "ranges   1.50 to 2.50 m, median 2.00 m, 66.7 % valid" in out
    assert run(["info", str(tmp_path / "a.zip")]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert f"holds several logs, expected a log file: {tmp_path}/a.zip/x.log" in error
