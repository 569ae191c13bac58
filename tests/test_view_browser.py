"""The page in a real browser, software rendering, nothing but the file. Skipped where no Chromium is found."""

from __future__ import annotations

import io
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Browser, find_browser
from carom.show.viewer import write_html
from view_scenes import RADIUS, STEP, billiard, drum, struck, turn

pytestmark = pytest.mark.skipif(
    find_browser() is None, reason="needs a Chromium (apt-get install chromium, or name one in CAROM_BROWSER)"
)

FRAMES = 300


@pytest.fixture(scope="module")
def run() -> Any:
    return billiard(FRAMES)


@pytest.fixture(scope="module")
def page(run: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_html(run, tmp_path_factory.mktemp("view") / "view.html", title="Four balls").path


@pytest.fixture(scope="module")
def window(page: Path) -> Iterator[Browser]:
    with Browser(size=(900, 640)) as browser:
        browser.open(page)
        yield browser


@pytest.fixture
def browser(window: Browser) -> Browser:
    """The page as it is when opened."""
    window.evaluate("carom.select(-1), carom.view('fit'), carom.setTime(0)")
    window.settle()
    return window


def state(browser: Browser) -> Any:
    return browser.evaluate("carom.state()")


def pixels(browser: Browser) -> Any:
    image = pytest.importorskip("PIL.Image", reason="needs pillow (comes with matplotlib)")
    return np.asarray(image.open(io.BytesIO(browser.picture())).convert("RGB")).astype(int)


def wait(browser: Browser, condition: str) -> None:
    deadline = time.monotonic() + 30.0
    while not browser.evaluate(condition):
        assert time.monotonic() < deadline, condition
        time.sleep(0.05)


def test_page_asks_for_itself_and_nothing_else(browser: Browser, page: Path) -> None:
    assert browser.requests == [page.resolve().as_uri()]
    errors = [line for line in browser.console if not line.startswith("warning: [.WebGL")]
    assert errors == []  # a refusal by the policy would be one


def test_state_is_the_runs_at_frames_and_between(browser: Browser, run: Any) -> None:
    for frame, share in ((0, 0.0), (17, 0.0), (120, 0.4), (FRAMES - 1, 0.0)):
        t = (frame + share) * STEP
        # A hair late, so that rounding does not put us before the frame.
        browser.evaluate(f"carom.setTime({t + 1e-9})")
        now = state(browser)
        assert now["frame"] == frame == browser.evaluate("carom.frame")
        following = min(frame + 1, FRAMES - 1)
        expected = (1 - share) * run.position[frame] + share * run.position[following]
        assert np.abs(np.array(now["positions"]) - expected).max() < 2e-5 * RADIUS
        before, after = run.orientation[frame], run.orientation[following]
        attitude = np.array(now["orientations"])
        # On the way from one attitude to the next: the angles to both add up to the angle between.
        angle = [2 * np.arccos(np.clip(np.abs((attitude * q).sum(-1)), 0, 1)) for q in (before, after)]
        whole = 2 * np.arccos(np.clip(np.abs((before * after).sum(-1)), 0, 1))
        assert np.abs(angle[0] - share * whole).max() < 2e-3
        assert np.abs(angle[1] - (1 - share) * whole).max() < 2e-3


def test_fast_spin_turns_the_right_way_between_frames(tmp_path: Path) -> None:
    """At 350 rad/s and ten frames' spacing the short way round is the wrong one; the recorded spin knows."""
    run = billiard(30)
    run.time = 0.02 * np.arange(30)
    rate = np.array([[0.0, 350.0, 0.0], [200.0, 0.0, 150.0], [0.0, 0.0, 314.159265 / 2], [0.0, 0.0, 0.0]])
    run.angular_velocity = np.broadcast_to(rate, (30, 4, 3)).copy()
    from view_scenes import turn

    run.orientation = np.stack([turn(rate, float(t)) for t in run.time])
    with Browser(size=(400, 300)) as browser:
        browser.open(write_html(run, tmp_path / "spin.html").path)
        for t in (0.1067, 0.255, 0.3333):
            browser.evaluate(f"carom.setTime({t})")
            attitude = np.array(state(browser)["orientations"])
            overlap = np.abs((attitude * turn(rate, t)).sum(-1))
            assert overlap.min() > 1 - 1e-5


def test_rates_from_frames_are_exact_under_constant_acceleration(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They were those of the middle of the time to the next frame; times here are unequal."""
    monkeypatch.setattr("carom.show.viewer.page.MAX_BODY_FRAMES_WITH_VELOCITY", 0)
    run = billiard(6)
    run.time = np.array([0.0, 0.01, 0.03, 0.04, 0.06, 0.07])
    run.position = np.zeros((6, 4, 3))
    run.position[:, 0, 2] = 5.0 - 4.905 * run.time**2
    axis = np.broadcast_to([1.0, 0.0, 0.0], (4, 3))
    run.orientation = np.stack([turn(axis, float(20.0 * t**2)) for t in run.time])
    info = write_html(run, tmp_path / "view.html")
    assert info.notes == ("Velocities and spins are differences between frames.",)
    with Browser(size=(800, 600)) as browser:
        browser.open(info.path)
        browser.evaluate("carom.select(0)")
        for time_ in run.time:
            browser.evaluate(f"carom.setTime({time_ + 1e-9})")
            card = browser.evaluate("document.getElementById('card').innerText").replace("−", "-")
            speed, spin = (float(re.search(rf"(\S+) {unit}", card)[1]) for unit in ("m/s", "rad/s"))
            assert speed == pytest.approx(9.81 * time_, abs=2e-3)
            assert spin == pytest.approx(40.0 * time_, abs=0.02)


def test_balls_are_where_the_numbers_say_and_their_patterns_turn(browser: Browser) -> None:
    first = pixels(browser)
    x, y = map(round, state(browser)["screen"][1])
    ball = first[y - 2 : y + 3, x - 6 : x + 7].reshape(-1, 3)
    red = (ball[:, 0] > 1.5 * ball[:, 1]) & (ball[:, 0] > 1.5 * ball[:, 2])
    white = ball.min(axis=1) > 150
    assert red.any()  # number 3 is red,
    assert white.any()  # with a white badge
    cloth = first[y + 60, x - 60]
    assert cloth[1] > cloth[0] and cloth[1] > cloth[2]  # noqa: PT018  (green is one colour)
    browser.evaluate("carom.select('ball3'), carom.follow(true), carom.setTime(0)")
    browser.settle()
    browser.evaluate("carom.select('ball3')")
    close = pixels(browser)
    browser.evaluate("carom.setTime(0.25)")
    turned = pixels(browser)
    x, y = map(round, state(browser)["screen"][1])
    patch = np.s_[y - 20 : y + 20, x - 20 : x + 20]
    assert np.abs(turned[patch] - close[patch]).max() > 80


def test_playing_ends_and_loops(browser: Browser) -> None:
    browser.evaluate("carom.play()")
    assert state(browser)["playing"]
    wait(browser, "!carom.state().playing")
    assert state(browser)["time"] == pytest.approx((FRAMES - 1) * STEP)
    assert browser.evaluate("document.getElementById('play').getAttribute('aria-label')") == "Play"
    # From the end it starts again; with loop it goes on.
    browser.press("o", "o")
    browser.press(" ", " ")
    wait(browser, "carom.state().playing && carom.state().time < 0.5")
    assert state(browser)["loop"]
    browser.press("o", "o")
    browser.press(" ", " ")
    assert not state(browser)["playing"]


def test_nothing_is_drawn_while_nothing_changes(browser: Browser) -> None:
    before = state(browser)["pictures"]
    time.sleep(0.5)
    assert state(browser)["pictures"] == before


def test_keys(browser: Browser) -> None:
    for key, shift, expected in (
        ("ArrowRight", False, 1),
        ("ArrowRight", True, 11),
        ("ArrowLeft", False, 10),
        ("End", False, FRAMES - 1),
        ("Home", False, 0),
    ):
        browser.press(key, shift=shift)
        wait(browser, f"carom.frame === {expected}")  # drawn at the next refresh of the screen
    speed = state(browser)["speed"]
    browser.press("-", "-")
    assert state(browser)["speed"] < speed
    browser.press("+", "+")
    assert state(browser)["speed"] == speed
    eye = state(browser)["eye"]
    browser.press("2", "2")
    browser.settle()
    above = state(browser)["eye"]
    assert above[2] > eye[2]
    assert above[0] == pytest.approx(1.27, abs=0.05)  # over the middle of the table
    dark = state(browser)["theme"]
    browser.press("t", "t")
    assert state(browser)["theme"] != dark
    browser.press("t", "t")


def test_click_selects_and_the_card_shows_the_runs_numbers(browser: Browser, run: Any) -> None:
    browser.evaluate(f"carom.setTime({100 * STEP + 1e-9})")
    x, y = state(browser)["screen"][2]
    browser.click(x, y)
    assert state(browser)["selected"] == 2
    browser.evaluate("carom.setTime(carom.state().time)")
    card = browser.evaluate("document.getElementById('card').innerText")
    assert "ball4" in card
    speed = float(np.linalg.norm(run.velocity[100, 2]))
    spin = float(np.linalg.norm(run.angular_velocity[100, 2]))
    assert f"{speed:.4f} m/s" in card
    assert f"{spin:.3f} rad/s" in card
    browser.press("f", "f")
    assert state(browser)["followed"] == 2
    browser.press("Escape")
    assert (state(browser)["selected"], state(browser)["followed"]) == (-1, -1)


def test_every_control_has_a_name_and_is_reached_by_tab(browser: Browser) -> None:
    nameless = browser.evaluate(
        "[...document.querySelectorAll('button, input, select, dialog, aside, main, canvas:not([aria-hidden])')]"
        ".filter(e => !(e.getAttribute('aria-label') || e.innerText.trim() || e.closest('label'))).map(e => e.outerHTML)"
    )
    assert nameless == []
    reached = set()
    for _ in range(30):
        browser.press("Tab")
        reached.add(browser.evaluate("document.activeElement.id"))
    controls = {
        "scrub",
        "back",
        "play",
        "on",
        "loop",
        "speed",
        "fit",
        "top",
        "side",
        "follow",
        "tags",
        "bodies",
        "end",
        "what",
        "plots",
        "picture",
    }
    assert controls | {"theme", "keys"} <= reached
    browser.evaluate("document.activeElement.blur()")


def test_fits_a_telephone(browser: Browser) -> None:
    browser.resize(390, 780)
    try:
        time.sleep(0.1)
        browser.settle()
        inside = browser.evaluate(
            "[...document.querySelectorAll('#bar button, #bar select, #bar input')].every(e => {"
            "const r = e.getBoundingClientRect(); return r.left >= 0 && r.right <= 390 && r.bottom <= 780 })"
        )
        assert inside
        assert all(0 < x < 390 and 0 < y < 700 for x, y in state(browser)["screen"])
    finally:
        browser.resize(900, 640)


def test_dark_when_the_system_is(page: Path) -> None:
    with Browser(size=(500, 400), dark=True) as browser:
        browser.open(page)
        assert state(browser)["theme"] == "dark"
        assert pixels(browser)[5, 250].mean() < 60


def test_damaged_page_says_so(page: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken.html"
    text = page.read_text()
    start = text.index('id="carom-motion"') + 200
    broken.write_text(text[:start] + "AAAA" + text[start + 4 :])
    with Browser(size=(500, 400)) as browser:
        with pytest.raises(RuntimeError):
            browser.open(broken)
        assert browser.evaluate("document.getElementById('failure').innerText").strip()


def test_moving_walls_and_balls_that_come_and_go(tmp_path: Path) -> None:
    run = drum(60)
    with Browser(size=(700, 500)) as browser:
        browser.open(write_html(run, tmp_path / "view.html").path)
        empty = pixels(browser)
        for t, first, last in ((0.1, False, True), (0.3, True, True), (0.5, True, False)):
            browser.evaluate(f"carom.setTime({t + 0.001})")
            now = state(browser)
            assert (now["present"][0], now["present"][-1]) == (first, last)
            walls = {wall["name"]: wall for wall in now["walls"]}
            half = 0.5 * 3.0 * (t + 0.001)
            assert walls["drum"]["turn"] == pytest.approx([np.cos(half), 0, np.sin(half), 0], abs=1e-4)
            height = -0.15 + 0.02 * np.sin(10 * (t + 0.001))
            assert walls["table"]["point"] == pytest.approx([0.1, 0.0, height], abs=5e-5)
            assert walls["funnel"]["point"] == pytest.approx([0.2, 0.0, -0.05])
        assert [line for line in browser.console if not line.startswith("warning: [.WebGL")] == []
        assert np.abs(pixels(browser) - empty).max() > 60  # the table and the drum have moved


def test_a_periodic_world_is_drawn_within_one_period(tmp_path: Path) -> None:
    run = billiard(FRAMES)
    run.periodic, run.periodic_origin = np.array([0.5, 0.0, 0.0]), np.array([0.1, 0.0, 0.0])
    page = write_html(run, tmp_path / "view.html").path
    with Browser(size=(700, 500)) as browser:
        browser.open(page)
        browser.evaluate(f"carom.setTime({100 * STEP + 1e-9})")
        now = state(browser)
        assert np.abs(np.array(now["positions"]) - run.position[100]).max() < 2e-5 * RADIUS  # as recorded
        low, high = browser.evaluate("carom.state().drawn")
        assert low[0] >= 0.1
        assert high[0] <= 0.6


@pytest.mark.parametrize(("up", "long"), ["yx", "yz", "zx", "zy"])
def test_from_above_the_long_axis_runs_to_the_right_whichever_is_up(
    up: str, long: str, tmp_path: Path
) -> None:
    """Where y is up and z long, z once ran to the left, and the picture seemed a mirror image."""
    axis = ["xyz".index(long), 3 - "xyz".index(long) - "xyz".index(up), "xyz".index(up)]
    run, turned = billiard(5), {}
    for name, values in (("position", run.position), ("velocity", run.velocity)):
        turned[name] = np.empty_like(values)
        turned[name][..., axis] = values
    run.position, run.velocity = turned["position"], turned["velocity"]
    run.gravity = -9.8 * np.eye(3)["xyz".index(up)]
    run.planes = {
        name: values if name == "name" else np.asarray(values)[:, np.argsort(axis)].tolist()
        for name, values in run.planes.items()
    }
    with Browser(size=(700, 500)) as browser:
        browser.open(write_html(run, tmp_path / "view.html").path)
        browser.evaluate("carom.view('top')")
        browser.settle()
        screen = np.array(state(browser)["screen"])
    along, level = run.position[0][:, axis[0]], run.position[0][:, axis[1]]
    scale = (screen[1] - screen[0]) @ [1, 0] / (along[1] - along[0])
    assert scale > 0
    # A view from above and no mirror image: along, level and up are right-handed, or left-handed, on the screen as in space.
    hand = np.linalg.det(np.eye(3)[axis])
    assert -(screen[3] - screen[2]) @ [0, 1] / (level[3] - level[2]) == pytest.approx(hand * scale, rel=0.05)


def test_no_headings_of_impacts_before_the_first(tmp_path: Path) -> None:
    with Browser(size=(700, 500)) as browser:
        browser.open(write_html(struck(FRAMES), tmp_path / "view.html").path)
        for at, told, headings in ((0.0, "No impact yet", "none"), (0.2, "Impacts at 0.1 s", "table")):
            browser.evaluate(f"carom.setTime({at})")
            assert told in browser.evaluate("document.querySelector('#sequence').innerText")
            shown = browser.evaluate("getComputedStyle(document.querySelector('#sequence table')).display")
            assert shown == headings
