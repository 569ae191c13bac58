"""What all formats write: chosen frames of a run, block by block, so that a long run never lies in memory whole."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from carom.arrays import F64, I64, Array, Bool
from carom.errors import CaromError
from carom.numeric import is_whole
from carom.result.data import RunData
from carom.result.kinematics import QUANTITIES
from carom.result.record import Column
from carom.units import number

#: Bytes of one quantity that are read at a time.
BLOCK_BYTES = 16 * 1024 * 1024


@dataclass(frozen=True)
class Frame:
    """One frame of the n balls that are there: `body` (n,) their indices, `quantities` by name, (n,) or (n, k), SI."""

    index: int
    time: float
    step: int
    body: I64
    quantities: Mapping[str, Array]

    @property
    def position(self) -> F64:
        """Centres, (n, 3), m."""
        return self.quantities["position"]


@dataclass(frozen=True)
class Stack:
    """The balls of some consecutive chosen frames end to end: of frame k `count[k]`, in the order of `body` (n,).

    `frames` (F,) are indices of recorded frames; `quantities` by name, (n,) or (n, k), SI.
    """

    frames: I64
    time: F64
    step: I64
    count: I64
    body: I64
    quantities: Mapping[str, Array]


#: Quantities of a ball that do not change.
FIXED = {"radius": "m", "mass": "kg", "material": "1"}


@dataclass(frozen=True)
class Selection:
    """The frames of a run that are exported."""

    result: RunData
    frames: range
    with_contacts: bool
    time: F64
    """Times of all recorded frames, (T,), s."""
    contact_end: I64 = field(repr=False)
    """Rows of the table of contacts up to and including each recorded frame, (T,)."""

    @classmethod
    def of(
        cls,
        result: RunData,
        *,
        every: int = 1,
        start: float | str | None = None,
        stop: float | str | None = None,
        contacts: bool = True,
    ) -> Selection:
        """Every so many of the frames from `start` to `stop`, s; the last of them need not be among them."""
        time = np.asarray(result.time)
        if not len(time):
            raise CaromError(f"{result.origin} holds no frames yet; there is nothing to export")
        if not is_whole(every) or every < 1:
            raise CaromError(f"every: {every!r} is no whole number from 1; 1 takes every recorded frame")
        start, stop = (
            None if value is None else number("export", name, value, "time", infinite=True)
            for name, value in (("start", start), ("stop", stop))
        )
        if start is not None and stop is not None and start > stop:
            raise CaromError(
                f"no frame from {start:g} to {stop:g} s, which ends before it begins; exchange them"
            )
        # Times are products of the step: what was meant as a frame's time is it up to rounding.
        slack = 1e-9 * max(1e-30, float(time[-1]))
        first = 0 if start is None else int(np.searchsorted(time, start - slack))
        last = len(time) if stop is None else int(np.searchsorted(time, stop + slack, side="right"))
        frames = range(first, last, every)
        if not frames:
            raise CaromError(
                f"no frame between {time[0] if start is None else start:g} and {time[-1] if stop is None else stop:g} s;"
                f" the run has frames from {time[0]:g} to {time[-1]:g} s"
            )
        end = np.asarray(result._segments.column("frames", "contact_end")).astype(np.int64)
        return cls(result, frames, contacts and len(result.contacts) > 0, time, end)

    @cached_property
    def changes(self) -> bool:
        """Whether balls enter or leave, so that frames differ in their number."""
        return "present" in self.result._segments.columns("frames")

    def fixed(self) -> dict[str, Array]:
        """What does not change, (N,) each, of all balls."""
        bodies = self.result.bodies
        found = {name: np.asarray(bodies[name]) for name in FIXED}
        return {**found, "material": found["material"].astype(np.int64)}

    def blocks(self) -> Iterator[Block]:
        """The chosen frames in blocks of some megabytes."""
        bodies = len(self.result.names)
        size = max(1, BLOCK_BYTES // max(1, 4 * 8 * bodies))
        for first in range(0, len(self.frames), size):
            yield Block(self, self.frames[first : first + size])

    def __iter__(self) -> Iterator[Frame]:
        for block in self.blocks():
            yield from block

    def contact_rows(self, frames: I64) -> tuple[I64, I64]:
        """First row of the table of contacts of recorded frames (F,), and the row after the last."""
        begin = np.where(frames > 0, self.contact_end[frames - 1], 0)
        return begin, self.contact_end[frames]

    def rows_between(self, table: Any) -> Bool:
        """Which rows of a table with times lie in the time of the selection; the time before a frame belongs to it."""
        time = np.asarray(table["time"])
        # Up to the last frame of the time asked for, which need not be one of those chosen by `every`.
        first, end = self.frames.start, self.frames.stop
        low = -np.inf if first == 0 else self.time[first - 1]
        high = np.inf if end >= len(self.time) else self.time[end - 1]
        slack = 1e-9 * max(1e-30, float(self.time[-1]))
        return np.asarray((time > low + slack) & (time <= high + slack))


class Block:
    """Some consecutive chosen frames, read at once."""

    def __init__(self, selection: Selection, frames: range) -> None:
        self.frames = frames
        self._result = selection.result
        key = slice(frames.start, frames[-1] + 1, frames.step)
        result = selection.result
        self.time: F64 = np.asarray(result.time[key])
        self.step: I64 = np.asarray(result.step[key]).astype(np.int64)
        columns: dict[str, Column] = {name: getattr(result, name) for name in QUANTITIES}
        self.quantities: dict[str, F64] = {name: np.asarray(column[key]) for name, column in columns.items()}
        self.present = np.asarray(result.present[key]) if selection.changes else None
        self._fixed = selection.fixed()

    def stack(self) -> Stack:
        """All frames at once."""
        frames, bodies = np.array(self.frames, dtype=np.int64), len(self._result.names)
        if self.present is None:
            count, body = np.full(len(frames), bodies), np.tile(np.arange(bodies), len(frames))
            quantities = {name: values.reshape(len(body), -1) for name, values in self.quantities.items()}
        else:
            count, body = self.present.sum(axis=1), np.nonzero(self.present)[1]
            quantities = {name: values[self.present] for name, values in self.quantities.items()}
        quantities |= {name: values[body] for name, values in self._fixed.items()}
        return Stack(frames, self.time, self.step, count, body, quantities)

    def __iter__(self) -> Iterator[Frame]:
        everybody = np.arange(len(self._result.names))
        for k, frame in enumerate(self.frames):
            body = everybody if self.present is None else np.flatnonzero(self.present[k])
            there: Any = slice(None) if self.present is None else body
            quantities = {name: values[k][there] for name, values in self.quantities.items()}
            quantities |= {name: values[there] for name, values in self._fixed.items()}
            yield Frame(frame, float(self.time[k]), int(self.step[k]), body, quantities)
