"""One self-contained page of figures and facts, to be opened from a folder or sent by mail."""

from __future__ import annotations

import base64
import os
from collections.abc import Iterable
from html import escape
from pathlib import Path

from ..errors import LineamentError
from ..files import write_text

__all__ = [
    "contents_part",
    "heading_part",
    "image_part",
    "list_part",
    "table_part",
    "text_parts",
    "write_page",
    "write_parts",
]

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


def write_page(
    path: str | os.PathLike[str],
    title: str,
    facts: Iterable[tuple[str, str]],
    figures: Iterable[tuple[str, str | os.PathLike[str]]],
    notes: Iterable[str] = (),
) -> None:
    """Write one HTML file with the images inside it, that needs no network.

    Parameters
    ----------
    path : path-like
        The page.
    title : str
        Its title.
    facts : iterable of (str, str)
        Names and values, shown as a list above the figures.
    figures : iterable of (str, path-like)
        Caption and PNG file of each figure; the caption is the image's text, too.
    notes : iterable of str
        Paragraphs below the figures.

    Raises
    ------
    LineamentError
        If an image cannot be read or the page cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> page = Path(tempfile.mkdtemp()) / "index.html"
    >>> write_page(page, "Demo", [("scans", "331")], [], ["Made by one command."])
    >>> "<dt>scans</dt><dd>331</dd>" in page.read_text(encoding="utf-8")
    True
    """
    images = [image_part(caption, _png(image)) for caption, image in figures]
    write_parts(path, title, [list_part(facts), *images, *text_parts(notes)])


def write_parts(path: str | os.PathLike[str], title: str, parts: Iterable[str]) -> None:
    """Write one HTML file of parts, such as those that the functions below make.

    Parameters
    ----------
    path : path-like
        The page.
    title : str
        Its title.
    parts : iterable of str
        What stands below the title, in HTML; empty ones are left out.

    Raises
    ------
    LineamentError
        If the page cannot be written.
    """
    lines = [
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>",
        f"<h1>{escape(title)}</h1>",
        *(part for part in parts if part),
        "</body>\n</html>\n",
    ]
    write_text(path, "\n".join(lines))


def list_part(facts: Iterable[tuple[str, str]]) -> str:
    """Names and values as a list; nothing of none."""
    rows = "\n".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in facts)
    return f"<dl>\n{rows}\n</dl>" if rows else ""


def text_parts(paragraphs: Iterable[str]) -> list[str]:
    """Plain text as paragraphs.

    Examples
    --------
    >>> text_parts(["1 < 2"])
    ['<p>1 &lt; 2</p>']
    """
    return [f"<p>{escape(paragraph)}</p>" for paragraph in paragraphs]


def contents_part(entries: Iterable[tuple[str, str]]) -> str:
    """List the headings of a page by name and text, each a link to its place."""
    links = [f'<a href="#{escape(name)}">{escape(text)}</a>' for name, text in entries]
    return "\n".join(["<nav>", *links, "</nav>"])


def heading_part(name: str, text: str) -> str:
    """Make a heading that `contents_part` links to.

    Examples
    --------
    >>> heading_part("noise", "Noise points")
    '<h2 id="noise">Noise points</h2>'
    """
    return f'<h2 id="{escape(name)}">{escape(text)}</h2>'


def table_part(
    title: str, columns: Iterable[str], rows: Iterable[Iterable[tuple[str, bool]]], note: str = ""
) -> str:
    """Make a table; each cell is its text, and whether it is a number."""
    head = "".join(f"<th>{escape(name)}</th>" for name in columns)
    lines = [
        "<tr>"
        + "".join(
            f'<td class="number">{escape(text)}</td>' if is_number else f"<td>{escape(text)}</td>"
            for text, is_number in row
        )
        + "</tr>"
        for row in rows
    ]
    below = f'<p class="note">{escape(note)}</p>\n' if note else ""
    return (
        f'<div class="table">\n<table>\n<caption>{escape(title)}</caption>\n'
        f"<thead><tr>{head}</tr></thead>\n<tbody>\n"
        + "\n".join(lines)
        + f"\n</tbody>\n</table>\n{below}</div>"
    )


def image_part(caption: str, png: bytes) -> str:
    """Make a figure of the bytes of a PNG file; the caption is the image's text, too."""
    data, text = base64.b64encode(png).decode("ascii"), escape(caption)
    return (
        f'<figure>\n<img src="data:image/png;base64,{data}" alt="{text}">\n'
        f"<figcaption>{text}</figcaption>\n</figure>"
    )


def _png(image: str | os.PathLike[str]) -> bytes:
    try:
        content = Path(image).read_bytes()
    except OSError as error:
        raise LineamentError(f"{image}: cannot be read: {error.strerror}") from error
    if not content.startswith(b"\x89PNG\r\n\x1a\n"):
        raise LineamentError(f"{image}: is no PNG file")
    return content
