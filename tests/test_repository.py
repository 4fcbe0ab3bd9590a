"""What people meet in the repository agrees with the package."""

import ast
import re
import tomllib
from datetime import date
from pathlib import Path

import numpy as np
import pytest
import yaml  # which distributed needs

import lineament as ln
from lineament.cli import cli

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
FORMS = sorted(
    path for path in (ROOT / ".github/ISSUE_TEMPLATE").glob("*.yml") if path.stem != "config"
)


def read_yaml(path):
    return yaml.safe_load((ROOT / path).read_text(encoding="utf-8"))


def test_citation_is_of_this_version():
    citation = read_yaml("CITATION.cff")
    assert citation["cff-version"] == "1.2.0"
    assert citation["type"] == "software"
    assert citation["title"] == PROJECT["name"]
    assert citation["version"] == ln.__version__
    assert citation["license"] == PROJECT["license"]
    assert citation["abstract"] == PROJECT["description"]
    assert citation["keywords"] == PROJECT["keywords"]
    assert citation["authors"] == PROJECT["authors"]
    released = re.search(
        rf"^## {re.escape(ln.__version__)} – (.+)$",
        (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"),
        re.MULTILINE,
    )[1]
    assert str(citation.get("date-released", "unreleased")) == released
    assert released == "unreleased" or date.fromisoformat(released)


def test_citation_has_the_article_that_the_method_names():
    (article,) = read_yaml("CITATION.cff")["references"]
    names = ", ".join(f"{a['given-names']} {a['family-names']}" for a in article["authors"])
    from lineament.methods import liu

    text = " ".join(liu.__doc__.split())
    assert f"{names}, *{article['journal']}* {article['year']}, article {article['start']}" in text
    assert article["doi"] == f"10.1155/{article['year']}/{article['start']}"


def test_workflow_runs_what_a_commit_runs_on_each_system_and_python():
    workflow = read_yaml(".github/workflows/ci.yml")
    quick, job = workflow["jobs"].values()
    assert quick["steps"][-1]["run"].startswith("make test ")
    assert job["needs"] == "quick"
    matrix = job["strategy"]["matrix"]
    listed = [c.rpartition(" ")[2] for c in PROJECT["classifiers"] if "Python :: 3." in c]
    assert matrix["python"] == listed
    assert PROJECT["requires-python"] == f">={listed[0]}"
    assert {name.partition("-")[0] for name in matrix["os"]} == {"ubuntu", "macos", "windows"}
    runs = [step["run"] for step in job["steps"] if "run" in step]
    assert runs[-1] == ".ci/run"
    assert (ROOT / ".ci/run").stat().st_mode & 0o100
    assert workflow["permissions"] == {"contents": "read"}
    table = (ROOT / "docs/releasing.md").read_text(encoding="utf-8")
    assert re.findall(r"3\.\d+", " ".join(re.findall(r"^\| Python .*", table, re.M))) == listed


@pytest.mark.parametrize("path", FORMS, ids=lambda path: path.stem)
def test_forms_ask_for_what_shows_the_problem(path, tmp_path, monkeypatch):
    form = read_yaml(path)
    assert form["name"]
    assert form["description"]
    fields = {part["id"]: part for part in form["body"]}
    assert len(fields) == len(form["body"])
    assert {"info", "scan", "version"} <= fields.keys()
    assert "`lineament info LOG`" in fields["info"]["attributes"]["description"]
    for part in fields.values():
        assert part["type"] in {"input", "textarea"}
        for command in re.findall(r"`lineament (\w+)", str(part["attributes"])):
            assert command in cli.list_commands(None)
    # What people are asked to type works, and the scan that arrives is the one that they saw.
    (code,) = re.findall(r'python -c "(.+)"', fields["scan"]["attributes"]["description"])
    ast.parse(code)
    monkeypatch.chdir(tmp_path)
    ranges = np.full((41, 9), 2.0) + np.arange(41)[:, None]
    ln.logs.save_npz("LOG.npz", [ln.LaserScan(row, 0.0, 0.01, stamp=row[0]) for row in ranges])
    exec(code.replace("'LOG'", "'LOG.npz'"))
    (scan,) = ln.open_log("scan.npz")
    assert (scan.ranges[0], scan.stamp) == (42.0, 42.0)


def test_forms_are_there():
    assert {path.stem for path in FORMS} == {"fault", "wrong_features"}
