"""What other packages add: methods and commands, found by their entry points.

A package that declares, in its ``pyproject.toml``, ::

    [project.entry-points."lineament.methods"]
    mine = "my_package:Mine"

has its method found by that name wherever one is given; ``lineament.commands`` does the same for
click commands. `lineament-lab`, which judges methods, is the first to do so.
"""

from functools import cache
from importlib.metadata import EntryPoint, entry_points

METHODS, COMMANDS = "lineament.methods", "lineament.commands"

#: What the laboratory adds: where it is missing, the message names the package.
LABORATORY = {
    METHODS: (
        *("pdbs", "iepf", "split_and_merge", "line_tracking", "hough", "ransac"),
        *("region_growing", "ple", "falko", "flirt"),
    ),
    COMMANDS: ("bench", "compare", "reproduce"),
}


@cache
def plugins(group: str) -> dict[str, EntryPoint]:
    """Return what installed packages add to a group, by name.

    Examples
    --------
    >>> plugins("lineament.flavours")
    {}
    """
    return {entry.name: entry for entry in entry_points(group=group)}


def missing(group: str, name: str) -> str:
    """Return where what is not installed comes from, "" if nobody knows.

    Examples
    --------
    >>> missing(COMMANDS, "reproduce")
    'reproduce is part of lineament-lab, which is not installed: pip install lineament-lab'
    >>> missing(COMMANDS, "fly")
    ''
    """
    if name not in LABORATORY[group]:
        return ""
    return f"{name} is part of lineament-lab, which is not installed: pip install lineament-lab"
