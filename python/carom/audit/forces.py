"""What acted on each body in each interval: recorded impulses of contacts and joints, and impulses of the loads.

Moments of sliding impulses depend on the normal of their lever, `-r n x P_T` on either body. The scheme takes the normal of
`t_n` for the tangents beside that of `t_{n+1}` for the normal impulse (eqs. 39, 41); piles and Moreau-Jean have one frame.
Both readings of a recorded impulse are therefore admitted: `Impulse.split` gives them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from carom.audit.data import Block
from carom.audit.formula import law
from carom.audit.vectors import dot, norm, rotated
from numpy.typing import NDArray

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Split:
    """An impulse (K, 3) as its normal part (K,), its sliding part (K, 3) and the lever's normal (K, 3)."""

    normal: F64
    sliding: F64
    lever: F64


def split(impulse: F64, end: F64, start: F64) -> tuple[Split, Split]:
    """Both readings: all rows in the frame of `end`; or the normal part along `end` and the rest across `start`."""
    normal = dot(impulse, end)
    one = Split(normal, impulse - normal[:, None] * end, end)
    aligned = dot(start, end)
    usable = aligned > 0.1
    normal = np.where(usable, dot(impulse, start) / np.where(usable, aligned, 1.0), normal)
    lever = np.where(usable[:, None], start, end)
    return one, Split(normal, impulse - normal[:, None] * end, lever)


@dataclass(frozen=True)
class Sums:
    """Sums over the contacts of each body: (B, N, ...)."""

    impulse: F64
    size: F64
    """Sum of the lengths of the impulses, N s."""
    moments: tuple[F64, F64]
    """Moment by either reading, N m s."""
    moment_size: F64
    turned: F64
    """What the moments may be off by the turn of normals within the interval, N m s."""
    shift: F64
    """Position impulses, N s^2."""
    shift_size: F64
    shift_moments: tuple[F64, F64]
    count: F64
    """Contacts of the body."""


def of_contacts(block: Block) -> Sums:
    """Sums of the recorded contacts of a block."""
    c, run = block.rows, block.run
    shape = (block.count, run.bodies)
    reach = np.append(run.radius, 0.0)
    start = block.start[1]
    both = split(c.impulse, c.normal, start)
    shifted = split(c.position_impulse, c.normal, start)
    angle = turn(block)
    spread = np.where(block.single[c.k] | (angle == 0.0), 0.0, np.maximum(angle, norm(c.normal - start)))

    def collect(of_a: F64, of_b: F64) -> F64:
        """Adds what a row gives to its bodies; walls take nothing."""
        out = np.zeros((*shape, *of_a.shape[1:]))
        np.add.at(out, (c.k, c.a), of_a)
        ball = c.b < run.bodies
        np.add.at(out, (c.k[ball], c.b[ball]), of_b[ball])
        return out

    def moment(s: Split, own: F64) -> F64:
        arm = np.cross(s.lever, s.sliding)
        return collect(
            own - reach[c.a][:, None] * arm, -own - reach[np.minimum(c.b, run.bodies)][:, None] * arm
        )

    size, slide = norm(c.impulse), norm(both[0].sliding)
    ra, rb = reach[c.a], reach[np.minimum(c.b, run.bodies)]
    couple = norm(c.moment)
    return Sums(
        impulse=collect(c.impulse, -c.impulse),
        size=collect(size, size),
        moments=(moment(both[0], c.moment), moment(both[1], c.moment)),
        moment_size=collect(ra * size + couple, rb * size + couple),
        turned=collect(ra * (size + slide) * spread, rb * (size + slide) * spread),
        shift=collect(c.position_impulse, -c.position_impulse),
        shift_size=collect(norm(c.position_impulse), norm(c.position_impulse)),
        shift_moments=(moment(shifted[0], c.position_moment), moment(shifted[1], c.position_moment)),
        count=collect(np.ones(len(c)), np.ones(len(c))),
    )


def speeds(block: Block) -> F64:
    """(B, N) a bound on the speed of each body within an interval, m/s: the larger of both ends, what gravity gives, and all
    its recorded impulses together.
    """
    run, c = block.run, block.rows
    ends = np.maximum(norm(block.v0), norm(block.v1))
    pushed = np.zeros_like(ends)
    if run.has_contacts and len(c):
        size = norm(c.impulse)
        np.add.at(pushed, (c.k, c.a), size)
        ball = c.b < run.bodies
        np.add.at(pushed, (c.k[ball], c.b[ball]), size[ball])
    return np.asarray(ends + norm(run.gravity) * block.dt[:, None] + pushed / run.mass)


def turn(block: Block) -> F64:
    """(K,) a bound on the angle by which the normal of a contact turned within its interval, rad; 0 at flat walls that do
    not turn. The contact point moves at most at the speed of the bodies over the smallest radius of curvature.
    """
    c, run = block.rows, block.run
    speed = speeds(block)
    ball = np.minimum(c.b, run.bodies - 1)
    relative = speed[c.k, c.a] + np.where(c.b < run.bodies, speed[c.k, ball], 0.0)
    curvature = 1.0 / (run.radius[c.a] + run.radius[ball])
    spin = np.zeros(len(c))
    for k in np.unique(c.b[c.b >= run.bodies]):
        wall, rows = run.walls[k - run.bodies], np.flatnonzero(c.b == k)
        curvature[rows] = wall.curvature
        if wall.travels:
            for time in (block.t0, block.t1):
                velocity, _, _ = wall.velocity(time[c.k[rows]], block.x1[c.k[rows], c.a[rows]])
                relative[rows] = np.maximum(relative[rows], speed[c.k[rows], c.a[rows]] + norm(velocity))
            if wall.rotation is not None:
                rate = np.maximum(*(np.abs(law(wall.rotation[2], t[c.k[rows]])[1]) for t in (block.t0, block.t1)))
                spin[rows] = 2.0 * rate
    with np.errstate(invalid="ignore"):
        angle = (np.where(relative > 0.0, curvature * relative, 0.0) + spin) * block.dt[c.k]
    return np.minimum(angle, np.pi)


@dataclass
class Loads:
    """Loads and joints on each body over an interval: forces and moments (B, N, 6)."""

    impulse: F64
    slack: F64
    """(B, N, 2) what the impulse and the angular impulse may be off, N s and N m s."""
    shift: F64
    """Displacement and turn in one step by loads that depend on the time, (B, N, 6), m and rad; nsga alone."""
    shift_slack: F64
    """(B, N, 2) m, rad."""
    unknown: NDArray[np.bool_]
    """(B, N) bodies of which the loads cannot be known."""


def of_loads(block: Block) -> Loads:
    """Joints and loads of a block.

    Of loads that depend on the time alone the scheme's own filter (eqs. 6b-c) is evaluated exactly. Those that depend on the
    motion are known at the frames: their impulse over one step lies between the forces at its ends, with the lag of the
    filter between those of a step before, so that twice the change bounds the error. Over several steps they are unknown.
    """
    run = block.run
    shape = (block.count, run.bodies)
    found = Loads(np.zeros((*shape, 6)), np.zeros((*shape, 2)), np.zeros((*shape, 6)), np.zeros((*shape, 2)),
                  np.zeros(shape, dtype=bool))  # fmt: skip
    for load in run.loads:
        if load["kind"] == "force":
            _applied(block, load, found)
        elif load["kind"] == "callable":
            found.unknown[:] = True
        else:
            _of_motion(block, load, found)
    if run.joints:
        _joints(block, found)
    if run.method == "moreau":
        # The theta rule moves bodies by their velocities alone, whatever changed these.
        found.shift[:] = 0.0
        if not run.options["position_projection"]:
            found.shift_slack[:] = 0.0
    return found


def _applied(block: Block, load: dict[str, object], out: Loads) -> None:
    run, body = block.run, int(load["body"])  # type: ignore[call-overload]
    scale = np.repeat([run.mass[body], run.inertia[body]], 3)
    impulse, shift = _filtered(run, (*load["force"], *load["torque"]))  # type: ignore[misc]
    change = np.abs(np.diff(_at_steps(run, (*load["force"], *load["torque"])), axis=0))  # type: ignore[misc]
    for j in range(6):
        out.impulse[:, body, j] += run.total(impulse[:, j], block)
        out.shift[:, body, j] += run.total(shift[:, j], block) / scale[j]
        loose = block.cut | (run.method == "penalty")
        slack = np.where(loose, run.total(change[:, j], block) * run.h, 0.0)
        out.slack[:, body, j // 3] += slack
        out.shift_slack[:, body, j // 3] += slack * block.dt / scale[j]


def _at_steps(run: object, forms: tuple[object, ...]) -> F64:
    """Force and torque at all times of the grid, (S + 1, 6)."""
    time = np.concatenate([[0.0], run.steps["time"]])  # type: ignore[attr-defined]
    return np.stack([law(form, time)[0] for form in forms], axis=1)  # type: ignore[arg-type]


def _filtered(run: object, forms: tuple[object, ...]) -> tuple[F64, F64]:
    """Impulse and displacement times mass of every step, (S, 6), as the scheme makes them of forces at the times of the grid."""
    f = _at_steps(run, forms)
    h, o = run.h, run.options  # type: ignore[attr-defined]
    if run.method == "moreau":  # type: ignore[attr-defined]
        return h * ((1.0 - o["theta"]) * f[:-1] + o["theta"] * f[1:]), np.zeros_like(f[1:])
    if run.method == "penalty":  # type: ignore[attr-defined]
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


def _of_motion(block: Block, load: dict[str, object], out: Loads) -> None:
    """Springs and drag."""
    first, last = (_wrench(block, load, end) for end in (0, 1))
    several = ~block.single
    for body, (start, end) in {b: (first[b], last[b]) for b in first}.items():
        before = np.concatenate([start[:1], start[:-1]])  # of the interval before, as far as this block knows it
        change = np.abs(end - start) + np.abs(start - before)
        mean = 0.5 * (start + end) * block.dt[:, None]
        out.impulse[:, body] += mean
        slack = 2.0 * np.stack([norm(change[:, :3]), norm(change[:, 3:])], axis=1) * block.dt[:, None]
        # The very first intervals of a block do not know what was before them.
        slack[0] += np.stack([norm(start[0, :3]), norm(start[0, 3:])]) * block.dt[0] * (block.first > 1)
        scale = np.array([block.run.mass[body], block.run.inertia[body]])
        out.slack[:, body] += slack
        out.shift[:, body] += 0.5 * mean * block.dt[:, None] / np.repeat(scale, 3)
        out.shift_slack[:, body] += slack * block.dt[:, None] / scale
        out.unknown[:, body] |= several


def _wrench(block: Block, load: dict[str, object], end: int) -> dict[int, F64]:
    """Force and moment on each body of a load at the first (0) or second (1) frame of each interval, (B, 6)."""
    x, v, w, q = (
        (block.x1, block.v1, block.w1, block.q1) if end else (block.x0, block.v0, block.w0, block.q0)
    )
    if load["kind"] == "drag":
        body = int(load["body"])  # type: ignore[call-overload]
        force = -float(load["translation"]) * v[:, body]  # type: ignore[arg-type]
        return {body: np.hstack([force, -float(load["rotation"]) * w[:, body]])}  # type: ignore[arg-type]
    points = []
    for side in "ab":
        body, arm = int(load[side]), np.asarray(load[f"arm_{side}"], dtype=np.float64)  # type: ignore[call-overload]
        if body < 0:
            points.append((body, np.zeros((block.count, 3)), np.broadcast_to(arm, (block.count, 3)), 0.0 * x[:, 0]))
            continue
        lever = rotated(q[:, body], np.broadcast_to(arm, (block.count, 3)))
        points.append((body, lever, x[:, body] + lever, v[:, body] + np.cross(w[:, body], lever)))
    (a, arm_a, at_a, rate_a), (b, arm_b, at_b, rate_b) = points
    way = at_a - at_b
    length = norm(way)
    line = np.divide(way, length[:, None], out=np.zeros_like(way), where=length[:, None] > 0)
    tension = float(load["stiffness"]) * (length - float(load["rest_length"]))  # type: ignore[arg-type]
    tension = tension + float(load["damping"]) * dot(line, rate_a - rate_b)  # type: ignore[arg-type]
    pull = -tension[:, None] * line
    found = {a: np.hstack([pull, np.cross(arm_a, pull)])}
    if b >= 0:
        found[b] = np.hstack([-pull, -np.cross(arm_b, pull)])
    return found


def _joints(block: Block, out: Loads) -> None:
    """Recorded reactions: the impulse at the joint and the couple on A; on B the opposite. Arms are those of the second frame,
    and off by their turn within the interval.
    """
    run = block.run
    given = np.asarray(run.result.joint_impulse[block.first : block.first + block.count])
    rate = np.maximum(norm(block.w0), norm(block.w1))
    for j, joint in enumerate(run.joints):
        impulse, couple = given[:, j, :3], given[:, j, 3:]
        size = norm(impulse)
        # The filter of the scheme (eq. 6) carries reactions of a step, with its arms, into the next one.
        before = np.concatenate([_reaction_before(block, j), size[:-1]])
        # Reactions of the smooth motion and of impacts are solved to the tolerance; those that hardly act against all others.
        solved = 4.0 * block.tolerance * (size + run.mass.max() * norm(run.gravity) * run.h)
        for body, sign, arm in ((joint["a"], 1.0, joint["rows"][0][2]), (joint["b"], -1.0, joint["rows"][0][3])):
            if body < 0:
                continue
            lever = rotated(block.q1[:, body], np.broadcast_to(np.asarray(arm, dtype=np.float64), (block.count, 3)))
            moment = np.cross(lever, impulse) + couple
            out.impulse[:, body] += sign * np.hstack([impulse, moment])
            reach = norm(lever)
            swing = rate[:, body] + norm(moment) / run.inertia[body]
            turned = 2.0 * block.dt * swing * reach * (size + before)
            out.slack[:, body] += np.stack([solved, solved * (2.0 * reach + run.radius[body]) + turned], axis=1)
            way = np.stack([size, reach * size + norm(couple)], axis=1) * block.dt[:, None]
            out.shift_slack[:, body] += way / np.array([run.mass[body], run.inertia[body]])
            out.unknown[:, body] |= ~block.kept


def _reaction_before(block: Block, j: int) -> F64:
    """(1,) size of the impulse of joint `j` in the interval before the block, N s."""
    frame = max(block.first - 1, 0)
    return norm(np.asarray(block.run.result.joint_impulse[frame : frame + 1])[:, j, :3])
