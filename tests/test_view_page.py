"""The page of `view` in headless Chromium: it shows, plays, switches, and answers."""

import shutil
import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.wait import WebDriverWait

from lineament import Extractor, LaserScan, progress
from lineament.explain.explain import explain
from lineament.logs import open_log, save_npz
from lineament.view import Session, ViewServer

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
DRIVER = shutil.which("chromedriver")
FLAGS = (
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--disable-dev-shm-usage", "--no-proxy-server"),
)

pytestmark = [
    pytest.mark.skipif(
        not (CHROMIUM and DRIVER), reason="no chromium or chromedriver: make browser"
    ),
    pytest.mark.slow,
]

METHODS = ("liu:scale_free", "pdbs")
#: Pixel in the window of a point of the first panel.
PLACE = """
return import("/main.js").then(({ app }) => {
  const panel = app.panels[0], box = panel.canvas.getBoundingClientRect();
  const [u, v] = app.plane.toPixels(arguments[0], panel.size);
  return [box.left + u, box.top + v];
});
"""
#: Put a point into the middle, near enough to tell measurements apart.
LOOK_AT = """
return import("/main.js").then(({ app }) => {
  [app.plane.x, app.plane.y] = arguments[0];
  app.zoom(4);
});
"""


def corners(count):
    """Scans of a corner straight ahead that comes nearer; nothing comes back on the left."""
    bearings = np.radians(np.arange(-60, 61))
    rng = np.random.default_rng(1)
    for k in range(count):
        ranges = (4.0 - 0.05 * k) / (np.cos(bearings) + abs(np.sin(bearings)))
        ranges += rng.normal(0.0, 0.01, len(ranges))
        ranges[110:] = np.nan
        yield LaserScan(ranges, bearings[0], np.radians(1), range_max=30.0, stamp=5 + 0.05 * k)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "corner.npz"
    save_npz(path, corners(25))
    return path


@pytest.fixture(scope="module")
def address(log):
    extractors = {name: Extractor(name) for name in METHODS}
    for extractor in extractors.values():  # The page must not wait for a compiler.
        extractor.trace(open_log(log).scan(0))
    with Session(log, extractors) as session, ViewServer(session) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server.address
        server.shutdown()
        thread.join()


class Page:
    """The page in a window. Elements are named by CSS selectors."""

    def __init__(self, driver: webdriver.Chrome) -> None:
        self.driver, self.run = driver, driver.execute_script

    def text(self, selector: str) -> str | None:
        return self.run("return document.querySelector(arguments[0])?.innerText", selector)

    def wait(self, script: str) -> Any:
        """Wait until a JavaScript expression is true; return its value."""
        waiting = WebDriverWait(self.driver, 60, poll_frequency=0.05)
        return waiting.until(lambda _: self.run(f"return {script}"), f"never true: {script}")

    def point(self, *places: tuple[float, float], press: bool = False) -> None:
        """Move the mouse to a place in the window, and maybe click; or drag it from it on."""
        actions = ActionBuilder(self.driver, duration=50)
        for k, (x, y) in enumerate(places):
            actions.pointer_action.move_to_location(round(x), round(y))
            if press and k == 0:
                actions.pointer_action.pointer_down()
        if press:
            actions.pointer_action.pointer_up()
        actions.perform()

    def press(self, *keys: str) -> None:
        webdriver.ActionChains(self.driver).send_keys(*keys).perform()

    def change(self, selector: str, value: object, event: str) -> None:
        """Give an element another value, as a user does."""
        script = "const e = document.querySelector(arguments[0]); e.value = arguments[1];"
        self.run(f"{script} e.dispatchEvent(new Event('{event}'))", selector, value)

    def click(self, selector: str) -> None:
        self.run("document.querySelector(arguments[0]).click()", selector)

    def resize(self, width: int, height: int, scheme: str = "light") -> None:
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in (*FLAGS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    # With the path of the driver, selenium does not look for one to download.
    driver = webdriver.Chrome(options, Service(DRIVER))
    yield Page(driver)
    driver.quit()


@pytest.fixture
def page(browser: Page, address: str) -> Iterator[Page]:
    """The page, anew, with a scan on it; it must not have complained in the end."""
    browser.resize(1366, 768)
    browser.driver.get("about:blank")
    browser.driver.get(address)
    browser.wait("document.body.dataset.scan === '0' && document.querySelector('#reading').hidden")
    yield browser
    assert browser.driver.get_log("browser") == []
    assert browser.text("#problem") == ""


def shown(page, index):
    return page.wait(f"document.body.dataset.scan === '{index}'")


def caption(page, panel=1):
    return page.text(f".panel:nth-child({panel}) span")


def found(log, index, method=METHODS[0]):
    return Extractor(method)(open_log(log).scan(index))


def test_the_page_shows_the_log_and_its_first_scan(page, log):
    features = found(log, 0)
    assert page.text("h1") == "corner.npz"
    assert page.text("header p") == "ranges in npz, 25 scans"
    assert f"{len(features.segments)} segments, 1 corner, 0 edges, 0 arcs" in caption(page)
    label = page.run("return document.querySelector('canvas').ariaLabel")
    assert label.startswith("Scan 0 by liu:scale_free: ")
    # Something is drawn: far more colours than those of a grid.
    colours = page.run(
        "const c = document.querySelector('canvas'), d = c.getContext('2d')"
        ".getImageData(0, 0, c.width, c.height).data;"
        "const seen = new Set(); for (let i = 0; i < d.length; i += 4)"
        " seen.add((d[i] << 16) | (d[i + 1] << 8) | d[i + 2]); return seen.size"
    )
    assert colours > 20


def test_the_page_says_what_it_waits_for(page, log, monkeypatch):
    """A scan of a method that is being compiled."""
    session = Session(log, {"pdbs": Extractor("pdbs")})
    state = progress.Compiling(14, 40, 9.0, 18.0, is_first=False, is_last=False)
    monkeypatch.setattr(progress._compiler, "now", state)
    with session, ViewServer(session) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        with session._busy["pdbs"]:
            page.driver.get(server.address)
            text = "document.querySelector('.panel span')?.textContent"
            page.wait(f"{text} === 'compiling kernels, once: 14 of 40, 18 s left'")
            monkeypatch.setattr(progress._compiler, "now", None)
            page.wait(f"{text} === 'working …'")
        shown(page, 0)
        time.sleep(1.5)  # what is asked every 0.7 s came for the last time
        assert "segments" in caption(page)
        server.shutdown()
        thread.join()


def test_scrubbing_keys_and_playing_change_the_scan(page):
    page.change("#slider", 17, "input")
    shown(page, 17)
    page.wait("document.querySelector('#position').textContent === 'scan 17 / 24, 0.85 s'")
    assert "scan=17" in page.run("return location.hash")
    keys = {Keys.ARROW_RIGHT: 18, Keys.ARROW_LEFT: 17, Keys.END: 24, Keys.HOME: 0}
    for key, index in keys.items():
        page.press(key)
        shown(page, index)
    page.press(" ")
    assert page.run("return document.querySelector('#play').ariaLabel") == "Pause"
    shown(page, 24)
    page.wait("document.querySelector('#play').ariaLabel === 'Play'")


def test_hovering_shows_the_numbers_of_a_feature(page, log):
    corner = found(log, 0).corners[0]
    page.point(page.run(PLACE, corner["position"].tolist()))
    page.wait("!document.querySelector('.card').hidden")
    card = page.text(".card")
    x, y = corner["position"]
    assert "corner 0" in card
    assert f"kind corner quality {corner['quality']:.2f}" in " ".join(card.split())
    assert f"{x:.3f}, {y:.3f} m" in card
    segment = found(log, 0).segments[0]
    page.point(page.run(PLACE, segment["centroid"].tolist()))
    page.wait("document.querySelector('.card').innerText.includes('segment 0')")
    assert f"{segment['n_points']} measurements" in page.text(".card")


def test_a_click_pins_a_feature_once_and_it_can_be_removed(page, log):
    place = page.run(PLACE, found(log, 0).corners[0]["position"].tolist())
    for _ in range(2):
        page.point(place, press=True)
    page.wait("document.querySelectorAll('#pins tbody tr').length === 1")
    assert "corner 0" in page.text("#pins tbody")
    assert "scan 0, liu:scale_free" in page.text("#pins tbody")
    page.click("#pins tbody button")
    page.wait("document.querySelector('#pins').hidden")


def test_a_click_on_a_measurement_is_answered(page, log):
    scan = open_log(log).scan(0)
    expected = explain(Extractor(METHODS[0]).trace(scan), 25)
    page.run(LOOK_AT, scan.points[25].tolist())
    page.point(page.run(PLACE, scan.points[25].tolist()), press=True)
    page.wait("document.querySelector('#why .summary')")
    assert page.text("#why h3") == "beam 25, scan 0, liu:scale_free"
    assert page.text("#why .summary") == expected.summary
    assert page.text("#why dl dd:last-child") == expected.steps[-1][1]


def test_a_beam_is_asked_for_by_its_number(page):
    page.run("document.querySelector('#beam').focus()")
    page.press("115", Keys.ENTER)
    page.wait("document.querySelector('#why h3')?.textContent.startsWith('beam 115, ')")
    assert page.text("#why .summary") == "Invalid: the range is NaN, no measurement."
    # A click to where nothing came back is answered, too.
    page.point(page.run(PLACE, [0.6, 0.93]), press=True)
    page.wait("!document.querySelector('#why h3').textContent.startsWith('beam 115, ')")
    assert page.text("#why .summary") == "Invalid: the range is NaN, no measurement."


def test_methods_are_switched_and_shown_side_by_side(page):
    page.change(".panel select", "pdbs", "change")
    page.wait("document.querySelector('.panel span').textContent.startsWith('0 segments')")
    page.click("#compare")
    page.wait("document.querySelectorAll('.panel').length === 2")
    page.wait("document.querySelector('.panel:nth-child(2) span').textContent.includes('1 corner')")
    assert "with=liu" in page.run("return location.hash")
    page.click("#compare")
    page.wait("document.querySelectorAll('.panel').length === 1")


def test_wheel_and_drag_move_the_view(page):
    state = "return import('/main.js').then(({ app: { plane: p } }) => [p.x, p.y, p.scale])"
    x, y, scale = page.run(state)
    page.run(
        "document.querySelector('canvas').dispatchEvent(new WheelEvent('wheel',"
        "{ deltaY: -100, clientX: 300, clientY: 300, cancelable: true }))"
    )
    assert page.run(state)[2] == pytest.approx(1.25 * scale)
    page.press("f")
    assert page.run(state) == pytest.approx([x, y, scale])
    page.point((300, 300), (340, 280), press=True)
    assert page.run(state) == pytest.approx([x - 40 / scale, y - 20 / scale, scale])


def test_a_narrow_window_needs_no_scrolling_sideways(page):
    page.resize(390, 844, "dark")
    page.wait("document.documentElement.scrollWidth <= 390")
    assert page.run("return document.querySelector('canvas').clientHeight") > 300
    dark = "getComputedStyle(document.body).backgroundColor === 'rgb(13, 17, 23)'"
    page.wait(dark)


def test_a_server_that_has_gone_is_reported(page):
    page.run("window.fetch = () => Promise.reject(new TypeError('gone'))")
    page.press(Keys.ARROW_RIGHT)
    page.wait("!document.querySelector('#problem').hidden")
    assert "The server has ended" in page.text("#problem")
    page.run("document.querySelector('#problem').textContent = ''")
