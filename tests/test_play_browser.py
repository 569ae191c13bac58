"""The page of `carom play` in a real browser: aim, tip, shot, replay, undo, save, with mouse and keys."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import Any

import pytest
from browser import Browser, find_browser
from carom import billiards
from carom.play.game import Game
from carom.play.server import Server

pytestmark = pytest.mark.skipif(
    find_browser() is None, reason="needs a Chromium (apt-get install chromium, or name one in CAROM_BROWSER)"
)


@pytest.fixture(scope="module")
def table() -> Iterator[tuple[Server, Browser]]:
    kit = billiards.table("9ft")
    scene = kit.scene("two balls")
    kit.cue_ball(scene)
    kit.ball(scene, "1", at=(1.3, 0.8))
    with Server(Game(scene), port=0) as server, Browser(size=(1100, 800)) as browser:
        browser.visit(server.url, "play")
        browser.evaluate("play.ready")
        yield server, browser


@pytest.fixture
def page(table: tuple[Server, Browser]) -> Browser:
    """The page as it is when opened."""
    server, browser = table
    wait(browser, "play.aiming()")
    while server.game.can_undo:
        browser.press("u", "u")
        wait(browser, "play.aiming()")
    browser.press("x", "x")
    browser.evaluate("play.set({ direction: 0, speed: 2, squirt: false })")
    settled(browser)
    return browser


def wait(browser: Browser, condition: str, limit: float = 60.0) -> None:
    deadline = time.monotonic() + limit
    while not browser.evaluate(condition):
        assert time.monotonic() < deadline, condition
        time.sleep(0.05)


def settled(browser: Browser) -> Any:
    """The line of aim, once it belongs to the aim."""
    wait(browser, "!play.asking()")
    return browser.evaluate("play.sight()")


def shoot(browser: Browser) -> None:
    """Press the space bar and see the shot through to its end."""
    shots = browser.evaluate("play.state().shots")
    browser.press(" ", " ")
    wait(browser, f"play.state().shots > {shots} && play.viewer().running()")
    assert not browser.evaluate("play.aiming()")
    browser.evaluate("play.viewer().setTime(Infinity)")
    wait(browser, "play.aiming()")


def pixel(browser: Browser, x: float, y: float) -> tuple[float, float]:
    across, down = browser.evaluate(f"play.pixel({x}, {y})")
    return across, down


def test_the_page_asks_this_server_alone_and_has_no_errors(
    page: Browser, table: tuple[Server, Browser]
) -> None:
    assert all(request.startswith((table[0].url, "blob:")) for request in page.requests)
    assert [line for line in page.console if not line.startswith("warning: [.WebGL")] == []


def test_a_drag_aims_at_the_pointer(page: Browser) -> None:
    page.mouse("mousePressed", *pixel(page, 1.5, 0.3), buttons=1)
    page.mouse("mouseMoved", *pixel(page, 1.3, 0.8), buttons=1)
    page.mouse("mouseReleased", *pixel(page, 1.3, 0.8))
    sight = settled(page)
    wanted = math.atan2(0.8 - 0.635, 1.3 - 0.635)
    assert page.evaluate("play.aim().direction") == pytest.approx(wanted, abs=2e-3)
    assert sight["hit"] == "1"
    assert math.dist(sight["ghost"], (1.3, 0.8)) == pytest.approx(0.05715, abs=1e-6)


def test_keys_set_the_stroke(page: Browser) -> None:
    for key, times in (("ArrowUp", 3), ("ArrowLeft", 2), ("d", 4), ("s", 2), ("e", 5)):
        for _ in range(times):
            page.press(key, key if len(key) == 1 else "")
    aim = page.evaluate("play.aim()")
    assert aim["speed"] == pytest.approx(2.6)
    assert aim["direction"] == pytest.approx(math.radians(1.0))
    assert (aim["side"], aim["height"]) == (pytest.approx(0.2), pytest.approx(-0.1))
    assert aim["elevation"] == pytest.approx(math.radians(15))
    page.press("ArrowLeft", shift=True)
    assert page.evaluate("play.aim().direction") == pytest.approx(math.radians(1.05))
    page.press("x", "x")
    aim = page.evaluate("play.aim()")
    assert (aim["side"], aim["height"], aim["elevation"]) == (0, 0, 0)


def test_a_shot_is_played_replayed_and_undone(page: Browser, table: tuple[Server, Browser]) -> None:
    game = table[0].game
    before = page.evaluate("play.state().balls")
    page.evaluate(f"play.set({{ direction: {math.atan2(0.165, 0.665)}, speed: 1.5 }})")
    shoot(page)
    assert "cue hits 1 first" in page.evaluate("document.getElementById('words').textContent")
    after = page.evaluate("play.state().balls")
    assert after != before
    shown = page.evaluate("play.viewer().state()")
    for name, place in zip(shown["names"], shown["positions"], strict=True):
        assert math.dist(place[:2], after[name]) < 1e-5
    page.press("r", "r")
    wait(page, "play.viewer().running()")
    page.evaluate("play.viewer().setTime(Infinity)")
    page.press("u", "u")
    wait(page, "play.state().shots === 0 && play.aiming()")
    assert page.evaluate("play.state().balls") == before
    assert page.evaluate("play.aim().speed") == 1.5  # and the aim of that shot
    assert not game.can_undo


def test_the_cue_ball_is_moved_by_a_drag(page: Browser) -> None:
    page.mouse("mousePressed", *pixel(page, 0.635, 0.635), buttons=1)
    page.mouse("mouseMoved", *pixel(page, 0.4, 0.3), buttons=1)
    page.mouse("mouseReleased", *pixel(page, 0.4, 0.3))
    wait(page, "play.aiming() && play.state().undo")
    assert math.dist(page.evaluate("play.state().balls.cue"), (0.4, 0.3)) < 5e-3
    page.mouse("mousePressed", *pixel(page, *page.evaluate("play.state().balls.cue")), buttons=1)
    page.mouse("mouseMoved", *pixel(page, 1.3, 0.8), buttons=1)
    page.mouse("mouseReleased", *pixel(page, 1.3, 0.8))
    wait(page, "document.getElementById('words').textContent.includes('overlap')")


def test_the_last_shot_is_saved(page: Browser) -> None:
    page.evaluate("window.saved = []")
    page.evaluate(
        "HTMLAnchorElement.prototype.click = function () { saved.push([this.download, this.href]) }"
    )
    shoot(page)
    page.evaluate("document.getElementById('save').click()")
    wait(page, "saved.length === 1")
    assert page.evaluate("saved[0][0]") == "shot-1.toml"
    assert "shot-1.toml" in page.evaluate("document.getElementById('words').textContent")


def test_the_line_of_aim_follows_the_pointer(page: Browser) -> None:
    """A minute hand over the table: the page shows how many lines of aim a second it gets, 60 on an idle machine."""
    page.evaluate(
        "new Promise((done) => { let k = 0; const turn = () => {"
        " play.set({ direction: 0.001 * k }); k++ < 90 ? requestAnimationFrame(turn) : done(); }; turn(); })"
    )
    settled(page)
    rate = page.evaluate("play.rate()")
    print(f"{rate:.0f} lines of aim a second")
    assert rate > 5  # this machine may be loaded, and draws by software


def test_a_short_shot_plays_as_fast_as_it_is(page: Browser) -> None:
    """Films of less than 1.5 s are slowed down elsewhere; here shots of 1 s crept."""
    page.evaluate("play.set({ speed: 0.1, height: -0.2 })")
    shots = page.evaluate("play.state().shots")
    page.press(" ", " ")
    wait(page, f"play.state().shots > {shots} && play.viewer().running()")
    assert page.evaluate("play.viewer().state().end") < 1.5
    assert page.evaluate("play.viewer().state().speed") == 1


def test_a_page_that_stayed_behind_shows_the_table_anew(page: Browser, table: tuple[Server, Browser]) -> None:
    """Another page moves a ball; this one aims, is told, and shoots only then."""
    game = table[0].game
    game.place("1", (1.1, 0.95))
    assert page.evaluate("play.state().balls['1'][0]") == 1.3
    for act in (lambda: page.evaluate("play.set({ direction: 0.1 })"), lambda: page.press(" ", " ")):
        act()
        wait(page, f"play.state().state === {game.changes} && play.aiming() && !play.asking()")
        assert "another page" in page.evaluate("document.getElementById('words').textContent")
        assert game.shots == 0
        assert page.evaluate("play.state().balls['1']") == [*game.ball("1").position[:2]]
        shown = page.evaluate("play.viewer().state()")
        assert shown["positions"][shown["names"].index("1")][:2] == pytest.approx(
            game.ball("1").position[:2], abs=1e-5
        )
        game.place("1", (1.2, 0.95))
    page.evaluate("play.set({ direction: 0.1 })")
    wait(page, f"play.state().state === {game.changes} && play.aiming()")
    shoot(page)
    assert game.shots == 1


def test_balls_at_rest_have_no_time(page: Browser) -> None:
    """A new game showed "0.017 s of 0.0166667 s, frame 2 / 2, 0.01x"."""
    frame = "document.querySelector('iframe.shown').contentDocument"
    shown = f"{frame}.defaultView.getComputedStyle({frame}.getElementById('clock')).display"
    assert page.evaluate(shown) == "none"
    shoot(page)
    assert page.evaluate(shown) == "flex"


def test_the_bar_is_as_dark_as_the_page_or_as_it_was_chosen(page: Browser) -> None:
    """Half of it was a large white strip beside the dark column, in two rows."""
    assert page.evaluate("play.viewer().state().theme") == "dark"
    rows = "new Set([...document.querySelector('iframe.shown').contentDocument"
    rows += ".querySelectorAll('#bar .group:not([hidden])')]"
    rows += ".map((part) => part.getBoundingClientRect().top)).size"
    with Browser(size=(1280, 800)) as wide:
        wide.visit(str(page.evaluate("location.href")), "play")
        wide.evaluate("play.ready")
        assert wide.evaluate(rows) == 1
    page.evaluate("play.viewer().theme()")
    shoot(page)
    assert page.evaluate("play.viewer().state().theme") == "light"
    page.evaluate("play.viewer().theme()")


def test_a_table_that_cannot_be_drawn_leaves_the_old_one(
    page: Browser, table: tuple[Server, Browser], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full() -> bytes:
        raise OSError("No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(table[0], "table", full)
        page.press(" ", " ")
        wait(page, "document.getElementById('words').textContent.includes('No space left')")
    wait(page, "play.aiming()")
    page.press("u", "u")
    wait(page, "play.state().shots === 0 && play.aiming()")
