"""Forces of joints and loads on what they move, a ball or the clump of a ball: moments are about its centre.

The first ball of a clump stands for it, and is its *node* (`Run.node`); every other body is its own.
"""

from __future__ import annotations

from copy import copy
from typing import Any

import numpy as np

from carom.arrays import F64, I64
from carom.audit.block import Block, Point, once
from carom.audit.data import Run
from carom.audit.formula import law
from carom.audit.recorded import pushes, shifts
from carom.audit.vectors import EPS, cross, dot, norm, rotated

#: Times in a step at which forces in time are looked at for how much they vary in it.
PARTS_OF_STEP = 4


def at_steps(run: Run, forms: tuple[Any, ...], parts: int = 1) -> F64:
    """Force and torque at all times of the grid, and of `parts` of its steps, (parts S + 1, 6)."""
    time = np.concatenate([[0.0], run.steps["time"]])
    if parts > 1:
        shares = np.arange(parts) / parts
        time = np.append((time[:-1, None] + np.diff(time)[:, None] * shares).ravel(), time[-1])
    return np.stack([_value(form, time) for form in forms], axis=1)


def argument(run: Run, forms: tuple[Any, ...]) -> F64:
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


def varied(run: Run, forms: tuple[Any, ...]) -> F64:
    """(S, 6) by how much force and torque vary in each step: one may turn back within it, and be as large at both ends."""
    inner = at_steps(run, forms, PARTS_OF_STEP)
    return np.asarray(np.abs(np.diff(inner, axis=0)).reshape(-1, PARTS_OF_STEP, 6).sum(axis=1))


def loose(run: Run, forms: tuple[Any, ...], change: F64) -> F64:
    """(S, 6) how far the impulses of a force and torque that vary by `change` (S, 6) may be off in each step."""
    # A step in parts runs the filter in parts, and hands on another end of it: that of the last step whole.
    parted = change * (run.cut | run.divides)[:, None]
    last = np.concatenate([np.zeros((1, 6)), parted[:-1]])
    return remembered(run, parted + last + argument(run, forms)) * run.h


def impulses(run: Run, load: dict[str, Any]) -> F64:
    """(S, 6) impulses of a force and torque in each step, N s and N m s."""
    return filtered(run, (*load["force"], *load["torque"]))[0]


def filtered(run: Run, forms: tuple[Any, ...]) -> tuple[F64, F64]:
    """Impulse and displacement times mass of every step, (S, 6), by the scheme from forces at the times of the grid."""
    f = at_steps(run, forms)
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


def lever(block: Block, body: int, arm: Any, end: int) -> F64:
    """(B, 3) of a point of a body, or of the ground (-1), at the first (0) or second (1) frames, from the centre of what
    moves with it; `arm` is in the axes of the body, m.
    """
    of_ball = block.point(body, arm, end).lever
    return of_ball + centre_of_ball(block, body, end) if carried(block.run, body) else of_ball


def centre_of_ball(block: Block, body: int, end: int) -> F64:
    """(B, 3) the centre of a ball of a clump from that of the clump."""
    clumps, number = block.run.clumps, block.run.clump_of[body]
    q = (block.c1 if end else block.c0)[:, number, 3:7]
    return rotated(q, np.broadcast_to(clumps.offsets[body], (block.count, 3)))


def carried(run: Run, body: int) -> bool:
    """Whether a body is a ball of a clump."""
    return body >= 0 and bool(run.in_clump[body])


def reach(run: Run, body: int, arm: Any) -> float:
    """Length of levers of such a point at most, m."""
    away = float(norm(run.clumps.offsets[body])) if body >= 0 else 0.0
    return float(norm(np.asarray(arm, dtype=np.float64))) + away


def ends(run: Run, load: dict[str, Any]) -> list[tuple[int, float]]:
    """Both bodies of a spring, and the lengths of their levers, m."""
    return [(int(load[side]), reach(run, int(load[side]), load[f"arm_{side}"])) for side in "ab"]


@once
def groups(run: Run) -> list[tuple[list[int], list[dict[str, Any]]]]:
    """Nodes that joints hold together, and these joints."""
    found: list[tuple[set[int], list[dict[str, Any]]]] = []
    for joint in run.joints:
        mine = {int(run.node[body]) for body in (joint["a"], joint["b"]) if body >= 0}
        met = [group for group in found if group[0] & mine]
        found = [group for group in found if not group[0] & mine]
        found.append((mine.union(*(g[0] for g in met)), [joint, *(j for g in met for j in g[1])]))
    return [(sorted(bodies), held) for bodies, held in found]


def kinked(block: Block, load: dict[str, Any]) -> F64:
    """(B, 2) by how much the force and moment of a load change with the velocities, as the law of a periodic box has a kink
    after the interval: the filter of the scheme still has those before it in the next one.
    """
    rate = norm(block.kink)
    if load["kind"] == "drag":
        force = float(load["translation"]) * rate[:, int(load["body"])]
        return np.stack([force, np.zeros(block.count)], axis=1)
    both, force = ends(block.run, load), np.zeros(block.count)
    for body, _ in both:
        force += float(load["damping"]) * (rate[:, body] if body >= 0 else 0.0)
    return np.stack([force, force * max(arm for _, arm in both)], axis=1)


def rounding(block: Block, load: dict[str, Any]) -> F64:
    """(B, 2) of the force and moment of a spring: that of the coordinates and velocities of its ends."""
    if load["kind"] == "drag":
        return np.zeros((block.count, 2))
    both = [_end(block, load, side, end) for side in "ab" for end in (0, 1)]
    extent = np.sum([norm(end.place) for end in both], axis=0) + abs(float(load["rest_length"]))
    fast = np.sum([norm(end.velocity) for end in both], axis=0)
    arm = max(arm for _, arm in ends(block.run, load))
    pull = float(load["stiffness"]) * extent + float(load["damping"]) * fast
    return np.asarray(8.0 * EPS * pull[:, None] * [1.0, arm])


def sizes(given: F64) -> F64:
    """Lengths of force and moment, (..., 2) of (..., 6)."""
    return np.stack([norm(given[..., :3]), norm(given[..., 3:])], axis=-1)


def echo(run: Run, own: F64, first: tuple[F64, F64]) -> tuple[F64, tuple[F64, F64]]:
    """(B, n) what changes (B, n) of earlier intervals are still worth: the last one whole, and those before as `remembered`,
    of both ends of a step (eqs. 5a and 6a): what the filter forgets at once is still that of the begin. `first` is that of
    the end and of the begin of the first; the same of the interval after the last one is returned, too.
    """
    at_end = remembered(run, np.concatenate([first[0][None], own]))
    at_begin = np.concatenate([first[1][None], at_end[:-2]])
    return at_end[:-1] + (1.0 - memory(run)) * at_begin, (at_end[-1], at_end[-2])


def remembered(run: Run, changes: F64) -> F64:
    """(S, ...) changes of forces of steps, with what is left of those of earlier ones: the filter of the scheme (eq. 6c)
    keeps `alpha_m/(1 - alpha_m)` of its error at each step.
    """
    kept, found = memory(run), changes.copy()
    for k in range(1, len(found)):
        found[k] += kept * found[k - 1]
    return found


def ringing(run: Run, steps: int) -> tuple[F64, F64]:
    """Of reactions that change in a step, what is left `n` steps after it (`steps` of them): where directions turn by an
    angle per step, the part of first order in it, and that of second order.

    Reactions are those whose filtered sum is what the joints ask for: theirs is the inverse of the filter of eqs. 5b and 6c,

        W(z) = (1 - p z)(1 - q z)/(1 - r z),    p = (gamma - 1)/gamma,  q = -rho,  r = -alpha_m/(1 - alpha_m)

    with `z` for a step later. Directions of `n` steps before weigh the coefficients of `1/W` with `n` and `n^2`. What the
    filter makes of these are the coefficients of `L = -z W'/W` and of `z L' + L^2`: `l_n = p^n + q^n - r^n` and
    `n l_n + sum l_k l_(n-k)`. The latter grow at first, as `n rho^n`, with alternating sign.
    """
    if run.method != "nsga":
        return np.eye(1, steps)[0], np.zeros(steps)
    rho, n = float(run.options["spectral_radius"]), np.arange(steps)
    first = ((1.0 - 3.0 * rho) / (3.0 - rho)) ** n + (-rho) ** n - ((1.0 - 2.0 * rho) / (2.0 - rho)) ** n
    later = np.where(n > 0, first, 0.0)
    return first, n * first + np.convolve(later, later)[:steps]


def memory(run: Run) -> float:
    """What the filter of the scheme keeps of its error at each step."""
    rho = float(run.options["spectral_radius"])
    alpha = (2.0 * rho - 1.0) / (rho + 1.0)
    return abs(alpha / (1.0 - alpha)) if run.method == "nsga" else 0.0


def jumps(block: Block, load: dict[str, Any]) -> dict[int, F64]:
    """Force and moment on each node, (B, 2), by which a load is off that the scheme takes before the impulses of contacts
    in the interval: with other velocities, and for springs with other places (eqs. 3 and 4 add the change at `t_{n+1}`
    whole, the filter of eq. 6 keeps what it was before).

    The force of a spring of length `l` and tension `T = k (l - l_0) + c l'` changes by `k` of what its points move along it
    and by `|T|/l` of what they move across, its damping by `c` of their speeds, and `c/l` of them where the line turns; its
    moments by the arms times that, and `|T|` times what the arms turn.
    """
    run = block.run
    impulse, moment = pushes(block)
    way, turned = shifts(block)
    if load["kind"] == "drag":
        body = int(load["body"])
        v, w = impulse[:, body] / run.mass[body], moment[:, body] / run.inertia[body]
        force, torque = float(load["translation"]) * v, float(load["rotation"]) * w
        if carried(run, body):
            fast = np.maximum(norm(block.v0[:, body]), norm(block.v1[:, body])) + v
            pull = force + float(load["translation"]) * fast * turned[:, body]
            torque = torque + float(norm(run.clumps.offsets[body])) * pull
        return {int(run.node[body]): np.stack([force, torque], axis=1)}
    both = ends(run, load)
    rate, moved = np.zeros((2, block.count))
    for (body, arm), side in zip(both, "ab", strict=True):
        if body >= 0:
            # Of a clump these are of any ball, and of what is farther away by the lever of the ball.
            arm = (
                float(norm(np.asarray(load[f"arm_{side}"], dtype=np.float64))) if carried(run, body) else arm
            )
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
        int(run.node[body]) if body >= 0 else body: np.stack(
            [pull, arm * (pull + tension * turned[:, max(body, 0)])], axis=1
        )
        for body, arm in both
    }


def _line(block: Block, load: dict[str, Any], end: int) -> tuple[F64, F64, F64, F64]:
    """Of a spring at the first (0) or second (1) frame of each interval: its direction from B to A (B, 3), its length and
    its tension (B,), and the velocity of A's point against B's (B, 3).
    """
    (_, at_a, rate_a), (_, at_b, rate_b) = (_end(block, load, side, end) for side in "ab")
    way, rate = at_a - at_b, rate_a - rate_b
    length = norm(way)
    line = np.where(length[:, None] > 0.0, way, rate)  # with no length that in which its ends part
    line = line / np.maximum(norm(line), np.finfo(float).tiny)[:, None]
    tension = float(load["stiffness"]) * (length - float(load["rest_length"]))
    return line, length, tension + float(load["damping"]) * dot(line, rate), rate


def _end(block: Block, load: dict[str, Any], side: str, end: int) -> Point:
    return block.point(int(load[side]), load[f"arm_{side}"], end)


def wrench(block: Block, load: dict[str, Any], end: int) -> dict[int, F64]:
    """Force and moment on each node of a load at the first (0) or second (1) frame of each interval, (B, 6)."""
    run = block.run
    v, w = (block.v1, block.w1) if end else (block.v0, block.w0)
    if load["kind"] == "drag":
        body = int(load["body"])
        force = -float(load["translation"]) * v[:, body]
        moment = -float(load["rotation"]) * w[:, body]
        if carried(run, body):
            moment = moment + cross(centre_of_ball(block, body, end), force)
        return {int(run.node[body]): np.hstack([force, moment])}
    line, _, tension, _ = _line(block, load, end)
    pull = -tension[:, None] * line
    a, b = (int(load[side]) for side in "ab")
    found = {int(run.node[a]): np.hstack([pull, cross(lever(block, a, load["arm_a"], end), pull)])}
    if b >= 0:
        found[int(run.node[b])] = np.hstack([-pull, -cross(lever(block, b, load["arm_b"], end), pull)])
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
                for body, given in wrench(at, load, 1).items():
                    found[:, body] += sign * given
    return found[active]


#: Intervals before a block from which reactions are remembered.
MEMORY = 32


def turned_since(block: Block, j: int, body: int, arm: float) -> F64:
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
    inertia = run.node_inertia[run.node[body]]
    rate = np.maximum(spin[1:], spin[:-1]) + (arm * size + couple) / inertia
    turn = np.nan_to_num(np.diff(run.time[first - 1 : last]) * rate)
    kept, earlier, lasting = memory(run), 0.0, np.zeros(len(size))
    for k in range(1, len(size)):
        earlier = size[k - 1] + kept * earlier
        lasting[k] = kept * lasting[k - 1] + size[k - 1] * turn[k - 1] + earlier * turn[k]
    return np.asarray((size * turn + lasting)[-block.count :])
