"""What a picture of the viewer costs its page while it plays: 1000 balls x 1000 frames, and 20 000.

    python benches/viewer.py [--pictures 120] [--csv FILE]

Rasterising is the graphics card's; a machine without one does it in software and tells nothing of others. So draw calls are
not passed on (`--drawn`: they are), and all else is measured as it is: sampling, sorting, filling buffers, three.js,
uploads, DOM. Time of a picture: of the page's callback for it, by `performance.now()`, which Chromium rounds to 0.1 ms.
Garbage: bytes allocated for JavaScript objects, by V8's sampling profiler. 60 pictures a second leave 16.7 ms.
"""

from __future__ import annotations

import argparse
import csv
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from carom.show.viewer import write_html

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from browser import Browser, find_browser
from view_scenes import Shown, Table

AIM_MS = 8.0
RADIUS, RATE, SPIN = 0.01, 3.0, 10.0  # m, rad/s, rad/s
#: What the reader may have switched on besides balls and walls.
NOTHING = "{trails:'off',velocities:false,contacts:false}"
ALL = "{trails:'whole',velocities:true,contacts:true}"

# Runs before anything of the page; `probe.pictures(n)` waits for n pictures and says what they took.
PROBE = """
window.probe = (() => {
  let left = 0, done, found;
  const ask = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (picture) => ask((now) => {
    const before = performance.now();
    picture(now);
    if (left === 0) return;
    found.ms.push(performance.now() - before);
    if (--left === 0) done(found);
  });
  const gl = WebGL2RenderingContext.prototype;
  const watch = (name, note, passed = true) => {
    const real = gl[name];
    gl[name] = function (...given) {
      if (left > 0) note(given);
      if (passed) return real.apply(this, given);
    };
  };
  for (const name of ["drawArrays", "drawElements", "drawArraysInstanced", "drawElementsInstanced"])
    watch(name, () => found.drawcalls++, DRAWN);
  watch("bufferSubData", ([, , data, , length]) =>
    (found.uploaded += length ? length * data.BYTES_PER_ELEMENT : data.byteLength));
  watch("bufferData", ([, data]) => (found.uploaded += data.byteLength ?? data));
  for (const name of ["createBuffer", "createTexture", "createProgram", "createVertexArray"])
    watch(name, () => found.created++);
  const make = document.createElement.bind(document);
  document.createElement = (...given) => (left > 0 && found.created++, make(...given));
  const pictures = (count) => new Promise((resolve) => {
    [found, done, left] = [{ ms: [], drawcalls: 0, uploaded: 0, created: 0 }, resolve, count];
  });
  return { pictures };
})();
"""


@dataclass(frozen=True)
class Cost:
    """Of one picture, on the average; `slow` is the time that 95 of 100 pictures stay below."""

    ms: float
    slow: float
    garbage: float
    """Bytes of JavaScript objects."""
    drawcalls: float
    uploaded: float
    """Bytes to the graphics card."""
    created: float
    """Objects of the graphics card and elements of the page."""


def crowd(balls: int, frames: int, contacts: int = 0) -> Any:
    """Balls that circle and turn above a floor, each about an axis of its own; so many contacts per ball, made up."""
    rng = np.random.default_rng(balls)
    side = int(np.ceil(balls ** (1 / 3)))
    phase = rng.uniform(0, 2 * np.pi, balls)
    axis = rng.normal(size=(balls, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    centre = 2.5 * RADIUS * np.stack(np.unravel_index(np.arange(balls), (side, side, side)), -1)
    time = 0.01 * np.arange(frames)
    position, velocity = np.empty((2, frames, balls, 3), np.float32)
    orientation = np.empty((frames, balls, 4), np.float32)
    for row, t in enumerate(time):
        angle = RATE * t + phase
        way = np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1)
        position[row] = centre + RADIUS * (way + np.array([0, 0, 1]))
        velocity[row] = RADIUS * RATE * np.stack([-way[:, 1], way[:, 0], 0 * angle], -1)
        orientation[row, :, 0] = np.cos(0.5 * SPIN * t)
        orientation[row, :, 1:] = np.sin(0.5 * SPIN * t) * axis
    run = Shown(
        time=time,
        position=position,
        orientation=orientation,
        velocity=velocity,
        angular_velocity=np.broadcast_to(SPIN * axis, position.shape),
        names=[f"grain{n}" for n in range(balls)],
        bodies={"radius": np.full(balls, RADIUS)},
        planes={"name": ["floor"], "point": [[0, 0, 0]], "normal": [[0, 0, 1]]},
        gravity=np.array([0.0, 0.0, -9.8]),
    )
    if contacts:
        first, each = np.tile(np.arange(balls), contacts), contacts * balls
        run.contacts = Table(
            body=np.tile(np.stack([first, (first + 1) % balls], 1), (frames - 1, 1)),
            status=np.tile(1 + first % 2, frames - 1),
            normal=np.tile([1.0, 0.0, 0.0], (each * (frames - 1), 1)),
            impulse=np.tile(rng.exponential(size=(each, 1)) * [1.0, 0.2, 0.0], (frames - 1, 1)),
        )
        run.contacts.ends = each * np.arange(frames)
    return run


def measure(browser: Browser, pictures: int) -> Cost:
    """Of the page that is open, while it plays; the browser was prepared by `watched`."""
    browser.evaluate("carom.setTime(carom.state().start), carom.play(), probe.pictures(60)")  # let V8 compile
    browser._call("HeapProfiler.enable")
    browser._call(
        "HeapProfiler.startSampling",
        samplingInterval=4096,
        includeObjectsCollectedByMajorGC=True,
        includeObjectsCollectedByMinorGC=True,
    )
    browser.evaluate(f"probe.pictures({pictures})")
    garbage = _allocated(browser._call("HeapProfiler.stopSampling")["profile"]["head"])
    found = browser.evaluate(f"probe.pictures({pictures})")  # times without the profiler
    assert browser.evaluate("carom.state().playing"), "the run ended before all pictures were drawn"
    browser.evaluate("carom.play(false)")
    times = np.array(found["ms"])
    return Cost(
        ms=float(times.mean()),
        slow=float(np.quantile(times, 0.95)),
        garbage=garbage / pictures,
        drawcalls=found["drawcalls"] / pictures,
        uploaded=found["uploaded"] / pictures,
        created=found["created"] / pictures,
    )


def _allocated(node: dict[str, Any]) -> float:
    return float(node["selfSize"]) + sum(_allocated(child) for child in node["children"])


def watched(browser: Browser, *, drawn: bool = False) -> Browser:
    """Lets pages opened from now on count what each picture does; draw calls are counted and, unless `drawn`, left out."""
    browser._call("Page.addScriptToEvaluateOnNewDocument", source=PROBE.replace("DRAWN", str(drawn).lower()))
    return browser


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--pictures", type=int, default=120, help="pictures to take the average of")
    parser.add_argument("--drawn", action="store_true", help="pass draw calls on")
    parser.add_argument("--csv", type=Path, help="write the figures to this file too")
    parser.add_argument("--quick", action="store_true", help="1000 balls alone")
    given = parser.parse_args()
    if find_browser() is None:
        print("viewer: no Chromium found; install one or name it in CAROM_BROWSER")
        return
    rows = []
    print(" balls frames shown        ms   95 % garbage kB draw calls to GPU kB created")
    for balls, frames, contacts in [(1000, 1000, 3), (20_000, 600, 0)][: 1 if given.quick else 2]:
        with (
            tempfile.TemporaryDirectory() as folder,
            watched(Browser(size=(1280, 800), timeout=300.0), drawn=given.drawn) as browser,
        ):
            info = write_html(crowd(balls, frames, contacts), Path(folder) / "view.html")
            browser.open(info.path)
            browser.press("o", "o")  # again and again
            for name, shown in (("balls", NOTHING), ("all", ALL)):
                browser.evaluate(f"carom.show({shown}), carom.graphs({str(shown == ALL).lower()})")
                cost = measure(browser, given.pictures)
                rows.append({"balls": balls, "frames": info.frames, "shown": name, **asdict(cost)})
                print(
                    f"{balls:6d} {info.frames:6d} {name:8s} {cost.ms:6.2f} {cost.slow:6.2f} {cost.garbage / 1e3:10.1f}"
                    f" {cost.drawcalls:10.1f} {cost.uploaded / 1e3:9.1f} {cost.created:7.1f}",
                    flush=True,
                )
    print(f"aim: {AIM_MS} ms for 1000 balls")
    if given.csv:
        with open(given.csv, "w", newline="") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
