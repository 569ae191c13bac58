"""Pages of runs at any scale, with names of any length, in windows of any size."""

from __future__ import annotations

import itertools
import re
from pathlib import Path
from typing import Any

import carom
import pytest
from browser import Browser, find_browser
from carom import billiards
from carom.show.viewer import write_html
from carom.text import shortened

pytestmark = pytest.mark.skipif(
    find_browser() is None, reason="needs a Chromium (apt-get install chromium, or name one in CAROM_BROWSER)"
)

LONG = "a name that nobody would write but that a program may well have made, of ball number 17"


def rolling(size: float) -> carom.Result:
    """Two balls of a radius (m), which fall as far in times that go with the root of it."""
    end = (size / 9.8) ** 0.5
    scene = carom.Scene("scale", gravity=(0, 0, -9.8), run={"until": 6 * end, "step": 0.01 * end})
    scene.contact("m", "m", friction=0.3, restitution=0.5)
    scene.plane("floor", material="m", point=(0, 0, 0), normal=(0, 0, 1))
    for k, name in enumerate((LONG, "b")):
        scene.sphere(name, radius=size, density=2500, at=(3 * k * size, 0, 2 * size), material="m")
    return carom.simulate(scene)


def text(browser: Browser, element: str) -> str:
    return str(browser.evaluate(f"document.getElementById('{element}').innerText"))


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e4])
def test_numbers_have_digits_at_any_scale(size: float, tmp_path: Path) -> None:
    """Energies of grains of a micron were 0.000000 J, those of boulders had twenty digits."""
    result = rolling(size)
    with Browser(size=(1280, 720)) as browser:
        browser.open(write_html(result, tmp_path / "view.html").path)
        browser.evaluate("carom.graphs(true), carom.show({contacts:true, velocities:true}), carom.select(1)")
        frame = len(result.time) // 2
        browser.evaluate(f"carom.setTime({float(result.time[frame]) * (1 + 1e-12)})")
        graphs, key, card = (
            text(browser, element).replace("−", "-") for element in ("graphs", "key", "card")
        )

        def number(words: str, before: str) -> tuple[str, float]:
            found = re.search(rf"{before}\s+(-?[\d.]+(?:e-?\d+)?)", words)
            assert found, words
            return found[1], float(found[1])

        energy = result.energy
        k = int(abs(energy.time - result.time[frame]).argmin())
        written, kinetic = number(graphs, "kinetic")
        assert kinetic == pytest.approx(energy.kinetic[k], rel=0.01, abs=0.002 * energy.total[0])
        assert 3 <= len(written) <= 9
        speed = max(abs(result.velocity[frame, n]).max() for n in (0, 1))
        assert number(key, "velocity, longest")[1] == pytest.approx(speed, rel=0.005)
        assert number(card, r"z")[1] == pytest.approx(result.position[frame, 1, 2], rel=0.02)
        for cell in browser.evaluate(
            "[...document.querySelectorAll('.triple span')].map(e => e.scrollWidth - e.clientWidth)"
        ):
            assert cell <= 0  # none is cut


def test_the_card_shows_small_motion_far_places_and_slow_spins(tmp_path: Path) -> None:
    """A large ball stayed at 0 with 0.00 turns a second; 1e5 m from the origin all were at one place, and at height 0."""
    scene = carom.Scene(gravity=(0, 0, 0), run={"until": 600, "step": 1})
    scene.sphere(
        "slow",
        radius=50,
        density=1,
        at=(0, 0, 0),
        velocity=(1e-3, 0, 0),
        angular_velocity=(0, 0, 0.02),
        material="m",
    )
    slow = carom.simulate(scene)
    scene = carom.Scene(gravity=(0, 0, 0), run={"until": 0.1, "step": 0.01})
    scene.contact("m", "m", friction=0.3, restitution=0.5)
    for k in range(3):
        scene.sphere(f"far{k}", radius=0.02, density=1, at=(1e5 + 0.05 * k, -2e5, 0.1), material="m")
    scene.sphere("tiny", radius=1e-4, density=1, at=(1e5, -2e5, 0.2), velocity=(0, 0, 0.1), material="m")
    for result, body, time, cells in (
        (slow, "slow", 300, ["0.300", "0", "0"]),
        (carom.simulate(scene), "far1", 0.1, ["100000.050000", "−200000.000000", "0.100000"]),
    ):
        with Browser(size=(1280, 720)) as browser:
            browser.open(write_html(result, tmp_path / "view.html").path)
            browser.evaluate(f"carom.select('{body}'), carom.graphs(true), carom.setTime({time})")
            written = browser.evaluate("[...document.querySelectorAll('.triple b')].map(e => e.textContent)")
            assert written[:3] == cells
            assert body != "slow" or "0.00318 turns a second" in text(browser, "card")
            if body == "far1":  # and the smallest ball is as exact as the page says
                place = browser.evaluate("carom.state().positions[3]")
                assert place == pytest.approx(result.position[-1, 3], rel=0, abs=1e-9 + 4e-11)


def boxes(browser: Browser, *elements: str) -> list[Any]:
    return [
        browser.evaluate(
            f"(({{left, top, right, bottom}}) => [left, top, right, bottom])"
            f"(document.querySelector('{element}').getBoundingClientRect())"
        )
        for element in elements
    ]


@pytest.mark.parametrize("size", [(900, 420), (1280, 800), (640, 360), (420, 800)])
def test_all_in_view_is_clear_of_the_title(size: tuple[int, int], tmp_path: Path) -> None:
    """In low windows title and list of impacts lay over a pocket."""
    table = billiards.table("9ft")
    scene = table.scene("A nine-ball break on a pocket table", until=0.1)
    billiards.strike(table.cue_ball(scene, at=(0.1, 0.5)), speed=2.0, direction="180 deg")
    with Browser(size=size) as browser:
        browser.open(write_html(carom.simulate(scene), tmp_path / "view.html").path)
        browser.evaluate("carom.setTime(0)")
        _, _, right, bottom = boxes(browser, "header")[0]
        across, down, most_across, most_down = boxes(browser, "#stage")[0]
        for pocket in table.pockets.values():
            x, y = browser.evaluate(f"carom.project([{pocket[0]}, {pocket[1]}, {table.spec.nose_height}])")
            assert across < x < most_across
            assert down < y < most_down
            assert x > right or y > bottom


@pytest.mark.parametrize("size", [(1280, 720), (390, 800)])
def test_nothing_lies_over_the_key_or_the_list(size: tuple[int, int], tmp_path: Path) -> None:
    """The key ran under the list of bodies, and on telephones the choice of the graph was squeezed to its arrow."""
    run = rolling(0.01)
    with Browser(size=size) as browser:
        browser.open(write_html(run, tmp_path / "view.html").path)
        browser.evaluate("carom.graphs(true), carom.show({contacts:true, velocities:true, impacts:true})")
        browser.evaluate("carom.select(0)")
        browser.evaluate(f"carom.setTime({float(run.time[-1])})")
        panel, key, head, choice = boxes(browser, "#panel", "#key", "header", "#graphs select")
        browser.evaluate("document.getElementById('what').click()")
        menu = boxes(browser, "#show", "#panel", "header", "#key")
        browser.evaluate("document.getElementById('what').click()")
        assert head[2] <= size[0]
        for shown in ((panel, key, head), menu):
            for one, other in itertools.combinations([box for box in shown if box[2] > box[0]], 2):
                beside = one[2] <= other[0] or other[2] <= one[0]
                assert beside or one[3] <= other[1] or other[3] <= one[1]
        assert choice[2] - choice[0] > 60
        [label] = [row for row in text(browser, "list").split("\n") if "…" in row]
        assert label == shortened(LONG, 24)
        assert LONG in text(browser, "card")
        assert shortened(LONG) in text(browser, "labels")
