"""The balance of energy of frames: it changes by the recorded work alone, in each group of bodies that touch.

Between two frames, with weight alone and whole steps, exactly

    nsga     E' - E = sum of works of contacts + energy_work + in - out - g . sum nu
    moreau   E' - E = sum of works of contacts + energy_work + in - out - (h/2) g . sum P - (theta - 1/2) h g . sum m dv

where `sum nu` and `sum P` run over what the balls got from contacts: the position correction lifts bodies (nsga), and the
theta rule moves them by the mean of velocities that contacts changed at its end (moreau). So do other loads than the weight
lift what contacts move, and the weight what joints answer (`borne`). Works are recorded by cause,
relative to moving walls, whose own work (`energy_work`) is taken with the mean of their velocities at both ends of the
step: the two differ by half of the change of the wall's velocity times its impulses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.audit import (
    answers,
    borne,
    box_energy,
    cohesion,
    flights,
    groups,
    reactions,
    rigid,
    turning,
    wrenches,
)
from carom.audit.block import Block, Rows, once
from carom.audit.centres import at_walls, half_way, riding
from carom.audit.cones import PARTS
from carom.audit.data import Run
from carom.audit.energy import at_start, of_spring
from carom.audit.forces import absolute, projected, speeds, together
from carom.audit.loads import of_loads
from carom.audit.recorded import pushes
from carom.audit.report import Place, Tally
from carom.audit.vectors import EPS, dot, norm


@dataclass(frozen=True)
class Groups:
    """The groups of an interval each, and what of them all comes from."""

    block: Block
    label: I64
    """(B, N + 1) number of the group of each body, and of what is outside of all."""

    @property
    def rows(self) -> I64:
        """(K,) the group of each contact."""
        c = self.block.rows
        return np.asarray(self.label[c.k, c.a])

    @property
    def outer(self) -> tuple[I64, I64]:
        """Where the outer groups have their sums: bodies that come or go are of them."""
        return np.divmod(self.label[:, -1], self.block.run.bodies + 1)

    def summed(self, of_bodies: F64, of_rows: F64) -> F64:
        """(B, N + 1) sums of (B, N) and (K,) over the groups, each at the place of its number."""
        each = np.where(self.block.there, np.nan_to_num(of_bodies), 0.0).ravel()
        total = np.bincount(self.label[:, :-1].ravel(), each, minlength=self.label.size)
        total = total + np.bincount(self.rows, of_rows, minlength=self.label.size)
        return np.asarray(total, dtype=np.float64).reshape(self.label.shape)


def judge(block: Block, tally: Tally) -> None:
    """Of each group (`groups`); of the outer one with the work on record, as what the others leave of the whole."""
    run = block.run
    if not run.has_contacts:
        why = "work of contacts was not recorded"
        tally.skip("energy balance", why, "contacts = true in [record]", block.count)
        return
    if run.method == "penalty":  # `springs`
        return
    of = Groups(block, groups.labels(block))
    turned, turned_slack = turning.of_block(block)
    attracted, unsure = _attracted(block)
    value = _gained(of, turned, attracted)
    bound = _bound(of, turned_slack) + unsure[:, None]
    # What joints, springs and drag do within a step is known to what it may add; what the scheme damps is no fault.
    held = groups.held(block)
    value = np.where(held, np.maximum(value, 0.0), value)
    bound = bound + np.where(held, block.total(answered(run))[:, None], 0.0)
    k, first = np.nonzero(_judged(of, tally))

    def place(i: int) -> Place:
        own = first[i] < run.bodies and of.label[k[i], -1] != of.label[k[i], first[i]]
        return block.place(int(k[i]), *([int(first[i])] if own else []))

    tally.measure("energy balance", np.abs(value[k, first]), bound[k, first], place)


def _judged(of: Groups, tally: Tally) -> Bool:
    """(B, N + 1) the groups with contacts, and the outer ones, of intervals whose record tells."""
    block, run, label = of.block, of.block.run, of.label
    busy = np.bincount(of.rows, minlength=label.size).reshape(label.shape) > 0
    busy[of.outer] = True
    root = label == np.arange(label.size).reshape(label.shape)
    judged = root & busy & (block.kept & ~(block.cut & (run.method == "moreau")))[:, None]
    if run.cohesive:
        block.skip(tally, "energy balance", "cohesion: " + PARTS, np.flatnonzero(~block.single))
        # Where a ball was that leaves is on no record, nor what attracted it last.
        passing = block.passing.any(axis=1)
        why = "cohesion: balls come or go in the step"
        tally.skip("energy balance", why, "a run without inflows and outlets", int(passing.sum()))
        judged &= (block.single & ~passing)[:, None]
    return np.asarray(judged)


def _gained(of: Groups, turned: F64, attracted: F64) -> F64:
    """(B, N + 1) energy that the groups have gained beyond all work, J; `turned` (B, N) and `attracted` (B,) are known."""
    block, run, c = of.block, of.block.run, of.block.rows
    motions = (block.v0, block.w0, block.c0), (block.v1, block.w1, block.c1)
    before, after = (rigid.kinetic(run, *motion) for motion in motions)
    change = after - before - rigid.weight(run, block.x1 - block.x0, block.c1 - block.c0) - turned
    for load in run.loads:
        if load["kind"] == "spring":
            ends = [of_spring(load, x, q)[0] for x, q in ((block.x0, block.q0), (block.x1, block.q1))]
            change[:, max(int(load["a"]), int(load["b"]))] += ends[1] - ends[0]
    lift = _lifted(run, c, projected(block))
    if run.method == "moreau":
        lift = lift + 0.5 * run.h * _lifted(run, c, c.impulse)
        gained = run.mass * dot(block.v1 - block.v0, run.falls)
        change = change + (float(run.options["theta"]) - 0.5) * run.h * gained
    carried = borne.on_bodies(block) + borne.by_weight(block)
    given = lift - c.work.sum(axis=1)
    value = of.summed(change + carried, given)
    # What the steps have of the whole, less all other groups, is the outer one's.
    motion, place = _told(run)
    told = motion + place
    work, entered, left = (
        block.total(run.steps[name]) for name in ("energy_work", "energy_in", "energy_out")
    )
    total = told[block.s1] - told[block.s0] - work - entered + left
    total = total + np.bincount(c.k, given, minlength=block.count)
    if run.method == "moreau":
        gained = np.where(block.there, gained, 0.0)
        total = total + (float(run.options["theta"]) - 0.5) * run.h * np.nansum(gained, axis=1)
    total = total - attracted - turned.sum(axis=1) + carried.sum(axis=1)
    value[of.outer] = total - (value.sum(axis=1) - value[of.outer])
    return value


def _told(run: Run) -> list[F64]:
    """Kinetic and potential energy (S + 1,) on record, J, from the first frame on."""
    names = ("energy_kinetic", "energy_potential")
    return [np.concatenate([[start], run.steps[n]]) for n, start in zip(names, at_start(run), strict=True)]


def _bound(of: Groups, turned: F64) -> F64:
    """(B, N + 1) what solving, recording and rounding leave of that, J; `turned` (B, N) of turning bodies."""
    block, run, c = of.block, of.block.run, of.block.rows
    impulse, at = norm(c.impulse), together(block, speeds(block))
    moved = norm(c.position_impulse) * norm(run.gravity)
    # Impulses that fall within the interval and cancel are not in its sums: the steps know how fast all were.
    solved = 4.0 * block.tolerance[c.k] * (impulse * at + moved + np.abs(c.work).sum(axis=1))
    off = 0.5 * _once_step(block)[c.k] * impulse * norm(run.gravity)
    if run.projects:  # along the normals of all steps between the frames
        off = off + np.where(block.single[c.k], 0.0, 2.0 * moved * norm(block.end[1] - block.start[1]))
    # Joints answer what contacts move, by position impulses of which there is no record; of several steps not where.
    jointed, answer = np.append(run.jointed, False), moved
    if run.method == "moreau":
        answer = answer + np.where(block.single[c.k], 0.0, 0.5 * run.h * impulse * norm(run.gravity))
    off = off + np.where(jointed[c.a] | jointed[np.minimum(c.b, run.bodies)], answer, 0.0)
    of_box = box_energy.carried_off(block)
    turned = turned + of_box
    bound = of.summed(_forced(block) + turned, solved + off + _walls(block))
    bound = bound + EPS * (16.0 + run.bodies) * (2.0 + block.n)[:, None] * _size(of)
    # Of who leaves; and the works of the box are in the whole alone.
    bound[of.outer] += np.where(block.there, of_box, turned).sum(axis=1)
    # Groups on record may have been solved together, and what that leaves is in the size of all of them.
    squares = (
        np.bincount(c.k, moved**2, minlength=block.count),
        np.bincount(c.k, (impulse * at) ** 2, minlength=block.count),
    )
    bound = bound + 4.0 * (block.tolerance * (np.sqrt(squares[0]) + np.sqrt(squares[1])))[:, None]
    busy = np.bincount(of.rows, minlength=of.label.size).reshape(of.label.shape) > 0
    # The position level leaves a floor in the balance of all bodies (in its norm): gravity works on that way, too.
    floor = norm(run.gravity) * block.floor * np.sqrt(run.bodies)
    return np.asarray(bound + np.where(busy, floor[:, None], 0.0))


def _size(of: Groups) -> F64:
    """(B, N + 1) energies that the sums are made of, J, to which their rounding is relative."""
    block, run = of.block, of.block.run
    states = (block.x0, block.v0, block.w0, block.c0), (block.x1, block.v1, block.w1, block.c1)
    size = np.maximum(*(rigid.sizes(run, *state) for state in states))
    top = of.summed(size, np.abs(block.rows.work).sum(axis=1))
    # Who leaves is in none of these sums, but in those of the record before.
    motion, place = _told(run)
    record = np.abs(motion) + np.abs(place)
    top[of.outer] = np.maximum.reduce([top.sum(axis=1), record[block.s0], block.over(record[1:])])
    return top


def _lifted(run: Run, c: Rows, given: F64) -> F64:
    """(K,) what gravity does on the ways that impulses (K, 3) of contacts give, per mass: both parts of a pair of balls
    cancel, walls that are not free take nothing, free ones along their normals.
    """
    of_a = np.where((c.b < run.balls)[:, None], 0.0, given) @ run.gravity
    free = np.flatnonzero(run.is_free_wall(c.b))
    if free.size:
        of_a[free] -= dot(run.taken(c.b[free], given[free]), run.falls[c.b[free]])
    return np.asarray(of_a)


def _attracted(block: Block) -> tuple[F64, F64]:
    """(B,) by how much the energy of whole steps changes by cohesion, whose force is that of a way without contacts, and how
    far that may be off, J: its work by the velocities before and after, its potential, and the work of moving walls by it.
    """
    run, none = block.run, np.zeros(block.count)
    if not run.cohesive:
        return none, none
    (given, slack), fast = cohesion.on_bodies(block), speeds(block)
    after = answers.before_contacts(block)[..., :3]
    each = 0.5 * dot(given, block.v0 + after)
    if run.clumps:  # what turns them is part of `turning.of_block`
        flown, alone = flights.of_block(block), ~run.in_clump
        each = np.concatenate(
            [each[:, alone], 0.5 * dot(flown.pulled, block.c0[..., 7:10] + flown.rows[..., 7:10])], axis=1
        )
    work = np.nansum(each, axis=1)
    ends = [cohesion.potential(run, *at) for at in ((block.t0, block.x0), (block.t1, block.x1))]
    pairs, along, impulse, _ = cohesion.pulls(block)
    driven, moved = np.zeros((2, block.count))
    for w, mine in run.on_walls(pairs.b):
        wall = run.walls[w]
        if not wall.moves:
            continue
        k, a = pairs.k[mine], pairs.a[mine]
        r = run.radius[a][:, None]
        first, last = (x - r * along[mine] for x in half_way(block, k, a, pairs.b[mine]))
        mean = wall.velocity(block.t0[k], first)[0] + wall.velocity(block.t1[k], last, end=True)[0]
        driven += np.bincount(k, 0.5 * dot(impulse[mine], mean), minlength=block.count)
        moved += np.bincount(k, norm(impulse[mine]) * norm(mean), minlength=block.count)
    image = block.image(pairs.k, pairs.a, pairs.b)
    if image is not None:
        box, k = run.box, pairs.k
        mean = box.velocity(block.t0[k], image) + box.velocity(block.t1[k], image, end=True)
        driven += np.bincount(k, 0.5 * dot(impulse, mean), minlength=block.count)
        moved += np.bincount(k, norm(impulse) * norm(mean), minlength=block.count)
        fast = absolute(block)
    solved = 4.0 * block.tolerance * np.nansum(norm(given) * fast, axis=1)
    unsure = solved + np.nansum(2.0 * slack * fast, axis=1) + ends[0][1] + ends[1][1]
    unsure = unsure + 64.0 * EPS * (np.nansum(norm(given) * fast, axis=1) + moved)
    return work + ends[1][0] - ends[0][0] - driven, unsure


def _once_step(block: Block) -> F64:
    """(B,) s: the step whose loads, solved once, lift what they move by more than sums over several steps tell."""
    run = block.run
    if run.method == "events":
        handed = run.loads_once_within & (block.total(run.steps["stepped"]) > 0.0)
        return np.where(handed, float(run.options["pressing_step"]), 0.0)
    return np.where(run.loads_once & ~block.single, run.h, 0.0)


def _forced(block: Block) -> F64:
    """(B, N) by how much the work of forces and torques in time may differ from that of their impulses, J: their work is
    recorded by the velocities at the ends of steps, contacts change these, and the filter of the scheme delays the force.
    """
    run = block.run
    if not run.loads:
        return np.zeros((block.count, run.bodies))
    loads, pushed = of_loads(block), pushes(block)
    found = np.zeros((block.count, run.bodies))
    for j, (v0, v1, inert, fall) in enumerate(
        ((block.v0, block.v1, run.mass, float(norm(run.gravity))), (block.w0, block.w1, run.inertia, 0.0))
    ):
        given = loads.spread[..., j]
        gained = (2.0 * given + pushed[j]) / inert + fall * block.dt[:, None] + norm(v1 - v0)
        fastest = np.maximum(norm(v0), norm(v1)) + gained
        found += given * gained + 2.0 * (loads.varied[..., j] + loads.alone_slack[..., j]) * fastest
    return np.nan_to_num(found)


def _walls(block: Block) -> F64:
    """(K,) twice what works by moving walls may differ by, J: on record they are against the wall at the end of the step,
    its own is by its mean. Both are where the impulses act, but for Moreau-Jean with another theta than a half.
    """
    run, c = block.run, block.rows
    found = np.zeros(len(c))
    for w, mine in run.on_walls(c.b):
        wall = run.walls[w]
        if not wall.moves:
            continue
        k, a, b, normal = c.k[mine], c.a[mine], c.b[mine], c.normal[mine]
        laws = [at_walls(block, k, a, b, normal, start=start) for start in (True, False)]
        rides = [riding(block, k, a, start=True), riding(block, k, a)]
        ridden = [there if x is None else x for x, there in zip(rides, laws, strict=True)]
        (first, end), of_material, (start, last) = (
            [
                np.stack(wall.velocity(t[k], centre - run.radius[a][:, None] * normal, end=after))
                for centre, t, after in zip(centres, (block.t0, block.t1), (False, True), strict=True)
            ]
            for centres in (laws, ridden, half_way(block, k, a, b))
        )
        first[1], end[1] = of_material[0][1], of_material[1][1]
        by_loads = 2.0 * end - start - last if run.method == "moreau" else last - start
        both = np.maximum(norm(end - first), norm(by_loads))
        change = both[0] + both[1] + run.radius[a] * both[2]
        found[mine] = change * (norm(c.impulse[mine]) + norm(c.moment[mine]) / run.radius[a])
    return np.asarray(found + box_energy.unsure(block))


@once
def answered(run: Run) -> F64:
    """(S,) by how much springs, drag and joints may raise the energy in a step beyond their work on record, J."""
    kinetic, h = np.append(at_start(run)[0], run.steps["energy_kinetic"]), run.h
    found = np.zeros(len(kinetic) - 1)
    if run.joints or run.loads:
        second = np.pad(np.abs(np.diff(kinetic, n=2)), 1, mode="edge" if len(kinetic) > 2 else "constant")
        found = found + wrenches.remembered(run, np.maximum(second[1:], second[:-1]))
        motion = np.maximum(kinetic[1:], kinetic[:-1])
        jump = np.where(run.steps["impact_problems"] > 0, h * motion * grip(run), 0.0)
        found = found + 2.0 * (jump + wrenches.remembered(run, np.concatenate([[0.0], jump[:-1]])))
    if run.joints:
        found = found + reactions.unsteady(run)
    return found


def grip(run: Run) -> float:
    """Most power by which an impact can change that of springs and drag, over the kinetic energy `K`, 1/s.

    No end of a damper is faster than `sqrt(2 K) u`, `u = 1/sqrt(m_A) + arm/sqrt(I_A)` and the same of B. So an impact
    changes its force by `2 c sqrt(2 K) u` at most, and its power by `4 c u^2 K`; a spring, whose points it moves for a step,
    by as much with `k h` for `c`.
    """
    found = 0.0
    for load in run.loads:
        if load["kind"] == "drag":
            body = int(load["body"])
            found += 4.0 * (load["translation"] / run.mass[body] + load["rotation"] / run.inertia[body])
        elif load["kind"] == "spring":
            ends = [
                (int(load[side]), norm(np.asarray(load[f"arm_{side}"], dtype=np.float64))) for side in "ab"
            ]
            each = [run.mass[i] ** -0.5 + arm * run.inertia[i] ** -0.5 for i, arm in ends if i >= 0]
            found += 4.0 * (load["damping"] + load["stiffness"] * run.h) * float(sum(each)) ** 2
    return float(found)
