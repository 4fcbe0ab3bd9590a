"""The rules of the house that no linter knows: sizes, signatures, words."""

from __future__ import annotations

import ast
import re
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
#: Packages whose names are imported when they are first used.
LAZY = ("lineament", *(f"lineament.{name}" for name in ("checks", "live", "logs", "methods")))
LAZY += ("lineament_lab.methods",)
SOURCES = sorted([*(ROOT / "src").rglob("*.py"), *(ROOT / "lab" / "src").rglob("*.py")])
TEXTS = [*(ROOT / "src").rglob("*.js"), *(ROOT / "docs").glob("*.md"), ROOT / "README.md"]
PAGES = [*SOURCES, *sorted(TEXTS)]
#: Words that a roboticist would have to translate; the glossary in CONTRIBUTING has the field's.
PRIVATE = re.compile(
    r"\b([Tt]ells?(?! apart)|[Tt]old|(?<!there )is none|of (its|their) own|made straight)\b"
)


def names(paths):
    return [str(path.relative_to(ROOT)) for path in paths]


@pytest.mark.parametrize("path", SOURCES, ids=names(SOURCES))
def test_files_and_signatures_are_of_a_size_to_read(path):
    text = path.read_text(encoding="utf-8")
    assert text.count("\n") <= 340
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef):
            count = len(node.args.posonlyargs) + len(node.args.args) + len(node.args.kwonlyargs)
            assert count <= 14, f"{node.name}: {count}"  # `self` included
        if isinstance(node, ast.ImportFrom):
            assert node.end_lineno - node.lineno <= 15, f"line {node.lineno}"


def test_kernels_have_at_most_twelve_parameters():
    found = [
        f"{path.name}: {node.name} has {len(node.args.args)}"
        for path in SOURCES
        if "kernels" in path.parts
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef) and len(node.args.args) > 12
    ]
    assert found == []


@pytest.mark.parametrize("path", PAGES, ids=names(PAGES))
def test_words_are_those_of_the_field(path):
    lines = path.read_text(encoding="utf-8").splitlines()
    assert [f"{k}: {line.strip()}" for k, line in enumerate(lines, 1) if PRIVATE.search(line)] == []


@pytest.mark.parametrize("path", SOURCES, ids=names(SOURCES))
def test_no_room_reaches_for_the_roof(path):
    """Of imports of the whole package the contracts of the floors know nothing."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    imported = [a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names]
    assert not {"lineament", "lineament_lab"} & set(imported)


@pytest.mark.parametrize("module", LAZY)
def test_lazy_names_are_those_that_type_checkers_see(module):
    """They let others use what is imported as the same name, and what is defined."""
    lazy = import_module(module)
    source = Path(lazy.__file__).read_text(encoding="utf-8")
    seen = re.findall(r"\b(\w+) as \1\b|^(?:class |def )?(\w+)(?: =|\()", source, re.M)
    assert {*lazy.__all__} - {one or other for one, other in seen} <= {"__version__"}
