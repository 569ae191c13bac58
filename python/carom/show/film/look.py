"""The options of films and pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any

from carom.errors import CaromError, did_you_mean
from carom.units import number

CAMERAS = ("fit", "top", "side", "end")
SHADINGS = ("pattern", "plain", "speed", "spin")
#: Sides of a picture, pixels: what encoders and players bear.
SIDES = (64, 8192)
#: A film of more pictures than this was not meant.
MOST_PICTURES = 100_000
#: Formats, with what they have where nothing is said.
DEFAULTS: dict[str, dict[str, Any]] = {
    "mp4": {"width": 1280, "height": 720, "fps": 30.0},
    "gif": {"width": 640, "height": 360, "fps": 20.0},
    "png": {"width": 1280, "height": 720, "fps": 30.0},
}


@dataclass(frozen=True)
class Look:
    """How a run is filmed."""

    width: int
    """Pixels."""
    height: int
    """Pixels."""
    fps: float
    """Pictures per second of the film."""
    speed: float | None = None
    """Simulated seconds per second of the film; None chooses one."""
    camera: str = "fit"
    """One of `CAMERAS`: from the side and above, from above, level, along the longer side."""
    follow: str | None = None
    """Name of a ball that the camera goes along with, near by."""
    shading: str = "pattern"
    """One of `SHADINGS`: two tones and a cap by which rotation shows, one colour, colours by speed or by spin."""
    stamp: bool = True
    """Whether the time is written in the corner."""
    at: float | None = None
    """The time of one still, s, in place of all pictures; only of png."""
    progress: Callable[[int, int], None] | None = None
    """Called with the number of pictures made and that of all."""

    @classmethod
    def of(cls, format: str, given: Mapping[str, Any]) -> Look:
        """The options of a format, where `given` does not say otherwise (None says nothing)."""
        known = [field.name for field in fields(cls)]
        for name in given:
            if name not in known:
                raise CaromError(f"films have no option {name!r}; {did_you_mean(name, known)}")
        stated = {k: v for k, v in given.items() if v is not None}
        if "at" in stated:
            stated["at"] = number("films", "at", stated["at"], "time")
        look = cls(**{**DEFAULTS[format], **stated})
        look._check(format)
        return look

    def _check(self, format: str) -> None:
        for name in ("width", "height", "fps", "speed"):
            value = getattr(self, name)
            if value is not None and not isinstance(value, int | float):
                raise CaromError(f"{name}: {value!r} is not a number")
        for name in ("width", "height"):
            value = getattr(self, name)
            if not SIDES[0] <= value <= SIDES[1] or value != int(value):
                raise CaromError(f"{name}: {value} is no whole number from {SIDES[0]} to {SIDES[1]} (pixels)")
            if format == "mp4" and value % 2:
                raise CaromError(f"{name}: {value} is odd, which H.264 cannot hold; take {value + 1}")
        for name, most in (("fps", 240.0), ("speed", 1e9)):
            value = getattr(self, name)
            if value is not None and not 0.0 < value <= most:
                raise CaromError(f"{name}: {value} is not above 0 and at most {most:g}")
        for name, choices in (("camera", CAMERAS), ("shading", SHADINGS)):
            value = getattr(self, name)
            if value not in choices:
                raise CaromError(f"{name}: there is no {value!r}; {did_you_mean(str(value), list(choices))}")
        if self.at is not None and format != "png":
            raise CaromError(f"at: a still is a picture, and {format} a film; take the format png")
