"""What the functions of this package look at: one frame of a run, or balls from elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property, partial

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.errors import CaromError
from carom.measure.contacts import closed
from carom.measure.granular.region import Region, ball_volume, images
from carom.measure.granular.shown import NotKnown
from carom.result.data import RunData
from carom.result.selection import Selection
from carom.scene.assembly.rotations import upward
from carom.scene.packing.periodic import PeriodicBox
from carom.units import number


@dataclass(frozen=True)
class Contacts:
    """C contacts. `first` is a ball; `second` is a ball, or from N on a wall."""

    first: I64
    second: I64
    normal: F64
    """Unit normals from the second to the first body, (C, 3)."""
    force: F64
    """Mean force on the first body since the frame before, (C, 3), N: the impulse over the time."""
    gap: F64
    """Distance of the surfaces, (C,), m, at the last step in which the contact was closed, as the normal."""
    closed: Bool
    """Whether the bodies touch at the frame; others only did since the frame before."""

    def of(self, rows: Bool) -> Contacts:
        """Those that a mask (C,) chooses."""
        return Contacts(*(np.asarray(getattr(self, field.name))[rows] for field in fields(self)))

    @cached_property
    def push(self) -> F64:
        """Normal forces, (C,), N, positive in compression."""
        return np.asarray((self.force * self.normal).sum(axis=1))


@dataclass(frozen=True)
class Snapshot:
    """N balls at one time. What is not known may be left out; a function that needs it says so."""

    position: F64
    """Centres, (N, 3), m; not a number for balls that are absent."""
    radius: F64
    """(N,), m."""
    mass: F64 | None = None
    """(N,), kg."""
    velocity: F64 | None = None
    """(N, 3), m/s."""
    inertia: F64 | None = None
    """(N,), kg m^2."""
    angular_velocity: F64 | None = None
    """(N, 3), rad/s."""
    contacts: Contacts | None = None
    """Those between what is there: contacts of absent balls, which have no place, are left out of what is given."""
    planes: tuple[F64, F64] | None = None
    """Points (P, 3), m, and unit normals (P, 3) of half-spaces."""
    walls: tuple[Callable[[F64, F64, float], I64], ...] | None = None
    """In place of `planes` for each wall a function of centres (K, 3), radii (K,) and a gap, all in m, that returns which
    balls are nearer, each as often as it meets the wall.
    """
    time: float = 0.0
    """s."""
    gravity: F64 | None = None
    """(3,), m/s^2."""
    period: F64 | None = None
    """After which the world repeats itself along x, y and z, (3,), m, 0 along axes where it does not; None: nowhere."""
    box: PeriodicBox | None = None
    """The periodic box, in place of `period`: of one that is sheared this says where the images are."""
    missing: str = "give the Snapshot its contacts"
    """What to do where there are no contacts."""

    def __post_init__(self) -> None:
        # Lists of other programs are welcome; mismatches are reported here, not in the midst of a measure.
        if np.ndim(self.radius) != 1:
            raise CaromError("Snapshot: radius is no list; give one radius for each ball, (N,), in m")
        n = len(self.radius)
        shapes = {"position": (n, 3), "radius": (n,), "mass": (n,), "velocity": (n, 3), "inertia": (n,),
                  "angular_velocity": (n, 3), "gravity": (3,), "period": (3,)}  # fmt: skip
        for name, shape in shapes.items():
            given = getattr(self, name)
            if given is None:
                continue
            try:
                array = np.asarray(given, dtype=np.float64)
            except (TypeError, ValueError):
                raise CaromError(
                    f"Snapshot: {name} is no array of numbers; give it the shape {shape}"
                ) from None
            if array.shape != shape:
                raise CaromError(
                    f"Snapshot: {name} has shape {array.shape}; with {n} radii it must be {shape}"
                )
            object.__setattr__(self, name, array)
        if self.box is not None:
            object.__setattr__(self, "period", self.box.lengths)
        self._in_bounds()
        if self.box is None:
            object.__setattr__(self, "box", PeriodicBox.of(self.period))
        self._without_absent()

    def _in_bounds(self) -> None:
        """Refuses sizes that no ball that is there can have, and a period that is none."""
        for name, above in (("radius", True), ("mass", True), ("inertia", False)):
            known: F64 | None = getattr(self, name)
            if known is None:
                continue
            value = known[self.present]
            wrong = ~(np.isfinite(value) & ((value > 0) if above else (value >= 0)))
            if wrong.any():
                k = int(np.flatnonzero(wrong)[0])
                cure = "give a number above 0" if above else "give 0 or a number above it"
                raise CaromError(f"Snapshot: {name} of ball {self.present[k]} is {value[k]:g}; {cure}")
        if self.period is not None and not (np.isfinite(self.period) & (self.period >= 0)).all():
            cure = "give lengths in m, 0 along axes where nothing repeats itself"
            raise CaromError(f"Snapshot: period = {self.period.tolist()}; {cure}")

    def _without_absent(self) -> None:
        """Leaves out the contacts of balls that left since they touched. Without a place no region can say whether it holds
        them, and one of them had made the stress of every region not a number.
        """
        c, n = self.contacts, len(self.radius)
        if c is None or len(self.present) == n:
            return
        there = np.append(np.isfinite(self.position).all(axis=1), True)  # the last stands for all walls
        first, second = np.asarray(c.first), np.asarray(c.second)
        object.__setattr__(self, "contacts", c.of(there[first] & there[np.minimum(second, n)]))

    @cached_property
    def present(self) -> I64:
        """Numbers of the balls that are there."""
        return np.flatnonzero(np.isfinite(self.position).all(axis=1))

    @property
    def volume(self) -> F64:
        """Volumes of the balls, (N,), m^3."""
        return np.asarray(4.0 / 3.0 * np.pi * self.radius**3)

    @cached_property
    def folded(self) -> F64:
        """Centres (N, 3), m, within the periodic box: balls of a periodic world may be many periods away."""
        return self.position if self.box is None else self.box.fold(self.position)

    @cached_property
    def against_flow(self) -> F64:
        """Velocities, (N, 3), m/s, against the mean flow of a periodic box that deforms, else as they are. Those of the
        images of a ball differ, and these do not.
        """
        velocity = self.known("velocity")
        deforms = self.box is not None and self.box.deforms
        return (
            velocity - self.box.flow_velocity(self.position) if self.box is not None and deforms else velocity
        )

    def within(self, region: Region) -> F64:
        """Volume of each ball that lies in a region, of all its images, (N,), m^3; 0 for balls that are absent."""
        there = self.present
        rows, moved = images(region, self.position[there], self.radius[there], self.box)
        rows = there[rows]
        volume = ball_volume(region, moved, self.radius[rows])
        return np.asarray(np.bincount(rows, volume, minlength=len(self.radius)), dtype=np.float64)

    @property
    def touching(self) -> Contacts:
        """The contacts, or an error that says why there are none."""
        if self.contacts is None:
            raise NotKnown(f"forces of contacts are not known here; {self.missing}")
        return self.contacts

    def known(self, name: str) -> F64:
        """An array that may have been left out."""
        found: F64 | None = getattr(self, name)
        if found is None:
            raise NotKnown(f"{name} is not known here; give the Snapshot its {name}")
        return found

    @cached_property
    def branch(self) -> F64:
        """Of each contact the vector to the centre of its first ball, (C, 3), m: from the centre of the second ball, or from
        the point where it touches the wall. From normals and gaps, so that it also holds across a periodic face.
        """
        c = self.touching
        other = np.where(
            c.second < len(self.radius), self.radius[np.minimum(c.second, len(self.radius) - 1)], 0.0
        )
        return np.asarray(c.normal * (self.radius[c.first] + other + c.gap)[:, None])

    @cached_property
    def up(self) -> F64:
        """Unit vector against gravity, (3,); z where there is none."""
        return upward(np.zeros(3) if self.gravity is None else self.gravity)


Source = RunData | Selection | Snapshot
"""What a measure takes: a result, a part of one as `result.sel` makes it, or a snapshot."""


def snapshot(source: Source, frame: int = -1, *, time: float | str | None = None) -> Snapshot:
    """Frame number `frame` of a result (negative counts from the end), or the one nearest to `time`, in s
    or as `"20 ms"`.

    A part of a result is its balls and all walls, without contacts.
    Every function of `carom.granular` makes one of what it is given; to call several of them make it once.
    """
    if isinstance(source, Snapshot):
        return source
    if not hasattr(source, "time"):
        raise CaromError(f"a measure takes a Result or a Snapshot first, found {type(source).__name__}")
    times = np.asarray(source.time)
    if not len(times):
        raise CaromError("the result has no frames yet; wait until the run has written some")
    if time is not None:
        time, slack = number("snapshot", "time", time, "time"), 1e-9 * float(times[-1])
        if not times[0] - slack <= time <= times[-1] + slack:
            raise CaromError(f"{time:.12g} s is outside of the run, {times[0]:.12g} to {times[-1]:.12g} s")
        frame = int(np.abs(times - time).argmin())
    if not isinstance(frame, int | np.integer) or not -len(times) <= frame < len(times):
        raise CaromError(f"there is no frame {frame}; give one of -{len(times)} to {len(times) - 1}")
    frame %= len(times)
    contacts, missing = None, ""
    if isinstance(source, Selection):
        missing = "a part of a result leaves them out: measure the whole one, with a region or by ball"
    elif not source.scene.record.contacts:
        missing = "run it again with contacts = true in [record]"
    elif frame == 0:
        missing = "they are summed since the frame before: take frame 1 or a later one"
    else:
        contacts = _contacts(source, frame, float(times[frame] - times[frame - 1]))
    bodies = source.bodies
    return Snapshot(
        position=np.asarray(source.position[frame]),
        radius=np.asarray(bodies["radius"]),
        mass=np.asarray(bodies["mass"]),
        velocity=np.asarray(source.velocity[frame]),
        inertia=np.asarray(bodies["inertia"]),
        angular_velocity=np.asarray(source.angular_velocity[frame]),
        contacts=contacts,
        walls=tuple(partial(wall.met, time=float(times[frame])) for wall in source.walls.values()),
        time=float(times[frame]),
        gravity=source.gravity,
        box=source.box(frame),
        missing=missing,
    )


def _contacts(result: RunData, frame: int, interval: float) -> Contacts:
    rows = result.contacts.at(frame)
    body = np.asarray(rows["body"]).astype(np.int64).reshape(-1, 2)
    gap, position = np.asarray(rows["gap"]), np.asarray(result.position[frame])
    part = np.asarray(rows["part"]) if "part" in rows.columns else None
    place = position[body[:, 0]], position[np.minimum(body[:, 1], len(position) - 1)]
    return Contacts(
        first=body[:, 0],
        second=body[:, 1],
        normal=np.asarray(rows["normal"]).reshape(-1, 3),
        force=np.asarray(rows["impulse"]).reshape(-1, 3) / interval,
        gap=gap,
        closed=closed(result, body, gap, place, np.full(len(body), frame), part),
    )
