"""A pressure of a free plane has an area."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from carom.errors import CaromError
from carom.scene.assembly.areas import sides
from carom.scene.assembly.placing import Placed
from carom.scene.checks.walls import called
from carom.scene.messages import Finding

if TYPE_CHECKING:
    from carom.scene.checks.rules import Parts


def check_areas(parts: Parts) -> Iterator[Finding]:
    """Where the scenario gives none, walls and periods enclose one, from the start to the end."""
    surfaces = parts.walls()
    periods = parts.periods
    end = parts.run.until if parts.run is not None else None
    for k, wall in enumerate(surfaces):
        if wall.free is None or not wall.free.follows():
            continue
        place = (wall.section, wall.index, "free", "pressure")
        around = sides(k, surfaces, periods)
        if not around:
            cause = "pressure without area, and no rectangle across the normal that it could act on"
            cure = (
                "give area; or two pairs of facing planes without end, or periods, at right angles around it"
            )
            yield Finding(place, cause, cure)
        if (first := first_to_go(k, surfaces, periods)) is not None and (end is None or first.until < end):
            gone = f"pressure without area, and {first.called} beside it is taken away at {first.until:g} s"
            yield Finding(place, gone, "give area, or leave until of that wall out")


@dataclass(frozen=True)
class Gone:
    """A wall beside an area that is taken away: when, s, and what messages call it."""

    until: float
    called: str

    def refuse(self, time: float, place: str) -> None:
        """Raise where a run that goes on is to go beyond, to a `time`, s; one that begins is looked at by `check_areas`."""
        if self.until * (1.0 + 1e-9) < time:
            cause = f"{self.called} is taken away at {self.until:g} s, and a pressure beside it has no area from then on"
            raise CaromError(f"{place}: {cause}; end there, or give area in a new run")


def first_to_go(number: int, surfaces: Sequence[Placed], periods: Sequence[float] | None) -> Gone | None:
    """Of the walls between which the area of plane `number` lies the one that is taken away first."""
    around = (surfaces[n] for side in sides(number, surfaces, periods) if len(side) == 3 for n in side[1:])
    found = [
        Gone(plane.motion.until, called(plane))
        for plane in around
        if plane.motion is not None and plane.motion.until is not None
    ]
    return min(found, key=lambda gone: gone.until, default=None)


def first_area_to_go(surfaces: Sequence[Placed], periods: Sequence[float] | None) -> Gone | None:
    """The same of all free planes whose pressure has no area of its own."""
    follow = [k for k, wall in enumerate(surfaces) if wall.free is not None and wall.free.follows()]
    found = [gone for k in follow if (gone := first_to_go(k, surfaces, periods)) is not None]
    return min(found, key=lambda gone: gone.until, default=None)
