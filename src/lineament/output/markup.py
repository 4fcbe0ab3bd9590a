"""Text in HTML and SVG."""

import html
import unicodedata


def escape(text: str) -> str:
    r"""Escape text for HTML and SVG.

    Control characters, which steer terminals and which XML has none of, become escapes as well.

    Examples
    --------
    >>> escape("a < b\x1b[31m")
    'a &lt; b\\x1b[31m'
    """
    return html.escape("".join(letter if _is_shown(letter) else _named(letter) for letter in text))


def _is_shown(letter: str) -> bool:
    return letter in "\n\t" or not unicodedata.category(letter).startswith("C")


def _named(letter: str) -> str:
    return ascii(letter)[1:-1]
