"""Logs in the browser, by a local server and its page, and scans and features in notebooks."""

from .server import ViewServer, serve
from .session import Session

__all__ = ["Session", "ViewServer", "serve"]
