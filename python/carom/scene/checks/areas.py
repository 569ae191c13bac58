"""A pressure of a free plane has an area."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from carom.scene.assembly.areas import sides
from carom.scene.checks.walls import called
from carom.scene.messages import Finding

if TYPE_CHECKING:
    from carom.scene.checks.rules import Parts


def check_areas(parts: Parts) -> Iterator[Finding]:
    """Where the scenario gives none, walls and periods enclose one, from the start to the end."""
    surfaces = parts.walls()
    periods = parts.periods
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
        for plane in (surfaces[n] for side in around if len(side) == 3 for n in side[1:]):
            if plane.motion is not None and plane.motion.until is not None:
                gone = f"pressure without area, and {called(plane)} beside it is taken away at {plane.motion.until:g} s"
                yield Finding(place, gone, "give area, or leave until of that wall out")
                break
