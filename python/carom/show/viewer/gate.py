"""Who may talk to a server of ours (the live view, `carom play`): anybody who knows its address.

A server on the loopback address is open to every page that the browser shows. A foreign page can open a WebSocket to it,
and, by a name that it lets point here (DNS rebinding), read its pages. Thus each request must name this machine as host,
come from a page of this server if it says where it comes from, and have the token of the address as first part of its path.
"""

from __future__ import annotations

import hmac
import socket  # noqa: TID251 the loopback address alone
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any

from carom.errors import CaromError

NAMES = ("127.0.0.1", "localhost")


def unusable(port: int, error: Exception) -> CaromError:
    """What is said of a port that no server can have."""
    cause = str(error).partition(" (while")[0]
    return CaromError(f"port {port} cannot be used ({cause}); give another with --port (port=)")


def refuse_taken(port: int) -> None:
    """Raise where no server of this machine can have this port; 0 is any that is free."""
    try:
        socket.create_server((NAMES[0], port)).close()
    except (OSError, OverflowError) as error:
        raise unusable(port, error) from error


@contextmanager
def gated(token: str) -> Iterator[None]:
    """Within it a server of viser is made that answers by these rules: viser has no place for rules of others."""
    import websockets.asyncio.server as library

    server: Any = library
    original, used = server.serve, []

    def serve(*args: Any, process_request: Any = None, **options: Any) -> Any:
        used.append(True)
        return original(*args, process_request=partial(_judged, token, process_request), **options)

    server.serve = serve
    try:
        yield
    finally:
        server.serve = original
    if not used:
        raise CaromError("this version of viser serves in a way that Carom cannot guard; install viser 1.1")


def _judged(token: str, answer: Callable[[Any, Any], Any], connection: Any, request: Any) -> Any:
    """What is answered to a request: None to open a WebSocket."""
    hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
    rest = admitted(token, connection.local_address[1], hosts, origins, request.path)
    if rest is None:
        return connection.respond(403, "Forbidden: open the address that `carom view --live` printed.\n")
    return answer(connection, replace(request, path=rest))


def admitted(token: str, port: int, hosts: Sequence[str], origins: Sequence[str], path: str) -> str | None:
    """The path behind the token, where a request to this port may be answered; its `Host` and `Origin` lines are given."""
    here = [f"{name}:{port}" for name in NAMES]
    known = len(hosts) == 1 and hosts[0] in here
    own = all(origin.removeprefix("http://") in here for origin in origins)
    given, _, rest = path.lstrip("/").partition("?")[0].partition("/")
    good = known and own and hmac.compare_digest(given.encode(), token.encode())
    return f"/{rest}" if good else None
