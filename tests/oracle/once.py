"""Loads solved once (`position_friction = "once"`, section 12 of the specification), for contacts alone.

Neither joints nor loads that follow the motion, and no energy safeguard: those of the core act on this law as on the
printed one. A sequence that does not die out is refused.
"""

from dataclasses import dataclass, field

import numpy as np

from .contact import Element, element, gap_and_normal
from .impact import impact_problem
from .island import CLOSING_SPEED, Island, connected
from .model import F64, TOUCH, Model, Pair, State
from .newton import NotConverged, solve
from .problem import Layout, PositionProblem, VelocityProblem
from .smooth import FreeMotion

TURN_SHARE = 0.1
MOST_PROBLEMS = 500


@dataclass
class Loads:
    """Contacts of R: their multipliers P0 by pair (k,) [N s], and the normals with which these were found."""

    multipliers: dict[tuple[int, int], F64] = field(default_factory=dict)
    normals: dict[tuple[int, int], F64] = field(default_factory=dict)


def step(model: Model, state: State, free: FreeMotion) -> tuple[F64, F64, F64]:
    """Centres (N,3), displacement of the whole step (6N,), and velocities u_{n+1} (6N,)."""
    if model.joints or model.following or model.options.energy_safeguard:
        raise ValueError("loads once: the reference knows neither joints, springs and drag nor the safeguard")
    half = 0.5 * model.options.step
    start = {pair.key: element(model, pair, state.x, state.u) for pair in model.pairs}
    x_check = state.x + free.d_check.reshape(-1, 6)[:, :3]
    loads = _solve_loads(model, state, free, start, x_check)
    middle = {key: _middle(model, start[key], x_check) for key in loads.multipliers}
    w0 = _jump(model, middle, loads.multipliers)
    displacement = free.d_check + half * w0
    by_loads = state.x + displacement.reshape(-1, 6)[:, :3]
    x, pressed = _along_normals(model, state.x, displacement, loads, half)
    displacement.reshape(-1, 6)[:, :3] = x - state.x
    closed = [
        pair
        for pair in model.pairs
        if pair.key in pressed
        or gap_and_normal(model, pair, x)[0] <= TOUCH * pair.radius
        or (pair.key in loads.multipliers and gap_and_normal(model, pair, by_loads)[0] <= TOUCH * pair.radius)
    ]
    u = free.u_check.copy()
    for group in _islands(closed):
        u += _velocities(model, state, free, [start[pair.key] for pair in group], x, loads)
    return x, displacement, u


def _islands(pairs: list[Pair]) -> list[list[Pair]]:
    return [[pairs[i] for i in group] for group in connected([pair.bodies for pair in pairs])]


def _at(model: Model, e: Element, x: F64) -> Element:
    """The element with the frame at centres x (N,3), turned from that of t_n the shortest way; bounds stay."""
    return _turned(model, e, x, gap_and_normal(model, e.pair, x)[1])


def _turned(model: Model, e: Element, x: F64, n: F64) -> Element:
    turn = (e.normal + n) / (1.0 + e.normal @ n)
    turned = element(model, e.pair, x, None, np.stack([t - (n @ t) * turn for t in e.tangents]), n)
    return Element(e.pair, n, turned.tangents, turned.rows, e.discs, e.delassus)


def _middle(model: Model, e: Element, x: F64) -> Element:
    """The element with the frame half-way between those at t_n and at x."""
    both = e.normal + gap_and_normal(model, e.pair, x)[1]
    return _turned(model, e, x, both / np.linalg.norm(both))


def _jump(
    model: Model, along: dict[tuple[int, int], Element], multipliers: dict[tuple[int, int], F64]
) -> F64:
    """M^-1 Gm^T P0, (6N,)."""
    force = np.zeros_like(model.mass_diagonal)
    for key, given in multipliers.items():
        for k, body in enumerate(along[key].pair.bodies):
            force[6 * body : 6 * body + 6] += along[key].rows[:, 6 * k : 6 * k + 6].T @ given
    return force / model.mass_diagonal


def _solve_loads(
    model: Model, state: State, free: FreeMotion, start: dict[tuple[int, int], Element], x: F64
) -> Loads:
    change = np.linalg.norm((free.u_check - state.u).reshape(-1, 6)[:, :3], axis=1)
    sizes = np.linalg.norm(state.u.reshape(-1, 2, 3), axis=2)
    speed = sizes[:, 0] + model.radius * sizes[:, 1]
    pairs = []
    for pair in model.pairs:
        e = start[pair.key]
        opening = float(e.rows[0] @ np.concatenate([state.u[6 * b : 6 * b + 6] for b in pair.bodies]))
        load = float(np.max(change[list(pair.bodies)]))
        reach = TOUCH * pair.radius + 0.5 * model.options.step * load
        slow = CLOSING_SPEED * float(np.max(speed[list(pair.bodies)]))
        held = gap_and_normal(model, pair, state.x)[0] <= reach and opening <= load + slow
        if held or gap_and_normal(model, pair, x)[0] <= TOUCH * pair.radius:
            pairs.append(pair)
    found = Loads()
    for group in _islands(pairs):
        first = [start[pair.key] for pair in group]
        island = Island(model, [_at(model, e, x) for e in first], x, state.u, free.u_check)
        tolerance = island.closing_tolerance()
        if tolerance is None:
            continue
        old = Layout(model, first).frozen_gradient()[island.layout.start] @ island.u_n
        resting = np.flatnonzero(old >= -tolerance).tolist()
        closing = island.normal_velocity(island.u_check) < -tolerance
        solved = _plastic(island, [_middle(model, e, x) for e in first], resting, any(closing[resting]))
        for i in resting:
            key = group[i].key
            found.multipliers[key] = solved[island.layout.slices[i]]
            found.normals[key] = island.elements[i].normal
    return found


def _plastic(island: Island, middle: list[Element], members: list[int], loaded: bool) -> F64:
    """P0 (m,) of the given contacts of an island along the rows of `middle`."""
    result = np.zeros(island.layout.rows)
    if loaded:
        usual, columns, rows = island.problem(members, island.plastic, result)
        along = Layout(island.model, [middle[i] for i in members]).frozen_gradient()
        problem = VelocityProblem(
            usual.layout,
            usual.gradient,
            island.u_check[columns],
            island.plastic[rows],
            usual.fixed,
            usual.floor,
        )
        problem.along = along
        what = f"loads, spheres {island.layout.bodies}"
        result[rows] = solve(problem, np.zeros(len(columns)), island.model.options, what).multipliers
    return result


class _Normals(PositionProblem):
    """Positions along normals from where the loads have brought the spheres; multipliers count from `of_loads` (m,)."""

    of_loads: F64

    def forces(self, u: F64) -> tuple[F64, F64 | None]:
        _, gradient = self.kinematics(u)
        turning = self.curvature(u, self.of_loads)
        return -gradient.T @ self.of_loads, None if turning is None else -turning


def _along_normals(
    model: Model, x_n: F64, displacement: F64, loads: Loads, half: float
) -> tuple[F64, set[tuple[int, int]]]:
    """Corrected centres (N,3), and the pairs with a multiplier or a load."""
    x = x_n + displacement.reshape(-1, 6)[:, :3]
    pressed = {key for key, given in loads.multipliers.items() if given[0] > 0.0}
    elements = []
    for pair in model.pairs:
        e = element(model, pair, x, np.zeros_like(displacement))
        elements.append(Element(pair, e.normal, e.tangents, e.rows[:1], (), e.delassus[:1]))
    if not elements:
        return x, pressed
    layout = Layout(model, elements)
    problem = _Normals(model, layout, x, displacement)
    none = np.zeros(1)
    problem.of_loads = np.array([half * loads.multipliers.get(e.pair.key, none)[0] for e in elements])
    found = solve(problem, np.zeros(len(layout.dofs)), model.options, "positions along normals")
    pressed |= {e.pair.key for e, nu in zip(elements, found.multipliers, strict=True) if nu > 0.0}
    return problem.centres(found.u), pressed


def _velocities(
    model: Model, state: State, free: FreeMotion, first: list[Element], x: F64, loads: Loads
) -> F64:
    """Jump of the velocities (6N,) of an island of closed contacts."""
    island = Island(model, [_at(model, e, x) for e in first], x, state.u, free.u_check)
    lay, keys = island.layout, [e.pair.key for e in first]
    middle = [_middle(model, e, x) for e in first]
    tolerance = island.closing_tolerance()
    total = np.zeros_like(free.u_check)
    if tolerance is None:
        return total
    resting = [i for i, key in enumerate(keys) if key in loads.multipliers]
    given = {keys[i]: loads.multipliers[keys[i]] for i in resting}
    closing = island.normal_velocity(island.u_check) < -tolerance
    loaded = {i for i in resting if closing[i]}
    turned = [np.linalg.norm(island.elements[i].normal - loads.normals[keys[i]]) for i in resting]
    if np.any(np.array(turned) > TURN_SHARE * CLOSING_SPEED):
        again = bool(loaded) or any(g[0] > 0.0 for g in given.values())
        solved = _plastic(island, middle, resting, again)
        given = {keys[i]: solved[lay.slices[i]] for i in resting}
    along = {e.pair.key: e for e in middle}
    offset = _jump(model, along, given)[lay.dofs]
    u_check, kept, impulses = island.u_check, offset, np.zeros(lay.rows)
    for number in range(1, MOST_PROBLEMS):
        jump = kept + island.jump(impulses)
        members = set(np.flatnonzero(island.normal_velocity(u_check + jump) < -tolerance).tolist())
        if not members:
            total[lay.dofs] = jump
            return total
        if number == 1:
            members |= loaded
            given = {key: g for key, g in given.items() if keys.index(key) not in members}
            kept = _jump(model, along, given)[lay.dofs]
            island.u_check = u_check + kept
        u_minus = island.u_n + jump - offset if number > 1 else island.u_n
        added, _ = impact_problem(
            island, sorted(members), impulses, impulses, u_minus, tolerance, str(number)
        )
        impulses = impulses + added
    raise NotConverged(f"sequence of spheres {lay.bodies}", [np.inf])
