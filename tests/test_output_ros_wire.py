"""Bytes of ROS messages: by hand, and as the reader of both encodings takes them back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lineament.rosmsg.wire import WireReader as Wire
from lineament.rosmsg.wire import WireWriter as Packer

both = pytest.mark.parametrize("encoding", ["cdr", "ros1"])


def packed(encoding, *fields):
    """Bytes behind the first four of CDR, of calls (method, arguments ...)."""
    packer = Packer(encoding)
    for name, *arguments in fields:
        getattr(packer, name)(*arguments)
    return packer.data[4 if encoding == "cdr" else 0 :]


def test_cdr_tells_its_byte_order():
    assert Packer("cdr").data == b"\0\1\0\0"
    assert Packer("ros1").data == b""


def test_numbers_are_aligned_to_their_size_in_cdr_alone():
    fields = ("numbers", "B", 7), ("numbers", "d", 1.0)
    one = b"\0\0\0\0\0\0\xf0\x3f"
    assert packed("cdr", *fields) == b"\7" + bytes(7) + one
    assert packed("ros1", *fields) == b"\7" + one
    assert packed("cdr", ("numbers", "B", 1), ("numbers", "I", 2)) == b"\1\0\0\0\2\0\0\0"
    assert packed("cdr", ("numbers", "iI", -1, 2), ("numbers", "B", 3))[-1:] == b"\3"


def test_strings_end_with_a_counted_null_byte_in_cdr_alone():
    assert packed("cdr", ("text", "hé")) == b"\4\0\0\0h\xc3\xa9\0"
    assert packed("ros1", ("text", "hé")) == b"\3\0\0\0h\xc3\xa9"
    assert packed("cdr", ("text", "")) == b"\1\0\0\0\0"
    assert packed("ros1", ("text", "")) == b"\0\0\0\0"
    assert packed("ros1", ("text", "\ud800")) == b"\1\0\0\0?"  # half of a pair is no character


def test_headers():
    fields = ("header", 7, 9, "ab")
    assert packed("cdr", fields) == b"\7\0\0\0\t\0\0\0\3\0\0\0ab\0"
    assert packed("ros1", fields) == bytes(4) + b"\7\0\0\0\t\0\0\0\2\0\0\0ab"


def test_elements_are_aligned_where_there_are_some():
    some, none = np.ones((1, 2)), np.ones((0, 2))
    assert packed("cdr", ("sequence", some))[:8] == b"\1\0\0\0\0\0\0\0"
    assert len(packed("cdr", ("sequence", some))) == 4 + 4 + 16
    assert packed("cdr", ("sequence", none)) == packed("ros1", ("sequence", none)) == bytes(4)
    assert len(packed("ros1", ("sequence", some))) == 4 + 16
    assert packed("cdr", ("numbers", "B", 1), ("raw", b"ab", 4)) == b"\1\0\0\0ab"
    assert packed("cdr", ("numbers", "B", 1), ("raw", b"", 4)) == b"\1"


def test_arrays_are_written_row_by_row():
    table = np.arange(6, dtype="<f4").reshape(2, 3)
    assert packed("ros1", ("array", table)) == np.arange(6, dtype="<f4").tobytes()
    every_other = table[:, ::2]  # not in one piece
    assert packed("ros1", ("array", every_other)) == np.array([0, 2, 3, 5], "<f4").tobytes()


def test_unknown_encoding_is_told():
    with pytest.raises(ValueError, match="encoding is 'xcdr2', expected ros1 or cdr"):
        Packer("xcdr2")


numbers = st.one_of(
    st.tuples(st.just("B"), st.tuples(st.integers(0, 255))),
    st.tuples(st.just("I"), st.tuples(st.integers(0, 2**32 - 1))),
    st.tuples(st.just("II"), st.tuples(*[st.integers(0, 2**32 - 1)] * 2)),
    st.tuples(st.just("7d"), st.tuples(*[st.floats(allow_nan=False)] * 7)),
)
texts = st.text(st.characters(exclude_characters="\0", exclude_categories=("Cs",)), max_size=9)
floats = st.lists(st.floats(width=32, allow_nan=False), max_size=9)


@both
@given(st.integers(0, 2**31 - 1), st.lists(st.one_of(numbers, texts, floats), max_size=12))
def test_what_is_written_is_read(encoding, stamp, fields):
    packer = Packer(encoding)
    packer.header(stamp, 5, "laser")
    for field in fields:
        if isinstance(field, str):
            packer.text(field)
        elif isinstance(field, list):
            packer.sequence(np.array(field, "<f4"))
        else:
            packer.numbers(field[0], *field[1])
    wire = Wire(packer.data, encoding)
    time, frame = wire.header()
    assert (math.floor(time), frame) == (stamp, "laser")
    for field in fields:
        if isinstance(field, str):
            assert wire.text() == field
        elif isinstance(field, list):
            assert wire.floats(wire.count()).tolist() == field
        else:
            assert wire.numbers(field[0]) == field[1]
    wire.end()
