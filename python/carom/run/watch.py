"""Callbacks and stop conditions: Python functions that look at a run between two of its steps.

They are given a `View` of the state, which holds while the function runs (or in its `with` block) and no longer. Its arrays
are read-only and belong to it alone: nothing that a function does reaches the core, so that a run with a callback has the
bits of one without.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from carom.arrays import F64, Array, Bool
from carom.errors import CaromError
from carom.numeric import is_whole
from carom.result.kinematics import Body, Motion
from carom.run.loop import Sink
from carom.scene.assembly.rotations import rotated_back
from carom.scene.plan import Plan, thinned

if TYPE_CHECKING:
    from carom._core import Block
    from carom._core import Simulation as Core
    from carom.run.result import Result


#: What of a core's model has laws of the time.
_DRIVEN = ("wall_motion", "free_walls", "joints", "loads", "deformation")


def _changes(part: object) -> Iterator[tuple[float, float]]:
    """When what is in a part of a model changes by an `until` or a table: from when to when, s."""
    if isinstance(part, Mapping):
        if "until" in part:
            yield float(part["until"]), float(part["until"])
        part = tuple(part.values())
    if isinstance(part, tuple) and len(part) == 2 and part[0] == "table":
        yield from ((a[0], b[0]) for a, b in itertools.pairwise(part[1]) if a[1] != b[1])
    elif isinstance(part, list | tuple):
        yield from itertools.chain.from_iterable(map(_changes, part))


class Watched:
    """What the views of a run look at: what is asked at every look, and seldom changes, is found once."""

    def __init__(self, names: Sequence[str], model: Any, until: float = math.inf) -> None:
        self.names, self.model, self.until = names, model, until
        self._entered, self._due = -1, np.zeros(0, dtype=bool)

    @functools.cached_property
    def last_change(self) -> float:
        """Where the last change that begins before the end of the run is over, s; 0 where there is none."""
        changes = itertools.chain.from_iterable(_changes(self.model.get(key, ())) for key in _DRIVEN)
        return max((end for begin, end in changes if begin < self.until), default=0.0)

    def due(self, simulation: Core) -> Bool:
        """Which balls have still to enter; that changes only when one enters."""
        flows = self.model.get("inflow", ())
        entered = simulation.monitors()["entered"] if flows else 0
        if entered != self._entered:
            self._due = self._still_due(simulation.state()["entered"] if flows else (), flows)
            self._entered = entered
        return self._due.copy()

    def _still_due(self, done: Iterable[int], flows: Any) -> Bool:
        count = len(self.names)
        due, clumps = np.zeros(count, dtype=bool), [clump["balls"] for clump in self.model.get("clumps", ())]
        for flow, entered in zip(flows, done, strict=True):
            first, many = flow["bodies"]
            if entered < many and flow["start"] < self.until:  # clumps are bodies behind the balls
                ends = (int(first + entered), first + many - 1)
                (low, _), (_, high) = ((k, k + 1) if k < count else clumps[k - count] for k in ends)
                due[low:high] = True
        return due


class State(Motion[Array]):
    """The state of a simulation between two steps: `position` (N, 3), `["cue"].velocity` (3,). Arrays are read-only copies.

    Only what is asked for is fetched from the core.
    """

    def __init__(self, simulation: Core, watched: Watched, block: Block | None = None) -> None:
        self._simulation: Core | None = simulation
        self._watched, self._model = watched, watched.model
        self._block = block
        self._frame: dict[str, F64] | None = None
        self.names = watched.names
        """Names of the balls."""

    @property
    def time(self) -> float:
        """s."""
        return float(self._fetch_allowed().time)

    @property
    def free_walls(self) -> F64:
        """Displacement along its normal since the start, m, and velocity along it, m/s, of each free wall, (W, 2)."""
        frame = self._fetch()
        return np.array(frame["free_walls"]) if "free_walls" in frame else np.zeros((0, 2))

    @property
    def clumps(self) -> F64:
        """Of each clump its centre of mass, m, the unit quaternion of its principal axes, its velocity, m/s, and its angular
        velocity in the world frame, rad/s: (C, 13). The centre of one that has left is not a number.
        """
        frame = self._fetch()
        return np.array(frame["clumps"]) if "clumps" in frame else np.zeros((0, 13))

    @property
    def due(self) -> Bool:
        """Which balls an inflow has still to let in, (N,)."""
        return self._watched.due(self._fetch_allowed())

    @property
    def last_change(self) -> float:
        """When the last table of the time, of motions, joints and forces, and the last `until` of a wall is over, s.

        What begins after the end of the run does not count. Formulas go on for ever, and are not asked, nor are Python
        functions.
        """
        return self._watched.last_change

    @property
    def radius(self) -> F64:
        """Radii, (N,), m."""
        return self._fixed("radius")

    @property
    def mass(self) -> F64:
        """Masses, (N,), kg."""
        return self._fixed("mass")

    @property
    def inertia(self) -> F64:
        """Moments of inertia, (N,), kg m^2."""
        return self._fixed("inertia")

    @property
    def kinetic_energy(self) -> float:
        """Of translation and rotation of the balls and clumps, J."""
        mass, inertia, of_clumps = self.mass, self.inertia, 0.0
        for clump, row in zip(self._model.get("clumps", ()), self.clumps, strict=True):
            parts = slice(*clump["balls"])
            mass, inertia = mass.copy(), inertia.copy()
            mass[parts] = inertia[parts] = 0.0
            spin = rotated_back(row[3:7], row[10:13])
            of_clumps += clump["mass"] * (row[7:10] @ row[7:10]) + np.array(clump["inertia"]) @ (spin * spin)
        translation = mass @ (self.velocity**2).sum(axis=1)
        rotation = inertia @ (self.angular_velocity**2).sum(axis=1)
        return float(0.5 * (translation + rotation + of_clumps))

    @property
    def contacts(self) -> int:
        """Closed contacts in the last step; 0 before the first one, and after a state was restored."""
        self._fetch_allowed()
        counts: Any = () if self._block is None else self._block["steps"].get("contacts", ())
        return int(counts[-1]) if len(counts) else 0

    def __getitem__(self, name: str) -> Body:
        return Body.of(self, name)

    def _of_ball(self, name: str, index: int) -> Any:
        return getattr(self, name)[index]

    def _fetch_allowed(self) -> Core:
        assert self._simulation is not None
        return self._simulation

    def _fetch(self) -> dict[str, F64]:
        simulation = self._fetch_allowed()
        if self._frame is None:
            self._frame = dict(simulation.frame())
        return self._frame

    def _fixed(self, name: str) -> F64:
        """A column of the model that nobody can write to: the run has the same array."""
        values = np.asarray(self._model[name]).view()
        values.flags.writeable = False
        return values

    def _quantity(self, name: str) -> Array:
        values = self._fetch().get(name)
        if values is None:  # of `present`, where no ball comes or goes
            return np.ones(len(self.names), dtype=bool)
        values.flags.writeable = False
        return values


class View(State):
    """The state after a step, as callbacks and stop conditions see it: `view.time`, `view["cue"].velocity` (3,).

    After the call a view is closed, and asking it raises `CaromError`; arrays that were fetched before keep their values.
    """

    def __init__(self, simulation: Core, watched: Watched, block: Block | None = None) -> None:
        super().__init__(simulation, watched, block)
        self.step = int(simulation.step)
        """Number of steps made."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the view."""
        self._simulation = self._block = self._frame = None

    def __repr__(self) -> str:
        state = "closed" if self._simulation is None else f"t = {self.time:g} s"
        return f"<view of step {self.step}, {state}, {len(self.names)} balls>"

    def _fetch_allowed(self) -> Core:
        if self._simulation is None:
            raise CaromError(
                f"the view of step {self.step} is over: it holds during the call only; keep what you need in it, as"
                " kept.append(view.position)"
            )
        return self._simulation


Callback = Callable[[View], object]
"""What it returns is not looked at."""
Stop = Callable[[View], object]
"""Ends the run where it returns True or a text, the reason that `outcome.message` gives; False, None and "" let it go on."""


def check_function(caller: str, name: str, given: object, example: str) -> None:
    """Raise unless what is given as the argument `name` is a function, or None; `example` is one without `lambda`."""
    if isinstance(given, type):
        kind = given.__name__
        raise CaromError(f"{caller}: {name} is the class {kind}; write {name}={kind}(), with parentheses")
    if given is not None and not callable(given):
        raise CaromError(f"{caller}: {name} must be a function, as lambda {example}, found {given!r}")


class Watch(Sink):
    """A callback and a stop condition, and after which steps they are asked: all multiples of `every`."""

    def __init__(
        self, callback: Callback | None, stop: Stop | None, every: int | None, caller: str = "simulate"
    ) -> None:
        check_function(caller, "callback", callback, "view: view.time > 1")
        check_function(caller, "stop", stop, "view: view.time > 1")
        if every is not None and (not is_whole(every) or every < 1):
            raise CaromError(f"{caller}: callback_every must be a number of steps from 1 on, found {every!r}")
        self._callback, self._stop, self.every = callback, stop, every
        self._watched, self._last = Watched((), {}), 0
        self.error: BaseException | None = None

    @classmethod
    def of(
        cls, callback: Callback | None, stop: Stop | None, every: int | None, caller: str = "simulate"
    ) -> Watch | None:
        """None where there is nothing to ask. Messages name the `caller`."""
        watch = cls(callback, stop, every, caller)
        if callback is None and stop is None:
            if every is not None:
                what = "callback or stop" if caller == "simulate" else "stop"
                raise CaromError(f"{caller}: callback_every is given without {what}")
            return None
        return watch

    def begin(self, names: Sequence[str], model: Any, plan: Plan) -> None:
        """The run that is watched; the plan's spacing of frames holds where no other was given."""
        self._watched, self._last = Watched(names, model, plan.until), plan.steps
        self.every = self.every or plan.every or thinned(plan.steps)

    def next(self, step: int) -> float:
        """The first step after `step` at which to ask."""
        every = self.every or 1
        return (step // every + 1) * every

    def take(self, simulation: Core, block: Block) -> dict[str, Any] | None:
        """The outcome if the run ends here: by the stop condition, or because a function raised (then `error` is set).

        After the last step there is nothing to stop.
        """
        if block["outcome"] is not None or simulation.step % (self.every or 1):
            return None
        here = {"step": simulation.step, "time": simulation.time}
        name = "callback"
        try:
            with View(simulation, self._watched, block) as view:
                if self._callback is not None:
                    self._callback(view)
                name = "stop"
                reason = self._stop(view) if self._stop is not None else None
                if not _ends(reason) or simulation.step >= self._last:
                    return None
        except BaseException as error:
            self.error = error
            told = f"{name} raised {type(error).__name__}" + (f": {error}" if str(error) else "")
            return {"kind": "interrupted", **here, "message": told.splitlines()[0]}
        called = getattr(self._stop, "__name__", type(self._stop).__name__)
        return {"kind": "stopped", **here, "message": reason if isinstance(reason, str) else f"by {called}"}

    def raise_with(self, result: Result) -> None:
        """Raise what a function raised, with the result so far as its attribute `result`."""
        if self.error is None:
            return
        with contextlib.suppress(AttributeError, TypeError):  # an exception with slots
            self.error.result = result  # type: ignore[attr-defined]
        self.error.add_note(
            f"carom: the run ended at {result.outcome.time:g} s; error.result has all up to there"
        )
        raise self.error


def _ends(answer: object) -> bool:
    """Whether a stop condition ends the run. Any other object would be true, as a condition that was made and not asked."""
    if answer is None or isinstance(answer, str | bool | np.bool_):
        return bool(answer)
    if isinstance(answer, np.ndarray) and answer.dtype == bool and answer.size == 1:
        return bool(answer)
    hint = "; of an array take .any() or .all()" if isinstance(answer, np.ndarray) else ""
    raise CaromError(f"stop must return True, False, None or a text, found {type(answer).__name__}{hint}")
