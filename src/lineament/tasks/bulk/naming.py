"""What each log is called in a data set, and where its file lies."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Mapping
from urllib.parse import quote

from ...logs.sources import is_address

__all__ = ["full_path", "names_of", "part_path"]


def full_path(log: str) -> str:
    """Name a log so that every process, wherever it runs, finds it.

    Examples
    --------
    >>> full_path("s3://robots/a.bag")
    's3://robots/a.bag'
    """
    return log if is_address(log) else os.path.abspath(log)  # noqa: PTH100 (keeps links)


def names_of(logs: Iterable[str], known: Mapping[str, str]) -> dict[str, str]:
    """Name logs: as before, else by so much of the end of the path as tells them apart.

    Parameters
    ----------
    logs : iterable of str
        Full paths or addresses.
    known : mapping of str to str
        The names that logs have already; no other log gets them.

    Returns
    -------
    dict of str to str
        A name for each log. No two differ in case alone.

    Examples
    --------
    >>> names = names_of(["/mon/a.bag", "/tue/a.bag", "/tue/b.bag"], {})
    >>> list(names.values())
    ['mon/a.bag', 'tue/a.bag', 'b.bag']
    >>> names_of(["/wed/b.bag"], names | {"/tue/b.bag": "b.bag"})
    {'/wed/b.bag': 'wed/b.bag'}
    """
    logs = list(dict.fromkeys(logs))
    names = {log: known[log] for log in logs if log in known}
    taken = {name.casefold() for name in known.values()}
    left = {log: _parts(log) for log in logs if log not in names}
    depth = 1
    while left:
        deepest = depth > max(map(len, left.values()))
        ends = {log: "/".join(parts[-depth:]) for log, parts in left.items()}
        counts = Counter(end.casefold() for end in ends.values())
        for log, end in ends.items():
            if deepest:
                end = _numbered(end, taken)
            elif counts[end.casefold()] > 1 or end.casefold() in taken:
                continue
            names[log] = end
            taken.add(end.casefold())
            del left[log]
        depth += 1
    return {log: names[log] for log in logs}


def _parts(log: str) -> list[str]:
    return [part for part in log.replace(os.sep, "/").split("/") if part]


def _numbered(name: str, taken: set[str]) -> str:
    """Make a name of its own for what only the case of its letters tells from another."""
    number = 1
    while (numbered := f"{name}~{number}").casefold() in taken:
        number += 1
    return numbered


def part_path(name: str, ending: str) -> str:
    """Tell where the file of a log lies in a data set, in the way of Hive.

    Examples
    --------
    >>> part_path("mon/a.bag", ".parquet")
    'log=mon%2Fa.bag/part-0.parquet'
    """
    return f"log={quote(name, safe=' ', errors='surrogateescape')}/part-0{ending}"
