"""One self-contained page of figures and facts, to be opened from a folder or sent by mail."""

import base64
import os
import struct
from collections.abc import Iterable
from typing import NamedTuple

from ..files import write_text
from .markup import escape

_STYLE = """
:root { color-scheme: light dark; --ink: #1b1f24; --soft: #57606a; --line: #d0d7de; --page: #fff;
  --good: #1a7f37; --fair: #9a6700; --bad: #cf222e; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6edf3; --soft: #9aa4af; --line: #30363d; --page: #0d1117;
    --good: #3fb950; --fair: #d29922; --bad: #ff7b72; }
}
* { box-sizing: border-box; }
body { max-width: 76rem; margin: 2.5rem auto; padding: 0 1.25rem; color: var(--ink);
  background: var(--page); font: 16px/1.55 system-ui, sans-serif; }
body > p { max-width: 46rem; }
h1 { margin: 0 0 1.25rem; font-size: 1.9rem; line-height: 1.2; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .3rem 1.25rem; margin: 0 0 2rem;
  padding: 1rem 0; border: solid var(--line); border-width: 1px 0; }
dt, figcaption, .note, th, small { color: var(--soft); }
dd { margin: 0; font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
a { color: inherit; text-underline-offset: .15em; }
figure { margin: 0 0 2.25rem; }
.card { overflow-x: auto; max-width: max-content; padding: .5rem; border-radius: 8px;
  background: #fff; border: 1px solid var(--line); }
.card.either { background: var(--page); }
.card img { display: block; width: var(--width); max-width: 100%; height: auto;
  min-width: min(.6 * var(--width), 40rem); }
figcaption { margin-top: .6rem; max-width: 46rem; }
h2 { margin: 3rem 0 .75rem; font-size: 1.4rem; line-height: 1.25; }
nav { columns: 20rem; margin: 0 0 2rem; }
nav a { display: block; padding: .1rem 0; break-inside: avoid; }
.table { margin: 1.25rem 0 2rem; }
.table > div { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .9rem; }
caption { text-align: left; font-weight: 600; padding: .4rem 0; }
th, td { padding: .3rem .9rem .3rem 0; border-bottom: 1px solid var(--line); text-align: left;
  vertical-align: top; }
td { min-width: 3.5rem; }
th { font-weight: 500; vertical-align: bottom; }
th.number, td.number { text-align: right; }
td.number, td.number small, td.verdict { white-space: nowrap; }
td.long { min-width: 14rem; }
td.number small { display: block; line-height: 1.2; }
td:first-child, th:first-child { position: sticky; left: 0; background: var(--page); }
td:first-child { min-width: min(11rem, 30vw); }
td.verdict { font-weight: 600; color: var(--soft); }
td.holds { color: var(--good); } td.in { color: var(--fair); } td.does { color: var(--bad); }
th button { all: unset; cursor: pointer; }
th button:focus-visible, .table > div:focus-visible { outline: 2px solid; outline-offset: 2px; }
th[aria-sort=ascending] button::after { content: " \\2191"; }
th[aria-sort=descending] button::after { content: " \\2193"; }
.note { max-width: 46rem; font-size: .9rem; margin: .4rem 0 0; }
@media print {
  :root { color-scheme: light; --ink: #000; --soft: #444; --line: #bbb; --page: #fff;
    --good: #1a7f37; --fair: #9a6700; --bad: #cf222e; }
  @page { margin: 14mm; }
  body { max-width: none; margin: 0; padding: 0; font-size: 10pt; }
  figure, tr { break-inside: avoid; }
  h2, caption { break-after: avoid; }
  .card, .table > div { overflow: visible; border: 0; padding: 0; }
  .card img { min-width: 0; max-height: 235mm; width: auto; max-width: 100%; }
  table { font-size: 7pt; }
  th, td { padding: .15rem .35rem .15rem 0; }
  th { hyphens: auto; }
  td.number small { white-space: normal; overflow-wrap: anywhere; }
  td, td.long, td:first-child { min-width: 0; }
}
"""
#: A click on the name of a column sorts by it: up, then down, then as the table was.
_SORTING = """
for (const table of document.querySelectorAll("table")) {
  const body = table.tBodies[0], rows = [...body.rows], cells = [...table.tHead.rows[0].cells];
  const key = (row, k) => {
    const text = row.cells[k].textContent.replace("\\u2212", "-");
    return /^[+-]?\\d/.test(text) ? parseFloat(text) : text;
  };
  const order = (a, b) => typeof a !== typeof b ? (typeof a === "number" ? -1 : 1)
    : typeof a === "number" ? a - b : a.localeCompare(b);
  cells.forEach((cell, k) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...cell.childNodes);
    cell.append(button);
    button.addEventListener("click", () => {
      const next = {ascending: "descending", descending: null}[cell.ariaSort];
      const sort = next === undefined ? "ascending" : next;
      cells.forEach(other => other.removeAttribute("aria-sort"));
      const sign = sort === "descending" ? -1 : 1, empty = row => key(row, k) === "\\u2013";
      if (sort) cell.setAttribute("aria-sort", sort);
      body.append(...!sort ? rows : [...rows].sort(
        (a, b) => empty(a) - empty(b) || sign * order(key(a, k), key(b, k))));
    });
  });
}
"""
#: Pixels of the page to one of a picture: figures of 200 dots to the inch have legible texts.
_SCALE = 0.6


class Cell(NamedTuple):
    """A cell of a table: its text, of what kind it is ("number", "verdict"), where it leads."""

    text: str
    kind: str = ""
    href: str = ""

    def __str__(self) -> str:
        """Write the cell as HTML; the range of a number is small, below it."""
        text, kind = escape(self.text), self.kind
        if kind == "number" and " (" in text:
            text = text.replace(" (", " <small>(", 1) + "</small>"
        if self.href:
            text = f'<a href="{escape(self.href)}">{text}</a>'
        if kind == "verdict":
            kind += f" {self.text.split()[0]}"
        elif not kind and len(self.text) > 40:
            kind = "long"
        return f"<td{_class(kind)}>{text}</td>"


def _class(name: str) -> str:
    return f' class="{name}"' if name else ""


def write_parts(path: str | os.PathLike[str], title: str, parts: Iterable[str]) -> None:
    """Write one HTML file, which needs no network, of parts as the functions below make them."""
    body = [f"<h1>{escape(title)}</h1>", *parts]
    if any("<table>" in part for part in body):
        body.append(f"<script>{_SORTING}</script>")
    lines = [
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>",
        *body,
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
    return "\n".join(['<nav aria-label="Contents">', *links, "</nav>"])


def heading_part(name: str, text: str) -> str:
    """Make a heading that `contents_part` links to."""
    return f'<h2 id="{escape(name)}">{escape(text)}</h2>'


def table_part(
    title: str, columns: Iterable[str], rows: Iterable[Iterable[Cell]], note: str = ""
) -> str:
    """Make a table that can be sorted by each column; one of numbers is set flush right."""
    cells = [list(row) for row in rows]
    kinds = [{cell.kind for cell in column} for column in zip(*cells, strict=True)]
    head = "".join(
        f"<th{_class('number' if 'number' in kind else '')}>{escape(name)}</th>"
        for name, kind in zip(columns, kinds, strict=True)
    )
    lines = [
        '<div class="table">\n<div tabindex="0">\n<table>',
        f"<caption>{escape(title)}</caption>\n<thead><tr>{head}</tr></thead>\n<tbody>",
        *(f"<tr>{''.join(map(str, row))}</tr>" for row in cells),
        "</tbody>\n</table>\n</div>",
        *([f'<p class="note">{escape(note)}</p>'] if note else []),
        "</div>",
    ]
    return "\n".join(lines)


def image_part(caption: str, png: bytes, name: str = "", dark: bytes = b"") -> str:
    """Make a figure of the bytes of a PNG file; the caption is the image's text, too.

    It is as wide as it was drawn, or as the page if that is less; links lead to its `name`. One for
    dark pages, of the same size, may be given with it.
    """
    data, text = base64.b64encode(png).decode("ascii"), escape(caption)
    source = ""
    if dark:
        black = base64.b64encode(dark).decode("ascii")
        source = (
            '<source media="screen and (prefers-color-scheme: dark)" '
            f'srcset="data:image/png;base64,{black}">'
        )
    width, height = (round(_SCALE * side) for side in struct.unpack(">2I", png[16:24]))
    place = f' id="{escape(name)}"' if name else ""
    return (
        f"<figure{place}>\n"
        f'<div class="card{" either" if dark else ""}" tabindex="0"><picture>{source}'
        f'<img width="{width}" height="{height}" style="--width: {width}px" '
        f'src="data:image/png;base64,{data}" alt="{text}"></picture></div>\n'
        f"<figcaption>{text}</figcaption>\n</figure>"
    )
