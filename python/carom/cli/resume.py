"""`carom resume`."""

from __future__ import annotations

import signal
from typing import Annotated

import typer

from carom.cli.options import Json, Quiet, Run, overrides
from carom.cli.output import guarded, note
from carom.cli.progress import progress_bar
from carom.cli.run import report


@guarded
def resume(
    run: Run,
    until: Annotated[
        str | None,
        typer.Option("--until", metavar="TIME", help="Simulate on to this time, s or with a unit."),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Go on with another numerical option of [run], as tolerance; may be repeated.",
        ),
    ] = None,
    checkpoint: Annotated[
        str,
        typer.Option(
            "--checkpoint",
            metavar="newest|previous|start",
            help="Continue from the one before the newest, or compute the run anew, if the newest cannot be used.",
        ),
    ] = "newest",
    any_version: Annotated[
        bool,
        typer.Option("--any-version", help="Take a checkpoint of another version of Carom; bits may differ."),
    ] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> int:
    """Continue a run that was interrupted or killed, bit for bit as if nothing had happened.

    With --until a finished run is extended; with --set a run that failed goes on from its last good state. What
    is new goes into a further segment of the results.

    Example: carom resume runs/break-1 --until 6
    """
    from carom.drive import Interrupt
    from carom.restart import Wish
    from carom.run import relaunch
    from carom.rundir import RunDir

    options, places = overrides(set_, until)
    stop = Interrupt()
    with stop.listening(signal.SIGINT, signal.SIGTERM), progress_bar(not (quiet or as_json)) as bar:
        result = relaunch(
            RunDir.open(run),
            options,
            places=places,
            stop=stop,
            progress=bar,
            wish=Wish(checkpoint, any_version, tell=note),
        )
    return report(result, quiet=quiet, as_json=as_json)
