"""check_message: every decoder passes, and what is broken in one is named in a line."""

import struct

import numpy as np
import pytest

from lineament.checks import check_message, message_kinds


@pytest.mark.parametrize("kind", message_kinds())
def test_every_decoder(kind):
    check_message(kind)


#: The number of bytes, and they.
SAMPLES = dict.fromkeys(("ros1", "cdr"), struct.pack("<I8s", 8, b"ab\xc3\xa9cdef"))


def taken(data, _):
    if len(data) < 4 or len(data) != 4 + int.from_bytes(data[:4], "little"):
        raise ValueError("has another length than it says")
    return bytes(data[4:])


def indexed(data, _):
    return data[0], data[11]


def in_letters(data, encoding):
    return taken(data, encoding).decode()


def in_any_length(data, _):
    return bytes(data[4:])


def in_one_encoding(data, encoding):
    return taken(data, encoding), encoding


def by_its_length(data, encoding):
    np.zeros(min(int.from_bytes(data[:4], "little"), 1 << 25), np.uint8)
    return taken(data, encoding)


def by_lines(data, encoding):
    try:
        return taken(data, encoding)
    except ValueError as error:
        raise ValueError(f"what is this?\n{error}") from None


def of_bytes(data, encoding):
    return taken(data, encoding) if isinstance(data, bytes) else b""


def test_a_decoder_of_somebody():
    check_message(taken, SAMPLES)


@pytest.mark.parametrize(
    ("decode", "line"),
    [
        (indexed, "ros1: cut off after 0 of 12 bytes: raised IndexError: index out of range"),
        (in_letters, "ros1: with 0x.* at byte .: raised UnicodeDecodeError: 'utf-8' codec"),
        (in_any_length, "ros1: cut off after 0 of 12 bytes: gives a value that is not that of"),
        (in_one_encoding, "the encodings give different values"),
        (by_its_length, "ros1: a damaged message of a few bytes takes 32 MB"),
        (by_lines, "ros1: cut off after 0 of 12 bytes: the ValueError is not one line"),
        (of_bytes, "ros1: a memoryview gives another one"),
        ("std_msgs/String", "is unknown, expected one of: .'sensor_msgs/LaserScan'"),
    ],
)
def test_what_is_broken_is_named(decode, line):
    with pytest.raises(AssertionError, match=line) as caught:
        check_message(decode, SAMPLES)
    assert str(caught.value).isprintable()


def test_no_samples():
    with pytest.raises(AssertionError, match="taken: has no samples"):
        check_message(taken)
