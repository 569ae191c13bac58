"""The server of `carom play`: the loopback address alone, for who knows its address (`carom.show.viewer.gate`).

The page asks for JSON: `state`, and by POST `aim`, `shoot`, `place`, `undo`, `save`. `table` is the viewer's page of the
last shot. Requests are answered one after the other. Several pages may show one game: a POST names the `state` that its
page shows, by the number in the answers, and is refused where the table has another one by now.
"""

from __future__ import annotations

import json
import secrets
import sys
import tempfile
import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from pathlib import Path
from typing import Any, Self, TypeVar

from carom.errors import CaromError, quoted
from carom.play.game import Aim, Game
from carom.show.viewer.gate import NAMES, admitted, unusable

T = TypeVar("T")
HOST = NAMES[0]
PORT = 8090
MOST_BYTES = 10_000
"""Of a request; strokes and places are a few hundred."""
PAGE = {
    "/": ("play.html", "text/html"),
    "/play.js": ("play.js", "text/javascript"),
    "/play.css": ("play.css", "text/css"),
}
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src data:; connect-src 'self'; frame-src 'self';"
    " frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
TABLE_POLICY = "frame-ancestors 'self'"
"""All else the viewer's page says of itself."""


class Stale(CaromError):
    """A page asked for something on a table that no longer is as it shows."""


class _Http(ThreadingHTTPServer):
    def handle_error(self, request: Any, client_address: Any) -> None:
        """A page that is left or loaded anew breaks off what it had asked for: no error of ours."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)


def _read(body: bytes) -> Any:
    """What a request asks for."""
    cure = 'send one value, as {"speed": 2.0}'
    try:
        return json.loads(body)
    except json.JSONDecodeError as error:
        raise CaromError(
            f"play: the request is no JSON from its character {error.pos + 1} on; {cure}"
        ) from None
    except UnicodeDecodeError as error:
        raise CaromError(
            f"play: the request is no UTF-8 from its byte {error.start + 1} on; {cure}"
        ) from None
    except RecursionError:
        raise CaromError(f"play: the request is nested too deeply; {cure}") from None
    except ValueError:  # Python reads no integer of thousands of digits
        raise CaromError("play: the request has a number of too many digits; write one below 1e308") from None


class Server:
    """Serves a game until `stop`, or the end of a `with` block; `url` is where to play."""

    def __init__(self, game: Game, *, port: int = PORT) -> None:
        self.game = game
        self.words = "Drag on the table to aim."
        self._token = secrets.token_urlsafe(16)
        self._lock = threading.Lock()
        try:
            self._http = _Http((HOST, port), self._handler())
        except (OSError, OverflowError) as error:
            raise unusable(port, error) from error
        self._thread = threading.Thread(target=self._http.serve_forever, name="carom-play", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Where to play. Who does not know it gets no answer."""
        return f"http://{HOST}:{self._http.server_port}/{self._token}/"

    def stop(self) -> None:
        """End the server."""
        self._http.shutdown()
        self._http.server_close()
        self._thread.join(5.0)

    def wait(self) -> None:
        """Until `stop` is called, or the program interrupted."""
        while self._thread.is_alive():
            self._thread.join(1.0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    # --- answers --------------------------------------------------------------------------------------------------

    def state(self, **more: Any) -> dict[str, Any]:
        """What the page knows of the table."""
        game = self.game
        return {
            "state": game.changes,
            "balls": {ball.name: ball.position[:2] for ball in game.scene.spheres},
            "radius": game.ball("cue").radius,
            "shots": game.shots,
            "undo": game.can_undo,
            "words": self.words,
            "still": game.last is None,
            "back": game.last is not None and game.last.shot.scratch,
            **more,
        }

    def answer(self, path: str, given: Any) -> dict[str, Any] | None:
        """The answer to a POST as JSON; None where there is no such request."""
        found: Callable[[Any], dict[str, Any]] | None = {
            "/aim": self._aim,
            "/shoot": self._shoot,
            "/place": self._place,
            "/undo": self._undo,
            "/save": self._save,
        }.get(path)
        if found is None:
            return None
        if isinstance(given, dict) and "state" in given:
            if given["state"] != self.game.changes:
                raise Stale("The table was changed by another page: it is shown anew.")
            given = {name: value for name, value in given.items() if name != "state"}
        return found(given)

    def _aim(self, given: Any) -> dict[str, Any]:
        return self.game.sight(Aim.of(given))

    def _shoot(self, given: Any) -> dict[str, Any]:
        self.words = self.game.shoot(Aim.of(given)).words
        return self.state()

    def _place(self, given: Any) -> dict[str, Any]:
        if not isinstance(given, dict) or given.keys() != {"ball", "x", "y"}:
            raise CaromError(f"play: a place has ball, x and y, found {quoted(given)}")
        self.game.place(str(given["ball"]), (given["x"], given["y"]))
        self.words = f"{given['ball']} is moved."
        return self.state()

    def _undo(self, _: Any) -> dict[str, Any]:
        aim = self.game.undo()
        self.words = "Back to before the shot." if aim else "The ball is back."
        return self.state(aim=vars(aim) if aim else None)

    def _save(self, given: Any) -> dict[str, Any]:
        game = self.game
        number = game.shots + (game.last is None)
        return {"name": f"shot-{number}.toml", "text": game.saved(Aim.of(given))}

    def table(self) -> bytes:
        """The viewer's page of what there is to see."""
        with tempfile.TemporaryDirectory(prefix="carom-play-") as folder:
            path = Path(folder) / "view.html"
            self.game.shown().view(path, title=self.game.scene.title)
            return path.read_bytes()

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        server = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"
            timeout = 60
            wbufsize = -1  # one packet an answer: a second one would wait for the receipt of the first

            def do_GET(self) -> None:
                if (path := self._admitted()) is None:
                    return
                if path in PAGE:
                    name, kind = PAGE[path]
                    self._send(200, (files("carom.play") / "assets" / name).read_bytes(), kind, POLICY)
                elif path == "/table":
                    if page := self._found(server.table):
                        self._send(200, page, "text/html", TABLE_POLICY)
                elif path == "/state":
                    if state := self._found(server.state):
                        self._json(200, state)
                else:
                    self._json(404, {"error": "there is no such page"})

            def do_POST(self) -> None:
                if (path := self._admitted()) is None:
                    return
                size = self.headers.get("Content-Length", "")
                if not size.isdecimal() or len(size) > len(str(MOST_BYTES)) or int(size) > MOST_BYTES:
                    self.close_connection = True
                    self._json(413, {"error": f"a request has at most {MOST_BYTES} bytes, and says how many"})
                    return
                body = self.rfile.read(int(size))
                none = {"error": "there is no such request"}
                if found := self._found(lambda: server.answer(path, _read(body)) or none):
                    self._json(200 if found is not none else 404, found)

            def _found(self, ask: Callable[[], T]) -> T | None:
                """What the game answers, or None after saying what is in the way."""
                try:
                    with server._lock:
                        return ask()
                except Stale as error:
                    self._json(409, {"error": str(error)})
                except (CaromError, ValueError, RecursionError, OSError, MemoryError) as error:
                    self._json(400, {"error": str(error)})
                return None

            def _admitted(self) -> str | None:
                """The path behind the token, or None after a refusal."""
                hosts, origins = (self.headers.get_all(name, []) for name in ("Host", "Origin"))
                path = admitted(server._token, server._http.server_port, hosts, origins, self.path)
                if path is None:
                    self.close_connection = True  # a body may follow that nobody reads
                    self._json(403, {"error": "open the address that `carom play` printed"})
                return path

            def _json(self, status: int, value: dict[str, Any]) -> None:
                self._send(status, json.dumps(value).encode(), "application/json", POLICY)

            def _send(self, status: int, body: bytes, kind: str, policy: str) -> None:
                self.send_response(status)
                self.send_header("Content-Type", f"{kind}; charset=utf-8")
                self.send_header("Content-Length", str(len(body)))
                self.send_header("Content-Security-Policy", policy)
                self.send_header("Cache-Control", "no-store")
                self.send_header("Referrer-Policy", "no-referrer")
                self.send_header("X-Content-Type-Options", "nosniff")
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, *_: Any) -> None:
                """Quiet: the terminal is the player's."""

        return Handler
