"""`carom.sensitivity`: how the end of a shot depends on what it begins with.

Method `events` computes a motion to rounding, so that central differences of it are exact but for their own step. Two of
them, with a step and its half, leave an error of fourth order. It is below their difference, which also shows what
rounding does in the runs. The step is the one with the least sum of this and what rounding of the ends does. What steps
with errors alike find lies within both, else the error is more: a logarithm has small differences at all, and all differ.

A motion depends smoothly on what it begins with only as long as the same events follow one another. They are in the
table of transitions: a difference whose runs have other events than the shot itself does not count.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from inspect import signature
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError, CaromWarning, quoted
from carom.many import moved
from carom.many.absent import there_only
from carom.many.batch import refuse_records, simulate_batch
from carom.many.batch_result import Batch
from carom.many.cases import Overrides
from carom.many.quantity import USUAL
from carom.numeric import is_finite
from carom.result.tables import Transitions
from carom.run.simulate import scene_of
from carom.scene.scene import Scene

Events = list[tuple[int, ...]]

QUANTITIES = USUAL
#: Steps of the differences, over the size of what is changed (1 where it is 0). Larger: other events; smaller: rounding, and
#: spins of 1e-10 rad/s, which method events takes for none.
STEPS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
#: Places of the runs of a difference, in steps.
PLACES = (1.0, -1.0, 0.5, -0.5)
#: Error of a derivative over its size from which no smaller step is tried.
ENOUGH = 1e-10
#: Error over the least one (1) up to which a step has to find what that one does. Larger steps may reach over a kink.
ALIKE = 10.0
#: Share of the change before that the next one must exceed to go on; those that fall by less than the second never end.
STEADY, SLOWEST = 0.5, 0.05
ROUNDING = 4.0 * 3.0 * float(np.finfo(float).eps)
"""Four times that of the four ends, in the weights of the differences: (4 * 2 + 1)/3. Times of impacts are rounded, too."""
OTHER = "other events follow: a hit grazes, two happen at one time, or a ball that lies still begins to move"
OF_A_FUNCTION = "let a function build the scene, and name its argument"
PRESS, RELEASE, SPIN_ENDS = (Transitions.EVENTS.index(event) for event in ("press", "release", "spin ends"))


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives of the final state of N balls by P inputs, and by how much they may be off. Balls that left have NaN."""

    inputs: tuple[str, ...]
    names: tuple[str, ...]
    """Of the balls."""
    position: F64
    """(P, N, 3) of the centres, m over the unit of the input."""
    velocity: F64
    """(P, N, 3), m/s over the unit of the input."""
    angular_velocity: F64
    """(P, N, 3), rad/s over the unit of the input."""
    error: F64
    """(P,) by how much it may be off: the largest difference of the two estimates and what rounding of the final state
    does to it, over the largest derivative of its quantity or, where that is more, over the quantity over the input.
    """

    def of(self, ball: str, quantity: str = "position") -> F64:
        """(P, 3) derivatives of a quantity of one ball."""
        if ball not in self.names or quantity not in QUANTITIES:
            raise CaromError(f"there is no {quantity} of {quoted(ball)} in these sensitivities")
        return np.asarray(getattr(self, quantity)[:, self.names.index(ball)])

    @property
    def gone(self) -> list[str]:
        """Balls that left, as into a pocket: they have no place at the end."""
        there = np.asarray(np.isfinite(self.position).all(axis=(0, 2)))
        return [name for name, here in zip(self.names, there, strict=True) if not here]

    def __repr__(self) -> str:
        gone = f"; NaN of {', '.join(self.gone)}, which left" if self.gone else ""
        to = f"{len(self.names)} balls to {', '.join(self.inputs)}"
        return f"<sensitivity of {to}; relative error {self.error.max():.1g}{gone}>"


def sensitivity(
    scene: Scene | str | Path | Callable[..., Scene],
    to: Sequence[str] | Mapping[str, float],
    *,
    threads: int | None = None,
    **options: Any,
) -> Sensitivity:
    """Derivatives of the final state by inputs of a shot, through all its impacts, by method `events`.

    `to` names inputs as `carom.simulate_batch` does, each a single number: `"cue.velocity.x"` (m/s), `"cue.radius"` (m),
    `"ball/cloth.friction"`. Or `scene` is a function that builds a scene, and `to` its arguments with their values,
    as `{"speed": 2.0, "direction": 0.1}`. `options` are keys of `[run]`, as `until`, which is kept to exactly; `step` does
    not count, as runs have one frame. Balls that left have NaN, and are `gone`.

    Raises `CaromError` where there is no derivative: where the events that follow depend on the smallest change, as at a
    grazing hit; where differences have no limit, as by a spin of 0 under rolling resistance; where an input moves bodies
    apart that touch at the start; where balls press one another, so that steps are made.
    """
    if not to:
        raise CaromError('sensitivity: to names no input; name some, as ["cue.velocity.x"]')
    refuse_records("sensitivity", options)
    if (method := options.get("method", "events")) != "events":
        raise CaromError(f"sensitivity: method must be events, whose motions are exact, found {method!r}")
    runs = (
        _of_function(scene, to, threads, options)
        if callable(scene)
        else _of_scene(scene, to, threads, options)
    )
    base, start, value, names = runs
    batch = base({})
    if not batch.ok.all():
        raise CaromError(f"sensitivity: the shot itself fails ({batch.outcome[0]}): {batch.message[0]}")
    events = _events(batch)[0]
    if any(row[0] in (PRESS, RELEASE) for row in events):
        _refuse_steps(batch, start({})[1])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CaromWarning)  # the shot itself has told
        _refuse_to_part(start, value)
        found = [_derivative(base, name, value[name], events) for name in value]
    parts = {q: np.array([d[q] for d, _ in found]) for q in QUANTITIES}
    return Sensitivity(tuple(value), tuple(names), **parts, error=np.array([off for _, off in found]))


Run = Callable[[Mapping[str, F64]], Batch]
"""Runs of a shot with other values of some inputs, (B,) each; of none: of the shot itself."""
Start = Callable[[Mapping[str, float]], tuple[moved.Model, list[str]]]
"""The model of a shot with other values of some inputs, and the names of its balls and walls."""


def _of_scene(
    scene: Scene | str | Path,
    to: Sequence[str] | Mapping[str, float],
    threads: int | None,
    options: Mapping[str, Any],
) -> tuple[Run, Start, dict[str, float], list[str]]:
    if isinstance(to, (str, Mapping)):
        raise CaromError(
            'sensitivity: to must be a list of inputs, as ["cue.velocity.x"]; values are the scene\'s'
        )
    scene = _exact(scene_of(scene, "sensitivity"), options)
    overrides, value = Overrides(scene, {}, "sensitivity"), {}
    places: dict[Any, str] = {}
    for name in to:
        place, shape = overrides._place(name)
        if shape:
            raise CaromError(
                f"sensitivity: {quoted(name)} is not one number; name its component, as {name}.x"
            )
        laws = overrides._base.get(f"{place.array}_law")
        if laws is not None and laws[place.index[0]] is not None:
            raise CaromError(
                f"sensitivity: {quoted(name)} is a law of the slip speed, which has no single number; {OF_A_FUNCTION}"
            )
        if (other := places.setdefault(place, name)) != name or name in value:
            raise CaromError(f"sensitivity: {quoted(other)} and {quoted(name)} both name the same number")
        value[name] = float(overrides._base[place.array][place.index])

    def run(given: Mapping[str, F64]) -> Batch:
        return simulate_batch(scene, given, threads=threads, impacts=True)

    def start(given: Mapping[str, float]) -> tuple[moved.Model, list[str]]:
        return Overrides(scene, {name: [x] for name, x in given.items()}).model(0), _bodies(scene)

    return run, start, value, list(scene.names)


def _of_function(
    build: Callable[..., Scene],
    to: Sequence[str] | Mapping[str, float],
    threads: int | None,
    options: Mapping[str, Any],
) -> tuple[Run, Start, dict[str, float], list[str]]:
    if not isinstance(to, Mapping):
        raise CaromError(
            'sensitivity: give the arguments of the function with their values, as {"speed": 2.0}'
        )
    for name, x in to.items():
        if not is_finite(x):
            raise CaromError(f"sensitivity: {name} must be a number in SI, found {quoted(x)}")
    value = {str(name): float(x) for name, x in to.items()}
    try:
        signature(build).bind(**value)
    except TypeError as error:
        raise CaromError(
            f"sensitivity: the function cannot be called with {', '.join(value)} alone: {error}"
        ) from None

    def made(given: Mapping[str, float]) -> Scene:
        scene = build(**given)
        if not isinstance(scene, Scene):
            raise CaromError(f"sensitivity: the function must return a scene, found {type(scene).__name__}")
        return _exact(scene, options)

    def run(given: Mapping[str, F64]) -> Batch:
        cases = max((len(x) for x in given.values()), default=1)
        rows = [value | {name: float(x[k]) for name, x in given.items()} for k in range(cases)]
        return simulate_batch([made(row) for row in rows], threads=threads, impacts=True)

    def start(given: Mapping[str, float]) -> tuple[moved.Model, list[str]]:
        scene = made(value | dict(given))
        return scene.to_model(), _bodies(scene)

    return run, start, value, list(made(value).names)


def _exact(scene: Scene, options: Mapping[str, Any]) -> Scene:
    """The scene with method `events` and the options, in one step: each frame would round the motion once more."""
    method = scene.run.written().get("method", "events")
    if method != "events" and "method" not in options:
        told = f"sensitivity: the scene has method {method}; derivatives are by events, which is exact"
        warnings.warn(told, CaromWarning, stacklevel=4)
    scene = scene.overridden({**options, "method": "events"}, dict.fromkeys(options, "sensitivity"))
    until = scene.run.until
    return scene.overridden({"step": until}, {"step": "sensitivity"}) if until else scene


def _bodies(scene: Scene) -> list[str]:
    return [*scene.names, *scene.wall_names]


def _refuse_steps(batch: Batch, bodies: Sequence[str]) -> NoReturn:
    """Raise for a shot of which a part is computed in steps: name who was the first to need them."""
    first = int(np.argmax(np.isin(batch.transitions["kind"], (PRESS, RELEASE))))
    a, b = batch.transitions["body"][first]
    from_then = batch.transitions["kind"][first] == PRESS
    press = (
        f"{quoted(bodies[a])} and {quoted(bodies[b])} press one another"
        if b >= 0
        else f"{quoted(bodies[a])} is pressed"
    )
    time = f"t = {batch.transitions['time'][first]:.6g} s"
    when = f"from {time} on" if from_then else f"until {time}"
    raise CaromError(
        f"sensitivity: {when} {press}, as on a slope or in a pile; method"
        " events makes steps then, and what steps compute has no exact derivative"
    )


def _refuse_to_part(start: Start, value: Mapping[str, float]) -> None:
    """Raise where an input moves bodies apart that touch at the start."""
    model, bodies = start({})
    base = moved.gaps(model)
    for name, x in value.items():
        h = moved.TRIAL * (abs(x) or 1.0)
        try:
            pair = moved.parted(base, *(moved.gaps(start({name: x + way})[0]) for way in (h, -h)))
        except CaromError:
            continue  # no shot has such a value, as a friction below 0: the runs say so
        if pair is not None:
            a, b = (bodies[i] for i in pair)
            raise CaromError(
                f"sensitivity: no derivative by {quoted(name)}: {a} and {b} touch at the start, and it moves them apart or"
                " into one another; leave a gap between them, or let a function build the scene that keeps them in touch"
            )


def _derivative(run: Run, name: str, value: float, events: Events) -> tuple[dict[str, F64], float]:
    """The derivatives by one input, with the step of the least error."""
    tried: list[tuple[float, dict[str, F64], dict[str, float]]] = []
    why = ""
    for share in STEPS:
        h = share * (abs(value) or 1.0)
        at = value + h * np.array(PLACES)
        batch = run({name: at})
        changed = f"where it changes by {share:g} of its size"
        if not batch.ok.all():
            border = (batch.ok == (at > value)).all() or (batch.ok == (at < value)).all()
            where = "its value lies at the border of its range" if border else f"{changed} a run fails"
            why = f"{where}: {batch.message[~batch.ok][0]}"
            continue
        if any(row != events for row in _events(batch)):
            why = f"{changed} {OTHER}"
            continue
        found, sizes, off = {}, {}, 0.0
        for quantity in QUANTITIES:
            x = there_only(getattr(batch, quantity), batch.present)
            whole, half = (x[0] - x[1]) / (at[0] - at[1]), (x[2] - x[3]) / (at[2] - at[3])
            found[quantity] = (4.0 * half - whole) / 3.0
            size = sizes[quantity] = max(_largest(found[quantity]), _largest(x) / (abs(value) or 1.0))
            error = _largest(half - whole) + ROUNDING * _largest(x) / h
            off = max(off, error / size if size else 0.0)
        tried.append((off, found, sizes))
        if off < ENOUGH:
            break
    if not tried:
        raise CaromError(f"sensitivity: no derivative by {quoted(name)} = {value:g}; {why}")
    off, best, sizes = min(tried, key=lambda one: one[0])
    alike = [(other, found) for other, found, _ in tried if other <= ALIKE * off]
    larger = alike[: 1 + [found is best for _, found in alike].index(True)]  # smaller ones are of rounding
    if any(_goes_on([found[q] for _, found in larger]) for q in QUANTITIES):
        raise CaromError(
            f"sensitivity: no derivative by {quoted(name)} = {value:g}; its differences go on changing with their step, so"
            " that no limit is seen, as about a spin of 0 under rolling resistance"
        )
    for other, found in alike:
        apart = (_largest(best[q] - found[q]) / sizes[q] for q in QUANTITIES if sizes[q])
        off = max(off, max(apart, default=0.0) - other)
    return best, off


def _goes_on(found: Sequence[F64]) -> bool:
    """Whether differences over ever smaller steps go on changing by more than half of what they are.

    What is left of changes that fall by the same factor each time is the last one over what that lacks to 1.
    """
    x = np.nan_to_num(np.array(found)).reshape(len(found), -1)
    changes = np.diff(x, axis=0)
    along, size = (changes[1:] * changes[:-1]).sum(axis=1), (changes[:-1] ** 2).sum(axis=1)
    if len(changes) < 3 or (along <= STEADY * size).any():
        return False
    left = np.linalg.norm(changes[-1]) / max(SLOWEST, 1.0 - along[-1] / size[-1])
    return bool(left > 0.5 * np.linalg.norm(x[-1]))


def _largest(x: F64) -> float:
    """Of the balls that are there."""
    return float(np.nan_to_num(np.abs(x)).max(initial=0.0))


def _events(batch: Batch) -> list[Events]:
    """What happens to the balls in each case, ball by ball. Bounces on one body that follow one another are one: how
    many there are before they end is no matter of the motion. Nor are ends of spin, which may be one of rounding.
    """
    table = batch.transitions
    found: list[Events] = [[] for _ in range(len(batch))]
    if not table:
        return found
    rows = np.column_stack(
        [table["case"], table["body"][:, 0], table["kind"], table["body"][:, 1], table["mode"][:, 1]]
    )
    order = np.lexsort((np.arange(len(rows)), rows[:, 1], rows[:, 0]))
    for case, ball, kind, other, after in rows[order].astype(np.int64).tolist():
        if kind == SPIN_ENDS:
            continue
        own = found[case]
        if own and own[-1][:3] == (kind, ball, other):
            own.pop()
        own.append((kind, ball, other, after))
    return found
