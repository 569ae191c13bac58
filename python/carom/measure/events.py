"""Events in a result: first contacts, sliding that turns into rolling, rest, balls that left.

`result.events` is what the core itself records, balls that enter and leave; this page finds in the columns of any result
what happened between. Each bound is an argument, and each time says how well it is known: impacts carry the time of the end
of their step, so they happened up to one step earlier; what is read off the frames is known to the time between frames.
Method `events` knows when slip ends and bodies meet, but for what depends on steps: `stepped.py` says of whom.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carom.arrays import F64, Array, Bool
from carom.errors import CaromError, among
from carom.measure.contacts import closed
from carom.measure.stepped import between, known_to
from carom.result.names import UnknownName
from carom.scene.packing.neighbours import TOUCHING

if TYPE_CHECKING:
    from carom.result.data import RunData
    from carom.result.kinematics import Frames
    from carom.result.tables import Impacts
    from carom.run.watch import State


#: Slip or speed below which a ball counts as rolling or at rest, m/s, unless the caller says otherwise.
SPEED = 1e-3
#: How long all must be quiet for the stop condition `AtRest`, s.
HOLD = 0.05

#: How well method `events` knows a time, s: flights that are shorter end in contact (crates/carom-events).
ROUNDING = 1e-9

#: Numbers of a quantity that are read at a time: runs of many balls and frames do not fit the memory.
BLOCK = 6_000_000

AWAY, SLIDING, ROLLING, RESTING = range(4)
"""What a ball does on a plane, as `phases` has it."""
PHASES = ("away", "sliding", "rolling", "resting")


@dataclass(frozen=True)
class Event:
    """Something that happened: `kind` to `body` (with `other`) at `time` s, known to `within` s."""

    kind: str
    """ "contact", "roll", "rest" or "left"."""
    time: float
    within: float
    body: str
    other: str = ""
    speed: float = float("nan")
    """Closing speed of a contact; speed of the centre otherwise, m/s."""


def detect(result: RunData, *, speed: float = SPEED) -> list[Event]:
    """First contact of each pair, slide-to-roll, rest and departures of all balls, in the order of time."""
    found = [*first_contacts(result), *slip_to_roll(result, speed=speed), *rest(result, speed=speed)]
    return _sorted([*found, *departures(result)])


def first_contact(result: RunData, body: str, other: str) -> Event | None:
    """The first time that these two, balls, clumps or walls, met; None if they never did."""
    return next(iter(_first(result, (body, other))), None)


class Meeting(NamedTuple):
    """Two balls meet: time (s) and closing speed (m/s) of the contact, and the step that has its impact."""

    time: float
    speed: float
    step: int


def hits(run: Frames[Any], a: str, b: str, after: int = 0) -> Impacts:
    """The impacts of two balls after a step. Problem 0, which has only the loads of a step, is left out."""
    rows: Impacts = run.impacts.between(a, b)
    return rows.where((np.asarray(rows["problem"]) > 0) & (np.asarray(rows["step"]) > after))


def frame_before(run: Frames[Any], step: int) -> int:
    """The last frame before the end of a step."""
    return int(np.searchsorted(np.asarray(run.step), step)) - 1


def meeting(run: Frames[Any], a: str, b: str, slowing: float = 0.0, after: int = 0) -> Meeting:
    """When two balls first meet after a step. They must have met: `hits` has rows.

    The scheme has the impact at the end of a step. The time inside of it follows from gap and closing speed in the frame
    before, with the deceleration `slowing` of the approach, m/s^2.
    """
    step = int(hits(run, a, b, after)["step"][0])
    frame, first, second = frame_before(run, step), run[a], run[b]
    apart = first.position[frame] - second.position[frame]
    length = float(np.linalg.norm(apart))
    closing = -float((first.velocity[frame] - second.velocity[frame]) @ apart) / length
    gap = length - (first.radius + second.radius)
    speed = math.sqrt(closing**2 - 2 * slowing * gap)
    return Meeting(float(run.time[frame]) + 2 * gap / (closing + speed), speed, step)


def slip(velocity: F64, spin: F64, radius: ArrayLike, normal: ArrayLike) -> F64:
    """Velocity along a surface of the point where a ball touches it, (..., 3), m/s.

    `velocity` (..., 3) of the centre, m/s; `spin` (..., 3), rad/s; `radius` (...), m; `normal` (3,) from the surface.
    """
    arm, normal = np.asarray(radius)[..., np.newaxis], np.asarray(normal)
    point = velocity - arm * np.cross(spin, normal)
    return np.asarray(point - (point @ normal)[..., np.newaxis] * normal)


def first_contacts(result: RunData) -> list[Event]:
    """The first contact of every pair that met, in the order of time.

    Of the table of impacts, and of the contacts of the frames, where those without any impact appear (as of a ball that
    rolls from piece to piece of a wall). Those that touch from the start have its time.
    """
    return _first(result, None)


def phases(result: RunData, body: str, surface: str, *, speed: float = SPEED) -> NDArray[np.int8]:
    """What a ball does on a plane that stands, per frame, (T,): `AWAY`, `SLIDING`, `ROLLING` or `RESTING`.

    It slides where the material point at the contact moves along the plane faster than `speed`, m/s; it rests where its
    centre is slower than that as well (a ball that spins in its place rests).
    """
    _bound(speed)
    index = _index(body, result.names)
    return _phases(result, _motion(result, [index]), [index], _plane(result, surface), speed)[0][:, 0]


def slip_to_roll(
    result: RunData, body: str | None = None, surface: str | None = None, *, speed: float = SPEED
) -> list[Event]:
    """When balls that slid on a plane began to roll: their slip (m/s) came to `speed` or below.

    Slip falls linearly under dry friction, so the time is found by its slope in the two frames before, within the frames
    around it. Method `events` knows when slip ends: its times are these, whatever `speed` is, but for what it steps.
    Without `body` of all balls, without `surface` on all planes that stand.
    """
    _bound(speed)
    names = result.names
    bodies = list(range(len(names))) if body is None else [_index(body, names)]
    known = result.plane_names
    surfaces = [n for n in known if not _moves(result, n)] if surface is None else [surface]
    planes = [_plane(result, name) for name in surfaces]
    times = np.asarray(result.time)
    found = _ends_of_slip(result, bodies, surfaces)
    exact = {body: [e.time for e in found if e.body == body] for body in names}
    stepped = between(result, times)
    for low, high in _windows(len(times), len(names)):
        before = max(0, low - 2)  # the slope of slip is that of the two frames before
        motion, time = _motion(result, bodies, rows=slice(before, high)), times[before:high]
        for name, plane in zip(surfaces, planes, strict=True):
            state, slides, fast = _phases(result, motion, bodies, plane, speed)
            ends = (state[:-1] == SLIDING) & (state[1:] >= ROLLING)
            ends[: max(0, low - before - 1)] = False  # those of the window before
            ends &= stepped[before : high - 1, bodies]
            for k, place in np.argwhere(ends).tolist():
                if any(time[k] < known <= time[k + 1] for known in exact[names[bodies[place]]]):
                    continue
                at = _end_of_slip(time, slides[:, place], state[:, place], k, speed)
                within = float(time[k + 1] - time[k])
                found.append(Event("roll", at, within, names[bodies[place]], name, float(fast[k + 1, place])))
    return _sorted(found)


def rest(
    result: Frames[Any], body: str | None = None, *, speed: float = SPEED, ignore_spin: bool = False
) -> list[Event]:
    """From when on balls lay still to the end: |v| and r |w| below `speed`, m/s, in all frames from there.

    Balls that move at the end, or left, have no such event. With `ignore_spin` the spin about z does not count, as in
    `AtRest`.
    """
    _bound(speed)
    names, time = result.names, np.asarray(result.time)
    bodies = list(range(len(names))) if body is None else [_index(body, names)]
    radius = np.asarray(result.bodies["radius"])[bodies]
    frames = len(time)
    # From the end back: the frame after the last one in which a ball moved, and its speed there.
    first, slowly = np.full(len(bodies), -1), np.zeros(len(bodies))
    after = np.zeros(len(bodies))
    for low, high in reversed(list(_windows(frames, len(names)))):
        velocity, spin, there = _motion(result, bodies, MOTION[1:], slice(low, high))
        loud = ~(_still(velocity, spin, radius, speed, ignore_spin) & there)
        v = np.linalg.norm(velocity, axis=2)
        last = len(loud) - 1 - loud[::-1].argmax(axis=0)
        ended = np.flatnonzero((first < 0) & loud.any(axis=0))
        first[ended] = low + last[ended] + 1
        slowly[ended] = np.vstack([v, after])[last[ended] + 1, ended]
        after = v[0]
        if (first >= 0).all():
            break
    always = first < 0
    first[always], slowly[always] = 0, after[always]
    return _sorted(
        Event("rest", float(time[k]), float(time[k] - time[k - 1]) if k else 0.0, names[i], "", float(v))
        for i, k, v in zip(bodies, first.tolist(), slowly.tolist(), strict=True)
        if k < frames
    )


def departures(result: RunData) -> list[Event]:
    """Balls that left through an outlet, as one of a pocket."""
    rows = result.events.where(np.asarray(result.events["kind"]) == 0)
    known = zip(
        np.asarray(rows["time"]).tolist(),
        known_to(result, rows, ROUNDING).tolist(),
        rows["ball"],
        strict=True,
    )
    return [Event("left", time, within, str(ball)) for time, within, ball in known]


class AtRest:
    """A stop condition for `carom.simulate(scene, stop=AtRest())`: all that can move lay still for `hold` s.

    That is every ball that is there and every free wall, and nothing may be due: no ball of an inflow, no wall with an
    `until`, no table of the time of a motion, a joint or a force that still changes. What such a table or `until` does later
    would end the rest; after the end of the run there is no later. A wall whose motion has no end, as a drum with a `rate`
    or a formula, does not count: balls are at rest in it where they are. Nor does a `load_function`, which may do anything.
    With names of balls, one or several, only these are asked, and whether they have entered.

    Still is |v| and r |w| below `speed`, m/s. A ball at the top of its way is no slower than that for 2 speed/g, 0.2 ms:
    that is what `hold` is for. With `ignore_spin` the spin about z does not count: a ball on a horizontal bed may turn on
    the spot for seconds after all has come to rest.
    """

    def __init__(
        self,
        bodies: str | Sequence[str] | None = None,
        *,
        speed: float = SPEED,
        hold: float = HOLD,
        ignore_spin: bool = False,
    ) -> None:
        if not speed > 0 or not hold >= 0:
            raise CaromError(f"AtRest: speed must be above 0 and hold not below, found {speed:g}, {hold:g}")
        self.bodies = [bodies] if isinstance(bodies, str) else bodies
        self.speed, self.hold, self.ignore_spin = speed, hold, ignore_spin
        self._since: float | None = None
        self.__name__ = "AtRest"

    def __call__(self, view: State) -> bool:
        """Whether all are still, and were for long enough."""
        chosen = slice(None) if self.bodies is None else [_index(n, view.names) for n in self.bodies]
        motion = view.velocity[chosen], view.angular_velocity[chosen], view.radius[chosen]
        still = bool((_still(*motion, self.speed, self.ignore_spin) | ~view.present[chosen]).all())
        if still and self.bodies is None:
            still = bool((np.abs(view.free_walls[:, 1]) <= self.speed).all())
            still &= view.time >= view.last_change
        if not still or view.due[chosen].any():
            self._since = None
            return False
        if self._since is None or self._since > view.time:  # later than now: of another run
            self._since = view.time
        return view.time - self._since >= self.hold * (1 - 1e-9)


def _still(velocity: F64, spin: F64, radius: F64, speed: float, ignore_spin: bool) -> Bool:
    """Whether |v| and r |w| are `speed`, m/s, at most, (...), of balls with velocities (..., 3)."""
    turning = radius * np.linalg.norm(spin[..., : 2 if ignore_spin else 3], axis=-1)
    return np.asarray((np.linalg.norm(velocity, axis=-1) <= speed) & (turning <= speed))


def _bound(speed: float) -> None:
    if not isinstance(speed, int | float | np.number) or not speed >= 0:
        raise CaromError(
            f"speed = {speed!r} is no bound of a speed; give a number from 0 in m/s, as {SPEED:g}"
        )


def _first(result: RunData, pair: tuple[str, str] | None) -> list[Event]:
    names = [*result.names, *result.wall_names]
    earliest: dict[tuple[int, int], Event] = {}
    frames = np.asarray(result.time)
    between = float(np.diff(frames).max()) if len(frames) > 1 else 0.0
    impacts, contacts = (
        table if pair is None else table.between(*pair) for table in (result.impacts, result.contacts)
    )
    tables: list[tuple[Any, Any, F64]] = []
    if len(impacts):
        tables.append((impacts, impacts["approach"], known_to(result, impacts, ROUNDING)))
    if len(contacts):
        tables.append((contacts, None, np.full(len(contacts), between)))
    for rows, closing, within in tables:
        body, time = np.asarray(rows["body"]).astype(np.int64), np.asarray(rows["time"])
        # Rows are in the order of time. One number for each pair: rows as such are sorted ten times more slowly.
        _, first = np.unique(body[:, 0] * len(names) + body[:, 1], return_index=True)
        for row in first.tolist():
            a, b = (int(i) for i in body[row])
            speed = float("nan") if closing is None else max(0.0, -float(np.asarray(closing)[row]))
            event = Event("contact", float(time[row]), float(within[row]), names[a], names[b], speed)
            # A contact of the frames is known less well than the impact that made it, which is no later than its frame.
            if (a, b) not in earliest or event.time < earliest[a, b].time - 0.5 * earliest[a, b].within:
                earliest[a, b] = event
    return _sorted(_of_start(result, earliest))


def _of_start(result: RunData, found: dict[tuple[int, int], Event]) -> Iterator[Event]:
    """First contacts; of those that touch in the first frame at its time, with a speed that may be of this time."""
    if not found:
        return
    start, body = np.asarray(result.position[0]), np.array(list(found))
    places = start[body[:, 0]], start[np.minimum(body[:, 1], len(start) - 1)]
    touch = closed(result, body, np.zeros(len(body)), places, np.zeros(len(body), dtype=np.int64))
    begin = float(result.time[0])
    for event, touches in zip(found.values(), touch.tolist(), strict=True):
        at_once = event.time - event.within <= begin
        speed = event.speed if at_once else float("nan")
        yield replace(event, time=begin, within=0.0, speed=speed) if touches else event


MOTION = ("position", "velocity", "angular_velocity", "present")


def _windows(frames: int, bodies: int) -> Iterator[tuple[int, int]]:
    """Frames in windows of so many numbers that they fit the memory, one after the other."""
    size = max(3, BLOCK // (3 * max(1, bodies)))
    for low in range(0, frames, size):
        yield low, min(frames, low + size)


def _motion(
    result: Frames[Any], bodies: list[int], columns: Sequence[str] = MOTION, rows: slice = slice(None)
) -> tuple[Array, ...]:
    """Columns of some frames, (T, n, ...), of some balls."""
    if len(bodies) == 1:
        chosen = slice(bodies[0], bodies[0] + 1)
        return tuple(np.asarray(getattr(result, name)[rows, chosen]) for name in columns)
    return tuple(np.asarray(getattr(result, name)[rows])[:, bodies] for name in columns)


def _phases(
    result: RunData, motion: tuple[Array, ...], bodies: list[int], plane: int, speed: float
) -> tuple[NDArray[np.int8], F64, F64]:
    """Phases, slip and speed of the centre, m/s, (T, n) each, of balls on a plane, whose `motion` is given."""
    normal = np.asarray(result.planes["normal"][plane])
    point = np.asarray(result.planes["point"][plane])
    radius = np.asarray(result.bodies["radius"])[bodies]
    x, v, w, there = motion
    with np.errstate(invalid="ignore"):  # absent balls are nowhere
        touches = (x - point) @ normal - radius <= TOUCHING * radius
    touches &= there
    slides, fast = np.linalg.norm(slip(v, w, radius, normal), axis=2), np.linalg.norm(v, axis=2)
    state = np.where(slides > speed, SLIDING, np.where(fast > speed, ROLLING, RESTING))
    return np.where(touches, state, AWAY).astype(np.int8), slides, fast


def _ends_of_slip(result: RunData, bodies: list[int], surfaces: list[str]) -> list[Event]:
    """Where method `events` found that balls no longer slide on planes."""
    rows, names, walls = result.transitions, result.names, result.wall_names
    if not len(rows):
        return []
    mode, body = np.asarray(rows["mode"]), np.asarray(rows["body"]).astype(np.int64)
    on = [len(names) + k for k, name in enumerate(walls) if name in surfaces]
    slid, after = rows.MODES.index("slide"), [rows.MODES.index(word) for word in ("roll", "spin", "rest")]
    chosen = (mode[:, 0] == slid) & np.isin(mode[:, 1], after)
    rows = rows.where(chosen & np.isin(body[:, 0], bodies) & np.isin(body[:, 1], on))
    fast = np.linalg.norm(np.asarray(rows["velocity"]), axis=1)
    return [
        Event("roll", float(time), float(within), str(ball), str(surface), float(speed))
        for time, within, (ball, surface), speed in zip(
            np.asarray(rows["time"]), known_to(result, rows, ROUNDING), rows["pair"], fast, strict=True
        )
    ]


def _end_of_slip(time: F64, slip: F64, state: NDArray[np.int8], k: int, speed: float) -> float:
    """When slip comes to `speed` between frames k and k + 1: by its slope before, or else on the straight line."""
    if k > 0 and state[k - 1] == SLIDING and slip[k - 1] > slip[k]:
        slope = (slip[k - 1] - slip[k]) / (time[k] - time[k - 1])
        return float(np.clip(time[k] + (slip[k] - speed) / slope, time[k], time[k + 1]))
    share = (slip[k] - speed) / (slip[k] - slip[k + 1])
    return float(time[k] + share * (time[k + 1] - time[k]))


def _plane(result: RunData, name: str) -> int:
    index = _index(name, result.plane_names)
    if _moves(result, name):
        raise CaromError(f"{name!r} moves; slip and rest are found on planes that stand")
    return index


def _moves(result: RunData, name: str) -> bool:
    index, planes = result.plane_names.index(name), result.planes
    return any(bool(str(planes[how][index])) for how in ("motion", "free") if how in planes)


def _index(name: str, known: Sequence[str]) -> int:
    names = list(known)
    if name not in names:
        raise UnknownName(f"nothing is called {name!r} there; {among(str(name), names)}")
    return names.index(name)


def _sorted(events: Iterable[Event]) -> list[Event]:
    return sorted(events, key=lambda event: (event.time, event.kind, event.body, event.other))
