"""The local server: the page's own files, the answers of the API, and nothing else."""

import ipaddress
import json
import socket
import sys
import threading
import webbrowser
from collections.abc import Callable
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from socketserver import TCPServer
from typing import Any
from urllib.parse import urlsplit

from ..errors import LineamentError
from .api import RequestError, answer
from .session import Session

#: The files of the page, by their endings.
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
_JSON, _BYTES = "application/json; charset=utf-8", "application/octet-stream"
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
_LOOPBACK = ("localhost", "127.0.0.1", "::1")
#: Seconds after which a silent connection is closed.
_PATIENCE = 60


class ViewServer(ThreadingHTTPServer):
    """Serves the page of a session.

    It answers only requests that name it as loopback or by the host that it was bound to: a page
    from elsewhere cannot read the log by rebinding its own name (DNS rebinding).

    It listens on an address and a port, 0 for any that is free; a LineamentError if it cannot.
    """

    daemon_threads = True

    def __init__(self, session: Session, host: str = "127.0.0.1", port: int = 0) -> None:
        self.session, self.host = session, host
        self.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        found = [file for file in (files(__package__) / "static").iterdir() if file.is_file()]
        self.page = {f"/{file.name}": file.read_bytes() for file in found}
        self.page["/"] = self.page["/index.html"]
        try:
            super().__init__((host, port), _Handler)
        except OSError as error:
            reason = error.strerror or error
            raise LineamentError(f"{host}:{port}: cannot listen there: {reason}") from None

    def server_bind(self) -> None:
        """Bind, without HTTPServer's look-up of the host name, which may take seconds."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = self.host, self.server_address[1]

    @property
    def address(self) -> str:
        """The page's address; by loopback where the server listens everywhere."""
        host = "localhost" if self._is_everywhere else self.host
        return f"http://{f'[{host}]' if ':' in host else host}:{self.server_port}/"

    def is_known_host(self, header: str | None) -> bool:
        """Whether the Host header of a request names this server."""
        try:
            name = urlsplit(f"//{header or ''}").hostname or ""
        except ValueError:
            return False
        if name in _LOOPBACK or name == self.host.lower():
            return True
        # Where it listens everywhere it has many addresses; none is a name that could be rebound.
        return self._is_everywhere and _address(name) is not None

    @property
    def _is_everywhere(self) -> bool:
        address = _address(self.host)
        return self.host == "" or (address is not None and address.is_unspecified)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore it: the other side has gone."""


class _Handler(BaseHTTPRequestHandler):
    server: ViewServer
    server_version, sys_version = "lineament", ""
    protocol_version = "HTTP/1.1"
    timeout = _PATIENCE

    def do_GET(self) -> None:
        try:
            kind, body = self._found()
        except RequestError as error:
            self.send_error(error.status, str(error))
        except Exception as error:  # A scan that breaks a method does not break the server.
            self.send_error(500, f"{type(error).__name__}: {' '.join(str(error).split())}")
        else:
            self._send(200, kind, body)

    do_HEAD = do_GET  # noqa: N815

    def _found(self) -> tuple[str, bytes]:
        if not self.server.is_known_host(self.headers.get("Host")):
            raise RequestError(403, f"the request is for another host, expected {_LOOPBACK[0]}")
        path = self.path.partition("?")[0]
        if path in self.server.page:
            ending = path[path.rindex(".") :] if path != "/" else ".html"
            return _TYPES[ending], self.server.page[path]
        kind = _BYTES if path == "/api/npz" else _JSON
        return kind, answer(self.server.session, self.path)

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Send what is wrong as JSON."""
        self.close_connection = True
        problem = message or explain or "the request makes no sense"
        self._send(code, _JSON, json.dumps({"error": problem}).encode())

    def _send(self, status: int, kind: str, body: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        closing = {"Connection": "close"} if self.close_connection else {}
        for name, value in {**_HEADERS, **closing}.items():
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def log_message(self, *_: Any) -> None:
        """Keep the terminal quiet."""


def serve(
    session: Session,
    host: str = "127.0.0.1",
    port: int = 0,
    *,
    browser: bool = True,
    write: Callable[[str], None] = print,
) -> None:
    """Serve the page of a session until interrupted, and open it in a browser where asked for.

    `write` is called with a line that has the address. Raises as `ViewServer` does.
    """
    with session, ViewServer(session, host, port) as server:
        address = _address(host)
        if host != "localhost" and not (address and address.is_loopback):
            warning = f"{host} is not loopback: anybody who can reach it can look at these logs"
            print(f"lineament: {warning}", file=sys.stderr, flush=True)
        write(f"{session.name}: look at {server.address} (Ctrl-C ends it)")
        if browser:
            # A browser of the terminal would keep its caller waiting.
            opening = partial(webbrowser.open, server.address)
            threading.Thread(target=opening, name="browser", daemon=True).start()
        server.serve_forever()


def _address(name: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(name)
    except ValueError:
        return None
