"""A film of the run as MP4 or GIF, and pictures as PNG: a function per format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from carom.export.atomic import whole_file, whole_folder
from carom.export.frames import Selection
from carom.show.film import encode
from carom.show.film.look import Look
from carom.show.film.shoot import pictures


def mp4(selection: Selection, directory: Path, look: Look) -> list[Path]:
    """`film.mp4`."""
    return _film(selection, directory / "film.mp4", look, encode.mp4)


def gif(selection: Selection, directory: Path, look: Look) -> list[Path]:
    """`film.gif`."""
    return _film(selection, directory / "film.gif", look, encode.gif)


def _film(selection: Selection, path: Path, look: Look, into: Callable[..., None]) -> list[Path]:
    encode.ffmpeg()  # a missing ffmpeg is reported before anything is drawn
    with whole_file(path) as temporary:
        into(pictures(selection, look), look, temporary)
    return [path]


def png(selection: Selection, directory: Path, look: Look) -> list[Path]:
    """`still-TIME.png` if the look has one time, else `pictures/00000.png` and so on."""
    if look.at is not None:
        path = directory / f"still-{look.at:g}s.png"
        with whole_file(path) as temporary:
            for picture in pictures(selection, look):
                encode.png(picture, temporary)
        return [path]
    names = []
    with whole_folder(directory / "pictures", own="*.png") as folder:
        for k, picture in enumerate(pictures(selection, look)):
            names.append(f"{k:05d}.png")
            encode.png(picture, folder / names[-1])
    return [directory / "pictures" / name for name in names]
