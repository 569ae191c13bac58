"""`carom export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from carom.cli.options import Json, Run, listed, loaded, option, time
from carom.cli.output import files, guarded, note
from carom.errors import CaromError


@guarded
def export(
    run: Run,
    format_: Annotated[
        str,
        option(
            "--format",
            "FORMAT",
            "Formats: vtkhdf, vtp (ParaView), csv, parquet (tables), extxyz, gsd (OVITO), mp4, gif, png (films,"
            " pictures); several with commas.",
        ),
    ] = "vtkhdf",
    out: Annotated[
        Path | None, option("-o", "--out", "DIR", "Output directory. Default: RUN/export.")
    ] = None,
    every: Annotated[int, option("--every", "K", "Export every K-th recorded frame.", min=1)] = 1,
    start: Annotated[str | None, option("--from", "TIME", "Start at this time, s or with a unit.")] = None,
    stop: Annotated[str | None, option("--to", "TIME", "Stop at this time, s or with a unit.")] = None,
    contacts: Annotated[
        bool, option("--contacts/--no-contacts", "Also export contacts and their forces.")
    ] = True,
    at: Annotated[
        str | None, option("--at", "TIME", "png: one picture at this time, s or with a unit.")
    ] = None,
    speed: Annotated[
        float | None,
        option("--speed", "X", "Films: simulated seconds per second. Default: 1, or what suits the run."),
    ] = None,
    fps: Annotated[
        float | None, option("--fps", "N", "Films: frames per second. Default: 30; gif 20.")
    ] = None,
    width: Annotated[int | None, option("--width", "PIXELS", "Films: width. Default: 1280; gif 640.")] = None,
    height: Annotated[
        int | None, option("--height", "PIXELS", "Films: height. Default: 720; gif 360.")
    ] = None,
    camera: Annotated[
        str | None, option("--camera", "NAME", "Films: fit (default), top, side or end.")
    ] = None,
    follow: Annotated[str | None, option("--follow", "BALL", "Films: follow this ball.")] = None,
    shading: Annotated[
        str | None,
        option(
            "--shading",
            "NAME",
            "Films: pattern (default, shows rotation), plain, or colours by speed or spin.",
        ),
    ] = None,
    stamp: Annotated[bool, option("--stamp/--no-stamp", "Films: show the time in the corner.")] = True,
    quiet: Annotated[bool, option("--quiet", "-q", "Show no progress bar.")] = False,
    as_json: Json = False,
) -> None:
    """Convert a run for ParaView, OVITO or pandas, or make a film.

    Example: carom export runs/break-1 --format vtkhdf -o paraview

    Example: carom export runs/break-1 --format mp4 --speed 0.5 --follow ball2
    """
    import numpy as np

    from carom.cli.progress import counting_bar
    from carom.export import FILMS, formats_of

    result = loaded(run)
    formats = formats_of(listed("--format", format_))  # before anything is written
    named: dict[str, Any] = {
        "at": time("--at", at),
        "speed": speed,
        "fps": fps,
        "width": width,
        "height": height,
    }
    named |= {"camera": camera, "follow": follow, "shading": shading}
    film = {key: value for key, value in named.items() if value is not None}
    if film and not set(formats) & set(FILMS):
        raise CaromError(f"--{next(iter(film))} is an option of films; add --format {FILMS[0]}")
    if (
        contacts
        and set(formats) - set(FILMS)
        and not len(result.contacts)
        and np.any(result.steps["contacts"])
    ):
        note("contacts were not recorded, and are left out; contacts = true in [record] keeps them")
    begin, end = time("--from", start), time("--to", stop)
    written = []
    for name in formats:
        with counting_bar(not (quiet or as_json) and name in FILMS, "pictures") as bar:
            look = {**film, "stamp": stamp, "progress": bar} if name in FILMS else {}
            written += result.export(out, name, every=every, start=begin, stop=end, contacts=contacts, **look)
    files(written, as_json)
