"""The documents name what there is."""

import doctest
import pkgutil
import re
import tomllib
from dataclasses import fields
from importlib import import_module
from pathlib import Path

import lineament_lab
import pytest

import lineament as ln
from lineament.cli import cli
from lineament.methods import method_names, stages
from lineament.methods.liu import Liu

ROOT = Path(__file__).parent.parent
SOURCE = ROOT / "src" / "lineament"


def listed(nav):
    if isinstance(nav, str):
        return [nav]
    return [
        page for part in (nav.values() if isinstance(nav, dict) else nav) for page in listed(part)
    ]


def test_site_has_each_page_and_each_public_package_once():
    site = tomllib.loads((ROOT / "zensical.toml").read_text(encoding="utf-8"))["project"]
    docs, documents = ROOT / "docs", site["extra"]["documents"]
    written = [p.relative_to(docs).with_suffix(".md").as_posix() for p in docs.rglob("*.[mp][dy]")]
    for source in documents.values():
        assert (ROOT / source).exists()
    packages = {"commands", "lineament", "lineament.bounds", "lineament.methods.stages"}
    packages |= {"lineament.methods.functions", "lineament.plugins"}
    found_packages = (
        *pkgutil.walk_packages(ln.__path__, "lineament."),
        *pkgutil.walk_packages(lineament_lab.__path__, "lineament_lab."),
    )
    for found in found_packages:
        if found.ispkg and not found.name.startswith("lineament.cli"):
            packages |= {found.name} if hasattr(import_module(found.name), "__all__") else set()
    reference = [f"reference/{package}.md" for package in packages]
    assert sorted(listed(site["nav"])) == sorted([*written, *documents, *reference])


def test_equations_lead_to_functions_in_their_files():
    text = (ROOT / "docs" / "equations.md").read_text(encoding="utf-8")
    places = re.findall(r"`([\w.]+)`(?:, `(\w+)`)? → `([\w/]+\.py)`", text)
    assert len(places) >= 12
    for first, second, file in places:
        code = (SOURCE / file).read_text(encoding="utf-8")
        for name in filter(None, (first.split(".")[-1], second)):
            assert re.search(rf"\bdef {name}\(", code), f"{name} is not in {file}"
    for name in re.findall(r"`stages\.(\w+)`", text):
        assert name in stages.__all__


def test_equations_state_the_defaults():
    text = (ROOT / "docs" / "equations.md").read_text(encoding="utf-8")
    for name, value in re.findall(r"`(\w+) = ([\d.]+)`", text):
        assert getattr(Liu(), name) == float(value)
    for name in re.findall(r"`(\w+)=\"?\w*\"?`", text):
        assert name in {field.name for field in fields(Liu)}


def test_methods_commands_and_public_names_are_what_there_is():
    methods = (ROOT / "docs" / "methods.md").read_text(encoding="utf-8")
    for name in method_names(presets=False):
        assert f"| `{name}`" in methods
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for command in re.findall(r"^lineament (\w+)", text, re.MULTILINE):
        assert command in cli.list_commands(None)
    for name in re.findall(r"\bln\.(\w+)", text):
        assert hasattr(ln, name)


def test_every_public_name_resolves_and_is_documented():
    for name in ln.__all__:
        value = getattr(ln, name)
        assert isinstance(value, str) or value.__doc__
    assert dir(ln) == sorted(ln.__all__)


@pytest.mark.parametrize("name", ["choosing", "faq", "invalid"])
def test_examples_of_documents(name):
    path = str(ROOT / "docs" / f"{name}.md")
    flags = doctest.NORMALIZE_WHITESPACE
    failed, tried = doctest.testfile(
        path, module_relative=False, encoding="utf-8", optionflags=flags
    )
    assert tried >= 5
    assert not failed


def test_pages_lead_somewhere():
    for page in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        for target in re.findall(r"\]\(([\w/.-]+)(?:#[\w-]*)?\)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.name} leads to {target}"


def test_what_is_said_of_other_projects_has_its_source():
    text = (ROOT / "docs" / "comparison.md").read_text(encoding="utf-8")
    sources = set(re.findall(r"^\[([A-Z]\d+)\]: https://", text, re.MULTILINE))
    tables, used, count = text.split("## Speed")[0].split("## Finding"), set(), 0
    for part, projects in zip(tables, ("LOSFN", "ATCG"), strict=True):
        lines = [line for line in part.splitlines() if line.startswith("|")]
        for line, below in zip(lines, [*lines[1:], ""], strict=True):
            if "---" in line or "---" in below:  # a heading
                continue
            for project, cell in zip(projects, line.split("|")[3:-1], strict=True):
                found = re.findall(r"\[([A-Z]\d+)\]", cell)
                known = "†" in cell or cell.strip() == "*not stated*"
                assert known or any(name[0] == project for name in found), cell
                used.update(found)
                count += 1
    assert count > 150
    assert used == sources
