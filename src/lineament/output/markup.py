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
    shown = (
        letter
        if letter in "\n\t" or not unicodedata.category(letter).startswith("C")
        else ascii(letter)[1:-1]
        for letter in text
    )
    return html.escape("".join(shown))
