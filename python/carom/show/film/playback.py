"""Where the balls of a run are at any time between its frames, and at which times a film has its pictures.

Centres move straight from frame to frame. Attitudes turn at constant rate, by as many whole turns as the recorded spin says:
two frames alone do not tell. Walls need no frames, their motion is a law of time.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from carom.arrays import F64, I64
from carom.errors import CaromError, CaromWarning
from carom.result.kinematics import QUANTITIES
from carom.show.film.look import MOST_PICTURES, Look
from carom.show.surfaces import box

if TYPE_CHECKING:
    from carom.export.frames import Selection


#: Turns between frames above which the recorded spin counts, rad; below, the short way round is the one taken.
FAST = 2.5


@dataclass(frozen=True)
class Moment:
    """The n balls that are there at a time (s): `body` (n,) indices, centres (n, 3), m, unit quaternions (n, 4), and speeds
    (n,), m/s, and spins (n,), rad/s, of the frame before.
    """

    time: float
    body: I64
    position: F64
    orientation: F64
    speed: F64
    spin: F64


class Playback:
    """The chosen frames of a run, played. `low` and `high` (3,), m, are the box of all balls in all of them."""

    def __init__(self, selection: Selection, look: Look) -> None:
        self._selection = selection
        self._index = np.array(selection.frames)
        self._time = selection.time[self._index]
        self._frames: dict[int, dict[str, F64]] = {}
        self.low, self.high = box(selection)
        self.radius: F64 = np.asarray(selection.result.bodies["radius"], dtype=np.float64)
        start, end = float(self._time[0]), float(self._time[-1])
        if look.follow is not None:
            self._met(look.follow)
        self.speed = look.speed if look.speed is not None else natural_speed(end - start)
        if look.at is not None:
            slack = 1e-9 * max(abs(start), abs(end))
            if not start - slack <= look.at <= end + slack:
                raise CaromError(
                    f"at: {look.at:.12g} s is outside of the chosen frames, which are from {start:.12g} to {end:.12g} s"
                )
            self.times: F64 = np.array([look.at])
            return
        count = math.floor((end - start) / self.speed * look.fps * (1.0 + 1e-9)) + 1
        if count > MOST_PICTURES:
            raise CaromError(
                f"a film of {count} pictures; take a greater speed, a shorter time or fewer pictures per second"
            )
        self.times = np.minimum(start + np.arange(count) * self.speed / look.fps, end)

    def _met(self, name: str) -> None:
        """Refuses a ball to follow that is in none of the frames; of one that comes later is said when."""
        present = self._selection.result[name].present[self._index]
        if not present.any():
            raise CaromError(f"follow: ball {name!r} is in none of the chosen frames")
        if not present[0]:
            time = self._time[np.argmax(present)]
            told = f"follow: ball {name!r} is there from {time:g} s on; until then all is in view"
            warnings.warn(told, CaromWarning, stacklevel=2)

    def largest(self, quantity: str) -> float:
        """The largest `speed` (m/s) or `spin` (rad/s) in all frames."""
        name = {"speed": "velocity", "spin": "angular_velocity"}[quantity]
        sizes = (np.linalg.norm(frame.quantities[name], axis=1) for frame in self._selection)
        return float(max((size.max() for size in sizes if len(size)), default=0.0))

    def at(self, time: float) -> Moment:
        """What is there at a time, s, not before the first frame and not after the last."""
        k = int(np.clip(np.searchsorted(self._time, time, side="right") - 1, 0, len(self._time) - 1))
        after = min(k + 1, len(self._time) - 1)
        span = float(self._time[after] - self._time[k])
        share = min(max((time - self._time[k]) / span, 0.0), 1.0) if span > 0 else 0.0
        here, there = self._read(k), self._read(after)
        body = np.flatnonzero(np.isfinite(here["position"][:, 0]))
        a, b = ({name: values[body] for name, values in frame.items()} for frame in (here, there))
        stays = np.isfinite(b["position"][:, :1])  # a ball that leaves waits where it is until it has left
        for name in b:
            b[name] = np.where(stays, b[name], a[name])
        return Moment(
            time,
            body,
            a["position"] + share * (b["position"] - a["position"]),
            turned(
                a["orientation"],
                b["orientation"],
                0.5 * span * (a["angular_velocity"] + b["angular_velocity"]),
                share,
            ),
            np.linalg.norm(a["velocity"], axis=1),
            np.linalg.norm(a["angular_velocity"], axis=1),
        )

    def _read(self, k: int) -> dict[str, F64]:
        if k not in self._frames:
            while len(self._frames) > 1:  # the film needs the frames before and after, no others
                self._frames.pop(min(self._frames, key=lambda other: abs(other - k) < 2))
            result, frame = self._selection.result, int(self._index[k])
            self._frames[k] = {
                name: np.asarray(getattr(result, name)[frame], dtype=np.float64) for name in QUANTITIES
            }
            if self._selection.changes:
                there = np.asarray(result.present[frame])[:, np.newaxis]
                self._frames[k]["position"] = np.where(there, self._frames[k]["position"], np.nan)
        return self._frames[k]


def natural_speed(span: float) -> float:
    """Real time, unless all would be over in a blink or take an hour: 1, 2 or 5 of any power of ten. `span` in s."""
    if 1.5 <= span <= 60.0 or span <= 0.0:
        return 1.0
    wanted = span / 6 if span < 1.5 else span / 40
    decade = math.floor(math.log10(wanted))
    # Read from text, so that they are the numbers one would write.
    speeds = (float(f"{digit}e{decade + k}") for k in (0, 1) for digit in (1, 2, 5))
    return min(speeds, key=lambda speed: abs(math.log(speed / wanted)))


def turned(a: F64, b: F64, expected: F64, share: float) -> F64:
    """Attitudes a `share` of the way from `a` to `b`, unit quaternions (n, 4), where the recorded spin turns by the vectors
    `expected` (n, 3), rad, in between.
    """
    # b = turn * a, so turn = b * conj(a).
    w = np.sum(a * b, axis=1, keepdims=True)
    vector = a[:, :1] * b[:, 1:] - b[:, :1] * a[:, 1:] - np.cross(b[:, 1:], a[:, 1:])
    sign = np.where(w < 0, -1.0, 1.0)
    w, vector = sign * w, sign * vector
    sine = np.linalg.norm(vector, axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, w)
    size = np.linalg.norm(expected, axis=1, keepdims=True)
    fast = size >= FAST
    # Whole turns leave no axis in the two attitudes; that of the spin is left.
    lost = fast & (sine < 0.05)
    angle = np.where(lost, 0.0, angle)
    axis = np.where(lost, expected / np.maximum(size, 1e-300), vector / np.maximum(sine, 1e-300))
    along = np.sum(axis * expected, axis=1, keepdims=True)
    angle += np.where(fast, 2 * np.pi * np.round((along - angle) / (2 * np.pi)), 0.0)
    half = 0.5 * share * angle
    c, s = np.cos(half), np.sin(half) * axis
    scalar = c * a[:, :1] - np.sum(s * a[:, 1:], axis=1, keepdims=True)
    product = np.hstack([scalar, c * a[:, 1:] + a[:, :1] * s + np.cross(s, a[:, 1:])])
    found: F64 = product / np.linalg.norm(product, axis=1, keepdims=True)
    return found
