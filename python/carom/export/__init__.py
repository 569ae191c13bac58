"""Runs in the formats of other programs: `result.export("folder", "vtkhdf")`, `carom export RUN --format vtkhdf`.

ParaView reads `vtkhdf` (5.12 or newer) and `vtp` (every version), OVITO reads `extxyz` and `gsd`, data frames `parquet` and
`csv`; `mp4`, `gif` and `png` are films and pictures. Files are written beside their place and renamed when they are whole.
Balls that are absent (inflows and outlets) are left out of every format. Units are SI throughout.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module  # noqa: TID251 formats of our own
from pathlib import Path
from typing import Any

from carom.errors import CaromError, did_you_mean
from carom.export.atomic import writing_into
from carom.export.frames import Selection
from carom.files import inside
from carom.result.data import RunData
from carom.show.film.look import Look

#: Format: its module, which has `write(selection, directory) -> list[Path]`, and what it is for; that of `FILMS` has
#: a function for each, which takes the `Look` as a third argument.
FORMATS = {
    "vtkhdf": (
        "carom.export.vtkhdf",
        "ParaView 5.12 or newer: balls, contacts and walls over time, one file each",
    ),
    "vtp": ("carom.export.vtp", "any ParaView: a file per frame with a .pvd that lists them"),
    "csv": ("carom.export.csv_tables", "frames, impacts, contacts, steps as text, units in the headings"),
    "parquet": ("carom.export.parquet", "the same for data frames (extra [export])"),
    "extxyz": (
        "carom.export.extxyz",
        "OVITO, ASE and others: balls and contacts, a text file of all frames each",
    ),
    "gsd": (
        "carom.export.gsd",
        "OVITO, HOOMD, freud: one binary file of all frames, contacts as bonds (extra [export])",
    ),
    "mp4": ("carom.export.film", "a film, H.264 (extra [video])"),
    "gif": ("carom.export.film", "a film for pages that play no other (extra [video])"),
    "png": ("carom.export.film", "a still, or numbered pictures of a film (extra [video])"),
}
FILMS = ("mp4", "gif", "png")

#: Names by which programs are asked for, and the formats that they read.
PROGRAMS = {
    "paraview": "vtkhdf or vtp",
    "ovito": "extxyz or gsd",
    "hoomd": "gsd",
    "ase": "extxyz",
    "pandas": "parquet or csv",
}


def check_format(name: str) -> None:
    """Refuse what is no format, with the nearest one or, for the name of a program, those that it reads."""
    if name in FORMATS:
        return
    program = name.lower()
    cure = f"{name} reads {PROGRAMS[program]}" if program in PROGRAMS else did_you_mean(name, list(FORMATS))
    raise CaromError(f"no export format is called {name!r}; {cure}")


def formats_of(given: str | Sequence[str]) -> list[str]:
    """The formats of a list, or of a text with commas between them; what is none is refused."""
    several = isinstance(given, Sequence) and not isinstance(given, str)
    names = [str(name).strip() for name in (given if several else str(given).split(","))]
    found = [name for name in names if name] or [""]
    for name in found:
        check_format(name)
    return found


def export(
    result: RunData,
    directory: str | Path | None = None,
    format: str | Sequence[str] = "vtkhdf",
    *,
    every: int = 1,
    start: float | str | None = None,
    stop: float | str | None = None,
    contacts: bool = True,
    **look: Any,
) -> list[Path]:
    """Write a run as `format` (one of `FORMATS`, several as a list or with commas) into `directory`, by default `export` in
    the run directory.

    Of the recorded frames every so many (`every`) from `start` to `stop` (both included) are written; tables of
    impacts and steps have the rows of that time. Without `contacts` no contacts are written. Files of an earlier export
    of the same format are replaced, and removed where this run has nothing for them. Returns the files to open, the first
    of them the balls.

    Films and pictures have further options: `width`, `height` (pixels), `fps`, `speed` (simulated s per s), `camera`,
    `follow` (the name of a ball), `shading`, `stamp` (whether the time is shown), `at` (the time of one still),
    `progress`; see `carom.show.film.look.Look`. Times are numbers in s or texts with a unit, `"250 ms"`.
    """
    if directory == "":
        raise CaromError("export: the path is empty; name a directory, or leave it out")
    formats = formats_of(format)
    looks = {name: Look.of(name, look) for name in formats if name in FILMS}
    if look and not looks:
        raise CaromError(
            f"{next(iter(look))} is an option of films; {', '.join(formats)} has none of that name"
        )
    for chosen in looks.values():
        if chosen.follow is not None:
            result[chosen.follow]  # a name that is none is refused here
    selection = Selection.of(result, every=every, start=start, stop=stop, contacts=contacts)
    path = Path(directory) if directory is not None else inside(result.path, "export")
    written: list[Path] = []
    for name in formats:
        module = import_module(FORMATS[name][0])
        write: Callable[..., list[Path]] = getattr(module, name if name in looks else "write")
        with writing_into(path):
            written += write(selection, path, *([looks[name]] if name in looks else []))
    return written
