"""The page of `view` in headless Chromium, of a log of several scanners."""

import pytest
from test_merge_command import made
from test_view_page import PLACE, browser, pytestmark, served, shown
from test_view_scanners import FRONT, REAR, log

from lineament import Extractor
from lineament.explain.explain import explain
from lineament.logs import open_log

__all__ = ["browser", "log", "pytestmark"]


@pytest.fixture
def page(browser, log):
    browser.resize(1366, 768)
    with served(log, ["optimal"]) as (_, address):
        browser.open(address)
        yield browser
        said = browser.driver.get_log("browser")
        browser.driver.get("about:blank")  # it asks nothing more
    assert said == []


def drawn(page):
    """Return how many pixels have the colour of each scanner, once all is drawn."""
    page.run(
        "return new Promise((next) => requestAnimationFrame(() => requestAnimationFrame(next)))"
    )
    colors = page.seen("app.theme.scanners.slice(0, 2)")
    pixels = page.pixels()[..., :3]
    return [(pixels == [*bytes.fromhex(color[1:])]).all(axis=-1).sum() for color in colors]


def topics(page):
    return page.seen("app.topics.chosenNames")


def test_scanners_are_shown_over_each_other_in_their_colours(page):
    assert page.text("header p").startswith("/front + /rear in mcap, ")
    assert page.text("#topics").split() == [FRONT, REAR]
    assert page.text(".panel span").startswith("merged: ")
    assert min(drawn(page)) > 500
    # Without them the merged features stay, and what all have measured.
    page.click("#show-scanners")
    assert drawn(page) == [0, 0]
    assert page.seen("app.panels[0].scan.segments.length") > 4


def test_the_merged_wall_lies_on_the_measurements_of_both(page):
    """A scanner is drawn where it is on the robot: its points are on the merged segments."""
    off = page.run("""
    return import("/main.js").then(({ app }) => {
      const [{ scan, frame }] = app.panels;
      const away = ([x, y], { start, end }) => {
        const [dx, dy] = [end[0] - start[0], end[1] - start[1]], n = Math.hypot(dx, dy);
        const t = ((x - start[0]) * dx + (y - start[1]) * dy) / n / n;
        return t < 0 || t > 1 ? Infinity : Math.abs((x - start[0]) * dy - (y - start[1]) * dx) / n;
      };
      return scan.parts.map((part) => {
        const points = part.points.filter(Boolean).map((p) => frame.within(part.place).toPlane(p));
        const all = points.map((p) => Math.min(...scan.segments.map((s) => away(p, s))));
        return all.sort((a, b) => a - b)[Math.floor(0.9 * all.length)];
      });
    });
    """)
    assert max(off) < 0.08


def test_boxes_and_a_key_choose_scanners_and_the_link_keeps_them(page):
    page.seen("app.timeline.go(20)")
    shown(page, 20)
    page.click("#topics label:nth-child(1) input")
    page.until("app.panels[0].scan?.topic", REAR)
    assert topics(page) == [REAR]
    assert drawn(page) == [0, 0]  # alone, as any log
    # The scan at the same time as before.
    assert page.seen("app.timeline.index") in (19, 20, 21)
    page.click("#topics label:nth-child(1) input")
    page.until("app.panels[0].scan?.topic", f"{FRONT} + {REAR}")
    page.press("t")
    page.until("app.panels[0].scan?.topic", FRONT)
    page.press("t")
    page.until("app.panels[0].scan?.topic", REAR)
    page.until("location.hash.includes('topics=/rear')", True)
    address = page.driver.current_url
    page.press("t")
    page.until("app.panels[0].scan?.topic", f"{FRONT} + {REAR}")
    page.open(address)
    page.until("app.panels[0].scan?.topic", REAR)
    # The last box cannot be taken away.
    page.click("#topics label:nth-child(2) input")
    page.until("app.topics.chosenNames.join()", REAR)


def test_a_beam_is_explained_of_the_scanner_that_measured_it(page, log):
    """The one under the pointer."""
    part, beam, place = page.run("""
    return import("/main.js").then(({ app }) => {
      const [{ scan }] = app.panels, part = scan.parts[1];
      const beam = part.numbers.findIndex((n, i) => i > 300 && n >= 0);
      return [part.index, beam, scan.points[part.numbers[beam]]];
    });
    """)
    whole = page.seen(f"app.panels[0].scan.parts[1].numbers[{beam}]")
    page.seen(f"app.explain(app.panels[0], {whole})")
    text = page.text("#why")
    scan = open_log(log, REAR).scan(part)
    summary = explain(Extractor().trace(scan), beam).summary
    assert f"/rear, its beam {beam}: {summary}" in text
    assert len(page.run(PLACE, place)) == 2


def test_the_timeline_plays_several_scanners(page):
    page.press(" ")
    page.wait("Number(document.body.dataset.scan) > 5")
    assert page.seen("app.panels[0].scan.parts.length") == 2


def test_a_log_that_does_not_say_where_scanners_are_shows_one_and_says_why(browser, tmp_path):
    path = made(tmp_path, frames=False)
    browser.resize(1366, 768)
    with served(path, ["optimal"]) as (_, address):
        browser.open(address)
        assert browser.seen("app.panels[0].scan.topic") == FRONT
        assert "expected /tf_static, or --mounting /front=X,Y,DEGREES" in browser.text("#topics")
        browser.click("#topics label:nth-child(2) input")
        browser.until("app.panels[0].scan?.topic", REAR)
        assert topics(browser) == [REAR]
        assert browser.driver.get_log("browser") == []
        browser.driver.get("about:blank")
