"""Pictures of the run as PNG: one still, or all of a film, numbered."""

from __future__ import annotations

from pathlib import Path

from carom.export.atomic import whole_file, whole_folder
from carom.export.frames import Selection
from carom.show.film import encode
from carom.show.film.look import Look
from carom.show.film.shoot import pictures


def write(selection: Selection, directory: Path, look: Look) -> list[Path]:
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
