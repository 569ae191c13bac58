"""A film of the run as MP4."""

from __future__ import annotations

from pathlib import Path

from carom.export.atomic import whole_file
from carom.export.frames import Selection
from carom.show.film import encode
from carom.show.film.look import Look
from carom.show.film.shoot import pictures


def write(selection: Selection, directory: Path, look: Look) -> list[Path]:
    """`film.mp4`."""
    path = directory / "film.mp4"
    encode.ffmpeg()  # a missing ffmpeg is reported before anything is drawn
    with whole_file(path) as temporary:
        encode.mp4(pictures(selection, look), look, temporary)
    return [path]
