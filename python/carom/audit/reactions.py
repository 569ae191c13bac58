"""What joints may bring into or take out of the energy, where no file tells their reactions of every level.

Reactions act along directions of the step's start and end, which turn by `turn = h rate` between; at either end no speed
remains along its own. In the norm of the masses reactions accelerate a group by `A` at most (`corrections`), at speeds
`S = sqrt(2 K)`: in smooth motion that is of second order, `h S A turn^2` (Moreau-Jean: first). Reactions that change in
size, as near a dead point of a closed loop, add what `held` says, from their values at both frames; `A` is no less than
these. An impact, or a kink of a law, changes `A`, which the filter of the scheme remembers along directions of before:
`h S turn` of that change, and `h S turn^2/2`, rings on (`wrenches.ringing`). Kinks show as changes of the acceleration of
the group from one interval to the next. And joints answer impulses of contacts, which are at most what changes the speeds of
the group and bears its loads (or what is recorded): `S turn` of these. At rest there is what the position level leaves.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.audit import held, recorded, rigid
from carom.audit.block import Block, blocks, once
from carom.audit.corrections import kinks, swing
from carom.audit.data import Run
from carom.audit.gradients import largest
from carom.audit.loads import of_loads
from carom.audit.vectors import norm
from carom.audit.wrenches import groups, memory, reach, ringing

#: Stands for no bound at all (a spring without length turns at once), as products with 0 have no value.
LARGEST = 1e60
#: Steps for which reactions ring on that are looked at.
RINGS = 1000


def unsteady(run: Run) -> F64:
    """(S,) what joints may change the energy by in each step, J."""
    s, h = run.steps, run.h
    order = 1 if run.method == "moreau" else 2
    kept = memory(run)
    first, second = np.abs(ringing(run, min(RINGS, len(s["time"]))))
    touched = (s["contacts"] > 0) | (s["impact_problems"] > 0) | run.cut
    jolted = touched | np.concatenate([[True], touched[:-1]])
    found = np.zeros((len(groups(run)), 6, len(touched)))
    for block in blocks(run):
        steps = np.repeat(np.arange(block.count), block.n)
        for k, parts in enumerate(_reactions(block)):
            found[k, :, block.s0[0] : block.s1[-1]] = np.minimum(np.nan_to_num(parts), LARGEST)[:, steps]
    covered, bends = slice(int(run.step[0]), int(run.step[-1])), np.zeros(len(touched))
    total, third = np.zeros(len(touched)), held.share(run) * h * h * (order == 2)
    for k, (accelerated, speed, turn, pushed, varied, left) in enumerate(found):
        jumps = accelerated + np.concatenate([accelerated[:1], accelerated[:-1]])
        bends[covered] = np.repeat(kinked(run)[k], np.diff(run.step))
        jumps = np.maximum(np.where(jolted, jumps / (1.0 - kept), 0.0), bends)
        along, across = (np.convolve(jumps, of)[: len(jumps)] for of in (first, second))
        smooth = h * (accelerated * turn**order + along * turn + 0.5 * across * turn**2)
        total += (
            speed * (smooth + np.where(touched, pushed * turn, 0.0)) + third * accelerated * varied + left
        )
        solved = run.loosest["tolerance"] * h * along  # which rings on as what it was solved against
        total += (speed + solved) * solved
    return total


def _reactions(block: Block) -> Iterator[tuple[F64, ...]]:
    """Of each group of joined bodies, (B,): how much reactions may accelerate it, m/s^2 sqrt(kg), its speed, m/s sqrt(kg),
    the turn of its joints in a step, rad, what contacts may change its speed by, m/s sqrt(kg), by how much reactions
    vary (`held`), m/s^2 sqrt(kg), and what they do on what the position level leaves of their rows, J.
    """
    run, h = block.run, block.run.h
    loads = of_loads(block)
    several = (block.n > 1) & (block.over(run.steps["contacts"]) > 0)
    top = np.sqrt(2.0 * block.over(run.steps["energy_kinetic"]))
    motion = [
        rigid.kinetic(run, *end) for end in ((block.v0, block.w0, block.c0), (block.v1, block.w1, block.c1))
    ]
    for bodies, joints in groups(run):
        m, inertia = run.heavy[bodies], run.node_inertia[bodies]
        ends = [np.sqrt(2.0 * of[:, bodies].sum(axis=1)) for of in motion]
        speed = np.where(several, top, np.maximum(*ends))
        fast = np.where(several, top, 0.0)
        swings = [[swing(block, joint, end, fast) for joint in joints] for end in (0, 1)]
        parted = np.max([np.sum([bent for bent, _ in of], axis=0) for of in swings], axis=0)
        parted = parted + sum(kinks(block, joint) for joint in joints) / h
        rate = np.max([turning for of in swings for _, turning in of], axis=0)
        force, couple = norm(loads.alone[:, bodies, :3]), norm(loads.alone[:, bodies, 3:])
        force, couple = force + loads.alone_slack[:, bodies, 0], couple + loads.alone_slack[:, bodies, 1]
        pull = np.sqrt((force**2 / m + couple**2 / inertia).sum(axis=1)) / block.dt
        weight = np.sqrt(m.sum()) * float(norm(run.gravity))
        pushed = 2.0 * speed + h * (pull + weight)
        if run.has_contacts:
            struck, turned = (of[:, bodies] for of in recorded.strokes(block))
            turned = turned + np.where(run.in_clump[bodies], run.node_reach[bodies] * struck, 0.0)
            pushed = np.maximum(pushed, np.sqrt((struck**2 / m + turned**2 / inertia).sum(axis=1)))
        grounded = any(joint["b"] < 0 for joint in joints)
        alone = pull + weight * grounded
        exact = held.accelerations(block, bodies, joints)
        accelerated = np.maximum(parted * np.sqrt(m.sum()), np.maximum(*map(norm, exact))) + alone
        # Where nothing happens within an interval its steps share the change, as those around it.
        change = norm(exact[1] - exact[0])
        even = np.where(several, change, change / block.n)
        varied = np.max([even, np.append(even[1:], 0.0), np.insert(even[:-1], 0, 0.0)], axis=0)
        # In the norm of the masses rows are met to the floor of eq. 44 (`Block.floor`), times the root of their compliance.
        left = 4.0 * accelerated * block.floor * np.sqrt(sum(_compliance(run, joint) for joint in joints))
        yield accelerated, speed, np.minimum(h * rate, 1.0), pushed, varied, left


@once
def kinked(run: Run) -> F64:
    """(G, F - 1) by how much the mean acceleration of each group changes from an interval to the next, m/s^2 sqrt(kg)."""
    found = np.zeros((len(groups(run)), run.frames - 1))
    for k, (bodies, _) in enumerate(groups(run) if run.frames > 1 else ()):
        mean = np.concatenate([_mean(block, bodies) for block in blocks(run)])
        found[k, 1:] = norm(np.diff(mean, axis=0))
    return found


@once
def rung(block: Block) -> list[F64]:
    """Of each group (B,) the speed that its last changes are worth yet in the filter of the scheme, m/s sqrt(kg)."""
    run, here = block.run, slice(block.first - 1, block.first - 1 + block.count)
    first, _ = np.abs(ringing(run, min(RINGS, run.frames - 1)))
    return [run.h * np.convolve(of, first)[: run.frames - 1][here] for of in kinked(run)]


def _compliance(run: Run, joint: dict[str, Any]) -> float:
    """Sum of those of the rows of a joint, 1/kg, at most."""
    found = 0.0
    for _, _, arm_a, arm_b, _ in joint["rows"]:
        for body, arm in ((joint["a"], arm_a), (joint["b"], arm_b)):
            if body >= 0:
                node, lever = run.node[body], reach(run, body, arm) + run.radius[body]
                found += float(1.0 / run.heavy[node] + lever**2 / run.node_inertia[node])
    return found


def _mean(block: Block, bodies: list[int]) -> F64:
    """(B, 6 n) mean accelerations of a group, m/s^2 sqrt(kg)."""
    run, clumps = block.run, block.run.clumps
    gained = np.concatenate([block.v1 - block.v0, block.w1 - block.w0], axis=-1)
    gained[:, clumps.first, :3] = (block.c1 - block.c0)[..., 7:10]
    most = np.stack([run.heavy[bodies], largest(run)[bodies]], axis=1)
    mean = gained[:, bodies] * np.repeat(np.sqrt(most), 3, axis=1) / block.dt[:, None, None]
    return np.asarray(np.nan_to_num(mean).reshape(block.count, -1))
