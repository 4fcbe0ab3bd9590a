"""Requests of the page and their answers, as JSON; what is wrong with a request."""

from urllib.parse import parse_qsl

from ..errors import LineamentError
from ..files import strict_json
from .session import Session

#: Largest values of the parameters that bound an answer, by route.
MOST = {"/api/stamps": 4096, "/api/poses": 4096, "/api/drive": 32}
#: A parameter that chooses topics of a log.
TOPICS = "topics"
#: No whole number in a request has more digits.
_MOST_DIGITS = 12
#: By path: who answers, and the parameters; all are needed but `topics`, which goes with a log.
_ROUTES = {
    "/api/logs": (Session.logs, ()),
    "/api/log": (Session.facts, ("log",)),
    "/api/topics": (Session.topics, ("log",)),
    "/api/plan": (Session.plan, ()),
    "/api/stamps": (Session.stamps, ("log", "first", "count")),
    "/api/poses": (Session.poses, ("log", "first", "count")),
    "/api/drive": (Session.drive, ("log", "first", "step", "count")),
    "/api/scan": (Session.scan, ("log", "i", "method")),
    "/api/trace": (Session.trace, ("log", "i", "method", "beam")),
    "/api/npz": (Session.npz, ("log", "i")),
}


class RequestError(Exception):
    """A request without an answer: 400 or 404, and one line on what was expected."""

    def __init__(self, status: int, problem: str) -> None:
        super().__init__(problem)
        self.status = status


def answer(session: Session, target: str) -> bytes:
    """Answer a request for ``/api/...``; RequestError if it makes no sense or nothing is there.

    Answers are JSON, but for that of ``/api/npz``. Logs are named by number, never by path.

    - ``/api/logs``: the names of logs and methods.
    - ``/api/topics?log=``: the topics of a log with scans, where there are several.
    - ``/api/log?log=``: what a log is, and how much of it has been read.
    - ``/api/plan``: the walls of the plan.
    - ``/api/stamps?log=&first=&count=``, ``/api/poses?...``: stamps, poses of some scans.
    - ``/api/drive?log=&first=&step=&count=``: poses and points of every so many scans.
    - ``/api/scan?log=&i=&method=``: a scan and what a method finds in it.
    - ``/api/trace?log=&i=&method=&beam=``: what became of a beam.
    - ``/api/npz?log=&i=``: a scan as a log.

    With ``&topics=0,2`` they are of these topics of the log, by number: the first one's scans are
    counted, and ``/api/scan`` has what all of them see. Without, all topics take turns.
    """
    path, query = _split(target)
    if path not in _ROUTES:
        raise RequestError(404, f"{path[:80]!r} is not there, expected {', '.join(_ROUTES)}")
    reply, names = _ROUTES[path]
    optional = (TOPICS,) if "log" in names and path != "/api/topics" else ()
    for name in query:
        if name not in names + optional:
            expected = ", ".join(names) or "none"
            raise RequestError(400, f"parameter {name[:40]!r} is unknown, expected {expected}")
    values = {name: _value(session, name, query) for name in names}
    if path in MOST and not 1 <= values["count"] <= MOST[path]:  # type: ignore[operator]
        raise RequestError(400, f"count is {values['count']}, expected 1 to {MOST[path]}")
    if values.get("step") == 0:
        raise RequestError(400, "step is 0, expected a whole number ≥ 1")
    given = {TOPICS: _numbers(query[TOPICS])} if TOPICS in query else {}
    try:
        found = reply(session, *values.values(), **given)  # type: ignore[operator]
    except IndexError:
        n = session.facts(values["log"], **given)["scans"]  # type: ignore[arg-type]
        read = f"0 to {n - 1} have been read" if n else "none has been read"
        problem = f"scan {values.get('i', 'wanted')} is not there: {read}"
        raise RequestError(404, problem) from None
    except (LineamentError, ValueError) as error:
        raise RequestError(404, str(error)) from None
    return found if isinstance(found, bytes) else strict_json(found).encode()


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


def _numbers(text: str) -> tuple[int, ...]:
    """Return the numbers of topics, each once."""
    parts = text.split(",")
    if not all(map(_is_whole, parts)):
        raise RequestError(400, f"topics is {text[:40]!r}, expected whole numbers, as in 0,2")
    found = tuple(map(int, parts))
    if len({*found}) < len(found):
        raise RequestError(400, f"topics is {text[:40]!r}, expected each of them once")
    return found


def _is_whole(text: str) -> bool:
    return text.isascii() and text.isdigit() and len(text) <= _MOST_DIGITS


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
    if not _is_whole(text):
        raise RequestError(400, f"{name} is {text[:40]!r}, expected a whole number ≥ 0")
    return int(text)
