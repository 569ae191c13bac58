"""Write `docs/table9.png`, a nine-ball break on a table of the billiards kit: python tools/table_picture.py

It is the picture that the page of the run shows, with the ways of the balls, drawn by a headless Chromium. Run it after a
change of the viewer, of the kit or of the example `nine_ball_break`.
"""

from __future__ import annotations

import base64
import io
import sys
import tempfile
import time
from pathlib import Path

import carom
from carom.show.viewer import write_html
from PIL import Image

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from browser import Browser

FILE = Path(__file__).parents[1] / "docs" / "table9.png"
WINDOW = (1200, 640)
"""The page with its bar, px."""
MOMENT = 2.2
"""When the balls have spread over the table, s."""
WIDTH = 1000
"""Of the picture, px."""


def drawn(page: Path) -> Image.Image:
    """The page's own picture at the moment, twice as sharp as the window."""
    with Browser(size=WINDOW) as browser:
        browser.open(page)
        browser.evaluate("carom.show({impacts: false, trails: 'whole'})")
        browser.evaluate(f"carom.setTime({MOMENT})")
        time.sleep(1.0)
        data = browser.evaluate("carom.picture()")
    return Image.open(io.BytesIO(base64.b64decode(data.partition(",")[2]))).convert("RGB")


def main() -> None:
    result = carom.simulate(carom.example("nine_ball_break"))
    with tempfile.TemporaryDirectory() as folder:
        page = write_html(result, Path(folder) / "break.html").path
        picture = drawn(page)
    small = picture.resize((WIDTH, round(WIDTH * picture.height / picture.width)), Image.Resampling.LANCZOS)
    small.save(FILE, optimize=True)
    print(f"{FILE}: {small.width} x {small.height} px, {FILE.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
