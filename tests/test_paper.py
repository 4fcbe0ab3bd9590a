"""The paper: as long as the journal allows, and all that it cites was looked up."""

import re
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "paper"
TEXT = (FOLDER / "paper.md").read_text(encoding="utf-8")
ENTRIES = re.split(r"^@\w+\{", (FOLDER / "paper.bib").read_text(encoding="utf-8"), flags=re.M)[1:]


def test_it_is_as_long_as_the_journal_allows():
    _, head, body = TEXT.split("---\n", 2)
    assert 700 < len(body.split()) <= 1500
    for field in ("title", "tags", "authors", "affiliations", "date", "bibliography"):
        assert re.search(rf"^{field}:", head, re.M), field
    for part in ("Summary", "Statement of need", "State of the field", "Evidence", "Limits"):
        assert f"# {part}\n" in body


def test_each_source_is_cited_and_has_an_address():
    names = {entry.split(",")[0] for entry in ENTRIES}
    assert names == set(re.findall(r"@([a-z]+\d{4})", TEXT))
    for entry in ENTRIES:
        assert re.search(r"^\s+(doi|url) = \{\S+\}", entry, re.M), entry
        assert all(f"{field} = " in entry for field in ("author", "title", "year"))


def test_its_pictures_exist():
    for target in re.findall(r"!\[[^]]*\]\(([^)]+)\)", TEXT):
        assert (FOLDER / target).exists(), target
