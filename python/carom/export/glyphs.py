"""Contacts as points with vectors: where they are, what they carry."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from carom.export.frames import Frame, Selection

#: What `contact_glyphs` gives beside the points, in this order, with units.
GLYPHS = {
    "normal": "1",
    "branch": "m",
    "impulse": "N s",
    "moment": "N m s",
    "force": "N",
    "normal_force": "N",
    "friction_force": "N",
    "gap": "m",
    "status": "1",
    "body_a": "1",
    "body_b": "1",
}


def contact_glyphs(selection: Selection, frame: Frame) -> tuple[NDArray[Any], dict[str, NDArray[Any]]]:
    """Points (C, 3), m, of the contacts of a frame, and their quantities.

    A contact of two balls lies in the middle of their gap, one with a wall on the wall. `normal` points from B to A;
    `branch` from the centre of B (of a wall: from the contact) to that of A, m; `impulse` on A and `moment` since the
    recorded frame before, N s and N m s; `force` their mean over that time, N, with its part `normal_force` along the
    normal and the size `friction_force` of the rest; `gap`, m; `status` 0 open, 1 stick, 2 slip; `body_a` and `body_b`
    indices, of walls counted after the balls.
    """
    table, rows = selection.result.contacts, selection.contact_rows(frame.index)
    body = np.asarray(table["body"][rows]).astype(np.int64)
    column = {
        name: np.asarray(table[name][rows]) for name in ("normal", "impulse", "moment", "gap", "status")
    }
    radius = selection.result.bodies["radius"]
    count = len(radius)
    place = np.full((count, 3), np.nan)
    place[frame.body] = frame.position
    a, b = body[:, 0], body[:, 1]
    gap = column["gap"][:, None]
    reach = radius[a][:, None] + np.where((b < count)[:, None], 0.5 * gap, gap)
    points = place[a] - reach * column["normal"]
    other = np.where(b < count, radius[np.minimum(b, count - 1)], 0.0)[:, None]
    branch = (radius[a][:, None] + gap + other) * column["normal"]
    elapsed = selection.time[frame.index] - selection.time[frame.index - 1] if frame.index else np.inf
    force = column["impulse"] / elapsed
    along = np.sum(force * column["normal"], axis=1)
    found = {
        **column,
        "branch": branch,
        "force": force,
        "normal_force": along,
        "friction_force": np.linalg.norm(force - along[:, None] * column["normal"], axis=1),
        "status": column["status"].astype(np.int64),
        "body_a": a,
        "body_b": b,
    }
    there = np.isfinite(points).all(axis=1)  # the ball may have left since the contact
    return points[there], {name: found[name][there] for name in GLYPHS}
