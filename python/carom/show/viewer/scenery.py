"""What a page shows besides balls that are always there: walls and their poses, balls that come and go, periods."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.result.boxes import Boxes
from carom.result.data import RunData
from carom.result.record.walls import PARAMETERS, WIDTHS
from carom.show.facing import facing
from carom.show.surfaces import sharp_edges

NUMBERS = [name for name, width in WIDTHS.items() if width == 1]
"""Columns of a wall that are numbers."""
SHORT = {"radius_end": "end"}
"""What the page calls some of them."""


@dataclass(frozen=True)
class Scenery:
    """Walls as the page has them: facts of all that are no resting planes, and the poses of those that move."""

    planes: list[dict[str, Any]]
    walls: list[dict[str, Any]]
    position: F64
    """(frame, moving wall, 3), m."""
    orientation: F64
    """(frame, moving wall, 4), scalar part first."""


def scenery(result: RunData, frames: I64, hidden: Collection[str] = ()) -> Scenery:
    """The walls of a result, with poses at some of its frames. Walls that are `hidden` are drawn in another way."""
    planes: list[dict[str, Any]] = []
    facts: list[dict[str, Any]] = []
    moving: list[Any] = []
    for wall in result.walls.values():
        if wall.motion.moves:
            end = {"until": wall.motion.until} if math.isfinite(wall.motion.until) else {}
            facts.append({**_wall(wall), **end, "pose": len(moving)})
            moving.append(wall)
        elif wall.name in hidden:
            continue
        elif wall.shape == "plane":
            planes.append(_plane(wall.facts))
        else:
            facts.append(_wall(wall))
    if not moving:
        return Scenery(planes, facts, np.zeros((len(frames), 0, 3)), np.zeros((len(frames), 0, 4)))
    position = np.stack([np.asarray(wall.position)[frames] for wall in moving], axis=1)
    orientation = np.stack([np.asarray(wall.orientation)[frames] for wall in moving], axis=1)
    return Scenery(planes, facts, position, orientation)


def _plane(row: Mapping[str, Any]) -> dict[str, Any]:
    return {"name": str(row["name"]), "point": _vector(row["point"]), "normal": _unit(row["normal"])}


def _wall(wall: Any) -> dict[str, Any]:
    row = wall.facts
    found: dict[str, Any] = {"name": wall.name, "shape": wall.shape, "point": _vector(row["point"])}
    if wall.mesh is not None:
        relative = np.round(wall.mesh.vertices - np.asarray(row["point"]), 9)
        return found | {
            "vertices": relative.ravel().tolist(),
            "triangles": facing(wall).ravel().tolist(),
            "edges": sharp_edges(wall.mesh).ravel().tolist(),
        }
    axis = row["normal"] if wall.shape == "plane" else row["axis"]
    if np.isfinite(axis).all():
        found["axis"] = _unit(axis)
    if wall.shape == "rectangle":
        found |= {"side": _vector(row["side"]), "size": _vector(row["size"])}
    for key in NUMBERS:
        value = float(row.get(key, math.nan))
        if math.isfinite(value):
            found[SHORT.get(key, key)] = value
    if "inside" in PARAMETERS.get(wall.shape, ()):
        found["inside"] = bool(row["inside"])
    return found


def _vector(values: Any) -> list[float]:
    return [float(x) for x in values]


def _unit(values: Any) -> list[float]:
    vector = np.asarray(values, dtype=np.float64)
    return _vector(vector / np.linalg.norm(vector))


def held(values: F64, present: Bool) -> F64:
    """`values` (frame, body, ...), where a ball is absent those of its last frame before, or of its first one.

    Of a ball that never comes they are zero, or the quaternion of no rotation. What is not shown is then at rest, which
    costs no bytes.
    """
    frame = np.arange(len(values))[:, np.newaxis]
    last = np.maximum.accumulate(np.where(present, frame, -1), axis=0)
    source = np.where(last < 0, present.argmax(axis=0), last)
    found: F64 = values[source, np.arange(values.shape[1])]
    found[:, ~present.any(axis=0)] = np.eye(1, 4) if values.shape[-1] == 4 else 0.0
    return found


def period(result: RunData) -> tuple[Sequence[float], Sequence[float]] | None:
    """Periods of the world along x, y, z (0: none) and its lowest corner, m; None of a world without."""
    if result.periodic is None or not result.periodic.any():
        return None
    return _vector(result.periodic), _vector(result.periodic_origin)


def deforming(result: RunData) -> Boxes | None:
    """The periodic boxes of the frames, if they differ."""
    return result.boxes if result.boxes is not None and result.boxes.deform else None


def bounds(
    position: F64, present: Bool | None, fold: tuple[Any, Any] | None, boxes: Boxes | None = None
) -> tuple[F64, F64]:
    """Lowest and highest coordinates of the centres that are shown, m; along a periodic axis those of the period, or of all
    `boxes` that differ.
    """
    there = position.reshape(-1, 3) if present is None else position[present]
    if len(there) == 0:
        there = np.zeros((1, 3))
    low, high = there.min(axis=0), there.max(axis=0)
    if boxes is not None:
        return boxes.around(low, high)
    if fold is not None:
        lengths, origin = (np.asarray(part) for part in fold)
        low = np.where(lengths > 0, origin, low)
        high = np.where(lengths > 0, origin + lengths, high)
    return low, high
