"""`carom view`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from carom.cli.options import Force, Json, Run, loaded, option, refuse_existing
from carom.cli.output import emit, guarded
from carom.errors import counted


@guarded
def view(
    run: Run,
    out: Annotated[Path | None, option("-o", "--out", "FILE", "Output file. Default: RUN/view.html.")] = None,
    force: Force = False,
    max_mb: Annotated[
        float | None,
        option("--max-mb", "MB", "Largest page; longer runs keep fewer frames. Default: 100."),
    ] = None,
    live: Annotated[
        bool, option("--live", "Serve the run on this machine and follow it (needs the extra `live`).")
    ] = False,
    port: Annotated[
        int | None,
        option("--port", "N", "Port of --live. Default: 8080, or the next free one.", min=1, max=65535),
    ] = None,
    open_: Annotated[bool, option("--open", "Open the page in the web browser.")] = False,
    as_json: Json = False,
) -> None:
    """Write a run as one HTML page that plays in 3D, offline.

    With --live, show the run while it is computed, on this machine only.

    Example: carom view runs/break-1 --open
    """
    if live:
        of_pages = {
            "--out": out is not None,
            "--force": force,
            "--max-mb": max_mb is not None,
            "--open": open_,
            "--json": as_json,
        }
        if given := [name for name, is_given in of_pages.items() if is_given]:
            raise typer.BadParameter(f"{', '.join(given)}: --live writes no page; leave one of them out")
        from carom.show.viewer.live import serve

        serve(run, port, print)
        return
    if port is not None:
        raise typer.BadParameter("--port: a page has no port; add --live to serve the run")
    refuse_existing("--out", out, force)
    result = loaded(run)
    size = 100.0 if max_mb is None else max_mb
    info = result.view(out, open_browser=open_, title=result.title or None, max_mb=size)
    if as_json:
        facts = {"frames": info.frames, "bodies": info.bodies, "bytes": info.bytes, "notes": list(info.notes)}
        emit({"file": str(info.path), **facts})
        return
    for remark in info.notes:
        print(f"note: {remark}")
    print(
        f"{info.path}  ({info.bytes / 1e6:.1f} MB, {counted(info.frames, 'frame')} of {counted(info.bodies, 'ball')})"
    )
