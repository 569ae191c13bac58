"""`carom play`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from carom.cli.options import option
from carom.cli.output import guarded
from carom.errors import CaromError


@guarded
def play(
    scenario: Annotated[
        Path | None,
        typer.Argument(
            metavar="SCENARIO", help="Scenario on a table of the billiards kit.", show_default=False
        ),
    ] = None,
    table: Annotated[
        str | None, option("--table", "NAME", "Table: 7ft, 8ft, 9ft (the default), snooker or carom.")
    ] = None,
    rack: Annotated[
        str | None,
        option("--rack", "GAME", "Balls: 8-ball, 9-ball (the default), 10-ball or three (for practice)."),
    ] = None,
    seed: Annotated[
        int | None, option("--seed", "N", "Which rack, by default 1: gaps and order are drawn by it.", min=0)
    ] = None,
    port: Annotated[int, option("--port", "N", "Port on this machine.", min=1, max=65535)] = 8090,
    open_: Annotated[bool, option("--open", "Open the page in the web browser.")] = False,
) -> None:
    """Play billiards in the browser, each shot without a step.

    The page is for this machine only. Ctrl-C ends the game.

    Example: carom play --rack 9-ball --open
    """
    from carom.play.game import Game, set_up
    from carom.play.server import Server
    from carom.scene.scene import Scene

    chosen = [
        f"--{name}" for name, value in (("table", table), ("rack", rack), ("seed", seed)) if value is not None
    ]
    if scenario is not None and chosen:
        given = " and ".join(chosen)
        raise CaromError(f"play: {scenario} has its own table and balls; leave out {given}, or the scenario")
    if scenario is None:
        scene = set_up(table or "9ft", rack or "9-ball", 1 if seed is None else seed)
    else:
        scene = Scene.from_toml(scenario)
    with Server(Game(scene), port=port) as server:
        print(f"{server.url}  (this machine only; Ctrl-C ends it)", flush=True)
        if open_:
            import webbrowser

            webbrowser.open(server.url)
        try:
            server.wait()
        except KeyboardInterrupt:
            return
