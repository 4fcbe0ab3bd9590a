"""The prose of pages: paragraphs, captions and notes, by section of ``text.md``."""

from functools import cache
from importlib.resources import files


@cache
def _sections() -> dict[str, list[str]]:
    """Read the prose of pages: paragraphs by the name of their section."""
    text = (files(__package__) / "text.md").read_text(encoding="utf-8")
    parts = (section.split("\n\n") for section in text.removeprefix("# ").split("\n# "))
    return {name: [" ".join(one.split()) for one in those] for name, *those in parts}


def prose(section: str, **values: object) -> tuple[str, ...]:
    """Return the paragraphs of a section of ``text.md``, with values in their places.

    Examples
    --------
    >>> prose("two_corners", scans=20)[0][:62]
    'In the paper a convex corner A and a concave corner B of a mus'
    """
    return tuple(paragraph.format(**values) for paragraph in _sections()[section])
