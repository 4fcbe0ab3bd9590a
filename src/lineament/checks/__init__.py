"""Checks of what others add: a method, a writer, a reader, a message, each as ours are checked.

Each is a function that returns nothing, or raises an AssertionError of one line that names what
broke: in a test of yours, ``check_method("mine")`` is all of it.
"""

from typing import TYPE_CHECKING

from .._lazy import lazily

if TYPE_CHECKING:
    from .logs import check_log as check_log
    from .messages import check_message as check_message
    from .messages import message_kinds as message_kinds
    from .methods import check_method as check_method
    from .writers import check_writer as check_writer

_HOME = {
    "check_log": "logs",
    "check_message": "messages",
    "check_method": "methods",
    "check_writer": "writers",
    "message_kinds": "messages",
}

__all__ = [*_HOME]

__getattr__ = lazily(__name__, _HOME)


def __dir__() -> list[str]:
    return __all__
