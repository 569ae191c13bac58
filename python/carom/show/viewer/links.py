"""Joints and springs as the page draws them: ends carried by their balls, and the axes that they leave or take."""

from __future__ import annotations

from typing import Any

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError
from carom.scene.assembly.rotations import rotated_back
from carom.scene.tables.joints import Joint
from carom.scene.tables.loads import GROUND, Spring


def links(result: Any, every: int) -> list[dict[str, Any]]:
    """One entry per joint and spring between bodies that are shown (one in `every`), or one and the ground.

    `a` and `b` are bodies, -1 the ground; `from` and `to` are the ends, m: of a ball in its own axes, relative to its
    centre, of the ground in fixed axes. `axes` are unit vectors, fixed: along a line, normal to a plane, locked.
    """
    try:
        scene = result.scene
    except (AttributeError, CaromError):
        return []  # a lost or damaged copy of the scenario does not keep the motion from being seen
    start = _Start(result)
    names = zip(scene.joints, scene.joint_names, strict=True)
    found = [*(start.joint(*named) for named in names), *(start.spring(spring) for spring in scene.springs)]
    return [thinned for entry in found if (thinned := _thinned(entry, every)) is not None]


def _thinned(entry: dict[str, Any], every: int) -> dict[str, Any] | None:
    ends = [entry["a"], entry["b"]]
    if any(end >= 0 and end % every for end in ends):
        return None
    a, b = (end // every if end >= 0 else -1 for end in ends)
    return {**entry, "a": a, "b": b}


class _Start:
    """Where the bodies are at the start, when points of joints and springs are given in fixed axes."""

    def __init__(self, result: Any) -> None:
        self._ground = GROUND
        self._number = {str(name): i for i, name in enumerate(result.names)}
        self._position = np.asarray(result.position[0], dtype=np.float64)
        self._orientation = np.asarray(result.orientation[0], dtype=np.float64)

    def joint(self, table: Joint, name: str) -> dict[str, Any]:
        between = table.between or (table.body, self._ground)
        points = table.points or [table.point] * 2
        axes: Any = [axis for axis in (table.direction, table.normal, table.axis) if axis is not None]
        if table.type == "lock":
            axes = table.axes or np.eye(3).tolist()
        return self._link(name, table.type, between, points, axes)

    def spring(self, table: Spring) -> dict[str, Any]:
        return self._link(
            " - ".join(table.between), "spring", table.between, table.points or [None, None], []
        )

    def _link(self, name: str, kind: str, between: Any, points: Any, axes: Any) -> dict[str, Any]:
        bodies = [self._number.get(end, -1) for end in between]
        # An end that is not given is the centre; what the ground holds is then the point of the other body.
        known = [
            point if point is not None else (self._position[body] if body >= 0 else None)
            for point, body in zip(points, bodies, strict=True)
        ]
        ends = [known[k] if known[k] is not None else known[1 - k] for k in (0, 1)]
        arms = [self._arm(body, np.asarray(end, dtype=float)) for body, end in zip(bodies, ends, strict=True)]
        return {
            "name": name,
            "kind": kind,
            "a": bodies[0],
            "b": bodies[1],
            "from": arms[0],
            "to": arms[1],
            "axes": [(np.asarray(axis, dtype=float) / np.linalg.norm(axis)).tolist() for axis in axes],
        }

    def _arm(self, body: int, point: F64) -> list[float]:
        """The point in the body's own axes, relative to its centre; of the ground as it is."""
        if body < 0:
            return [float(x) for x in point]
        arm = rotated_back(self._orientation[body], point - self._position[body])
        return [float(x) for x in arm]
