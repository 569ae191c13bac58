"""`Result.sel`: a part of a result, some frames and some balls of it, with the same names for what they have.

A part shows a whole run through the numbers of its frames and balls; it holds no data of its own. What concerns a run as a
whole, its files, figures and scene, a part has not.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

from carom.arrays import F64, Array, Bool
from carom.errors import CaromError, counted, quoted
from carom.numeric import is_whole
from carom.result.clumps import Clump, Clumps
from carom.result.kinematics import Frames, Part
from carom.result.names import Names, UnknownName
from carom.result.tables import (
    Contacts,
    Energy,
    Events,
    Impacts,
    Impulses,
    Residuals,
    Static,
    Steps,
    Transitions,
    frame_number,
)
from carom.result.walls import Walls
from carom.units import number

if TYPE_CHECKING:
    from carom.result.data import RunData
    from carom.scene.packing.periodic import PeriodicBox

T = TypeVar("T", Impacts, Impulses, Contacts, Events, Transitions)


class NotOfAPart(CaromError, AttributeError):
    """What only a whole result has: for `hasattr` an attribute that is not there, for functions a mistake to mend."""

    __str__ = CaromError.__str__


class Selection(Frames[F64]):
    """Some frames and some balls of a result. Arrays are read when they are asked for."""

    def __init__(self, result: RunData, frames: NDArray[np.intp], bodies: NDArray[np.intp]) -> None:
        self._result, self._frames, self._bodies = result, frames, bodies
        table = result.bodies
        self.bodies = Static({column: np.asarray(table[column])[bodies] for column in table.columns})
        self.title, self.gravity, self.versions = result.title, result.gravity, result.versions

    @classmethod
    def of(cls, result: RunData, time: Any, body: Any) -> Selection:
        """What `time` and `body` choose of a result, as in `Result.sel`."""
        frames = chosen_frames(np.asarray(result.time), time)
        return cls(result, frames, chosen_bodies(result.names, body, result.clumps))

    def sel(self, time: Any = None, body: Any = None) -> Selection:
        """A part of this part, as `Result.sel` makes it of the result."""
        frames = chosen_frames(self.time, time)
        bodies = chosen_bodies(self.names, body, self.clumps, self._bodies)
        return Selection(self._result, self._frames[frames], self._bodies[bodies])

    @property
    def time(self) -> F64:
        """Times of the frames, (T,), s."""
        return np.asarray(self._result.time)[self._frames]

    @property
    def step(self) -> Array:
        """Steps after which the frames were taken, (T,)."""
        return np.asarray(self._result.step)[self._frames]

    @property
    def joint_impulse(self) -> F64:
        """As of the result, (T, J, 6), in these frames: each since the frame of the run before."""
        return self._rows("joint_impulse")

    @property
    def joint_names(self) -> list[str]:
        """Names of the joints, in the order of the second axis of `joint_impulse`."""
        return self._result.joint_names

    def box(self, frame: int = -1) -> PeriodicBox | None:
        """The periodic box at a frame of this part; None of a world without."""
        return self._result.box(int(self._frames[frame_number("the part", frame, len(self))]))

    @cached_property
    def walls(self) -> Walls:
        """All walls by name, in these frames; impulses and forces are those of all balls."""
        return self._result.walls.chosen(self._frames)

    @cached_property
    def clumps(self) -> Clumps:
        """The clumps by name of which a ball is in this part, in these frames."""
        return self._result.clumps.chosen(self._frames, self._bodies)

    @property
    def impacts(self) -> Impacts:
        """The impacts of these balls from the first to the last of these frames."""
        return self._between(self._of_these(self._result.impacts))

    @property
    def impulses(self) -> Impulses:
        """How the impulses of these impacts grow; none unless the run has `impacts = "history"`."""
        return self._between(self._of_these(self._result.impulses))

    @property
    def events(self) -> Events:
        """Which of these balls entered or left from the first to the last of these frames."""
        return self._between(self._of_these(self._result.events))

    @property
    def transitions(self) -> Transitions:
        """The transitions of these balls from the first to the last of these frames."""
        return self._between(self._of_these(self._result.transitions))

    @property
    def contacts(self) -> Contacts:
        """The contacts of these balls in these frames."""
        return self._of_these(self._result.contacts.of_frames(self._frames))

    @property
    def steps(self) -> Steps:
        """The steps from the first to the last of these frames."""
        table = self._result.steps
        return table.where(self._within(table["time"]))

    @property
    def residuals(self) -> Residuals:
        """The contact problems of these steps that were recorded, of all balls."""
        table = self._result.residuals
        return table.where(np.isin(np.asarray(table["step"]), np.asarray(self.steps["step"])))

    @property
    def energy(self) -> Energy:
        """Energies of all balls after these steps, (S,), J; of single balls see `kinetic_energy`."""
        return Energy(self.steps)

    if not TYPE_CHECKING:  # a checker of types knows what is there

        def __getattr__(self, name: str) -> NoReturn:
            told = f"a part of a result has no attribute {name!r}"
            if name.startswith("_") or not hasattr(type(self._result), name):
                raise AttributeError(told, name=name, obj=self)  # a traceback says which was meant
            told += "; take it from the whole result, without sel, or give a function the whole one"
            raise NotOfAPart(told + (" (start, stop and every choose frames)" if name == "export" else ""))

    def _parts(self) -> list[Part]:
        return [part.chosen(self._frames, self._bodies) for part in self._result._parts()]

    def _table_number(self, index: int) -> int:
        """The number that a body has in tables, from its place in the arrays of this part."""
        return int(self._bodies[index])

    def __len__(self) -> int:
        return len(self._frames)

    def __repr__(self) -> str:
        names = self.names
        shown = ", ".join(names[:4]) + (f", ... ({len(names)})" if len(names) > 4 else "")
        span = f"t = {self.time[0]:g} to {self.time[-1]:g} s" if len(self) else "no frames"
        return f"<part of {self._result.label!r}: {counted(len(self), 'frame')}, {span}; {shown}>"

    def _quantity(self, quantity: str) -> Array:
        return np.asarray(self._rows(quantity)[:, self._bodies])

    def _rows(self, quantity: str) -> Array:
        # The rows between are read in one piece: of a long file only what is needed, of a short one what is there already.
        if not len(self._frames):
            return np.asarray(getattr(self._result, quantity)[0:0])
        low, high = int(self._frames.min()), int(self._frames.max())
        rows = np.asarray(getattr(self._result, quantity)[low : high + 1])
        return rows[self._frames - low]

    def _within(self, times: Any) -> Bool:
        times, mine = np.asarray(times), self.time
        if not len(mine):
            return np.zeros(len(times), dtype=bool)
        return np.asarray((times >= mine.min()) & (times <= mine.max()))

    def _between(self, table: T) -> T:
        return table.where(self._within(table["time"]))

    def _of_these(self, table: T) -> T:
        mine = np.isin(np.asarray(table["body"]), self._bodies)
        return table.where(mine if mine.ndim == 1 else mine.any(axis=1))


def chosen_frames(time: F64, wanted: Any) -> NDArray[np.intp]:
    """Indices of the frames: of a slice of times (both ends count), of the times nearest to those given, of a mask with a
    truth for each frame, or all (None).
    """
    if wanted is None:
        return np.arange(len(time))
    if (masked := _masked(wanted, len(time), "frame")) is not None:
        return masked
    if isinstance(wanted, slice):
        if wanted.step is not None and (not is_whole(wanted.step) or wanted.step < 1):
            raise CaromError("sel: the step of a slice of times counts frames, as time=slice(0.1, 0.5, 10)")
        slack = 1e-9 * float(time.max(initial=0.0))
        low, high = (
            end if given is None else number("sel", "time", given, "time", infinite=True)
            for end, given in ((-np.inf, wanted.start), (np.inf, wanted.stop))
        )
        low, high = low - slack, high + slack
        if len(time) and not (low <= high and low <= time.max() and high >= time.min()):
            told = f"slice({wanted.start}, {wanted.stop}) holds none of the frames"
            raise CaromError(
                f"sel: {told}; give times from {time.min():g} to {time.max():g} s, the smaller one first"
            )
        return np.flatnonzero((time >= low) & (time <= high))[:: wanted.step]
    several = np.atleast_1d(np.asarray(wanted, dtype=object))  # objects: text and numbers stay what they are
    given = np.asarray([number("sel", "time", t, "time") for t in several], dtype=np.float64)
    if not len(time):
        raise CaromError("sel: there are no frames yet")
    order = np.argsort(time, kind="stable")  # frames of a part may be in any order
    time = time[order]
    outside = given[~((given >= time[0] - 1e-9) & (given <= time[-1] * (1 + 1e-9) + 1e-12))]
    if len(outside):
        raise CaromError(
            f"sel: {outside[0]:.12g} s is outside of the frames; give times from {time[0]:.12g} to {time[-1]:.12g} s"
        )
    after = np.clip(np.searchsorted(time, given), 1, max(1, len(time) - 1))
    before = after - 1
    after = np.minimum(after, len(time) - 1)
    nearest = np.where(np.abs(time[before] - given) <= np.abs(time[after] - given), before, after)
    return np.asarray(order[nearest])


def chosen_bodies(
    names: Sequence[str], wanted: Any, clumps: Mapping[str, Clump], numbers: NDArray[np.intp] | None = None
) -> NDArray[np.intp]:
    """Indices of the balls: of one name or several, of a slice of names or numbers, of numbers, of a mask with a truth for
    each, or all (None). The name of one of the `clumps` means its balls, which have `numbers` in the run.
    """
    if wanted is None:
        return np.arange(len(names))
    if (masked := _masked(wanted, len(names), "body")) is not None:
        return masked
    called = Names(names, {name: clump.numbers for name, clump in clumps.items()}, "body", numbers)
    if isinstance(wanted, slice):
        start, stop = wanted.start, wanted.stop
        for end in (start, stop, wanted.step):
            if end is not None and not (isinstance(end, str) or is_whole(end)):
                raise CaromError(
                    f'sel: a slice of bodies is of names or numbers, as slice("a", "c"), found {end!r}'
                )
        start = min(called.numbers(start)) if isinstance(start, str) else start
        # Of names both ends count.
        stop = max(called.numbers(stop)) + 1 if isinstance(stop, str) else stop
        if isinstance(wanted.start, str) and isinstance(wanted.stop, str) and start >= stop:
            raise CaromError(f"sel: {wanted.start!r} comes after {wanted.stop!r}; give the first body first")
        return np.arange(len(names))[start : stop : wanted.step]
    several = list(wanted) if isinstance(wanted, Iterable) and not isinstance(wanted, str) else [wanted]
    found: list[int] = []
    for name in several:
        found += [_number(names, name)] if is_whole(name) else called.numbers(name)
        if len(set(found)) < len(found):  # it would count twice in sums of bodies
            twice = next(names[k] for n, k in enumerate(found) if k in found[:n])
            raise CaromError(f"sel: body: {quoted(twice)} is given twice; leave out one of the two")
    return np.array(found, dtype=np.intp)


def _masked(wanted: Any, count: int, what: str) -> NDArray[np.intp] | None:
    """Where a mask is true, an array or a list of truths; None for all else."""
    if isinstance(wanted, np.ndarray):
        if wanted.dtype != bool or wanted.ndim != 1:
            return None
    elif not (isinstance(wanted, list) and wanted and all(isinstance(v, (bool, np.bool_)) for v in wanted)):
        return None
    if len(wanted) != count:
        raise CaromError(
            f"sel: a mask has a truth for each {what}, {count} here, and this one has {len(wanted)}"
        )
    return np.flatnonzero(np.asarray(wanted))


def _number(names: Sequence[str], wanted: int) -> int:
    if not -len(names) <= wanted < len(names):
        raise UnknownName(f"no body {wanted}; there are {len(names)}, numbered from 0")
    return range(len(names))[int(wanted)]
