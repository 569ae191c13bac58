"""What counts as closing (rule R3), and which speeds loads give in a step."""

from __future__ import annotations

import numpy as np

from carom.arrays import F64, I64
from carom.audit import answers, carried, cohesion, flights
from carom.audit.block import Block, blocks, once
from carom.audit.data import Run
from carom.audit.loads import of_loads
from carom.audit.vectors import norm


def closing(block: Block, k: I64, a: I64, b: I64, contacts: str = "largest_island") -> F64:
    """(K,) closing tolerances of contacts, m/s (rule R3), in islands of at most as many `contacts` as steps say.

    A share of the speed that loads give its own bodies in a step, or its wall, and at least `closing_tolerance_speed` of
    the largest speed.
    """
    run, t = block.run, block.run.loosest
    every = given(block)
    own, all_of = np.maximum(every[k, a], every[k, run.given(b)]), every.max(axis=1)[k]
    image = block.image(k, a, b)
    # Images of all contacts of an island count, as walls do.
    top, c = np.zeros(block.count), block.rows
    np.maximum.at(top, c.k, carried.image_speed(block, c.k, block.image(c.k, c.a, c.b)))
    np.maximum.at(top, k, carried.image_speed(block, k, image))
    own = np.maximum(own, norm(carried.image_change(block, k, image)))
    all_of = np.maximum(all_of, top[k])
    largest = block.over(run.steps[contacts])[k]
    by_speed = t["closing_tolerance_speed"] * np.maximum(fastest(block)[k], all_of)
    return np.asarray(np.maximum(run.load_share(largest) * own, by_speed))


def fastest(block: Block) -> F64:
    """(B,) largest `|v| + r |w|` of a body or clump at either end, m/s."""
    speed = np.maximum(
        norm(block.v0) + block.run.radius * norm(block.w0), norm(block.v1) + block.run.radius * norm(block.w1)
    )
    found = np.nan_to_num(speed).max(axis=1)
    for rows in (block.c0, block.c1):
        fast = norm(rows[..., 7:10]) + block.run.clumps.reach * norm(rows[..., 10:])
        found = np.maximum(found, np.nan_to_num(fast).max(axis=1, initial=0.0))
    return np.asarray(found)


@once
def left(run: Run) -> F64:
    """(F,) m by which contacts of Moreau-Jean may have come nearer since the start by what solvers leave them to close by
    (rule R3) in each step: its velocities keep their sign from step to step.
    """
    found, share = np.zeros(run.frames), float(run.load_share(np.array([np.inf]))[0])
    top = run.loosest["closing_tolerance_speed"] * run.top_speeds.max(initial=0.0)
    for block in blocks(run):
        speed = np.maximum(share * np.nan_to_num(given(block)).max(axis=1), top)
        found[block.first : block.first + block.count] = block.dt * speed
    return np.asarray(np.cumsum(found))


def given(block: Block) -> F64:
    """(B, N + W) m/s, what loads change the velocity of each body by in a step, and that of each moving wall changes."""
    return np.concatenate([fall(block), _walls(block)], axis=1)


def fall(block: Block) -> F64:
    """(B, N) speed that weight and other loads give each body in a step, m/s."""
    run = block.run
    weight = np.full((block.count, run.bodies), float(norm(run.gravity)) * run.h)
    weight += flights.speeds_of_turning(block) + norm(carried.of_block(block).velocity)
    if not run.loads and not run.joints:
        return weight
    loads = of_loads(block)
    of_box = run.mass[:, None] * carried.of_block(block).velocity
    pushed = norm(loads.impulse[..., :3] - of_box) + loads.slack[..., 0]
    if run.clumps:  # a moment moves what is far from the centre
        first = run.clumps.first
        pushed[:, first] += (norm(loads.impulse[:, first, 3:]) + loads.slack[:, first, 1]) / run.clumps.reach
        run.clumps.share(np.maximum, pushed)
    walls = slice(run.balls, None)  # whose forces may cancel over several steps
    pushed[:, walls] = np.maximum(pushed[:, walls], loads.spread[:, walls, 0])
    pushed = pushed / run.mass / np.maximum(block.n, 1)[:, None]
    if run.joints and run.has_contacts:
        # What joints answer to contacts is in their reactions, and may cancel what they give by themselves.
        alone = norm(answers.before_contacts(block)[..., :3] - block.v0)
        pushed = np.where(block.single[:, None], np.maximum(pushed, alone), pushed)
    return np.asarray(weight + pushed + run.h * cohesion.most(block) / run.mass)


def _walls(block: Block) -> F64:
    """(B, W) change of each moving wall's velocity in a step, m/s."""
    run, found = block.run, np.zeros((block.count, block.run.given_walls))
    for w, wall in enumerate(run.walls[: run.given_walls]):
        if wall.travels:
            p = np.broadcast_to(wall.point, (block.count, 3))
            before = wall.velocity(block.t1 - run.h, p)[1]
            found[:, w] = norm(wall.velocity(block.t1, p, end=True)[1] - before)
    return found
