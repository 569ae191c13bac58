"""Appendix A: Algorithm 1, line by line, in numbers that the core gives on problems with known discrete solutions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from carom.arrays import F64
from carom.many.order import Order, error_of, order_of
from carom.reproduce import study
from carom.reproduce.analytic.approach import Approach
from carom.reproduce.analytic.generalized_alpha import GeneralizedAlpha, radius_of, scaled
from carom.reproduce.document import Context, Curve, Example, Figure, NotConverged, Row
from carom.reproduce.memory import trace
from carom.reproduce.study import row
from carom.result.record import Memory
from carom.run.loop import advance, begin, drive
from carom.run.sinks import Recorder
from carom.scene.plan import Plan
from carom.scene.scene import Scene

if TYPE_CHECKING:
    from carom._core import Simulation


ID = "A"
OSCILLATOR, THROWN, BALLS = "A_oscillator.toml", "A_thrown.toml", "5.4_three_balls.toml"
RADII = (0.0, 0.5, 0.8, 0.99)
#: Values of h omega from which the spectral radius at infinity is read.
STIFF = (5.0, 10.0)
STEPS = (0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
QUICK = (0.1, 0.05, 0.02, 0.01)


def scene(name: str, case: str | None = None, **parameters: float) -> Scene:
    """A scenario with some of its parameters replaced."""
    return Scene.from_toml(Context.scenario(name), case=case, parameters=parameters)


def reproduce(context: Context) -> Example:
    """The example with all its rows and figures."""
    steps = QUICK if context.quick else STEPS
    displacement, velocity = _errors(steps)
    rows = [
        *_start(),
        *(_recursion(rho) for rho in RADII),
        *(_constant_force(rho) for rho in RADII),
        *(_at_infinity(rho) for rho in RADII),
        _order("displacement", order_of(steps, displacement)),
        _order("velocity", order_of(steps, velocity)),
        *_corrections(),
    ]
    return Example(
        id=ID,
        title="Algorithm 1",
        rows=tuple(rows),
        figures=(_radius_figure(context.quick), _order_figure(steps, displacement, velocity)),
        texts=study.paragraphs(TEXT),
        options={"oscillator": {"spectral_radius": list(RADII), "steps": list(steps)}},
        scenarios=(OSCILLATOR, THROWN, BALLS),
    )


# --- the smooth part, lines 2 to 20 and 41 --------------------------------------------------------------------------


def _omega(model: dict[str, Any]) -> float:
    [spring] = [load for load in model["loads"] if load["kind"] == "spring"]
    return float(np.sqrt(spring["stiffness"] / model["mass"][0]))


def _start() -> list[Row]:
    """Lines 2 and 3: v'_0 from the loads, a_0 = v'_0."""
    model = scene(OSCILLATOR).to_model()
    state = begin(model).state()
    exact = -(_omega(model) ** 2) * float(model["position"][0][0])
    what = {"lines 1-2: v'_0 of the oscillator": "acceleration", "line 3: a_0 of the oscillator": "pseudo"}
    return [
        row(name, "m/s^2", float(state[key][0, 0]), 1e-12, "rounding", exact=exact)
        for name, key in what.items()
    ]


def _recursion(rho: float) -> Row:
    """Lines 5 to 20 and 41: q, v and a of a period against the same recursion as a matrix."""
    balls = scene(OSCILLATOR).with_options(spectral_radius=rho)
    model, h = balls.to_model(), balls.run.step
    simulation, omega = begin(model), _omega(model)
    matrix = GeneralizedAlpha(rho).step(h, omega)
    q = float(model["position"][0][0])
    state, worst = np.array([q, 0.0, -(omega**2) * q]), 0.0
    units = q * np.array([1.0, omega, omega**2])
    for step in range(round(1 / h)):
        advance(simulation, step + 1, 0, [])
        state = matrix @ state
        worst = max(worst, float(np.max(np.abs(_read(simulation) - state) / units)))
    name = f"lines 5-20, 41: q, v, a over a period of the oscillator, rho_inf = {rho:g}"
    why = "tolerance of the smooth sub-problem; relative, against eqs. 6 and 7"
    return row(name, "1", worst, 1e-9, why, exact=0.0)


def _read(simulation: Simulation) -> F64:
    """(q, v, a) of the ball along x."""
    state = simulation.state()
    return np.array([state["position"][0, 0], state["velocity"][0, 0], state["pseudo"][0, 0]])


def _constant_force(rho: float) -> Row:
    """A constant force is integrated exactly whatever the spectral radius."""
    run = trace(scene(THROWN), spectral_radius=rho)
    g = float(scene(THROWN).to_model()["gravity"][2])
    t, x0, v0 = run.time, run.position[0, 0], run.velocity[0, 0]
    fall = np.array([0.0, 0.0, g])
    off_v = run.velocity[:, 0] - (v0 + t[:, np.newaxis] * fall)
    off_x = run.position[:, 0] - (x0 + t[:, np.newaxis] * v0 + 0.5 * t[:, np.newaxis] ** 2 * fall)
    worst = max(float(np.abs(off_v).max()), float(np.abs(off_x).max()))
    name = f"a constant force, largest departure, rho_inf = {rho:g}"
    return row(name, "m, m/s", worst, 1e-12, "rounding", exact=0.0)


def amplification(rho: float, h_omega: float) -> F64:
    """The matrix (3, 3) of one step of the core, for the state (q, h v, h^2 a): a column from each unit state."""
    model = scene(OSCILLATOR).to_model()
    omega, size = _omega(model), float(model["position"][0][0])
    h = h_omega / omega
    # A prediction may lie (h omega)^2 amplitudes away: the spring is so long that it does not pass its end.
    balls = scene(OSCILLATOR, length=max(10.0, h_omega**2) * size)
    model = balls.with_options(spectral_radius=rho, step=h, until=h, max_halvings=0).to_model()
    columns = []
    for unit in np.eye(3):
        simulation = begin(model)
        state = simulation.state()
        q, v, a = size * unit / np.array([1.0, h, h * h])
        for key, value in (
            ("position", q),
            ("velocity", v),
            ("pseudo", a),
            ("acceleration", -(omega**2) * q),
        ):
            state[key][0, 0] = value
        simulation.restore(state)
        ending = advance(simulation, 1, 0, [])
        if ending.kind != "done":
            raise NotConverged(f"a step of the oscillator with h omega = {h_omega:g}: {ending.outcome}")
        columns.append(_read(simulation) * np.array([1.0, h, h * h]) / size)
    return np.array(columns).T


def _at_infinity(rho: float) -> Row:
    """Eq. 7: rho_inf is the spectral radius of the scheme for h omega -> infinity."""
    # There all three eigenvalues meet in -rho_inf. Single ones are then known to the cube root of an error only; their
    # product is known as well as the matrix, and goes to its limit as 1/(h omega)^2.
    products = [abs(float(np.linalg.det(amplification(rho, x)))) for x in STIFF]
    limit = study.limit([1 / x**2 for x in STIFF], products)
    name = f"eq. 7: product of the three eigenvalues for h omega -> infinity, rho_inf = {rho:g}"
    why = f"fourth order in 1/(h omega), from {STIFF[0]:g} and {STIFF[1]:g}"
    return row(name, "1", limit, 1e-3, why, exact=rho**3)


def _errors(steps: tuple[float, ...]) -> tuple[list[float], list[float]]:
    """Eq. 45 over a period, displacement and velocity, against the cosine."""
    balls = scene(OSCILLATOR)
    model = balls.to_model()
    omega, size = _omega(model), float(model["position"][0][0])
    found: tuple[list[float], list[float]] = ([], [])
    for h in steps:
        run = trace(balls, step=h)
        exact = size * np.cos(omega * run.time), -size * omega * np.sin(omega * run.time)
        for errors, quantity, wanted in zip(found, (run.position, run.velocity), exact, strict=True):
            errors.append(error_of(quantity[:, 0, :1], wanted[:, np.newaxis]))
    return found


def _order(name: str, order: Order) -> Row:
    note = f"between neighbouring steps {', '.join(f'{pair:.2f}' for pair in order.pairwise)}"
    why = "slope of a fit; second order for every rho_inf"
    name = f"order of convergence in smooth motion, {name}"
    return row(name, "1", order.value, 0.1, why, exact=2.0, paper="second order", note=note)


# --- the corrections, lines 21 to 40 --------------------------------------------------------------------------------


def _corrections() -> list[Row]:
    """The first step of section 5.4: ball 1 slides, ball 2 rests. Both corrections have closed forms."""
    balls = scene(BALLS, "frictional").with_options(tolerance=1e-12)
    model, h = balls.to_model(), balls.run.step
    simulation, memory = begin(model), Memory()
    plan = Plan(1, 1, h, contacts=True)
    drive(simulation, plan, [Recorder(memory, plan, len(model["mass"]))])
    contacts, frame = memory.table("contacts"), simulation.frame()
    mass, g, v0 = float(model["mass"][1]), -float(model["gravity"][2]), float(model["velocity"][0][0])
    spheres = len(model["mass"])
    [resting] = np.flatnonzero((contacts["body"] == [1, spheres]).all(axis=1))
    slowing = float(Approach.of(model).slowing)
    travelled = float(frame["position"][0, 0]) - float(model["position"][0][0])
    why = "rounding; the solver is asked for 1e-12"
    nu, impulse = contacts["position_impulse"][resting, 2], contacts["impulse"][resting, 2]
    at_rest, push = mass * g * h * h / 2, mass * g * h
    way, speed, after = v0 * h - slowing * h * h / 2, v0 - slowing * h, frame["velocity"][0, 0]
    rows = (
        ("lines 22-30: nu_N of a ball at rest, m g h^2/2", "N s^2", nu, 2 * at_rest, at_rest),
        ("lines 32-40: Lambda_N of a ball at rest, m g h", "N s", impulse, push, push),
        ("line 28: way of a sliding ball in a step, v h - mu g h^2/2", "m", travelled, v0 * h, way),
        ("line 38: its velocity after it, v - mu g h", "m/s", after, v0, speed),
    )
    return [
        row(name, unit, found, 1e-10 * scale, why, exact=exact) for name, unit, found, scale, exact in rows
    ]


# --- figures --------------------------------------------------------------------------------------------------------


def _radius_figure(quick: bool) -> Figure:
    """Spectral radius against h omega: the core's matrix over that of eqs. 6 and 7."""
    fine, coarse = np.logspace(-2, 2, 121), np.logspace(-2, np.log10(STIFF[-1]), 7 if quick else 13)
    curves = []
    for i, rho in enumerate(RADII):
        scheme = GeneralizedAlpha(rho)
        exact = np.array([radius_of(scaled(scheme.step(x, 1.0), x)) for x in fine])
        core = np.array([radius_of(amplification(rho, float(x))) for x in coarse])
        curves.append(Curve(f"rho_inf = {rho:g}", fine, exact, body=i))
        curves.append(Curve(f"core, {rho:g}", coarse, core, "points", body=i))
    return Figure(
        number="radius",
        title="Spectral radius of a step",
        xlabel="h omega",
        ylabel="spectral radius",
        curves=tuple(curves),
        xscale="log",
        caption="Lines: eqs. 6 and 7 as a matrix; points: one step of the core from three states.",
    )


def _order_figure(steps: tuple[float, ...], displacement: list[float], velocity: list[float]) -> Figure:
    h = np.array(steps)
    curves = (Curve("displacement", h, np.array(displacement)), Curve("velocity", h, np.array(velocity)))
    caption = "A period of the oscillator of 1 s, rho_inf = 0.8."
    title, label = "Convergence in smooth motion", "step h in s"
    return study.convergence("order", title, curves, caption, slopes=(2.0,), xlabel=label)


TEXT = """
The algorithm of Appendix A is `step.rs` of the core, one page with the same order of lines. The rows check its lines
in numbers. The smooth part (lines 2 to 20 and 41) runs on a linear oscillator, whose recursion is a matrix of three rows. It
also runs on a thrown ball. The corrections (lines 21 to 40) run on the first step of section 5.4, where a ball slides and
another rests.

**Errata in the equations behind it.** All are slips of print: followed to the letter they contradict the text around them.

| where | printed | meant |
|---|---|---|
| eq. 6c, right side | v-check_{n+1} | its derivative, as in the term beside it: accelerations, another unit otherwise |
| line 16 | v := v-dot + dv | v := v + dv |
| line 18 | q | q-check, which is q at that stage |
| eqs. 3, 4; eq. 28 | multipliers without k_s, k_v | with them, as in eqs. 1a and 1f |
| eq. 8c | A | Lambda |
| after eq. 15 | xi_N = k nu_N + p g_N, twice | k nu_N - p g_N, as two lines above |
| eq. 26 | closing if g < tol_v | g < -tol_v: with a positive tol_v contacts at rest would count as closing |
| eq. 29, gap | 0 in the row of q | earlier impulses stay whatever the status; P stands there once, not per contact |
| eq. 30 | an increment in body axes | a spatial one, as the normals of eqs. 34 to 43: else friction turns wrong |
| eq. 42, left side | G_Nq transposed | its derivative, with rows of zeros for the rotations, which are left out |

None of them stands in the code: its equations are the corrected ones, and the rows above would show the difference.

**Departures.** The contact problems are solved for the multipliers alone (mass is diagonal), with p from each row's
own compliance: the solutions are those of eqs. 1, the iterates are not. Steps that do not converge are repeated by
other means or as two half steps, never accepted.
"""
