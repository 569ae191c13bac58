"""Section 5.2: the runs. Hits at the paper's step and at half of it, and the studies of the step."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.many.order import error_of
from carom.measure.events import slip
from carom.reproduce import study
from carom.reproduce.analytic.impact import Outcome
from carom.reproduce.analytic.single_collision import Hit, Roll, after_impact, eq_63
from carom.reproduce.analytic.table_motion import TableMotion, motion
from carom.reproduce.document import Context
from carom.reproduce.examples.two_balls import hit_step
from carom.reproduce.memory import Trace, trace
from carom.scene.scene import Scene

RULE, FREE, LOCKED = "5.2_thirty_degree_rule.toml", "5.2_spin_free.toml", "5.2_spin_locked.toml"
#: The paper's step, s.
H = 1e-4
FRACTIONS = (0.0, 0.125, 0.25, 0.5, 0.75, 0.875, 1.0)
CASES = ("mu_b=0 e=1", "mu_b=0.06 e=1", "mu_b=0 e=0.94")
SPINS = {FREE: "spin free", LOCKED: "spin locked"}
#: Slip on the cloth above which a ball counts as sliding, m/s.
SLIDING = 1e-6
#: The study of the step: steps before the hit; instants after it (s) for displacement, and for velocity: its first flight.
BEFORE = 20
INSTANTS = tuple(0.02 * k for k in range(1, 21))
IN_FLIGHT = tuple(0.005 * k for k in range(1, 8))


@dataclass(frozen=True)
class Cloth:
    """Friction of the cloth, restitution on it, gravity (m/s^2)."""

    friction: float
    restitution: float
    gravity: float


@dataclass(frozen=True)
class Path:
    """One hit of figure 6: runs at h and at h/2, the impact law and the exact motion after it, and the paper's formulas."""

    label: str
    locked: bool
    hit: Hit
    cloth: Cloth
    run: Trace
    fine: Trace
    law: Outcome
    exact: TableMotion
    printed: Roll

    def start(self, run: Trace) -> int:
        """Index of the first state after the hit."""
        return hit_step(run)

    def after(self, run: Trace) -> float:
        """Time of the hit in a run, s: the middle of its step."""
        return (self.start(run) - 0.5) * run.h

    def farthest(self, run: Trace) -> float:
        """Greatest distance, seen from above, of the cue ball from its exact place after the hit, at equal times, m."""
        n = self.start(run)
        exact = self.exact.position(run.time[n:] - self.after(run))
        return float(np.linalg.norm(run.position[n:, 0, :2] - exact[:, :2], axis=1).max())

    def sliding_time(self, run: Trace) -> float:
        """Time from the hit to rolling, s, of a cue ball that stays on the cloth."""
        slip = np.linalg.norm(slip_of(run), axis=1)
        last = int(np.flatnonzero(slip > SLIDING)[-1])
        rest = float(slip[last]) / (3.5 * self.cloth.friction * self.cloth.gravity)
        return float(run.time[last]) + rest - self.after(run)


@dataclass(frozen=True)
class Point:
    """Errors of the cue ball after the hit at one step (eq. 45)."""

    h: float
    displacement: float
    velocity: float
    unconverged: int


@dataclass(frozen=True)
class Rise:
    """Greatest rise of the energy in a step, J, under the default law and under the paper's."""

    h: float
    default: float
    printed: float


def scene(file: str, case: str, **parameters: float) -> Scene:
    """The scene of a case, some of its parameters replaced."""
    return Scene.from_toml(Context.scenario(file), case=case, parameters=parameters)


def cloth_of(balls: Scene) -> Cloth:
    """What the scenario says of the cloth."""
    model = balls.to_model()
    return Cloth(float(model["friction"][1]), float(model["restitution"][1]), -float(model["gravity"][2]))


def event_of(model: dict[str, Any], cloth: Cloth) -> float:
    """Time of the hit, s: the cue ball slides, if it does, then rolls to the origin."""
    speed, way = float(model["velocity"][0][1]), -float(model["position"][0][1])
    slip = speed + float(model["radius"][0]) * float(model["angular_velocity"][0][0])
    sliding = 2 * slip / (7 * cloth.friction * cloth.gravity)
    slowing = cloth.friction * cloth.gravity * sliding
    return sliding + (way - speed * sliding + slowing * sliding / 2) / (speed - slowing)


def slip_of(run: Trace) -> F64:
    """Velocity of the lowest point of the cue ball, (T, 2), m/s (eq. 64 with its sign corrected)."""
    cue = run["cue"]
    return slip(cue.velocity, cue.angular_velocity, cue.radius, [0.0, 0.0, 1.0])[:, :2]


def deflection_of(run: Trace) -> float:
    """Angle from +y to the velocity of the cue ball at the end, towards +x, deg."""
    vx, vy, _ = run["cue"].velocity[-1]
    return math.degrees(math.atan2(vx, vy))


def deflections(context: Context, tolerance: float) -> dict[float, Trace]:
    """The seven hits of figure 5b, by hit fraction."""
    found = {}
    for fraction in FRACTIONS:
        balls = scene(RULE, f"f={fraction:g}")
        found[fraction] = study.counted(balls, solver="newton", tolerance=tolerance)
    return found


def path(file: str, case: str, tolerance: float, label: str = "") -> Path:
    """One hit at the paper's step and at half of it, with the hit in the middle of a step of either."""
    balls = scene(file, case)
    model = balls.to_model()
    hit, cloth, locked = Hit.of(model), cloth_of(balls), file == LOCKED
    run = trace(balls, solver="newton", tolerance=tolerance)
    half = scene(file, case, t_hit=event_of(model, cloth) - H / 4)
    fine = trace(half, solver="newton", tolerance=tolerance, step=H / 2)
    law = after_impact(hit, locked=locked, table_friction=cloth.friction)
    exact = _exact(hit, cloth, law, float(run.time[-1]))
    velocity, spin = eq_63(hit)
    printed = Roll(velocity, spin, hit.radius, cloth.friction, cloth.gravity)
    return Path(label or f"{case}, {SPINS[file]}", locked, hit, cloth, run, fine, law, exact, printed)


def paths(context: Context) -> list[Path]:
    """The hits of figure 6, spin locked and spin free."""
    tolerance = study.default_tolerance(context)
    return [path(file, case, tolerance) for file in (LOCKED, FREE) for case in CASES]


def loose(context: Context) -> list[Trace]:
    """All hits at the paper's tolerance: their last states, and what was counted."""
    run: dict[str, Any] = {"solver": "newton", "tolerance": study.PAPER_TOLERANCE}
    return [study.counted(balls, **run) for balls in _hits()]


def as_printed(context: Context) -> list[Trace]:
    """The same by the paper's law, with eq. 44 alone to end the iterations."""
    return [study.counted(balls, **study.AS_PRINTED) for balls in _hits()]


def _hits() -> list[Scene]:
    """Seven hit fractions, six hits of figure 6, that of figure 7."""
    named = [(RULE, f"f={fraction:g}") for fraction in FRACTIONS]
    named += [(file, case) for file in (LOCKED, FREE) for case in CASES] + [(LOCKED, "energy")]
    return [scene(file, case) for file, case in named]


def points(context: Context) -> list[Point]:
    """The case of figure 9 at several steps, coarse first, against the impact law and the exact motion after it."""
    steps = [4e-4 / 2**k for k in range(4 if context.quick else 6)]
    return [_point(h, study.default_tolerance(context)) for h in steps]


def rises(context: Context) -> list[Rise]:
    """The half-ball hit without friction between the balls, e_N = 1: energy under both laws at several steps."""
    found = []
    for h in [4e-4 / 2**k for k in range(3 if context.quick else 5)]:
        balls = scene(RULE, "f=0.5", t_hit=(BEFORE + 0.5) * h)
        end = (BEFORE + 10) * h
        default, printed = (
            trace(balls, at=[end], step=h, impact=law).monitors["energy"]["max_rise"]
            for law in ("sequence", "sequence-paper")
        )
        found.append(Rise(h, float(default), float(printed)))
    return found


def _exact(hit: Hit, cloth: Cloth, law: Outcome, until: float) -> TableMotion:
    # Rounding of the impact law must not start the ball into the cloth.
    velocity = law.velocity[0] * [1.0, 1.0, float(law.velocity[0, 2] > SLIDING)]
    return motion(
        velocity,
        law.spin[0],
        radius=hit.radius,
        friction=cloth.friction,
        restitution=cloth.restitution,
        gravity=cloth.gravity,
        until=until,
    )


def _point(h: float, tolerance: float) -> Point:
    event = (BEFORE + 0.5) * h
    balls = scene(LOCKED, "convergence", t_hit=event)
    hit, cloth = Hit.of(balls.to_model()), cloth_of(balls)
    law = after_impact(hit, locked=True, table_friction=cloth.friction)
    exact = _exact(hit, cloth, law, 2 * INSTANTS[-1])
    far, near = ([BEFORE + 1 + round(t / h) for t in times] for times in (INSTANTS, IN_FLIGHT))
    run = trace(balls, at=[n * h for n in sorted({*far, *near})], step=h, tolerance=tolerance)

    def at(steps: list[int]) -> tuple[list[int], F64]:
        return [run.index(n * h) for n in steps], np.array([n * h - event for n in steps])

    rows, after = at(far)
    displacement = error_of(run.position[rows, 0, :2], exact.position(after)[:, :2])
    rows, after = at(near)
    velocity = error_of(run.velocity[rows, 0], exact.velocity(after))
    return Point(h, displacement, velocity, run.unconverged)
