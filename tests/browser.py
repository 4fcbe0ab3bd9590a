"""A headless Chromium, driven over plain HTTP through chromedriver (W3C WebDriver)."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
import time
import urllib.error
import urllib.request
from contextlib import contextmanager
from pathlib import Path

__all__ = ["MISSING", "Browser", "open_browser"]

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
DRIVER = shutil.which("chromedriver")
#: Why there is no browser, or nothing.
MISSING = (
    ""
    if CHROMIUM and DRIVER
    else "no chromium or no chromedriver: apt-get install chromium chromium-driver"
)
_FLAGS = (
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--disable-dev-shm-usage", "--no-proxy-server"),
)
_PATIENCE = 60.0
_DOWN, _UP = ({"type": kind, "button": 0} for kind in ("pointerDown", "pointerUp"))


class Browser:
    """One window. Elements are named by CSS selectors."""

    def __init__(self, session):
        self._session = session

    def _call(self, method, path, **body):
        return _call(method, f"{self._session}/{path}", body if method == "POST" else None)

    def open(self, url):
        self._call("POST", "url", url=url)

    def run(self, script, *arguments):
        """Run JavaScript; give what it returns."""
        return self._call("POST", "execute/sync", script=script, args=list(arguments))

    def text(self, selector):
        return self.run("return document.querySelector(arguments[0])?.innerText", selector)

    def wait(self, script):
        """Wait until a JavaScript expression is true; give its value."""
        end = time.monotonic() + _PATIENCE
        while time.monotonic() < end:
            if value := self.run(f"return {script}"):
                return value
            time.sleep(0.05)
        raise AssertionError(f"never true: {script}; problem: {self.text('#problem')!r}")

    def point(self, x, y, *, click=False):
        """Move the mouse to a place in the window, and maybe click."""
        self._mouse(_to(x, y), *([_DOWN, _UP] if click else []))

    def drag(self, start, end):
        """Press the mouse at a place in the window, and release it at another."""
        self._mouse(_to(*start), _DOWN, _to(*end), _UP)

    def _mouse(self, *actions):
        mouse = {"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}}
        self._call("POST", "actions", actions=[{**mouse, "actions": actions}])

    def press(self, key):
        """Press a key; special ones by their code points of WebDriver."""
        actions = [{"type": kind, "value": key} for kind in ("keyDown", "keyUp")]
        self._call("POST", "actions", actions=[{"type": "key", "id": "keys", "actions": actions}])

    def console(self):
        """What the page has complained about since the last call."""
        return [entry["message"] for entry in self._call("POST", "se/log", type="browser")]

    def devtools(self, command, **parameters):
        return self._call("POST", "goog/cdp/execute", cmd=command, params=parameters)

    def resize(self, width, height, *, dark=False):
        self.devtools(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.devtools("Emulation.setEmulatedMedia", features=[scheme])

    def save_screenshot(self, path):
        Path(path).write_bytes(base64.b64decode(self._call("GET", "screenshot")))


@contextmanager
def open_browser(folder):
    """Start a browser with a new profile in a folder."""
    command = [DRIVER, "--port=0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as driver:
        try:
            started = next(line for line in driver.stdout if "started successfully" in line)
            port = re.search(r"on port (\d+)", started)[1]
            root = f"http://127.0.0.1:{port}/session"
            flags = [*_FLAGS, f"--user-data-dir={folder}"]
            wanted = {
                "browserName": "chrome",
                "goog:chromeOptions": {"binary": CHROMIUM, "args": flags},
                "goog:loggingPrefs": {"browser": "ALL"},
            }
            made = _call("POST", root, {"capabilities": {"alwaysMatch": wanted}})
            session = f"{root}/{made['sessionId']}"
            yield Browser(session)
            _call("DELETE", session)
        finally:
            driver.kill()


def _to(x, y):
    return {"type": "pointerMove", "x": round(x), "y": round(y), "duration": 50}


def _call(method, url, body=None):
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(url, data=data, method=method)
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    try:
        with opener.open(request, timeout=_PATIENCE) as response:
            return json.load(response)["value"]
    except urllib.error.HTTPError as error:
        raise AssertionError(json.load(error)["value"]["message"]) from None
