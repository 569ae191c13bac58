"""The billiard break of the paper (section 5.6), simulated and held against what the paper says of it.

Every number in the column of Carom is computed from the results of a run; the paper's are quoted here and nowhere else.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carom.arrays import F64
from carom.errors import CaromError
from carom.measure import events
from carom.reproduce.analytic.approach import Approach
from carom.result.directory import RunDir
from carom.run.launch import launch, relaunch
from carom.run.result import Result
from carom.run.sinks import Interrupt
from carom.scene.scene import Scene
from carom.text import WIDTH, table

CASES = ("5.6_break", "5.6_break_rolling")
CUE, APEX, LEFT, RIGHT = "ball2", "ball3", "ball4", "ball5"

#: The case with rolling resistance is continued in portions of this until all balls rest, s.
PORTION, LONGEST = 3.0, 30.0
#: A ball rests if it neither moves nor rolls faster, m/s. (Spin about the vertical is left out: without spinning friction
#: nothing stops it, and nothing in the paper's figures shows it.)
REST_SPEED = 1e-6
#: A ball is on the bed if its lowest point is nearer than this many radii.
TOUCHING = 1e-6
#: The order of convergence is read from residuals near enough to the solution and above rounding.
CONVERGING, ROUNDING = 1e-2, 1e-14

# What the paper prints.
PAPER_CONTACT_TIME = 0.114  # s
PAPER_ITERATIONS = {"smooth": (1, 1), "position": (7, 2), "velocity": (4, 1)}  # greatest, mean
PAPER_COMPUTING_S, PENALTY_COMPUTING_S = 40.0, 25000.0


@dataclass(frozen=True)
class Row:
    """One line of the comparison. `value` and `reference` are numbers where there are any."""

    quantity: str
    paper: str
    carom: str
    difference: str
    value: float | None = None
    reference: float | None = None
    exact: str = ""
    """What the exact method has there, where the line is about the motion."""


def scenario(case: str) -> Path:
    """The scenario file of a case, as it comes with Carom."""
    path = Path(__file__).parents[1] / "scenarios" / "paper" / f"{case}.toml"
    if not path.exists():
        raise CaromError(f"the scenario {path.name} is missing from this installation of Carom")
    return path


def simulate(case: str, out: Path, *, progress: Callable[..., None] | None = None) -> Result:
    """Run a case into the directory `out`, on until all balls rest if they are slowed down by rolling resistance."""
    scene = Scene.from_toml(scenario(case))
    scene.validate()
    stop = Interrupt()
    path = scenario(case)
    result = launch(
        scene, lambda: RunDir.create(out, force=True), stop=stop, progress=progress, source=path.name
    )
    if case.endswith("rolling"):
        until = float(result.time[-1])
        while result.outcome.ok and len(_rested(result)) < len(result.names) and until < LONGEST:
            until += PORTION
            result.close()
            result = relaunch(RunDir.open(out), {"until": until}, stop=stop, progress=progress)
    return result


def compare(result: Result, exact: Result | None = None) -> list[Row]:
    """The lines of the comparison for either case, beside those of a run of it by the exact method (`exactly`)."""
    rows = [*_motion(result), *_solver(result), *_totals(result)]
    if exact is None:
        return rows
    found = {row.quantity: row.carom for row in (*_motion(exact), *_totals(exact))}
    return [replace(row, exact=found.get(row.quantity, "")) for row in rows]


def exactly(result: Result) -> Result:
    """The same scene by method `events`, with the same frames."""
    scene = result.scene.with_options(method="events", until=float(result.time[-1]))
    return launch(scene, None, stop=Interrupt())


def _motion(result: Result) -> list[Row]:
    rows = [*_contact(result), *_after(result), _mirror(result)]
    return rows + (_rest(result) if _way(result).rho > 0 else [_rolling(result)])


def _totals(result: Result) -> list[Row]:
    return [_penetration(result), _energy(result), _computing_time(result)]


def first_contact(result: Result, a: str, b: str) -> events.Meeting:
    """When two balls first meet."""
    hits = events.hits(result, a, b)
    if not len(hits):
        raise CaromError(f"{a} and {b} never met in {result.origin}")
    # The cue ball slides and loses speed on the way: its own deceleration makes the time exact to rounding.
    slides = slip(result, a)[events.frame_before(result, int(hits["step"][0]))] > REST_SPEED
    return events.meeting(result, a, b, _way(result).slowing if slides else 0.0)


def slip(result: Result, name: str) -> F64:
    """Speed of the lowest point of a ball relative to the bed, (T,), m/s; NaN while the ball is in the air."""
    body = result[name]
    along = events.slip(body.velocity, body.angular_velocity, body.radius, _up(result))
    speed = np.linalg.norm(along, axis=1)
    return np.where(height(result, name) < TOUCHING * body.radius, speed, np.nan)


def height(result: Result, name: str) -> F64:
    """Height of the lowest point of a ball above the bed, (T,), m."""
    body = result[name]
    up = _up(result)
    bed = result.plane_names.index("bed")
    return np.asarray((body.position - result.planes["point"][bed]) @ up - body.radius)


def _up(result: Result) -> F64:
    return np.asarray(-result.gravity / np.linalg.norm(result.gravity))


def _contact(result: Result) -> list[Row]:
    time, speed, _ = first_contact(result, CUE, APEX)
    way = _way(result)
    return [
        _number(
            "contact of balls 2 and 3 (s)",
            f"{PAPER_CONTACT_TIME:g}",
            time,
            way.contact_time,
            "exact {:.5f}",
            ".5f",
        ),
        _number(
            "speed of ball 2 there (m/s)", "below 10.729", speed, way.contact_speed, "exact {:.4f}", ".4f"
        ),
    ]


def _way(result: Result) -> Approach:
    """How the cue ball comes to the apex ball, in closed form."""
    return Approach.of(result.scene.to_model())


def _after(result: Result) -> list[Row]:
    _, _, step = first_contact(result, CUE, APEX)
    # The velocities of the multiple impact: at the end of the step in which it happens.
    frame = int(np.searchsorted(np.asarray(result.step), step))
    cue, apex = (float(result[name].velocity[frame, 0]) for name in (CUE, APEX))
    before = float(result[CUE].speed[frame - 1])
    time, rolling = _begins_to_roll(result, APEX, frame)
    rows = [
        _words("ball 2 after the impact", "back", f"{cue:+.3f} m/s", cue < 0),
        _words("ball 3 after the impact", "forward, slow", f"{apex:+.3f} m/s", 0 < apex < 0.1 * before),
        _words("ball 3 when it begins to roll", "-", f"{rolling:+.3f} m/s, t = {time:.3f} s", None),
    ]
    jump = height(result, CUE)
    air = np.flatnonzero(jump > TOUCHING * result[CUE].radius)
    told = "no"
    if len(air):
        start, end = float(result.time[air[0]]), _landing(np.asarray(result.time), air)
        told = f"{1e3 * float(jump.max()):.2g} mm high, t = {start:.3f} to {end:.3f} s"
    # The paper shows the jump of the case without rolling resistance only (fig. 25).
    if _way(result).rho > 0:
        return [*rows, _words("ball 2 jumps", "-", told, None)]
    return [*rows, _words("ball 2 jumps", "yes", told, len(air) > 0)]


def _begins_to_roll(result: Result, name: str, frame: int) -> tuple[float, float]:
    """Time (s) and forward speed (m/s) in the first frame after `frame` in which a ball rolls without slipping."""
    rolls = np.flatnonzero(slip(result, name)[frame:] < REST_SPEED)
    first = frame + int(rolls[0]) if len(rolls) else len(result.time) - 1
    return float(result.time[first]), float(result[name].velocity[first, 0])


def _landing(time: F64, air: NDArray[np.intp]) -> float:
    ends = np.flatnonzero(np.diff(air) > 1)
    last = int(air[ends[0]] if len(ends) else air[-1])
    return float(time[min(last + 1, len(time) - 1)])


def _mirror(result: Result) -> Row:
    left, right = result[LEFT], result[RIGHT]
    axis = result[CUE].position[0, 1]
    flip = np.array([1.0, -1.0, 1.0])
    mirrored = (right.position - [0.0, axis, 0.0]) * flip + [0.0, axis, 0.0]
    off = float(np.max(np.abs(left.position - mirrored)))
    return _words("balls 4 and 5 mirror images", "yes", f"to {off:.1g} m", off < 1e-9)


def _rolling(result: Result) -> Row:
    worst = [float(slip(result, name)[-1]) for name in result.names]
    on_bed = [w for w in worst if not math.isnan(w)]
    told = f"slip at most {max(on_bed, default=math.nan):.1g} m/s, {len(on_bed)} of {len(worst)} balls on the bed"
    return _words(
        f"pure rolling at t = {float(result.time[-1]):g} s", "yes", told, max(on_bed, default=1.0) < 1e-6
    )


def _rested(result: Result) -> dict[str, float]:
    """Since when the balls that came to rest lie still, s."""
    return {event.body: event.time for event in events.rest(result, speed=REST_SPEED, ignore_spin=True)}


def _rest(result: Result) -> list[Row]:
    rows = []
    came = _rested(result)
    for name in result.names:
        time = came.get(name)
        spin = abs(float(result[name].angular_velocity[-1] @ _up(result)))
        told = f"t = {time:.3f} s" if time is not None else f"moves at {float(result.time[-1]):g} s"
        if time is not None and spin > REST_SPEED:
            told += f", spins on at {spin:.1f} rad/s"
        rows.append(_words(f"{name.replace('ball', 'ball ')} at rest", "yes", told, time is not None))
    return rows


def _solver(result: Result) -> list[Row]:
    iterations = result.summary["iterations"]
    rows = []
    for level, (most, mean) in PAPER_ITERATIONS.items():
        found = iterations[level]
        rows.append(
            Row(
                f"iterations, {level}: max / mean",
                f"{most} / {mean}",
                f"{found['max']:g} / {found['mean']:.2f}",
                f"{found['max'] - most:+g} / {found['mean'] - mean:+.2f}",
                float(found["max"]),
                float(most),
            )
        )
    found = newton_order(result)
    if found is None:
        return [*rows, _words("convergence at the impact step", "quadratic", "-", None)]
    order, (a, b, c) = found
    told = f"order {order:.2f} (residuals {a:.0e}, {b:.0e}, {c:.0e})"
    verdict = "agrees" if order > 1.7 else "differs"
    # With rolling resistance discs are full at a tiny slip, and the quadratic phase begins late: where even the next
    # residual of a quadratic sequence, C c^2 with C = c / b^2, is rounding, no order can be read from what is left.
    if 1.0 < order <= 1.7 and c**3 / b**2 < ROUNDING:
        verdict = "superlinear, next is rounding"
    return [*rows, Row("convergence at the impact step", "quadratic", told, verdict, order, 2.0)]


def newton_order(result: Result) -> tuple[float, tuple[float, float, float]] | None:
    """Order of convergence of the position sub-problem in the step of the impact, and the residuals that show it.

    It is that of the last three consecutive residuals that fall, all between `CONVERGING` and `ROUNDING`.
    """
    _, _, step = first_contact(result, CUE, APEX)
    histories = [h for h in result.residuals.history(step, "position") if len(h) >= 3]
    if not histories:
        return None
    useful = [float(r) for r in max(histories, key=len) if ROUNDING < r < CONVERGING]
    last: tuple[float, tuple[float, float, float]] | None = None
    for three in zip(useful, useful[1:], useful[2:], strict=False):
        a, b, c = map(math.log, three)
        if c < b < a:
            last = (c - b) / (b - a), three
    return last


def _penetration(result: Result) -> Row:
    deepest = max(0.0, float(result.summary["penetration_max"]))
    radius = float(np.min(result.bodies["radius"]))
    return _words(
        "penetration after a step", "none", f"{deepest / radius:.1g} radii", deepest < 1e-10 * radius
    )


def _energy(result: Result) -> Row:
    energy = result.summary["energy"]
    told = f"{energy['initial']:.4f} to {energy['final']:.4f} J, rise {max(0.0, energy['max_rise']):.1g} J"
    return _words("energy", "", told, energy["max_rise"] <= 1e-12 * energy["initial"])


def _computing_time(result: Result) -> Row:
    core = float(result.summary["core_s"])
    per = f" for {float(result.time[-1]):g} s" if result.time[-1] > 3.001 else ""
    return Row(
        "computing time",
        f"{PAPER_COMPUTING_S:g} s (penalty method {PENALTY_COMPUTING_S:g} s)",
        f"{1e3 * core:.3g} ms{per}",
        f"{PAPER_COMPUTING_S / core:.2g} times faster",
        core,
        PAPER_COMPUTING_S,
    )


def _number(quantity: str, paper: str, value: float, exact: float, words: str, spec: str) -> Row:
    told = f"{paper} ({words.format(exact)})"
    return Row(quantity, told, format(value, spec), f"{value - exact:+.1g}", value, exact)


def _words(quantity: str, paper: str, carom: str, agrees: bool | None) -> Row:
    verdict = "" if agrees is None else ("agrees" if agrees else "differs")
    return Row(quantity, paper or "-", carom, verdict)


def as_table(rows: Sequence[Row], width: int = WIDTH) -> str:
    """The comparison in lines of at most `width` characters: quantity, paper, Carom, the exact method where it is there,
    difference; long cells wrap.
    """
    columns = {
        "quantity": [r.quantity for r in rows],
        "paper": [r.paper for r in rows],
        "Carom": [r.carom for r in rows],
        "exact": [r.exact for r in rows],
        "difference": [r.difference for r in rows],
    }
    shown = {head: cells for head, cells in columns.items() if head != "exact" or any(cells)}
    lines = zip(*shown.values(), strict=True)
    return table([tuple(shown), *lines], width, head=True, left=range(len(shown)))


def as_json(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """The comparison as plain values."""
    return [vars(row) for row in rows]
