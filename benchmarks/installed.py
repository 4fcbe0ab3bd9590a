"""What `pip install lineament` brought: packages and megabytes, held to their limits.

Run by the Python of an environment that has nothing else: ``make wheel`` does.
"""

from __future__ import annotations

import sys
from importlib.metadata import Distribution, distributions

#: What comes with a new environment, and what is measured.
APART = {"pip", "setuptools", "lineament"}
MOST_PACKAGES, MOST_MEGABYTES = 20, 420


def megabytes(package: Distribution) -> float:
    """Size of the files of a package on the disk, in blocks of 4 KB."""
    places = [path.locate() for path in package.files or ()]
    return sum(-(-place.stat().st_size // 4096) for place in places if place.is_file()) / 256


def main() -> int:
    sizes = {package.name: megabytes(package) for package in distributions()}
    needed = sorted((name for name in sizes if name.lower() not in APART), key=lambda n: -sizes[n])
    total = sum(sizes[name] for name in (*needed, "lineament"))
    for name in needed:
        print(f"{sizes[name]:7.1f} MB  {name}")
    print(f"{total:7.1f} MB in {len(needed)} packages and lineament ({sizes['lineament']:.1f} MB)")
    return int(len(needed) > MOST_PACKAGES or total > MOST_MEGABYTES)


if __name__ == "__main__":
    sys.exit(main())
