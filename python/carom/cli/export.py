"""`carom export`."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated

import typer

from carom.cli.options import Json, Run
from carom.cli.output import emit, guarded, note


@guarded
def export(
    run: Run,
    format_: Annotated[
        str,
        typer.Option(
            "--format",
            metavar="FORMAT",
            help="vtkhdf, vtp (ParaView), csv, parquet (tables), extxyz, gsd (OVITO), or several with commas.",
        ),
    ] = "vtkhdf",
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="DIR", help="Where to write; default RUN/export.")
    ] = None,
    every: Annotated[
        int, typer.Option("--every", metavar="K", min=1, help="Every K-th recorded frame only.")
    ] = 1,
    start: Annotated[
        float | None, typer.Option("--from", metavar="TIME", help="From this time on, s.")
    ] = None,
    stop: Annotated[float | None, typer.Option("--to", metavar="TIME", help="Up to this time, s.")] = None,
    contacts: Annotated[
        bool, typer.Option("--contacts/--no-contacts", help="Contacts with their forces too.")
    ] = True,
    as_json: Json = False,
) -> None:
    """Write a run in a format of other programs: ParaView, OVITO, data frames.

    Example: carom export runs/break-1 --format vtkhdf -o paraview
    """
    from carom.export import FORMATS
    from carom.result import load

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = load(run)
    for warning in caught:
        note(str(warning.message))
    from carom.errors import CaromError, did_you_mean

    formats = [name.strip() for name in format_.split(",")]
    for name in formats:  # before anything is written
        if name not in FORMATS:
            raise CaromError(f"no export format is called {name!r}; {did_you_mean(name, list(FORMATS))}")
    files = []
    for name in formats:
        files += result.export(out, name, every=every, start=start, stop=stop, contacts=contacts)
    if as_json:
        emit({"files": [str(f) for f in files]})
    else:
        print("\n".join(str(f) for f in files))
