"""What the page does for each picture while it plays: bounds on work, which hold on every machine, and none on time."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import Browser, find_browser
from carom.show.viewer import write_html

sys.path.insert(0, str(Path(__file__).parent.parent / "benches"))
import viewer

pytestmark = pytest.mark.skipif(
    find_browser() is None, reason="needs a Chromium (apt-get install chromium, or name one in CAROM_BROWSER)"
)

BALLS = 1000
FRAMES = 60
#: Of a ball: centre and radius, attitude, look and number, as 32-bit floats.
BALL_BYTES = 4 * (4 + 4 + 4 + 2)
#: Of an arrow or a bar: tail and radius, tip and kind, colour.
STICK_BYTES = 4 * (4 + 4 + 3)


@pytest.fixture(scope="module")
def playing(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    path = tmp_path_factory.mktemp("view") / "view.html"
    with viewer.watched(Browser(size=(800, 600))) as browser:
        browser.open(write_html(viewer.crowd(BALLS, FRAMES, contacts=3), path).path)
        browser.press("o", "o")  # again and again
        yield browser


def test_a_picture_of_a_crowd_is_a_few_draws_of_buffers_that_are_there(playing: Browser) -> None:
    playing.evaluate(f"carom.show({viewer.NOTHING})")
    cost = viewer.measure(playing, 30)
    assert cost.drawcalls <= 5  # backdrop, floor, shadows, balls
    assert cost.uploaded == BALLS * BALL_BYTES
    assert cost.created == 0
    # 62 bytes a ball, where lists of coordinates per ball once made 460.
    assert cost.garbage < 200 * BALLS


def test_arrows_and_force_chains_make_no_objects_either(playing: Browser) -> None:
    playing.evaluate(f"carom.show({viewer.ALL})")
    cost = viewer.measure(playing, 30)
    assert cost.drawcalls <= 7
    assert cost.uploaded <= BALLS * (BALL_BYTES + (1 + 3) * STICK_BYTES) + 20_000
    assert cost.created == 0
    # 52 bytes a ball, once 990.
    assert cost.garbage < 200 * BALLS
