"""`carom resume`."""

from __future__ import annotations

import signal
from typing import Annotated

from carom.cli.options import Json, Quiet, Run, option, overrides
from carom.cli.output import INTERRUPTED, guarded, note
from carom.cli.progress import progress_bar
from carom.cli.run import report


@guarded
def resume(
    run: Run,
    until: Annotated[
        str | None, option("--until", "TIME", "New end of the run: seconds, or with a unit.")
    ] = None,
    set_: Annotated[
        list[str] | None,
        option(
            "--set", "KEY=VALUE", "Change a numerical option of [run], such as tolerance; may be repeated."
        ),
    ] = None,
    checkpoint: Annotated[
        str,
        option(
            "--checkpoint",
            "newest|previous|start",
            "Checkpoint to continue from. If the newest cannot be used, take the previous one, or start anew.",
        ),
    ] = "newest",
    any_version: Annotated[
        bool, option("--any-version", "Accept a checkpoint of another version of Carom; bits may differ.")
    ] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> int:
    """Continue an interrupted run, or extend a finished one.

    A continued run has the same bits as an uninterrupted one. --until extends a finished run. --set lets a failed run
    go on from its last good state. New results go into a further segment.

    Example: carom resume runs/break-1 --until 6
    """
    from carom.result.directory import RunDir
    from carom.run.launch import relaunch
    from carom.run.restart import Wish
    from carom.run.sinks import Interrupt

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
    code = report(result, quiet=quiet, as_json=as_json)
    return INTERRUPTED if stop else code
