"""How the energy changes with a periodic box that deforms, beyond the works on record (`energy`)."""

from __future__ import annotations

import numpy as np

from carom.arrays import F64
from carom.audit import carried, forces, loads_once
from carom.audit.block import Block
from carom.audit.data import Run
from carom.audit.vectors import dot, norm


def weights(block: Block) -> tuple[F64, F64]:
    """(B, N) by how much the energy of bodies changes with the rate of a periodic box beyond the work of that on record, and
    how far that may be off, J: their weight falls by the way that the box carries them, and is carried as it falls.
    """
    run, of_box = block.run, carried.of_block(block)
    found, off = np.zeros((2, block.count, run.bodies))
    if not run.box.deforms:
        return found, off
    mass = run.mass.copy()
    for clump in run.clumps:
        mass[clump.balls], mass[clump.first] = 0.0, clump.mass
    theta = float(run.options["theta"]) - 0.5 if run.method == "moreau" else 0.0
    # Moreau-Jean's ways, with the mean of both velocities, have half of it already.
    beyond = of_box.way - (0.5 + theta) * block.dt[:, None, None] * of_box.velocity
    single = block.single[:, None]
    found = -mass * dot(beyond, run.falls)
    slack = of_box.slack_way + block.dt[:, None] * of_box.slack
    off = mass * norm(np.broadcast_to(run.falls, block.x0.shape)) * slack
    most = mass * norm(run.falls) * (norm(of_box.way) + block.dt[:, None] * norm(of_box.velocity))
    return np.where(single, found, 0.0), off + np.where(single, 0.0, most)


def impulses(block: Block) -> F64:
    """(K,) J that impulses of contacts do with half of what the rate of the box changes by, over the distance of the bodies:
    works on record have its velocities at both ends. With loads that are solved once they have the velocity of an image with
    the impulse in the frame of the last normal, the work of the box has it with the impulse itself.
    """
    run, c = block.run, block.rows
    if not run.box.deforms or not len(c):
        return np.zeros(len(c))
    ball = np.minimum(c.b, run.bodies - 1)
    of_box, image = carried.of_block(block).velocity, block.image(c.k, c.a, c.b)
    assert image is not None
    apart = of_box[c.k, c.a] - np.where((c.b < run.balls)[:, None], of_box[c.k, ball], 0.0)
    apart = apart - carried.image_change(block, c.k, image)
    found = 0.5 * dot(c.impulse, apart)
    if run.loads_once and run.has_impacts:
        velocity = run.box.velocity(block.t1[c.k], image, end=True)
        found = found + dot(c.impulse - loads_once.stated(block)[0], velocity)
    return np.where(block.single[c.k], found, 0.0)


def unsure(block: Block) -> F64:
    """(K,) J by which works of recorded contacts may be off where they are not exact: of images and the flow together it is
    the change of what bodies at a distance of their radii have, and what normals turn by (`impulses`).
    """
    run, c = block.run, block.rows
    if not run.box.deforms or not len(c):
        return np.zeros(len(c))
    flow = np.where(block.single, 0.0, carried.strained(block))
    lengths = run.radius[c.a] + run.reach[np.minimum(c.b, run.bodies)]
    found = flow[c.k] * lengths * norm(c.impulse)
    if run.loads_once:
        angle = np.where(block.single[c.k], norm(c.normal - block.start[1]), forces.turn(block))
        known = block.single & run.has_impacts
        speed = carried.image_speed(block, c.k, block.image(c.k, c.a, c.b))
        found = found + np.where(known[c.k], 0.0, angle * norm(c.impulse) * speed)
    return np.asarray(found)


def jolted(run: Run, motion: F64) -> F64:
    """(S,) by how much the energy may rise beyond the work on record where the rate of a box changes in a step, for kinetic
    energies `motion` (S,), J: weights fall by what the box carries them (`weights`), and impulses act at a distance of two
    radii at most (`impulses`): impulses of loads and motion, four times the momenta in jams.
    """
    far = 0.0
    size = max(1, 1_000_000 // run.bodies)
    for first in range(0, run.frames, size):
        x = np.nan_to_num(run.state(slice(first, first + size))[0][:, : run.balls])
        far = max(far, float((run.mass[: run.balls] * norm(x - run.box.middle)).sum(axis=1).max(initial=0.0)))
    g, jolt = float(norm(run.gravity)), carried.jolts(run)
    pushed = 4.0 * np.sqrt(2.0 * motion * run.whole_mass) + run.whole_mass * g * run.h
    return np.asarray(jolt * (run.h * g * far + float(run.radius.max()) * pushed))
