"""Numbers as the words of a text line hold them, with what is wrong with one as a ValueError."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["Numbers", "floats", "quoted", "whole_number"]


class Numbers(dict[bytes, float]):
    """Numbers by how they are written.

    Scanners report centimetres: a log has few different values, and to look one up takes half
    the time of converting it. The table is bounded, as memory must not grow with the log.

    Examples
    --------
    >>> Numbers().vector("range", [b"1.5", b"81.83"]).tolist()
    [1.5, 81.83]
    """

    def __missing__(self, word: bytes) -> float:
        if b"_" in word:  # Python's own notation, nobody else's.
            raise ValueError
        value = float(word)
        if len(self) < 1 << 15 and len(word) < 16:
            self[word] = value
        return value

    def vector(self, what: str, words: list[bytes]) -> NDArray[np.float64]:
        """Return all words as numbers; ValueError, which names the first that is none, if not."""
        try:
            return np.fromiter(map(self.__getitem__, words), np.float64, len(words))
        except ValueError:
            raise _no_number(what, words) from None


def floats(what: str, words: list[bytes]) -> list[float]:
    """Return numbers that hardly ever repeat, which would only fill the table.

    Raises
    ------
    ValueError
        If a word is no number.

    Examples
    --------
    >>> floats("pose: value", [b"1", b"x"])
    Traceback (most recent call last):
    ValueError: pose: value 2 of 2 is 'x', expected a number
    """
    try:
        if any(b"_" in word for word in words):
            raise ValueError
        return list(map(float, words))
    except ValueError:
        raise _no_number(what, words) from None


def whole_number(what: str, word: bytes) -> int:
    """Return a count; ValueError if the word is none.

    Examples
    --------
    >>> whole_number("the number of ranges", b"180")
    180
    """
    if not word.isdigit() or len(word) > 9:
        raise ValueError(f"{what} is {quoted(word)}, expected a whole number")
    return int(word)


def quoted(word: bytes) -> str:
    r"""Return the beginning of a word as an error shows it, whatever its bytes.

    Examples
    --------
    >>> print(quoted(bytes([97, 255])))
    'a\xff'
    """
    return f"'{word[:24].decode('ascii', 'backslashreplace')}'"


def _no_number(what: str, words: list[bytes]) -> ValueError:
    for i, word in enumerate(words):
        try:
            Numbers()[word]
        except ValueError:
            which = f"{what} {i + 1} of {len(words)}"
            return ValueError(f"{which} is {quoted(word)}, expected a number")
    return ValueError(f"{what}: expected numbers")
