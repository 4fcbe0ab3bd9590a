"""Check of a decoder of messages: every encoding the same, and no damage but a ValueError."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from random import Random
from typing import Any

import numpy as np

from ..rosmsg.poses import POSE_TYPES, odometry, stamped_poses
from ..rosmsg.scans import decoders
from ..rosmsg.wire import WireWriter
from .claims import claim, during, without_warnings, words_of

#: What a length or a number must not be believed to be.
_WORDS = (0, 1, 255, 2**16, 2**28, 2**31 - 1, 2**31, 2**32 - 1, 0x7F800001, 0x7FC00000)
#: Memory that a damaged message of a few hundred bytes may take [bytes].
_MOST = 1 << 24

Decoder = Callable[[Any, str], Any]


def message_kinds() -> list[str]:
    """List the types of messages that `check_message` knows by name.

    Examples
    --------
    >>> message_kinds()[:2]
    ['sensor_msgs/LaserScan', 'sensor_msgs/MultiEchoLaserScan']
    """
    return [*decoders("first", 1), *POSE_TYPES, "tf2_msgs/TFMessage"]


def check_message(
    kind: str | Decoder, samples: Mapping[str, bytes] | None = None, *, tries: int = 200
) -> None:
    """Check a decoder: every encoding gives the same, and no damage but a ValueError.

    Wherever a message is cut off, and with any word of it changed, the decoder returns something
    or raises a ValueError of one line, in little memory: it does not believe the lengths in it.
    Without its last bytes it may return only what it returned with them.

    Parameters
    ----------
    kind : str or callable
        One of `message_kinds`, which lineament decodes, or a function of bytes and an encoding
        (``cdr`` or ``ros1``) that returns what is in the message.
    samples : mapping, optional
        The same message in each encoding, for a function.
    tries : int
        Words that are changed, always the same.

    Raises
    ------
    AssertionError
        If anything of this does not hold: one line that names the encoding and what broke.

    Examples
    --------
    >>> check_message("sensor_msgs/LaserScan")
    >>> check_message(lambda data, encoding: data[3], {"ros1": bytes(9)})  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    AssertionError: <lambda>: ros1: cut off after 0 of 9 bytes: raised IndexError: index out ...
    """
    if isinstance(kind, str):
        claim(kind in message_kinds(), f"{kind} is unknown, expected one of: {message_kinds()}")
        name, decode = kind, _decoder(kind)
        samples = {encoding: _sample(kind, encoding) for encoding in ("cdr", "ros1")}
    else:
        name, decode = getattr(kind, "__name__", type(kind).__name__), kind
    with during(name), without_warnings():
        claim(samples, "has no samples: they are few to check")
        found = []
        for encoding, data in (samples or {}).items():
            with during(encoding):
                found.append(_decoded(decode, data, encoding, tries))
        claim(all(one == found[0] for one in found), "the encodings give different values")


def _decoded(decode: Decoder, data: bytes, encoding: str, tries: int) -> object:
    """Return what a whole message gives."""
    whole = words_of(decode(data, encoding))
    claim(words_of(decode(data, encoding)) == whole, "the same bytes give another value")
    claim(words_of(decode(memoryview(data), encoding)) == whole, "a memoryview gives another one")
    for size in range(len(data)):
        with during(f"cut off after {size} of {len(data)} bytes"):
            given = _given(decode, data[:size], encoding)
            claim(given in (None, whole), "gives a value that is not that of the message")
    chance = Random(0)
    with _little_memory():
        for _ in range(tries):
            at, word = chance.randrange(len(data)), chance.choice(_WORDS)
            changed = (data[:at] + word.to_bytes(4, "little") + data[at + 4 :])[: len(data)]
            with during(f"with {word:#x} at byte {at}"):
                _given(decode, changed, encoding)
    return whole


def _given(decode: Decoder, data: bytes, encoding: str) -> object:
    """Return what comes of a damaged message, None if it is a ValueError."""
    try:
        return words_of(decode(data, encoding))
    except ValueError as error:
        claim(str(error).isprintable(), "the ValueError is not one line")
        claim(type(error) is ValueError, f"raised {type(error).__name__}: {error}")
        return None


@contextmanager
def _little_memory() -> Iterator[None]:
    """Claim that little memory is taken within, unless somebody traces it already."""
    if tracemalloc.is_tracing():
        yield
        return
    tracemalloc.start()
    try:
        yield
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    claim(most < _MOST, f"a damaged message of a few bytes takes {most >> 20} MB")


# Those that lineament knows


def _decoder(kind: str) -> Decoder:
    known: dict[str, Decoder] = dict(decoders("last", 1))
    if kind == "nav_msgs/Odometry":
        return lambda data, encoding: (odometry(data, encoding), *_poses(data, encoding, kind))
    return known.get(kind) or partial(_poses, kind=kind)


def _poses(data: Any, encoding: str, kind: str) -> list[Any]:
    return list(stamped_poses(data, encoding, kind))


def _sample(kind: str, encoding: str) -> bytes:
    """Return a message of a type, field by field."""
    writer = WireWriter(encoding)
    geometry = (-0.5, 0.5, 0.5, 1e-3, 0.1, 0.25, 30.0)
    if kind in POSE_TYPES or "/TF" in kind:
        _put_poses(writer, kind)
        return writer.data
    writer.header(1_700_000_000, 5, "laser")
    if kind == "sensor_msgs/LaserScan":
        writer.numbers("7f", *geometry)
        for values in ((1.0, np.nan, 3.0), (7.0, 8.0, 9.0)):
            writer.sequence(np.array(values, "<f4"))
    elif kind == "sensor_msgs/MultiEchoLaserScan":
        writer.numbers("7f", *geometry)
        for beams in (((1.0, 2.0), (), (3.0,)), ((5.0, 6.0), (), (7.0,))):
            writer.count(len(beams))
            for beam in beams:
                writer.sequence(np.array(beam, "<f4"))
    else:
        _put_cloud(writer)
    return writer.data


def _put_poses(writer: WireWriter, kind: str) -> None:
    if "/TF" in kind:
        writer.count(1)
    writer.header(1_700_000_000, 5, "odom")
    if POSE_TYPES.get(kind, True):
        writer.text("base")
    writer.numbers("7d", 1.0, 2.0, 0.0, 0.0, 0.0, 0.6, 0.8)
    if "Covariance" in kind or "Odometry" in kind:
        writer.array(np.eye(6))
    if "Odometry" in kind:
        writer.numbers("6d", 1.0, 0.0, 0.0, 0.0, 0.0, 0.5)
        writer.array(np.eye(6))


def _put_cloud(writer: WireWriter) -> None:
    """Two rings of three points."""
    points = np.zeros((2, 3), [("x", "<f4"), ("y", "<f4"), ("ring", "<u2")])
    points["x"], points["y"] = 2.0, [(-1.0, 0.0, 1.0)] * 2
    points["ring"] = [[0] * 3, [1] * 3]
    writer.numbers("2I", *points.shape)
    writer.count(3)
    for name, offset, form in (("x", 0, 7), ("y", 4, 7), ("ring", 8, 4)):
        writer.text(name)
        writer.count(offset)
        writer.numbers("B", form)
        writer.count(1)
    writer.numbers("B", False)
    writer.numbers("2I", points.itemsize, points[0].nbytes)
    writer.count(points.nbytes)
    writer.raw(points.tobytes())
    writer.numbers("B", True)
