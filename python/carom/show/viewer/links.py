"""Joints and springs as the page draws them: ends carried by their balls, and the axes that they leave or take."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from carom.errors import CaromError
from carom.result.data import RunData
from carom.scene.assembly.mechanics import arm, joint_rows, numbers, spring_ends


def links(result: RunData, every: int) -> list[dict[str, Any]]:
    """One entry per joint and spring between bodies that are shown (one in `every`), or one and the ground.

    `a` and `b` are bodies, -1 the ground; `from` and `to` are the ends, m: of a ball in its own axes, relative to its
    centre, of the ground in fixed axes. `axes` are unit vectors, fixed: along a line, normal to a plane, locked.
    """
    try:
        scene = result.scene
    except CaromError:
        return []  # a lost or damaged copy of the scenario does not keep the motion from being seen
    start: Any = SimpleNamespace(
        names=list(result.names),
        position=np.asarray(result.position[0], dtype=np.float64),
        orientation=np.asarray(result.orientation[0], dtype=np.float64),
    )
    number = numbers(start)
    found = []
    for joint, name in zip(scene.joints, scene.joint_names, strict=True):
        a, b, rows = joint_rows(joint, start, number)
        axes: Any = [axis for axis in (joint.direction, joint.normal, joint.axis) if axis is not None]
        if joint.type == "lock":
            axes = joint.axes or np.eye(3).tolist()
        units = [(np.asarray(axis, dtype=float) / np.linalg.norm(axis)).tolist() for axis in axes]
        ends = arm(a, rows[0].point_a, start), arm(b, rows[0].point_b, start)
        found.append({"name": name, "kind": joint.type, **_between((a, b), ends), "axes": units})
    for spring in scene.springs:
        a, b, *points = spring_ends(spring, start, number)
        ends = arm(a, points[0], start), arm(b, points[1], start)
        name = " - ".join(spring.between)
        found.append({"name": name, "kind": "spring", **_between((a, b), ends), "axes": []})
    return [thinned for entry in found if (thinned := _thinned(entry, every)) is not None]


def _thinned(entry: dict[str, Any], every: int) -> dict[str, Any] | None:
    ends = [entry["a"], entry["b"]]
    if any(end >= 0 and end % every for end in ends):
        return None
    a, b = (end // every if end >= 0 else -1 for end in ends)
    return {**entry, "a": a, "b": b}


def _between(bodies: tuple[int, int], ends: tuple[list[float], list[float]]) -> dict[str, Any]:
    return {"a": bodies[0], "b": bodies[1], "from": ends[0], "to": ends[1]}
