"""What the page draws besides balls and walls, in a browser: arrows, impacts in order, trails, graphs, pictures, touch."""

from __future__ import annotations

import base64
import io
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Browser, find_browser
from carom.show.viewer import write_html
from view_scenes import RADIUS, STEP, billiard, struck

pytestmark = pytest.mark.skipif(
    find_browser() is None, reason="needs a Chromium (apt-get install chromium, or name one in CAROM_BROWSER)"
)

FRAMES = 300
NOTHING = "{trails:'off',velocities:false,contacts:false,impacts:false,links:false,through:false,scale:1}"


@pytest.fixture(scope="module")
def run() -> Any:
    return struck(FRAMES)


@pytest.fixture(scope="module")
def page(run: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_html(run, tmp_path_factory.mktemp("view") / "view.html").path


@pytest.fixture(scope="module")
def window(page: Path) -> Iterator[Browser]:
    with Browser(size=(900, 640)) as browser:
        browser.open(page)
        # Cameras glide otherwise, and pictures would have to wait.
        browser._call(
            "Emulation.setEmulatedMedia", features=[{"name": "prefers-reduced-motion", "value": "reduce"}]
        )
        yield browser


@pytest.fixture
def browser(window: Browser) -> Browser:
    """The page with nothing shown but balls and walls."""
    window.evaluate(f"carom.select(-1), carom.view('top'), carom.graphs(false), carom.show({NOTHING})")
    window.evaluate("carom.setTime(0)")
    return window


def at(browser: Browser, t: float, shown: str = "{}") -> Any:
    """The state at a time (a hair later, so that rounding does not put us before the frame)."""
    browser.evaluate(f"carom.show({shown})")
    browser.evaluate(f"carom.setTime({t + 1e-9})")
    return browser.evaluate("carom.state()")


def pixels(browser: Browser) -> Any:
    image = pytest.importorskip("PIL.Image", reason="needs pillow (comes with matplotlib)")
    return np.asarray(image.open(io.BytesIO(browser.picture())).convert("RGB")).astype(int)


def text(browser: Browser, element: str) -> str:
    return str(browser.evaluate(f"document.getElementById('{element}').innerText"))


def test_impacts_have_their_place_in_the_sequence(browser: Browser, run: Any) -> None:
    now = at(browser, 0.1, "{impacts:true}")
    badges = {badge["text"]: badge for badge in now["badges"]}
    # Of problem 0, the loads of the same step, there is none; ball2 and ball3 meet twice.
    assert sorted(b["text"] for b in now["badges"]) == ["1, 3", "2", "2"]
    touch = run.position[50, 0] + [RADIUS, 0, 0]  # the normal points from the second ball to the first
    assert badges["1, 3"]["at"] == pytest.approx(touch, abs=1e-5)
    assert now["largest"]["impact"] == pytest.approx(0.5)
    drawn = browser.evaluate(
        "[...document.querySelectorAll('#badges span:not([hidden])')].map(e => e.innerText)"
    )
    assert sorted(drawn) == ["1, 3", "2", "2"]
    table = text(browser, "sequence")
    assert "Impacts at 0.1 s" in table
    assert "3 in sequence" in table
    for words in ("ball2 – ball3", "ball3 – bed", "slip", "0.250", "−3.000 → 2.900"):
        assert words in table
    # Long after, nothing flashes and the list still tells of the last.
    now = at(browser, 0.29)
    assert now["badges"] == [] or now["speed"] > 0.2
    now = at(browser, 0.3)
    assert "ball5 – foot cushion" in text(browser, "sequence")


def test_keys_go_from_impact_to_impact(browser: Browser) -> None:
    times = []
    for shift in (False, False, False, True, True):
        browser.press("N" if shift else "n", "N" if shift else "n", shift=shift)
        times.append(browser.evaluate("new Promise(r => requestAnimationFrame(() => r(carom.state().time)))"))
    assert times == pytest.approx([0.1, 0.3, 0.3, 0.1, 0.1])


def test_flashes_and_arrows_are_drawn(browser: Browser) -> None:
    bare = at(browser, 0.1)
    picture = pixels(browser)
    x, y = map(round, bare["screen"][0])
    patch = np.s_[y - 25 : y + 25, x - 25 : x + 45]

    def coloured(which: str) -> Any:
        """Pixels that are new and of the colour of velocities, of sticking or of slipping contacts."""
        now = pixels(browser)[patch]
        r, g, b = np.moveaxis(now, -1, 0)
        kinds = {
            "velocity": (r > g + 50) & (b > g + 20),
            "stick": (b > r + 60) & (b > g + 20),
            "slip": (r > b + 90) & (r > g + 50),
        }
        return int((kinds[which] & (np.abs(now - picture[patch]).max(-1) > 40)).sum())

    at(browser, 0.1, "{velocities:true}")
    assert coloured("velocity") > 15
    assert coloured("stick") == 0
    at(browser, 0.1, "{velocities:false,impacts:true}")
    assert coloured("stick") > 15
    assert coloured("velocity") == 0


def test_the_key_gives_the_runs_numbers(browser: Browser, run: Any) -> None:
    now = at(browser, 50 * STEP, "{velocities:true,contacts:true}")
    speed = np.linalg.norm(run.velocity[50], axis=1).max()
    assert now["largest"]["velocity"] == pytest.approx(speed, rel=1e-5)
    assert now["largest"]["contact"] == pytest.approx(4 * 0.17 * 9.8, rel=1e-6)
    words = text(browser, "key")
    assert f"velocity, longest {speed:.3g} m/s" in words
    assert "contact force: mean since the frame before, longest 6.66 N" in words
    # Before the first interval there is no mean force.
    assert at(browser, 0.0)["largest"]["contact"] == 0


def test_trails_lie_where_the_ball_was(browser: Browser, run: Any) -> None:
    end = at(browser, (FRAMES - 1) * STEP)
    bare = pixels(browser)
    at(browser, (FRAMES - 1) * STEP, "{trails:'whole'}")
    change = np.abs(pixels(browser) - bare).max(-1)
    start = browser.evaluate("carom.setTime(0).then(() => carom.state().screen)")
    for n in range(4):
        # Half way the ball has left the place, and beside the way nothing is drawn.
        (x0, y0), (x1, y1) = start[n], end["screen"][n]
        x, y = 0.5 * (x0 + x1), 0.5 * (y0 + y1)
        length = np.hypot(x1 - x0, y1 - y0)
        across = np.array([-(y1 - y0), x1 - x0]) / length
        on = change[round(y) - 1 : round(y) + 2, round(x) - 1 : round(x) + 2].max()
        off = [change[round(y + s * 9 * across[1]), round(x + s * 9 * across[0])] for s in (-1, 1)]
        assert on > 25
        assert max(off) < 15
    browser.evaluate("carom.setTime(0)")
    first = pixels(browser)
    browser.evaluate("carom.show({trails:'off'}), carom.setTime(0)")
    assert np.abs(pixels(browser) - first).max() < 15  # nothing of what is still to come


def test_graphs_follow_the_clock_and_the_clock_a_click(browser: Browser, run: Any) -> None:
    browser.press("g", "g")
    t = 100 * STEP
    at(browser, t)
    words = text(browser, "graphs")
    # The potential energy is measured from its least value.
    assert f"total {2 * np.exp(-t):.3f} J" in words
    assert "potential 0.000 J" in words
    speed = np.linalg.norm(run.velocity[100, 1])
    assert f"ball3 {speed:.3f}" in words
    browser.evaluate("carom.select('ball4')")
    at(browser, t)
    words = text(browser, "graphs")
    v = run.velocity[100, 2]
    assert f"ball4 {np.linalg.norm(v):.3f}" in words
    assert f"y {v[1]:.3f}".replace("-", "−") in words
    box = browser.evaluate(
        "(({left, top, width, height}) => [left, top, width, height])"
        "(document.querySelector('#graphs canvas').getBoundingClientRect())"
    )
    left, right = box[0] + 58, box[0] + box[2] - 10  # the margins of graph.ts
    browser.click(left + 0.5 * (right - left), box[1] + 0.5 * box[3])
    middle = browser.evaluate("new Promise(r => requestAnimationFrame(() => r(carom.state().time)))")
    assert middle == pytest.approx(0.5 * (FRAMES - 1) * STEP, abs=0.01)
    assert browser.evaluate("document.getElementById('graphs').hidden") is False
    browser.press("g", "g")
    assert browser.evaluate("document.getElementById('graphs').hidden") is True


def test_graphs_of_balls_that_leave_hold_all_curves(tmp_path: Path) -> None:
    """One number that is none once made the range 0 to 1, and the curves of the others left the sheet."""
    run = billiard(50)
    run.velocity = 100 * run.velocity
    run.present = np.ones((50, 4), dtype=bool)
    run.present[20:, 3] = False
    run.position[20:, 3] = np.nan
    with Browser(size=(900, 640)) as browser:
        browser.open(write_html(run, tmp_path / "left.html").path)
        browser.evaluate("carom.graphs(true)")
        browser.evaluate(f"carom.setTime({10 * STEP})")
        coloured = """(share => {
            const canvas = [...document.querySelectorAll('#graphs canvas')].at(-1);
            const [left, right] = [58, canvas.clientWidth - 10];  // the margins of graph.ts
            const x = Math.round((left + share * (right - left)) * devicePixelRatio);
            const {data} = canvas.getContext('2d').getImageData(x, 0, 1, canvas.height);
            let found = 0;
            for (let i = 0; i < data.length; i += 4) {
              const c = [data[i], data[i + 1], data[i + 2]];
              found += data[i + 3] > 100 && Math.max(...c) - Math.min(...c) > 60;
            }
            return found;
        })"""
        assert browser.evaluate(f"{coloured}(0.35)") >= 3
        assert browser.evaluate(f"{coloured}(0.8)") >= 3
        assert not [said for said in browser.console if not said.startswith("warning")]


def test_keys_and_menu_switch_the_same_things(browser: Browser) -> None:
    for key, name in (("v", "velocities"), ("c", "contacts"), ("i", "impacts"), ("x", "through")):
        browser.press(key, key)
        assert browser.evaluate(f"carom.state().shown.{name}") is True
        browser.evaluate("carom.setTime(0.05)")
        assert browser.evaluate(f"document.getElementById('{name}').checked") is True
        browser.evaluate(f"document.getElementById('{name}').click()")
        assert browser.evaluate(f"carom.state().shown.{name}") is False
    for length in ("recent", "whole", "off"):
        browser.press("r", "r")
        assert browser.evaluate("carom.state().shown.trails") == length
    browser.press("m", "m")
    assert browser.evaluate("document.getElementById('show').hidden") is False
    browser.press("m", "m")
    assert browser.evaluate("document.getElementById('show').hidden") is True


def test_rod_and_spring_are_drawn(browser: Browser) -> None:
    at(browser, 0.0)
    bare = pixels(browser)
    now = at(browser, 0.0, "{links:true}")
    change = np.abs(pixels(browser) - bare).max(-1)
    (x0, y0), (x1, y1) = now["screen"][2:4]
    between = change[round(0.5 * (y0 + y1)), round(0.5 * (x0 + x1))]
    x, y = now["screen"][0]
    spring = change[round(y) - 6 : round(y) + 7, round(x) - 60 : round(x) - 12]
    assert max(between, change[round(y0) - 3 : round(y0) + 4, round(x0) - 3 : round(x0) + 4].max()) > 40
    assert spring.max() > 40


def test_balls_become_transparent(browser: Browser) -> None:
    now = at(browser, 0.0)
    x, y = map(round, now["screen"][1])
    solid = pixels(browser)[y - 3 : y + 4, x - 3 : x + 4].mean((0, 1))
    at(browser, 0.0, "{through:true}")
    faint = pixels(browser)[y - 3 : y + 4, x - 3 : x + 4].mean((0, 1))
    assert np.abs(solid - faint).max() > 30


def test_views_and_keys_of_the_camera(browser: Browser) -> None:
    browser.press("4", "4")
    browser.evaluate("carom.setTime(0)")
    eye = browser.evaluate("carom.state().eye")
    assert eye[1] == pytest.approx(0.635, abs=0.05)  # in the middle, beyond an end of the table
    assert not 0 < eye[0] < 2.54
    for key in ("a", "w", "e"):
        browser.press(key, key)
        browser.evaluate("carom.setTime(0)")
        moved = browser.evaluate("carom.state().eye")
        assert np.abs(np.subtract(moved, eye)).max() > 0.05
        eye = moved


def test_a_picture_is_the_view_twice_as_sharp(browser: Browser, page: Path) -> None:
    image = pytest.importorskip("PIL.Image", reason="needs pillow (comes with matplotlib)")
    at(browser, 0.1, "{impacts:true,velocities:true}")
    url = browser.evaluate("carom.picture()")
    picture = image.open(io.BytesIO(base64.b64decode(url.removeprefix("data:image/png;base64,"))))
    size = browser.evaluate(
        "[document.querySelector('#stage > canvas').clientWidth, document.querySelector('#stage > canvas').clientHeight]"
    )
    assert picture.size == (2 * size[0], 2 * size[1])
    seen = pixels(browser)[: size[1]]
    small = np.asarray(picture.convert("RGB").resize(size)).astype(int)
    # The same view (the list of impacts, the controls and the time differ).
    assert np.abs(small[300:480, 50:850] - seen[300:480, 50:850]).mean() < 4
    browser.press("p", "p")
    browser.evaluate("carom.setTime(0.1)")
    assert [u for u in browser.requests if not u.startswith(("blob:", "data:"))] == [page.resolve().as_uri()]
    assert [line for line in browser.console if not line.startswith("warning: [.WebGL")] == []


def test_fingers_turn_shift_and_select(page: Path) -> None:
    with Browser(size=(390, 780), touch=True) as browser:
        browser.open(page)
        x, y = browser.evaluate("carom.state().screen")[1]
        browser.fingers([(x, y)])
        assert browser.evaluate("carom.state().selected") == 1
        browser.evaluate("carom.select(-1)")
        eye = browser.evaluate("carom.setTime(0).then(() => carom.state().eye)")
        browser.fingers([(150, 400)], [(190, 400)], [(230, 400)])
        turned = browser.evaluate("carom.setTime(0).then(() => carom.state().eye)")
        assert np.abs(np.subtract(turned, eye)[:2]).max() > 0.1
        assert browser.evaluate("carom.state().selected") == -1  # a drag is no tap
        middle = np.array([1.27, 0.635, 0.0])
        browser.fingers([(150, 400), (240, 400)], [(120, 400), (270, 400)], [(90, 400), (300, 400)])
        near = browser.evaluate("carom.setTime(0).then(() => carom.state().eye)")
        assert np.linalg.norm(near - middle) < 0.9 * np.linalg.norm(turned - middle)
        browser.evaluate("carom.graphs(true), carom.show({velocities:true})")
        time.sleep(0.2)
        heights = browser.evaluate(
            "[...document.querySelectorAll('#graphs canvas')].map(e => e.clientHeight)"
        )
        assert min(heights) > 60
