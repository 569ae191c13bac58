"""A pressure of a free plane has an area."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from carom.scene.assembly.areas import sides
from carom.scene.messages import Finding

if TYPE_CHECKING:
    from carom.scene.checks.rules import Parts


def check_areas(parts: Parts) -> Iterator[Finding]:
    """Where the scenario gives none, walls and periods enclose one."""
    surfaces = parts.walls()
    periods = parts.periods
    for k, wall in enumerate(surfaces):
        if wall.free is None or not wall.free.follows() or sides(k, surfaces, periods):
            continue
        cause = "pressure without area, and no rectangle across the normal that it could act on"
        cure = "give area; or two pairs of facing planes without end, or periods, at right angles around it"
        yield Finding((wall.section, wall.index, "free", "pressure"), cause, cure)
