"""Joints hold: their rows at the positions, their rates at the velocities (eqs. 1c-d, 1f-g; algorithm, section 7).

    point     d . (p_A - p_B) = c(t)        d . (v_pA - v_pB) = c'(t)        p = x + R s
    distance  |p_A - p_B| = c(t)            its rate
    rotation                                e . (w_A - w_B) = c'(t)

Bounds: positions `1e3 gap_tolerance` of the lengths involved (the residual of eq. 44 is relative to all forces of an island,
and joints of a chain add theirs up), speeds `1e3 tol_r` of the speeds. Moreau-Jean holds rates alone: its lengths drift.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.audit import reactions, recorded
from carom.audit.block import Block, once
from carom.audit.formula import law
from carom.audit.loads import of_loads
from carom.audit.report import Place, Tally
from carom.audit.vectors import EPS, dot, norm
from carom.audit.wrenches import groups


def judge(block: Block, tally: Tally) -> None:
    """All joints at the second frames."""
    run = block.run
    if run.joints and run.method == "moreau" and not run.projects:
        tally.skip(
            "joint",
            "moreau holds joints by their speeds; lengths drift",
            "position_projection = true",
            block.count,
        )
    names = run.result.joint_names
    for joint, name in zip(run.joints, names, strict=True):
        for row in joint["rows"]:
            _row(block, tally, joint, row, name)


def _row(block: Block, tally: Tally, joint: dict[str, Any], row: tuple[Any, ...], name: str) -> None:
    run = block.run
    kind, direction, arm_a, arm_b, form = row
    a, b = joint["a"], joint["b"]
    value, slope = law(form, block.t1)
    _, at_a, rate_a = block.point(a, arm_a, 1)
    _, at_b, rate_b = block.point(b, arm_b, 1)
    along = np.broadcast_to(np.asarray(direction, dtype=np.float64), at_a.shape)
    between, rate = at_a - at_b, rate_a - rate_b
    length = norm(at_a) + norm(at_b) + np.abs(value)
    t = run.loosest
    speed = norm(rate_a) + norm(rate_b) + np.abs(slope)
    if kind == "rotation":
        w = block.w1[:, a] - (block.w1[:, b] if b >= 0 else 0.0)
        off = (dot(w, along) - slope) * run.radius[a]
        speed = (norm(w) + norm(block.w1[:, a])) * run.radius[a] + np.abs(slope) * run.radius[a]
    else:
        if kind == "distance":
            measure = norm(between)
            along = between / np.where(measure > 0.0, measure, 1.0)[:, None]
        else:
            measure = dot(between, along)
        off = dot(rate, along) - slope
        if not (run.method == "moreau" and not run.projects):
            bound = 1e3 * t["gap_tolerance"] * (length + run.radius[a]) + 64.0 * EPS * (
                norm(at_a) + norm(at_b)
            )
            tally.measure("joint", np.abs(measure - value), bound, lambda i: _place(block, i, name))
    pushed = sum(_kicked(block, body) for body in (a, b) if body >= 0)
    floor = 1e3 * t["tolerance"] * (speed + pushed + 1e-3 * run.radius[a] / run.h * t["tolerance"])
    floor = floor + (1e1 * t["tolerance"] + 64.0 * EPS) * _fastest(block)[:, a]
    floor = floor + 64.0 * EPS * _rung(block, a)
    if (
        run.method == "moreau"
    ):  # rates hold where the smooth motion ends: directions turn by a step from there
        # at the speeds before an impact, which may be the larger ones.
        spin = np.maximum(norm(block.w0), norm(block.w1))
        swing = spin[:, a] + (spin[:, b] if b >= 0 else 0.0)
        before = block.point(a, arm_a, 0).velocity - block.point(b, arm_b, 0).velocity
        fastest = np.maximum(norm(rate), norm(before))
        turning = swing + fastest / np.maximum(norm(between), 1e-3 * run.radius[a])
        # A point that stays is held by arms that turn.
        swung = spin[:, a] * np.linalg.norm(arm_a) + (spin[:, b] * np.linalg.norm(arm_b) if b >= 0 else 0.0)
        floor = floor + 4.0 * run.h * turning * (speed + swung) * (kind != "rotation")
    tally.measure("joint speed", np.abs(off), floor + 64.0 * EPS * speed, lambda i: _place(block, i, name))


@once
def _fastest(block: Block) -> F64:
    """(B, N) m/s, the fastest of all bodies that joints hang together with each: their rows are solved to a share of it."""
    run, n = block.run, block.run.bodies
    speed = np.zeros((block.count, n))
    for v, w in ((block.v0, block.w0), (block.v1, block.w1)):
        speed = np.maximum(speed, np.nan_to_num(norm(v) + run.radius * norm(w)))
    held = np.array([body for j in run.joints for body in (j["a"], j["b"]) if body >= 0], dtype=np.int64)
    system = run.joined([])
    for one in np.unique(system[held]):
        mine = system == one
        speed[:, mine] = speed[:, mine].max(axis=1, keepdims=True)
    return np.asarray(speed)


def _rung(block: Block, body: int) -> F64:
    """(B,) speeds that the filter of the scheme has yet to take back of a body, m/s: its own have their rounding."""
    run, node = block.run, int(block.run.node[body])
    [mine] = [k for k, (bodies, _) in enumerate(groups(run)) if node in bodies]
    lightness = run.heavy[node] ** -0.5 + run.node_reach[node] * run.node_inertia[node] ** -0.5
    return np.asarray(reactions.rung(block)[mine] * lightness)


def _kicked(block: Block, body: int) -> F64:
    """(B,) speed that weight, loads and contacts may give a body in an interval, m/s: its joints are solved against all."""
    loads, (struck, _) = of_loads(block), recorded.strokes(block)
    run, node = block.run, int(block.run.node[body])
    given = norm(loads.alone[:, node, :3]) + loads.alone_slack[:, node, 0] + struck[:, node]
    if run.in_clump[node]:  # whose moments move what is far from its centre
        given = (
            given + (norm(loads.alone[:, node, 3:]) + loads.alone_slack[:, node, 1]) / run.node_reach[node]
        )
    return np.asarray(norm(run.gravity) * run.h + given / run.mass[node])


def _place(block: Block, k: int, name: str) -> Place:
    return replace(block.place(k), who=(name,))
