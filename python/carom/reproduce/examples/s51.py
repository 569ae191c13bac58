"""Section 5.1: two touching spheres, one driven by a growing torque; they stick, then slip. Figures 3 and 4."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carom.arrays import F64
from carom.many.order import error_of, order_of
from carom.measure.contacts import along_and_across
from carom.reproduce import study
from carom.reproduce.analytic.sphere_pair import SpherePair
from carom.reproduce.document import Context, Curve, Example, Figure, Row
from carom.reproduce.memory import Trace, trace
from carom.run.simulate import simulate
from carom.scene.scene import Scene

ID = "5.1"
SCENARIO = "5.1_torque.toml"
#: The paper's step and duration, s.
H, UNTIL = 1e-3, 1.0
#: What section 5.1 prints: forces (N), end of sticking (s), iterations (greatest, mean), no line search.
PAPER_NORMAL, PAPER_FRICTION, PAPER_T_LIM = 9.8, 2.94, 0.294
PAPER_COUNTS: study.Printed = {
    "smooth": (1, 1),
    "position": (3, 2),
    "velocity": (3, 2),
    "line_search": (0, 0),
}
#: Steps of the study: t_lim = 0.294 s is a whole number of each. And beside them, steps that have it in their middle.
STEPS = (2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4)
MIDDLE = 0.5


@dataclass(frozen=True)
class Point:
    """Errors of sphere A (eq. 45) at one step: angle and angular velocity, over the run and while the contact sticks."""

    h: float
    angle: float
    velocity: float
    sticking: float
    unconverged: int


def reproduce(context: Context) -> Example:
    """Table, figures 3 and 4."""
    tolerance = study.default_tolerance(context)
    spheres = scene()
    pair = SpherePair.of(spheres.to_model())
    loose = trace(spheres, solver="newton", tolerance=study.PAPER_TOLERANCE)
    run = trace(spheres, solver="newton", tolerance=tolerance)
    force = contact_forces(tolerance)
    on_grid = [_point(h, tolerance) for h in STEPS[: 3 if context.quick else None]]
    near = study.grid_steps(UNTIL, pair.t_lim, STEPS[: 3 if context.quick else None], MIDDLE)
    between = [_point(h, tolerance) for h in near]
    rows = [
        *_force_rows(pair, force),
        *_angle_rows(pair, run),
        *_place_rows(run),
        *_energy_rows(pair, run),
        *_order_rows(on_grid, between),
        study.unconverged(study.PAPER_TOLERANCE, [loose]),
        study.unconverged(tolerance, [run]),
    ]
    return Example(
        ID,
        "Frictional contact between two spheres",
        tuple(rows),
        figures=(
            _figure_3a(pair, force),
            _figure_3b(pair, run),
            *(_figure_4(on_grid, between, number) for number in ("4a", "4b")),
        ),
        counts=(
            study.counts("all steps", loose, study.PAPER_TOLERANCE, PAPER_COUNTS),
            study.counts("all steps", run, tolerance, PAPER_COUNTS),
        ),
        texts=TEXTS,
        options={
            "table": {"step": H, "solver": "newton", "tolerance": tolerance},
            "study of the step": {"step": [p.h for p in [*on_grid, *between]], "tolerance": tolerance},
        },
        scenarios=(SCENARIO,),
    )


def scene() -> Scene:
    """The scenario of this section."""
    return Scene.from_toml(Context.scenario(SCENARIO))


def angle(run: Trace, body: str) -> F64:
    """Angle by which a sphere has turned about y, (T,), rad, whole turns counted."""
    turn = run[body].orientation
    return np.unwrap(2 * np.arctan2(turn[:, 2], turn[:, 0]))


def contact_forces(tolerance: float) -> F64:
    """Middle of every step (s), normal and friction force in it (N), (steps, 3): impulses over h, at the paper's h."""
    run = simulate(scene(), tolerance=tolerance, step=H, until=UNTIL, every=1, contacts=True)
    contacts = run.contacts
    along, across = along_and_across(contacts["impulse"], contacts["normal"])
    return np.column_stack([contacts["time"] - H / 2, along / H, across / H])


def _point(h: float, tolerance: float) -> Point:
    spheres = scene()
    pair = SpherePair.of(spheres.to_model())
    run = trace(spheres, step=h, tolerance=tolerance)
    found_w, found = run["A"].angular_velocity[:, 1], angle(run, "A")
    exact_w, exact = pair.angular_velocity_a(run.time), pair.angle_a(run.time)
    sticks = run.time < pair.t_lim - h

    def error(a: F64, b: F64) -> float:
        return error_of(a[:, np.newaxis], b[:, np.newaxis])

    return Point(
        h,
        error(found, exact),
        error(found_w, exact_w),
        error(found_w[sticks], exact_w[sticks]),
        run.unconverged,
    )


# --- rows -----------------------------------------------------------------------------------------------------------


def _force_rows(pair: SpherePair, force: F64) -> list[Row]:
    time, normal, friction = force.T
    worst = float(normal[np.argmax(np.abs(normal - pair.normal_force))])
    # Where the line of growing friction, through the middle of the sticking phase, meets the plateau.
    plateau = float(friction[-1])
    rising = time < 0.9 * pair.t_lim
    slope, at_zero = np.polyfit(time[rising], friction[rising], 1)
    found = (plateau - at_zero) / slope
    bound = 1e-8 * pair.normal_force
    return [
        Row(
            "normal force f_N, the step farthest from the exact one", "N", PAPER_NORMAL, pair.normal_force,
            worst, bound, "tolerance of the solver", "analytic"),
        Row(
            "greatest friction force f_T", "N", PAPER_FRICTION, pair.greatest_friction_force,
            float(friction.max()), bound, "tolerance of the solver", "analytic"),
        Row(
            "end of sticking t_lim", "s", PAPER_T_LIM, pair.t_lim, float(found), H,
            "one step", "analytic", "where the growing friction force would pass its plateau"),
    ]  # fmt: skip


def _angle_rows(pair: SpherePair, run: Trace) -> list[Row]:
    """Angular velocities and angles at 1 s, printed formula, corrected one, Carom."""
    end = float(run.time[-1])
    eq_46 = "eq. 46 for t > t_lim has the factor 4 I/k where k/(4 I) is right. As printed it jumps at t_lim"
    eq_47 = (
        "eq. 47 for t > t_lim has the wrong sign in its first term and a k too many in the bracket. As printed it jumps at"
        " t_lim, and its derivative is not the angular velocity"
    )
    # The acceleration is a line with a kink; the trapezoidal rule that the scheme amounts to has an error of at most
    # h^2/12 times the change of its slope for w; angles collect it over the run, and that of w itself.
    slope = pair.rate / pair.inertia
    tolerance, origin = slope * H**2, "second order, h^2 times the slope k/I of the acceleration"
    rows = []
    table = (
        ("angular velocity of A at 1 s", "rad/s", pair.angular_velocity_a, pair.angular_velocity_a, ""),
        (
            "angular velocity of B at 1 s",
            "rad/s",
            pair.printed_angular_velocity_b,
            pair.angular_velocity_b,
            eq_46,
        ),
        ("angle of A at 1 s", "rad", pair.angle_a, pair.angle_a, ""),
        ("angle of B at 1 s", "rad", pair.printed_angle_b, pair.angle_b, eq_47),
    )
    for quantity, unit, printed, exact, note in table:
        body = quantity.split()[-4]
        found = run[body].angular_velocity[-1, 1] if unit == "rad/s" else angle(run, body)[-1]
        rows.append(
            Row(
                quantity, unit, float(printed(end)), float(exact(end)), float(found), tolerance, origin,
                "analytic", note, paper_in_error=bool(note), erratum=note.split(" for")[0])
        )  # fmt: skip
    return rows


def _place_rows(run: Trace) -> list[Row]:
    """The joints hold, and the contact neither opens nor overlaps."""
    radius = 1e-10
    moved = float(np.abs(run["B"].position - run["B"].position[0]).max())
    sideways = float(np.abs(run["A"].position[:, :2]).max())
    return [
        Row(
            "greatest displacement of the centre of B", "m", None, 0.0, moved, radius, "gap tolerance, 1e-10 r",
            "analytic"),
        Row(
            "greatest sideways displacement of A", "m", None, 0.0, sideways, radius,
            "gap tolerance, 1e-10 r", "analytic"),
        study.penetration([run]),
    ]  # fmt: skip


def _energy_rows(pair: SpherePair, run: Trace) -> list[Row]:
    """Work of the torque, less the energy that is there at the end, is the heat of friction."""
    energy = run.monitors["energy"]
    heat = float(energy["initial"] + energy["work"] - energy["final"])
    # Friction works on the slip, which is the difference of the angles: there is none while the contact sticks.
    end, force = float(run.time[-1]), pair.greatest_friction_force * pair.radius
    slip = float(-pair.angle_b(end) - pair.angle_a(end))
    return [
        Row(
            "energy that friction turns into heat in 1 s", "J", None, force * slip, heat,
            2 * force * pair.rate / pair.inertia * H**2, "second order: friction moment times the bounds of the angles",
            "analytic"),
        study.energy_rise("greatest rise of energy in a step, work of the torque taken off", [run]),
    ]  # fmt: skip


def _order_rows(on_grid: list[Point], between: list[Point]) -> list[Row]:
    """The paper reports linear convergence; motion without impact has the second order of the scheme."""
    rows = []
    for name, key in (
        ("angle of A", "angle"),
        ("angular velocity of A", "velocity"),
        ("angular velocity of A while it sticks", "sticking"),
    ):
        order, other = (
            order_of([p.h for p in points], [getattr(p, key) for p in points])
            for points in (on_grid, between)
        )
        rows.append(
            Row(
                f"order of convergence, {name}", "1", "linear", 2.0, order.value, 0.1,
                "slope of a fit, second order", "analytic",
                "the paper reports a linear rate; forces are continuous here, nothing impacts, and the scheme keeps its"
                f" second order. With t_lim in the middle of a step: {other.value:.2f}",
                paper_in_error=True, erratum="order")
        )  # fmt: skip
    return rows


# --- figures --------------------------------------------------------------------------------------------------------


def _figure_3a(pair: SpherePair, force: F64) -> Figure:
    time, normal, friction = force[::5].T
    return Figure(
        "3a",
        "Contact forces",
        "time in s",
        "force in N",
        (
            Curve("normal f_N, exact", time, np.full_like(time, pair.normal_force), "line", 0),
            Curve("normal f_N, Carom", time[::8], normal[::8], "points", 0),
            Curve("friction f_T, exact", time, pair.friction_force(time), "line", 1),
            Curve("friction f_T, Carom", time[::8], friction[::8], "points", 1),
        ),
        "The normal force is the weight of A, 9.8 N. The friction force grows with the torque to 2.94 N at t_lim = 0.294 s.",
    )


def _figure_3b(pair: SpherePair, run: Trace) -> Figure:
    time = run.time[::5]
    curves = []
    for n, (body, exact) in enumerate((("A", pair.angular_velocity_a), ("B", pair.angular_velocity_b))):
        found = run[body].angular_velocity[::40, 1]
        curves += [
            Curve(f"sphere {body}, exact", time, exact(time), "line", n),
            Curve(f"sphere {body}, Carom", run.time[::40], found, "points", n),
        ]
    return Figure(
        "3b",
        "Angular velocities",
        "time in s",
        "angular velocity in rad/s",
        tuple(curves),
        "Equal and opposite while the contact sticks; then B turns on with the square of the time, and A gains speed"
        " steadily. The exact curve of B is eq. 46 with its factor corrected.",
    )


def _figure_4(on_grid: list[Point], between: list[Point], number: str) -> Figure:
    name, words = ("angle", "angle") if number == "4a" else ("velocity", "angular velocity")
    places = {"end": on_grid, "middle": between}
    return study.convergence(
        number,
        f"Convergence of the {words} of sphere A",
        (
            study.errors(
                f"t_lim {'at' if place == 'end' else 'in'} the {place} of a step", points, name, body=n
            )
            for n, (place, points) in enumerate(places.items())
        ),
        "Against the closed form. The paper shows a linear rate; second order is what the scheme has without impacts.",
        slopes=(1.0, 2.0),
    )


TEXTS = (
    "Sphere A is held by a vertical guide, sphere B by a bearing at its centre; the torque -20 t N m acts on B. The closed"
    " forms follow from the balance of angular momentum. While the contact sticks both spheres turn equally fast, so that"
    " each gets half of the torque; then friction is mu m g.",
    "Two of the four printed formulas are wrong for t > t_lim (the angular velocity and the angle of B). The corrected ones"
    " are continuous at t_lim, and the one is the derivative of the other.",
    "**Order.** The paper observes a linear rate in fig. 4. Here the acceleration is continuous, with a kink at t_lim, and"
    " no velocity jumps. The error is of second order in angle and angular velocity, wherever in a step t_lim falls.",
)
