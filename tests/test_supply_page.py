"""The page of `carom view` in a real browser: every way out is tried, and none leads anywhere.

A server on this machine, of which the page knows, counts who comes. Without the policy all the same ways lead to it.
"""

from __future__ import annotations

import http.server
import re
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from browser import Browser, find_browser
from carom.show.viewer import write_html
from view_scenes import billiard

pytestmark = pytest.mark.skipif(
    find_browser() is None, reason="needs a Chromium (apt-get install chromium, or name one in CAROM_BROWSER)"
)

#: Tried from a timer of the page, so that the policy applies as to its own program. `HOST` is the server.
ATTEMPTS = {
    "fetch": "fetch('http://HOST/fetch', {mode: 'no-cors'})",
    "request": "(() => { const r = new XMLHttpRequest(); r.open('GET', 'http://HOST/request'); r.send() })()",
    "beacon": "navigator.sendBeacon('http://HOST/beacon', 'x')",
    "socket": "new WebSocket('ws://HOST/socket')",
    "events": "new EventSource('http://HOST/events')",
    "image": "new Image().src = 'http://HOST/image'",
    "script": "document.body.append(Object.assign(document.createElement('script'), {src: 'http://HOST/script'}))",
    "style": "document.head.append(Object.assign(document.createElement('link'),"
    " {rel: 'stylesheet', href: 'http://HOST/style'}))",
    "frame": "document.body.append(Object.assign(document.createElement('iframe'), {src: 'http://HOST/frame'}))",
    "font": "new FontFace('f', 'url(http://HOST/font)').load()",
    "sound": "new Audio('http://HOST/sound').load()",
    "import": "import('http://HOST/import')",
    "form": "(() => { const f = Object.assign(document.createElement('form'), {action: 'http://HOST/form', target: 'n'});"
    " document.body.append(f); f.submit() })()",
}
#: Text that would become program.
RUNS = {
    "eval": "eval('window.ran = 1')",
    "function": "new Function('window.ran = 1')()",
    "inline": "document.body.append(Object.assign(document.createElement('script'), {textContent: 'window.ran = 1'}))",
    "handler": "document.body.insertAdjacentHTML('beforeend', '<img src=data: onerror=\"window.ran = 1\">')",
    "timer": "setTimeout('window.ran = 1', 0)",
    "worker": "new Worker(URL.createObjectURL(new Blob(['postMessage(1)']))).onmessage = () => { window.ran = 1 }",
}


@pytest.fixture
def visits() -> Iterator[tuple[str, set[str]]]:
    """Address of a server, and the paths it was asked for."""
    seen: set[str] = set()

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            seen.add(self.path.strip("/"))
            self.send_response(204)
            self.end_headers()

        do_POST = do_GET

        def log_message(self, *_: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"127.0.0.1:{server.server_address[1]}", seen
        server.shutdown()


@dataclass
class Tried:
    """Directives of the policy that refused something, and the names of texts that were run."""

    refused: set[str]
    ran: set[str]


def attempt(page: Path, ways: dict[str, str]) -> Tried:
    """Every way, one after the other, in one page."""
    ran = set()
    with Browser(size=(120, 120)) as browser:
        browser.open(page)
        browser.evaluate(
            "window.refused = [], window.ran = 0,"
            " addEventListener('securitypolicyviolation', e => refused.push(e.effectiveDirective)), 0"
        )
        for name, code in ways.items():
            # A page that is refused something may throw at once or reject later; neither is the matter here.
            browser.evaluate(
                "window.ran = 0, new Promise(done => setTimeout(() => {"
                f" try {{ Promise.resolve({code}).catch(() => 0) }} catch {{}} setTimeout(done, 30) }}, 0))"
            )
            if browser.evaluate("ran"):
                ran.add(name)
        time.sleep(0.5)
        refused = set(browser.evaluate("refused"))
        assert browser.evaluate("carom.state().frame") >= 0, "the page still works"
    return Tried(refused, ran)


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_html(billiard(5), tmp_path_factory.mktemp("page") / "view.html").path


def test_no_way_leads_out_of_the_page_and_no_text_becomes_program(
    page: Path, visits: tuple[str, set[str]]
) -> None:
    host, seen = visits
    tried = attempt(page, {name: code.replace("HOST", host) for name, code in (ATTEMPTS | RUNS).items()})
    assert seen == set()
    assert tried.ran == set()
    # Each kind of way was refused by the policy, and did not merely fail.
    kinds = {"connect-src", "img-src", "script-src", "script-src-elem", "script-src-attr", "style-src-elem"}
    assert tried.refused >= kinds | {"form-action", "frame-src", "font-src", "media-src", "worker-src"}


@pytest.mark.long
def test_without_the_policy_the_same_ways_lead_out(
    page: Path, tmp_path: Path, visits: tuple[str, set[str]]
) -> None:
    """What the test above tries is real."""
    host, seen = visits
    text, count = re.subn(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", page.read_text("utf-8"))
    assert count == 1
    (tmp_path / "open.html").write_text(text, encoding="utf-8")
    ways = {name: code.replace("HOST", host) for name, code in (ATTEMPTS | RUNS).items()}
    tried = attempt(tmp_path / "open.html", ways)
    assert tried.refused == set()
    assert tried.ran >= {"eval", "function", "inline", "handler", "timer", "worker"}
    assert seen >= {"fetch", "request", "beacon", "socket", "image", "script", "style", "frame", "sound"}
