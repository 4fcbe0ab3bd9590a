"""Logs in the browser: a local server, its JSON answers, and the page that asks for them."""

from .server import ViewServer, serve
from .session import Session

__all__ = ["Session", "ViewServer", "serve"]
