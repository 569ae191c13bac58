"""Impulses of loads and joints on each body in each interval, from their laws, the frames and the recorded reactions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.audit import carried, clump_loads, wrenches
from carom.audit.block import Block, once
from carom.audit.cohesion import on_bodies, pulls
from carom.audit.corrections import corrections
from carom.audit.forces import curvature, ends, of_contacts, together
from carom.audit.recorded import shifts, strokes
from carom.audit.vectors import add_at, cross, norm, unit


@dataclass
class Loads:
    """Loads and joints on each body over an interval: forces and moments (B, N, 6)."""

    impulse: F64
    slack: F64
    """(B, N, 2) what the impulse and the angular impulse may be off, N s and N m s."""
    size: F64
    """(B, N, 2) sums of the sizes of what all loads and joints give, which may cancel: velocities have their rounding."""
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
    corrected: F64
    """(B, N) rad of that by what corrects positions."""
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
    impulse, slack, size, spread, varied, shift, shift_slack, shift_held = (
        np.zeros(s) for s in (six, two, two, two, two, six, two, two)
    )
    unknown = np.zeros(shape, dtype=bool)
    held = shift_held, np.zeros(shape)
    found = Loads(impulse, slack, size, spread, varied, shift, shift_slack, *held, unknown, impulse, slack)
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
    found.size[..., 0] += run.mass * norm(of_box.velocity)
    found.size += found.spread
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
    node, forms = int(run.node[body]), (*load["force"], *load["torque"])
    scale = np.repeat([run.heavy[node], run.node_inertia[node]], 3)
    impulse, shift = wrenches.filtered(run, forms)
    change = wrenches.varied(run, forms)
    loose = wrenches.loose(run, forms, change)
    if any(form[0] == "pressure" for form in load["force"]):
        # Between frames nothing tells where the walls around are.
        out.unknown[:, body] |= ~block.single
    for j in range(6):
        out.impulse[:, node, j] += block.total(impulse[:, j])
        out.spread[:, node, j // 3] += block.total(np.abs(impulse[:, j]))
        out.shift[:, node, j] += block.total(shift[:, j]) / scale[j]
        out.varied[:, node, j // 3] += block.total(change[:, j]) * run.h
        slack = block.total(loose[:, j])
        out.slack[:, node, j // 3] += slack
        out.shift_slack[:, node, j // 3] += slack * block.dt / scale[j]
    if body < run.balls and run.in_clump[body]:
        moment, off = clump_loads.turned_moments(block, load)
        away = float(norm(run.clumps.offsets[body]))
        out.impulse[:, node, 3:] += moment
        out.slack[:, node, 1] += off
        out.spread[:, node, 1] += away * block.total(norm(impulse[:, :3]))
        out.varied[:, node, 1] += away * block.total(norm(change[:, :3])) * run.h + off
        out.unknown[:, node] |= ~block.single


def _ways_of_walls(block: Block, out: Loads) -> None:
    """Adds to the ways of free walls over several steps what their forces gave in earlier ones: these are laws of time."""
    run = block.run
    share = float(run.options["theta"]) if run.method == "moreau" else 0.0
    for load in run.loads:
        body = int(load.get("body", -1))
        if load["kind"] != "force" or body < run.balls:
            continue
        gained = wrenches.impulses(run, load)[:, :3] / run.mass[body]
        for k in np.flatnonzero(block.n > 1):
            mine = gained[block.s0[k] : block.s1[k]]
            after = np.arange(len(mine))[::-1] + share
            out.shift[k, body, :3] += run.h * after @ mine


def _cohesion(block: Block, out: Loads) -> None:
    """Attraction of pairs: known from the frame before a whole step."""
    impulse, slack = on_bodies(block)
    (pairs, _, each, _), bodies = pulls(block), block.run.bodies
    for body in (pairs.a, pairs.b):
        mine = body < bodies
        add_at(out.size[..., 0], (pairs.k[mine], body[mine]), norm(each[mine]))
    way, mass = 0.5 * block.dt[:, None], block.run.mass
    out.impulse[..., :3] += impulse
    out.slack[..., 0] += slack
    out.spread[..., 0] += norm(impulse)
    out.shift[..., :3] += (way / mass)[..., None] * impulse
    out.shift_slack[..., 0] += way * slack / mass
    out.unknown |= ~block.single[:, None]


def _of_motion(block: Block, load: dict[str, Any], out: Loads) -> None:
    """Springs and drag."""
    run, dt = block.run, block.dt[:, None]
    for node, (mean, slack) in clump_loads.of_motion(block, load).items():
        scale = np.array([run.heavy[node], run.node_inertia[node]])
        out.impulse[:, node] += mean
        out.size[:, node] += wrenches.sizes(mean)
        out.slack[:, node] += slack
        out.shift[:, node] += 0.5 * mean * dt / np.repeat(scale, 3)
        out.shift_slack[:, node] += slack * dt / scale
        out.unknown[:, node] |= ~block.single


def _joints(block: Block, out: Loads) -> None:
    """Recorded reactions: the impulse at the joint and the couple on A; on B the opposite. Arms are as in the second frame,
    and off by their turn within the interval.
    """
    run = block.run
    for bodies, moved, kicked in list(corrections(block, out)):
        for k, inert in enumerate(np.sqrt((run.heavy[bodies], run.node_inertia[bodies]))):
            out.shift_held[:, bodies, k] += moved[:, None] / inert
            out.corrected[:, bodies] += k * moved[:, None] / inert
            out.spread[:, bodies, k] += kicked[:, None] * inert  # what cancels within the interval
    # Those of the last frame of a run that stopped are not known, nor is that interval judged by them (`kept`).
    given = np.nan_to_num(run.result.joint_impulse[block.first : block.first + block.count])
    for j, joint in enumerate(run.joints):
        arms = joint["rows"][0][2], joint["rows"][0][3]
        for body, sign, arm in ((joint["a"], 1.0, arms[0]), (joint["b"], -1.0, arms[1])):
            if body < 0:
                continue
            node = int(run.node[body])
            mean, slack = clump_loads.reaction(block, j, given[:, j], body, arm)
            out.impulse[:, node] += sign * mean
            out.size[:, node] += wrenches.sizes(mean)
            out.slack[:, node] += slack
            reach = norm(wrenches.lever(block, body, arm, 1))
            size, couple = norm(given[:, j, :3]), norm(given[:, j, 3:])
            way = np.stack([size, reach * size + couple], axis=1) * block.dt[:, None]
            # Multipliers of joints at positions are not recorded; they are solved against the way of the weight at least.
            fall = 16.0 * block.tolerance * norm(run.gravity) * block.dt**2
            out.shift_slack[:, node] += np.stack([fall, fall / run.radius[node]], axis=1)
            out.shift_held[:, node] += way / np.array([run.heavy[node], run.node_inertia[node]])
            out.unknown[:, node] |= ~block.kept


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
    moved = norm(block.reached - smooth)
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
