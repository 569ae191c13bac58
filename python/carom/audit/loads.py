"""Impulses of loads and joints on each body in each interval, from their laws, the frames and the recorded reactions."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.audit import carried
from carom.audit.block import Block, Point, once
from carom.audit.cohesion import on_bodies
from carom.audit.corrections import corrections, groups
from carom.audit.data import Run
from carom.audit.forces import curvature, ends, of_contacts, pushes, shifts, strokes, together
from carom.audit.formula import law
from carom.audit.vectors import EPS, cross, dot, norm, rotated, unit


@dataclass
class Loads:
    """Loads and joints on each body over an interval: forces and moments (B, N, 6)."""

    impulse: F64
    slack: F64
    """(B, N, 2) what the impulse and the angular impulse may be off, N s and N m s."""
    spread: F64
    """(B, N, 2) sums over the steps of the sizes of impulses of given forces and moments, which may cancel in their sum."""
    varied: F64
    """(B, N, 2) sums over the steps of `h` times the changes of given forces and moments in each."""
    shift: F64
    """Displacement and turn in one step by loads that depend on the time, (B, N, 6), m and rad; nsga alone."""
    shift_slack: F64
    """(B, N, 2) m, rad."""
    shift_held: F64
    """(B, N, 2) what joints may do besides, along their directions, of which nothing is recorded at the position level."""
    unknown: Bool
    """(B, N) bodies of which the loads cannot be known."""
    alone: F64
    """(B, N, 6) the impulses of loads without joints."""
    alone_slack: F64
    """(B, N, 2) what these may be off."""


@once
def of_loads(block: Block) -> Loads:
    """Joints and loads of a block.

    Of loads that depend on the time alone the scheme's own filter (eqs. 6b-c) is evaluated exactly. Those that depend on the
    motion are known at the frames: their impulse over one step lies between the forces at its ends, with the lag of the
    filter between those of a step before, so that twice the change bounds the error. Drag and dampers are evaluated for the
    velocity without contacts too (v_check), which is off by what the contacts then give: a ball at rest on a floor has the
    drag of a fall of one step; springs for the places without contacts (q_check). Over several steps they are unknown.
    """
    run = block.run
    shape = (block.count, run.bodies)
    six, two = (*shape, 6), (*shape, 2)
    impulse, slack, spread, varied, shift, shift_slack, shift_held = (
        np.zeros(s) for s in (six, two, two, two, six, two, two)
    )
    unknown = np.zeros(shape, dtype=bool)
    found = Loads(impulse, slack, spread, varied, shift, shift_slack, shift_held, unknown, impulse, slack)
    for load in run.loads:
        if load["kind"] == "force":
            _applied(block, load, found)
        elif load["kind"] == "callable":
            found.unknown[:] = True
        elif load["kind"] == "cohesion":
            _cohesion(block, found)
        else:
            _of_motion(block, load, found)
    of_box = carried.of_block(block)
    found.impulse[..., :3] += run.mass[:, None] * of_box.velocity
    found.slack[..., 0] += run.mass * of_box.slack
    # What contacts move a body by within several steps is way against the flow, too.
    moved = strokes(block)[0] * block.dt[:, None] + run.mass * shifts(block)[0]
    several = np.where(block.single, 0.0, carried.jolted(block))[:, None] * moved
    found.slack[:, : run.balls, 0] += several[:, : run.balls]
    if run.joints:
        found.alone, found.alone_slack = found.impulse.copy(), found.slack.copy()
        _joints(block, found)
    if run.method == "moreau":
        # The theta rule moves bodies by their velocities alone, whatever changed these.
        found.shift[:] = 0.0
        if not run.options["position_projection"]:
            found.shift_slack[:] = found.shift_held[:] = 0.0
    _ways_of_walls(block, found)
    found.shift[..., :3] += of_box.way
    found.shift_slack[..., 0] += of_box.slack_way
    if run.method == "moreau":  # whose whole steps have the way of the new velocity
        share = np.where(block.single, float(run.options["theta"]) * block.dt, 0.0)
        found.shift[..., :3] -= share[:, None, None] * of_box.velocity
    return found


def _applied(block: Block, load: dict[str, Any], out: Loads) -> None:
    run, body = block.run, int(load["body"])
    scale = np.repeat([run.mass[body], run.inertia[body]], 3)
    impulse, shift = _filtered(run, (*load["force"], *load["torque"]))
    # A force may turn back within a step: where it is as large at both ends it has varied all the same.
    inner = _at_steps(run, (*load["force"], *load["torque"]), PARTS_OF_STEP)
    change = np.abs(np.diff(inner, axis=0)).reshape(-1, PARTS_OF_STEP, 6).sum(axis=1)
    # A step in parts runs the filter in parts, and hands on another end of it: that of the last step whole.
    parted = change * (run.cut | run.divides)[:, None]
    echo = np.concatenate([np.zeros((1, 6)), parted[:-1]])
    loose = remembered(run, parted + echo + _argument(run, (*load["force"], *load["torque"]))) * run.h
    if any(form[0] == "pressure" for form in load["force"]):
        # Between frames nothing tells where the walls around are.
        out.unknown[:, body] |= ~block.single
    for j in range(6):
        out.impulse[:, body, j] += block.total(impulse[:, j])
        out.spread[:, body, j // 3] += block.total(np.abs(impulse[:, j]))
        out.shift[:, body, j] += block.total(shift[:, j]) / scale[j]
        out.varied[:, body, j // 3] += block.total(change[:, j]) * run.h
        slack = block.total(loose[:, j])
        out.slack[:, body, j // 3] += slack
        out.shift_slack[:, body, j // 3] += slack * block.dt / scale[j]


def _ways_of_walls(block: Block, out: Loads) -> None:
    """Adds to the ways of free walls over several steps what their forces gave in earlier ones: these are laws of time."""
    run = block.run
    share = float(run.options["theta"]) if run.method == "moreau" else 0.0
    for load in run.loads:
        body = int(load.get("body", -1))
        if load["kind"] != "force" or body < run.balls:
            continue
        gained = impulses(run, load)[:, :3] / run.mass[body]
        for k in np.flatnonzero(block.n > 1):
            mine = gained[block.s0[k] : block.s1[k]]
            after = np.arange(len(mine))[::-1] + share
            out.shift[k, body, :3] += run.h * after @ mine


def _cohesion(block: Block, out: Loads) -> None:
    """Attraction of pairs: known from the frame before a whole step."""
    impulse, slack = on_bodies(block)
    way, mass = 0.5 * block.dt[:, None], block.run.mass
    out.impulse[..., :3] += impulse
    out.slack[..., 0] += slack
    out.spread[..., 0] += norm(impulse)
    out.shift[..., :3] += (way / mass)[..., None] * impulse
    out.shift_slack[..., 0] += way * slack / mass
    out.unknown |= ~block.single[:, None]


#: Times in a step at which forces in time are looked at for how much they vary in it.
PARTS_OF_STEP = 4


def _at_steps(run: Run, forms: tuple[Any, ...], parts: int = 1) -> F64:
    """Force and torque at all times of the grid, and of `parts` of its steps, (parts S + 1, 6)."""
    time = np.concatenate([[0.0], run.steps["time"]])
    if parts > 1:
        shares = np.arange(parts) / parts
        time = np.append((time[:-1, None] + np.diff(time)[:, None] * shares).ravel(), time[-1])
    return np.stack([_value(form, time) for form in forms], axis=1)


def _argument(run: Run, forms: tuple[Any, ...]) -> F64:
    """(S, 6) by how much forces differ for a rounding of the time at which they are taken."""
    end = run.steps["time"]

    def slope(form: Any) -> F64:
        if form[0] in ("times", "pressure"):
            factor, of, *pressed = form[1]
            area = np.interp(end, *pressed) if pressed else 1.0
            return np.asarray(np.abs(factor * law(of, end)[1] * area))
        return np.abs(law(form, end)[1])

    slopes = [slope(form) for form in forms]
    return np.asarray(4.0 * EPS * end[:, None] * np.nan_to_num(np.stack(slopes, axis=1)))


def _value(form: Any, time: F64) -> F64:
    """A law at some times, or ("times", (factor, law)), or ("pressure", (factor, law, times, areas))."""
    if form[0] == "times":
        factor, of = form[1]
        return np.asarray(factor * law(of, time)[0])
    if form[0] == "pressure":
        factor, of, grid, areas = form[1]
        return np.asarray(factor * law(of, time)[0] * np.interp(time, grid, areas))
    return law(form, time)[0]


def impulses(run: Run, load: dict[str, Any]) -> F64:
    """(S, 6) impulses of a force and torque in each step, N s and N m s."""
    return _filtered(run, (*load["force"], *load["torque"]))[0]


def _filtered(run: Run, forms: tuple[Any, ...]) -> tuple[F64, F64]:
    """Impulse and displacement times mass of every step, (S, 6), by the scheme from forces at the times of the grid."""
    f = _at_steps(run, forms)
    h, o = run.h, run.options
    if run.method == "moreau":
        return h * ((1.0 - o["theta"]) * f[:-1] + o["theta"] * f[1:]), np.zeros_like(f[1:])
    if run.method == "penalty":
        return 0.5 * h * (f[:-1] + f[1:]), 0.25 * h * h * (f[:-1] + f[1:])
    rho = o["spectral_radius"]
    am, af = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
    gamma = 0.5 + af - am
    beta = 0.25 * (gamma + 0.5) ** 2
    pseudo = np.empty_like(f)
    pseudo[0] = f[0]
    for k in range(1, len(f)):
        pseudo[k] = ((1.0 - af) * f[k] + af * f[k - 1] - am * pseudo[k - 1]) / (1.0 - am)
    old, new = pseudo[:-1], pseudo[1:]
    return h * ((1.0 - gamma) * old + gamma * new), h * h * ((0.5 - beta) * old + beta * new)


def _of_motion(block: Block, load: dict[str, Any], out: Loads) -> None:
    """Springs and drag."""
    first, last = (_wrench(block, load, end) for end in (0, 1))
    jump, rounding = _jumps(block, load), _rounding(block, load)
    several = ~block.single
    for body, (start, end) in {b: (first[b], last[b]) for b in first}.items():
        mean = 0.5 * (start + end) * block.dt[:, None]
        out.impulse[:, body] += mean
        own = _sizes(end - start) + jump[body] + _kinked(block, load) + rounding
        # What was before a block is not known: the force itself, at its first interval.
        earlier = _echo(block.run, own, _sizes(start[0]) * (block.first > 1))
        slack = 2.0 * (own + earlier) * block.dt[:, None]
        scale = np.array([block.run.mass[body], block.run.inertia[body]])
        out.slack[:, body] += slack
        out.shift[:, body] += 0.5 * mean * block.dt[:, None] / np.repeat(scale, 3)
        out.shift_slack[:, body] += slack * block.dt[:, None] / scale
        out.unknown[:, body] |= several


def _kinked(block: Block, load: dict[str, Any]) -> F64:
    """(B, 2) by how much the force and moment of a load change with the velocities, as the law of a periodic box has a kink
    after the interval: the filter of the scheme still has those before it in the next one.
    """
    rate = norm(block.kink)
    if load["kind"] == "drag":
        force = float(load["translation"]) * rate[:, int(load["body"])]
        return np.stack([force, np.zeros(block.count)], axis=1)
    ends = [(int(load[side]), norm(np.asarray(load[f"arm_{side}"], dtype=np.float64))) for side in "ab"]
    force = np.zeros(block.count)
    for body, _ in ends:
        force += float(load["damping"]) * (rate[:, body] if body >= 0 else 0.0)
    return np.stack([force, force * max(float(arm) for _, arm in ends)], axis=1)


def _rounding(block: Block, load: dict[str, Any]) -> F64:
    """(B, 2) of the force and moment of a spring: that of the coordinates of its ends by its stiffness."""
    if load["kind"] == "drag":
        return np.zeros((block.count, 2))
    ends = [_end(block, load, side, end) for side in "ab" for end in (0, 1)]
    extent = np.sum([norm(end.place) for end in ends], axis=0) + abs(float(load["rest_length"]))
    arm = max(float(norm(np.asarray(load[f"arm_{side}"], dtype=np.float64))) for side in "ab")
    return np.asarray(8.0 * EPS * float(load["stiffness"]) * extent[:, None] * [1.0, arm])


def _sizes(wrench: F64) -> F64:
    """Lengths of force and moment, (..., 2) of (..., 6)."""
    return np.stack([norm(wrench[..., :3]), norm(wrench[..., 3:])], axis=-1)


def _echo(run: Run, own: F64, first: F64) -> F64:
    """(B, 2) what changes (B, 2) of earlier intervals are still worth: the last one whole, and those before as `remembered`,
    of both ends of a step (eqs. 5a and 6a): what the filter forgets at once is still that of the begin. `first` (2,) is that
    of the first.
    """
    at_end = remembered(run, np.concatenate([first[None], own[:-1]]))
    at_begin = np.concatenate([first[None], at_end[:-1]])
    return at_end + (1.0 - memory(run)) * at_begin


def remembered(run: Run, changes: F64) -> F64:
    """(S, ...) changes of forces of steps, with what is left of those of earlier ones: the filter of the scheme (eq. 6c)
    keeps `alpha_m/(1 - alpha_m)` of its error at each step.
    """
    kept, found = memory(run), changes.copy()
    for k in range(1, len(found)):
        found[k] += kept * found[k - 1]
    return found


def memory(run: Run) -> float:
    """What the filter of the scheme keeps of its error at each step."""
    rho = float(run.options["spectral_radius"])
    alpha = (2.0 * rho - 1.0) / (rho + 1.0)
    return abs(alpha / (1.0 - alpha)) if run.method == "nsga" else 0.0


def _jumps(block: Block, load: dict[str, Any]) -> dict[int, F64]:
    """Force and moment on each body, (B, 2), by which a load is off that the scheme takes before the impulses of contacts
    in the interval: with other velocities, and for springs with other places (eqs. 3 and 4 add the change at `t_{n+1}`
    whole, the filter of eq. 6 keeps what it was before).

    The force of a spring of length `l` and tension `T = k (l - l_0) + c l'` changes by `k` of what its points move along it
    and by `|T|/l` of what they move across, its damping by `c` of their speeds, and `c/l` of them where the line turns; its
    moments by the arms times that, and `|T|` times what the arms turn.
    """
    run = block.run
    impulse, moment = pushes(block)
    if load["kind"] == "drag":
        body = int(load["body"])
        v, w = impulse[:, body] / run.mass[body], moment[:, body] / run.inertia[body]
        return {body: np.stack([float(load["translation"]) * v, float(load["rotation"]) * w], axis=1)}
    ends = [
        (int(load[side]), float(norm(np.asarray(load[f"arm_{side}"], dtype=np.float64)))) for side in "ab"
    ]
    way, turned = shifts(block)
    rate, moved = np.zeros((2, block.count))
    for body, arm in ends:
        if body >= 0:
            rate = rate + impulse[:, body] / run.mass[body] + arm * moment[:, body] / run.inertia[body]
            moved = moved + way[:, body] + arm * turned[:, body]
    lines = [_line(block, load, end) for end in (0, 1)]
    shortest = np.minimum(*(length for _, length, _, _ in lines)) - moved
    # Two directions differ by 2 at most.
    turn = np.where(moved < 2.0 * shortest, moved / np.where(shortest > 0.0, shortest, 1.0), 2.0)
    tension = np.maximum(*(np.abs(t) for _, _, t, _ in lines)) + float(load["stiffness"]) * moved
    tension = tension + float(load["damping"]) * rate
    fastest = np.maximum(*(norm(v) for _, _, _, v in lines)) + rate
    pull = (
        float(load["damping"]) * (rate + fastest * turn) + float(load["stiffness"]) * moved + tension * turn
    )
    return {
        body: np.stack([pull, arm * (pull + tension * turned[:, max(body, 0)])], axis=1) for body, arm in ends
    }


def _line(block: Block, load: dict[str, Any], end: int) -> tuple[F64, F64, F64, F64]:
    """Of a spring at the first (0) or second (1) frame of each interval: its direction from B to A (B, 3), its length and
    its tension (B,), and the velocity of A's point against B's (B, 3).
    """
    (_, at_a, rate_a), (_, at_b, rate_b) = (_end(block, load, side, end) for side in "ab")
    way, rate = at_a - at_b, rate_a - rate_b
    length = norm(way)
    line = np.divide(way, length[:, None], out=np.zeros_like(way), where=length[:, None] > 0)
    tension = float(load["stiffness"]) * (length - float(load["rest_length"]))
    return line, length, tension + float(load["damping"]) * dot(line, rate), rate


def _end(block: Block, load: dict[str, Any], side: str, end: int) -> Point:
    return block.point(int(load[side]), load[f"arm_{side}"], end)


def _wrench(block: Block, load: dict[str, Any], end: int) -> dict[int, F64]:
    """Force and moment on each body of a load at the first (0) or second (1) frame of each interval, (B, 6)."""
    v, w = (block.v1, block.w1) if end else (block.v0, block.w0)
    if load["kind"] == "drag":
        body = int(load["body"])
        force = -float(load["translation"]) * v[:, body]
        return {body: np.hstack([force, -float(load["rotation"]) * w[:, body]])}
    line, _, tension, _ = _line(block, load, end)
    pull = -tension[:, None] * line
    found = {int(load["a"]): np.hstack([pull, cross(_end(block, load, "a", end).lever, pull)])}
    if int(load["b"]) >= 0:
        found[int(load["b"])] = np.hstack([-pull, -cross(_end(block, load, "b", end).lever, pull)])
    return found


def pulled_from(block: Block, active: I64, places: tuple[F64, F64]) -> F64:
    """(A, N, 6) force and moment of springs in some intervals at other places and orientations of the bodies, with the
    velocities of the second frames, less those of these frames.
    """
    found, other = np.zeros((block.count, block.run.bodies, 6)), copy(block)
    other.x1, other.q1 = block.x1.copy(), block.q1.copy()
    other.x1[active], other.q1[active] = places
    for load in block.run.loads:
        if load["kind"] == "spring":
            for at, sign in ((other, 1.0), (block, -1.0)):
                for body, wrench in _wrench(at, load, 1).items():
                    found[:, body] += sign * wrench
    return found[active]


def _joints(block: Block, out: Loads) -> None:
    """Recorded reactions: the impulse at the joint and the couple on A; on B the opposite. Arms are as in the second frame,
    and off by their turn within the interval.
    """
    run = block.run
    for bodies, moved, kicked in list(corrections(block, out)):
        for k, inert in enumerate(np.sqrt((run.mass[bodies], run.inertia[bodies]))):
            out.shift_held[:, bodies, k] += moved[:, None] / inert
            out.spread[:, bodies, k] += kicked[:, None] * inert  # what cancels within the interval
    # Those of the last frame of a run that stopped are not known, nor is that interval judged by them (`kept`).
    given = np.nan_to_num(run.result.joint_impulse[block.first : block.first + block.count])
    struck = {
        body: strokes(block)[0][:, bodies].sum(axis=1) for bodies, _ in groups(run.joints) for body in bodies
    }
    for j, joint in enumerate(run.joints):
        impulse, couple = given[:, j, :3], given[:, j, 3:]
        size = norm(impulse)
        # Reactions of the smooth motion and of impacts are solved to the tolerance; those that hardly act against all
        # others of their bodies.
        radius = run.radius[joint["a"]]
        own = size + norm(couple) / radius + struck[joint["a"]]
        solved = 4.0 * block.tolerance * (own + run.mass.max() * norm(run.gravity) * run.h)
        for body, sign, arm in (
            (joint["a"], 1.0, joint["rows"][0][2]),
            (joint["b"], -1.0, joint["rows"][0][3]),
        ):
            if body < 0:
                continue
            lever = rotated(
                block.q1[:, body], np.broadcast_to(np.asarray(arm, dtype=np.float64), (block.count, 3))
            )
            out.impulse[:, body] += sign * np.hstack([impulse, cross(lever, impulse) + couple])
            reach = norm(lever)
            turned = 2.0 * reach * _turned(block, j, body, float(norm(np.asarray(arm, dtype=np.float64))))
            out.slack[:, body] += np.stack(
                [solved, solved * (2.0 * reach + run.radius[body]) + turned], axis=1
            )
            way = np.stack([size, reach * size + norm(couple)], axis=1) * block.dt[:, None]
            # Multipliers of joints at positions are not recorded; they are solved against the way of the weight at least.
            fall = 16.0 * block.tolerance * norm(run.gravity) * block.dt**2
            out.shift_slack[:, body] += np.stack([fall, fall / run.radius[body]], axis=1)
            out.shift_held[:, body] += way / np.array([run.mass[body], run.inertia[body]])
            out.unknown[:, body] |= ~block.kept


#: Intervals before a block from which reactions are remembered.
MEMORY = 32


def _turned(block: Block, j: int, body: int, arm: float) -> F64:
    """(B,) sum of the reactions of joint `j` that act in an interval, each times the angle by which the arms of `body` have
    turned since it arose, N s.

    The filter of the scheme (eq. 6) carries those of a step, with its arms, into later ones: that of the last step whole,
    and those before as `remembered`.
    """
    run, result = block.run, block.run.result
    first, last = max(block.first - MEMORY, 1), block.first + block.count
    given = np.nan_to_num(result.joint_impulse[first:last])[:, j]
    size, couple = norm(given[:, :3]), norm(given[:, 3:])
    spin = norm(np.asarray(result.angular_velocity[first - 1 : last])[:, body])
    rate = np.maximum(spin[1:], spin[:-1]) + (arm * size + couple) / run.inertia[body]
    turn = np.nan_to_num(np.diff(run.time[first - 1 : last]) * rate)
    kept, earlier, carried = memory(run), 0.0, np.zeros(len(size))
    for k in range(1, len(size)):
        earlier = size[k - 1] + kept * earlier
        carried[k] = kept * carried[k - 1] + size[k - 1] * turn[k - 1] + earlier * turn[k]
    return np.asarray((size * turn + carried)[-block.count :])


@once
def solved_again(block: Block) -> F64:
    """(B,) by how much what turned bodies may be off, N s^2: their loads are solved with the normals where the smooth motion
    ends, and those of velocities, which are on record, again with the last ones. Impulses change by the momenta that the
    turn of these normals brings across, by what a wall that turns is faster where the body has been moved to, and by what
    loads that depend on the motion change by.
    """
    run, c = block.run, block.rows
    if not run.loads_once:
        return np.zeros(block.count)
    dt = block.dt[:, None, None]
    smooth = block.x0 + dt * block.v0 + 0.5 * dt * dt * run.falls + carried.of_block(block).way
    moved = norm(block.x1 - smooth)
    pulled = norm(on_bodies(block)[0])
    if run.cohesive:  # what it pulls in contacts push out again
        moved = np.maximum(moved, norm(of_contacts(block).shift) / run.mass)
    fast = ends(block) + run.radius * np.maximum(norm(block.w0), norm(block.w1))
    way = together(block, moved)
    turned = np.minimum(way * curvature(block), 1.0)
    momenta = run.heavy * (fast + run.h * norm(run.gravity)) + pulled
    each = turned * together(block, momenta)
    if run.free_walls:  # what a heavy wall brings goes on from ball to ball
        walls = slice(run.balls, None)
        brought = momenta[:, walls] + of_loads(block).spread[:, walls, 0]
        each += turned * brought.sum(axis=1)[c.k]
    for k in np.unique(c.b[c.b >= run.bodies]):
        rows = np.flatnonzero(c.b == k)
        turning = run.walls[k - run.bodies].turning(block.t1[c.k[rows]])
        each[rows] += turning * way[rows] * run.heavy[c.a[rows]]
    again = np.nan_to_num(of_loads(block).alone_slack)
    changed = (again[..., 0] + again[..., 1] / run.radius).sum(axis=1)
    return np.asarray(run.h * (changed + np.bincount(c.k, np.nan_to_num(each), minlength=block.count)))


def turned_loads(block: Block, k: I64, first: F64, last: F64) -> F64:
    """(K,) N s by which the second solve of the loads of a pile may be off its law, at contacts of the intervals `k` with
    these normals at both ends. Sweeps have one frame, half-way; they know by how much velocities differ in it from the
    first solve, but for what changed since.
    """
    if not (block.run.loads_once and block.cascaded.any()):
        return np.zeros(len(k))
    apart = norm(cross(unit(first + last), last))
    return np.where(block.cascaded[k], apart * solved_again(block)[k] / block.run.h, 0.0)
