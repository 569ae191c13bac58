"""Billiards on a page: a table of the kit as triangles, and what is on the balls."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.result.data import RunData
from carom.scene.billiards.look import KINDS
from carom.scene.billiards.shape import Shape
from carom.scene.billiards.solid import SURFACES, parts
from carom.scene.billiards.table import Table
from carom.show.looks import few, looks
from carom.show.viewer import codec

STEP = 1e-4
"""Grid of the corners, in radii of a ball."""
UNIT = 1000
"""Components of a normal are whole thousandths."""


def table_facts(shape: Shape) -> dict[str, Any]:
    """Measures of a table, m; the box is that of all that is drawn of it."""
    low, high = shape.box
    return {
        "kinds": list(SURFACES),
        "size": [shape.length, shape.width],
        "radius": shape.size,
        "box": [low.tolist(), high.tolist()],
    }


def packed_table(shape: Shape, origin: F64) -> Iterator[tuple[str, codec.Integers, dict[str, Any]]]:
    """The triangles: for every corner its place, normal and kind, and the faces; places are measured from `origin`."""
    found = parts(shape)
    points = np.concatenate([part.points for part in found])
    step = STEP * shape.size
    yield "table_points", codec.quantise(points[:, np.newaxis], step, origin), {"step": step}
    normals = np.concatenate([part.normals for part in found])
    yield "table_normals", np.rint(UNIT * normals[:, np.newaxis]).astype(np.int32), {"step": 1 / UNIT}
    counts = [len(part.points) for part in found]
    kinds = np.repeat([SURFACES.index(part.kind) for part in found], counts)
    yield "table_kinds", kinds[:, np.newaxis, np.newaxis].astype(np.int32), {}
    first = np.cumsum([0, *counts[:-1]])
    faces = np.concatenate([part.faces + at for part, at in zip(found, first, strict=True)])
    yield "table_faces", faces[:, np.newaxis].astype(np.int32), {}


def ball_facts(result: RunData, table: Table | None, every: int) -> dict[str, Any]:
    """Kind, colour and number of each ball that is shown, where there are few: `{"balls": [[1, "#f2b705", "1"], ...]}`.

    The balls of a clump have one colour and no number.
    """
    if not few(result, every):
        return {}  # the page knows the colours of many
    return {
        "balls": [[KINDS.index(look.kind), look.colour, look.label] for look in looks(result, table, every)]
    }
