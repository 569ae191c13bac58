"""Contacts as points with vectors: where they are, what they carry."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from carom.arrays import F64, I64, Array
from carom.export.frames import Block, Selection
from carom.measure.contacts import along_and_across, closed

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
    "closed": "1",
    "body_a": "1",
    "body_b": "1",
}


#: Columns of the table of contacts that are needed.
OF_TABLE = ("normal", "impulse", "moment", "gap", "status")
#: Contacts that are computed at a time, unless a frame has more.
ROWS = 65536
#: Unwanted rows between those of two frames that are rather read than skipped: a read of its own costs as much.
GAP = 4096


@dataclass(frozen=True)
class Glyphs:
    """The contacts of some consecutive chosen frames end to end: of frame k `count[k]`.

    `frames` (F,) are indices of recorded frames, `time` (F,) s, `points` (C, 3) m, not a number where a contact has no
    place (see `contact_glyphs`), and `data` by the names of `GLYPHS`, (C,) or (C, 3): `normal` points from B to A;
    `branch` from the centre of B (of a wall: from the contact) to that of A; `impulse` on A and `moment` since the
    recorded frame before; `force` their mean over that time, with its part `normal_force` along the normal and the size
    `friction_force` of the rest; `status` 0 open, 1 stick, 2 slip; `closed` 1 where the bodies still touch at the frame, 0
    where they have parted since; `body_a` and `body_b` indices, of walls counted after the balls.

    Normal, branch, gap and status are those of the last step in which the contact was closed, as in the table.
    """

    frames: I64
    time: F64
    count: I64
    points: F64
    data: dict[str, Array]

    def __iter__(self) -> Iterator[tuple[F64, dict[str, Array]]]:
        """Points and data of each frame."""
        end = np.cumsum(self.count)
        for first, last in zip(end - self.count, end, strict=True):
            yield self.points[first:last], {name: values[first:last] for name, values in self.data.items()}

    def with_place(self) -> Glyphs:
        """Those that have a place."""
        there = np.isfinite(self.points).all(axis=1)
        if there.all():
            return self
        own = np.repeat(np.arange(len(self.count)), self.count)
        count = np.bincount(own[there], minlength=len(self.count))
        data = {name: values[there] for name, values in self.data.items()}
        return replace(self, count=count, points=self.points[there], data=data)


def contact_glyphs(selection: Selection, *, everything: bool = False) -> Iterator[Glyphs]:
    """The contacts of all chosen frames, some megabytes at a time.

    A contact of two balls lies in the middle of their gap, one with a wall on the wall, seen from A where that is at the
    frame: of bodies that have parted since it is on the surface of A, where they last touched. Of
    one whose balls have all left since nobody knows where it is: it is left out, unless `everything` is asked for.
    """
    for block in selection.blocks():
        frames = np.array(block.frames, dtype=np.int64)
        begin, end = selection.contact_rows(frames)
        first = 0
        while first < len(frames):
            fits = int(np.searchsorted(np.cumsum(end[first:] - begin[first:]), ROWS, side="right"))
            part = slice(first, first + max(1, fits))
            found = _glyphs(selection, block, frames, part, begin[part], end[part])
            yield found if everything else found.with_place()
            first = part.stop


def _glyphs(
    selection: Selection,
    block: Block,
    frames: I64,
    part: slice,
    begin: I64,
    end: I64,
) -> Glyphs:
    """Those of a part of the `frames` of a block, whose rows are `begin` to `end`, (F,) each."""
    column = _rows(selection.result.contacts, begin, end)
    own = np.repeat(np.arange(len(begin)), end - begin)  # the frame of each contact, counted within the part
    radius = selection.result.bodies["radius"]
    count = len(radius)
    body, of_mesh = column.pop("body").astype(np.int64), column.pop("part", None)
    a, b = body[:, 0], body[:, 1]
    gap = column["gap"][:, None]
    pair = b < count
    reach = radius[a][:, None] + np.where(pair[:, None], 0.5 * gap, gap)
    position, of_b = block.quantities["position"][part], np.minimum(b, count - 1)
    place, index = (position[own, a], position[own, of_b]), frames[part]
    points = place[0] - reach * column["normal"]
    if block.present is not None:
        # A ball may have left since the contact, and then the other one tells its place.
        there = block.present[part]
        from_b = place[1] + (radius[of_b][:, None] + 0.5 * gap) * column["normal"]
        b_there = (pair & there[own, of_b])[:, None]
        points = np.where(there[own, a][:, None], points, np.where(b_there, from_b, np.nan))
    other = np.where(pair, radius[of_b], 0.0)[:, None]
    branch = (radius[a][:, None] + gap + other) * column["normal"]
    elapsed = np.where(index > 0, selection.time[index] - selection.time[index - 1], np.inf)
    force = column["impulse"] / elapsed[own][:, None]
    along, across = along_and_across(force, column["normal"])
    found = {
        **column,
        "branch": branch,
        "force": force,
        "normal_force": along,
        "friction_force": across,
        "status": column["status"].astype(np.int64),
        "closed": closed(selection.result, body, column["gap"], place, index[own], of_mesh).astype(np.int64),
        "body_a": a,
        "body_b": b,
    }
    count_of = np.asarray(end - begin)
    return Glyphs(index, selection.time[index], count_of, points, {name: found[name] for name in GLYPHS})


def _rows(table: Any, begin: I64, end: I64) -> dict[str, Array]:
    """The columns of a table in the rows `begin` to `end`, (F,) each and rising, end to end."""
    count = end - begin
    wanted = np.repeat(begin - np.cumsum(count) + count, count) + np.arange(int(count.sum()))
    runs = np.split(np.arange(len(begin)), np.flatnonzero(begin[1:] - end[:-1] > GAP) + 1)
    found: dict[str, Array] = {}
    for name in ("body", *OF_TABLE, *({"part"} & set(table.columns))):
        column = table[name]
        pieces = []
        for run in runs:
            low, high = int(begin[run[0]]), int(end[run[-1]])
            own = wanted[int(count[: run[0]].sum()) : int(count[: run[-1] + 1].sum())]
            piece = np.asarray(column[low:high])
            pieces.append(piece if len(piece) == len(own) else piece[own - low])
        found[name] = np.concatenate(pieces)
    return found
