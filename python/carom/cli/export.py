"""`carom export`."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated, Any

import typer

from carom.cli.options import Json, Run
from carom.cli.output import emit, guarded, note
from carom.errors import CaromError


@guarded
def export(
    run: Run,
    format_: Annotated[
        str,
        typer.Option(
            "--format",
            metavar="FORMAT",
            help="Formats: vtkhdf, vtp (ParaView), csv, parquet (tables), extxyz, gsd (OVITO), mp4, gif, png (films,"
            " pictures); several with commas.",
        ),
    ] = "vtkhdf",
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="DIR", help="Output directory. Default: RUN/export.")
    ] = None,
    every: Annotated[
        int, typer.Option("--every", metavar="K", min=1, help="Export every K-th recorded frame.")
    ] = 1,
    start: Annotated[
        float | None, typer.Option("--from", metavar="TIME", help="Start at this time, s.")
    ] = None,
    stop: Annotated[float | None, typer.Option("--to", metavar="TIME", help="Stop at this time, s.")] = None,
    contacts: Annotated[
        bool, typer.Option("--contacts/--no-contacts", help="Also export contacts and their forces.")
    ] = True,
    at: Annotated[
        float | None, typer.Option("--at", metavar="TIME", help="png: one picture at this time, s.")
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(
            "--speed",
            metavar="X",
            help="Films: simulated seconds per second. Default: 1, or what suits the run.",
        ),
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option("--fps", metavar="N", help="Films: frames per second. Default: 30; gif 20."),
    ] = None,
    width: Annotated[
        int | None, typer.Option("--width", metavar="PIXELS", help="Films: width. Default: 1280; gif 640.")
    ] = None,
    height: Annotated[
        int | None, typer.Option("--height", metavar="PIXELS", help="Films: height. Default: 720; gif 360.")
    ] = None,
    camera: Annotated[
        str | None,
        typer.Option("--camera", metavar="NAME", help="Films: fit (default), top, side or end."),
    ] = None,
    follow: Annotated[
        str | None, typer.Option("--follow", metavar="BALL", help="Films: follow this ball.")
    ] = None,
    shading: Annotated[
        str | None,
        typer.Option(
            "--shading",
            metavar="NAME",
            help="Films: pattern (default, shows rotation), plain, or colours by speed or spin.",
        ),
    ] = None,
    stamp: Annotated[
        bool, typer.Option("--stamp/--no-stamp", help="Films: show the time in the corner.")
    ] = True,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Show no progress bar.")] = False,
    as_json: Json = False,
) -> None:
    """Convert a run for ParaView, OVITO or pandas, or make a film.

    Example: carom export runs/break-1 --format vtkhdf -o paraview

    Example: carom export runs/break-1 --format mp4 --speed 0.5 --follow ball2
    """
    import numpy as np

    from carom.cli.progress import counting_bar
    from carom.export import FILMS, check_format
    from carom.result.result import load

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = load(run)
    for warning in caught:
        note(str(warning.message))
    formats = [name.strip() for name in format_.split(",")]
    for name in formats:  # before anything is written
        check_format(name)
    named: dict[str, Any] = {"at": at, "speed": speed, "fps": fps, "width": width, "height": height}
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
    files = []
    for name in formats:
        with counting_bar(not (quiet or as_json) and name in FILMS, "pictures") as bar:
            look = {**film, "stamp": stamp, "progress": bar} if name in FILMS else {}
            files += result.export(out, name, every=every, start=start, stop=stop, contacts=contacts, **look)
    if as_json:
        emit({"files": [str(f) for f in files]})
    else:
        print("\n".join(str(f) for f in files))
