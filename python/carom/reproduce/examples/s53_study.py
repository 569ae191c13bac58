"""Section 5.3: the runs. The 28 shots at the paper's step, and one of them at many steps (figure 14)."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from carom.many.order import error_of
from carom.measure.events import hits
from carom.reproduce import study
from carom.reproduce.analytic.throw import Shot, angle_of, impact, on_table
from carom.reproduce.document import Context
from carom.reproduce.memory import Trace, trace
from carom.scene.scene import Scene

SCENARIO = "5.3_throw.toml"
#: The paper's step, s, and the time of its simulations, s.
H, UNTIL = 1e-4, 1.0
#: Soon after the hit, s: nothing changes the velocities any more.
SOON = 0.06
ANGLES, ROLLS = (0, 30), (0.0, 0.5)
RATIOS = (-1.25, -0.9, -0.4, 0.0, 0.4, 0.9, 1.25)
#: The shot of figure 14 (text before it).
STUDY = (30, 0.5, -0.4)
#: Instants at which errors are summed (eq. 45), s, counted from the hit; and steps before the hit in the study.
INSTANTS = tuple(0.01 * k for k in range(1, 11))
BEFORE = 20


@dataclass(frozen=True)
class Throw:
    """One shot: throw angle at the paper's step and at half of it, deg, and what the run reports.

    `closed` is eq. 50, `law` the impact law with the table. `friction_ratio` is friction over normal impulse of the hit.
    """

    phi: int
    roll: float
    ratio: float
    shot: Shot
    found: float
    finer: float
    friction_ratio: float
    run: Trace

    @property
    def law(self) -> float:
        """Throw by the impact law with the table, deg."""
        return math.degrees(on_table(self.shot))


@dataclass(frozen=True)
class Point:
    """Errors at one step: throw in rad, displacement and velocity of both balls after the hit by eq. 45."""

    h: float
    throw: float
    displacement: float
    velocity: float
    unconverged: int


def name_of(phi: int, roll: float, ratio: float) -> str:
    """Name of a case in the scenario file."""
    return f"phi={phi} roll={roll:g} spin={ratio:g}"


def scene(case: str, **parameters: float) -> Scene:
    """The scene of a case, some of its parameters replaced."""
    return Scene.from_toml(Context.scenario(SCENARIO), case=case, parameters=parameters)


def at_paper_tolerance(context: Context) -> list[Trace]:
    """The 28 shots at tol_r = 1e-5, by Newton's method as in the paper."""
    run: dict[str, Any] = {"solver": "newton", "tolerance": study.PAPER_TOLERANCE}
    return [trace(scene(name_of(*shot)), at=[_until(context)], **run) for shot in _shots()]


def at_default_tolerance(context: Context) -> list[Throw]:
    """The 28 shots at the default tolerance, by Newton's method, and at half the step."""
    tolerance = study.default_tolerance(context)
    return [_shot(*shot, tolerance, _until(context)) for shot in _shots()]


def _shots() -> list[tuple[int, float, float]]:
    return list(itertools.product(ANGLES, ROLLS, RATIOS))


def _until(context: Context) -> float:
    """The quick ones end soon after the hit."""
    return SOON if context.quick else UNTIL


def as_printed(context: Context) -> list[Trace]:
    """The 28 shots by the paper's law, with eq. 44 alone to end the iterations."""
    return [trace(scene(name_of(*shot)), at=[_until(context)], **study.AS_PRINTED) for shot in _shots()]


def points(context: Context) -> list[Point]:
    """The shot of figure 14 at several steps, coarse first. The hit is always in the middle of a step."""
    steps = [4e-4 / 2**k for k in range(4 if context.quick else 7)]
    return [_point(h, study.default_tolerance(context)) for h in steps]


def throw_of(run: Trace) -> float:
    """Angle from the line of centres at the hit to the velocity of the object ball at the end, rad."""
    return angle_of(run["object"].velocity[-1], -hits(run, "cue", "object")["normal"][0])


def _shot(phi: int, roll: float, ratio: float, tolerance: float, until: float) -> Throw:
    balls = scene(name_of(phi, roll, ratio))
    run = trace(balls, at=[until], solver="newton", tolerance=tolerance)
    middle = scene(name_of(phi, roll, ratio), t_hit=0.05 + H / 4)  # the hit in the middle of a step of h/2
    fine = trace(middle, at=[SOON], solver="newton", tolerance=tolerance, step=H / 2)
    hit = hits(run, "cue", "object")
    impulse, normal = hit["impulse"][0], hit["normal"][0]
    along = float(impulse @ normal)
    return Throw(
        phi,
        roll,
        ratio,
        Shot.of(balls.to_model()),
        math.degrees(throw_of(run)),
        math.degrees(throw_of(fine)),
        float(np.linalg.norm(impulse - along * normal)) / along,
        run,
    )


def _point(h: float, tolerance: float) -> Point:
    event = (BEFORE + 0.5) * h
    balls = scene(name_of(*STUDY), t_hit=event)
    shot = Shot.of(balls.to_model())
    # Instants on the grid: whole steps after the one of the hit.
    steps = [BEFORE + 1 + round(t / h) for t in INSTANTS]
    run = trace(balls, at=[n * h for n in steps], step=h, tolerance=tolerance)
    after = np.array([n * h - event for n in steps])[:, np.newaxis, np.newaxis]
    law = impact(shot, table=True)
    velocity = np.broadcast_to(law.velocity, (len(steps), 2, 3)).copy()
    # The cue ball is thrown up and falls back on a table that holds it.
    velocity[:, :, 2] = 0.0
    start = np.array([[0.0, 0.0], 2 * shot.radius * shot.direction[:2]])
    place = start + after * velocity[:, :, :2]
    return Point(
        h,
        abs(throw_of(run) - on_table(shot)),
        error_of(run.position[1:, :, :2], place),
        error_of(run.velocity[1:, :, :2], velocity[:, :, :2]),
        run.unconverged,
    )
