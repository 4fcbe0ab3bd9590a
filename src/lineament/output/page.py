"""One self-contained page of figures and facts, to be opened from a folder or sent by mail."""

import base64
import os
from collections.abc import Iterable
from html import escape

from ..files import write_text

_STYLE = """
:root { color-scheme: light dark; --ink: #1b1f24; --soft: #57606a; --line: #d0d7de; --page: #fff; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6edf3; --soft: #9aa4af; --line: #30363d; --page: #0d1117; }
}
body { max-width: 72rem; margin: 2.5rem auto; padding: 0 1.25rem; color: var(--ink);
  background: var(--page); font: 16px/1.55 system-ui, sans-serif; }
h1 { margin: 0 0 1.25rem; font-size: 1.9rem; line-height: 1.2; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .3rem 1.25rem; margin: 0 0 2rem;
  padding: 1rem 0; border: solid var(--line); border-width: 1px 0; }
dt { color: var(--soft); }
dd { margin: 0; font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
figure { margin: 0 0 2.25rem; }
img { display: block; max-width: 100%; height: auto; border-radius: 8px; background: #fff;
  border: 1px solid var(--line); }
figcaption { margin-top: .6rem; color: var(--soft); }
h2 { margin: 3rem 0 .75rem; font-size: 1.4rem; line-height: 1.25; }
nav { columns: 20rem; margin: 0 0 2rem; }
nav a { display: block; color: inherit; }
.table { overflow-x: auto; margin: 1.25rem 0 2rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .9rem; }
caption { text-align: left; font-weight: 600; padding: .4rem 0; }
th, td { padding: .3rem .9rem .3rem 0; border-bottom: 1px solid var(--line); text-align: left; }
th { color: var(--soft); font-weight: 500; vertical-align: bottom; }
td.number { text-align: right; white-space: nowrap; }
.note { color: var(--soft); font-size: .9rem; margin: .4rem 0 0; }
"""
_NUMBER = ' class="number"'


def write_parts(path: str | os.PathLike[str], title: str, parts: Iterable[str]) -> None:
    """Write one HTML file, which needs no network, of parts as the functions below make them."""
    lines = [
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>",
        f"<h1>{escape(title)}</h1>",
        *parts,
        "</body>\n</html>\n",
    ]
    write_text(path, "\n".join(lines))


def list_part(facts: Iterable[tuple[str, str]]) -> str:
    """Make a list of names and values; nothing without one."""
    rows = "\n".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in facts)
    return f"<dl>\n{rows}\n</dl>" if rows else ""


def text_parts(paragraphs: Iterable[str]) -> list[str]:
    """Make paragraphs of plain text."""
    return [f"<p>{escape(paragraph)}</p>" for paragraph in paragraphs]


def contents_part(entries: Iterable[tuple[str, str]]) -> str:
    """List the headings of a page by name and text, each a link to its place."""
    links = [f'<a href="#{escape(name)}">{escape(text)}</a>' for name, text in entries]
    return "\n".join(["<nav>", *links, "</nav>"])


def heading_part(name: str, text: str) -> str:
    """Make a heading that `contents_part` links to."""
    return f'<h2 id="{escape(name)}">{escape(text)}</h2>'


def table_part(
    title: str, columns: Iterable[str], rows: Iterable[Iterable[tuple[str, bool]]], note: str = ""
) -> str:
    """Make a table; each cell is its text, and whether it is a number."""
    head = "".join(f"<th>{escape(name)}</th>" for name in columns)
    body = [
        "".join(f"<td{_NUMBER if is_number else ''}>{escape(text)}</td>" for text, is_number in row)
        for row in rows
    ]
    lines = [
        '<div class="table">\n<table>',
        f"<caption>{escape(title)}</caption>\n<thead><tr>{head}</tr></thead>\n<tbody>",
        *(f"<tr>{cells}</tr>" for cells in body),
        "</tbody>\n</table>",
        *([f'<p class="note">{escape(note)}</p>'] if note else []),
        "</div>",
    ]
    return "\n".join(lines)


def image_part(caption: str, png: bytes) -> str:
    """Make a figure of the bytes of a PNG file; the caption is the image's text, too."""
    data, text = base64.b64encode(png).decode("ascii"), escape(caption)
    return (
        f'<figure>\n<img src="data:image/png;base64,{data}" alt="{text}">\n'
        f"<figcaption>{text}</figcaption>\n</figure>"
    )
