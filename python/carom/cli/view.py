"""`carom view`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from carom.cli.options import Json, Run, loaded, option
from carom.cli.output import emit, guarded


@guarded
def view(
    run: Run,
    out: Annotated[Path | None, option("-o", "--out", "FILE", "Output file. Default: RUN/view.html.")] = None,
    max_mb: Annotated[
        float, option("--max-mb", "MB", "Largest page; longer runs keep fewer frames.")
    ] = 100.0,
    live: Annotated[
        bool, option("--live", "Serve the run on this machine and follow it (needs the extra `live`).")
    ] = False,
    port: Annotated[int, option("--port", "N", "Port of --live.", min=1, max=65535)] = 8080,
    open_: Annotated[bool, option("--open", "Open the page in the web browser.")] = False,
    as_json: Json = False,
) -> None:
    """Write a run as one HTML page that plays in 3D, offline.

    With --live, show the run while it is computed, on this machine only.

    Example: carom view runs/break-1 --open
    """
    if live:
        from carom.show.viewer.live import serve

        serve(run, port, print)
        return
    result = loaded(run)
    info = result.view(out, open_browser=open_, max_mb=max_mb, title=result.title or None)
    if as_json:
        facts = {"frames": info.frames, "bodies": info.bodies, "bytes": info.bytes, "notes": list(info.notes)}
        emit({"file": str(info.path), **facts})
        return
    for remark in info.notes:
        print(f"note: {remark}")
    print(f"{info.path}  ({info.bytes / 1e6:.1f} MB, {info.frames} frames of {info.bodies} bodies)")
