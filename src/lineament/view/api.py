"""Requests of the page and their answers, as JSON; what is wrong with a request."""

from urllib.parse import parse_qsl

from ..files import strict_json
from .session import Session

#: Most stamps in one answer.
MOST_STAMPS = 4096
#: No whole number in a request has more digits.
_MOST_DIGITS = 12
#: By path: who answers, and the parameters, all of which are needed.
_ROUTES = {
    "/api/log": (Session.facts, ()),
    "/api/stamps": (Session.stamps, ("first", "count")),
    "/api/scan": (Session.scan, ("i", "method")),
    "/api/trace": (Session.trace, ("i", "method", "beam")),
}


class RequestError(Exception):
    """A request without an answer: 400 or 404, and one line on what was expected."""

    def __init__(self, status: int, problem: str) -> None:
        super().__init__(problem)
        self.status = status


def answer(session: Session, target: str) -> bytes:
    """Answer a request for ``/api/...``; RequestError if it makes no sense or nothing is there.

    - ``/api/log``: what the log is, and how much of it has been read.
    - ``/api/stamps?first=&count=``: stamps of some scans.
    - ``/api/scan?i=&method=``: a scan and what a method finds in it.
    - ``/api/trace?i=&method=&beam=``: what became of a beam.
    """
    path, query = _split(target)
    if path not in _ROUTES:
        raise RequestError(404, f"{path[:80]!r} is not there, expected {', '.join(_ROUTES)}")
    reply, names = _ROUTES[path]
    for name in query:
        if name not in names:
            expected = ", ".join(names) or "none"
            raise RequestError(400, f"parameter {name[:40]!r} is unknown, expected {expected}")
    values = {name: _value(session, name, query) for name in names}
    try:
        found = reply(session, *values.values())  # type: ignore[operator]
    except IndexError:
        n = session.facts()["scans"]
        read = f"0 to {n - 1} have been read" if n else "none has been read"
        raise RequestError(404, f"scan {values['i']} is not there: {read}") from None
    except ValueError as error:
        raise RequestError(404, str(error)) from None
    return strict_json(found).encode()


def _split(target: str) -> tuple[str, dict[str, str]]:
    path, _, text = target.partition("?")
    try:
        pairs = parse_qsl(text, keep_blank_values=True, max_num_fields=8)
    except ValueError:
        raise RequestError(400, "the request makes no sense: too many parameters") from None
    query = dict(pairs)
    if len(query) < len(pairs):
        raise RequestError(400, "a parameter is given twice")
    return path, query


def _value(session: Session, name: str, query: dict[str, str]) -> int | str:
    """Return the value of a parameter: the name of a method, or a whole number."""
    if name not in query:
        raise RequestError(400, f"parameter {name} is missing")
    text = query[name]
    if name == "method":
        if text not in session.extractors:
            known = ", ".join(session.extractors)
            raise RequestError(404, f"method {text[:40]!r} is not there, expected one of: {known}")
        return text
    if not (text.isascii() and text.isdigit() and len(text) <= _MOST_DIGITS):
        raise RequestError(400, f"{name} is {text[:40]!r}, expected a whole number ≥ 0")
    if name == "count" and not 1 <= int(text) <= MOST_STAMPS:
        raise RequestError(400, f"count is {text}, expected 1 to {MOST_STAMPS}")
    return int(text)
