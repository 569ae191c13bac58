"""A headless Chromium on a page of ours: for tests, and for pictures without a display.

It is spoken to over two pipes (the DevTools protocol, one JSON message each, ended by a zero byte), so
neither a port is opened nor a library needed. Chromium's own `--screenshot` waits for animations to end,
which on a page that draws in a loop is never.
"""

from __future__ import annotations

import base64
import contextlib
import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
_FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--remote-debugging-pipe",
)
# The browser reads descriptor 3 and writes 4: put ours there, out of each other's way, and become the browser.
_LAUNCH = """
import fcntl, os, sys
ends = [fcntl.fcntl(int(end), fcntl.F_DUPFD, 10) for end in sys.argv[1:3]]
for end, place in zip(ends, (3, 4)):
    os.dup2(end, place)
os.execv(sys.argv[3], sys.argv[3:])
"""


class BrowserError(RuntimeError):
    """The browser did not start, answer in time, or do as asked."""


def find_browser() -> str | None:
    """Path of a Chromium, or `None`; the variable CAROM_BROWSER names one that is not on PATH."""
    if not hasattr(os, "killpg"):  # Windows hands no pipes to the browser as it is started here
        return None
    named = os.environ.get("CAROM_BROWSER")
    return named or next((path for name in _NAMES if (path := shutil.which(name))), None)


class Browser:
    """One page in a fresh profile. `requests` and `console` gather what the page asked for and said."""

    def __init__(
        self,
        *,
        size: tuple[int, int] = (1280, 800),
        dark: bool = False,
        touch: bool = False,
        timeout: float = 60.0,
    ) -> None:
        program = find_browser()
        if program is None:
            raise BrowserError("no Chromium found; install one or name it in CAROM_BROWSER")
        self.timeout = timeout
        self.requests: list[str] = []
        self.console: list[str] = []
        self._last = 0
        self._pending = b""
        self._session: str | None = None
        self._profile = tempfile.TemporaryDirectory(prefix="carom-browser-", ignore_cleanup_errors=True)
        to_read, self._to = os.pipe()
        self._from, to_write = os.pipe()
        self._process = subprocess.Popen(
            [
                *(sys.executable, "-I", "-S", "-c", _LAUNCH, str(to_read), str(to_write), program, *_FLAGS),
                f"--user-data-dir={self._profile.name}",
                f"--window-size={size[0]},{size[1]}",
                "about:blank",
            ],
            pass_fds=(to_read, to_write),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        os.close(to_read)
        os.close(to_write)
        try:
            target = self._call("Target.createTarget", url="about:blank")["targetId"]
            self._session = self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
            for domain in ("Page", "Network", "Runtime", "Log"):
                self._call(f"{domain}.enable")
            self._call(
                "Emulation.setDeviceMetricsOverride",
                width=size[0],
                height=size[1],
                deviceScaleFactor=1,
                mobile=touch,
            )
            self._call("Emulation.setTouchEmulationEnabled", enabled=touch)
            self._call(
                "Emulation.setEmulatedMedia",
                features=[{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}],
            )
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def open(self, page: Path) -> None:
        """Open one of our pages from disk and wait until it shows its first picture."""
        self.visit(page.resolve().as_uri(), "carom")
        self.evaluate("carom.ready.then(() => carom.setTime(carom.state().start))")

    def visit(self, address: str, hook: str) -> None:
        """Open a page and wait until it is loaded and has the global `hook`."""
        self._call("Page.navigate", url=address)
        deadline = time.monotonic() + self.timeout
        while (
            self.evaluate("document.readyState") != "complete"
            or self.evaluate(f"typeof {hook}") == "undefined"
        ):
            if time.monotonic() > deadline:
                raise BrowserError(f"{address} did not load")
            time.sleep(0.05)

    def evaluate(self, script: str) -> Any:
        """The value of a JavaScript expression; a promise is waited for."""
        answer = self._call(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True, userGesture=True
        )
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            raise BrowserError(details.get("exception", {}).get("description") or details["text"])
        return answer["result"].get("value")

    def settle(self) -> None:
        """Waits until nothing is drawn any more: the camera glides to a view, slowly where pictures take long."""
        refresh = "await new Promise(requestAnimationFrame); "
        draws = f"(async () => {{ const n = carom.state().pictures; {2 * refresh}return carom.state().pictures !== n }})()"
        deadline = time.monotonic() + self.timeout
        while self.evaluate(draws):
            if time.monotonic() > deadline:
                raise BrowserError("the page goes on drawing")

    def picture(self, path: Path | None = None) -> bytes:
        """What the window shows, as PNG; also written to `path`."""
        data = base64.b64decode(self._call("Page.captureScreenshot", format="png")["data"])
        if path is not None:
            path.write_bytes(data)
        return data

    def press(self, key: str, text: str = "", *, shift: bool = False) -> None:
        """Press and release a key, named as in KeyboardEvent.key."""
        modifiers = 8 if shift else 0
        for kind in ("keyDown", "keyUp"):
            typed = text if kind == "keyDown" else ""
            self._call("Input.dispatchKeyEvent", type=kind, key=key, modifiers=modifiers, text=typed)

    def click(self, x: float, y: float) -> None:
        for kind in ("mousePressed", "mouseReleased"):
            self.mouse(kind, x, y)

    def mouse(
        self,
        kind: Literal["mousePressed", "mouseReleased", "mouseMoved", "mouseWheel"],
        x: float,
        y: float,
        **more: Any,
    ) -> None:
        self._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1, **more)

    def fingers(self, *moments: list[tuple[float, float]]) -> None:
        """Put fingers on the screen at the first of the moments, move them through the others and lift them."""
        for kind, points in zip(["touchStart"] + ["touchMove"] * (len(moments) - 1), moments, strict=True):
            touches = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(points)]
            self._call("Input.dispatchTouchEvent", type=kind, touchPoints=touches)
        self._call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def resize(self, width: int, height: int) -> None:
        self._call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )

    def close(self) -> None:
        """End the browser; its profile goes with it."""
        if self._process.poll() is None:
            try:
                self._session = None
                self._call("Browser.close", limit=5.0)
                self._process.wait(10)
            except (BrowserError, OSError, subprocess.TimeoutExpired):
                # Its own session, so this reaches the helpers it started and nobody else.
                os.killpg(self._process.pid, 9)
                self._process.wait(10)
        for descriptor in (self._to, self._from):
            with contextlib.suppress(OSError):
                os.close(descriptor)
        self._profile.cleanup()

    def _call(self, method: str, *, limit: float | None = None, **params: Any) -> Any:
        self._last += 1
        message: dict[str, Any] = {"id": self._last, "method": method, "params": params}
        if self._session is not None:
            message["sessionId"] = self._session
        try:
            os.write(self._to, json.dumps(message).encode() + b"\0")
        except BrokenPipeError:
            raise BrowserError(f"the browser ended before {method}") from None
        deadline = time.monotonic() + (limit or self.timeout)
        while True:
            answer = self._receive(deadline, method)
            if answer.get("id") == self._last:
                if "error" in answer:
                    raise BrowserError(f"{method}: {answer['error'].get('message')}")
                return answer["result"]
            self._note(answer)

    def _receive(self, deadline: float, method: str) -> dict[str, Any]:
        while b"\0" not in self._pending:
            ready, _, _ = select.select([self._from], [], [], max(0.0, deadline - time.monotonic()))
            if not ready:
                raise BrowserError(f"no answer to {method} in time")
            data = os.read(self._from, 1 << 20)
            if not data:
                raise BrowserError(f"the browser ended during {method}")
            self._pending += data
        message, _, self._pending = self._pending.partition(b"\0")
        decoded: dict[str, Any] = json.loads(message)
        return decoded

    def _note(self, event: dict[str, Any]) -> None:
        params = event.get("params", {})
        match event.get("method"):
            case "Network.requestWillBeSent":
                self.requests.append(params["request"]["url"])
            case "Runtime.consoleAPICalled":
                said = " ".join(str(a.get("value", a.get("description"))) for a in params["args"])
                self.console.append(f"{params['type']}: {said}")
            case "Log.entryAdded":
                self.console.append(f"{params['entry']['level']}: {params['entry']['text']}")
            case "Runtime.exceptionThrown":
                details = params["exceptionDetails"]
                self.console.append(
                    "error: " + str(details.get("exception", {}).get("description", details["text"]))
                )
