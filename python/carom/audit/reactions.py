"""What joints may bring into or take out of the energy, where no file tells their reactions of every level.

Reactions act along directions of the step's start and end, which turn by `turn = h rate` between; at either end no speed
remains along its own. In the norm of the masses reactions accelerate a group by `A` at most (`corrections`), at speeds
`S = sqrt(2 K)`: in smooth motion that is of second order, `h S A turn^2` (Moreau-Jean: first). Reactions that change in
size, as near a dead point of a closed loop, add what `held` says, from their values at both frames; `A` is no less than
these. An impact changes `A`, which the filter of the scheme remembers along directions of before: `h S turn` of that
change. And joints answer impulses of contacts, which are at most what changes the speeds of the group and bears its loads
(or what is recorded): `S turn` of these.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from carom.arrays import F64
from carom.audit import held, recorded, rigid
from carom.audit.block import Block, blocks
from carom.audit.corrections import kinks, swing
from carom.audit.data import Run
from carom.audit.loads import of_loads
from carom.audit.vectors import norm
from carom.audit.wrenches import groups, remembered

#: Stands for no bound at all (a spring without length turns at once), as products with 0 have no value.
LARGEST = 1e60


def unsteady(run: Run) -> F64:
    """(S,) what joints may change the energy by in each step, J."""
    s, h = run.steps, run.h
    rho = float(run.options["spectral_radius"])
    order = 1 if run.method == "moreau" else 2
    kept = abs((2.0 * rho - 1.0) / (2.0 - rho)) if run.method == "nsga" else 0.0
    touched = (s["contacts"] > 0) | (s["impact_problems"] > 0) | run.cut
    jolted = touched | np.concatenate([[True], touched[:-1]])
    found = np.zeros((len(groups(run)), 5, len(touched)))
    for block in blocks(run):
        steps = np.repeat(np.arange(block.count), block.n)
        for k, parts in enumerate(_reactions(block)):
            found[k, :, block.s0[0] : block.s1[-1]] = np.minimum(np.nan_to_num(parts), LARGEST)[:, steps]
    total, third = np.zeros(len(touched)), held.share(run) * h * h * (order == 2)
    for accelerated, speed, turn, pushed, varied in found:
        jumps = np.where(jolted, accelerated + np.concatenate([accelerated[:1], accelerated[:-1]]), 0.0)
        smooth = h * (accelerated * turn**order + remembered(run, jumps) * turn / (1.0 - kept))
        total += speed * (smooth + np.where(touched, pushed * turn, 0.0)) + third * accelerated * varied
    return total


def _reactions(block: Block) -> Iterator[tuple[F64, F64, F64, F64, F64]]:
    """Of each group of joined bodies, (B,): how much reactions may accelerate it, m/s^2 sqrt(kg), its speed, m/s sqrt(kg),
    the turn of its joints in a step, rad, and what contacts may change its speed by, m/s sqrt(kg).
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
        yield accelerated, speed, np.minimum(h * rate, 1.0), pushed, varied
