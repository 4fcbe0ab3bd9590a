"""One self-contained page of figures and facts, to be opened from a folder or sent by mail."""

from __future__ import annotations

import base64
import os
from collections.abc import Iterable
from html import escape
from pathlib import Path

from ..atomic import naming_errors, written_beside
from ..errors import LineamentError

__all__ = ["write_page"]

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
    rows = "\n".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in facts)
    images = "\n".join(_figure(caption, image) for caption, image in figures)
    paragraphs = "\n".join(f"<p>{escape(note)}</p>" for note in notes)
    parts = [
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>",
        f"<h1>{escape(title)}</h1>",
        f"<dl>\n{rows}\n</dl>" if rows else "",
        images,
        paragraphs,
        "</body>\n</html>\n",
    ]
    # A name that no encoding knows (of a file, say) is shown with a mark, not a failure.
    page = "\n".join(part for part in parts if part).encode("utf-8", errors="replace")
    with written_beside(path) as temporary, naming_errors(path):
        temporary.write_bytes(page)


def _figure(caption: str, image: str | os.PathLike[str]) -> str:
    try:
        content = Path(image).read_bytes()
    except OSError as error:
        raise LineamentError(f"{image}: cannot be read: {error.strerror}") from error
    if not content.startswith(b"\x89PNG\r\n\x1a\n"):
        raise LineamentError(f"{image}: is no PNG file")
    data, text = base64.b64encode(content).decode("ascii"), escape(caption)
    return (
        f'<figure>\n<img src="data:image/png;base64,{data}" alt="{text}">\n'
        f"<figcaption>{text}</figcaption>\n</figure>"
    )
