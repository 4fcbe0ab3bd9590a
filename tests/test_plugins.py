"""What other packages add by entry points: found, listed, and named where it is missing."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import click
import pytest

import lineament
from lineament import plugins as module
from lineament.cli import cli, run
from lineament.plugins import COMMANDS, LABORATORY, METHODS

ROOT = Path(__file__).parents[1]
LAB = tomllib.loads((ROOT / "lab" / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_a_command_of_another_package(install, capsys):
    code = "import click\n@click.command()\ndef hello():\n    'Greet.'\n    click.echo('hi')\n"
    install(code, "[lineament.commands]\nhello = stranger:hello\n")
    assert run(["hello"]) == 0
    assert capsys.readouterr().out == "hi\n"
    assert run(["--help"]) == 0
    assert re.search(r"^  hello +Greet\.$", capsys.readouterr().out, re.MULTILINE)


@pytest.mark.parametrize(
    ("code", "why"),
    [
        ("import nothing_like_it\n", "ModuleNotFoundError: No module named 'nothing_like_it'"),
        ("hello = 3\n", "it is 3, expected a click command"),
        ("1 / 0\n", "ZeroDivisionError: division by zero"),
    ],
)
def test_a_broken_command_costs_no_other(code, why, install, capsys, refused):
    install(code, "[lineament.commands]\nhello = stranger:hello\n")
    line = f"lineament: hello cannot be loaded from stranger:hello: {why}"
    assert refused("hello --loud x") == line
    assert run(["--help"]) == 0
    assert "cannot be loaded" in capsys.readouterr().out
    assert run(["methods"]) == 0


def test_our_own_commands_cannot_be_replaced(install, refused):
    install(
        "import click\ninfo = click.Command('info')\n", "[lineament.commands]\ninfo = stranger:info"
    )
    assert "nowhere.npz" in refused("info nowhere.npz")


def test_without_the_laboratory_its_package_is_named(monkeypatch, capsys, refused):
    monkeypatch.setattr("lineament.cli.plugins", lambda _: {})
    missing = "which is not installed: pip install lineament-lab"
    said = refused("reproduce -o x", 2)
    assert said == f"lineament: reproduce is part of lineament-lab, {missing}"
    assert "No such command 'fly'" in refused("fly", 2)
    assert run(["--help"]) == 0
    assert "reproduce" not in capsys.readouterr().out


def test_what_is_known_of_the_laboratory_is_what_it_declares():
    declared = LAB["entry-points"]
    for group in (COMMANDS, METHODS):
        assert set(LABORATORY[group]) == set(declared.get(group, ()))
    assert LAB["version"] == lineament.__version__
    assert f"lineament=={lineament.__version__}" in LAB["dependencies"]
    assert module.LABORATORY is LABORATORY


def test_the_commands_of_the_laboratory_are_there():
    context = click.Context(cli)
    assert set(LABORATORY[COMMANDS]) <= set(cli.list_commands(context))
