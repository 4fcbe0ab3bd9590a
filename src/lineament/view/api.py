"""The questions of the page and their answers, as JSON; what is wrong with a question."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any
from urllib.parse import parse_qsl

from .session import Session

__all__ = ["RequestError", "answer"]

#: Most stamps of one answer.
MOST_STAMPS = 4096
#: No whole number in a question has more digits.
_MOST_DIGITS = 12


class RequestError(Exception):
    """A question that has no answer.

    Parameters
    ----------
    status : int
        HTTP status: 400 for a question that makes no sense, 404 for what is not there.
    problem : str
        One line on what is wrong, and what was expected.
    """

    def __init__(self, status: int, problem: str) -> None:
        super().__init__(problem)
        self.status = status


def answer(session: Session, target: str) -> bytes:
    """Answer a request for ``/api/...``: the log, a scan and its features, stamps, or a trace.

    - ``/api/log``: what the log is, and how much of it has been read.
    - ``/api/stamps?first=&count=``: stamps of some scans.
    - ``/api/scan?i=&method=``: a scan and what a method finds in it.
    - ``/api/trace?i=&method=&beam=``: what became of a beam.

    Parameters
    ----------
    session : Session
    target : str
        Path and query.

    Raises
    ------
    RequestError
        If there is no such thing, or a parameter is missing, unknown or makes no sense.
    """
    path, query = _split(target)
    if path not in _ROUTES:
        raise RequestError(404, f"{path[:80]} is not there, expected {', '.join(_ROUTES)}")
    names, reply = _ROUTES[path]
    for name in query:
        if name not in names:
            expected = ", ".join(names) or "none"
            raise RequestError(400, f"parameter {name[:40]!r} is unknown, expected {expected}")
    return json.dumps(reply(session, query), allow_nan=False).encode()


def _split(target: str) -> tuple[str, dict[str, str]]:
    path, _, text = target.partition("?")
    try:
        pairs = parse_qsl(text, keep_blank_values=True, max_num_fields=8)
    except ValueError:
        raise RequestError(400, "the question makes no sense: too many parameters") from None
    query = dict(pairs)
    if len(query) < len(pairs):
        raise RequestError(400, "a parameter is given twice")
    return path, query


def _log(session: Session, query: dict[str, str]) -> dict[str, Any]:  # noqa: ARG001
    return session.facts()


def _stamps(session: Session, query: dict[str, str]) -> dict[str, Any]:
    count = _whole(query, "count")
    if not 1 <= count <= MOST_STAMPS:
        raise RequestError(400, f"count is {count}, expected 1 to {MOST_STAMPS}")
    return session.stamps(_whole(query, "first"), count)


def _scan(session: Session, query: dict[str, str]) -> dict[str, Any]:
    index, method = _whole(query, "i"), _method(session, query)
    try:
        return session.scan(index, method)
    except IndexError:
        raise _no_such_scan(session, index) from None


def _trace(session: Session, query: dict[str, str]) -> dict[str, Any]:
    index, method, beam = _whole(query, "i"), _method(session, query), _whole(query, "beam")
    try:
        return session.trace(index, method, beam)
    except IndexError:
        raise _no_such_scan(session, index) from None
    except ValueError as error:
        raise RequestError(404, str(error)) from None


#: By path: the parameters that it knows, and who answers.
_ROUTES: dict[str, tuple[tuple[str, ...], Callable[[Session, dict[str, str]], dict[str, Any]]]] = {
    "/api/log": ((), _log),
    "/api/stamps": (("first", "count"), _stamps),
    "/api/scan": (("i", "method"), _scan),
    "/api/trace": (("i", "method", "beam"), _trace),
}


def _no_such_scan(session: Session, index: int) -> RequestError:
    facts = session.facts()
    read = f"0 to {facts['scans'] - 1} have been read" if facts["scans"] else "none has been read"
    return RequestError(404, f"scan {index} is not there: {read}")


def _whole(query: dict[str, str], name: str) -> int:
    text = _given(query, name)
    if not (text.isascii() and text.isdigit() and len(text) <= _MOST_DIGITS):
        raise RequestError(400, f"{name} is {text[:40]!r}, expected a whole number ≥ 0")
    return int(text)


def _method(session: Session, query: dict[str, str]) -> str:
    method = _given(query, "method")
    if method not in session.extractors:
        known = ", ".join(session.extractors)
        raise RequestError(404, f"method {method[:40]!r} is not there, expected one of: {known}")
    return method


def _given(query: dict[str, str], name: str) -> str:
    if name not in query:
        raise RequestError(400, f"parameter {name} is missing")
    return query[name]
