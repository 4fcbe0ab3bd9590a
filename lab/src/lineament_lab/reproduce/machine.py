"""Table 1: the paper's hardware and software, and this machine."""

import os
import platform
from importlib.metadata import version
from pathlib import Path

from .findings import Table


def machine() -> str:
    """Return processor, cores, system and Python, in a line.

    Examples
    --------
    >>> machine().endswith(f"Python {platform.python_version()}")
    True
    """
    name = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        lines = [line for line in cpuinfo.read_text().splitlines() if "model name" in line]
        name = lines[0].split(":")[1].strip() if lines else name
    return (
        f"{name}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"
    )


def machines() -> Table:
    """Make Table 1: the paper's hardware and software, and that of this page."""
    memory = None
    if hasattr(os, "sysconf"):
        memory = f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 2**30:.0f} GiB"
    packages = ", ".join(f"{name} {version(name)}" for name in ("lineament", "numba", "numpy"))
    return Table(
        "Table 1: hardware and software",
        ("", "paper", "here"),
        (
            ("machine", "Intel Core i7-7700U", machine()),
            ("memory", "8 GB", memory),
            ("software", "MATLAB 2020a", packages),
            ("scanner", "160°, 0.33°, 481 points", "the same, simulated, with noise of 10 mm"),
        ),
        "The table is lost: its values are those of the text around it.",
    )
