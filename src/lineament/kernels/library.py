"""The kernels as a library, compiled when the package was built: nothing waits for a compiler.

A library needs neither numba nor a certain Python. Each of its functions takes the address of one
table of 8-byte words: the size of an object's head, and then, in the order of the kernel's
arguments with tuples unrolled, each number, or of an array the address of NumPy's own header, which
has its place and its shape. An array that is not contiguous, or of another type than the kernel was
compiled for, is refused and not read. ``building/`` in the repository makes libraries.
"""

import ctypes
import hashlib
import os
import platform
import struct
import sys
from collections.abc import Callable, Iterable, Iterator
from functools import cached_property, partial, update_wrapper
from itertools import chain
from pathlib import Path
from typing import Any, get_args, get_type_hints

import numpy as np

HERE = Path(__file__).parent
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
#: What a CPU of each level has, by the names of Linux, the fastest first.
_OF_V2 = "cx16 lahf_lm popcnt sse4_1 sse4_2 ssse3"
LEVELS = {
    "x86-64-v3": f"{_OF_V2} abm avx avx2 bmi1 bmi2 f16c fma movbe",
    "x86-64-v2": _OF_V2,
}
#: Each of these asks for the kernels as numba has them: compiled at first use, or plain Python.
_BY_NUMBA = ("LINEAMENT_JIT", "NUMBA_DISABLE_JIT", "NUMBA_BOUNDSCHECK")
#: What a function returns that was given other arrays than it was compiled for.
REFUSED = -(2**63)
#: Bytes of each Python object before what its type adds.
_HEAD = object.__basicsize__


class NoLibraryError(Exception):
    """There is no library of these kernels for this machine; the text says why."""


def sources(home: Path | None = None) -> list[Path]:
    """Return the files that the kernels of a folder are made of; those of others call ours.

    Their order is the same wherever both are installed.
    """
    homes = dict.fromkeys((HERE, home or HERE))
    kernels = [path for one in homes for path in sorted(one.rglob("*.py"))]
    own = [path for path in kernels if path != HERE / "library.py"]
    return [HERE.parent / "features" / "records.py", *own]


def state(home: Path | None = None) -> str:
    """Return a hash of the kernels' source."""
    whole = b"".join(path.read_bytes() for path in sources(home))
    return hashlib.sha256(whole).hexdigest()[:16]


def seal(path: Path) -> Path:
    """Return the file that says of which kernels a library is."""
    return path.with_suffix(".sha256")


def sealed(path: Path) -> str:
    """Return what its seal has where a library is whole, and of the kernels as they are."""
    return hashlib.sha256(state(path.parent).encode() + path.read_bytes()).hexdigest()


def is_current(path: Path) -> bool:
    """Whether a library is whole, and of the kernels as they are."""
    return seal(path).exists() and path.exists() and seal(path).read_text() == sealed(path)


def levels() -> list[str]:
    """Return what this CPU can run, the fastest first."""
    machine = platform.machine().lower()
    if machine not in ("x86_64", "amd64"):
        return [machine]
    if not sys.platform.startswith("linux"):
        return ["x86-64-v2"]
    with Path("/proc/cpuinfo").open() as about:
        flags = next((set(line.split()) for line in about if line.startswith("flags")), set())
    return [level for level, needed in LEVELS.items() if flags.issuperset(needed.split())]


def words_of(kind: Any) -> Iterator[str]:
    """Yield the format of each word of an argument: ``d`` for floats, ``q`` for all else."""
    if hasattr(kind, "_fields"):
        yield from chain(*map(words_of, get_type_hints(kind, include_extras=True).values()))
    elif getattr(kind, "__origin__", None) is tuple:
        yield from chain(*map(words_of, get_args(kind)))
    else:
        yield "d" if kind is float else "q"


def _flat(values: Iterable[Any]) -> list[Any]:
    """Return what a table has for these arguments."""
    words: list[Any] = []
    for value in values:
        if type(value) is np.ndarray:
            words.append(id(value))
        elif isinstance(value, tuple):
            words += _flat(value)
        else:
            words.append(value)
    return words


class Entry:
    """A kernel of a library, called as the Python function that it was compiled from."""

    def __init__(self, function: Callable[..., Any], compiled: Any) -> None:
        update_wrapper(self, function)
        compiled.argtypes, compiled.restype = [ctypes.c_char_p], ctypes.c_int64
        self._function, self._compiled = function, compiled

    @cached_property
    def _pack(self) -> Callable[..., bytes]:
        kinds = get_type_hints(self._function, include_extras=True)
        kinds.pop("return", None)
        words = "".join(chain(*map(words_of, kinds.values())))
        return partial(struct.Struct(f"=q{words}").pack, _HEAD)

    def __call__(self, *arguments: Any) -> int:
        """Run it; a TypeError if an array is not what it was compiled for."""
        return self.bind(*arguments)()

    def bind(self, *arguments: Any) -> Callable[[], int]:
        """Return the call of it with these arguments, for arrays whose contents change."""
        table, compiled = self._pack(*_flat(arguments)), self._compiled

        def call(_: Any = arguments) -> int:  # which live as long as the call
            found: int = compiled(table)
            if found == REFUSED:
                raise TypeError(f"kernel {self.__name__} takes contiguous arrays of its types")
            return found

        return call


class Library:
    """A library that is loaded."""

    def __init__(self, path: Path) -> None:
        if not is_current(path):
            raise NoLibraryError("the kernels are not those that were compiled")
        try:
            self._functions = ctypes.CDLL(str(path))
        except OSError as error:
            raise NoLibraryError(f"{path.name} cannot be loaded ({error})") from None

    def entry(self, function: Callable[..., Any]) -> Entry:
        """Return the compiled function in place of a kernel's."""
        return Entry(function, self._functions[symbol(function.__module__, function.__name__)])


def symbol(module: str, name: str) -> str:
    """Return the name of a kernel in a library."""
    return "_".join(("lineament", *module.split(".")[2:], name))


def load(home: Path | None = None) -> Library:
    """Load the library of a folder for this machine; NoLibraryError says why there is none."""
    home = home or HERE
    if asked := next((name for name in _BY_NUMBA if os.environ.get(name, "0") != "0"), None):
        raise NoLibraryError(f"{asked} is set")
    if not any(home.glob(f"*{SUFFIX}")):
        raise NoLibraryError("the package was built without compiled kernels")
    try:
        ran = levels()
    except OSError as error:
        raise NoLibraryError(f"the CPU is not known ({error})") from None
    for level in ran:
        if (path := home / f"{level}{SUFFIX}").exists():
            return Library(path)
    raise NoLibraryError(f"no compiled kernels are for this CPU ({platform.machine()})")
