"""What is refused before anything is simulated: impossible bounds, quantities that no run has, times after its end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carom.errors import CaromError, ScenarioError, among, did_you_mean
from carom.many.fit.data import ROUNDED, Target, moving
from carom.many.sweep.study import RESERVED
from carom.scene.plan import Plan

if TYPE_CHECKING:
    from carom.many.fit.calibration import Calibration
    from carom.many.sweep.targets import Targets
    from carom.scene.scene import Scene

#: Columns of a run that are text.
TEXTS = ("outcome", "message", "id", "carom", "build")
#: Ends of runs from which on a time is taken for one in another unit.
FAR = 10.0


def plan_of(calibration: Calibration) -> Plan | None:
    """Steps and frames of all runs; None if they depend on a parameter."""
    found = set()
    for scene in at_bounds(calibration):
        if scene.run.until is None:
            return None
        found.add(Plan.of(scene.run.until, scene.run.step, scene.record.every, scene.record.contacts))
    return found.pop() if len(found) == 1 else None


def at_bounds(calibration: Calibration) -> list[Scene]:
    """The scene at each bound of each parameter and at the start. Refuses a bound that no other parameter can mend."""
    n, first, seeds = len(calibration.axes), calibration.first, calibration.seeds
    tried = [(k, bound, rest) for k in range(n) for bound in (0.0, 1.0) for rest in (first, 0.0, 1.0)]
    shares = [np.where(np.arange(n) == k, bound, rest) for k, bound, rest in tried]
    study = calibration.study_of(calibration.values(np.array([*shares, first])))
    found = []
    for j in range(0, len(tried), 3):
        scene = _first_of(study.targeting, range(j * seeds, (j + 3) * seeds, seeds))
        if isinstance(scene, ScenarioError):
            axis, [wrong, *_] = calibration.axes[tried[j][0]], scene.problems
            word, value = ("high", axis.high) if tried[j][1] else ("low", axis.low)
            raise CaromError(
                f"parameters.{axis.name}: {word} = {value:g} is impossible: {wrong.key} {wrong.cause}; give another {word}"
            )
        if scene is not None:
            found.append(scene)
    return [*found, study.targeting.of_text(len(tried) * seeds)]


def _first_of(targeting: Targets, cases: range) -> Scene | ScenarioError | None:
    """The scene of the first case that has one, else what is wrong with the first; None if an expression has no value."""
    errors = []
    for case in cases:
        try:
            return targeting.possible(case)
        except ScenarioError as error:
            errors.append(error)
        except CaromError:  # points where it has none count as bad
            return None
    return errors[0]


def quantities(calibration: Calibration, free: bool) -> None:
    """Refuse what no run has. `free`: what a measure returns is not known before it is called."""
    names = calibration.study.targeting.base.names
    ends = calibration.study.ends
    numbers = [name for name in RESERVED if name not in TEXTS]
    for target in calibration.targets:
        place = moving(target.quantity)
        if target.time is not None and place is not None and place[0] not in names:
            raise CaromError(f"{target.place}: no ball is called {place[0]!r}; {among(place[0], names)}")
        if not free and target.time is not None and target.quantity in numbers:
            raise CaromError(
                f"{target.place}: {target.quantity} is a number of the whole run, no curve; leave time out"
            )
        if not free and target.quantity not in (*ends, *numbers) and not (target.time is not None and place):
            cure = did_you_mean(target.quantity, [*numbers, *ends[:20]])
            raise CaromError(
                f"{target.place}: no quantity is called {target.quantity!r} without a measure (--measure FILE.py:FUNCTION);"
                f" {cure}"
            )


def times(targets: tuple[Target, ...], end: float) -> None:
    """Refuse measurements after the end of all runs (s)."""
    for target in targets:
        if target.time is None or moving(target.quantity) is None:  # a measure has times of its own
            continue
        late = [k for k, t in enumerate(target.time) if t > end * (1 + ROUNDED)]
        if late:
            row = f", row {target.lines[late[0]]}" if target.lines else ""
            cure = "raise run.until, or leave out what was measured later"
            if max(target.time) > FAR * end:
                where = 'time_unit = "ms", or "t (ms)" in its heading' if target.lines else '"20 ms"'
                cure = f"if the times are in another unit, write {where}; else raise run.until"
            raise CaromError(
                f"{target.place}{row}: a time of {target.time[late[0]]:.7g} s is after the end of the run at"
                f" {end:.7g} s; {cure}"
            )


def coarse(calibration: Calibration) -> str | None:
    """A remark where frames are farther apart than measurements; None where they are not, or where it is not known."""
    plan = calibration.plan
    curves = [t.time for t in calibration.targets if t.time and len(t.time) > 1 and moving(t.quantity)]
    if plan is None or not curves:
        return None
    frame = plan.every * plan.step
    apart = min(float(np.median(np.diff(np.sort(time)))) for time in curves)
    if frame <= apart * (1 + 1e-9):
        return None
    every = int(apart / plan.step + 1e-9)
    cure = f"write every = {every} below [run]" if every else f"write step = {apart:.3g} below [run], or less"
    return f"frames of the runs every {frame:.3g} s lie under measurements every {apart:.3g} s; {cure}"
