"""The page of `view` in headless Chromium: it shows, plays, switches, and answers."""

import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from matplotlib import image
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.wait import WebDriverWait
from test_view import served as serving

from lineament import Extractor, LaserScan, progress
from lineament.explain.explain import explain
from lineament.logs import open_log, save_npz
from lineament.view import Session

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

NARROW, WIDE = (400, 800), (1400, 800)
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


def drive(count):
    """Scans with poses on the way through a room, x from -4 to 4 m and y from -2 to 3 m."""
    bearings = np.radians(np.arange(-90, 90, 2))
    for k in range(count):
        x, y, theta = pose = (-2.0 + 0.1 * k, 0.5, 0.05 * k)
        c, s = np.cos(bearings + theta), np.sin(bearings + theta)
        with np.errstate(divide="ignore"):
            ranges = np.fmin((np.copysign(4, c) - x) / c, (np.where(s > 0, 3, -2) - y) / s)
        yield LaserScan(
            ranges, bearings[0], np.radians(2), range_max=30.0, stamp=0.1 * k, pose=pose,
            intensities=np.arange(90.0),
        )  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    save_npz(folder / "corner.npz", corners(25))
    save_npz(folder / "drive.npz", drive(40))
    (folder / "x.npz").write_bytes((folder / "drive.npz").read_bytes()[:900])
    return folder


@pytest.fixture(scope="module")
def log(folder):
    return folder / "corner.npz"


@contextmanager
def served(path, methods):
    extractors = {name: Extractor(name) for name in methods}
    with Session(path, extractors) as session, serving(session) as server:
        yield session, server.address


@pytest.fixture(scope="module")
def address(folder, log):
    for name in METHODS:  # The page must not wait for a compiler.
        Extractor(name).trace(open_log(log).scan(0))
    with served(folder, METHODS) as (_, address):
        yield address


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

    def press_with_shift(self, key: str) -> None:
        actions = webdriver.ActionChains(self.driver).key_down(Keys.SHIFT).send_keys(key)
        actions.key_up(Keys.SHIFT).perform()

    def change(self, selector: str, value: object, event: str) -> None:
        """Give an element another value, as a user does."""
        script = "const e = document.querySelector(arguments[0]); e.value = arguments[1];"
        self.run(f"{script} e.dispatchEvent(new Event('{event}'))", selector, value)

    def click(self, selector: str) -> None:
        self.run("document.querySelector(arguments[0]).click()", selector)

    def resize(self, width: int, height: int, scheme: str = "light", touch: bool = False) -> None:
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": touch}
        self.command("Emulation.setDeviceMetricsOverride", **metrics)
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.command("Emulation.setEmulatedMedia", features=features)
        self.command("Emulation.setTouchEmulationEnabled", enabled=touch)

    def command(self, name: str, **parameters: Any) -> None:
        self.driver.execute_cdp_cmd(name, parameters)

    def touch(self, *fingers: tuple[float, float], kind: str = "touchMove") -> None:
        points = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(fingers)]
        self.command("Input.dispatchTouchEvent", type=kind, touchPoints=points)

    def open(self, address: str) -> None:
        """Go to an address, and wait for the scan."""
        self.driver.get("about:blank")
        self.driver.get(address)
        self.wait("document.body.dataset.scan && document.querySelector('#reading').hidden")

    def seen(self, script: str) -> Any:
        """Return what an expression of the page's `app` is."""
        return self.run(f"return import('/main.js').then(({{ app }}) => {script})")

    def until(self, script: str, expected: Any) -> None:
        """Wait until an expression of `app` has a value."""
        waiting = WebDriverWait(self.driver, 20, poll_frequency=0.02)
        never = f"{script} never was {expected!r}"
        waiting.until(lambda _: self.seen(script) == expected, never)

    def pixels(self) -> Any:
        """Return what is drawn in the first panel: rows of red, green, blue and opacity."""
        width, height, data = self.run(
            "const c = document.querySelector('canvas');"
            "const copy = new OffscreenCanvas(c.width, c.height).getContext('2d');"
            "copy.drawImage(c, 0, 0);"
            "return [c.width, c.height, [...copy.getImageData(0, 0, c.width, c.height).data]];"
        )
        return np.reshape(data, (height, width, 4))


@contextmanager
def new_browser(folder) -> Iterator[Page]:
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in (*FLAGS, f"--user-data-dir={folder}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    # With the path of the driver, selenium does not look for one to download.
    driver = webdriver.Chrome(options, Service(DRIVER))
    try:
        yield Page(driver)
    finally:
        driver.quit()


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with new_browser(tmp_path_factory.mktemp("profile")) as page:
        yield page


@pytest.fixture
def page(browser: Page, address: str) -> Iterator[Page]:
    """The page, anew, with a scan on it; it must not have complained in the end."""
    browser.resize(1366, 768)
    browser.open(address)
    yield browser
    assert browser.driver.get_log("browser") == []
    assert browser.run("return document.querySelector('#problem').hidden")


def shown(page, index):
    return page.wait(f"document.body.dataset.scan === '{index}'")


def caption(page, panel=1):
    return page.text(f".panel:nth-child({panel}) span")


def found(log, index, method=METHODS[0]):
    return Extractor(method)(open_log(log).scan(index))


def test_the_page_shows_the_log_and_its_first_scan(page, log):
    features = found(log, 0)
    assert page.text("#log option:checked") == "corner.npz"
    assert page.text("header p") == "ranges in npz, 25 scans, no poses"
    assert f"{len(features.segments)} segments, 1 corner, 0 edges, 0 arcs" in caption(page)
    label = page.run("return document.querySelector('canvas').ariaLabel")
    assert label.startswith("Scan 0 by liu:scale_free: ")
    # Something is drawn: far more colours than those of a grid.
    assert len(np.unique(page.pixels()[..., :3].reshape(-1, 3), axis=0)) > 20


def test_the_page_says_what_it_waits_for(page, log, monkeypatch):
    """A scan of a method that is being compiled."""
    monkeypatch.setattr(progress._compiler, "reason", "it is a test")
    monkeypatch.setattr(progress._compiler, "_is_said", True)
    with served(log, ["pdbs"]) as (session, address):
        busy, extractor = threading.Lock(), session.extractors["pdbs"]

        def waiting(scan):
            with busy:
                return extractor(scan)

        session.extractors["pdbs"] = waiting
        with busy:
            page.driver.get(address)
            text = "document.querySelector('.panel span')?.textContent"
            page.wait(
                f"{text} === 'compiling kernels (it is a test): once, for up to some minutes'"
            )
            monkeypatch.setattr(progress._compiler, "_is_said", False)
            page.wait(f"{text} === 'working …'")
        shown(page, 0)
        time.sleep(1.5)  # what is asked every 0.7 s came for the last time
        assert "segments" in caption(page)
        assert page.text("h1") == "corner.npz"  # of a single log no list


def test_scrubbing_and_playing_change_the_scan(page):
    page.change("#slider", 17, "input")
    shown(page, 17)
    page.wait("document.querySelector('#position').textContent === 'scan 17 / 24, 0.85 s'")
    page.wait("location.hash.startsWith('#log=corner.npz&scan=17&method=')")
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


def test_a_method_is_chosen_and_another_shown_beside_it(page):
    page.change(".panel select", "pdbs", "change")
    page.wait("document.querySelector('.panel span').textContent.startsWith('0 segments')")
    page.click("#compare")
    page.wait("document.querySelector('.panel:nth-child(2) span').textContent.includes('1 corner')")


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


@pytest.mark.parametrize("size", [NARROW, WIDE])
@pytest.mark.parametrize(
    ("scheme", "color"), [("dark", "rgb(13, 17, 23)"), ("light", "rgb(255, 255, 255)")]
)
def test_the_first_picture_is_whole(page, address, size, scheme, color):
    page.resize(*size, scheme, touch=size is NARROW)
    page.open(address)
    assert page.run("return getComputedStyle(document.body).backgroundColor") == color
    width, height = page.run("return [document.documentElement.scrollWidth, innerHeight]")
    assert width <= size[0]
    left, top, right, bottom = page.run(
        "const b = document.querySelector('canvas').getBoundingClientRect();"
        "return [b.left, b.top, b.right, b.bottom]"
    )
    footer = page.run("return document.querySelector('footer').getBoundingClientRect().top")
    assert bottom <= footer < height  # nothing hides the picture
    assert right - left > 300
    assert bottom - top > 300
    # The scan fills it: 90 % of its height or width, and none of it lies outside.
    places = [page.run(PLACE, point) for point in page.seen("app.panels[0].scan.points") if point]
    (u0, v0), (u1, v1) = np.min(places, axis=0), np.max(places, axis=0)
    assert left < u0 < u1 < right
    assert top < v0 < v1 < bottom
    share = max(
        (u1 - min(u0, page.run(PLACE, [0, 0])[0])) / (right - left), (v1 - v0) / (bottom - top)
    )
    assert share == pytest.approx(0.9, abs=0.01)


def test_fingers_move_zoom_and_ask(page, address):
    page.resize(*NARROW, touch=True)
    page.open(address)
    small = page.run(
        "return [...document.querySelectorAll('button, select, #layers label')]"
        ".filter((e) => e.offsetParent).filter((e) => e.offsetHeight < 44 || e.offsetWidth < 44)"
        ".map((e) => e.id || e.textContent)"
    )
    assert small == []
    state = "[app.plane.x, app.plane.y, app.plane.scale]"
    x, y, scale = page.seen(state)
    middle, top = page.run(
        "const b = document.querySelector('canvas').getBoundingClientRect();"
        "return [b.left + b.width / 2, b.top]"
    )
    page.touch((150, top + 100), kind="touchStart")
    page.touch((180, top + 90))
    page.touch((190, top + 120))
    page.touch(kind="touchEnd")
    assert page.seen(state) == pytest.approx([x - 40 / scale, y + 20 / scale, scale])
    page.click("#fit")
    # Two fingers: apart to half as much again, and up by 30; between them the plane stays.
    page.touch((middle - 50, top + 130), (middle + 50, top + 130), kind="touchStart")
    page.touch((middle - 60, top + 115), (middle + 60, top + 115))
    page.touch((middle - 75, top + 100), (middle + 75, top + 100))
    page.touch(kind="touchEnd")
    zoomed = page.seen(state)
    assert zoomed[2] == pytest.approx(1.5 * scale, rel=1e-3)
    half = page.run("return document.querySelector('canvas').clientHeight") / 2
    under = y + (half - 130) / scale
    assert zoomed[:2] == pytest.approx([x, under - (half - 100) / zoomed[2]], abs=2 / scale)
    assert page.text("#pins-hint") != ""  # that was no tap
    page.touch((100, top + 100), (200, top + 100), kind="touchStart")
    page.touch(kind="touchEnd")  # neither was that
    time.sleep(0.3)
    assert page.text("#why h3") is None
    page.click("#fit")
    place = page.seen("app.panels[0].scan.points[30]")
    u, v = page.run(PLACE, place)
    page.touch((u, v), kind="touchStart")
    page.touch(kind="touchEnd")
    page.wait("document.querySelector('.card .why')?.offsetHeight > 0")
    assert page.text(".card .why") == page.text("#why .summary")
    assert page.text("#why h3").startswith("beam 30, ")


KEYS = [
    ("c", "app.panels.length", 2),
    ("n", "app.panels[1].method", METHODS[0]),
    ("N", "app.panels[1].method", METHODS[1]),
    ("c", "app.panels.length", 1),
    ("m", "app.panels[0].method", METHODS[1]),
    ("M", "app.panels[0].method", METHODS[0]),
    ("2", "app.layers.shown.clusters", False),
    ("7", "app.layers.shown.corners", False),
    ("7", "app.layers.shown.corners", True),
    ("v", "app.sigmas", 15),
    ("]", "app.logName", "drive.npz"),
    ("w", "app.world", True),
    ("1", "app.layers.shown.drive", False),
    ("w", "app.world", False),
    ("[", "app.logName", "corner.npz"),
    (".", "app.timeline.speed.value", "2"),
    (",", "app.timeline.speed.value", "1"),
    (Keys.ARROW_RIGHT, "app.timeline.index", 1),
    (Keys.ARROW_LEFT, "app.timeline.index", 0),
    (Keys.END, "app.timeline.index", 24),
    (Keys.HOME, "app.timeline.index", 0),
    ("b", "document.activeElement.id", "beam"),
    ("7" + Keys.ENTER, "app.asked?.beam", 7),
    ("s", "document.querySelector('dialog[open]')?.id", "sharing"),
    (Keys.ESCAPE, "document.querySelector('dialog[open]')", None),
    ("?", "document.querySelector('dialog[open]')?.id", "keys"),
    ("c", "document.querySelectorAll('#key-list dt').length > 20", True),
    (Keys.ESCAPE, "document.querySelector('dialog[open]')", None),
    ("v", "app.panels.length", 1),  # the c did nothing below the list of keys
]


def test_all_that_can_be_clicked_has_a_key(page):
    for keys, script, expected in KEYS:
        page.press(keys)
        page.until(script, expected)
        page.until("document.body.dataset.scan === String(app.timeline.index)", True)
    page.press_with_shift(Keys.ARROW_RIGHT)
    shown(page, 10)
    page.press("f")
    scale, x, y = page.seen("[app.plane.scale, app.plane.x, app.plane.y]")
    page.press("+")
    assert page.seen("app.plane.scale") == pytest.approx(1.3 * scale)
    page.press("-hk")
    place = [x - 80 / scale, y + 80 / scale]
    assert page.seen("[app.plane.x, app.plane.y]") == pytest.approx(place)
    page.press("ljf")
    assert page.seen("app.plane.scale") == pytest.approx(scale)


def test_another_log_is_chosen_and_a_broken_one_reported(page):
    page.change("#log", "1", "change")
    page.wait("document.querySelector('#facts').innerText === 'npz, 40 scans'")
    page.wait("document.body.dataset.scan === '0'")
    assert page.seen("app.panels[0].scan.beams") == 90
    page.change("#log", "2", "change")
    page.wait("!document.querySelector('#problem').hidden")
    assert "x.npz: " in page.text("#problem")
    assert caption(page) == ""
    logged = page.driver.get_log("browser")
    assert all("404" in line["message"] for line in logged)
    page.change("#log", "0", "change")
    page.wait("document.querySelector('.panel span').innerText.includes('1 corner')")
    page.wait("document.querySelector('#problem').hidden")


def test_the_world_frame_has_the_drive_behind_the_scan(page, address):
    assert page.run("return document.querySelector('#world').disabled")
    assert "has no poses" in page.run("return document.querySelector('#world').title")
    page.open(f"{address}#log=drive.npz&scan=20")
    page.click("#world")
    page.wait("document.querySelector('#world').ariaPressed === 'true'")
    page.until("app.drive.scans.length", 40)
    # The room: the scan's own points, the points of the drive, and what is under the pointer.
    beam = page.run(
        "return import('/main.js').then(({ app }) => app.panels[0].frame.toPlane("
        "app.panels[0].scan.points[45]))"
    )
    scan = list(drive(21))[20]
    x, y, theta = scan.pose
    ahead = x + scan.ranges[45] * np.cos(theta), y + scan.ranges[45] * np.sin(theta)
    assert beam == pytest.approx(ahead)
    there = "{ const { frame, size } = app.panels[0];"
    there += "return frame.toMetres(frame.toPixels([1.5, -0.7], size), size); }"
    assert page.seen(there) == pytest.approx([1.5, -0.7])
    for name in ("clusters", "arcs", "segments", "breakpoints", "edges", "corners"):
        page.click(f"#show-{name}")

    def drawn(point):
        """Whether there is ink within two pixels of a point of the plane."""
        time.sleep(0.3)
        size = "app.panels[0].size"
        u, v = page.seen(f"app.plane.toPixels({point.tolist()}, {size}).map(Math.round)")
        red, *_, opacity = np.moveaxis(page.pixels()[v - 2 : v + 3, u - 2 : u + 3], -1, 0)
        return bool(((opacity > 100) & (red < 200)).any())

    seen = list(drive(40))
    behind, later = seen[0].points[5], seen[39].points[80]
    c, s = np.cos(seen[39].pose[2]), np.sin(seen[39].pose[2])
    later = seen[39].pose[:2] + np.array([[c, -s], [s, c]]) @ later
    assert drawn(behind + seen[0].pose[:2])
    assert not drawn(later)  # seen only from scan 39 on
    page.change("#slider", 39, "input")
    shown(page, 39)
    assert drawn(later)
    page.click("#show-drive")
    assert not drawn(behind + seen[0].pose[:2])
    # Near, the view goes with the sensor.
    page.press(Keys.HOME)
    shown(page, 0)
    width, height = page.seen(
        "{ const { size } = app.panels[0]; app.look(() => app.plane.look([-2, 0.5, 1], size));"
        "return [size.width, size.height]; }"
    )
    assert page.seen("app.plane.scale") == pytest.approx(min(width, height))
    assert width > height
    page.press(Keys.END)
    shown(page, 39)
    assert page.seen("[app.plane.x, app.plane.y]") == pytest.approx(seen[39].pose[:2])


SCENE = """
const { Drawing, readTheme } = await import("/drawing.js");
const { placeBeams } = await import("/geometry.js");
const { Frame, Plane } = await import("/plane.js");
const { LAYERS } = await import("/layers.js");
const covariance = [[0.002, 0.001], [0.001, 0.004]], spread = { first_beam: 0, last_beam: 3 };
const scan = {
  beams: 6, angle_min: 0.2, angle_increment: 0.3, ranges: [3, 3.1, 3, 2.9, null, 2],
  clusters: [0, 0, 0, 0, -1, -1],
  arcs: [{ center: [2, 2], radius: 1.3, ...spread }],
  segments: [{ start: [-3, 1], end: [-1, 2.5] }],
  breakpoints: [{ position: [-2, -1] }],
  corners: [{ kind: "corner", position: [1, -2], covariance }],
  edges: [{ side: "end", position: [-3, -2], covariance }],
};
placeBeams(scan);
const size = { width: 400, height: 400 }, plane = Object.assign(new Plane(), { scale: 45 });
const canvas = Object.assign(document.createElement("canvas"), size), ctx = canvas.getContext("2d");
const drawing = new Drawing(ctx, plane, new Frame(plane, arguments[0]), size, readTheme());
for (const layer of LAYERS) layer.draw(true, drawing, { scan, sigmas: 6 });
drawing.highlight({ kind: "arc", feature: scan.arcs[0] }, scan, 3);
drawing.beam(scan, 4);
return [...ctx.getImageData(0, 0, 400, 400).data].filter((_, k) => k % 4 === 3);
"""


def test_a_scan_is_drawn_the_same_at_any_pose(page):
    """Turned by a quarter and moved, with all that there is to draw: the picture turned."""
    script = f"return (async function () {{ {SCENE} }}).apply(null, arguments)"
    pictures = [
        np.reshape(page.run(script, pose), (400, 400))
        for pose in ([0, 0, 0], [0, 0, np.pi / 2], [20 / 45, 30 / 45, 0])
    ]
    assert np.count_nonzero(pictures[0]) > 2000
    off = abs(np.rot90(pictures[0]) - pictures[1].astype(int)) > 100
    assert np.count_nonzero(off) < 20
    moved = pictures[2][:-30, 20:].astype(int) - pictures[0][30:, :-20]
    assert np.count_nonzero(abs(moved) > 100) < 300  # the end of the beam that goes out of it


def test_a_link_shows_the_same_in_another_browser(page, address, tmp_path):
    page.open(f"{address}#log=drive.npz&scan=7")
    page.press("cmw+lvv46")
    page.press(Keys.ARROW_RIGHT * 5)
    shown(page, 12)
    page.run("document.querySelector('#beam').value = 33")
    page.click("#ask button")
    page.wait("location.hash.includes('beam=33')")
    state = (
        "[app.logName, app.timeline.index, app.panels.map((p) => p.method), app.layers.hidden,"
        "app.sigmas, app.world, app.asked?.beam, app.drive.scans.length, document.title,"
        "document.querySelector('#why').innerText, app.panels.map((p) => p.caption.innerText)]"
    )
    view = "[app.plane.x, app.plane.y, app.plane.scale]"
    with new_browser(tmp_path) as other:
        other.resize(1366, 768)
        other.open(page.driver.current_url)
        other.wait("document.querySelector('#why .summary')")
        for one in (page, other):
            one.until("app.drive.scans.length", 40)
        time.sleep(0.5)
        assert other.seen(state) == page.seen(state)
        assert page.seen(state)[:7] == [
            "drive.npz", 12, ["pdbs", "pdbs"], ["segments", "edges"], 60, True, 33,
        ]  # fmt: skip
        assert other.seen(view) == pytest.approx(page.seen(view), rel=1e-4, abs=1e-4)
        assert np.mean(abs(page.pixels() - other.pixels()) > 64) < 0.002
        assert other.driver.get_log("browser") == []


@pytest.mark.parametrize("touch", [False, True])
def test_what_is_shared_is_saved(page, address, folder, tmp_path, touch):
    page.resize(*(NARROW if touch else WIDE), touch=touch)
    page.command("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    granted = ["clipboardReadWrite", "clipboardSanitizedWrite"]
    page.command("Browser.grantPermissions", permissions=granted, origin=address.rstrip("/"))
    page.open(f"{address}#log=drive.npz&scan=17")
    page.click("#share")
    for button, name in (("npz", "drive.npz-scan-17.npz"), ("png", "drive.npz-scan-17.png")):
        page.click(f"#save-{button}")
        saved = tmp_path / name
        WebDriverWait(page.driver, 20).until(lambda _, path=saved: path.exists())
        page.wait(f"document.querySelector('#shared').innerText === 'Saved {name}'")
    (scan,) = open_log(tmp_path / "drive.npz-scan-17.npz")
    original = open_log(folder / "drive.npz").scan(17)
    for name in ("ranges", "angles", "intensities", "pose", "stamp", "range_max"):
        np.testing.assert_array_equal(getattr(scan, name), getattr(original, name))
    # It is what the page shows, under a title.
    canvas, picture = page.pixels(), image.imread(tmp_path / "drive.npz-scan-17.png")
    title = len(picture) - len(canvas)
    assert 40 < title < 120
    on_page = canvas[..., 0] * (canvas[..., 3] / 255) + 255 - canvas[..., 3]
    np.testing.assert_allclose(255 * picture[title:, :, 0], on_page, atol=2)
    assert np.unique(picture[:title, :, 0]).size > 5  # words
    page.click("#copy")
    page.wait("document.querySelector('#shared').innerText === 'Copied the link'")
    copied = page.run("return navigator.clipboard.readText()")
    assert copied == page.run("return document.querySelector('#link').value")
    assert copied.startswith(f"{address}#log=drive.npz&scan=17&method=liu:scale_free&view=")


def test_a_server_that_has_gone_is_reported(page):
    page.run("window.fetch = () => Promise.reject(new TypeError('gone'))")
    page.press(Keys.ARROW_RIGHT)
    page.wait("!document.querySelector('#problem').hidden")
    assert "The server has ended" in page.text("#problem")
    page.run("document.querySelector('#problem').hidden = true")
